//! Weights of other programs: `.safetensors` and `.npz` files with documented names.
//!
//! Layers are numbered from 0 in the order of application; numbers are float32 or float64.
//!
//! - A gyroceptron has `psi.{i}.w_in` (n, h), `psi.{i}.b_in` (1, h), `psi.{i}.w_out` (h, 1) and `psi.{i}.eta` (1, n),
//!   the same under `near_identity.{i}.`, and `theta` (one element). A HénonNet has `henon.{i}.…` only.
//! - A gyroceptron in normal form has `kick.{i}.angles` (1, n), `kick.{i}.w_in` (n, h), `kick.{i}.b_in` and
//!   `kick.{i}.w_out`; `twist.{i}.w_in` (d, h; the rows of the actions first), `twist.{i}.b_in`, `twist.{i}.w_out`
//!   and, for even i, `twist.{i}.quadratic` (1, d(d + 1)/2; the rows of the upper triangle of Q);
//!   `turned_twist.{i}.angles` (1, slow planes) with `w_in`, `b_in` and `w_out` as for twists; `theta` (an angle for
//!   each circle); and `psi.{i}.…` if it has a ψ. One that is nearly integrable also has `perturbation.{i}.…`, as for
//!   kicks, and `perturbation` (1), their number.
//! - A gyroceptron of couplings has `angles` (1, n), `w_in` (n, h), `b_in` (1, h), `w_scale` (n, h), `b_scale`
//!   (1, n), `w_shift` (n, h) and `b_shift` (1, n) under `psi.{i}.` and `near_identity.{i}.`, and `theta`.
//!
//! If the data has units of its own, they are `units.centre` and `units.factors`, (1, 2n) each: z = centre +
//! factors·w, where w are the coordinates of the network.
//!
//! A file that is exported also has the architecture in JSON, which tells what names cannot: arrangements of blocks of
//! your own, polynomials, controls.

use super::arrays::{Archive, write_archive_of};
use super::tensor::Tensor;
use super::{read_bytes, tensor_bundle, write_atomically};
use crate::error::Error;
use crate::layer::{CircleAction, TorusAction};
use crate::network::{
    Architecture, CouplingGyroceptronShape, GyroceptronShape, Model, NormalFormShape, Part,
};
use crate::phase::Units;
use safetensors::tensor::{Dtype, TensorView};
use safetensors::{SafeTensors, serialize};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// The file formats of weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WeightsFormat {
    /// The format of `.safetensors` files.
    Safetensors,
    /// The format of `.npz` archives of NumPy.
    Npz,
}

impl WeightsFormat {
    /// The format that the ending of a file name says.
    fn of(path: &Path) -> Result<Self, Error> {
        match path.extension().and_then(|e| e.to_str()) {
            Some("safetensors") => Ok(Self::Safetensors),
            Some("npz") => Ok(Self::Npz),
            other => Err(Error::content(
                path.display(),
                "a file ending in .safetensors or .npz",
                other.map_or("no ending".into(), |e| format!(".{e}")),
            )),
        }
    }
}

/// The tensors, by name, of a `.safetensors` or `.npz` file, or of a TensorFlow checkpoint. Of the latter the path is
/// that of its `.index` file, and the numbers are in a file beside it.
///
/// # Errors
/// When the file is missing or corrupt, of another ending, or a tensor is not
/// float32 or float64.
pub fn read_tensors(path: &Path) -> Result<BTreeMap<String, Tensor>, Error> {
    if tensor_bundle::is_index(path) {
        return tensor_bundle::read(path);
    }
    let format = WeightsFormat::of(path)?;
    parse_tensors(&path.display().to_string(), format, read_bytes(path)?)
}

/// Reads the tensors in the bytes of a file; `place` names it in errors.
///
/// # Errors
/// Those of [`read_tensors`].
pub fn parse_tensors(
    place: &str,
    format: WeightsFormat,
    bytes: Vec<u8>,
) -> Result<BTreeMap<String, Tensor>, Error> {
    match format {
        WeightsFormat::Safetensors => from_safetensors(place, &bytes),
        WeightsFormat::Npz => from_npz(place, bytes),
    }
}

