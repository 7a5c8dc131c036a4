//! How far a Jacobian is from symplectic, in absolute numbers.

use crate::scalar::Scalar;
use faer::{Mat, MatRef};

/// R = JᵀΩJ − Ω, 2n × 2n.
///
/// # Panics
/// When the Jacobian is not square and of an even size.
pub fn symplecticity_defect<S: Scalar>(jacobian: MatRef<'_, S>) -> Mat<S> {
    let dim = jacobian.nrows();
    let dof = dim / 2;
    assert!(jacobian.ncols() == dim && dim == 2 * dof, "a Jacobian is 2n × 2n");
    Mat::from_fn(dim, dim, |j, k| {
        let mut sum = S::zero();
        for i in 0..dof {
            let (qj, pj) = (jacobian[(i, j)], jacobian[(dof + i, j)]);
            let (qk, pk) = (jacobian[(i, k)], jacobian[(dof + i, k)]);
            sum += qj * pk - pj * qk;
        }
        let omega = if k == j + dof {
            1.0
        } else if j == k + dof {
            -1.0
        } else {
            0.0
        };
        sum - S::from_f64(omega)
    })
}
