//! The steps of maps as measures see them: with the scale of their rounding errors.
//!
//! Turns and kicks by tanh and polynomial potentials have scales derived by hand. The scales of
//! any other step are found by running it on [`Tracked`] numbers ([`TrackedStep`]), for twists
//! part by part. A new kind of step needs nothing here, unless it saturates, as couplings do.

use crate::layer::{
    ElementaryMap, HenonMap, Kick, Neuron, NeuronPotential, PolynomialPotential, Potential,
    RidgePotential, Turn, quarter_turns,
};
use crate::phase::{Direction, Half, Map};
use crate::scalar::{Dual, Elementary, Over, Scalar, Tracked, max_or_nan, scales};

/// One step of a map, with the scale of the rounding errors that it makes.
///
/// Matrices are 2n × 2n, row by row.
pub trait MeasuredStep {
    /// z ← the step of z.
    fn apply(&self, z: &mut [f64]);

    /// z ← the step of z, with derivatives in eight directions.
    fn apply_tangent(&self, z: &mut [Dual<f64, 8>]);

    /// `e` ← the scale, in units of u, of the error that the step leaves in
    /// the running Jacobian, which is `before` at its input z and `after` at
    /// its output.
    fn jacobian_magnitude(&self, z: &[f64], before: &[f64], after: &[f64], e: &mut [f64]);

    /// `delta` ← the scale, in units of u, of the error that the step leaves
    /// in the point, which it moves from z to `after`.
    fn value_magnitude(&self, z: &[f64], after: &[f64], delta: &mut [f64]);

    /// `out` ← a bound of the deviation of the step from its linearisation for
    /// errors of z of size `spread`.
    fn curvature_magnitude(&self, z: &[f64], spread: &[f64], out: &mut [f64]);

    /// Whether the step may be symplectic. One that is not has to return false: next to large derivatives the
    /// defect does not show.
    fn may_be_symplectic(&self) -> bool {
        true
    }
}

/// Steps in the order of application.
pub type MeasuredSteps<'a> = Vec<Box<dyn MeasuredStep + 'a>>;

/// A bound is for errors up to so many times what they are taken for.
pub(super) const ROOM: f64 = 100.0;

/// A minimum that keeps a NaN of x.
pub(super) fn at_most(most: f64, x: f64) -> f64 {
    if x > most { most } else { x }
}

/// Scales of the rounding errors of a potential's derivatives.
pub trait Magnitudes {
    /// `out` ← a bound of |V″(y)| that rounding errors are measured by, n × n
    /// row by row.
    fn hessian_magnitude(&self, y: &[f64], out: &mut [f64]);

    /// `out` ← δ, with u·δ the scale of the rounding error of ∇V(y).
    fn gradient_magnitude(&self, y: &[f64], out: &mut [f64]);

    /// `out` ← a bound of the deviation of ∇V from its linearisation at y for errors
    /// `spread` of y, which a first-order analysis of rounding leaves out.
    fn curvature_magnitude(&self, y: &[f64], spread: &[f64], out: &mut [f64]);
}

