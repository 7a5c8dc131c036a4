//! Stroboscopic averaging: long times in steps of the slow motion.

use super::numerical_method::NumericalMethod;
use super::parts::{check_periodic_parts, each_splittable};
use super::request::{Method, Request};
use super::{MicroSteps, Splitting, SplittingSteps};
use crate::error::Error;
use crate::scalar::{Elementary, Over, Pack};
use crate::system::{Splittable, System};
use serde::{Deserialize, Serialize};

/// The flow over many fast periods P = 2π/ω₀, by an averaged equation that is computed from the map M over one period:
/// where M is near the identity, z at whole periods is on a trajectory of
///
/// dZ/dt = F(Z) = (8(M − M⁻¹) − (M² − M⁻²))Z / 12P + O(ε⁵P⁴),
///
/// or of another central difference of M^k. Classical Runge–Kutta steps integrate this slow motion. M is computed by
/// steps of a splitting: a few of ABA(10,6,4), or Strang's, whose equally spaced kicks average over the circle by the
/// trapezoidal rule. A step costs 8m periods with m differences, however long it is. Errors are O(ε²ᵐ), in addition
/// to those of both methods, and rounding errors of M are amplified by ε⁻¹. Without central differences,
/// F = (M − Id)Z / P: a step costs four periods, and errors are O(ε).
///
/// Source: Calvo, Chartier, Murua and Sanz-Serna, <https://doi.org/10.1016/j.apnum.2011.06.007>.
#[derive(Clone, Debug)]
pub struct Stroboscopic {
    period: f64,
    /// Whole periods, as a time.
    slow: f64,
    forward: SplittingSteps<f64>,
    backward: SplittingSteps<f64>,
    /// Steps of the splitting in a period.
    micro: usize,
    /// Of M^k − Id and of Id − M^−k, k = 1 …, over P.
    weights: &'static [f64],
    /// Whether the differences are central and so need periods backwards in time too.
    central: bool,
    rest: SplittingSteps<f64>,
    rest_steps: usize,
}

/// Steps of ABA(10,6,4) for a part of a period, none longer than this, and their number.
pub(super) fn rest_of(
    system: &impl Splittable,
    time: f64,
    longest: f64,
) -> (SplittingSteps<f64>, usize) {
    let count = ((time / longest).abs().ceil() as usize).max(1);
    (Splitting::ABA_1064.steps(system, time / count as f64), count)
}

/// The longest step of ABA(10,6,4) in a part of a period whose other steps are Strang's, over the period.
pub(super) const LONGEST_REST: f64 = 1.0 / 6.0;

impl Stroboscopic {
    /// The largest number of central differences of an integrator; its error is estimated with one more.
    pub const MOST_DIFFERENCES: usize = 3;

    /// The method over `time`, with a splitting and the number `micro` of its steps in a period, and `differences`
    /// central differences, or the forward difference if 0. Steps of ABA(10,6,4) integrate the remainder beyond whole
    /// periods.
    ///
    /// # Panics
    /// When `micro` is 0, or there are more than 4 differences.
    pub fn new(
        system: &impl Splittable,
        time: f64,
        (splitting, micro): (Splitting, usize),
        differences: usize,
    ) -> Self {
        assert!(micro > 0);
        let weights: &[f64] = match differences {
            0 => &[1.0],
            1 => &[1.0 / 2.0],
            2 => &[8.0 / 12.0, -1.0 / 12.0],
            3 => &[45.0 / 60.0, -9.0 / 60.0, 1.0 / 60.0],
            4 => &[672.0 / 840.0, -168.0 / 840.0, 32.0 / 840.0, -3.0 / 840.0],
            _ => panic!("{differences} differences"),
        };
        let period = std::f64::consts::TAU / system.limiting_frequency();
        let periods = (time / period).trunc();
        let rest = (-periods).mul_add(period, time);
        let step = period / micro as f64;
        let steps = |h: f64| splitting.steps(system, h);
        let own = splitting == Splitting::ABA_1064;
        let longest = if own { step } else { LONGEST_REST * period };
        let (rest, rest_steps) = rest_of(system, rest, longest);
        Self {
            period,
            slow: periods * period,
            forward: steps(step),
            backward: steps(-step),
            micro,
            weights,
            central: differences > 0,
            rest,
            rest_steps,
        }
    }

