//! Potentials V(y) and what their gradients and adjoints need.

use super::unrolled::{for_neurons, in_registers};
use crate::scalar::{Over, Pack, Scalar, WIDTH};
use serde::{Deserialize, Serialize};

/// A potential V: ℝⁿ → ℝ, seen through its gradient.
///
/// The methods work on slices that the caller owns; none allocates.
pub trait Potential<S: Scalar> {
    /// n, the length of `y`.
    fn dof(&self) -> usize;

    /// Computes the gradient of V at y, `out` ← ∇V(y), n numbers.
    fn gradient(&self, y: &[S], out: &mut [S]);
}

/// The activation σ of the neurons of a potential.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Neuron {
    /// tanh, that of the paper.
    #[default]
    Tanh,
    /// arctan. Its slope 1/(1 + x²) needs no exponential, so that it takes about half as long; it is bounded and
    /// analytic too.
    Arctan,
}

impl Neuron {
    /// Its name in files and options.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tanh => "tanh",
            Self::Arctan => "arctan",
        }
    }

    /// The neuron of a name, if there is one.
    pub fn named(name: &str) -> Option<Self> {
        [Self::Tanh, Self::Arctan].into_iter().find(|neuron| neuron.name() == name)
    }

    /// (t, s) at K numbers: the slope s = σ′(x), and t such that s′ = −2ts.
    #[inline(always)]
    pub(crate) fn slopes<S: Scalar, const K: usize>(self, x: [S; K]) -> ([S; K], [S; K]) {
        match self {
            Self::Tanh => S::tanh_sech2_each(x),
            Self::Arctan => S::lorentzian_each(x),
        }
    }
}

/// V(y) = w·σ(Wᵀy + b): one hidden layer of h neurons; with σ = tanh the paper's V\[W\].
///
/// ∇V(y) = W(w ⊙ σ′(Wᵀy + b)). There is no output bias, since it would not affect
/// the gradient. `D` fixes n at compile time where the caller knows it; `D = 0`
/// takes n from the arguments.
#[derive(Clone, Copy, Debug)]
pub struct NeuronPotential<'a, P, const D: usize = 0> {
    dof: usize,
    w_in: &'a [P],
    b_in: &'a [P],
    w_out: &'a [P],
    neuron: Neuron,
}

impl<'a, P: Copy, const D: usize> NeuronPotential<'a, P, D> {
    /// A view of the parameters `[W (n × h, row by row), b (h), w (h)]` of neurons of tanh.
    ///
    /// # Panics
    /// When `parameters` does not hold `width·(dof + 2)` numbers, or `D` is
    /// neither 0 nor `dof`.
    #[inline(always)]
    pub fn new(dof: usize, width: usize, parameters: &'a [P]) -> Self {
        assert!(D == 0 || D == dof);
        let (w_in, rest) = parameters.split_at(dof * width);
        let (b_in, w_out) = rest.split_at(width);
        assert!(w_out.len() == width);
        Self { dof, w_in, b_in, w_out, neuron: Neuron::Tanh }
    }

    /// The potential of the same numbers with neurons of this activation.
    #[inline(always)]
    #[must_use]
    pub fn with_neurons(self, neuron: Neuron) -> Self {
        Self { neuron, ..self }
    }

    /// The activation of its neurons.
    #[inline(always)]
    pub fn neuron(&self) -> Neuron {
        self.neuron
    }

    /// n, a constant where `D` is.
    #[inline(always)]
    pub(super) fn n(&self) -> usize {
        if D > 0 { D } else { self.dof }
    }

    /// W (n × h, row by row), b (h) and w (h).
    pub fn weights(&self) -> [&[P]; 3] {
        [self.w_in, self.b_in, self.w_out]
    }

    /// The number of neurons h.
    #[inline(always)]
    pub fn width(&self) -> usize {
        self.w_out.len()
    }

