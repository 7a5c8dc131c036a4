//! What a composition does with each of its steps: the visitors whose work is compiled as functions of its own.
//!
//! Each has a module, since the compiler puts all code for the types of a module in one unit, and one unit for
//! all of these would be built last, and alone.

mod across;
mod apply;
mod forward_recorded;
mod jvp;
mod vjp;

pub(super) use across::Across;
pub(super) use apply::{Apply, ApplyShears};
pub(super) use forward_recorded::ForwardRecorded;
pub(super) use jvp::Jvp;
pub(super) use vjp::Vjp;

/// A visitor whose work on each step is compiled as a function of its own, for the registers of `$number`: a task of
/// the module that this is used in.
macro_rules! visit_outlined {
    ([$($generics:tt)*] $visitor:ty, $number:ident) => {
        impl<'a, $($generics)*> Visitor<'a, P> for $visitor {
            type Output = ();
            const SPECIALISED: bool = $number::SPECIALISED;
            #[inline(always)]
            fn visit(self, map: impl ElementaryMap<P> + 'a) {
                $number::outlined(OfEach { map, work: self, parameters: PhantomData });
            }
        }

        /// What the visitor does with a step.
        struct OfEach<P, T, W> {
            map: T,
            work: W,
            parameters: PhantomData<P>,
        }
    };
}
use visit_outlined;
