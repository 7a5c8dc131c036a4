//! Turns: each plane (q_j, p_j) rotated clockwise by its own angle; the circle and
//! torus actions that such rotations make.

use super::ElementaryMap;
use crate::error::Error;
use crate::phase::Map;
use crate::scalar::{Over, Real, Scalar};
use serde::{Deserialize, Serialize};

/// A linear circle action on phase space with integer weights m_j:
///
/// q_j ← q_j cos m_jθ + p_j sin m_jθ, p_j ← −q_j sin m_jθ + p_j cos m_jθ.
///
/// Its invariant, the momentum map of the rotation, is
/// 𝔍₀ = ½ Σ m_j (q_j² + p_j²). Weight 0 leaves a plane alone.
///
/// Source: Duruisseaux, Burby and Tang, <https://doi.org/10.1038/s41598-023-34862-w>.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct CircleAction {
    weights: Vec<i32>,
}

/// The weights, as options of the command take them: 0,1,2.
impl std::fmt::Display for CircleAction {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let weights: Vec<String> = self.weights.iter().map(i32::to_string).collect();
        f.write_str(&weights.join(","))
    }
}

impl CircleAction {
    /// The action with these weights, one for each degree of freedom.
    pub fn new(weights: impl Into<Vec<i32>>) -> Self {
        Self { weights: weights.into() }
    }

    /// The weight m_j of each plane: how often it turns while the circle turns once.
    pub fn weights(&self) -> &[i32] {
        &self.weights
    }

    /// The greatest common divisor g of the weights, or 0 where all are 0: the rotation is already the identity
    /// after 1/g of a whole turn.
    pub fn common_factor(&self) -> u32 {
        let gcd = |mut a: u32, mut b: u32| {
            while b > 0 {
                (a, b) = (b, a % b);
            }
            a
        };
        self.weights.iter().map(|m| m.unsigned_abs()).fold(0, gcd)
    }

    /// Whether a symplectic map conjugates one action to the other or to its reverse: the weights agree up to the
    /// order of the planes, which an exchange of planes changes, and up to one sign for all. No data can
    /// distinguish such actions when any symplectic ψ may be learnt.
    pub fn is_conjugate(&self, other: &Self) -> bool {
        let sorted = |sign: i64, action: &Self| {
            let mut weights: Vec<i64> =
                action.weights.iter().map(|m| sign * i64::from(*m)).collect();
            weights.sort_unstable();
            weights
        };
        let own = sorted(1, self);
        own == sorted(1, other) || own == sorted(-1, other)
    }

    /// The number of degrees of freedom.
    pub fn dof(&self) -> usize {
        self.weights.len()
    }

    /// The rotation Φ_θ, θ in radians.
    ///
    /// m_jθ is computed together with its rounding error, so that the angle of a high
    /// harmonic is as exact as θ itself.
    pub fn turn_by<P: Real>(&self, theta: P) -> Turn<P> {
        Turn::new(self.dof(), &[&self.weights], &[theta])
    }

    /// 𝔍₀(z) = ½ Σ m_j (q_j² + p_j²), the invariant of the action.
    #[inline(always)]
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

    /// 𝔍₀(ψ⁻¹(z)), the invariant of the action conjugated by ψ: μ₀, the leading
    /// adiabatic invariant of a gyroceptron.
    pub fn conjugated_invariant<S: Scalar>(&self, psi: &(impl Map<S> + ?Sized), z: &[S]) -> S {
        let mut w = z.to_vec();
        psi.inverse(&mut w);
        self.invariant(&w)
    }
}

/// Several commuting circle actions: plane j turns by Σ_a m_{aj} θ_a.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<CircleAction>", into = "Vec<CircleAction>")]
pub struct TorusAction {
    circles: Vec<CircleAction>,
}

impl TryFrom<Vec<CircleAction>> for TorusAction {
    type Error = Error;
    fn try_from(circles: Vec<CircleAction>) -> Result<Self, Error> {
        Self::new(circles)
    }
}

impl From<TorusAction> for Vec<CircleAction> {
    fn from(action: TorusAction) -> Self {
        action.circles
    }
}

