//! Maps on a grid: undone as an equality of whole numbers, wherever they wrap.

use super::{Outcome, blocks, number, numbers};
use arbitrary::Unstructured;
use gyroceptron::measure::{GridMap, OneStep, ratios::differing_places};
use gyroceptron::network::Model;
use gyroceptron::phase::Direction;
use gyroceptron::scalar::{Grid, GridNumbers};

/// More degrees of freedom and parameters take too long.
const MOST_DOF: usize = 4;
const MOST: usize = 2048;

/// A network of shears with any weights at any place of any grid: P⁻¹∘P and P∘P⁻¹ change no place, and its
/// kernels move the point as the network does over one number on the grid.
pub fn grid(data: &[u8]) -> Result<Outcome, String> {
    let u = &mut Unstructured::new(data);
    let architecture = blocks::of_shears(u);
    let count = architecture.parameter_count();
    if architecture.dof > MOST_DOF || count > MOST || architecture.check().is_err() {
        return Ok(Outcome::Refused);
    }
    let mut weights = numbers(u, count);
    weights.iter_mut().filter(|v| !v.is_finite()).for_each(|v| *v = 0.25);
    let Ok(model) = Model::new(architecture, weights) else { return Ok(Outcome::Refused) };
    if model.composition().check_on_grid().is_err() {
        return Ok(Outcome::Refused);
    }
    let numbers = GridNumbers::ALL[usize::from(u.arbitrary::<u8>().unwrap_or(0) % 2)];
    let bits = u32::from(u.arbitrary::<u8>().unwrap_or(44)) % (numbers.most_bits() + 1);
    let grid = Grid::new(bits, numbers).map_err(|reason| reason.to_string())?;
    let dim = 2 * model.architecture().dof;
    let places: Vec<i64> = match numbers {
        GridNumbers::Integers => (0..dim).map(|_| u.arbitrary().unwrap_or(1)).collect(),
        GridNumbers::Floats => {
            let within = |value: f64| if value.is_finite() { value % grid.limit() } else { 0.5 };
            let z: Vec<f64> = (0..dim).map(|_| within(number(u))).collect();
            match grid.quantise(&z) {
                Ok(places) => places,
                Err(_) => return Ok(Outcome::Refused),
            }
        }
    };
    let mut outcome = Outcome::OutOfRange;
    for first in [Direction::Forward, Direction::Inverse] {
        match differing_places(&model, first, grid, &places) {
            Some(0) => outcome = Outcome::Tested,
            None => {}
            Some(count) => {
                return Err(format!("{first:?}, then back: {count} other places, from {places:?}"));
            }
        }
        let (mut kernels, mut single) = (places.clone(), places.clone());
        let by_kernels = model.move_places(first, grid, &mut kernels);
        let alone = OneStep(&model).move_places(first, grid, &mut single);
        if by_kernels != alone || kernels != single {
            return Err(format!("{first:?}: {kernels:?} by kernels, {single:?} alone"));
        }
    }
    Ok(outcome)
}
