//! Symmetric splittings of H = H_A + εH_B.

use crate::layer::Turn;
use crate::scalar::{Elementary, Over, Real};
use crate::system::Splittable;
use serde::{Deserialize, Serialize};

/// A symmetric composition of the flows of the two parts,
/// A(a₁h) B(b₁h) A(a₂h) … A(a₁h), symplectic for every step.
///
/// The sequences of coefficients are palindromes; the first half, the middle
/// one included, is stored.
///
/// Source: Hairer, Lubich and Wanner, Geometric Numerical Integration, II.5,
/// <https://doi.org/10.1007/3-540-30666-8>.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splitting {
    /// The name used in tables.
    pub name: &'static str,
    /// The order in the step h: the error over a fixed time is O(h^order).
    pub order: usize,
    /// The number of flows of B in a step.
    pub stages: usize,
    /// a_0, a_1, … of the flows of A, up to the middle of the step: the others are those, backwards.
    pub a: &'static [f64],
    /// b_0, b_1, … of the flows of B, up to the middle of the step.
    pub b: &'static [f64],
}

impl Splitting {
    /// Strang's splitting, order 2.
    ///
    /// Source: Strang, <https://doi.org/10.1137/0705041>; of parts of sizes 1 and ε: McLachlan,
    /// <https://doi.org/10.1137/0916010>.
    pub const STRANG: Self = Self { name: "Strang", order: 2, stages: 1, a: &[0.5], b: &[1.0] };

    /// Yoshida's triple jump of Strang's splitting, order 4.
    ///
    /// Source: <https://doi.org/10.1016/0375-9601(90)90092-3>.
    pub const YOSHIDA_4: Self = Self {
        name: "Yoshida 4",
        order: 4,
        stages: 3,
        a: &[0.675_603_595_979_828_8, -0.175_603_595_979_828_8],
        b: &[1.351_207_191_959_657_6, -1.702_414_383_919_315_3],
    };

    /// ABA(8,6,4): error O(εh⁸ + ε²h⁶ + ε³h⁴), seven stages.
    ///
    /// Source: table 3 of Blanes et al.,
    /// <https://doi.org/10.1016/j.apnum.2013.01.003>.
    pub const ABA_864: Self = Self {
        name: "ABA(8,6,4)",
        order: 4,
        stages: 7,
        a: &[
            0.071_133_426_498_223_12,
            0.241_153_427_956_640_1,
            0.521_411_761_772_814_8,
            -0.333_698_616_227_678,
        ],
        b: &[
            0.183_083_687_472_197_22,
            0.310_782_859_898_574_85,
            -0.026_564_618_511_958_8,
            0.065_396_142_282_373_42,
        ],
    };

    /// ABA(10,6,4): error O(εh¹⁰ + ε²h⁶ + ε³h⁴), eight stages.
    ///
    /// Source: as [`Splitting::ABA_864`].
    pub const ABA_1064: Self = Self {
        name: "ABA(10,6,4)",
        order: 4,
        stages: 8,
        a: &[
            0.038_094_497_422_412_194,
            0.145_298_716_116_913_75,
            0.207_627_695_725_541_25,
            0.435_909_703_651_526_16,
            -0.653_861_225_832_786_7,
        ],
        b: &[
            0.095_858_880_837_075_21,
            0.204_446_153_142_998_78,
            0.217_070_347_978_991_1,
            -0.017_375_381_959_065_093,
        ],
    };

    /// All splittings of this crate.
    pub const ALL: [Self; 4] = [Self::STRANG, Self::YOSHIDA_4, Self::ABA_864, Self::ABA_1064];

    /// a_i, i = 0 … stages.
    #[inline(always)]
    pub(super) fn a(&self, i: usize) -> f64 {
        self.a[i.min(self.stages - i)]
    }

    /// b_i, i = 0 … stages − 1.
    #[inline(always)]
    pub(super) fn b(&self, i: usize) -> f64 {
        self.b[i.min(self.stages - 1 - i)]
    }

    /// Steps of size `h` of this method, ready to be taken.
    pub fn steps<S: Real>(&self, system: &impl Splittable, h: f64) -> SplittingSteps<S> {
        self.steps_by(&system.frequencies(), h, 1.0)
    }