impl TorusAction {
    /// The action of these circles, an angle for each.
    ///
    /// # Errors
    /// When there is no circle, or the circles differ in their number of degrees of freedom,
    /// or it is 0.
    pub fn new(circles: impl Into<Vec<CircleAction>>) -> Result<Self, Error> {
        let circles = circles.into();
        Error::check_count_range("circles of a torus action", circles.len(), 1, usize::MAX)?;
        Error::check_count_range("degrees of freedom", circles[0].dof(), 1, usize::MAX)?;
        for circle in &circles {
            Error::check_count("weights of a circle action", circles[0].dof(), circle.dof())?;
        }
        Ok(Self { circles })
    }

    /// The action that rotates each plane by a separate angle.
    pub fn of_planes(dof: usize) -> Self {
        Self::of_first_planes(dof, dof)
    }

    /// The action that rotates each of the first `count` planes by a separate angle and fixes the others.
    pub fn of_first_planes(count: usize, dof: usize) -> Self {
        let circle =
            |plane| CircleAction::new(Vec::from_iter((0..dof).map(|j| i32::from(j == plane))));
        Self { circles: (0..count).map(circle).collect() }
    }

    /// The circles of the torus, each with its weights.
    pub fn circles(&self) -> &[CircleAction] {
        &self.circles
    }

    /// The number of degrees of freedom.
    pub fn dof(&self) -> usize {
        self.circles.first().map_or(0, CircleAction::dof)
    }

    /// The first plane that is rotated by several circles, if any.
    pub fn shared_plane(&self) -> Option<usize> {
        let turned = |j: &usize| self.circles.iter().filter(|c| c.weights()[*j] != 0).count() > 1;
        (0..self.dof()).find(turned)
    }

    /// How often each circle goes round while `circle` goes round once: m_j/m_aj for all planes j of
    /// circle a. None unless the circles rotate disjoint planes, and together act as `circle` does.
    pub fn multiples_of<P: Real>(&self, circle: &CircleAction) -> Option<Vec<P>> {
        let (wanted, dof) = (circle.weights(), self.dof());
        let turned = |j: &usize| self.circles.iter().any(|own| own.weights()[*j] != 0);
        if self.shared_plane().is_some() || (0..dof).any(|j| turned(&j) != (wanted[j] != 0)) {
            return None;
        }
        let of_circle = |own: &CircleAction| {
            let weights = own.weights();
            let first = (0..dof).find(|&j| weights[j] != 0)?;
            let product = |j: usize, k: usize| i64::from(wanted[j]) * i64::from(weights[k]);
            let alike = |&j: &usize| weights[j] == 0 || product(j, first) == product(first, j);
            let multiple =
                || P::from_f64(wanted[first].into()) / P::from_f64(weights[first].into());
            (0..dof).all(|j| alike(&j)).then(multiple)
        };
        self.circles.iter().map(of_circle).collect()
    }

    /// The rotation by these angles, in radians, one for each circle.
    ///
    /// # Panics
    /// When there are more or fewer angles.
    pub fn turn_by<P: Real>(&self, angles: &[P]) -> Turn<P> {
        let weights: Vec<&[i32]> = self.circles.iter().map(CircleAction::weights).collect();
        Turn::new(self.dof(), &weights, angles)
    }
}

/// `1,0`, or `0,1,0/0,0,2` for several circles, as command-line options take actions.
impl std::fmt::Display for TorusAction {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (number, circle) in self.circles.iter().enumerate() {
            let between = if number > 0 { "/" } else { "" };
            write!(f, "{between}{circle}")?;
        }
        Ok(())
    }
}

impl From<CircleAction> for TorusAction {
    fn from(circle: CircleAction) -> Self {
        Self { circles: vec![circle] }
    }
}

/// The rotation of one plane as a quarter-turn count and three shears.
///
/// The matrix (cos, sin) is never used: since fl(c)² + fl(s)² ≠ 1, 𝔍₀ would
/// drift linearly in the number of iterations. Shears have determinant 1 in
/// floating point too, and 𝔍₀ only wanders as the square root of that number.
///
/// Source: the factorisation of a rotation into three shears, as in Daubechies and Sweldens,
/// <https://doi.org/10.1007/BF02476026>.
#[derive(Clone, Copy, Debug)]
pub struct PlaneTurn<P> {
    /// The number j of the plane, from 0.
    pub plane: usize,
    /// Quarter turns, 0 … 3, subtracted from the angle so that |angle′| ≤ π/4; 6 for two of them after the shears.
    pub quarter_turns: u8,
    /// t = tan(angle′/2) = s/(1 + c).
    pub t: P,
    /// s = sin(angle′), the factor of the shear between the two by t.
    pub s: P,
}

