//! What surrogates are compared with over many fast periods: orders, structure, and mutants of each.

use super::integrators::{assert_order, omega_defect};
use super::systems::{distance, point};
use gyroceptron::error::Error;
use gyroceptron::flow::{
    Averaged, AveragedSettings, Integrator, MicroSteps, MultiRevolution, MultiRevolutionSettings,
    Splitting, StepTable, Stroboscopic, StroboscopicSettings, TableKind, Tableau,
};
use gyroceptron::layer::CircleAction;
use gyroceptron::measure::adiabatic::log_slope;
use gyroceptron::measure::timing::root_mean_square_distance;
use gyroceptron::scalar::{DoubleDouble, Dual, Elementary, Real, Scalar, max_or_nan};
use gyroceptron::system::{
    AverageConstants, AveragePart, CellularDrift, FieldLines, FieldProfile, FullOrbit, Hamiltonian,
    NearlyPeriodic, Oscillators, ParticleField, System, ThreeOscillators, VanDerPol,
};
use std::f64::consts::TAU;

/// Eight points of two degrees of freedom.
fn points() -> Vec<f64> {
    (0..8).flat_map(|seed| point(2, seed)).collect()
}

/// What many steps of ABA(10,6,4) make of points.
fn exact(system: &System, time: f64) -> Vec<f64> {
    Integrator::Aba1064
        .trajectories(system, &points(), time, (8.0 * time).ceil() as usize, 1)
        .expect("integrates")
}

/// Of order 2 and 4 in the length of a step, beside the same periods one after another; with coefficients of infinite
/// N, or one that is off by a thousandth, they have no order.
#[test]
fn multi_revolution_compositions_have_their_orders() {
    // A little more than whole periods.
    let time = 2000.0 * TAU * (1.0 + 1e-15);
    let system = Oscillators { epsilon: 2e-4 };
    let micro = (Splitting::STRANG, 16);
    let mut exact_points = points();
    for z in exact_points.chunks_exact_mut(4) {
        Splitting::STRANG.integrate(&system, z, time, 2000 * 16);
    }
    let error = |count: usize, shares: &dyn Fn(f64) -> Vec<f64>| {
        let mut z = points();
        MultiRevolution::of_shares(&system, time, count, micro, shares)
            .take(&system, &mut z, count);
        distance(&z, &exact_points)
    };
    // N is whole for some.
    for (order, counts) in [(2, [48, 64, 96, 128, 192]), (4, [16, 20, 24, 32, 40])] {
        let sizes = counts.map(|count| 1.0 / count as f64);
        let own = |revolutions: f64| MultiRevolution::shares(order, revolutions);
        let errors = counts.map(|count| error(count, &own));
        assert!(errors[4] > 1e-10, "at the floor: {errors:?}");
        assert_order(&format!("multi-revolution, order {order}"), order as f64, &sizes, &errors);
        let of_infinite = |_: f64| MultiRevolution::shares(order, f64::INFINITY);
        let off = |revolutions: f64| {
            let mut shares = own(revolutions);
            shares[1] *= 1.001;
            shares
        };
        let mutants: [&dyn Fn(f64) -> Vec<f64>; 2] = [&of_infinite, &off];
        for (number, mutant) in mutants.into_iter().enumerate() {
            let errors = counts.map(|count| error(count, mutant));
            let slope = log_slope(&sizes, &errors);
            assert!(
                slope < order as f64 - 0.5,
                "order {order}, mutant {number}: {slope} {errors:?}"
            );
        }
    }
    // Other systems, by the name.
    let of_fourth = [16, 20, 24, 28, 32];
    let others = [
        (System::FullOrbit(FullOrbit::new(2e-4)), 8, of_fourth),
        (System::CellularDrift(CellularDrift::new(2e-4)), 8, of_fourth),
        // Its error is nearer to that of the steps within a turn.
        (System::VanDerPol(VanDerPol::new(2e-4)), 24, [8, 10, 12, 14, 16]),
    ];
    for (system, micro, of_fourth) in others {
        let exact = exact(&system, time);
        for (order, counts) in [(2, [48, 64, 96, 128, 192]), (4, of_fourth)] {
            let by = Integrator::MultiRevolution(MultiRevolutionSettings {
                micro,
                order,
                by: MicroSteps::Aba1064,
            });
            let errors = counts.map(|count| {
                let found = by.trajectories(&system, &points(), time, count, 1);
                distance(&found.expect("integrates"), &exact)
            });
            let sizes = counts.map(|count| 1.0 / count as f64);
            let what = format!("multi-revolution, order {order}, {}", system.kind());
            assert_order(&what, order as f64, &sizes, &errors);
        }
    }
}

