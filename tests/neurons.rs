//! Neurons of arctan, whose slope is computed without a division, against their definition.

use gyroceptron::layer::{CircleAction, Neuron, NeuronPotential, Potential};
use gyroceptron::measure::{certificate::CertificateOptions, certificate::certify};
use gyroceptron::network::{
    Architecture, Block, InitialWeights, LayerSizes, Layers, Model, NetworkSpec, Part, map_points,
};
use gyroceptron::phase::{Direction, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{
    DoubleDouble, Dual, Elementary, Lanes, Real, Scalar, Tracked, max_or_nan,
};

/// Half a unit in the last place of a number from 1 to 2.
const U: f64 = f64::EPSILON / 2.0;

fn points() -> Vec<f64> {
    let mut stream = Stream::new(3, "lorentzian");
    let mut out: Vec<f64> = (0..20_000).map(|_| stream.uniform(-6.0, 6.0)).collect();
    // Each binade of 1 + x², and the ends of them, where the first guess is worst.
    for e in -60..498 {
        out.extend((0..8).map(|_| libm::exp2(f64::from(e)) * stream.uniform(1.0, 2.0)));
    }
    out.extend((1..60).map(|k| (libm::exp2(f64::from(k)) - 1.0).sqrt()));
    out.extend([0.0, -0.0, 5e-324, 1e-300, 1.0, 1e8, 9e149, -9e149]);
    out
}

/// 3u and 4u relative, which the tracked bounds take.
#[test]
fn the_slope_of_arctan_keeps_its_digits() {
    let mut worst = [0.0_f64; 2];
    for x in points() {
        let (t, s) = x.lorentzian();
        let wide = DoubleDouble::from_f64(x);
        let one = DoubleDouble::from_f64(1.0);
        let exact = one / (wide * wide + one);
        let off = |computed: f64, exact: DoubleDouble| {
            let error = (DoubleDouble::from_f64(computed) - exact).abs();
            if x == 0.0 { error.value() } else { error.value() / exact.value().abs() }
        };
        worst = [max_or_nan(worst[0], off(s, exact)), max_or_nan(worst[1], off(t, wide * exact))];
        assert_eq!((-x).lorentzian(), (-t, s), "at {x}");
    }
    assert!(worst[0] <= 3.0 * U && worst[1] <= 4.0 * U, "{:?} u", worst.map(|of| of / U));
    // The test sees rounding: a correctly rounded slope would err by u/2 and more.
    assert!(worst.iter().all(|of| *of > U));
}

#[test]
fn the_slope_of_arctan_has_ends() {
    for x in [1e150, 1e200, f64::MAX, f64::INFINITY] {
        let (t, s) = x.lorentzian();
        assert!((s / 1e-300 - 1.0).abs() < 1e-15 && (t / 1e-150 - 1.0).abs() < 1e-15, "{t} {s}");
        assert_eq!((-x).lorentzian(), (-t, s));
    }
    let (t, s) = f64::NAN.lorentzian();
    assert!(t.is_nan() && s.is_nan());
}

/// The same bits in lanes as alone.
#[test]
fn the_slope_of_arctan_has_the_same_bits_in_lanes() {
    for x in points().as_chunks::<8>().0 {
        let (t, s) = Lanes(*x).lorentzian();
        for k in 0..8 {
            let (one, slope) = x[k].lorentzian();
            assert_eq!((t.0[k].to_bits(), s.0[k].to_bits()), (one.to_bits(), slope.to_bits()));
        }
    }
}

/// (arctan)′ = s by the derivative of atan2, s′ = −2ts, and both derivatives of t and s by nested duals.
#[test]
fn derivatives_are_those_of_arctan() {
    type D = Dual<f64, 1>;
    for x in [-3.0, -0.7, 0.0, 0.2, 1.0, 40.0] {
        let (t, s) = D::variable(x, 0).lorentzian();
        let angle = D::variable(x, 0).atan2(D::constant(1.0));
        let near = |a: f64, b: f64| (a - b).abs() <= 8.0 * U * (1.0 + b.abs());
        assert!(near(s.re, angle.eps[0]) && near(s.re, 1.0 / (1.0 + x * x)));
        assert!(near(s.eps[0], -2.0 * t.re * s.re) && near(s.eps[0], -2.0 * x * s.re * s.re));
        assert!(near(t.eps[0], (1.0 - x * x) * s.re * s.re), "t' at {x}");
        // s″ = (6x² − 2)s³.
        let twice = Dual::<D, 1> { re: D::variable(x, 0), eps: [D::constant(1.0)] };
        let (_, curved) = twice.lorentzian();
        let expected = (6.0 * x * x - 2.0) * s.re.powi(3);
        assert!(near(curved.eps[0].eps[0], expected), "s'' at {x}: {:?}", curved.eps[0].eps[0]);
    }
}

/// An input's error comes out by the slope, and the rounding beside it.
#[test]
fn tracked_errors_go_through_arctan() {
    let x = Tracked { value: 0.6, bound: 1e9 };
    let (t, s) = x.lorentzian();
    let (slope, of_t) = (2.0 * t.value * s.value, (1.0 - 0.36) / 1.36_f64.powi(2));
    assert!((s.bound / (1e9 * slope) - 1.0).abs() < 1e-6);
    assert!(t.bound >= 1e9 * of_t && t.bound <= 2.0 * 1e9 * s.value);
    let (t, s) = Tracked::exact(0.6).lorentzian();
    assert!(s.bound > 0.0 && t.bound > 0.0);
}

/// ∇V of V = Σ w arctan(a·y + b) by differences of libm's arctan.
#[test]
fn gradients_are_those_of_arctan() {
    for width in 1..=9 {
        let mut stream = Stream::new(5, "potential");
        let weights: Vec<f64> = (0..4 * width).map(|_| stream.normal()).collect();
        let of = NeuronPotential::<f64>::new(2, width, &weights).with_neurons(Neuron::Arctan);
        assert_eq!(of.neuron(), Neuron::Arctan);
        let value = |y: [f64; 2]| -> f64 {
            let argument =
                |j: usize| weights[j] * y[0] + weights[width + j] * y[1] + weights[2 * width + j];
            (0..width).map(|j| weights[3 * width + j] * libm::atan(argument(j))).sum()
        };
        let (y, h) = ([0.4, -0.9], 1e-4);
        let mut gradient = [0.0; 2];
        of.gradient(&y, &mut gradient);
        for i in 0..2 {
            let at = |shift: f64| {
                let mut at = y;
                at[i] += shift;
                value(at)
            };
            let slope = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
            assert!((gradient[i] - slope).abs() < 1e-10, "{width}: {} {slope}", gradient[i]);
        }
    }
}

fn architecture(neuron: Neuron) -> Architecture {
    let of = |part, layers| Block::new(part, layers).of_neurons(neuron);
    Architecture::new(2)
        .on_circle(CircleAction::new([1, 0]))
        .at_epsilon(0.3)
        .of_time(2.0)
        .with(of(Part::Conjugation, Layers::Henon(vec![3, 5])))
        .with(of(Part::Chart, Layers::TurnedKick(vec![7, 2])))
        .with(of(Part::SlowMap, Layers::Twist(vec![2, 9])))
        .with(of(Part::SlowMap, Layers::TurnedTwist(vec![6])).named("turned"))
}

fn model(neuron: Neuron) -> Model {
    let weights = InitialWeights::Normal { scale: 0.3 };
    architecture(neuron).initialise(weights, 0.7, 4).expect("a sound architecture")
}

/// As many numbers as of tanh, quadratic forms of twists among them; another map; all laws hold.
#[test]
fn networks_of_arctan_are_certified() {
    let (tanh, arctan) = (model(Neuron::Tanh), model(Neuron::Arctan));
    assert_eq!(tanh.parameters(), arctan.parameters());
    let mut moved = [[0.4, -0.2, 0.1, 0.7]; 2];
    tanh.forward(&mut moved[0]);
    arctan.forward(&mut moved[1]);
    assert!(moved[0].iter().zip(&moved[1]).all(|(a, b)| (a - b).abs() > 1e-6), "{moved:?}");
    let options = CertificateOptions { samples: 60, ..Default::default() };
    let certificate = certify(&arctan, options);
    assert!(certificate.holds(), "{certificate:?}");
}

/// Points together, alone, and in the pass that keeps what the pullback needs.
#[test]
fn points_of_networks_of_arctan_have_the_same_bits_together() {
    let model = model(Neuron::Arctan);
    let mut stream = Stream::new(8, "points");
    let points: Vec<f64> = (0..4 * 37).map(|_| stream.uniform(-1.5, 1.5)).collect();
    for direction in [Direction::Forward, Direction::Inverse] {
        let mut together = points.clone();
        map_points(model.composition(), direction, &mut together).expect("whole points");
        for (moved, start) in together.chunks_exact(4).zip(points.chunks_exact(4)) {
            let mut alone = start.to_vec();
            model.run(direction, &mut alone);
            assert_eq!(moved, alone);
        }
    }
    let mut recorded = points[..4].to_vec();
    let mut recording = model.composition().recording();
    model.composition().forward_recorded(&mut recorded, &mut recording);
    let mut plain = points[..4].to_vec();
    model.forward(&mut plain);
    assert_eq!(recorded, plain);
}

#[test]
fn files_name_arctan_and_no_tanh() {
    let text = |neuron| serde_json::to_string(&architecture(neuron)).expect("JSON");
    assert!(!text(Neuron::Tanh).contains("activation"));
    assert_eq!(text(Neuron::Arctan).matches(r#""activation":"arctan""#).count(), 4);
    for neuron in [Neuron::Tanh, Neuron::Arctan] {
        let read: Architecture = serde_json::from_str(&text(neuron)).expect("the same");
        assert_eq!(read, architecture(neuron));
    }
    let named = r#"{"layer": "twist", "widths": [3], "part": "slow-map", "activation": "tanh"}"#;
    let read: Block = serde_json::from_str(named).expect("tanh may be named");
    assert_eq!(read, Block::new(Part::SlowMap, Layers::Twist(vec![3])));
}

#[test]
fn other_activations_are_refused() {
    let block = |keys: &str| {
        let text = format!(r#"{{"layer": "turned-kick", "widths": [3], "part": "chart"{keys}}}"#);
        serde_json::from_str::<Block>(&text).expect_err("no such block").to_string()
    };
    for (keys, names) in [
        (r#", "activation": "sigmoid""#, ["sigmoid", "tanh or arctan"]),
        (r#", "activation": "relu""#, ["sigmoid, tanh or sech2 of a SympNet", "tanh or arctan"]),
        (r#", "activation": "arctan", "degree": 3"#, ["activation", "degree"]),
    ] {
        let error = block(keys);
        assert!(names.iter().all(|name| error.contains(name)), "{error}");
    }
    let sympnet = r#"{"layer": "symp-net", "modules": 2, "shears": 2, "activation": "arctan"}"#;
    let error = serde_json::from_str::<Block>(sympnet).expect_err("none of a SympNet").to_string();
    assert!(error.contains("arctan") && error.contains("sech2"), "{error}");
    let coupling = Architecture::new(2).on_circle(CircleAction::new([1, 0])).at_epsilon(0.1).with(
        Block::new(Part::NearIdentity, Layers::TurnedCoupling(vec![3])).of_neurons(Neuron::Arctan),
    );
    let error = coupling.check().expect_err("couplings are of tanh").to_string();
    assert!(error.contains("neurons of arctan"), "{error}");
}

#[test]
fn sizes_name_their_activation() {
    let parse = |text| LayerSizes::parse("kicks", text);
    let sizes = parse("8x2,12:arctan").expect("two widths of arctan");
    assert_eq!((sizes.activation, sizes.degree), (Some(Neuron::Arctan), None));
    assert_eq!(sizes.to_string(), "8x2,12:arctan");
    for text in ["8x2:relu", "8x2^3:arctan", "8x2:arctan^3", "8x2:"] {
        assert!(parse(text).is_err(), "{text}");
    }
    let both = LayerSizes { degree: Some(3), ..sizes };
    let error = NetworkSpec::named("normal-form").expect("it is").with_size("kicks", both);
    let error = error.and_then(|spec| spec.check()).expect_err("neurons or polynomials");
    assert!(error.to_string().contains("degree 3"), "{error}");
}