impl<P: Real> PlaneTurn<P> {
    /// By Σ_a m_a θ_a, formed with its rounding error.
    fn new(plane: usize, weights: impl Iterator<Item = (i32, P)>) -> Self {
        let (mut angle, mut rest) = (P::zero(), P::zero());
        for (number, (weight, theta)) in weights.filter(|(weight, _)| *weight != 0).enumerate() {
            let m = P::from_f64(weight.into());
            let product = m * theta;
            let low = m.mul_add(theta, -product);
            if number == 0 {
                (angle, rest) = (product, low);
                continue;
            }
            // Knuth's sum with its error.
            let sum = angle + product;
            let part = sum - angle;
            let error = (angle - (sum - part)) + (product - part);
            (angle, rest) = (sum, rest + (error + low));
        }
        let (sin_0, cos_0) = angle.sin_cos();
        // Not small where an angle is beyond 2⁵³.
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
        Self { plane, quarter_turns, t: s / (P::from_f64(1.0) + c), s }
    }
}

impl<P: Copy> PlaneTurn<P> {
    /// Whether the quarter turns come before the shears. One and three quarter turns have opposite
    /// orders, so that Φ_{−θ} undoes Φ_θ step by step. A half turn commutes with shears, except for a
    /// coordinate on a grid of integers that is its own negative.
    #[inline(always)]
    pub fn turns_first(&self) -> bool {
        !matches!(self.quarter_turns, 3 | 6)
    }
}

impl<P: Scalar> PlaneTurn<P> {
    /// (q, p) of M points turned by the angle, or back.
    #[inline(always)]
    pub(super) fn apply_together<S: Over<P>, const M: usize>(
        &self,
        q: &mut [S; M],
        p: &mut [S; M],
        inverse: bool,
    ) {
        let turns = if inverse { (8 - self.quarter_turns) % 4 } else { self.quarter_turns };
        if self.turns_first() != inverse {
            for m in 0..M {
                quarter_turns(turns, &mut q[m], &mut p[m]);
            }
        }
        if !self.s.is_zero() {
            let (t, s) = if inverse { (-self.t, -self.s) } else { (self.t, self.s) };
            // A tangent that underflows adds nothing: 0·p would turn −0 into 0.
            let bends = !t.is_zero();
            for m in 0..M {
                if bends {
                    q[m] = q[m].increment(t, p[m]);
                }
                p[m] = p[m].increment(-s, q[m]);
                if bends {
                    q[m] = q[m].increment(t, p[m]);
                }
            }
        }
        if self.turns_first() == inverse {
            for m in 0..M {
                quarter_turns(turns, &mut q[m], &mut p[m]);
            }
        }
    }
}

/// Turns (q, p) clockwise by `count` right angles, exactly.
#[inline(always)]
pub fn quarter_turns<S: Scalar>(count: u8, q: &mut S, p: &mut S) {
    (*q, *p) = match count % 4 {
        0 => (*q, *p),
        1 => (*p, -*q),
        2 => (-*q, -*p),
        _ => (-*p, *q),
    };
}

/// The rotation of each plane (q_j, p_j) clockwise by its angle, ready to be applied: a
/// circle action at one angle, or a torus action at one angle for each circle.
#[derive(Clone, Debug)]
pub struct Turn<P> {
    dof: usize,
    planes: Vec<PlaneTurn<P>>,
    /// m_{aj}: for each of the planes, in their order, as many as there are angles.
    weights: Vec<i32>,
    angles: usize,
}

impl<P: Real> Turn<P> {
    /// By weights of each circle, and an angle for each.
    pub(super) fn new(dof: usize, weights: &[&[i32]], angles: &[P]) -> Self {
        assert!(weights.len() == angles.len(), "an angle for each circle");
        let of_plane = |j: usize| weights.iter().map(move |circle| circle[j]);
        let turned: Vec<usize> = (0..dof).filter(|&j| of_plane(j).any(|m| m != 0)).collect();
        Self {
            dof,
            planes: turned
                .iter()
                .map(|&j| PlaneTurn::new(j, of_plane(j).zip(angles.iter().copied())))
                .collect(),
            weights: turned.iter().flat_map(|&j| of_plane(j)).collect(),
            angles: angles.len(),
        }
    }

    /// The turn of each plane (q_j, p_j) by its own angle, in radians; `angles` has one for each plane.
    pub fn by_angles(angles: &[P]) -> Self {
        TorusAction::of_planes(angles.len()).turn_by(angles)
    }
}

