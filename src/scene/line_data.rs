//! Field lines of coils as the data of a scene.

use crate::error::Error;
use crate::flow::{LineRequest, LineSection, Pairs};
use crate::io::read_coils;
use crate::phase::Section;
use crate::system::{CoilSet, Torsatron};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::path::PathBuf;

/// The coils of a machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Coils {
    /// By formula.
    Torsatron(Torsatron),
    /// Of a text file, as [`read_coils`] reads it.
    File(CoilFile),
}

/// Coils of a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoilFile {
    /// The file. A relative path is from the folder of the scene's file.
    pub path: PathBuf,
    /// The current of each coil, in amperes.
    pub currents: Vec<f64>,
    /// The field periods of the machine, …
    pub periods: u32,
    /// … and whether half a turn about the x axis is a symmetry of it.
    pub stellarator_symmetric: bool,
}

/// Lines of a section of the field of coils, for training and held out: a line is followed over as many maps as the
/// orbits of the data are long.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineData {
    /// The coils.
    pub coils: Coils,
    /// φ of the section, in field periods: ½ is the other plane of symmetry.
    #[serde(default)]
    pub section: f64,
    /// Field periods in a map.
    #[serde(default = "one")]
    pub periods: u32,
    /// How many lines there are, …
    pub lines: usize,
    /// … from the axis out to so many metres from it.
    pub reach: f64,
    /// (R, Z) near the magnetic axis, where it is not found without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<[f64; 2]>,
    /// What a map of the reference may err by, in metres.
    #[serde(default = "usual_error")]
    pub error: f64,
    /// ε, by which the perturbation of a nearly-integrable network is scaled.
    #[serde(default = "usual_epsilon")]
    pub epsilon: f64,
}

fn one() -> u32 {
    1
}

fn usual_error() -> f64 {
    1e-10
}

fn usual_epsilon() -> f64 {
    0.01
}

/// More lines are a mistake.
const MOST_LINES: usize = 1_000_000;
/// Fewer fill no section.
const LEAST_LINES: usize = 4;

impl Coils {
    /// The field periods of the machine.
    fn periods(&self) -> u32 {
        match self {
            Self::Torsatron(torsatron) => torsatron.periods,
            Self::File(file) => file.periods,
        }
    }

    fn set(&self) -> Result<CoilSet, Error> {
        match self {
            Self::Torsatron(torsatron) => torsatron.coils(),
            Self::File(CoilFile { path, currents, periods, stellarator_symmetric }) => {
                read_coils(path, currents, *periods, *stellarator_symmetric)
            }
        }
    }
}

impl LineData {
    /// The toroidal angle of a map.
    fn angle(&self) -> f64 {
        TAU * f64::from(self.periods) / f64::from(self.coils.periods())
    }

    /// Fails unless numbers are in range; a file is not read.
    pub(super) fn check(&self) -> Result<(), Error> {
        if let Coils::Torsatron(torsatron) = &self.coils {
            torsatron.coils()?;
        }
        let place = |error: Error| error.with_place("data.lines");
        let counts = [
            ("coils.periods", self.coils.periods() as usize, 1, 1000),
            ("periods", self.periods as usize, 1, 1000),
            ("lines", self.lines, LEAST_LINES, MOST_LINES),
        ];
        for (name, found, least, most) in counts {
            Error::check_count_range(name, found, least, most).map_err(place)?;
        }
        Error::check_finite("section", self.section).map_err(place)?;
        Error::check_finite("epsilon", self.epsilon).map_err(place)?;
        Error::check_range("reach", self.reach, Error::LEAST_POSITIVE, f64::MAX).map_err(place)?;
        Error::check_range("error", self.error, Error::LEAST_POSITIVE, 1.0).map_err(place)
    }

    /// Fails where a file of coils cannot be read.
    pub(super) fn check_files(&self) -> Result<(), Error> {
        self.coils.set()?.all().map(|_| ())
    }
}

