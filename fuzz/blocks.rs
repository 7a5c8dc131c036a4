//! Networks of any list of blocks: refused for a reason, or models that are what their list says.

use super::{Outcome, file_of, inverts, number, numbers, small};
use arbitrary::Unstructured;
use gyroceptron::layer::{
    Activation, CircleAction, MOST_DEGREES, Neuron, Reversor, RidgeFunction, TorusAction,
};
use gyroceptron::measure::ratios::differing_components;
use gyroceptron::network::{
    Architecture, Block, ControlRange, Controls, InitialWeights, Layers, Model, Modules, Part,
    Scale,
};
use gyroceptron::phase::Map;
use gyroceptron::scalar::max_or_nan;

const SCALES: [Scale; 4] = [Scale::None, Scale::Epsilon, Scale::Time, Scale::EpsilonTime];
/// More parameters are not drawn.
const MOST: usize = 4096;
/// Points of more degrees of freedom take too long.
const MOST_DOF: usize = 8;
/// What the checks allow: parameters, planes that are turned, and weights of a circle.
const MOST_PARAMETERS: u128 = 1_000_000_000;
const MOST_PLANES: usize = 1000;
const LARGEST_WEIGHT: u32 = 1_000_000;

/// The list is refused exactly when something is wrong with it, by an error that names it; or it is
/// a model: of as many numbers as its tensors, the composition of its parts, undone by its inverse,
/// the identity at ε = 0 where ε scales it, and the same when read from its file.
pub fn blocks(data: &[u8]) -> Result<Outcome, String> {
    let u = &mut Unstructured::new(data);
    let architecture = architecture(u);
    for block in &architecture.blocks {
        reads_back(block)?;
    }
    let faults = faults(&architecture);
    let count = all_parameters(&architecture);
    if count < 1 << 60 && architecture.parameter_count() as u128 != count {
        return Err(format!("{} parameters for {count}", architecture.parameter_count()));
    }
    let checked = architecture.check();
    if checked.is_ok() && count > MOST as u128 && faults.is_empty() {
        return Ok(Outcome::Accepted);
    }
    // Of a list with faults, the count may be any.
    let count = (count as usize).min(MOST);
    let steady = !u.arbitrary::<u8>().unwrap_or(0).is_multiple_of(4);
    let mut weights = numbers(u, count);
    if steady {
        weights.iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = 0.25);
    }
    let made = Model::new(architecture.clone(), weights.clone());
    let model = match (checked, made, weights.iter().all(|v| v.is_finite())) {
        (Err(reason), Ok(_), _) => return Err(format!("a model, but its check: {reason}")),
        (Err(reason), Err(of_model), finite) => {
            let (reason, of_model) = (reason.to_string(), of_model.to_string());
            if finite && reason != of_model {
                return Err(format!("the check: {reason}; the model: {of_model}"));
            }
            let named = |fault: &Vec<String>| fault.iter().all(|word| reason.contains(word));
            if faults.iter().any(named) {
                return Ok(Outcome::Refused);
            }
            return Err(format!("refused by `{reason}`, with the faults {faults:?}"));
        }
        (Ok(()), _, _) if !faults.is_empty() => {
            return Err(format!("accepted with the faults {faults:?}"));
        }
        (Ok(()), Ok(_), false) => return Err("a model of numbers that are not finite".into()),
        (Ok(()), Err(_), false) => return Ok(Outcome::Refused),
        (Ok(()), Err(reason), true) => {
            let unknown = architecture.blocks.iter().any(|block| block.ridges.is_unbounded());
            return match unknown && reason.to_string().contains("radius") {
                true => Ok(Outcome::Refused),
                false => Err(format!("refused without a cause: {reason}")),
            };
        }
        (Ok(()), Ok(model), true) => model,
    };
    if architecture.dof > MOST_DOF {
        return Ok(Outcome::Accepted);
    }
    let size = |shape: [usize; 2]| shape[0] * shape[1];
    let in_tensors: usize = architecture.tensors().into_iter().map(|(_, shape)| size(shape)).sum();
    if in_tensors != count {
        return Err(format!("tensors of {in_tensors} numbers for {count}"));
    }
    let seed = u64::from(u.arbitrary::<u8>().unwrap_or(0));
    architecture
        .initialise(InitialWeights::Glorot, 1.1, seed)
        .map_err(|reason| format!("no initial weights: {reason}"))?;
    let z = numbers(u, 2 * architecture.dof);
    // At given controls it is a map of none.
    let plain = match &architecture.controls {
        None => model.clone(),
        Some(controls) => {
            let small = weights.iter().all(|v| v.abs() <= 1e3);
            let share =
                if small { f64::from(u.arbitrary::<u8>().unwrap_or(0)) / 255.0 } else { 0.5 };
            let value = |range: &ControlRange| share.mul_add(range.high - range.low, range.low);
            let values: Vec<f64> = match small {
                true => controls.ranges.iter().map(value).collect(),
                false => controls.nominal(),
            };
            model.at_controls(&values).map_err(|reason| format!("at {values:?}: {reason}"))?
        }
    };
    let (of_plain, weights) = (plain.architecture(), plain.parameters());
    let outcome = inverts(&plain, &z, in_range(of_plain, weights, &z))?;
    is_its_parts(&plain, &z)?;
    let scaled = plain.composition().near_identity_part();
    for zero in [0.0, -0.0] {
        if differing_components(&scaled.with_epsilon(zero), &z) > 0 {
            return Err(format!("moved at ε = {zero:?}: {z:?}"));
        }
    }
    file_of(u, model)?;
    Ok(outcome)
}

