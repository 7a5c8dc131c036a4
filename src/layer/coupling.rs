//! The affine coupling: a layer that is invertible and not symplectic.

use super::unrolled::{for_neurons, in_registers};
use super::{ElementaryMap, OfMomenta};
use crate::scalar::{Over, Scalar};

/// p ← f(τ) ⊙ p + c·y(q), τ = tanh(c·x(q)): each momentum scaled and shifted by functions of the
/// positions,
///
/// x(q) = A tanh(Wᵀq + b) + a, y(q) = B tanh(Wᵀq + b) + β, f(τ) = (2 + τ)/(2 − τ).
///
/// The inverse is p ← f(−τ) ⊙ (p − c·y(q)), in closed form for all weights: f lies between ⅓ and
/// 3, equals e^τ to second order, and f(τ)f(−τ) = 1. Volumes change by Π f(τᵢ): the map is not
/// symplectic, and it maps no grid of numbers onto itself, so the inverse is exact up to rounding
/// but not bit for bit. At c = 0 it is the identity.
///
/// Its parameters are `[W (n × h, row by row), b (h), A (n × h), a (n), B (n × h), β (n)]`. `D` fixes n
/// at compile time where the caller knows it.
///
/// Source: the affine coupling layers of Dinh, Sohl-Dickstein and Bengio,
/// <https://arxiv.org/abs/1605.08803>, section 3.3, with the bounded f in place of the exponential.
#[derive(Clone, Copy, Debug)]
pub struct AffineCoupling<'a, P, const D: usize = 0> {
    dof: usize,
    width: usize,
    w_in: &'a [P],
    b_in: &'a [P],
    of_scale: Outputs<'a, P>,
    of_shift: Outputs<'a, P>,
    scale: P,
    inverse: bool,
}

/// A row of weights and a bias for each output.
#[derive(Clone, Copy, Debug)]
struct Outputs<'a, P> {
    weights: &'a [P],
    biases: &'a [P],
}

impl<P: Scalar> Outputs<'_, P> {
    /// out += the K neurons' part, t from j on.
    #[inline(always)]
    fn add<S: Over<P>, const K: usize>(&self, width: usize, j: usize, t: [S; K], out: &mut [S]) {
        for (i, out) in out.iter_mut().enumerate() {
            let row = &self.weights[i * width + j..][..K];
            for k in 0..K {
                *out = t[k].mul_add_parameter(row[k], *out);
            }
        }
    }
}

/// The number of parameters of a coupling.
pub fn coupling_parameter_count(dof: usize, width: usize) -> usize {
    let weights = dof.saturating_mul(width).saturating_mul(3);
    weights.saturating_add(width).saturating_add(dof.saturating_mul(2))
}

