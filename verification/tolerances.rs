//! Every threshold of the suite, with its derivation. No other file of
//! `verification/` holds one: `coverage` reads them all.

use gyroceptron::measure;

/// u, the unit roundoff of double precision.
const U: f64 = 0.5 * f64::EPSILON;

/// Ratios are errors over the rounding scale of the computation that made
/// them: O(1) by construction, and below 4 in all that was ever measured. A
/// decimal order above that leaves room for another processor's worst sample
/// and none for a weight that is wrong by 1e-13, which shows as some 20.
pub const RATIO: f64 = measure::certificate::RATIO_LIMIT;

/// Bitwise laws count components that differ: there must be none.
pub const COUNT: f64 = measure::certificate::COUNT_LIMIT;

/// The upper decile of the ratios that are not 0, of each law with bounds that add the
/// errors of steps as independent ones: 0.2 to 0.6. Limits of ratios are ten times the
/// bounds, so that bounds which are a hundred times too large would hide weights that
/// are wrong by 1e-10.
pub const DEVIATION: f64 = measure::certificate::SOUND_DEVIATION;
/// The law that shows the least has to show less than this: else a larger limit would
/// do.
pub const DEVIATION_NEEDED: f64 = 20.0 * DEVIATION;

/// The median of ρ_S over the clean suite. T adds the scales of the errors in
/// squares, as independent errors add, and an error is on average a third of
/// its scale: some 0.3. Saturated neurons make no error at all and pull the
/// median to 0: below 0.05 the suite would say nothing.
pub const CLEAN_MEDIAN: [f64; 2] = [0.05, 0.6];

/// What may be missing to an order in ε: the next order contributes a relative
/// 1e-3 at the largest ε, where I_ε moves points by a thousandth of their size,
/// and its effect on the slope is some tens of times that for weights where the
/// leading term is small.
pub const ORDER: f64 = measure::certificate::SLOPE_LIMIT;

/// The exponent of the drift of μ₀ in the number of iterations, one degree of
/// freedom. The curve is invariant: the drift is the range of a smooth function
/// on it, seen at N points. These leave gaps of at most 2π/q, q the largest
/// denominator ≤ N of a convergent of the rotation number; a maximum of the
/// harmonic m is missed by at most ½(mπ/q)². For m = 3 and a q of 100 at the
/// first horizon, 5000 (a partial quotient of 50, which one number in fifty has
/// there), that is 4.4e-3, which a line over five halvings turns into
/// 4.4e-3·2.5/(17.5 ln 2) = 9e-4.
pub const DRIFT_EXPONENT: f64 = 1e-3;

/// The exponent of the drift with a second degree of freedom, up to Nε = 10, the
/// median over networks: in a slow time of 10 the slow plane moves by its own
/// size, and the amplitude of the fast oscillation, a function of it, may double
/// between the horizons 10 and 20,000: ln 2/ln 2000 = 0.09.
pub const DRIFT_EXPONENT_4D: f64 = 0.1;

/// The exponent of the drift of an exact invariant, which is that of a random walk of
/// rounding errors, ½, in the largest value up to N. The logarithm of a walk's range
/// scatters by some 0.35 from one network and orbit to another; of 4 networks with
/// 8 orbits each, at four horizons over three decades, the slope by 0.05.
pub const EXACT_DRIFT_EXPONENT: f64 = 0.6;
/// The drift of an exact invariant of size 1 over 10⁶ steps. Each has at most 12
/// roundings, which would add up to 12·1000 u = 1.3e-12 as independent ones of the largest
/// size; those of a uniform law are 0.6 of that.
pub const EXACT_DRIFT: f64 = 1e-12;

/// The slow time Nε up to which drifts are followed: a period and a half of the
/// slow plane.
pub const SLOW_TIME: f64 = 10.0;

/// The exponent of the control, which loses a fixed share of μ₀ at each
/// iteration, is 1: up to the oscillation that it has in common with the clean
/// map at its first horizon, and its exponential decay at the last.
pub const CONTROL_EXPONENT: f64 = 0.1;

/// Drifts count that are so many times the drift of rounding at ε = 0: at the
/// smallest ε, 2e-9, a drift of 0.05ε is 1e-10, and rounding makes 1e-14 in
/// 10,000 iterations.
pub const ABOVE_FLOOR: f64 = 1e3;

/// A relative error of the drift that is e at one end of the line over ε halved seven
/// times, and halves with each step from there, moves its slope by at most this
/// times e: Σ|k − 3.5|2⁻ᵏ/(42 ln 2), k = 0 … 7. Rounding does so from the smallest ε.
pub const SHIFT_OF_SLOPE: f64 = 0.184;

