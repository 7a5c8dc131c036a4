//! Dynamic apertures: how far from the closed orbit orbits stay, by angle and by the number of maps.

use super::shared::{Study, WIDER, beyond_pairs, check_slice, coordinate, positions};
use crate::error::Error;
use crate::flow::{Pairs, Symmetries, SymplecticPolynomial};
use crate::measure::orbits::{Follow, aperture_of_ray, maps_survived};
use crate::network::Rollout;
use crate::scalar::max_or_nan;
use crate::scene::bibliography::{APERTURES, SYMPLECTIC_MAPS};
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::setup::{MOST, Need};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::f64::consts::PI;

const FIGURE: &str = "aperture";

/// The states of more are not held at once.
const MOST_POINTS: usize = 20_000;
/// No polynomial is of a higher degree.
const MOST_DEGREE: usize = 60;

/// Orbits from points along rays of a map of two degrees of freedom: up to which radius all of a ray stay.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ApertureOptions {
    /// The point from which rays begin: the closed orbit.
    #[serde(default)]
    pub centre: [f64; 4],
    /// The two coordinates in which rays lie, of q₁, q₂, p₁, p₂.
    #[serde(default = "positions")]
    pub along: [usize; 2],
    /// How far rays reach along the first of the two coordinates, and along the second; between, on an ellipse.
    pub reach: [f64; 2],
    /// The number of rays, from the positive first axis through the positive second to the negative first.
    pub rays: usize,
    /// The number of points of each, equally far apart up to its end.
    pub points: usize,
    /// Numbers of maps, ascending, for which orbits have to stay.
    pub counts: Vec<usize>,
    /// Degrees of symplectic polynomials of least squares beside the networks.
    #[serde(default)]
    pub symplectic_polynomials: Vec<usize>,
    /// Planes, from 1, of which the polynomials have the mirror symmetry.
    #[serde(default)]
    pub mirrored: Vec<usize>,
}

impl Study for ApertureOptions {
    fn name(&self) -> &'static str {
        "aperture"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::TargetFlow, Need::Data, Need::Models]
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        check_slice(self.name(), scene, self.centre, self.along)?;
        for reach in self.reach {
            if !(reach > 0.0 && reach.is_finite()) {
                return Err(Error::invalid("reach", reach, "finite numbers above 0"));
            }
        }
        Error::check_count_range("rays", self.rays, 2, MOST_POINTS)?;
        Error::check_count_range("points", self.points, 1, MOST_POINTS)?;
        let all = self.rays.saturating_mul(self.points);
        Error::check_count_range("rays × points", all, 2, MOST_POINTS)?;
        Error::check_count_range("counts", self.counts.len(), 1, 20)?;
        self.counts.iter().try_for_each(|n| Error::check_count_range("counts", *n, 1, MOST))?;
        if let Some(pair) = self.counts.windows(2).find(|pair| pair[0] >= pair[1]) {
            let found = format!("{} after {}", pair[1], pair[0]);
            return Err(Error::invalid("counts", found, "numbers that grow"));
        }
        for degree in &self.symplectic_polynomials {
            Error::check_count_range("symplectic_polynomials", *degree, 2, MOST_DEGREE)?;
        }
        self.symmetries().check(2)
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![FIGURE]
    }

    fn cites(&self, _: &Declared<'_>) -> Vec<&'static str> {
        let polynomials = self.symplectic_polynomials.first().map(|_| SYMPLECTIC_MAPS);
        [APERTURES].into_iter().chain(polynomials).collect()
    }

    /// Every other ray and point, and no more than a thousand maps.
    fn shorten(&mut self) {
        const LONGEST: usize = 1000;
        self.rays = self.rays.div_ceil(2).max(2);
        self.points = self.points.div_ceil(2);
        let shortest = self.counts[0];
        self.counts.retain(|count| *count <= LONGEST.max(shortest));
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let (models, data) = (context.models()?, context.data()?);
        let (beyond, units) = (beyond_pairs(&data), data.units.as_ref());
        let network = |points: &[f64]| {
            let mut points = points.to_vec();
            if let Some(units) = units {
                units.to_network(&mut points);
            }
            points
        };
        let starts = self.starts();
        let in_network = network(&starts);
        let mut found = Vec::new();
        for trained in models.iter() {
            let (name, model) = (&trained.spec.name, trained.model());
            let follow = |here: &[f64], maps: usize| {
                let states = model.rollout(here, Rollout { steps: maps, every: 1 })?;
                Ok(states[here.len()..].to_vec())
            };
            found.push(self.staged(context, name, &in_network, &beyond, &follow)?);
        }
        // A mirror is one of the data, whatever the units of networks are about.
        let pairs = data.training.transformed("pairs", |_, z| {
            if let Some(units) = units {
                units.to_data(z);
            }
            Ok(())
        })?;
        // A polynomial is of one map.
        let epsilon = context.target()?.epsilon();
        let own = pairs.under_conditions(|of| of.controls.is_empty() && of.is_of(epsilon, 1.0));
        let without_conditions = |own: Pairs| {
            Pairs::new("pairs", own.dof(), own.input().to_vec(), own.output().to_vec())
        };
        let own = own.map(without_conditions).transpose()?;
        let mut left_out = Vec::new();
        for degree in &self.symplectic_polynomials {
            let name = format!("symplectic polynomial of degree {degree}");
            let Some(pairs) = &own else {
                left_out.push(Block::Text(format!(
                    "{name} is left out: no pairs are of the networks' own ε and flow time, without controls."
                )));
                continue;
            };
            let fit = || SymplecticPolynomial::fit_symmetric(pairs, *degree, &self.symmetries());
            let of = match context.stage(&name, |_| Ok::<_, RunError>(fit()))? {
                Ok(of) => of,
                // Of the other maps there is something to be said.
                Err(error @ (Error::NoConvergence { .. } | Error::Diverged { .. })) => {
                    left_out.push(Block::Text(format!("{name} is left out: {error}.")));
                    continue;
                }
                Err(error) => return Err(error.with_place("symplectic_polynomials").into()),
            };
            let follow = |here: &[f64], maps: usize| {
                let states = of.rollout(here, Rollout { steps: maps, every: 1 })?;
                Ok(states[here.len()..].to_vec())
            };
            let beyond = |z: &[f64]| beyond(&network(z));
            found.push(self.staged(context, &name, &starts, &beyond, &follow)?);
        }
        let mut figures = Vec::new();
        if context.draws(FIGURE) {
            figures.push(self.figure(&found));
        }
        Ok(Findings {
            title: "Dynamic aperture".into(),
            results: Section {
                summary: std::iter::once(Block::Table(self.table(&found)))
                    .chain(left_out)
                    .collect(),
                details: vec![Block::Text(self.words()), Block::Table(self.by_ray(&found))],
                data: json!(found),
            },
            figures,
            ..Findings::default()
        })
    }
}

