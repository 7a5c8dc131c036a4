//! What the fuzz targets assert of one input. `cargo test` replays the seeds
//! in `seeds/` through the same functions.
#![allow(dead_code)]

mod blocks;
mod grid;

pub use blocks::blocks;
pub use grid::grid;

use arbitrary::Unstructured;
use gyroceptron::io::{
    Provenance, StoredModel, WeightsFormat, assemble_weights, model_text, parse_model, parse_pairs,
    parse_points, parse_polynomial, parse_tensors, polynomial_text,
};
use gyroceptron::layer::{CircleAction, HenonLayer, TorusAction, layer_parameter_count};
use gyroceptron::measure::{Measurable, fuzz, ratios::differing_components};
use gyroceptron::network::{
    Architecture, CouplingGyroceptronShape, GyroceptronShape, HenonShape, Model, NormalFormShape,
};
use gyroceptron::phase::Units;
use gyroceptron::scalar::max_or_nan;
use gyroceptron::scene::parse;

/// What an input came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The ratio was measured, and is below the limit.
    Tested,
    /// Rounding leaves no digit to test.
    IllConditioned,
    /// The numbers may leave the range of f64.
    OutOfRange,
    /// Refused with an error.
    Refused,
    /// Read, and as it should be.
    Accepted,
}

pub type Property = fn(&[u8]) -> Result<Outcome, String>;

/// Panics where the property does not hold.
pub fn check(property: Property, data: &[u8]) {
    if let Err(reason) = property(data) {
        panic!("{reason}");
    }
}

/// A number of any size: common ones, special ones, any bits.
pub fn number(u: &mut Unstructured<'_>) -> f64 {
    fuzz::number(&mut |bytes| u.fill_buffer(bytes).unwrap_or_default())
}

pub fn numbers(u: &mut Unstructured<'_>, count: usize) -> Vec<f64> {
    (0..count).map(|_| number(u)).collect()
}

pub fn small(u: &mut Unstructured<'_>, most: u8) -> usize {
    usize::from(u.arbitrary::<u8>().unwrap_or(0) % most) + 1
}

/// Whether no step can leave the finite numbers: |z| grows by at most the sum
/// of |ε||w||W| over the neurons in each kick, and |W||z| + |b| + |η| stays
/// finite.
fn in_range(widest: usize, kicks: usize, epsilon: f64, weights: &[f64], z: &[f64]) -> bool {
    const ROOM: f64 = 1e300;
    let size = |v: &[f64]| v.iter().fold(0.0_f64, |m, x| max_or_nan(m, x.abs()));
    let (w, z) = (size(weights), size(z));
    let gain = widest as f64 * w * w * epsilon.abs().max(1.0);
    // A rotation may lengthen a component by √2.
    let reach = 2.0 * (z + w + kicks as f64 * gain);
    gain < ROOM && reach * (1.0 + w) * 8.0 < ROOM
}

/// P⁻¹∘P and P∘P⁻¹ at z. Only a result that is not finite may be put down to
/// numbers out of range.
pub fn inverts(map: &dyn Measurable, z: &[f64], in_range: bool) -> Result<Outcome, String> {
    Ok(match fuzz::inverted(map, z, in_range)? {
        fuzz::Outcome::Tested => Outcome::Tested,
        fuzz::Outcome::IllConditioned => Outcome::IllConditioned,
        fuzz::Outcome::OutOfRange => Outcome::OutOfRange,
    })
}

pub fn epsilon(u: &mut Unstructured<'_>) -> f64 {
    if u.arbitrary().unwrap_or(false) { 1.0 } else { number(u) }
}

pub fn henon_layer(data: &[u8]) -> Result<Outcome, String> {
    let u = &mut Unstructured::new(data);
    let (dof, width) = (small(u, 4), small(u, 8));
    let z = numbers(u, 2 * dof);
    let epsilon = epsilon(u);
    let weights = numbers(u, layer_parameter_count(dof, width));
    let layer = HenonLayer::new(dof, width, epsilon, &weights);
    let range = in_range(width, 8, epsilon, &weights, &z) && epsilon.is_finite();
    let outcome = inverts(&layer, &z, range)?;
    // The single map whose fourth iterate it is.
    inverts(&layer.map(), &z, range)?;
    Ok(outcome)
}

