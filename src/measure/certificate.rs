//! The structure certificate of a model: all laws on seeded samples.

use super::laws::{self, Samples};
use super::tally::{RATIO_LIMIT, Row, Tally, Verdict, merged};
use super::{Measurable, NearlyPeriodic, NormalFormed};
use crate::error::Error;
use crate::network::Model;
use crate::phase::Direction;
use crate::scalar::max_or_nan;
use serde::{Deserialize, Serialize};

/// What was asked, and a row for each law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Certificate {
    /// How the samples were drawn.
    pub options: CertificateOptions,
    /// The laws.
    pub rows: Vec<Row>,
}

impl Certificate {
    fn of(options: CertificateOptions, tallies: impl IntoIterator<Item = Tally>) -> Self {
        Self { options, rows: merged(tallies).iter().map(Tally::row).collect() }
    }

    /// No law is violated or vacuous, and none is without a testable sample.
    pub fn holds(&self) -> bool {
        let holds = |row: &Row| matches!(row.verdict, Verdict::Holds | Verdict::Reported);
        !self.rows.is_empty() && self.rows.iter().all(holds)
    }

    /// The largest ratio of all laws with a rounding bound; NaN if one is.
    pub fn largest_ratio(&self) -> Option<f64> {
        self.rows
            .iter()
            .filter(|row| row.limit == RATIO_LIMIT && row.verdict != Verdict::Reported)
            .filter_map(|row| match row.verdict {
                Verdict::Violated => Some(row.largest.unwrap_or(f64::NAN)),
                _ => row.largest,
            })
            .reduce(max_or_nan)
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
    /// [`Error::CountOutOfRange`] or [`Error::OutOfRange`] with the option.
    pub fn check(&self) -> Result<(), Error> {
        const MOST: usize = 10_000_000;
        const LARGEST: f64 = 1e150;
        Error::check_count_range("samples", self.samples, 1, MOST)?;
        Error::check_range("radius", self.radius, Error::LEAST_POSITIVE, LARGEST)
    }
}

/// Measures the laws that `model` is built to obey.
///
/// A HénonNet or SympNet: those of [`certify_map`]. A gyroceptron: those of
/// [`certify_family`] and [`laws::formula_of_generator`]. One in normal form: those of
/// [`certify_normal_form`]. HénonNets and gyroceptrons:
/// [`laws::exact_relations`]. Cost: some 200 evaluations over dual numbers a
/// sample.
pub fn certify(model: &Model, options: CertificateOptions) -> Certificate {
    certify_all(std::slice::from_ref(model), options)
}

/// One certificate for several models, each on samples of its own.
pub fn certify_all(models: &[Model], options: CertificateOptions) -> Certificate {
    let tallies = models.iter().enumerate().flat_map(|(index, model)| {
        let samples = Samples::draw(model.composition().dof(), index, options);
        let mut out = match model {
            Model::HenonNet(network) => of_map(network, &samples),
            Model::SympNet(network) => of_map(network, &samples),
            Model::NormalForm(network) => of_normal_form(network, &samples),
            Model::Gyroceptron(network) => {
                let mut out = of_family(network, &samples);
                out.push(laws::formula_of_generator(network, samples.points()));
                out
            }
        };
        if matches!(model, Model::HenonNet(_) | Model::Gyroceptron(_)) {
            out.extend(laws::exact_relations(model, samples.points()));
        }
        out
    });
    Certificate::of(options, tallies)
}

/// The laws of any symplectic map that is invertible in closed form:
/// symplecticity, inversion of the map and of each of its layers, that all
/// ways of evaluating it give the same bits, and, for information, its
/// determinant.
///
/// For a map of your own, [`OneStep`](super::OneStep) makes a [`Measurable`] of
/// anything that is written over the number type:
///
/// ```
/// use gyroceptron::measure::{CertificateOptions, OneStep, certify_map};
/// use gyroceptron::phase::Map;
/// use gyroceptron::scalar::Elementary;
///
/// /// p ← p + K sin q, q ← q + p.
/// struct StandardMap(f64);
///
/// impl<S: Elementary> Map<S> for StandardMap {
///     fn dof(&self) -> usize {
///         1
///     }
///     fn forward(&self, z: &mut [S]) {
///         z[1] = z[1] + S::from_f64(self.0) * z[0].sin_cos().0;
///         z[0] = z[0] + z[1];
///     }
///     fn inverse(&self, z: &mut [S]) {
///         z[0] = z[0] - z[1];
///         z[1] = z[1] - S::from_f64(self.0) * z[0].sin_cos().0;
///     }
/// }
///
/// let options = CertificateOptions { radius: 3.0, ..Default::default() };
/// assert!(certify_map(&OneStep(StandardMap(1.2)), options).holds());
/// ```
pub fn certify_map(map: &dyn Measurable, options: CertificateOptions) -> Certificate {
    Certificate::of(options, of_map(map, &Samples::draw(map.dof(), 0, options)))
}

/// The laws of a nearly-periodic map P_ε = I_ε∘ψ∘Φ_θ∘ψ⁻¹: those of
/// [`certify_map`], the inversion of ψ and I_ε, I₀ = Id, P₀ = ψ∘Φ_θ∘ψ⁻¹, the
/// slopes of I_ε in ε, the axioms of the circle action, plain and conjugated,
/// and, for information, the drift of μ₀.
pub fn certify_family(family: &dyn NearlyPeriodic, options: CertificateOptions) -> Certificate {
    Certificate::of(options, of_family(family, &Samples::draw(family.dof(), 0, options)))
}

/// The laws of a map P = χ∘R∘χ⁻¹ in normal form: those of [`certify_map`], that it is
/// this composition, that it commutes with the action conjugated by χ, and that R
/// keeps the actions.
pub fn certify_normal_form(map: &dyn NormalFormed, options: CertificateOptions) -> Certificate {
    Certificate::of(options, of_normal_form(map, &Samples::draw(map.dof(), 0, options)))
}

fn of_normal_form(map: &dyn NormalFormed, samples: &Samples) -> Vec<Tally> {
    let points = samples.points();
    // The weights of a twist of a long flow time cancel: its bounds are further from its errors
    // than those of a layer, so that these need not show as in `laws::symplecticity`.
    let symplecticity = laws::symplecticity_of("symplecticity of P", map, points);
    let mut out = of_map_with(symplecticity, map, samples);
    out.push(laws::normal_form(map, points));
    out.push(laws::equivariance(map, samples));
    out.extend(laws::actions(map, points));
    out
}

fn of_map(map: &dyn Measurable, samples: &Samples) -> Vec<Tally> {
    of_map_with(laws::symplecticity(map, samples.points()), map, samples)
}

fn of_map_with(symplecticity: Tally, map: &dyn Measurable, samples: &Samples) -> Vec<Tally> {
    let points = samples.points();
    let mut out = vec![
        symplecticity,
        laws::inversion("inversion of P", "P⁻¹∘P = Id", map, Direction::Forward, points),
        laws::inversion("inversion of P", "P∘P⁻¹ = Id", map, Direction::Inverse, points),
    ];
    out.extend(laws::layers(map, points));
    out.push(laws::evaluation(map, points));
    out.push(laws::determinant(map, points));
    out
}

fn of_family(family: &dyn NearlyPeriodic, samples: &Samples) -> Vec<Tally> {
    let points = samples.points();
    let mut out = of_map(family, samples);
    let psi = family.conjugation();
    let near_identity = family.near_identity_at(family.epsilon());
    let forward = Direction::Forward;
    out.push(laws::inversion("inversion of ψ", "ψ⁻¹∘ψ = Id", &*psi, forward, points));
    out.push(laws::inversion(
        "inversion of I_ε",
        "I_ε⁻¹∘I_ε = Id",
        &*near_identity,
        forward,
        points,
    ));
    out.extend(laws::identity_at_zero(family, points));
    out.extend(laws::near_identity_orders(family, points));
    out.push(laws::near_periodicity(family, points));
    out.extend(laws::circle_action(family, samples));
    out.extend(laws::conjugated_circle_action(family, samples));
    out.push(laws::adiabatic_invariance(family, points));
    out
}
