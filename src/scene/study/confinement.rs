//! Curves of maps of a plane that no orbit crosses, with proofs.

use super::rollout::{GREY, columns};
use super::shared::Study;
use crate::error::Error;
use crate::io::{ProofRequest, Proofs, Provenance, StoredModel};
use crate::measure::proof::{
    Circle, Constants, NobleNumber, PlaneMap, Ray, Verdict, fixed_point_near, place_on_ray,
};
use crate::network::{Composition, Rollout, map_points, rollout};
use crate::phase::Direction;
use crate::scene::bibliography::PROVED_CIRCLES;
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::setup::Need;
use serde::{Deserialize, Serialize};
use serde_json::json;

const CONFINEMENT: &str = "confinement";

/// Curves of maps of a plane that no orbit crosses, with proofs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConfinementOptions {
    /// The number of rotation numbers, spread over those of the orbits on a ray.
    pub circles: usize,
    /// The end of the ray, in the coordinates of the normal form; the ray begins at the fixed point near 0.
    pub to: [f64; 2],
    /// The number of orbits that are drawn.
    pub orbits: usize,
    /// The number of maps of each orbit.
    pub steps: usize,
}

impl Study for ConfinementOptions {
    fn name(&self) -> &'static str {
        "confinement"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::Models]
    }

    fn check(&self, _: &Declared<'_>) -> Result<(), Error> {
        Error::check_count_range("circles", self.circles, 1, 200)?;
        Error::check_count_range("orbits", self.orbits, 1, 200)?;
        Error::check_count_range("steps", self.steps, 1, 10_000)?;
        self.to.iter().try_for_each(|v| Error::check_finite("to", *v))
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![CONFINEMENT]
    }

    fn cites(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![PROVED_CIRCLES]
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let draws = context.draws(CONFINEMENT);
        let models = context.models()?;
        let (mut summary, mut data, mut panels) =
            (vec![Block::Text(INTRODUCTION.into())], Vec::new(), Vec::new());
        for trained in models.iter() {
            let name = &trained.spec.name;
            let provenance = Provenance::of_scene("confinement");
            let model = trained.model().clone();
            let stored = StoredModel { model, units: None, section: None, provenance };
            let request =
                ProofRequest { circles: self.circles, to: self.to, ..ProofRequest::default() };
            let proofs = context.stage(&format!("proofs of {name}"), |_| {
                Proofs::of_model(&stored, &request, |_, _, _| Ok(()))
            })?;
            let map = PlaneMap::of_model(&stored.model)?;
            let from = fixed_point_near(&map, [0.0; 2]).unwrap_or_default();
            let ray = Ray { from, to: self.to };
            let inner = stored.model.in_conjugated_coordinates();
            let share = share_within(&inner, ray, proofs.file.circles.last())?;
            let proved = proofs.file.circles.len();
            summary.push(Block::Text(format!(
                "`{name}`: {proved} of {} circles are proved. {}",
                proofs.tried.len(),
                share.map_or_else(String::new, |share| format!(
                    "The outermost encloses {} of what the orbit from the end of the ray encloses.",
                    Format::Percent.number(share)
                ))
            )));
            summary.push(Block::Table(table_of(&proofs.tried)));
            summary.extend(proofs.file.statements().into_iter().map(Block::Text));
            let mut document = proofs.document();
            document["name"] = name.clone().into();
            document["enclosed_share"] = share.into();
            data.push(document);
            if draws {
                let [chart, _] = stored.model.chart_and_inner_map();
                panels.push(self.panel(name, [&chart, &inner], ray, &map, &proofs)?);
            }
        }
        let mut figures = Vec::new();
        if draws {
            let caption =
                "Orbits, the curves that are proved, and orbits of rotation numbers that are not.";
            let columns = columns(panels.len());
            figures.push(Figure { columns, ..Figure::in_a_row(CONFINEMENT, caption, panels) });
        }
        Ok(Findings {
            title: "Curves that no orbit crosses".into(),
            results: Section { summary, data: json!(data), ..Section::default() },
            figures,
            ..Findings::default()
        })
    }
}

const INTRODUCTION: &str = "Theorems about the map of real numbers with these weights, its turns exact rotations, in \
    the coordinates of its normal form: not about the rounded map of doubles, nor about what it was trained on.";