/// Any count: mostly few, none, about as many planes as are turned at most, or any.
fn count(u: &mut Unstructured<'_>) -> usize {
    match u.arbitrary::<u8>().unwrap_or(1) % 16 {
        0 => 0,
        1 => MOST_PLANES - 1 + small(u, 3),
        2 => u.arbitrary::<u32>().unwrap_or(0) as usize,
        3 => u.arbitrary::<u64>().unwrap_or(0) as usize,
        _ => small(u, 4),
    }
}

fn pick<T: Clone>(u: &mut Unstructured<'_>, of: &[T]) -> T {
    of[usize::from(u.arbitrary::<u8>().unwrap_or(0)) % of.len()].clone()
}

fn layers(u: &mut Unstructured<'_>) -> Layers {
    let kind = u.arbitrary::<u8>().unwrap_or(0) % 6;
    if kind == 4 {
        let (modules, shears) = (count(u), count(u));
        let activation = pick(u, &Activation::ALL);
        return Layers::SympNet(Modules {
            modules,
            shears,
            activation,
            plain: pick(u, &[false, true]),
        });
    }
    let widths: Vec<usize> = (0..small(u, 4) - 1).map(|_| count(u)).collect();
    match kind {
        0 => Layers::Henon(widths),
        1 => Layers::TurnedKick(widths),
        2 => Layers::Twist(widths),
        3 => Layers::TurnedCoupling(widths),
        _ => Layers::TurnedTwist(widths),
    }
}

fn block(u: &mut Unstructured<'_>) -> Block {
    let (part, layers) = (pick(u, &Part::ALL), layers(u));
    let block = Block::new(part, layers);
    let block = match u.arbitrary::<u8>().unwrap_or(0) % 8 {
        0..=3 => block,
        4..=6 => block.named(pick(u, &["", "psi", "near_identity", "0", "a-b", "a.b", "ψ", "\n"])),
        _ => block.named(u.arbitrary::<String>().unwrap_or_default()),
    };
    match u.arbitrary::<u8>().unwrap_or(0) % 2 {
        0 => block,
        _ => block.scaled(pick(u, &SCALES)),
    }
}

/// Neurons, or polynomials in a box of any radius, or of one that is not known yet.
fn ridges(u: &mut Unstructured<'_>) -> RidgeFunction {
    let degree = match u.arbitrary::<u8>().unwrap_or(0) {
        0..=95 => return RidgeFunction::default(),
        96..=127 => return RidgeFunction::Neurons(Neuron::Arctan),
        128..=191 => small(u, 8),
        192..=254 => count(u),
        255 => MOST_DEGREES,
    };
    let radius = match u.arbitrary::<u8>().unwrap_or(0) % 8 {
        0..=3 => 1.3,
        4 => 30.0,
        5 => f64::INFINITY,
        _ => number(u),
    };
    RidgeFunction::Polynomial { degree, radius }
}

