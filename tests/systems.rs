//! Systems against the equations of motion.

use crate::integrators::{assert_order, has_order};
use gyroceptron::flow::{
    GaussLegendreSettings, Integrator, Pairs, Reference, ReferenceTrajectories, Splitting, Tableau,
    Window, natural_runge_kutta_4, runge_kutta_4, sample_of,
};
use gyroceptron::measure::adiabatic::{averaged_invariant, log_slope};
use gyroceptron::measure::trajectories::drifts;
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Dual, Elementary, max_or_nan};
use gyroceptron::system::{
    AveragedOscillator, CellularDrift, Counted, FieldLines, FieldProfile, FullOrbit, Hamiltonian,
    NaturalCoordinates, NearlyPeriodic, Oscillators, ParticleField, Splittable, System,
    ThreeOscillators, VanDerPol, divergence, symplectic_gradient,
};
use std::f64::consts::TAU;

pub(crate) fn particle(epsilon: f64, modes: usize) -> ParticleField {
    let mut system = ParticleField::two_modes(epsilon);
    system.profiles.resize(modes, FieldProfile::Sine { amplitude: 0.3, wavenumber: 1.5 });
    system
}

/// Does something with a system whose parts have exact flows.
macro_rules! split {
    ($system:expr, $s:ident => $body:expr) => {
        match &$system {
            System::Oscillators($s) => $body,
            System::ParticleField($s) => $body,
            System::FullOrbit($s) => $body,
            System::CellularDrift($s) => $body,
            System::ThreeOscillators($s) => $body,
            System::VanDerPol($s) => $body,
            System::FieldLines(_) => panic!("no parts"),
        }
    };
}
pub(crate) use split;

pub(crate) fn systems(epsilon: f64) -> Vec<System> {
    vec![
        System::Oscillators(Oscillators { epsilon }),
        System::ParticleField(particle(epsilon, 1)),
        System::ParticleField(particle(epsilon, 2)),
        System::ParticleField(particle(epsilon, 4)),
        System::FullOrbit(FullOrbit::new(epsilon)),
        System::CellularDrift(CellularDrift::new(epsilon)),
        System::CellularDrift(CellularDrift { epsilon, wavenumber: 1.7 }),
        System::ThreeOscillators(ThreeOscillators::new(epsilon)),
        System::VanDerPol(VanDerPol::new(epsilon)),
    ]
}

pub(crate) fn point(dof: usize, seed: u64) -> Vec<f64> {
    let mut stream = Stream::new(seed, "point");
    (0..2 * dof).map(|_| stream.uniform(-1.2, 1.2)).collect()
}

pub(crate) fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, max_or_nan)
}

/// Ω∇H by duals.
fn from_energy(system: &impl Hamiltonian, z: &[f64]) -> Vec<f64> {
    let n = system.dof();
    let slope = |direction: usize| {
        let w: Vec<_> = z
            .iter()
            .enumerate()
            .map(|(i, &v)| Dual::<f64, 1>::variable(v, if i == direction { 0 } else { 1 }))
            .collect();
        system.energy(&w, 0.0).eps[0]
    };
    (0..2 * n).map(|i| if i < n { slope(n + i) } else { -slope(i - n) }).collect()
}

#[test]
fn vector_fields_are_hamiltonian_but_for_dissipation() {
    for system in systems(0.3) {
        for seed in 0..20 {
            let z = point(system.dof(), seed);
            let mut field = vec![0.0; z.len()];
            system.vector_field(&z, 0.0, &mut field);
            let mut expected = from_energy(&system, &z);
            let by_energy = distance(&field, &expected);
            assert_eq!(by_energy > 1e-3, system.dissipates(), "{by_energy}");
            system.add_dissipation(&z, 0.0, &mut expected);
            assert!(distance(&field, &expected) < 1e-14);
        }
    }
    let averaged = AveragedOscillator::new(1.5);
    let mut field = [0.0; 2];
    averaged.vector_field(&[0.7, -0.4], 0.0, &mut field);
    assert!(distance(&field, &from_energy(&averaged, &[0.7, -0.4])) < 1e-15);
}

