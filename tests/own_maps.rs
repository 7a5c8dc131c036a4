//! Six maps that the crate does not know, certified: each holds, and each that goes wrong
//! by a billionth or a trillionth is distinguished from it. `wrong` is 0 in the right ones.

/// The target for `cargo fuzz`, which is no dependency of the suite, as a function: what `libfuzzer_sys` makes of it.
#[macro_export]
macro_rules! fuzz_target {
    (|$data:ident: &[u8]| $body:block) => {
        pub fn target($data: &[u8]) $body
    };
}

#[allow(unused_attributes)]
#[path = "../fuzz/targets/own_map.rs"]
mod own_map;

use gyroceptron::measure::{
    Coordinate, Implicit, Measurable, OneStep, Solved, Steps, WithDomain,
    certificate::{Certificate, CertificateOptions, Verdict, certify_map},
    fuzz,
};
use gyroceptron::phase::Map;
use gyroceptron::random::Stream;
use gyroceptron::scalar::{
    DoubleDouble, Dual, Elementary, Real, Scalar, Tracked, constant as c, max_or_nan,
};
use std::f64::consts::TAU;

/// p ← p + K sin q, q ← q + p, on the line or, with a period, on the torus.
struct StandardMap {
    strength: f64,
    period: Option<f64>,
    wrong: f64,
}

impl StandardMap {
    fn wrapped<S: Elementary>(&self, x: S) -> S {
        self.period.map_or(x, |period| x.rem_euclid(period))
    }
}

impl<S: Elementary> Map<S> for StandardMap {
    fn dof(&self) -> usize {
        1
    }
    fn forward(&self, z: &mut [S]) {
        z[1] = self.wrapped(z[1] * c(1.0 + self.wrong) + z[0].sin_cos().0 * c(self.strength));
        z[0] = self.wrapped(z[0] + z[1]);
    }
    fn inverse(&self, z: &mut [S]) {
        z[0] = self.wrapped(z[0] - z[1]);
        z[1] = self.wrapped(z[1] - z[0].sin_cos().0 * c(self.strength));
    }
}

/// Froeschlé's: two standard maps, coupled by sin(q₁ + q₂); its inverse is not given.
struct Froeschle {
    wrong: f64,
}

impl<S: Elementary> Map<S> for Froeschle {
    fn dof(&self) -> usize {
        2
    }
    fn forward(&self, z: &mut [S]) {
        let both = (z[0] + z[1]).sin_cos().0 * c(0.3);
        z[2] += z[0].sin_cos().0 * c(0.7) + both;
        z[3] += z[1].sin_cos().0 * c(0.9) + both * c(1.0 + self.wrong);
        z[0] += z[2];
        z[1] += z[3];
    }
    fn has_inverse(&self) -> bool {
        false
    }
}

/// A step of Störmer and Verlet for H = ½|p|² + ½|q|² + q₁²q₂ − q₂³/3 (Hénon and Heiles).
#[derive(Clone)]
struct Verlet {
    step: f64,
    wrong: f64,
}

impl Verlet {
    fn kick<S: Elementary>(&self, z: &mut [S], step: f64) {
        let (x, y) = (z[0], z[1]);
        z[2] -= (x + x * y * c(2.0)) * c(step);
        z[3] -= (y + x.powi(2) - y.powi(2) + x * c(self.wrong)) * c(step);
    }
    fn go<S: Elementary>(&self, z: &mut [S], step: f64) {
        self.kick(z, 0.5 * step);
        for i in 0..2 {
            z[i] += z[2 + i] * c(step);
        }
        self.kick(z, 0.5 * step);
    }
}

impl<S: Elementary> Map<S> for Verlet {
    fn dof(&self) -> usize {
        2
    }
    fn forward(&self, z: &mut [S]) {
        self.go(z, self.step);
    }
    fn inverse(&self, z: &mut [S]) {
        self.go(z, -self.step);
    }
}

/// The implicit midpoint for Kepler's problem, H = ½|p|² − 1/|q|.
struct Midpoint {
    step: f64,
    wrong: f64,
}