impl<'a, P: Scalar, const D: usize> AffineCoupling<'a, P, D> {
    /// The coupling of these parameters with c = `scale`.
    ///
    /// # Panics
    /// When `parameters` does not hold [`coupling_parameter_count`] numbers, or `D` is neither 0 nor
    /// `dof`.
    #[inline(always)]
    pub fn new(dof: usize, width: usize, scale: P, parameters: &'a [P]) -> Self {
        assert!(D == 0 || D == dof);
        let (w_in, rest) = parameters.split_at(dof * width);
        let (b_in, rest) = rest.split_at(width);
        let (of_scale, of_shift) = rest.split_at(dof * (width + 1));
        assert!(of_shift.len() == dof * (width + 1));
        let outputs = |of: &'a [P]| {
            let (weights, biases) = of.split_at(dof * width);
            Outputs { weights, biases }
        };
        let (of_scale, of_shift) = (outputs(of_scale), outputs(of_shift));
        Self { dof, width, w_in, b_in, of_scale, of_shift, scale, inverse: false }
    }

    /// The weights of the coupling in the order of its parameters: W, b, A, a, B and β.
    pub fn weights(&self) -> [&'a [P]; 6] {
        let Outputs { weights: to_scale, biases: of_scale } = self.of_scale;
        let Outputs { weights: to_shift, biases: of_shift } = self.of_shift;
        [self.w_in, self.b_in, to_scale, of_scale, to_shift, of_shift]
    }

    /// The factor c in the change of the momenta.
    pub fn scale(&self) -> P {
        self.scale
    }

    /// n, a constant where `D` is.
    #[inline(always)]
    fn n(&self) -> usize {
        if D > 0 { D } else { self.dof }
    }

    /// tanh and sech² of K neurons from j on.
    #[inline(always)]
    fn neurons<S: Over<P>, const K: usize>(&self, j: usize, q: &[S]) -> ([S; K], [S; K]) {
        let mut z = [S::zero(); K];
        for k in 0..K {
            z[k] = S::embed(self.b_in[j + k]);
        }
        for i in 0..self.n() {
            let row = &self.w_in[i * self.width + j..][..K];
            for k in 0..K {
                z[k] = q[i].mul_add_parameter(row[k], z[k]);
            }
        }
        S::tanh_sech2_each(z)
    }

    /// x and y, from (tanh, sech²) of each neuron, which are kept where there is space.
    #[inline(always)]
    fn outputs<S: Over<P>>(&self, q: &[S], x: &mut [S], y: &mut [S], kept: &mut [S]) {
        let n = self.n();
        in_registers!(S, n, D, [q], x => in_registers!(S, n, D, [], y => {
            for_neurons!(self.width, j, K => {
                let (t, s) = self.neurons::<S, K>(j, q);
                if !kept.is_empty() {
                    for k in 0..K {
                        kept[2 * (j + k)] = t[k];
                        kept[2 * (j + k) + 1] = s[k];
                    }
                }
                self.of_scale.add(self.width, j, t, x);
                self.of_shift.add(self.width, j, t, y);
            });
            for i in 0..n {
                x[i] += S::embed(self.of_scale.biases[i]);
                y[i] += S::embed(self.of_shift.biases[i]);
            }
        }));
    }

    /// One momentum moved, with x and y of it.
    #[inline(always)]
    fn moved<S: Over<P>>(&self, p: S, x: S, y: S) -> Moved<S> {
        let two = S::from_f64(2.0);
        let (mut tau, slope) = x.times(self.scale).tanh_sech2();
        let mut scaled = p;
        if self.inverse {
            tau = -tau;
            scaled = y.mul_add_parameter(-self.scale, p);
        }
        let room = two - tau;
        // f − 1, so that a small change is not rounded as a large number.
        let growth = two * tau / room;
        let mut out = growth.mul_add(scaled, scaled);
        if !self.inverse {
            out = y.mul_add_parameter(self.scale, out);
        }
        let factor = S::from_f64(1.0) + growth;
        let along = S::from_f64(4.0) / (room * room) * slope.times(self.scale);
        let along = if self.inverse { -along } else { along };
        Moved { out, factor, by_x: scaled * along }
    }

    /// The derivative of a moved momentum by its y.
    #[inline(always)]
    fn by_y<S: Over<P>>(&self, factor: S) -> S {
        let scale = S::embed(self.scale);
        if self.inverse { -(factor * scale) } else { scale }
    }
}

/// A momentum after the coupling, with its derivatives by the momentum and by x.
struct Moved<S> {
    out: S,
    factor: S,
    by_x: S,
}

