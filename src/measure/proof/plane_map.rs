//! Maps of a plane as lists of analytic steps.

use super::ball::{Ball, BallCentre, BallOf, FineBall};
use super::number::{Constant, Coordinate, Function, Number};
use crate::error::Error;
use crate::layer::{
    Activation, Neuron, NeuronPotential, OfAction, PolynomialPotential, RidgeFunction, Ridges,
    TorusAction,
};
use crate::network::{Composition, Kind, Model};
use crate::phase::Half;

/// A function of one variable: a step adds a multiple of it to a coordinate, or turns by a multiple of it.
#[derive(Clone, Debug, PartialEq)]
pub enum Slope {
    /// Σ_k a_k w_k sech²(a_k x + b_k) + rx, the derivative of neurons and of ½rx².
    Tanh {
        /// a_k, b_k and w_k of each neuron.
        neurons: Vec<[f64; 3]>,
        /// The coefficient r of the linear term rx.
        linear: f64,
    },
    /// l Σ_m c_m T_m((x − centre)·k), with Chebyshev polynomials T_m.
    Chebyshev {
        /// The centre of the interval of x that the polynomials are made for.
        centre: f64,
        /// k, the inverse of half the width of the interval.
        inverse_half: f64,
        /// The factor l of the whole sum.
        factor: f64,
        /// The coefficients c_m of the polynomials T_m, from m = 0 on.
        coefficients: Vec<f64>,
    },
    /// A scalar function between the modules of a SympNet.
    Activation {
        /// The activation function of the module.
        activation: Activation,
        /// The factor that the activation function is multiplied by.
        factor: f64,
    },
    /// sin 2πx, of a coordinate that counts turns.
    Sine,
    /// The linear function rx with the coefficient r.
    Linear(f64),
    /// A function that has the same value for all x.
    Constant(f64),
}

/// y, y′ and y″ of Σ c_m T_m by the recursion of each.
fn chebyshev<N: Number, const K: usize>(coefficients: &[f64], s: N) -> [N; K] {
    let zero = N::of(0.0);
    // T_m, T_m′, T_m″ of this m and of the one before.
    let (mut now, mut before) = ([zero; K], [zero; K]);
    now[0] = N::of(1.0);
    let mut sums = [zero; K];
    for (m, &c) in coefficients.iter().enumerate() {
        for k in 0..K {
            sums[k] = sums[k].plus(now[k].scaled(c));
        }
        let mut next = [zero; K];
        for k in 0..K {
            let mut term = s.times(now[k]);
            if k > 0 {
                term = term.plus(now[k - 1].scaled(k as f64));
            }
            // T₁ = sT₀, where the others double.
            next[k] = if m == 0 { term } else { term.scaled(2.0).minus(before[k]) };
        }
        (before, now) = (now, next);
    }
    sums
}