    /// K neurons from j on.
    #[inline(always)]
    fn neurons<const K: usize>(&self, j: usize) -> Neurons<'a, P, K, D> {
        let h = self.width();
        let b_in = self.b_in[j..j + K].first_chunk().expect("K of them");
        let mut w_in = [b_in; D];
        for i in 0..D {
            w_in[i] = self.w_in[i * h..(i + 1) * h][j..j + K].first_chunk().expect("K of them");
        }
        Neurons {
            w_in,
            b_in,
            w_out: self.w_out[j..j + K].first_chunk().expect("K of them"),
            all: self.w_in,
            row: h,
            first: j,
        }
    }

    /// The argument (Wᵀy + b)ⱼ of the activation of neuron j.
    #[inline(always)]
    pub fn preactivation<S: Over<P>>(&self, j: usize, y: &[S]) -> S {
        let [z] = self.neurons(j).preactivations(y);
        z
    }

    #[inline(always)]
    fn add_gradient<S: Over<P>, const K: usize>(&self, j: usize, y: &[S], out: &mut [S]) {
        let neurons = self.neurons::<K>(j);
        let (_, s) = self.neuron.slopes(neurons.preactivations(y));
        neurons.accumulate(s, out);
    }

    /// out += the K neurons' part of ∇V, keeping (t, s) of each on the tape.
    #[inline(always)]
    fn add_gradient_recording<S: Over<P>, const K: usize>(
        &self,
        j: usize,
        y: &[S],
        out: &mut [S],
        tape: &mut [S],
    ) {
        let neurons = self.neurons::<K>(j);
        let tape = &mut tape[2 * j..2 * (j + K)];
        let (t, s) = self.neuron.slopes(neurons.preactivations(y));
        for k in 0..K {
            tape[2 * k] = t[k];
            tape[2 * k + 1] = s[k];
        }
        neurons.accumulate(s, out);
    }

    #[inline(always)]
    fn gradient_of<S: Over<P>>(&self, y: &[S], out: &mut [S]) {
        for_neurons!(self.width(), j, K => self.add_gradient::<S, K>(j, y, out));
    }

    #[inline(always)]
    fn gradient_of_recording<S: Over<P>>(&self, y: &[S], out: &mut [S], tape: &mut [S]) {
        for_neurons!(self.width(), j, K => self.add_gradient_recording::<S, K>(j, y, out, tape));
    }

    /// `out` ← ∇V(y), `hessian` ← V″(y) = W diag(−2 w t s) Wᵀ, n × n row by row.
    #[inline(always)]
    pub(super) fn gradient_and_hessian<S: Over<P>>(
        &self,
        y: &[S],
        out: &mut [S],
        hessian: &mut [S],
    ) {
        let n = self.n();
        // Where n is known: in registers.
        let mut known = [[S::zero(); D]; D];
        in_registers!(S, n, D, [y], out => {
            if const { D == 0 } {
                for entry in hessian.iter_mut() {
                    *entry = S::zero();
                }
            }
            for_neurons!(self.width(), j, K => {
                let neurons = self.neurons::<K>(j);
                let (t, s) = self.neuron.slopes(neurons.preactivations(y));
                neurons.accumulate(s, out);
                for k in 0..K {
                    let d = S::from_f64(-2.0) * t[k] * s[k].times(neurons.w_out[k]);
                    for row in 0..D {
                        let d = d.times(neurons.w_in[row][k]);
                        for column in 0..D {
                            // A constant number of turns, so that the loop is unrolled.
                            if column >= row {
                                let entry = &mut known[row][column];
                                *entry = d.mul_add_parameter(neurons.w_in[column][k], *entry);
                            }
                        }
                    }
                    if const { D == 0 } {
                        for row in 0..n {
                            let d = d.times(neurons.row(row)[k]);
                            for column in row..n {
                                let entry = &mut hessian[row * n + column];
                                *entry = d.mul_add_parameter(neurons.row(column)[k], *entry);
                            }
                        }
                    }
                }
            });
        });
        for row in 0..D {
            for column in row..D {
                hessian[row * D + column] = known[row][column];
            }
        }
        for row in 0..n {
            for column in 0..row {
                hessian[row * n + column] = hessian[column * n + row];
            }
        }
    }
}

/// The parameters of K neurons, found before anything is computed with them: a check
/// of a bound between two computations would keep them from going in step. Seen by
/// reference, so that a register is filled straight from memory.
struct Neurons<'a, P, const K: usize, const D: usize> {
    /// K columns of W, row by row, where the number of rows is known.
    w_in: [&'a [P; K]; D],
    b_in: &'a [P; K],
    w_out: &'a [P; K],
    /// W, the length of its rows, and the first of the columns.
    all: &'a [P],
    row: usize,
    first: usize,
}

