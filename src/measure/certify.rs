//! The structure certificate of a model: all laws on seeded samples.
//!
//! It is a sampled test and no proof: it holds for the points that were drawn.

use super::laws::{self, NO_INVERSE, Samples};
use super::samples::CertificateOptions;
use super::tally::{COUNT_LIMIT, RATIO_LIMIT, Row, Tally, Verdict, merged};
use super::{
    coordinate::Coordinate,
    equivariance::NormalFormed,
    measurable::{Measurable, NearlyPeriodic},
};
use crate::layer::Reversor;
use crate::network::{Block, Layers, Model, Part, Structure};
use crate::phase::{Direction, Map};
use crate::scalar::max_or_nan;
use crate::stopping::unless_stopped;
use serde::{Deserialize, Serialize};
use std::fmt;

/// The result of a sampled test of the laws of a map: the options, and a row for each law.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Certificate {
    /// How the samples were drawn, and how many of them.
    pub options: CertificateOptions,
    /// The [domain](Measurable::domain) of the samples; empty for the box |z_i| ≤ `radius`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub domain: Vec<Coordinate>,
    /// The laws that were checked, a row each.
    pub rows: Vec<Row>,
}

impl Certificate {
    pub(super) fn of(
        options: CertificateOptions,
        tallies: impl IntoIterator<Item = Tally>,
    ) -> Self {
        let rows = merged(tallies).iter().map(Tally::row).collect();
        Self { options, domain: Vec::new(), rows }
    }

    /// Where the samples are, in words: `uniform in |z_i| ≤ 1.6`, or the interval of each coordinate.
    pub fn sampled_box(&self) -> String {
        if self.domain.is_empty() {
            return format!("uniform in |z_i| ≤ {}", self.options.radius);
        }
        let of = |coordinate: &Coordinate| {
            let (low, high) = coordinate.range(self.options.radius);
            format!("[{low:.3e}, {high:.3e}]")
        };
        format!("within {}", self.domain.iter().map(of).collect::<Vec<_>>().join(" × "))
    }

    /// With the domain of the map.
    fn within(self, map: &(impl Measurable + ?Sized)) -> Self {
        self.with_domain(map.domain())
    }

    pub(super) fn with_domain(self, domain: Vec<Coordinate>) -> Self {
        Self { domain, ..self }
    }

    /// Whether every law holds or is reported for information only, and there is at least one law.
    pub fn holds(&self) -> bool {
        let holds = |row: &Row| matches!(row.verdict, Verdict::Holds | Verdict::Reported);
        !self.rows.is_empty() && self.rows.iter().all(holds)
    }

    /// One line such as "holds: 14 laws, headroom 7.3 × (JᵀΩJ = Ω), 0 vacuous", or the laws that
    /// do not hold. The headroom is the smallest of all laws; it is left out where none deviated.
    pub fn summary(&self) -> String {
        let judged = self.rows.iter().filter(|row| row.verdict != Verdict::Reported);
        let (good, bad): (Vec<&Row>, Vec<&Row>) =
            judged.partition(|row| row.verdict == Verdict::Holds);
        let of = |verdict| bad.iter().filter(|row| row.verdict == verdict).count();
        let vacuous = of(Verdict::Vacuous);
        let (count, all) = (good.len(), good.len() + bad.len());
        let tight = good.iter().filter_map(|row| Some((row, row.headroom()?)));
        let headroom = match tight.min_by(|a, b| a.1.total_cmp(&b.1)) {
            Some((row, headroom)) if headroom < 1e4 => {
                format!(", headroom {headroom:.1} × ({})", row.equation)
            }
            Some((row, headroom)) => format!(", headroom {headroom:.0e} × ({})", row.equation),
            None => String::new(),
        };
        let untested = self.rows.iter().filter(|row| row.equation.ends_with(NO_INVERSE)).count();
        let untested = match untested {
            0 => String::new(),
            count => format!(", {count} not tested: {NO_INVERSE}"),
        };
        if self.holds() {
            return format!("holds: {all} laws{headroom}, {vacuous} vacuous{untested}");
        }
        let mut out = format!(
            "DOES NOT HOLD: {} of {all} laws violated, {vacuous} vacuous, {} ill-conditioned, \
             {count} hold{headroom}{untested}",
            of(Verdict::Violated),
            of(Verdict::IllConditioned),
        );
        for row in bad {
            out.push_str(&format!("; {} {}: {}", row.law, row.equation, row.verdict.word()));
        }
        out
    }