impl Function for Slope {
    fn derivatives<N: Number, const K: usize>(&self, x: N) -> [N; K] {
        let zero = N::of(0.0);
        let mut out = [zero; K];
        let one = N::of(1.0);
        match self {
            Self::Tanh { neurons, linear } => {
                for &[a, b, w] in neurons {
                    let t = x.scaled(a).plus(N::of(b)).tanh();
                    let s = one.minus(t.times(t));
                    let mut next = s.scaled(w).scaled(a);
                    out[0] = out[0].plus(next);
                    if const { K > 1 } {
                        // s′ = −2ts.
                        next = next.scaled(a);
                        out[1] = out[1].plus(next.times(t).scaled(-2.0));
                    }
                    if const { K > 2 } {
                        // s″ = s(4 − 6s), s‴ = −2ts(4 − 12s).
                        next = next.scaled(a);
                        let bent = N::of(4.0).minus(s.scaled(6.0));
                        out[2] = out[2].plus(next.times(bent));
                        if const { K > 3 } {
                            let bent = N::of(-8.0).plus(s.scaled(24.0));
                            next = next.scaled(a);
                            out[3] = out[3].plus(next.times(t).times(bent));
                        }
                        if const { K > 4 } {
                            // s⁗ = s(16 − 120s + 120s²).
                            let bent = N::of(16.0).plus(s.times(s.minus(one)).scaled(120.0));
                            out[4] = out[4].plus(next.scaled(a).times(bent));
                        }
                    }
                }
                if *linear != 0.0 {
                    out[0] = out[0].plus(x.scaled(*linear));
                    if const { K > 1 } {
                        out[1] = out[1].plus(N::of(*linear));
                    }
                }
            }
            Self::Chebyshev { centre, inverse_half, factor, coefficients } => {
                let s = x.minus(N::of(*centre)).scaled(*inverse_half);
                out = chebyshev(coefficients, s);
                for (k, term) in out.iter_mut().enumerate() {
                    for _ in 0..k {
                        *term = term.scaled(*inverse_half);
                    }
                    *term = term.scaled(*factor);
                }
            }
            Self::Activation { activation, factor } => {
                let half = *activation == Activation::Sigmoid;
                let t = if half { x.scaled(0.5) } else { x }.tanh();
                let s = one.minus(t.times(t));
                let ts = t.times(s);
                // Of tanh: s, −2ts, s(4 − 6s) and −2ts(4 − 12s).
                let tower = [
                    t,
                    s,
                    ts.scaled(-2.0),
                    s.times(N::of(4.0).minus(s.scaled(6.0))),
                    ts.times(N::of(-8.0).plus(s.scaled(24.0))),
                    s.times(N::of(16.0).plus(s.times(s.minus(one)).scaled(120.0))),
                ];
                for k in 0..K {
                    out[k] = match activation {
                        Activation::Tanh => tower[k],
                        Activation::Sech2 => tower[k + 1],
                        Activation::Sigmoid if k == 0 => one.plus(t).scaled(0.5),
                        Activation::Sigmoid => tower[k].scaled(0.5_f64.powi(k as i32 + 1)),
                    }
                    .scaled(*factor);
                }
            }
            Self::Sine => {
                let tau = Ball::TAU.constant(FineBall::TAU);
                let (s, c) = x.scaled_by(tau).sin_cos();
                let (once, twice) = (c.scaled_by(tau), s.scaled(-1.0).scaled_by(tau));
                let twice = twice.scaled_by(tau);
                let thrice = once.scaled(-1.0).scaled_by(tau).scaled_by(tau);
                let fourfold = twice.scaled(-1.0).scaled_by(tau).scaled_by(tau);
                let tower = [s, once, twice, thrice, fourfold];
                out[..K].copy_from_slice(&tower[..K]);
            }
            Self::Linear(factor) => {
                out[0] = x.scaled(*factor);
                if const { K > 1 } {
                    out[1] = N::of(*factor);
                }
            }
            Self::Constant(value) => out[0] = N::of(*value),
        }
        out
    }
}

/// A step of a map of a plane (q, p).
#[derive(Clone, Debug, PartialEq)]
pub enum PlaneStep {
    /// target += c·f(τ·source − η).
    Shear {
        /// The coordinate that it changes.
        target: Half,
        /// The factor c of the increment.
        factor: f64,
        /// Whether the source is reflected, τ = −1.
        reflect: bool,
        /// The shift η of the argument of f.
        shift: f64,
        /// The function f that the shear adds a multiple of.
        slope: Slope,
    },
    /// R(−φ)∘K∘R(φ) with K: p += c·f(q) and the clockwise turn R(φ): q += −c sin φ·f(x), p += c cos φ·f(x),
    /// x = q cos φ + p sin φ.
    TurnedShear {
        /// The angle φ of the turn R(φ), in radians.
        angle: f64,
        /// The factor c of the shear K.
        factor: f64,
        /// The function f that the shear K adds a multiple of.
        slope: Slope,
    },
    /// The turn by m·θ, clockwise where it is positive.
    Turn {
        /// The angle θ of the circle action, in radians.
        angle: f64,
        /// The weight m: the turns of the plane while θ goes round once.
        weight: i32,
    },
    /// The turn by m·c·f(½m(q² + p²)).
    Twist {
        /// The factor c of the angle of the turn.
        factor: f64,
        /// The weight m of the plane in the action ½m(q² + p²).
        weight: i32,
        /// The function f of the action, of which the angle is a multiple.
        slope: Slope,
    },
    /// The change of sign of a coordinate. It is not symplectic, but a pair of reflections is.
    Reflection(Half),
    /// The product of a coordinate with 1 + μ. It is not symplectic, and no model has such a step.
    Scaling {
        /// The coordinate that is multiplied by 1 + μ.
        target: Half,
        /// The excess μ of the factor over 1.
        excess: f64,
    },
}

