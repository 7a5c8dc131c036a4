//! The judgement of a training, in words and as data.

use super::findings::{Block, Findings, Format, Section, Table};
use crate::measure::adiabatic::OwnInvariance;
use crate::train::{Judgement, Limit};
use crate::words::plane_name;
use serde_json::json;

/// Applications of the network in each orbit.
const STEPS: usize = OwnInvariance::ITERATIONS;

/// Whether to trust the outcome of a training, why not, and what limits it.
pub(super) fn trust(judgement: &Judgement) -> Findings {
    let Judgement {
        verdict,
        too_few,
        error,
        no,
        no_long_orbits,
        care,
        held_out,
        planes,
        worst,
        share_beyond_rotation,
        limit,
        orbits,
        swings,
        own,
        repeated: _,
        care_of_pairs: _,
        sizes: _,
    } = judgement;
    let mut text = format!("**{verdict}**: ");
    too_few.iter().for_each(|first| text.push_str(&format!("{first}; ")));
    text.push_str(error);
    let stands = |reason: &&str| reason != error && Some(*reason) != too_few.as_deref();
    for reason in judgement.reasons().filter(stands) {
        text.push_str(&format!("; {reason}"));
    }
    text.push_str(".\n\n");
    let of_orbits = judgement.orbits_in_words();
    let mut lines = format!("- What limits the error: {}.\n", limit.describe());
    if let Some(own) = &own {
        let change = format!(
            "changes by {} over {STEPS} steps along its orbits (median), as the power {:.2} of \
             their number",
            Format::Percent.number(own.drift),
            own.exponent
        );
        lines.push_str(&match own.unperturbed {
            true => format!(
                "- The action that it owns is an invariant at ε = 0 only; it {change}. This is no \
                 fault.\n"
            ),
            // Neither of ε nor at ε = 0 only: exact by construction.
            false if own.moved.is_none() => format!(
                "- Its own invariant {change}: this is rounding, since the network keeps it whatever its weights, \
                 and says nothing of the error.\n"
            ),
            false => format!("- Its own invariant {change}.\n"),
        });
    }
    if planes.iter().any(|plane| plane.explained) {
        lines.push_str(
            "- A plane that the rotation explains to rounding has no other motion: its error is \
             compared with its size.\n",
        );
    }
    let mut table = Table::new([
        ("plane", Format::Exact),
        ("error (rms)", Format::Exponent(2)),
        ("of what the nearest rotation leaves of it", Format::Percent),
        ("action: change in a step of the pairs (rms)", Format::Exponent(2)),
        ("swing along orbits (median)", Format::Exponent(2)),
        ("range in the pairs", Format::Exponent(2)),
    ]);
    for (j, plane) in planes.iter().enumerate() {
        let swing = swings.get(j);
        table.push([
            plane_name(j).into(),
            plane.error.into(),
            plane.share.into(),
            swing.map(|swing| swing.step).into(),
            swing.map(|swing| swing.swing).into(),
            swing.map(|swing| swing.range).into(),
        ]);
    }
    let of_planes: Vec<_> = planes
        .iter()
        .enumerate()
        .map(|(j, plane)| {
            let swing = swings.get(j);
            json!({
                "error": plane.error,
                "share": plane.share,
                "explained_by_rotation": plane.explained,
                "action_step": swing.map(|swing| swing.step),
                "action_swing": swing.map(|swing| swing.swing),
                "action_range": swing.map(|swing| swing.range),
                "action_swings_allowed": swing.and_then(|swing| swing.allowed),
                "orbits_beyond_range": swing.map(|swing| swing.beyond),
            })
        })
        .collect();
    let data = json!({
        "trust": verdict,
        "no": no,
        "no_long_orbits": no_long_orbits,
        "care": care,
        "held_out": held_out,
        "planes": of_planes,
        "plane": worst + 1,
        "share": planes[*worst].share,
        "share_beyond_rotation": share_beyond_rotation,
        "limit": match limit {
            Limit::Data => "data",
            Limit::Iterations => "iterations",
            Limit::Network => "network",
            Limit::Unknown => "unknown",
            Limit::Areas => "areas",
        },
        "orbits": orbits.as_ref().map(|orbits| orbits.count),
        "astray": orbits.as_ref().map(|orbits| orbits.astray),
        "own_invariant_drift": own.as_ref().map(|own| own.drift),
        "own_invariant_exponent": own.as_ref().map(|own| own.exponent),
        "own_invariant_unperturbed": own.as_ref().map(|own| own.unperturbed),
        "near_identity_over_epsilon": own.as_ref().and_then(|own| own.moved),
    });
    Findings {
        title: "Whether to trust it".into(),
        results: Section {
            summary: vec![Block::Text(text), Block::Text(of_orbits)],
            details: vec![Block::Text(lines), Block::Table(table)],
            data,
        },
        ..Findings::default()
    }
}