/// The first conditions, which have closed forms, at numbers of revolutions that are whole and not.
#[test]
fn shares_add_up_to_the_revolutions() {
    for order in [2, 4] {
        for revolutions in [2.0, 3.5, 10.0, 1e4] {
            let shares = MultiRevolution::shares(order, revolutions);
            let sum: f64 = shares.iter().sum();
            let squares = shares.chunks_exact(2).map(|pair| pair[1] * pair[1] - pair[0] * pair[0]);
            let squares: f64 = squares.sum();
            assert!((sum - 1.0).abs() < 1e-13, "order {order}, N = {revolutions}: {sum}");
            let apart = (squares - 1.0 / revolutions).abs();
            assert!(apart < 1e-13, "order {order}, N = {revolutions}: {squares}");
        }
    }
}

/// Symplectic to rounding, as flows of parts are; and a step of few periods is nearly as many single ones.
#[test]
fn multi_revolution_compositions_are_symplectic() {
    let system = Oscillators { epsilon: 0.01 };
    for order in [2, 4] {
        let method = MultiRevolution::new(&system, 100.1 * TAU, 4, (Splitting::STRANG, 8), order);
        let columns: Vec<Vec<f64>> = (0..4)
            .map(|direction| {
                let lift = |(i, &v): (usize, &f64)| {
                    Dual::<f64, 1>::variable(v, usize::from(i != direction))
                };
                let mut z: Vec<_> = point(2, 3).iter().enumerate().map(lift).collect();
                method.take(&system, &mut z, 4);
                z.iter().map(|v| v.eps[0]).collect()
            })
            .collect();
        let defect = omega_defect(&columns);
        assert!(defect < 1e-12, "{defect:e}");
        // Of one period N is 1: the map of a period itself.
        let once = MultiRevolution::new(&system, TAU * (1.0 + 1e-15), 1, (Splitting::STRANG, 8), 2);
        let (mut by_composition, mut by_steps) = (point(2, 3), point(2, 3));
        once.take(&system, &mut by_composition, 1);
        Splitting::STRANG.integrate(&system, &mut by_steps, TAU, 8);
        assert!(distance(&by_composition, &by_steps) < 1e-14);
    }
}

