//! Level sets of a Hamiltonian of one degree of freedom.

use crate::error::Error;
use crate::flow::Reference;
use crate::system::Hamiltonian;

/// The level set of H through `start`, traced by its own flow: `start` and `steps`
/// points after it, `interval` of time apart, in a plane (q, p). Closed when
/// `interval`·`steps` is at least the period.
///
/// # Errors
/// Those of [`Reference::flow`], and [`Error::Invalid`] when the system is not of one
/// degree of freedom.
pub fn level_set(
    system: &impl Hamiltonian,
    start: [f64; 2],
    interval: f64,
    steps: usize,
) -> Result<Vec<(f64, f64)>, Error> {
    Error::check_count("degrees of freedom", 1, system.dof())?;
    let reference = Reference::new(system, &start);
    let mut point = start;
    let mut points = vec![(point[0], point[1])];
    for _ in 0..steps {
        reference.flow(system, &mut point, interval)?;
        points.push((point[0], point[1]));
    }
    Ok(points)
}