impl<const D: usize> Magnitudes for NeuronPotential<'_, f64, D> {
    /// |W||D||Wᵀ| with D = diag(2 w s t), the diagonal of second derivatives.
    fn hessian_magnitude(&self, y: &[f64], out: &mut [f64]) {
        let [w_in, _, w_out] = self.weights();
        let (n, h) = (y.len(), w_out.len());
        out.fill(0.0);
        for j in 0..h {
            let ([t], [s]) = self.neuron().slopes([self.preactivation(j, y)]);
            let d = ((2.0 * t.abs() * s + f64::MIN_POSITIVE) * w_out[j]).abs();
            for i in 0..n {
                let row = w_in[i * h + j].abs();
                for k in 0..n {
                    let column = w_in[k * h + j].abs();
                    out[i * n + k] = (d * row).mul_add(column, out[i * n + k]);
                }
            }
        }
    }

    /// |W|(|w| ⊙ (s + 2|t| s (|W|ᵀ|y| + |b|))).
    fn gradient_magnitude(&self, y: &[f64], out: &mut [f64]) {
        let [w_in, b_in, w_out] = self.weights();
        let (n, h) = (y.len(), w_out.len());
        out.fill(0.0);
        for j in 0..h {
            let ([t], [s]) = self.neuron().slopes([self.preactivation(j, y)]);
            let mut reach = b_in[j].abs();
            for i in 0..n {
                reach = w_in[i * h + j].abs().mul_add(y[i].abs(), reach);
            }
            // Below the smallest normal number results are rounded to multiples of
            // 2⁻¹⁰⁷⁴.
            let sensitivity = 2.0 * t.abs() * s * reach + (s + f64::MIN_POSITIVE);
            let weight = w_out[j].abs().mul_add(sensitivity, f64::MIN_POSITIVE);
            for i in 0..n {
                out[i] = w_in[i * h + j].abs().mul_add(weight, out[i]);
            }
        }
    }

    /// |W|(|w| ⊙ c·min(d², 1 + d)) with d = |W|ᵀ·spread and c a bound of ½|s″|, |s′| and s next to the
    /// preactivation a, for errors up to a hundred times what they are taken for: min(1, 8e^{−2|a|}) of
    /// tanh, and min(1, 3/(1 + a²)) of arctan, where ½|s″| ≤ 3s² and |s′| = 2|a|s² ≤ s.
    fn curvature_magnitude(&self, y: &[f64], spread: &[f64], out: &mut [f64]) {
        let [w_in, _, w_out] = self.weights();
        let (n, h) = (y.len(), w_out.len());
        out.fill(0.0);
        for j in 0..h {
            let mut d = 0.0;
            for i in 0..n {
                d = w_in[i * h + j].abs().mul_add(spread[i].abs(), d);
            }
            let nearest = self.preactivation(j, y).abs() - ROOM * d;
            let tail = match self.neuron() {
                Neuron::Tanh => 8.0 * Elementary::exp(-2.0 * nearest),
                Neuron::Arctan if nearest > 0.0 => 3.0 * nearest.lorentzian().1,
                Neuron::Arctan => 1.0,
            };
            let bend = at_most(1.0, tail) * at_most(1.0 + d, d * d);
            let weight = w_out[j].abs() * bend;
            for i in 0..n {
                out[i] = w_in[i * h + j].abs().mul_add(weight, out[i]);
            }
        }
    }
}

/// A potential whose kicks can be measured. For your own potential that is generic
/// over the number type, an empty implementation is enough.
pub trait MeasuredPotential:
    Potential<f64> + Potential<Dual<f64, 8>> + Potential<Dual<Tracked, 8>> + Copy
{
    /// A kick by this potential as a measured step.
    fn measured_kick<'a>(kick: Kick<'a, f64, Self>) -> Box<dyn MeasuredStep + 'a>
    where
        Self: 'a,
    {
        Box::new(TrackedStep { map: KickMap(kick), direction: Direction::Forward })
    }

    /// The single Hénon map with this potential, or its inverse, as a measured step.
    fn measured_map<'a>(
        map: HenonMap<'a, f64, Self>,
        direction: Direction,
    ) -> Box<dyn MeasuredStep + 'a>
    where
        Self: 'a,
    {
        Box::new(TrackedStep { map, direction })
    }
}

/// A potential whose [`Magnitudes`] are derived by hand.
macro_rules! with_own_magnitudes {
    ([$($generics:tt)*] $potential:ty) => {
        impl<$($generics)*> MeasuredPotential for $potential {
            fn measured_kick<'a>(kick: Kick<'a, f64, Self>) -> Box<dyn MeasuredStep + 'a>
            where
                Self: 'a,
            {
                Box::new(KickStep { kick })
            }

            fn measured_map<'a>(
                map: HenonMap<'a, f64, Self>,
                direction: Direction,
            ) -> Box<dyn MeasuredStep + 'a>
            where
                Self: 'a,
            {
                Box::new(HenonStep { map, inverse: direction == Direction::Inverse })
            }
        }
    };
}

