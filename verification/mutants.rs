//! Gyroceptrons broken on purpose. Each has to be rejected by a law, and each
//! law has to reject one.

use crate::{
    adiabatic, blocks, coupling, fitted, gradients, nearly_integrable, normal_form, on_grid,
    polynomials, precision, reversible, suite, symp_net, tanh, tolerances, torus,
};
use gyroceptron::layer::{
    CircleAction, HenonLayer, HenonMap, Kick, KickForm, NeuronPotential, Potential,
    layer_parameter_count,
};
use gyroceptron::measure::{
    Layers, Measurable, NearlyPeriodic, OneStep,
    certificate::{CertificateOptions, Row, Verdict, certify_family},
    laws,
    ratios::{Conditioned, Relation, ThereAndBack, near_identity_generator},
    steps::{KickStep, Magnitudes, MeasuredStep, MeasuredSteps, Numbers, TrackedStep, turn_steps},
};
use gyroceptron::network::{GyroceptronShape, InitialWeights, Model, Part};
use gyroceptron::phase::{Direction, Half, Map};
use gyroceptron::scalar::{Dual, Over, Scalar, max_or_nan};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::sync::OnceLock;

/// What is broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fault {
    /// Outer factor of ∇V read with the transposed index.
    MissingTranspose,
    /// ∇V evaluated at the half that it changes.
    OwnHalf,
    /// Outer W off by 1e-9: the kick is no gradient any more.
    OuterWeights,
    /// W, w or b off by 1e-9 in the inverse only.
    InverseInner,
    InverseOuter,
    InverseBias,
    /// W off by 1e-12 in the inverse only.
    InverseInnerSlightly,
    /// W off by 1e-13, some 900 units of rounding, in the inverse only.
    InverseInnerBarely,
    /// The sign of η, in the inverse only.
    InverseShift,
    /// The layers of the inverse in the order of the map.
    InverseOrder,
    /// Three inverse Hénon maps for four.
    InverseThrice,
    /// −x → +x in the single map.
    PlusX,
    /// I_ε with the same ε, whichever is asked for.
    EpsilonIgnored,
    /// I_ε takes |ε|.
    AbsoluteEpsilon,
    /// I_ε takes ε|ε|.
    EpsilonSquared,
    /// The inverse of I_ε is I_{−ε}.
    InverseByNegativeEpsilon,
    /// Four literal Hénon maps for the layer: not the identity at ε = 0.
    LiteralLayer,
    /// The rotation as a matrix in single precision.
    SingleRotation,
    /// The rotation with a wrong sign.
    WrongSignRotation,
    /// The angle slips by 1e-12 beyond a full turn.
    AngleSlips,
    /// The square of the angle.
    AngleSquared,
    /// cos(θ + 0.1) for cos θ.
    AngleOffset,
    /// |sin θ|.
    EvenSine,
    /// ψ∘Φ_θ without ψ⁻¹.
    ConjugatedOnce,
    /// The last point of a batch is left where it is.
    BatchTail,
    /// V → −V everywhere.
    NegatedPotential,
    /// The increment is cut off at 0.3: no scaling any more.
    ClippedGradient,
    /// |W| inside: turning a neuron round changes it.
    InnerMagnitude,
    /// |b|: not the same seen from −z.
    BiasMagnitude,
    /// All momenta lose 1e-6 of themselves: the adiabatic control.
    Friction,
    /// The pullback forgets the sign of one entry.
    PullbackSign,
    /// sech² as 1 − tanh².
    SechByDifference,
    /// tanh from the exponential alone.
    TanhByExponential,
    /// The slope of arctan, the last step of whose reciprocal leaves an error of 2.7e-16.
    LorentzianByCubicStep,
    /// A constant that is right to 1e-12 at every precision.
    ConstantTo12Digits,
    /// A linear shear beside a SympNet, a torus turn or a normal form whose matrix is not symmetric, by 1e-9.
    SkewModule,
    /// All parameters of a SympNet or a torus turn off by 1e-12 in the inverse only.
    ModuleInverse,
    /// The last point of a batch is left where it is by a SympNet or a torus turn.
    ModuleBatchTail,
    /// The pullback of a SympNet or a torus turn forgets the sign of one entry.
    ModulePullback,
    /// The angles of two circles exchanged, in the inverse only.
    TorusInverse,
    /// The pullback of a torus turn forgets the sign of the second angle.
    TorusPullback,
    /// A twist that moves the slow coordinates and does not turn the fast plane.
    TwistWithoutTurn,
    /// A twist that turns the fast plane by twice its weight.
    TwistWeight,
    /// A twist by a function of the position of the fast plane, for its action.
    TwistSeesPlane,
    /// A quadratic form of a twist whose matrix is not symmetric, by 1e-9.
    TwistSkewForm,
    /// The fast momentum loses 1e-12 of itself with each twist.
    TwistFriction,
    /// A turned twist that turns back by another angle, by 1e-9.
    TurnedTwistBack,
    /// A turned twist that turns back the position alone.
    TurnedTwistPosition,
    /// The pullback forgets the sign of the angle of a turned twist.
    TurnedTwistPullback,
    /// A kick of polynomials whose directions outside are not those inside, by 1e-9.
    PolynomialSkew,
    /// The coefficient of the highest degree off by 1e-9.
    PolynomialCoefficient,
    /// A normal form whose chart has weights off by 1e-9.
    OtherChart,
    /// A symplectic shear by 1e-9 behind a reversible map.
    ShearBehind,
    /// A reversible map that claims to be so by the other reflection.
    OtherReversor,
    /// The last momentum loses 1e-11 of itself after a step of a symplectic polynomial.
    FittedFriction,
    /// A symplectic polynomial whose inverse is that of another fit, to pairs with twice the noise of 1e-6.
    FittedInverse,
    /// A symplectic polynomial that claims symmetries without which it was fitted.
    FittedClaims,
    /// The first position off by a unit in the last place where a symplectic polynomial moves many points.
    FittedBatch,
    /// The result of a shear is rounded to a grid, not its increment.
    GridRoundsResult,
    /// Increments are rounded down to a grid: the inverse does not subtract what was added.
    GridRoundsDown,
    /// Increments are rounded to every 64th point of a grid.
    GridTooCoarse,
    /// The result of a rotation is rounded to a grid.
    GridRotation,
}

