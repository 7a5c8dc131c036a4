//! The structure certificate of a model.

use super::circle_axioms::{CircleAxiom, circle_axiom_ratio, conjugated_axiom_ratio};
use super::inversion::{Conditioned, inversion_ratio};
use super::near_identity::{
    differing_components, log_slope, near_identity_size, near_identity_undoing,
};
use super::{Walk, symplecticity_ratio};
use crate::error::Error;
use crate::layer::{ElementaryStep, TanhPotential};
use crate::network::{Composition, Direction, Gyroceptron, HenonNet, Model, Stream, map_points};
use crate::phase::Map;
use crate::scalar::Scalar;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Every ratio must stay below it.
const RATIO_LIMIT: f64 = 10.0;
/// Slopes in ε may fall short of 1 and 2 by this; they may exceed them, as they
/// do where the potentials are odd and the leading term vanishes.
const SLOPE_LIMIT: f64 = 0.1;
/// A count of components that must be none.
const COUNT_LIMIT: f64 = 0.5;
/// The range of the median of ρ_S for a computation whose errors are those of
/// rounding. Below it the samples saturate and the test shows nothing; above it
/// a defect smaller than the limit hides among the errors of rounding.
const SOUND_MEDIAN: [f64; 2] = [0.05, 2.0];
/// Slopes are taken from values so many times above rounding.
const ABOVE_ROUNDING: f64 = 1e3;
/// The least share of samples with a digit to test.
const TESTABLE: f64 = 0.5;

/// What a row of the certificate came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The law holds to rounding on all samples that have a digit to test.
    Holds,
    /// The law is violated.
    Violated,
    /// On these samples the law cannot fail: nothing is shown.
    Vacuous,
    /// On more than half of the samples no digit is left to test.
    IllConditioned,
}

impl Verdict {
    /// One word for tables.
    pub fn word(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Violated => "VIOLATED",
            Self::Vacuous => "VACUOUS",
            Self::IllConditioned => "ill-conditioned",
        }
    }
}

/// One law, measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The law.
    pub law: String,
    /// What is measured.
    pub equation: String,
    /// The number of samples.
    pub samples: usize,
    /// On how many of them rounding leaves no digit to test.
    pub ill_conditioned: usize,
    /// The largest ratio; a count of components for bitwise laws, what is
    /// missing to the order for slopes. None where no sample could be tested or a result was NaN.
    pub largest: Option<f64>,
    /// The median.
    pub median: Option<f64>,
    /// What `largest` must stay below.
    pub limit: f64,
    /// What it came to.
    pub verdict: Verdict,
}

/// What was asked, and a row for each law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Certificate {
    /// How the samples were drawn.
    pub options: CertificateOptions,
    /// The laws.
    pub rows: Vec<Row>,
}

impl Certificate {
    /// No law is violated or vacuous, and none is without a testable sample.
    pub fn holds(&self) -> bool {
        !self.rows.is_empty() && self.rows.iter().all(|row| row.verdict == Verdict::Holds)
    }

    /// The largest ratio of all laws with a rounding bound.
    pub fn largest_ratio(&self) -> Option<f64> {
        self.rows
            .iter()
            .filter(|row| row.limit == RATIO_LIMIT)
            .filter_map(|row| row.largest)
            .max_by(f64::total_cmp)
    }
}

/// The samples of a certificate: uniform in |z_i| ≤ `radius`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CertificateOptions {
    /// How many points.
    pub samples: usize,
    /// Half the side of the box.
    pub radius: f64,
    /// The seed.
    pub seed: u64,
}

impl Default for CertificateOptions {
    fn default() -> Self {
        Self { samples: 200, radius: 1.6, seed: 0 }
    }
}

impl CertificateOptions {
    /// Fails unless there are samples, in a box of finite size.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the option and its value.
    pub fn check(&self) -> Result<(), Error> {
        const MOST: usize = 10_000_000;
        const LARGEST: f64 = 1e150;
        if self.samples == 0 || self.samples > MOST {
            return Err(Error::invalid("samples", self.samples, format!("1 to {MOST}")));
        }
        if !(self.radius > 0.0 && self.radius <= LARGEST) {
            let expected = format!("a positive number of at most {LARGEST:e}");
            return Err(Error::invalid("radius", self.radius, expected));
        }
        Ok(())
    }
}

/// The results of one law over the samples.
struct Tally {
    law: String,
    equation: String,
    limit: f64,
    sound_median: [f64; 2],
    ratios: Vec<f64>,
    ill_conditioned: usize,
    /// The samples that each ratio stands for.
    samples_each: usize,
    vacuous: bool,
}

