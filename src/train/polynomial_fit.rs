//! From pairs to a symplectic polynomial.

use super::{Control, FitNote, ReversalDefect};
use crate::error::Error;
use crate::flow::{Pairs, PolynomialOnSection, Symmetries, SymplecticPolynomial, TwoFits};
use crate::phase::Section;
use crate::random::Stream;
use serde::Serialize;

/// What is asked for of a [`SymplecticPolynomial`] that is fitted to pairs of a file.
///
/// Nothing is trained: for each degree the fit is one of linear least squares. Where no degree is given, degrees are
/// raised from 2 on, until the error on held-out pairs is one of rounding, or has not fallen by a tenth in
/// [`PolynomialFit::PATIENCE`] of them, or the pairs are too few; the last one that made it fall is taken.
///
/// ```
/// use gyroceptron::flow::Pairs;
/// use gyroceptron::train::{Control, PolynomialFit};
///
/// // Hénon's map.
/// let input: Vec<f64> = (0..800).map(|k| (0.7 * f64::from(k * k % 331)).sin() * 0.5).collect();
/// let output = input.chunks(2).flat_map(|z| [0.3 * z[0] + z[1] - z[0] * z[0], -z[0]]).collect();
/// let pairs = Pairs::new("henon", 1, input, output)?;
/// let fitted = PolynomialFit::default().run(pairs, &mut |_| Ok(Control::Continue))?;
/// assert_eq!(fitted.map.map().degree(), 3);
/// assert!(fitted.chosen().held_out < Some(1e-14));
/// # Ok::<(), gyroceptron::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct PolynomialFit {
    /// The total degree of the generating function; None: it is found.
    pub degree: Option<usize>,
    /// What the map has in common with its reflections, in canonical coordinates.
    pub symmetries: Symmetries,
    /// The charts of pairs whose columns are x₁ … xₙ, y₁ … yₙ with another area form than dq∧dp. None: the columns
    /// are canonical.
    pub section: Option<Section>,
    /// The share of the pairs that is held out.
    pub validation: f64,
    /// The seed of the held-out choice.
    pub seed: u64,
}

impl Default for PolynomialFit {
    fn default() -> Self {
        let symmetries = Symmetries::default();
        Self { degree: None, symmetries, section: None, validation: 0.1, seed: 0 }
    }
}

/// A degree that was tried.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PolynomialTrial {
    /// The total degree of the generating function.
    pub degree: usize,
    /// How many coefficients it has.
    pub parameters: usize,
    /// How many iterations of Newton's method a step takes.
    pub iterations: usize,
    /// The root mean square distance of the images of the fitted pairs from theirs, in units of the data.
    pub error: f64,
    /// The same for held-out pairs.
    pub held_out: Option<f64>,
}

/// A polynomial that was fitted.
#[derive(Clone, Debug)]
pub struct FittedPolynomial {
    /// The map.
    pub map: PolynomialOnSection,
    /// The degrees that were tried, without those of which Newton's method found no images.
    pub trials: Vec<PolynomialTrial>,
    /// How many pairs it was fitted to.
    pub pairs: usize,
    /// How many were held out.
    pub held_out: usize,
    /// The root mean square distance of the images of all pairs from their mean, in units of the data.
    pub spread: f64,
    /// SHA-256 of the pairs.
    pub digest: String,
    /// What is to be said of the pairs.
    pub notes: Vec<FitNote>,
}

impl FittedPolynomial {
    /// The trial of the degree that was taken.
    pub fn chosen(&self) -> &PolynomialTrial {
        let degree = self.map.map().degree();
        let own = self.trials.iter().find(|trial| trial.degree == degree);
        own.expect("the map is that of a trial")
    }
}

impl PolynomialFit {
    /// So many degrees are tried without an improvement.
    pub const PATIENCE: usize = 3;
    /// An error of this share of the spread of the images is one of rounding.
    const ROUNDING: f64 = 10.0 * f64::EPSILON;
    /// An error that falls by less than this factor is no improvement.
    const BETTER: f64 = 0.9;

