//! Adjoints of steps.

use super::visit_outlined;
use crate::layer::ElementaryMap;
use crate::network::step::Visitor;
use crate::scalar::{Over, Scalar, Task};
use std::marker::PhantomData;

/// The adjoint of a step at all points recorded.
pub(in crate::network) struct Vjp<'s, S> {
    pub(in crate::network) tape: &'s [S],
    pub(in crate::network) z_bar: &'s mut [S],
    pub(in crate::network) parameters_bar: &'s mut [S],
    pub(in crate::network) scratch: &'s mut [S],
}

visit_outlined!([P: Scalar, S: Over<P>] Vjp<'_, S>, S);

impl<P: Scalar, S: Over<P>, T: ElementaryMap<P>> Task for OfEach<P, T, Vjp<'_, S>> {
    #[inline(always)]
    fn run(self) {
        let Vjp { tape, z_bar, parameters_bar, scratch } = self.work;
        self.map.vjp_each(tape, z_bar, parameters_bar, scratch);
    }
}
