//! What measures give, by the definitions in their documentation: ratios of errors to their bounds,
//! of steps whose matrices and errors are chosen, and what is reported of orbits.

use faer::Mat;
use gyroceptron::flow::Pairs;
use gyroceptron::layer::{CircleAction, Kick, NeuronPotential, TorusAction};
use gyroceptron::measure::internals::{monomials, power, powers};
use gyroceptron::measure::{
    Coordinate, Measurable, NearlyPeriodic, NormalFormed,
    adiabatic::{AdiabaticOrbit, OwnInvariance, PlaneSwing, log_slope},
    certificate::{CertificateOptions, Tally, Verdict, certify},
    fuzz, jacobian, laws,
    ratios::{
        Adjoint, CircleAxiom, Conditioned, RESOLVED, RoundingPropagation, action_ratio,
        adjoint_ratio, circle_axiom_ratio, conjugated_axiom_ratio, determinant_ratio,
        differing_components, equivariance_ratio, inversion_ratio, near_identity_inversion,
        near_identity_rms, near_identity_size, symplecticity_ratio, symplecticity_scale,
        turning_axiom_ratio,
    },
    steps::{KickStep, Magnitudes, MeasuredStep, MeasuredSteps, turn_steps},
};
use gyroceptron::network::{GyroceptronShape, InitialWeights, Model};
use gyroceptron::phase::{Direction, Half, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Dual, Scalar, Tracked, max_or_nan};
use std::f64::consts::{SQRT_2, TAU};

const U: f64 = f64::EPSILON / 2.0;

/// z ← Az of one degree of freedom, with the scales of its errors.
#[derive(Clone, Copy, Debug)]
struct Linear {
    matrix: [f64; 4],
    /// Of the running Jacobian.
    e: [f64; 4],
    delta: [f64; 2],
}

impl Linear {
    fn exact(matrix: [f64; 4]) -> Self {
        Self { matrix, e: [0.0; 4], delta: [0.0; 2] }
    }

    fn run<S: Scalar>(&self, z: &mut [S]) {
        let [a, b, c, d] = self.matrix.map(S::from_f64);
        (z[0], z[1]) = (a * z[0] + b * z[1], c * z[0] + d * z[1]);
    }
}

impl MeasuredStep for Linear {
    fn apply(&self, z: &mut [f64]) {
        self.run(z);
    }
    fn apply_tangent(&self, z: &mut [Dual<f64, 8>]) {
        self.run(z);
    }
    fn jacobian_magnitude(&self, _: &[f64], _: &[f64], _: &[f64], e: &mut [f64]) {
        e.copy_from_slice(&self.e);
    }
    fn value_magnitude(&self, _: &[f64], _: &[f64], delta: &mut [f64]) {
        delta.copy_from_slice(&self.delta);
    }
    fn curvature_magnitude(&self, _: &[f64], _: &[f64], out: &mut [f64]) {
        out.fill(0.0);
    }
}

/// Steps there, and steps back.
#[derive(Clone, Debug, Default)]
struct Chain {
    there: Vec<Linear>,
    back: Vec<Linear>,
}

impl Chain {
    fn of(matrix: [f64; 4]) -> Self {
        let [a, b, c, d] = matrix;
        let determinant = a * d - b * c;
        let inverse = [d, -b, -c, a].map(|entry| entry / determinant);
        Self { there: vec![Linear::exact(matrix)], back: vec![Linear::exact(inverse)] }
    }
}

impl Map<f64> for Chain {
    fn dof(&self) -> usize {
        1
    }
    fn forward(&self, z: &mut [f64]) {
        self.there.iter().for_each(|step| step.run(z));
    }
    fn inverse(&self, z: &mut [f64]) {
        self.back.iter().for_each(|step| step.run(z));
    }
}

impl Measurable for Chain {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        let steps = match direction {
            Direction::Forward => &self.there,
            Direction::Inverse => &self.back,
        };
        steps.iter().map(|step| Box::new(*step) as Box<dyn MeasuredStep>).collect()
    }
}

fn boxed(steps: &[Linear]) -> MeasuredSteps<'_> {
    steps.iter().map(|step| Box::new(*step) as Box<dyn MeasuredStep>).collect()
}

#[track_caller]
fn close(found: f64, expected: f64, share: f64) {
    assert!((found - expected).abs() <= share * expected.abs(), "{found:e} for {expected:e}");
}

fn ratio(of: Conditioned) -> f64 {
    match of {
        Conditioned::Ratio(ratio) => ratio,
        Conditioned::IllConditioned => panic!("ill-conditioned"),
    }
}

fn product(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [
        a[0] * b[0] + a[1] * b[2],
        a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2],
        a[2] * b[1] + a[3] * b[3],
    ]
}

/// |a|ᵀ|Ω||b|.
fn form(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    let [a, b] = [a, b].map(|m| m.map(f64::abs));
    product([a[0], a[2], a[1], a[3]], [b[2], b[3], b[0], b[1]])
}

