//! The slow manifold μ₀ = 0 of the charged particle, and the learnt invariant off it.

use super::rollout::{envelope, orbit_color};
use super::shared::Study;
use crate::error::Error;
use crate::flow::Trajectories;
use crate::measure::timing::Spread;
use crate::measure::trajectories::{distance, drifts};
use crate::network::{Model, Rollout, Structure, map_points};
use crate::phase::Direction;
use crate::scalar::max_or_nan;
use crate::scene::bibliography::GAUSS_LEGENDRE;
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::learning::BySeed;
use crate::scene::setup::{Need, check_points};
use crate::scene::trained::Trained;
use crate::scene::words::{initial_names, sets_of_weights};
use crate::system::{Hamiltonian, NearlyPeriodic, System};
use serde::{Deserialize, Serialize};
use serde_json::json;

const SLOW: &str = "slow-manifold";
const OFF: &str = "learnt-invariant";

/// The slow manifold μ₀ = 0 of the charged particle, and the learnt invariant off it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlowManifoldOptions {
    /// The number of applications of each network.
    pub steps: usize,
    /// One state in so many is kept.
    pub every: usize,
    /// (q, p) of the initial points with μ₀ = 0.
    pub on: Vec<[f64; 2]>,
    /// Initial points beside it, 2n numbers each.
    pub off: Vec<Vec<f64>>,
}

impl Study for SlowManifoldOptions {
    fn name(&self) -> &'static str {
        "slow_manifold"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::System, Need::FlowTime, Need::Data, Need::Models]
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        Error::check_count_range("steps", self.steps, 1, usize::MAX)?;
        Error::check_count_range("every", self.every, 1, self.steps)?;
        Error::check_count_range("on", self.on.len(), 1, 100)?;
        self.on.iter().flatten().try_for_each(|v| Error::check_finite("on", *v))?;
        match &scene.setup.system {
            Some(system) => {
                self.on_manifold(system)?;
                check_points("off", &self.off, system)
            }
            None => Ok(()),
        }
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![SLOW, OFF]
    }

    fn cites(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![GAUSS_LEGENDRE]
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let system = context.system()?;
        let interval = context.flow_time()? * self.every as f64;
        let request = Rollout { steps: self.steps, every: self.every };
        let on = self.on_manifold(system)?;
        let reference = context.reference(system, &on, interval, request.kept())?;
        let models = context.models()?;
        let moved = context.rollouts(&on, request)?;
        let beside = context.rollouts(&self.off, request)?;

        let beside_reference = self.beside_reference(context, system, interval, request)?;
        let of = |name: &str, orbits: &Trajectories| Slow::of(system, name, orbits, interval);
        let mut slow = vec![of("reference", &reference.trajectories)];
        slow.extend(models.iter().zip(moved.iter()).map(|(m, orbits)| of(&m.spec.name, orbits)));
        let off: Vec<Off> = models
            .iter()
            .zip(beside.iter())
            .filter_map(|(trained, orbits)| {
                let network = trained.model();
                let adiabatic = network.architecture().structure() == Structure::NearlyPeriodic;
                if !adiabatic || !network.architecture().is_symplectic() {
                    return None;
                }
                Some(Off::new(trained, system, orbits))
            })
            .collect();
        let mut figures = Vec::new();
        if context.draws(SLOW) {
            figures.push(self.slow_figure(system, &slow, interval));
        }
        if context.draws(OFF) {
            figures.push(self.off_figure(&off, interval));
        }
        let text = format!(
            "From {} points with μ₀ = 0 over a time of {}: there, to order ε, q = q(0) + εp(0)t and \
             p = p(0). The constants are the largest deviations over ε = {}. In the paper's \
             reduction P_k moves by εp sin(kq), in the equations of motion it does not: the last \
             column, μ₀ over ε², stays of order one along the reference.",
            on.len(),
            interval * (request.kept() - 1) as f64,
            system.epsilon()
        );
        let mut summary = vec![
            Block::Text(text),
            Block::Table(self.slow_table(&slow, system.epsilon())),
            Block::Text(words_beside_reference(&beside_reference)),
            Block::Table(table_beside_reference(&beside_reference)),
        ];
        if !off.is_empty() {
            let text = "Off it: the invariant 𝔍₀∘ψ⁻¹ that was learnt beside μ₀ of the system, both \
            along the network's orbits.";
            summary.extend([Block::Text(text.into()), Block::Table(self.off_table(&off))]);
        }
        let data = json!({
            "slow": slow.iter().map(Slow::data).collect::<Vec<_>>(),
            "beside_reference": beside_reference,
            "off": off.iter().map(Off::data).collect::<Vec<_>>(),
        });
        Ok(Findings {
            title: "Slow manifold".into(),
            results: Section { summary, data, ..Section::default() },
            figures,
            ..Findings::default()
        })
    }
}

