//! Field lines of coils as the data of a scene.

use crate::error::Error;
use crate::flow::{LineRequest, LineSection, Pairs};
use crate::io::read_coils;
use crate::layer::Reversor;
use crate::network::{ControlRange, Controls};
use crate::phase::Section;
use crate::scalar::max_or_nan;
use crate::system::{Coil, CoilSet, Tokamak, Torsatron};
use crate::train::ControlOptions;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::path::PathBuf;

/// The coils of a machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Coils {
    /// A torsatron, given by a formula.
    Torsatron(Torsatron),
    /// A tokamak, given by a formula.
    Tokamak(Tokamak),
    /// Coils from a file, as [`read_coils`] reads it.
    File(CoilFile),
}

/// Coils from a file, with their currents and the symmetry of the machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoilFile {
    /// The path of the file of coils. A relative path is from the folder of the scene's file.
    pub path: PathBuf,
    /// The current of each coil, in amperes.
    pub currents: Vec<f64>,
    /// The number of field periods of the machine.
    pub periods: u32,
    /// Whether half a turn about the x axis is a symmetry of the machine.
    pub stellarator_symmetric: bool,
}

/// Field lines of coils through a section, for training and held out. Each line is followed over as many maps as the
/// orbits of the data are long.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineData {
    /// The coils in whose field the lines are traced.
    pub coils: Coils,
    /// φ of the section, in field periods; the other plane of symmetry is at ½.
    #[serde(default)]
    pub section: f64,
    /// The number of field periods in a map.
    #[serde(default = "one")]
    pub periods: u32,
    /// The number of lines, at least 4; with controls, the number for each row of their values.
    pub lines: usize,
    /// The largest distance of a line from the axis at its start, in metres.
    pub reach: f64,
    /// (R, Z) near the magnetic axis, if the axis is not found without a guess.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<[f64; 2]>,
    /// The largest error that a map of the reference may have, in metres.
    #[serde(default = "usual_error")]
    pub error: f64,
    /// ε, by which the perturbation of a nearly-integrable network is scaled.
    #[serde(default = "usual_epsilon")]
    pub epsilon: f64,
    /// The controls that networks depend on, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub controls: Option<LineControls>,
}

/// Currents that are controls of a machine. For each row of values the same number of lines is traced.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineControls {
    /// The controls, each with the currents that a unit of it adds.
    pub list: Vec<LineControl>,
    /// Values of all controls to learn from: a row for each machine.
    pub values: Vec<Vec<f64>>,
    /// Values between them whose lines are held out too, to judge what is learnt from the others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub held_out: Vec<Vec<f64>>,
    /// The total degree of the polynomials of the controls that give the network's parameters. Unless given, it is the
    /// highest up to 4 that the values determine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degree: Option<usize>,
}

/// A control of a machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LineControl {
    /// The name of the control.
    pub name: String,
    /// What a unit of the control adds to the current of each given coil, in amperes; for a torsatron these coils are
    /// the windings and the two rings, for a tokamak the coils in poloidal planes and the plasma.
    pub currents: Vec<f64>,
}

impl LineControls {
    /// How a network depends on them.
    pub(super) fn of_network(&self) -> Result<Controls, Error> {
        let rows: Vec<&[f64]> = self.values.iter().map(Vec::as_slice).collect();
        let names = self.list.iter().map(|control| control.name.clone()).collect();
        let options = ControlOptions { names, degree: self.degree };
        let none = || Error::invalid("controls", "no values", "at least two");
        options.of_values(&rows)?.ok_or_else(none)
    }