impl Fault {
    const ALL: [Self; 62] = [
        Self::MissingTranspose,
        Self::OwnHalf,
        Self::OuterWeights,
        Self::InverseInner,
        Self::InverseOuter,
        Self::InverseBias,
        Self::InverseInnerSlightly,
        Self::InverseInnerBarely,
        Self::InverseShift,
        Self::InverseOrder,
        Self::InverseThrice,
        Self::PlusX,
        Self::EpsilonIgnored,
        Self::AbsoluteEpsilon,
        Self::EpsilonSquared,
        Self::InverseByNegativeEpsilon,
        Self::LiteralLayer,
        Self::SingleRotation,
        Self::WrongSignRotation,
        Self::AngleSlips,
        Self::AngleSquared,
        Self::AngleOffset,
        Self::EvenSine,
        Self::ConjugatedOnce,
        Self::BatchTail,
        Self::NegatedPotential,
        Self::ClippedGradient,
        Self::InnerMagnitude,
        Self::BiasMagnitude,
        Self::Friction,
        Self::PullbackSign,
        Self::SechByDifference,
        Self::TanhByExponential,
        Self::LorentzianByCubicStep,
        Self::ConstantTo12Digits,
        Self::SkewModule,
        Self::ModuleInverse,
        Self::ModuleBatchTail,
        Self::ModulePullback,
        Self::TorusInverse,
        Self::TorusPullback,
        Self::TwistWithoutTurn,
        Self::TwistWeight,
        Self::TwistSeesPlane,
        Self::TwistSkewForm,
        Self::TwistFriction,
        Self::TurnedTwistBack,
        Self::TurnedTwistPosition,
        Self::TurnedTwistPullback,
        Self::PolynomialSkew,
        Self::PolynomialCoefficient,
        Self::OtherChart,
        Self::ShearBehind,
        Self::OtherReversor,
        Self::FittedFriction,
        Self::FittedInverse,
        Self::FittedClaims,
        Self::FittedBatch,
        Self::GridRoundsResult,
        Self::GridRoundsDown,
        Self::GridTooCoarse,
        Self::GridRotation,
    ];

    /// A map that is broken, rather than something beside it.
    fn is_map(self) -> bool {
        !matches!(
            self,
            Self::PullbackSign
                | Self::SechByDifference
                | Self::TanhByExponential
                | Self::LorentzianByCubicStep
                | Self::ConstantTo12Digits
                | Self::SkewModule
                | Self::ModuleInverse
                | Self::ModuleBatchTail
                | Self::ModulePullback
                | Self::TorusInverse
                | Self::TorusPullback
                | Self::TwistWithoutTurn
                | Self::TwistWeight
                | Self::TwistSeesPlane
                | Self::TwistSkewForm
                | Self::TwistFriction
                | Self::TurnedTwistBack
                | Self::TurnedTwistPosition
                | Self::TurnedTwistPullback
                | Self::PolynomialSkew
                | Self::PolynomialCoefficient
                | Self::OtherChart
                | Self::GridRoundsResult
                | Self::GridRoundsDown
                | Self::GridTooCoarse
                | Self::GridRotation
        )
    }
}

/// ∇V with a fault, over any number, so that duals see the fault as well.
#[derive(Clone, Copy, Debug)]
struct Faulty<'a> {
    clean: NeuronPotential<'a, f64>,
    parameters: &'a [f64],
    width: usize,
    fault: Fault,
}

const DOF: usize = 2;

impl<'a> Faulty<'a> {
    fn new(width: usize, parameters: &'a [f64], fault: Fault) -> Self {
        Self { clean: NeuronPotential::new(DOF, width, parameters), parameters, width, fault }
    }
}

