//! The results of a law over its samples, and what they come to.

use super::inversion::Conditioned;
use serde::{Deserialize, Serialize};

/// Every ratio must stay below it.
pub const RATIO_LIMIT: f64 = 10.0;
/// Slopes in ε may fall short of 1 and 2 by this; they may exceed them, as they
/// do where the potentials are odd and the leading term vanishes.
pub const SLOPE_LIMIT: f64 = 0.1;
/// A count of components that must be none.
pub const COUNT_LIMIT: f64 = 0.5;
/// What ρ_S is for a computation whose errors are those of rounding: its upper
/// decile is at least the first. Below, all but a few samples saturate, or make
/// no error at all, and the test shows nothing.
pub const SOUND_DECILE: f64 = 0.05;
/// What other ratios are, of which many are 0 because a step was undone to the last
/// bit: the upper decile of those that are not is at least this. It is 0.2 to 0.6 for
/// every law on clean networks (`verification/soundness.rs`); bounds that are a
/// thousand times as large as the errors hide defects of that size.
pub const SOUND_DEVIATION: f64 = 0.01;
/// Where errors of rounding need not show because there are none, as in maps of few or exact
/// operations: a defect of this share of the terms of an equation still has a ratio of 1.
pub const RESOLUTION: f64 = 1e-13;
/// The largest median of ratios of such a computation: above, a defect smaller
/// than the limit hides among the errors of rounding.
pub const SOUND_MEDIAN: f64 = 2.0;
/// The least share of samples with a digit to test.
pub const TESTABLE: f64 = 0.5;

/// What a row of the certificate came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The law holds to rounding on all samples that have a digit to test.
    Holds,
    /// The law is violated.
    Violated,
    /// On these samples the law cannot fail: nothing is shown.
    Vacuous,
    /// On more than half of the samples no digit is left to test.
    IllConditioned,
    /// A figure for information: nothing is concluded from it.
    Reported,
}

impl Verdict {
    /// One word for tables.
    pub fn word(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Violated => "VIOLATED",
            Self::Vacuous => "VACUOUS",
            Self::IllConditioned => "ill-conditioned",
            Self::Reported => "reported",
        }
    }
}

/// One law, measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The name of the law.
    pub law: String,
    /// What is measured.
    pub equation: String,
    /// The number of samples.
    pub samples: usize,
    /// On how many of them rounding leaves no digit to test.
    pub ill_conditioned: usize,
    /// The smallest result.
    pub smallest: Option<f64>,
    /// The largest ratio; a count of components for bitwise laws, what is
    /// missing to the order for slopes. None where no sample could be tested or a result was NaN.
    pub largest: Option<f64>,
    /// The median.
    pub median: Option<f64>,
    /// The upper decile of the results that are not 0, if there are any.
    pub deviation: Option<f64>,
    /// What `largest` must stay below.
    pub limit: f64,
    /// What it came to.
    pub verdict: Verdict,
    /// The point of the largest result, or of one that is NaN, where results belong to
    /// points.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worst: Option<Vec<f64>>,
}

impl Row {
    /// How many times `largest` would have to grow to reach the limit; none
    /// where nothing was measured or nothing deviated.
    pub fn headroom(&self) -> Option<f64> {
        self.largest.filter(|largest| *largest > 0.0).map(|largest| self.limit / largest)
    }
}

/// What is asked of the bounds behind ratios, so that no law holds because its bounds
/// are too large.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Soundness {
    /// Nothing: the results are no ratios.
    Any,
    /// [`SOUND_DEVIATION`].
    Deviations,
    /// [`SOUND_DECILE`].
    Errors,
}