/// Orbits that start on the slow manifold.
struct Slow {
    name: String,
    /// (q, p) of each state.
    plane: Vec<Vec<(f64, f64)>>,
    /// Of each orbit: the largest |q − q(0) − εp(0)t|, |p − p(0)| and μ₀.
    largest: Vec<[f64; 3]>,
}

impl Slow {
    fn of(system: &System, name: &str, orbits: &Trajectories, interval: f64) -> Self {
        let momentum = orbits.dim() / 2;
        let mut out = Self { name: name.to_owned(), plane: Vec::new(), largest: Vec::new() };
        for m in 0..orbits.count() {
            let (q, p) = (orbits.state(0, m)[0], orbits.state(0, m)[momentum]);
            let mut largest = [0.0; 3];
            for (t, z) in orbits.orbit(m).enumerate() {
                let time = t as f64 * interval;
                let now = [
                    (z[0] - q - system.epsilon() * p * time).abs(),
                    (z[momentum] - p).abs(),
                    system.adiabatic_invariant(z),
                ];
                for (largest, now) in largest.iter_mut().zip(now) {
                    *largest = max_or_nan(*largest, now);
                }
            }
            out.plane.push(orbits.orbit(m).map(|z| (z[0], z[momentum])).collect());
            out.largest.push(largest);
        }
        out
    }

    fn data(&self) -> serde_json::Value {
        json!({ "name": self.name, "largest_q_p_mu": self.largest })
    }
}

/// How far the orbits of a map go from those of the reference, from points of the slow manifold and from those that
/// the map itself has in their place.
#[derive(Serialize)]
struct BesideReference {
    /// The network, and the name of the map from one of its initial weights.
    network: String,
    name: String,
    /// The largest |z − z_ref| over the diagonal of the box that the reference goes through, the largest of all
    /// orbits: from points with μ₀ = 0.
    from_system: f64,
    /// The same from ψ(w), w being ψ⁻¹ of such a point with the fast planes at 0, where 𝔍₀∘ψ⁻¹ = 0; None of maps that
    /// own no such invariant.
    from_learnt: Option<f64>,
    /// The largest distance of these orbits from those of the reference on the slow manifold, from the other points,
    /// over the same diagonal.
    from_manifold: Option<f64>,
    /// The largest distance of that point from the other.
    moved: Option<f64>,
    /// The largest 𝔍₀∘ψ⁻¹ along the orbits from there.
    own: Option<f64>,
    /// The largest |𝔍₀∘ψ⁻¹ − μ₀| along orbits that begin beside the manifold, over μ₀ at their start: the largest of all
    /// orbits.
    off: Option<f64>,
}

/// The largest distance from a reference over the diagonal of the box that this goes through, over all orbits.
fn relative_distance(orbits: &Trajectories, reference: &Trajectories) -> f64 {
    let of = |m: usize| {
        let states = || reference.orbit(m);
        let widths = (0..reference.dim()).map(|i| {
            let values = || states().map(move |z| z[i]);
            let highest = values().reduce(max_or_nan).unwrap_or(f64::NAN);
            let lowest = -values().map(|v| -v).reduce(max_or_nan).unwrap_or(f64::NAN);
            highest - lowest
        });
        let diagonal = widths.map(|width| width * width).sum::<f64>().sqrt();
        let apart = orbits.orbit(m).zip(states()).map(|(z, reference)| distance(z, reference));
        apart.fold(0.0, max_or_nan) / diagonal
    };
    (0..reference.count()).map(of).fold(0.0, max_or_nan)
}

