//! The adiabatic invariant of a nearly-periodic map to second order in ε, and its roto-rate.

use crate::error::Error;
use crate::layer::CircleAction;
use crate::network::{Composition, Model, Structure, map_points};
use crate::phase::Direction;
use crate::scalar::Elementary;
use std::f64::consts::TAU;

/// The terms μ₀, μ₁ and μ₂ of the formal adiabatic invariant μ₀ + εμ₁ + ε²μ₂ + … of P = I_ε∘ψ∘Φ_θ∘ψ⁻¹, and the
/// roto-rate that it generates.
///
/// With Q = ψ∘Φ_θ∘ψ⁻¹ and D_j f the Taylor coefficient of f∘I_ε at εʲ, μ is invariant to second order when
///
/// μ₁∘Q − μ₁ = −(D₁μ₀)∘Q,  μ₂∘Q − μ₂ = −(D₁μ₁ + D₂μ₀)∘Q.
///
/// Both are solved by Fourier series along the circle through a point: with g(ψΦ_aψ⁻¹z) = Σ g_k e^{ika} the right side,
/// whose mean is 0 where I_ε is symplectic, the solution is −Σ_{k≠0} g_k/(1 − e^{−ikθ}) plus its mean. The mean of μ₁
/// is 0; that of μ₂ is ½⟨{μ₁, G}⟩, where G generates the change of coordinates of first order, ∂_a G = −μ₁, and
/// {f, g} = Σ ∂f/∂q ∂g/∂p − ∂f/∂p ∂g/∂q. Along orbits μ₀ changes by O(ε), μ₀ + εμ₁ by O(ε²) and the sum of three terms
/// by O(ε³), for times longer than every power of 1/ε, except at low resonances of θ.
///
/// Source: Kruskal, <https://doi.org/10.1063/1.1724285>; of maps: Burby, Hirvijoki and Leok,
/// <https://doi.org/10.1007/s00332-023-09891-4>.
pub struct SeriesInvariant {
    action: CircleAction,
    psi: Composition<f64>,
    fine: Differences,
    coarse: Differences,
    theta: f64,
    angles: usize,
}

/// I at ε = −2h, −h, h, 2h, for central differences of fourth order.
struct Differences {
    step: f64,
    maps: [Composition<f64>; 4],
}

/// h of first derivatives of functions known to rounding.
const FINE: f64 = 1e-4;

/// h of second derivatives, and of derivatives of functions that are differences themselves.
const COARSE: f64 = 1e-3;

/// The places of a central difference of fourth order over h, and 12 times their weights in the first derivative and in
/// the second. The value in the middle, of weight −30 in the second, is taken from all values beforehand: digits that
/// they share are not lost then.
const PLACES: [f64; 4] = [-2.0, -1.0, 1.0, 2.0];
const FIRST: [f64; 4] = [1.0, -8.0, 8.0, -1.0];
const SECOND: [f64; 4] = [-1.0, 16.0, 16.0, -1.0];

impl Differences {
    fn new(model: &Model, step: f64) -> Self {
        Self { step, maps: PLACES.map(|place| model.with_epsilon(place * step).near_identity()) }
    }

    /// `points` moved by each of the four maps.
    fn moved(&self, points: &[f64]) -> Result<[Vec<f64>; 4], Error> {
        let mut moved = [const { Vec::new() }; 4];
        for (moved, map) in moved.iter_mut().zip(&self.maps) {
            *moved = points.to_vec();
            map_points(map, Direction::Forward, moved)?;
        }
        Ok(moved)
    }
}

/// Of the right side g on the circle through a point, what the equation of the homology gives at the point itself.
struct Solved {
    /// The solution without its mean at the point, −Σ_{k≠0} g_k/(1 − e^{−ikθ}).
    value: f64,
    /// Σ_{k≠0} g_k/(ik(1 − e^{−ikθ})), whose derivative along the circle is −`value`.
    generator: f64,
}

