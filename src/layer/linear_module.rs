//! The linear module of SympNets.

use super::ElementaryMap;
use super::quadratic_form::{QuadraticForm, symmetric_len};
use crate::phase::Half;
use crate::scalar::{Over, Scalar};

/// The number of parameters of a linear module of `shears` shears in `dof` degrees of
/// freedom: n(n + 1)/2 for each symmetric matrix, 2n for the translation.
///
/// Saturates instead of overflowing.
pub const fn linear_module_parameter_count(dof: usize, shears: usize) -> usize {
    let matrix = symmetric_len(dof);
    shears.saturating_mul(matrix).saturating_add(dof.saturating_mul(2))
}

/// Linear shears, target += c·S_k·source with S_k symmetric, that change the two halves
/// of the coordinates in alternation, and then a translation z += c·b.
///
/// Its parameters are `[S₁, …, S_m, b]`, each S_k by the rows of its upper triangle,
/// b in the order of z; the translation is optional. Every linear symplectic map is a product of such shears.
///
/// Source: linear modules of Jin, Zhang, Zhu, Tang and Karniadakis,
/// <https://doi.org/10.1016/j.neunet.2020.08.017>, section 3.1.
#[derive(Clone, Copy, Debug)]
pub struct LinearModule<'a, P> {
    dof: usize,
    matrices: &'a [P],
    translation: &'a [P],
    first: Half,
    scale: P,
    inverse: bool,
}

impl<'a, P: Scalar> LinearModule<'a, P> {
    /// The module of these parameters, whose first shear changes the half `first`;
    /// `scale` is c.
    ///
    /// # Panics
    /// When the parameters are not those of a whole number of shears.
    #[inline(always)]
    pub fn new(dof: usize, first: Half, scale: P, parameters: &'a [P]) -> Self {
        let (matrices, translation) = parameters.split_at(parameters.len() - 2 * dof);
        Self { translation, ..Self::without_translation(dof, first, scale, matrices) }
    }

    /// The module that has only these matrices.
    ///
    /// # Panics
    /// When the parameters are not those of a whole number of shears.
    #[inline(always)]
    pub fn without_translation(dof: usize, first: Half, scale: P, matrices: &'a [P]) -> Self {
        assert!(matrices.len().is_multiple_of(symmetric_len(dof)));
        Self { dof, matrices, translation: &[], first, scale, inverse: false }
    }

    #[inline(always)]
    fn shears(&self) -> usize {
        self.matrices.len() / symmetric_len(self.dof)
    }

    /// The number of the shear that is applied as the `k`th, and the half that it
    /// changes.
    #[inline(always)]
    fn shear(&self, k: usize) -> (usize, Half) {
        let number = if self.inverse { self.shears() - 1 - k } else { k };
        (number, if number % 2 == 0 { self.first } else { self.first.other() })
    }

    /// The factor c of the shears, negative for the inverse.
    #[inline(always)]
    fn factor(&self) -> P {
        if self.inverse { -self.scale } else { self.scale }
    }

    /// ½yᵀS_number·y, whose flow the shear is.
    #[inline(always)]
    fn form(&self, number: usize) -> QuadraticForm<'a, P> {
        let size = symmetric_len(self.dof);
        QuadraticForm::new(self.dof, &self.matrices[number * size..(number + 1) * size])
    }

    /// The linear shears, calling `keep(k, source)` before each.
    #[inline(always)]
    fn linear<S: Over<P>>(
        &self,
        z: &mut [S],
        scratch: &mut [S],
        mut keep: impl FnMut(usize, &[S]),
    ) {
        let gradient = &mut scratch[..self.dof];
        for k in 0..self.shears() {
            let (number, half) = self.shear(k);
            let (source, target) = half.split(self.dof, z);
            keep(k, source);
            gradient.fill(S::zero());
            self.form(number).add_gradient(source, gradient);
            for (target, &gradient) in target.iter_mut().zip(&*gradient) {
                *target = target.increment(self.factor(), gradient);
            }
        }
    }

    #[inline(always)]
    fn translate<S: Over<P>>(&self, z: &mut [S]) {
        for (z, &b) in z.iter_mut().zip(self.translation) {
            *z = z.increment(self.factor(), S::embed(b));
        }
    }

    #[inline(always)]
    fn run<S: Over<P>>(&self, z: &mut [S], scratch: &mut [S], keep: impl FnMut(usize, &[S])) {
        // 0·∞ is not 0.
        if self.scale.is_zero() {
            return;
        }
        if self.inverse {
            self.translate(z);
        }
        self.linear(z, scratch, keep);
        if !self.inverse {
            self.translate(z);
        }
    }
}

impl<P: Scalar> ElementaryMap<P> for LinearModule<'_, P> {
    #[inline(always)]
    fn dof(&self) -> usize {
        self.dof
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        Self { inverse: !self.inverse, ..self }
    }

    #[inline(always)]
    fn tape_len(&self) -> usize {
        self.shears() * self.dof
    }

    #[inline(always)]
    fn activation_count(&self) -> usize {
        0
    }

    #[inline(always)]
    fn apply<S: Over<P>>(&self, z: &mut [S], scratch: &mut [S]) {
        self.run(z, scratch, |_, _| {});
    }

    #[inline(always)]
    fn forward_recorded<S: Over<P>>(&self, z: &mut [S], tape: &mut [S], scratch: &mut [S]) {
        let n = self.dof;
        self.run(z, scratch, |k, source| tape[k * n..(k + 1) * n].copy_from_slice(source));
    }

    #[inline(always)]
    fn vjp<S: Over<P>>(
        &self,
        tape: &[S],
        z_bar: &mut [S],
        parameters_bar: &mut [S],
        scratch: &mut [S],
    ) {
        if self.scale.is_zero() {
            return;
        }
        let n = self.dof;
        let (matrices_bar, translation_bar) = parameters_bar.split_at_mut(self.matrices.len());
        let translation = |z_bar: &[S], translation_bar: &mut [S]| {
            for (b_bar, z_bar) in translation_bar.iter_mut().zip(z_bar) {
                *b_bar = z_bar.mul_add_parameter(self.factor(), *b_bar);
            }
        };
        if !self.inverse {
            translation(z_bar, translation_bar);
        }
        let (u, y_bar) = scratch.split_at_mut(n);
        let y_bar = &mut y_bar[..n];
        for k in (0..self.shears()).rev() {
            let (number, half) = self.shear(k);
            let y = &tape[k * n..(k + 1) * n];
            let (source_bar, target_bar) = half.split_mut(n, z_bar);
            for i in 0..n {
                u[i] = target_bar[i].times(self.factor());
            }
            let size = symmetric_len(n);
            let matrix_bar = &mut matrices_bar[number * size..(number + 1) * size];
            y_bar.fill(S::zero());
            self.form(number).vjp(y, u, y_bar, matrix_bar);
            for (source_bar, y_bar) in source_bar.iter_mut().zip(&*y_bar) {
                *source_bar += *y_bar;
            }
        }
        if self.inverse {
            translation(z_bar, translation_bar);
        }
    }

    #[inline(always)]
    fn jvp<S: Over<P>>(&self, z: &mut [S], directions: &mut [S], scratch: &mut [S]) {
        if self.scale.is_zero() {
            return;
        }
        self.run(z, scratch, |_, _| {});
        for direction in directions.chunks_exact_mut(2 * self.dof) {
            self.linear(direction, scratch, |_, _| {});
        }
    }
}