fn two_steps(beside: f64) -> [Linear; 2] {
    [
        Linear { matrix: [2.0, 1.0, 1.0, 1.0], e: [1.0, 2.0, 3.0, 5.0], delta: [3.0, 5.0] },
        Linear {
            matrix: [1.0, 0.0, 3.0, 1.0 + beside],
            e: [0.5, 4.0, 0.0, 2.5],
            delta: [7.0, 0.0],
        },
    ]
}

#[test]
fn bounds_of_a_walk_are_the_errors_of_its_steps_carried_to_an_end() {
    let steps = two_steps(0.0);
    let boxed = boxed(&steps);
    let propagation = RoundingPropagation::new(&boxed, &[1.0, 2.0]);
    assert_eq!((propagation.dim(), propagation.end()), (2, &[4.0, 15.0][..]));
    assert_eq!(propagation.jacobian(), faer::mat![[2.0, 1.0], [7.0, 4.0]].as_ref());
    // Behind the first step there is the second, behind that nothing.
    let (squares, sums) = propagation.value_scales();
    for (found, expected) in squares.iter().zip([58.0_f64, 196.0]) {
        close(*found, expected.sqrt(), 1e-14);
    }
    for (found, expected) in sums.iter().zip([10.0, 14.0]) {
        close(*found, expected, 1e-14);
    }
    // J₁⁻¹ = (1, −1; −1, 2) and J₂⁻¹ = (4, −1; −7, 2).
    let (squares, sums) = propagation.return_scales(2);
    for (found, expected) in squares.iter().zip([8.0_f64.hypot(28.0), 13.0_f64.hypot(49.0)]) {
        close(*found, SQRT_2 * expected, 1e-14);
    }
    for (found, expected) in sums.iter().zip([2.0 * 36.0, 2.0 * 62.0]) {
        close(*found, expected, 1e-14);
    }
    let (_, sums) = propagation.return_scales(1);
    close(sums[0], 2.0 * 8.0, 1e-14);
}

#[test]
fn defects_are_measured_in_units_of_their_scale() {
    let beside = 1e-9;
    let steps = two_steps(beside);
    let boxed = boxed(&steps);
    let propagation = RoundingPropagation::new(&boxed, &[1.0, 2.0]);
    let jacobians = [steps[0].matrix, product(steps[1].matrix, steps[0].matrix)];
    let mut squares = [1.0; 4];
    for (jacobian, step) in jacobians.iter().zip(&steps) {
        let (there, back) = (form(*jacobian, step.e), form(step.e, *jacobian));
        for k in 0..4 {
            squares[k] += (there[k] + back[k]).powi(2);
        }
    }
    let forming = form(jacobians[1], jacobians[1]);
    let scale: [f64; 4] = std::array::from_fn(|k| (squares[k] + forming[k].powi(2)).sqrt());
    let found = symplecticity_scale(&propagation);
    for k in 0..4 {
        close(found[(k / 2, k % 2)], scale[k], 1e-8);
    }
    // JᵀΩJ = det J·Ω in a plane.
    close(symplecticity_ratio(&propagation), beside / (U * scale[1]), 1e-6);
    // The rounding of the decomposition, 2n|J|², and of J.
    let norm: f64 = jacobians[1].iter().map(|entry| entry * entry).sum();
    let [[a, b, c, d], [k, l, m, n]] = [[1.0, 1.0, 1.0, 2.0], [4.0, 1.0, 7.0, 2.0]];
    let trace = |[a, b, c, d]: [f64; 4], e: [f64; 4]| a * e[0] + b * e[2] + c * e[1] + d * e[3];
    let of_jacobian = trace([a, b, c, d], steps[0].e) + trace([k, l, m, n], steps[1].e);
    let bound = U * (2.0 * norm + of_jacobian + 1.0);
    close(ratio(determinant_ratio(&propagation)), beside / bound, 1e-6);
}

/// A tenth of 1 leaves no digit of a determinant, a tenth of |z| none of a way back.
#[test]
fn bounds_that_leave_no_digit_are_reported() {
    for (share, said) in [(0.995, false), (1.005, true)] {
        // 2|J|² + 1 = 0.1/u.
        let stretch = (0.05 * share / U).sqrt();
        let step = [Linear::exact([stretch, 0.0, 0.0, 1.0 / stretch])];
        let found = determinant_ratio(&RoundingPropagation::new(&boxed(&step), &[1.0, 1.0]));
        assert_eq!(found == Conditioned::IllConditioned, said, "{share}: {found:?}");
        // Twice the error there is the reach of the way there and back.
        let there =
            Linear { delta: [0.0, 0.05 * share / U], ..Linear::exact([1.0, 0.0, 0.0, 1.0]) };
        let back = Linear::exact([1.0, 0.0, 0.0, 1.0]);
        let found = inversion_ratio(boxed(&[there]), boxed(&[back]), &[1.0, 1.0]);
        assert_eq!(found == Conditioned::IllConditioned, said, "{share}: {found:?}");
    }
}