    fn check(&self) -> Result<(), Error> {
        Error::check_count_range("controls.values", self.values.len(), 2, 1000)?;
        let mut before: Vec<&Vec<f64>> = Vec::new();
        let rows = self.values.iter().map(|row| ("controls.values", row));
        for (name, row) in rows.chain(self.held_out.iter().map(|row| ("controls.held_out", row))) {
            Error::check_count(name, self.list.len(), row.len())?;
            row.iter().try_for_each(|value| Error::check_finite(name, *value))?;
            if before.contains(&row) {
                let found = format!("{row:?} twice");
                return Err(Error::invalid(name, found, "other values in each row"));
            }
            before.push(row);
        }
        for control in &self.list {
            let name = format!("controls.{}.currents", control.name);
            control.currents.iter().try_for_each(|v| Error::check_finite(&name, *v))?;
            if control.currents.iter().all(|current| *current == 0.0) {
                return Err(Error::invalid(
                    &name,
                    "none",
                    "what a unit of it adds to the currents",
                ));
            }
        }
        let ranges = self.of_network()?;
        for row in &self.held_out {
            if let Some((range, value)) = ranges.first_outside(row) {
                let expected =
                    format!("values of {} from {} to {}", range.name, range.low, range.high);
                return Err(Error::invalid("controls.held_out", value, expected));
            }
        }
        Ok(())
    }
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
/// The smallest number of lines: fewer do not fill a section.
const LEAST_LINES: usize = 4;

impl Coils {
    /// The field periods of the machine.
    fn periods(&self) -> u32 {
        match self {
            Self::Torsatron(torsatron) => torsatron.periods,
            Self::Tokamak(tokamak) => tokamak.coils,
            Self::File(file) => file.periods,
        }
    }

    /// Whether half a turn about the x axis maps the machine to itself.
    fn is_symmetric(&self) -> bool {
        match self {
            Self::Torsatron(_) | Self::Tokamak(_) => true,
            Self::File(file) => file.stellarator_symmetric,
        }
    }

    /// By a formula, with a point near the magnetic axis; None of a file.
    fn by_formula(&self) -> Option<(Result<CoilSet, Error>, [f64; 2])> {
        match self {
            Self::Torsatron(torsatron) => Some((torsatron.coils(), [torsatron.major_radius, 0.0])),
            Self::Tokamak(tokamak) => Some((tokamak.coils(), [tokamak.plasma_radius, 0.0])),
            Self::File(_) => None,
        }
    }

