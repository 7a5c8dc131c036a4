//! The structure certificate of a model.

use super::circle_axioms::{CircleAxiom, circle_axiom_ratio, conjugated_axiom_ratio};
use super::inversion::{Conditioned, inversion_ratio};
use super::near_identity::{
    differing_components, log_slope, near_identity_size, near_identity_undoing,
};
use super::{Walk, symplecticity_ratio};
use crate::layer::{Elementary, TanhPotential};
use crate::network::{Composition, Gyroceptron, HenonNet, Model, Stream};
use crate::phase::Map;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Every ratio must stay below it.
const RATIO_LIMIT: f64 = 10.0;
/// Slopes in ε may fall short of 1 and 2 by this; they may exceed them, as they
/// do where the potentials are odd and the leading term vanishes.
const SLOPE_LIMIT: f64 = 0.1;
/// A count of components that must be none.
const COUNT_LIMIT: f64 = 0.5;
/// The median of ρ_S of a computation whose errors are those of rounding; below
/// it the samples saturate and the test shows nothing.
const VACUOUS_BELOW: f64 = 0.05;

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
    /// On no sample is a digit left to test.
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

/// The results of one law over the samples.
struct Tally {
    law: String,
    equation: String,
    limit: f64,
    vacuous_below: f64,
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
            vacuous_below: 0.0,
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
        let samples = (self.ratios.len() + self.ill_conditioned) * self.samples_each;
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
            (Some(_), Some(median)) if median < self.vacuous_below => Verdict::Vacuous,
            (Some(_), _) => Verdict::Holds,
            (None, _) => Verdict::IllConditioned,
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

/// One certificate for several models of one architecture, each on samples of
/// its own.
pub fn certify_all(models: &[Model], options: CertificateOptions) -> Certificate {
    let mut tallies: Vec<Tally> = Vec::new();
    for (index, model) in models.iter().enumerate() {
        let own = Samples::draw(model.composition().dof(), index, options).tallies(model);
        if tallies.is_empty() {
            tallies = own;
        } else {
            for (tally, other) in tallies.iter_mut().zip(own) {
                tally.merge(other);
            }
        }
    }
    Certificate { options, rows: tallies.into_iter().map(Tally::row).collect() }
}

/// The steps of a map followed by those of another.
fn chain<'a>(
    first: &'a Composition<f64>,
    second: &'a Composition<f64>,
) -> Vec<Elementary<'a, f64, TanhPotential<'a, f64>>> {
    let mut steps = first.elementary();
    steps.extend(second.elementary());
    steps
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

    fn tallies(&self, model: &Model) -> Vec<Tally> {
        let map = model.composition();
        let inverse = map.inverted();
        let mut out = vec![
            self.symplecticity(map),
            self.inversion("inversion of P", "P⁻¹∘P = Id", map, &inverse),
            self.inversion("inversion of P", "P∘P⁻¹ = Id", &inverse, map),
        ];
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
        let steps = map.elementary();
        let ratios =
            self.each().map(|z| Conditioned::Ratio(symplecticity_ratio(&Walk::new(&steps, z))));
        Tally {
            vacuous_below: VACUOUS_BELOW,
            ..Tally::of("symplecticity of P", "JᵀΩJ = Ω", RATIO_LIMIT, ratios)
        }
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
                a.iter().zip(&b).filter(|(a, b)| a.to_bits() != b.to_bits()).count()
            }),
        ];
        // Small enough for the leading term, large enough to stand out of
        // rounding; scaled to how strongly this network responds to ε.
        let response = near_identity_size(&at(1e-6), &self.points) / 1e-6;
        let epsilons: Vec<f64> =
            (0..6).map(|k| 1e-3 / response.max(1.0) * libm::exp2(-f64::from(k))).collect();
        let first: Vec<f64> =
            epsilons.iter().map(|&e| near_identity_size(&at(e), &self.points)).collect();
        let second: Vec<f64> = epsilons
            .iter()
            .map(|&e| near_identity_undoing(&at(e), &at(-e), &self.points))
            .collect();
        for (values, order, equation) in
            [(first, 1.0, "|I_ε − Id| = O(ε)"), (second, 2.0, "|I₋ε∘I_ε − Id| = O(ε²)")]
        {
            let slope = log_slope(&epsilons, &values);
            let shortfall = if slope >= order { 0.0 } else { order - slope };
            // A network that does not respond to ε has no slope.
            let vacuous = values.iter().all(|v| *v == 0.0);
            let result = Conditioned::Ratio(if vacuous { 0.0 } else { shortfall });
            out.push(Tally {
                samples_each: self.each().count(),
                vacuous,
                ..Tally::of("near identity", equation, SLOPE_LIMIT, std::iter::once(result))
            });
        }
        out
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