#[test]
fn a_way_back_is_measured_by_the_errors_of_the_way_there() {
    // p comes back with 1e-9 of itself more.
    let there = Linear { delta: [3.0, 4.0], ..Linear::exact([2.0, 0.0, 0.0, 0.5]) };
    let back = Linear::exact([0.5, 0.0, 0.0, 2.0 * (1.0 + 1e-9)]);
    let found = inversion_ratio(boxed(&[there]), boxed(&[back]), &[3.0, 5.0]);
    let bound = U * (SQRT_2 * 2.0 * 4.0_f64).hypot(5.0);
    close(ratio(found), 5e-9 / bound, 1e-6);
    // A component that is 0, and which nothing rounds, has the rounding of an error.
    let there = Linear { delta: [0.0, 8.0], ..Linear::exact([1.0, 0.0, 0.0, 1.0]) };
    let back = Linear::exact([1.0, 1e-28, 0.0, 1.0]);
    let found = inversion_ratio(boxed(&[there]), boxed(&[back]), &[0.0, 1.0]);
    close(ratio(found), 1e-28 / (U * U * 2.0 * 8.0), 1e-6);
}

/// A map in normal form whose chart is the identity.
struct Form(Chain);

impl Map<f64> for Form {
    fn dof(&self) -> usize {
        1
    }
    fn forward(&self, z: &mut [f64]) {
        self.0.forward(z);
    }
    fn inverse(&self, z: &mut [f64]) {
        self.0.inverse(z);
    }
}

impl Measurable for Form {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        self.0.measured_steps(direction)
    }
}

impl NormalFormed for Form {
    fn chart(&self) -> Box<dyn Measurable + '_> {
        Box::new(Chain::default())
    }
    fn inner_map(&self) -> Box<dyn Measurable + '_> {
        Box::new(self.0.clone())
    }
    fn action(&self) -> TorusAction {
        CircleAction::new([1]).into()
    }
}

#[test]
fn a_map_that_does_not_commute_is_measured_by_both_ways() {
    let mut chain = Chain::of([2.0, 0.0, 0.0, 2.0 + 1e-9]);
    chain.there[0].delta = [30.0, 40.0];
    let form = Form(chain.clone());
    let (angle, z) = (0.7, [3.0, 4.0]);
    let turn = form.action().turn_by(&[angle]);
    let turned = turn_steps(&turn, Direction::Forward);
    let of_turn = RoundingPropagation::new(&turned, &z);
    let moved = [2.0 * z[0], (2.0 + 1e-9) * z[1]];
    let after = RoundingPropagation::new(&turned, &moved);
    let (sine, cosine) = angle.sin_cos();
    // Both turn by the same; the map stretches p by 1e-9 more.
    let error = [1e-9 * sine * z[1], 1e-9 * sine * z[0]];
    let (first, last) = (of_turn.value_scales().0, after.value_scales().0);
    let delta = chain.there[0].delta;
    let mut largest = 0.0_f64;
    for k in 0..2 {
        // The turn, then the map: and the map, then the turn.
        let before = (2.0 * first[k]).hypot(delta[k]);
        let own = if k == 0 {
            cosine.abs() * delta[0] + sine.abs() * delta[1]
        } else {
            sine.abs() * delta[0] + cosine.abs() * delta[1]
        };
        let behind = last[k].hypot(own);
        // The coefficients of one turn before the map, and of three behind it.
        let of_turns = 4.0 * 2.0 * 5.0 + 3.0 * 4.0 * 10.0;
        let bound = U * (z[k].hypot(before).hypot(behind) + of_turns);
        largest = max_or_nan(largest, error[k] / bound);
    }
    close(ratio(equivariance_ratio(&form, &[angle], &z)), largest, 1e-3);
}

/// ψ, and a circle action that slips.
struct Family {
    psi: Chain,
    slip: f64,
    delta: [f64; 2],
}

impl Family {
    fn turned(&self, angle: f64) -> Chain {
        let (sine, cosine) = (angle + self.slip).sin_cos();
        let turn = [cosine, sine, -sine, cosine];
        let matrix = product(product(self.psi.there[0].matrix, turn), self.psi.back[0].matrix);
        let mut chain = Chain::of(matrix);
        chain.there[0].delta = self.delta;
        chain
    }
}

impl Map<f64> for Family {
    fn dof(&self) -> usize {
        1
    }
    fn forward(&self, _: &mut [f64]) {}
    fn inverse(&self, _: &mut [f64]) {}
}

impl Measurable for Family {
    fn measured_steps(&self, _: Direction) -> MeasuredSteps<'_> {
        Vec::new()
    }
}

impl NearlyPeriodic for Family {
    fn map_at(&self, _: f64) -> Box<dyn Measurable + '_> {
        Box::new(Chain::default())
    }
    fn near_identity_at(&self, _: f64) -> Box<dyn Measurable + '_> {
        Box::new(Chain::default())
    }
    fn conjugation(&self) -> Box<dyn Measurable + '_> {
        Box::new(self.psi.clone())
    }
    fn action_weights(&self) -> Vec<i32> {
        vec![1]
    }
    fn turn(&self, theta: f64, z: &mut [f64]) {
        CircleAction::new([1]).turn_by(theta).apply(z, false);
    }
    fn conjugated_action_at(&self, theta: f64) -> Box<dyn Measurable + '_> {
        Box::new(self.turned(theta))
    }
    fn angle(&self) -> f64 {
        0.0
    }
    fn epsilon(&self) -> f64 {
        0.0
    }
}

