//! Error against run time of tanh and sech².

use super::shared::Study;
use super::work_precision::{MOST_ROUNDS, error_cell, work_precision_panel};
use crate::error::Error;
use crate::measure::timing::{
    Method, WorkPrecision, fastest, most_accurate, tanh_errors, work_precision,
};
use crate::random::Stream;
use crate::scalar::tanh_sech2_of_all;
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::figure::{Figure, Panel};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::setup::{MOST, Need};
use serde::{Deserialize, Serialize};
use serde_json::json;

const TANH: &str = "tanh";

/// Beyond it sech² is taken for 0 or is less than what numbers can hold.
const LARGEST: f64 = 350.0;

/// Error against run time of tanh and sech².
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TanhOptions {
    /// The number of values at which tanh and sech² are computed.
    pub values: usize,
    /// They are uniform in |x| ≤ this.
    pub largest: f64,
    /// How often each time is taken.
    pub rounds: usize,
}

impl Study for TanhOptions {
    fn name(&self) -> &'static str {
        "tanh"
    }

    fn needs(&self) -> &'static [Need] {
        &[]
    }

    fn check(&self, _: &Declared<'_>) -> Result<(), Error> {
        Error::check_count_range("values", self.values, 1, MOST)?;
        Error::check_count_range("rounds", self.rounds, 1, MOST_ROUNDS)?;
        if !(self.largest > 0.0 && self.largest <= LARGEST) {
            let expected = format!("a positive number of at most {LARGEST}");
            return Err(Error::invalid("largest", self.largest, expected));
        }
        Ok(())
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![TANH]
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let seed = context.scene.seed;
        let judged = context.stage("tanh and sech²", |_| self.compare(seed))?;
        let figures = match context.draws(TANH) {
            true => vec![figure(&judged)],
            false => Vec::new(),
        };
        let results: Vec<_> = judged.iter().filter_map(Judged::as_result).collect();
        let how = "One thread; medians of repeated runs, in turn, and in brackets their quartiles. \
                   Errors are the largest seen, against double-double precision.";
        let mut summary = vec![Block::Text(how.into()), Block::Table(table(&judged))];
        summary.extend(words(&judged).map(Block::Text));
        Ok(Findings {
            title: "tanh and sech²".into(),
            results: Section { data: json!(results), ..Section::default() },
            timings: Section { summary, data: json!(judged), ..Section::default() },
            figures,
            ..Findings::default()
        })
    }
}

/// A method to get tanh and sech², judged.
#[derive(Clone, Serialize)]
struct Judged {
    /// The largest error of tanh, in units in the last place.
    tanh_ulps: f64,
    /// sech²: its largest relative error and seconds a value, with tanh.
    sech2: WorkPrecision,
}

/// std takes tanh and cosh from the C library.
const OF_THE_SYSTEM: &str = "std";

impl Judged {
    /// What does not depend on the machine: no times, and nothing of the functions
    /// of the system.
    fn as_result(&self) -> Option<Self> {
        let of_the_system = self.sech2.name.starts_with(OF_THE_SYSTEM);
        let sech2 = self.sech2.without_seconds();
        (!of_the_system).then_some(Self { tanh_ulps: self.tanh_ulps, sech2 })
    }
}

impl TanhOptions {
    /// tanh and sech² of each value, one array after the other, by this crate and as
    /// one would write it with the functions at hand.
    fn compare(&self, seed: u64) -> Result<Vec<Judged>, Error> {
        let mut stream = Stream::new(seed, "tanh");
        let x: Vec<f64> =
            (0..self.values).map(|_| stream.uniform(-self.largest, self.largest)).collect();
        let x = &x[..];
        let each = |name: &str, f: fn(f64) -> (f64, f64)| {
            Method::new(name, None, move || {
                let mut out = vec![0.0; 2 * x.len()];
                let (t, s) = out.split_at_mut(x.len());
                for ((&x, t), s) in x.iter().zip(t).zip(s) {
                    (*t, *s) = f(x);
                }
                Ok(out)
            })
        };
        let methods = [
            Method::new("gyroceptron", None, move || {
                let mut out = vec![0.0; 2 * x.len()];
                let (t, s) = out.split_at_mut(x.len());
                tanh_sech2_of_all(x, t, s);
                Ok(out)
            }),
            each("std, sech² = 1 − tanh²", |x| {
                let t = x.tanh();
                (t, (-t).mul_add(t, 1.0))
            }),
            each("std, sech² = 1/cosh²", |x| {
                let c = x.cosh();
                (x.tanh(), 1.0 / (c * c))
            }),
            each("libm, sech² = 1 − tanh²", |x| {
                let t = libm::tanh(x);
                (t, (-t).mul_add(t, 1.0))
            }),
            each("libm, sech² = 1/cosh²", |x| {
                let c = libm::cosh(x);
                (libm::tanh(x), 1.0 / (c * c))
            }),
        ];
        let errors = |out: &[f64]| {
            let (t, s) = out.split_at(x.len());
            tanh_errors(x, t, s)
        };
        let judged = work_precision(&methods, &|out| errors(out).1, x.len() as f64, self.rounds)?;
        let mut out = Vec::new();
        for (method, sech2) in methods.iter().zip(judged) {
            let (tanh_ulps, _) = errors(&(method.run)()?);
            out.push(Judged { tanh_ulps, sech2 });
        }
        Ok(out)
    }
}

const NANO: f64 = 1e9;

fn table(judged: &[Judged]) -> Table {
    let mut table = Table::new([
        ("by", Format::Exact),
        ("tanh, ulp", Format::Fixed(2)),
        ("sech², relative", Format::Exponent(2)),
        ("ns a value, both", Format::Magnitude),
    ]);
    for Judged { tanh_ulps, sech2 } in judged {
        table.push([
            sech2.name.clone().into(),
            (*tanh_ulps).into(),
            error_cell(sech2),
            sech2.seconds.map(|seconds| seconds.scaled(NANO)).into(),
        ]);
    }
    table
}

fn words(judged: &[Judged]) -> Option<String> {
    let all = || judged.iter().map(|method| &method.sech2);
    let (best, seconds) = fastest(all(), f64::INFINITY)?;
    let ns = Format::Magnitude.number(seconds * NANO);
    let accurate = most_accurate(all()).map_or("none", |method| &method.name);
    Some(format!("Fastest: {}, {ns} ns; most accurate sech²: {accurate}.", best.name))
}

/// A point for each method.
fn figure(judged: &[Judged]) -> Figure {
    let methods: Vec<_> = judged.iter().map(|method| method.sech2.clone()).collect();
    let panel = Panel {
        title: "tanh and sech²: error against run time".into(),
        y_label: "relative error of sech²".into(),
        ..work_precision_panel("ns a value", &methods, NANO)
    };
    let caption =
        "tanh with sech²: the error of sech² against run time on this machine, one thread.";
    Figure::in_a_row(TANH, caption, vec![panel])
}