impl<P: Scalar, const D: usize> ElementaryMap<P> for AffineCoupling<'_, P, D> {
    #[inline(always)]
    fn dof(&self) -> usize {
        self.n()
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        Self { inverse: !self.inverse, ..self }
    }

    /// The positions, both derivatives of each momentum, and (tanh, sech²) of each neuron.
    #[inline(always)]
    fn tape_len(&self) -> usize {
        3 * self.n() + 2 * self.width
    }

    #[inline(always)]
    fn activation_count(&self) -> usize {
        self.width + self.n()
    }

    #[inline(always)]
    fn apply<S: Over<P>>(&self, z: &mut [S], scratch: &mut [S]) {
        if self.is_identity() {
            return;
        }
        let n = self.n();
        let (q, p) = z.split_at_mut(n);
        let (x, y) = scratch.split_at_mut(n);
        self.outputs(q, x, y, &mut []);
        for i in 0..n {
            p[i] = self.moved(p[i], x[i], y[i]).out;
        }
    }

    #[inline(always)]
    fn forward_recorded<S: Over<P>>(&self, z: &mut [S], tape: &mut [S], scratch: &mut [S]) {
        if self.is_identity() {
            return;
        }
        let n = self.n();
        let (q, p) = z.split_at_mut(n);
        let (x, y) = scratch.split_at_mut(n);
        let (positions, rest) = tape.split_at_mut(n);
        let (derivatives, neurons) = rest.split_at_mut(2 * n);
        positions.copy_from_slice(q);
        self.outputs(q, x, y, neurons);
        for i in 0..n {
            let moved = self.moved(p[i], x[i], y[i]);
            p[i] = moved.out;
            derivatives[2 * i] = moved.factor;
            derivatives[2 * i + 1] = moved.by_x;
        }
    }

    #[inline(always)]
    fn vjp<S: Over<P>>(
        &self,
        tape: &[S],
        z_bar: &mut [S],
        parameters_bar: &mut [S],
        scratch: &mut [S],
    ) {
        if self.is_identity() {
            return;
        }
        let (n, h) = (self.n(), self.width);
        let (q_bar, p_bar) = z_bar.split_at_mut(n);
        let (x_bar, y_bar) = scratch.split_at_mut(n);
        let (q, rest) = tape.split_at(n);
        let (derivatives, neurons) = rest.split_at(2 * n);
        let (w_in_bar, rest) = parameters_bar.split_at_mut(n * h);
        let (b_in_bar, rest) = rest.split_at_mut(h);
        let (scale_bar, shift_bar) = rest.split_at_mut(n * (h + 1));
        for i in 0..n {
            let (factor, by_x) = (derivatives[2 * i], derivatives[2 * i + 1]);
            x_bar[i] = by_x * p_bar[i];
            y_bar[i] = self.by_y(factor) * p_bar[i];
            p_bar[i] *= factor;
            scale_bar[n * h + i] += x_bar[i];
            shift_bar[n * h + i] += y_bar[i];
        }
        for j in 0..h {
            let (t, s) = (neurons[2 * j], neurons[2 * j + 1]);
            let mut t_bar = S::zero();
            for i in 0..n {
                let at = i * h + j;
                scale_bar[at] = x_bar[i].mul_add(t, scale_bar[at]);
                shift_bar[at] = y_bar[i].mul_add(t, shift_bar[at]);
                t_bar = x_bar[i].mul_add_parameter(self.of_scale.weights[at], t_bar);
                t_bar = y_bar[i].mul_add_parameter(self.of_shift.weights[at], t_bar);
            }
            let z_bar = s * t_bar;
            b_in_bar[j] += z_bar;
            for i in 0..n {
                let at = i * h + j;
                w_in_bar[at] = z_bar.mul_add(q[i], w_in_bar[at]);
                q_bar[i] = z_bar.mul_add_parameter(self.w_in[at], q_bar[i]);
            }
        }
    }

    #[inline(always)]
    fn jvp<S: Over<P>>(&self, z: &mut [S], directions: &mut [S], scratch: &mut [S]) {
        if self.is_identity() {
            return;
        }
        let (n, h) = (self.n(), self.width);
        let (q, p) = z.split_at_mut(n);
        let (by_x, rest) = scratch.split_at_mut(n);
        let (factor, rest) = rest.split_at_mut(n);
        let by_position = &mut rest[..n * n];
        self.outputs(q, by_x, factor, &mut []);
        for i in 0..n {
            let moved = self.moved(p[i], by_x[i], factor[i]);
            p[i] = moved.out;
            by_x[i] = moved.by_x;
            factor[i] = moved.factor;
        }
        by_position.fill(S::zero());
        for_neurons!(h, j, K => {
            let (_, s) = self.neurons::<S, K>(j, q);
            for k in 0..K {
                for i in 0..n {
                    let at = i * h + j + k;
                    let through_scale = by_x[i].times(self.of_scale.weights[at]);
                    let through_shift = self.by_y(factor[i]).times(self.of_shift.weights[at]);
                    let slope = (through_scale + through_shift) * s[k];
                    for l in 0..n {
                        let entry = &mut by_position[i * n + l];
                        *entry = slope.mul_add_parameter(self.w_in[l * h + j + k], *entry);
                    }
                }
            }
        });
        for direction in directions.chunks_exact_mut(2 * n) {
            let (along_q, along_p) = direction.split_at_mut(n);
            for i in 0..n {
                along_p[i] *= factor[i];
                for l in 0..n {
                    along_p[i] = by_position[i * n + l].mul_add(along_q[l], along_p[i]);
                }
            }
        }
    }
}

impl<P: Scalar, const D: usize> OfMomenta<P> for AffineCoupling<'_, P, D> {
    #[inline(always)]
    fn is_identity(&self) -> bool {
        self.scale.is_zero()
    }
}