/// Kicks at equal distances average by the trapezoidal rule: each more gains a factor.
#[test]
fn equidistant_kicks_average_exponentially() {
    let time = 200.3 * TAU;
    let system = System::Oscillators(Oscillators { epsilon: 1e-4 });
    let exact = exact(&system, time);
    let error = |micro: usize| {
        let by = Integrator::Stroboscopic(StroboscopicSettings {
            micro,
            differences: 3,
            by: MicroSteps::Strang,
        });
        distance(&by.trajectories(&system, &points(), time, 8, 1).expect("integrates"), &exact)
    };
    let kicks = [4, 6, 8, 10, 12];
    let errors = kicks.map(error);
    for pair in errors.windows(2) {
        assert!(pair[1] < 0.3 * pair[0], "{errors:?}");
    }
    // Faster than by any power: the slope between neighbours steepens.
    let slope =
        |k: usize| (errors[k] / errors[k + 1]).ln() / (kicks[k + 1] as f64 / kicks[k] as f64).ln();
    assert!(slope(2) > slope(0) + 1.0, "{errors:?}");
    // A kick or a turn that is off by a thousandth costs all of that, and so do kicks at unequal distances, although
    // these are a method of order 2 too.
    let of = |splitting: Splitting, micro: usize| {
        let system = Oscillators { epsilon: 1e-4 };
        let mut z = points();
        Stroboscopic::new(&system, time, (splitting, micro), 3).take(&system, &mut z, 8);
        distance(&z, &exact)
    };
    assert!((of(Splitting::STRANG, 8) / errors[2] - 1.0).abs() < 1e-6);
    let mutants = [
        (Splitting { b: &[1.001], ..Splitting::STRANG }, 1),
        (Splitting { a: &[0.4995], ..Splitting::STRANG }, 1),
        (Splitting { name: "unequal", order: 2, stages: 2, a: &[0.22, 0.56], b: &[0.5] }, 2),
    ];
    for (number, (mutant, kicks_a_step)) in mutants.into_iter().enumerate() {
        let errors = kicks.map(|kicks| of(mutant, kicks / kicks_a_step));
        let falls = errors.windows(2).all(|pair| pair[1] < 0.3 * pair[0]);
        assert!(!falls && errors[4] > 1e-6, "mutant {number}: {errors:?}");
    }
    // Of half the kicks of ABA(10,6,4), whose step has eight.
    let of_aba = Integrator::Stroboscopic(StroboscopicSettings {
        micro: 2,
        differences: 3,
        by: MicroSteps::Aba1064,
    });
    let of_aba = of_aba.trajectories(&system, &points(), time, 8, 1).expect("integrates");
    assert!(error(16) < distance(&of_aba, &exact) + 1e-9);
}

/// A perturbation of twice the strength is that of twice the ε, slow turns and kicks alike.
#[test]
fn perturbed_steps_are_those_of_a_stronger_perturbation() {
    let (system, stronger) = (Oscillators { epsilon: 0.01 }, Oscillators { epsilon: 0.02 });
    for splitting in [Splitting::STRANG, Splitting::ABA_1064] {
        let (mut z, mut own, mut expected) = (points(), points(), points());
        splitting.steps_perturbed::<f64>(&system, 0.4, 2.0).take(&system, &mut z, 30);
        splitting.steps::<f64>(&system, 0.4).take(&system, &mut own, 30);
        splitting.integrate(&stronger, &mut expected, 12.0, 30);
        assert!(distance(&z, &expected) < 1e-13, "{}", distance(&z, &expected));
        assert!(distance(&z, &own) > 1e-2);
    }
}

/// A system that gives a wrong average, a wrong part of it that joins the other two, or a wrong circle action.
pub struct Wrong<H> {
    pub weights: Vec<i32>,
    pub average: f64,
    /// What the time in the part that joins the others is multiplied by.
    pub joined: f64,
    pub system: H,
}

impl<H: NearlyPeriodic> Hamiltonian for Wrong<H> {
    fn dof(&self) -> usize {
        self.system.dof()
    }
    fn energy<S: Elementary>(&self, z: &[S], time: f64) -> S {
        self.system.energy(z, time)
    }
}