    fn set(&self) -> Result<CoilSet, Error> {
        match self {
            Self::Torsatron(torsatron) => torsatron.coils(),
            Self::Tokamak(tokamak) => tokamak.coils(),
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

    /// Whether lines run backwards in the mirror Z → −Z of the section: q = Z then changes its sign, and p = ∫ρ dR
    /// does not.
    fn is_mirrored(&self) -> bool {
        self.coils.is_symmetric() && (2.0 * self.section).fract() == 0.0
    }

    /// Fails where maps of the section are not reversible so.
    pub(super) fn check_reversor(&self, reversor: Reversor) -> Result<(), Error> {
        let expected = match reversor {
            Reversor::Momenta => "positions, the reflection of Z, of maps of a section",
            Reversor::Positions if self.is_mirrored() => return Ok(()),
            Reversor::Positions => {
                "none: the section at 0 or half a field period of coils with stellarator symmetry is mirrored, others \
                 are not"
            }
        };
        Err(Error::invalid("reversor", reversor.name(), expected))
    }

    /// Fails unless numbers are in range; a file is not read.
    pub(super) fn check(&self) -> Result<(), Error> {
        let by_formula = self.coils.by_formula().map(|(set, _)| set).transpose()?;
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
        if let Some(controls) = &self.controls {
            controls.check().map_err(place)?;
            if let Some(set) = by_formula {
                controls.list.iter().try_for_each(|c| check_currents(&set, c)).map_err(place)?;
            }
        }
        Error::check_range("error", self.error, Error::LEAST_POSITIVE, 1.0).map_err(place)
    }

    /// Fails where a file of coils cannot be read, or has another number of them than a control has currents.
    pub(super) fn check_files(&self) -> Result<(), Error> {
        let set = self.coils.set()?;
        let list = self.controls.iter().flat_map(|controls| &controls.list);
        list.into_iter()
            .try_for_each(|control| check_currents(&set, control))
            .map_err(|e| e.with_place("data.lines"))?;
        set.all().map(|_| ())
    }

    /// The middle of the range of each control; none of a machine without.
    pub(super) fn nominal(&self) -> Result<Vec<f64>, Error> {
        self.controls.as_ref().map_or(Ok(Vec::new()), |of| Ok(of.of_network()?.nominal()))
    }

    /// The coils at these values of the controls.
    pub(super) fn coils_at(&self, values: &[f64]) -> Result<Vec<Coil>, Error> {
        let mut set = self.coils.set()?;
        let list = self.controls.iter().flat_map(|controls| &controls.list);
        for (control, value) in list.zip(values) {
            let more: Vec<f64> = control.currents.iter().map(|current| value * current).collect();
            set = set.with_more(&more)?;
        }
        set.all()
    }

    /// The section at these values of the controls, like that of the middle of their ranges.
    pub(super) fn section_like(
        &self,
        nominal: &LineSection,
        values: &[f64],
    ) -> Result<LineSection, Error> {
        let place = || format!("data.lines: controls {values:?}");
        nominal.with_coils(&self.coils_at(values)?).map_err(|e| e.with_place(place()))
    }

    /// The section in the middle of the ranges of the controls.
    fn nominal_section(&self) -> Result<LineSection, Error> {
        let of_formula = self.coils.by_formula().map(|(_, axis)| axis);
        let request = LineRequest {
            phi: TAU * self.section / f64::from(self.coils.periods()),
            angle: self.angle(),
            reach: self.reach,
            guess: self.axis.or(of_formula),
            error: self.error,
        };
        let coils = self.coils_at(&self.nominal()?)?;
        LineSection::new(&coils, request).map_err(|e| e.with_place("data.lines"))
    }

    /// Lines of a section over so many maps, state by state; None where `stopped` says so, which is asked every few
    /// maps.
    pub(super) fn traced(
        section: &LineSection,
        lines: usize,
        maps: usize,
        stopped: &dyn Fn() -> bool,
    ) -> Result<Option<Vec<f64>>, Error> {
        /// A few seconds of many lines in the field of many coils.
        const MAPS: usize = 4;
        let starts = section.starts(lines);
        let mut states = starts.clone();
        for first in (0..maps).step_by(MAPS) {
            if stopped() {
                return Ok(None);
            }
            let here = states[states.len() - starts.len()..].to_vec();
            let part = if first + MAPS < maps { MAPS } else { maps - first };
            states.extend(section.map().trajectories(&here, part)?);
        }
        Ok(Some(states))
    }
}

/// Fails where a control has another number of currents than there are coils.
fn check_currents(set: &CoilSet, control: &LineControl) -> Result<(), Error> {
    let name = format!("controls.{}.currents", control.name);
    Error::check_count(&name, set.coils.len(), control.currents.len())
}

/// The lines of a scene, traced.
pub(super) struct TracedLines {
    /// The section, at the middle of the range of each control.
    pub(super) section: LineSection,
    /// The canonical chart of the section, and what controls change of it.
    pub(super) chart: Section,
    /// In metres, (R, Z): of the lines that are trained with, …
    pub(super) training: Pairs,
    /// … and of the others.
    pub(super) held_out: Option<Pairs>,
    /// How far out the lines begin that left the machine or ran into a coil, in metres from the axis.
    pub(super) lost: Vec<f64>,
    /// Whether lines run backwards in the mirror Z → −Z of the section.
    pub(super) is_mirrored: bool,
    /// Field periods in a map.
    pub(super) periods: u32,
    /// The number of field periods of the machine.
    pub(super) of_machine: u32,
    /// Maps of all lines that were traced.
    pub(super) maps: usize,
    /// How networks depend on the controls.
    pub(super) controls: Option<Controls>,
    /// What the maps of the reference err by, the worst of them, in metres.
    pub(super) error: f64,
}

/// Lines that are traced, as a file holds them.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MadeLines {
    chart: Section,
    training: Pairs,
    held_out: Option<Pairs>,
    lost: Vec<f64>,
    maps: usize,
    /// As bits: JSON has no number that is not finite.
    error: u64,
}

/// Lines of one machine, traced.
struct OfMachine {
    starts: Vec<f64>,
    states: Vec<f64>,
    count: usize,
    maps: usize,
    /// The numbers of those that stayed.
    kept: Vec<usize>,
}

impl OfMachine {
    /// None where `stopped` says so.
    fn traced(
        lines: &LineData,
        section: &LineSection,
        maps: usize,
        stopped: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, Error> {
        // By whole turns points of a line do not go round.
        let turns = section.turns();
        let turns = (turns - turns.round()).abs();
        if !(turns * maps as f64 >= 1.0) {
            let least = (1.0 / turns).ceil();
            let expected = format!("{least} maps at least, in which lines go round the section");
            return Err(Error::invalid("data.orbit", maps, expected));
        }
        let count = lines.lines;
        let Some(states) = LineData::traced(section, count, maps, stopped)? else {
            return Ok(None);
        };
        let starts = section.starts(count);
        let end = &states[2 * maps * count..];
        let mut stays: Vec<bool> =
            end.chunks_exact(2).map(|z| z.iter().all(|v| v.is_finite())).collect();
        for map in (0..maps).step_by(LineSection::LOOKED_AT) {
            if stopped() {
                return Ok(None);
            }
            let here = &states[2 * count * map..][..2 * count];
            let resolved = section.are_resolved(here)?;
            stays.iter_mut().zip(resolved).for_each(|(stays, resolved)| *stays &= resolved);
        }
        let kept: Vec<usize> = (0..count).filter(|m| stays[*m]).collect();
        if kept.len() < LEAST_LINES {
            let found = format!("{} of {count} lines over {maps} maps", kept.len());
            let expected = "a reach within which lines stay in the machine";
            return Err(Error::invalid("data.lines.reach", found, expected));
        }
        Ok(Some(Self { starts, states, count, maps, kept }))
    }

    /// How far out the others begin.
    fn lost(&self, section: &LineSection) -> impl Iterator<Item = f64> + '_ {
        let axis = section.axis()[0];
        let left = (0..self.count).filter(|m| !self.kept.contains(m));
        left.map(move |m| self.starts[2 * m] - axis)
    }