fn words_beside_reference(found: &[BesideReference]) -> String {
    let mut out = "How far orbits go from those of the reference over a share of what these travel: the \
                   largest |z − z_ref| \
                   over the diagonal of the box that the reference goes through, of the worst orbit. From points with \
                   μ₀ = 0 of the system, and from the points nearest to them, in the coordinates of the \
                   map, on the zero level set of the \
                   invariant that it has learnt."
        .to_owned();
    let mut networks: Vec<&str> = found.iter().map(|of| &of.network[..]).collect();
    networks.dedup();
    for network in networks {
        let of: Vec<&BesideReference> = found.iter().filter(|of| of.network == network).collect();
        let spread = |values: Vec<f64>| {
            let worst = values.iter().copied().fold(0.0, max_or_nan);
            let median = Spread::from_values(values).map_or(f64::NAN, |spread| spread.median);
            format!(
                "{} (median), {} (worst)",
                Format::Percent.number(median),
                Format::Percent.number(worst)
            )
        };
        let system = spread(of.iter().map(|of| of.from_system).collect());
        let learnt: Vec<f64> = of.iter().filter_map(|of| of.from_learnt).collect();
        let learnt = if learnt.is_empty() { "–".into() } else { spread(learnt) };
        out.push_str(&format!(
            "\n- `{network}`, {}: from μ₀ = 0 {system}; from the learnt level set {learnt}.",
            sets_of_weights(of.len())
        ));
    }
    out
}

fn table_beside_reference(found: &[BesideReference]) -> Table {
    let mut table = Table::new([
        ("map", Format::Exact),
        ("from μ₀ = 0", Format::Percent),
        ("from the learnt level set", Format::Percent),
        ("these from the slow manifold", Format::Percent),
        ("which is so far away", Format::Exponent(1)),
        ("largest 𝔍₀∘ψ⁻¹ along it", Format::Exponent(1)),
        ("off it, 𝔍₀∘ψ⁻¹ from μ₀", Format::Percent),
    ]);
    for of in found {
        table.push([
            format!("`{}`", of.name).into(),
            of.from_system.into(),
            of.from_learnt.into(),
            of.from_manifold.into(),
            of.moved.into(),
            of.own.into(),
            of.off.into(),
        ]);
    }
    table
}

/// ψ(w), w being ψ⁻¹(z) with the planes that the circle turns at 0: there 𝔍₀∘ψ⁻¹ = 0.
fn on_learnt_manifold(model: &Model, z: &[f64]) -> Result<Vec<f64>, Error> {
    let [psi, _] = model.chart_and_inner_map();
    let mut w = z.to_vec();
    map_points(&psi, Direction::Inverse, &mut w)?;
    let dof = w.len() / 2;
    for circle in &model.architecture().circles {
        for (plane, weight) in circle.weights().iter().enumerate() {
            if *weight != 0 {
                (w[plane], w[dof + plane]) = (0.0, 0.0);
            }
        }
    }
    map_points(&psi, Direction::Forward, &mut w)?;
    Ok(w)
}

/// Two invariants along orbits that start beside the slow manifold.
struct Off {
    name: String,
    learnt: Trajectories,
    of_system: Trajectories,
}

impl Off {
    /// The invariants along orbits of a network.
    fn new(trained: &Trained, system: &System, orbits: &Trajectories) -> Self {
        let own = |z: &[f64]| trained.model().adiabatic_invariant(z)[0];
        Self {
            name: trained.spec.name.clone(),
            learnt: orbits.quantity(own),
            of_system: orbits.quantity(|z| system.adiabatic_invariant(z)),
        }
    }

    /// The largest difference of the two over μ₀ at the start, of all orbits.
    fn relative_difference(&self) -> f64 {
        let initial = |m: usize| self.of_system.state(0, m)[0].abs();
        let all = (0..self.learnt.count()).map(|m| self.difference(m) / initial(m));
        all.fold(0.0, max_or_nan)
    }

    fn data(&self) -> serde_json::Value {
        json!({
            "name": self.name,
            "learnt": drifts(&self.learnt, |v| v[0]),
            "system": drifts(&self.of_system, |v| v[0]),
            "differences": (0..self.learnt.count()).map(|m| self.difference(m)).collect::<Vec<_>>(),
        })
    }