impl<H: NearlyPeriodic> NearlyPeriodic for Wrong<H> {
    fn epsilon(&self) -> f64 {
        self.system.epsilon()
    }
    fn circle_action(&self) -> CircleAction {
        CircleAction::new(self.weights.clone())
    }
    fn limiting_frequency(&self) -> f64 {
        self.system.limiting_frequency()
    }
    fn adiabatic_invariant<S: Elementary>(&self, z: &[S]) -> S {
        self.system.adiabatic_invariant(z)
    }
    fn average_constants<S: Elementary>(
        &self,
        z: &[S],
        order: usize,
    ) -> Option<AverageConstants<S>> {
        let mut constants = self.system.average_constants(z, order)?;
        for value in constants.second.iter_mut().flatten().flatten() {
            *value *= S::from_f64(self.average);
        }
        Some(constants)
    }
    fn averaged_field<S: Elementary>(
        &self,
        z: &[S],
        constants: &AverageConstants<S>,
        out: &mut [S],
    ) {
        self.system.averaged_field(z, constants, out);
        // Of second order its coefficients are wrong, and the first is right.
        if constants.second.is_none() {
            out.iter_mut().for_each(|v| *v *= S::from_f64(self.average));
        }
    }
    fn average_split(&self) -> Option<Vec<f64>> {
        self.system.average_split()
    }
    fn average_has_cross(&self) -> bool {
        self.system.average_has_cross()
    }
    fn flow_of_average<S: Elementary>(
        &self,
        part: AveragePart,
        z: &mut [S],
        constants: &AverageConstants<S>,
        time: S,
    ) -> S {
        let share = if part == AveragePart::Cross { self.joined } else { 1.0 };
        self.system.flow_of_average(part, z, constants, S::from_f64(share) * time)
    }
    fn limiting_flow<S: Elementary>(&self, z: &mut [S], time: S) {
        self.system.limiting_flow(z, time);
    }
}

/// A hundredth of the average of first order, half of that of second order, or another circle action costs the order.
#[test]
fn averaged_equations_of_wrong_coefficients_lose_their_order() {
    let intervals = [2.3, 8.3, 32.3, 128.3].map(|periods| periods * TAU);
    let epsilons = intervals.map(|interval| 0.05 / interval);
    let slope = |weights: [i32; 2], average: f64, order: usize, closed: bool| {
        let errors = intervals.map(|interval| {
            let system = Oscillators { epsilon: 0.05 / interval };
            let exact = exact(&System::Oscillators(system), interval);
            let wrong = Wrong { weights: weights.to_vec(), average, joined: 1.0, system };
            let by = Averaged::new(&wrong, interval, 32, order);
            let by = if closed { by.in_closed_form() } else { by };
            let mut found = points();
            for z in found.chunks_exact_mut(4) {
                by.take(&wrong, z, 16);
            }
            distance(&found, &exact)
        });
        log_slope(&epsilons, &errors)
    };
    let kinds = [(1, true), (1, false), (2, false), (2, true)];
    let right = kinds.map(|(order, closed)| slope([1, 0], 1.0, order, closed));
    assert!(right[0] > 0.8 && right[1] > 0.8 && right[2] > 1.6 && right[3] > 1.6, "{right:?}");
    let wrong = kinds.map(|(order, closed)| match closed {
        // Of second order what is wrong is as small as ε times the first.
        true => slope([1, 0], if order == 1 { 1.01 } else { 1.5 }, order, closed),
        false => slope([2, 0], 1.0, order, closed),
    });
    for ((_, closed), (right, wrong)) in kinds.into_iter().zip(right.into_iter().zip(wrong)) {
        assert!(!closed || wrong.is_finite(), "{wrong}");
        // Not finite where the other action tears the planes apart.
        assert!(!(wrong >= right - 0.4), "{right} {wrong}");
    }
}

/// States that are kept on the way do not change an averaged trajectory: to enter and leave its coordinates for each of
/// them would move it by ε² each time.
#[test]
fn averaged_trajectories_do_not_depend_on_the_states_kept() {
    let sine = FieldProfile::Sine { amplitude: 0.5, wavenumber: 2.0 };
    let field = ParticleField { epsilon: 0.02, profiles: vec![sine] };
    let systems = [
        (System::Oscillators(Oscillators { epsilon: 0.02 }), 2),
        (System::FullOrbit(FullOrbit::new(0.02)), 2),
        (System::CellularDrift(CellularDrift::new(0.02)), 2),
        (System::VanDerPol(VanDerPol::new(0.02)), 2),
        (System::ParticleField(field), 1),
    ];
    for (system, most) in systems {
        let initial = match &system {
            System::ParticleField(field) => point(field.dof(), 3),
            _ => points(),
        };
        let is_split = !matches!(system, System::ParticleField(_) | System::VanDerPol(_));
        for order in 1..=most {
            for (closed, by) in [(false, None), (true, None), (true, Some(MicroSteps::Aba1064))] {
                if by.is_some() && !is_split {
                    continue;
                }
                let by = Integrator::Averaged(AveragedSettings { order, angles: 32, closed, by });
                let often = by.trajectories(&system, &initial, 2.5, 2, 40).expect("integrates");
                let once = by.trajectories(&system, &initial, 100.0, 80, 1).expect("integrates");
                let last = &often[often.len() - initial.len()..];
                let apart = distance(last, &once);
                assert!(apart < 1e-9, "{system:?}, {by:?}: {apart:e}");
                let moved = distance(&once, &initial);
                assert!(moved > 0.1, "nothing moved: {moved}");
            }
        }
    }
}