/// What has come of each rotation number.
fn table_of(tried: &[(NobleNumber, Verdict)]) -> Table {
    let mut table = Table::new([
        ("rotation number", Format::Exact),
        ("turns", Format::Exact),
        ("γ", Format::Exact),
        ("ρ", Format::Exponent(1)),
        ("|E|", Format::Exponent(1)),
        ("κ", Format::Exponent(1)),
        ("16κ|E|", Format::Exponent(1)),
        ("distance", Format::Exponent(1)),
        ("verdict", Format::Exact),
    ]);
    for (omega, verdict) in tried {
        let constants = |of: fn(&Constants) -> f64| match verdict {
            Verdict::Proved(circle) => Some(of(&circle.constants)),
            _ => None,
        };
        let rho = match verdict {
            Verdict::Proved(circle) => Some(circle.candidate.rho),
            _ => None,
        };
        let said = match verdict {
            Verdict::Proved(_) => "proved".to_owned(),
            Verdict::NotProved(failure) => format!("not proved: {failure}"),
            Verdict::NotFound(_) => "not proved: no curve is found".to_owned(),
        };
        table.push([
            omega.to_string().into(),
            format!("{:.6}", omega.value().centre()).into(),
            format!("{:.3}", omega.gamma()).into(),
            rho.into(),
            constants(|c| c.residual).into(),
            constants(|c| c.kappa).into(),
            constants(|c| c.margin).into(),
            constants(|c| c.distance).into(),
            said.into(),
        ]);
    }
    table
}

/// The area within a circle over that within the orbit from the end of the ray, its points joined by their angles
/// around the beginning.
fn share_within(
    map: &Composition<f64>,
    ray: Ray,
    outermost: Option<&Circle>,
) -> Result<Option<f64>, Error> {
    const STEPS: usize = 4000;
    let Some(outermost) = outermost else { return Ok(None) };
    let states = rollout(map, &ray.to, Rollout { steps: STEPS, every: 1 })?;
    let from = ray.from;
    let off = |z: &[f64]| [z[0] - from[0], z[1] - from[1]];
    let mut points: Vec<[f64; 2]> = states.chunks_exact(2).map(off).collect();
    points.sort_by(|a, b| libm::atan2(a[1], a[0]).total_cmp(&libm::atan2(b[1], b[0])));
    let next = points.iter().cycle().skip(1);
    let area: f64 = points.iter().zip(next).map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum();
    let share = outermost.area() / area;
    Ok(share.is_finite().then_some(share))
}

impl ConfinementOptions {
    /// Orbits and circles in the coordinates of the data.
    fn panel(
        &self,
        name: &str,
        [chart, inner]: [&Composition<f64>; 2],
        ray: Ray,
        map: &PlaneMap,
        proofs: &Proofs,
    ) -> Result<Panel, Error> {
        const POINTS: usize = 512;
        let orbit_of =
            |start: [f64; 2]| rollout(inner, &start, Rollout { steps: self.steps, every: 1 });
        let in_data = |mut points: Vec<f64>| -> Result<Vec<(f64, f64)>, Error> {
            points.retain(|v| v.is_finite());
            map_points(chart, Direction::Forward, &mut points)?;
            Ok(points.chunks_exact(2).map(|z| (z[0], z[1])).collect())
        };
        let mut series = Vec::new();
        for k in 0..self.orbits {
            let part = (k as f64 + 0.5) / self.orbits as f64;
            let start = [0, 1].map(|axis| ray.from[axis] + part * (ray.to[axis] - ray.from[axis]));
            let points = in_data(orbit_of(start)?)?;
            series.push(Series::unnamed(GREY, Style::Dots, points));
        }
        let named = |first: bool, name: &str| if first { name.to_owned() } else { String::new() };
        let mut others = 0;
        for (omega, verdict) in &proofs.tried {
            if matches!(verdict, Verdict::Proved(_)) {
                continue;
            }
            if let Some(start) = place_on_ray(map, ray, omega) {
                let points = in_data(orbit_of(start)?)?;
                let name = named(others == 0, "not proved");
                series.push(Series { name, color: 1, style: Style::Dots, points });
                others += 1;
            }
        }
        for (number, circle) in proofs.file.circles.iter().enumerate() {
            let mut points = circle.points(POINTS);
            points.extend_from_within(..2);
            let (name, points) = (named(number == 0, "proved"), in_data(points)?);
            series.push(Series { name, color: 0, style: Style::Line, points });
        }
        Ok(Panel {
            title: name.to_owned(),
            x_label: "q".into(),
            y_label: "p".into(),
            square: true,
            series,
            ..Panel::default()
        })
    }
}
