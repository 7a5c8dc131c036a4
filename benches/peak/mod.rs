//! The fused multiply-adds that a core does, and shares of them.

use gyroceptron::scalar::Simd;
use std::hint::black_box;
use std::time::Instant;

/// Multiplications, fused or not, of one tanh with its sech². Additions go
/// beside; the one division does not.
pub const TANH_PRODUCTS: f64 = 21.0;

/// Those of sech² alone.
pub const SECH2_PRODUCTS: f64 = 19.0;

#[inline(always)]
fn products(lanes: &mut [[f64; 8]; 12], times: usize) {
    // The compiler keeps a copy of its own in registers.
    let mut chains = *lanes;
    let (factor, addend) = (black_box([0.999_999; 8]), black_box([1e-9; 8]));
    for _ in 0..times {
        for chain in &mut chains {
            for i in 0..8 {
                chain[i] = chain[i].mul_add(factor[i], addend[i]);
            }
        }
    }
    *lanes = chains;
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
fn products_avx512(lanes: &mut [[f64; 8]; 12], times: usize) {
    products(lanes, times);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn products_avx2(lanes: &mut [[f64; 8]; 12], times: usize) {
    products(lanes, times);
}

/// Fused multiply-adds a second of one core, in independent chains.
pub fn peak() -> f64 {
    const TIMES: usize = 1_000_000;
    let mut lanes = [[1.0; 8]; 12];
    let mut best = f64::INFINITY;
    for _ in 0..5 {
        let start = Instant::now();
        match Simd::current() {
            #[cfg(target_arch = "x86_64")]
            // SAFETY: `current` gives what the processor has.
            Simd::Avx512 => unsafe { products_avx512(&mut lanes, TIMES) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Simd::Avx2 => unsafe { products_avx2(&mut lanes, TIMES) },
            _ => products(&mut lanes, TIMES),
        }
        black_box(&lanes);
        // no NaN: a time
        best = best.min(start.elapsed().as_secs_f64());
    }
    (TIMES * 96) as f64 / best
}

/// Prints what a sample takes, on one thread, beside the products counted for it
/// and the share of the peak that they are.
pub fn share(name: &str, samples: usize, products: f64, peak: f64, mut work: impl FnMut()) {
    let mut times: Vec<f64> = (0..15)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    let seconds = times[times.len() / 2] / samples as f64;
    let rate = products / seconds;
    println!(
        "{name}: {:.2} ns a sample, {products} products counted: {:.1} of {:.1} G a second, {:.0} % \
         of the peak",
        1e9 * seconds,
        rate / 1e9,
        peak / 1e9,
        100.0 * rate / peak
    );
}