impl Implicit for Midpoint {
    fn dof(&self) -> usize {
        2
    }
    fn residual<S: Elementary>(&self, z: &[S], next: &[S], out: &mut [S]) {
        let m: Vec<S> = z.iter().zip(next).map(|(a, b)| (*a + *b) * c(0.5)).collect();
        let cube = (m[0] * m[0] + m[1] * m[1]).powf(1.5);
        for i in 0..2 {
            out[i] = next[i] - z[i] - m[2 + i] * c(self.step);
            let force = -m[i] / cube - m[2 + i] * c(self.wrong);
            out[2 + i] = next[2 + i] - z[2 + i] - force * c(self.step);
        }
    }
}

/// Two stages of Gauss and Legendre for three particles of Toda's ring,
/// H = ½|p|² + Σ exp(qᵢ − qᵢ₊₁).
struct GaussLegendre {
    step: f64,
    wrong: f64,
}

impl GaussLegendre {
    fn field<S: Elementary>(&self, z: &[S], out: &mut [S]) {
        let bond = |i: usize| (z[i % 3] - z[(i + 1) % 3]).exp();
        for i in 0..3 {
            out[i] = z[3 + i];
            out[3 + i] = bond(i + 2) - bond(i) - z[3 + i] * c(self.wrong);
        }
    }
}

impl Implicit for GaussLegendre {
    fn dof(&self) -> usize {
        3
    }
    fn unknowns(&self) -> usize {
        12
    }
    fn residual<S: Elementary>(&self, z: &[S], stages: &[S], out: &mut [S]) {
        let root = 3.0_f64.sqrt() / 6.0;
        for (i, [a, b]) in [[0.25, 0.25 - root], [0.25 + root, 0.25]].into_iter().enumerate() {
            let at = |k: usize| z[k] + (stages[k] * c(a) + stages[6 + k] * c(b)) * c(self.step);
            let point: Vec<S> = (0..6).map(at).collect();
            let out = &mut out[6 * i..6 * i + 6];
            self.field(&point, out);
            for (out, stage) in out.iter_mut().zip(&stages[6 * i..]) {
                *out = *stage - *out;
            }
        }
    }
    fn end<S: Elementary>(&self, z: &mut [S], stages: &[S]) {
        for k in 0..6 {
            z[k] += (stages[k] + stages[6 + k]) * c(0.5 * self.step);
        }
    }
    fn guess(&self, z: &[f64], stages: &mut [f64]) {
        self.field(z, &mut stages[..6]);
        stages.copy_within(..6, 6);
    }
}

fn within<M: Measurable>(map: M, domain: Vec<Coordinate>) -> WithDomain<M> {
    WithDomain::new(map, domain).expect("a domain")
}

/// Each map, right or wrong by so much, with the radius of its samples.
fn maps(wrong: f64) -> Vec<(&'static str, Box<dyn Measurable>, f64)> {
    let standard = |period| OneStep(StandardMap { strength: 1.2, period, wrong });
    let torus = vec![Coordinate::Angle(TAU); 2];
    let near = |x: f64| Coordinate::Between(x - 0.2, x + 0.2);
    let orbit = vec![near(1.0), near(0.0), near(0.0), near(1.0)];
    let midpoint = OneStep(Solved(Midpoint { step: 0.3, wrong }));
    vec![
        ("standard map", Box::new(standard(None)), 3.0),
        ("on the torus", Box::new(within(standard(Some(TAU)), torus)), 3.0),
        ("Froeschlé", Box::new(OneStep(Froeschle { wrong })), 3.0),
        ("Verlet", Box::new(Steps::repeated(Verlet { step: 0.1, wrong }, 100)), 0.3),
        ("midpoint", Box::new(within(midpoint, orbit)), 1.0),
        ("Gauss–Legendre", Box::new(OneStep(Solved(GaussLegendre { step: 0.3, wrong }))), 1.0),
    ]
}

#[test]
fn six_maps_hold() {
    for (name, map, radius) in maps(0.0) {
        let certificate =
            certify_map(&*map, CertificateOptions { radius, samples: 100, ..Default::default() });
        println!("{name} {certificate}");
        certificate.assert_holds();
    }
}

