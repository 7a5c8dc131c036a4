//! Multi-revolution compositions: many fast periods by a few periods with a larger perturbation.

use super::numerical_method::NumericalMethod;
use super::parts::{check_periodic_parts, each_splittable};
use super::request::{Method, Request};
use super::stroboscopic::{LONGEST_REST, StroboscopicSettings, rest_of};
use super::{MicroSteps, Splitting, SplittingSteps};
use crate::error::Error;
use crate::scalar::{Dual, Elementary, Over, Pack, Scalar};
use crate::system::{Splittable, System};
use faer::Side;
use faer::linalg::solvers::Solve;
use serde::{Deserialize, Serialize};

/// The flow over many fast periods P = 2π/ω₀, by a few periods of a system that is perturbed more strongly.
///
/// With φ_ε the map over one period, the map over N periods is approximated by
///
/// φ_ε^N ≈ φ_{α_s Nε} ∘ φ*_{β_s Nε} ∘ … ∘ φ_{α₁Nε} ∘ φ*_{β₁Nε}, φ*_ε = φ_{−ε}⁻¹,
///
/// a composition of 2s periods, each with ε replaced by α_i Nε, or, backwards in time, by −β_i Nε. N need not be whole.
/// A period is made of steps of a splitting of the system with the larger ε, symplectic where those are.
/// Order p = 2 has s = 1, α = (1 + 1/N)/2 and β = (1 − 1/N)/2; order p = 4 has s = 6. Errors are O((Nε)^(p+1)) in
/// each step, in addition to those of the splitting in a period. The remainder of the time beyond whole periods
/// is integrated by steps of ABA(10,6,4).
///
/// Source: Chartier, Makazaga, Murua and Vilmart, <https://doi.org/10.1007/s00211-013-0602-0>.
#[derive(Clone, Debug)]
pub struct MultiRevolution {
    /// The periods of a composition, in turn.
    periods: Vec<SplittingSteps<f64>>,
    /// Steps of the splitting in a period.
    micro: usize,
    rest: SplittingSteps<f64>,
    rest_steps: usize,
}

impl MultiRevolution {
    /// The method over `time`, in `count` compositions of this order, 2 or 4; `micro` is the splitting and the number
    /// of its steps in a period.
    ///
    /// # Panics
    /// When a count is 0, or the order is another one.
    pub fn new(
        system: &impl Splittable,
        time: f64,
        count: usize,
        micro: (Splitting, usize),
        order: usize,
    ) -> Self {
        Self::of_shares(system, time, count, micro, |revolutions| Self::shares(order, revolutions))
    }

    /// The coefficients β₁, α₁, … β_s, α_s of this order, 2 or 4, for N revolutions.
    ///
    /// # Panics
    /// When the order is another one.
    pub fn shares(order: usize, revolutions: f64) -> Vec<f64> {
        match order {
            2 => vec![0.5 - 0.5 / revolutions, 0.5 + 0.5 / revolutions],
            4 => fourth_order(1.0 / revolutions).to_vec(),
            _ => panic!("order {order}"),
        }
    }

    /// [`MultiRevolution::new`] with other coefficients β₁, α₁, …, which `shares` gives as a function of N.
    ///
    /// # Panics
    /// When a count is 0.
    pub fn of_shares(
        system: &impl Splittable,
        time: f64,
        count: usize,
        (splitting, micro): (Splitting, usize),
        shares: impl Fn(f64) -> Vec<f64>,
    ) -> Self {
        assert!(count > 0 && micro > 0, "{count} compositions, {micro} steps in a period");
        let period = std::f64::consts::TAU / system.limiting_frequency();
        let whole = (time / period).trunc();
        let rest = (-whole).mul_add(period, time);
        let (rest, rest_steps) = rest_of(system, rest, LONGEST_REST * period);
        let (step, revolutions) = (period / micro as f64, whole / count as f64);
        let shares = if whole == 0.0 { Vec::new() } else { shares(revolutions) };
        let of = |(number, share): (usize, f64)| {
            // Those of even number are adjoint maps: the limit goes backwards, and the perturbation does not.
            let sign = if number.is_multiple_of(2) { -1.0 } else { 1.0 };
            let factor = sign * share * revolutions;
            splitting.steps_perturbed(system, sign * step, factor)
        };
        let periods = shares.into_iter().enumerate().map(of).collect();
        Self { periods, micro, rest, rest_steps }
    }