impl<S: Over<f64>> Potential<S> for Faulty<'_> {
    fn dof(&self) -> usize {
        DOF
    }
    fn gradient(&self, y: &[S], out: &mut [S]) {
        let h = self.width;
        let (w_in, rest) = self.parameters.split_at(DOF * h);
        let (b_in, w_out) = rest.split_at(h);
        out[..DOF].fill(S::zero());
        for j in 0..h {
            let bias = if self.fault == Fault::BiasMagnitude { b_in[j].abs() } else { b_in[j] };
            let mut z = S::embed(bias);
            for i in 0..DOF {
                let inner = w_in[i * h + j];
                let inner = if self.fault == Fault::InnerMagnitude { inner.abs() } else { inner };
                z = y[i].mul_add_parameter(inner, z);
            }
            let sign = if self.fault == Fault::NegatedPotential { -1.0 } else { 1.0 };
            let c = z.sech2().times(sign * w_out[j]);
            for i in 0..DOF {
                let outer = match self.fault {
                    Fault::MissingTranspose => w_in[j * DOF + i],
                    Fault::OuterWeights if i == 0 => w_in[i * h + j] * (1.0 + 1e-9),
                    _ => w_in[i * h + j],
                };
                out[i] = c.mul_add_parameter(outer, out[i]);
            }
        }
        if self.fault == Fault::ClippedGradient {
            // x ↦ 0.3 tanh(x/0.3): smooth, and of one scale only.
            for value in &mut out[..DOF] {
                *value = (*value / S::from_f64(0.3)).tanh() * S::from_f64(0.3);
            }
        }
    }
}

impl Magnitudes for Faulty<'_> {
    fn hessian_magnitude(&self, y: &[f64], out: &mut [f64]) {
        self.clean.hessian_magnitude(y, out);
    }
    fn gradient_magnitude(&self, y: &[f64], out: &mut [f64]) {
        self.clean.gradient_magnitude(y, out);
    }
    fn curvature_magnitude(&self, y: &[f64], spread: &[f64], out: &mut [f64]) {
        self.clean.curvature_magnitude(y, spread, out);
    }
}

/// A kick that reads the half which it changes.
struct OwnHalf<'a>(KickStep<'a, Faulty<'a>>);

impl OwnHalf<'_> {
    fn run<S: Over<f64>>(&self, z: &mut [S]) {
        let kick = &self.0.kick;
        let changed: Vec<S> = (0..DOF).map(|i| z[kick.target.index(DOF, i)]).collect();
        let mut gradient = [S::zero(); DOF];
        kick.potential.gradient(&changed, &mut gradient);
        for i in 0..DOF {
            let row = kick.target.index(DOF, i);
            z[row] = gradient[i].mul_add_parameter(kick.scale, z[row]);
        }
    }
}

impl MeasuredStep for OwnHalf<'_> {
    fn apply(&self, z: &mut [f64]) {
        self.run(z);
    }
    fn apply_tangent(&self, z: &mut [Dual<f64, 8>]) {
        self.run(z);
    }
    fn jacobian_magnitude(&self, z: &[f64], before: &[f64], after: &[f64], e: &mut [f64]) {
        self.0.jacobian_magnitude(z, before, after, e);
    }
    fn value_magnitude(&self, z: &[f64], after: &[f64], delta: &mut [f64]) {
        self.0.value_magnitude(z, after, delta);
    }
    fn curvature_magnitude(&self, z: &[f64], spread: &[f64], out: &mut [f64]) {
        self.0.curvature_magnitude(z, spread, out);
    }
}

/// The literal Hénon map, with x ↦ ±x.
struct LiteralMap<'a> {
    map: HenonMap<'a, f64>,
    plus_x: bool,
}

impl<S: Over<f64>> Map<S> for LiteralMap<'_> {
    fn dof(&self) -> usize {
        DOF
    }
    fn forward(&self, z: &mut [S]) {
        if !self.plus_x {
            return self.map.forward(z);
        }
        for value in &mut z[..DOF] {
            *value = -*value;
        }
        self.map.forward(z);
    }
    fn inverse(&self, z: &mut [S]) {
        self.map.inverse(z);
    }
}

/// The rotation of all planes by their (cos, sin), whatever these are.
struct Matrix {
    planes: Vec<(f64, f64, f64)>,
}

impl<S: Scalar> Map<S> for Matrix {
    fn dof(&self) -> usize {
        DOF
    }
    fn forward(&self, z: &mut [S]) {
        for (j, &(c, s, lower)) in self.planes.iter().enumerate() {
            let [c, s, lower] = [c, s, lower].map(S::from_f64);
            (z[j], z[DOF + j]) = (c * z[j] + s * z[DOF + j], c * z[DOF + j] + lower * z[j]);
        }
    }
    fn inverse(&self, z: &mut [S]) {
        for (j, &(c, s, lower)) in self.planes.iter().enumerate() {
            let [c, s, lower] = [c, -s, -lower].map(S::from_f64);
            (z[j], z[DOF + j]) = (c * z[j] + s * z[DOF + j], c * z[DOF + j] + lower * z[j]);
        }
    }
}