impl<P: Scalar> Turn<P> {
    /// The planes that are rotated: those with a weight other than 0.
    pub fn planes(&self) -> &[PlaneTurn<P>] {
        &self.planes
    }

    pub(super) fn planes_mut(&mut self) -> &mut [PlaneTurn<P>] {
        &mut self.planes
    }

    /// The degrees of freedom n.
    pub fn dof(&self) -> usize {
        self.dof
    }

    /// The turn of the same planes by other angles.
    ///
    /// # Panics
    /// When there are more or fewer of them.
    pub fn with_angles<Q: Real>(&self, angles: &[Q]) -> Turn<Q> {
        assert!(angles.len() == self.angles, "an angle for each circle");
        let planes = self.planes.iter().zip(self.weights.chunks_exact(self.angles.max(1)));
        Turn {
            dof: self.dof,
            planes: planes
                .map(|(of, weights)| {
                    PlaneTurn::new(of.plane, weights.iter().copied().zip(angles.iter().copied()))
                })
                .collect(),
            weights: self.weights.clone(),
            angles: self.angles,
        }
    }

    /// The number of angles, one for each circle.
    pub fn angle_count(&self) -> usize {
        self.angles
    }

    /// z ← Φ_θ(z), or Φ_θ⁻¹(z) when `inverse`.
    #[inline(always)]
    pub fn apply<S: Over<P>>(&self, z: &mut [S], inverse: bool) {
        let (q, p) = z.split_at_mut(self.dof);
        for plane in &self.planes {
            let (q, p) = (&mut q[plane.plane], &mut p[plane.plane]);
            plane.apply_together(std::array::from_mut(q), std::array::from_mut(p), inverse);
        }
    }
}

/// A turn or its inverse, as a step of a network whose parameters are the angles.
#[derive(Clone, Copy, Debug)]
pub struct TurnStep<'a, P> {
    /// The turn, prepared for its angles.
    pub turn: &'a Turn<P>,
    /// Whether the step is the inverse of the turn.
    pub inverse: bool,
}

impl<P: Scalar> ElementaryMap<P> for TurnStep<'_, P> {
    #[inline(always)]
    fn dof(&self) -> usize {
        self.turn.dof
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        Self { inverse: !self.inverse, ..self }
    }

    #[inline(always)]
    fn tape_len(&self) -> usize {
        2 * self.turn.dof
    }

    #[inline(always)]
    fn activation_count(&self) -> usize {
        0
    }

    #[inline(always)]
    fn apply<S: Over<P>>(&self, z: &mut [S], _: &mut [S]) {
        self.turn.apply(z, self.inverse);
    }

    #[inline(always)]
    fn forward_recorded<S: Over<P>>(&self, z: &mut [S], tape: &mut [S], _: &mut [S]) {
        self.turn.apply(z, self.inverse);
        tape.copy_from_slice(z);
    }

    /// The derivative in the angle of a plane is the infinitesimal generator at
    /// the output, q̇ = p, ṗ = −q.
    #[inline(always)]
    fn vjp<S: Over<P>>(&self, out: &[S], z_bar: &mut [S], angles_bar: &mut [S], _: &mut [S]) {
        let n = self.turn.dof;
        for (angle, angle_bar) in angles_bar.iter_mut().enumerate() {
            let mut total = S::zero();
            for (number, plane) in self.turn.planes.iter().enumerate() {
                let weight = self.turn.weights[number * self.turn.angles + angle];
                if weight == 0 {
                    continue;
                }
                let (i, k) = (plane.plane, n + plane.plane);
                let weight = S::from_f64(weight.into());
                let m = if self.inverse { -weight } else { weight };
                let turn = z_bar[i] * out[k] - z_bar[k] * out[i];
                total = m.mul_add(turn, total);
            }
            *angle_bar += total;
        }
        // A rotation is orthogonal: its adjoint is its inverse.
        self.turn.apply(z_bar, !self.inverse);
    }

    #[inline(always)]
    fn jvp<S: Over<P>>(&self, z: &mut [S], directions: &mut [S], _: &mut [S]) {
        self.turn.apply(z, self.inverse);
        for direction in directions.chunks_exact_mut(2 * self.turn.dof) {
            self.turn.apply(direction, self.inverse);
        }
    }
}

impl<P: Scalar, S: Over<P>> Map<S> for Turn<P> {
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