/// An analytic map of a plane, or of a cylinder whose first coordinate counts turns, as a list of steps.
///
/// It is the exact map of real numbers with the doubles in the steps as parameters and exact rotations as turns, not
/// its evaluation in rounded arithmetic.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaneMap {
    /// The steps, the first one applied first.
    pub steps: Vec<PlaneStep>,
    /// Whether q counts turns; then the map is of a cylinder, and a circle goes once around it.
    pub cylinder: bool,
}

fn turn<C: Coordinate>(z: &mut [C; 2], s: C, c: C) {
    let [q, p] = *z;
    *z = [q.times(c).plus(p.times(s)), p.times(c).plus(q.times(s).scaled(-1.0))];
}

/// A map with the sines and cosines of its turns.
#[derive(Clone, Debug)]
pub struct Prepared<'a> {
    map: &'a PlaneMap,
    /// Of each step; of those that turn by nothing of their own (0, 1).
    turns: Vec<(Constant, Constant)>,
}

impl PlaneStep {
    /// The sine and the cosine of what it turns by; of one that turns by nothing of its own 0 and 1.
    fn turn<C: BallCentre>(&self) -> (BallOf<C>, BallOf<C>) {
        match self {
            Self::TurnedShear { angle, .. } => Number::sin_cos(BallOf::<C>::of(*angle)),
            Self::Turn { angle, weight } => {
                Number::sin_cos(Number::scaled(BallOf::<C>::of(*angle), (*weight).into()))
            }
            _ => (BallOf::of(0.0), BallOf::of(1.0)),
        }
    }
}