impl SeriesInvariant {
    /// The invariant of a network, with harmonics from values at `angles` angles. None unless the network is
    /// symplectic and nearly periodic with one circle.
    ///
    /// # Panics
    /// When there are fewer than three angles.
    pub fn new(model: &Model, angles: usize) -> Option<Self> {
        assert!(angles >= 3, "{angles} angles");
        let architecture = model.architecture();
        let adiabatic = architecture.structure() == Structure::NearlyPeriodic;
        if !adiabatic || !architecture.is_symplectic() || architecture.circles.len() != 1 {
            return None;
        }
        let [psi, _] = model.chart_and_inner_map();
        Some(Self {
            action: architecture.circles[0].clone(),
            psi,
            fine: Differences::new(model, FINE),
            coarse: Differences::new(model, COARSE),
            theta: model.angle()?,
            angles,
        })
    }

    /// (μ₀, μ₁) at a point of 2n numbers.
    ///
    /// Cost: five evaluations of ψ and four of I_ε for each angle.
    ///
    /// # Errors
    /// When the point is of another size.
    pub fn evaluate(&self, z: &[f64]) -> Result<(f64, f64), Error> {
        let leading = self.leading(z)?;
        Ok((leading[0], self.first(z, &leading)?[0].value))
    }

    /// μ₀, μ₁ and μ₂ at a point of 2n numbers.
    ///
    /// Cost: with M angles M²(8n + 4) times the evaluations of [`SeriesInvariant::evaluate`] for one angle.
    ///
    /// # Errors
    /// When the point is of another size.
    pub fn terms(&self, z: &[f64]) -> Result<[f64; 3], Error> {
        let dim = z.len();
        let leading = self.leading(z)?;
        let first = self.first(z, &leading)?[0].value;
        let circle = self.circles(z)?;
        let center: Vec<f64> = self.first_at(&circle)?.iter().map(|solved| solved.value).collect();
        // D₁μ₁ + D₂μ₀ on the circle.
        let mut right_side = vec![0.0; self.angles];
        let step = self.coarse.step;
        for (place, moved) in self.coarse.moved(&circle)?.iter().enumerate() {
            let (zeroth, first) = (self.leading(moved)?, self.first_at(moved)?);
            for (number, sum) in right_side.iter_mut().enumerate() {
                *sum += FIRST[place] * (first[number].value - center[number]) / (12.0 * step);
                *sum += 0.5 * SECOND[place] * (zeroth[number] - leading[0]) / (12.0 * step * step);
            }
        }
        // The gradients of μ₁ and G on the circle, a row of 2n for each angle.
        let mut gradients = [vec![0.0; circle.len()], vec![0.0; circle.len()]];
        for component in 0..dim {
            for (place, weight) in PLACES.iter().zip(FIRST) {
                let mut moved = circle.clone();
                moved.iter_mut().skip(component).step_by(dim).for_each(|v| *v += place * step);
                for (number, solved) in self.first_at(&moved)?.iter().enumerate() {
                    let slopes = [solved.value - center[number], solved.generator];
                    for (gradient, slope) in gradients.iter_mut().zip(slopes) {
                        gradient[number * dim + component] += weight * slope / (12.0 * step);
                    }
                }
            }
        }
        let [of_first, of_generator] = &gradients;
        let mut bracket = 0.0;
        for (f, g) in of_first.chunks_exact(dim).zip(of_generator.chunks_exact(dim)) {
            let ((f_q, f_p), (g_q, g_p)) = (f.split_at(dim / 2), g.split_at(dim / 2));
            let products = f_q.iter().zip(g_p).zip(f_p.iter().zip(g_q));
            bracket += products.map(|((a, b), (c, d))| a * b - c * d).sum::<f64>();
        }
        let mean = 0.5 * bracket / self.angles as f64;
        let second = self.solve(&right_side).value + mean;
        Ok([leading[0], first, second])
    }

