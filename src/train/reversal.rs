//! Whether pairs are those of a map with a symmetry: reversible, or mirrored.

use crate::flow::{Pairs, TwoFits};
use crate::layer::Reversor;
use crate::network::{Architecture, Structure};
use crate::scalar::median_or_nan;
use std::fmt;

/// A defect is seen if it is this many times the difference of two fits, …
const ABOVE: f64 = 5.0;
/// … and more than this part of the motion: less is put down to errors of the pairs, which both fits have in common,
/// and changes nothing that is fitted to them.
const LEAST: f64 = 1e-9;
/// Fits that differ by more than this know too little to recommend anything.
const KNOWN: f64 = 1e-3;

fn is_seen(median: f64, resolution: f64) -> bool {
    !(median <= ABOVE * resolution || median <= LEAST)
}

/// How far pairs (z, w) are from those of a reversible map F, F(Sw) = Sz, measured by polynomial maps that are fitted
/// to them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReversalDefect {
    /// The reflection S that was tried.
    pub reversor: Reversor,
    /// The median of |F(Sw) − Sz| over pairs, in units of the root mean square motion |w − z|.
    pub median: f64,
    /// The median of the difference of two fits at Sw, over the same motion: a smaller defect is not resolved.
    pub resolution: f64,
}

impl ReversalDefect {
    /// The defect of pairs of one map, by fits to them. None where too few mirrored points are in
    /// their box.
    pub fn measure(pairs: &Pairs, fits: &TwoFits, reversor: Reversor) -> Option<Self> {
        let backwards = |z: &[f64], w: &[f64]| {
            let [mut start, mut end] = [w, z].map(<[f64]>::to_vec);
            reversor.apply(&mut start);
            reversor.apply(&mut end);
            [start, end]
        };
        let [median, resolution] = off(pairs, fits, backwards)?;
        Some(Self { reversor, median, resolution })
    }

    /// Whether the pairs are visibly not those of a map that is reversible by S. A NaN counts as visible.
    pub fn is_seen(&self) -> bool {
        is_seen(self.median, self.resolution)
    }

    /// A defect worth reporting for a network of this architecture, if any: either its reversor is not that of the
    /// pairs, or they have one that the network could have without giving up an invariant.
    pub(super) fn worth_saying(
        pairs: &Pairs,
        fits: &TwoFits,
        architecture: &Architecture,
    ) -> Option<Self> {
        let gives_up_nothing =
            matches!(architecture.structure(), Structure::Plain | Structure::NearlyIntegrable);
        Self::of_model(pairs, fits, architecture.reversor, gives_up_nothing)
    }

    /// A defect worth reporting for what has this reversor, or has none and could have one.
    pub(super) fn of_model(
        pairs: &Pairs,
        fits: &TwoFits,
        reversor: Option<Reversor>,
        could_have: bool,
    ) -> Option<Self> {
        if let Some(reversor) = reversor {
            return Self::measure(pairs, fits, reversor).filter(Self::is_seen);
        }
        if !could_have {
            return None;
        }
        let is_theirs = |of: &Self| !of.is_seen() && of.resolution <= KNOWN;
        Reversor::ALL.into_iter().filter_map(|s| Self::measure(pairs, fits, s)).find(is_theirs)
    }
}

impl fmt::Display for ReversalDefect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { reversor, median, resolution } = self;
        match self.is_seen() {
            true => write!(
                f,
                "These pairs are of no map that is reversible by {}: reflected, they are off its inverse by \
                 {median:.1e} of the motion in the median, as a polynomial map fitted to them has it; two such fits \
                 differ by {resolution:.1e}. What is fitted to them with this reversor is reversible all the same: is S \
                 the right reflection?",
                reversor.equation()
            ),
            false => write!(
                f,
                "These pairs are of a map that is reversible by {}, to within {:.1e} of the motion. With the reversor \
                 \"{}\" a network is so for all weights, and uses each of its kicks twice; a polynomial has half the \
                 coefficients",
                reversor.equation(),
                median.max(*resolution),
                reversor.name()
            ),
        }
    }
}

