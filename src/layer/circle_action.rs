//! The circle action Φ_θ: each plane (q_j, p_j) turned clockwise by m_j θ.

use crate::phase::Map;
use crate::scalar::{Over, Real, Scalar};
use serde::{Deserialize, Serialize};

/// A linear circle action on phase space with integer weights m_j:
///
/// q_j ← q_j cos m_jθ + p_j sin m_jθ, p_j ← −q_j sin m_jθ + p_j cos m_jθ.
///
/// Its invariant, the momentum map of the rotation, is
/// 𝔍₀ = ½ Σ m_j (q_j² + p_j²). Weight 0 leaves a plane alone.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct CircleAction {
    weights: Vec<i32>,
}

impl CircleAction {
    /// The action with these weights, one for each degree of freedom.
    pub fn new(weights: impl Into<Vec<i32>>) -> Self {
        Self { weights: weights.into() }
    }

    /// The weights m_j.
    pub fn weights(&self) -> &[i32] {
        &self.weights
    }

    /// The number of degrees of freedom.
    pub fn dof(&self) -> usize {
        self.weights.len()
    }

    /// The rotation Φ_θ, θ in radians.
    ///
    /// m_jθ is formed with its rounding error, so that the angle of a high
    /// harmonic is as exact as θ itself.
    pub fn at<P: Real>(&self, theta: P) -> Rotation<P> {
        let planes = self
            .weights
            .iter()
            .enumerate()
            .filter(|(_, weight)| **weight != 0)
            .map(|(plane, &weight)| PlaneRotation::new(plane, weight, theta))
            .collect();
        Rotation { dof: self.weights.len(), planes }
    }

    /// 𝔍₀(z) = ½ Σ m_j (q_j² + p_j²), the invariant of the action.
    pub fn invariant<S: Scalar>(&self, z: &[S]) -> S {
        let n = self.dof();
        let mut total = S::zero();
        for (j, &weight) in self.weights.iter().enumerate() {
            if weight != 0 {
                let square = z[j].mul_add(z[j], z[n + j] * z[n + j]);
                total = square.mul_add(S::from_f64(0.5) * S::from_f64(weight.into()), total);
            }
        }
        total
    }
}

/// The rotation of one plane as a quarter-turn count and three shears.
///
/// The matrix (cos, sin) is never used: fl(c)² + fl(s)² ≠ 1 would make 𝔍₀
/// drift in proportion to the number of iterations, where shears, whose
/// determinants are 1 in floating point too, let it wander as its square root.
#[derive(Clone, Copy, Debug)]
pub struct PlaneRotation<P> {
    /// j, the plane.
    pub plane: usize,
    /// m_j.
    pub weight: i32,
    /// Quarter turns, 0 … 3, taken off the angle so that |angle′| ≤ π/4.
    pub quarter_turns: u8,
    /// t = tan(angle′/2) = s/(1 + c).
    pub t: P,
    /// s = sin(angle′).
    pub s: P,
}

impl<P: Real> PlaneRotation<P> {
    fn new(plane: usize, weight: i32, theta: P) -> Self {
        let m = P::from_f64(weight.into());
        let angle = m * theta;
        let rest = m.mul_add(theta, -angle);
        let (sin_0, cos_0) = angle.sin_cos();
        // Not small where θ is beyond 2⁵³.
        let (sin_rest, cos_rest) = rest.sin_cos();
        let sin = cos_0.mul_add(sin_rest, sin_0 * cos_rest);
        let cos = (-sin_0).mul_add(sin_rest, cos_0 * cos_rest);
        let (vs, vc) = (sin.value(), cos.value());
        let (quarter_turns, c, s) = if vc >= vs.abs() {
            (0, cos, sin)
        } else if vs >= vc.abs() {
            (1, sin, -cos)
        } else if -vc > vs.abs() {
            (2, -cos, -sin)
        } else {
            (3, -sin, cos)
        };
        Self { plane, weight, quarter_turns, t: s / (P::from_f64(1.0) + c), s }
    }
}