fn architecture(u: &mut Unstructured<'_>) -> Architecture {
    let sound = !u.arbitrary::<u8>().unwrap_or(0).is_multiple_of(4);
    let dof = count(u);
    let own = if sound { dof.clamp(1, 3) } else { dof.min(MOST_PLANES + 2) };
    let weight = |u: &mut Unstructured<'_>| match u.arbitrary::<u8>().unwrap_or(0) % 8 {
        0 => u.arbitrary().unwrap_or(0),
        1 => i32::from(u.arbitrary::<i8>().unwrap_or(1)),
        2..=4 => 0,
        _ => 1,
    };
    let circles: Vec<CircleAction> = (0..small(u, 6) - 1)
        .map(|_| {
            let dof = if u.arbitrary::<u8>().unwrap_or(1).is_multiple_of(16) {
                count(u).min(9)
            } else {
                own
            };
            CircleAction::new((0..dof).map(|_| weight(u)).collect::<Vec<_>>())
        })
        .collect();
    let (epsilon, flow_time) = (number(u), number(u));
    let mut blocks: Vec<Block> = (0..small(u, 5) - 1).map(|_| block(u)).collect();
    blocks.iter_mut().for_each(|block| block.ridges = ridges(u));
    let controls = u.arbitrary::<u8>().unwrap_or(0).is_multiple_of(8).then(|| controls(u));
    let controls = controls.filter(|controls| !controls.ranges.is_empty());
    let reversor = match u.arbitrary::<u8>().unwrap_or(0) % 16 {
        0 => Some(Reversor::Positions),
        1 => Some(Reversor::Momenta),
        _ => None,
    };
    let drawn = Architecture { dof, circles, epsilon, flow_time, blocks, reversor, controls };
    if sound { mended(drawn) } else { drawn }
}

/// A list without faults whose steps are shears: neither twists nor couplings.
pub fn of_shears(u: &mut Unstructured<'_>) -> Architecture {
    let mut drawn = mended(architecture(u));
    drawn.controls = None;
    drawn.blocks.retain(|block| {
        !block.layers.kind().commutes_with_circles()
            && !matches!(block.layers, Layers::TurnedCoupling(_))
    });
    drawn
}

/// A few controls, whose names may be the same and whose ranges may be none.
fn controls(u: &mut Unstructured<'_>) -> Controls {
    let range = |u: &mut Unstructured<'_>| ControlRange {
        name: pick(u, &["a", "b", "c", ""]).into(),
        low: number(u),
        high: number(u),
    };
    let ranges = (0..small(u, 4) - 1).map(|_| range(u)).collect();
    Controls { ranges, degree: small(u, 4) - 1 }
}

