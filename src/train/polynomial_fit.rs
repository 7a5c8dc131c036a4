//! From pairs to a symplectic polynomial.

use super::fit_note::SURE_DENSITY;
use super::judgement::repeated_inputs;
use super::{Control, FitNote, MirrorDefect, ReversalDefect};
use crate::error::Error;
use crate::flow::{Pairs, PolynomialOnSection, Symmetries, SymplecticPolynomial, TwoFits};
use crate::network::Rollout;
use crate::phase::Section;
use crate::random::Stream;
use crate::scalar::max_or_nan;
use serde::Serialize;

/// What is asked for of a [`SymplecticPolynomial`] that is fitted to pairs of a file.
///
/// Nothing is trained: for each degree the fit is one of linear least squares. Where no degree is given, degrees are
/// raised from 2 on, until the error on held-out pairs is one of rounding, or has not fallen by a tenth in
/// [`PolynomialFit::PATIENCE`] fits, or the pairs are too few; the last one that made it fall by a tenth is taken. What
/// falls is the largest over coordinates of their error over their own spread.
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
    /// The number of coefficients of its generating function.
    pub parameters: usize,
    /// How many iterations of Newton's method a step takes.
    pub iterations: usize,
    /// The root mean square distance of the images of the fitted pairs from theirs, in units of the data.
    pub error: f64,
    /// The root mean square distance of the images of held-out pairs from theirs; None without such pairs.
    pub held_out: Option<f64>,
    /// The largest, over the coordinates, of the root mean square error divided by the spread of the coordinate among
    /// the images; on held-out pairs where there are some.
    pub share: f64,
}

/// A polynomial that was fitted.
#[derive(Clone, Debug)]
pub struct FittedPolynomial {
    /// The fitted polynomial, with its section and box.
    pub map: PolynomialOnSection,
    /// The degrees that were tried, without those of which Newton's method found no images.
    pub trials: Vec<PolynomialTrial>,
    /// How many pairs it was fitted to.
    pub pairs: usize,
    /// The number of pairs that were held out.
    pub held_out: usize,
    /// The SHA-256 of all pairs, those held out too.
    pub digest: String,
    /// The notes that reports give about the pairs.
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
    /// An error of this share of the spread is one of rounding.
    const ROUNDING: f64 = 10.0 * f64::EPSILON;
    /// An error that falls by less than this factor is no improvement.
    const BETTER: f64 = 0.9;

    /// Fits the polynomial. `observe` is shown each degree that was tried, and says whether to go on.
    ///
    /// # Errors
    /// Those of [`PolynomialOnSection::fit`]; when no degree is given and no pairs are held out; [`Error::Stopped`]
    /// when `observe` asks to stop, and its errors.
    pub fn run(
        &self,
        pairs: Pairs,
        observe: &mut dyn FnMut(&PolynomialTrial) -> Result<Control, Error>,
    ) -> Result<FittedPolynomial, Error> {
        if !(0.0..1.0).contains(&self.validation) {
            let expected = "at least 0 and below 1";
            return Err(Error::invalid("validation", self.validation, expected));
        }
        let (digest, region, count) = (pairs.digest(), pairs.region(), pairs.len());
        let region = region.ok_or_else(|| Error::invalid("pairs", "none", "at least one"))?;
        let spreads = spreads(&pairs);
        let all = pairs.clone();
        let mut stream = Stream::new(self.seed, "validation");
        let (pairs, held_out) = pairs.split(self.validation, &mut stream);
        if let (None, None) = (self.degree, &held_out) {
            let found = format!("{} of {count} pairs", self.validation);
            let expected = "a share that is at least one pair, by which to choose the degree";
            return Err(Error::invalid("validation", found, expected));
        }
        let repeated = held_out
            .as_ref()
            .map_or([0; 2], |held_out| [repeated_inputs(&pairs, held_out), held_out.len()]);
        let judged = |map: &PolynomialOnSection, pairs: &Pairs| -> Result<(f64, f64), Error> {
            Ok((map.error_on(pairs)?, largest_share(map, pairs, &spreads)?))
        };
        let terms = |degree| SymplecticPolynomial::terms(pairs.dof(), degree, &self.symmetries);
        let least = self.degree.unwrap_or(2);
        let (mut trials, mut best) = (Vec::<PolynomialTrial>::new(), None::<(f64, _)>);
        let (mut degree, mut in_vain, mut failure) = (least, 0, None);
        loop {
            let is_first = degree == least;
            if !is_first && !SymplecticPolynomial::has_enough(&pairs, degree, &self.symmetries)? {
                break;
            }
            let section = self.section.clone();
            match PolynomialOnSection::fit(&pairs, degree, &self.symmetries, section) {
                Ok(map) => {
                    let (error, share) = judged(&map, &pairs)?;
                    let of_others =
                        held_out.as_ref().map(|pairs| judged(&map, pairs)).transpose()?;
                    let share = of_others.map_or(share, |(_, share)| share);
                    let trial = PolynomialTrial {
                        degree,
                        parameters: map.map().parameters(),
                        iterations: map.map().iterations(),
                        error,
                        held_out: of_others.map(|(error, _)| error),
                        share,
                    };
                    if observe(&trial)? == Control::Interrupt {
                        return Err(Error::Stopped { what: "the fit of a polynomial".into() });
                    }
                    trials.push(trial);
                    let is_better = |least: f64| {
                        share < Self::BETTER * least || least.is_nan() && !share.is_nan()
                    };
                    if best.as_ref().is_none_or(|(least, _)| is_better(*least)) {
                        best = Some((share, map));
                        in_vain = 0;
                    } else {
                        in_vain += 1;
                    }
                }
                Err(reason @ Error::NoConvergence { .. }) => {
                    in_vain += usize::from(best.is_some());
                    failure = Some(reason);
                }
                // What is found already is kept.
                Err(_) if best.is_some() => break,
                Err(reason) => return Err(reason),
            }
            let is_rounding = best.as_ref().is_some_and(|(share, _)| *share <= Self::ROUNDING);
            if self.degree.is_some() || is_rounding || in_vain >= Self::PATIENCE {
                break;
            }
            // Degrees that add no term are passed over.
            let own = terms(degree);
            degree += 1;
            while own.is_some() && terms(degree) == own {
                degree += 1;
            }
        }
        match (best, failure) {
            (Some((_, map)), _) => Ok(FittedPolynomial {
                map: map.with_region(region)?,
                trials,
                pairs: pairs.len(),
                held_out: held_out.as_ref().map_or(0, Pairs::len),
                digest,
                notes: self.notes(&all, repeated)?,
            }),
            (None, Some(reason)) => {
                // Pairs that keep no area have no such images, whatever the degree.
                let notes = self.notes(&all, repeated).unwrap_or_default();
                let of_pairs = |note: &FitNote| match note {
                    FitNote::Form(defect, on_section) if defect.median > FAR_FROM_SYMPLECTIC => {
                        let found =
                            format!("ones that keep areas up to {:.1e} only", defect.median);
                        let expected = match on_section {
                            true => "pairs that keep the area of their section",
                            false => "pairs of a symplectic map, in canonical coordinates",
                        };
                        Some(Error::invalid("pairs", found, expected))
                    }
                    _ => None,
                };
                Err(notes.iter().find_map(of_pairs).unwrap_or(reason))
            }
            (None, None) => unreachable!("the first degree is tried"),
        }
    }

