//! Steps applied to points.

use super::visit_outlined;
use crate::layer::{ElementaryMap, TurnedCoupling, Twist};
use crate::network::step::Visitor;
use crate::scalar::{Over, Scalar, Task};
use std::marker::PhantomData;

/// A step of all points, 2n numbers each.
pub(in crate::network) struct Apply<'s, S> {
    pub(in crate::network) z: &'s mut [S],
    pub(in crate::network) scratch: &'s mut [S],
}

visit_outlined!([P: Scalar, S: Over<P>] Apply<'_, S>, S);

impl<P: Scalar, S: Over<P>, T: ElementaryMap<P>> Task for OfEach<P, T, Apply<'_, S>> {
    #[inline(always)]
    fn run(self) {
        let Apply { z, scratch } = self.work;
        self.map.apply_each(z, scratch);
    }
}

/// [`Apply`] of shears alone: what is no bijection of a grid is not compiled for numbers on one.
pub(in crate::network) struct ApplyShears<'s, S>(pub(in crate::network) Apply<'s, S>);

impl<'a, P: Scalar, S: Over<P>> Visitor<'a, P> for ApplyShears<'_, S> {
    type Output = ();
    const SPECIALISED: bool = S::SPECIALISED;

    #[inline(always)]
    fn visit(self, map: impl ElementaryMap<P> + 'a) {
        S::outlined(OfEach { map, work: self.0, parameters: PhantomData });
    }

    #[inline(always)]
    fn visit_twist<const D: usize>(self, _: Twist<'a, P, D>) {
        unreachable!("{NO_SHEAR}");
    }

    #[inline(always)]
    fn visit_coupling<const D: usize>(self, _: TurnedCoupling<'a, P, D>) {
        unreachable!("{NO_SHEAR}");
    }
}

/// What a caller has to have asked.
const NO_SHEAR: &str = "`Composition::check_on_grid` refuses it";