fn net(u: &mut Unstructured<'_>, epsilon: f64) -> Result<Outcome, String> {
    let dof = small(u, 4);
    let widths: Vec<usize> = (0..small(u, 4)).map(|_| small(u, 6)).collect();
    let shape = HenonShape { dof, widths: widths.clone() };
    let z = numbers(u, 2 * dof);
    let weights = numbers(u, shape.architecture(0.0).parameter_count());
    let architecture = shape.architecture(epsilon);
    let finite = weights.iter().chain([&epsilon]).all(|v| v.is_finite());
    let model = match Model::new(architecture, weights.clone()) {
        Ok(model) if finite => model,
        Ok(_) => return Err("a model of numbers that are not finite".into()),
        Err(_) if !finite => return Ok(Outcome::Refused),
        Err(reason) => return Err(format!("refused without a cause: {reason}")),
    };
    let widest = widths.iter().copied().max().unwrap_or(0);
    let range = in_range(widest, 8 * widths.len(), epsilon, &weights, &z);
    let outcome = inverts(&model, &z, range)?;
    // At ε = 0 nothing moves, whatever the weights.
    for zero in [0.0, -0.0] {
        if differing_components(&model.with_epsilon(zero), &z) > 0 {
            return Err(format!("moved at ε = {zero:?}: {z:?}"));
        }
    }
    Ok(outcome)
}

pub fn henon_net(data: &[u8]) -> Result<Outcome, String> {
    net(&mut Unstructured::new(data), 1.0)
}

pub fn near_identity(data: &[u8]) -> Result<Outcome, String> {
    let u = &mut Unstructured::new(data);
    let epsilon = number(u);
    net(u, epsilon)
}

pub fn circle_action(data: &[u8]) -> Result<Outcome, String> {
    let u = &mut Unstructured::new(data);
    let dof = small(u, 4);
    let weights: Vec<i32> = (0..dof)
        .map(|_| match u.arbitrary::<u8>().unwrap_or(0) % 8 {
            0..=5 => i32::from(u.arbitrary::<i8>().unwrap_or(0)),
            6 => 0,
            _ => u.arbitrary().unwrap_or(0),
        })
        .collect();
    let theta = number(u);
    let z = numbers(u, 2 * dof);
    let rotation = CircleAction::new(weights.clone()).turn_by(theta);
    let largest = weights.iter().map(|w| f64::from(*w).abs()).fold(1.0, max_or_nan);
    let range = in_range(0, 0, 0.0, &[], &z) && (theta * largest).is_finite();
    inverts(&rotation, &z, range)
}

pub fn gyroceptron(data: &[u8]) -> Result<Outcome, String> {
    let u = &mut Unstructured::new(data);
    let dof = small(u, 3);
    let action: Vec<i32> = (0..dof).map(|_| i32::from(u.arbitrary::<i8>().unwrap_or(1))).collect();
    let layers = |u: &mut Unstructured<'_>| -> Vec<usize> {
        (0..small(u, 3)).map(|_| small(u, 5)).collect()
    };
    let (psi, near_identity) = (layers(u), layers(u));
    let epsilon = number(u);
    let kicks = 8 * (2 * psi.len() + near_identity.len());
    let widest = psi.iter().chain(&near_identity).copied().max().unwrap_or(0);
    let shape =
        GyroceptronShape { circle_action: CircleAction::new(action.clone()), psi, near_identity };
    let z = numbers(u, 2 * dof);
    let weights = numbers(u, shape.architecture(0.0).parameter_count());
    let finite = weights.iter().chain([&epsilon]).all(|v| v.is_finite());
    let acts = action.iter().any(|m| *m != 0);
    let model = match Model::new(shape.architecture(epsilon), weights.clone()) {
        Ok(model) if finite && acts => model,
        Ok(_) => return Err("a model that should have been refused".into()),
        Err(_) if !(finite && acts) => return Ok(Outcome::Refused),
        Err(reason) => return Err(format!("refused without a cause: {reason}")),
    };
    let range = in_range(widest, kicks, epsilon, &weights, &z);
    let outcome = inverts(&model, &z, range)?;
    if differing_components(&model.near_identity().with_epsilon(0.0), &z) > 0 {
        return Err(format!("moved at ε = 0: {z:?}"));
    }
    Ok(outcome)
}

