//! Vector registers, chosen at run time. The only `unsafe` of the crate.
//!
//! # Safety
//! Every intrinsic here needs a processor that has its instructions, and nothing
//! else but the loads and stores, which are of arrays of the register's size. The
//! register types are private to this module, and the only places that name them
//! are methods of [`Kernel`], which [`on_registers`] calls after the processor has been asked.
//! A kernel gets them as a type parameter, works with their values on the thread
//! it is called on, and cannot keep one: its output does not depend on the type.
//! A task that a kernel has outlined is called through the register type that the kernel
//! was given, and so on the same processor.

use super::lanewise::{Lanewise, functions_of_lanes, zero_lanes_with};
use super::lorentzian::lorentzian_in_step;
use super::tanh::tanh_sech2_in_step;
use super::{Elementary, Over, Scalar, WIDTH, assigning, over_parameters};
use crate::error::Error;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Lanes that can be filled from memory and written back.
pub trait Pack<P: Scalar = f64>: Lanewise + Over<P> {
    /// The number of lanes, each of which holds one number.
    const LANES: usize;

    /// Loads a slice of [`Pack::LANES`] numbers.
    fn load(values: &[P]) -> Self;

    /// Stores the lanes in a slice of [`Pack::LANES`] numbers, `values` ← the lanes.
    fn store(self, values: &mut [P]);

    /// ((first + c₀w₀) + c₂w₂) + (c₁w₁ + c₃w₃) over the first four lanes, with c₁w₁
    /// rounded and the other products fused with their sums: two short dependency chains
    /// rather than a long one. A lane whose product is −0 adds nothing.
    #[inline(always)]
    fn sum_of_products(self, weights: Self, first: P) -> P {
        let (mut c, mut w) = ([P::zero(); WIDTH], [P::zero(); WIDTH]);
        self.store(&mut c[..Self::LANES]);
        weights.store(&mut w[..Self::LANES]);
        c[2].mul_add(w[2], c[0].mul_add(w[0], first)) + c[3].mul_add(w[3], c[1] * w[1])
    }

    /// One number in all lanes.
    #[inline(always)]
    fn splat(value: P) -> Self {
        Self::embed(value)
    }

    /// `values` ← the first lanes, as many as there are values.
    #[inline(always)]
    fn store_part(self, values: &mut [P]) {
        if values.len() == Self::LANES {
            return self.store(values);
        }
        let mut all = [P::zero(); WIDTH];
        self.store(&mut all[..Self::LANES]);
        values.copy_from_slice(&all[..values.len()]);
    }

    /// Loads a slice of at most [`Pack::LANES`] numbers; the other lanes are zero.
    #[inline(always)]
    fn load_part(values: &[P]) -> Self {
        if values.len() == Self::LANES {
            return Self::load(values);
        }
        let mut all = [P::zero(); WIDTH];
        all[..values.len()].copy_from_slice(values);
        Self::load(&all[..Self::LANES])
    }
}

/// A computation that is written for any lanes.
///
/// `run` and all that it calls for each lane must be `#[inline(always)]`, else it
/// is compiled for any processor, and slow.
///
/// What runs it on registers are methods of the trait, which kernels do not override: so the compiler puts the code of
/// a kernel in the unit of its module, and not that of all kernels in one.
pub(crate) trait Kernel: Sized {
    /// The result of the computation.
    type Output;

    /// Runs the computation on lanes of the type `V`.
    fn run<V: Pack>(self) -> Self::Output;

    /// The computation on lanes of any processor.
    fn on_any<V: Pack>(self) -> Self::Output {
        self.run::<V>()
    }

    /// The computation on four lanes (`L` = 4) or eight.
    ///
    /// # Safety
    /// The processor has AVX2 and fused multiply-adds.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    unsafe fn on_avx2<const L: usize>(self) -> Self::Output {
        x86::align_frame();
        // With a `const` block the kernel is compiled for the one register that it runs on, and not for both.
        if const { L == 4 } { self.run::<x86::Ymm>() } else { self.run::<x86::Pair<x86::Ymm>>() }
    }

    /// The computation on four lanes (`L` = 4) or eight.
    ///
    /// # Safety
    /// The processor has AVX2, fused multiply-adds and the parts F, DQ and VL of AVX-512.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,avx512f,avx512dq,avx512vl")]
    unsafe fn on_avx512<const L: usize>(self) -> Self::Output {
        x86::align_frame();
        if const { L == 4 } { self.run::<x86::Ymm>() } else { self.run::<x86::Zmm>() }
    }
}

