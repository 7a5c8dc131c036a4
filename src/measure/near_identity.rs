//! I₀ = Id, and the size and derivative of I_ε − Id.

use crate::layer::{Neuron, RidgeFunction, Ridges};
use crate::network::{Layers, Model};
use crate::phase::Map;
use crate::scalar::{Dual, Over, Scalar, max_or_nan};
use crate::stopping::until_stopped;

/// The number of components of z whose bits the map changes.
pub fn differing_components(map: &(impl Map<f64> + ?Sized), z: &[f64]) -> usize {
    let mut moved = z.to_vec();
    map.forward(&mut moved);
    moved.iter().zip(z).filter(|(a, b)| a.to_bits() != b.to_bits()).count()
}

/// The largest |P(z) − z|, over all components and points (2n numbers each).
pub fn near_identity_size(map: &(impl Map<f64> + ?Sized), points: &[f64]) -> f64 {
    largest_change(points, 2 * map.dof(), |z| map.forward(z))
}

/// The root mean square of P(z) − z over all components and points.
pub fn near_identity_rms(map: &(impl Map<f64> + ?Sized), points: &[f64]) -> f64 {
    let mut squares = 0.0;
    for z in points.chunks_exact(2 * map.dof()) {
        let mut moved = z.to_vec();
        map.forward(&mut moved);
        squares += moved.iter().zip(z).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
    }
    (squares / points.len() as f64).sqrt()
}

/// The largest |Q(P(z)) − z| for Q = `other`. It is of order ε² for P = I_ε and
/// Q = I_{−ε}, since I_{−ε} undoes I_ε to first order only.
pub fn near_identity_inversion(
    map: &(impl Map<f64> + ?Sized),
    other: &(impl Map<f64> + ?Sized),
    points: &[f64],
) -> f64 {
    largest_change(points, 2 * map.dof(), |z| {
        map.forward(z);
        other.forward(z);
    })
}

fn largest_change(points: &[f64], dim: usize, f: impl Fn(&mut [f64])) -> f64 {
    let mut largest = 0.0;
    for point in until_stopped(points.chunks_exact(dim)) {
        let mut moved = point.to_vec();
        f(&mut moved);
        for (a, b) in moved.iter().zip(point) {
            largest = max_or_nan(largest, (a - b).abs());
        }
    }
    largest
}

/// `out` ← X_{G₁}(z) = Ω∇G₁, the derivative of I_ε in ε at 0, from the formula
/// G₁ = −Σ_layers [V(y) + V(−y−η) + V(−x) + V(x−η)] with (x, y) = (q, p). The sum is over the
/// Hénon layers that ε scales; a layer that the flow time scales too has it as a factor.
///
/// G₁ is evaluated with V(y) = w·σ(Wᵀy + b), or ρ Σ_k ∫c_k for polynomials, directly from the
/// flat parameters, and differentiated by dual numbers: the gradient code of the kicks is not
/// used. Cost: 2n evaluations of G₁.
pub fn near_identity_generator(network: &Model, z: &[f64], out: &mut [f64]) {
    type Number = Dual<f64, 1>;
    let n = network.architecture().dof;
    let flow_time = network.architecture().flow_time;
    let scaled =
        network.architecture().layers().into_iter().filter_map(|(block, number, range)| {
            let Layers::Henon(widths) = &block.layers else { return None };
            let ridges = Ridges { width: widths[number], function: block.ridges };
            let factor = if block.scale.has_time() { flow_time } else { 1.0 };
            block.scale.has_epsilon().then(|| (ridges, &network.parameters()[range], factor))
        });
    let layers: Vec<(Ridges, &[f64], f64)> = scaled.collect();
    let slope = |direction: usize| {
        let w: Vec<Number> = z
            .iter()
            .enumerate()
            .map(|(i, &v)| if i == direction { Dual::variable(v, 0) } else { Dual::constant(v) })
            .collect();
        let mut total = Number::zero();
        for &(ridges, parameters, factor) in &layers {
            let (weights, eta) = parameters.split_at(ridges.parameter_count(n));
            let potential = |at: &dyn Fn(usize) -> Number| {
                let at: Vec<Number> = (0..n).map(at).collect();
                literal_potential(ridges, weights, &at)
            };
            let eta = |i: usize| Number::constant(eta[i]);
            total = total
                - potential(&|i| w[n + i]).times(factor)
                - potential(&|i| -w[n + i] - eta(i)).times(factor)
                - potential(&|i| -w[i]).times(factor)
                - potential(&|i| w[i] - eta(i)).times(factor);
        }
        total.eps[0]
    };
    for i in 0..n {
        out[i] = slope(n + i);
        out[n + i] = -slope(i);
    }
}

/// V(y), a number: w·σ(Wᵀy + b) of neurons, ρ Σ_k ∫c_k(Wᵀy/ρ)_k of polynomials, with
/// ∫T_m = ½(T_{m+1}/(m + 1) − T_{m−1}/(m − 1)).
fn literal_potential<S: Over<f64>>(ridges: Ridges, weights: &[f64], y: &[S]) -> S {
    let (n, h) = (y.len(), ridges.width);
    let mut value = S::zero();
    match ridges.function {
        RidgeFunction::Neurons(neuron) => {
            let (w_in, rest) = weights.split_at(n * h);
            let (b_in, w_out) = rest.split_at(h);
            for j in 0..h {
                let mut argument = S::embed(b_in[j]);
                for i in 0..n {
                    argument = y[i].mul_add_parameter(w_in[i * h + j], argument);
                }
                let activation = match neuron {
                    Neuron::Tanh => argument.tanh(),
                    Neuron::Arctan => argument.atan2(S::from_f64(1.0)),
                };
                value = activation.mul_add_parameter(w_out[j], value);
            }
        }
        RidgeFunction::Polynomial { radius, .. } => {
            let (w_in, c) = weights.split_at(if n > 1 { n * h } else { 0 });
            for j in 0..h {
                let mut s = S::zero();
                for i in 0..n {
                    let direction = if n > 1 { w_in[i * h + j] } else { 1.0 };
                    s = y[i].mul_add_parameter(direction / radius, s);
                }
                let mut t = vec![S::from_f64(1.0), s];
                for m in 1..=c.len() / h {
                    t.push(S::from_f64(2.0) * s * t[m] - t[m - 1]);
                }
                for (m, c) in c.iter().skip(j).step_by(h).enumerate() {
                    let over = |m: usize| t[m].times(1.0 / m as f64);
                    let integral = match m {
                        0 => s,
                        1 => over(2).times(0.5),
                        _ => (over(m + 1) - over(m - 1)).times(0.5),
                    };
                    value = integral.mul_add_parameter(radius * c, value);
                }
            }
        }
    }
    value
}
