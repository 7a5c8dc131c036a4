//! The structure certificate of each network.

use super::shared::Study;
use crate::error::Error;
use crate::measure::certificate::{Certificate, CertificateOptions, Row, Verdict, certify};
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::findings::{Block, Cell, Findings, Format, Section, Table};
use crate::scene::setup::Need;
use serde_json::json;

impl Study for CertificateOptions {
    fn name(&self) -> &'static str {
        "certificate"
    }

    fn needs(&self) -> &'static [Need] {
        &[Need::Models]
    }

    fn check(&self, _: &Declared<'_>) -> Result<(), Error> {
        CertificateOptions::check(self)
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let (mut lines, mut data, mut holds) = (String::new(), Vec::new(), true);
        let mut appendix = Vec::new();
        for trained in context.models()?.iter() {
            let name = &trained.spec.name;
            let certificate = context.stage(&format!("structure certificate of {name}"), |_| {
                Ok::<_, Error>(certify(trained.model(), *self))
            })?;
            holds &= certificate.holds();
            lines.push_str(&format!("- `{name}` {}\n", certificate.summary()));
            appendix.push(Block::Heading(format!("`{name}`")));
            appendix.push(Block::Table(certificate_table(&certificate.rows)));
            data.push(entry(name, &certificate));
        }
        let explanation = format!(
            "A test on {} points, uniform in |zᵢ| ≤ {}, seed {}; other points are not tested. A ratio is an error \
             over the rounding scale of the computation that made it.",
            self.samples, self.radius, self.seed
        );
        Ok(Findings {
            title: "Structure certificate".into(),
            verdict: Some(holds),
            results: Section {
                summary: vec![Block::Text(lines)],
                details: vec![Block::Text(explanation)],
                data: data.into(),
            },
            appendix,
            ..Findings::default()
        })
    }
}

fn entry(model: &str, certificate: &Certificate) -> serde_json::Value {
    json!({ "model": model, "holds": certificate.holds(), "rows": certificate.rows })
}

/// The column headings of [`certificate_table`].
pub const CERTIFICATE_HEADINGS: [&str; 8] =
    ["law", "measured", "samples", "largest", "median", "limit", "headroom", "verdict"];

/// The rows of a certificate as a table.
pub fn certificate_table(rows: &[Row]) -> Table {
    let formats = [
        Format::Exact,
        Format::Exact,
        Format::Exact,
        Format::Magnitude,
        Format::Magnitude,
        Format::Below,
        Format::Factor,
        Format::Exact,
    ];
    let mut table = Table::new(CERTIFICATE_HEADINGS.into_iter().zip(formats));
    for row in rows {
        let samples: Cell = match row.ill_conditioned {
            0 => row.samples.into(),
            ill => format!("{} ({ill} ill-conditioned)", row.samples).into(),
        };
        let largest: Cell = match (row.largest, row.verdict) {
            (None, Verdict::Violated) => "NaN".into(),
            (largest, _) => largest.into(),
        };
        let (limit, headroom) = match row.verdict {
            // Nothing is concluded from it.
            Verdict::Reported => (None, None),
            _ => (Some(row.limit), row.headroom()),
        };
        table.push([
            row.law.clone().into(),
            row.equation.clone().into(),
            samples,
            largest,
            row.median.into(),
            limit.into(),
            headroom.into(),
            row.verdict.word().into(),
        ]);
    }
    table
}

/// The cells of a certificate's row as text, under [`CERTIFICATE_HEADINGS`].
pub fn certificate_cells(row: &Row) -> [String; 8] {
    let table = certificate_table(std::slice::from_ref(row));
    let mut cells = table.text_rows().flatten();
    std::array::from_fn(|_| cells.next().unwrap_or_default())
}