/// A list without faults, near the one that was drawn: most of those are refused.
fn mended(mut drawn: Architecture) -> Architecture {
    let finite = |value: f64| if value.is_finite() { value } else { 0.5 };
    drawn.dof = drawn.dof.clamp(1, 3);
    (drawn.epsilon, drawn.flow_time) = (finite(drawn.epsilon), finite(drawn.flow_time));
    if let Some(controls) = &mut drawn.controls {
        controls.degree = controls.degree.max(1);
        for (range, name) in controls.ranges.iter_mut().zip(["a", "b", "c", "d"]) {
            range.name = name.into();
            if !(range.low < range.high && (0.5 * (range.high - range.low)).is_normal()) {
                (range.low, range.high) = (-1.0, 1.0);
            }
        }
    }
    let dof = drawn.dof;
    drawn.circles.truncate(4);
    for circle in &mut drawn.circles {
        let of = |j: usize| circle.weights().get(j).map_or(0, |m| m % 7);
        let mut weights: Vec<i32> = (0..dof).map(of).collect();
        if weights.iter().all(|m| *m == 0) {
            weights[0] = 1;
        }
        *circle = CircleAction::new(weights);
    }
    let has = |blocks: &[Block], part: Part| blocks.iter().any(|block| block.part == part);
    if drawn.reversor.is_some() {
        let (allowed, other) = match drawn.circles.is_empty() {
            true => (&[Part::None][..], Part::None),
            false => (&[Part::Chart, Part::SlowMap, Part::Perturbation][..], Part::Chart),
        };
        let others = drawn.blocks.iter_mut().filter(|block| !allowed.contains(&block.part));
        others.for_each(|block| block.part = other);
    }
    let near_identity = has(&drawn.blocks, Part::NearIdentity);
    for (number, block) in drawn.blocks.iter_mut().enumerate() {
        if near_identity && block.part == Part::Perturbation {
            block.part = Part::NearIdentity;
        }
        let of_circles = !matches!(block.part, Part::None | Part::NearIdentity);
        if drawn.circles.is_empty() && of_circles {
            block.part = Part::None;
        }
        let few = |width: usize| (width.max(1) - 1) % 4 + 1;
        let mut widths: Vec<usize> = block.layers.widths().iter().copied().map(few).collect();
        let twist = matches!(block.layers, Layers::Twist(_));
        block.layers = match &block.layers {
            layers if drawn.circles.is_empty() && layers.kind().commutes_with_circles() => {
                Layers::Henon(widths.clone())
            }
            Layers::TurnedTwist(_) => Layers::TurnedTwist(widths.clone()),
            _ if block.part == Part::SlowMap => Layers::Twist(widths.clone()),
            Layers::Henon(_) => Layers::Henon(widths.clone()),
            Layers::TurnedKick(_) => Layers::TurnedKick(widths.clone()),
            Layers::Twist(_) => Layers::Twist(widths.clone()),
            Layers::TurnedCoupling(_) => Layers::TurnedCoupling(widths.clone()),
            Layers::SympNet(of) => {
                Layers::SympNet(Modules { modules: few(of.modules), shears: few(of.shears), ..*of })
            }
        };
        if let (Layers::Twist(own), true) = (&mut block.layers, twist) {
            // Those of momenta may be without neurons.
            widths.iter_mut().step_by(2).for_each(|width| *width -= 1);
            *own = widths;
        }
        let needs_epsilon = matches!(block.part, Part::Perturbation | Part::NearIdentity)
            || (near_identity && matches!(block.part, Part::Chart | Part::SlowMap))
            || (drawn.reversor.is_some() && block.part == Part::Chart);
        if block.part == Part::Conjugation {
            block.scale = Scale::None;
        } else if needs_epsilon && !block.scale.has_epsilon() {
            block.scale = Scale::Epsilon;
        }
        if block.part == Part::NearIdentity && block.scale.has_time() && drawn.flow_time == 0.0 {
            block.scale = Scale::Epsilon;
        }
        block.name = format!("block-{number}");
        block.ridges = match block.ridges {
            _ if matches!(block.layers, Layers::TurnedCoupling(_) | Layers::SympNet(_)) => {
                RidgeFunction::default()
            }
            RidgeFunction::Polynomial { degree, radius } => RidgeFunction::Polynomial {
                degree: few(degree),
                radius: if (1e-3..1e3).contains(&radius) { radius } else { 1.3 },
            },
            neurons => neurons,
        };
    }
    if drawn.blocks.iter().any(|block| block.layers.kind().commutes_with_circles()) {
        let turned = |j: &usize| drawn.circles.iter().any(|c| c.weights()[*j] != 0);
        let fast = (0..dof).filter(turned).count();
        if drawn.circles.len() > fast {
            drawn.circles.truncate(1);
        }
    }
    let of_twists = arguments(&drawn);
    for block in drawn.blocks.iter_mut().filter(|block| block.ridges.is_polynomial()) {
        let twist = block.layers.kind().commutes_with_circles();
        let one = if twist { of_twists == 1 } else { dof == 1 };
        if let Layers::Henon(widths)
        | Layers::TurnedKick(widths)
        | Layers::Twist(widths)
        | Layers::TurnedTwist(widths) = &mut block.layers
        {
            widths.iter_mut().for_each(|h| *h = if one { 1 } else { (*h).max(1) });
        }
    }
    drawn
}

/// The planes that no circle turns.
fn slow_planes(architecture: &Architecture) -> u128 {
    let still = |j: &usize| {
        architecture.circles.iter().all(|c| c.weights().get(*j).is_some_and(|m| *m == 0))
    };
    (0..architecture.dof.min(MOST_PLANES)).filter(still).count() as u128
}

/// d, the numbers that the functions of twists are of.
fn arguments(architecture: &Architecture) -> u128 {
    architecture.circles.len() as u128 + slow_planes(architecture)
}

fn times(factors: &[u128]) -> u128 {
    factors.iter().fold(1, |product, factor| product.saturating_mul(*factor))
}

fn plus(terms: &[u128]) -> u128 {
    terms.iter().fold(0, |sum, term| sum.saturating_add(*term))
}

/// n(n + 1)/2.
fn triangle(n: u128) -> u128 {
    times(&[n, n + 1]) / 2
}

