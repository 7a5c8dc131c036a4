//! Controls: the parameters of a family of maps in addition to ε and the flow time.

use crate::error::Error;
use crate::scalar::Real;
use serde::{Deserialize, Serialize};

/// A control λ and the range in which it is learnt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControlRange {
    /// The name of the control, of letters, digits, `-` and `_`.
    pub name: String,
    /// The least value of the control among the pairs.
    pub low: f64,
    /// The greatest value of the control among the pairs.
    pub high: f64,
}

impl ControlRange {
    /// The middle of the range, the value of the nominal network.
    pub fn nominal(&self) -> f64 {
        0.5f64.mul_add(self.high - self.low, self.low)
    }

    /// Whether a value is in the range, up to rounding.
    pub fn contains(&self, value: f64) -> bool {
        let rounding = 8.0 * f64::EPSILON * (self.high - self.low);
        value >= self.low - rounding && value <= self.high + rounding
    }

    /// The warning about a value outside the range.
    pub fn outside(&self, value: f64) -> String {
        let Self { name, low, high } = self;
        format!("{name} = {value} is outside of what the model has learnt, from {low} to {high}")
    }

    /// u = (λ − middle)/half the range.
    fn unit<P: Real>(&self, value: P) -> P {
        let half = 0.5 * (self.high - self.low);
        (value - P::from_f64(self.nominal())) * P::from_f64(1.0 / half)
    }
}

/// The controls λ of a network whose parameters are polynomials of them:
///
/// θ(λ) = Σ_k θ_k u^k, u = (λ − middle)/half the range,
///
/// over the products u^k of total degree at most d, the lowest first. At each λ it is a network of the same
/// blocks and obeys their laws; at fixed controls a step costs as much as without controls.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Controls {
    /// The controls, in the order of the columns of data.
    pub ranges: Vec<ControlRange>,
    /// d, the highest total degree.
    pub degree: usize,
}

impl Controls {
    /// The largest number of controls.
    pub const MOST: usize = 64;
    /// Names of what else a model is asked at.
    const TAKEN: [&str; 8] =
        ["epsilon", "flow_time", "points", "guess", "period", "start", "centre", "steps"];
    /// The largest degree of the polynomials.
    pub const MOST_DEGREE: usize = 8;
    /// A network has so many times the parameters of one without controls, at most.
    const MOST_TERMS: usize = 1000;

    /// Fails unless there are controls of different names and of some extent.
    ///
    /// # Errors
    /// With the name and the value.
    pub fn check(&self) -> Result<(), Error> {
        Error::check_count_range("controls", self.ranges.len(), 1, Self::MOST)?;
        Error::check_count_range("controls: degree", self.degree, 1, Self::MOST_DEGREE)?;
        for (number, range) in self.ranges.iter().enumerate() {
            let ControlRange { name, low, high } = range;
            let is_plain = |c: char| c.is_alphanumeric() || c == '-' || c == '_';
            if name.is_empty() || !name.chars().all(is_plain) {
                let expected = "letters, digits, `-` and `_`";
                return Err(Error::invalid("name of a control", format!("`{name}`"), expected));
            }
            if Self::TAKEN.contains(&&**name) {
                let expected =
                    "another one: that is the name of something else that is asked of a model";
                return Err(Error::invalid("name of a control", format!("`{name}`"), expected));
            }
            if self.ranges[..number].iter().any(|other| other.name == *name) {
                let found = format!("`{name}` twice");
                return Err(Error::invalid("names of controls", found, "a name for each"));
            }
            Error::check_finite(name, *low)?;
            Error::check_finite(name, *high)?;
            // Else there is no u.
            if !(low < high && (0.5 * (high - low)).is_normal()) {
                let found = format!("from {low} to {high}");
                let expected = "at least two values, between which it is learnt";
                return Err(Error::invalid(&format!("control `{name}`"), found, expected));
            }
        }
        Error::check_count_range("controls: terms", self.terms(), 1, Self::MOST_TERMS)
    }

    /// The number of products: binomial(controls + d, d), at most 2³².
    pub fn terms(&self) -> usize {
        let mut terms: u64 = 1;
        for k in 1..=self.degree as u64 {
            terms = terms.saturating_mul(self.ranges.len() as u64 + k) / k;
        }
        usize::try_from(terms.min(1 << 32)).unwrap_or(usize::MAX)
    }

