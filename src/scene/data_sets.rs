//! The pairs of a scene, from windows or of a file.

use super::line_data::TracedLines;
use super::notes::Note;
use super::setup::{Data, FlowBy};
use super::target_flow::{FileData, TargetFlow};
use crate::error::Error;
use crate::flow::{Pairs, Region};
use crate::io::PairsFile;
use crate::layer::{Reversor, TorusAction};
use crate::measure::trajectories::{limiting_flow_error, root_mean_square, rotation_error};
use crate::network::{Controls, NetworkSpec};
use crate::phase::{Section, Units};
use crate::scalar::max_or_nan;
use crate::system::{Counted, Hamiltonian, NearlyPeriodic, System};
use crate::train::{
    AreaDefect, Control, FamilyPairs, Fit, FitNote, Preparation, Prepared, fit_rotations,
};
use serde::{Deserialize, Serialize};

/// The pairs of a flow map, for training and held out.
pub(super) struct DataSets {
    pub(super) training: Pairs,
    pub(super) held_out: Option<Pairs>,
    /// The pairs that choose among the models of a training, where they are not those:
    /// of all maps of a family.
    validation: Option<Pairs>,
    /// The largest difference of the reference flow between two resolutions; NaN of pairs of a
    /// file, of which nothing is known.
    pub(super) reference_error: f64,
    /// The units of the file that the pairs are of, where they are not those of the pairs here.
    pub(super) units: Option<Units>,
    /// The chart of a section between those units and the data, and the box of the data in its coordinates.
    pub(super) section: Option<(Section, Region)>,
    /// The mean squared error of the exact limiting rotation alone, on the pairs that choose
    /// among the models of a training.
    pub(super) rotation_error: Option<f64>,
    /// The controls that the parameters of networks depend on, if there are any.
    pub(super) controls: Option<Controls>,
    /// The rotation nearest to the pairs of a file, by its angle.
    pub(super) nearest: Option<(TorusAction, Vec<f64>)>,
    /// SHA-256 of the pairs of a file, as they were given.
    pub(super) digest: Option<String>,
    /// What is to be said of the pairs of a file.
    pub(super) notes: Vec<String>,
    /// What is known of how well they keep areas.
    pub(super) area_defects: Vec<AreaDefect>,
}

/// Pairs of a system's flow, as a file holds them.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MadePairs {
    training: Pairs,
    held_out: Option<Pairs>,
    validation: Option<Pairs>,
    /// As bits: JSON has no number that is not finite.
    reference_error: u64,
    rotation_error: Option<u64>,
}

impl From<&DataSets> for MadePairs {
    fn from(sets: &DataSets) -> Self {
        let DataSets { training, held_out, validation, reference_error, rotation_error, .. } = sets;
        Self {
            training: training.clone(),
            held_out: held_out.clone(),
            validation: validation.clone(),
            reference_error: reference_error.to_bits(),
            rotation_error: rotation_error.map(f64::to_bits),
        }
    }
}

impl From<MadePairs> for DataSets {
    fn from(made: MadePairs) -> Self {
        let MadePairs { training, held_out, validation, reference_error, rotation_error } = made;
        let reference_error = f64::from_bits(reference_error);
        let rotation_error = rotation_error.map(f64::from_bits);
        let plain = Self::plain(training, held_out, reference_error, rotation_error);
        Self { validation, ..plain }
    }
}

impl DataSets {
    /// Pairs in the coordinates of their system.
    fn plain(
        training: Pairs,
        held_out: Option<Pairs>,
        reference_error: f64,
        rotation_error: Option<f64>,
    ) -> Self {
        Self {
            training,
            held_out,
            validation: None,
            reference_error,
            units: None,
            section: None,
            rotation_error,
            controls: None,
            nearest: None,
            digest: None,
            notes: Vec::new(),
            area_defects: Vec::new(),
        }
    }

    pub(super) fn of_flow(
        data: &Data,
        system: &Counted<'_, System>,
        [training_points, held_out_points]: &[Vec<f64>; 2],
        time: f64,
    ) -> Result<Self, Error> {
        let flow = |points: &[f64]| FlowBy::pairs(data.flow, system, points.to_vec(), time);
        let (training, mut reference_error) = flow(training_points)?;
        let held_out = if held_out_points.is_empty() {
            None
        } else {
            let (held_out, error) = flow(held_out_points)?;
            reference_error = max_or_nan(reference_error, error);
            Some(held_out)
        };
        let rotation_error =
            held_out.as_ref().map(|held_out| limiting_flow_error(system, held_out, time));
        Ok(Self::plain(training, held_out, reference_error, rotation_error))
    }

