//! Derivatives: the pullback against duals, duals against two other
//! implementations, and the map against the formulas written out once more.

use crate::mutants;
use crate::samples::{Case, mild};
use crate::{suite, tolerances};
use gyroceptron::layer::{CircleAction, layer_parameter_count};
use gyroceptron::measure::{
    Measurable,
    certificate::{Row, Tally},
    laws,
    ratios::{Adjoint, Conditioned, ILL_CONDITIONED, RoundingPropagation},
};
use gyroceptron::network::{Model, Part};
use gyroceptron::phase::{Direction, Map};
use gyroceptron::scalar::{Dual, Elementary, Scalar, Tracked, max_or_nan};
use std::ops::{Add, Mul, Neg, Sub};
use std::sync::OnceLock;

pub const STATED: usize = 400;

pub fn rows() -> &'static [Row] {
    static ROWS: OnceLock<Vec<Row>> = OnceLock::new();
    ROWS.get_or_init(|| suite::run("gradients", STATED / 2, mild(1, 12), measure))
}

fn measure(case: &Case) -> Vec<Tally> {
    let (model, points) = (case.model(), case.points(2));
    vec![
        laws::pullback(&model, &points, case.dof, case.seed),
        literal_formula(&model, &model, &points),
        other_derivatives(&model, &model, &points),
    ]
}

/// The arithmetic that the formulas need.
trait Literal:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    fn number(value: f64) -> Self;
    /// A number that is known to so many units of u.
    fn known_to(value: f64, _units: f64) -> Self {
        Self::number(value)
    }
    /// 1/cosh².
    fn sech2(self) -> Self;
}

impl Literal for num_dual::Dual64 {
    fn number(value: f64) -> Self {
        value.into()
    }
    fn sech2(self) -> Self {
        let cosh = num_dual::DualNum::cosh(&self);
        num_dual::DualNum::recip(&(cosh * cosh))
    }
}

impl Literal for dual_num::Dual<f64> {
    fn number(value: f64) -> Self {
        dual_num::Dual::from_real(value)
    }
    fn sech2(self) -> Self {
        let cosh = dual_num::Float::cosh(self);
        Self::number(1.0) / (cosh * cosh)
    }
}

type Bounded = Dual<Tracked, 1>;

impl Literal for Bounded {
    fn number(value: f64) -> Self {
        Scalar::from_f64(value)
    }
    fn known_to(value: f64, units: f64) -> Self {
        Dual::constant(Tracked { value, bound: units })
    }
    fn sech2(self) -> Self {
        Scalar::sech2(self)
    }
}

/// The parameters of a layer, read off the documented layout.
struct Layer<'a> {
    w_in: &'a [f64],
    b_in: &'a [f64],
    w_out: &'a [f64],
    eta: &'a [f64],
}

fn layers<'a>(n: usize, widths: &[usize], mut parameters: &'a [f64]) -> Vec<Layer<'a>> {
    let mut take = |count: usize| {
        let (layer, rest) = parameters.split_at(count);
        parameters = rest;
        layer
    };
    widths
        .iter()
        .map(|&h| Layer { w_in: take(n * h), b_in: take(h), w_out: take(h), eta: take(n) })
        .collect()
}

/// ε∇V(y), V(y) = Σ_j w_j tanh(Σ_i W_ij y_i + b_j).
fn gradient<T: Literal>(layer: &Layer<'_>, epsilon: f64, y: &[T]) -> Vec<T> {
    let (n, h) = (y.len(), layer.b_in.len());
    let mut out = vec![T::number(0.0); n];
    for j in 0..h {
        let mut argument = T::number(layer.b_in[j]);
        for i in 0..n {
            argument = argument + T::number(layer.w_in[i * h + j]) * y[i];
        }
        let slope = argument.sech2() * T::number(layer.w_out[j]);
        for i in 0..n {
            out[i] = out[i] + T::number(layer.w_in[i * h + j]) * slope;
        }
    }
    out.into_iter().map(|g| T::number(epsilon) * g).collect()
}