/// A gyroceptron in normal form, or a nearly-integrable map: several circles, any flow time, any of its
/// parts left out.
pub fn normal_form(data: &[u8]) -> Result<Outcome, String> {
    let u = &mut Unstructured::new(data);
    let dof = small(u, 4);
    let circles: Vec<CircleAction> = (0..small(u, 3))
        .map(|_| {
            let weights = (0..dof).map(|_| i32::from(u.arbitrary::<i8>().unwrap_or(1) % 4));
            CircleAction::new(weights.collect::<Vec<_>>())
        })
        .collect();
    let action = TorusAction::new(circles).map_err(|reason| reason.to_string())?;
    let layers = |u: &mut Unstructured<'_>, width: u8| -> Vec<usize> {
        (0..small(u, 4) - 1).map(|_| small(u, width)).collect()
    };
    let (psi, kicks) = (layers(u, 4), layers(u, 6));
    // Those of momenta may be without neurons.
    let twists: Vec<usize> =
        (0..small(u, 5) - 1).map(|k| small(u, 6 + (k + 1) as u8 % 2) - (k + 1) % 2).collect();
    let (flow_time, epsilon) = (number(u), number(u));
    let turned_twists = layers(u, 6);
    let perturbed = u.arbitrary::<u8>().unwrap_or(0) % 2 == 1;
    let perturbation = perturbed.then(|| layers(u, 6));
    let z = numbers(u, 2 * dof);
    let most = action.circles().iter().flat_map(CircleAction::weights).map(|m| m.abs()).max();
    let perturbing = perturbation.iter().flatten();
    let slow = twists.iter().chain(&turned_twists);
    let widths = psi.iter().chain(&kicks).chain(slow.clone()).chain(perturbing.clone());
    let widest = widths.copied().fold(1, usize::max);
    let steps = 16 * psi.len() + 2 * kicks.len() + slow.count() + perturbing.count();
    let turned = (0..dof).filter(|&j| action.circles().iter().any(|c| c.weights()[j] != 0));
    let acts = |circle: &CircleAction| circle.weights().iter().any(|m| *m != 0);
    let slow_ones = turned_twists.is_empty() || turned.clone().count() < dof;
    let sound = slow_ones
        && (1..=turned.count()).contains(&action.circles().len())
        && action.circles().iter().all(acts);
    let shape =
        NormalFormShape { action, psi, kicks, twists, turned_twists, flow_time, perturbation };
    let weights = numbers(u, shape.architecture(0.0).parameter_count());
    let finite = weights.iter().chain([&epsilon, &flow_time]).all(|v| v.is_finite());
    let model = match Model::new(shape.architecture(epsilon), weights.clone()) {
        Ok(model) if finite && sound => model,
        Ok(_) => return Err("a model that should have been refused".into()),
        Err(_) if !(finite && sound) => return Ok(Outcome::Refused),
        Err(reason) => return Err(format!("refused without a cause: {reason}")),
    };
    // A twist moves by εh of its gradient, which is one of the actions, of squares.
    let factor = epsilon.abs().max(1.0) * flow_time.abs().max(1.0);
    let size = |v: &[f64]| v.iter().fold(0.0_f64, |m, x| max_or_nan(m, x.abs()));
    let (w, m) = (size(&weights).max(1.0), f64::from(most.unwrap_or(1).max(1)));
    let gain = (widest * steps) as f64 * factor * w * w * m * dof as f64;
    let reach = 4.0 * (size(&z) + w + gain);
    let range = gain * reach < 1e150
        && reach * w * m < 1e140
        && in_range(widest, steps, factor, &weights, &z);
    let outcome = inverts(&model, &z, range)?;
    let scaled = model.composition().near_identity_part();
    if differing_components(&scaled.with_epsilon(0.0), &z) > 0 {
        return Err(format!("moved at ε = 0: {z:?}"));
    }
    Ok(outcome)
}