    /// The largest difference of the two along an orbit.
    fn difference(&self, m: usize) -> f64 {
        let both = self.learnt.orbit(m).zip(self.of_system.orbit(m));
        both.map(|(a, b)| (a[0] - b[0]).abs()).fold(0.0, max_or_nan)
    }
}

impl SlowManifoldOptions {
    /// All maps beside the reference, from all their initial weights.
    fn beside_reference(
        &self,
        context: &mut Context<'_>,
        system: &System,
        interval: f64,
        request: Rollout,
    ) -> Result<Vec<BesideReference>, RunError> {
        let on = self.on_manifold(system)?;
        let dim = 2 * system.dof();
        let mut out = Vec::new();
        for BySeed { network, seeds } in context.by_network()? {
            for trained in seeds {
                let model = trained.model();
                if trained.lost.is_some() {
                    out.push(BesideReference {
                        network: network.clone(),
                        name: trained.spec.name.clone(),
                        from_system: f64::INFINITY,
                        from_learnt: None,
                        from_manifold: None,
                        moved: None,
                        own: None,
                        off: None,
                    });
                    continue;
                }
                let orbits = |initial: &[Vec<f64>]| {
                    let states = model.rollout(&initial.concat(), request)?;
                    Trajectories::new(states, dim, initial.len())
                };
                let reference = context.reference(system, &on, interval, request.kept())?;
                let from_system = relative_distance(&orbits(&on)?, &reference.trajectories);
                let mut found = BesideReference {
                    network: network.clone(),
                    name: trained.spec.name.clone(),
                    from_system,
                    from_learnt: None,
                    from_manifold: None,
                    moved: None,
                    own: None,
                    off: None,
                };
                let adiabatic = model.architecture().structure() == Structure::NearlyPeriodic;
                if adiabatic && model.architecture().is_symplectic() {
                    let learnt = on.iter().map(|z| on_learnt_manifold(model, z));
                    let learnt: Vec<Vec<f64>> = learnt.collect::<Result<_, Error>>()?;
                    let apart = on.iter().zip(&learnt).map(|(a, b)| distance(a, b));
                    found.moved = Some(apart.fold(0.0, max_or_nan));
                    let moved = orbits(&learnt)?;
                    found.from_manifold = Some(relative_distance(&moved, &reference.trajectories));
                    let reference = context.reference(system, &learnt, interval, request.kept())?;
                    found.from_learnt = Some(relative_distance(&moved, &reference.trajectories));
                    let own = moved.values().chunks_exact(dim);
                    let own = own.map(|z| model.adiabatic_invariant(z)[0].abs());
                    found.own = Some(own.fold(0.0, max_or_nan));
                    let off = Off::new(&trained, system, &orbits(&self.off)?);
                    found.off = Some(off.relative_difference());
                }
                out.push(found);
            }
        }
        Ok(out)
    }

    /// The points of the slow manifold, or the error that the system has none.
    fn on_manifold(&self, system: &System) -> Result<Vec<Vec<f64>>, Error> {
        let points = self.on.iter().map(|[q, p]| system.on_slow_manifold(*q, *p));
        let unknown = || {
            let expected = "a system whose slow manifold is known, such as particle-field";
            Error::invalid("system", system.kind(), expected)
        };
        points.collect::<Option<_>>().ok_or_else(unknown)
    }

    fn names(&self) -> Vec<String> {
        self.on.iter().map(|[q, p]| format!("q = {q}, p = {p}")).collect()
    }

    fn slow_table(&self, slow: &[Slow], epsilon: f64) -> Table {
        let mut table = Table::new([
            ("orbits", Format::Exact),
            ("from", Format::Exact),
            ("|q − q(0) − εp(0)t| / ε", Format::Fixed(3)),
            ("|p − p(0)| / ε", Format::Fixed(3)),
            ("μ₀ / ε²", Format::Fixed(3)),
        ]);
        for of in slow {
            for (name, [q, p, mu]) in self.names().into_iter().zip(&of.largest) {
                table.push([
                    of.name.clone().into(),
                    name.into(),
                    (q / epsilon.abs()).into(),
                    (p / epsilon.abs()).into(),
                    (mu / (epsilon * epsilon)).into(),
                ]);
            }
        }
        table
    }

