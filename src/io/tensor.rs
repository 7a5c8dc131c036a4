//! Named arrays of weights.

/// A named array of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// The lengths of the axes.
    pub shape: Vec<usize>,
    /// The numbers of the tensor, row by row.
    pub values: Vec<f64>,
    /// The file held single precision.
    pub single_precision: bool,
}
