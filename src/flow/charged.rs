//! Methods made for a charged particle in the plane, in its position and velocity.

use super::numerical_method::NumericalMethod;
use super::request::{Method, Request};
use crate::error::Error;
use crate::scalar::{Elementary, Pack};
use crate::system::{FullOrbit, System};

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

/// The BibTeX entry of the article of Qin et al. on Boris' method.
const BORIS: &str = "@article{QinEtAl2013,
  author = {Qin, Hong and Zhang, Shuangxi and Xiao, Jianyuan and Liu, Jian and Sun, Yajuan and Tang, William M.},
  title = {Why is {B}oris algorithm so good?},
  journal = {Physics of Plasmas},
  volume = {20},
  number = {8},
  pages = {084503},
  year = {2013},
  doi = {10.1063/1.4818428}
}
";

/// The explicit symplectic splitting for charged particles.
const VELOCITY_SPLITTING: &str = "@article{HeEtAl2017,
  author = {He, Yang and Zhou, Zhaoqi and Sun, Yajuan and Liu, Jian and Qin, Hong},
  title = {Explicit {K}-symplectic algorithms for charged particle dynamics},
  journal = {Physics Letters A},
  volume = {381},
  number = {6},
  pages = {568--573},
  year = {2017},
  doi = {10.1016/j.physleta.2016.12.031}
}
";

/// The charged particle that a system is, or the error that it is none.
fn particle<'a>(method: &impl NumericalMethod, system: &'a System) -> Result<&'a FullOrbit, Error> {
    match system {
        System::FullOrbit(system) => Ok(system),
        _ => {
            Err(method.cannot_integrate("this one is of charged particles, the system full-orbit"))
        }
    }
}

/// The integrator of scenes that takes steps of [`boris`].
pub(super) struct Boris;

impl NumericalMethod for Boris {
    fn name(&self) -> String {
        "Boris".into()
    }

    fn bibtex(&self) -> Option<&'static str> {
        Some(BORIS)
    }

    fn check_for(&self, system: &System) -> Result<(), Error> {
        particle(self, system).map(|_| ())
    }

    fn trajectories(
        &self,
        request: &Request,
        system: &System,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        request.step(self, particle(self, system)?, initial)
    }
}

impl Method<FullOrbit> for Boris {
    type Known<V: Pack> = ();

    #[inline(always)]
    fn take<V: Pack>(
        &self,
        system: &FullOrbit,
        z: &mut [V],
        _: &[()],
        interval: f64,
        steps: usize,
    ) {
        for z in z.chunks_exact_mut(4) {
            boris(system, z, interval, steps);
        }
    }
}

/// The integrator of scenes that takes steps of [`velocity_splitting`].
pub(super) struct VelocitySplitting;

impl NumericalMethod for VelocitySplitting {
    fn name(&self) -> String {
        "splitting of ½v_x², ½v_y² and φ".into()
    }

    fn bibtex(&self) -> Option<&'static str> {
        Some(VELOCITY_SPLITTING)
    }

    fn check_for(&self, system: &System) -> Result<(), Error> {
        particle(self, system).map(|_| ())
    }

    fn trajectories(
        &self,
        request: &Request,
        system: &System,
        initial: &[f64],
    ) -> Result<Vec<f64>, Error> {
        request.step(self, particle(self, system)?, initial)
    }
}

impl Method<FullOrbit> for VelocitySplitting {
    type Known<V: Pack> = ();

    #[inline(always)]
    fn take<V: Pack>(
        &self,
        system: &FullOrbit,
        z: &mut [V],
        _: &[()],
        interval: f64,
        steps: usize,
    ) {
        for z in z.chunks_exact_mut(4) {
            velocity_splitting(system, z, interval, steps);
        }
    }
}