#[test]
fn what_cannot_be_composed_is_refused() {
    let torus = System::ThreeOscillators(ThreeOscillators::new(0.01));
    let lines = System::FieldLines(FieldLines::new(1e-3));
    let by = Integrator::MultiRevolution(MultiRevolutionSettings {
        micro: 8,
        order: 2,
        by: MicroSteps::Strang,
    });
    for (system, word) in [(torus, "no period"), (lines, "no parts with exact flows")] {
        let refused = by.check_for(&system);
        assert!(refused.expect_err("refused").to_string().contains(word));
    }
    for (micro, order) in [(0, 2), (1001, 2), (8, 3), (8, 0)] {
        let by = Integrator::MultiRevolution(MultiRevolutionSettings {
            micro,
            order,
            by: MicroSteps::Strang,
        });
        assert!(by.check().is_err(), "{micro} {order}");
    }
    // Less than a period is the splitting's alone.
    let system = Oscillators { epsilon: 0.01 };
    let (mut found, mut exact) = (point(2, 1), point(2, 1));
    let by = MultiRevolution::new(&system, 1.0, 1, (Splitting::STRANG, 8), 4);
    by.take(&system, &mut found, 1);
    Splitting::ABA_1064.integrate(&system, &mut exact, 1.0, 1);
    assert_eq!(found, exact);
    // So it is of averages.
    let mut found = point(2, 1);
    Stroboscopic::new(&system, 1.0, (Splitting::STRANG, 8), 2).take(&system, &mut found, 1);
    assert_eq!(found, exact);
}