#[test]
fn axioms_are_measured_in_units_of_the_radius() {
    let z = [3.0, 4.0, 0.0, 0.0];
    // Whatever the angle is, q₁ gets more by 1e-9.
    let more = |_: f64, z: &mut [f64]| z[0] += 1e-9;
    let (a, b) = (0.3, -1.1);
    let found = turning_axiom_ratio(&[2, 0], more, CircleAxiom::Inverse(a), &[3.0, 0.0, 4.0, 0.0]);
    close(found, 2e-9 / (U * 4.0 * 5.0), 1e-6);
    let sum = CircleAxiom::Additivity(a, b);
    let found = turning_axiom_ratio(&[2, 0], more, sum, &[3.0, 0.0, 4.0, 0.0]);
    close(found, 1e-9 / (U * (4.0 + 2.0 * 0.8) * 5.0), 1e-5);
    // In proportion to the angle, by 2π·1e-9 more after a whole turn.
    let along = |angle: f64, z: &mut [f64]| z[0] += 1e-9 * angle;
    let angle = 0.1 - TAU;
    let found = turning_axiom_ratio(&[2, 0], along, CircleAxiom::Periodicity(angle), &z);
    close(found, 1e-9 * TAU / (U * (4.0 + 2.0 * (2.2 + 0.1)) * 3.0), 1e-5);
    // What is to be the identity has no bound.
    let found = turning_axiom_ratio(&[2, 0], more, CircleAxiom::Identity, &z);
    assert_eq!(found, f64::INFINITY);
    // Of an action itself it is the same of its turns, which rounding alone moves.
    let action = CircleAction::new([2, 1]);
    let own = |angle: f64, z: &mut [f64]| action.turn_by(angle).apply(z, false);
    let mut largest = 0.0;
    for axiom in [CircleAxiom::Periodicity(angle), sum, CircleAxiom::Inverse(a)] {
        let z = [3.1, 4.2, 0.7, -1.3];
        let found = circle_axiom_ratio(&action, axiom, &z);
        assert_eq!(found, turning_axiom_ratio(&[2, 1], own, axiom, &z), "{axiom:?}");
        assert!(found < 1.0, "{axiom:?}: {found}");
        largest = max_or_nan(largest, found);
    }
    assert!(largest > 0.0, "nothing is rounded");

    let family = Family { psi: Chain::of([2.0, 0.0, 0.0, 0.5]), slip: 1e-9, delta: [6.0, 8.0] };
    let z = [4.0, 0.5];
    let found = conjugated_axiom_ratio(&family, CircleAxiom::Inverse(a), &z);
    // w = ψ⁻¹z = (2, 1) turns by 2e-9 to (2 + 2e-9, 1 − 4e-9).
    let error = [2.0 * 2e-9, 0.5 * 4e-9];
    let back = family.turned(-a).there[0].matrix.map(f64::abs);
    let mut largest = 0.0_f64;
    for k in 0..2 {
        let first = back[2 * k] * family.delta[0] + back[2 * k + 1] * family.delta[1];
        let carried = [2.0, 0.5][k] * 4.0 * 5.0_f64.sqrt();
        let bound = U * (z[k].hypot(first.hypot(family.delta[k])) + carried);
        largest = max_or_nan(largest, error[k] / bound);
    }
    close(ratio(found), largest, 1e-5);
}

#[test]
fn actions_are_measured_by_the_rounding_of_a_step() {
    let grown = 1.0 + 1e-9;
    let inner = Chain::of([grown, 0.0, 0.0, grown]);
    let found = action_ratio(&inner, &[CircleAction::new([3])], 16, &[3.0, 4.0]);
    // 𝔍 = ½·3·25 grows by the square of the growth, 16 times over.
    let change = 0.5 * 3.0 * 25.0 * 2.0 * 16.0 * 1e-9;
    close(found, change / (U * 12.0 * 4.0 * 3.0 * 25.0), 1e-5);
}

/// z ← az with a pullback that is off by a share, and a slope with a bound that is chosen.
struct Scaled {
    off: f64,
    bound: Option<f64>,
}

impl Adjoint for Scaled {
    fn parameters(&self) -> Vec<f64> {
        vec![1.5]
    }
    fn tangent(&self, parameters: &[Dual<Tracked, 1>], z: &mut [Dual<Tracked, 1>]) {
        for z in z {
            *z = parameters[0] * *z;
            if let Some(bound) = self.bound {
                z.eps[0] = Tracked { value: 1.0, bound };
            }
        }
    }
    fn cotangent(
        &self,
        parameters: &[Tracked],
        z: &[Tracked],
        z_bar: &mut [Tracked],
        parameters_bar: &mut [Tracked],
    ) {
        for (z_bar, z) in z_bar.iter_mut().zip(z) {
            parameters_bar[0] += *z_bar * *z * Tracked::exact(1.0 + self.off);
            *z_bar *= parameters[0];
        }
    }
}