/// The numbers of each block by the layout that `network` documents, and an angle for each circle.
fn parameter_counts(architecture: &Architecture) -> Vec<u128> {
    let (n, d) = (architecture.dof as u128, arguments(architecture));
    let of_block = |block: &Block| -> u128 {
        let each = |count: &dyn Fn(usize, u128) -> u128| {
            let widths = block.layers.widths().iter().enumerate();
            widths.map(|(layer, h)| count(layer, *h as u128)).fold(0, u128::saturating_add)
        };
        let of_ridges = |h: u128, arguments: u128| match block.ridges {
            RidgeFunction::Neurons(_) => times(&[h, arguments + 2]),
            RidgeFunction::Polynomial { degree, .. } => {
                let directions = if arguments > 1 { arguments } else { 0 };
                times(&[h, directions + degree as u128])
            }
        };
        let has_form = !block.ridges.is_polynomial();
        match &block.layers {
            Layers::Henon(_) => each(&|_, h| plus(&[of_ridges(h, n), n])),
            Layers::TurnedKick(_) => each(&|_, h| plus(&[n, of_ridges(h, n)])),
            Layers::Twist(_) => each(&|layer, h| {
                let form = if has_form && layer % 2 == 0 { triangle(d) } else { 0 };
                plus(&[of_ridges(h, d), form])
            }),
            Layers::TurnedTwist(_) => {
                each(&|_, h| plus(&[slow_planes(architecture), of_ridges(h, d)]))
            }
            Layers::TurnedCoupling(_) => each(&|_, h| plus(&[3 * n, times(&[3, n, h]), h])),
            Layers::SympNet(of) => {
                let (modules, shears) = (of.modules as u128, of.shears as u128);
                let last = modules.saturating_sub(1);
                let (translations, factors) = if of.plain { (last, 0) } else { (modules, last) };
                plus(&[
                    times(&[modules, shears, triangle(n)]),
                    times(&[translations, 2 * n]),
                    times(&[factors, n]),
                ])
            }
        }
    };
    let circles = architecture.circles.len() as u128;
    architecture.blocks.iter().map(of_block).chain([circles]).collect()
}

/// Those of all products of controls.
fn all_parameters(architecture: &Architecture) -> u128 {
    let nominal = parameter_counts(architecture).into_iter().fold(0, u128::saturating_add);
    let terms = architecture.controls.as_ref().map_or(1, |controls| {
        let (count, degree) = (controls.ranges.len(), controls.degree);
        (1..=degree).fold(1, |terms, k| terms * (count + k) / k)
    });
    nominal.saturating_mul(terms as u128)
}