    /// The roto-rate at a point to the given order, 0, 1 or 2: X_μ of μ = μ₀ + … + ε^k μ_k, a vector of 2n numbers with
    /// q̇ = ∂μ/∂p and ṗ = −∂μ/∂q.
    ///
    /// The map commutes with its flow, of period 2π, to that order: DP(z)·R(z) = R(P(z)) + O(ε^{k+1}).
    ///
    /// # Errors
    /// When the point is of another size, and for a higher order.
    pub fn roto_rate(&self, z: &[f64], epsilon: f64, order: usize) -> Result<Vec<f64>, Error> {
        Error::check_count_range("order", order, 0, 2)?;
        let half = z.len() / 2;
        let mut rate = vec![0.0; z.len()];
        let invariant = |z: &[f64]| {
            Ok::<_, Error>(match order {
                0 => self.leading(z)?[0],
                1 => {
                    let (leading, first) = self.evaluate(z)?;
                    leading + epsilon * first
                }
                _ => {
                    let [leading, first, second] = self.terms(z)?;
                    leading + epsilon * (first + epsilon * second)
                }
            })
        };
        let center = invariant(z)?;
        for component in 0..z.len() {
            let mut slope = 0.0;
            for (place, weight) in PLACES.iter().zip(FIRST) {
                let mut moved = z.to_vec();
                moved[component] += place * COARSE;
                slope += weight * (invariant(&moved)? - center) / (12.0 * COARSE);
            }
            match component < half {
                true => rate[component + half] = -slope,
                false => rate[component - half] = slope,
            }
        }
        Ok(rate)
    }

    /// μ₀ = 𝔍₀∘ψ⁻¹ at each point.
    fn leading(&self, points: &[f64]) -> Result<Vec<f64>, Error> {
        let mut w = points.to_vec();
        map_points(&self.psi, Direction::Inverse, &mut w)?;
        let dim = 2 * self.psi.dof();
        Ok(w.chunks_exact(dim).map(|w| self.action.invariant(w)).collect())
    }

    /// The circle through each point, at all angles.
    fn circles(&self, points: &[f64]) -> Result<Vec<f64>, Error> {
        let (dim, count) = (2 * self.psi.dof(), self.angles);
        let mut w = points.to_vec();
        map_points(&self.psi, Direction::Inverse, &mut w)?;
        let mut circles: Vec<f64> = w.chunks_exact(dim).flat_map(|w| w.repeat(count)).collect();
        for (number, w) in circles.chunks_exact_mut(dim).enumerate() {
            let angle = TAU * (number % count) as f64 / count as f64;
            self.action.turn_by(angle).apply(w, false);
        }
        map_points(&self.psi, Direction::Forward, &mut circles)?;
        Ok(circles)
    }

    /// μ₁ and G at each point.
    fn first_at(&self, points: &[f64]) -> Result<Vec<Solved>, Error> {
        self.first(points, &self.leading(points)?)
    }

    /// [`SeriesInvariant::first_at`], of points whose μ₀ is known.
    fn first(&self, points: &[f64], leading: &[f64]) -> Result<Vec<Solved>, Error> {
        let circles = self.circles(points)?;
        let mut slopes = vec![0.0; circles.len() / (2 * self.psi.dof())];
        for (moved, weight) in self.fine.moved(&circles)?.iter().zip(FIRST) {
            for (number, value) in self.leading(moved)?.into_iter().enumerate() {
                let less = leading[number / self.angles];
                slopes[number] += weight * (value - less) / (12.0 * self.fine.step);
            }
        }
        Ok(slopes.chunks_exact(self.angles).map(|slopes| self.solve(slopes)).collect())
    }

    /// The solution at a point of f∘Q − f = −g∘Q, of g on the circle through it.
    fn solve(&self, right_side: &[f64]) -> Solved {
        let count = right_side.len();
        let mut solved = Solved { value: 0.0, generator: 0.0 };
        // −1/(1 − e^{−ikθ}) = −½ + ½i cot ½kθ, of k and −k together.
        for k in 1..=(count - 1) / 2 {
            let (mut cosine, mut sine) = (0.0, 0.0);
            for (number, slope) in right_side.iter().enumerate() {
                let angle = TAU * ((k * number) % count) as f64 / count as f64;
                let (s, c) = Elementary::sin_cos(angle);
                cosine += slope * c;
                sine += slope * s;
            }
            let (s, c) = Elementary::sin_cos(0.5 * k as f64 * self.theta);
            let cotangent = c / s;
            solved.value += (sine * cotangent - cosine) / count as f64;
            solved.generator -= (cosine * cotangent + sine) / (k * count) as f64;
        }
        solved
    }
}
