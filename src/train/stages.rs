//! Options of the stages of a training: starts, a ramp, twists trained alone.

use super::record::at_least_one;
use crate::error::Error;
use crate::layer::MOST_DEGREES;
use crate::network::{Architecture, MOST_REPEATS, Part};
use serde::{Deserialize, Serialize};

/// Several sets of initial weights, of which the best is trained further.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Starts {
    /// How many sets of initial weights are tried.
    pub count: u64,
    /// The iterations of each, after which the one of the lowest held-out error (loss,
    /// without held-out pairs) is chosen. It continues as if it had been the only one.
    pub iterations: u64,
}

/// A problem near the final one that is trained before it; its weights start the next stage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RampStage {
    /// The flow time of the pairs of this stage. None: that of the scene; where pairs are given, any. A scene whose
    /// pairs a system makes leaves out stages with a longer flow time than the final one, and those with the same flow
    /// time and the same ε.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow_time: Option<f64>,
    /// The ε of the pairs of this stage. None: that of the system; where pairs are given, any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epsilon: Option<f64>,
    /// For a normal form: only the first 1/m of its twist shears are trained, m being this number. The training after
    /// the ramp begins with them repeated m times ([`Model::iterated`](crate::network::Model::iterated)), so that its
    /// flow time is best m times as long. None: all shears. The number of a stage divides that of the stage before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repeats: Option<usize>,
    /// For a network with polynomials: the highest degree of those outside its slow map. The stages after it begin
    /// with the learnt coefficients, and with 0 for those of higher degrees. None: the degree of the network. It may
    /// not be below that of the stage before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degree: Option<usize>,
    /// The largest number of iterations of the stage.
    pub iterations: u64,
}

/// Twists T_ε of a normal form, trained alone before the last stage.
///
/// The chart χ of a short flow time is also that of a long one, but T_ε is not: its shears, like the stages of a
/// splitting, suit steps of one length. In the coordinates of χ the pairs are those of Φ_θ∘T_ε, whose fast motion is
/// a rotation and which is soon trained from random weights; θ starts at that of the ramp. Loss and held-out error
/// are in these coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FreshTwists {
    /// The number of random twists, in addition to those of the ramp.
    pub count: u64,
    /// The iterations of each, after which the one of the lowest held-out error (loss,
    /// without held-out pairs) is combined with χ; training then begins with at least as many pairs
    /// as its record has.
    pub iterations: u64,
}

/// Fails unless several are tried, each for a while.
fn check_trials(name: &str, count: u64, iterations: u64) -> Result<(), Error> {
    /// More are taken for a mistake.
    const MOST: usize = 10_000;
    let count = usize::try_from(count).unwrap_or(usize::MAX);
    Error::check_count_range(&format!("training.{name}.count"), count, 1, MOST)?;
    at_least_one(&format!("training.{name}.iterations"), iterations)
}

impl Starts {
    /// Iterations that distinguish good starts from bad ones.
    pub const TRIAL: u64 = 40;

    /// The seed of the weights of a start. The first start has the seed of the training; the others
    /// are far from it, because different trainings often have consecutive seeds.
    pub fn seed(training: u64, number: u64) -> u64 {
        training.wrapping_add(number << 32)
    }

    pub(super) fn check(self) -> Result<(), Error> {
        check_trials("starts", self.count, self.iterations)
    }
}

impl FreshTwists {
    pub(super) fn check(self) -> Result<(), Error> {
        check_trials("fresh_twists", self.count, self.iterations)
    }
}

impl RampStage {
    pub(super) fn times(&self) -> usize {
        self.repeats.unwrap_or(1)
    }

    pub(super) fn check(self) -> Result<(), Error> {
        at_least_one("training.ramp.iterations", self.iterations)?;
        if let Some(time) = self.flow_time {
            Error::check_range("training.ramp.flow_time", time, Error::LEAST_POSITIVE, f64::MAX)?;
        }
        Error::check_count_range("training.ramp.repeats", self.times(), 1, MOST_REPEATS)?;
        self.epsilon.map_or(Ok(()), |epsilon| Error::check_finite("training.ramp.epsilon", epsilon))
    }

    /// The largest degree of polynomials in it.
    pub(super) fn most_degrees(&self) -> usize {
        self.degree.unwrap_or(MOST_DEGREES)
    }

    /// Fails unless the [degrees](RampStage::degree) of a ramp are of polynomials, and do not fall.
    pub(super) fn check_degrees(ramp: &[Self], architecture: &Architecture) -> Result<(), Error> {
        let mut before = 1;
        for stage in ramp {
            if let (Some(degree), false) = (stage.degree, architecture.has_polynomials()) {
                let expected = "none: the network has no polynomials";
                return Err(Error::invalid("training.ramp.degree", degree, expected));
            }
            let degree = stage.most_degrees();
            Error::check_count_range("training.ramp.degree", degree, before, MOST_DEGREES)?;
            before = degree;
        }
        Ok(())
    }

    /// Fails unless the [repeats](RampStage::repeats) of a ramp divide, each those before it, and leave
    /// the first of its stages twist shears of both kinds.
    pub(super) fn check_repeats(ramp: &[Self], architecture: &Architecture) -> Result<(), Error> {
        let twists = architecture.twist_shears();
        let blocks = architecture.part(Part::SlowMap).count();
        // Where shears of the two kinds alternate, one of each at least.
        let least = if architecture.twists_alternate() { 2 } else { 1 };
        let mut before = None;
        for repeats in ramp.iter().map(Self::times) {
            let divides = match before {
                None => {
                    let whole = twists.is_multiple_of(repeats.saturating_mul(least));
                    repeats == 1 || blocks == 1 && twists > 0 && whole
                }
                Some(before) => usize::is_multiple_of(before, repeats),
            };
            if !divides {
                let expected = match before {
                    None if twists == 0 => "1: only a normal form has twists".to_owned(),
                    None if blocks > 1 => format!("1: the slow map is {blocks} blocks"),
                    None if least == 1 => format!("1, or a divisor of {twists} turned twists"),
                    None => format!("1, or a divisor of half of {twists} twist shears"),
                    Some(before) => format!("a divisor of {before}, those of the stage before"),
                };
                return Err(Error::invalid("training.ramp.repeats", repeats, expected));
            }
            before = Some(repeats);
        }
        Ok(())
    }
}

/// What is said of fresh twists where there are none.
pub(super) fn not_a_normal_form(found: u64) -> Error {
    let expected = "none: only a normal form has twists";
    Error::invalid("training.fresh_twists", found, expected)
}