/// All that is wrong with a list, each with the words that an error of it has.
fn faults(architecture: &Architecture) -> Vec<Vec<String>> {
    let Architecture { dof, circles, epsilon, flow_time, blocks, reversor, controls } =
        architecture;
    let mut out: Vec<Vec<String>> = Vec::new();
    let mut fault = |is: bool, words: &[&dyn ToString]| {
        if is {
            out.push(words.iter().map(|word| word.to_string()).collect());
        }
    };
    for (name, value) in [("epsilon", epsilon), ("flow_time", flow_time)] {
        fault(!value.is_finite(), &[&name, &format!("{value:?}")]);
    }
    fault(*dof == 0, &[&"degrees of freedom", &0]);
    for circle in circles {
        let weights = circle.weights();
        fault(weights.len() != *dof, &[&"circle action", &weights.len(), dof]);
        for weight in weights {
            fault(weight.unsigned_abs() > LARGEST_WEIGHT, &[&"circle action", weight]);
        }
        fault(weights.iter().all(|m| *m == 0), &[&"circle action", &"all weights 0"]);
    }
    let is_twist = |block: &Block| block.layers.kind().commutes_with_circles();
    let turned = |j: &usize| circles.iter().any(|c| c.weights().get(*j).is_some_and(|m| *m != 0));
    let most = (0..(*dof).min(MOST_PLANES)).filter(turned).count().min(4);
    if let Some(Controls { ranges, degree }) = controls {
        fault(*degree == 0, &[&"controls: degree", &0]);
        for (number, ControlRange { name, low, high }) in ranges.iter().enumerate() {
            fault(name.is_empty(), &[&"name of a control"]);
            for value in [low, high] {
                fault(!value.is_finite(), &[name, &format!("{value:?}")]);
            }
            let extent = low < high && (0.5 * (high - low)).is_normal();
            fault(!extent, &[&"control", name, low, high]);
            let twice = ranges[..number].iter().any(|other| other.name == *name);
            fault(twice, &[&"names of controls", name]);
        }
    }
    let count = all_parameters(architecture);
    fault(count > MOST_PARAMETERS, &[&"parameters"]);
    let first = |part: Part| blocks.iter().find(|block| block.part == part);
    for (number, block) in blocks.iter().enumerate() {
        let Block { name, part, scale, layers, ridges } = block;
        let place = match &name[..] {
            "" => format!("block {number}: "),
            name => format!("block {number} (`{name}`): "),
        };
        let sane = name.chars().all(|c| c.is_ascii_alphanumeric() || "-_".contains(c));
        fault(!sane, &[&place, &"name of a block", name]);
        let of_planes = !matches!(layers, Layers::Henon(_) | Layers::SympNet(_));
        let many_planes = of_planes && *dof > MOST_PLANES;
        fault(many_planes, &[&place, &"planes of", &layers.kind().plural(), dof]);
        let many_circles = is_twist(block) && circles.len() > most;
        fault(many_circles, &[&place, &"circles of the actions of a twist", &circles.len()]);
        if let Layers::SympNet(of) = layers {
            fault(of.modules == 0, &[&place, name, &"linear modules"]);
            fault(of.shears == 0, &[&place, name, &"shears of a linear module"]);
        }
        for (layer, width) in layers.widths().iter().enumerate() {
            let of_form = matches!(layers, Layers::Twist(_)) && !ridges.is_polynomial();
            let empty = *width == 0 && !(of_form && layer % 2 == 0 && *dof > 0);
            fault(empty, &[&place, name, &format!("width 0 (number {layer})")]);
        }
        let none = matches!(layers, Layers::TurnedCoupling(_) | Layers::SympNet(_));
        let of_arctan = *ridges == RidgeFunction::Neurons(Neuron::Arctan);
        fault(none && of_arctan, &[&place, name, &"neurons of arctan in"]);
        if let RidgeFunction::Polynomial { degree, radius } = ridges {
            fault(none, &[&place, name, &"polynomials in"]);
            let fits = (1..=MOST_DEGREES).contains(degree);
            fault(!fits, &[&place, name, &"degree of a polynomial", degree]);
            let square = radius * radius;
            let sizes = [*radius, square, 1.0 / square];
            let is_box = *radius > 0.0 && sizes.iter().all(|size| size.is_normal());
            let known = *radius != f64::INFINITY;
            fault(known && !is_box, &[&place, name, &"radius of the box"]);
            let of = if is_twist(block) { arguments(architecture) } else { *dof as u128 };
            let wide = layers.widths().iter().any(|width| *width > 1);
            fault(wide && of == 1, &[&place, name, &"polynomials of one number"]);
        }
        let of_circles = !matches!(part, Part::None | Part::NearIdentity);
        let alone = circles.is_empty() && (of_circles || is_twist(block));
        fault(alone, &[&place, name, &layers.kind().plural(), &"without a circle action"]);
        let turned = matches!(layers, Layers::TurnedTwist(_)) && layers.count() > 0;
        let none_slow = turned && slow_planes(architecture) == 0;
        fault(none_slow, &[&place, name, &"turned twists, where no plane is slow"]);
        let factor = match scale {
            Scale::None => "1",
            Scale::Epsilon => "ε",
            Scale::Time => "h",
            Scale::EpsilonTime => "εh",
        };
        let scaled = format!("scaled by {factor}");
        fault(*part == Part::Conjugation && *scale != Scale::None, &[&place, name, &scaled]);
        fault(*part == Part::SlowMap && !is_twist(block), &[&place, name, &layers.kind().plural()]);
        let has_epsilon = matches!(scale, Scale::Epsilon | Scale::EpsilonTime);
        let small = matches!(part, Part::Perturbation | Part::NearIdentity);
        fault(small && !has_epsilon, &[&place, name, &scaled]);
        let twice = blocks[..number].iter().any(|other| other.name == *name);
        fault(twice, &[&place, name, &"name: expected a name of its own"]);
        let nameless = name.is_empty() && blocks.len() > 1;
        fault(nameless, &[&place, &"name: expected a name of its own", &blocks.len()]);
        let has_time = matches!(scale, Scale::Time | Scale::EpsilonTime);
        let still = *part == Part::NearIdentity && has_time && *flow_time == 0.0;
        fault(still, &[&place, &"flow_time", &0]);
        if reversor.is_some() && layers.count() > 0 {
            let fits = match part {
                Part::None => circles.is_empty(),
                Part::Chart | Part::Perturbation => has_epsilon,
                Part::SlowMap => true,
                Part::Conjugation | Part::NearIdentity => false,
            };
            fault(!fits, &[&place, &"of a reversible map"]);
        }
        if let Some(near_identity) = first(Part::NearIdentity) {
            let other = *part == Part::Perturbation;
            fault(other, &[&"blocks", &near_identity.name, name]);
            let of_order_one = matches!(part, Part::Chart | Part::SlowMap) && !has_epsilon;
            fault(of_order_one, &[&"blocks", &near_identity.name, name, &"order one"]);
        }
    }
    out
}

