//! Methods made for a charged particle in the plane, in its position and velocity.

use crate::scalar::Elementary;
use crate::system::FullOrbit;

/// z ← the flow over `time`, in `steps` equal steps of Boris' method: half a drift, half a kick by the electric
/// field, a turn by the magnetic one, half a kick, half a drift. It is of second order and preserves volume,
/// but not the symplectic form.
///
/// Source: Qin et al., <https://doi.org/10.1063/1.4818428>.
///
/// # Panics
/// When `steps` is 0 or z is not of 4 numbers.
#[inline(always)]
pub fn boris<S: Elementary>(system: &FullOrbit, z: &mut [S], time: f64, steps: usize) {
    assert!(steps > 0 && z.len() == 4);
    let h = time / steps as f64;
    let (half, whole, one) = (S::from_f64(0.5 * h), S::from_f64(h), S::from_f64(1.0));
    let [mut x, mut y, mut vx, mut vy] = system.particle(z);
    (x, y) = (half.mul_add(vx, x), half.mul_add(vy, y));
    for step in 0..steps {
        let ((sx, cx), (_, cy)) = (system.wave(x), system.wave(y));
        let (ex, ey) = system.electric(sx, cy);
        // tan(½Bh) to lowest order, as in all codes: its error is of second order too.
        let t = half * (one + cx + cy);
        let s = (t + t) / t.mul_add(t, one);
        let (ax, ay) = (half.mul_add(ex, vx), half.mul_add(ey, vy));
        let (bx, by) = (t.mul_add(ay, ax), ay - t * ax);
        (vx, vy) = (half.mul_add(ex, s.mul_add(by, ax)), half.mul_add(ey, ay - s * bx));
        let drift = if step + 1 < steps { whole } else { half };
        (x, y) = (drift.mul_add(vx, x), drift.mul_add(vy, y));
    }
    system.set_particle([x, y, vx, vy], z);
}

/// z ← the flow over `time`, in `steps` equal steps of Strang's composition of the exact flows of ½v_x², ½v_y² and εφ:
/// explicit, symplectic, of second order.
///
/// Source: He et al., <https://doi.org/10.1016/j.physleta.2016.12.031>.
///
/// # Panics
/// When `steps` is 0 or z is not of 4 numbers.
#[inline(always)]
pub fn velocity_splitting<S: Elementary>(system: &FullOrbit, z: &mut [S], time: f64, steps: usize) {
    assert!(steps > 0 && z.len() == 4);
    let h = time / steps as f64;
    let (half, whole, one) = (S::from_f64(0.5 * h), S::from_f64(h), S::from_f64(1.0));
    let [mut x, mut y, mut vx, mut vy] = system.particle(z);
    let ((mut sx, _), (mut sy, mut cy)) = (system.wave(x), system.wave(y));
    let mut kick = half;
    for step in 0..steps {
        let (ex, ey) = system.electric(sx, cy);
        (vx, vy) = (kick.mul_add(ex, vx), kick.mul_add(ey, vy));
        // A drift in x changes v_y by −∫B dx along the way, and a drift in y changes v_x by ∫B dy.
        let (way, before) = (half * vx, sx);
        x += way;
        let (between, cx) = system.wave(x);
        vy -= way.mul_add(one + cy, between - before);
        let (way, before) = (whole * vy, sy);
        y += way;
        (sy, cy) = system.wave(y);
        vx += way.mul_add(one + cx, sy - before);
        let way = half * vx;
        x += way;
        (sx, _) = system.wave(x);
        vy -= way.mul_add(one + cy, sx - between);
        kick = whole;
        if step + 1 == steps {
            let (ex, ey) = system.electric(sx, cy);
            (vx, vy) = (half.mul_add(ex, vx), half.mul_add(ey, vy));
        }
    }
    system.set_particle([x, y, vx, vy], z);
}