/// p ← (1 − 1e-6)p.
struct Damping;

impl<S: Scalar> Map<S> for Damping {
    fn dof(&self) -> usize {
        DOF
    }
    fn forward(&self, z: &mut [S]) {
        for value in &mut z[DOF..] {
            *value *= S::from_f64(1.0 - 1e-6);
        }
    }
    fn inverse(&self, z: &mut [S]) {
        for value in &mut z[DOF..] {
            *value /= S::from_f64(1.0 - 1e-6);
        }
    }
}

fn one_step<'a, M: Numbers + 'a>(map: M, direction: Direction) -> Box<dyn MeasuredStep + 'a> {
    Box::new(TrackedStep { map, direction })
}

/// A gyroceptron with a fault. It is the clean one but for the fault.
#[derive(Clone, Debug)]
pub struct Mutant {
    pub fault: Fault,
    clean: Model,
    /// The parameters that the inverse uses.
    inverse: Vec<f64>,
    epsilon: f64,
}

/// A factor of P_ε, by whose layers it is.
#[derive(Clone, Copy, PartialEq)]
enum Factor {
    Psi,
    NearIdentity,
}

impl Mutant {
    fn new(fault: Fault, clean: Model) -> Self {
        let mut inverse = clean.composition().parameters().to_vec();
        let widths =
            [Part::Conjugation, Part::NearIdentity].map(|p| clean.architecture().widths(p));
        let mut rest = &mut inverse[..];
        for width in widths.concat() {
            let (layer, others) = rest.split_at_mut(layer_parameter_count(DOF, width));
            rest = others;
            let (w_in, layer) = layer.split_at_mut(DOF * width);
            let (b_in, layer) = layer.split_at_mut(width);
            let (w_out, eta) = layer.split_at_mut(width);
            let scale = |part: &mut [f64], factor: f64| part.iter_mut().for_each(|v| *v *= factor);
            match fault {
                Fault::InverseInner => scale(w_in, 1.0 + 1e-9),
                Fault::InverseOuter => scale(w_out, 1.0 + 1e-9),
                Fault::InverseBias => scale(b_in, 1.0 + 1e-9),
                Fault::InverseInnerSlightly => scale(w_in, 1.0 + 1e-12),
                Fault::InverseInnerBarely => scale(w_in, 1.0 + 1e-13),
                Fault::InverseShift => scale(eta, -1.0),
                _ => {}
            }
        }
        let epsilon = clean.epsilon();
        Self { fault, clean, inverse, epsilon }
    }

    fn layers(&self, factor: Factor, inverse: bool) -> Vec<(usize, &[f64])> {
        let of = self.clean.architecture();
        let parameters =
            if inverse { &self.inverse[..] } else { self.clean.composition().parameters() };
        let mut rest = parameters;
        let mut out = Vec::new();
        let tagged = |part, factor| of.widths(part).into_iter().map(move |w| (factor, w));
        let psi = tagged(Part::Conjugation, Factor::Psi);
        for (of, width) in psi.chain(tagged(Part::NearIdentity, Factor::NearIdentity)) {
            let (layer, others) = rest.split_at(layer_parameter_count(DOF, width));
            rest = others;
            if of == factor {
                out.push((width, layer));
            }
        }
        out
    }