/// The table of a block, in JSON and in TOML, whose whole numbers are of 63 bits.
fn reads_back(block: &Block) -> Result<(), String> {
    let json = serde_json::to_string(block).map_err(|e| format!("{block:?} in JSON: {e}"))?;
    let back = serde_json::from_str::<Block>(&json).map_err(|e| format!("{json}: {e}"))?;
    if back != *block {
        return Err(format!("{block:?}, read as {back:?} from {json}"));
    }
    let modules = match &block.layers {
        Layers::SympNet(of) => [of.modules, of.shears],
        _ => [0; 2],
    };
    let mut counts = block.layers.widths().iter().chain(&modules);
    let fits = counts.all(|count| i64::try_from(*count).is_ok());
    match toml::to_string(block) {
        Err(_) if !fits => Ok(()),
        Err(reason) => Err(format!("{block:?} in TOML: {reason}")),
        Ok(text) => match toml::from_str::<Block>(&text) {
            Ok(back) if back == *block => Ok(()),
            back => Err(format!("{block:?}, read as {back:?} from {text}")),
        },
    }
}

/// What is applied: a block, the turn of the circles, or the reflection of a reversible map.
#[derive(Clone, Copy)]
enum Applied {
    Block(usize),
    Turn,
    Reflection,
}

/// What is applied one after the other, or its inverse.
///
/// P = R∘I_ε∘χ∘K_ε∘Φ_θ∘T_ε∘χ⁻¹, χ = ψ∘ψ_ε; P = A∘Φ_θ∘T_ε∘S∘A⁻¹∘S, A = R∘ψ_ε∘K_ε, of a reversible
/// map, where T_ε is a part of A if some planes stand still.
fn order(architecture: &Architecture) -> Vec<(Applied, bool)> {
    let of = |part: Part| {
        let blocks = architecture.blocks.iter().enumerate();
        let own = blocks.filter(move |(_, block)| block.part == part);
        own.map(|(number, _)| (Applied::Block(number), false)).collect::<Vec<_>>()
    };
    let undone =
        |of: &[(Applied, bool)]| of.iter().rev().map(|(what, _)| (*what, true)).collect::<Vec<_>>();
    let chart = [of(Part::Chart), of(Part::Conjugation)].concat();
    let turn = Vec::from_iter((!architecture.circles.is_empty()).then_some((Applied::Turn, false)));
    if architecture.reversor.is_some() {
        let (mut slow, mut half) = (of(Part::SlowMap), Vec::new());
        if slow_planes(architecture) > 0 {
            half.append(&mut slow);
        }
        half.extend([of(Part::Perturbation), of(Part::Chart), of(Part::None)].concat());
        let reflection = vec![(Applied::Reflection, false)];
        return [reflection.clone(), undone(&half), reflection, slow, turn, half].concat();
    }
    [
        undone(&chart),
        of(Part::SlowMap),
        turn,
        of(Part::Perturbation),
        chart,
        of(Part::NearIdentity),
        of(Part::None),
    ]
    .concat()
}