pub fn coupling_gyroceptron(data: &[u8]) -> Result<Outcome, String> {
    let u = &mut Unstructured::new(data);
    let dof = small(u, 3);
    let action: Vec<i32> = (0..dof).map(|_| i32::from(u.arbitrary::<i8>().unwrap_or(1))).collect();
    let layers = |u: &mut Unstructured<'_>| -> Vec<usize> {
        (0..small(u, 4) - 1).map(|_| small(u, 5)).collect()
    };
    let (psi, near_identity) = (layers(u), layers(u));
    let (flow_time, epsilon) = (number(u), number(u));
    let z = numbers(u, 2 * dof);
    let couplings = 2 * psi.len() + near_identity.len();
    let acts = action.iter().any(|m| *m != 0);
    let shape = CouplingGyroceptronShape {
        circle_action: CircleAction::new(action),
        psi,
        near_identity,
        flow_time,
    };
    let weights = numbers(u, shape.architecture(0.0).parameter_count());
    let finite = weights.iter().chain([&epsilon, &flow_time]).all(|v| v.is_finite());
    let sound = finite && acts && flow_time != 0.0;
    let architecture = shape.architecture(epsilon);
    let model = match Model::new(architecture, weights.clone()) {
        Ok(model) if sound => model,
        Ok(_) => return Err("a model that should have been refused".into()),
        Err(_) if !sound => return Ok(Outcome::Refused),
        Err(reason) => return Err(format!("refused without a cause: {reason}")),
    };
    // A coupling lengthens by 3 and its shift, the turns around it by 2; five neurons and a bias.
    let size = |v: &[f64]| v.iter().fold(0.0_f64, |m, x| max_or_nan(m, x.abs()));
    let (w, scale) = (size(&weights).max(1.0), (epsilon * flow_time).abs().max(1.0));
    let reach = 6_f64.powi(couplings as i32 + 1) * (size(&z) + scale * w * 6.0);
    let range = reach * w * 8.0 < 1e150 && scale * w < 1e150;
    let outcome = inverts(&model, &z, range)?;
    let scaled = model.composition().near_identity_part();
    if differing_components(&scaled.with_epsilon(0.0), &z) > 0 {
        return Err(format!("moved at ε = 0: {z:?}"));
    }
    Ok(outcome)
}

/// A model file: raw bytes, or the file of a drawn model, written, read and
/// compared, then read again with one byte changed.
pub fn model(data: &[u8]) -> Result<Outcome, String> {
    let u = &mut Unstructured::new(data);
    if data.first().is_some_and(|b| b.is_ascii()) {
        if let Ok(read) = parse_polynomial("map.json", data) {
            let point = vec![0.1; 2 * read.map.map().dof()];
            let _ = (read.map.with_jacobian(&point), read.map.inverted().with_jacobian(&point));
            let text = polynomial_text(&read).map_err(|e| e.to_string())?;
            let again = parse_polynomial("map.json", text.as_bytes()).map_err(|e| e.to_string())?;
            let same = polynomial_text(&again).map_err(|e| e.to_string())? == text;
            return if same { Ok(Outcome::Accepted) } else { Err("another polynomial".into()) };
        }
        return match parse_model("model.json", data) {
            Err(_) => Ok(Outcome::Refused),
            Ok(stored) => same_again(&stored),
        };
    }
    let shape = HenonShape { dof: small(u, 3), widths: vec![small(u, 4); small(u, 3)] };
    let weights = numbers(u, shape.architecture(0.0).parameter_count());
    let architecture = shape.architecture(number(u));
    let Ok(model) = Model::new(architecture, weights) else { return Ok(Outcome::Refused) };
    file_of(u, model)
}

/// The file of a model, in drawn units: read again to the same, and with one byte changed to none,
/// or to the same but for its provenance.
fn file_of(u: &mut Unstructured<'_>, model: Model) -> Result<Outcome, String> {
    let dim = 2 * model.composition().dof();
    let factors = vec![number(u); dim];
    let units = match u.arbitrary() {
        Ok(true) => Units::new(numbers(u, dim), factors).ok(),
        _ => None,
    };
    let stored =
        StoredModel { model, units, section: None, provenance: Provenance::of_scene("fuzz") };
    let outcome = same_again(&stored)?;
    let mut bytes = model_text(&stored).map_err(|e| e.to_string())?.into_bytes();
    let at = u.arbitrary::<u32>().unwrap_or(0) as usize % bytes.len();
    bytes[at] = u.arbitrary().unwrap_or(b'9');
    if let Ok(changed) = parse_model("model.json", &bytes) {
        // Then only the provenance and the spacing can be others.
        is_same(&stored, &changed).map_err(|what| format!("byte {at}: {what}, and no word"))?;
    }
    Ok(outcome)
}

fn bits(model: &Model) -> Vec<u64> {
    model.composition().parameters().iter().map(|v| v.to_bits()).collect()
}