#[test]
fn a_pullback_is_measured_by_the_bounds_of_both_sums() {
    let (z, direction, cotangent) = ([3.0, 4.0], [0.5, 0.25, 2.0], [1.0, 0.5]);
    let map = Scaled { off: 1e-9, bound: None };
    let found = adjoint_ratio(&map, &z, &direction, &cotangent);
    let exact = Tracked::exact;
    // ⟨c, a·dz + da·z⟩ with the bounds that numbers carry by themselves.
    let dual = |value, slope| Dual { re: exact(value), eps: [exact(slope)] };
    let slope = |k: usize| (dual(1.5, 2.0) * dual(z[k], direction[k])).eps[0];
    let left = exact(0.0) + slope(0) * exact(cotangent[0]);
    let left = left + slope(1) * exact(cotangent[1]);
    let bar = |k: usize| exact(cotangent[k]) * exact(1.5) * exact(direction[k]);
    let of_parameter = exact(0.0)
        + exact(cotangent[0]) * exact(z[0]) * exact(1.0 + 1e-9)
        + exact(cotangent[1]) * exact(z[1]) * exact(1.0 + 1e-9);
    let right = exact(0.0) + bar(0) + bar(1) + of_parameter * exact(2.0);
    // What is off: 1e-9 of (1·3 + ½·4)·2.
    close(ratio(found), 1e-8 / (left.error() + right.error()), 1e-6);
    // A bound of a hundred-thousandth of the largest term, here 1.5·1, is a test, a larger one is none.
    for (share, said) in [(0.995, false), (1.005, true)] {
        let map = Scaled { off: 0.0, bound: Some(share * RESOLVED * 1.5 / U) };
        let found = adjoint_ratio(&map, &[0.0, 0.0], &[1.0, 0.0, 0.0], &[1.0, 0.0]);
        assert_eq!(found == Conditioned::IllConditioned, said, "{share}: {found:?}");
    }
}

#[test]
fn changes_of_points_are_their_definitions() {
    let map = Chain::of([1.0, 0.5, 0.0, 1.0]);
    // q changes by p/2: by 3 and by 4.
    let points = [1.0, 6.0, 2.0, -8.0];
    assert_eq!(near_identity_size(&map, &points), 4.0);
    assert_eq!(near_identity_rms(&map, &points), 2.5);
    let other = Chain::of([1.0, -0.25, 0.0, 1.0]);
    assert_eq!(near_identity_inversion(&map, &other, &points), 2.0);
    assert_eq!(differing_components(&map, &points[..2]), 1);
    assert_eq!(differing_components(&map, &[1.0, 0.0]), 0);
}

/// Over duals too.
struct ElementaryMap;

impl<S: Scalar> Map<S> for ElementaryMap {
    fn dof(&self) -> usize {
        1
    }
    fn forward(&self, z: &mut [S]) {
        z[0] = S::from_f64(2.0) * z[0] + S::from_f64(3.0) * z[1];
        z[1] = S::from_f64(0.5) * z[1];
    }
    fn inverse(&self, z: &mut [S]) {
        z[1] = S::from_f64(2.0) * z[1];
        z[0] = S::from_f64(0.5) * (z[0] - S::from_f64(3.0) * z[1]);
    }
}

#[test]
fn the_jacobian_of_a_linear_map_is_its_matrix() {
    let expected: Mat<f64> = faer::mat![[2.0, 3.0], [0.0, 0.5]];
    assert_eq!(jacobian(&ElementaryMap, &[0.3, 0.7]), expected);
}

#[test]
fn coordinates_are_of_their_ranges() {
    assert_eq!(Coordinate::Any.range(1.6), (-1.6, 1.6));
    assert_eq!(Coordinate::Between(-3.0, 5.0).range(1.6), (-3.0, 5.0));
    assert_eq!(Coordinate::Angle(TAU).range(1.6), (0.0, TAU));
    assert_eq!(Coordinate::Angle(4.0).difference(7.5), -0.5);
    assert_eq!(Coordinate::Angle(4.0).difference(1.5), 1.5);
    assert_eq!(Coordinate::Any.difference(7.5), 7.5);
}

#[test]
fn bytes_are_the_numbers_that_they_say() {
    let number = |bytes: &[u8]| {
        let mut bytes = bytes.iter().copied().chain(std::iter::repeat(0));
        let mut fill = |out: &mut [u8]| out.iter_mut().for_each(|o| *o = bytes.next().unwrap_or(0));
        fuzz::number(&mut fill)
    };
    let [low, high] = (-5000_i16).to_le_bytes();
    assert_eq!(number(&[3, low, high]), -5000.0 / 4096.0);
    assert_eq!(number(&[12, low, high, 7]), -5000.0 / 256.0);
    assert_eq!(number(&[5, 17]), 1e16);
    assert_eq!(number(&[6, 200]), -56.0 / 16.0);
    let bits = 0.1_f64.to_le_bytes();
    assert_eq!(number(&[&[7], &bits[..]].concat()), 0.1);
    // Into the box, as on a circle: −5000/4096 is 0.7793 of a box of width 2 from −1.
    let bytes = [0, low, high, 6, 8];
    assert_eq!(fuzz::point(&Chain::default(), 1.0, &bytes), [2.0 - 5000.0 / 4096.0, 0.5]);
}

fn tally(values: impl IntoIterator<Item = f64>) -> Tally {
    Tally::of_ratios("law", "equation").extend(values.into_iter().map(Conditioned::Ratio))
}