    /// The rows of the pairs of the lines that are held out, or of the others: inputs and outputs.
    fn rows(&self, validation: f64, held_out: bool) -> [Vec<f64>; 2] {
        // Neither the innermost nor the outermost.
        let held = |number: usize| match validation > 0.0 {
            true => {
                let each = ((1.0 / validation).round() as usize).max(2);
                number % each == each / 2 && number + 1 < self.kept.len() && number > 0
            }
            false => false,
        };
        let of: Vec<usize> = (0..self.kept.len()).filter(|k| held(*k) == held_out).collect();
        [0, 1].map(|shift| {
            let mut rows = Vec::with_capacity(2 * self.maps * of.len());
            for t in 0..self.maps {
                for &k in &of {
                    let at = 2 * ((t + shift) * self.count + self.kept[k]);
                    rows.extend_from_slice(&self.states[at..at + 2]);
                }
            }
            rows
        })
    }
}

impl TracedLines {
    /// Maps of one turn around the machine.
    pub(super) fn maps_a_turn(&self) -> f64 {
        f64::from(self.of_machine) / f64::from(self.periods)
    }

    /// That lines were lost, where some were.
    pub(super) fn lost_in_words(&self) -> Option<String> {
        // no NaN: they are distances of starts
        let nearest = self.lost.iter().copied().reduce(f64::min)?;
        let count = self.lost.len();
        let are = if count == 1 { "line is" } else { "lines are" };
        Some(format!(
            "{count} {are} lost or run into a coil, and left out: the nearest to the axis begins {nearest:.6} m from it"
        ))
    }

    /// As a file holds them.
    pub(super) fn made(&self) -> MadeLines {
        MadeLines {
            chart: self.chart.clone(),
            training: self.training.clone(),
            held_out: self.held_out.clone(),
            lost: self.lost.clone(),
            maps: self.maps,
            error: self.error.to_bits(),
        }
    }

