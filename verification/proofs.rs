//! Proofs of invariant circles: enclosures against 320-bit values and against the maps themselves, the theorem on the
//! standard map and on networks, and what each part of it is to refuse.

use crate::tolerances;
use astro_float::{BigFloat, Consts, RoundingMode};
use gyroceptron::layer::{CircleAction, Reversor, TorusAction};
use gyroceptron::measure::proof::{
    Ball, BallCentre, BallOf, Candidate, Circle, Complex, Constant, Divisors, Failure, FineBall,
    FixedPoint, Jet, NobleNumber, Number, PlaneMap, PlaneStep, Ray, Slope, Taylor, ThreeWords,
    TwoWords, Verdict, candidates, candidates_near, fixed_point_near, noble_numbers, place_on_ray,
    prove_circle, rounding_of_a_step, turns_of_orbit,
};
use gyroceptron::network::{InitialWeights, Model, NetworkSpec, NormalFormShape};
use gyroceptron::phase::{Half, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{DoubleDouble, Scalar};
use std::f64::consts::{FRAC_PI_2, LN_2, PI};

const BITS: usize = 320;
const NEAREST: RoundingMode = RoundingMode::ToEven;

fn wide<C: BallCentre>(ball: BallOf<C>) -> BigFloat {
    let words = ball.parts().map(|word| BigFloat::from_f64(word, BITS));
    let [high, low, third] = &words;
    high.add(low, BITS, NEAREST).add(third, BITS, NEAREST)
}

/// Whether a value is in a ball.
fn holds<C: BallCentre>(ball: BallOf<C>, value: &BigFloat) -> bool {
    let apart = wide(ball).sub(value, BITS, NEAREST).abs();
    apart.cmp(&BigFloat::from_f64(ball.radius(), BITS)).is_some_and(|order| order <= 0)
}

fn double(stream: &mut Stream) -> f64 {
    let exponent = stream.uniform(-30.0, 30.0).round() as i32;
    stream.uniform(-2.0, 2.0) * 2.0_f64.powi(exponent)
}

/// Points of as many bits as they may have, and arguments at edges.
fn points<C: BallCentre>(stream: &mut Stream, count: usize) -> Vec<BallOf<C>> {
    let edges = [
        0.0,
        1.0,
        -1.0,
        0.5,
        LN_2,
        LN_2 / 64.0,
        FRAC_PI_2,
        PI,
        1e-300,
        20.0,
        149.9,
        -150.1,
        150.005,
    ];
    let edges = edges.into_iter().map(BallOf::of);
    let drawn = (0..count).map(|_| {
        let high = double(stream);
        let mut less = |than: f64| than * stream.uniform(-1.0, 1.0) * f64::EPSILON * 0.25;
        let low = less(high);
        BallOf::around([high, low, less(low)], 0.0)
    });
    edges.chain(drawn.collect::<Vec<_>>()).collect()
}

/// How many operations do not hold their value, with balls that `change` makes of the results.
fn missed<C: BallCentre>(change: impl Fn(BallOf<C>) -> BallOf<C>) -> usize {
    let mut stream = Stream::new(crate::suite::SEED, "balls");
    let mut constants = Consts::new().expect("memory");
    let all = points::<C>(&mut stream, 1200 * crate::suite::times());
    let mut missed = 0;
    let (mut all_of_them, mut refused) = (0, 0);
    let mut count = |ball: BallOf<C>, value: BigFloat| {
        all_of_them += 1;
        // What overflows on the way has no finite radius.
        if !ball.radius().is_finite() {
            refused += 1;
        } else {
            missed += usize::from(!holds(change(ball), &value));
        }
    };
    for pair in all.windows(2) {
        let ([a, b], [x, y]) = ([pair[0], pair[1]], [wide(pair[0]), wide(pair[1])]);
        count(a.plus(b), x.add(&y, BITS, NEAREST));
        count(a.minus(b), x.sub(&y, BITS, NEAREST));
        count(a.times(b), x.mul(&y, BITS, NEAREST));
        if b.centre() != 0.0 {
            count(a.divided_by(b), x.div(&y, BITS, NEAREST));
        }
        if a.centre() > 0.0 {
            count(a.sqrt(), x.sqrt(BITS, NEAREST));
        }
        if a.centre().abs() < tolerances::MOST_OF_EXP {
            count(a.exp(), x.exp(BITS, NEAREST, &mut constants));
            count(a.tanh(), x.tanh(BITS, NEAREST, &mut constants));
        }
        if a.centre().abs() < tolerances::MOST_OF_SIN {
            let (s, c) = a.sin_cos();
            count(s, x.sin(BITS, NEAREST, &mut constants));
            count(c, x.cos(BITS, NEAREST, &mut constants));
        }
    }
    assert!(100 * refused < all_of_them, "{refused} of {all_of_them}");
    missed
}

#[test]
fn balls_hold_the_values_of_320_bits() {
    assert_eq!(missed::<TwoWords>(|ball| ball), 0);
    assert_eq!(missed::<ThreeWords>(|ball| ball), 0);
    // Words that cancel: the first is 0, and the bounds are not.
    let small = 2.0_f64.powi(-60);
    let cancelled = FineBall::around([1.0, small, -1.0], 0.0);
    assert!(cancelled.upper() >= small && cancelled.lower() <= small, "{cancelled:?}");
    assert!(cancelled.magnitude() >= small, "{cancelled:?}");
    // A radius that is not updated, and one that is too small for a centre of a double less.
    assert!(missed(Ball::exact) > 0);
    assert!(missed(FineBall::exact) > 0);
    assert!(missed(|ball| Ball::new(ball.centre(), 0.0, ball.radius())) > 0);
    assert!(
        missed(|ball| {
            let [high, low, _] = ball.parts();
            FineBall::around([high, low, 0.0], ball.radius())
        }) > 0
    );
}

#[test]
fn three_words_enclose_to_fifteen_more_digits_than_two() {
    fn radii<C: BallCentre>() -> [f64; 6] {
        let x = BallOf::<C>::of(0.7).divided_by(BallOf::of(3.0));
        let (s, c) = x.sin_cos();
        [x, x.sqrt(), x.exp(), x.tanh(), s, c].map(BallOf::radius)
    }
    for (two, three) in radii::<TwoWords>().into_iter().zip(radii::<ThreeWords>()) {
        assert!(three < tolerances::OF_A_THIRD_WORD * two, "{three:e} against {two:e}");
    }
}

#[test]
fn what_is_no_number_is_in_no_ball() {
    let none = Ball::of(f64::NAN);
    for ball in [
        none.plus(Ball::of(1.0)),
        Ball::of(1.0).divided_by(Ball::of(0.0)),
        Ball::of(1.0).divided_by(Ball::of(1e-3).widened(1e-2)),
        Ball::of(-1.0).sqrt(),
        none.sin_cos().0,
        Ball::of(1e200).times(Ball::of(1e200)),
        Ball::of(700.0).exp(),
        Ball::of(f64::INFINITY).tanh().minus(Ball::of(f64::INFINITY)),
    ] {
        let magnitude = ball.magnitude();
        assert!(!(magnitude < f64::MAX), "{ball:?}");
    }
}

/// f(w) for a complex w from balls: sin and tanh by their formulas in real functions.
fn exact_complex(w: [Ball; 2]) -> [[Ball; 2]; 2] {
    let [x, y] = w;
    let (e, inverse) = (y.exp(), y.negated().exp());
    let (cosh, sinh) = (e.plus(inverse).scaled(0.5), e.minus(inverse).scaled(0.5));
    let (s, c) = x.sin_cos();
    let sine = [s.times(cosh), c.times(sinh)];
    let (e, inverse) = (x.scaled(2.0).exp(), x.scaled(-2.0).exp());
    let (cosh, sinh) = (e.plus(inverse).scaled(0.5), e.minus(inverse).scaled(0.5));
    let (s, c) = y.scaled(2.0).sin_cos();
    let below = cosh.plus(c);
    [sine, [sinh.divided_by(below), s.divided_by(below)]]
}

#[test]
fn taylor_models_hold_complex_values() {
    let mut stream = Stream::new(crate::suite::SEED, "taylor models");
    let (mut looked_at, mut tight) = (0, 0);
    for number in 0..300 * crate::suite::times() {
        let size = 10.0_f64.powf(stream.uniform(-3.0, -0.3));
        let mut c = [Complex::ZERO; 7];
        // Every third beside the slits of tanh, up to where it is 1.
        c[0] = if number % 3 == 0 {
            let side = if number % 2 == 0 { 1.0 } else { -1.0 };
            Complex::new(side * stream.uniform(0.8, 40.0), stream.uniform(-6.0, 6.0))
        } else {
            Complex::new(stream.uniform(-3.0, 3.0), stream.uniform(-1.2, 1.2))
        };
        for (k, c) in c.iter_mut().enumerate().skip(1) {
            let size = size.powi(k as i32);
            *c = Complex::new(size * stream.uniform(-1.0, 1.0), size * stream.uniform(-1.0, 1.0));
        }
        let model = Taylor::new(c, 0.0);
        let (sine, _) = model.sin_cos();
        let results = [sine, model.tanh(), model.times(model), model.inverse()];
        for _ in 0..4 {
            // On the circle, where they are worst.
            let (s, co) = libm::sincos(stream.uniform(0.0, 2.0 * PI));
            let place = Complex::new(s, co);
            let mut w = [Ball::of(0.0); 2];
            for c in c.iter().rev() {
                let [re, im] = w;
                w = [
                    re.scaled(s).minus(im.scaled(co)).plus(Ball::of(c.re)),
                    re.scaled(co).plus(im.scaled(s)).plus(Ball::of(c.im)),
                ];
            }
            let [sine, tanh] = exact_complex(w);
            let [re, im] = w;
            let square = [re.times(re).minus(im.times(im)), re.times(im).scaled(2.0)];
            let norm = re.times(re).plus(im.times(im));
            let inverse = [re.divided_by(norm), im.negated().divided_by(norm)];
            for (model, value) in results.iter().zip([sine, tanh, square, inverse]) {
                let near = model.evaluate(place);
                let off = [near.re - value[0].centre(), near.im - value[1].centre()];
                let off = libm::hypot(off[0], off[1]);
                // The point is on the circle to a rounding, and so is what is compared.
                let slack = 64.0 * f64::EPSILON * (1.0 + libm::hypot(near.re, near.im));
                assert!(off <= model.remainder() + slack, "{off} {model:?} {w:?}");
                looked_at += 1;
                tight += usize::from(off > tolerances::TIGHT * model.remainder());
            }
        }
    }
    // They are not merely large.
    assert!(10 * tight > looked_at, "{tight} of {looked_at}");
}

#[test]
fn a_pole_within_a_model_makes_it_unbounded() {
    let mut c = [Complex::ZERO; 7];
    (c[0], c[1]) = (Complex::new(0.1, 1.0), Complex::new(0.7, 0.0));
    assert!(Taylor::new(c, 0.0).tanh().remainder() == f64::INFINITY);
    c[1] = Complex::new(0.1, 0.0);
    assert!(Taylor::new(c, 0.0).tanh().remainder().is_finite());
    // On a slit, and beside it.
    (c[0], c[1]) = (Complex::new(0.1, 2.5), Complex::new(0.2, 0.0));
    assert!(Taylor::new(c, 0.0).tanh().remainder() == f64::INFINITY);
    c[0].re = 0.5;
    assert!(Taylor::new(c, 0.0).tanh().remainder().is_finite());
}

/// γ is below k|kω − m| for so many k.
fn is_below_all(omega: &NobleNumber, gamma: f64) -> bool {
    let value = omega.value().centre();
    (1..20_000).all(|k| {
        let turns = k as f64 * value;
        // Rounding of k·ω is k·10⁻¹⁶.
        let off = (turns - turns.round()).abs() + k as f64 * f64::EPSILON;
        gamma <= k as f64 * off
    })
}

#[test]
fn rotation_numbers_are_as_far_from_fractions_as_they_say() {
    for text in
        ["golden", "[0; 7, (1)]", "[0; 1, 2, 5, (1)]", "0.6853", "0.60", "[0; 1, 1, 30, 2, (1)]"]
    {
        let omega: NobleNumber = text.parse().expect(text);
        let gamma = omega.gamma();
        assert!(is_below_all(&omega, gamma), "{text}: {gamma}");
        assert!(!is_below_all(&omega, 2.0 * gamma), "{text}: {gamma}");
        let again: NobleNumber = omega.to_string().parse().expect("as it is written");
        assert_eq!(again, omega);
    }
    let golden: NobleNumber = "golden".parse().expect("golden");
    let value = 0.5 * (5.0_f64.sqrt() - 1.0);
    assert!((golden.value().centre() - value).abs() <= f64::EPSILON);
    for (text, why) in [
        ("2/3", "rational"),
        ("[0; 1, 2]", "rational"),
        ("[0; 2, (2)]", "the only period"),
        ("1.618", "whole turns"),
        ("0", "whole turns"),
        ("nan", "whole turns"),
        ("[1; (1)]", "continued fraction"),
        ("[0; 0, (1)]", "quotient"),
        ("", "continued fraction"),
    ] {
        let found = text.parse::<NobleNumber>().expect_err(text).to_string();
        assert!(found.contains(why), "{text}: {found}");
    }
}

#[test]
fn small_divisors_are_bounded() {
    for text in ["golden", "[0; 1, 2, 5, (1)]", "[0; 7, (1)]"] {
        let omega: NobleNumber = text.parse().expect(text);
        let (divisors, value) = (Divisors::new(&omega), omega.value().centre());
        for delta in [0.1, 0.01, 0.001] {
            let bound = divisors.bound(delta);
            let scaling = divisors.scaling_bound(delta);
            assert!(bound <= scaling);
            let formula = 1.0 / (96f64.sqrt() * divisors.gamma() * delta);
            assert!(
                (scaling / formula - 1.0).abs() < tolerances::OF_BOUNDS,
                "{text} {delta}: {scaling} {formula}"
            );
            // The literal sum, and |ξ| of the η whose modes are all as large as they may be at one point.
            let mut sum = 0.0;
            for k in 1..40_000 {
                let s = libm::sin(PI * libm::remainder(k as f64 * value, 1.0));
                sum += libm::exp(-4.0 * PI * k as f64 * delta) / (4.0 * s * s);
            }
            let literal = 2.0 * f64::sqrt(sum);
            assert!(
                bound >= literal && bound <= tolerances::OF_DIVISORS * literal,
                "{text} {delta}: {bound} {literal}"
            );
        }
    }
}

/// The standard map p += (K/2π) sin 2πx, x += p.
fn standard_map(k: f64) -> PlaneMap {
    let shear = |target, factor, slope| PlaneStep::Shear {
        target,
        factor,
        reflect: false,
        shift: 0.0,
        slope,
    };
    PlaneMap {
        steps: vec![
            shear(Half::Momentum, k / (2.0 * PI), Slope::Sine),
            shear(Half::Position, 1.0, Slope::Linear(1.0)),
        ],
        cylinder: true,
    }
}

/// Without a kick, orbits of the standard map turn by p a map.
#[test]
fn orbits_turn_as_far_as_they_are_found_to() {
    let map = standard_map(0.0);
    for p in [0.1, 0.31, -0.44] {
        let turns = turns_of_orbit(&map, [0.0; 2], [0.2, p]);
        assert!((turns - p).abs() < tolerances::OF_TURNS, "{turns} {p}");
    }
    let omega: NobleNumber = "[0; 2, (1)]".parse().expect("a number");
    let ray = Ray { from: [0.25, 0.0], to: [0.25, 0.5] };
    let place = place_on_ray(&map, ray, &omega).expect("between 0 and a half");
    let apart = (place[1] - omega.value().centre()).abs();
    assert!(place[0] == 0.25 && apart < tolerances::OF_TURNS, "{place:?}");
}

/// What a ball says of itself, but for rounding outwards.
#[test]
fn balls_say_their_centre_and_bounds() {
    let ball = Ball::new(3.0, 0.0, 0.25);
    assert_eq!((ball.centre(), ball.radius()), (3.0, 0.25));
    for (ball, sign) in [(ball, 1.0), (ball.negated(), -1.0)] {
        for (bound, exact) in [
            (ball.magnitude(), 3.25),
            (ball.mignitude(), 2.75),
            (ball.lower(), 3.0 * sign - 0.25),
            (ball.upper(), 3.0 * sign + 0.25),
        ] {
            assert!((bound - exact).abs() < tolerances::OF_BOUNDS, "{bound} {exact}");
        }
    }
    let wider = ball.widened(0.5).radius();
    assert!(ball.exact().radius() == 0.0 && (wider - 0.75).abs() < tolerances::OF_BOUNDS);

    // Moduli of a number, and of a linear model with a remainder.
    let w = Complex::new(3.0, -4.0);
    let mut c = [Complex::ZERO; 7];
    (c[0], c[1]) = (w, Complex::new(0.3, 0.4));
    let model = Taylor::new(c, 0.25);
    let fine = ([3.0, 0.25, 0.0], 0.0);
    let constant = Constant { high: 3.0, low: -0.25, radius: 0.5, fine };
    for (above, exact) in [(w.above(), 5.0), (model.above(), 5.75), (constant.off(), 0.75)] {
        assert!(above >= exact && above - exact < tolerances::OF_BOUNDS, "{above} {exact}");
    }
    for (below, exact) in [(w.below(), 5.0), (model.below(), 4.25)] {
        assert!(below <= exact && exact - below < tolerances::OF_BOUNDS, "{below} {exact}");
    }
    assert_eq!(model.remainder(), 0.25);
}

/// The golden circle of the standard map for one K after another, by continuation from none.
struct GoldenCircle {
    omega: NobleNumber,
    k: f64,
    modes: Vec<[[f64; 2]; 4]>,
}

impl GoldenCircle {
    fn new() -> Self {
        let omega: NobleNumber = "golden".parse().expect("a number");
        let mut modes = vec![[[0.0; 2]; 4]];
        modes[0][2][0] = omega.value().centre();
        Self { omega, k: 0.0, modes }
    }

    /// Candidates for a larger K.
    fn continued(&mut self, k: f64) -> Result<Vec<Candidate>, gyroceptron::Error> {
        loop {
            self.k = if self.k + 0.2 < k { self.k + 0.2 } else { k };
            let found = candidates_near(&standard_map(self.k), &self.modes, &self.omega)?;
            self.modes.clone_from(&found[0].modes);
            if self.k == k {
                return Ok(found);
            }
        }
    }
}

#[test]
fn golden_circles_of_the_standard_map_are_proved_below_the_critical_one() {
    let mut circle = GoldenCircle::new();
    for k in [0.5, 0.8, 0.9, 0.95] {
        let found = circle.continued(k).expect("a curve");
        let map = standard_map(k);
        let proved = found.iter().find_map(|candidate| {
            let constants = candidate.prove(&map).expect("symplectic").ok()?;
            Some((candidate, constants))
        });
        let Some((candidate, constants)) = proved else { panic!("K = {k}") };
        // Two doubles do for all but the last.
        assert_eq!(constants.words, if k == 0.95 { 3 } else { 2 }, "K = {k}");
        // Near the critical value numbers see that areas shrink by 1e-12.
        if k == 0.9 {
            let mut shrinking = map.clone();
            let excess = -1e-12;
            shrinking.steps.push(PlaneStep::Scaling { target: Half::Momentum, excess });
            assert!(candidate.prove_by_numbers(&shrinking).is_err());
        }
    }
    // Greene's critical value is 0.971635….
    match circle.continued(0.98) {
        Err(_) => {}
        Ok(found) => {
            let map = standard_map(0.98);
            assert!(
                found.iter().all(|candidate| candidate.prove(&map).expect("symplectic").is_err())
            );
        }
    }
}

/// A neuron that is 1 all along a circle has poles where it crosses 0, not beside the circle.
#[test]
fn neurons_without_effect_do_not_narrow_the_strip() {
    let map = PlaneMap::of_model(&model(0.01, 3)).expect("of one degree of freedom");
    let neuron = |bias: f64| {
        let slope = Slope::Tanh { neurons: vec![[80.0, bias, 0.01]], linear: 0.0 };
        let target = Half::Momentum;
        let mut with = map.clone();
        with.steps.push(PlaneStep::Shear {
            target,
            factor: 1.0,
            reflect: false,
            shift: 0.0,
            slope,
        });
        with
    };
    let circle = proved(&map).remove(0);
    let strip = |map: &PlaneMap| {
        let found = candidates_near(map, &circle.candidate.modes, &circle.candidate.omega);
        found.ok().and_then(|found| {
            let proves = |candidate: &&Candidate| candidate.prove(map).expect("symplectic").is_ok();
            found.iter().find(proves).map(|candidate| candidate.rho_hat)
        })
    };
    let plain = strip(&map).expect("proved before");
    let beside = strip(&neuron(400.0)).expect("as good as without it");
    assert!(beside > tolerances::AS_WIDE * plain, "{beside} {plain}");
    // Such an argument goes beyond ½π in the strip, which alone is no reason to refuse it.
    assert!(80.0 * circle.constants.tangent * beside > FRAC_PI_2);
    let across = strip(&neuron(0.0));
    let narrow = |across: f64| across < tolerances::NARROWED * plain;
    assert!(across.is_none_or(narrow), "{across:?} {plain}");
}

#[test]
fn there_is_no_circle_in_an_island() {
    // At K = 0.9 the island of the fixed point reaches to p = ±0.3: orbits with turns near 0 go around it.
    let omega: NobleNumber = "[0; 40, (1)]".parse().expect("a number");
    let ray = Ray { from: [0.5, 0.0], to: [0.5, 0.5] };
    let verdict = prove_circle(&standard_map(0.9), ray, &omega).expect("symplectic");
    assert!(!matches!(verdict, Verdict::Proved(_)), "{verdict:?}");
}

/// A nearly integrable map of a plane that turns by about a third.
fn model(epsilon: f64, seed: u64) -> Model {
    let shape = NormalFormShape {
        action: TorusAction::from(CircleAction::new([1])),
        psi: Vec::new(),
        kicks: vec![3; 2],
        twists: vec![4],
        turned_twists: Vec::new(),
        flow_time: 1.0,
        perturbation: Some(vec![3; 3]),
    };
    let weights = InitialWeights::Normal { scale: 0.6 };
    shape.architecture(epsilon).initialise(weights, 2.3, seed).expect("a network")
}

const RAY: Ray = Ray { from: [0.0; 2], to: [1.2, 0.0] };

fn proved(map: &PlaneMap) -> Vec<Circle> {
    let fixed = fixed_point_near(map, [0.0; 2]).expect("a fixed point");
    let ray = Ray { from: fixed, ..RAY };
    let verdicts = noble_numbers(map, ray, 2).into_iter().map(|omega| {
        let verdict = prove_circle(map, ray, &omega).expect("symplectic");
        match verdict {
            Verdict::Proved(circle) => *circle,
            other => panic!("{omega}: {other:?}"),
        }
    });
    verdicts.collect()
}

#[test]
fn circles_of_a_network_are_proved_and_nested_and_what_is_wrong_is_refused() {
    let map = PlaneMap::of_model(&model(0.01, 3)).expect("of one degree of freedom");
    let mut circles = proved(&map);
    circles.sort_by(|a, b| a.area().total_cmp(&b.area()));
    let [inner, outer] = &circles[..] else { panic!("{} circles", circles.len()) };
    assert_eq!(outer.encloses(inner), Ok(()));
    assert!(inner.encloses(outer).is_err() && inner.encloses(inner).is_err());
    let fixed = fixed_point_near(&map, [0.0; 2]).expect("a fixed point");
    let point = FixedPoint::prove(&map, fixed).expect("a proof");
    assert_eq!(point.is_elliptic(), Some(true));
    assert!(FixedPoint::prove(&map, [0.3, 0.2]).is_none());

    for circle in [inner, outer] {
        let points = circle.points(1 << 14);
        let ahead = points.chunks(2).cycle().skip(1);
        let twice: f64 = points.chunks(2).zip(ahead).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum();
        let area = 0.5 * twice.abs();
        let share = circle.area() / area - 1.0;
        assert!(share.abs() < tolerances::OF_POLYGON, "{} {area}", circle.area());
    }
    // What a step in doubles is off by is bounded, and by no more than it is where it is off by far more than rounding.
    let start = [outer.points(1)[0], outer.points(1)[1]];
    let mut image = start;
    map.prepared().apply(&mut image);
    let rounding = rounding_of_a_step(&map, start, image);
    assert!(rounding > 0.0 && rounding < tolerances::OF_A_STEP, "{rounding:e}");
    let moved = rounding_of_a_step(&map, start, [image[0] + 3e-4, image[1] - 4e-4]);
    assert!((moved / 5e-4 - 1.0).abs() < tolerances::OF_A_DISTANCE, "{moved:e}");

    // The orbit of a point of the curve stays by the proved circle.
    let (mut z, candidate) = ([outer.points(1)[0], outer.points(1)[1]], &outer.candidate);
    let turns = candidate.omega.value().centre();
    let count = 1 << 10;
    let curve = outer.points(count);
    for n in 1..200 {
        map.prepared().apply(&mut z);
        let place = (n as f64 * turns).rem_euclid(1.0) * count as f64;
        let near = place.round() as usize % count;
        let apart = libm::hypot(curve[2 * near] - z[0], curve[2 * near + 1] - z[1]);
        // Half the distance of neighbouring points, at most.
        assert!(apart <= outer.constants.tangent / count as f64, "{n}: {apart}");
    }

    let refused = |name: &str, candidate: &Candidate, map: &PlaneMap| {
        refused_by("", name, candidate, map);
    };
    assert!(candidate.prove_by_numbers(&map).is_ok());
    // A coefficient that is off.
    let mut off = candidate.clone();
    off.modes[2][0][0] += 1e-6;
    refused_by("(6)", "a coefficient off by 1e-6", &off, &map);
    let failure = off.prove(&map).expect("symplectic").expect_err("a coefficient off by 1e-6");
    assert_eq!(failure.strip, Some(off.rho));
    // A strip across a pole.
    let across = Candidate { rho_hat: 0.7, ..candidate.clone() };
    refused_by("(1)", "a strip across a pole", &across, &map);
    // Another rotation number.
    let other = Candidate { omega: inner.candidate.omega.clone(), ..candidate.clone() };
    refused("another rotation number", &other, &map);
    // So few points that what is above their modes is seen by the bound of aliasing alone.
    let truncated = candidate.modes[..candidate.modes.len() / 4].to_vec();
    let coarse = Candidate { modes: truncated, ..candidate.clone() };
    refused("a quarter of the modes", &coarse, &map);

    // Areas that shrink, by the numbers, and whatever the numbers by the kind of step.
    for excess in [1e-6, 1e-9, 1e-12, 1e-15] {
        let mut shrinking = map.clone();
        shrinking.steps.push(PlaneStep::Scaling { target: Half::Momentum, excess: -excess });
        let found = candidate.prove(&shrinking).expect_err("a kind of step").to_string();
        assert!(found.contains("not symplectic"), "{found}");
        assert!(prove_circle(&shrinking, RAY, &candidate.omega).is_err());
        if excess > tolerances::SMALLEST_DISSIPATION {
            let ray = Ray { from: fixed, ..RAY };
            if let Ok(found) = candidates(&shrinking, ray, &candidate.omega) {
                for candidate in &found {
                    refused("areas that shrink", candidate, &shrinking);
                }
            }
        }
    }
}

/// That it fails, and by which inequality.
fn refused_by(number: &str, name: &str, candidate: &Candidate, map: &PlaneMap) {
    let found: Result<_, Failure> = candidate.prove_by_numbers(map);
    let failed = found.as_ref().is_err_and(|failure| failure.inequality.starts_with(number));
    assert!(failed, "{name}: {found:?}");
}

/// A circle of this radius around a point, its modes at `harmonic`.
fn round(centre: [f64; 2], radius: f64, harmonic: usize, omega: &NobleNumber) -> Candidate {
    let mut modes = vec![[[0.0; 2]; 4]; harmonic + 1];
    (modes[0][0][0], modes[0][2][0]) = (centre[0], centre[1]);
    // Clockwise: (cos 2πkφ, −sin 2πkφ).
    (modes[harmonic][0][0], modes[harmonic][3][0]) = (0.5 * radius, 0.5 * radius);
    let (omega, cylinder) = (omega.clone(), false);
    Candidate { omega, modes, rho: 0.02, rho_hat: 0.1, points: 128, cylinder }
}

fn twist(weight: i32, by: f64) -> PlaneStep {
    PlaneStep::Twist { factor: 1.0, weight, slope: Slope::Linear(by) }
}

/// p ← p + c of all points.
fn shift(factor: f64) -> PlaneStep {
    let (target, slope) = (Half::Momentum, Slope::Constant(1.0));
    PlaneStep::Shear { target, factor, reflect: false, shift: 0.0, slope }
}

#[test]
fn each_inequality_refuses_what_it_is_about() {
    let omega: NobleNumber = "golden".parse().expect("golden");
    // A rigid turn by ω, to a rounding of the angle: all circles are there, and none has torsion.
    let angle = omega.value().scaled(2.0 * PI).centre();
    let turn = PlaneStep::Turn { angle, weight: 1 };
    let rigid = PlaneMap { steps: vec![turn.clone()], cylinder: false };
    let circle = round([0.0; 2], 0.5, 1, &omega);
    refused_by("(5)", "no torsion", &circle, &rigid);
    // The same circle where the turn depends on the radius, and is by ω at this one.
    let (action, by) = (0.125, 0.5);
    let turn = PlaneStep::Turn { angle: angle - action * by, weight: 1 };
    let map = PlaneMap { steps: vec![turn, twist(1, by)], cylinder: false };
    let constants = circle.prove(&map).expect("symplectic").expect("proved");
    let whole = Circle { candidate: circle.clone(), constants };
    assert_eq!(whole.goes_around([0.1, 0.2], 0.0), Ok(()));
    let number = |found: Result<(), Failure>| found.expect_err("refused").number();
    assert_eq!(number(whole.goes_around([0.5, 0.0], 0.0)), "(9)");
    assert_eq!(number(whole.goes_around([0.1, 0.2], 0.4)), "(9)");
    assert_eq!(number(whole.goes_around([0.7, 0.2], 0.0)), "(10)");
    // A point in place of a curve, and a curve with a cusp within the strip.
    refused_by("(3)", "a point", &round([0.0; 2], 0.0, 1, &omega), &map);
    let mut cusp = circle.clone();
    cusp.modes.push([[0.12, 0.0], [0.0; 2], [0.0; 2], [0.12, 0.0]]);
    refused_by("(3)", "a cusp", &cusp, &map);
    // The circle passed twice is no circle of this rotation number.
    let mut twice = round([0.0; 2], 0.5, 2, &omega);
    let half = omega.value().scaled(4.0 * PI).centre();
    let turn = PlaneStep::Turn { angle: half - action * by, weight: 1 };
    let doubled = PlaneMap { steps: vec![turn, twist(1, by)], cylinder: false };
    assert!(twice.prove_by_numbers(&doubled).is_ok());
    let found = twice.prove(&doubled).expect("symplectic").expect_err("twice around");
    assert_eq!(found.number(), "(10)");
    twice.omega = "[0; 2, (1)]".parse().expect("a number");
    refused_by("(6)", "another rotation number", &twice, &doubled);
    // An error for which the steps converge, and go farther than the constants hold.
    let mut shifted = map.clone();
    shifted.steps.push(shift(1e-11));
    refused_by("(7)", "a shift by more than the room", &circle, &shifted);
    // Numbers that are none.
    for step in [shift(f64::NAN), shift(f64::INFINITY), twist(1, f64::NAN)] {
        let mut broken = map.clone();
        broken.steps.push(step);
        refused_by("", "no numbers", &circle, &broken);
    }
    let mut none = circle.clone();
    none.modes[1][0][0] = f64::NAN;
    assert!(none.prove(&map).is_err());
    none.modes[1][0] = [1.0, 1.0];
    assert!(none.prove(&map).is_err());
    assert!(Candidate { rho: 0.2, ..circle.clone() }.prove(&map).is_err());
    assert!(Candidate { points: 100, ..circle.clone() }.prove(&map).is_err());
    assert!(Candidate { cylinder: true, ..circle }.prove(&map).is_err());
}

#[test]
fn aliasing_is_bounded() {
    // A curve with few points: the coefficients that its points see are all but exact, those beyond are not seen.
    let map = PlaneMap::of_model(&model(0.01, 3)).expect("of one degree of freedom");
    let candidate = proved(&map).remove(0).candidate;
    let modes = candidate.modes[..12].to_vec();
    let coarse = Candidate { modes: modes.clone(), points: 64, ..candidate.clone() };
    let fine = Candidate { modes, points: 512, ..candidate };
    let [coarse, fine] = [coarse, fine].map(|candidate| residual_and_aliasing(&candidate, &map));
    // More points see what few cannot: the bound with aliasing holds it, the coefficients alone do not.
    assert!(coarse[0] >= fine[0] - fine[1], "{coarse:?} {fine:?}");
    assert!(coarse[0] - coarse[1] < fine[0] - fine[1], "{coarse:?} {fine:?}");
}

fn residual_and_aliasing(candidate: &Candidate, map: &PlaneMap) -> [f64; 2] {
    candidate.residual_bounds(map).expect("bounded")
}

/// The evaluator against the maps of the crate, with random weights.
#[test]
fn maps_of_a_proof_are_the_maps_of_models() {
    let mut kinds = 0;
    for (number, text) in NETWORKS.iter().enumerate() {
        let spec: NetworkSpec = serde_json::from_str(text).expect(text);
        let architecture =
            spec.architecture(&TorusAction::from(CircleAction::new([2])), 0.1, 0.7).expect(text);
        let weights = InitialWeights::Normal { scale: 0.4 };
        let model = architecture.initialise(weights, 0.9, number as u64).expect(text);
        let map = PlaneMap::of_model(&model).expect(text);
        assert!(map.check_symplectic().is_ok());
        let (exact, literal) = (model.lift::<DoubleDouble>(), map.prepared());
        let inner = exact.in_conjugated_coordinates();
        let mut stream = Stream::new(crate::suite::SEED, text);
        for _ in 0..8 {
            let start = [stream.uniform(-0.9, 0.9), stream.uniform(-0.9, 0.9)];
            let mut doubled = start.map(DoubleDouble::from_f64);
            inner.forward(&mut doubled);
            let mut balls = start.map(Ball::of);
            literal.apply(&mut balls);
            let mut z = start;
            literal.apply(&mut z);
            let mut fine = start.map(FineBall::of);
            literal.apply(&mut fine);
            let jets = [0, 1].map(|axis| Jet::<Ball, false>::start(Ball::of(start[axis]), axis));
            let mut jets = jets;
            literal.apply(&mut jets);
            for k in 0..2 {
                let (high, low) = doubled[k].parts();
                let apart = balls[k].minus(Ball::new(high, low, 0.0)).exact().magnitude();
                assert!(apart < tolerances::OF_TWO_DOUBLES, "{text}: {apart}");
                assert!((z[k] - high).abs() < tolerances::OF_A_MAP, "{text}: {}", z[k] - high);
                assert!(balls[k].radius() < tolerances::OF_TWO_DOUBLES, "{text}: {:?}", balls[k]);
                // The middle of what three words enclose is in the ball of two.
                assert!(holds(balls[k], &wide(fine[k])), "{text}: {:?} {:?}", balls[k], fine[k]);
                assert!(fine[k].radius() < tolerances::OF_THREE_DOUBLES, "{text}: {:?}", fine[k]);
            }
            let [a, b] = [jets[0].first, jets[1].first];
            let determinant = a[0].times(b[1]).minus(a[1].times(b[0])).minus(Ball::of(1.0));
            assert!(
                determinant.magnitude() < tolerances::OF_TWO_DOUBLES,
                "{text}: {determinant:?}"
            );
        }
        kinds += 1;
    }
    assert_eq!(kinds, NETWORKS.len());
}

const NETWORKS: [&str; 6] = [
    r#"{"kind": "gyroceptron", "psi": {"count": 2, "width": 3}, "near_identity": {"count": 2, "width": 3}}"#,
    r#"{"kind": "henon-net", "layers": {"count": 2, "width": 3}}"#,
    r#"{"kind": "symp-net", "layers": {"count": 2, "width": 3}}"#,
    r#"{"kind": "normal-form", "kicks": {"count": 3, "width": 4}, "twists": {"count": 1, "width": 5}, "perturbation": {"count": 2, "width": 3}}"#,
    r#"{"kind": "normal-form", "radius": 1.0, "kicks": {"count": 3, "width": 1, "degree": 6}, "twists": {"count": 1, "width": 1, "degree": 4}, "perturbation": {"count": 2, "width": 1, "degree": 5}}"#,
    r#"{"kind": "normal-form", "kicks": {"count": 2, "width": 4}, "twists": {"count": 1, "width": 5}, "perturbation": {"count": 2, "width": 3}, "reversor": "momenta"}"#,
];

#[test]
fn maps_that_no_theorem_is_about_are_refused() {
    let spec: NetworkSpec = serde_json::from_str(NETWORKS[0]).expect("a network");
    let two = spec
        .architecture(&TorusAction::from(CircleAction::new([1, 0])), 0.1, 1.0)
        .expect("a network");
    let two = two.initialise(InitialWeights::Glorot, 1.0, 1).expect("weights");
    let found = PlaneMap::of_model(&two).expect_err("two degrees of freedom").to_string();
    assert!(found.contains("one degree of freedom"), "{found}");
    let once =
        PlaneMap { steps: vec![PlaneStep::Reflection(Reversor::Momenta.half())], cylinder: false };
    assert!(once.check_symplectic().is_err());
    let drift = PlaneStep::Shear {
        target: Half::Momentum,
        factor: 1e-3,
        reflect: false,
        shift: 0.0,
        slope: Slope::Constant(1.0),
    };
    let map = PlaneMap { steps: vec![drift], cylinder: true };
    assert!(map.check_symplectic().expect_err("a flux").to_string().contains("not exact"));
}
