//! The classical fourth-order Runge–Kutta method.

use super::numerical_method::NumericalMethod;
use super::request::{Method, Request};
use crate::error::Error;
use crate::scalar::{Elementary, Pack};
use crate::system::{Hamiltonian, NaturalCoordinates, System, each_system};

/// Small systems keep their working space on the stack.
const STACK: usize = 16;

/// z ← the flow over `time`, in `steps` equal steps of the classical
/// fourth-order method. Not symplectic.
///
/// Source: Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, II.1,
/// <https://doi.org/10.1007/978-3-540-78862-1>.
///
/// # Panics
/// When `steps` is 0 or z is not of 2n numbers.
#[inline(always)]
pub fn runge_kutta_4<S: Elementary>(
    system: &impl Hamiltonian,
    z: &mut [S],
    time: f64,
    steps: usize,
) {
    assert!(z.len() == 2 * system.dof());
    of_field(&Canonical(system), z, time, steps);
}

/// [`runge_kutta_4`] in the natural coordinates x of a system that has some: x ← the flow.
///
/// # Panics
/// When `steps` is 0 or x is not of 2n numbers.
#[inline(always)]
pub fn natural_runge_kutta_4<S: Elementary>(
    system: &impl NaturalCoordinates,
    x: &mut [S],
    time: f64,
    steps: usize,
) {
    assert!(x.len() == 2 * system.dof());
    of_field(&Natural(system), x, time, steps);
}

/// A vector field that depends on time: dx/dt in some coordinates x.
pub(super) trait Field {
    fn at<S: Elementary>(&self, x: &[S], time: f64, out: &mut [S]);
}

pub(super) struct Canonical<'a, H>(pub(super) &'a H);

impl<H: Hamiltonian> Field for Canonical<'_, H> {
    #[inline(always)]
    fn at<S: Elementary>(&self, x: &[S], time: f64, out: &mut [S]) {
        self.0.vector_field(x, time, out);
    }
}

pub(super) struct Natural<'a, H>(pub(super) &'a H);

impl<H: NaturalCoordinates> Field for Natural<'_, H> {
    #[inline(always)]
    fn at<S: Elementary>(&self, x: &[S], time: f64, out: &mut [S]) {
        self.0.natural_field(x, time, out);
    }
}

#[inline(always)]
fn of_field<S: Elementary>(field: &impl Field, z: &mut [S], time: f64, steps: usize) {
    assert!(steps > 0);
    let (h, dim) = (time / steps as f64, z.len());
    let mut stack = [S::zero(); 3 * STACK];
    let mut heap;
    let space = if dim <= STACK {
        &mut stack[..3 * dim]
    } else {
        heap = vec![S::zero(); 3 * dim];
        &mut heap[..]
    };
    let (stage, rest) = space.split_at_mut(dim);
    let (slope, sum) = rest.split_at_mut(dim);
    for step in 0..steps {
        let start = step as f64 * h;
        sum.fill(S::zero());
        stage.copy_from_slice(z);
        for (node, advance, weight) in
            [(0.0, 0.5, 1.0), (0.5, 0.5, 2.0), (0.5, 1.0, 2.0), (1.0, 0.0, 1.0)]
        {
            field.at(stage, start + node * h, slope);
            for i in 0..dim {
                sum[i] = S::from_f64(weight).mul_add(slope[i], sum[i]);
                stage[i] = S::from_f64(advance * h).mul_add(slope[i], z[i]);
            }
        }
        for i in 0..dim {
            z[i] = S::from_f64(h / 6.0).mul_add(sum[i], z[i]);
        }
    }
}

/// The integrator of scenes that takes steps of [`runge_kutta_4`].
pub(super) struct RungeKutta4;

impl NumericalMethod for RungeKutta4 {
    fn name(&self) -> String {
        "RK4".into()
    }

    fn trajectories(
        &self,
        request: &Request,
        system: &System,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        each_system!(system, system => request.step(self, system, initial))
    }
}

impl<H: Hamiltonian> Method<H> for RungeKutta4 {
    type Known<V: Pack> = ();

    #[inline(always)]
    fn take<V: Pack>(&self, system: &H, z: &mut [V], _: &[()], interval: f64, steps: usize) {
        for z in z.chunks_exact_mut(2 * system.dof()) {
            runge_kutta_4(system, z, interval, steps);
        }
    }
}
