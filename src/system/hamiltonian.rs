//! Systems that their energy defines.

use crate::error::Error;
use crate::scalar::{Dual, Elementary};

/// A Hamiltonian system on ℝ²ⁿ with the canonical form, defined by its energy alone. Friction and other forces that
/// do not derive from an energy are added: ż = Ω∇H(z, t) + D(z, t).
pub trait Hamiltonian {
    /// The degrees of freedom n.
    fn dof(&self) -> usize;

    /// H(z, t), which for most systems does not depend on the time. `#[inline(always)]` here and on all that it calls
    /// makes flows several times as fast: it is then compiled for the vector registers that they use.
    fn energy<S: Elementary>(&self, z: &[S], time: f64) -> S;

    /// `out` += D(z, t), which is not Hamiltonian; 0 by default. With it, flows are not symplectic.
    #[inline(always)]
    fn add_dissipation<S: Elementary>(&self, z: &[S], time: f64, out: &mut [S]) {
        let _ = (z, time, out);
    }

    /// `out` ← Ω∇H(z, t) + D(z, t), by default with dual numbers. Explicit equations of motion take a fraction of
    /// that time, and should be `#[inline(always)]` too.
    #[inline(always)]
    fn vector_field<S: Elementary>(&self, z: &[S], time: f64, out: &mut [S]) {
        symplectic_gradient(self, z, time, out);
        self.add_dissipation(z, time, out);
    }

    /// The period of H in time; None where H does not depend on it. Steps of a flow map begin at
    /// whole periods: over any other interval, the iterated map is not the flow.
    fn period(&self) -> Option<f64> {
        None
    }

    /// A rough angular frequency of the fastest motion near z: it sets the first step that a
    /// reference flow tries. By default it follows from the derivatives of the vector field.
    fn fastest_frequency(&self, z: &[f64]) -> f64 {
        let mut squares = 0.0;
        for direction in 0..z.len() {
            let along = |(i, &v)| Dual::<f64, 1>::variable(v, usize::from(i != direction));
            let z: Vec<_> = z.iter().enumerate().map(along).collect();
            let mut slope = z.clone();
            self.vector_field(&z, 0.0, &mut slope);
            squares += slope.iter().map(|v| v.eps[0] * v.eps[0]).sum::<f64>();
        }
        // For a plane that turns, this is the frequency of its rotation.
        let frequency = libm::sqrt(0.5 * squares);
        if frequency.is_finite() && frequency > 0.0 { frequency } else { 1.0 }
    }

    /// Fails unless the system is defined at z.
    ///
    /// # Errors
    /// With the point, and the condition that it does not meet.
    fn check_point(&self, z: &[f64]) -> Result<(), Error> {
        let _ = z;
        Ok(())
    }
}

/// `out` ← Ω∇H(z, t), with the gradient by dual numbers.
///
/// # Panics
/// When z and `out` do not both hold 2n numbers.
#[inline(always)]
pub fn symplectic_gradient<S: Elementary>(
    system: &(impl Hamiltonian + ?Sized),
    z: &[S],
    time: f64,
    out: &mut [S],
) {
    /// Small systems keep their working space on the stack.
    const STACK: usize = 16;
    let dim = z.len();
    assert!(out.len() == dim && dim.is_multiple_of(2), "{dim} and {} numbers", out.len());
    let mut stack = [Dual::constant(S::zero()); STACK];
    let mut heap;
    let lifted = if dim <= STACK {
        &mut stack[..dim]
    } else {
        heap = vec![Dual::constant(S::zero()); dim];
        &mut heap[..]
    };
    let dof = dim / 2;
    for k in 0..dof {
        for (lifted, &v) in lifted.iter_mut().zip(z) {
            *lifted = Dual::constant(v);
        }
        lifted[k] = Dual::variable(z[k], 0);
        lifted[dof + k] = Dual::variable(z[dof + k], 1);
        let [by_position, by_momentum] = system.energy(lifted, time).eps;
        out[k] = by_momentum;
        out[dof + k] = -by_position;
    }
}

/// The divergence Σ ∂żᵢ/∂zᵢ at z, by dual numbers: how fast volumes grow. It is 0 for a Hamiltonian
/// system.
pub fn divergence(system: &impl Hamiltonian, z: &[f64], time: f64) -> f64 {
    let mut sum = 0.0;
    for direction in 0..z.len() {
        let along = |(i, &v)| Dual::<f64, 1>::variable(v, usize::from(i != direction));
        let lifted: Vec<_> = z.iter().enumerate().map(along).collect();
        let mut field = lifted.clone();
        system.vector_field(&lifted, time, &mut field);
        sum += field[direction].eps[0];
    }
    sum
}

/// Turns the plane (q, p) clockwise by `angle`.
pub(super) fn turn<S: Elementary>(z: &mut [S], q: usize, p: usize, angle: S) {
    let (s, c) = angle.sin_cos();
    let (x, y) = (z[q], z[p]);
    z[q] = c.mul_add(x, s * y);
    z[p] = c.mul_add(y, -(s * x));
}