    /// Panics unless the certificate [holds](Certificate::holds).
    ///
    /// # Panics
    /// With the certificate, each law that does not hold, the worst point, the seed and what
    /// to try.
    #[track_caller]
    pub fn assert_holds(&self) {
        assert!(self.holds(), "{self}");
    }

    /// A line for each law that does not hold: by how much, the worst point, and what to try.
    pub fn advice(&self) -> Vec<String> {
        let bad = |row: &&Row| !matches!(row.verdict, Verdict::Holds | Verdict::Reported);
        self.rows.iter().filter(bad).map(|row| self.advice_on(row)).collect()
    }

    fn advice_on(&self, row: &Row) -> String {
        let CertificateOptions { samples, radius, seed } = self.options;
        let mut out = format!("{} {}: {}", row.law, row.equation, row.verdict.word());
        match (row.largest, row.limit) {
            (None, _) if row.verdict == Verdict::Violated => {
                out.push_str(", a result or its bound is not finite")
            }
            (Some(largest), RATIO_LIMIT) => {
                let (ratio, median) = (short(largest), row.median.map_or("–".into(), short));
                out.push_str(&format!(
                    ", {ratio} times the rounding scale at worst, {median} in the median"
                ));
            }
            (Some(largest), limit) => {
                out.push_str(&format!(", {} where less than {limit} is to be", short(largest)));
            }
            (None, _) => {}
        }
        if let (Some(point), true) = (&row.worst, row.verdict == Verdict::Violated) {
            let numbers: Vec<String> = point.iter().map(|v| format!("{v:?}")).collect();
            out.push_str(&format!(" at z = [{}]", numbers.join(", ")));
        }
        let place = match &self.domain[..] {
            [] => format!("radius {radius}"),
            domain => format!("domain {domain:?}, else radius {radius}"),
        };
        out.push_str(&format!(" ({samples} samples, {place}, seed {seed}). "));
        let symplectic = row.law.starts_with("symplecticity");
        let inversion = row.law.starts_with("inversion");
        let bitwise = row.limit == COUNT_LIMIT;
        out.push_str(match row.verdict {
            Verdict::Violated if row.largest.is_none() => {
                "Try: the map there, on `f64` and on duals, which have to give the same bits; where \
                 it is not defined, another domain (`WithDomain`) or radius; where it solves \
                 equations, another `guess`."
            }
            Verdict::Violated if symplectic => {
                "Coordinates have to be canonical, q₁ … qₙ, p₁ … pₙ. Try: the Jacobian there \
                 (`measure::jacobian`) and JᵀΩJ − Ω (`symplecticity_defect`), whose rows show which coordinates; then the steps of \
                 the map one by one. What is solved for has to be given as `Implicit`."
            }
            Verdict::Violated if inversion => {
                "Try: the map and then its inverse there, and which coordinate does not come \
                 back; an angle has to be declared as one (`Coordinate::Angle`)."
            }
            Verdict::Violated if bitwise => {
                "Try: both sides there; they have to do the same operations in the same order."
            }
            Verdict::Violated => "Try: both sides of the equation there.",
            Verdict::Vacuous if row.samples == 0 => "Try: more samples.",
            Verdict::Vacuous => {
                "The rounding scales are far above the errors, so that a defect would hide. Try: \
                 a long composition as `Steps`, equations that are solved as `Implicit`; other \
                 points, where the map moves them."
            }
            Verdict::IllConditioned => {
                "Rounding leaves no digit to test. Try: a smaller radius, or fewer steps."
            }
            Verdict::Holds | Verdict::Reported => "",
        });
        out
    }

