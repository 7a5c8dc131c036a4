//! Gauss–Legendre collocation, of one point.

use crate::error::Error;
use crate::scalar::max_or_nan;
use crate::system::Hamiltonian;

/// The s-stage Gauss–Legendre Runge–Kutta method: symplectic, of order 2s.
///
/// Source: Hairer, Lubich and Wanner, Geometric Numerical Integration, II.1.3,
/// <https://doi.org/10.1007/3-540-30666-8>.
#[derive(Clone, Debug)]
pub struct GaussLegendre {
    pub(super) nodes: Vec<f64>,
    /// The weights b_i of the stages.
    pub weights: Vec<f64>,
    /// The coefficients a_ij, row by row: (stages, stages).
    pub matrix: Vec<f64>,
}

/// The Legendre polynomial of degree s = `stages` and its derivative, (P_s(x), P_s′(x)).
fn legendre(stages: usize, x: f64) -> (f64, f64) {
    let (mut previous, mut current) = (1.0, x);
    for k in 2..=stages {
        let k = k as f64;
        (previous, current) = (current, ((2.0 * k - 1.0) * x * current - (k - 1.0) * previous) / k);
    }
    let slope = stages as f64 * (x * current - previous) / (x * x - 1.0);
    (current, slope)
}

/// Legendre polynomials P_0 … P_s at x.
fn legendre_values(stages: usize, x: f64) -> Vec<f64> {
    let mut values = vec![1.0, x];
    for k in 2..=stages {
        let n = k as f64;
        let next = ((2.0 * n - 1.0) * x * values[k - 1] - (n - 1.0) * values[k - 2]) / n;
        values.push(next);
    }
    values
}

/// Iterations for the stages of a step.
pub(super) const MAXIMUM: usize = 100;

fn out_of_range(step: usize) -> Error {
    Error::Diverged { what: "Gauss–Legendre".into(), place: format!("step {step}") }
}

impl GaussLegendre {
    /// The method of `stages` stages.
    ///
    /// Nodes by Newton's iteration on the Legendre polynomial. a_ij = ∫₀^{c_i}
    /// ℓ_j expanded in Legendre polynomials, whose integrals are known:
    /// no linear system is solved.
    ///
    /// # Panics
    /// When `stages` is 0.
    pub fn new(stages: usize) -> Self {
        assert!(stages > 0);
        let s = stages;
        let mut x = vec![0.0; s];
        let mut weights = vec![0.0; s];
        for i in 0..s {
            let mut root = -libm::cos(std::f64::consts::PI * (i as f64 + 0.75) / (s as f64 + 0.5));
            if s == 1 {
                root = 0.0;
            }
            for _ in 0..50 {
                let (value, slope) = legendre(s, root);
                let change = value / slope;
                root -= change;
                if change.abs() < 1e-16 {
                    break;
                }
            }
            let (_, slope) = legendre(s, root);
            x[i] = root;
            weights[i] = 1.0 / ((1.0 - root * root) * slope * slope);
        }
        // ℓ_j(x) = Σ_k (2k+1)·w_j·P_k(x_j)·P_k(x) with the weights of [0, 1], and
        // ∫_{-1}^x P_k = (P_{k+1}(x) − P_{k−1}(x))/(2k+1).
        let mut matrix = vec![0.0; s * s];
        for i in 0..s {
            let at_i = legendre_values(s, x[i]);
            for j in 0..s {
                let at_j = legendre_values(s, x[j]);
                let mut sum = x[i] + 1.0;
                for k in 1..s {
                    sum += at_j[k] * (at_i[k + 1] - at_i[k - 1]);
                }
                matrix[i * s + j] = 0.5 * weights[j] * sum;
            }
        }
        Self { nodes: x.iter().map(|v| 0.5 * (v + 1.0)).collect(), weights, matrix }
    }

    /// The nodes c_i of the method in [0, 1], one for each stage.
    pub fn nodes(&self) -> &[f64] {
        &self.nodes
    }

    /// The number of stages s.
    pub fn stages(&self) -> usize {
        self.weights.len()
    }

    /// z ← the flow over `time` in `steps` equal steps.
    ///
    /// The stages are found by fixed-point iteration, until they change by
    /// rounding only; a step must therefore resolve the fastest oscillation.
    ///
    /// # Errors
    /// When a step does not converge or the numbers leave their range.
    #[inline(always)]
    pub fn integrate(
        &self,
        system: &impl Hamiltonian,
        z: &mut [f64],
        time: f64,
        steps: usize,
    ) -> Result<(), Error> {
        Error::check_count_range("steps", steps, 1, usize::MAX)?;
        let (s, dim) = (self.stages(), z.len());
        let h = time / steps as f64;
        let mut slopes = vec![0.0; s * dim];
        let mut updated = vec![0.0; s * dim];
        let mut stage = vec![0.0; dim];
        // Compensated: the increments are small against z.
        let mut carry = vec![0.0; dim];
        for step in 0..steps {
            if step == 0 {
                system.vector_field(z, 0.0, &mut stage);
                for block in slopes.chunks_exact_mut(dim) {
                    block.copy_from_slice(&stage);
                }
            }
            let mut last = f64::INFINITY;
            let mut iteration = 0;
            loop {
                for i in 0..s {
                    for d in 0..dim {
                        let mut sum = 0.0;
                        for j in 0..s {
                            sum = self.matrix[i * s + j].mul_add(slopes[j * dim + d], sum);
                        }
                        stage[d] = h.mul_add(sum, z[d]);
                    }
                    let now = (step as f64 + self.nodes[i]) * h;
                    system.vector_field(&stage, now, &mut updated[i * dim..(i + 1) * dim]);
                }
                let mut change = 0.0_f64;
                // What a stage is rounded by: its own size or its increment's.
                let mut scale = z.iter().map(|v| v.abs()).fold(0.0, max_or_nan);
                for (old, new) in slopes.iter().zip(&updated) {
                    scale = max_or_nan(scale, (h * new).abs());
                    let difference = (h * (new - old)).abs();
                    change = max_or_nan(change, difference);
                }
                std::mem::swap(&mut slopes, &mut updated);
                iteration += 1;
                if !change.is_finite() {
                    return Err(out_of_range(step));
                }
                // At the rounding level the changes stop shrinking.
                if change == 0.0 || (change <= 8.0 * f64::EPSILON * scale && change >= last) {
                    break;
                }
                if iteration == MAXIMUM {
                    return Err(Error::NoConvergence {
                        what: format!("Gauss–Legendre, step {step} of {h}"),
                        iterations: MAXIMUM,
                        change,
                    });
                }
                last = change;
            }
            for d in 0..dim {
                let mut sum = 0.0;
                for j in 0..s {
                    sum = self.weights[j].mul_add(slopes[j * dim + d], sum);
                }
                let increment = h.mul_add(sum, carry[d]);
                let next = z[d] + increment;
                carry[d] = increment - (next - z[d]);
                z[d] = next;
            }
            if z.iter().any(|v| !v.is_finite()) {
                return Err(out_of_range(step));
            }
        }
        Ok(())
    }
}