fn from_safetensors(place: &str, bytes: &[u8]) -> Result<BTreeMap<String, Tensor>, Error> {
    let file = SafeTensors::deserialize(bytes)
        .map_err(|reason| Error::content(place, "a .safetensors file", reason))?;
    let mut tensors = BTreeMap::new();
    for (name, view) in file.tensors() {
        let data = view.data();
        let values = match view.dtype() {
            Dtype::F64 => data.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect(),
            Dtype::F32 => {
                data.as_chunks::<4>().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect()
            }
            other => {
                return Err(Error::content(
                    format!("{place}: {name}"),
                    "float32 or float64",
                    format!("{other:?}"),
                ));
            }
        };
        tensors.insert(
            name,
            Tensor {
                shape: view.shape().to_vec(),
                values,
                single_precision: view.dtype() == Dtype::F32,
            },
        );
    }
    Ok(tensors)
}

fn from_npz(place: &str, bytes: Vec<u8>) -> Result<BTreeMap<String, Tensor>, Error> {
    let mut archive = Archive::open(place, bytes)?;
    let mut tensors = BTreeMap::new();
    for name in archive.names().into_iter().filter(|name| name != ARCHITECTURE) {
        let array = archive.array(&name)?;
        tensors.insert(
            name,
            Tensor { shape: array.shape, values: array.values, single_precision: array.single },
        );
    }
    Ok(tensors)
}

/// The widths of a block's layers, read off the tensors `{block}.{i}.w_in`; none where there is no
/// such block.
fn widths(
    place: &str,
    tensors: &BTreeMap<String, Tensor>,
    block: &str,
    arguments: usize,
) -> Result<Vec<usize>, Error> {
    let layer = |name: &String| {
        let rest = name.strip_prefix(block)?.strip_prefix('.')?;
        let (number, of) = rest.split_once('.')?;
        Some((number.parse::<usize>().ok()?, of.to_owned()))
    };
    let layers: Vec<(usize, String)> = tensors.keys().filter_map(layer).collect();
    let last = layers.iter().filter(|(_, of)| of == "w_in").map(|(number, _)| *number).max();
    let mut count = last.map_or(0, |last| last.saturating_add(1));
    // What is left of a last layer is one that lacks it.
    count += usize::from(layers.iter().any(|(number, _)| *number == count));
    let width = |layer: usize| {
        let name = format!("{block}.{layer}.w_in");
        let place = format!("{place}: {name}");
        let Some(tensor) = tensors.get(&name) else {
            return Err(Error::content(place, "a tensor of that name", "none"));
        };
        match tensor.shape[..] {
            [rows, width] if rows == arguments => Ok(width),
            _ => {
                let expected = format!("shape ({arguments}, h)");
                Err(Error::content(place, expected, format!("shape {:?}", tensor.shape)))
            }
        }
    };
    (0..count).map(width).collect()
}

/// Reads the weights of a gyroceptron with these circles at ε: see [`assemble_weights`].
///
/// # Errors
/// When a tensor is missing, superfluous or of another shape, or the file
/// cannot be read.
pub fn import_weights(
    path: &Path,
    action: &TorusAction,
    epsilon: f64,
    flow_time: Option<f64>,
) -> Result<Model, Error> {
    assemble_weights(&path.display().to_string(), read_tensors(path)?, action, epsilon, flow_time)
}

