//! Potentials of polynomials against their literal definitions.

use gyroceptron::Error;
use gyroceptron::layer::{
    CircleAction, PolynomialPotential, Potential, Reversor, RidgeFunction, Ridges, TorusAction,
};
use gyroceptron::network::{
    Architecture, Block, InitialWeights, LayerSizes, Layers, Model, NetworkSpec, Part, map_points,
};
use gyroceptron::phase::{Direction, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{DoubleDouble, Dual, Over, Scalar, Series, Tracked, max_or_nan};

const U: f64 = f64::EPSILON / 2.0;

fn drawn(count: usize, name: &str) -> Vec<f64> {
    let mut stream = Stream::new(7, name);
    (0..count).map(|_| stream.normal()).collect()
}

/// T_m(s), its derivative and its second derivative, by their recurrences in any number.
fn chebyshev<S: Scalar>(count: usize, s: S) -> Vec<[S; 3]> {
    let [zero, one] = [0.0, 1.0].map(S::from_f64);
    let two = S::from_f64(2.0);
    let mut out = vec![[one, zero, zero], [s, one, zero]];
    for m in 2..count {
        let (now, before) = (out[m - 1], out[m - 2]);
        out.push([
            two * s * now[0] - before[0],
            two * (now[0] + s * now[1]) - before[1],
            two * (now[1] + now[1] + s * now[2]) - before[2],
        ]);
    }
    out.truncate(count);
    out
}

/// T_m(cos t) = cos mt, T_m(cosh t) = cosh mt.
#[test]
fn series_are_sums_of_cosines() {
    for degree in [1, 2, 3, 4, 7, 16, 33, 64] {
        let c = drawn(degree, "coefficients");
        for t in [0.0, 0.3, 1.1, 1.5, 2.9, 3.1] {
            let sum: f64 = c.iter().enumerate().map(|(m, c)| c * (m as f64 * t).cos()).sum();
            let slope: f64 =
                c.iter().enumerate().map(|(m, c)| c * m as f64 * (m as f64 * t).sin()).sum();
            let [[f], [of]] = f64::series_with_slopes([t.cos()], Series::new(&c, c.len(), 1, 0));
            let size: f64 = c.iter().map(|c| c.abs()).sum();
            let near = |a: f64, b: f64, scale: f64| (a - b).abs() <= 1e-13 * scale;
            // cos t knows t to u/sin t only.
            let m2 = (degree * degree) as f64;
            assert!(near(f, sum, m2 * size), "degree {degree} at {t}: {f}, not {sum}");
            // df/dt = −f′ sin t.
            assert!(near(of * t.sin(), slope, m2 * m2 * size), "degree {degree} at {t}: slope");
        }
        let outside: f64 = c.iter().enumerate().map(|(m, c)| c * (m as f64 * 0.2).cosh()).sum();
        let [f] = f64::series_each([0.2_f64.cosh()], Series::new(&c, c.len(), 1, 0));
        assert!((f / outside - 1.0).abs() < 1e-11, "degree {degree}: {f}, not {outside}");
    }
}

/// Rounding errors against double-double, within their tracked bounds, which are no more than
/// some hundred times as large as the errors are.
#[test]
fn tracked_bounds_of_series_hold_and_are_near() {
    for degree in [1, 2, 5, 16, 40, 64] {
        let c = drawn(degree, "tracked");
        let mut share = [0.0_f64; 2];
        for i in 0..400 {
            let s = -1.05 + 2.1 * f64::from(i) / 399.0;
            let reference = chebyshev(degree, DoubleDouble::from_f64(s));
            let sum = |order: usize| {
                let terms = reference.iter().zip(&c);
                terms.fold(DoubleDouble::zero(), |sum, (t, c)| {
                    sum + t[order] * DoubleDouble::from_f64(*c)
                })
            };
            let series = Series::new(&c, c.len(), 1, 0);
            let bounds = <Tracked as Over<f64>>::series_with_slopes([Tracked::exact(s)], series);
            let plain = f64::series_with_curvatures([s], series);
            for order in 0..2 {
                let [of] = bounds[order];
                assert_eq!(of.value.to_bits(), plain[order][0].to_bits());
                let error = (sum(order) - DoubleDouble::from_f64(of.value)).abs();
                let error = gyroceptron::scalar::Real::value(error);
                assert!(
                    error <= 1.01 * of.error(),
                    "degree {degree}, order {order} at {s}: {error:e} > {:e}",
                    of.error()
                );
                share[order] = max_or_nan(share[order], error / of.error());
            }
        }
        // Of a constant there is none.
        if degree > 2 {
            assert!(share.iter().all(|share| *share > 0.005), "degree {degree}: {share:?}");
        }
    }
}

/// An input's error comes out by the slope.
#[test]
fn tracked_errors_go_through_series() {
    let c = drawn(9, "through");
    let series = Series::new(&c, c.len(), 1, 0);
    let s = 0.3;
    let [[f], [slope], [curvature]] = f64::series_with_curvatures([s], series);
    let known = Tracked { value: s, bound: 1e6 };
    let [[of], [of_slope]] = <Tracked as Over<f64>>::series_with_slopes([known], series);
    assert_eq!((of.value, of_slope.value), (f, slope));
    for (bound, factor) in [(of.bound, slope), (of_slope.bound, curvature)] {
        assert!((bound / (1e6 * factor.abs()) - 1.0).abs() < 1e-3);
    }
}

/// Duals take the derivatives, in both places.
#[test]
fn derivatives_of_series_are_those_of_duals() {
    let c = drawn(12, "duals");
    let series = Series::new(&c, c.len(), 1, 0);
    for s in [-0.9, -0.2, 0.0, 0.6, 1.3] {
        let [[f], [slope], [curvature]] = f64::series_with_curvatures([s], series);
        let reference = chebyshev(12, s);
        for (order, value) in [f, slope, curvature].into_iter().enumerate() {
            let sum: f64 = reference.iter().zip(&c).map(|(t, c)| t[order] * c).sum();
            assert!((value - sum).abs() <= 1e-12 * (1.0 + sum.abs()), "order {order} at {s}");
        }
        let x = Dual::<f64, 1>::variable(s, 0);
        let [[v], [d]] = <Dual<f64, 1> as Over<f64>>::series_with_slopes([x], series);
        assert_eq!([v.re, v.eps[0], d.re, d.eps[0]], [f, slope, slope, curvature]);
        // With weights that are duals, nothing is taken from a formula.
        let lifted: Vec<_> = c.iter().map(|c| Dual::<f64, 1>::constant(*c)).collect();
        let [v] =
            <Dual<f64, 1> as Over<_>>::series_each([x], Series::new(&lifted, lifted.len(), 1, 0));
        assert!((v.eps[0] - slope).abs() <= 1e-12 * (1.0 + slope.abs()));
    }
}

/// V = ρ Σ_k ∫c_k, by the antiderivatives of Chebyshev polynomials.
fn antiderivative<S: Scalar>(c: &[f64], s: S) -> S {
    let t = chebyshev(c.len() + 2, s);
    c.iter().enumerate().fold(S::zero(), |sum, (m, c)| {
        let of = |m: usize| t[m][0] * S::from_f64(1.0 / m as f64);
        let half = S::from_f64(0.5);
        let primitive = match m {
            0 => s,
            1 => half * half * t[2][0],
            _ => half * (of(m + 1) - of(m - 1)),
        };
        sum + S::from_f64(*c) * primitive
    })
}

/// The gradient and the Hessian of a potential are those of V itself, by second duals.
#[test]
fn gradients_are_those_of_the_polynomials() {
    type D = Dual<f64, 4>;
    let radius = 1.4;
    for n in [1, 2, 4] {
        for degree in [1, 2, 5, 8] {
            let width = if n == 1 { 1 } else { 7 };
            let directions = if n == 1 { 0 } else { n * width };
            let mut weights = drawn(directions + degree * width, "potential");
            weights[..directions].iter_mut().for_each(|w| *w /= n as f64);
            let function = RidgeFunction::Polynomial { degree, radius };
            let count = Ridges { width, function }.parameter_count(n);
            assert_eq!(weights.len(), count);
            let of = PolynomialPotential::new(n, [width, degree], radius, &[], &weights);
            let y = &drawn(n, "point").iter().map(|y| 0.6 * y).collect::<Vec<_>>()[..];
            let value = |y: &[D]| {
                let mut sum = D::zero();
                for k in 0..width {
                    let mut s = D::zero();
                    for i in 0..n {
                        let w = if n == 1 { 1.0 } else { weights[i * width + k] };
                        s += D::from_f64(w / radius) * y[i];
                    }
                    let c: Vec<f64> =
                        (0..degree).map(|m| weights[directions + m * width + k]).collect();
                    sum += antiderivative(&c, s);
                }
                sum * D::from_f64(radius)
            };
            let lifted: Vec<D> = y.iter().enumerate().map(|(i, v)| D::variable(*v, i)).collect();
            let expected = value(&lifted);
            let mut gradient = vec![0.0; n];
            of.gradient(y, &mut gradient);
            let size = weights.iter().map(|w| w.abs()).sum::<f64>();
            for i in 0..n {
                let (a, b) = (gradient[i], expected.eps[i]);
                assert!((a - b).abs() <= 1e3 * U * size, "n {n}, degree {degree}: {a}, not {b}");
            }
        }
    }
}

/// The pass that keeps what the pullback needs moves points to the same bits, however many polynomials
/// there are.
#[test]
fn recorded_passes_have_the_same_bits() {
    for width in 1..=11 {
        let polynomials = |part, layers| Block::new(part, layers).of_polynomials(5).in_box(1.5);
        let architecture = Architecture::new(2)
            .on_circle(CircleAction::new([1, 0]))
            .at_epsilon(0.3)
            .with(polynomials(Part::Chart, Layers::TurnedKick(vec![width])))
            .with(polynomials(Part::SlowMap, Layers::Twist(vec![width, width])));
        let weights = InitialWeights::Normal { scale: 0.3 };
        let model = architecture.initialise(weights, 0.4, 3).expect("weights");
        let mut z = vec![0.3, -0.7, 0.5, 0.4];
        let start = z.clone();
        model.forward(&mut z);
        let mut recorded = start;
        let mut recording = model.composition().recording();
        model.composition().forward_recorded(&mut recorded, &mut recording);
        assert_eq!(z, recorded, "width {width}");
    }
}

/// With directions of all angles, jolts of degree d are all polynomials of degree d: a monomial of
/// both coordinates is a sum of d + 1 of them.
/// Kicks of a plane go several points together, whatever the number of points: each has the bits that it has alone.
#[test]
fn kicks_of_a_plane_have_the_same_bits_together() {
    for reversor in [None, Some(Reversor::Positions)] {
        let block = |part, degree| {
            let layers = Layers::TurnedKick(vec![1; 5]);
            Block::new(part, layers).of_polynomials(degree).in_box(2.0)
        };
        let architecture = Architecture::new(1)
            .on_circle(CircleAction::new([1]))
            .at_epsilon(0.8)
            .reversible(reversor)
            .with(block(Part::Chart, 9))
            .with(block(Part::Perturbation, 4));
        let weights = InitialWeights::Normal { scale: 0.3 };
        let model = architecture.initialise(weights, 1.1, 3).expect("a sound architecture");
        for count in [1, 9, 70, 333] {
            let points: Vec<f64> = drawn(2 * count, "points").iter().map(|v| 0.4 * v).collect();
            for direction in [Direction::Forward, Direction::Inverse] {
                let mut together = points.clone();
                map_points(model.composition(), direction, &mut together).expect("whole points");
                for (moved, start) in together.chunks_exact(2).zip(points.chunks_exact(2)) {
                    let mut alone = start.to_vec();
                    model.run(direction, &mut alone);
                    assert_eq!(moved, alone, "{count} points, {direction:?}");
                    assert_ne!(moved, start);
                }
            }
        }
    }
}

#[test]
fn jolts_make_monomials() {
    // q²p² of degree 4 from five directions: Σ_k a_k (q cos φ_k + p sin φ_k)⁴.
    let angles: Vec<f64> = (0..5).map(|k| std::f64::consts::PI * f64::from(k) / 5.0).collect();
    // The coefficients of q⁴, q³p, … of each direction, over the binomial.
    let column = |phi: f64| -> Vec<f64> {
        (0..5).map(|j| phi.cos().powi(4 - j) * phi.sin().powi(j)).collect()
    };
    let columns: Vec<Vec<f64>> = angles.iter().map(|phi| column(*phi)).collect();
    let mut matrix: Vec<Vec<f64>> = (0..5)
        .map(|j| {
            (0..5).map(|k| columns[k][j]).chain([if j == 2 { 1.0 / 6.0 } else { 0.0 }]).collect()
        })
        .collect();
    for i in 0..5 {
        let pivot = (i..5).max_by(|a, b| matrix[*a][i].abs().total_cmp(&matrix[*b][i].abs()));
        matrix.swap(i, pivot.expect("a row"));
        for row in 0..5 {
            if row != i {
                let factor = matrix[row][i] / matrix[i][i];
                for k in i..6 {
                    matrix[row][k] -= factor * matrix[i][k];
                }
            }
        }
    }
    let amounts: Vec<f64> = (0..5).map(|i| matrix[i][5] / matrix[i][i]).collect();
    // s³ = ¾T₁ + ¼T₃; V = ρ Σ ∫4a s³ with ρ = 1.
    let mut parameters = Vec::new();
    for (phi, a) in angles.iter().zip(&amounts) {
        parameters.extend([*phi, 0.0, 3.0 * a, 0.0, a + 0.0]);
    }
    let small = 1e-7;
    let architecture = Architecture::new(1).at_epsilon(small).with(
        Block::new(Part::NearIdentity, Layers::TurnedKick(vec![1; 5]))
            .of_polynomials(4)
            .in_box(1.0),
    );
    let model = Model::new(architecture, parameters).expect("five jolts");
    let (q, p) = (0.7, -0.4);
    let mut z = [q, p];
    model.forward(&mut z);
    // −V is the Hamiltonian: q̇ = −2q²p, ṗ = 2qp².
    let expected = [-2.0 * q * q * p, 2.0 * q * p * p];
    for k in 0..2 {
        let moved = (z[k] - [q, p][k]) / small;
        assert!((moved - expected[k]).abs() < 1e-5, "{moved}, not {}", expected[k]);
    }
}

/// The interval of an action: those of planes that turn backwards are below 0.
#[test]
fn twists_of_actions_see_their_interval() {
    // A twist of 𝔍 alone with f = c₁T₁: the angle is ρ/half·c₁·(𝔍 − centre)/half.
    let (radius, c) = (1.5, 0.2);
    let action = CircleAction::new([1]);
    let architecture = Architecture::new(1)
        .on_circle(action)
        .with(Block::new(Part::SlowMap, Layers::Twist(vec![1])).of_polynomials(2).in_box(radius));
    let model = Model::new(architecture, vec![0.0, c, 0.0]).expect("a twist");
    let z = [0.8, -0.3];
    let mut w = z;
    model.forward(&mut w);
    let j = 0.5 * (z[0] * z[0] + z[1] * z[1]);
    let half = 0.25 * radius * radius;
    let angle = radius / half * c * (j - half) / half;
    let (sin, cos) = angle.sin_cos();
    let expected = [z[0] * cos + z[1] * sin, z[1] * cos - z[0] * sin];
    for k in 0..2 {
        assert!((w[k] - expected[k]).abs() < 1e-14, "{w:?}, not {expected:?}");
    }
}

/// A point in the box reaches no further than 1, where directions are as drawn; one outside does.
#[test]
fn reaches_tell_the_box() {
    let action = TorusAction::from(CircleAction::new([1, 0]));
    let size = |count, width, degree| LayerSizes {
        degree: Some(degree),
        ..LayerSizes::uniform(count, width)
    };
    let spec = NetworkSpec {
        kind: "normal-form".into(),
        kicks: Some(size(3, 4, 5)),
        twists: Some(size(2, 3, 4)),
        turned_twists: Some(size(2, 3, 3)),
        radius: Some(1.2),
        ..NetworkSpec::default()
    };
    let architecture = spec.architecture(&action, 1e-6, 1.0).expect("a normal form");
    let model =
        architecture.initialise(InitialWeights::Normal { scale: 0.3 }, 0.4, 3).expect("weights");
    let inside = [0.8, 0.8, -0.8, 0.8];
    let outside = [0.8, 40.0, -0.8, 0.8];
    assert!(model.reach(&inside) <= 1.0, "{}", model.reach(&inside));
    assert!(model.reach(&outside) > 1.0);
    assert!(model.reach(&[f64::NAN, 0.0, 0.0, 0.0]).is_nan());
    assert!(model.largest_reach(&[inside, outside].concat()) > 1.0);
    // An action of 0 is at the border of its interval, whatever the radius of the box.
    for k in 1..200 {
        let twist = Block::new(Part::SlowMap, Layers::Twist(vec![1])).of_polynomials(2);
        let twist = Architecture::new(1)
            .on_circle(CircleAction::new([1]))
            .with(twist.in_box(0.013 * f64::from(k)));
        let twist = Model::new(twist, vec![0.1, 0.2, 0.3]).expect("a twist");
        assert!(twist.is_in_box(&[0.0, 0.0]), "{k}: {:e}", twist.reach(&[0.0, 0.0]) - 1.0);
    }
    // The literal one of a jolt: its argument over the radius.
    let jolt = Architecture::new(1)
        .with(Block::new(Part::None, Layers::TurnedKick(vec![1])).of_polynomials(3).in_box(2.0));
    let jolt = Model::new(jolt, vec![0.5, 0.1, 0.2, 0.3]).expect("a jolt");
    let (q, p) = (1.1, -0.7);
    let argument = (q * 0.5_f64.cos() + p * 0.5_f64.sin()) / 2.0;
    assert!((jolt.reach(&[q, p]) - argument.abs()).abs() < 1e-15);
    // Neurons have no box.
    let neurons =
        NetworkSpec { twists: None, kicks: None, turned_twists: None, radius: None, ..spec };
    let neurons = neurons.architecture(&action, 0.1, 1.0).expect("a normal form");
    assert!(!neurons.has_polynomials());
    let neurons = neurons.initialise(InitialWeights::Glorot, 0.4, 3).expect("weights");
    assert_eq!(neurons.reach(&outside), 0.0);
}

/// What is no polynomial is refused, with the value.
#[test]
fn wrong_polynomials_are_refused() {
    let kicks = || Block::new(Part::None, Layers::TurnedKick(vec![2]));
    let refused = |block: Block, words: &[&str]| {
        let error = Architecture::new(2).with(block).initialise(InitialWeights::Glorot, 0.0, 1);
        let text = error.expect_err("it is wrong").to_string();
        assert!(words.iter().all(|word| text.contains(word)), "{text}");
    };
    refused(kicks().of_polynomials(0).in_box(1.0), &["degree", "0"]);
    refused(kicks().of_polynomials(65).in_box(1.0), &["degree", "65"]);
    refused(kicks().of_polynomials(3).in_box(0.0), &["radius", "0"]);
    refused(kicks().of_polynomials(3).in_box(-1.0), &["radius", "-1"]);
    refused(kicks().of_polynomials(3).in_box(f64::NAN), &["radius", "NaN"]);
    refused(kicks().of_polynomials(3).in_box(1e-320), &["radius"]);
    refused(kicks().of_polynomials(3), &["radius", "none"]);
    let couplings = Block::new(Part::None, Layers::TurnedCoupling(vec![2]));
    refused(couplings.of_polynomials(3).in_box(1.0), &["couplings"]);
    let one = Architecture::new(1).with(kicks().of_polynomials(3).in_box(1.0));
    let text = one.check().expect_err("two of one number").to_string();
    assert!(text.contains("2 polynomials of one number"), "{text}");
    for (text, sound) in [
        ("10x1^16", true),
        ("10x1^", false),
        ("10x1^a", false),
        ("10x1,2^4", true),
        ("^4", false),
        ("10^4", false),
    ] {
        let parsed = LayerSizes::parse("kicks", text);
        assert_eq!(parsed.is_ok(), sound, "{text}");
        if let Ok(size) = parsed {
            assert_eq!(size.to_string(), text);
        }
    }
    let without = NetworkSpec::named("normal-form").and_then(|spec| spec.with_radius(1.0));
    assert!(matches!(without, Err(Error::Invalid { .. })));
    let json = r#"{"layer": "turned-kick", "widths": [1], "radius": 1.0}"#;
    let text = serde_json::from_str::<Block>(json).expect_err("no degree").to_string();
    assert!(text.contains("radius"), "{text}");
}
