//! Loops that layers run for each lane, unrolled where their lengths are known.
//!
//! In what a layer does for each lane there is no closure, and no function of the
//! library that takes one: these are compiled for any processor before they are
//! inlined, and what they call is not inlined in them.

/// Runs `$body` on copies of the n inputs and on n outputs that are zero, whose number the
/// compiler knows (unless `$D` is 0), so that it keeps them in registers. With a `const` block only the branch that is
/// taken is compiled.
macro_rules! in_registers {
    ($number:ident, $n:expr, $D:ident, [$($input:ident),*], $out:ident => $body:expr) => {
        if const { $D > 0 } {
            let slice: &mut [_; $D] = $out.first_chunk_mut().expect("n of them");
            $(let $input: &[_; $D] = &{ *$input.first_chunk().expect("n of them") };)*
            let $out = &mut [$number::zero(); $D];
            $body;
            *slice = *$out;
        } else {
            $(let $input = &$input[..$n];)*
            let $out = &mut $out[..$n];
            for out in $out.iter_mut() {
                *out = $number::zero();
            }
            $body;
        }
    };
}

/// Runs `$body` for all neurons, `$j` being the first of `$K` at a time: as many
/// as keep a processor busy whose results take long to come.
macro_rules! for_neurons {
    ($width:expr, $j:ident, $K:ident => $body:expr) => {{
        let width = $width;
        let mut $j = 0;
        while $j + 4 <= width {
            const $K: usize = 4;
            $body;
            $j += $K;
        }
        while $j + 2 <= width {
            const $K: usize = 2;
            $body;
            $j += $K;
        }
        if $j < width {
            const $K: usize = 1;
            $body;
        }
    }};
}

/// [`for_neurons`] with four at a time or one: polynomials are busy by themselves, and each
/// number of them is compiled once more.
macro_rules! for_polynomials {
    ($width:expr, $j:ident, $K:ident => $body:expr) => {{
        let width = $width;
        let mut $j = 0;
        while $j + 4 <= width {
            const $K: usize = 4;
            $body;
            $j += $K;
        }
        while $j < width {
            const $K: usize = 1;
            $body;
            $j += $K;
        }
    }};
}

pub(super) use {for_neurons, for_polynomials, in_registers};
