//! The stages of a training as they are asked for: starts, a ramp, twists alone.

use super::record::at_least_one;
use crate::error::Error;
use crate::layer::MOST_DEGREES;
use crate::network::{Architecture, MOST_REPEATS, Part};
use serde::{Deserialize, Serialize};

/// Several initial weights, of which the best goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Starts {
    /// How many sets of initial weights are tried.
    pub count: u64,
    /// The iterations of each, after which the one of the lowest held-out error (loss,
    /// without held-out pairs) is chosen. It goes on as if it had been alone.
    pub iterations: u64,
}

/// A problem near the one that is wanted, whose weights start the next.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RampStage {
    /// Its flow time; the scene's, unless given. A scene leaves out stages of longer times than the
    /// one that is wanted, and of the same where their ε is the same too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flow_time: Option<f64>,
    /// Its ε; the system's, unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epsilon: Option<f64>,
    /// Of a normal form: only one in so many of its twist shears, the first ones, are trained. What
    /// comes after the ramp begins with them so many times over
    /// ([`Model::iterated`](crate::network::Model::iterated)), so that its flow time is best as many times as long. All of
    /// them, unless given; those of a stage divide those of the one before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub repeats: Option<usize>,
    /// Of a network with polynomials: those outside its slow map have at most this degree, and in the stages
    /// after it begin with what they have learnt, coefficients of higher degrees being 0. Their own degree,
    /// unless given; none is below that of the stage before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degree: Option<usize>,
    /// Its iterations.
    pub iterations: u64,
}

/// Twists T_ε of a normal form, trained alone before the last stage.
///
/// The chart χ of a short flow time is that of a long one, T_ε is not: its shears, as the stages
/// of a splitting, suit steps of one length. In the coordinates of χ the pairs are of Φ_θ∘T_ε, whose
/// fast motion is a rotation, and which is soon trained from random weights; θ is the
/// ramp's to begin with. Loss and held-out error are in these coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FreshTwists {
    /// How many random ones, beside those of the ramp.
    pub count: u64,
    /// The iterations of each, after which the one of the lowest held-out error (loss,
    /// without held-out pairs) goes on with χ, beginning with as many pairs as its record has.
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

    /// The seed of the weights of a start, that of the first being the training's own: far from
    /// the seeds of other trainings, which follow one another.
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
        // Of those that come by turns, one of each kind at least.
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