    /// Lines of a file, which were traced for this set-up.
    pub(super) fn of_made(lines: &LineData, made: MadeLines) -> Result<Self, Error> {
        let MadeLines { chart, training, held_out, lost, maps, error } = made;
        Ok(Self {
            section: lines.nominal_section()?,
            chart,
            training,
            held_out,
            lost,
            periods: lines.periods,
            is_mirrored: lines.is_mirrored(),
            of_machine: lines.coils.periods(),
            maps,
            controls: lines.controls.as_ref().map(LineControls::of_network).transpose()?,
            error: f64::from_bits(error),
        })
    }

    /// Lines over so many maps, of which a share is held out; None where `stopped` says so, which is asked every few
    /// maps.
    pub(super) fn new(
        lines: &LineData,
        maps: usize,
        validation: f64,
        stopped: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, Error> {
        let nominal = lines.nominal()?;
        let section = lines.nominal_section()?;
        let machines = match &lines.controls {
            None => vec![nominal],
            Some(of) => of.values.iter().chain(&of.held_out).cloned().collect(),
        };
        let learnt = lines.controls.as_ref().map_or(1, |controls| controls.values.len());
        let (mut lost, mut error) = (Vec::new(), section.error());
        let (mut rows, mut values) = ([(); 2].map(|()| [Vec::new(), Vec::new()]), [vec![], vec![]]);
        for (number, at) in machines.iter().enumerate() {
            let own = match lines.controls {
                None => None,
                Some(_) => Some(lines.section_like(&section, at)?),
            };
            let of = own.as_ref().unwrap_or(&section);
            let Some(traced) = OfMachine::traced(lines, of, maps, stopped)? else {
                return Ok(None);
            };
            lost.extend(traced.lost(of));
            error = max_or_nan(error, of.error());
            for (held_out, (rows, values)) in rows.iter_mut().zip(&mut values).enumerate() {
                let [input, output] = match (number < learnt, held_out) {
                    (true, _) => traced.rows(validation, held_out == 1),
                    (false, 1) => traced.rows(0.0, false),
                    (false, _) => continue,
                };
                (0..input.len() / 2).for_each(|_| values.extend_from_slice(at));
                rows[0].extend(input);
                rows[1].extend(output);
            }
        }
        let [training, held_out] = rows;
        let [of_training, of_held_out] = values;
        let pairs = |[input, output]: [Vec<f64>; 2], values: Vec<f64>| {
            let count = input.len() / 2;
            let pairs = Pairs::new("field lines", 1, input, output)?;
            match lines.controls {
                None => Ok(pairs),
                Some(_) => pairs.under_controls(&vec![1.0; count], &vec![1.0; count], &values),
            }
        };
        let training = pairs(training, of_training)?;
        let none = held_out[0].is_empty();
        let held_out = (!none).then(|| pairs(held_out, of_held_out)).transpose()?;
        let mut all = training.points().to_vec();
        all.extend(held_out.iter().flat_map(Pairs::points));
        let points = all.concat();
        let controls = lines.controls.as_ref().map(LineControls::of_network).transpose()?;
        let chart = match &lines.controls {
            None => section.chart(&points)?,
            Some(controls) => {
                let set = || lines.coils.set();
                let ranges = controls.of_network()?.ranges;
                let coils = |(of, range): (&LineControl, &ControlRange)| {
                    let coils = set()?.with_currents(&of.currents)?.all()?;
                    Ok::<_, Error>((coils, 0.5 * (range.high - range.low)))
                };
                let both = controls.list.iter().zip(&ranges);
                let coils: Vec<_> = both.map(coils).collect::<Result<_, _>>()?;
                let chart = section.chart_by_controls(&points, &coils, &lines.nominal()?)?;
                for at in &controls.values {
                    let there = chart.at_controls(at).and_then(|there| there.check(1));
                    there.map_err(|e| e.with_place(format!("controls {at:?}")))?;
                }
                chart
            }
        };
        let (maps, periods) = (maps * lines.lines * machines.len(), lines.periods);
        let of_machine = lines.coils.periods();
        Ok(Some(Self {
            section,
            chart,
            training,
            held_out,
            lost,
            periods,
            is_mirrored: lines.is_mirrored(),
            of_machine,
            maps,
            controls,
            error,
        }))
    }
}