/// |slope − 1| of the drift in ε. Rounding shifts it by [`SHIFT_OF_SLOPE`] of
/// 1/[`ABOVE_FLOOR`]; the second order in ε, from the largest, 2.5e-7, by that of
/// 2.5e-5 where it is a hundred times the first: 1.9e-4.
pub const DRIFT_SLOPE: f64 = 2e-4;

/// The share of samples on which rounding may leave no digit: 942 of 10,000 are
/// seen, in the determinant of networks of up to 40 layers. Of 500 networks with
/// two points each it is as much within four standard deviations (0.013).
pub const ILL_CONDITIONED_SHARE: f64 = 0.15;

/// The distance of a map on a grid from that of plain numbers, over the sum of the bounds of both: a bound.
pub const GRID_DISTANCE: f64 = 1.0;
/// What is seen of the bound: it adds the largest errors of all increments with one sign. Of the few increments of
/// one layer some nearly add up; a sixth of that leaves room for other samples.
pub const GRID_DISTANCE_SEEN: f64 = 0.1;
/// Where a bound to first order holds: the second order is some 10 (weights of 10, in curvatures of 100, whose
/// errors are a hundredth of the sum) times as much again.
pub const GRID_LINEAR: f64 = 1e-3;

/// Confidence of all intervals.
pub const CONFIDENCE: f64 = 0.99;

/// |slope − 1| of log residual in log u, one seed, two levels of 29 bits: ratios
/// of two samples of rounding may differ by 2^(0.2·29) = 56.
pub const LADDER_TWO_RUNGS: f64 = 0.20;
/// |slope − 1| over all three levels, 82 bits apart: a factor of 17.
pub const LADDER_THREE_RUNGS: f64 = 0.05;
/// How many times the limit a map that is not symplectic is from it, at the least of its points: contractions of a
/// thousandth would do.
pub const REFUSED: f64 = 1e6;
/// |slope − 1| of the medians of twenty seeds over all levels: a factor of 3,
/// which the spread of a median does not reach.
pub const LADDER_MEDIAN: f64 = 0.02;

/// tanh to 3 ulp, up to ±∞. No guarantee depends on it: symplecticity, inversion
/// and gradients hold for whatever function the kernel computes, as long as both
/// directions and all lanes compute the same. Its accuracy only has to be far below
/// that of any trained net (1e-4 and more), and it is cheap to have: roundings of
/// e^{−2|x|} − 1, of 1 + e^{−2|x|}, of its inverse and of the product, each at most
/// 0.5 to 0.9 ulp.
pub const TANH_ULPS: f64 = 3.0;
/// sech² to 5e-16 relative up to |x| = 354, where it is 1.3e-307, for the same
/// reason: roundings of 1 + e^{−2|x|}, its inverse, q and q − q², at most 1.1e-16
/// each (the inverse half of it), and 0.3e-16 of the exponential.
pub const SECH2: f64 = 5e-16;
/// 3u = 3.33e-16: roundings of 1 + x² and of the last two operations of its reciprocal, each of at most u.
pub const LORENTZIAN: f64 = 3.4e-16;
/// 4u = 4.44e-16: and one of the product with x.
pub const ODD_LORENTZIAN: f64 = 4.5e-16;

/// Four roundings of numbers of size 1, which is what a rotation by three shears
/// takes, and what one derivative of sech² takes by any formula.
pub const FOUR_ROUNDINGS: f64 = 4.0 * U;
/// A rotation by a harmonic m·θ: m·θ is rounded, and its rounding error, besides.
pub const HARMONIC: f64 = 6.0 * U;
/// A product of sech² with two weights: sech², the two products, the reference's
/// rounding and that of the quotient.
pub const PRODUCT_WITH_SECH2: f64 = SECH2 + 4.0 * U;
/// The distance of an angle from a resonance that it is on: four roundings of a
/// number of turns below 1, in radians.
pub const ON_RESONANCE: f64 = 4.0 * U * std::f64::consts::TAU;
/// The distance of the golden mean from 2πp/q is at least 2π/(√5 q²) (Hurwitz),
/// up to what q = 7 lacks to the limit: 0.057.
pub const OFF_RESONANCE: f64 = 0.05;
/// The rounding of 2π times the golden mean: two units in its last place.
pub const GOLDEN: f64 = 8.0 * U;
/// An oracle sees that the naive form of sech² is wrong where that errs by so
/// many times what the kernel may.
pub const NAIVE_SECH2: f64 = 1e4 * SECH2;
/// What no rounding of double precision makes of numbers of size 1 in a few
/// operations: ten billion units.
pub const NO_ROUNDING: f64 = 1e10 * U;
/// Digits that double precision has lost and a longer one has: three at least.
pub const MORE_DIGITS: f64 = 1e-3;
/// A unit in the last of the digits that are quoted: three and four decimals.
pub const THREE_DECIMALS: f64 = 1e-3;
/// See [`THREE_DECIMALS`].
pub const FOUR_DECIMALS: f64 = 1e-4;
/// The relative accuracy to which statrs inverts the Beta distribution.
pub const QUANTILE: f64 = 1e-6;