/// The equations as the paper displays them, written out once more.
#[test]
fn equations_of_motion_are_the_papers() {
    let (epsilon, z) = (0.07, [0.4, -0.9, 1.1, 0.3]);
    let [q1, q2, p1, p2]: [f64; 4] = z;
    let (s, c) = (2.0 * q1 + 2.0 * q2).sin_cos();
    let expected = [
        p1,
        epsilon * p2,
        -q1 - epsilon * (q2 * s + 2.0 * q1 * q2 * c),
        -epsilon * q2 - epsilon * (q1 * s + 2.0 * q1 * q2 * c),
    ];
    let mut field = [0.0; 4];
    Oscillators { epsilon }.vector_field(&z, 0.0, &mut field);
    assert!(distance(&field, &expected) < 1e-15);

    let w = [0.5, -0.3, 0.8, 0.9, 0.2, -0.6];
    let [q, a1, a2, p, b1, b2]: [f64; 6] = w;
    let v = p - q.sin() * a1 - (2.0 * q).sin() * a2;
    let v1 = 0.5 * (2.0 * a1).sin();
    let v2 = 0.5 * (-5.0 * a2 * a2).exp();
    let (d1, d2) = ((2.0 * a1).cos(), -5.0 * a2 * (-5.0 * a2 * a2).exp());
    let expected = [
        epsilon * v,
        b1 - v1,
        2.0 * (b2 - v2),
        epsilon * v * (q.cos() * a1 + 2.0 * (2.0 * q).cos() * a2),
        -a1 + (b1 - v1) * d1 + epsilon * v * q.sin(),
        -2.0 * a2 + 2.0 * (b2 - v2) * d2 + epsilon * v * (2.0 * q).sin(),
    ];
    let mut field = [0.0; 6];
    ParticleField::two_modes(epsilon).vector_field(&w, 0.0, &mut field);
    assert!(distance(&field, &expected) < 1e-15);
}

#[test]
fn the_limit_is_the_circle_action() {
    for system in systems(0.0) {
        let z = point(system.dof(), 3);
        let time = 2.3;
        let mut by_flow = z.clone();
        Reference::new(&system, &z).flow(&system, &mut by_flow, time).expect("converges");
        let mut by_limit = z.clone();
        system.limiting_flow(&mut by_limit, time);
        assert!(distance(&by_flow, &by_limit) < 1e-13);
        // In the simple coordinates it is Φ_{ω₀t}, and μ₀ is its invariant.
        let mut by_action = z.clone();
        split!(system, s => s.enter(&mut by_action));
        let invariant = system.circle_action().invariant(&by_action);
        assert!((invariant - system.adiabatic_invariant(&z)).abs() < 1e-14);
        let (torus, frequencies) = system.torus();
        let angles: Vec<f64> = frequencies.iter().map(|frequency| frequency * time).collect();
        torus.turn_by(&angles).apply(&mut by_action, false);
        split!(system, s => s.leave(&mut by_action));
        assert!(distance(&by_action, &by_limit) < 1e-14);
    }
}

/// Points inside of the torus, away from the axis.
fn lines(count: usize) -> Vec<f64> {
    let mut stream = Stream::new(3, "lines");
    let system = FieldLines::new(0.0);
    (0..count)
        .flat_map(|_| system.point(stream.uniform(0.1, 0.9), stream.uniform(-3.0, 3.0)))
        .collect()
}

#[test]
fn field_lines_are_of_the_vector_potential() {
    let system = FieldLines::new(1e-2);
    for (k, z) in lines(20).chunks_exact(2).enumerate() {
        let time = 0.7 * k as f64;
        let (r, theta) = system.polar(z);
        // A_θ is half the squared distance, and H is −A_φ.
        let momentum = r * r / 2.0 - r.powi(3) * theta.cos() / (3.0 * system.aspect_ratio);
        assert!((momentum - 0.5 * (z[0] * z[0] + z[1] * z[1])).abs() < 1e-15);
        let phase: f64 = -3.0 * theta + 2.0 * time;
        let energy = system.iota * (r * r / 2.0 - r.powi(4) / 4.0) * (1.0 + 1e-2 * phase.cos());
        assert!((system.energy(z, time) - energy).abs() < 1e-15);
        assert!(distance(&system.point(r, theta), z) < 1e-15);
        let (mut field, mut by_duals) = ([0.0; 2], [0.0; 2]);
        system.vector_field(z, time, &mut field);
        symplectic_gradient(&system, z, time, &mut by_duals);
        assert!(distance(&field, &by_duals) < 2e-15, "{field:?} {by_duals:?}");
        assert!(system.fastest_frequency(z) > 0.5 && system.check_point(z).is_ok());
    }
}

