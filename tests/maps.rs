//! Maps: layers, networks, their derivatives and inverses, and what certifies them.

// A target of `cargo fuzz`, which is no dependency of the suite, is compiled in `own_maps`.
extern crate self as libfuzzer_sys;

mod certificate;
mod couplings;
mod errors;
mod generators;
mod layers;
mod networks;
mod neurons;
mod normal_form;
mod on_grid;
mod own_maps;
mod polynomials;
mod ratios;
mod reversible;
mod rooms;
mod units;
