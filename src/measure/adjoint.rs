//! The pullback (reverse-mode gradient) tested against forward-mode dual numbers.

use super::inversion::Conditioned;
use crate::network::{Composition, Model};
use crate::phase::Map;
use crate::scalar::{Dual, Over, Real, Tracked, max_or_nan};

/// The largest error bound, as a share of the largest term, with which the identity is
/// tested. With the limit of ratios, errors of up to a ten-thousandth pass. A wrong entry
/// of the gradient changes the sum by much more: by some hundredths for a network of a
/// thousand parameters.
pub const RESOLVED: f64 = 1e-5;

/// A parametrised map with a pullback, evaluated on numbers that bound their
/// own rounding errors.
pub trait Adjoint {
    /// The current parameters of the map, in one vector.
    fn parameters(&self) -> Vec<f64>;

    /// z ← P(z) with a derivative in one direction of (parameters, z).
    fn tangent(&self, parameters: &[Dual<Tracked, 1>], z: &mut [Dual<Tracked, 1>]);

    /// The pullback at z: `z_bar` from the cotangent of P(z) to that of z,
    /// `parameters_bar` += that of the parameters.
    fn cotangent(
        &self,
        parameters: &[Tracked],
        z: &[Tracked],
        z_bar: &mut [Tracked],
        parameters_bar: &mut [Tracked],
    );
}

/// The dot-product identity ⟨c, DP·d⟩ = ⟨DPᵀ·c, d⟩ for a direction d in
/// (z, parameters) and a cotangent c of the output: |left − right| divided by the
/// sum of both running error bounds. A direction without zeros tests every entry
/// of the Jacobian.
///
/// The bound is a worst-case bound and grows with the depth. Where it exceeds [`RESOLVED`]
/// times the largest term, the result is [`Conditioned::IllConditioned`].
///
/// Source: Griewank and Walther, Evaluating Derivatives, <https://doi.org/10.1137/1.9780898717761>,
/// chapter 3, for pullbacks as transposes.
pub fn adjoint_ratio(
    map: &dyn Adjoint,
    z: &[f64],
    direction: &[f64],
    cotangent: &[f64],
) -> Conditioned {
    let parameters = map.parameters();
    let (dz, dp) = direction.split_at(z.len());
    let dual = |(value, slope): (&f64, &f64)| Dual {
        re: Tracked::exact(*value),
        eps: [Tracked::exact(*slope)],
    };
    let lifted: Vec<_> = parameters.iter().zip(dp).map(dual).collect();
    let mut w: Vec<_> = z.iter().zip(dz).map(dual).collect();
    map.tangent(&lifted, &mut w);

    let exact = |v: &[f64]| v.iter().map(|x| Tracked::exact(*x)).collect::<Vec<_>>();
    let mut z_bar = exact(cotangent);
    let mut parameters_bar = vec![Tracked::exact(0.0); parameters.len()];
    map.cotangent(&exact(&parameters), &exact(z), &mut z_bar, &mut parameters_bar);

    let mut size = 0.0;
    let mut dot = |terms: &mut dyn Iterator<Item = (Tracked, f64)>| {
        terms.fold(Tracked::exact(0.0), |sum, (value, weight)| {
            let term = value * Tracked::exact(weight);
            size = max_or_nan(size, term.value.abs());
            sum + term
        })
    };
    let left = dot(&mut w.iter().map(|v| v.eps[0]).zip(cotangent.iter().copied()));
    let bars = z_bar.iter().chain(&parameters_bar).copied();
    let right = dot(&mut bars.zip(direction.iter().copied()));
    let bound = left.error() + right.error();
    if !(left.value - right.value).is_finite() {
        return Conditioned::Ratio(f64::NAN);
    }
    if !(bound <= RESOLVED * size) {
        return Conditioned::IllConditioned;
    }
    let difference = (left.value - right.value).abs();
    Conditioned::Ratio(if difference == 0.0 { 0.0 } else { difference / bound })
}

/// The map over other numbers, its parameters replaced.
fn over<P: Real>(map: &Composition<f64>, parameters: &[P]) -> Composition<P> {
    map.with_parameters(parameters.to_vec(), P::from_f64(map.epsilon()))
        .expect("as many parameters")
}

fn vjp<P: Over<P>>(composition: &Composition<P>, z: &[P], z_bar: &mut [P], bar: &mut [P]) {
    let mut recording = composition.recording();
    composition.forward_recorded(&mut z.to_vec(), &mut recording);
    composition.vjp(&mut recording, z_bar, bar);
}

impl Adjoint for Composition<f64> {
    fn parameters(&self) -> Vec<f64> {
        Composition::parameters(self).to_vec()
    }
    fn tangent(&self, parameters: &[Dual<Tracked, 1>], z: &mut [Dual<Tracked, 1>]) {
        over(self, parameters).forward(z);
    }
    fn cotangent(
        &self,
        parameters: &[Tracked],
        z: &[Tracked],
        z_bar: &mut [Tracked],
        parameters_bar: &mut [Tracked],
    ) {
        vjp(&over(self, parameters), z, z_bar, parameters_bar);
    }
}

impl Adjoint for Model {
    fn parameters(&self) -> Vec<f64> {
        self.composition().parameters().to_vec()
    }
    fn tangent(&self, parameters: &[Dual<Tracked, 1>], z: &mut [Dual<Tracked, 1>]) {
        self.composition().tangent(parameters, z);
    }
    fn cotangent(
        &self,
        parameters: &[Tracked],
        z: &[Tracked],
        z_bar: &mut [Tracked],
        parameters_bar: &mut [Tracked],
    ) {
        self.composition().cotangent(parameters, z, z_bar, parameters_bar);
    }
}
