//! The networks of all parts of a scene in one table.

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
        let mut table = Table::new([
            ("part", Format::Exact),
            ("network", Format::Exact),
            ("parameters", Format::Exact),
            ("pairs", Format::Exact),
            ("held-out MSE", Format::Exponent(2)),
            ("loss", Format::Exponent(2)),
            ("share of the motion beyond the rotation", Format::Percent),
            ("distance over the roll-out, rms", Format::Exponent(2)),
            ("its own invariant moves by", Format::Percent),
            ("I_ε moves points by, over ε", Format::Fixed(1)),
            ("θ moved by", Format::Exponent(1)),
        ]);
        let mut seconds = Table::new([
            ("part", Format::Exact),
            ("network", Format::Exact),
            ("s", Format::Fixed(0)),
        ]);
        let mut data = Vec::new();
        for part in context.parts {
            for row in rows(part) {
                let number = |key: &str| row[key].as_f64();
                table.push([
                    part.title.into(),
                    format!("`{}`", row["network"].as_str().unwrap_or_default()).into(),
                    row["parameters"].as_u64().map(|n| n as usize).into(),
                    row["pairs"].as_u64().map(|n| n as usize).into(),
                    number("held_out").into(),
                    number("loss").into(),
                    number("share").into(),
                    number("rollout").into(),
                    number("own_change").into(),
                    number("near_identity_over_epsilon").into(),
                    number("theta_moved").into(),
                ]);
                data.push(row);
            }
            for times in part.training_times {
                let Some((_, of_all)) = times.points.last() else { continue };
                let name = format!("`{}`", times.model);
                seconds.push([part.title.into(), name.into(), (*of_all).into()]);
            }
        }
        Ok(Findings {
            title: "All networks".into(),
            results: Section {
                summary: vec![Block::Table(table)],
                data: data.into(),
                ..Section::default()
            },
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
    let networks = training["models"].as_array().into_iter().flatten();
    let row = |network: &Value| {
        let name = &network["name"];
        let along = rollout["models"].as_array().into_iter().flatten();
        let along = along.into_iter().find(|found| found["name"] == *name).unwrap_or(&none);
        let own = &along["own_adiabatic"];
        let plain = network["held_out_error"].as_f64();
        let held_out = plain.or(network["best"]["validation"].as_f64());
        let rotation = pairs["rotation_error"].as_f64();
        let share = || Some((held_out? / rotation?).sqrt());
        let moved = || Some(own["near_identity_rms"].as_f64()? / epsilon?.abs());
        let theta = || Some(network["theta"].as_f64()? - network["initial_theta"].as_f64()?);
        json!({
            "part": part.name,
            "network": name,
            "parameters": network["parameters"],
            "pairs": pairs["training"],
            "held_out": held_out,
            "loss": network["loss"],
            "share": share(),
            "rollout": along["rms_error"],
            "own_change": own["along_own_orbits"]["largest_change"],
            "near_identity_over_epsilon": moved(),
            "theta_moved": theta(),
        })
    };
    networks.map(row).collect()
}