/// A piece of work that is compiled as a separate function: see
/// [`Scalar::outlined`].
pub trait Task: Sized {
    /// Runs the task. It must be `#[inline(always)]`, as must all that it calls for each number.
    fn run(self);
}

impl<T: Task> Apart for T {}

/// A task as a function of its own, which the compiler puts in the unit of the module of the task, as it does
/// kernels.
pub(super) trait Apart: Task {
    /// Runs the task as a separate function for any processor.
    #[inline(never)]
    fn run_apart(self) {
        self.run();
    }

    /// Runs the task as a separate function.
    ///
    /// # Safety
    /// The processor has AVX2 and fused multiply-adds.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    #[inline(never)]
    unsafe fn run_apart_on_avx2(self) {
        x86::align_frame();
        self.run();
    }

    /// Runs the task as a separate function.
    ///
    /// # Safety
    /// The processor has AVX2, fused multiply-adds and the parts F, DQ and VL of AVX-512.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,avx512f,avx512dq,avx512vl")]
    #[inline(never)]
    unsafe fn run_apart_on_avx512(self) {
        x86::align_frame();
        self.run();
    }
}

/// Sets of vector instructions that the kernels are compiled for.
///
/// Results are the same bits with each of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Simd {
    /// The instructions that every processor of the architecture has.
    Portable,
    /// Four lanes a register, fused multiply-add.
    Avx2,
    /// Eight lanes in a register, fused multiply-add: the instructions of AVX-512.
    Avx512,
}

/// The widest set that may be used, for comparisons.
static LIMIT: AtomicUsize = AtomicUsize::new(Simd::Avx512 as usize);

/// The widest set that this processor has.
static WIDEST: LazyLock<Simd> = LazyLock::new(|| {
    let mut widest = Simd::ALL.into_iter().rev();
    widest.find(|set| set.is_available()).unwrap_or(Simd::Portable)
});

impl Simd {
    /// All of them, the narrowest first.
    pub const ALL: [Self; 3] = [Self::Portable, Self::Avx2, Self::Avx512];

    /// Whether this processor has these instructions.
    pub fn is_available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_available()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// The set that is used: the widest that this processor has and that
    /// [`Simd::limit`] allows.
    pub fn current() -> Self {
        // A processor that has one has the narrower ones.
        Self::ALL[(*WIDEST as usize).min(LIMIT.load(Ordering::Relaxed))]
    }

    /// Limits this process to sets no wider than this one from now on. Results do
    /// not change, only run times.
    pub fn limit(self) {
        LIMIT.store(self as usize, Ordering::Relaxed);
    }

    /// Applies [`Simd::limit`] as the environment variable `GYROCEPTRON_SIMD` says: `portable`, `avx2` or `avx512`.
    /// The program and the Python module do this when they start.
    ///
    /// # Errors
    /// [`Error::Invalid`] with another value.
    pub fn limit_by_environment() -> Result<(), Error> {
        const NAME: &str = "GYROCEPTRON_SIMD";
        let Some(value) = std::env::var_os(NAME) else { return Ok(()) };
        let names = ["portable", "avx2", "avx512"].into_iter().zip(Self::ALL);
        let found = names.into_iter().find(|(name, _)| value == *name);
        let expected = || Error::invalid(NAME, value.display(), "portable, avx2 or avx512");
        found.ok_or_else(expected)?.1.limit();
        Ok(())
    }
}

/// Runs a kernel on registers of eight lanes (`L` = 8) or of four, or on `F` where the processor has none
/// that may be used.
#[inline(always)]
pub(super) fn on_registers<const L: usize, F: Pack, K: Kernel>(kernel: K) -> K::Output {
    const { assert!(L == 4 || L == 8) };
    match Simd::current() {
        Simd::Portable => kernel.on_any::<F>(),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `current` gives what the processor has.
        Simd::Avx2 => unsafe { kernel.on_avx2::<L>() },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as above.
        Simd::Avx512 => unsafe { kernel.on_avx512::<L>() },
        #[cfg(not(target_arch = "x86_64"))]
        _ => kernel.on_any::<F>(),
    }
}

