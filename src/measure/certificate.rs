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
/// Slopes in ε must be within this of 1 and 2.
const SLOPE_LIMIT: f64 = 0.1;
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
    /// The largest ratio; a count of components for bitwise laws, a distance
    /// for slopes. None where no sample could be tested or a result was NaN.
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

/// Collects the results of one law over the samples.
struct Tally {
    ratios: Vec<f64>,
    ill_conditioned: usize,
}

impl Tally {
    fn of(results: impl Iterator<Item = Conditioned>) -> Self {
        let mut tally = Self { ratios: Vec::new(), ill_conditioned: 0 };
        for result in results {
            match result {
                Conditioned::Ratio(ratio) => tally.ratios.push(ratio),
                Conditioned::IllConditioned => tally.ill_conditioned += 1,
            }
        }
        tally
    }

    fn row(self, law: &str, equation: &str, limit: f64, vacuous_below: f64) -> Row {
        let samples = self.ratios.len() + self.ill_conditioned;
        let nan = self.ratios.iter().any(|r| r.is_nan());
        let mut sorted = self.ratios;
        sorted.sort_by(f64::total_cmp);
        let usable = !nan && !sorted.is_empty();
        let largest = usable.then(|| sorted[sorted.len() - 1]);
        let median = usable.then(|| sorted[sorted.len() / 2]);
        let verdict = match (largest, median) {
            _ if samples == 0 => Verdict::Vacuous,
            _ if nan => Verdict::Violated,
            (Some(largest), _) if !(largest < limit) => Verdict::Violated,
            (Some(_), Some(median)) if median < vacuous_below => Verdict::Vacuous,
            (Some(_), _) => Verdict::Holds,
            (None, _) => Verdict::IllConditioned,
        };
        Row {
            law: law.into(),
            equation: equation.into(),
            samples,
            ill_conditioned: self.ill_conditioned,
            largest,
            median,
            limit,
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
    let dim = 2 * model.composition().dof();
    let mut stream = Stream::new(options.seed, "certificate/points");
    let points: Vec<f64> = (0..options.samples * dim)
        .map(|_| stream.uniform(-options.radius, options.radius))
        .collect();
    let mut angles = Stream::new(options.seed, "certificate/angles");
    let angles: Vec<[f64; 2]> = (0..options.samples)
        .map(|_| [angles.uniform(-TAU, TAU), angles.uniform(-TAU, TAU)])
        .collect();
    let samples = Samples { dim, points, angles };

    let mut rows = vec![samples.symplecticity("P", model.composition())];
    rows.extend(samples.inversion("P", model.composition()));
    if let Model::Gyroceptron(network) = model {
        let psi = network.psi();
        let near_identity = network.near_identity();
        rows.push(samples.inversion_row("inversion of ψ", "ψ⁻¹∘ψ = Id", psi.composition()));
        rows.push(samples.inversion_row(
            "inversion of I_ε",
            "I_ε⁻¹∘I_ε = Id",
            near_identity.composition(),
        ));
        rows.extend(samples.near_identity(network, &near_identity));
        rows.extend(samples.circle_axioms(network));
    }
    Certificate { options, rows }
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
    fn each(&self) -> impl Iterator<Item = &[f64]> {
        self.points.chunks_exact(self.dim)
    }

    fn symplecticity(&self, name: &str, map: &Composition<f64>) -> Row {
        let steps = map.elementary();
        Tally::of(self.each().map(|z| Conditioned::Ratio(symplecticity_ratio(&Walk::new(&steps, z)))))
            .row(&format!("symplecticity of {name}"), "JᵀΩJ = Ω", RATIO_LIMIT, VACUOUS_BELOW)
    }

    fn inversion(&self, name: &str, map: &Composition<f64>) -> [Row; 2] {
        let inverse = map.inverted();
        let there_and_back = chain(map, &inverse);
        let back_and_there = chain(&inverse, map);
        let law = format!("inversion of {name}");
        [(there_and_back, format!("{name}⁻¹∘{name} = Id")), (back_and_there, format!("{name}∘{name}⁻¹ = Id"))]
            .map(|(steps, equation)| {
                Tally::of(self.each().map(|z| inversion_ratio(&steps, z)))
                    .row(&law, &equation, RATIO_LIMIT, 0.0)
            })
    }

    fn inversion_row(&self, law: &str, equation: &str, map: &Composition<f64>) -> Row {
        let inverse = map.inverted();
        let steps = chain(map, &inverse);
        Tally::of(self.each().map(|z| inversion_ratio(&steps, z)))
            .row(law, equation, RATIO_LIMIT, 0.0)
    }

    fn near_identity(&self, network: &Gyroceptron<f64>, own: &HenonNet<f64>) -> Vec<Row> {
        let at = |epsilon: f64| own.composition().with_epsilon(epsilon);
        let count = |map: &Composition<f64>| {
            Tally::of(self.each().map(|z| Conditioned::Ratio(differing_components(map, z) as f64)))
        };
        let limit = network.with_epsilon(0.0);
        let rotation = network.conjugated_circle_action(network.theta());
        let differences = self.each().map(|z| {
            let (mut a, mut b) = (z.to_vec(), z.to_vec());
            limit.forward(&mut a);
            rotation.forward(&mut b);
            let differing = a.iter().zip(&b).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
            Conditioned::Ratio(differing as f64)
        });
        let exact = 0.5;
        let mut rows = vec![
            count(&at(0.0)).row("near identity", "I₀ = Id, bitwise", exact, 0.0),
            count(&at(-0.0)).row("near identity", "I₋₀ = Id, bitwise", exact, 0.0),
            Tally::of(differences).row(
                "near periodicity",
                "P₀ = ψ∘Φ_θ∘ψ⁻¹, bitwise",
                exact,
                0.0,
            ),
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
        for (values, order, equation) in [
            (first, 1.0, "|I_ε − Id| ~ ε¹"),
            (second, 2.0, "|I₋ε∘I_ε − Id| ~ ε²"),
        ] {
            let distance = (log_slope(&epsilons, &values) - order).abs();
            let mut row = Tally::of(std::iter::once(Conditioned::Ratio(distance))).row(
                "near identity",
                equation,
                SLOPE_LIMIT,
                0.0,
            );
            row.samples = self.each().count();
            // A network that does not respond to ε has no slope.
            if values.iter().all(|v| *v == 0.0) {
                row.verdict = Verdict::Vacuous;
            }
            rows.push(row);
        }
        rows
    }

    fn circle_axioms(&self, network: &Gyroceptron<f64>) -> Vec<Row> {
        type Form = fn(&[f64; 2]) -> CircleAxiom;
        let axioms: [(&str, &str, Form); 4] = [
            ("Φ₀ = Id", "identity", |_| CircleAxiom::Identity),
            ("Φ_{θ+2π} = Φ_θ", "periodicity", |a| CircleAxiom::Periodicity(a[0])),
            ("Φ_{θ₁+θ₂} = Φ_θ₁∘Φ_θ₂", "additivity", |a| CircleAxiom::Additivity(a[0], a[1])),
            ("Φ₋θ∘Φ_θ = Id", "inverse", |a| CircleAxiom::Inverse(a[0])),
        ];
        let action = &network.shape().circle_action;
        let mut rows = Vec::new();
        for (equation, name, form) in axioms {
            let plain = self
                .each()
                .zip(&self.angles)
                .map(|(z, a)| Conditioned::Ratio(circle_axiom_ratio(action, form(a), z)));
            rows.push(Tally::of(plain).row(
                &format!("circle action: {name}"),
                equation,
                RATIO_LIMIT,
                0.0,
            ));
        }
        for (equation, name, form) in axioms {
            let conjugated = self
                .each()
                .zip(&self.angles)
                .map(|(z, a)| conjugated_axiom_ratio(network, form(a), z));
            rows.push(Tally::of(conjugated).row(
                &format!("conjugated by ψ: {name}"),
                equation,
                RATIO_LIMIT,
                0.0,
            ));
        }
        rows
    }
}