    fn layer_steps<'a>(
        &self,
        width: usize,
        parameters: &'a [f64],
        epsilon: f64,
        inverse: bool,
    ) -> MeasuredSteps<'a> {
        let (potential, eta) = parameters.split_at(width * (DOF + 2));
        let literal = |plus_x: bool, times: usize| -> MeasuredSteps<'a> {
            let direction = if inverse { Direction::Inverse } else { Direction::Forward };
            let map = || LiteralMap {
                map: HenonLayer::new(DOF, width, epsilon, parameters).map(),
                plus_x,
            };
            (0..times).map(|_| one_step(map(), direction)).collect()
        };
        match self.fault {
            Fault::PlusX if !inverse => return literal(true, 4),
            Fault::PlusX | Fault::LiteralLayer => return literal(false, 4),
            Fault::InverseThrice if inverse => return literal(false, 3),
            _ => {}
        }
        let potential = Faulty::new(width, potential, self.fault);
        let mut kicks: Vec<Kick<'a, f64, Faulty<'a>>> =
            KickForm::LAYER.map(|form| form.kick(potential, eta, epsilon)).into();
        if inverse {
            kicks.reverse();
            kicks = kicks.into_iter().map(Kick::inverse).collect();
        }
        kicks
            .into_iter()
            .map(|kick| -> Box<dyn MeasuredStep + 'a> {
                if self.fault == Fault::OwnHalf {
                    Box::new(OwnHalf(KickStep { kick }))
                } else {
                    Box::new(KickStep { kick })
                }
            })
            .collect()
    }

    fn steps_of(&self, factor: Factor, epsilon: f64, direction: Direction) -> MeasuredSteps<'_> {
        let inverse = direction == Direction::Inverse;
        if inverse
            && factor == Factor::NearIdentity
            && self.fault == Fault::InverseByNegativeEpsilon
        {
            return self.steps_of(factor, -epsilon, Direction::Forward);
        }
        let epsilon = match (factor, self.fault) {
            (Factor::Psi, _) => 1.0,
            (_, Fault::EpsilonIgnored) => self.clean.epsilon(),
            (_, Fault::AbsoluteEpsilon) => epsilon.abs(),
            (_, Fault::EpsilonSquared) => epsilon * epsilon.abs(),
            _ => epsilon,
        };
        let mut layers = self.layers(factor, inverse);
        if inverse && self.fault != Fault::InverseOrder {
            layers.reverse();
        }
        layers
            .into_iter()
            .flat_map(|(width, layer)| self.layer_steps(width, layer, epsilon, inverse))
            .collect()
    }

    fn matrix(&self, theta: f64) -> Option<Matrix> {
        let plane = |m: f64| {
            let angle = m * theta;
            let (s, c) = libm::sincos(angle);
            Some(match self.fault {
                Fault::SingleRotation => {
                    let (c, s) = (f64::from(c as f32), f64::from(s as f32));
                    (c, s, -s)
                }
                Fault::WrongSignRotation => (c, s, s),
                Fault::AngleSlips if theta > TAU => {
                    let (s, c) = libm::sincos(angle + 1e-12);
                    (c, s, -s)
                }
                Fault::AngleSlips => (c, s, -s),
                Fault::AngleSquared => {
                    let (s, c) = libm::sincos(angle * angle);
                    (c, s, -s)
                }
                Fault::AngleOffset => (libm::cos(angle + 0.1), s, -s),
                Fault::EvenSine => (c, s.abs(), -s.abs()),
                _ => return None,
            })
        };
        let planes: Option<Vec<_>> =
            self.action_weights().iter().map(|&m| plane(f64::from(m))).collect();
        planes.map(|planes| Matrix { planes })
    }

    fn rotation(&self, theta: f64, direction: Direction) -> MeasuredSteps<'_> {
        match self.matrix(theta) {
            Some(matrix) => vec![one_step(matrix, direction)],
            None => turn_steps(&self.clean.architecture().circles[0].turn_by(theta), direction),
        }
    }

    fn conjugated(&self, theta: f64, direction: Direction) -> MeasuredSteps<'_> {
        let mut steps = self.steps_of(Factor::Psi, 1.0, Direction::Inverse);
        steps.extend(self.rotation(theta, direction));
        steps.extend(self.steps_of(Factor::Psi, 1.0, Direction::Forward));
        steps
    }

    fn whole_map(&self, epsilon: f64, direction: Direction) -> MeasuredSteps<'_> {
        let theta = self.clean.angles()[0];
        let once = self.fault == Fault::ConjugatedOnce;
        let near = self.steps_of(Factor::NearIdentity, epsilon, direction);
        let mut steps = MeasuredSteps::new();
        match direction {
            Direction::Forward => {
                if once {
                    steps.extend(self.rotation(theta, direction));
                    steps.extend(self.steps_of(Factor::Psi, 1.0, direction));
                } else {
                    steps.extend(self.conjugated(theta, direction));
                }
                steps.extend(near);
                if self.fault == Fault::Friction {
                    steps.push(one_step(Damping, direction));
                }
            }
            Direction::Inverse => {
                if self.fault == Fault::Friction {
                    steps.push(one_step(Damping, direction));
                }
                steps.extend(near);
                if once {
                    steps.extend(self.steps_of(Factor::Psi, 1.0, direction));
                    steps.extend(self.rotation(theta, direction));
                } else {
                    steps.extend(self.conjugated(theta, direction));
                }
            }
        }
        steps
    }
}

fn run(steps: &MeasuredSteps<'_>, z: &mut [f64]) {
    for step in steps {
        step.apply(z);
    }
}

/// A part of a mutant, given by its steps.
struct Piece<'a>(Box<dyn Fn(Direction) -> MeasuredSteps<'a> + 'a>);

impl Map<f64> for Piece<'_> {
    fn dof(&self) -> usize {
        DOF
    }
    fn forward(&self, z: &mut [f64]) {
        run(&(self.0)(Direction::Forward), z);
    }
    fn inverse(&self, z: &mut [f64]) {
        run(&(self.0)(Direction::Inverse), z);
    }
}

impl Measurable for Piece<'_> {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        (self.0)(direction)
    }
}

impl Map<f64> for Mutant {
    fn dof(&self) -> usize {
        DOF
    }
    fn forward(&self, z: &mut [f64]) {
        run(&self.measured_steps(Direction::Forward), z);
    }
    fn inverse(&self, z: &mut [f64]) {
        run(&self.measured_steps(Direction::Inverse), z);
    }
}