/// What was found of a map.
#[derive(Serialize)]
struct Found {
    name: String,
    /// For each number of maps and each ray the aperture, as a share of the length of the ray.
    apertures: Vec<Vec<f64>>,
    /// The number of maps after which the orbit from each point of each ray is lost, the nearest to the centre first.
    lost_after: Vec<Vec<Option<usize>>>,
}

impl ApertureOptions {
    fn symmetries(&self) -> Symmetries {
        Symmetries { mirrored: self.mirrored.clone(), ..Symmetries::default() }
    }

    /// The end of a ray, from the centre.
    fn end(&self, ray: usize) -> [f64; 2] {
        let (sin, cos) = libm::sincos(PI * ray as f64 / (self.rays - 1) as f64);
        [self.reach[0] * cos, self.reach[1] * sin]
    }

    fn length(&self, ray: usize) -> f64 {
        let [x, y] = self.end(ray);
        libm::hypot(x, y)
    }

    /// Shares of the length of a ray at which its points are.
    fn shares(&self) -> Vec<f64> {
        (1..=self.points).map(|k| k as f64 / self.points as f64).collect()
    }

    /// The points of all rays, one ray after another, in units of the data.
    fn starts(&self) -> Vec<f64> {
        let shares = self.shares();
        let points = (0..self.rays).flat_map(|ray| {
            let end = self.end(ray);
            shares.iter().flat_map(move |share| {
                let mut z = self.centre;
                for (coordinate, along) in self.along.into_iter().zip(end) {
                    z[coordinate] += share * along;
                }
                z
            })
        });
        points.collect()
    }

    /// What becomes of orbits from these points, in the units of the map.
    fn staged(
        &self,
        context: &mut Context<'_>,
        name: &str,
        starts: &[f64],
        beyond: &dyn Fn(&[f64]) -> bool,
        follow: Follow<'_>,
    ) -> Result<Found, RunError> {
        context.stage(&format!("aperture of {name}"), |context| {
            let most = self.counts[self.counts.len() - 1];
            let unless_stopped = |here: &[f64], maps: usize| match context.interrupted() {
                true => Err(Error::invalid("run", "interrupted", "to the end")),
                false => follow(here, maps),
            };
            let survived = maps_survived(&unless_stopped, starts, 4, most, &|z| !beyond(z));
            if context.interrupted() {
                return Err(RunError::Interrupted);
            }
            let (survived, shares) = (survived?, self.shares());
            let of_rays: Vec<&[Option<usize>]> = survived.chunks(self.points).collect();
            let after = |count: &usize| {
                let of_ray = |ray: &&[Option<usize>]| aperture_of_ray(ray, &shares, *count);
                of_rays.iter().map(of_ray).collect()
            };
            Ok(Found {
                name: name.to_owned(),
                apertures: self.counts.iter().map(after).collect(),
                lost_after: of_rays.iter().map(|ray| ray.to_vec()).collect(),
            })
        })
    }

