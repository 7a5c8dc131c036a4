//! The networks of all parts of a scene in one table.

use super::over_seeds::MedianAndWorst;
use super::shared::{Study, check_parts};
use crate::error::Error;
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::part::Part;
use crate::scene::setup::Need;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// A row for each network of each part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OverviewOptions {}

impl Study for OverviewOptions {
    fn name(&self) -> &'static str {
        "overview"
    }

    fn needs(&self) -> &'static [Need] {
        &[]
    }

    fn check(&self, scene: &Declared<'_>) -> Result<(), Error> {
        check_parts(self.name(), scene)
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let all: Vec<Vec<Value>> = context.parts.iter().map(rows).collect();
        let of_several = all.iter().flatten().any(|row| row["seeds"].as_u64() > Some(1));
        // What there is of all initial weights: the name of its column, its key, that of the worst.
        let numbers = [
            ("held-out MSE", "held_out", Some("worst_held_out"), Format::Exponent(2)),
            ("loss", "loss", None, Format::Exponent(2)),
            (
                "share of the motion beyond the rotation",
                "share",
                Some("worst_share"),
                Format::Percent,
            ),
            (
                "distance over the roll-out, rms",
                "rollout",
                Some("worst_rollout"),
                Format::Exponent(2),
            ),
            ("its own invariant moves by", "own_change", None, Format::Percent),
            ("I_ε moves points by, over ε", "near_identity_over_epsilon", None, Format::Fixed(1)),
            ("θ moved by", "theta_moved", None, Format::Exponent(1)),
        ];
        let mut columns = vec![
            ("part", Format::Exact),
            ("network", Format::Exact),
            ("parameters", Format::Exact),
            ("pairs", Format::Exact),
        ];
        columns.extend(of_several.then_some(("initial weights", Format::Exact)));
        for (name, _, worst, format) in numbers {
            columns.push((name, format));
            columns.extend(worst.filter(|_| of_several).map(|_| ("worst", format)));
        }
        let mut table = Table::new(columns);
        let mut seconds = Table::new([
            ("part", Format::Exact),
            ("network", Format::Exact),
            ("s", Format::Fixed(0)),
        ]);
        let mut data = Vec::new();
        for (part, rows) in context.parts.iter().zip(all) {
            for row in rows {
                let count = |key: &str| row[key].as_u64().map(|n| n as usize);
                let mut cells = vec![
                    part.title.into(),
                    format!("`{}`", row["network"].as_str().unwrap_or_default()).into(),
                    count("parameters").into(),
                    count("pairs").into(),
                ];
                cells.extend(of_several.then(|| count("seeds").into()));
                for (_, key, worst, _) in numbers {
                    cells.push(row[key].as_f64().into());
                    cells.extend(
                        worst.filter(|_| of_several).map(|worst| row[worst].as_f64().into()),
                    );
                }
                table.push(cells);
                data.push(row);
            }
            for times in part.training_times {
                let Some((_, of_all)) = times.points.last() else { continue };
                let name = format!("`{}`", times.model);
                seconds.push([part.title.into(), name.into(), (*of_all).into()]);
            }
        }
        let mut summary = vec![Block::Table(table)];
        if of_several {
            let words = "Held-out errors, shares and distances are medians over the initial weights; the other numbers \
                         are of the first of them.";
            summary.push(Block::Text(words.into()));
        }
        Ok(Findings {
            title: "All networks".into(),
            results: Section { summary, data: data.into(), ..Section::default() },
            timings: Section {
                details: vec![Block::Text("Seconds of training:".into()), Block::Table(seconds)],
                ..Section::default()
            },
            ..Findings::default()
        })
    }
}

/// What the studies of a part found of each of its networks.
fn rows(part: &Part<'_>) -> Vec<Value> {
    let none = Value::Null;
    let of = |study: &str| part.study(study).map_or(&none, |found| &found.results.data);
    let (pairs, training, rollout) = (of("pairs"), of("training"), of("rollout"));
    let epsilon = part.epsilon;
    let list = |of: &'_ Value| of.as_array().cloned().unwrap_or_default();
    let (trainings, seeds) = (list(&training["models"]), list(&rollout["seeds"]));
    let held_out = |of: &Value| of["held_out_error"].as_f64().or(of["best"]["validation"].as_f64());
    let row = |network: &Value| {
        let name = &network["name"];
        let same: Vec<&Value> = trainings.iter().filter(|one| one["network"] == *name).collect();
        let errors = MedianAndWorst::of(same.iter().map(|one| held_out(one)));
        let along = rollout["models"].as_array().into_iter().flatten();
        let along = along.into_iter().find(|found| found["name"] == *name).unwrap_or(&none);
        let own = &along["own_adiabatic"];
        let distances = match seeds.iter().find(|of| of["network"] == *name) {
            Some(of) => MedianAndWorst::of(list(&of["rms_errors"]).iter().map(Value::as_f64)),
            None => MedianAndWorst::of([along["rms_error"].as_f64()]),
        };
        let rotation = pairs["rotation_error"].as_f64();
        let share = |error: Option<f64>| Some((error? / rotation?).sqrt());
        let moved = || Some(own["near_identity_rms"].as_f64()? / epsilon?.abs());
        let theta = || Some(network["theta"].as_f64()? - network["initial_theta"].as_f64()?);
        json!({
            "part": part.name,
            "network": name,
            "parameters": network["parameters"],
            "pairs": pairs["training"],
            "seeds": same.len(),
            "held_out": errors.median,
            "worst_held_out": errors.worst,
            "loss": network["loss"],
            "share": share(errors.median),
            "worst_share": share(errors.worst),
            "rollout": distances.median,
            "worst_rollout": distances.worst,
            "own_change": own["along_own_orbits"]["largest_change"],
            "near_identity_over_epsilon": moved(),
            "theta_moved": theta(),
        })
    };
    trainings.iter().filter(|one| one["name"] == one["network"]).map(row).collect()
}
