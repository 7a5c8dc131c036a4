//! Named, seeded streams of random numbers.

use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64;
use sha2::{Digest, Sha256};

/// A seeded stream of random numbers with a name.
///
/// Every use of randomness has its own stream, so that drawing more numbers for one purpose changes
/// nothing for another. The generator is PCG-64 seeded with SHA-256(seed, name). The mapping to
/// [0, 1) is implemented here, so that the numbers depend neither on the platform nor on a
/// dependency.
#[derive(Clone, Debug)]
pub struct Stream {
    generator: Pcg64,
}

impl Stream {
    /// The stream `name` of this seed.
    pub fn new(seed: u64, name: &str) -> Self {
        let mut hash = Sha256::new();
        hash.update(seed.to_le_bytes());
        hash.update(name.as_bytes());
        let digest: [u8; 32] = hash.finalize().into();
        Self { generator: Pcg64::from_seed(digest) }
    }

    /// The next number, uniform in [0, 1), of 53 bits.
    pub fn unit(&mut self) -> f64 {
        (self.generator.next_u64() >> 11) as f64 * (f64::EPSILON / 2.0)
    }

    /// The next number, uniform in [low, high).
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        (high - low).mul_add(self.unit(), low)
    }

    /// The next number, normal with mean 0 and variance 1.
    ///
    /// Source: Box and Muller, <https://doi.org/10.1214/aoms/1177706645>.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.unit())).sqrt();
        radius * libm::cos(std::f64::consts::TAU * self.unit())
    }

    /// Shuffles the values in place, from the last one down.
    ///
    /// Source: Fisher and Yates; as here in Durstenfeld, <https://doi.org/10.1145/364520.364540>.
    pub fn shuffle<T>(&mut self, values: &mut [T]) {
        for i in (1..values.len()).rev() {
            let j = (self.unit() * (i + 1) as f64) as usize;
            values.swap(i, j.min(i));
        }
    }
}