    fn words(&self) -> String {
        let names = self.along.map(coordinate);
        format!(
            "{} rays from {:?} in {} and {}, to {} along the first and {} along the second of these, {} points on \
             each. The aperture along a ray is the largest distance from the centre up to which the orbits from all of its \
             points stay, to within the spacing of the points, in the two coordinates as they are. An orbit is lost \
             where it leaves a box {WIDER} times as wide as that of the pairs; near the aperture motion is chaotic, \
             and maps that differ little lose other orbits.",
            self.rays, self.centre, names[0], names[1], self.reach[0], self.reach[1], self.points,
        )
    }

    /// By the number of maps: the mean over the rays as a share of their lengths, and the smallest aperture.
    fn table(&self, found: &[Found]) -> Table {
        let whole = Format::Exact;
        let mut heads = vec![("map".to_owned(), whole), ("orbits lost".to_owned(), whole)];
        for count in &self.counts {
            heads.push((format!("after {count} maps: mean share of a ray"), Format::Percent));
            heads.push((format!("after {count}: smallest aperture"), Format::Magnitude));
        }
        let mut table = Table::new(heads);
        for of in found {
            let lost = of.lost_after.iter().flatten().filter(|lost| lost.is_some()).count();
            let mut row = vec![format!("`{}`", of.name).into(), lost.into()];
            for shares in &of.apertures {
                row.push((shares.iter().sum::<f64>() / self.rays as f64).into());
                let lengths = shares.iter().enumerate().map(|(ray, s)| s * self.length(ray));
                // no NaN: shares of finite lengths
                row.push(lengths.fold(f64::INFINITY, f64::min).into());
            }
            table.push(row);
        }
        table
    }

    /// Of the largest number of maps, ray by ray, and the largest share by which two maps differ.
    fn by_ray(&self, found: &[Found]) -> Table {
        let mut heads = vec![("ray, from the first coordinate".to_owned(), Format::Exact)];
        let of_maps = found.iter().map(|of| (format!("`{}`", of.name), Format::Magnitude));
        heads.extend(of_maps);
        if found.len() > 1 {
            heads.push(("maps differ by, of the ray".to_owned(), Format::Percent));
        }
        let mut table = Table::new(heads);
        for ray in 0..self.rays {
            let last = |of: &Found| of.apertures.last().map_or(f64::NAN, |shares| shares[ray]);
            let all: Vec<f64> = found.iter().map(last).collect();
            let [x, y] = self.end(ray);
            let mut row = vec![format!("{:.1}°", libm::atan2(y, x).to_degrees()).into()];
            row.extend(all.iter().map(|share| (share * self.length(ray)).into()));
            if found.len() > 1 {
                let apart = |a: &f64| all.iter().map(|b| (a - b).abs()).fold(0.0, max_or_nan);
                row.push(all.iter().map(apart).fold(0.0, max_or_nan).into());
            }
            table.push(row);
        }
        table
    }

    /// The outline of the aperture of each map, after the largest number of maps.
    fn figure(&self, found: &[Found]) -> Figure {
        let [x, y] = self.along.map(coordinate);
        let series = found.iter().enumerate().filter_map(|(color, of)| {
            let shares = of.apertures.last()?;
            let at = |(ray, share): (usize, &f64)| {
                let end = self.end(ray);
                let of = |k: usize| self.centre[self.along[k]] + share * end[k];
                (of(0), of(1))
            };
            let points = shares.iter().enumerate().map(at).collect();
            Some(Series { name: of.name.clone(), color, style: Style::Marked, points })
        });
        let most = self.counts.last().copied().unwrap_or_default();
        let panel = Panel {
            title: format!("aperture after {most} maps"),
            x_label: x.to_owned(),
            y_label: y.to_owned(),
            series: series.collect(),
            ..Panel::default()
        };
        let caption = "How far along each ray orbits stay. Where a mark is at the end of its ray, the aperture may be \
                       larger.";
        Figure::in_a_row(FIGURE, caption, vec![panel])
    }
}
