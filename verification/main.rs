//! The proof by measurement that the maps are what they claim to be, whatever
//! their weights.
//!
//! One file a law; `mutants` shows that each of them can fail, `tolerances`
//! holds the thresholds, `coverage` that nothing is left out, `report` the
//! tables that can be cited. `cargo test --test verification -- --ignored` runs ten
//! times the samples and all 360 configurations; `GYROCEPTRON_SEED=n` other ones.

mod adiabatic;
mod blocks;
mod circle_action;
mod compositions;
mod coupling;
mod coverage;
mod determinant;
mod evaluation;
mod exact_relations;
mod extremes;
mod fitted;
mod gradients;
mod inversion;
mod mutants;
mod near_identity;
mod near_periodicity;
mod nearly_integrable;
mod normal_form;
mod on_grid;
mod polynomials;
mod precision;
mod proofs;
mod report;
mod reversible;
mod samples;
mod seeds;
mod soundness;
mod statistics;
mod suite;
mod symp_net;
mod symplecticity;
mod tanh;
mod tolerances;
mod torus;
mod watched;