#[test]
fn a_trillionth_is_seen() {
    for wrong in [1e-9, 1e-12] {
        for (name, map, radius) in maps(wrong) {
            let options = CertificateOptions { radius, samples: 30, ..Default::default() };
            let certificate = certify_map(&*map, options);
            let row = &certificate.rows[0];
            assert_eq!(row.verdict, Verdict::Violated, "{name} {wrong:e} {certificate}");
            let message = certificate.to_string();
            for words in ["DOES NOT HOLD", "JᵀΩJ = Ω: VIOLATED", "at z = [", "seed 0", "Try:"] {
                assert!(message.contains(words), "{name}: {words} is missing in {message}");
            }
            let point = row.worst.as_ref().expect("a worst point");
            assert!(message.contains(&format!("{:?}", point[0])), "{message}");
        }
    }
}

/// The midpoint of a pendulum with Newton's method inside, on numbers that carry bounds.
struct NewtonInside {
    iterations: usize,
}

impl<S: Real> Map<S> for NewtonInside {
    fn dof(&self) -> usize {
        1
    }
    fn forward(&self, z: &mut [S]) {
        let (h, half) = (c::<S>(0.1), c::<S>(0.5));
        let mut next = z[1];
        for _ in 0..self.iterations {
            // q′ = q + ½h(p + p′) put into the equation for p′.
            let (sin, cos) = (z[0] + h * half * half * (z[1] + next)).sin_cos();
            let defect = next - z[1] + h * sin;
            next -= defect / (c::<S>(1.0) + h * h * half * half * cos);
        }
        z[0] += h * half * (z[1] + next);
        z[1] = next;
    }
    fn has_inverse(&self) -> bool {
        false
    }
}

#[test]
fn newton_inside_the_number_type_is_not_taken_for_a_proof() {
    let map = OneStep(NewtonInside { iterations: 20 });
    let certificate = certify_map(&map, CertificateOptions::default());
    assert_eq!(certificate.rows[0].verdict, Verdict::Vacuous, "{certificate}");
    assert!(certificate.to_string().contains("solved as `Implicit`"), "{certificate}");
}

/// x² = −1 − q²: no solution.
struct Unsolvable;

impl Implicit for Unsolvable {
    fn dof(&self) -> usize {
        1
    }
    fn residual<S: Elementary>(&self, z: &[S], next: &[S], out: &mut [S]) {
        out[0] = next[0] * next[0] + z[0] * z[0] + c(1.0);
        out[1] = next[1] - z[1];
    }
}

#[test]
fn equations_without_a_solution_are_no_map() {
    let certificate = certify_map(&OneStep(Solved(Unsolvable)), CertificateOptions::default());
    assert_eq!(certificate.rows[0].verdict, Verdict::Violated);
    assert!(
        certificate.to_string().contains("a result or its bound is not finite at z = ["),
        "{certificate}"
    );
    let mut z: [f64; 2] = [0.5, 0.25];
    Solved(Unsolvable).forward(&mut z);
    assert!(z.iter().all(|v| v.is_nan()), "{z:?}");
}

#[test]
fn an_angle_that_is_not_said_to_be_one_jumps() {
    let map = OneStep(StandardMap { strength: 1.2, period: Some(TAU), wrong: 0.0 });
    let options = CertificateOptions { radius: 3.0, ..Default::default() };
    let certificate = certify_map(&map, options);
    let row = certificate.rows.iter().find(|row| row.equation == "P⁻¹∘P = Id").expect("a row");
    assert_eq!(row.verdict, Verdict::Violated);
    assert!(certificate.to_string().contains("`Coordinate::Angle`"), "{certificate}");
}

#[test]
fn laws_that_need_an_inverse_say_so() {
    let certificate =
        certify_map(&OneStep(Froeschle { wrong: 0.0 }), CertificateOptions::default());
    let without = |row: &&gyroceptron::measure::certificate::Row| {
        row.equation.contains("no inverse is given")
    };
    assert_eq!(certificate.rows.iter().filter(without).count(), 2);
    let summary = certificate.summary();
    assert!(summary.starts_with("holds: 2 laws"), "{summary}");
    assert!(summary.ends_with("2 not tested: no inverse is given"), "{summary}");
}

#[test]
#[should_panic(expected = "JᵀΩJ = Ω: VIOLATED")]
fn a_broken_map_panics_with_its_law() {
    let map = OneStep(StandardMap { strength: 1.2, period: None, wrong: 1e-9 });
    certify_map(&map, CertificateOptions::default()).assert_holds();
}