/// Of order 8, in canonical and in natural coordinates; not so with one wrong coefficient.
#[test]
fn the_tableau_of_dormand_and_prince_is_of_order_eight() {
    let system = Oscillators { epsilon: 0.3 };
    let start = point(2, 4);
    let moved = |tableau: Tableau<'_>, steps: usize| {
        let mut z: Vec<DoubleDouble> = start.iter().map(|v| DoubleDouble::from_f64(*v)).collect();
        tableau.take(&system, &mut z, 3.0, steps);
        z
    };
    let exact = moved(Tableau::DORMAND_PRINCE_8, 160);
    let steps = [8, 10, 12, 14, 16, 20];
    let errors = |tableau: Tableau<'_>| {
        steps.map(|steps| {
            let apart = moved(tableau, steps).into_iter().zip(&exact);
            apart.map(|(a, b)| (a - *b).value().abs()).fold(0.0, max_or_nan)
        })
    };
    let sizes = steps.map(|steps| 1.0 / steps as f64);
    let found = errors(Tableau::DORMAND_PRINCE_8);
    assert_order("Dormand–Prince 8", 8.0, &sizes, &found);
    // A stage and a weight, each by a ten-thousandth.
    let own = Tableau::DORMAND_PRINCE_8;
    let shares: Vec<(usize, f64)> = own.stages[6].1.to_vec();
    let wrong: Vec<(usize, f64)> = shares.iter().map(|(j, a)| (*j, a * 1.0001)).collect();
    let mut stages = own.stages.to_vec();
    stages[6].1 = &wrong;
    let mut weights = own.weights.to_vec();
    weights[1].1 *= 1.0001;
    for mutant in [Tableau { stages: &stages, ..own }, Tableau { weights: &weights, ..own }] {
        let slope = log_slope(&sizes, &errors(mutant));
        assert!(slope < 6.5, "{slope}");
    }
    // By its names, of many points: the bits of each alone.
    let any = System::Oscillators(system);
    let together = Integrator::DormandPrince8.trajectories(&any, &points(), 3.0, 9, 1);
    let together = together.expect("integrates");
    for (z, moved) in points().chunks_exact(4).zip(together.chunks_exact(4)) {
        let mut alone = z.to_vec();
        Tableau::DORMAND_PRINCE_8.take(&system, &mut alone, 3.0, 9);
        assert_eq!(alone, moved);
    }
    let lines = FieldLines::new(1e-3);
    let any = System::FieldLines(lines);
    let z: Vec<f64> = [(0.2, 0.3), (0.5, 2.0), (0.8, -1.0)]
        .into_iter()
        .flat_map(|(radius, theta)| lines.point(radius, theta))
        .collect();
    let by = |steps: usize| {
        let by = Integrator::NaturalDormandPrince8;
        by.trajectories(&any, &z, TAU, steps, 1).expect("integrates")
    };
    let exact = by(96);
    let steps = [8, 9, 10, 11, 12, 13];
    let errors = steps.map(|steps| distance(&by(steps), &exact));
    assert!(errors[5] > 1e-13, "{errors:?}");
    let sizes = steps.map(|steps| 1.0 / steps as f64);
    assert_order("Dormand–Prince 8 in (r, θ)", 8.0, &sizes, &errors);
    let refused = Integrator::NaturalDormandPrince8.check_for(&System::Oscillators(system));
    assert!(refused.expect_err("canonical ones alone").to_string().contains("coordinates"));
}

/// What moves points.
type Map<'a> = &'a dyn Fn(&[f64]) -> Vec<f64>;

/// What moves points, or fails.
type Flow<'a> = &'a dyn Fn(&[f64]) -> Result<Vec<f64>, Error>;

/// A twist and a kick: a map of a plane that keeps area, times `shrink` of the momentum.
fn twist_and_kick(points: &[f64], shrink: f64) -> Vec<f64> {
    let mut out = points.to_vec();
    for z in out.chunks_exact_mut(2) {
        let angle = 5.0 + 0.6 * (z[0] * z[0] + z[1] * z[1]);
        let (s, c) = angle.sin_cos();
        (z[0], z[1]) = (c * z[0] + s * z[1], c * z[1] - s * z[0]);
        z[1] = shrink * (z[1] + 0.01 * (1.3 * z[0]).cos());
    }
    out
}

/// Points of a ring.
fn of_ring(count: usize) -> Vec<f64> {
    let of = |k: usize| {
        let (s, c) = (2.4 * k as f64).sin_cos();
        let radius = 0.3 + 0.6 * ((0.618 * k as f64) % 1.0);
        [radius * s, radius * c]
    };
    (0..count).flat_map(of).collect()
}

fn table(kind: TableKind, nodes: usize, flow: Map<'_>) -> StepTable {
    let dof = 1;
    StepTable::of_flow(kind, nodes, dof, &of_ring(200), &|z| Ok(flow(z))).expect("a table")
}

/// The largest |det J − 1| of a step of a table, by central differences.
fn area_defect(table: &StepTable) -> f64 {
    const STEP: f64 = 1e-5;
    let mut worst = 0.0;
    for z in of_ring(20).chunks_exact(2) {
        let column = |i: usize| {
            let ends = [-STEP, STEP].map(|step| {
                let mut z = z.to_vec();
                z[i] += step;
                table.trajectories(&z, 1, 1)
            });
            [0, 1].map(|k| (ends[1][k] - ends[0][k]) / (2.0 * STEP))
        };
        let [a, b] = [column(0), column(1)];
        worst = max_or_nan(worst, (a[0] * b[1] - a[1] * b[0] - 1.0).abs());
    }
    worst
}