/// Whether the map, and its inverse, is that of networks of one block each, to the bit.
fn is_its_parts(model: &Model, z: &[f64]) -> Result<(), String> {
    let (architecture, weights) = (model.architecture(), model.parameters());
    let counts = parameter_counts(architecture);
    let (angles, mut end) = (&weights[weights.len() - architecture.circles.len()..], 0);
    let mut alone = Vec::new();
    for (block, count) in architecture.blocks.iter().zip(counts) {
        let start = end;
        end += count as usize;
        let only = Block { part: Part::None, ..block.clone() };
        let halved = architecture.reversor.is_some()
            && block.part == Part::SlowMap
            && slow_planes(architecture) > 0;
        let architecture = Architecture {
            blocks: vec![only],
            flow_time: architecture.flow_time / if halved { 2.0 } else { 1.0 },
            reversor: None,
            ..architecture.clone()
        };
        let own = Model::new(architecture, [&weights[start..end], angles].concat());
        alone.push(own.map_err(|reason| format!("{block:?} alone: {reason}"))?.part(Part::None));
    }
    let turn =
        TorusAction::new(architecture.circles.clone()).ok().map(|action| action.turn_by(angles));
    let apply = |map: &dyn Map<f64>, inverse: bool, z: &mut [f64]| match inverse {
        true => map.inverse(z),
        false => map.forward(z),
    };
    for back in [false, true] {
        let mut order = order(architecture);
        if back {
            order.reverse();
        }
        let mut by_parts = z.to_vec();
        for (number, inverse) in order {
            match (number, &turn, architecture.reversor) {
                (Applied::Block(number), ..) => {
                    apply(&alone[number], inverse != back, &mut by_parts);
                }
                (Applied::Turn, Some(turn), _) => apply(turn, inverse != back, &mut by_parts),
                (Applied::Reflection, _, Some(reversor)) => reversor.apply(&mut by_parts),
                _ => {}
            }
        }
        let mut whole = z.to_vec();
        apply(model, back, &mut whole);
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
        if !whole.iter().zip(&by_parts).all(same) {
            return Err(format!("back {back}: {whole:?}, by its parts {by_parts:?}, at {z:?}"));
        }
    }
    Ok(())
}

/// Whether no step can leave the finite numbers on the way there and back: what bounds |z| after
/// each stays small.
fn in_range(architecture: &Architecture, weights: &[f64], z: &[f64]) -> bool {
    const ROOM: f64 = 1e100;
    let size = |v: &[f64]| v.iter().fold(0.0_f64, |m, x| max_or_nan(m, x.abs()));
    let (w, n) = (size(weights).max(1.0), architecture.dof as f64);
    let d = arguments(architecture) as f64;
    let of_circles = architecture.circles.iter().flat_map(CircleAction::weights);
    let m = of_circles.map(|m| f64::from(*m).abs()).fold(1.0, max_or_nan);
    let order = order(architecture);
    let there_and_back = order.iter().chain(order.iter().rev()).chain(&order);
    let mut reach = max_or_nan(size(z), 1.0);
    for (number, _) in there_and_back {
        let Applied::Block(number) = *number else {
            reach *= 2.0;
            continue;
        };
        let Block { scale, layers, ridges, .. } = &architecture.blocks[number];
        let of_epsilon = if scale.has_epsilon() { architecture.epsilon } else { 1.0 };
        let of_time = if scale.has_time() { architecture.flow_time } else { 1.0 };
        let s = (of_epsilon * of_time).abs().max(1.0);
        // The actions stand still during a twist.
        let actions = m * n * reach * reach;
        for width in layers.widths() {
            let mut gain = s * w * w * (*width as f64 + 1.0);
            if let RidgeFunction::Polynomial { degree, radius } = ridges {
                let inverse = 1.0 / radius + 4.0 / (radius * radius);
                let x = (n + d) * w * (1.0 + (actions + reach) * inverse);
                let most = (2.0 * x + 2.0).powi(i32::try_from(*degree).unwrap_or(i32::MAX));
                gain *= (1.0 + radius * inverse) * (n + d) * *degree as f64 * most;
            }
            reach = match layers {
                Layers::Twist(_) => 2.0 * reach + m * (gain + s * d * w * (actions + reach)),
                // Between two turns, which lengthen by 2.
                Layers::TurnedTwist(_) => {
                    8.0 * reach + 8.0 * m * (gain + s * d * w * (actions + reach))
                }
                // One lengthens by 3 and its shift, the turns around it by 2.
                Layers::TurnedCoupling(_) => 12.0 * (reach + gain),
                _ => 4.0 * reach + 8.0 * (gain + w),
            };
        }
        if let Layers::SympNet(of) = layers {
            for _ in 0..of.modules {
                reach *= (1.0 + s * n * w).powi(i32::try_from(of.shears).unwrap_or(i32::MAX));
                reach += 3.0 * s * w;
            }
        }
    }
    reach * w * m * n < ROOM
}