impl Measurable for Mutant {
    fn measured_steps(&self, direction: Direction) -> MeasuredSteps<'_> {
        self.whole_map(self.epsilon, direction)
    }
    fn move_points(&self, direction: Direction, points: &mut [f64]) {
        let tail = if self.fault == Fault::BatchTail { 2 * DOF } else { 0 };
        let end = points.len() - tail;
        for point in points[..end].chunks_exact_mut(2 * DOF) {
            run(&self.measured_steps(direction), point);
        }
    }
    fn layers(&self) -> Layers<'_> {
        let both = |factor: Factor, epsilon: f64| -> Layers<'_> {
            let forward = Mutant::layers(self, factor, false);
            let inverse = Mutant::layers(self, factor, true);
            let pieces =
                forward.into_iter().zip(inverse).map(move |((width, there), (_, back))| {
                    let steps = move |direction| match direction {
                        Direction::Forward => self.layer_steps(width, there, epsilon, false),
                        Direction::Inverse => self.layer_steps(width, back, epsilon, true),
                    };
                    let piece: Box<dyn Measurable + '_> = Box::new(Piece(Box::new(steps)));
                    (Direction::Forward, piece)
                });
            pieces.collect()
        };
        let mut out = both(Factor::Psi, 1.0);
        out.reverse();
        for (direction, _) in &mut out {
            *direction = Direction::Inverse;
        }
        let theta = self.clean.angles()[0];
        let turn = Piece(Box::new(move |direction| self.rotation(theta, direction)));
        out.push((Direction::Forward, Box::new(turn)));
        out.extend(both(Factor::Psi, 1.0));
        out.extend(both(Factor::NearIdentity, self.epsilon));
        out
    }
}

impl NearlyPeriodic for Mutant {
    fn map_at(&self, epsilon: f64) -> Box<dyn Measurable + '_> {
        Box::new(Self { epsilon, ..self.clone() })
    }
    fn near_identity_at(&self, epsilon: f64) -> Box<dyn Measurable + '_> {
        Box::new(Piece(Box::new(move |direction| {
            self.steps_of(Factor::NearIdentity, epsilon, direction)
        })))
    }
    fn conjugation(&self) -> Box<dyn Measurable + '_> {
        Box::new(Piece(Box::new(|direction| self.steps_of(Factor::Psi, 1.0, direction))))
    }
    fn action_weights(&self) -> Vec<i32> {
        self.clean.architecture().circles[0].weights().to_vec()
    }
    fn turn(&self, theta: f64, z: &mut [f64]) {
        run(&self.rotation(theta, Direction::Forward), z);
    }
    fn conjugated_action_at(&self, theta: f64) -> Box<dyn Measurable + '_> {
        Box::new(Piece(Box::new(move |direction| self.conjugated(theta, direction))))
    }
    fn angle(&self) -> f64 {
        self.clean.angles()[0]
    }
    fn epsilon(&self) -> f64 {
        self.epsilon
    }
}

/// The clean network that all mutants are made from.
pub fn clean() -> Model {
    GyroceptronShape {
        circle_action: CircleAction::new([1, 2]),
        psi: vec![5; 3],
        near_identity: vec![4; 2],
    }
    .architecture(0.01)
    .initialise(InitialWeights::Normal { scale: 0.6 }, 2.0, 1)
    .expect("a sound architecture")
}

pub fn mutant(fault: Fault, model: &Model) -> Mutant {
    Mutant::new(fault, model.clone())
}

const SAMPLES: CertificateOptions = CertificateOptions { samples: 100, radius: 1.6, seed: 1 };

/// All laws on the map itself.
fn map_rows(fault: Fault) -> Vec<Row> {
    let model = clean();
    let broken = mutant(fault, &model);
    let mut rows = certify_family(&broken, SAMPLES).rows;
    // Judged by the suite's own study of the drift instead.
    rows.retain(|row| row.law != "adiabatic invariant");
    let samples = laws::Samples::draw(DOF, 0, SAMPLES);
    let points = samples.points();
    for relation in Relation::ALL {
        let other = mutant(fault, &relation.transform_model(&model).expect("finite"));
        let transform = |z: &mut [f64]| relation.transform_point(z);
        rows.push(
            laws::exact_relation(relation.equation(), &broken, &other, &transform, points).row(),
        );
    }
    let field = |z: &[f64], out: &mut [f64]| near_identity_generator(&broken.clean, z, out);
    rows.push(laws::generator(&broken, &field, points).row());
    rows.push(gradients::literal_formula(&model, &broken, points).row());
    rows.push(gradients::other_derivatives(&model, &broken, points).row());
    let (width, layer) = Mutant::layers(&broken, Factor::Psi, false)[0];
    let map = HenonLayer::new(DOF, width, 1.0, layer).map();
    let single = OneStep(LiteralMap { map, plus_x: fault == Fault::PlusX });
    let forward = Direction::Forward;
    rows.push(laws::inversion("inversion of H", "H⁻¹∘H = Id", &single, forward, points).row());
    rows.push(laws::symplecticity_of("symplecticity of H", &single, points).row());
    rows.extend(adiabatic::rows_of_mutant(fault));
    rows
}