/// Splines err as the fourth power of the distance of nodes, a step by a generating function, which takes derivatives
/// of them, as the third. It keeps area to rounding, the others to their errors. Every seventh value off by a
/// thousandth, or a map that generates nothing, costs the order.
#[test]
fn tables_have_their_orders_and_one_keeps_area() {
    let own = |z: &[f64]| twist_and_kick(z, 1.0);
    let points = of_ring(200);
    let exact = own(&points);
    let nodes = [65, 97, 129, 193, 257];
    let sizes = nodes.map(|nodes| 1.0 / nodes as f64);
    let errors = |kind: TableKind, flow: Map<'_>| {
        nodes.map(|nodes| {
            let found = table(kind, nodes, flow).trajectories(&points, 1, 1);
            root_mean_square_distance(&found, &exact, 2)
        })
    };
    let kinds = [
        (TableKind::Splines, 4.0),
        (TableKind::PolarSplines, 4.0),
        (TableKind::GeneratingFunction, 3.0),
    ];
    for (kind, order) in kinds {
        let found = errors(kind, &own);
        assert_order(kind.name(), order, &sizes, &found);
        assert!(found[4] < 1e-5, "{found:?}");
        let some_off = |z: &[f64]| {
            let mut out = own(z);
            out.iter_mut().step_by(14).for_each(|v| *v *= 1.001);
            out
        };
        let shrunk = |z: &[f64]| twist_and_kick(z, 0.999);
        let mutants: [Map<'_>; 2] = [&some_off, &shrunk];
        for (number, mutant) in mutants.into_iter().enumerate() {
            let made = StepTable::of_flow(kind, 65, 1, &points, &|z| Ok(mutant(z)));
            if kind == TableKind::GeneratingFunction && number == 1 {
                let refused = made.expect_err("keeps no area").to_string();
                assert!(refused.contains("keeps area"), "{refused}");
                continue;
            }
            let found = errors(kind, mutant);
            let slope = log_slope(&sizes, &found);
            let finite = found.iter().all(|error| error.is_finite());
            assert!(finite && slope < order - 1.0, "{}, mutant {number}: {slope}", kind.name());
        }
    }
    // A cubic spline is exact of cubic polynomials, to its ends.
    let cubic = |z: &[f64]| -> Vec<f64> {
        let of = |z: &[f64]| [z[0] * z[0] * z[1] - z[1], z[1] * z[1] * z[1] + z[0] * z[1] + 0.3];
        z.chunks_exact(2).flat_map(of).collect()
    };
    for nodes in [4, 5, 6, 9] {
        let found = table(TableKind::Splines, nodes, &cubic).trajectories(&points, 1, 1);
        let apart = distance(&found, &cubic(&points));
        assert!(apart < 1e-12, "{nodes} nodes: {apart:e}");
    }
    // Of few nodes, for the defect of the others to be seen.
    let defects = kinds.map(|(kind, _)| area_defect(&table(kind, 33, &own)));
    assert!(defects[2] < 1e-8, "{defects:?}");
    assert!(defects[0] > 1e-6 && defects[1] > 1e-6, "nothing is seen: {defects:?}");
    // Many steps at once and one after another are the same; the ring ends somewhere.
    let by = table(TableKind::GeneratingFunction, 65, &own);
    let [at_once, in_turn] = [by.trajectories(&points, 3, 2), by.trajectories(&points, 1, 6)];
    assert_eq!(at_once[points.len()..], in_turn[5 * points.len()..]);
    for (kind, _) in kinds {
        let outside = table(kind, 33, &own).trajectories(&[3.0, 0.0], 1, 1);
        assert!(outside.iter().any(|v| v.is_nan()), "{}: {outside:?}", kind.name());
    }
}

