//! The laws that any composition of shears has, and faults to break one with.

use crate::mutants::Fault;
use gyroceptron::measure::{
    Measurable,
    certificate::{Row, Tally},
    laws,
    ratios::{Adjoint, Conditioned, differing_components},
    steps::{MeasuredSteps, TrackedStep},
};
use gyroceptron::network::{Composition, Model};
use gyroceptron::phase::{Direction, Map};
use gyroceptron::random::Stream;
use gyroceptron::scalar::{Dual, Scalar, Tracked};

/// The rows with the name of what they were measured on.
pub fn named(mut rows: Vec<Row>, of: &str) -> Vec<Row> {
    rows.iter_mut().for_each(|row| row.law += of);
    rows
}

/// Points of a cube.
pub fn points(seed: u64, radius: f64, dof: usize, count: usize) -> Vec<f64> {
    let mut stream = Stream::new(seed, "points");
    (0..count * 2 * dof).map(|_| stream.uniform(-radius, radius)).collect()
}

/// The laws on the first two of the points; that of evaluation on all.
pub fn measure(
    map: &dyn Measurable,
    adjoint: &dyn Adjoint,
    points: &[f64],
    dof: usize,
    seed: u64,
) -> Vec<Tally> {
    let two = &points[..4 * dof];
    let mut out = vec![laws::symplecticity_of("symplecticity", map, two).must_show_errors()];
    out.extend(measure_any(map, adjoint, points, dof, seed));
    out
}

/// [`measure`] but for symplecticity.
pub fn measure_any(
    map: &dyn Measurable,
    adjoint: &dyn Adjoint,
    points: &[f64],
    dof: usize,
    seed: u64,
) -> Vec<Tally> {
    let two = &points[..4 * dof];
    let inversion = |equation, first| laws::inversion("inversion", equation, map, first, two);
    vec![
        inversion("P⁻¹∘P = Id", Direction::Forward),
        inversion("P∘P⁻¹ = Id", Direction::Inverse),
        laws::evaluation(map, points),
        laws::pullback(adjoint, two, dof, seed),
    ]
}

/// At ε = 0 nothing is left of what ε scales.
pub fn identity_at_zero(network: &Model, points: &[f64]) -> Tally {
    let part = network.composition().near_identity_part();
    let dim = 2 * network.architecture().dof;
    let moved =
        points.chunks_exact(dim).map(|z| Conditioned::Ratio(differing_components(&part, z) as f64));
    Tally::of_counts("near identity", "I₀ = Id, T₀ = Id, bitwise").extend_at(points, dim, moved)
}

/// A composition in two degrees of freedom with a fault.
pub struct Broken {
    fault: Fault,
    sound: Composition<f64>,
    /// With the parameters that a broken inverse takes.
    other: Composition<f64>,
    /// The angle of a turned twist among the parameters.
    angle: usize,
}

impl Broken {
    /// With a turned twist whose angle is this parameter.
    pub fn with_angle(fault: Fault, sound: &Composition<f64>, angle: usize) -> Self {
        Self { angle, ..Self::new(fault, sound) }
    }

    pub fn new(fault: Fault, sound: &Composition<f64>) -> Self {
        let mut parameters = sound.parameters().to_vec();
        if fault == Fault::TorusInverse {
            parameters.swap(0, 1);
        } else {
            parameters.iter_mut().for_each(|w| *w *= 1.0 + 1e-12);
        }
        let other = sound.with_parameters(parameters, sound.epsilon()).expect("as many");
        Self { fault, sound: sound.clone(), other, angle: 0 }
    }
}

/// p₁ += 1e-9·q₂ and nothing else: the matrix of a linear shear that is not symmetric.
struct Skew;

impl<S: Scalar> Map<S> for Skew {
    fn dof(&self) -> usize {
        2
    }
    fn forward(&self, z: &mut [S]) {
        z[2] = z[1].mul_add(S::from_f64(1e-9), z[2]);
    }
    fn inverse(&self, z: &mut [S]) {
        z[2] = z[1].mul_add(S::from_f64(-1e-9), z[2]);
    }
}

/// p₁ += 1e-9·q₁: a symplectic shear.
struct Behind;

impl<S: Scalar> Map<S> for Behind {
    fn dof(&self) -> usize {
        2
    }
    fn forward(&self, z: &mut [S]) {
        z[2] = z[0].mul_add(S::from_f64(1e-9), z[2]);
    }
    fn inverse(&self, z: &mut [S]) {
        z[2] = z[0].mul_add(S::from_f64(-1e-9), z[2]);
    }
}

impl Map<f64> for Broken {
    fn dof(&self) -> usize {
        2
    }
    fn forward(&self, z: &mut [f64]) {
        self.measured_steps(Direction::Forward).iter().for_each(|step| step.apply(z));
    }
    fn inverse(&self, z: &mut [f64]) {
        self.measured_steps(Direction::Inverse).iter().for_each(|step| step.apply(z));
    }
}

impl Measurable for Broken {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        let inverse = direction == Direction::Inverse;
        let wrong = matches!(self.fault, Fault::ModuleInverse | Fault::TorusInverse) && inverse;
        let map = if wrong { &self.other } else { &self.sound };
        let mut steps = map.measured_steps(direction);
        if self.fault == Fault::SkewModule {
            let skew = Box::new(TrackedStep { map: Skew, direction });
            if inverse { steps.insert(0, skew) } else { steps.push(skew) }
        }
        if self.fault == Fault::ShearBehind {
            let behind = Box::new(TrackedStep { map: Behind, direction });
            if inverse { steps.insert(0, behind) } else { steps.push(behind) }
        }
        steps
    }
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        let count = points.len() / 4;
        let left = usize::from(self.fault == Fault::ModuleBatchTail);
        for point in points.chunks_exact_mut(4).take(count - left) {
            self.run(direction, point);
        }
    }
}

impl Adjoint for Broken {
    fn parameters(&self) -> Vec<f64> {
        self.sound.parameters().to_vec()
    }
    fn tangent(&self, parameters: &[Dual<Tracked, 1>], z: &mut [Dual<Tracked, 1>]) {
        self.sound.tangent(parameters, z);
    }
    fn cotangent(
        &self,
        parameters: &[Tracked],
        z: &[Tracked],
        z_bar: &mut [Tracked],
        parameters_bar: &mut [Tracked],
    ) {
        self.sound.cotangent(parameters, z, z_bar, parameters_bar);
        let sign = match self.fault {
            Fault::ModulePullback => Some(0),
            // The second angle of a torus action.
            Fault::TorusPullback => Some(1),
            Fault::TurnedTwistPullback => Some(self.angle),
            _ => None,
        };
        if let Some(entry) = sign {
            parameters_bar[entry] = -parameters_bar[entry];
        }
    }
}
