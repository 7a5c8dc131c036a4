//! What networks make of the pairs they are judged by: predictions beside the truth, orbits in
//! the phase portraits of the planes, errors by component; all in units of the data.

use super::figure::{Figure, Panel, Series, Style};
use super::findings::{Format, Table};
use super::words::coordinate;
use crate::error::Error;
use crate::flow::{Pairs, Region, Trajectories};
use crate::layer::TorusAction;
use crate::measure::{
    adiabatic::OwnInvariance,
    trajectories::{PlaneMotion, plane_motions, predictions, rotation_errors},
};
use crate::network::{Model, Rollout};
use crate::phase::Units;

/// The name of the figure of predictions against the truth.
pub(super) const PREDICTION: &str = "prediction";
/// The name of the figure of the orbits of networks.
pub(super) const ORBITS: &str = "orbits";

/// Points of a panel, and orbits: more hide each other.
const POINTS: usize = 500;
const STARTS: usize = 8;
const STEPS: usize = OwnInvariance::ITERATIONS;
/// One state in so many is drawn.
const EVERY: usize = 4;
/// Beyond the box of the pairs by such a share of its width, an orbit is drawn no further.
const ASTRAY: f64 = 0.5;
/// The colour of what is beside the numbers of a network.
const GREY: usize = 6;

/// Networks and the pairs to judge them by.
pub(super) struct Judged<'a> {
    /// The networks that are judged, each with its name.
    pub(super) models: Vec<(&'a str, &'a Model)>,
    pub(super) training: &'a Pairs,
    pub(super) held_out: Option<&'a Pairs>,
    /// The units of the data, where they are not those of the pairs here.
    pub(super) units: Option<&'a Units>,
    /// What the coordinates are in, in words: see [`coordinates_in_words`].
    pub(super) coordinates: &'static str,
}

/// What errors by component and figures of them are in, in words.
pub(super) fn coordinates_in_words(on_section: bool) -> &'static str {
    match on_section {
        true => "in the canonical coordinates of the section",
        false => "in units of the data",
    }
}

impl Judged<'_> {
    fn judge(&self) -> &Pairs {
        self.held_out.unwrap_or(self.training)
    }

    fn words(&self) -> &'static str {
        if self.held_out.is_some() { "held-out" } else { "training" }
    }

    fn to_data(&self, mut points: Vec<f64>) -> Vec<f64> {
        if let Some(units) = self.units {
            units.to_data(&mut points);
        }
        points
    }

    /// A title, with the name of the network where there are several.
    fn title(&self, name: &str, of: &str) -> String {
        if self.models.len() > 1 { format!("{name}: {of}") } else { of.to_owned() }
    }

    /// Two panels for each plane, of its q and its p: predictions against the truth.
    pub(super) fn prediction(&self) -> Result<Figure, Error> {
        let pairs = self.judge().thinned(POINTS);
        let dim = 2 * pairs.dof();
        let truth = self.to_data(pairs.output().to_vec());
        let mut panels = Vec::new();
        for (name, model) in &self.models {
            let found = self.to_data(predictions(model.composition(), &pairs)?);
            for plane in 0..pairs.dof() {
                for k in [plane, pairs.dof() + plane] {
                    let column = |values: &[f64]| -> Vec<f64> {
                        values.iter().skip(k).step_by(dim).copied().collect()
                    };
                    let truth = column(&truth);
                    let ends = [f64::min, f64::max].map(|of| {
                        let end = truth.iter().copied().reduce(of).unwrap_or(0.0);
                        (end, end)
                    });
                    let points = truth.into_iter().zip(column(&found)).collect();
                    let line = Series {
                        name: "prediction = truth".into(),
                        color: GREY,
                        style: Style::Dashed,
                        points: ends.into(),
                    };
                    let symbol = coordinate(k, dim);
                    panels.push(Panel {
                        title: self.title(name, &symbol),
                        x_label: format!("true {symbol}"),
                        y_label: format!("predicted {symbol}"),
                        series: vec![line, Series::unnamed(0, Style::Dots, points)],
                        ..Panel::default()
                    });
                }
            }
        }
        let caption = format!(
            "Predictions of one step against the truth, of {} {} pairs: each plane has a row, its q \
             on the left and its p on the right, {}. Where the rotation is most of \
             the motion, points lie near the line whatever is learnt beyond it: the errors by \
             component say how much that is.",
            pairs.len(),
            self.words(),
            self.coordinates
        );
        Ok(Figure { columns: 2, ..Figure::in_a_row(PREDICTION, &caption, panels) })
    }

    /// A panel for each plane: orbits of many steps, and the box of the pairs.
    pub(super) fn orbits(&self) -> Result<Figure, Error> {
        let (pairs, dof) = (self.judge(), self.training.dof());
        let dim = 2 * dof;
        let both = [Some(self.training), self.held_out].into_iter().flatten();
        let ends: Vec<Vec<f64>> = both
            .flat_map(|pairs| [pairs.input(), pairs.output()])
            .map(|points| self.to_data(points.to_vec()))
            .collect();
        let region = Region::around(dim, ends.iter().map(Vec::as_slice));
        let starts = &pairs.input()[..dim * pairs.len().min(STARTS)];
        let count = starts.len() / dim;
        let mut panels = Vec::new();
        for (name, model) in &self.models {
            let states =
                self.to_data(model.rollout(starts, Rollout { steps: STEPS, every: EVERY })?);
            let orbits = Trajectories::new(states, dim, count)?;
            let around = region.as_ref().map(|region| region.widened(ASTRAY));
            let inside =
                |z: &&[f64]| around.as_ref().is_none_or(|around| around.first_outside(z).is_none());
            for plane in 0..dof {
                let (i, k) = (plane, dof + plane);
                let mut series = Vec::new();
                for m in 0..count {
                    let points = orbits.orbit(m).take_while(inside).map(|z| (z[i], z[k])).collect();
                    let (name, color) = (format!("orbit {}", m + 1), color_of(m));
                    series.push(Series { name, color, style: Style::Dots, points });
                }
                if let Some(Region { low, high }) = &region {
                    let (left, right) = (low[i], high[i]);
                    let points = vec![
                        (left, low[k]),
                        (right, low[k]),
                        (right, high[k]),
                        (left, high[k]),
                        (left, low[k]),
                    ];
                    let (name, style) = ("box of the pairs".into(), Style::Dashed);
                    series.push(Series { name, color: GREY, style, points });
                }
                panels.push(Panel {
                    title: self.title(name, &format!("plane {}", plane + 1)),
                    x_label: coordinate(i, dim),
                    y_label: coordinate(k, dim),
                    series,
                    ..Panel::default()
                });
            }
        }
        let caption = format!(
            "Phase portraits of each plane: {count} orbits of {STEPS} steps of the network, one in \
             {EVERY} drawn, from {} points, {}. An orbit is drawn until it leaves the box of the \
             pairs by more than half its width.",
            self.words(),
            self.coordinates
        );
        Ok(Figure { columns: dof.min(3), ..Figure::in_a_row(ORBITS, &caption, panels) })
    }
}