/// r and θ from their definition by bisection and differences, and dθ/dφ = ∂H/∂p_θ: by hand, in the
/// coordinates of the paper.
#[test]
fn field_lines_move_as_in_their_angles() {
    let system = FieldLines::new(2e-2);
    let radius = |theta: f64, momentum: f64| {
        let (mut low, mut high): (f64, f64) = (0.0, 1.2);
        for _ in 0..200 {
            let r = 0.5 * (low + high);
            let found = r * r / 2.0 - r.powi(3) * theta.cos() / (3.0 * system.aspect_ratio);
            if found < momentum { low = r } else { high = r }
        }
        low
    };
    let energy = |theta: f64, momentum: f64, time: f64| {
        let r = radius(theta, momentum);
        let wave = 1.0 + 2e-2 * (-3.0 * theta + 2.0 * time).cos();
        system.iota * (r * r / 2.0 - r.powi(4) / 4.0) * wave
    };
    let field = |z: [f64; 2], time: f64| {
        let d = 1e-5;
        let by = |f: &dyn Fn(f64) -> f64| {
            (8.0 * (f(d) - f(-d)) - (f(2.0 * d) - f(-2.0 * d))) / (12.0 * d)
        };
        [by(&|x| energy(z[0], z[1] + x, time)), -by(&|x| energy(z[0] + x, z[1], time))]
    };
    let (theta, r): (f64, f64) = (0.8, 0.6);
    let mut w = [theta, r * r / 2.0 - r.powi(3) * theta.cos() / (3.0 * system.aspect_ratio)];
    let (steps, time) = (400, 4.0);
    let h = time / f64::from(steps);
    for step in 0..steps {
        let t = f64::from(step) * h;
        let at = |k: [f64; 2], s: f64| [w[0] + s * k[0], w[1] + s * k[1]];
        let k1 = field(w, t);
        let k2 = field(at(k1, h / 2.0), t + h / 2.0);
        let k3 = field(at(k2, h / 2.0), t + h / 2.0);
        let k4 = field(at(k3, h), t + h);
        w = [0, 1].map(|i| w[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
    }
    let z = system.point(r, theta);
    let found = Reference::calibrated(&system, &z, time)
        .and_then(|reference| reference.flow_with_error(&system, &z, time))
        .expect("converges");
    assert!(found.error < 1e-13);
    let expected = system.point(radius(w[0], w[1]), w[0]);
    let error = distance(&found.point, &expected);
    assert!(error < 1e-8, "{error:e}");
    assert!(distance(&expected, &z) > 0.1);
    let mut by_steps = z;
    runge_kutta_4(&system, &mut by_steps, time, 2000);
    assert!(distance(&by_steps, &found.point) < 1e-10);
}

/// How far dx/dt in natural coordinates is from what the canonical equations make of it.
fn natural_disagreement(system: &impl NaturalCoordinates) -> f64 {
    let mut largest = 0.0;
    for (seed, z) in lines(30).chunks_exact(2).enumerate() {
        let time = 0.3 * seed as f64;
        let mut slope = [0.0; 2];
        system.vector_field(z, time, &mut slope);
        let mut lifted = [0, 1].map(|k| Dual::<f64, 1> { re: z[k], eps: [slope[k]] });
        system.to_natural(&mut lifted);
        let x = lifted.map(|x| x.re);
        let mut found = [0.0; 2];
        system.natural_field(&x, time, &mut found);
        for k in 0..2 {
            largest = max_or_nan(largest, (found[k] - lifted[k].eps[0]).abs());
        }
        let mut back = x;
        system.to_canonical(&mut back);
        largest = max_or_nan(largest, distance(&back, z));
    }
    largest
}

/// With a third of p_θ's bend, a wrong coefficient.
struct Bent(FieldLines);

impl Hamiltonian for Bent {
    fn dof(&self) -> usize {
        1
    }
    fn energy<S: Elementary>(&self, z: &[S], time: f64) -> S {
        self.0.energy(z, time)
    }
    fn vector_field<S: Elementary>(&self, z: &[S], time: f64, out: &mut [S]) {
        self.0.vector_field(z, time, out);
    }
}

impl NaturalCoordinates for Bent {
    fn to_natural<S: Elementary>(&self, z: &mut [S]) {
        self.0.to_natural(z);
    }
    fn to_canonical<S: Elementary>(&self, x: &mut [S]) {
        self.0.to_canonical(x);
    }
    fn natural_field<S: Elementary>(&self, x: &[S], time: f64, out: &mut [S]) {
        let other = FieldLines { aspect_ratio: self.0.aspect_ratio * (1.0 + 1e-9), ..self.0 };
        other.natural_field(x, time, out);
    }
}

/// (r, θ): the same lines, of fourth order in the steps.
#[test]
fn field_lines_are_the_same_in_natural_coordinates() {
    for poloidal in [-3, 0, 2] {
        let system = FieldLines { poloidal, ..FieldLines::new(2e-2) };
        let disagreement = natural_disagreement(&system);
        assert!(disagreement < 1e-14, "{disagreement:e}");
        let broken = natural_disagreement(&Bent(system));
        assert!(broken > 1e-11, "{broken:e}");
    }
    assert!(natural_disagreement(&FieldLines::new(0.0)) < 1e-14);
    let system = FieldLines::new(1e-3);
    let any = System::FieldLines(system);
    let z = lines(11);
    let exact = Integrator::GaussLegendre(GaussLegendreSettings { stages: 5 });
    let exact = exact.trajectories(&any, &z, TAU, 60, 3).expect("converges");
    let steps = [12, 16, 24, 32, 48];
    let by = |steps: usize| Integrator::NaturalRungeKutta4.trajectories(&any, &z, TAU, steps, 3);
    let errors = steps.map(|steps| distance(&by(steps).expect("integrates"), &exact));
    let sizes = steps.map(|steps| 1.0 / steps as f64);
    assert_order("RK4 in (r, θ)", 4.0, &sizes, &errors);
    // Its tableau takes the same steps, and with a stage or a weight off by a thousandth has not the order.
    let moved = |off: [f64; 4], weight: f64, steps: usize| {
        let shares = [[(0, 0.5 * off[1])], [(1, 0.5 * off[2])], [(2, off[3])]];
        let stages = [(0.0, &[][..]), (0.5, &shares[0]), (0.5, &shares[1]), (1.0, &shares[2])];
        let weights = [(0, 1.0 / 6.0), (1, weight / 3.0), (2, 1.0 / 3.0), (3, 1.0 / 6.0)];
        let tableau = Tableau { stages: &stages, weights: &weights };
        let mut out = z.clone();
        for x in out.chunks_exact_mut(2) {
            system.to_natural(x);
            tableau.take_natural(&system, x, TAU, steps);
            system.to_canonical(x);
        }
        distance(&out, &exact[..z.len()])
    };
    let own = steps.map(|steps| moved([1.0; 4], 1.0, steps));
    let named = steps.map(|steps| {
        let found = Integrator::NaturalRungeKutta4.trajectories(&any, &z, TAU, steps, 1);
        distance(&found.expect("integrates"), &exact[..z.len()])
    });
    for (own, named) in own.iter().zip(named) {
        assert!((own / named - 1.0).abs() < 1e-6, "{own:e} {named:e}");
    }
    assert!(has_order(4.0, &sizes, &own));
    for place in 1..4 {
        let mut off = [1.0; 4];
        off[place] = 1.001;
        assert!(!has_order(4.0, &sizes, &steps.map(|steps| moved(off, 1.0, steps))), "{place}");
    }
    assert!(!has_order(4.0, &sizes, &steps.map(|steps| moved([1.0; 4], 1.001, steps))));
    // The bits of each line alone, which stays in (r, θ) from state to state.
    let together = by(16).expect("integrates");
    for (m, start) in z.chunks_exact(2).enumerate() {
        let mut x = start.to_vec();
        system.to_natural(&mut x);
        for t in 0..3 {
            natural_runge_kutta_4(&system, &mut x, TAU, 16);
            let mut shown = x.clone();
            system.to_canonical(&mut shown);
            assert_eq!(&together[(t * 11 + m) * 2..][..2], &shown[..]);
        }
    }
    let other = System::Oscillators(Oscillators { epsilon: 0.1 });
    let refused = Integrator::NaturalRungeKutta4.trajectories(&other, &[0.1; 4], 1.0, 3, 1);
    assert!(refused.expect_err("canonical ones alone").to_string().contains("coordinates"));
    assert!(exact.len() == 3 * z.len());
}

#[test]
fn unperturbed_field_lines_turn_on_their_surfaces() {
    let system = FieldLines::new(0.0);
    let points = lines(20);
    for z in points.chunks_exact(2) {
        let flow = Reference::calibrated(&system, z, 5.0).expect("converges");
        let (mut by_flow, mut by_limit) = (z.to_vec(), z.to_vec());
        flow.flow(&system, &mut by_flow, 5.0).expect("converges");
        system.limiting_flow(&mut by_limit, 5.0);
        let error = distance(&by_flow, &by_limit);
        assert!(error < 1e-13, "{error:e}");
        let change = system.adiabatic_invariant(&by_flow) - system.adiabatic_invariant(z);
        assert!(change.abs() < 1e-14);
    }
    // Away from resonances the flux stays to first order in ε.
    let z = system.point(0.3, 0.4);
    let change = |epsilon: f64| {
        let system = FieldLines::new(epsilon);
        let found = ReferenceTrajectories::of_flow(&system, &z, TAU, 200).expect("converges");
        assert!(found.error < 1e-11, "{:e}", found.error);
        let flux = found.trajectories.quantity(|z| system.adiabatic_invariant(z));
        flux.values().iter().map(|v| (v - flux.values()[0]).abs()).fold(0.0, max_or_nan)
    };
    let epsilons = [4e-4, 2e-4, 1e-4];
    let slope = log_slope(&epsilons, &epsilons.map(change));
    assert!((slope - 1.0).abs() < 0.05, "{slope}");
}

#[test]
fn field_lines_tell_where_they_are_not() {
    let system = FieldLines::new(1e-3);
    let said = |z: [f64; 2]| system.check_point(&z).expect_err("not there").to_string();
    assert!(said([1.02, 0.3]).contains("inside of the torus"), "{}", said([1.02, 0.3]));
    assert!(said([0.0, 0.0]).contains("singular on the axis"));
    assert!(said([0.1, 3.0]).contains("r(p_θ, θ) at the point [0.1, 3.0]"));
    assert!(said([f64::NAN, 0.1]).contains("NaN"));
    assert!(FieldLines::new(0.0).check_point(&[0.0, 0.0]).is_ok());
    // Without a poloidal wave it is defined there, and at rest.
    let plain = FieldLines { poloidal: 0, ..system };
    let mut field = [1.0; 2];
    plain.vector_field(&[0.0, 0.0], 0.4, &mut field);
    assert!(plain.check_point(&[0.0, 0.0]).is_ok() && field == [0.0, 0.0], "{field:?}");
    // Steps from one turn to the next are of whole periods.
    let z = system.point(0.5, 0.1);
    let quarter = ReferenceTrajectories::of_flow(&system, &z, 0.25 * TAU, 3).expect_err("no map");
    assert!(quarter.to_string().contains("a multiple of the period"), "{quarter}");
    assert!(ReferenceTrajectories::of_flow(&system, &z, 0.25 * TAU, 2).is_ok());
    let any = System::FieldLines(system);
    let by = |integrator: Integrator, interval, kept| {
        integrator.trajectories(&any, &z, interval, 50, kept)
    };
    assert!(by(Integrator::RungeKutta4, 0.25 * TAU, 2).is_err());
    assert!(by(Integrator::RungeKutta4, 0.5 * TAU, 2).is_ok());
    let refused = by(Integrator::Strang, TAU, 1).expect_err("nothing to split");
    assert!(refused.to_string().contains("no parts with exact flows"), "{refused}");
    let outside = Integrator::RungeKutta4.trajectories(&any, &[0.1, 0.2, 1.02, 0.3], TAU, 50, 1);
    assert!(outside.expect_err("one outside").to_string().contains("[1.02, 0.3]"));
    // Steps from one time to the next add up to that of all, at whole periods.
    let gauss = Integrator::GaussLegendre(GaussLegendreSettings { stages: 6 });
    let (once, twice) = (by(gauss, 2.0 * TAU, 1), by(gauss, TAU, 2));
    let (once, twice) = (once.expect("converges"), twice.expect("converges"));
    assert!(distance(&once, &twice[2..]) < 1e-11, "{:e}", distance(&once, &twice[2..]));
    let window =
        |low: f64, high: f64| Window { low: vec![low; 2], high: vec![high; 2], samples: 300 };
    let mut stream = Stream::new(1, "data");
    let inside = sample_of(&system, &[window(-1.2, 1.2)], &mut stream).expect("some are inside");
    assert_eq!(inside.len(), 600);
    assert!(inside.chunks_exact(2).all(|z| system.check_point(z).is_ok()));
    let away = sample_of(&system, &[window(2.0, 3.0)], &mut stream).expect_err("none inside");
    assert!(away.to_string().starts_with("window 0"), "{away}");
}

/// A Hamiltonian is all that a system needs.
struct Pendulum;

impl Hamiltonian for Pendulum {
    fn dof(&self) -> usize {
        1
    }
    fn energy<S: Elementary>(&self, z: &[S], _: f64) -> S {
        S::from_f64(0.5) * z[1] * z[1] - z[0].sin_cos().1
    }
}

#[test]
fn a_hamiltonian_is_enough() {
    let mut field = [0.0; 2];
    Pendulum.vector_field(&[0.7, -0.3], 0.0, &mut field);
    assert!(distance(&field, &[-0.3, -0.7_f64.sin()]) < 1e-16);
    assert!((Pendulum.fastest_frequency(&[0.0, 0.0]) - 1.0).abs() < 1e-15);
    let point = [3.0, 0.1];
    let (pairs, error) = Pairs::of_flow(&Pendulum, point.to_vec(), 20.0).expect("converges");
    assert!(error < 1e-12);
    let change = Pendulum.energy(pairs.output(), 0.0) - Pendulum.energy(&point, 0.0);
    assert!(change.abs() < 1e-14 && distance(pairs.output(), &point) > 0.1);
    // More coordinates than fit on the stack.
    struct Many;
    impl Hamiltonian for Many {
        fn dof(&self) -> usize {
            10
        }
        fn energy<S: Elementary>(&self, z: &[S], time: f64) -> S {
            let square = |sum, k: usize| sum + S::from_f64(k as f64) * z[k] * z[k];
            (0..20).fold(S::from_f64(time) * z[0], square)
        }
    }
    let z: Vec<f64> = (0..20).map(|k| 0.1 * f64::from(k) - 1.0).collect();
    let mut field = vec![0.0; 20];
    Many.vector_field(&z, 2.0, &mut field);
    for k in 0..10 {
        let (up, down) = (2.0 * (k + 10) as f64 * z[k + 10], 2.0 * k as f64 * z[k]);
        let force = if k == 0 { down + 2.0 } else { down };
        assert!((field[k] - up).abs() < 1e-14 && (field[k + 10] + force).abs() < 1e-14);
    }
}

/// v²/2B + ½v²(v×∇B)_z/B³, the textbooks' next order in the gyroradius: where B varies slowly it
/// changes less, by the wavenumber; within a gyroradius only the average does.
#[test]
fn the_gradient_corrects_the_magnetic_moment_where_it_is_small() {
    let changes = |wavenumber: f64| -> [f64; 3] {
        let epsilon = 1e-4;
        let system = FullOrbit { epsilon, wavenumber, potential: 0.0 };
        // Where the gradient is steepest.
        let z = [0.8, 0.5 / wavenumber, 0.3, 0.9 / wavenumber];
        let orbit = ReferenceTrajectories::of_flow(&system, &z, 0.1, 201).expect("moves");
        let of =
            |quantity: &dyn Fn(&[f64]) -> f64| drifts(&orbit.trajectories, quantity)[0].largest;
        let gradient = |z: &[f64]| {
            let (x, y) = (z[3] - z[2], z[0] + z[1]);
            let (vx, vy) = system.velocity(z);
            let (bx, by) = (
                -epsilon * wavenumber * (wavenumber * x).sin(),
                -epsilon * wavenumber * (wavenumber * y).sin(),
            );
            0.5 * (vx * vx + vy * vy) * (vx * by - vy * bx)
        };
        [
            of(&|z| system.magnetic_moment(z)),
            of(&|z| system.magnetic_moment(z) + gradient(z)),
            of(&|z| averaged_invariant(&system, z)),
        ]
    };
    let wavenumbers = [0.4, 0.2, 0.1];
    let found = wavenumbers.map(changes);
    let order = |which: usize| log_slope(&wavenumbers, &found.map(|changes| changes[which]));
    assert!((order(0) - 1.0).abs() < 0.2 && (order(1) - 2.0).abs() < 0.3, "{found:?}");
    let [first, second, averaged] = changes(1.0);
    assert!(second > 0.1 * first && averaged < 0.1 * first, "{first:e} {second:e} {averaged:e}");
}

/// ẋ = v, v̇ = Bv×e_z − ε∇φ, and the orders in ε of the magnetic moment.
#[test]
fn a_full_orbit_is_newtons_and_keeps_its_magnetic_moment() {
    let system = FullOrbit { epsilon: 0.3, wavenumber: 1.3, potential: 0.7 };
    for seed in 0..20 {
        let z = point(2, seed);
        let mut field = [0.0; 4];
        system.vector_field(&z, 0.0, &mut field);
        let along: Vec<_> =
            z.iter().zip(field).map(|(&re, rate)| Dual::<f64, 1> { re, eps: [rate] }).collect();
        let (vx, vy) = system.velocity(&along);
        let (x, y): (f64, f64) = (z[3] - z[2], z[0] + z[1]);
        assert!((field[3] - field[2] - vx.re).abs() < 1e-15);
        assert!((field[0] + field[1] - vy.re).abs() < 1e-15);
        let b = 1.0 + 0.3 * ((1.3 * x).cos() + (1.3 * y).cos());
        let force = 0.3 * 0.7 * 1.3;
        assert!((vx.eps[0] - (b * vy.re + force * (1.3 * x).sin())).abs() < 1e-14);
        assert!((vy.eps[0] - (-b * vx.re - force * (1.3 * y).cos())).abs() < 1e-14);
    }
    let epsilons = [0.04, 0.02, 0.01];
    let (mut first, mut second) = (Vec::new(), Vec::new());
    for epsilon in epsilons {
        let system = FullOrbit::new(epsilon);
        let z = [0.7, -0.4, 0.5, 0.6];
        let orbit =
            ReferenceTrajectories::of_flow(&system, &z, 0.05 / epsilon, 101).expect("moves");
        assert!(orbit.error < 1e-12, "{:e}", orbit.error);
        let of =
            |quantity: &dyn Fn(&[f64]) -> f64| drifts(&orbit.trajectories, quantity)[0].largest;
        first.push(of(&|z| system.magnetic_moment(z)));
        second.push(of(&|z| averaged_invariant(&system, z)));
    }
    let orders = [log_slope(&epsilons, &first), log_slope(&epsilons, &second)];
    assert!((orders[0] - 1.0).abs() < 0.2 && (orders[1] - 2.0).abs() < 0.3, "{orders:?}");
}

/// Both actions of a torus change by O(ε) where no harmonic of its frequencies is small; at 2ω₁ ≈ ω₂ they are
/// exchanged, and J₁ + 2J₂ alone stays.
#[test]
fn a_resonance_exchanges_the_actions_of_a_torus() {
    let changes = |epsilon: f64, frequency: f64| -> [f64; 3] {
        let system = ThreeOscillators { epsilon, frequency };
        let z = [0.9, 0.6, 0.5, 0.0, 0.3, 0.0];
        let orbit = ReferenceTrajectories::of_flow(&system, &z, 0.1 / epsilon, 301).expect("moves");
        assert!(orbit.error < 1e-11, "{:e}", orbit.error);
        let (torus, _) = system.torus();
        let of =
            |quantity: &dyn Fn(&[f64]) -> f64| drifts(&orbit.trajectories, quantity)[0].largest;
        let [first, second] = [0, 1].map(|k| of(&|z| torus.circles()[k].invariant(z)));
        [first, second, of(&|z| system.adiabatic_invariant(z))]
    };
    let epsilons = [0.02, 0.01, 0.005];
    let golden = ThreeOscillators::new(0.0).frequency;
    let free = epsilons.map(|epsilon| changes(epsilon, golden));
    for which in 0..2 {
        let slope = log_slope(&epsilons, &free.map(|changes| changes[which]));
        assert!((slope - 1.0).abs() < 0.2, "{which}: {slope}, {free:?}");
    }
    for epsilon in epsilons {
        let [first, second, both] = changes(epsilon, 2.0 + epsilon);
        // Beside the exchange each changes by O(ε).
        assert!((first - 2.0 * second).abs() < 3.0 * epsilon && both < 3.0 * epsilon);
        assert!(first > 0.05 && second > 0.025, "{first} {second} {both}");
    }
    let system = ThreeOscillators::new(0.1);
    assert_eq!(Counted::new(&system).torus(), system.torus());
    let (orbit, z) = (FullOrbit::new(0.1), point(2, 1));
    let known = Counted::new(&orbit).customary_invariant(&z);
    assert!(known.is_some() && known == orbit.customary_invariant(&z));
    let system = System::ThreeOscillators(ThreeOscillators { epsilon: 0.1, frequency: -1.0 });
    assert!(system.check().expect_err("no frequency").to_string().contains("system.frequency"));
}

#[test]
fn far_out_the_gaussian_profile_is_zero() {
    let profile = FieldProfile::Gaussian { amplitude: 0.5, rate: 5.0 };
    for x in [12.3, -40.0, 1e200, f64::INFINITY] {
        assert_eq!(profile.value_and_slope::<f64>(x), (0.0, 0.0));
    }
    let (value, slope) = profile.value_and_slope::<f64>(0.3);
    assert!((value - 0.5 * (-0.45_f64).exp()).abs() < 1e-16);
    assert!((slope + 3.0 * value).abs() < 1e-15);
}

/// The equations of motion, written out once more, and what they say of volumes: the flow's Jacobian has
/// the determinant e^∫div.
#[test]
fn the_self_excited_oscillator_is_its_equations() {
    let (epsilon, damping) = (0.07, 0.2);
    let system = VanDerPol { epsilon, damping };
    let [q1, q2, p1, p2]: [f64; 4] = [0.9, -0.4, 1.3, 0.6];
    let mut field = [0.0; 4];
    system.vector_field(&[q1, q2, p1, p2], 0.0, &mut field);
    let expected = [
        p1,
        epsilon * p2,
        -q1 + epsilon * (1.0 - q1 * q1 - q2) * p1,
        epsilon * (0.5 * q1 * q1 - q2 - damping * p2),
    ];
    assert!(distance(&field, &expected) < 1e-15);

    type D = Dual<f64, 4>;
    let (steps, interval) = (400, 0.05);
    let lifted = [q1, q2, p1, p2].into_iter().enumerate().map(|(i, v)| D::variable(v, i));
    let mut z: Vec<D> = lifted.collect();
    let split = Splitting::ABA_1064.steps::<f64>(&system, interval);
    // Simpson's rule, on steps in pairs.
    let rate = |z: &[D]| {
        let point: Vec<f64> = z.iter().map(|v| v.re).collect();
        let found = divergence(&system, &point, 0.0);
        let expected = epsilon * (1.0 - point[0] * point[0] - point[1] - damping);
        assert!((found - expected).abs() < 1e-16, "{found} {expected}");
        found
    };
    let mut growth = rate(&z);
    for step in 1..=steps {
        split.take(&system, &mut z, 1);
        let weight = if step == steps { 1.0 } else { 2.0 + 2.0 * f64::from(step % 2) };
        growth += weight * rate(&z);
    }
    growth *= interval / 3.0;
    let volume = faer::Mat::from_fn(4, 4, |i, k| z[i].eps[k]).determinant();
    assert!((volume.ln() - growth).abs() < 1e-7, "{} {growth}", volume.ln());
    assert!(growth.abs() > 0.1);

    // The formula of the exact flow without damping is the limit of that with damping.
    let of = |damping: f64| {
        let mut z = [q1, q2, p1, p2];
        VanDerPol { epsilon, damping }.flow_b(&mut z, 0.8);
        z
    };
    assert!(distance(&of(0.0), &of(1e-12)) < 1e-13);
    assert!(System::VanDerPol(VanDerPol { epsilon, damping: -1.0 }).check().is_err());
    assert!(System::VanDerPol(VanDerPol { epsilon, damping: f64::NAN }).check().is_err());
}

/// Over times of 1/ε the fast action follows the averaged equations, whose torus of γ = 0.3 all trajectories
/// come to, with errors of order ε.
#[test]
fn the_self_excited_oscillator_follows_its_averaged_equations() {
    /// J′ = J(1 − ½J − x), x′ = y, y′ = −x − γy + ½J in slow time.
    struct Averaged(f64);
    impl Averaged {
        fn slope(&self, [j, x, y]: [f64; 3]) -> [f64; 3] {
            [j * (1.0 - 0.5 * j - x), y, 0.5 * j - x - self.0 * y]
        }
        fn flow(&self, mut s: [f64; 3], time: f64, steps: usize) -> [f64; 3] {
            let h = time / steps as f64;
            let beside =
                |s: [f64; 3], by: f64, k: [f64; 3]| std::array::from_fn(|i| k[i].mul_add(by, s[i]));
            for _ in 0..steps {
                let a = self.slope(s);
                let b = self.slope(beside(s, 0.5 * h, a));
                let c = self.slope(beside(s, 0.5 * h, b));
                let d = self.slope(beside(s, h, c));
                for i in 0..3 {
                    s[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
                }
            }
            s
        }
    }
    let z: [f64; 4] = [1.2, 0.3, -0.4, 0.5];
    let slow_time = 8.0;
    let start = [0.5 * (z[0] * z[0] + z[2] * z[2]), z[1], z[3]];
    let averaged = Averaged(0.3).flow(start, slow_time, 4000);
    // Of whole turns, so that the fast angle of the error is the same in all.
    let epsilons = [32.0, 64.0, 128.0, 256.0].map(|turns| slow_time / (TAU * turns));
    let errors = epsilons.map(|epsilon| {
        let system = VanDerPol::new(epsilon);
        let mut w = z;
        let time = slow_time / epsilon;
        Splitting::ABA_1064.integrate(&system, &mut w, time, (time / 0.2) as usize);
        distance(&[system.adiabatic_invariant(&w), w[1], w[3]], &averaged)
    });
    assert_order("averaging", 1.0, &epsilons, &errors);
    let swing = |damping: f64| {
        let (mut low, mut high) = (f64::INFINITY, 0.0);
        let mut s = Averaged(damping).flow(start, 6000.0, 300_000);
        for _ in 0..400 {
            s = Averaged(damping).flow(s, 0.05, 10);
            (low, high) = (f64::min(low, s[0]), f64::max(high, s[0]));
        }
        (low, high)
    };
    let (low, high) = swing(0.3);
    assert!((low - 0.131).abs() < 1e-3 && (high - 2.72).abs() < 1e-2, "{low} {high}");
    // The circle loses its stability at ¼(√41 − 5) = 0.3508.
    let (low, high) = swing(0.345);
    assert!(high - low > 0.2, "{low} {high}");
    let (low, high) = swing(0.357);
    assert!(high - low < 1e-3 && (high - 1.0).abs() < 1e-3, "{low} {high}");
}