impl<P: Copy> PlaneRotation<P> {
    /// Whether the quarter turns come before the shears. For one and for three
    /// of them the order is opposite, so that Φ_{−θ} undoes Φ_θ step by step.
    #[inline(always)]
    fn turns_first(&self) -> bool {
        self.quarter_turns != 3
    }
}

/// Turns (q, p) clockwise by `count` right angles, exactly.
#[inline(always)]
pub(super) fn quarter_turns<S: Scalar>(count: u8, q: &mut S, p: &mut S) {
    (*q, *p) = match count % 4 {
        0 => (*q, *p),
        1 => (*p, -*q),
        2 => (-*q, -*p),
        _ => (-*p, *q),
    };
}

/// Φ_θ for one θ, ready to be applied.
#[derive(Clone, Debug)]
pub struct Rotation<P> {
    dof: usize,
    planes: Vec<PlaneRotation<P>>,
}

impl<P: Real> Rotation<P> {
    /// Each plane (q_j, p_j) turned clockwise by its own angle; an angle of 0
    /// leaves it alone.
    pub fn by_angles(angles: &[P]) -> Self {
        let turned = angles.iter().enumerate().filter(|(_, angle)| !angle.is_zero());
        let planes = turned.map(|(plane, &angle)| PlaneRotation::new(plane, 1, angle)).collect();
        Self { dof: angles.len(), planes }
    }
}

impl<P: Scalar> Rotation<P> {
    /// The rotations of the planes with a weight other than 0.
    pub fn planes(&self) -> &[PlaneRotation<P>] {
        &self.planes
    }

    /// n.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// z ← Φ_θ(z), or Φ_θ⁻¹(z) when `inverse`.
    #[inline(always)]
    pub fn apply<S: Over<P>>(&self, z: &mut [S], inverse: bool) {
        let (q, p) = z.split_at_mut(self.dof);
        for plane in &self.planes {
            let (q, p) = (&mut q[plane.plane], &mut p[plane.plane]);
            let turns = if inverse { (4 - plane.quarter_turns) % 4 } else { plane.quarter_turns };
            if plane.turns_first() != inverse {
                quarter_turns(turns, q, p);
            }
            if !plane.s.is_zero() {
                let (t, s) = if inverse { (-plane.t, -plane.s) } else { (plane.t, plane.s) };
                // A tangent that underflows adds nothing: 0·p would turn −0 into 0.
                let bends = !t.is_zero();
                if bends {
                    *q = p.mul_add_parameter(t, *q);
                }
                *p = q.mul_add_parameter(-s, *p);
                if bends {
                    *q = p.mul_add_parameter(t, *q);
                }
            }
            if plane.turns_first() == inverse {
                quarter_turns(turns, q, p);
            }
        }
    }

    /// The adjoint of Φ_θ (of Φ_θ⁻¹ when `inverse`) at the output point `out`:
    /// `z_bar` from the cotangent of the output to that of the input; returns
    /// the cotangent of θ.
    ///
    /// ∂Φ_θ/∂θ is the infinitesimal generator at the output, q̇ = m p, ṗ = −m q.
    #[inline(always)]
    pub fn pullback<S: Over<P>>(&self, out: &[S], z_bar: &mut [S], inverse: bool) -> S {
        let n = self.dof;
        let mut theta_bar = S::zero();
        for plane in &self.planes {
            let (i, k) = (plane.plane, n + plane.plane);
            let weight = S::from_f64(plane.weight.into());
            let m = if inverse { -weight } else { weight };
            let turn = z_bar[i] * out[k] - z_bar[k] * out[i];
            theta_bar = m.mul_add(turn, theta_bar);
        }
        // A rotation is orthogonal: its adjoint is its inverse.
        self.apply(z_bar, !inverse);
        theta_bar
    }
}

impl<P: Scalar, S: Over<P>> Map<S> for Rotation<P> {
    fn dof(&self) -> usize {
        self.dof
    }
    fn forward(&self, z: &mut [S]) {
        self.apply(z, false);
    }
    fn inverse(&self, z: &mut [S]) {
        self.apply(z, true);
    }
}
