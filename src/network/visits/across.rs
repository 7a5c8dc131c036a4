//! Steps of one point, whose neurons go together.

use super::visit_outlined;
use crate::layer::ElementaryMap;
use crate::network::step::Visitor;
use crate::scalar::{Over, Pack, Task};
use std::marker::PhantomData;

/// A step of one point, its neurons in the lanes of `V`.
pub(in crate::network) struct Across<'s, P, V> {
    pub(in crate::network) z: &'s mut [P],
    pub(in crate::network) scratch: &'s mut [P],
    pub(in crate::network) lanes: PhantomData<V>,
}

visit_outlined!([P: Over<P>, V: Pack<P>] Across<'_, P, V>, V);

impl<P: Over<P>, V: Pack<P>, T: ElementaryMap<P>> Task for OfEach<P, T, Across<'_, P, V>> {
    #[inline(always)]
    fn run(self) {
        self.map.apply_across::<V>(self.work.z, self.work.scratch);
    }
}