impl Tally {
    fn of(
        law: impl Into<String>,
        equation: impl Into<String>,
        limit: f64,
        results: impl Iterator<Item = Conditioned>,
    ) -> Self {
        let mut tally = Self {
            law: law.into(),
            equation: equation.into(),
            limit,
            sound_median: [0.0, f64::INFINITY],
            ratios: Vec::new(),
            ill_conditioned: 0,
            samples_each: 1,
            vacuous: false,
        };
        for result in results {
            match result {
                Conditioned::Ratio(ratio) => tally.ratios.push(ratio),
                Conditioned::IllConditioned => tally.ill_conditioned += 1,
            }
        }
        tally
    }

    /// Adds the results of the same law on another model.
    fn merge(&mut self, other: Self) {
        self.ratios.extend(other.ratios);
        self.ill_conditioned += other.ill_conditioned;
        self.vacuous |= other.vacuous;
    }

    fn row(self) -> Row {
        let testable = self.ratios.len() * self.samples_each;
        let samples = testable + self.ill_conditioned * self.samples_each;
        let nan = self.ratios.iter().any(|r| r.is_nan());
        let mut sorted = self.ratios;
        sorted.sort_by(f64::total_cmp);
        let usable = !nan && !sorted.is_empty();
        let largest = usable.then(|| sorted[sorted.len() - 1]);
        let median = usable.then(|| sorted[sorted.len() / 2]);
        let verdict = match (largest, median) {
            _ if samples == 0 => Verdict::Vacuous,
            _ if nan => Verdict::Violated,
            (Some(largest), _) if !(largest < self.limit) => Verdict::Violated,
            _ if self.vacuous => Verdict::Vacuous,
            (Some(_), Some(median)) if median < self.sound_median[0] => Verdict::Vacuous,
            (Some(_), Some(median)) if median > self.sound_median[1] => Verdict::Violated,
            _ if (testable as f64) < TESTABLE * samples as f64 => Verdict::IllConditioned,
            _ => Verdict::Holds,
        };
        Row {
            law: self.law,
            equation: self.equation,
            samples,
            ill_conditioned: self.ill_conditioned,
            largest,
            median,
            limit: self.limit,
            verdict,
        }
    }
}

/// Measures the laws that `model` is built to obey.
///
/// A HénonNet: symplecticity and inversion. A gyroceptron: also ψ and I_ε for
/// themselves, I₀ = Id, P₀ = ψ∘Φ_θ∘ψ⁻¹, the slopes of I_ε in ε, and the axioms
/// of the circle action, plain and conjugated. Cost: some 100 evaluations over
/// dual numbers a sample.
pub fn certify(model: &Model, options: CertificateOptions) -> Certificate {
    certify_all(std::slice::from_ref(model), options)
}

/// One certificate for several models, each on samples of its own.
pub fn certify_all(models: &[Model], options: CertificateOptions) -> Certificate {
    let mut tallies: Vec<Tally> = Vec::new();
    for (index, model) in models.iter().enumerate() {
        let own = Samples::draw(model.composition().dof(), index, options).of_model(model);
        if tallies.is_empty() {
            tallies = own;
        } else {
            for other in own {
                match tallies
                    .iter_mut()
                    .find(|t| t.equation == other.equation && t.law == other.law)
                {
                    Some(tally) => tally.merge(other),
                    None => tallies.push(other),
                }
            }
        }
    }
    Certificate { options, rows: tallies.into_iter().map(Tally::row).collect() }
}

/// The laws that any map of the library obeys, such as ψ, I_ε or a conjugated
/// circle action alone: symplecticity, inversion, and that all ways of
/// evaluating it give the same bits.
pub fn certify_map(map: &Composition<f64>, options: CertificateOptions) -> Certificate {
    let tallies = Samples::draw(map.dof(), 0, options).of_map(map);
    Certificate { options, rows: tallies.into_iter().map(Tally::row).collect() }
}

/// The steps of a map followed by those of another.
fn chain<'a>(
    first: &'a Composition<f64>,
    second: &'a Composition<f64>,
) -> Vec<ElementaryStep<'a, f64, TanhPotential<'a, f64>>> {
    let mut steps = first.elementary_steps();
    steps.extend(second.elementary_steps());
    steps
}

/// The number of components that differ in their bits or are not finite.
fn differing(a: &[f64], b: &[f64]) -> usize {
    a.iter().zip(b).filter(|(a, b)| a.to_bits() != b.to_bits() || !a.is_finite()).count()
}