    fn off_table(&self, off: &[Off]) -> Table {
        let mut table = Table::new([
            ("network", Format::Exact),
            ("from", Format::Exact),
            ("μ₀ of the system at the start", Format::Fixed(4)),
            ("its change", Format::Percent),
            ("𝔍₀∘ψ⁻¹ at the start", Format::Fixed(4)),
            ("its change", Format::Percent),
            ("largest difference", Format::Percent),
        ]);
        for of in off {
            let (learnt, system) = (drifts(&of.learnt, |v| v[0]), drifts(&of.of_system, |v| v[0]));
            for (m, name) in initial_names(&self.off).into_iter().enumerate() {
                let (learnt, system) = (learnt[m], system[m]);
                table.push([
                    format!("`{}`", of.name).into(),
                    name.into(),
                    system.initial.into(),
                    (system.largest / system.initial.abs()).into(),
                    learnt.initial.into(),
                    (learnt.largest / learnt.initial.abs()).into(),
                    (of.difference(m) / system.initial.abs()).into(),
                ]);
            }
        }
        table
    }

    fn slow_figure(&self, system: &System, slow: &[Slow], interval: f64) -> Figure {
        let panel = |label: &str,
                     pick: fn(&(f64, f64)) -> f64,
                     formula: &dyn Fn([f64; 2], f64) -> f64| {
            let mut series = Vec::new();
            for (m, (name, start)) in self.names().into_iter().zip(&self.on).enumerate() {
                let time = |t: usize| t as f64 * interval;
                for of in &slow[1..] {
                    let points =
                        of.plane[m].iter().enumerate().map(|(t, z)| (time(t), pick(z))).collect();
                    let (name, color) = (name.clone(), orbit_color(m));
                    series.push(Series { name, color, style: Style::Line, points });
                }
                let of_reference =
                    slow[0].plane[m].iter().enumerate().map(|(t, z)| (time(t), pick(z))).collect();
                series.push(Series {
                    name: "reference".into(),
                    color: 7,
                    style: Style::Dashed,
                    points: of_reference,
                });
                let ends =
                    [0, slow[0].plane[m].len() - 1].map(|t| (time(t), formula(*start, time(t))));
                series.push(Series {
                    name: "to order ε: q(0) + εp(0)t, p(0)".into(),
                    color: 6,
                    style: Style::Faint,
                    points: ends.into(),
                });
            }
            Panel {
                title: format!("{label} on the slow manifold"),
                x_label: "time".into(),
                y_label: label.into(),
                series,
                ..Panel::default()
            }
        };
        let epsilon = system.epsilon();
        let panels = vec![
            panel("q", |z| z.0, &|[q, p], time| q + epsilon * p * time),
            panel("p", |z| z.1, &|[_, p], _| p),
        ];
        let caption = "Orbits that start with μ₀ = 0: of the networks (colours), of the reference \
        (dashed) and of the slow manifold to order ε (grey).";
        Figure::in_a_row(SLOW, caption, panels)
    }

    fn off_figure(&self, off: &[Off], interval: f64) -> Figure {
        let panel = |of: &Off| {
            let mut series = Vec::new();
            for (m, name) in initial_names(&self.off).into_iter().enumerate() {
                let learnt: Vec<f64> = of.learnt.orbit(m).map(|v| v[0]).collect();
                let [lower, upper] = envelope(&learnt, interval);
                let color = orbit_color(m);
                series.push(Series { name, color, style: Style::Line, points: upper });
                series.push(Series::unnamed(color, Style::Line, lower));
            }
            for m in 0..self.off.len() {
                let system: Vec<f64> = of.of_system.orbit(m).map(|v| v[0]).collect();
                for points in envelope(&system, interval) {
                    let name = "μ₀ of the system".to_owned();
                    series.push(Series { name, color: 7, style: Style::Dashed, points });
                }
            }
            Panel {
                title: format!("𝔍₀∘ψ⁻¹ of {} along its orbits", of.name),
                x_label: "time".into(),
                y_label: "invariant".into(),
                series,
                ..Panel::default()
            }
        };
        let caption = "Beside the slow manifold: the envelope of the learnt invariant 𝔍₀∘ψ⁻¹ along the \
        network's orbits, and of μ₀ of the system along the same (dashed).";
        Figure::in_a_row(OFF, caption, off.iter().map(panel).collect())
    }
}