    /// As [`Splitting::steps`], for H₀ + factor·(H − H₀) with H₀ the limit ε = 0: the perturbation is `factor` times
    /// as strong.
    pub fn steps_perturbed<S: Real>(
        &self,
        system: &impl Splittable,
        h: f64,
        factor: f64,
    ) -> SplittingSteps<S> {
        let (action, limit) = (system.circle_action(), system.limiting_frequency());
        let of_limit = action.weights().iter().map(|m| f64::from(*m) * limit);
        let frequencies = system.frequencies();
        let slow = frequencies.iter().zip(of_limit).map(|(w, limit)| (limit, w - limit));
        let scaled: Vec<f64> = slow.map(|(limit, slow)| factor.mul_add(slow, limit)).collect();
        self.steps_by(&scaled, h, factor)
    }

    fn steps_by<S: Real>(&self, frequencies: &[f64], h: f64, factor: f64) -> SplittingSteps<S> {
        let turn = |a: f64| {
            let time = S::from_f64(a * h);
            let angles: Vec<S> = frequencies.iter().map(|&w| S::from_f64(w) * time).collect();
            Turn::by_angles(&angles)
        };
        SplittingSteps {
            first: turn(self.a(0)),
            between: turn(2.0 * self.a(0)),
            inner: (1..=self.stages).map(|i| turn(self.a(i))).collect(),
            kicks: (0..self.stages).map(|i| S::from_f64(self.b(i) * h * factor)).collect(),
        }
    }

    /// z ← the flow over `time` in `steps` equal steps.
    ///
    /// # Panics
    /// When `steps` is 0 or z is not of whole points of 2n numbers.
    pub fn integrate<S: Real + Over<S>>(
        &self,
        system: &impl Splittable,
        z: &mut [S],
        time: f64,
        steps: usize,
    ) {
        assert!(steps > 0);
        self.steps(system, time / steps as f64).take(system, z, steps);
    }
}

/// Steps of fixed size of a splitting, for states of any scalar type over `P`. Their rotations
/// are computed before the first step.
#[derive(Clone, Debug)]
pub struct SplittingSteps<P> {
    first: Turn<P>,
    /// The last A of a step and the first of the next.
    between: Turn<P>,
    /// The A after each B.
    inner: Vec<Turn<P>>,
    /// The time of each B.
    kicks: Vec<P>,
}

impl<P: Real> SplittingSteps<P> {
    /// z ← `count` steps of z, for the system for which the steps were made: 2n numbers for each
    /// point. Each stage is applied to all points in turn, so that a processor works on the next
    /// point while it awaits the results of one.
    ///
    /// # Panics
    /// When z is not of whole points.
    #[inline(always)]
    pub fn take<S: Over<P> + Elementary>(
        &self,
        system: &impl Splittable,
        z: &mut [S],
        count: usize,
    ) {
        let dim = 2 * self.first.dof();
        assert!(z.len().is_multiple_of(dim));
        if count == 0 {
            return;
        }
        for z in z.chunks_exact_mut(dim) {
            system.enter(z);
            self.first.apply(z, false);
        }
        for step in 0..count {
            for (i, (&time, turn)) in self.kicks.iter().zip(&self.inner).enumerate() {
                let last = i + 1 == self.inner.len();
                let turn = if last && step + 1 < count { &self.between } else { turn };
                for z in z.chunks_exact_mut(dim) {
                    system.flow_b(z, S::embed(time));
                    turn.apply(z, false);
                }
            }
        }
        for z in z.chunks_exact_mut(dim) {
            system.leave(z);
        }
    }
}

/// The splitting whose steps a period is made of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MicroSteps {
    /// Steps of the splitting ABA(10,6,4), [`Splitting::ABA_1064`].
    #[default]
    #[serde(rename = "aba-1064")]
    Aba1064,
    /// Steps of Strang's splitting, [`Splitting::STRANG`].
    Strang,
}

impl MicroSteps {
    pub(super) fn is_usual(&self) -> bool {
        *self == Self::default()
    }

    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Aba1064 => "steps",
            Self::Strang => "steps of Strang",
        }
    }

    pub(super) fn splitting(self) -> Splitting {
        match self {
            Self::Aba1064 => Splitting::ABA_1064,
            Self::Strang => Splitting::STRANG,
        }
    }
}
