//! The adiabatic invariant of a nearly-periodic map to first order in ε.

use crate::error::Error;
use crate::layer::CircleAction;
use crate::network::{Composition, Model, Structure, map_points};
use crate::phase::Direction;
use crate::scalar::Elementary;
use std::f64::consts::TAU;

/// The terms μ₀ and μ₁ of the formal adiabatic invariant μ₀ + εμ₁ + … of P = I_ε∘ψ∘Φ_θ∘ψ⁻¹.
///
/// With μ₀ = 𝔍₀∘ψ⁻¹ and g = ∂_ε(μ₀∘I_ε) at ε = 0, μ₀ changes by εg∘Q + O(ε²) in a step, Q = ψ∘Φ_θ∘ψ⁻¹. So
///
/// μ₁∘Q − μ₁ = −g∘Q,
///
/// is solved by Fourier series along the circle through a point. With g(ψΦ_aψ⁻¹z) = Σ g_k e^{ika}, whose mean is 0
/// where I_ε is symplectic, μ₁(z) = −Σ_{k≠0} g_k/(1 − e^{−ikθ}). Along orbits μ₀ changes by O(ε) and μ₀ + εμ₁ by O(ε²),
/// for times longer than every power of 1/ε, except at low resonances of θ.
///
/// Source: Kruskal, <https://doi.org/10.1063/1.1724285>; of maps: Burby, Hirvijoki and Leok,
/// <https://doi.org/10.1007/s00332-023-09891-4>.
pub struct SeriesInvariant {
    action: CircleAction,
    psi: Composition<f64>,
    /// I at each of [`STEPS`].
    near_identity: [Composition<f64>; 4],
    theta: f64,
    angles: usize,
}

/// ε of a central difference of fourth order, and the weights of its values.
const STEP: f64 = 1e-4;
const STEPS: [(f64, f64); 4] = [(-2.0 * STEP, 1.0), (-STEP, -8.0), (STEP, 8.0), (2.0 * STEP, -1.0)];

impl SeriesInvariant {
    /// The invariant of a network, with harmonics from values at `angles` angles. None unless the network is
    /// symplectic and nearly periodic with one circle.
    ///
    /// # Panics
    /// When there are fewer than three angles.
    pub fn of(model: &Model, angles: usize) -> Option<Self> {
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
            near_identity: STEPS.map(|(step, _)| model.with_epsilon(step).near_identity()),
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
    pub fn at(&self, z: &[f64]) -> Result<(f64, f64), Error> {
        let (dim, count) = (z.len(), self.angles);
        let invariants = |points: &[f64]| -> Result<Vec<f64>, Error> {
            let mut w = points.to_vec();
            map_points(&self.psi, Direction::Inverse, &mut w)?;
            Ok(w.chunks_exact(dim).map(|w| self.action.invariant(w)).collect())
        };
        let mut w = z.to_vec();
        map_points(&self.psi, Direction::Inverse, &mut w)?;
        let leading = self.action.invariant(&w);
        let mut circle = w.repeat(count);
        for (number, w) in circle.chunks_exact_mut(dim).enumerate() {
            self.action.turn_by(TAU * number as f64 / count as f64).apply(w, false);
        }
        map_points(&self.psi, Direction::Forward, &mut circle)?;
        let mut slopes = vec![0.0; count];
        for (map, (_, weight)) in self.near_identity.iter().zip(STEPS) {
            let mut moved = circle.clone();
            map_points(map, Direction::Forward, &mut moved)?;
            for (slope, value) in slopes.iter_mut().zip(invariants(&moved)?) {
                // Less μ₀, of which the weights leave nothing: so no digits are lost to it.
                *slope += weight * (value - leading) / (12.0 * STEP);
            }
        }
        // −1/(1 − e^{−ikθ}) = −½ + ½i cot ½kθ, of k and −k together.
        let mut next = 0.0;
        for k in 1..=(count - 1) / 2 {
            let (mut cosine, mut sine) = (0.0, 0.0);
            for (number, slope) in slopes.iter().enumerate() {
                let angle = TAU * ((k * number) % count) as f64 / count as f64;
                let (s, c) = Elementary::sin_cos(angle);
                cosine += slope * c;
                sine += slope * s;
            }
            let (s, c) = Elementary::sin_cos(0.5 * k as f64 * self.theta);
            next += (sine * (c / s) - cosine) / count as f64;
        }
        Ok((leading, next))
    }
}