    /// The largest ratio over all laws that have a rounding scale; NaN if one of them is.
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

/// Two digits, or as a power of ten.
fn short(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || (0.01..1000.0).contains(&size) {
        format!("{value:.2}")
    } else {
        format!("{value:.1e}")
    }
}

/// The [summary](Certificate::summary), the rows, and what to try where one does not hold.
impl fmt::Display for Certificate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.summary())?;
        let number = |value: Option<f64>| value.map_or("–".into(), short);
        let heading = ["law", "measured", "samples", "largest", "median", "limit", "verdict"];
        let mut cells = vec![heading.map(String::from)];
        for row in &self.rows {
            cells.push([
                row.law.clone(),
                row.equation.clone(),
                match row.ill_conditioned {
                    0 => row.samples.to_string(),
                    ill => format!("{} ({ill} ill-conditioned)", row.samples),
                },
                number(row.largest),
                number(row.median),
                row.limit.to_string(),
                row.verdict.word().to_owned(),
            ]);
        }
        let width = |column: usize| {
            cells.iter().map(|row: &[String; 7]| row[column].chars().count()).max().unwrap_or(0)
        };
        let widths: [usize; 7] = std::array::from_fn(width);
        for row in &cells {
            let padded: Vec<String> =
                row.iter().zip(widths).map(|(cell, width)| format!("{cell:<width$}")).collect();
            writeln!(f, "{}", padded.join("  ").trim_end())?;
        }
        for line in self.advice() {
            writeln!(f, "- {line}")?;
        }
        Ok(())
    }
}

/// Tests on samples the laws that `model` is built to obey. The [structure](Structure) of its list of blocks
/// determines the laws.
///
/// | structure | laws |
/// |---|---|
/// | plain | those of [`certify_map`] |
/// | nearly periodic | those of [`certify_family`], and [`laws::formula_of_generator`] where I_ε is of Hénon layers |
/// | normal form | those of [`certify_normal_form`] |
/// | nearly integrable | those of [`certify_map`], and at ε = 0 those of a normal form |
/// | mixed | those of [`certify_map`], I₀ = Id, P₀ = ψ∘Φ_θ∘ψ⁻¹ and the axioms of the circle action |
///
/// Models with a [reversor](Reversor) are tested for [`laws::reversibility`] too, and at ε = 0 for
/// [`laws::reversible_at_zero`]. Models whose steps are shears are tested for
/// [`laws::inversion_on_grid`], and networks of Hénon layers alone for [`laws::exact_relations`].
/// Where a layer is not symplectic, symplecticity is reported and not claimed.
///
/// Cost: some 200 evaluations over dual numbers for each sample.
pub fn certify(model: &Model, options: CertificateOptions) -> Certificate {
    certify_all(std::slice::from_ref(model), options)
}

/// [`certify`] that can be stopped: it calls `go_on` between samples, several times a second, and
/// returns None when the answer is false.
pub fn certify_unless_stopped(
    model: &Model,
    options: CertificateOptions,
    go_on: impl FnMut() -> bool + 'static,
) -> Option<Certificate> {
    unless_stopped(go_on, || certify(model, options))
}

/// Whether all points, and where they go and come from, are in the box of the model's polynomials.
fn is_within_boxes(model: &Model, points: &[f64]) -> bool {
    if !model.architecture().has_polynomials() {
        return true;
    }
    points.chunks_exact(2 * model.composition().dof()).all(|z| {
        let moved = |direction| {
            let mut z = z.to_vec();
            model.composition().run(direction, &mut z);
            z
        };
        let [back, ahead] = [Direction::Inverse, Direction::Forward].map(moved);
        [&back[..], z, &ahead].iter().all(|z| model.is_in_box(z))
    })
}

