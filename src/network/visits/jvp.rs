//! Derivatives of steps along directions.

use super::visit_outlined;
use crate::layer::ElementaryMap;
use crate::network::step::Visitor;
use crate::scalar::{Over, Scalar, Task};
use std::marker::PhantomData;

/// A step of one point, with its derivatives.
pub(in crate::network) struct Jvp<'s, S> {
    pub(in crate::network) z: &'s mut [S],
    pub(in crate::network) directions: &'s mut [S],
    pub(in crate::network) scratch: &'s mut [S],
}

visit_outlined!([P: Scalar, S: Over<P>] Jvp<'_, S>, S);

impl<P: Scalar, S: Over<P>, T: ElementaryMap<P>> Task for OfEach<P, T, Jvp<'_, S>> {
    #[inline(always)]
    fn run(self) {
        let Jvp { z, directions, scratch } = self.work;
        self.map.jvp(z, directions, scratch);
    }
}