/// At rest stages are zero but for rounding: no share of them tells where Newton's method
/// stops. Points of any size have their solution, and only those.
#[test]
fn solutions_are_found_at_any_scale() {
    let ring = Solved(GaussLegendre { step: 0.3, wrong: 0.0 });
    for q in [0.0_f64, 0.1, 0.7, 1e3] {
        let mut z: [f64; 6] = [q, q, q, 0.0, 0.0, 0.0];
        ring.forward(&mut z);
        assert!(z[..3].iter().all(|v| (v - q).abs() <= 1e-15 * q), "{z:?}");
        assert!(z[3..].iter().all(|v| v.abs() <= 1e-15), "{z:?}");
    }
    for scale in [1e-8_f64, 1e-3, 1.0, 1e3, 1e8] {
        // 0.3 of the time of a radian.
        let step = 0.3 * scale * scale.sqrt();
        let kepler = Solved(Midpoint { step, wrong: 0.0 });
        let start = [scale, 0.0, 0.0, 1.0 / scale.sqrt()];
        let mut z = start;
        kepler.forward(&mut z);
        kepler.inverse(&mut z);
        for i in 0..4 {
            let size = start[3 * (i / 2)];
            assert!((z[i] - start[i]).abs() <= 1e-14 * size, "{scale:e}: {z:?}");
        }
    }
}

/// Bytes as a fuzzer makes them.
fn inputs() -> impl Iterator<Item = Vec<u8>> {
    let mut stream = Stream::new(5, "fuzz");
    (0..300).map(move |k| {
        let bytes = |_| stream.uniform(0.0, 256.0) as u8;
        (0..k % 60).map(bytes).collect()
    })
}

#[test]
fn any_bytes_are_a_point_of_ones_own_map() {
    for (name, map, radius) in maps(0.0) {
        let mut tested = 0;
        for data in inputs() {
            let z = fuzz::point(&*map, radius, &data);
            let inside = |v: &f64| v.abs() <= if name == "on the torus" { TAU } else { 3.0 };
            assert!(z.len() == 2 * map.dof() && z.iter().all(inside), "{name}: {z:?}");
            tested += usize::from(fuzz::check(&*map, radius, &data) == fuzz::Outcome::Tested);
        }
        assert!(tested > 200, "{name}: {tested} of 300");
    }
}

#[test]
fn the_target_for_a_map_of_ones_own_runs() {
    for data in inputs() {
        own_map::target(&data);
    }
}

#[test]
fn a_fuzzer_finds_what_is_broken() {
    for (name, map, radius) in maps(1e-9) {
        let found = inputs().any(|data| {
            let z = fuzz::point(&*map, radius, &data);
            fuzz::symplectic(&*map, &z, true).is_err()
        });
        assert!(found, "{name}");
    }
    let map = OneStep(StandardMap { strength: 1.2, period: None, wrong: 1e-9 });
    let reason = fuzz::inverted(&map, &[0.5, 0.25], true).expect_err("another inverse");
    assert!(reason.contains("[0.5, 0.25]"), "{reason}");
}

/// Maps whose operations are few or exact make no errors of rounding: their bounds are small
/// all the same, so that nothing is left to show.
#[test]
fn maps_of_few_operations_hold_too() {
    let options = |seed| CertificateOptions { radius: 3.0, seed, ..Default::default() };
    for seed in 0..4 {
        for strength in [0.0, 0.5, 0.97, 2.0, 5.0] {
            let map = |wrong| OneStep(StandardMap { strength, period: None, wrong });
            certify_map(&map(0.0), options(seed)).assert_holds();
            let broken = certify_map(&map(1e-12), options(seed));
            assert_eq!(broken.rows[0].verdict, Verdict::Violated, "{broken}");
            let map = OneStep(StandardMap { strength, period: Some(TAU), wrong: 0.0 });
            certify_map(&within(map, vec![Coordinate::Angle(TAU); 2]), options(seed))
                .assert_holds();
        }
    }
}