/// A violation of a law among random networks: the upper end of the interval
/// for none in ten thousand is 5.3e-4.
pub const VIOLATION_RATE: f64 = 6e-4;

mod needed {
    use super::*;
    use crate::mutants::Fault;
    use crate::{adiabatic, mutants, near_identity, precision, statistics, suite, symplecticity};
    use crate::{inversion, tanh};
    use gyroceptron::scalar::max_or_nan;

    /// A twentieth of the limit would reject the clean suite, ten times the limit
    /// would let a mutant live. All three are measured.
    fn is_needed(name: &str, clean: f64, limit: f64, mutant: f64) {
        assert!(clean < limit && limit < mutant, "{name}: {clean:e} < {limit:e} < {mutant:e}");
        if suite::seed() != suite::SEED || suite::extensive() {
            return;
        }
        assert!(clean > limit / 20.0, "{name}: {limit:e} / 20 would do, {clean:e} is seen");
        assert!(mutant < limit * 10.0, "{name}: no mutant needs less than ten times {limit:e}");
    }

    fn largest(rows: &[gyroceptron::measure::certificate::Row]) -> f64 {
        rows.iter().map(|row| row.largest.unwrap_or(f64::NAN)).fold(0.0, max_or_nan)
    }

    #[test]
    fn the_ratio() {
        let clean = max_or_nan(largest(symplecticity::rows()), largest(inversion::rows()));
        let weakest = mutants::smallest_inversion(Fault::InverseInnerBarely);
        is_needed("RATIO", clean, RATIO, weakest);
    }

    #[test]
    fn the_count() {
        let clean = largest(crate::near_periodicity::rows());
        let mutant = mutants::largest_of(Fault::Friction, "near periodicity");
        assert!(clean < COUNT && COUNT < mutant, "{clean} {mutant}");
    }

    #[test]
    fn the_median() {
        let median = symplecticity::clean_median();
        let [low, high] = CLEAN_MEDIAN;
        assert!(low < median && median < high, "{median}");
        // Saturated inputs fall below; a tenth of the range would not hold it.
        assert!(symplecticity::saturated_median() < low);
        assert!(median > high / 10.0 && median < low * 10.0, "{median}");
    }

    #[test]
    fn the_orders() {
        let clean = near_identity::largest_shortfall();
        // Orders are whole numbers: a mutant is wrong by one.
        let mutant = mutants::largest_of(Fault::AbsoluteEpsilon, "O(ε²)");
        assert!(clean < ORDER && ORDER < mutant, "{clean} {mutant}");
        assert!(clean > ORDER / 100.0, "{clean}");
    }

    #[test]
    fn the_share() {
        let share = |row: &gyroceptron::measure::certificate::Row| {
            row.ill_conditioned as f64 / row.samples as f64
        };
        let clean = crate::report::clean_rows().iter().map(share).fold(0.0, max_or_nan);
        assert!(ILL_CONDITIONED_SHARE / 10.0 < clean && clean < ILL_CONDITIONED_SHARE, "{clean}");
    }

    /// The limits of the drifts are those that the theory promises, far above
    /// what is seen; the control shows that they are not out of reach.
    #[test]
    fn the_drifts() {
        let study = adiabatic::study();
        let control = study.control_exponent();
        assert!(study.largest_exponent() < DRIFT_EXPONENT && DRIFT_EXPONENT < control);
        assert!(DRIFT_EXPONENT_4D < control && control < 10.0 * DRIFT_EXPONENT_4D, "{control}");
        let defect = study.control_defect();
        assert!(defect < CONTROL_EXPONENT && defect > CONTROL_EXPONENT / 10.0, "{defect}");
        assert!(study.slope_defect() < DRIFT_SLOPE);
        let ignored = mutants::largest_of(Fault::EpsilonIgnored, "slope − 1");
        assert!(DRIFT_SLOPE < ignored, "{ignored}");
        assert!(study.least_above_floor() > ABOVE_FLOOR);
    }

