//! Orbits from points of windows.

use super::{Trajectories, Window, sample_of};
use crate::error::Error;
use crate::random::Stream;
use crate::system::Hamiltonian;

/// Orbits of `states` states each, one after another: an array (M, states, 2n).
///
/// `starts` are the points of the windows, `samples` of each in turn, and `follow` gives the
/// trajectories from such points. A start whose orbit leaves the domain of the system is replaced by
/// another point drawn from the same window.
///
/// # Errors
/// Those of `follow` and of [`sample_of`]; where 100 draws in a row lead out, the reason, at `place`.
///
/// # Panics
/// When there are not as many starts as the windows have samples, or `follow` gives fewer trajectories or
/// states.
pub fn orbits_of(
    place: &str,
    system: &impl Hamiltonian,
    windows: &[Window],
    mut starts: Vec<f64>,
    states: usize,
    stream: &mut Stream,
    follow: &dyn Fn(&[f64]) -> Result<Trajectories, Error>,
) -> Result<Vec<f64>, Error> {
    /// Draws in a row for an orbit: a window that has so few is in the wrong place.
    const MOST: usize = 100;
    let dim = 2 * system.dof();
    let of_window: Vec<&Window> =
        windows.iter().flat_map(|window| std::iter::repeat_n(window, window.samples)).collect();
    let mut out = vec![0.0; starts.len() * states];
    let mut drawn: Vec<usize> = (0..of_window.len()).collect();
    for draw in 1.. {
        let found = follow(&starts)?;
        let (mut left, mut reason) = (Vec::new(), None);
        for (m, &orbit) in drawn.iter().enumerate() {
            match found.orbit(m).try_for_each(|state| system.check_point(state)) {
                Ok(()) => {
                    let values = found.orbit(m).flatten().copied();
                    let room = &mut out[orbit * states * dim..][..states * dim];
                    room.iter_mut().zip(values).for_each(|(to, from)| *to = from);
                }
                Err(error) => {
                    left.push(orbit);
                    reason = Some(error);
                }
            }
        }
        match reason {
            None => break,
            Some(reason) if draw == MOST => return Err(reason.with_place(place)),
            Some(_) => {
                starts.clear();
                for &orbit in &left {
                    let window = [Window { samples: 1, ..of_window[orbit].clone() }];
                    starts.extend(sample_of(system, &window, stream)?);
                }
                drawn = left;
            }
        }
    }
    Ok(out)
}