#[test]
fn circles_that_are_none_of_the_map_are_reported() {
    let options = CertificateOptions::default();
    let verdict = |certificate: &Certificate| {
        certificate.rows.iter().find(|row| row.law == "periodicity").expect("a row").verdict
    };
    let of = |circumference: f64| {
        let map = StandardMap { strength: 1.2, period: Some(circumference), wrong: 0.0 };
        let domain = vec![Coordinate::Angle(circumference); 2];
        certify_map(&within(OneStep(map), domain), options)
    };
    assert_eq!(verdict(&of(TAU)), Verdict::Holds);
    // sin q has another period.
    assert_eq!(verdict(&of(5.0)), Verdict::Violated);
    let map = || OneStep(StandardMap { strength: 1.2, period: None, wrong: 0.0 });
    for domain in [
        vec![Coordinate::Angle(TAU)],
        vec![Coordinate::Any; 3],
        vec![Coordinate::Any, Coordinate::Angle(0.0)],
        vec![Coordinate::Any, Coordinate::Angle(f64::NAN)],
        vec![Coordinate::Between(1.0, 1.0), Coordinate::Any],
        vec![Coordinate::Between(0.0, f64::INFINITY), Coordinate::Any],
    ] {
        assert!(WithDomain::new(map(), domain.clone()).is_err(), "{domain:?}");
    }
}

/// exp x′ = exp(q + 3): Newton's whole steps lead far away from the solution, back by 1 each.
struct Exponential;

impl Implicit for Exponential {
    fn dof(&self) -> usize {
        1
    }
    fn residual<S: Elementary>(&self, z: &[S], next: &[S], out: &mut [S]) {
        out[0] = next[0].exp() - z[0].exp() * c(3.0_f64.exp());
        out[1] = next[1] - z[1] - c(1e9);
    }
}

/// A pendulum's midpoint with a step of this length.
struct Pendulum(f64);

impl Implicit for Pendulum {
    fn dof(&self) -> usize {
        1
    }
    fn residual<S: Elementary>(&self, z: &[S], next: &[S], out: &mut [S]) {
        let (h, half) = (c::<S>(self.0), c::<S>(0.5));
        out[0] = next[0] - z[0] - h * (z[1] + next[1]) * half;
        out[1] = next[1] - z[1] + h * ((z[0] + next[0]) * half).sin_cos().0;
    }
}

#[test]
fn newton_s_method_finds_what_there_is() {
    for q in [-3.0_f64, 0.5, 4.0] {
        let mut z: [f64; 2] = [q, 0.0];
        Solved(Exponential).forward(&mut z);
        assert!((z[0] - q - 3.0).abs() <= 1e-14 * 7.0 && z[1] == 1e9, "{z:?}");
    }
    let mut z: [f64; 2] = [-2.7853233725299744, 2.75142126505878];
    let start = z;
    // So long a step that whole steps of the method run away.
    Solved(Pendulum(1.9)).forward(&mut z);
    assert!((0.5 * (z[0] + start[0]) + 0.0901884).abs() < 1e-6, "{z:?}");
}

/// What a step is bounded to err by, against the same step in double-double.
#[test]
fn bounds_of_implicit_steps_hold() {
    let mut stream = Stream::new(7, "bounds");
    let mut largest = 0.0;
    for _ in 0..200 {
        let z: Vec<f64> = (0..2).map(|_| stream.uniform(-2.0, 2.0)).collect();
        let mut tracked: Vec<Dual<Tracked, 2>> =
            (0..2).map(|i| Dual::variable(Tracked::exact(z[i]), i)).collect();
        let mut exact: Vec<Dual<DoubleDouble, 2>> =
            (0..2).map(|i| Dual::variable(DoubleDouble::from_f64(z[i]), i)).collect();
        let map = Solved(Pendulum(0.3));
        map.forward(&mut tracked);
        map.forward(&mut exact);
        for (found, exact) in tracked.iter().zip(&exact) {
            let pairs = [(found.re, exact.re), (found.eps[0], exact.eps[0])];
            for (found, exact) in pairs {
                let error = (DoubleDouble::from_f64(found.value) - exact).value().abs();
                largest = max_or_nan(largest, error / found.error());
            }
        }
    }
    assert!(largest <= 1.0, "{largest}");
    assert!(largest > 0.05, "the bound is vacuous: {largest}");
}