with_own_magnitudes!([const D: usize] NeuronPotential<'_, f64, D>);

impl Magnitudes for PolynomialPotential<'_, f64> {
    /// ρ Σ_k |a_k||f_k′||a_k|ᵀ with a = ∂s/∂y, f = P′: an error of f′ itself leaves a shear a shear.
    fn hessian_magnitude(&self, y: &[f64], out: &mut [f64]) {
        let n = y.len();
        out.fill(0.0);
        for (ridge, series) in self.each_ridge(y) {
            let [_, [slope]] = f64::series_with_slopes([ridge.s], series);
            let d = self.radius() * (slope.abs() + f64::MIN_POSITIVE);
            for i in 0..n {
                for k in 0..n {
                    let [a, b] = [ridge.slopes[i], ridge.slopes[k]].map(f64::abs);
                    out[i * n + k] = (d * a).mul_add(b, out[i * n + k]);
                }
            }
        }
    }

    /// ρ Σ_k |a_k|(|δf_k| + |f_k| + |f_k′| Σ|a||y|), δf being what rounding leaves of the series.
    fn gradient_magnitude(&self, y: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (ridge, series) in self.each_ridge(y) {
            let [[f], [slope]] = f64::series_with_slopes([ridge.s], series);
            let own = scales(ridge.s, series).value + f.abs() + slope.abs() * ridge.size;
            for (out, a) in out.iter_mut().zip(&ridge.slopes) {
                *out = (self.radius() * a).abs().mul_add(own + f64::MIN_POSITIVE, *out);
            }
        }
    }

    /// ½ρ Σ_k |a_k| max|f_k″| d² with d = |a|·spread, the second derivative being that of any point within
    /// a hundred d of s. That of a Chebyshev polynomial is largest at the end further out.
    fn curvature_magnitude(&self, y: &[f64], spread: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (ridge, series) in self.each_ridge(y) {
            let terms = ridge.slopes.iter().zip(spread).map(|(a, e)| a.abs() * e.abs());
            let d: f64 = terms.sum();
            let end = ROOM.mul_add(d, ridge.s.abs());
            let bend = series.largest_curvature(if end > 1.0 { end } else { 1.0 });
            for (out, a) in out.iter_mut().zip(&ridge.slopes) {
                *out = (self.radius() * a).abs().mul_add(0.5 * bend * d * d, *out);
            }
        }
    }
}

with_own_magnitudes!([] PolynomialPotential<'_, f64>);

impl<const D: usize> MeasuredPotential for RidgePotential<'_, f64, D> {
    fn measured_kick<'a>(kick: Kick<'a, f64, Self>) -> Box<dyn MeasuredStep + 'a>
    where
        Self: 'a,
    {
        match kick.potential {
            Self::Neurons(neurons) => NeuronPotential::measured_kick(kick.with_potential(neurons)),
            Self::Polynomial(of) => PolynomialPotential::measured_kick(kick.with_potential(of)),
        }
    }
}

/// A kick by any potential as a map.
struct KickMap<'a, V>(Kick<'a, f64, V>);

impl<S: Over<f64>, V: Potential<S> + Copy> Map<S> for KickMap<'_, V> {
    fn dof(&self) -> usize {
        self.0.potential.dof()
    }
    fn forward(&self, z: &mut [S]) {
        self.0.apply(z, &mut vec![S::zero(); z.len()]);
    }
    fn inverse(&self, z: &mut [S]) {
        self.0.inverse().apply(z, &mut vec![S::zero(); z.len()]);
    }
}

/// A kick with the scales of its errors derived by hand.
#[derive(Clone, Copy, Debug)]
pub struct KickStep<'a, V> {
    /// The kick whose errors are measured.
    pub kick: Kick<'a, f64, V>,
}

impl<V> KickStep<'_, V> {
    /// The argument of ∇V at z.
    fn argument(&self, z: &[f64]) -> Vec<f64> {
        let n = z.len() / 2;
        let mut argument = vec![0.0; n];
        self.kick.argument(self.source_of(z), &mut argument);
        argument
    }

    fn source_of<'z>(&self, z: &'z [f64]) -> &'z [f64] {
        let n = z.len() / 2;
        match self.kick.target {
            Half::Position => &z[n..],
            Half::Momentum => &z[..n],
        }
    }
}