    #[test]
    fn the_ladder() {
        let ladder = precision::ladder();
        let two = precision::two_rungs_of_mutant(1e-24);
        is_needed("LADDER_TWO_RUNGS", ladder.worst_two_rungs(), LADDER_TWO_RUNGS, two);
        let three = precision::three_rungs_of_mutant(1e-26);
        is_needed("LADDER_THREE_RUNGS", ladder.worst_three_rungs(), LADDER_THREE_RUNGS, three);
        let weak = precision::three_rungs_of_mutant(1e-28);
        is_needed("LADDER_MEDIAN", ladder.median_defect(), LADDER_MEDIAN, weak);
    }

    #[test]
    fn the_elementary_functions() {
        let (ulps, relative) = tanh::worst(gyroceptron::scalar::tanh_sech2);
        is_needed("TANH_ULPS", ulps, TANH_ULPS, tanh::worst(tanh::by_exponentials).0);
        assert!(relative > SECH2 / 10.0 && relative < SECH2);
        assert!(tanh::worst(tanh::by_difference).1 > SECH2 * 10.0);
        let worst = |kernel| {
            let all = tanh::errors_of_arctan(kernel).into_iter();
            all.fold([0.0, 0.0], |[a, b], (t, s)| [max_or_nan(a, t), max_or_nan(b, s)])
        };
        let (sound, broken) =
            (worst(gyroceptron::scalar::Scalar::lorentzian), worst(tanh::by_cubic_step));
        is_needed("ODD_LORENTZIAN", sound[0], ODD_LORENTZIAN, broken[0]);
        is_needed("LORENTZIAN", sound[1], LORENTZIAN, broken[1]);
    }

    #[test]
    fn the_rate() {
        let none = statistics::upper_bound(0, suite::NETWORKS);
        let one = statistics::upper_bound(1, suite::NETWORKS);
        is_needed("VIOLATION_RATE", none, VIOLATION_RATE, one);
    }
}

/// A map of a dozen steps in balls of two doubles: 2⁻¹⁰³ for each of some thousand operations, by factors
/// of steps that move points by their size.
pub const OF_TWO_DOUBLES: f64 = 1e-24;
/// The same in balls of three: 2⁻¹⁵⁴ in place of 2⁻¹⁰³.
pub const OF_THREE_DOUBLES: f64 = 1e-39;
/// A strip is as wide as another, to the steps of a search by a factor of 1.12.
pub const AS_WIDE: f64 = 0.85;
/// What a pole near a circle leaves of its strip at most.
pub const NARROWED: f64 = 0.5;
/// What is left of a radius with a third double: 2⁻⁵³ and the factors of 2⁴ between the bounds of both.
pub const OF_A_THIRD_WORD: f64 = 1e-14;
/// The same in doubles.
pub const OF_A_MAP: f64 = 1e-11;
/// Areas that shrink by no more than this a map the numbers of a proof do not see where κ is 10⁶, as in the small
/// network of the tests: κ times it is to be of order one. What is less the kinds of step refuse.
pub const SMALLEST_DISSIPATION: f64 = 5e-10;
/// Arguments of exp and tanh in balls: e^600 is the most that they hold.
pub const MOST_OF_EXP: f64 = 500.0;
/// Of sine and cosine: beyond 10⁹ quarter turns they hold all of [−1, 1].
pub const MOST_OF_SIN: f64 = 1e6;
/// A remainder of a Taylor model that is a hundred times the error at a point of its edge is not merely large: rounding
/// makes it so where the model is narrow.
pub const TIGHT: f64 = 0.01;
/// Bounds of numbers of order one are rounded outwards some ten times by 2⁻⁵²: a few 10⁻¹⁵.
pub const OF_BOUNDS: f64 = 1e-13;
/// The area of a polygon of 2¹⁴ corners on a curve of few harmonics k is less than that of the curve by (2πk/2¹⁴)²/6, some
/// 10⁻⁷ of it.
pub const OF_POLYGON: f64 = 1e-6;
/// A step of some hundred operations in doubles on numbers of order one is off by some hundred units in the last place.
pub const OF_A_STEP: f64 = 1e-13;
/// A hundred roundings of a step beside a distance of 5·10⁻⁴.
pub const OF_A_DISTANCE: f64 = 1e-9;
/// A weighted average of equal numbers, and 44 halvings of a part of a ray, are off by rounding.
pub const OF_TURNS: f64 = 1e-12;
/// The bound of small divisors sums 1500 of them as they are: the rest is less than a thousandth.
pub const OF_DIVISORS: f64 = 1.001;