/// The results of one law, collected sample by sample.
///
/// ```
/// use gyroceptron::measure::{certificate::{Tally, Verdict}, ratios::Conditioned};
///
/// let mut tally = Tally::of_ratios("my law", "P(P(z)) = z");
/// tally.push(Conditioned::Ratio(0.3));
/// assert_eq!(tally.row().verdict, Verdict::Holds);
/// tally.push(Conditioned::Ratio(f64::NAN));
/// assert_eq!(tally.row().verdict, Verdict::Violated);
/// ```
#[derive(Clone, Debug)]
pub struct Tally {
    law: String,
    equation: String,
    limit: f64,
    soundness: Soundness,
    ratios: Vec<f64>,
    ill_conditioned: usize,
    worst: Option<(f64, Vec<f64>)>,
    vacuous: bool,
    reported: bool,
    /// Whether small defects show though errors of rounding do not.
    resolved: bool,
}

impl Tally {
    /// The law holds there alone, and says so.
    #[must_use]
    pub(super) fn where_(mut self, place: &str) -> Self {
        self.law = format!("{}, {place}", self.law);
        self
    }

    /// The same law of another kind of map.
    #[must_use]
    pub(super) fn stating(self, equation: &str) -> Self {
        Self { equation: equation.into(), ..self }
    }

    /// The same law in another notation.
    #[must_use]
    pub(super) fn restating(self, from: &str, to: &str) -> Self {
        Self { equation: self.equation.replace(from, to), ..self }
    }

    fn new(law: impl Into<String>, equation: impl Into<String>, limit: f64) -> Self {
        Self {
            law: law.into(),
            equation: equation.into(),
            limit,
            soundness: Soundness::Any,
            ratios: Vec::new(),
            ill_conditioned: 0,
            worst: None,
            vacuous: false,
            reported: false,
            resolved: false,
        }
    }

    /// A law whose results are errors over their rounding scales: vacuous below
    /// [`SOUND_DEVIATION`], and violated above [`SOUND_MEDIAN`].
    pub fn of_ratios(law: impl Into<String>, equation: impl Into<String>) -> Self {
        let soundness = Soundness::Deviations;
        Self { soundness, ..Self::new(law, equation, RATIO_LIMIT) }
    }

    /// A law that holds bit for bit: its results are numbers of components that
    /// differ.
    pub fn of_counts(law: impl Into<String>, equation: impl Into<String>) -> Self {
        Self::new(law, equation, COUNT_LIMIT)
    }

    /// A law on the order of something that vanishes with ε: its results are
    /// what is missing to the order, one for each map.
    pub fn of_slopes(law: impl Into<String>, equation: impl Into<String>) -> Self {
        Self::new(law, equation, SLOPE_LIMIT)
    }

    /// A law with a limit of its own.
    pub fn with_limit(law: impl Into<String>, equation: impl Into<String>, limit: f64) -> Self {
        Self::new(law, equation, limit)
    }

    /// For bounds of the worst case, which grow with the length of a computation far
    /// beyond its errors: nothing is asked of the ratios. What they have to resolve is
    /// to be asked for where they are made.
    pub fn of_worst_case(self) -> Self {
        Self { soundness: Soundness::Any, ..self }
    }

    /// Makes the law vacuous below [`SOUND_DECILE`] too: where errors of rounding
    /// have to show.
    pub fn must_show_errors(self) -> Self {
        Self { soundness: Soundness::Errors, ..self }
    }

    /// Says, where `resolved`, that the bounds are small whatever the errors are, to
    /// [`RESOLUTION`]: no error of rounding has to show.
    pub fn resolved_if(self, resolved: bool) -> Self {
        Self { resolved, ..self }
    }

    /// Makes the law one for information only.
    pub fn reported(self) -> Self {
        Self { reported: true, ..self }
    }

    /// The name of the law.
    pub fn law(&self) -> &str {
        &self.law
    }

    /// What is measured.
    pub fn equation(&self) -> &str {
        &self.equation
    }

    /// Adds a sample.
    pub fn push(&mut self, result: Conditioned) {
        match result {
            Conditioned::Ratio(ratio) => self.ratios.push(ratio),
            Conditioned::IllConditioned => self.ill_conditioned += 1,
        }
    }

    /// Adds a sample that belongs to a point.
    pub fn push_at(&mut self, result: Conditioned, point: &[f64]) {
        if let Conditioned::Ratio(ratio) = result {
            self.note(ratio, || point.to_vec());
        }
        self.push(result);
    }