/// The elementary functions of one `f64`, compiled for where they are called.
mod one {
    use super::*;

    #[inline(always)]
    pub(super) fn tanh_sech2(x: f64) -> (f64, f64) {
        let ([t], [s]) = tanh_sech2_in_step([x]);
        (t, s)
    }

    #[inline(always)]
    pub(super) fn lorentzian(x: f64) -> (f64, f64) {
        let ([t], [s]) = lorentzian_in_step([x]);
        (t, s)
    }

    pub(super) use crate::scalar::exp::exp;
    pub(super) use crate::scalar::sin_cos::sin_cos;
}

/// A function of [`one`] with the processor's fused multiply-adds, if it has them.
macro_rules! on_one {
    ($function:ident, $x:expr) => {{
        #[cfg(target_arch = "x86_64")]
        if Simd::current() > Simd::Portable {
            // SAFETY: the processor has AVX2 and fused multiply-adds.
            return unsafe { x86::$function($x) };
        }
        one::$function($x)
    }};
}

/// `(tanh x, sech² x)`, sharing their exponential.
///
/// tanh errs by less than 3 ulp everywhere, sech² by less than 5e-16 relative up to
/// |x| = 354; from 354.38 on it is 0. NaN gives NaN, ±∞ gives (±1, 0). Every
/// instruction set gives the same bits.
pub fn tanh_sech2(x: f64) -> (f64, f64) {
    on_one!(tanh_sech2, x)
}

pub(super) fn lorentzian(x: f64) -> (f64, f64) {
    on_one!(lorentzian, x)
}

pub(super) fn sin_cos(x: f64) -> (f64, f64) {
    on_one!(sin_cos, x)
}

