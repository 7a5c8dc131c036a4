//! Symplectic gyroceptrons: neural networks that are symplectic, invertible and nearly periodic,
//! and have an adiabatic invariant, whatever their weights.
//!
//! A symplectic gyroceptron is the map
//!
//! P_ε = I_ε ∘ ψ ∘ Φ_θ ∘ ψ⁻¹
//!
//! with a circle action Φ_θ, a symplectic network ψ and a symplectic network
//! I_ε that is the identity at ε = 0. This crate evaluates, inverts,
//! differentiates, trains, certifies and rolls out such maps.
//!
//! # Example
//!
//! Fit a network to pairs of the coupled oscillators' flow, ask how far to trust it, certify its structure, and roll it
//! out:
//!
//! ```
//! use gyroceptron::prelude::*;
//!
//! let window = Window { low: vec![-1.0; 4], high: vec![1.0; 4], samples: 200 };
//! let pairs = Pairs::of_windows(&Oscillators { epsilon: 0.01 }, &[window], 0.5, 1)?;
//! let fit = Fit { epsilon: Some(0.01), flow_time: Some(0.5), ..Fit::default() };
//! let fitted = fit.with_iterations(20).run(pairs)?;
//! println!("{}", fitted.judgement()?);
//! let options = CertificateOptions { samples: 20, ..Default::default() };
//! certify(fitted.model(), options).assert_holds();
//! let model = StoredModel::of_fit(&fitted, "example"); // in the units of the data
//! let orbit = model.rollout(&[0.8, 0.3, 0.0, 0.0], Rollout { steps: 100, every: 1 })?; // from q₁, q₂, p₁, p₂
//! assert_eq!(orbit.len(), 4 * 101);
//! # Ok::<(), Error>(())
//! ```
//!
//! The [`guide`] explains the terms, shows how to use the crate from Rust, Python and the shell, and reports the
//! measurements.
//!
//! # Where things are
//!
//! In reading order: a module imports only modules that stand above it in this list.
//!
//! - [`scalar`]: the numbers that maps are written over.
//! - [`phase`]: points, their order in arrays, the sign of Ω, and
//!   [`Map`](phase::Map).
//! - [`random`]: seeded streams.
//! - [`work`]: how much was computed.
//! - [`layer`]: the kinds of step, such as shears, turns and couplings, each bound to its parameters.
//! - [`network`]: a network as a list of blocks, the architectures that have a name, and a model: a
//!   network with its parameters.
//! - [`system`]: the Hamiltonian systems, and one that dissipates.
//! - [`flow`]: their flows, and data sets of flow maps.
//! - [`measure`]: from a map and points to numbers; the laws, generic over the
//!   map; the structure certificate, a test on samples; error against run time.
//! - [`train`]: [`Fit`](train::Fit), the one way from pairs to a model; the loss, the optimisers,
//!   schedules, checkpoints; the [judgement](train::Judgement) of a training.
//! - `io` (feature `files`): models, data sets, weights of others.
//! - `scene` (feature `scenes`): declared experiments and their reports.
//!
//! The page [`conformance`] lists each definition of the paper with the item that implements it and
//! the law that checks it.
//!
//! # Pitfalls
//!
//! - Points are `[q₁, …, qₙ, p₁, …, pₙ]`, not (q₁, p₁, q₂, p₂, …).
//! - I_{−ε} is not I_ε⁻¹: the two agree to first order in ε only. The inverse is
//!   [`Map::inverse`](phase::Map::inverse).
//! - θ and I_ε are not identifiable together from data at one ε: training may
//!   move part of the rotation into I_ε. Start θ at ω₀t.
//! - Near a resonance, θ close to 2πp/q with small q, there is no adiabatic
//!   invariant to speak of.
#![warn(missing_docs)]
// The one exception is `scalar::simd`.
#![deny(unsafe_code)]

pub mod conformance;
mod digest;
pub mod error;
pub mod flow;
pub mod guide;
#[cfg(feature = "files")]
pub mod io;
pub mod layer;
pub mod measure;
pub mod network;
pub mod phase;
pub mod prelude;
#[cfg(feature = "python")]
mod python;
pub mod random;
pub mod scalar;
#[cfg(feature = "scenes")]
pub mod scene;
mod stopping;
pub mod system;
pub mod train;
mod words;
pub mod work;

pub use error::Error;

/// The examples of the READMEs are compiled and run as they stand.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
#[doc = include_str!("../verification/README.md")]
struct Readme;
