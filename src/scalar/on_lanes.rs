//! Kernels on the widest registers of the processor.

use super::simd::on_registers;
use super::{Kernel, Lanes, Pack, WIDTH};

/// Runs a kernel on eight lanes (`L` = 8) or on four.
pub(crate) fn on_lanes<const L: usize, K: Kernel>(kernel: K) -> K::Output {
    on_registers::<L, Lanes<L>, K>(kernel)
}

/// What stands for eight lanes where a processor of this architecture has no registers that may be
/// used. One of x86-64 without fused multiply-adds computes each in software: more than one
/// lane would make code, and nothing faster.
#[cfg(target_arch = "x86_64")]
type Portable = f64;
#[cfg(not(target_arch = "x86_64"))]
type Portable = Lanes<WIDTH>;

/// Runs a kernel on eight lanes, or on fewer where they are no faster: one whose results do not
/// depend on how many points go together.
pub(crate) fn on_independent_lanes<K: Kernel>(kernel: K) -> K::Output {
    on_registers::<WIDTH, Portable, K>(kernel)
}

/// `tanh[i]`, `sech2[i]` ← [`tanh_sech2`](super::tanh_sech2)`(x[i])`, with the same bits, on the widest vector
/// registers.
///
/// # Panics
/// When the three slices differ in length.
pub fn tanh_sech2_of_all(x: &[f64], tanh: &mut [f64], sech2: &mut [f64]) {
    assert!(x.len() == tanh.len() && x.len() == sech2.len());
    on_lanes::<WIDTH, _>(TanhSech2 { x, tanh, sech2 });
}

struct TanhSech2<'a> {
    x: &'a [f64],
    tanh: &'a mut [f64],
    sech2: &'a mut [f64],
}

impl Kernel for TanhSech2<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Pack>(self) {
        /// Registers that go in step.
        const K: usize = 4;
        let Self { x, tanh, sech2 } = self;
        let size = K * V::LANES;
        let outputs = tanh.chunks_exact_mut(size).zip(sech2.chunks_exact_mut(size));
        for (x, (tanh, sech2)) in x.chunks_exact(size).zip(outputs) {
            let mut lanes = [V::zero(); K];
            for (k, lane) in lanes.iter_mut().enumerate() {
                *lane = V::load(&x[k * V::LANES..(k + 1) * V::LANES]);
            }
            let (t, s) = V::tanh_sech2_each(lanes);
            for k in 0..K {
                let range = k * V::LANES..(k + 1) * V::LANES;
                t[k].store(&mut tanh[range.clone()]);
                s[k].store(&mut sech2[range]);
            }
        }
        let whole = x.len() / size * size;
        for first in (whole..x.len()).step_by(V::LANES) {
            let part = first..x.len().min(first + V::LANES);
            let (t, s) = V::load_part(&x[part.clone()]).tanh_sech2();
            t.store_part(&mut tanh[part.clone()]);
            s.store_part(&mut sech2[part]);
        }
    }
}