    /// The pairs of a file for these networks, made ready as by `gyroceptron train`; `go_on` is asked whether to
    /// continue where short trainings tell circle actions apart.
    pub(super) fn of_file(
        file: FileData<'_>,
        own: PairsFile,
        time: f64,
        validation: f64,
        networks: &[&NetworkSpec],
        seed: u64,
        go_on: &mut dyn FnMut() -> Result<Control, Error>,
    ) -> Result<Self, Error> {
        let place = file.pairs.display().to_string();
        let (unused, single_precision) = (own.unused.clone(), own.single_precision);
        let data = FamilyPairs::from(own);
        let action = TargetFlow::File(file).torus();
        let fit = Fit {
            place: place.clone(),
            action: Some(action.clone()),
            epsilon: Some(file.epsilon),
            flow_time: Some(time),
            section: file.read_section()?,
            seed,
            ..Fit::default()
        };
        let mut fit_notes = fit.notes_on(data.clone(), networks, go_on)?;
        let (given, digest) = (data.pairs.region(), data.pairs.digest());
        let pairs = fit.charted(fit.placed(data))?;
        fit_notes.extend(FitNote::of_negative_epsilons(&pairs, file.epsilon));
        let area_defects = fit_notes.iter().filter_map(FitNote::area_defect).collect();
        // Reports describe the section beside the pairs.
        let says = |note: &&FitNote| note.is_warning() || !matches!(note, FitNote::Section(_));
        let mut notes: Vec<String> = file.found.into_iter().map(str::to_owned).collect();
        notes.extend(fit_notes.iter().filter(says).map(FitNote::to_string));
        if single_precision {
            notes.push(Note::SinglePrecision.to_string());
        }
        if !unused.is_empty() {
            notes.push(Note::Unused(&unused).to_string());
        }
        let reversors: Vec<Reversor> =
            networks.iter().filter_map(|network| network.reversor).collect();
        let reversors = &reversors[..];
        let preparation = Preparation {
            place: &place,
            action: &action,
            epsilon: file.epsilon,
            flow_time: Some(time),
            of_order_one: false,
            theta: None,
            units: true,
            reversors,
            validation,
            seed,
        };
        let Prepared { pairs: training, held_out, units, nearest, .. } =
            preparation.prepare(pairs)?;
        let judge = held_out.as_ref().unwrap_or(&training);
        let rotation_error = Some(rotation_error(&action, &nearest, judge));
        let reference_error = f64::NAN;
        let nearest = Some((action, nearest));
        Ok(Self {
            units,
            section: fit.section.zip(given),
            digest: Some(digest),
            nearest,
            notes,
            area_defects,
            ..Self::plain(training, held_out, reference_error, rotation_error)
        })
    }

    /// The pairs of field lines, in the canonical chart of their section and units of their own.
    pub(super) fn of_lines(
        lines: &TracedLines,
        target: TargetFlow<'_>,
        time: f64,
        reversors: &[Reversor],
        seed: u64,
    ) -> Result<Self, Error> {
        let charted = |pairs: &Pairs| {
            let pairs = pairs.transformed("field lines", |condition, points| {
                let values = condition.map_or(&[][..], |condition| &condition.controls);
                lines.chart.at_controls(values)?.to_canonical(points);
                Ok(())
            })?;
            Ok::<_, Error>(pairs.with_conditions(|condition| (target.epsilon(), condition.time)))
        };
        let action = TorusAction::from(target.circle_action());
        let preparation = Preparation {
            place: "data.lines",
            action: &action,
            epsilon: target.epsilon(),
            flow_time: Some(time),
            of_order_one: true,
            theta: None,
            units: true,
            reversors,
            validation: 0.0,
            seed,
        };
        let Prepared { pairs: training, units, nearest, .. } =
            preparation.prepare(charted(&lines.training)?)?;
        let in_units = |pairs: &Pairs| {
            let pairs = charted(pairs)?;
            units.as_ref().map_or(Ok(pairs.clone()), |units| pairs.to_network("data.lines", units))
        };
        let held_out = lines.held_out.as_ref().map(in_units).transpose()?;
        let judge = held_out.as_ref().unwrap_or(&training);
        let rotation_error = Some(rotation_error(&action, &nearest, judge));
        let both = [Some(&lines.training), lines.held_out.as_ref()].into_iter().flatten();
        let region = Region::around(2, both.flat_map(|pairs| [pairs.input(), pairs.output()]));
        let section = region.map(|region| (lines.chart.clone(), region));
        let nearest = Some((action, nearest));
        let reference_error = lines.error;
        Ok(Self {
            units,
            section,
            nearest,
            controls: lines.controls.clone(),
            notes: lines.lost_in_words().into_iter().collect(),
            ..Self::plain(training, held_out, reference_error, rotation_error)
        })
    }

