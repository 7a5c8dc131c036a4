//! Predictions of a model or of a symplectic polynomial.

use super::arguments::{Outside, Predict, block, positive};
use super::controls::{ControlsNote, at_controls};
use super::guards::{check_ending, guard_output, use_threads};
use super::output::{json, out};
use super::progress::line;
use super::status::Status;
use gyroceptron::Error;
use gyroceptron::flow::{PolynomialExit, SectionExit, Trajectories};
use gyroceptron::io::{
    StoredMap, load_map, read_points, read_trajectories_until_lost, write_points,
};
use gyroceptron::measure::timing::root_mean_square_distance;
use gyroceptron::network::{Course, Pace, Rollout};
use gyroceptron::phase::Direction;
use gyroceptron::scalar::{Grid, GridNumbers, max_or_nan};
use gyroceptron::scene::Note;
use rayon::prelude::*;
use serde::Serialize;
use serde_json::json;
use std::path::Path;

pub fn predict(arguments: &Predict) -> Result<Status, Error> {
    use_threads(&arguments.common)?;
    let direction = if arguments.steps < 0 { Direction::Inverse } else { Direction::Forward };
    let steps = usize::try_from(arguments.steps.unsigned_abs()).ok().filter(|steps| *steps > 0);
    let expected = "at least 1, or at most -1 for steps back";
    let steps = steps.ok_or_else(|| Error::invalid("--steps", arguments.steps, expected))?;
    let request = Rollout { steps, every: positive("--every", arguments.every)? };
    let grid = arguments.grid.map(|bits| {
        // What is no count is none of bits, and no grid has so many.
        let numbers = GridNumbers::from(arguments.grid_numbers);
        let expected = || format!("0 to {} bits", numbers.most_bits());
        let bits = u32::try_from(bits).map_err(|_| Error::invalid("--grid", bits, expected()))?;
        Grid::new(bits, numbers).map_err(|e| e.with_place("--grid"))
    });
    let course = Course { direction, grid: grid.transpose()? };
    if request.every > request.steps {
        let expected = format!("at most {} steps, so that one is taken", request.steps);
        return Err(Error::invalid("--every", request.every, expected));
    }
    let mut inputs = vec![arguments.model.as_path(), arguments.input.as_path()];
    inputs.extend(arguments.compare.as_deref());
    check_ending("--output", &arguments.output, "npy")?;
    if let Some(invariant) = &arguments.invariant {
        check_ending("--invariant", invariant, "npy")?;
    }
    let (map, of_controls) = asked_map(arguments)?;
    let network = match &map {
        StoredMap::Network(stored) => Some(stored),
        StoredMap::Polynomial(_) => None,
    };
    let along = network.and_then(|stored| stored.invariant());
    let asked = arguments.outside != Outside::Ignore;
    let of_controls = of_controls.filter(|note| asked || !note.is_outside());
    guard_output("--output", &arguments.output, arguments.overwrite, &inputs)?;
    if let Some(invariant) = &arguments.invariant {
        if along.is_none() {
            let expected = "an option of symplectic gyroceptrons: other networks own no invariant";
            return Err(Error::invalid("--invariant", invariant.display(), expected));
        }
        let taken = [&inputs[..], &[arguments.output.as_path()]].concat();
        guard_output("--invariant", invariant, arguments.overwrite, &taken)?;
        // Neither may exist yet.
        let place = |path: &Path| {
            let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
            let folder = std::fs::canonicalize(folder.unwrap_or(Path::new("."))).ok();
            folder.map(|folder| (folder, path.file_name().map(ToOwned::to_owned)))
        };
        if place(invariant) == place(&arguments.output) {
            let expected = "another file than --output";
            return Err(Error::invalid("--invariant", invariant.display(), expected));
        }
    }
    let has_polynomials =
        network.is_some_and(|stored| stored.model.architecture().has_polynomials());
    let has_box = has_polynomials || map.region().is_some();
    if arguments.outside == Outside::Stop && !has_box {
        let expected = "a model that knows the box of its training points";
        return Err(Error::invalid("--outside", "stop", expected));
    }
    let dof = map.dof();
    let dim = 2 * dof;
    let file = read_points(&arguments.input, dof)?;
    if file.single_precision {
        line(&format!("{}: {}", arguments.input.display(), Note::SinglePrecision));
    }
    let mut initial = file.points;
    if let Some(block) = &arguments.block {
        let rows = self::block(block, initial.len() / dim)?;
        initial = initial[rows.start * dim..rows.end * dim].to_vec();
    }
    let points = initial.len() / dim;
    let others = arguments.compare.as_deref().map(|file| {
        let others = read_trajectories_until_lost(file, dof)?;
        let counts = [
            ("states of each trajectory", request.kept(), others.states()),
            ("trajectories", points, others.count()),
        ];
        for (what, expected, found) in counts {
            if expected != found {
                let name = format!("{}: {what}", file.display());
                return Err(Error::WrongCount { name, expected, found });
            }
        }
        Ok::<_, Error>(others)
    });
    let others = others.transpose()?;
    let mut pace = Pace::unbroken();
    let rolled = match &map {
        StoredMap::Network(stored) => {
            let rolled = stored.rollout_until_lost(course, &initial, request, &mut pace);
            rolled.map(|rolled| (rolled.states, rolled.is_exact))
        }
        StoredMap::Polynomial(stored) => {
            let states = stored.rollout_until_lost(direction, &initial, request, &mut pace);
            states.map(|states| (states, false))
        }
    };
    let (values, is_exact) = rolled.map_err(|e| e.with_place(arguments.model.display()))?;
    // In units of the data.
    let apart = initial.iter().zip(&values).map(|(a, b)| (a - b).abs());
    let moved = apart.fold(0.0, max_or_nan);
    let rounded = course.grid.filter(|_| !is_exact).map(|grid| {
        format!(
            "a state at the end is rounded in the file, since a grid of {} bits is finer than its numbers are there: \
             --steps {}{} from the file ends near the first state, not at it",
            grid.bits(),
            if direction == Direction::Forward { "-" } else { "" },
            request.steps / request.every * request.every
        )
    });
    rounded.iter().for_each(|text| line(&format!("note: {text}")));
    let region = map.region().filter(|_| asked);
    let left = region.and_then(|region| region.left_by(&values, points, request.every));
    let beyond = network.filter(|_| asked);
    let beyond =
        beyond.and_then(|stored| stored.leaves_polynomials(&values, points, request.every));
    let lost = SectionExit::in_states(&values, dof, points, request.every);
    let lost = lost.filter(|_| asked);
    let beyond_learnt = network.filter(|_| asked).and_then(|stored| stored.beyond_learnt());
    let exits: Vec<String> = { left.iter().zip(region) }
        .map(|(left, region)| left.describe(region, map.has_section()))
        .chain(lost.iter().map(|lost| lost.describe(map.has_section())))
        .chain(beyond.iter().map(PolynomialExit::describe))
        .chain(beyond_learnt.clone())
        .collect();
    exits.iter().for_each(|text| line(&format!("note: {text}")));
    of_controls.iter().for_each(|text| line(&format!("note: {text}")));
    let beyond_range = of_controls.as_ref().is_some_and(ControlsNote::is_outside);
    if (beyond_range || !exits.is_empty()) && arguments.outside == Outside::Stop {
        line("nothing is written");
        if arguments.common.json {
            let left = json!({
                "output": null,
                "outside": left,
                "lost": lost,
                "outside_polynomials": beyond,
                "outside_controls": beyond_range,
                "outside_learnt": beyond_learnt,
            });
            json(&left)?;
        }
        return Ok(Status::CheckFailed);
    }
    let shape = [request.kept() as u64, points as u64, dim as u64];
    write_points(&arguments.output, &shape, &values)?;
    let apart = others.as_ref().map(|others| distances(&values, others, request.every));
    if let (Some(file), Some(invariant)) = (&arguments.invariant, along) {
        let along: Vec<f64> = values.par_chunks_exact(dim).map(invariant).collect();
        write_points(file, &shape[..2], &along)?;
    }
    if arguments.common.json {
        json(&json!({
            "output": arguments.output.display().to_string(),
            "shape": shape,
            "block": arguments.block,
            "compared": apart,
            "invariant": arguments.invariant.as_ref().map(|file| file.display().to_string()),
            "outside": left,
            "lost": lost,
            "outside_polynomials": beyond,
            "outside_controls": beyond_range,
            "outside_learnt": beyond_learnt,
            "grid": course.grid.map(|grid| json!({
                "bits": grid.bits(),
                "numbers": grid.numbers().name(),
                "first_state_moved_by": moved,
                "leads_back": is_exact,
            })),
        }))?;
    } else {
        out(&format!(
            "{}: {} states of {points} trajectories of {dim} numbers\n",
            arguments.output.display(),
            request.kept()
        ))?;
        if let (Some(apart), Some(file)) = (&apart, &arguments.compare) {
            out(&format!("distance from {}:\n", file.display()))?;
            // The first steps, then each twice as far as the one before, and the last; of the start nothing is said
            // where it is the same.
            let all = apart.len();
            let begins_elsewhere = others.as_ref().is_some_and(|others| {
                // Of single precision they are rounded.
                let rounding = 4.0 * f64::from(f32::EPSILON);
                let is_other = |(a, b): (&f64, &f64)| (a - b).abs() > rounding * a.abs();
                initial.iter().zip(others.values()).any(is_other)
            });
            if begins_elsewhere {
                let of = "the other trajectories do not begin at the points of --input";
                line(&format!("note: {}: {of}", file.display()));
            }
            for (index, at) in apart.iter().enumerate().skip(usize::from(!begins_elsewhere)) {
                if index == 0 || index.is_power_of_two() || index + 1 == all {
                    let Distance { steps, rms, largest, lost } = at;
                    let without = match lost {
                        0 => String::new(),
                        lost => format!(", without {lost} that are lost"),
                    };
                    out(&format!(
                        "  after {steps} steps {rms:.2e} (rms), {largest:.2e} at most{without}\n"
                    ))?;
                }
            }
        }
    }
    Ok(Status::Done)
}