impl<V> MeasuredStep for KickStep<'_, V>
where
    V: Potential<f64> + Potential<Dual<f64, 8>> + Magnitudes,
{
    fn apply(&self, z: &mut [f64]) {
        self.kick.apply(z, &mut vec![0.0; z.len()]);
    }

    fn apply_tangent(&self, z: &mut [Dual<f64, 8>]) {
        self.kick.apply(z, &mut vec![Dual::constant(0.0); z.len()]);
    }

    /// |c||V″||J_source| + |J_out| on the target's rows.
    fn jacobian_magnitude(&self, z: &[f64], before: &[f64], after: &[f64], e: &mut [f64]) {
        e.fill(0.0);
        if self.kick.is_identity() {
            return;
        }
        let (dim, n) = (z.len(), z.len() / 2);
        let mut hessian = vec![0.0; n * n];
        self.kick.potential.hessian_magnitude(&self.argument(z), &mut hessian);
        for i in 0..n {
            let row = self.kick.target.index(n, i);
            for column in 0..dim {
                let mut sum = 0.0;
                for k in 0..n {
                    let source = self.kick.target.other().index(n, k);
                    sum = hessian[i * n + k].mul_add(before[source * dim + column].abs(), sum);
                }
                e[row * dim + column] =
                    self.kick.scale.abs().mul_add(sum, after[row * dim + column].abs());
            }
        }
    }

    /// |c|·(the magnitude of ∇V) + |z_out| on the target.
    fn value_magnitude(&self, z: &[f64], after: &[f64], delta: &mut [f64]) {
        delta.fill(0.0);
        if self.kick.is_identity() {
            return;
        }
        let n = z.len() / 2;
        let mut magnitude = vec![0.0; n];
        self.kick.potential.gradient_magnitude(&self.argument(z), &mut magnitude);
        for i in 0..n {
            let row = self.kick.target.index(n, i);
            delta[row] = self.kick.scale.abs().mul_add(magnitude[i], after[row].abs());
        }
    }

    fn curvature_magnitude(&self, z: &[f64], spread: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        if self.kick.is_identity() {
            return;
        }
        let n = z.len() / 2;
        let mut bend = vec![0.0; n];
        self.kick.potential.curvature_magnitude(
            &self.argument(z),
            self.source_of(spread),
            &mut bend,
        );
        for i in 0..n {
            out[self.kick.target.index(n, i)] = self.kick.scale.abs() * bend[i];
        }
    }
}

/// The single Hénon map, or its inverse, as one step. One half of the output is
/// a shifted copy, the other is a kick away from the other half of the input.
struct HenonStep<'a, V> {
    map: HenonMap<'a, f64, V>,
    inverse: bool,
}

impl<V> HenonStep<'_, V> {
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

impl<V> MeasuredStep for HenonStep<'_, V>
where
    V: Potential<f64> + Potential<Dual<f64, 8>> + Magnitudes,
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
        let mut bend = vec![0.0; n];
        let spread = &spread[source..source + n];
        self.map.potential.curvature_magnitude(&self.argument(z), spread, &mut bend);
        out.fill(0.0);
        for i in 0..n {
            out[target + i] = self.map.epsilon.abs() * bend[i];
        }
    }
}

/// A linear shear inside one plane: target += coefficient·source.
#[derive(Clone, Copy, Debug)]
struct PlaneShear {
    dof: usize,
    plane: usize,
    target: Half,
    coefficient: f64,
}

impl PlaneShear {
    /// The rows of target and source.
    fn rows(&self) -> (usize, usize) {
        let row = |half: Half| half.index(self.dof, self.plane);
        (row(self.target), row(self.target.other()))
    }

    fn run<S: Over<f64>>(&self, z: &mut [S]) {
        if self.coefficient != 0.0 {
            let (to, from) = self.rows();
            z[to] = z[to].increment(self.coefficient, z[from]);
        }
    }
}

