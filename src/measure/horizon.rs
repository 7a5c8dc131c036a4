//! Adiabatic invariants along long orbits.

use super::drift::settling_iterations;
use crate::error::Error;
use crate::layer::CircleAction;
use crate::network::{Composition, Model, NEURONS};
use crate::phase::{Direction, Map};
use crate::scalar::{Kernel, Pack, max_or_nan, on_lanes};
use crate::work;
use serde::{Deserialize, Serialize};

/// An orbit of a gyroceptron in the coordinates w = ψ⁻¹z, with the largest deviation of the
/// adiabatic invariant, μ₀ = 𝔍₀(w) in these coordinates, from its initial value.
///
/// An orbit can be serialised and resumed later; the results are the same bit for bit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "Stored", into = "Stored")]
pub struct AdiabaticOrbit {
    w: Vec<f64>,
    initial: f64,
    steps: u64,
    /// The largest |μ₀ − μ₀(0)| so far, and the largest of the first K(ε) steps.
    largest: f64,
    settled: f64,
    settling: u64,
    factors: Vec<f64>,
    horizons: Vec<Option<u64>>,
    drifts: Vec<(u64, f64)>,
}

/// An orbit as it is stored: numbers by their bits, since JSON has no infinity.
#[derive(Serialize, Deserialize)]
struct Stored {
    w: Vec<u64>,
    /// The bits of `initial`, `largest` and `settled`, in this order.
    values: [u64; 3],
    steps: u64,
    settling: u64,
    factors: Vec<u64>,
    horizons: Vec<Option<u64>>,
    drifts: Vec<(u64, u64)>,
}

impl From<AdiabaticOrbit> for Stored {
    fn from(orbit: AdiabaticOrbit) -> Self {
        let bits = |values: Vec<f64>| values.into_iter().map(f64::to_bits).collect();
        Self {
            values: [orbit.initial, orbit.largest, orbit.settled].map(f64::to_bits),
            w: bits(orbit.w),
            steps: orbit.steps,
            settling: orbit.settling,
            factors: bits(orbit.factors),
            horizons: orbit.horizons,
            drifts: orbit.drifts.into_iter().map(|(n, d)| (n, d.to_bits())).collect(),
        }
    }
}

impl From<Stored> for AdiabaticOrbit {
    fn from(stored: Stored) -> Self {
        let numbers = |bits: Vec<u64>| bits.into_iter().map(f64::from_bits).collect();
        let [initial, largest, settled] = stored.values.map(f64::from_bits);
        Self {
            w: numbers(stored.w),
            initial,
            steps: stored.steps,
            largest,
            settled,
            settling: stored.settling,
            factors: numbers(stored.factors),
            horizons: stored.horizons,
            drifts: stored.drifts.into_iter().map(|(n, d)| (n, f64::from_bits(d))).collect(),
        }
    }
}

impl AdiabaticOrbit {
    /// The orbit from z, before its first step. `factors`, ascending, are the factors ρ of the
    /// [horizons](AdiabaticOrbit::horizons); at ε = 0 there are no horizons.
    ///
    /// # Errors
    /// Unless 0 ≤ ε < ∞, z is of 2n numbers, and the network has exactly one circle.
    pub fn new(network: &Model, z: &[f64], factors: &[f64]) -> Result<Self, Error> {
        let dof = network.architecture().dof;
        Error::check_count("numbers of the initial point", 2 * dof, z.len())?;
        let epsilon = network.epsilon();
        let (settling, factors) = match epsilon {
            0.0 => (0, &[][..]),
            _ => (settling_iterations(epsilon)? as u64, factors),
        };
        let mut w = z.to_vec();
        network.psi().inverse(&mut w);
        let initial = match &network.architecture().circles[..] {
            [circle] => circle.invariant(&w),
            circles => {
                let found = format!("{} circles", circles.len());
                return Err(Error::invalid("network", found, "one circle, whose orbit it is"));
            }
        };
        Ok(Self {
            w,
            initial,
            steps: 0,
            largest: 0.0,
            settled: 0.0,
            settling,
            factors: factors.to_vec(),
            horizons: vec![None; factors.len()],
            drifts: Vec::new(),
        })
    }

    /// Continues the orbit until it has this number of steps; `map` is
    /// [`Model::in_conjugated_coordinates`].
    pub fn advance(&mut self, map: &Composition<f64>, action: &CircleAction, steps: u64) {
        let more = steps.saturating_sub(self.steps);
        work::count(work::Kind::Evaluation, usize::try_from(more).unwrap_or(usize::MAX));
        on_lanes::<NEURONS, _>(Advance { orbit: self, map, action, steps });
    }

    /// The number of steps done.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// The horizon N for each factor ρ: the first step at which |μ₀ − μ₀(0)| exceeds ρ times its
    /// largest value over the first K(ε) steps; None where it has not done so yet.
    ///
    /// Source: section "Numerical Confirmation of the Existence of Adiabatic
    /// Invariants" of <https://doi.org/10.1038/s41598-023-34862-w>, which takes ρ = 1.1.
    pub fn horizons(&self) -> &[Option<u64>] {
        &self.horizons
    }

    /// (N, D(N)) for each power of ten N that the orbit has reached, where D(N) is the largest
    /// |μ₀ − μ₀(0)| of the first N steps.
    pub fn drifts(&self) -> &[(u64, f64)] {
        &self.drifts
    }

    /// The largest |μ₀ − μ₀(0)| so far.
    pub fn largest(&self) -> f64 {
        self.largest
    }

    /// The adiabatic invariant μ₀ at the initial point.
    pub fn initial(&self) -> f64 {
        self.initial
    }

    /// Takes note of a new state.
    #[inline(always)]
    fn observe(&mut self, value: f64) {
        self.steps += 1;
        let drift = (value - self.initial).abs();
        // What is no larger changes nothing but at powers of ten.
        if !(drift <= self.largest) {
            self.largest = max_or_nan(self.largest, drift);
            if self.steps <= self.settling {
                self.settled = self.largest;
            } else {
                for (horizon, factor) in self.horizons.iter_mut().zip(&self.factors) {
                    if horizon.is_none() && !(drift <= factor * self.settled) {
                        *horizon = Some(self.steps);
                    }
                }
            }
        }
    }
}

struct Advance<'a> {
    orbit: &'a mut AdiabaticOrbit,
    map: &'a Composition<f64>,
    action: &'a CircleAction,
    steps: u64,
}

impl Kernel for Advance<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Pack>(self) {
        let Self { orbit, map, action, steps } = self;
        let mut scratch = vec![0.0; orbit.w.len()];
        let mut w = orbit.w.clone();
        let mut power = 10;
        while power <= orbit.steps {
            power = power.saturating_mul(10);
        }
        while orbit.steps < steps {
            while orbit.steps < steps.min(power) {
                map.apply_across::<V>(Direction::Forward, &mut w, &mut scratch);
                orbit.observe(action.invariant(&w));
            }
            if orbit.steps == power {
                orbit.drifts.push((power, orbit.largest));
                power = power.saturating_mul(10);
            }
        }
        orbit.w.copy_from_slice(&w);
    }
}
