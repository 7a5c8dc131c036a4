//! The results of a law over its samples, and the verdict on them.

use super::inversion::Conditioned;
use serde::{Deserialize, Serialize};

/// The limit of ratios: every ratio must stay below it.
pub const RATIO_LIMIT: f64 = 10.0;
/// Slopes in ε may fall short of 1 and 2 by this; they may exceed them, as they
/// do where the potentials are odd and the leading term vanishes.
pub const SLOPE_LIMIT: f64 = 0.1;
/// The limit of a count of components, which must be 0.
pub const COUNT_LIMIT: f64 = 0.5;
/// The least upper decile of ρ_S for a computation with rounding errors. If it is
/// smaller, all but a few samples saturate or make no error at all, and the test
/// shows nothing.
pub const SOUND_DECILE: f64 = 0.05;
/// The least upper decile of the nonzero values of other ratios. (Many of these are 0
/// because a step was undone to the last bit.) It is 0.2 to 0.6 for every law on clean
/// networks (`verification/soundness.rs`); scales that are a thousand times as large as
/// the errors hide defects of that size.
pub const SOUND_DEVIATION: f64 = 0.01;
/// The resolution that replaces visible rounding errors in maps of few or exact operations, which
/// make none: a defect of this share of the terms of an equation still has a ratio of 1.
pub const RESOLUTION: f64 = 1e-13;
/// The largest median of ratios of a sound computation. If it is larger, a defect
/// below the limit may hide among the rounding errors.
pub const SOUND_MEDIAN: f64 = 2.0;
/// The least share of samples that have to be testable, with a significant digit left.
pub const TESTABLE: f64 = 0.5;

/// The verdict of a row of the certificate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The law holds to rounding on all testable samples.
    Holds,
    /// The law is violated.
    Violated,
    /// The samples cannot show a violation of the law, so the test shows nothing.
    Vacuous,
    /// Rounding leaves no significant digit to test on more than half of the samples.
    IllConditioned,
    /// A figure for information: nothing is concluded from it.
    Reported,
}

impl Verdict {
    /// The verdict in one word, for tables.
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

/// The result of one law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The name of the law.
    pub law: String,
    /// The equation that is tested.
    pub equation: String,
    /// The number of samples, with those that are ill-conditioned.
    pub samples: usize,
    /// The number of samples on which rounding leaves no digit to test.
    pub ill_conditioned: usize,
    /// The smallest result, where there is one.
    pub smallest: Option<f64>,
    /// The largest result: a ratio, a count of components for bitwise laws, or the shortfall of the
    /// order for slopes. None where no sample could be tested or a result was NaN.
    pub largest: Option<f64>,
    /// The median of the results.
    pub median: Option<f64>,
    /// The upper decile of the results that are not 0, if there are any.
    pub deviation: Option<f64>,
    /// The limit that `largest` must stay below.
    pub limit: f64,
    /// Whether the law holds on these samples.
    pub verdict: Verdict,
    /// The point of the largest result, or of a result that is NaN; None where results do not
    /// belong to points.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worst: Option<Vec<f64>>,
}

impl Row {
    /// The factor by which `largest` would have to grow to reach the limit; None
    /// where nothing was measured or nothing deviated.
    pub fn headroom(&self) -> Option<f64> {
        self.largest.filter(|largest| *largest > 0.0).map(|largest| self.limit / largest)
    }
}

/// What is asked of the scales behind ratios, so that no law holds because its scales
/// are too large.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Soundness {
    /// Nothing: the results are no ratios.
    Any,
    /// The upper decile of the nonzero results has to reach [`SOUND_DEVIATION`].
    Deviations,
    /// The upper decile of all results has to reach [`SOUND_DECILE`].
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

    /// A law on the order in ε of a quantity that vanishes with ε: its results
    /// are the shortfalls of the order, one for each map.
    pub fn of_slopes(law: impl Into<String>, equation: impl Into<String>) -> Self {
        Self::new(law, equation, SLOPE_LIMIT)
    }

    /// A law with a limit of its own.
    pub fn with_limit(law: impl Into<String>, equation: impl Into<String>, limit: f64) -> Self {
        Self::new(law, equation, limit)
    }

    /// Requires nothing of the size of the ratios. This is for worst-case bounds, which grow
    /// with the length of a computation far beyond its errors. Their resolution has to be
    /// checked where they are computed.
    pub fn of_worst_case(self) -> Self {
        Self { soundness: Soundness::Any, ..self }
    }

    /// Makes the law vacuous where the upper decile is below [`SOUND_DECILE`]: rounding
    /// errors have to show.
    pub fn must_show_errors(self) -> Self {
        Self { soundness: Soundness::Errors, ..self }
    }

    /// Declares, if `resolved`, that the scales are small to [`RESOLUTION`] whatever the
    /// errors are, so that no rounding errors have to show.
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

    /// The equation that is tested.
    pub fn equation(&self) -> &str {
        &self.equation
    }

    /// Adds the result of one sample.
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

    /// Adds samples, each with its point: `points` has `dim` numbers for each result, in order.
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

    /// Adds the results of several samples.
    pub fn extend(mut self, results: impl IntoIterator<Item = Conditioned>) -> Self {
        for result in results {
            self.push(result);
        }
        self
    }

    /// Declares, if `vacuous`, that the samples cannot show a violation.
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

    /// The row of the certificate that the samples give.
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

/// Merges the tallies of the same law on several maps, in the order in which laws first appear.
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
