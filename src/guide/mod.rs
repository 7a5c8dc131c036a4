//! The guide: concepts, how to use the crate, and what was measured with it.
//!
//! | to learn | chapter |
//! |---|---|
//! | what the words mean | [`concepts`] |
//! | the library, from pairs to a model; networks and Hamiltonians of your own | [`library`] |
//! | the program: training on your pairs, predictions, scenes, file formats | [`program`] |
//! | the module for Python | [`python`] |
//! | which options to choose | [`choosing`] |
//! | symplectic maps by least squares, without training | [`polynomials`] |
//! | your own map under the laws, on a grid, and under fuzzing | [`own_map`] |
//! | what holds for all weights, what does not, exact inversion on a grid | [`guarantees`] |
//! | theorems about a model: curves that no orbit crosses | [`proofs`] |
//! | a scene on many machines: Dask, Slurm, Snakemake | [`many_machines`] |
//! | a model as source code: C, Fortran, Julia, JAX, PyTorch | [`source_code`] |
//! | the network in 40 lines of NumPy | [`weights`] |
//! | where things are in the source, and how to add to it | [`source`] |
//! | each definition of the paper | [`conformance`](crate::conformance) |
//!
//! What was measured, each with the command that measures it:
//!
//! | scene | chapter |
//! |---|---|
//! | `paper`: the paper's experiments | [`paper`] |
//! | `long-steps`: exact invariants, long steps and their rivals | [`long_steps`] |
//! | `family`, its part `invariant`: what the learnt invariant is worth | [`invariant_worth`] |
//! | `family`: one network for several ε and flow times | [`family`] |
//! | `field-lines`, `jolts`: surfaces and islands over 100,000 turns | [`field_lines`] |
//! | `coils`, `edge`, `tokamak`, `controls`: coils, their edge, a tokamak with ripple, Wendelstein 7-X, machines that change, storage rings | [`coils`] |
//! | `full-orbit`: a charged particle over 10,000 gyrations | [`particle`] |
//! | `two-modes`: two fast frequencies | [`two_modes`] |
//! | `dissipative`: a flow with friction | [`dissipation`] |
//! | `stiff`: ε from 1e-2 to 1e-8 | [`stiff`] |
//! | `noise`: pairs with noise or a gap | [`noise`] |
//! | `slow-manifold`: the slow manifold of the learnt invariant | [`paper`] |
//! | all: figures of speed and error in one table | [`figures`] |

macro_rules! chapters {
    ($($name:ident)*) => {
        // Of two definitions of a link the first holds: here that of rustdoc, elsewhere the file's own. Nothing but
        // rustdoc reads the texts, so that a word in a chapter builds nothing else anew.
        $(#[cfg_attr(any(doc, doctest), doc = include_str!("rustdoc-links.txt"))]
        #[cfg_attr(any(doc, doctest), doc = include_str!(concat!(stringify!($name), ".md")))]
        #[cfg_attr(not(any(doc, doctest)), doc = "A chapter of the guide.")]
        pub mod $name {})*
    };
}

chapters! {
    concepts library program python choosing polynomials own_map guarantees proofs many_machines source_code weights source
    paper long_steps family field_lines coils particle two_modes dissipation stiff noise
    invariant_worth figures
}