/// The architecture that [`export_weights`] has written into a file, if it has one.
///
/// # Errors
/// When the file cannot be read, or its architecture is none.
pub fn read_architecture(path: &Path) -> Result<Option<Architecture>, Error> {
    if tensor_bundle::is_index(path) {
        return Ok(None);
    }
    let (place, format) = (path.display().to_string(), WeightsFormat::of(path)?);
    let bytes = read_bytes(path)?;
    let text = match format {
        WeightsFormat::Safetensors => {
            let (_, metadata) = SafeTensors::read_metadata(&bytes)
                .map_err(|reason| Error::content(&place, "a .safetensors file", reason))?;
            metadata.metadata().as_ref().and_then(|of| of.get(ARCHITECTURE)).cloned()
        }
        WeightsFormat::Npz => {
            let mut archive = Archive::open(&place, bytes)?;
            let has_one = archive.names().iter().any(|name| name == ARCHITECTURE);
            has_one.then(|| archive.text(ARCHITECTURE)).transpose()?
        }
    };
    let parse = |text: String| -> Result<Architecture, Error> {
        let place = format!("{place}: {ARCHITECTURE}");
        let architecture: Architecture = serde_json::from_str(&text)
            .map_err(|reason| Error::content(&place, "an architecture", reason))?;
        architecture.check().map_err(|e| e.with_place(&place))?;
        Ok(architecture)
    };
    text.map(parse).transpose()
}

/// The name of the architecture, in JSON: among the metadata of a `.safetensors` file, as a text in an `.npz` file.
const ARCHITECTURE: &str = "architecture";

/// Which named gyroceptron tensors are of, by their names.
enum Recognised {
    Gyroceptron,
    NormalForm,
    Couplings,
}

impl Recognised {
    fn of(tensors: &BTreeMap<String, Tensor>) -> Self {
        let is_of_one = |name: &String| {
            ["kick.", "twist.", "turned_twist.", PERTURBATION]
                .iter()
                .any(|part| name.starts_with(part))
        };
        if tensors.keys().any(|name| name.ends_with(".w_scale")) {
            Self::Couplings
        } else if tensors.keys().any(is_of_one) {
            Self::NormalForm
        } else {
            Self::Gyroceptron
        }
    }

    fn words(&self) -> &'static str {
        match self {
            Self::Gyroceptron => "a gyroceptron",
            Self::NormalForm => "a gyroceptron in normal form",
            Self::Couplings => "a gyroceptron of couplings",
        }
    }
}

/// Makes a gyroceptron with these circles at ε from tensors in memory; `place` names them in errors. A flow time is
/// needed for a network in normal form, which has tensors `kick.…`, `twist.…` or `turned_twist.…`, and for one of
/// couplings, which has `….w_scale`; other networks have none.
///
/// # Errors
/// When a tensor is missing, superfluous or of another shape; when the flow time is missing,
/// superfluous, or not positive; when there are several circles and it is not in normal form.
pub fn assemble_weights(
    place: &str,
    mut tensors: BTreeMap<String, Tensor>,
    action: &TorusAction,
    epsilon: f64,
    flow_time: Option<f64>,
) -> Result<Model, Error> {
    let (dof, kind) = (action.dof(), Recognised::of(&tensors));
    let time = match (flow_time, &kind) {
        (Some(time), Recognised::Gyroceptron) => {
            let expected = "none: gyroceptrons in normal form and of couplings have one";
            return Err(Error::invalid("flow_time", time, expected));
        }
        (None, Recognised::Gyroceptron) => 1.0,
        (Some(time), _) if !(time > 0.0 && time.is_finite()) => {
            return Err(Error::invalid("flow_time", time, "a positive number"));
        }
        (Some(time), _) => time,
        (None, _) => {
            let (place, needed_by) = (place.into(), kind.words().into());
            return Err(Error::Missing { place, key: "flow_time", needed_by });
        }
    };
    let circle = || match action.circles() {
        [circle] => Ok(circle.clone()),
        circles => {
            let expected = format!("one circle, of {}", kind.words());
            Err(Error::invalid("circle action", format!("{} circles", circles.len()), expected))
        }
    };
    let parts =
        [widths(place, &tensors, "psi", dof)?, widths(place, &tensors, "near_identity", dof)?];
    let [psi, near_identity] = parts;
    let architecture = match kind {
        Recognised::Gyroceptron => {
            for (block, widths) in [("psi", &psi), ("near_identity", &near_identity)] {
                if widths.is_empty() {
                    let place = format!("{place}: {block}.0.w_in");
                    return Err(Error::content(place, "a tensor", "none"));
                }
            }
            GyroceptronShape { circle_action: circle()?, psi, near_identity }.architecture(epsilon)
        }
        Recognised::Couplings => {
            let (circle_action, flow_time) = (circle()?, time);
            CouplingGyroceptronShape { circle_action, psi, near_identity, flow_time }
                .architecture(epsilon)
        }
        Recognised::NormalForm => {
            let kicks = widths(place, &tensors, "kick", dof)?;
            let perturbation = widths(place, &tensors, PERTURBATION, dof)?;
            let perturbation = match tensors.remove(PERTURBATION) {
                Some(count) if count.values != [perturbation.len() as f64] => {
                    let place = format!("{place}: {PERTURBATION}");
                    let found = format!("{:?}", count.values);
                    return Err(Error::content(place, format!("[{}]", perturbation.len()), found));
                }
                Some(_) => Some(perturbation),
                None if perturbation.is_empty() => None,
                None => {
                    let place = format!("{place}: {PERTURBATION}");
                    return Err(Error::content(place, "a tensor of that name", "none"));
                }
            };
            let of = |circle: &CircleAction, j: usize| circle.weights()[j] == 0;
            let slow = |j: &usize| action.circles().iter().all(|circle| of(circle, *j));
            let arguments = action.circles().len() + (0..dof).filter(slow).count();
            let twists = widths(place, &tensors, "twist", arguments)?;
            let turned_twists = widths(place, &tensors, "turned_twist", arguments)?;
            let (action, flow_time) = (action.clone(), time);
            NormalFormShape { action, psi, kicks, twists, turned_twists, flow_time, perturbation }
                .architecture(epsilon)
        }
    };
    assemble_architecture(place, tensors, architecture)
}

