//! What a map must tell of itself to be measured.

use super::rounding::{MeasuredStep, MeasuredSteps};
use crate::layer::{ElementaryStep, HenonLayer, HenonMap, Potential, Rotation};
use crate::network::{Composition, Direction, Gyroceptron, HenonNet, Model, map_points};
use crate::phase::Map;
use crate::scalar::{Dual, Scalar, Tracked};

/// A map that the laws can be measured on.
///
/// Every map, layer and network of the crate is one. A map of your own that is
/// written over the number type becomes one inside [`OneStep`].
pub trait Measurable: Map<f64> {
    /// The steps whose rounding errors are followed one by one; for
    /// [`Direction::Inverse`] those of P⁻¹.
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_>;

    /// Moves many points, 2n numbers each. It has to give the bits of
    /// [`Map::forward`] and [`Map::inverse`].
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        for point in points.chunks_exact_mut(2 * self.dof()) {
            match direction {
                Direction::Forward => self.forward(point),
                Direction::Inverse => self.inverse(point),
            }
        }
    }

    /// The layers in the order of application, each with the direction in which
    /// it is applied; none where the map has no parts.
    fn layers(&self) -> Layers<'_> {
        Vec::new()
    }

    /// The name of the type, by which a suite knows what it has measured.
    fn type_name(&self) -> &'static str {
        std::any::type_name::<Self>()
    }
}

/// Layers, each to be measured alone.
pub type Layers<'a> = Vec<(Direction, Box<dyn Measurable + 'a>)>;

/// Layers applied forward.
fn forward_layers<'a, M: Measurable + 'a>(layers: impl Iterator<Item = M>) -> Layers<'a> {
    let boxed = |layer| Box::new(layer) as Box<dyn Measurable + 'a>;
    layers.map(|layer| (Direction::Forward, boxed(layer))).collect()
}

/// A family of nearly-periodic maps P_ε = I_ε∘ψ∘Φ_θ∘ψ⁻¹, seen through its
/// parts. [`Gyroceptron`] is one; so is whatever claims to be built this way.
pub trait NearlyPeriodic: Measurable {
    /// P_ε at another ε.
    fn map_at(&self, epsilon: f64) -> Box<dyn Measurable + '_>;
    /// I_ε at another ε.
    fn near_identity_at(&self, epsilon: f64) -> Box<dyn Measurable + '_>;
    /// ψ.
    fn conjugation(&self) -> Box<dyn Measurable + '_>;
    /// How often each plane (q_j, p_j) turns while θ goes round once.
    fn action_weights(&self) -> &[i32];
    /// z ← Φ_θ(z).
    fn turn(&self, theta: f64, z: &mut [f64]);
    /// ψ∘Φ_θ∘ψ⁻¹.
    fn conjugated_action_at(&self, theta: f64) -> Box<dyn Measurable + '_>;
    /// θ of the map.
    fn angle(&self) -> f64;
    /// ε of the map.
    fn epsilon(&self) -> f64;
}

/// Elementary steps as measures see them, those of the inverse backwards.
fn in_direction<'a, V>(
    mut steps: Vec<ElementaryStep<'a, f64, V>>,
    direction: Direction,
) -> MeasuredSteps<'a>
where
    V: Potential<f64> + Potential<Dual<f64, 8>> + 'a,
{
    if direction == Direction::Inverse {
        steps.reverse();
        steps = steps.into_iter().map(ElementaryStep::inverse).collect();
    }
    steps.into_iter().map(|step| Box::new(step) as Box<dyn MeasuredStep + 'a>).collect()
}

impl Measurable for Composition<f64> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        in_direction(self.elementary_steps(), direction)
    }
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        map_points(self, direction, points).expect("whole points");
    }
}

impl<'p, V> Measurable for HenonLayer<'p, f64, V>
where
    V: Potential<f64> + Potential<Dual<f64, 8>> + Copy + 'p,
{
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        in_direction(self.kicks().map(ElementaryStep::Kick).into(), direction)
    }
}

impl<'p, V> Measurable for HenonMap<'p, f64, V>
where
    V: Potential<f64> + Potential<Dual<f64, 8>> + Copy + 'p,
{
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        vec![Box::new(HenonStep { map: *self, inverse: direction == Direction::Inverse })]
    }
}