    /// The pairs of a family of maps: of each ε and flow time a share of the points. What is held
    /// out to judge by is of one map, as without a family.
    pub(super) fn of_family(
        data: &Data,
        system: &Counted<'_, System>,
        [training_points, held_out_points]: &[Vec<f64>; 2],
        time: f64,
        fields: &mut u64,
    ) -> Result<Self, Error> {
        let dim = 2 * system.dof();
        let (held_out, mut reference_error) =
            FlowBy::pairs(data.flow, system, held_out_points.clone(), time)?;
        let or = |values: &[f64], own: f64| match values {
            [] => vec![own],
            several => several.to_vec(),
        };
        let (epsilons, times) = (or(&data.epsilons, system.epsilon()), or(&data.flow_times, time));
        let maps: Vec<(f64, f64)> =
            epsilons.iter().flat_map(|&e| times.iter().map(move |&t| (e, t))).collect();
        let mut family = |points: &[f64]| -> Result<Pairs, Error> {
            let mut sets = Vec::new();
            for (number, &(epsilon, flow_time)) in maps.iter().enumerate() {
                let rows = points.chunks_exact(dim).skip(number).step_by(maps.len());
                let system = system.inner().clone().with_epsilon(epsilon);
                let counted = Counted::new(&system);
                let points = rows.flatten().copied().collect();
                let (set, error) = FlowBy::pairs(data.flow, &counted, points, flow_time)?;
                *fields += counted.vector_fields();
                reference_error = max_or_nan(reference_error, error);
                sets.push((epsilon, flow_time / time, set));
            }
            let family = Pairs::of_family(sets)?;
            if data.relative { family.relative() } else { Ok(family) }
        };
        let (training, validation) = (family(training_points)?, Some(family(held_out_points)?));
        let mut squares = 0.0;
        for (condition, input, output) in validation.iter().flat_map(Pairs::runs) {
            let condition = condition.expect("a set for each map");
            let system = system.inner().clone().with_epsilon(condition.epsilon);
            let of_map = Pairs::new("map", system.dof(), input.to_vec(), output.to_vec())?;
            let error = limiting_flow_error(&system, &of_map, condition.time * time);
            squares += condition.weight * error * of_map.len() as f64;
        }
        let rotation_error =
            validation.as_ref().map(|validation| squares / validation.len() as f64);
        let held_out = Some(held_out);
        Ok(Self { validation, ..Self::plain(training, held_out, reference_error, rotation_error) })
    }

    /// The same with other pairs of the system for training and held out.
    pub(super) fn changed(
        &self,
        change: &mut dyn FnMut(&str, &Pairs) -> Result<Pairs, Error>,
        system: &System,
        time: f64,
    ) -> Result<Self, Error> {
        let training = change("training", &self.training)?;
        let held_out = self.held_out.as_ref().map(|pairs| change("held-out", pairs)).transpose()?;
        let rotation_error =
            held_out.as_ref().map(|held_out| limiting_flow_error(system, held_out, time));
        let reference_error = self.reference_error;
        Ok(Self::plain(training, held_out, reference_error, rotation_error))
    }

    /// The box around the pairs, training and held out, in units of the data.
    pub(super) fn region(&self) -> Option<Region> {
        if let Some((_, region)) = &self.section {
            return Some(region.clone());
        }
        let both = [Some(&self.training), self.held_out.as_ref()].into_iter().flatten();
        let ends = both.flat_map(|pairs| [pairs.input(), pairs.output()]);
        let mut region = Region::around(2 * self.training.dof(), ends)?;
        if let Some(units) = &self.units {
            units.to_data(&mut region.low);
            units.to_data(&mut region.high);
        }
        Some(region)
    }

    /// The pairs that choose among the models of a training.
    pub(super) fn validation(&self) -> Option<&Pairs> {
        self.validation.as_ref().or(self.held_out.as_ref())
    }

    /// The root mean square of the components of the outputs that a training is judged by.
    pub(super) fn size(&self) -> f64 {
        root_mean_square(self.validation().unwrap_or(&self.training).output())
    }

    /// The rotation nearest to the pairs. For pairs of a file the held-out ones count too.
    pub(super) fn nearest_to(&self, target: TargetFlow<'_>) -> (TorusAction, Vec<f64>) {
        self.nearest.clone().unwrap_or_else(|| {
            let action = target.torus();
            let angles = fit_rotations(&self.training, &action);
            (action, angles)
        })
    }

    /// The pairs to judge the networks' own map by, that of their ε and flow time: held out, where there are any; None
    /// where none are of it.
    pub(super) fn of_own_map(&self, epsilon: f64) -> Option<Pairs> {
        let of = |pairs: &Pairs| pairs.under_conditions(|of| of.is_of(epsilon, 1.0));
        of(self.to_judge_by()).or_else(|| of(&self.training))
    }

    /// The pairs to judge by: held out, where there are any.
    pub(super) fn to_judge_by(&self) -> &Pairs {
        self.held_out.as_ref().unwrap_or(&self.training)
    }
}