/// The network of this architecture with these tensors and no others.
///
/// # Errors
/// When a tensor is missing, superfluous or of another shape, or the architecture cannot be.
pub fn assemble_architecture(
    place: &str,
    mut tensors: BTreeMap<String, Tensor>,
    architecture: Architecture,
) -> Result<Model, Error> {
    // Before anything of its size is allocated.
    architecture.check().map_err(|e| e.with_place(place))?;
    if architecture.part(Part::Perturbation).next().is_some() {
        tensors.remove(PERTURBATION);
    }
    let mut parameters = Vec::with_capacity(architecture.parameter_count());
    let angles = architecture.circles.len();
    let mut take = |name: &str, shape: Option<[usize; 2]>| -> Result<(), Error> {
        let place = format!("{place}: {name}");
        let tensor = tensors
            .remove(name)
            .ok_or_else(|| Error::content(&place, "a tensor of that name", "none"))?;
        let fits = match shape {
            Some(shape) => tensor.shape == shape,
            None => tensor.values.len() == angles,
        };
        if !fits {
            let elements = || match angles {
                1 => "one element".into(),
                several => format!("{several} elements"),
            };
            let expected = shape.map_or_else(elements, |[r, c]| format!("shape [{r}, {c}]"));
            return Err(Error::content(&place, expected, format!("shape {:?}", tensor.shape)));
        }
        let columns = tensor.shape.last().copied().unwrap_or(1).max(1);
        crate::flow::check_finite(&place, &tensor.values, columns)?;
        parameters.extend(tensor.values);
        Ok(())
    };
    for (name, shape) in architecture.tensors() {
        // θ may come as a number or as an array of any shape.
        take(&name, (name != "theta").then_some(shape))?;
    }
    if let Some(name) = tensors.keys().next() {
        return Err(Error::content(
            format!("{place}: {name}"),
            "no other tensor than the network's",
            format!("{} superfluous", tensors.len()),
        ));
    }
    Model::new(architecture, parameters)
}

/// The name of the block of turned kicks of a map which is nearly integrable, and of the tensor that says so: how many
/// turned kicks its perturbation has.
const PERTURBATION: &str = "perturbation";

/// The names of the tensors of units.
const UNITS: [&str; 2] = ["units.centre", "units.factors"];