/// H(x, y) = (y + η, −x + ε∇V(y)), four times; its inverse, four times.
fn henon<T: Literal>(layer: &Layer<'_>, epsilon: f64, inverse: bool, z: &mut [T]) {
    let n = z.len() / 2;
    let eta = |i: usize| T::number(layer.eta[i]);
    for _ in 0..4 {
        let (x, y) = (z[..n].to_vec(), z[n..].to_vec());
        if inverse {
            let back: Vec<T> = (0..n).map(|i| x[i] - eta(i)).collect();
            let g = gradient(layer, epsilon, &back);
            for i in 0..n {
                z[i] = g[i] - y[i];
                z[n + i] = back[i];
            }
        } else {
            let g = gradient(layer, epsilon, &y);
            for i in 0..n {
                z[i] = y[i] + eta(i);
                z[n + i] = g[i] - x[i];
            }
        }
    }
}

/// I_ε∘ψ∘Φ_θ∘ψ⁻¹ with the rotation as a matrix.
fn literal<T: Literal>(network: &Model, z: &mut [T]) {
    let (of, parameters) = (network.architecture(), network.parameters());
    let [psi, near_identity] = [Part::Conjugation, Part::NearIdentity].map(|part| of.widths(part));
    let count: usize = psi.iter().map(|&h| layer_parameter_count(of.dof, h)).sum();
    let (own, rest) = parameters.split_at(count);
    let psi = layers(of.dof, &psi, own);
    let near_identity = layers(of.dof, &near_identity, rest);
    for layer in psi.iter().rev() {
        henon(layer, 1.0, true, z);
    }
    let n = z.len() / 2;
    for (j, &weight) in of.circles[0].weights().iter().enumerate() {
        let angle = f64::from(weight) * network.angles()[0];
        let (s, c) = libm::sincos(angle);
        // m·θ, its sine and its cosine are rounded; the shears of the map are
        // three products more.
        let [c, s] = [c, s].map(|v| T::known_to(v, 4.0 + angle.abs()));
        let (q, p) = (z[j], z[n + j]);
        z[j] = c * q + s * p;
        z[n + j] = c * p - s * q;
    }
    for layer in &psi {
        henon(layer, 1.0, false, z);
    }
    for layer in &near_identity {
        henon(layer, network.epsilon(), false, z);
    }
}

/// The formulas with bounds of their rounding: value and derivative along e_k.
fn bounded(network: &Model, z: &[f64], direction: usize) -> Vec<Bounded> {
    let mut w: Vec<Bounded> = z
        .iter()
        .enumerate()
        .map(|(i, &v)| {
            if i == direction {
                Dual::variable(Tracked::exact(v), 0)
            } else {
                Dual::constant(Tracked::exact(v))
            }
        })
        .collect();
    literal(network, &mut w);
    w
}

/// The largest ratio of (difference, bound, size); none if a bound leaves no
/// digit. A difference that is not finite is a violation, whatever its bound.
fn worst_of(entries: impl Iterator<Item = (f64, f64, f64)>) -> Conditioned {
    let (mut largest, mut ill_conditioned) = (0.0, false);
    for (difference, bound, size) in entries {
        if !difference.is_finite() {
            return Conditioned::Ratio(f64::NAN);
        }
        ill_conditioned |= !(bound < ILL_CONDITIONED * size);
        let ratio = if difference == 0.0 { 0.0 } else { difference.abs() / bound };
        largest = max_or_nan(largest, ratio);
    }
    if ill_conditioned { Conditioned::IllConditioned } else { Conditioned::Ratio(largest) }
}

/// The map against the formulas: |P(z) − literal(z)| over the sum of both
/// bounds.
pub fn literal_formula(model: &Model, map: &dyn Measurable, points: &[f64]) -> Tally {
    let network = model;
    let u = f64::unit_roundoff();
    let steps = map.measured_steps(Direction::Forward);
    let results = points.chunks_exact(2 * map.dof()).map(|z| {
        let propagation = RoundingPropagation::new(&steps, z);
        let (scales, _) = propagation.value_scales();
        let reference = bounded(network, z, 0);
        let size = z.iter().map(|v| v.abs()).fold(1.0, max_or_nan);
        let entries = (0..z.len()).map(|i| {
            let bound = u * scales[i] + reference[i].re.error();
            (propagation.end()[i] - reference[i].re.value, bound, size)
        });
        worst_of(entries)
    });
    Tally::of_ratios("gradient", "P(z) = the formulas").extend(results.collect::<Vec<_>>())
}