impl<'a, P: Copy, const K: usize, const D: usize> Neurons<'a, P, K, D> {
    #[inline(always)]
    fn row(&self, i: usize) -> &'a [P; K] {
        if const { D > 0 } {
            return self.w_in[i];
        }
        let first = i * self.row + self.first;
        self.all[first..first + K].first_chunk().expect("K of them")
    }

    /// What the neurons are fed with, Wᵀy + b.
    #[inline(always)]
    fn preactivations<S: Over<P>>(&self, y: &[S]) -> [S; K] {
        let mut z = [S::zero(); K];
        for k in 0..K {
            z[k] = S::embed(self.b_in[k]);
        }
        for (i, &y) in y.iter().enumerate() {
            let w_in = self.row(i);
            for k in 0..K {
                z[k] = y.mul_add_parameter(w_in[k], z[k]);
            }
        }
        z
    }

    /// out += Σₖ W_{·k} wₖ sₖ, as [`Pack::sum_of_products`] sums: two short chains
    /// of results rather than a long one.
    #[inline(always)]
    fn accumulate<S: Over<P>>(&self, s: [S; K], out: &mut [S]) {
        let mut c = s;
        for k in 0..K {
            c[k] = s[k].times(self.w_out[k]);
        }
        for (i, out) in out.iter_mut().enumerate() {
            let w_in = self.row(i);
            let mut sums = [*out; 2];
            for k in 0..K {
                sums[k % 2] = match k {
                    1 => c[k].times(w_in[k]),
                    _ => c[k].mul_add_parameter(w_in[k], sums[k % 2]),
                };
            }
            *out = if const { K == 1 } { sums[0] } else { sums[0] + sums[1] };
        }
    }
}

impl<P: Scalar, const D: usize> NeuronPotential<'_, P, D> {
    /// ∇V at one point, with a neuron in each of the four lanes: the same bits as
    /// [`Potential::gradient`].
    #[inline(always)]
    pub(super) fn gradient_across<V: Pack<P>>(&self, y: &[P], out: &mut [P])
    where
        P: Over<P>,
    {
        const { assert!(V::LANES >= 4, "as many lanes as neurons that go together") };
        in_registers!(P, self.n(), D, [y], out => {
                for_neurons!(self.width(), j, K => {
                let neurons = self.neurons::<K>(j);
                let mut z = V::load_part(neurons.b_in);
                for (i, &y) in y.iter().enumerate() {
                    z = V::splat(y).mul_add(V::load_part(neurons.row(i)), z);
                }
                let (_, [s]) = self.neuron.slopes([z]);
                let mut c = s * V::load_part(neurons.w_out);
                if K < V::LANES {
                    // Lanes without a neuron would leave a NaN where y is infinite, and
                    // +0 where the sum is −0.
                    let mut all = [P::zero(); WIDTH];
                    c.store(&mut all[..V::LANES]);
                    for absent in &mut all[K..V::LANES] {
                        *absent = P::from_f64(-0.0);
                    }
                    c = V::load(&all[..V::LANES]);
                }
                for (i, out) in out.iter_mut().enumerate() {
                    *out = c.sum_of_products(V::load_part(neurons.row(i)), *out);
                }
            });
        });
    }
}

impl<P: Copy, S: Over<P>, const D: usize> Potential<S> for NeuronPotential<'_, P, D> {
    #[inline(always)]
    fn dof(&self) -> usize {
        self.n()
    }

    #[inline(always)]
    fn gradient(&self, y: &[S], out: &mut [S]) {
        in_registers!(S, self.n(), D, [y], out => self.gradient_of(y, out));
    }
}

impl<P: Copy, const D: usize> NeuronPotential<'_, P, D> {
    /// How many numbers [`NeuronPotential::gradient_recording`] leaves for
    /// [`NeuronPotential::vjp`].
    #[inline(always)]
    pub(super) fn tape_len(&self) -> usize {
        2 * self.width()
    }

    /// `out` ← ∇V(y), filling `tape` for the pullback.
    #[inline(always)]
    pub(super) fn gradient_recording<S: Over<P>>(&self, y: &[S], out: &mut [S], tape: &mut [S]) {
        in_registers!(S, self.n(), D, [y], out => self.gradient_of_recording(y, out, tape));
    }
}

