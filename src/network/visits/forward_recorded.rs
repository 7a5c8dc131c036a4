//! Steps that record what their adjoints need.

use super::visit_outlined;
use crate::layer::ElementaryMap;
use crate::network::step::Visitor;
use crate::scalar::{Over, Scalar, Task};
use std::marker::PhantomData;

/// A step of all points, filling the tape of each.
pub(in crate::network) struct ForwardRecorded<'s, S> {
    pub(in crate::network) z: &'s mut [S],
    pub(in crate::network) tape: &'s mut [S],
    pub(in crate::network) scratch: &'s mut [S],
}

visit_outlined!([P: Scalar, S: Over<P>] ForwardRecorded<'_, S>, S);

impl<P: Scalar, S: Over<P>, T: ElementaryMap<P>> Task for OfEach<P, T, ForwardRecorded<'_, S>> {
    #[inline(always)]
    fn run(self) {
        let ForwardRecorded { z, tape, scratch } = self.work;
        let (dim, size) = (2 * self.map.dof(), self.map.tape_len());
        for k in 0..z.len() / dim {
            let tape = &mut tape[k * size..(k + 1) * size];
            self.map.forward_recorded(&mut z[k * dim..(k + 1) * dim], tape, scratch);
        }
    }
}