impl MeasuredStep for PlaneShear {
    fn apply(&self, z: &mut [f64]) {
        self.run(z);
    }
    fn apply_tangent(&self, z: &mut [Dual<f64, 8>]) {
        self.run(z);
    }
    fn jacobian_magnitude(&self, z: &[f64], before: &[f64], after: &[f64], e: &mut [f64]) {
        e.fill(0.0);
        if self.coefficient == 0.0 {
            return;
        }
        let (dim, (to, from)) = (z.len(), self.rows());
        for column in 0..dim {
            let reach = before[from * dim + column].abs();
            e[to * dim + column] =
                self.coefficient.abs().mul_add(reach, after[to * dim + column].abs());
        }
    }
    fn value_magnitude(&self, z: &[f64], after: &[f64], delta: &mut [f64]) {
        delta.fill(0.0);
        if self.coefficient == 0.0 {
            return;
        }
        let (to, from) = self.rows();
        delta[to] = self.coefficient.abs().mul_add(z[from].abs(), after[to].abs());
    }
    fn curvature_magnitude(&self, _: &[f64], _: &[f64], out: &mut [f64]) {
        out.fill(0.0);
    }
}

/// Quarter turns of one plane; they make no error.
#[derive(Clone, Copy, Debug)]
struct QuarterTurns {
    dof: usize,
    plane: usize,
    count: u8,
}

impl QuarterTurns {
    fn run<S: Scalar>(&self, z: &mut [S]) {
        let (q, p) = z.split_at_mut(self.dof);
        quarter_turns(self.count, &mut q[self.plane], &mut p[self.plane]);
    }
}

impl MeasuredStep for QuarterTurns {
    fn apply(&self, z: &mut [f64]) {
        self.run(z);
    }
    fn apply_tangent(&self, z: &mut [Dual<f64, 8>]) {
        self.run(z);
    }
    fn jacobian_magnitude(&self, _: &[f64], _: &[f64], _: &[f64], e: &mut [f64]) {
        e.fill(0.0);
    }
    fn value_magnitude(&self, _: &[f64], _: &[f64], delta: &mut [f64]) {
        delta.fill(0.0);
    }
    fn curvature_magnitude(&self, _: &[f64], _: &[f64], out: &mut [f64]) {
        out.fill(0.0);
    }
}

/// The shears and quarter turns of a turn, or of its inverse, in the order of
/// application.
pub fn turn_steps<'a>(turn: &Turn<f64>, direction: Direction) -> MeasuredSteps<'a> {
    let dof = turn.dof();
    let mut steps: MeasuredSteps<'a> = Vec::new();
    let inverse = direction == Direction::Inverse;
    for of in turn.planes() {
        let plane = of.plane;
        let shear = |target, coefficient: f64| {
            let coefficient = if inverse { -coefficient } else { coefficient };
            Box::new(PlaneShear { dof, plane, target, coefficient }) as Box<dyn MeasuredStep>
        };
        let count = if inverse { (8 - of.quarter_turns) % 4 } else { of.quarter_turns };
        let turns = Box::new(QuarterTurns { dof, plane, count });
        let mut shears = vec![
            shear(Half::Position, of.t),
            shear(Half::Momentum, -of.s),
            shear(Half::Position, of.t),
        ];
        let at = if of.turns_first() != inverse { 0 } else { 3 };
        shears.insert(at, turns);
        steps.extend(shears);
    }
    steps
}

/// A map over all number types on which the laws evaluate it.
pub trait Numbers: Map<f64> + Map<Dual<f64, 8>> + Map<Dual<Tracked, 8>> {}

impl<M> Numbers for M where M: Map<f64> + Map<Dual<f64, 8>> + Map<Dual<Tracked, 8>> {}

/// A map as one step. Its scales are found by running it on [`Tracked`] numbers, so
/// nothing has to be derived by hand or taken on trust.
#[derive(Clone, Copy, Debug)]
pub struct TrackedStep<M> {
    /// The map whose errors are measured.
    pub map: M,
    /// Whether the step is the map or its inverse.
    pub direction: Direction,
}

impl<M: Numbers> TrackedStep<M> {
    /// The map on numbers of these values and bounds, with the derivatives along
    /// some of the columns of `directions` (row by row).
    fn track(
        &self,
        z: &[Tracked],
        directions: &[f64],
        columns: std::ops::Range<usize>,
    ) -> Vec<Dual<Tracked, 8>> {
        let dim = z.len();
        let mut w: Vec<Dual<Tracked, 8>> = (0..dim)
            .map(|row| {
                let mut out = Dual::constant(z[row]);
                for column in columns.clone() {
                    out.eps[column - columns.start] =
                        Tracked::exact(directions[row * dim + column]);
                }
                out
            })
            .collect();
        self.map.run(self.direction, &mut w);
        w
    }
}