/// The single Hénon map, or its inverse, as one step. One half of the output is
/// a shifted copy, the other is a kick away from the other half of the input.
struct HenonStep<'p, V> {
    map: HenonMap<'p, f64, V>,
    inverse: bool,
}

impl<V: Potential<f64> + Potential<Dual<f64, 8>>> HenonStep<'_, V> {
    /// Where ∇V is taken: y, or x − η in the inverse.
    fn argument(&self, z: &[f64]) -> Vec<f64> {
        let n = z.len() / 2;
        match self.inverse {
            false => z[n..].to_vec(),
            true => (0..n).map(|i| z[i] - self.map.eta[i]).collect(),
        }
    }

    /// The first row of the half that ∇V is added to, and of the half that it
    /// is taken of.
    fn rows(&self, n: usize) -> (usize, usize) {
        if self.inverse { (0, 0) } else { (n, n) }
    }
}

impl<V: Potential<f64> + Potential<Dual<f64, 8>>> MeasuredStep for HenonStep<'_, V>
where
    V: Copy,
{
    fn apply(&self, z: &mut [f64]) {
        if self.inverse { self.map.inverse(z) } else { self.map.forward(z) }
    }

    fn apply_tangent(&self, z: &mut [Dual<f64, 8>]) {
        if self.inverse { self.map.inverse(z) } else { self.map.forward(z) }
    }

    fn jacobian_magnitude(&self, z: &[f64], before: &[f64], after: &[f64], e: &mut [f64]) {
        let (dim, n) = (z.len(), z.len() / 2);
        let (target, source) = self.rows(n);
        let mut hessian = vec![0.0; n * n];
        self.map.potential.hessian_magnitude(&self.argument(z), &mut hessian);
        e.fill(0.0);
        for i in 0..n {
            for column in 0..dim {
                let reach: f64 = (0..n)
                    .map(|k| hessian[i * n + k] * before[(source + k) * dim + column].abs())
                    .sum();
                let row = (target + i) * dim + column;
                e[row] = self.map.epsilon.abs().mul_add(reach, after[row].abs());
            }
        }
    }

    fn value_magnitude(&self, z: &[f64], after: &[f64], delta: &mut [f64]) {
        let n = z.len() / 2;
        let (target, _) = self.rows(n);
        let mut magnitude = vec![0.0; n];
        self.map.potential.gradient_magnitude(&self.argument(z), &mut magnitude);
        for (d, value) in delta.iter_mut().zip(after) {
            *d = value.abs();
        }
        for i in 0..n {
            delta[target + i] += self.map.epsilon.abs() * magnitude[i];
        }
    }

    fn curvature_magnitude(&self, z: &[f64], spread: &[f64], out: &mut [f64]) {
        let n = z.len() / 2;
        let (target, source) = self.rows(n);
        let mut own = vec![0.0; n];
        let spread = &spread[source..source + n];
        self.map.potential.curvature_magnitude(&self.argument(z), spread, &mut own);
        out.fill(0.0);
        for i in 0..n {
            out[target + i] = self.map.epsilon.abs() * own[i];
        }
    }
}

impl Measurable for Rotation<f64> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        let undo = direction == Direction::Inverse;
        type NoPotential = crate::layer::TanhPotential<'static, f64>;
        let steps: Vec<ElementaryStep<'_, f64, NoPotential>> = ElementaryStep::rotation(self, undo);
        in_direction(steps, Direction::Forward)
    }
}

impl Measurable for HenonNet<f64> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        self.composition().measured_steps(direction)
    }
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        self.composition().move_points(direction, points);
    }
    fn layers(&self) -> Layers<'_> {
        forward_layers(HenonNet::layers(self))
    }
}

impl Measurable for Gyroceptron<f64> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        self.composition().measured_steps(direction)
    }
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        self.composition().move_points(direction, points);
    }
    fn layers(&self) -> Layers<'_> {
        let psi = self.shape().psi.len();
        let mut out: Layers<'_> = forward_layers(Gyroceptron::layers(self).take(psi));
        out.reverse();
        for (direction, _) in &mut out {
            *direction = Direction::Inverse;
        }
        let rotation = self.shape().circle_action.at(self.theta());
        out.push((Direction::Forward, Box::new(rotation)));
        out.extend(forward_layers(Gyroceptron::layers(self)));
        out
    }
}