/// How far pairs (z, w) are from those of a map F that commutes with the reflection M of some planes, F(Mz) = Mw,
/// measured by polynomial maps that are fitted to them.
#[derive(Clone, Debug, PartialEq)]
pub struct MirrorDefect {
    /// The reflected planes, from 1 to n.
    pub planes: Vec<usize>,
    /// The median of |F(Mz) − Mw| over pairs, in units of the root mean square motion |w − z|.
    pub median: f64,
    /// The median of the difference of two fits at Mz, over the same motion: a smaller defect is not resolved.
    pub resolution: f64,
}

impl MirrorDefect {
    /// The defect of pairs of one map, by fits to them; planes are from 1 to n. None where too few mirrored points are
    /// in their box.
    pub(super) fn measure(pairs: &Pairs, fits: &TwoFits, planes: &[usize]) -> Option<Self> {
        let dof = pairs.dof();
        let mirrored = |z: &[f64]| {
            let mut out = z.to_vec();
            for plane in planes {
                for k in [plane - 1, dof + plane - 1] {
                    out[k] = -out[k];
                }
            }
            out
        };
        let [median, resolution] = off(pairs, fits, |z, w| [mirrored(z), mirrored(w)])?;
        Some(Self { planes: planes.to_vec(), median, resolution })
    }

    /// Whether the pairs are visibly not those of a map that commutes with M. A NaN counts as visible.
    pub fn is_seen(&self) -> bool {
        is_seen(self.median, self.resolution)
    }

    /// A defect worth reporting: of the planes that are claimed, or, where none is, a plane of several that could be.
    pub(super) fn worth_saying(pairs: &Pairs, fits: &TwoFits, claimed: &[usize]) -> Option<Self> {
        if !claimed.is_empty() {
            return Self::measure(pairs, fits, claimed).filter(Self::is_seen);
        }
        let is_theirs = |of: &Self| !of.is_seen() && of.resolution <= KNOWN;
        let planes = (1..=pairs.dof()).filter(|_| pairs.dof() > 1);
        planes.filter_map(|plane| Self::measure(pairs, fits, &[plane])).find(is_theirs)
    }
}

impl fmt::Display for MirrorDefect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { planes, median, resolution } = self;
        let names: Vec<String> = planes.iter().map(|j| format!("(q{j}, p{j})")).collect();
        let names = names.join(", ");
        match self.is_seen() {
            true => write!(
                f,
                "These pairs are of no map that commutes with the reflection of {names}: reflected, they are off by \
                 {median:.1e} of the motion in the median, as a polynomial map fitted to them has it; two such fits \
                 differ by {resolution:.1e}. What is fitted to them commutes with it all the same: are these the right \
                 planes?"
            ),
            false => write!(
                f,
                "These pairs are of a map that commutes with the reflection of {names}, to within {:.1e} of the motion. \
                 A polynomial with this plane mirrored (`mirrored`: {}) does so exactly, with about half the \
                 coefficients",
                median.max(*resolution),
                planes.iter().map(usize::to_string).collect::<Vec<_>>().join(",")
            ),
        }
    }
}

/// The median distance of images of a fit from where a symmetry expects them, and of those of two fits from each other,
/// in units of the root mean square motion. `expected` gives a point and its image from a pair. None where too few such
/// points are in the box of the pairs.
fn off(
    pairs: &Pairs,
    fits: &TwoFits,
    expected: impl Fn(&[f64], &[f64]) -> [Vec<f64>; 2],
) -> Option<[f64; 2]> {
    const SAMPLE: usize = 1024;
    /// The smallest number of such points.
    const POINTS: usize = 64;
    let dim = 2 * pairs.dof();
    let sample = pairs.thinned(SAMPLE);
    let [best, other] = fits.maps();
    let distance =
        |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
    let (mut defects, mut differences, mut squares) = (Vec::new(), Vec::new(), 0.0);
    for (z, w) in sample.input().chunks_exact(dim).zip(sample.output().chunks_exact(dim)) {
        squares += distance(z, w).powi(2);
        let [start, end] = expected(z, w);
        if !best.is_inside(&start) {
            continue;
        }
        let [mut one, mut two] = [start.clone(), start];
        best.step(&mut one);
        other.step(&mut two);
        defects.push(distance(&one, &end));
        differences.push(distance(&one, &two));
    }
    if defects.len() < POINTS {
        return None;
    }
    let motion = (squares / sample.len() as f64).sqrt();
    Some([defects, differences].map(|of: Vec<f64>| median_or_nan(of) / motion))
}