struct Samples {
    dim: usize,
    points: Vec<f64>,
    angles: Vec<[f64; 2]>,
}

impl Samples {
    fn draw(dof: usize, index: usize, options: CertificateOptions) -> Self {
        let dim = 2 * dof;
        let mut stream = Stream::new(options.seed, &format!("certificate/points/{index}"));
        let points = (0..options.samples * dim)
            .map(|_| stream.uniform(-options.radius, options.radius))
            .collect();
        let mut stream = Stream::new(options.seed, &format!("certificate/angles/{index}"));
        let angles = (0..options.samples)
            .map(|_| [stream.uniform(-TAU, TAU), stream.uniform(-TAU, TAU)])
            .collect();
        Self { dim, points, angles }
    }

    /// The laws of any composition of shears.
    fn of_map(&self, map: &Composition<f64>) -> Vec<Tally> {
        let inverse = map.inverted();
        vec![
            self.symplecticity(map),
            self.inversion("inversion of P", "P⁻¹∘P = Id", map, &inverse),
            self.inversion("inversion of P", "P∘P⁻¹ = Id", &inverse, map),
            self.evaluations_agree(map),
        ]
    }

    fn of_model(&self, model: &Model) -> Vec<Tally> {
        let mut out = self.of_map(model.composition());
        if let Model::Gyroceptron(network) = model {
            let psi = network.psi();
            let near_identity = network.near_identity();
            for (law, equation, part) in [
                ("inversion of ψ", "ψ⁻¹∘ψ = Id", &psi),
                ("inversion of I_ε", "I_ε⁻¹∘I_ε = Id", &near_identity),
            ] {
                let part = part.composition();
                out.push(self.inversion(law, equation, part, &part.inverted()));
            }
            out.extend(self.near_identity(network, &near_identity));
            out.extend(self.circle_axioms(network));
        }
        out
    }

    fn each(&self) -> impl Iterator<Item = &[f64]> {
        self.points.chunks_exact(self.dim)
    }

    fn symplecticity(&self, map: &Composition<f64>) -> Tally {
        let steps = map.elementary_steps();
        let ratios =
            self.each().map(|z| Conditioned::Ratio(symplecticity_ratio(&Walk::new(&steps, z))));
        Tally {
            sound_median: SOUND_MEDIAN,
            ..Tally::of("symplecticity of P", "JᵀΩJ = Ω", RATIO_LIMIT, ratios)
        }
    }

    /// The shears that the other rows walk over are what users call, for one
    /// point and for many, forward and back, bit for bit.
    fn evaluations_agree(&self, map: &Composition<f64>) -> Tally {
        let inverse = map.inverted();
        let walk = |steps: &[ElementaryStep<'_, f64, TanhPotential<'_, f64>>], z: &mut [f64]| {
            let mut scratch = vec![0.0; z.len()];
            for step in steps {
                step.apply(z, &mut scratch);
            }
        };
        let batch = |direction| {
            let mut points = self.points.clone();
            map_points(map, direction, &mut points).expect("whole points");
            points
        };
        let (forward, backward) = (batch(Direction::Forward), batch(Direction::Inverse));
        let (steps, inverse_steps) = (map.elementary_steps(), inverse.elementary_steps());
        let counts = self.each().enumerate().map(|(index, z)| {
            let own = index * self.dim..(index + 1) * self.dim;
            let (mut walked, mut single) = (z.to_vec(), z.to_vec());
            walk(&steps, &mut walked);
            map.forward(&mut single);
            let (mut walked_back, mut single_back) = (z.to_vec(), z.to_vec());
            walk(&inverse_steps, &mut walked_back);
            map.inverse(&mut single_back);
            let count = differing(&walked, &single)
                + differing(&walked, &forward[own.clone()])
                + differing(&walked_back, &single_back)
                + differing(&walked_back, &backward[own]);
            Conditioned::Ratio(count as f64)
        });
        Tally::of("evaluation", "shears = single = batch, bitwise", COUNT_LIMIT, counts)
    }

    fn inversion(
        &self,
        law: &str,
        equation: &str,
        map: &Composition<f64>,
        inverse: &Composition<f64>,
    ) -> Tally {
        let steps = chain(map, inverse);
        Tally::of(law, equation, RATIO_LIMIT, self.each().map(|z| inversion_ratio(&steps, z)))
    }