#[test]
fn a_row_has_the_order_statistics_of_its_results() {
    let mut tally = Tally::with_limit("law", "equation", 50.0);
    for value in [0.0, 7.0, 3.0, 11.0, 2.0, 5.0, 13.0, 17.0, 19.0, 23.0, 29.0] {
        tally.push_at(Conditioned::Ratio(value), &[value, -value]);
    }
    tally.push_at(Conditioned::IllConditioned, &[0.0, 1.0]);
    let row = tally.row();
    assert_eq!((row.samples, row.ill_conditioned, row.limit), (12, 1, 50.0));
    assert_eq!((row.smallest, row.median, row.largest), (Some(0.0), Some(11.0), Some(29.0)));
    // Of the ten that are not 0, the largest tenth begins here.
    assert_eq!(row.deviation, Some(29.0));
    assert_eq!(row.worst, Some(vec![29.0, -29.0]));
    close(row.headroom().expect("deviated"), 50.0 / 29.0, 1e-15);
    assert_eq!(self::tally([2.0, 4.0]).row().smallest, Some(2.0));
}

#[test]
fn verdicts_change_at_their_limits() {
    use Verdict::{Holds, IllConditioned, Vacuous, Violated};
    let verdict = |tally: Tally| tally.row().verdict;
    let largest = |value: f64| {
        verdict(Tally::with_limit("law", "=", 5.0).extend([Conditioned::Ratio(value)]))
    };
    assert_eq!([4.98, 5.02].map(largest), [Holds, Violated]);
    assert_eq!([0.00995, 0.01005].map(|value| verdict(tally([value]))), [Vacuous, Holds]);
    assert_eq!([1.99, 2.01].map(|value| verdict(tally([value]))), [Holds, Violated]);
    // The upper decile of twenty is the nineteenth.
    let decile = |value: f64| {
        let others = (0..18).map(|_| 0.02);
        verdict(tally(others.chain([value, 1.0])).must_show_errors())
    };
    assert_eq!([0.04975, 0.05025].map(decile), [Vacuous, Holds]);
    let testable = |count: usize| {
        let mut tally = tally((0..count).map(|_| 0.3));
        (count..200).for_each(|_| tally.push(Conditioned::IllConditioned));
        verdict(tally)
    };
    assert_eq!([99, 100].map(testable), [IllConditioned, Holds]);
    // Bounds of 1e-13 of the terms do where no errors show: √(1 + (4·error)² + 1) units of u off
    // the diagonal of JᵀΩJ.
    let resolved = |share: f64| {
        let error = ((share * 1e-13 / U).powi(2) - 2.0).sqrt() / 2.0;
        let mut map = Chain::of([1.0, 0.0, 0.0, 1.0]);
        map.there[0].e = [error; 4];
        verdict(laws::symplecticity_of_any(&map, &[0.3, 0.7]))
    };
    assert_eq!([0.995, 1.005].map(resolved), [Holds, Vacuous]);
}

/// One neuron in a plane, V(y) = w tanh(Wy + b), kicked by c∇V(−q) into p.
#[test]
fn magnitudes_of_a_kick_are_their_formulas() {
    let (inner, bias, outer, scale): (f64, f64, f64, f64) = (1.5, -0.4, 2.0, -0.3);
    let weights = [inner, bias, outer];
    let potential = NeuronPotential::<f64>::new(1, 1, &weights);
    let y = -0.7;
    let t = (inner * y + bias).tanh();
    let slope = 1.0 - t * t;
    let hessian = 2.0 * t.abs() * slope * outer * inner * inner;
    let reach = inner * f64::abs(y) + f64::abs(bias);
    let gradient = inner * outer * (slope + 2.0 * t.abs() * slope * reach);
    let spread = 1e-3;
    let distance = inner * spread;
    let nearest = (inner * y + bias).abs() - 100.0 * distance;
    let tail = (8.0 * (-2.0 * nearest).exp()).min(1.0);
    let curvature = inner * outer * tail * (distance * distance);
    let mut out = [0.0];
    potential.hessian_magnitude(&[y], &mut out);
    close(out[0], hessian, 1e-13);
    potential.gradient_magnitude(&[y], &mut out);
    close(out[0], gradient, 1e-13);
    potential.curvature_magnitude(&[y], &[spread], &mut out);
    close(out[0], curvature, 1e-13);

    let step = KickStep {
        kick: Kick { potential, scale, reflect: true, shift: None, target: Half::Momentum },
    };
    let (z, after) = ([0.7, 0.2], [0.7, -1.1]);
    let (before, behind) = ([3.0, -5.0, 7.0, 11.0], [3.0, -5.0, -2.0, 13.0]);
    let mut e = [1.0; 4];
    step.jacobian_magnitude(&z, &before, &behind, &mut e);
    assert_eq!(e[..2], [0.0, 0.0]);
    close(e[2], scale.abs() * hessian * 3.0 + 2.0, 1e-13);
    close(e[3], scale.abs() * hessian * 5.0 + 13.0, 1e-13);
    let mut delta = [1.0; 2];
    step.value_magnitude(&z, &after, &mut delta);
    assert_eq!(delta[0], 0.0);
    close(delta[1], scale.abs() * gradient + 1.1, 1e-13);
    step.curvature_magnitude(&z, &[spread, 9.0], &mut delta);
    assert_eq!(delta[0], 0.0);
    close(delta[1], scale.abs() * curvature, 1e-13);
}