impl<P: Scalar, const D: usize> NeuronPotential<'_, P, D> {
    /// The adjoint of (y, parameters) ↦ ∇V(y): for the cotangent `u` of the
    /// gradient, `y_bar` ← V″(y)u and `parameters_bar` += ∂(u·∇V)/∂parameters.
    #[inline(always)]
    pub(super) fn vjp<S: Over<P>>(
        &self,
        y: &[S],
        tape: &[S],
        u: &[S],
        y_bar: &mut [S],
        parameters_bar: &mut [S],
    ) {
        in_registers!(S, self.n(), D, [y, u], y_bar => {
            self.vjp_of(y, tape, u, y_bar, parameters_bar);
        });
    }

    #[inline(always)]
    fn vjp_of<S: Over<P>>(
        &self,
        y: &[S],
        tape: &[S],
        u: &[S],
        y_bar: &mut [S],
        parameters_bar: &mut [S],
    ) {
        let (n, h) = (self.n(), self.width());
        let (w_bar, rest) = parameters_bar.split_at_mut(n * h);
        let (b_bar, w_out_bar) = rest.split_at_mut(h);
        let (b_bar, w_out_bar, w_out) = (&mut b_bar[..h], &mut w_out_bar[..h], &self.w_out[..h]);
        for (j, activation) in tape[..2 * h].as_chunks().0.iter().enumerate() {
            // r = (Wᵀu)ⱼ, so that u·∇V = Σⱼ wⱼ sⱼ rⱼ.
            let mut r = S::zero();
            for i in 0..n {
                r = u[i].mul_add_parameter(self.w_in[i * h + j], r);
            }
            let bar = NeuronCotangent::of(activation, r, w_out[j]);
            w_out_bar[j] += bar.w_out;
            b_bar[j] += bar.z;
            for i in 0..n {
                let entry = &mut w_bar[i * h + j];
                *entry = bar.c.mul_add(u[i], bar.z.mul_add(y[i], *entry));
                y_bar[i] = bar.z.mul_add_parameter(self.w_in[i * h + j], y_bar[i]);
            }
        }
    }

    /// [`NeuronPotential::vjp`] at M points, for n known at compile time: the same
    /// bits as of one after another. What belongs to a neuron is loaded and stored
    /// once for all of them.
    #[inline(always)]
    pub(super) fn vjp_together<S: Over<P>, const M: usize>(
        &self,
        y: &[[S; D]; M],
        tapes: [&[S]; M],
        u: &[[S; D]; M],
        y_bar: &mut [[S; D]; M],
        parameters_bar: &mut [S],
    ) {
        let h = self.width();
        let (w_bar, rest) = parameters_bar.split_at_mut(D * h);
        let (b_bar, w_out_bar) = rest.split_at_mut(h);
        let (b_bar, w_out_bar, w_out) = (&mut b_bar[..h], &mut w_out_bar[..h], &self.w_out[..h]);
        let mut neurons: [&[[S; 2]]; M] = [&[]; M];
        for m in 0..M {
            neurons[m] = &tapes[m].as_chunks().0[..h];
        }
        for j in 0..h {
            let mut w_in = [P::zero(); D];
            let mut w_in_bar = [S::zero(); D];
            for i in 0..D {
                w_in[i] = self.w_in[i * h + j];
                w_in_bar[i] = w_bar[i * h + j];
            }
            let (mut b, mut w) = (b_bar[j], w_out_bar[j]);
            for m in 0..M {
                let mut r = S::zero();
                for i in 0..D {
                    r = u[m][i].mul_add_parameter(w_in[i], r);
                }
                let bar = NeuronCotangent::of(&neurons[m][j], r, w_out[j]);
                w += bar.w_out;
                b += bar.z;
                for i in 0..D {
                    w_in_bar[i] = bar.c.mul_add(u[m][i], bar.z.mul_add(y[m][i], w_in_bar[i]));
                    y_bar[m][i] = bar.z.mul_add_parameter(w_in[i], y_bar[m][i]);
                }
            }
            (b_bar[j], w_out_bar[j]) = (b, w);
            for i in 0..D {
                w_bar[i * h + j] = w_in_bar[i];
            }
        }
    }
}

/// The cotangents within one neuron of u·∇V = Σⱼ wⱼ sⱼ rⱼ, r = Wᵀu.
struct NeuronCotangent<S> {
    /// s r, that of w.
    w_out: S,
    /// w s, the factor of u in that of W.
    c: S,
    /// −2 w t s r, that of the preactivation.
    z: S,
}

impl<S: Scalar> NeuronCotangent<S> {
    #[inline(always)]
    fn of<P: Scalar>(&[t, s]: &[S; 2], r: S, weight: P) -> Self
    where
        S: Over<P>,
    {
        let w_out = s * r;
        let z = t * w_out.times(P::from_f64(-2.0) * weight);
        Self { w_out, c: s.times(weight), z }
    }
}