/// Eight columns at a time.
fn eights(dim: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
    (0..dim).step_by(8).map(move |first| first..dim.min(first + 8))
}

impl<M: Numbers> MeasuredStep for TrackedStep<M> {
    fn apply(&self, z: &mut [f64]) {
        self.map.run(self.direction, z);
    }

    fn apply_tangent(&self, z: &mut [Dual<f64, 8>]) {
        self.map.run(self.direction, z);
    }

    fn jacobian_magnitude(&self, z: &[f64], before: &[f64], _: &[f64], e: &mut [f64]) {
        let dim = z.len();
        let exact: Vec<Tracked> = z.iter().map(|&v| Tracked::exact(v)).collect();
        for columns in eights(dim) {
            let w = self.track(&exact, before, columns.clone());
            for (row, value) in w.iter().enumerate() {
                for column in columns.clone() {
                    e[row * dim + column] = value.eps[column - columns.start].bound;
                }
            }
        }
    }

    fn value_magnitude(&self, z: &[f64], _: &[f64], delta: &mut [f64]) {
        let exact: Vec<Tracked> = z.iter().map(|&v| Tracked::exact(v)).collect();
        let w = self.track(&exact, &[], 0..0);
        for (d, value) in delta.iter_mut().zip(&w) {
            *d = value.re.bound;
        }
    }

    /// Σ_jk |∂²F/∂z_j∂z_k| spread_j spread_k with the magnitudes of all terms: the
    /// bound that derivatives along unit vectors get when the point itself is known
    /// to `spread` only, less what it is for an exact point. The largest at the
    /// point and a hundred spreads to either side of it, so that where a second
    /// derivative happens to vanish it is not taken for zero.
    fn curvature_magnitude(&self, z: &[f64], spread: &[f64], out: &mut [f64]) {
        let (dim, u) = (z.len(), f64::unit_roundoff());
        let mut units = vec![0.0; dim * dim];
        for i in 0..dim {
            units[i * dim + i] = 1.0;
        }
        out.fill(0.0);
        for side in [0.0, -ROOM, ROOM] {
            let mut bend = vec![0.0; dim];
            let centre = |i: usize| side.mul_add(spread[i], z[i]);
            let exact: Vec<Tracked> = (0..dim).map(|i| Tracked::exact(centre(i))).collect();
            let known: Vec<Tracked> = (0..dim)
                .map(|i| Tracked { value: centre(i), bound: spread[i].abs() / u })
                .collect();
            for columns in eights(dim) {
                let rounding = self.track(&exact, &units, columns.clone());
                let bound = self.track(&known, &units, columns.clone());
                for (row, (bound, rounding)) in bound.iter().zip(&rounding).enumerate() {
                    for column in columns.clone() {
                        let k = column - columns.start;
                        let change = u * (bound.eps[k].bound - rounding.eps[k].bound);
                        bend[row] = change.mul_add(spread[column].abs(), bend[row]);
                    }
                }
            }
            for (out, bend) in out.iter_mut().zip(bend) {
                *out = max_or_nan(*out, bend);
            }
        }
    }
}

/// A step of a network as a map.
pub(super) struct StepMap<T>(pub(super) T);

impl<S: Over<f64>, T: ElementaryMap<f64>> Map<S> for StepMap<T> {
    fn dof(&self) -> usize {
        self.0.dof()
    }
    fn forward(&self, z: &mut [S]) {
        apply_outlined(self.0, z);
    }
    fn inverse(&self, z: &mut [S]) {
        apply_outlined(self.0.inverse(), z);
    }
}

/// z ← the step of z: compiled once for both directions.
#[inline(never)]
fn apply_outlined<S: Over<f64>>(map: impl ElementaryMap<f64>, z: &mut [S]) {
    map.apply(z, &mut vec![S::zero(); z.len()]);
}
