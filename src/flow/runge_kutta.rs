//! The classical fourth-order Runge–Kutta method.

use crate::scalar::Elementary;
use crate::system::Hamiltonian;

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
    assert!(steps > 0 && z.len() == 2 * system.dof());
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
            system.vector_field(stage, start + node * h, slope);
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
