//! What a report says of the magnetic axis and of the periodic orbits of a section.

use super::section_maps::{Chain, OnSymmetryLine, OrbitFound, Resonance};
use crate::scene::findings::{Cell, Format, Table};
use crate::scene::line_data::TracedLines;
use serde::Serialize;

/// The magnetic axis and the periodic orbits of a resonance, of the reference and of each map.
#[derive(Serialize)]
pub(super) struct Fixed {
    pub(super) resonance: Option<Resonance>,
    pub(super) axis: Option<OrbitFound>,
    pub(super) chain: Chain,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) on_line: Option<OnSymmetryLine>,
    pub(super) found: Vec<OrbitsOf>,
}

#[derive(Serialize)]
pub(super) struct OrbitsOf {
    pub(super) name: String,
    pub(super) axis: Option<OrbitFound>,
    pub(super) chain: Chain,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) on_line: Option<OnSymmetryLine>,
}

impl Fixed {
    pub(super) fn words(&self, lines: &TracedLines) -> String {
        let axis = match &self.axis {
            Some(axis) => format!(
                "The magnetic axis of the coils is at R = {:.9}, Z = {} m, with Tr M = {:.9}.",
                axis.points[0][0],
                Format::Exponent(1).number(axis.points[0][1]),
                axis.trace
            ),
            None => "The magnetic axis of the coils is no isolated fixed point.".into(),
        };
        let Some(resonance) = self.resonance else {
            return format!(
                "{axis} No resonance of the periods that are looked for is in the profile."
            );
        };
        let orbit = |kind: &str, orbit: &Option<OrbitFound>| match orbit {
            Some(orbit) => format!("{kind} one with residue {:.6e}", orbit.residue),
            None => format!("{kind} none that differs from a curve of such points"),
        };
        let width = match self.chain.width {
            Some(width) => {
                let phase = self.chain.phase.unwrap_or(f64::NAN).to_degrees();
                format!(
                    "; its island is {:.4} mm wide, and seen from the axis the one nearest to the direction of R is \
                     {phase:.4}° from it",
                    1e3 * width
                )
            }
            None if self.chain.centre.is_some() => {
                "; its island is too narrow to be measured".into()
            }
            None => String::new(),
        };
        format!(
            "{axis} Orbits that come back after {} times around it in {} maps, |ι| = {:.6}: {}, {}{width}. They are \
             found by Newton's method with exact Jacobians, in the field of the coils; small residues leave open where on \
             their curve they are, and say how much of an error is seen there.",
            resonance.turns,
            resonance.maps,
            resonance.value() * lines.maps_a_turn(),
            orbit("as a centre", &self.chain.centre),
            orbit("as a corner", &self.chain.corner)
        ) + &self.words_of_line()
    }

    /// What is on the line of symmetry, where the section has one.
    fn words_of_line(&self) -> String {
        let Some(on_line) = &self.on_line else { return String::new() };
        let found = |kind: &str, apart: Option<f64>| match apart {
            Some(apart) => {
                format!("a {kind}, {} m from that above", Format::Exponent(1).number(apart))
            }
            None => format!("no {kind}"),
        };
        let of_reference = match on_line.orbits {
            0 => "None of this rotation is found on it by the reference.".to_owned(),
            orbits => format!(
                "Of this rotation {orbits} {} found on it by the reference; from there Newton's method in the field \
                 leads to {} and to {}.",
                if orbits == 1 { "is" } else { "are" },
                found("centre", on_line.centre),
                found("corner", on_line.corner)
            ),
        };
        format!(
            " Orbits that the mirror Z → −Z maps to themselves are looked for on the line Z = 0 without a guess: of an \
             odd period each has one point there, of an even one two or none. {of_reference} Only reversible maps have \
             such orbits exactly."
        )
    }

    pub(super) fn table(&self) -> Table {
        let mut heads = vec![
            ("method", Format::Exact),
            ("axis is off by [m]", Format::Exponent(1)),
            ("its Tr M by", Format::Exponent(1)),
            ("centre off by [m]", Format::Exponent(1)),
            ("its Tr M by", Format::Exponent(1)),
            ("corner off by [m]", Format::Exponent(1)),
            ("its Tr M by", Format::Exponent(1)),
            ("island [mm]", Format::Fixed(4)),
            ("its phase off by [°]", Format::Exponent(1)),
        ];
        let has_line = self.on_line.is_some();
        if has_line {
            heads.push(("centre from Z = 0 differs by [m]", Format::Exponent(1)));
            heads.push(("corner", Format::Exponent(1)));
        }
        let mut table = Table::new(heads);
        let compare = |own: &Option<OrbitFound>, other: &Option<OrbitFound>| match (own, other) {
            (Some(own), Some(other)) => {
                [Some(own.apart(other)), Some((own.trace - other.trace).abs())]
            }
            _ => [None, None],
        };
        for of in &self.found {
            let [axis, trace] = compare(&self.axis, &of.axis);
            let [centre, of_centre] = compare(&self.chain.centre, &of.chain.centre);
            let [corner, of_corner] = compare(&self.chain.corner, &of.chain.corner);
            let phases = self.chain.phase.zip(of.chain.phase);
            let mut row: Vec<Cell> = vec![
                of.name.clone().into(),
                axis.into(),
                trace.into(),
                centre.into(),
                of_centre.into(),
                corner.into(),
                of_corner.into(),
                of.chain.width.map(|width| 1e3 * width).into(),
                phases.map(|(own, other)| (own - other).abs().to_degrees()).into(),
            ];
            if has_line {
                let on_line = of.on_line.as_ref();
                row.push(on_line.and_then(|found| found.centre).into());
                row.push(on_line.and_then(|found| found.corner).into());
            }
            table.push(row);
        }
        table
    }
}
