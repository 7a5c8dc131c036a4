//! The machine on which a run is timed.

use crate::scalar::Simd;
use serde::Serialize;
use std::fmt::{Display, Formatter, Result};

/// The processor, and how much of it is used.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Machine {
    /// The processor's name as the system gives it, or else its architecture.
    pub processor: String,
    /// The number of threads that share the work, unless a time says otherwise.
    pub threads: usize,
    /// The vector instructions of the kernels.
    pub instructions: &'static str,
}

impl Machine {
    /// The machine that this process runs on.
    pub fn this() -> Self {
        let named = || {
            let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
            let line = text.lines().find(|line| line.starts_with("model name"))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        };
        let instructions = match Simd::current() {
            Simd::Portable => "portable instructions",
            Simd::Avx2 => "AVX2",
            Simd::Avx512 => "AVX-512",
        };
        let processor = named().unwrap_or_else(|| std::env::consts::ARCH.to_owned());
        Self { processor, threads: rayon::current_num_threads(), instructions }
    }
}

impl Display for Machine {
    fn fmt(&self, out: &mut Formatter<'_>) -> Result {
        let threads = if self.threads == 1 { "thread" } else { "threads" };
        write!(out, "{}, {} {threads}, {}", self.processor, self.threads, self.instructions)
    }
}
