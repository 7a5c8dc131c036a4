//! Python: models, their use and their training. Glue only.

mod arrays;
mod certificate;
mod circles;
mod controls;
mod exception;
mod interrupt;
mod lines;
mod model;
mod orbits;
mod outside;
mod polynomials;
mod proofs;
mod runs;
mod trained;
mod training;

use pyo3::prelude::*;

/// The native module `gyroceptron._native` of the Python package.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::certificate::PyCertificate;
    #[pymodule_export]
    use super::lines::FieldLines;
    #[pymodule_export]
    use super::model::{_restore, Model, load};
    #[pymodule_export]
    use super::orbits::{PyInvariantCircle, rotation_number, spectral_lines, tunes};
    #[pymodule_export]
    use super::polynomials::{_restore_polynomial, PySymplecticPolynomial};
    #[pymodule_export]
    use super::proofs::{check_proof, prove};
    #[pymodule_export]
    use super::runs::{_check_merge, _merge, _plan, _run, _run_job, _scene};
    #[pymodule_export]
    use super::training::train;
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        crate::scalar::Simd::limit_by_environment()?;
        module.add("Error", module.py().get_type::<super::exception::Error>())?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