    /// What is to be said of the pairs, of which so many out of all held-out ones repeat inputs.
    fn notes(
        &self,
        pairs: &Pairs,
        [repeated, held_out]: [usize; 2],
    ) -> Result<Vec<FitNote>, Error> {
        let mut notes = Vec::new();
        notes.extend((repeated > 0).then_some(FitNote::Repeated(repeated, held_out)));
        let error = self.section.as_ref().map_or(0.0, Section::error);
        notes.extend((!(error <= SURE_DENSITY)).then_some(FitNote::Density(error)));
        let canonical = match &self.section {
            None => pairs.clone(),
            Some(section) => pairs.transformed("pairs", |_, points| {
                section.to_canonical(points);
                Ok(())
            })?,
        };
        let Some(fits) = TwoFits::fit(&canonical) else { return Ok(notes) };
        let defect = fits.form_defect(&canonical);
        if defect.is_seen(self.section.as_ref().map_or(0.0, Section::error)) {
            notes.push(FitNote::Form(defect, self.section.is_some()));
        }
        let reversor = self.symmetries.reversor;
        notes.extend(
            ReversalDefect::of_model(&canonical, &fits, reversor, true).map(FitNote::Reversal),
        );
        let mirror = MirrorDefect::worth_saying(&canonical, &fits, &self.symmetries.mirrored);
        notes.extend(mirror.map(FitNote::Mirror));
        Ok(notes)
    }
}

/// Pairs that keep areas better than this may have no images for other reasons, as where midpoints fold.
const FAR_FROM_SYMPLECTIC: f64 = 1e-3;

/// The root mean square distance of each coordinate of the images from its mean.
fn spreads(pairs: &Pairs) -> Vec<f64> {
    let (dim, count) = (2 * pairs.dof(), pairs.len() as f64);
    let of = |k: usize| {
        let column = || pairs.output().iter().skip(k).step_by(dim);
        let mean = column().sum::<f64>() / count;
        libm::sqrt(column().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count)
    };
    (0..dim).map(of).collect()
}

/// The largest over coordinates of their root mean square error over their spread.
fn largest_share(map: &PolynomialOnSection, pairs: &Pairs, spreads: &[f64]) -> Result<f64, Error> {
    let (dim, count) = (spreads.len(), pairs.len() as f64);
    let images = map.rollout(pairs.input(), Rollout { steps: 1, every: 1 })?;
    let apart = images[pairs.input().len()..].iter().zip(pairs.output()).map(|(a, b)| a - b);
    let mut squares = vec![0.0; dim];
    for (k, off) in apart.enumerate() {
        squares[k % dim] += off * off;
    }
    let shares = squares.iter().zip(spreads).map(|(sum, spread)| libm::sqrt(sum / count) / spread);
    Ok(shares.fold(0.0, max_or_nan))
}