#[test]
fn magnitudes_of_a_turn_are_those_of_its_shears() {
    let turn = CircleAction::new([1]).turn_by(0.5);
    // Quarter turns first, and then q ← q + tp.
    let step = &turn_steps(&turn, Direction::Forward)[1];
    let mut moved = [0.0, 1.0];
    step.apply(&mut moved);
    let t = moved[0].abs();
    assert!(t > 0.1, "{t}");
    let (z, after) = ([0.3, -4.0], [0.8, -4.0]);
    let mut delta = [1.0; 2];
    step.value_magnitude(&z, &after, &mut delta);
    assert_eq!(delta[1], 0.0);
    close(delta[0], t * 4.0 + 0.8, 1e-14);
    let mut e = [1.0; 4];
    step.jacobian_magnitude(&z, &[1.0, 2.0, 3.0, -5.0], &[7.0, -8.0, 3.0, -5.0], &mut e);
    assert_eq!(e[2..], [0.0, 0.0]);
    close(e[0], t * 3.0 + 7.0, 1e-14);
    close(e[1], t * 5.0 + 8.0, 1e-14);
}

fn gyroceptron(theta: f64) -> Model {
    GyroceptronShape {
        circle_action: CircleAction::new([1, 0]),
        psi: vec![4; 3],
        near_identity: vec![3; 3],
    }
    .architecture(0.01)
    .initialise(InitialWeights::Normal { scale: 0.4 }, theta, 3)
    .expect("valid")
}

/// Step by step, in plain loops.
#[test]
fn an_orbit_tells_its_drifts_and_horizons() {
    let model = gyroceptron(0.7);
    let (action, map) = (CircleAction::new([1, 0]), model.in_conjugated_coordinates());
    let (z, factors) = ([0.9, -0.3, 0.4, 0.6], [0.7, 1.0, 1.2, 1.5]);
    let mut orbit = AdiabaticOrbit::new(&model, &z, &factors).expect("one circle");
    orbit.advance(&map, &action, 1500);
    let mut w = z.to_vec();
    model.psi().inverse(&mut w);
    let initial = action.invariant(&w);
    // ⌊10 + 0.01^(−1/4)⌋ = 13 steps settle it.
    let (mut largest, mut settled) = (0.0_f64, 0.0);
    let (mut horizons, mut drifts) = ([None; 4], Vec::new());
    for step in 1..=1500_u64 {
        map.forward(&mut w);
        let drift = (action.invariant(&w) - initial).abs();
        largest = max_or_nan(largest, drift);
        if step <= 13 {
            settled = largest;
        } else {
            for (horizon, factor) in horizons.iter_mut().zip(factors) {
                if horizon.is_none() && drift > factor * settled && drift >= largest {
                    *horizon = Some(step);
                }
            }
        }
        if [10, 100, 1000].contains(&step) {
            drifts.push((step, largest));
        }
    }
    assert_eq!((orbit.steps(), orbit.initial()), (1500, initial));
    assert_eq!((orbit.largest(), orbit.drifts()), (largest, &drifts[..]));
    assert_eq!(orbit.horizons(), horizons);
    assert!(horizons[1].is_some(), "{horizons:?}");
    // Just below the largest drift of the orbit, and just above.
    for (share, passed) in [(0.995, true), (1.005, false)] {
        let factor = [share * largest / settled];
        let mut orbit = AdiabaticOrbit::new(&model, &z, &factor).expect("one circle");
        orbit.advance(&map, &action, 1500);
        assert_eq!(orbit.horizons()[0].is_some(), passed, "{share}");
    }
}

#[test]
fn the_invariance_of_a_network_is_the_median_over_its_orbits() {
    let model = gyroceptron(0.7);
    let starts = [0.9, -0.3, 0.4, 0.6, -0.2, 0.8, 1.1, 0.1, 0.5, 0.5, -0.7, -0.4];
    let own = model.invariant().expect("one");
    let iterations = 160;
    let (mut drifts, mut exponents) = (Vec::new(), Vec::new());
    for start in starts.chunks_exact(4) {
        let (mut z, mut largest) = (start.to_vec(), 0.0_f64);
        let (mut at, mut along) = (Vec::new(), Vec::new());
        for step in 1..=iterations {
            model.forward(&mut z);
            largest = max_or_nan(largest, (own(&z) - own(start)).abs());
            // The last four octaves.
            if [10, 20, 40, 80, 160].contains(&step) {
                at.push(f64::from(step));
                along.push(largest);
            }
        }
        drifts.push(largest / own(start).abs());
        exponents.push(log_slope(&at, &along));
    }
    let median = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[1]
    };
    let found = OwnInvariance::measure(&model, &starts, iterations as usize).expect("an invariant");
    close(found.drift, median(&mut drifts), 1e-12);
    close(found.exponent, median(&mut exponents), 1e-12);
    assert_eq!(found.iterations, 160);
    let moved = near_identity_rms(&model.near_identity(), &starts) / 0.01;
    close(found.moved.expect("I_ε"), moved, 1e-14);
    // A resonance is reported within 2ε.
    for (share, said) in [(0.995, true), (1.005, false)] {
        let model = gyroceptron(TAU / 5.0 + 0.02 * share);
        let found = OwnInvariance::measure(&model, &starts, 20).expect("an invariant");
        assert_eq!(found.resonance.is_some(), said, "{share}");
    }
    // A tenth is of no use; a power of 0.3 is a drift where it is more than a hundredth.
    let fault = |drift: f64, exponent: f64| {
        OwnInvariance { drift, exponent, resonance: None, ..found.clone() }.fault().is_some()
    };
    assert_eq!([0.0995, 0.1005].map(|drift| fault(drift, 0.0)), [false, true]);
    assert_eq!([0.2985, 0.3015].map(|exponent| fault(0.05, exponent)), [false, true]);
    assert_eq!([0.00995, 0.01005].map(|drift| fault(drift, 1.0)), [false, true]);
}