fn rows_of(fault: Fault) -> Vec<Row> {
    match fault {
        Fault::PullbackSign => vec![gradients::broken_pullback()],
        Fault::SechByDifference => tanh::rows_of(tanh::by_difference),
        Fault::TanhByExponential => tanh::rows_of(tanh::by_exponentials),
        Fault::LorentzianByCubicStep => tanh::rows_of_arctan(tanh::by_cubic_step),
        Fault::ConstantTo12Digits => precision::rows_of_mutant(),
        Fault::SkewModule
        | Fault::ModuleInverse
        | Fault::ModuleBatchTail
        | Fault::ModulePullback => {
            let mut rows = symp_net::rows_of_mutant(fault);
            rows.extend(torus::rows_of_mutant(fault));
            rows.extend(normal_form::rows_of_mutant(fault));
            rows.extend(nearly_integrable::rows_of_mutant(fault));
            rows.extend(blocks::rows_of_mutant(fault));
            rows.extend(polynomials::rows_of_mutant(fault));
            rows.extend(reversible::rows_of_mutant(fault));
            rows.extend(on_grid::rows_of_mutant(fault));
            rows.extend(coupling::rows_of_mutant(fault));
            rows
        }
        Fault::EpsilonIgnored | Fault::ConjugatedOnce | Fault::AngleSlips => {
            let mut rows = map_rows(fault);
            if fault == Fault::EpsilonIgnored {
                rows.extend(nearly_integrable::rows_of_mutant(fault));
                rows.extend(blocks::rows_of_mutant(fault));
                rows.extend(polynomials::rows_of_mutant(fault));
                rows.extend(reversible::rows_of_mutant(fault));
                rows.extend(on_grid::rows_of_mutant(fault));
            }
            rows.extend(coupling::rows_of_mutant(fault));
            rows
        }
        Fault::TwistWithoutTurn
        | Fault::TwistWeight
        | Fault::TwistSeesPlane
        | Fault::TwistSkewForm
        | Fault::TwistFriction
        | Fault::TurnedTwistBack
        | Fault::TurnedTwistPosition
        | Fault::TurnedTwistPullback => normal_form::rows_of_mutant(fault),
        Fault::PolynomialSkew | Fault::PolynomialCoefficient => polynomials::rows_of_mutant(fault),
        Fault::OtherChart => {
            let mut rows = normal_form::rows_of_mutant(fault);
            rows.extend(nearly_integrable::rows_of_mutant(fault));
            rows
        }
        Fault::ShearBehind | Fault::OtherReversor => reversible::rows_of_mutant(fault),
        Fault::FittedFriction | Fault::FittedInverse | Fault::FittedClaims | Fault::FittedBatch => {
            fitted::rows_of_mutant(fault)
        }
        Fault::GridRoundsResult
        | Fault::GridRoundsDown
        | Fault::GridTooCoarse
        | Fault::GridRotation => on_grid::rows_of_mutant(fault),
        Fault::TorusInverse | Fault::TorusPullback => torus::rows_of_mutant(fault),
        _ => map_rows(fault),
    }
}

fn name(row: &Row) -> String {
    format!("{}: {}", row.law, row.equation)
}

type Table = BTreeMap<Fault, Vec<Row>>;

fn table() -> &'static Table {
    static TABLE: OnceLock<Table> = OnceLock::new();
    // Several tests wait for it: their processors help.
    TABLE.get_or_init(|| {
        suite::at_once(&Fault::ALL, |fault| (*fault, rows_of(*fault))).into_iter().collect()
    })
}

/// A figure for information rejects as well as another where it is asked to.
fn kills(row: &Row) -> bool {
    match row.verdict {
        Verdict::Violated => true,
        Verdict::Reported => !row.largest.is_some_and(|largest| largest < row.limit),
        _ => false,
    }
}

/// The largest ratio of a law on a mutant.
pub fn largest_of(fault: Fault, law: &str) -> f64 {
    let row = table()[&fault].iter().find(|row| name(row).contains(law)).expect("a law");
    row.largest.expect("measured")
}

/// The smallest ratio of ψ⁻¹∘ψ = Id over the points.
pub fn smallest_inversion(fault: Fault) -> f64 {
    let broken = mutant(fault, &clean());
    let psi = broken.conjugation();
    let there = psi.measured_steps(Direction::Forward);
    let both = ThereAndBack::new(there, psi.measured_steps(Direction::Inverse));
    let samples = laws::Samples::draw(DOF, 0, SAMPLES);
    -samples
        .points()
        .chunks_exact(2 * DOF)
        .map(|z| match both.ratio(z) {
            Conditioned::Ratio(ratio) => -ratio,
            Conditioned::IllConditioned => panic!("well-conditioned samples"),
        })
        .fold(f64::NEG_INFINITY, max_or_nan)
}

/// All laws that the suite runs, in the order of its tables.
fn all_laws() -> Vec<String> {
    let mut out = Vec::new();
    for row in crate::report::clean_rows().iter() {
        if !out.contains(&name(row)) {
            out.push(name(row));
        }
    }
    out
}