impl PlaneMap {
    /// Computes the sines and cosines of its turns.
    pub fn prepared(&self) -> Prepared<'_> {
        let turns = self.steps.iter().map(|step| {
            let ((s, c), (fine_s, fine_c)) = (step.turn(), step.turn());
            (Ball::constant(s, fine_s), Ball::constant(c, fine_c))
        });
        Prepared { map: self, turns: turns.collect() }
    }

    /// The map of a model of one degree of freedom, in the coordinates of its normal form where it has one.
    ///
    /// # Errors
    /// [`Error::Invalid`] where the model is not of one degree of freedom, or has a step that is no composition of
    /// shears, turns and twists.
    pub fn of_model(model: &Model) -> Result<Self, Error> {
        let action = model.architecture().action();
        let circles = action.iter().flat_map(TorusAction::circles);
        let weights: Vec<i32> = circles.map(|circle| circle.weights()[0]).collect();
        Self::of_composition(&model.in_conjugated_coordinates(), &weights)
    }

    /// The map of a composition of one degree of freedom, whose turns have a weight for each of their angles.
    ///
    /// # Errors
    /// Those of [`PlaneMap::of_model`]; when there are more or fewer weights than angles.
    pub fn of_composition(map: &Composition<f64>, weights: &[i32]) -> Result<Self, Error> {
        if map.dof() != 1 {
            return Err(Error::invalid(
                "map of a proof",
                format!("{} degrees of freedom", map.dof()),
                "a map of one degree of freedom: curves enclose regions of a plane alone",
            ));
        }
        let mut steps = Vec::new();
        for step in map.steps() {
            let parameters = &map.parameters()[step.parameters.clone()];
            let scale = if step.near_identity { map.epsilon() } else { 1.0 };
            let scale = step.time.map_or(scale, |time| scale * time);
            let signed = if step.inverse { -scale } else { scale };
            match &step.kind {
                Kind::Kick { ridges, form } => {
                    let (potential, eta) = parameters.split_at(ridges.parameter_count(1));
                    steps.push(PlaneStep::Shear {
                        target: form.target,
                        factor: if form.negative { -signed } else { signed },
                        reflect: form.reflect,
                        shift: if form.shifted { eta[0] } else { 0.0 },
                        slope: Slope::of_ridges(*ridges, potential)?,
                    });
                }
                Kind::Turn { .. } => {
                    Error::check_count("weights of a turn", parameters.len(), weights.len())?;
                    steps.extend(parameters.iter().zip(weights).map(|(&theta, &weight)| {
                        let angle = if step.inverse { -theta } else { theta };
                        PlaneStep::Turn { angle, weight }
                    }));
                }
                Kind::TurnedKick { ridges, .. } => {
                    let slope = Slope::of_ridges(*ridges, &parameters[1..])?;
                    steps.push(PlaneStep::TurnedShear {
                        angle: parameters[0],
                        factor: signed,
                        slope,
                    });
                }
                Kind::TurnedCoupling { .. } => {
                    return Err(Error::invalid(
                        "map of a proof",
                        "an affine coupling",
                        "steps that are shears, turns and twists",
                    ));
                }
                Kind::Twist { shears, .. } => {
                    let (weight, slopes) = shears.of_plane(parameters);
                    for of in slopes {
                        let slope = Slope::of_action(of)?;
                        steps.push(PlaneStep::Twist { factor: signed, weight, slope });
                    }
                }
                Kind::Linear { first, translated } => {
                    let count = parameters.len() - if *translated { 2 } else { 0 };
                    let shear = |target, factor, slope| PlaneStep::Shear {
                        target,
                        factor,
                        reflect: false,
                        shift: 0.0,
                        slope,
                    };
                    let mut own = Vec::new();
                    for (k, &entry) in parameters[..count].iter().enumerate() {
                        let target = if k % 2 == 0 { *first } else { first.other() };
                        own.push(shear(target, signed, Slope::Linear(entry)));
                    }
                    for (target, &by) in
                        [Half::Position, Half::Momentum].into_iter().zip(&parameters[count..])
                    {
                        own.push(shear(target, signed, Slope::Constant(by)));
                    }
                    if step.inverse {
                        own.reverse();
                    }
                    steps.extend(own);
                }
                Kind::Activation { activation, target } => {
                    let (activation, factor) =
                        (*activation, parameters.first().map_or(1.0, |a| *a));
                    steps.push(PlaneStep::Shear {
                        target: *target,
                        factor: signed,
                        reflect: false,
                        shift: 0.0,
                        slope: Slope::Activation { activation, factor },
                    });
                }
                Kind::Reflection(reversor) => steps.push(PlaneStep::Reflection(reversor.half())),
            }
        }
        Ok(Self { steps, cylinder: false })
    }

    /// Fails unless the kinds of its steps make it symplectic: shears, turns, twists, and pairs of reflections.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the step.
    pub fn check_symplectic(&self) -> Result<(), Error> {
        let expected = "shears, turns, twists and pairs of reflections, which keep areas whatever their numbers";
        let mut reflections = 0;
        for (number, step) in self.steps.iter().enumerate() {
            let found = match step {
                PlaneStep::Scaling { excess, .. } => {
                    format!("not symplectic: step {number} scales a coordinate by 1 + {excess:e}")
                }
                PlaneStep::Turn { .. }
                | PlaneStep::Twist { .. }
                | PlaneStep::TurnedShear { .. }
                    if self.cylinder =>
                {
                    format!("step {number}, a turn of a cylinder")
                }
                PlaneStep::Shear { target, slope, .. }
                    if self.cylinder
                        && *target == Half::Momentum
                        && !matches!(slope, Slope::Sine) =>
                {
                    format!(
                        "not exact: step {number} changes the momenta by what is not of mean 0 around a cylinder"
                    )
                }
                PlaneStep::Reflection(_) => {
                    reflections += 1;
                    continue;
                }
                _ => continue,
            };
            return Err(Error::invalid("map of a proof", found, expected));
        }
        if reflections % 2 == 1 || self.cylinder && reflections > 0 {
            let found = format!("not symplectic: {reflections} reflections");
            return Err(Error::invalid("map of a proof", found, expected));
        }
        Ok(())
    }
}

