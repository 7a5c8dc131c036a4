#![no_main]
use gyroceptron::measure::{OneStep, fuzz};
use gyroceptron::phase::Map;
use gyroceptron::scalar::{Elementary, constant};

/// p ← p + K sin q, q ← q + p.
struct StandardMap(f64);

impl<S: Elementary> Map<S> for StandardMap {
    fn dof(&self) -> usize {
        1
    }
    fn forward(&self, z: &mut [S]) {
        z[1] += z[0].sin_cos().0 * constant(self.0);
        z[0] += z[1];
    }
    fn inverse(&self, z: &mut [S]) {
        z[0] -= z[1];
        z[1] -= z[0].sin_cos().0 * constant(self.0);
    }
}

// Points of |zᵢ| ≤ 1e6 are undone to rounding, and JᵀΩJ = Ω there.
libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    fuzz::check(&OneStep(StandardMap(1.2)), 1e6, data);
});