/// The lines of a scene, traced.
pub(super) struct TracedLines {
    pub(super) section: LineSection,
    /// The canonical chart of the section.
    pub(super) chart: Section,
    /// In metres, (R, Z): of the lines that are trained with, …
    pub(super) training: Pairs,
    /// … and of the others.
    pub(super) held_out: Option<Pairs>,
    /// How far out the lines begin that left the machine, in metres from the axis.
    pub(super) lost: Vec<f64>,
    /// Field periods in a map.
    pub(super) periods: u32,
    /// Of the machine.
    pub(super) of_machine: u32,
    /// Maps of all lines that were traced.
    pub(super) maps: usize,
}

impl TracedLines {
    /// Maps of one turn around the machine.
    pub(super) fn maps_a_turn(&self) -> f64 {
        f64::from(self.of_machine) / f64::from(self.periods)
    }

    /// Lines over so many maps, of which a share is held out; None where `stopped` says so, which is asked every few
    /// maps.
    pub(super) fn new(
        lines: &LineData,
        maps: usize,
        validation: f64,
        stopped: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, Error> {
        /// A few seconds of many lines in the field of many coils.
        const MAPS: usize = 4;
        let coils = lines.coils.set()?.all()?;
        let of_machine = lines.coils.periods();
        let guess = lines.axis.or(match &lines.coils {
            Coils::Torsatron(torsatron) => Some([torsatron.major_radius, 0.0]),
            Coils::File(_) => None,
        });
        let request = LineRequest {
            phi: TAU * lines.section / f64::from(of_machine),
            angle: lines.angle(),
            reach: lines.reach,
            guess,
            error: lines.error,
        };
        let section = LineSection::new(&coils, request).map_err(|e| e.with_place("data.lines"))?;
        let turns = section.turns().abs();
        if !(turns * maps as f64 >= 1.0) {
            let expected =
                format!("{:.0} maps at least, in which lines go round the section", 1.0 / turns);
            return Err(Error::invalid("data.orbit", maps, expected));
        }
        let starts = section.starts(lines.lines);
        let count = lines.lines;
        let mut states = starts.clone();
        for first in (0..maps).step_by(MAPS) {
            if stopped() {
                return Ok(None);
            }
            let here = states[states.len() - starts.len()..].to_vec();
            let part = if first + MAPS < maps { MAPS } else { maps - first };
            states.extend(section.map().trajectories(&here, part)?);
        }
        let state = |t: usize, m: usize| {
            let at = 2 * (t * count + m);
            [states[at], states[at + 1]]
        };
        let (mut lost, mut kept) = (Vec::new(), Vec::new());
        for m in 0..count {
            match state(maps, m).iter().all(|v| v.is_finite()) {
                true => kept.push(m),
                false => lost.push(starts[2 * m] - section.axis()[0]),
            }
        }
        if kept.len() < LEAST_LINES {
            let found = format!("{} of {count} lines over {maps} maps", kept.len());
            let expected = "a reach within which lines stay in the machine";
            return Err(Error::invalid("data.lines.reach", found, expected));
        }
        // Neither the innermost nor the outermost.
        let held = |number: usize| match validation > 0.0 {
            true => {
                let each = ((1.0 / validation).round() as usize).max(2);
                number % each == each / 2 && number + 1 < kept.len() && number > 0
            }
            false => false,
        };
        let pairs = |wanted: bool| -> Result<Option<Pairs>, Error> {
            let of: Vec<usize> = (0..kept.len()).filter(|k| held(*k) == wanted).collect();
            if of.is_empty() {
                return Ok(None);
            }
            let rows = |shift: usize| {
                let mut rows = Vec::with_capacity(2 * maps * of.len());
                for t in 0..maps {
                    of.iter().for_each(|&k| rows.extend(state(t + shift, kept[k])));
                }
                rows
            };
            Pairs::new("field lines", 1, rows(0), rows(1)).map(Some)
        };
        let training = pairs(false)?.expect("half of the lines at least");
        let held_out = pairs(true)?;
        let mut all = training.points().to_vec();
        all.extend(held_out.iter().flat_map(Pairs::points));
        let chart = section.chart(&all.concat())?;
        let (maps, periods) = (maps * count, lines.periods);
        Ok(Some(Self { section, chart, training, held_out, lost, periods, of_machine, maps }))
    }
}