    fn near_identity(&self, network: &Gyroceptron<f64>, own: &HenonNet<f64>) -> Vec<Tally> {
        let at = |epsilon: f64| own.composition().with_epsilon(epsilon);
        let bitwise = |law: &str, equation: &str, count: &dyn Fn(&[f64]) -> usize| {
            let counts = self.each().map(|z| Conditioned::Ratio(count(z) as f64));
            Tally::of(law, equation, COUNT_LIMIT, counts)
        };
        let (zero, negative_zero) = (at(0.0), at(-0.0));
        let limit = network.with_epsilon(0.0);
        let rotation = network.conjugated_circle_action(network.theta());
        let mut out = vec![
            bitwise("near identity", "I₀ = Id, bitwise", &|z| differing_components(&zero, z)),
            bitwise("near identity", "I₋₀ = Id, bitwise", &|z| {
                differing_components(&negative_zero, z)
            }),
            bitwise("near periodicity", "P₀ = ψ∘Φ_θ∘ψ⁻¹, bitwise", &|z| {
                let (mut a, mut b) = (z.to_vec(), z.to_vec());
                limit.forward(&mut a);
                rotation.forward(&mut b);
                differing(&a, &b)
            }),
        ];
        let size = |e: f64| near_identity_size(&at(e), &self.points);
        // Such that I_ε moves points by about a hundredth of their size.
        let radius = self.points.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let response = size(1e-6) / 1e-6;
        let largest = f64::min(1.0, 1e-2 * radius / response);
        let epsilons: Vec<f64> = (0..6).map(|k| largest * libm::exp2(-f64::from(k))).collect();
        let undoing = |e: f64| near_identity_undoing(&at(e), &at(-e), &self.points);
        out.push(self.order("|I_ε − Id| = O(ε)", 1.0, &epsilons, &size));
        out.push(self.order("|I₋ε∘I_ε − Id| = O(ε²)", 2.0, &epsilons, &undoing));
        out
    }

    /// How much is missing to the order in ε of a quantity that vanishes with
    /// it, from the values that stand out of rounding.
    fn order(
        &self,
        equation: &str,
        order: f64,
        epsilons: &[f64],
        value: &dyn Fn(f64) -> f64,
    ) -> Tally {
        let radius = self.points.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let floor = ABOVE_ROUNDING * f64::unit_roundoff() * radius;
        let (epsilons, values): (Vec<f64>, Vec<f64>) = epsilons
            .iter()
            .map(|&epsilon| (epsilon, value(epsilon)))
            .filter(|(_, size)| !(*size <= floor))
            .unzip();
        // A network that does not respond to ε has no slope.
        let vacuous = values.len() < 3;
        let slope = log_slope(&epsilons, &values);
        let shortfall = if slope >= order { 0.0 } else { order - slope };
        let result = Conditioned::Ratio(if vacuous { 0.0 } else { shortfall });
        Tally {
            samples_each: self.each().count(),
            vacuous,
            ..Tally::of("near identity", equation, SLOPE_LIMIT, std::iter::once(result))
        }
    }

    fn circle_axioms(&self, network: &Gyroceptron<f64>) -> Vec<Tally> {
        type Form = fn(&[f64; 2]) -> CircleAxiom;
        let axioms: [(&str, &str, Form); 4] = [
            ("identity", "Φ₀ = Id", |_| CircleAxiom::Identity),
            ("periodicity", "Φ_{θ+2π} = Φ_θ", |a| CircleAxiom::Periodicity(a[0])),
            ("additivity", "Φ_{θ₁+θ₂} = Φ_θ₁∘Φ_θ₂", |a| {
                CircleAxiom::Additivity(a[0], a[1])
            }),
            ("inverse", "Φ₋θ∘Φ_θ = Id", |a| CircleAxiom::Inverse(a[0])),
        ];
        let action = &network.shape().circle_action;
        let samples = || self.each().zip(&self.angles);
        let plain = axioms.iter().map(|(name, equation, form)| {
            let ratios =
                samples().map(|(z, a)| Conditioned::Ratio(circle_axiom_ratio(action, form(a), z)));
            Tally::of(format!("circle action: {name}"), *equation, RATIO_LIMIT, ratios)
        });
        let conjugated = axioms.iter().map(|(name, equation, form)| {
            let ratios = samples().map(|(z, a)| conjugated_axiom_ratio(network, form(a), z));
            Tally::of(format!("conjugated by ψ: {name}"), *equation, RATIO_LIMIT, ratios)
        });
        plain.chain(conjugated).collect()
    }
}