    /// Keeps the point of the largest result: a NaN is larger than any.
    fn note(&mut self, ratio: f64, point: impl FnOnce() -> Vec<f64>) {
        if self.worst.as_ref().is_none_or(|(most, _)| !most.is_nan() && !(ratio <= *most)) {
            self.worst = Some((ratio, point()));
        }
    }

    /// Adds samples, each of the point of so many numbers that stands in its place.
    pub fn extend_at(
        mut self,
        points: &[f64],
        dim: usize,
        results: impl IntoIterator<Item = Conditioned>,
    ) -> Self {
        for (result, point) in results.into_iter().zip(points.chunks_exact(dim)) {
            self.push_at(result, point);
        }
        self
    }

    /// Adds samples.
    pub fn extend(mut self, results: impl IntoIterator<Item = Conditioned>) -> Self {
        for result in results {
            self.push(result);
        }
        self
    }

    /// Says, where `vacuous`, that the samples cannot show a violation.
    pub fn vacuous_if(mut self, vacuous: bool) -> Self {
        self.vacuous |= vacuous;
        self
    }

    /// Adds the results of this law on another map.
    pub fn merge(&mut self, other: Self) {
        self.ratios.extend(other.ratios);
        self.ill_conditioned += other.ill_conditioned;
        if let Some((ratio, point)) = other.worst {
            self.note(ratio, || point);
        }
        self.vacuous |= other.vacuous;
        self.resolved &= other.resolved;
    }

    /// What the samples come to.
    pub fn row(&self) -> Row {
        let testable = self.ratios.len();
        let samples = testable + self.ill_conditioned;
        let nan = self.ratios.iter().any(|r| r.is_nan());
        let mut sorted = self.ratios.clone();
        sorted.sort_by(f64::total_cmp);
        let usable = !nan && !sorted.is_empty();
        let smallest = usable.then(|| sorted[0]);
        let largest = usable.then(|| sorted[sorted.len() - 1]);
        let median = usable.then(|| sorted[sorted.len() / 2]);
        let decile = usable.then(|| sorted[sorted.len() * 9 / 10]);
        let deviating = &sorted[sorted.partition_point(|ratio| *ratio <= 0.0)..];
        let deviation = deviating.get(deviating.len() * 9 / 10).copied().filter(|_| usable);
        let ratios = self.soundness != Soundness::Any;
        let shows = match self.soundness {
            Soundness::Any => true,
            Soundness::Deviations => deviation.is_none_or(|d| d >= SOUND_DEVIATION),
            Soundness::Errors => decile.is_none_or(|d| d >= SOUND_DECILE),
        };
        let verdict = match (largest, median) {
            _ if self.reported => Verdict::Reported,
            _ if samples == 0 => Verdict::Vacuous,
            _ if nan => Verdict::Violated,
            (Some(largest), _) if !(largest < self.limit) => Verdict::Violated,
            _ if self.vacuous => Verdict::Vacuous,
            _ if !(shows || self.resolved) => Verdict::Vacuous,
            (_, Some(median)) if ratios && median > SOUND_MEDIAN => Verdict::Violated,
            _ if (testable as f64) < TESTABLE * samples as f64 => Verdict::IllConditioned,
            _ => Verdict::Holds,
        };
        Row {
            law: self.law.clone(),
            equation: self.equation.clone(),
            samples,
            ill_conditioned: self.ill_conditioned,
            smallest,
            largest,
            median,
            deviation,
            limit: self.limit,
            verdict,
            worst: self.worst.as_ref().map(|(_, point)| point.clone()),
        }
    }
}

/// Joins the tallies of the same laws on several maps, in their first order.
pub fn merged(tallies: impl IntoIterator<Item = Tally>) -> Vec<Tally> {
    let mut out: Vec<Tally> = Vec::new();
    for other in tallies {
        match out.iter_mut().find(|t| t.equation == other.equation && t.law == other.law) {
            Some(tally) => tally.merge(other),
            None => out.push(other),
        }
    }
    out
}