pub(super) fn exp(x: f64) -> f64 {
    on_one!(exp, x)
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::*;
    use std::arch::x86_64::*;
    use std::hint::black_box;
    use std::ops::{Add, Div, Mul, Neg, Sub};

    /// A local variable of this alignment makes the compiler align the frame, and
    /// with it the registers that it spills: else a spilled register may lie across
    /// two cache lines, which costs up to a quarter of the time, or not, as the
    /// callers happen to have left the stack.
    #[repr(align(64))]
    struct Aligned(#[allow(dead_code)] u8);

    #[inline(always)]
    pub(super) fn align_frame() {
        // A constant would not be a local variable.
        let mut local = Aligned(black_box(0));
        black_box(&mut local);
    }

    macro_rules! with_fused_multiply_add {
        ($($function:ident -> $output:ty;)*) => {
            $(#[target_feature(enable = "avx2,fma")]
            pub(super) fn $function(x: f64) -> $output {
                one::$function(x)
            })*
        };
    }
    with_fused_multiply_add! {
        tanh_sech2 -> (f64, f64);
        lorentzian -> (f64, f64);
        sin_cos -> (f64, f64);
        exp -> f64;
    }

    /// What all registers implement of [`Scalar`] in the same way.
    macro_rules! functions_of_registers {
        () => {
            const SPECIALISED: bool = true;

            #[inline(always)]
            fn tanh_sech2(self) -> (Self, Self) {
                let ([t], [s]) = tanh_sech2_in_step([self]);
                (t, s)
            }
            #[inline(always)]
            fn tanh_sech2_each<const K: usize>(x: [Self; K]) -> ([Self; K], [Self; K]) {
                tanh_sech2_in_step(x)
            }
            #[inline(always)]
            fn lorentzian(self) -> (Self, Self) {
                let ([t], [s]) = lorentzian_in_step([self]);
                (t, s)
            }
            #[inline(always)]
            fn lorentzian_each<const K: usize>(x: [Self; K]) -> ([Self; K], [Self; K]) {
                lorentzian_in_step(x)
            }
            fn unit_roundoff() -> f64 {
                f64::unit_roundoff()
            }
        };
    }

    macro_rules! elementary_functions {
        ([$($generics:tt)*] $register:ty) => {
            impl<$($generics)*> Elementary for $register {
                #[inline(always)]
                fn sin_cos(self) -> (Self, Self) {
                    crate::scalar::sin_cos::sin_cos(self)
                }
                #[inline(always)]
                fn exp(self) -> Self {
                    crate::scalar::exp::exp(self)
                }
                #[inline(always)]
                fn zero_with(self, factor: Self) -> Self {
                    zero_lanes_with(self, factor)
                }
                #[inline(always)]
                fn sign(self) -> Self {
                    Self::from_f64(1.0).with_sign_of(self)
                }
                functions_of_lanes!();
            }
            assigning!([$($generics)*] $register);
        };
    }

    /// The implementation of [`Lanewise::one_by_one`] for a register.
    #[inline(always)]
    fn each_lane<V: Pack>(x: V, f: impl Fn(f64) -> (f64, f64)) -> (V, V) {
        let mut all = [0.0; WIDTH];
        x.store(&mut all[..V::LANES]);
        let mut out = (all, all);
        for (i, &x) in all[..V::LANES].iter().enumerate() {
            (out.0[i], out.1[i]) = f(x);
        }
        (V::load(&out.0[..V::LANES]), V::load(&out.1[..V::LANES]))
    }

    /// The implementation of [`Lanewise::pair_by_pair`] for registers.
    #[inline(always)]
    fn each_pair<V: Pack>(x: V, y: V, f: impl Fn(f64, f64) -> f64) -> V {
        let mut all = [[0.0; WIDTH]; 2];
        x.store(&mut all[0][..V::LANES]);
        y.store(&mut all[1][..V::LANES]);
        let [mut out, other] = all;
        for (x, y) in out.iter_mut().zip(other) {
            *x = f(*x, y);
        }
        V::load(&out[..V::LANES])
    }

    /// A method of the register by an intrinsic of the same operands.
    macro_rules! intrinsic {
        ($($method:ident($($operand:ident),*) = $body:expr;)*) => {
            $(#[inline(always)]
            fn $method($($operand: Self),*) -> Self {
                // SAFETY: see the module.
                Self(unsafe { $body })
            })*
        };
    }

    macro_rules! operator {
        ($register:ident, $($trait:ident, $method:ident, $intrinsic:ident;)*) => {
            $(impl $trait for $register {
                type Output = Self;
                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    // SAFETY: see the module.
                    Self(unsafe { $intrinsic(self.0, other.0) })
                }
            })*
        };
    }

    /// A register of AVX2 with four lanes of `f64`.
    #[derive(Clone, Copy, Debug)]
    #[repr(transparent)]
    pub(super) struct Ymm(__m256d);

    operator! { Ymm,
        Add, add, _mm256_add_pd; Sub, sub, _mm256_sub_pd;
        Mul, mul, _mm256_mul_pd; Div, div, _mm256_div_pd;
    }

    impl Neg for Ymm {
        type Output = Self;
        intrinsic! { neg(self) = _mm256_xor_pd(self.0, _mm256_set1_pd(-0.0)); }
    }

    impl Scalar for Ymm {
        #[inline(always)]
        fn from_f64(value: f64) -> Self {
            // SAFETY: see the module.
            Self(unsafe { _mm256_set1_pd(value) })
        }
        intrinsic! {
            mul_add(self, a, b) = _mm256_fmadd_pd(self.0, a.0, b.0);
            abs(self) = _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0);
        }
        functions_of_registers!();
        #[inline(always)]
        fn outlined(task: impl Task) {
            // SAFETY: see the module.
            unsafe { task.run_apart_on_avx2() }
        }
        #[inline(always)]
        fn is_zero(self) -> bool {
            // SAFETY: see the module.
            unsafe {
                _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_EQ_OQ>(self.0, _mm256_setzero_pd())) == 15
            }
        }
    }

    impl Lanewise for Ymm {
        intrinsic! {
            negative_mul_add(self, a, b) = _mm256_fnmadd_pd(self.0, a.0, b.0);
            power_of_low_bits(self) =
                _mm256_castsi256_pd(_mm256_slli_epi64::<52>(_mm256_castpd_si256(self.0)));
            select_negative(self, negative, otherwise) =
                _mm256_blendv_pd(otherwise.0, negative.0, self.0);
            with_sign_of(self, sign) = _mm256_or_pd(
                _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0),
                _mm256_and_pd(_mm256_set1_pd(-0.0), sign.0),
            );
            negated_where(self, sign) =
                _mm256_xor_pd(self.0, _mm256_and_pd(_mm256_set1_pd(-0.0), sign.0));
            plus_bits(self, other) = _mm256_castsi256_pd(
                _mm256_add_epi64(_mm256_castpd_si256(self.0), _mm256_castpd_si256(other.0)),
            );
            minus_bits(self, other) = _mm256_castsi256_pd(
                _mm256_sub_epi64(_mm256_castpd_si256(self.0), _mm256_castpd_si256(other.0)),
            );
        }
        #[inline(always)]
        fn bit_as_sign<const BIT: u32>(self) -> Self {
            // SAFETY: see the module.
            Self(unsafe {
                let count = _mm_cvtsi32_si128(63 - BIT as i32);
                _mm256_castsi256_pd(_mm256_sll_epi64(_mm256_castpd_si256(self.0), count))
            })
        }
        #[inline(always)]
        fn any_above(self, limit: f64) -> bool {
            // SAFETY: see the module.
            unsafe {
                let above = _mm256_cmp_pd::<_CMP_GT_OQ>(self.0, _mm256_set1_pd(limit));
                _mm256_movemask_pd(above) != 0
            }
        }
        #[inline(always)]
        fn all_negative(self) -> bool {
            // SAFETY: see the module.
            unsafe {
                let below = _mm256_cmp_pd::<_CMP_LT_OQ>(self.0, _mm256_setzero_pd());
                _mm256_movemask_pd(below) == 15
            }
        }
        #[inline(always)]
        fn one_by_one(self, f: impl Fn(f64) -> (f64, f64)) -> (Self, Self) {
            each_lane(self, f)
        }
        #[inline(always)]
        fn pair_by_pair(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
            each_pair(self, other, f)
        }
        #[inline(always)]
        fn at_most(self, most: f64) -> Self {
            // SAFETY: see the module. A NaN in the second operand comes through.
            Self(unsafe { _mm256_min_pd(_mm256_set1_pd(most), self.0) })
        }
        #[inline(always)]
        fn select_above(self, limit: f64, above: Self, otherwise: Self) -> Self {
            // SAFETY: see the module.
            Self(unsafe {
                let mask = _mm256_cmp_pd::<_CMP_GT_OQ>(self.0, _mm256_set1_pd(limit));
                _mm256_blendv_pd(otherwise.0, above.0, mask)
            })
        }
    }

    elementary_functions!([] Ymm);
    over_parameters!([] Ymm);

    impl Pack for Ymm {
        const LANES: usize = 4;
        #[inline(always)]
        fn sum_of_products(self, weights: Self, first: f64) -> f64 {
            // SAFETY: see the module.
            unsafe {
                let front = _mm_fmadd_pd(
                    _mm256_castpd256_pd128(self.0),
                    _mm256_castpd256_pd128(weights.0),
                    // −0: c₁w₁ as it is, a zero with its sign.
                    _mm_set_pd(-0.0, first),
                );
                let sums = _mm_fmadd_pd(
                    _mm256_extractf128_pd::<1>(self.0),
                    _mm256_extractf128_pd::<1>(weights.0),
                    front,
                );
                _mm_cvtsd_f64(_mm_add_sd(sums, _mm_unpackhi_pd(sums, sums)))
            }
        }
        #[inline(always)]
        fn load(values: &[f64]) -> Self {
            let values: &[f64; 4] = values.try_into().expect("four lanes");
            // SAFETY: see the module; the array is of the register's size.
            Self(unsafe { _mm256_loadu_pd(values.as_ptr()) })
        }
        #[inline(always)]
        fn store(self, values: &mut [f64]) {
            let values: &mut [f64; 4] = values.try_into().expect("four lanes");
            // SAFETY: as in `load`.
            unsafe { _mm256_storeu_pd(values.as_mut_ptr(), self.0) }
        }
    }

    /// A register of AVX-512 with eight lanes of `f64`.
    #[derive(Clone, Copy, Debug)]
    #[repr(transparent)]
    pub(super) struct Zmm(__m512d);

    operator! { Zmm,
        Add, add, _mm512_add_pd; Sub, sub, _mm512_sub_pd;
        Mul, mul, _mm512_mul_pd; Div, div, _mm512_div_pd;
    }

    impl Neg for Zmm {
        type Output = Self;
        intrinsic! { neg(self) = _mm512_xor_pd(self.0, _mm512_set1_pd(-0.0)); }
    }

    impl Scalar for Zmm {
        #[inline(always)]
        fn from_f64(value: f64) -> Self {
            // SAFETY: see the module.
            Self(unsafe { _mm512_set1_pd(value) })
        }
        intrinsic! {
            mul_add(self, a, b) = _mm512_fmadd_pd(self.0, a.0, b.0);
            abs(self) = _mm512_abs_pd(self.0);
        }
        functions_of_registers!();
        #[inline(always)]
        fn outlined(task: impl Task) {
            // SAFETY: see the module.
            unsafe { task.run_apart_on_avx512() }
        }
        #[inline(always)]
        fn is_zero(self) -> bool {
            // SAFETY: see the module.
            unsafe { _mm512_cmp_pd_mask::<_CMP_EQ_OQ>(self.0, _mm512_setzero_pd()) == u8::MAX }
        }
    }

    impl Lanewise for Zmm {
        intrinsic! {
            negative_mul_add(self, a, b) = _mm512_fnmadd_pd(self.0, a.0, b.0);
            power_of_low_bits(self) =
                _mm512_castsi512_pd(_mm512_slli_epi64::<52>(_mm512_castpd_si512(self.0)));
            select_negative(self, negative, otherwise) = _mm512_mask_mov_pd(
                otherwise.0,
                _mm512_movepi64_mask(_mm512_castpd_si512(self.0)),
                negative.0,
            );
            negated_where(self, sign) =
                _mm512_xor_pd(self.0, _mm512_and_pd(_mm512_set1_pd(-0.0), sign.0));
            plus_bits(self, other) = _mm512_castsi512_pd(
                _mm512_add_epi64(_mm512_castpd_si512(self.0), _mm512_castpd_si512(other.0)),
            );
            minus_bits(self, other) = _mm512_castsi512_pd(
                _mm512_sub_epi64(_mm512_castpd_si512(self.0), _mm512_castpd_si512(other.0)),
            );
            // The bits of self where the mask is set, else those of `sign`.
            with_sign_of(self, sign) = _mm512_castsi512_pd(_mm512_ternarylogic_epi64::<0xe4>(
                _mm512_castpd_si512(self.0),
                _mm512_castpd_si512(sign.0),
                _mm512_set1_epi64(i64::MAX),
            ));
        }
        #[inline(always)]
        fn bit_as_sign<const BIT: u32>(self) -> Self {
            // SAFETY: see the module.
            Self(unsafe {
                let count = _mm_cvtsi32_si128(63 - BIT as i32);
                _mm512_castsi512_pd(_mm512_sll_epi64(_mm512_castpd_si512(self.0), count))
            })
        }
        #[inline(always)]
        fn any_above(self, limit: f64) -> bool {
            // SAFETY: see the module.
            unsafe { _mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0, _mm512_set1_pd(limit)) != 0 }
        }
        #[inline(always)]
        fn all_negative(self) -> bool {
            // SAFETY: see the module.
            unsafe { _mm512_cmp_pd_mask::<_CMP_LT_OQ>(self.0, _mm512_setzero_pd()) == u8::MAX }
        }
        #[inline(always)]
        fn one_by_one(self, f: impl Fn(f64) -> (f64, f64)) -> (Self, Self) {
            each_lane(self, f)
        }
        #[inline(always)]
        fn pair_by_pair(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
            each_pair(self, other, f)
        }
        #[inline(always)]
        fn at_most(self, most: f64) -> Self {
            // SAFETY: see the module. A NaN in the second operand comes through.
            Self(unsafe { _mm512_min_pd(_mm512_set1_pd(most), self.0) })
        }
        #[inline(always)]
        fn select_above(self, limit: f64, above: Self, otherwise: Self) -> Self {
            // SAFETY: see the module.
            Self(unsafe {
                let mask = _mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0, _mm512_set1_pd(limit));
                _mm512_mask_mov_pd(otherwise.0, mask, above.0)
            })
        }
    }

    elementary_functions!([] Zmm);
    over_parameters!([] Zmm);

    impl Pack for Zmm {
        const LANES: usize = 8;
        #[inline(always)]
        fn load(values: &[f64]) -> Self {
            let values: &[f64; 8] = values.try_into().expect("eight lanes");
            // SAFETY: see the module; the array is of the register's size.
            Self(unsafe { _mm512_loadu_pd(values.as_ptr()) })
        }
        #[inline(always)]
        fn store(self, values: &mut [f64]) {
            let values: &mut [f64; 8] = values.try_into().expect("eight lanes");
            // SAFETY: as in `load`.
            unsafe { _mm512_storeu_pd(values.as_mut_ptr(), self.0) }
        }
    }

    /// Twice the lanes, in two registers.
    #[derive(Clone, Copy, Debug)]
    pub(super) struct Pair<V>(V, V);

    macro_rules! both {
        ($($method:ident($($operand:ident),*);)*) => {
            $(#[inline(always)]
            fn $method(self $(, $operand: Self)*) -> Self {
                Self(self.0.$method($($operand.0),*), self.1.$method($($operand.1),*))
            })*
        };
    }

    macro_rules! pair_operator {
        ($($trait:ident, $method:ident;)*) => {
            $(impl<V: Pack> $trait for Pair<V> {
                type Output = Self;
                both! { $method(other); }
            })*
        };
    }
    pair_operator! { Add, add; Sub, sub; Mul, mul; Div, div; }

    impl<V: Pack> Neg for Pair<V> {
        type Output = Self;
        both! { neg(); }
    }

    impl<V: Pack> Scalar for Pair<V> {
        #[inline(always)]
        fn from_f64(value: f64) -> Self {
            Self(V::from_f64(value), V::from_f64(value))
        }
        both! { mul_add(a, b); abs(); }
        functions_of_registers!();
        #[inline(always)]
        fn outlined(task: impl Task) {
            V::outlined(task);
        }
        #[inline(always)]
        fn is_zero(self) -> bool {
            self.0.is_zero() && self.1.is_zero()
        }
    }

    impl<V: Pack> Lanewise for Pair<V> {
        both! {
            negative_mul_add(a, b);
            power_of_low_bits();
            select_negative(negative, otherwise);
            with_sign_of(sign);
            negated_where(sign);
            plus_bits(other);
            minus_bits(other);
        }
        #[inline(always)]
        fn bit_as_sign<const BIT: u32>(self) -> Self {
            Self(self.0.bit_as_sign::<BIT>(), self.1.bit_as_sign::<BIT>())
        }
        #[inline(always)]
        fn any_above(self, limit: f64) -> bool {
            self.0.any_above(limit) || self.1.any_above(limit)
        }
        #[inline(always)]
        fn all_negative(self) -> bool {
            self.0.all_negative() && self.1.all_negative()
        }
        #[inline(always)]
        fn one_by_one(self, f: impl Fn(f64) -> (f64, f64)) -> (Self, Self) {
            each_lane(self, f)
        }
        #[inline(always)]
        fn pair_by_pair(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
            each_pair(self, other, f)
        }
        #[inline(always)]
        fn at_most(self, most: f64) -> Self {
            Self(self.0.at_most(most), self.1.at_most(most))
        }
        #[inline(always)]
        fn select_above(self, limit: f64, above: Self, otherwise: Self) -> Self {
            Self(
                self.0.select_above(limit, above.0, otherwise.0),
                self.1.select_above(limit, above.1, otherwise.1),
            )
        }
    }

    elementary_functions!([V: Pack] Pair<V>);
    over_parameters!([V: Pack] Pair<V>);

    impl<V: Pack> Pack for Pair<V> {
        const LANES: usize = 2 * V::LANES;
        #[inline(always)]
        fn load(values: &[f64]) -> Self {
            let (low, high) = values.split_at(V::LANES);
            Self(V::load(low), V::load(high))
        }
        #[inline(always)]
        fn store(self, values: &mut [f64]) {
            let (low, high) = values.split_at_mut(V::LANES);
            self.0.store(low);
            self.1.store(high);
        }
    }
}