fn color_of(m: usize) -> usize {
    if m < GREY { m } else { m + 2 }
}

/// The errors of one network by component.
pub(super) struct ByComponent {
    /// Root mean squares, in units of the data.
    pub(super) errors: Vec<f64>,
    /// The same over what the nearest rotation leaves.
    pub(super) shares: Vec<f64>,
    /// The root mean square of the values about their mean, in units of the data.
    sizes: Vec<f64>,
    /// Of each plane, over what the nearest rotation leaves of it.
    planes: Vec<f64>,
    /// What the errors are in, in words.
    coordinates: &'static str,
}

impl ByComponent {
    /// Of root-mean-square errors, in units of the network, beside what the rotation by these angles
    /// leaves of each component. Of what it explains to rounding, the motion of the plane stands for
    /// that.
    pub(super) fn new(
        mut errors: Vec<f64>,
        (action, angles): (&TorusAction, &[f64]),
        judge: &Pairs,
        units: Option<&Units>,
        coordinates: &'static str,
    ) -> Self {
        let (dim, dof) = (errors.len(), errors.len() / 2);
        let motions = plane_motions(action, angles, judge);
        let scale = |(c, left): (usize, &f64)| {
            let (motion, own) = (&motions[c % dof], left.sqrt());
            let scale =
                if own <= PlaneMotion::ROUNDING * motion.scale { motion.scale } else { own };
            scale * scale
        };
        let left = rotation_errors(action, angles, judge);
        let rotation: Vec<f64> = left.iter().enumerate().map(scale).collect();
        let shares = errors.iter().zip(&rotation).map(|(a, b)| a / b.sqrt()).collect();
        let planes = (0..dof)
            .map(|j| {
                let left = rotation[j] + rotation[dof + j];
                ((errors[j].powi(2) + errors[dof + j].powi(2)) / left).sqrt()
            })
            .collect();
        let mut sizes: Vec<f64> = (0..dim)
            .map(|k| {
                let column = || judge.output().iter().skip(k).step_by(dim);
                let count = judge.len() as f64;
                let mean = column().sum::<f64>() / count;
                (column().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count).sqrt()
            })
            .collect();
        if let Some(units) = units {
            for values in [&mut errors, &mut sizes] {
                values.iter_mut().zip(units.factors()).for_each(|(value, s)| *value *= s);
            }
        }
        Self { errors, shares, sizes, planes, coordinates }
    }

    /// The plane of the largest share, from 0.
    pub(super) fn worst_plane(&self) -> Option<usize> {
        (0..self.planes.len()).max_by(|a, b| self.planes[*a].total_cmp(&self.planes[*b]))
    }

    /// Which plane errs most, and by how much.
    pub(super) fn describe(&self) -> String {
        let Some(worst) = self.worst_plane() else { return String::new() };
        let (dim, dof) = (self.errors.len(), self.planes.len());
        let of = |k: usize| format!("{:.2e} in {}", self.errors[k], coordinate(k, dim));
        format!(
            "plane {} errs most, by {} of what the nearest rotation leaves of it: {} and {} (rms, {})",
            worst + 1,
            Format::Percent.number(self.planes[worst]),
            of(worst),
            of(dof + worst),
            self.coordinates
        )
    }

    /// A row for each component.
    pub(super) fn table(&self) -> Table {
        let mut table = Table::new([
            ("component", Format::Exact),
            ("rms error", Format::Exponent(2)),
            ("rms of its values about their mean", Format::Exponent(2)),
            ("error over these", Format::Percent),
            ("share of what the nearest rotation leaves", Format::Percent),
        ]);
        let (dim, dof) = (self.errors.len(), self.planes.len());
        for j in 0..dof {
            for k in [j, dof + j] {
                let (error, size) = (self.errors[k], self.sizes[k]);
                table.push([
                    format!("{} (plane {})", coordinate(k, dim), j + 1).into(),
                    error.into(),
                    size.into(),
                    (error / size).into(),
                    self.shares[k].into(),
                ]);
            }
        }
        table
    }
}
