//! Whether pairs are those of a reversible map.

use crate::flow::{Pairs, TwoFits};
use crate::layer::Reversor;
use crate::network::{Architecture, Structure};
use crate::scalar::median_or_nan;
use std::fmt;

/// How far pairs (z, w) are from those of a reversible map F, F(Sw) = Sz, measured by polynomial maps that are fitted
/// to them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReversalDefect {
    /// The reflection S.
    pub reversor: Reversor,
    /// The median of |F(Sw) − Sz| over pairs, in units of the root mean square motion |w − z|.
    pub median: f64,
    /// The same for the difference of two fits at Sw: a smaller defect is not resolved.
    pub resolution: f64,
}

impl ReversalDefect {
    /// A defect is seen if it is this many times the difference of two fits.
    const ABOVE: f64 = 5.0;
    /// Fits that differ by more than this know too little to recommend anything.
    const KNOWN: f64 = 1e-3;
    /// The smallest number of mirrored points that have to lie where the pairs are.
    const POINTS: usize = 64;

    /// The defect of pairs of one map, by fits to them. None where too few mirrored points are in
    /// their box.
    pub fn of(pairs: &Pairs, fits: &TwoFits, reversor: Reversor) -> Option<Self> {
        const SAMPLE: usize = 1024;
        let dim = 2 * pairs.dof();
        let sample = pairs.thinned(SAMPLE);
        let [best, other] = fits.maps();
        let distance = |a: &[f64], b: &[f64]| {
            a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
        };
        let (mut defects, mut differences, mut squares) = (Vec::new(), Vec::new(), 0.0);
        for (z, w) in sample.input().chunks_exact(dim).zip(sample.output().chunks_exact(dim)) {
            squares += distance(z, w).powi(2);
            let [mut start, mut end] = [w, z].map(<[f64]>::to_vec);
            reversor.apply(&mut start);
            reversor.apply(&mut end);
            if !best.is_inside(&start) {
                continue;
            }
            let [mut one, mut two] = [start.clone(), start];
            best.step(&mut one);
            other.step(&mut two);
            defects.push(distance(&one, &end));
            differences.push(distance(&one, &two));
        }
        if defects.len() < Self::POINTS {
            return None;
        }
        let motion = (squares / sample.len() as f64).sqrt();
        let [median, resolution] =
            [defects, differences].map(|of: Vec<f64>| median_or_nan(of) / motion);
        Some(Self { reversor, median, resolution })
    }

    /// Whether the pairs are visibly not those of a map that is reversible by S. A NaN counts as visible.
    pub fn is_seen(&self) -> bool {
        !(self.median <= Self::ABOVE * self.resolution)
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
            return Self::of(pairs, fits, reversor).filter(Self::is_seen);
        }
        if !could_have {
            return None;
        }
        let is_theirs = |of: &Self| !of.is_seen() && of.resolution <= Self::KNOWN;
        Reversor::ALL.into_iter().filter_map(|s| Self::of(pairs, fits, s)).find(is_theirs)
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