impl Measurable for Model {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        self.composition().measured_steps(direction)
    }
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        self.composition().move_points(direction, points);
    }
    fn layers(&self) -> Layers<'_> {
        match self {
            Self::HenonNet(net) => Measurable::layers(net),
            Self::Gyroceptron(net) => Measurable::layers(net),
        }
    }
}

impl NearlyPeriodic for Gyroceptron<f64> {
    fn map_at(&self, epsilon: f64) -> Box<dyn Measurable + '_> {
        Box::new(self.with_epsilon(epsilon))
    }
    fn near_identity_at(&self, epsilon: f64) -> Box<dyn Measurable + '_> {
        Box::new(self.near_identity().composition().with_epsilon(epsilon))
    }
    fn conjugation(&self) -> Box<dyn Measurable + '_> {
        Box::new(self.psi())
    }
    fn action_weights(&self) -> &[i32] {
        self.shape().circle_action.weights()
    }
    fn turn(&self, theta: f64, z: &mut [f64]) {
        self.shape().circle_action.at(theta).apply(z, false);
    }
    fn conjugated_action_at(&self, theta: f64) -> Box<dyn Measurable + '_> {
        Box::new(self.conjugated_circle_action(theta))
    }
    fn angle(&self) -> f64 {
        self.theta()
    }
    fn epsilon(&self) -> f64 {
        Gyroceptron::epsilon(self)
    }
}

/// Any map that is written over the number type, as one step.
///
/// The scale of its rounding errors is found by running it on
/// [`Tracked`] numbers: nothing has to be derived by hand. The bound is that
/// of the worst case, so that a long computation is better given as a sequence
/// of steps, each a `OneStep`, in a [`Measurable`] of one's own.
#[derive(Clone, Copy, Debug)]
pub struct OneStep<M>(pub M);

impl<S, M: Map<S>> Map<S> for OneStep<M> {
    fn dof(&self) -> usize {
        self.0.dof()
    }
    fn forward(&self, z: &mut [S]) {
        self.0.forward(z);
    }
    fn inverse(&self, z: &mut [S]) {
        self.0.inverse(z);
    }
}

/// What the laws evaluate a map on.
pub trait Numbers: Map<f64> + Map<Dual<f64, 8>> + Map<Dual<Tracked, 8>> {}

impl<M> Numbers for M where M: Map<f64> + Map<Dual<f64, 8>> + Map<Dual<Tracked, 8>> {}

impl<M: Numbers> Measurable for OneStep<M> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        vec![Box::new(TrackedStep { map: &self.0, direction })]
    }
}

struct TrackedStep<'a, M> {
    map: &'a M,
    direction: Direction,
}

impl<M> TrackedStep<'_, M> {
    fn run<S>(&self, z: &mut [S])
    where
        M: Map<S>,
    {
        match self.direction {
            Direction::Forward => self.map.forward(z),
            Direction::Inverse => self.map.inverse(z),
        }
    }
}

impl<M: Numbers> MeasuredStep for TrackedStep<'_, M> {
    fn apply(&self, z: &mut [f64]) {
        self.run(z);
    }

    fn apply_tangent(&self, z: &mut [Dual<f64, 8>]) {
        self.run(z);
    }

    fn jacobian_magnitude(&self, z: &[f64], before: &[f64], _: &[f64], e: &mut [f64]) {
        let dim = z.len();
        for first in (0..dim).step_by(8) {
            let mut w: Vec<Dual<Tracked, 8>> = (0..dim)
                .map(|row| {
                    let mut out = Dual::constant(Tracked::exact(z[row]));
                    for column in first..dim.min(first + 8) {
                        out.eps[column - first] = Tracked::exact(before[row * dim + column]);
                    }
                    out
                })
                .collect();
            self.run(&mut w);
            for (row, value) in w.iter().enumerate() {
                for column in first..dim.min(first + 8) {
                    e[row * dim + column] = value.eps[column - first].bound;
                }
            }
        }
    }

    fn value_magnitude(&self, z: &[f64], _: &[f64], delta: &mut [f64]) {
        let mut w: Vec<Dual<Tracked, 8>> = z.iter().map(|&v| Dual::from_f64(v)).collect();
        self.run(&mut w);
        for (d, value) in delta.iter_mut().zip(&w) {
            *d = value.re.bound;
        }
    }
}