impl Prepared<'_> {
    /// Whether it is a map of a cylinder.
    pub fn cylinder(&self) -> bool {
        self.map.cylinder
    }

    /// Applies the map F to a point in place, z ← F(z).
    pub fn apply<C: Coordinate>(&self, z: &mut [C; 2]) {
        for (step, &(s, c)) in self.map.steps.iter().zip(&self.turns) {
            match step {
                PlaneStep::Shear { target, factor, reflect, shift, slope } => {
                    let (source, target) = match target {
                        Half::Position => (1, 0),
                        Half::Momentum => (0, 1),
                    };
                    let mut x = z[source];
                    if *reflect {
                        x = x.scaled(-1.0);
                    }
                    if *shift != 0.0 {
                        x = x.shifted(-shift);
                    }
                    z[target] = z[target].plus(x.through(slope).scaled(*factor));
                }
                PlaneStep::TurnedShear { factor, slope, .. } => {
                    let [q, p] = *z;
                    let by = q.scaled_by(c).plus(p.scaled_by(s)).through(slope).scaled(*factor);
                    *z = [q.plus(by.scaled_by(s).scaled(-1.0)), p.plus(by.scaled_by(c))];
                }
                PlaneStep::Turn { .. } => {
                    let [q, p] = *z;
                    let turned = [
                        q.scaled_by(c).plus(p.scaled_by(s)),
                        p.scaled_by(c).plus(q.scaled_by(s).scaled(-1.0)),
                    ];
                    *z = turned;
                }
                PlaneStep::Twist { factor, weight, slope } => {
                    let [q, p] = *z;
                    let weight = f64::from(*weight);
                    let action = q.times(q).plus(p.times(p)).scaled(0.5 * weight);
                    let angle = action.through(slope).scaled(*factor).scaled(weight);
                    let (s, c) = angle.sin_cos();
                    turn(z, s, c);
                }
                PlaneStep::Reflection(half) => {
                    let axis = if *half == Half::Position { 0 } else { 1 };
                    z[axis] = z[axis].scaled(-1.0);
                }
                PlaneStep::Scaling { target, excess } => {
                    let axis = if *target == Half::Position { 0 } else { 1 };
                    z[axis] = z[axis].plus(z[axis].scaled(*excess));
                }
            }
        }
    }
}

impl Slope {
    /// G′ of ridge functions of an action, in an interval where they are polynomials, and of half the square of it.
    fn of_action(of: OfAction<'_>) -> Result<Self, Error> {
        let OfAction { ridges, interval, functions, form } = of;
        let mut out = Self::of_ridges(ridges, functions)?;
        match (&mut out, ridges.function, interval) {
            (Self::Tanh { linear, .. }, ..) => *linear = form,
            (
                Self::Chebyshev { centre, inverse_half, factor, .. },
                RidgeFunction::Polynomial { radius, .. },
                Some(interval),
            ) => {
                (*centre, *inverse_half) = (interval.centre, interval.inverse_half);
                *factor = radius * interval.inverse_half;
            }
            _ => {}
        }
        Ok(out)
    }

    /// V′ of ridge functions of one coordinate. arctan has no enclosures yet: beside its poles ±i they would have to
    /// say where the complex argument may be.
    fn of_ridges(ridges: Ridges, parameters: &[f64]) -> Result<Self, Error> {
        Ok(match ridges.function {
            RidgeFunction::Neurons(Neuron::Arctan) => {
                let expected = "neurons of tanh, or polynomials, of which enclosures are known";
                return Err(Error::invalid("map of a proof", "neurons of arctan", expected));
            }
            RidgeFunction::Neurons(Neuron::Tanh) => {
                let neurons = NeuronPotential::<f64>::new(1, ridges.width, parameters);
                let [a, b, w] = neurons.weights();
                let neurons = (0..ridges.width).map(|k| [a[k], b[k], w[k]]).collect();
                Self::Tanh { neurons, linear: 0.0 }
            }
            RidgeFunction::Polynomial { degree, radius } => {
                let of =
                    PolynomialPotential::new(1, [ridges.width, degree], radius, &[], parameters);
                let [_, coefficients] = of.weights();
                Self::Chebyshev {
                    centre: 0.0,
                    inverse_half: 1.0 / radius,
                    factor: 1.0,
                    coefficients: coefficients.to_vec(),
                }
            }
        })
    }
}