/// The Jacobian by our duals against the formulas over two other dual numbers.
pub fn other_derivatives(model: &Model, map: &dyn Measurable, points: &[f64]) -> Tally {
    let network = model;
    let steps = map.measured_steps(Direction::Forward);
    let mut tally = Tally::of_ratios("gradient", "J = dual_num's = num-dual's");
    for z in points.chunks_exact(2 * map.dof()) {
        let propagation = RoundingPropagation::new(&steps, z);
        let jacobian = propagation.jacobian();
        let mut entries = Vec::new();
        for column in 0..z.len() {
            let one = |i: usize| if i == column { 1.0 } else { 0.0 };
            let mut first: Vec<num_dual::Dual64> =
                z.iter().enumerate().map(|(i, &v)| num_dual::Dual64::new(v, one(i))).collect();
            let mut second: Vec<dual_num::Dual<f64>> =
                z.iter().enumerate().map(|(i, &v)| dual_num::Dual::new(v, one(i))).collect();
            literal(network, &mut first);
            literal(network, &mut second);
            // Both computations err by the bound of the formulas: ours by less.
            for (row, bounded) in bounded(network, z, column).iter().enumerate() {
                let bound = 2.0 * bounded.eps[0].error();
                for other in [first[row].eps, second[row].dual()] {
                    entries.push((jacobian[(row, column)] - other, bound, 1.0));
                }
            }
        }
        tally.push(worst_of(entries.into_iter()));
    }
    tally
}

/// A pullback that is the transpose, but for the sign of the entry of θ.
struct WrongSign(Model);

impl Adjoint for WrongSign {
    fn parameters(&self) -> Vec<f64> {
        Adjoint::parameters(&self.0)
    }
    fn tangent(&self, parameters: &[Bounded], z: &mut [Bounded]) {
        self.0.tangent(parameters, z);
    }
    fn cotangent(
        &self,
        parameters: &[Tracked],
        z: &[Tracked],
        z_bar: &mut [Tracked],
        parameters_bar: &mut [Tracked],
    ) {
        self.0.cotangent(parameters, z, z_bar, parameters_bar);
        let theta = parameters_bar.len() - 1;
        parameters_bar[theta] = -parameters_bar[theta];
    }
}

pub fn broken_pullback() -> Row {
    let model = mutants::clean();
    let samples = laws::Samples::draw(2, 0, Default::default());
    laws::pullback(&WrongSign(model), samples.points(), 2, 0).row()
}

#[test]
fn holds() {
    suite::assert_holds(rows(), STATED);
}

/// The oracles are what they are taken for: sech² and its slope at a point.
#[test]
fn the_other_duals_know_sech2() {
    let x = 0.7;
    let slope = -2.0 * libm::tanh(x) / libm::cosh(x).powi(2);
    for (name, value) in [
        ("num-dual", num_dual::Dual64::new(x, 1.0).sech2().eps),
        ("dual_num", Literal::sech2(dual_num::Dual::new(x, 1.0)).dual()),
        ("ours", Scalar::sech2(Dual::<f64, 1>::variable(x, 0)).eps[0]),
    ] {
        assert!((value - slope).abs() < tolerances::FOUR_ROUNDINGS, "{name}: {value}");
    }
    let (s, c) = Elementary::sin_cos(Dual::<f64, 1>::variable(x, 0));
    assert_eq!(s.eps[0], c.re);
}

#[test]
fn the_rotation_of_the_formulas_is_that_of_the_paper() {
    let mut z = [1.0, 0.0];
    CircleAction::new([1]).turn_by(0.3_f64).forward(&mut z);
    let error = max_or_nan((z[0] - libm::cos(0.3)).abs(), (z[1] + libm::sin(0.3)).abs());
    assert!(error <= tolerances::FOUR_ROUNDINGS, "{error:e}");
}