#[test]
fn swings_are_of_the_actions_by_definition() {
    let mut stream = Stream::new(5, "swings");
    let mut draw =
        |count: usize| -> Vec<f64> { (0..count).map(|_| stream.uniform(0.5, 1.5)).collect() };
    let (input, output, states) = (draw(160), draw(160), draw(2 * 3 * 20));
    let pairs = Pairs::new("pairs", 1, input.clone(), output.clone()).expect("whole");
    let action: TorusAction = CircleAction::new([1]).into();
    let own = |z: &[f64]| 0.5 * (z[0] * z[0] + z[1] * z[1]);
    let of = |values: &[f64]| -> Vec<f64> { values.chunks_exact(2).map(own).collect() };
    let width = |values: &[f64]| {
        let largest = values.iter().copied().fold(0.0, max_or_nan);
        largest + values.iter().map(|v| -v).fold(f64::NEG_INFINITY, max_or_nan)
    };
    let (before, after) = (of(&input), of(&output));
    let squares: f64 = before.iter().zip(&after).map(|(a, b)| (b - a) * (b - a)).sum();
    let range = width(&[before, after].concat());
    let along = of(&states);
    let orbit = |m: usize| width(&along.iter().copied().skip(m).step_by(3).collect::<Vec<_>>());
    let mut swings = [0, 1, 2].map(orbit);
    swings.sort_by(f64::total_cmp);
    // Of three harmonics the third is the slowest, of four the fourth would be.
    let angle = TAU / 4.0 + 0.1;
    let found = PlaneSwing::measure(&[&pairs], &action, &[angle], &states, 3)[0];
    close(found.step, (squares / 80.0).sqrt(), 1e-13);
    close(found.range, range, 1e-13);
    close(found.swing, swings[1], 1e-13);
    assert_eq!(found.beyond, swings.iter().filter(|swing| **swing > range).count());
    close(found.allowed.expect("said"), 6.0 / (1.5 * angle).sin().abs(), 1e-12);
    close(found.steps(), found.swing / found.step, 1e-14);
    // Too wide beyond what is allowed, where it is more than a twentieth of the range.
    let wide = |swing: f64, range: f64| {
        PlaneSwing { step: 1.0, range, swing, beyond: 0, allowed: Some(2.0) }.is_too_wide()
    };
    assert_eq!([1.99, 2.01].map(|swing| wide(swing, 1.0)), [false, true]);
    assert_eq!([0.995, 1.005].map(|share| wide(3.0 * share, 60.0)), [false, true]);
    // A range is at least a hundredth of the largest action.
    let still = Pairs::new("pairs", 1, vec![1.0; 80], vec![1.0; 80]).expect("whole");
    close(PlaneSwing::measure(&[&still], &action, &[angle], &states, 3)[0].range, 0.01, 1e-13);
    assert_eq!((monomials(3, 2), monomials(4, 4)), (10, 70));
    assert_eq!(powers(&[2.0, 3.0], 2), [1.0, 2.0, 3.0, 4.0, 6.0, 9.0]);
    assert_eq!(power(1.0, 2.0, 3), (-11.0, -2.0));
}

#[test]
fn the_largest_ratio_is_of_the_rows_with_a_rounding_scale() {
    assert_eq!(
        CertificateOptions::default(),
        CertificateOptions { samples: 200, radius: 1.6, seed: 0 }
    );
    let options = CertificateOptions { samples: 20, radius: 1.5, seed: 4 };
    let certificate = certify(&gyroceptron(0.7), options);
    let rows = certificate.rows.iter().filter(|row| row.limit == 10.0);
    let ratios = rows.filter(|row| row.verdict != Verdict::Reported).filter_map(|row| row.largest);
    assert_eq!(certificate.largest_ratio(), Some(ratios.fold(0.0, max_or_nan)));
    // Points in the box, angles within two turns, of these streams.
    let mut stream = Stream::new(4, "certificate/points/0");
    let points: Vec<f64> = (0..80).map(|_| stream.uniform(-1.5, 1.5)).collect();
    assert_eq!(laws::Samples::draw(2, 0, options).points(), points);
}