    /// The exponents of each product, the constant first.
    fn exponents(&self) -> Vec<Vec<usize>> {
        let mut out = Vec::with_capacity(self.terms());
        for total in 0..=self.degree {
            push_exponents(&mut out, &mut vec![0; self.ranges.len()], 0, total);
        }
        out
    }

    /// The products u^k at these values of the controls.
    ///
    /// # Panics
    /// When there is not one value for each.
    pub fn products<P: Real>(&self, values: &[P]) -> Vec<P> {
        assert!(values.len() == self.ranges.len());
        let units: Vec<P> =
            self.ranges.iter().zip(values).map(|(range, value)| range.unit(*value)).collect();
        let product = |exponents: Vec<usize>| {
            let mut out = P::from_f64(1.0);
            for (unit, exponent) in units.iter().zip(exponents) {
                for _ in 0..exponent {
                    out *= *unit;
                }
            }
            out
        };
        self.exponents().into_iter().map(product).collect()
    }

    /// What stands before the name of a tensor of each product: nothing of the constant, `a^2*b:` of another.
    pub(super) fn prefixes(&self) -> Vec<String> {
        let prefix = |exponents: Vec<usize>| {
            let powers = self.ranges.iter().zip(exponents).filter(|(_, exponent)| *exponent > 0);
            let powers: Vec<String> = powers
                .map(|(range, exponent)| match exponent {
                    1 => range.name.clone(),
                    _ => format!("{}^{exponent}", range.name),
                })
                .collect();
            if powers.is_empty() { String::new() } else { powers.join("*") + ":" }
        };
        self.exponents().into_iter().map(prefix).collect()
    }

    /// The controls and their ranges in words.
    pub fn describe(&self) -> String {
        let range =
            |range: &ControlRange| format!("{} from {} to {}", range.name, range.low, range.high);
        let ranges: Vec<String> = self.ranges.iter().map(range).collect();
        format!(
            "The parameters are polynomials of total degree {}, {} terms each, in {}",
            self.degree,
            self.terms(),
            ranges.join(", ")
        )
    }

    /// Example values of all controls in the syntax of an option: `a=0.25,b=3`, a quarter into each range.
    pub fn example(&self) -> String {
        let value = |range: &ControlRange| {
            format!("{}={}", range.name, 0.25f64.mul_add(range.high - range.low, range.low))
        };
        self.ranges.iter().map(value).collect::<Vec<_>>().join(",")
    }

    /// The values of the controls at the middle of each range.
    pub fn nominal(&self) -> Vec<f64> {
        self.ranges.iter().map(ControlRange::nominal).collect()
    }

    /// The values of all controls: those given by name, and the middle of the range for the others.
    ///
    /// # Errors
    /// When there is no control of a name, or it has two values or one that is not finite.
    pub fn values<'a>(
        &self,
        given: impl IntoIterator<Item = (&'a str, f64)>,
    ) -> Result<Vec<f64>, Error> {
        let mut out = vec![None; self.ranges.len()];
        for (name, value) in given {
            let Some(number) = self.ranges.iter().position(|range| range.name == name) else {
                let names: Vec<&str> = self.ranges.iter().map(|range| &*range.name).collect();
                return Err(Error::invalid(
                    "control",
                    name,
                    format!("one of {}", names.join(", ")),
                ));
            };
            Error::check_finite(name, value)?;
            if out[number].replace(value).is_some() {
                return Err(Error::invalid("controls", format!("`{name}` twice"), "one value"));
            }
        }
        let both = out.into_iter().zip(self.nominal());
        Ok(both.map(|(value, nominal)| value.unwrap_or(nominal)).collect())
    }

    /// The first control whose value is outside its range, with the value.
    pub fn first_outside(&self, values: &[f64]) -> Option<(&ControlRange, f64)> {
        let mut both = self.ranges.iter().zip(values.iter().copied());
        both.find(|(range, value)| !range.contains(*value))
    }
}

/// All ways to have this total, the first controls with the highest exponents first.
fn push_exponents(out: &mut Vec<Vec<usize>>, here: &mut Vec<usize>, control: usize, total: usize) {
    if control + 1 == here.len() {
        here[control] = total;
        out.push(here.clone());
        return;
    }
    for exponent in (0..=total).rev() {
        here[control] = exponent;
        push_exponents(out, here, control + 1, total - exponent);
    }
}