    /// z ← the flow, in `count` steps of the averaged equation: 2n numbers for each point, all points together.
    ///
    /// # Panics
    /// When `count` is 0 or z is not of whole points.
    #[inline(always)]
    pub fn take<S: Over<f64> + Elementary>(
        &self,
        system: &impl Splittable,
        z: &mut [S],
        count: usize,
    ) {
        assert!(count > 0);
        let size = if self.slow == 0.0 { 0 } else { z.len() };
        let h = self.slow / count as f64;
        let mut space = vec![S::zero(); 4 * size];
        let (stage, others) = space.split_at_mut(size);
        let (sum, others) = others.split_at_mut(size);
        let (slope, moved) = others.split_at_mut(size);
        for _ in 0..if size > 0 { count } else { 0 } {
            sum.fill(S::zero());
            stage.copy_from_slice(z);
            for (advance, weight) in [(0.5, 1.0), (0.5, 2.0), (1.0, 2.0), (0.0, 1.0)] {
                self.averaged(system, stage, slope, moved);
                for i in 0..size {
                    sum[i] = S::from_f64(weight).mul_add(slope[i], sum[i]);
                    stage[i] = S::from_f64(advance * h).mul_add(slope[i], z[i]);
                }
            }
            for i in 0..size {
                z[i] = S::from_f64(h / 6.0).mul_add(sum[i], z[i]);
            }
        }
        self.rest.take(system, z, self.rest_steps);
    }

    /// Computes the vector field F of the slow motion by differences of period maps, `slope` ← F(z).
    #[inline(always)]
    fn averaged<S: Over<f64> + Elementary>(
        &self,
        system: &impl Splittable,
        z: &[S],
        slope: &mut [S],
        moved: &mut [S],
    ) {
        slope.fill(S::zero());
        let sides = [(&self.forward, 1.0), (&self.backward, -1.0)];
        for &(steps, sign) in &sides[..if self.central { 2 } else { 1 }] {
            moved.copy_from_slice(z);
            for weight in self.weights {
                steps.take(system, moved, self.micro);
                let weight = S::from_f64(sign * weight / self.period);
                for i in 0..z.len() {
                    // Of differences, which are small: nothing is lost in the sum.
                    slope[i] = weight.mul_add(moved[i] - z[i], slope[i]);
                }
            }
        }
    }
}

/// The BibTeX entry of the article on stroboscopic averaging.
const BIBTEX: &str = "@article{CalvoEtAl2011,
  author = {Calvo, Mari Paz and Chartier, Philippe and Murua, Ander and Sanz-Serna, Jes\\'us Mar\\'ia},
  title = {Numerical stroboscopic averaging for {ODE}s and {DAE}s},
  journal = {Applied Numerical Mathematics},
  volume = {61},
  number = {10},
  pages = {1077--1095},
  year = {2011},
  doi = {10.1016/j.apnum.2011.06.007}
}
";

/// [`Stroboscopic`] as scenes declare it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StroboscopicSettings {
    /// Steps of a splitting in a period.
    pub micro: usize,
    /// The number m of central differences, with errors O(ε²ᵐ); 0 is the forward difference, with errors O(ε).
    #[serde(default = "two")]
    pub differences: usize,
    /// The splitting that takes the steps within a revolution.
    #[serde(default, skip_serializing_if = "MicroSteps::is_usual")]
    pub by: MicroSteps,
}

/// The differences that scenes do not name.
fn two() -> usize {
    2
}

impl StroboscopicSettings {
    /// What estimates the error of averaged equations, whose own steps and angles leave some of it.
    pub(super) const REFERENCE: Self = Self { micro: 16, differences: 3, by: MicroSteps::Aba1064 };
}

impl NumericalMethod for StroboscopicSettings {
    fn name(&self) -> String {
        let (order, steps) = ((2 * self.differences).max(1), self.by.words());
        format!("stroboscopic averaging of order {order}, {} {steps} a period", self.micro)
    }

    fn bibtex(&self) -> Option<&'static str> {
        Some(BIBTEX)
    }

    fn check(&self) -> Result<(), Error> {
        Error::check_count_range("micro", self.micro, 1, 1000)?;
        let most = Stroboscopic::MOST_DIFFERENCES;
        Error::check_count_range("differences", self.differences, 0, most)
    }

    fn check_for(&self, system: &System) -> Result<(), Error> {
        check_periodic_parts(self, system)
    }

    fn finer(&self) -> Option<Box<dyn NumericalMethod>> {
        // A finer map of a period and one more difference, since more steps do not reduce those errors.
        let (micro, differences) = (2 * self.micro, self.differences + 1);
        Some(Box::new(Self { micro, differences, by: self.by }))
    }

    fn trajectories(
        &self,
        request: &Request,
        system: &System,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        Error::check_count_range("steps", request.steps, 1, usize::MAX)?;
        let micro = (self.by.splitting(), self.micro);
        each_splittable!(self, system, system => {
            let method = Stroboscopic::new(system, request.interval, micro, self.differences);
            request.step(&method, system, initial)
        })
    }
}

impl<H: Splittable> Method<H> for Stroboscopic {
    type Known<V: Pack> = ();

    #[inline(always)]
    fn take<V: Pack>(&self, system: &H, z: &mut [V], _: &[()], _: f64, steps: usize) {
        Stroboscopic::take(self, system, z, steps);
    }
}