    /// The fit. `observe` is shown each degree that was tried, and says whether to go on.
    ///
    /// # Errors
    /// Those of [`PolynomialOnSection::fit`]; when no degree is given and no pairs are held out; [`Error::Stopped`] when
    /// `observe` asks to stop, and its errors.
    pub fn run(
        &self,
        pairs: Pairs,
        observe: &mut dyn FnMut(&PolynomialTrial) -> Result<Control, Error>,
    ) -> Result<FittedPolynomial, Error> {
        if !(0.0..1.0).contains(&self.validation) {
            let expected = "at least 0 and below 1";
            return Err(Error::invalid("validation", self.validation, expected));
        }
        let (digest, spread) = (pairs.digest(), spread(&pairs));
        let notes = self.notes(&pairs)?;
        let mut stream = Stream::new(self.seed, "validation");
        let (pairs, held_out) = pairs.split(self.validation, &mut stream);
        if let (None, None) = (self.degree, &held_out) {
            let expected = "a share of the pairs that is not none, by which to choose the degree";
            return Err(Error::invalid("validation", self.validation, expected));
        }
        let least = self.degree.unwrap_or(2);
        let (mut trials, mut best) = (Vec::new(), None::<(f64, PolynomialOnSection)>);
        let (mut last_better, mut failure) = (least, None);
        let mut degree = least;
        loop {
            let is_first = degree == least;
            if !is_first && !SymplecticPolynomial::has_enough(&pairs, degree, &self.symmetries)? {
                break;
            }
            let section = self.section.clone();
            match PolynomialOnSection::fit(&pairs, degree, &self.symmetries, section) {
                Ok(map) => {
                    let held_out =
                        held_out.as_ref().map(|pairs| map.error_on(pairs)).transpose()?;
                    let trial = PolynomialTrial {
                        degree,
                        parameters: map.map().parameters(),
                        iterations: map.map().iterations(),
                        error: map.error_on(&pairs)?,
                        held_out,
                    };
                    if observe(&trial)? == Control::Interrupt {
                        return Err(Error::Stopped { what: "the fit of a polynomial".into() });
                    }
                    let error = held_out.unwrap_or(trial.error);
                    trials.push(trial);
                    let is_better = |least: f64| {
                        error < Self::BETTER * least || least.is_nan() && !error.is_nan()
                    };
                    if best.as_ref().is_none_or(|(least, _)| is_better(*least)) {
                        best = Some((error, map));
                        last_better = degree;
                    }
                }
                Err(reason @ Error::NoConvergence { .. }) => failure = Some(reason),
                Err(reason) => return Err(reason),
            }
            let is_rounding =
                best.as_ref().is_some_and(|(error, _)| *error <= Self::ROUNDING * spread);
            if self.degree.is_some() || is_rounding || degree - last_better >= Self::PATIENCE {
                break;
            }
            degree += 1;
        }
        match (best, failure) {
            (Some((_, map)), _) => Ok(FittedPolynomial {
                map,
                trials,
                pairs: pairs.len(),
                held_out: held_out.as_ref().map_or(0, Pairs::len),
                spread,
                digest,
                notes,
            }),
            (None, Some(reason)) => Err(reason),
            (None, None) => unreachable!("the first degree is tried"),
        }
    }

    /// What is to be said of the pairs.
    fn notes(&self, pairs: &Pairs) -> Result<Vec<FitNote>, Error> {
        let mut notes = Vec::new();
        let canonical = match &self.section {
            None => pairs.clone(),
            Some(section) => {
                section.check(pairs.dof())?;
                section.check_points("input", pairs.input())?;
                section.check_points("output", pairs.output())?;
                notes.push(FitNote::Section(section.clone()));
                pairs.transformed("pairs", |_, points| {
                    section.to_canonical(points);
                    Ok(())
                })?
            }
        };
        let Some(fits) = TwoFits::of(&canonical) else { return Ok(notes) };
        let defect = fits.form_defect(&canonical);
        if defect.is_seen(self.section.as_ref().map_or(0.0, Section::error)) {
            notes.push(FitNote::Form(defect, self.section.is_some()));
        }
        let reversor = self.symmetries.reversor;
        notes.extend(
            ReversalDefect::of_model(&canonical, &fits, reversor, true).map(FitNote::Reversal),
        );
        Ok(notes)
    }
}

/// The root mean square distance of images from their mean.
fn spread(pairs: &Pairs) -> f64 {
    let dim = 2 * pairs.dof();
    let count = pairs.len() as f64;
    let of = |k: usize| {
        let column = || pairs.output().iter().skip(k).step_by(dim);
        let mean = column().sum::<f64>() / count;
        column().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count
    };
    libm::sqrt((0..dim).map(of).sum::<f64>())
}