/// One certificate for several models, each tested on its own samples.
///
/// Networks of polynomials are not tested outside their box: the radius is reduced until the samples,
/// their images and their preimages are inside. [`Certificate::options`] has the radius used.
pub fn certify_all(models: &[Model], mut options: CertificateOptions) -> Certificate {
    let in_their_boxes = |options: CertificateOptions| {
        models.iter().enumerate().all(|(index, model)| {
            let samples = Samples::draw(model.composition().dof(), index, options);
            is_within_boxes(model, samples.points())
        })
    };
    // A box that holds no sample of any size is none: the laws say so.
    for _ in 0..64 {
        if in_their_boxes(options) {
            break;
        }
        options.radius *= 0.9;
    }
    let tallies = models.iter().enumerate().flat_map(|(index, model)| {
        let samples = Samples::draw(model.composition().dof(), index, options);
        let architecture = model.architecture();
        let symplectic = architecture.is_symplectic();
        let points = samples.points();
        let mut out = match architecture.structure() {
            Structure::Plain if symplectic => of_map(model, &samples),
            Structure::Plain => of_any_map(model, &samples),
            Structure::NearlyPeriodic if symplectic => of_family(model, &samples),
            Structure::NearlyPeriodic => of_any_family(model, &samples),
            Structure::Mixed => of_mixed(model, symplectic, &samples),
            Structure::NormalForm if symplectic => of_normal_form(model, &samples),
            Structure::NearlyIntegrable if symplectic => {
                let mut out = of_map_resolved_by_steps(model, &samples);
                out.extend(at_zero(model, &samples));
                out
            }
            structure => {
                let mut out = of_any_map(model, &samples);
                out.extend(match structure {
                    Structure::NormalForm => laws::integrable(model, &samples),
                    _ => at_zero(model, &samples),
                });
                out
            }
        };
        if model.composition().check_on_grid().is_ok() {
            out.push(laws::inversion_on_grid(model, points));
        }
        if let Some(reversor) = architecture.reversor {
            out.push(reversibility(model, reversor, points));
        }
        if structure_has_generator(model) {
            out.push(laws::formula_of_generator(model, points));
        }
        // Circles over chart and slow map have no such relation: their twists are of actions.
        if architecture.is_of_henon_layers() {
            out.extend(laws::exact_relations(model, points));
        }
        out
    });
    Certificate::of(options, tallies)
}

/// Tests the laws of any symplectic map that is invertible in closed form:
/// symplecticity, inversion of the map and of each of its layers, bitwise
/// agreement of all ways of evaluating it, and, for information, its
/// determinant.
///
/// For a map of your own, [`OneStep`](super::measurable::OneStep) makes a [`Measurable`] of
/// anything that is written over the number type:
///
/// ```
/// use gyroceptron::measure::{OneStep, certificate::{CertificateOptions, certify_map}};
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
    let samples = samples_of(map, options);
    let symplecticity = laws::symplecticity_of_any(map, samples.points());
    let tallies = of_map_with(symplecticity, map, &samples);
    Certificate::of(options, tallies).within(map)
}

/// Tests the laws of a reversible map, S∘P∘S = P⁻¹: those of [`certify_map`], and
/// [`laws::reversibility`].
pub fn certify_reversible(
    map: &dyn Measurable,
    reversor: Reversor,
    options: CertificateOptions,
) -> Certificate {
    let samples = samples_of(map, options);
    let symplecticity = laws::symplecticity_of_any(map, samples.points());
    let mut tallies = of_map_with(symplecticity, map, &samples);
    tallies.push(reversibility(map, reversor, samples.points()));
    Certificate::of(options, tallies).within(map)
}

/// Tests the laws of a nearly-periodic map P_ε = I_ε∘ψ∘Φ_θ∘ψ⁻¹: those of
/// [`certify_map`], the inversion of ψ and I_ε, I₀ = Id, P₀ = ψ∘Φ_θ∘ψ⁻¹, the
/// slopes of I_ε in ε, the axioms of the circle action, plain and conjugated,
/// and, for information, the drift of μ₀.
pub fn certify_family(family: &dyn NearlyPeriodic, options: CertificateOptions) -> Certificate {
    Certificate::of(options, of_family(family, &samples_of(family, options))).within(family)
}

/// Tests the laws of a nearly-periodic map that is not symplectic, such as that of a system with
/// friction: those of [`certify_family`] without symplecticity and the drift of μ₀. Its deviation from
/// symplecticity is reported.
pub fn certify_nearly_periodic(
    family: &dyn NearlyPeriodic,
    options: CertificateOptions,
) -> Certificate {
    Certificate::of(options, of_any_family(family, &samples_of(family, options))).within(family)
}

/// Tests the laws of a map P = χ∘R∘χ⁻¹ in normal form: those of [`certify_map`], that it is
/// this composition, that it commutes with the torus action conjugated by χ, and that R
/// conserves the actions. A perturbed map has these laws at ε = 0 only, where [`certify`] tests them.
pub fn certify_normal_form(map: &dyn NormalFormed, options: CertificateOptions) -> Certificate {
    Certificate::of(options, of_normal_form(map, &samples_of(map, options))).within(map)
}