    /// So many steps and no composition: one method on lanes serves both.
    pub(super) fn of_steps(steps: SplittingSteps<f64>, count: usize) -> Self {
        Self { periods: Vec::new(), micro: 0, rest: steps, rest_steps: count }
    }

    /// z ← the flow, in `count` compositions: 2n numbers for each point, all points together.
    ///
    /// # Panics
    /// When z is not of whole points.
    #[inline(always)]
    pub fn take<S: Over<f64> + Elementary>(
        &self,
        system: &impl Splittable,
        z: &mut [S],
        count: usize,
    ) {
        let in_turn = self.periods.len() * count;
        // One call, which is compiled once.
        for number in 0..=in_turn {
            let (steps, count) = if number < in_turn {
                (&self.periods[number % self.periods.len()], self.micro)
            } else {
                (&self.rest, self.rest_steps)
            };
            steps.take(system, z, count);
        }
    }
}

/// Periods of a composition of order 4.
const PERIODS: usize = 12;

/// β₁, α₁, … of order 4 where 1/N is 0: the splitting S₆ of Blanes and Moan,
/// <https://doi.org/10.1016/S0377-0427(01)00492-7>, table 2, whose coefficients are sums of two neighbours.
fn fourth_order_of_many() -> [f64; PERIODS] {
    let a = [0.079_203_696_431_195_7, 0.353_172_906_049_774, -0.042_065_080_357_719_5];
    let b = [0.209_515_106_613_362, -0.143_851_773_179_818];
    let sums = [a[0], b[0], a[1], b[1], a[2], 0.5 - b[0] - b[1]];
    let mut out = [0.0; PERIODS];
    let mut before = 0.0;
    for (number, sum) in sums.iter().enumerate() {
        before = sum - before;
        out[number] = before;
        out[PERIODS - 1 - number] = before;
    }
    out
}

/// The same at another 1/N; NaN where none are found, of one revolution or less.
fn fourth_order(share: f64) -> [f64; PERIODS] {
    let many = fourth_order_of_many();
    // From where N is infinite, at once or in steps of 1/N.
    let follow = |steps: u32| {
        let shares = (1..=steps).map(|step| share * f64::from(step) / f64::from(steps));
        shares.into_iter().try_fold(many, nearest_fourth_order)
    };
    follow(1).or_else(|| follow(16)).unwrap_or([f64::NAN; PERIODS])
}

/// Numbers near these that fulfil the conditions of order 4 at 1/N, by the method of Gauss and Newton.
fn nearest_fourth_order(mut shares: [f64; PERIODS], one_over_n: f64) -> Option<[f64; PERIODS]> {
    const ITERATIONS: usize = 10;
    for _ in 0..ITERATIONS {
        let lifted: [_; PERIODS] =
            std::array::from_fn(|k| Dual::<f64, PERIODS>::variable(shares[k], k));
        let conditions = conditions(&lifted, one_over_n);
        if conditions.iter().all(|missed| missed.re.abs() < 1e-14) {
            return Some(shares);
        }
        let slopes = faer::Mat::from_fn(CONDITIONS, PERIODS, |i, k| conditions[i].eps[k]);
        let missed = faer::Mat::from_fn(CONDITIONS, 1, |i, _| conditions[i].re);
        let factor = (&slopes * slopes.transpose()).llt(Side::Lower).ok()?;
        let correction = slopes.transpose() * factor.solve(&missed);
        for (share, k) in shares.iter_mut().zip(0..) {
            *share -= correction[(k, 0)];
        }
    }
    None
}

/// Words of the letters X₁ … X₄ of weight 1 … 4, up to weight 4, that are smaller than their rotations: what they
/// count determines all others.
const LYNDON: [&[usize]; CONDITIONS] = [&[1], &[2], &[3], &[1, 2], &[4], &[1, 3], &[1, 1, 2]];
const CONDITIONS: usize = 7;