/// Takes the tensors of units out, if there are any; `place` names them in errors.
///
/// # Errors
/// When one of both is missing, they are not of 2n numbers, or no units ([`Units::new`]).
pub fn take_units(
    place: &str,
    tensors: &mut BTreeMap<String, Tensor>,
    dof: usize,
) -> Result<Option<Units>, Error> {
    let [centre, factors] = UNITS.map(|name| tensors.remove(name));
    let units = match (centre, factors) {
        (None, None) => return Ok(None),
        (Some(centre), Some(mut factors)) => {
            if factors.single_precision {
                even_out(&mut factors.values);
            }
            Units::new(centre.values, factors.values)
        }
        (centre, _) => {
            let missing = UNITS[usize::from(centre.is_some())];
            return Err(Error::content(
                format!("{place}: {missing}"),
                "a tensor of that name",
                "none",
            ));
        }
    };
    let units = units.map_err(|e| e.with_place(place))?;
    units.check(&format!("{place}: units"), dof)?;
    Ok(Some(units))
}

/// Gives the factors of p what makes the products of all planes that of the first, where they
/// are so to single precision.
fn even_out(factors: &mut [f64]) {
    const CLOSE: f64 = 4.0 * f32::EPSILON as f64;
    let (positions, momenta) = factors.split_at_mut(factors.len() / 2);
    let Some(area) = positions.first().zip(momenta.first()).map(|(q, p)| q * p) else { return };
    for (q, p) in positions.iter().zip(momenta) {
        if (*q * *p / area - 1.0).abs() <= CLOSE {
            *p = area / q;
        }
    }
}

/// Writes a model's weights, float64, as `.safetensors` or `.npz`, with the units of its data, if these differ from the
/// network's.
///
/// # Errors
/// When the ending is another one or the file cannot be written.
pub fn export_weights(path: &Path, model: &Model, units: Option<&Units>) -> Result<(), Error> {
    let format = WeightsFormat::of(path)?;
    let architecture = model.architecture();
    let parameters = model.composition().parameters();
    let mut tensors: Vec<(String, Vec<usize>, &[f64])> = Vec::new();
    let mut rest = parameters;
    for (name, shape) in architecture.tensors() {
        let (values, after) = rest.split_at(shape[0] * shape[1]);
        rest = after;
        let shape = if name == "theta" { vec![shape[1]] } else { shape.to_vec() };
        tensors.push((name, shape, values));
    }
    let perturbation = architecture.part(Part::Perturbation).next();
    let kicks = perturbation.map(|block| [block.layers.count() as f64]);
    if let Some(kicks) = &kicks
        && perturbation.is_some_and(|block| block.name == PERTURBATION)
    {
        tensors.push((PERTURBATION.to_owned(), vec![1], kicks));
    }
    if let Some(units) = units {
        for (name, values) in UNITS.into_iter().zip([units.centre(), units.factors()]) {
            tensors.push((name.to_owned(), vec![1, values.len()], values));
        }
    }
    let text = serde_json::to_string(architecture).map_err(|reason| Error::write(path, reason))?;
    match format {
        WeightsFormat::Safetensors => {
            let metadata = HashMap::from([(ARCHITECTURE.to_owned(), text)]);
            let bytes: Vec<Vec<u8>> = tensors
                .iter()
                .map(|(_, _, values)| values.iter().flat_map(|v| v.to_le_bytes()).collect())
                .collect();
            let views: Result<Vec<_>, _> = tensors
                .iter()
                .zip(&bytes)
                .map(|((name, shape, _), bytes)| {
                    Ok((name.clone(), TensorView::new(Dtype::F64, shape.clone(), bytes)?))
                })
                .collect();
            let file = views
                .and_then(|views| serialize(views, Some(metadata)))
                .map_err(|reason: safetensors::SafeTensorError| Error::write(path, reason))?;
            write_atomically(path, |out| out.write_all(&file))
        }
        WeightsFormat::Npz => {
            let shapes: Vec<Vec<u64>> = tensors
                .iter()
                .map(|(_, shape, _)| shape.iter().map(|&d| d as u64).collect())
                .collect();
            let arrays: Vec<_> = tensors
                .iter()
                .zip(&shapes)
                .map(|((name, _, values), shape)| (name.as_str(), &shape[..], *values))
                .collect();
            write_archive_of(path, &arrays, &[(ARCHITECTURE, &text)])
        }
    }
}