/// [`laws::reversibility`], which says what S is.
pub(super) fn reversibility(map: &dyn Measurable, reversor: Reversor, points: &[f64]) -> Tally {
    let equation = format!("S∘P∘S∘P = Id, {}", reversor.equation());
    laws::reversibility(map, reversor, points).stating(&equation)
}

fn samples_of(map: &(impl Measurable + ?Sized), options: CertificateOptions) -> Samples {
    Samples::draw_within(&map.domain(), map.dof(), 0, options)
}

fn of_normal_form(map: &dyn NormalFormed, samples: &Samples) -> Vec<Tally> {
    let mut out = of_map_resolved_by_steps(map, samples);
    out.extend(laws::integrable(map, samples));
    out
}

/// The weights of a twist of a long flow time cancel: its bounds are further from its errors
/// than those of a layer, so that these need not show as in [`laws::symplecticity`].
fn of_map_resolved_by_steps(map: &dyn Measurable, samples: &Samples) -> Vec<Tally> {
    let symplecticity = laws::symplecticity_of("symplecticity of P", map, samples.points());
    of_map_with(symplecticity, map, samples)
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
    out.extend(laws::periodicity(map, points));
    out.push(laws::evaluation(map, points));
    out.push(laws::determinant(map, points));
    out
}

fn of_family(family: &dyn NearlyPeriodic, samples: &Samples) -> Vec<Tally> {
    let symplecticity = laws::symplecticity(family, samples.points());
    let mut out = of_family_with(symplecticity, family, samples);
    out.push(laws::adiabatic_invariance(family, samples.points()));
    out
}

fn of_any_family(family: &dyn NearlyPeriodic, samples: &Samples) -> Vec<Tally> {
    let symplecticity = symplecticity_not_claimed(family, samples.points());
    volumes_not_claimed(of_family_with(symplecticity, family, samples))
}

/// The laws of an invertible map that is not symplectic.
fn of_any_map(map: &dyn Measurable, samples: &Samples) -> Vec<Tally> {
    let symplecticity = symplecticity_not_claimed(map, samples.points());
    volumes_not_claimed(of_map_with(symplecticity, map, samples))
}

fn symplecticity_not_claimed(map: &dyn Measurable, points: &[f64]) -> Tally {
    let symplecticity = laws::symplecticity_of("symplecticity of P", map, points);
    symplecticity.stating("JᵀΩJ = Ω, not claimed").reported()
}

fn volumes_not_claimed(mut tallies: Vec<Tally>) -> Vec<Tally> {
    let of_volumes = |tally: &&mut Tally| tally.law() == "determinant";
    if let Some(tally) = tallies.iter_mut().find(of_volumes) {
        *tally = tally.clone().stating("det J = 1, not claimed");
    }
    tallies
}

/// What a nearly-integrable map has of an integrable one.
fn at_zero(model: &Model, samples: &Samples) -> Vec<Tally> {
    let at_zero = model.with_epsilon(0.0);
    match model.architecture().reversor {
        Some(_) => laws::reversible_at_zero(&at_zero, samples),
        None => laws::nearly_integrable(model, &at_zero, samples),
    }
}

/// The laws of I_ε∘χ∘Φ_θ∘T_ε∘χ⁻¹: those of the map, and that it is nearly periodic.
fn of_mixed(model: &Model, symplectic: bool, samples: &Samples) -> Vec<Tally> {
    let mut out = match symplectic {
        true => of_map_resolved_by_steps(model, samples),
        false => of_any_map(model, samples),
    };
    out.extend(laws::identity_at_zero(model, samples.points()));
    out.push(laws::near_periodicity(model, samples.points()));
    out.extend(laws::circle_action(model, samples));
    out.extend(laws::conjugated_circle_action(model, samples));
    out
}

/// Whether all that its I_ε is made of are Hénon layers, whose generator is known.
fn structure_has_generator(model: &Model) -> bool {
    let architecture = model.architecture();
    let of_henon = |block: &Block| matches!(block.layers, Layers::Henon(_));
    architecture.structure() == Structure::NearlyPeriodic
        && architecture.part(Part::NearIdentity).all(of_henon)
}

fn of_family_with(
    symplecticity: Tally,
    family: &dyn NearlyPeriodic,
    samples: &Samples,
) -> Vec<Tally> {
    let points = samples.points();
    let mut out = of_map_with(symplecticity, family, samples);
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
    out
}