/// How far trajectories are from others after so many steps, in units of the data.
#[derive(Serialize)]
struct Distance {
    steps: usize,
    /// The root mean square distance over all trajectories, in units of the data.
    rms: f64,
    largest: f64,
    /// The trajectories that are lost by then, here or in the other file, which are in neither.
    lost: usize,
}

fn distances(values: &[f64], others: &Trajectories, every: usize) -> Vec<Distance> {
    let (dim, row) = (others.dim(), others.dim() * others.count());
    let states = values.chunks_exact(row).zip(others.values().chunks_exact(row)).enumerate();
    let of = |(index, (own, other)): (usize, (&[f64], &[f64]))| {
        let both = own.chunks_exact(dim).zip(other.chunks_exact(dim));
        let (kept, lost): (Vec<_>, Vec<_>) =
            both.partition(|(own, other)| own.iter().chain(*other).all(|v| !v.is_nan()));
        let distances = kept.iter().map(|(a, b)| root_mean_square_distance(a, b, dim));
        let largest = distances.fold(0.0, max_or_nan);
        let own: Vec<f64> = kept.iter().flat_map(|(own, _)| *own).copied().collect();
        let other: Vec<f64> = kept.iter().flat_map(|(_, other)| *other).copied().collect();
        let rms = root_mean_square_distance(&own, &other, dim);
        Distance { steps: index * every, rms, largest, lost: lost.len() }
    };
    states.map(of).collect()
}

/// The map of the file, as the options have it, and what is to be said of its controls.
fn asked_map(arguments: &Predict) -> Result<(StoredMap, Option<ControlsNote>), Error> {
    match load_map(&arguments.model)? {
        StoredMap::Network(stored) => {
            let (stored, of_controls) = at_controls(*stored, &arguments.at)?;
            let stored = stored.member(arguments.epsilon, arguments.flow_time)?;
            Ok((StoredMap::Network(Box::new(stored)), of_controls))
        }
        polynomial => {
            let given = [
                ("--at", arguments.at.first().cloned()),
                ("--epsilon", arguments.epsilon.map(|value| value.to_string())),
                ("--flow-time", arguments.flow_time.map(|value| value.to_string())),
                ("--grid", arguments.grid.map(|value| value.to_string())),
                (
                    "--invariant",
                    arguments.invariant.as_ref().map(|file| file.display().to_string()),
                ),
            ];
            for (option, found) in given {
                if let Some(found) = found {
                    let expected = "none: it is of networks, and the model is a polynomial";
                    return Err(Error::invalid(option, found, expected));
                }
            }
            Ok((polynomial, None))
        }
    }
}
