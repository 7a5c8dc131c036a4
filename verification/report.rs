//! The table of all laws: the snapshot, and its copy in `README.md` beside.

use crate::{
    adiabatic, blocks, circle_action, coupling, determinant, evaluation, exact_relations, fitted,
    gradients, inversion, near_identity, near_periodicity, nearly_integrable, normal_form, on_grid,
    polynomials, precision, reversible, suite, symp_net, symplecticity, tanh, tolerances, torus,
};
use gyroceptron::measure::certificate::{Row, Verdict};
use gyroceptron::scene::{CERTIFICATE_HEADINGS, certificate_cells};
use std::fmt::Write;

/// A law file: its name, its rows, and the samples that it states.
pub struct Law {
    pub file: &'static str,
    pub rows: fn() -> &'static [Row],
    pub stated: usize,
}

pub const LAWS: [Law; 22] = [
    Law { file: "symplecticity", rows: symplecticity::rows, stated: symplecticity::STATED },
    Law { file: "inversion", rows: inversion::rows, stated: inversion::STATED },
    Law { file: "near_identity", rows: near_identity::rows, stated: near_identity::STATED },
    Law {
        file: "near_periodicity",
        rows: near_periodicity::rows,
        stated: near_periodicity::STATED,
    },
    Law { file: "circle_action", rows: circle_action::rows, stated: circle_action::STATED },
    Law { file: "adiabatic", rows: adiabatic::rows, stated: adiabatic::STATED },
    Law { file: "evaluation", rows: evaluation::rows, stated: evaluation::STATED },
    Law { file: "exact_relations", rows: exact_relations::rows, stated: exact_relations::STATED },
    Law { file: "determinant", rows: determinant::rows, stated: determinant::STATED },
    Law { file: "gradients", rows: gradients::rows, stated: gradients::STATED },
    Law { file: "symp_net", rows: symp_net::rows, stated: symp_net::STATED },
    Law { file: "torus", rows: torus::rows, stated: torus::STATED },
    Law { file: "normal_form", rows: normal_form::rows, stated: normal_form::STATED },
    Law {
        file: "nearly_integrable",
        rows: nearly_integrable::rows,
        stated: nearly_integrable::STATED,
    },
    Law { file: "blocks", rows: blocks::rows, stated: blocks::STATED },
    Law { file: "polynomials", rows: polynomials::rows, stated: polynomials::STATED },
    Law { file: "reversible", rows: reversible::rows, stated: reversible::STATED },
    Law { file: "fitted", rows: fitted::rows, stated: fitted::STATED },
    Law { file: "on_grid", rows: on_grid::rows, stated: on_grid::STATED },
    Law { file: "coupling", rows: coupling::rows, stated: coupling::STATED },
    Law { file: "tanh", rows: tanh::rows, stated: tanh::STATED },
    Law { file: "precision", rows: precision::rows, stated: precision::STATED },
];

pub fn clean_rows() -> Vec<Row> {
    LAWS.iter().flat_map(|law| (law.rows)().iter().cloned()).collect()
}

/// Markdown, as it stands in `README.md`.
fn table() -> String {
    let mut text = format!("| {} |\n|", CERTIFICATE_HEADINGS.join(" | "));
    text.push_str(&"---|".repeat(CERTIFICATE_HEADINGS.len()));
    text.push('\n');
    for row in clean_rows() {
        let cells = certificate_cells(&row).map(|cell| cell.replace('|', "\\|"));
        writeln!(text, "| {} |", cells.join(" | ")).expect("memory");
    }
    text
}

#[test]
fn the_table_is_as_cited() {
    if suite::seed() != suite::SEED {
        return;
    }
    let text = format!("seed {}\n\n{}", suite::SEED, table());
    let name = if suite::extensive() { "laws_extensive" } else { "laws" };
    insta::assert_snapshot!(name, text);
}

/// `GYROCEPTRON_UPDATE_README=1 cargo test` writes it.
#[test]
fn the_readme_has_the_same_table() {
    const BEGIN: &str = "<!-- laws: begin -->\n";
    const END: &str = "<!-- laws: end -->";
    if suite::seed() != suite::SEED || suite::extensive() {
        return;
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/verification/README.md");
    let readme = std::fs::read_to_string(path).expect("a README");
    let (before, rest) = readme.split_once(BEGIN).expect("the mark where the table begins");
    let (written, after) = rest.split_once(END).expect("the mark where it ends");
    let table = table();
    if std::env::var("GYROCEPTRON_UPDATE_README").is_ok_and(|value| value == "1") {
        let text = format!("{before}{BEGIN}{table}{END}{after}");
        std::fs::write(path, text).expect("a README that can be written");
    } else {
        assert!(written == table, "the README's table of laws is another: see the comment here");
    }
}

#[test]
fn all_laws_hold_and_all_ratios_are_below_the_limit() {
    for row in clean_rows() {
        assert!(matches!(row.verdict, Verdict::Holds | Verdict::Reported), "{row:?}");
        if row.limit == tolerances::RATIO {
            assert!(row.largest.expect("measured") < tolerances::RATIO, "{row:?}");
        }
    }
}

/// The extensive run is not made with each change; its snapshot has to know all laws and nothing else.
#[test]
fn both_snapshots_have_the_same_laws() {
    let laws = |name: &str| -> Vec<String> {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/verification/snapshots");
        let path = format!("{folder}/verification__report__{name}.snap");
        let text = std::fs::read_to_string(path).expect("a snapshot");
        let rows = text.lines().filter(|line| line.starts_with("| "));
        rows.map(|row| row.split(" | ").take(2).collect::<Vec<_>>().join(": ")).collect()
    };
    let laws_of_tests = laws("laws");
    assert!(laws_of_tests.len() > LAWS.len(), "{}", laws_of_tests.len());
    assert_eq!(laws_of_tests, laws("laws_extensive"));
}