/// What a composition lacks to be the N-th power of the map, up to order 4.
///
/// With φ_h = exp(hX₁ + h²X₂ + …), φ*_h = exp(hX₁ − h²X₂ + …) and H = Nε, the power is exp(HX₁ + H²/N X₂ + H³/N² X₃ +
/// …). Both are series of words in the X_k, which agree where the coefficients of [`LYNDON`] words do.
fn conditions<S: Scalar>(shares: &[S; PERIODS], one_over_n: f64) -> [S; CONDITIONS] {
    let power = [S::from_f64(1.0), S::from_f64(one_over_n)];
    let target = |weight: usize| (1..weight).fold(power[0], |value, _| value * power[1]);
    LYNDON.map(|word| {
        // Coefficients of the beginnings of the word in the product so far.
        let mut begun = vec![S::zero(); word.len() + 1];
        begun[0] = S::from_f64(1.0);
        for (number, &share) in shares.iter().enumerate() {
            let adjoint = number.is_multiple_of(2);
            let letter = |weight: usize| {
                let value = (1..weight).fold(share, |value, _| value * share);
                if adjoint && weight.is_multiple_of(2) { -value } else { value }
            };
            // From the longest on: each is made of shorter ones of the product before.
            for end in (1..=word.len()).rev() {
                for start in 0..end {
                    let factor = exponential(&word[start..end], letter);
                    begun[end] = begun[start] * factor + begun[end];
                }
            }
        }
        begun[word.len()] - exponential(word, target)
    })
}

/// The coefficient of a word in exp(Σ t_k X_k).
fn exponential<S: Scalar>(word: &[usize], t: impl Fn(usize) -> S) -> S {
    (1..).zip(word).fold(S::from_f64(1.0), |product, (place, &letter)| {
        product * t(letter) * S::from_f64(1.0 / f64::from(place))
    })
}

/// The BibTeX entry of the article on multi-revolution compositions.
const BIBTEX: &str = "@article{ChartierEtAl2014,
  author = {Chartier, Philippe and Makazaga, Joseba and Murua, Ander and Vilmart, Gilles},
  title = {Multi-revolution composition methods for highly oscillatory differential equations},
  journal = {Numerische Mathematik},
  volume = {128},
  number = {1},
  pages = {167--192},
  year = {2014},
  doi = {10.1007/s00211-013-0602-0}
}
";

/// [`MultiRevolution`] as scenes declare it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MultiRevolutionSettings {
    /// Steps of a splitting in a period.
    pub micro: usize,
    /// 2 or 4, in the size of the steps.
    pub order: usize,
    /// The splitting that takes the steps within a revolution.
    #[serde(default, skip_serializing_if = "MicroSteps::is_usual")]
    pub by: MicroSteps,
}

impl NumericalMethod for MultiRevolutionSettings {
    fn name(&self) -> String {
        let (order, micro, steps) = (self.order, self.micro, self.by.words());
        format!("multi-revolution composition of order {order}, {micro} {steps} a period")
    }

    fn bibtex(&self) -> Option<&'static str> {
        Some(BIBTEX)
    }

    fn check(&self) -> Result<(), Error> {
        Error::check_count_range("micro", self.micro, 1, 1000)?;
        match self.order {
            2 | 4 => Ok(()),
            order => Err(Error::invalid("order", order, "2 or 4")),
        }
    }

    fn check_for(&self, system: &System) -> Result<(), Error> {
        check_periodic_parts(self, system)
    }

    fn finer(&self) -> Option<Box<dyn NumericalMethod>> {
        // More steps do not reduce the error of a period.
        Some(Box::new(StroboscopicSettings::REFERENCE))
    }

    fn trajectories(
        &self,
        request: &Request,
        system: &System,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        Error::check_count_range("steps", request.steps, 1, usize::MAX)?;
        let (time, count) = (request.interval, request.steps);
        let micro = (self.by.splitting(), self.micro);
        each_splittable!(self, system, system => {
            let method = MultiRevolution::new(system, time, count, micro, self.order);
            request.step(&method, system, initial)
        })
    }
}

impl<H: Splittable> Method<H> for MultiRevolution {
    type Known<V: Pack> = ();

    #[inline(always)]
    fn take<V: Pack>(&self, system: &H, z: &mut [V], _: &[()], _: f64, steps: usize) {
        MultiRevolution::take(self, system, z, steps);
    }
}