/// The smallest and the largest ratio over the samples.
fn figure(row: &Row) -> String {
    match (row.smallest, row.largest) {
        (Some(smallest), Some(largest)) => format!("{smallest:>9.1e} … {largest:.1e}"),
        _ => "NaN".into(),
    }
}

#[test]
fn the_clean_network_is_not_killed() {
    for row in map_rows_of_clean() {
        assert!(!kills(&row), "{row:?}");
    }
}

/// The clean map through the same machinery: a fault that is none on maps.
fn map_rows_of_clean() -> Vec<Row> {
    map_rows(Fault::PullbackSign)
}

#[test]
fn every_mutant_is_dead() {
    for (fault, rows) in table() {
        assert!(rows.iter().any(kills), "{fault:?} lives");
    }
}

#[test]
fn every_law_kills() {
    let laws = all_laws();
    assert!(laws.len() > 25, "{}", laws.len());
    for law in laws {
        let killer = table().values().flatten().any(|row| name(row) == law && kills(row));
        assert!(killer, "{law} kills no mutant");
    }
}

/// These are seen at every single point.
#[test]
fn gross_faults_show_everywhere() {
    for (fault, law) in [
        (Fault::MissingTranspose, "symplecticity of P"),
        (Fault::OwnHalf, "symplecticity of P"),
        (Fault::OuterWeights, "symplecticity of P"),
        (Fault::SingleRotation, "symplecticity of P"),
        (Fault::WrongSignRotation, "symplecticity of P"),
        (Fault::InverseInner, "inversion of P: P⁻¹∘P"),
        (Fault::InverseOuter, "inversion of P: P⁻¹∘P"),
        (Fault::InverseBias, "inversion of P: P⁻¹∘P"),
        (Fault::InverseInnerSlightly, "inversion of P: P⁻¹∘P"),
        (Fault::InverseShift, "inversion of ψ"),
        (Fault::InverseOrder, "inversion of ψ"),
        (Fault::InverseThrice, "inversion of ψ"),
        (Fault::PlusX, "inversion of ψ"),
        (Fault::EpsilonIgnored, "near identity: I₀"),
        (Fault::NegatedPotential, "gradient: P(z)"),
    ] {
        let row = table()[&fault].iter().find(|row| name(row).starts_with(law)).expect("a law");
        let smallest = row.smallest.expect("measured");
        assert!(smallest > row.limit, "{fault:?}: {law}: {smallest:e}");
        assert_eq!(row.ill_conditioned, 0, "{fault:?} excuses itself: {law}");
    }
}

/// What the table of the numerics says of the laws that are blind.
#[test]
fn blind_laws_are_blind() {
    let verdict = |fault: Fault, law: &str| {
        let row = table()[&fault].iter().find(|row| name(row).starts_with(law)).expect("a law");
        kills(row)
    };
    for fault in [
        Fault::InverseInner,
        Fault::InverseShift,
        Fault::InverseOrder,
        Fault::InverseThrice,
        Fault::EpsilonIgnored,
        Fault::NegatedPotential,
    ] {
        assert!(fault.is_map() && !verdict(fault, "symplecticity"), "{fault:?}");
    }
    for law in ["symplecticity", "inversion of P", "inversion of ψ", "near identity: I₀"] {
        assert!(!verdict(Fault::NegatedPotential, law), "{law}");
    }
    assert!(!verdict(Fault::EpsilonIgnored, "inversion of P"));
    assert!(verdict(Fault::EpsilonIgnored, "near identity: I₀"));
}

#[test]
fn the_table_is_as_cited() {
    // The elementary functions are sampled more densely in the extensive run.
    if suite::seed() != suite::SEED || suite::extensive() {
        return;
    }
    let laws = all_laws();
    let mut text = format!(
        "The smallest and largest ratio of each law on each mutant over {} points, where it kills (limits: {} \
         for ratios, {} for orders, none for counts). A fault that is not said to be in the \
         inverse is in both directions.\n\n",
        SAMPLES.samples,
        tolerances::RATIO,
        tolerances::ORDER,
    );
    for law in &laws {
        writeln!(text, "{law}").expect("memory");
        for (fault, rows) in table() {
            if let Some(row) = rows.iter().find(|row| name(row) == *law && kills(row)) {
                writeln!(text, "    {:<26}{}", format!("{fault:?}"), figure(row)).expect("memory");
            }
        }
    }
    text.push_str("\nThe first law to kill each mutant, and how many do\n");
    for (fault, rows) in table() {
        let killers: Vec<&Row> = rows.iter().filter(|row| kills(row)).collect();
        let first = killers.first().map_or("LIVES".into(), |row| name(row));
        writeln!(text, "    {:<26}{:>3}  {first}", format!("{fault:?}"), killers.len())
            .expect("memory");
    }
    insta::assert_snapshot!("mutants", text);
}

#[test]
fn halves_are_as_the_mutants_read_them() {
    assert_eq!(Half::Momentum.index(DOF, 1), 3);
}