/// Of two degrees of freedom; and what is no table.
#[test]
fn tables_of_two_degrees_of_freedom() {
    let system = System::Oscillators(Oscillators { epsilon: 0.02 });
    let flow = |z: &[f64]| Integrator::Aba1064.trajectories(&system, z, 10.0, 40, 1);
    let points: Vec<f64> = (0..60).flat_map(|seed| point(2, seed)).collect();
    let exact = flow(&points).expect("integrates");
    let nodes = [13, 17, 25, 33];
    let errors = |flow: Flow<'_>| {
        nodes.map(|nodes| {
            let made = StepTable::of_flow(TableKind::Splines, nodes, 2, &points, flow);
            let made = made.expect("a table");
            assert_eq!(made.bytes(), 8 * 4 * (nodes + 2).pow(4));
            distance(&made.trajectories(&points, 1, 1), &exact)
        })
    };
    let sizes = nodes.map(|nodes| 1.0 / (nodes - 1) as f64);
    let own = errors(&flow);
    let slope = log_slope(&sizes, &own);
    // Few nodes: the ends, whose errors fall faster, are near.
    assert!((3.5..5.5).contains(&slope), "{slope} {own:?}");
    // Every eleventh value off by a thousandth costs the order.
    let some_off = |z: &[f64]| {
        let mut out = flow(z)?;
        out.iter_mut().step_by(11).for_each(|v| *v *= 1.001);
        Ok(out)
    };
    let found = errors(&some_off);
    let slope = log_slope(&sizes, &found);
    assert!(slope < 2.5, "{slope} {found:?}");
    let refused = |kind: TableKind, nodes: usize, dof: usize| {
        kind.check(nodes, dof).expect_err("refused").to_string()
    };
    assert!(refused(TableKind::Splines, 33, 3).contains("3 degrees of freedom"));
    assert!(refused(TableKind::PolarSplines, 33, 2).contains("2 degrees of freedom"));
    assert!(refused(TableKind::GeneratingFunction, 33, 2).contains("one degree of freedom"));
    assert!(refused(TableKind::Splines, 3, 2).contains("nodes"));
    assert!(refused(TableKind::Splines, 200, 2).contains("200 nodes along each of 4 axes"));
    assert!(refused(TableKind::Splines, usize::MAX, 1).contains("nodes"));
    let none = |points: &[f64], kind| StepTable::of_flow(kind, 9, 1, points, &|z| Ok(z.to_vec()));
    assert!(none(&[], TableKind::Splines).is_err());
    assert!(none(&[0.0, 0.0, 1.0, 0.0], TableKind::PolarSplines).is_err());
    // A map to one point has no such function; what fails says so.
    let away = |z: &[f64]| Ok(z.iter().enumerate().map(|(i, _)| 0.5 * (i % 2) as f64).collect());
    let made = StepTable::of_flow(TableKind::GeneratingFunction, 9, 1, &of_ring(9), &away);
    let refused = made.expect_err("one point").to_string();
    assert!(refused.contains("ρ′ grows with ρ"), "{refused}");
    let half = |z: &[f64]| Ok(z[..z.len() / 2].to_vec());
    let hole = |z: &[f64]| {
        let mut out = z.to_vec();
        out[5] = f64::NAN;
        Ok(out)
    };
    let of = |points: &[f64], flow: Flow<'_>| {
        let made = StepTable::of_flow(TableKind::Splines, 9, 1, points, &flow);
        made.expect_err("no table").to_string()
    };
    assert!(of(&of_ring(9), &half).contains("images of the nodes"));
    assert!(of(&of_ring(9), &hole).contains("none of 1 of 81 nodes"), "{}", of(&of_ring(9), &hole));
    let same = |z: &[f64]| Ok(z.to_vec());
    assert!(of(&[1.0, 0.2, 1.0, 0.3], &same).contains("coordinate 0 of a table"));
    assert!(of(&[1.0, f64::NAN], &same).contains("points of a table"));
    assert!(of(&[1.0, 0.2, 1.0], &same).contains("points of a table"));
    let failing = |_: &[f64]| Err(Error::invalid("flow", "none", "one"));
    assert!(StepTable::of_flow(TableKind::Splines, 9, 1, &of_ring(9), &failing).is_err());
}