fn same_again(stored: &StoredModel) -> Result<Outcome, String> {
    let text = model_text(stored).map_err(|e| format!("a model that cannot be written: {e}"))?;
    let back =
        parse_model("model.json", text.as_bytes()).map_err(|e| format!("its own file: {e}"))?;
    is_same(stored, &back).map_err(|what| format!("{what} came back"))?;
    if back.provenance != stored.provenance {
        return Err("another provenance came back".into());
    }
    Ok(Outcome::Accepted)
}

/// Whether two are the same to the bit, but for where they come from.
fn is_same(one: &StoredModel, other: &StoredModel) -> Result<(), String> {
    let of_units = |stored: &StoredModel| -> Option<Vec<u64>> {
        let units = stored.units.as_ref()?;
        Some(units.centre().iter().chain(units.factors()).map(|v| v.to_bits()).collect())
    };
    let numbers = |of: &Architecture| [of.epsilon.to_bits(), of.flow_time.to_bits()];
    let (a, b) = (one.model.architecture(), other.model.architecture());
    match () {
        () if a != b || numbers(a) != numbers(b) => Err("another architecture".into()),
        () if bits(&one.model) != bits(&other.model) => Err("other parameters".into()),
        () if of_units(one) != of_units(other) => Err("other units".into()),
        () => Ok(()),
    }
}

pub fn scene(data: &[u8]) -> Result<Outcome, String> {
    let Ok(text) = std::str::from_utf8(data) else { return Ok(Outcome::Refused) };
    match parse("scene.toml", text) {
        Err(reason) if reason.to_string().is_empty() => Err("an error without a word".into()),
        Err(_) => Ok(Outcome::Refused),
        Ok(scene) => {
            // Either an experiment or a word why it is none.
            if let Err(reason) = scene.complete()
                && reason.to_string().is_empty()
            {
                return Err("an error without a word".into());
            }
            Ok(Outcome::Accepted)
        }
    }
}

/// Archives of pairs and of weights, and, behind them, single arrays.
pub fn npz(data: &[u8]) -> Result<Outcome, String> {
    if let Ok(points) = parse_points("z.npy", data, 2)
        && (points.points.is_empty() || points.points.iter().any(|v| !v.is_finite()))
    {
        return Err("points that are none".into());
    }
    tensors(WeightsFormat::Npz, data)?;
    match parse_pairs("pairs.npz", data.to_vec()) {
        Err(_) => Ok(Outcome::Refused),
        Ok(file) => {
            let pairs = file.pairs;
            let sound = !pairs.is_empty()
                && pairs.input().len() == pairs.output().len()
                && pairs.input().len() == 2 * pairs.dof() * pairs.len()
                && pairs.input().iter().chain(pairs.output()).all(|v| v.is_finite());
            if sound { Ok(Outcome::Accepted) } else { Err("pairs that are none".into()) }
        }
    }
}

pub fn safetensors(data: &[u8]) -> Result<Outcome, String> {
    tensors(WeightsFormat::Safetensors, data)
}

fn tensors(format: WeightsFormat, data: &[u8]) -> Result<Outcome, String> {
    let Ok(tensors) = parse_tensors("weights", format, data.to_vec()) else {
        return Ok(Outcome::Refused);
    };
    for (name, tensor) in &tensors {
        if tensor.shape.iter().product::<usize>() != tensor.values.len() {
            return Err(format!("{name}: {:?} of {}", tensor.shape, tensor.values.len()));
        }
    }
    match assemble_weights("weights", tensors, &CircleAction::new([1, 0]).into(), 0.01, None) {
        Err(_) => Ok(Outcome::Refused),
        Ok(model) if bits(&model).len() == model.architecture().parameter_count() => {
            Ok(Outcome::Accepted)
        }
        Ok(_) => Err("a model of another size".into()),
    }
}

/// The targets by name.
pub const TARGETS: [(&str, Property); 13] = [
    ("henon_layer", henon_layer),
    ("henon_net", henon_net),
    ("near_identity", near_identity),
    ("circle_action", circle_action),
    ("gyroceptron", gyroceptron),
    ("normal_form", normal_form),
    ("coupling_gyroceptron", coupling_gyroceptron),
    ("blocks", blocks),
    ("grid", grid),
    ("model", model),
    ("scene", scene),
    ("npz", npz),
    ("safetensors", safetensors),
];
