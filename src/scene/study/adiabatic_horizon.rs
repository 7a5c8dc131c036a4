//! How long the adiabatic invariant of random gyroceptrons stays, for several ε.

use super::random_network::RandomNetwork;
use super::rollout::epsilon_name;
use super::shared::Study;
use crate::error::Error;
use crate::measure::{
    adiabatic::{AdiabaticOrbit, log_slope},
    timing::Spread,
};
use crate::network::{Composition, Model};
use crate::scene::context::{Context, RunError};
use crate::scene::declared::Declared;
use crate::scene::event::Event;
use crate::scene::figure::{Axis, Figure, Panel, Series, Style};
use crate::scene::findings::{Block, Findings, Format, Section, Table};
use crate::scene::setup::Need;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::json;

const HORIZON: &str = "adiabatic-horizon";
pub(in crate::scene) const CHECKPOINT: &str = "adiabatic-horizon.checkpoint";

/// How long the adiabatic invariant of random gyroceptrons stays, for several ε.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdiabaticHorizonOptions {
    /// The values of ε that are compared. ε = 0 is run beside them, to show the effect of rounding.
    pub epsilons: Vec<f64>,
    /// The factors ρ ≥ 1 of the horizons N(ε), ascending.
    pub factors: Vec<f64>,
    /// How many times weights are drawn.
    pub seeds: u64,
    /// The number of iterations of each orbit, at least 1000.
    pub iterations: u64,
    /// Orbits of the first weights that are continued for longer.
    pub long: Option<LongOrbits>,
    /// The gyroceptron, apart from its ε and the seed of its weights.
    pub network: RandomNetwork,
}

/// Orbits of the first weights that are continued for longer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LongOrbits {
    /// The values of ε of these orbits, which are among those of the study.
    pub epsilons: Vec<f64>,
    /// The number of iterations that they are continued to.
    pub iterations: u64,
}

/// Ten years of a processor: more is taken for a mistake, and the sum of as many is a number.
const MOST_ITERATIONS: usize = 1_000_000_000_000;

/// Iterations of all orbits between two checkpoints, about.
const BETWEEN: u64 = 2_000_000;

impl Study for AdiabaticHorizonOptions {
    fn name(&self) -> &'static str {
        "adiabatic_horizon"
    }

    fn needs(&self) -> &'static [Need] {
        &[]
    }

    fn check(&self, _: &Declared<'_>) -> Result<(), Error> {
        Error::check_count_range("epsilons", self.epsilons.len(), 1, 1000)?;
        for epsilon in &self.epsilons {
            Error::check_range("epsilons", *epsilon, Error::LEAST_POSITIVE, f64::MAX)?;
        }
        let mut sorted = self.epsilons.clone();
        sorted.sort_by(f64::total_cmp);
        if let Some(pair) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(Error::invalid("epsilons", format!("{} twice", pair[0]), "each once"));
        }
        Error::check_count_range("factors", self.factors.len(), 1, 100)?;
        for factor in &self.factors {
            Error::check_range("factors", *factor, 1.0, f64::MAX)?;
        }
        if !self.factors.is_sorted() {
            return Err(Error::invalid("factors", format!("{:?}", self.factors), "ascending"));
        }
        let count = |name: &str, value: u64, least: usize, most: usize| {
            let found = usize::try_from(value).unwrap_or(usize::MAX);
            Error::check_count_range(name, found, least, most)
        };
        count("seeds", self.seeds, 1, 100_000)?;
        count("iterations", self.iterations, 1000, MOST_ITERATIONS)?;
        if let Some(long) = &self.long {
            count("long.iterations", long.iterations, self.iterations as usize, MOST_ITERATIONS)?;
            if let Some(other) = long.epsilons.iter().find(|e| !self.epsilons.contains(e)) {
                let expected = format!("one of {:?}", self.epsilons);
                return Err(Error::invalid("long.epsilons", other, expected));
            }
        }
        self.network.check()
    }

    fn figures(&self, _: &Declared<'_>) -> Vec<&'static str> {
        vec![HORIZON]
    }

    /// A thousandth of the iterations of the longest, a tenth of the others.
    fn shorten(&mut self) {
        self.seeds = self.seeds.min(8);
        self.iterations = (self.iterations / 10).max(1000).min(self.iterations);
        if let Some(long) = &mut self.long {
            long.iterations = (long.iterations / 1000).max(self.iterations);
        }
    }

    fn run(&self, context: &mut Context<'_>) -> Result<Findings, RunError> {
        let mut orbits = self.orbits(context)?;
        context.stage("orbits of random networks", |context| self.advance(context, &mut orbits))?;
        let found = Found { options: self, orbits };
        let figures = match context.draws(HORIZON) {
            true => vec![found.figure()],
            false => Vec::new(),
        };
        Ok(Findings {
            title: "How long the adiabatic invariant stays".into(),
            results: Section {
                summary: vec![
                    Block::Text(found.words()),
                    Block::Table(found.horizons()),
                    Block::Text(found.meaning()),
                    Block::Table(found.drifts()),
                ],
                data: found.data(),
                ..Section::default()
            },
            figures,
            ..Findings::default()
        })
    }
}

/// The orbit of one network, and how far it is to go.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Run {
    epsilon: f64,
    /// The number of the draw of weights, from 0, which is added to the scene's seed.
    number: u64,
    iterations: u64,
    orbit: AdiabaticOrbit,
}

/// What a run goes on from.
#[derive(Serialize, Deserialize)]
struct Checkpoint {
    options: AdiabaticHorizonOptions,
    seed: u64,
    orbits: Vec<Run>,
}

impl AdiabaticHorizonOptions {
    /// At ε and for one of the weights.
    fn network(&self, context: &Context<'_>, run: &Run) -> Result<Model, Error> {
        self.network.draw(run.epsilon, context.scene.seed.wrapping_add(run.number))
    }

    /// All orbits before their first step, or where the run that is gone on with left
    /// them.
    fn orbits(&self, context: &Context<'_>) -> Result<Vec<Run>, RunError> {
        let seed = context.scene.seed;
        if let Some(earlier) = context.folder.earlier::<Checkpoint>(CHECKPOINT)? {
            if earlier.options != *self || earlier.seed != seed {
                let place = context.folder.file(CHECKPOINT);
                let (expected, found) = ("a checkpoint of this run", "one of other options");
                return Err(Error::content(place.display(), expected, found).into());
            }
            return Ok(earlier.orbits);
        }
        let mut out = Vec::new();
        for epsilon in self.epsilons.iter().copied().chain([0.0]) {
            for number in 0..self.seeds {
                let network = self.network.draw(epsilon, seed.wrapping_add(number))?;
                let long = self
                    .long
                    .as_ref()
                    .filter(|long| number == 0 && long.epsilons.contains(&epsilon));
                let iterations = long.map_or(self.iterations, |long| long.iterations);
                let orbit = AdiabaticOrbit::new(&network, &self.network.initial, &self.factors)?;
                out.push(Run { epsilon, number, iterations, orbit });
            }
        }
        Ok(out)
    }

    fn advance(&self, context: &mut Context<'_>, orbits: &mut Vec<Run>) -> Result<(), RunError> {
        let maps: Vec<(Composition<f64>, _)> = orbits
            .iter()
            .map(|run| {
                let network = self.network(context, run)?;
                let action = network.architecture().circles[0].clone();
                Ok((network.in_conjugated_coordinates(), action))
            })
            .collect::<Result<_, Error>>()?;
        let total: u64 = orbits.iter().map(|run| run.iterations).sum();
        loop {
            let left = orbits.iter().filter(|run| run.orbit.steps() < run.iterations).count();
            if left == 0 {
                break;
            }
            let share = BETWEEN / left as u64 + 1;
            orbits.par_iter_mut().zip(&maps).with_max_len(1).for_each(|(run, (map, action))| {
                let steps = run.iterations.min(run.orbit.steps() + share);
                run.orbit.advance(map, action, steps);
            });
            let checkpoint = Checkpoint {
                options: self.clone(),
                seed: context.scene.seed,
                orbits: orbits.clone(),
            };
            context.folder.save(CHECKPOINT, &checkpoint)?;
            let done: u64 = orbits.iter().map(|run| run.orbit.steps()).sum();
            context.report(Event::Progress { what: "iterations", done, total });
            if context.interrupted() && done < total {
                return Err(RunError::Interrupted);
            }
        }
        Ok(())
    }
}

/// The orbits of all ε and all weights, after their last iteration.
struct Found<'a> {
    options: &'a AdiabaticHorizonOptions,
    orbits: Vec<Run>,
}

impl Found<'_> {
    /// All orbits at one ε, the first weights first.
    fn runs_at(&self, epsilon: f64) -> impl Iterator<Item = &Run> {
        self.orbits.iter().filter(move |run| run.epsilon == epsilon)
    }

    /// N(ε) of all weights for the factor of this number, ascending; infinite where it
    /// was not reached.
    fn sorted(&self, epsilon: f64, factor: usize) -> Vec<f64> {
        let mut out: Vec<f64> = self
            .runs_at(epsilon)
            .map(|run| run.orbit.horizons()[factor].map_or(f64::INFINITY, |n| n as f64))
            .collect();
        out.sort_by(f64::total_cmp);
        out
    }

    /// The spread over all weights of D(N), the largest |μ − μ(0)| of the first N iterations.
    fn drift(&self, epsilon: f64, number: u64) -> Option<Spread> {
        let of = |run: &Run| run.orbit.drifts().iter().find(|(n, _)| *n == number).map(|(_, d)| *d);
        Spread::from_values(self.runs_at(epsilon).filter_map(of).collect())
    }

    /// The powers of ten up to the iterations of all orbits.
    fn powers(&self) -> Vec<u64> {
        let powers = (1..19).map(|k| 10_u64.pow(k));
        powers.take_while(|n| *n <= self.options.iterations).collect()
    }

    fn words(&self) -> String {
        let options = self.options;
        let mut out = format!(
            "{} gyroceptrons with random weights, {} iterations each, in the coordinates w = ψ⁻¹z. \
             {}. N(ε) is the first iteration at which |μ − μ(0)| is more than ρ times its largest \
             value over the first K(ε) = ⌊10 + ε^(−1/4)⌋ ones.",
            options.seeds,
            options.iterations,
            options.network.words()
        );
        if let Some(long) = &options.long {
            out.push_str(&format!(
                " The first weights went on to {} iterations at ε = {:?}.",
                long.iterations, long.epsilons
            ));
        }
        out
    }

    fn horizons(&self) -> Table {
        let mut columns = vec![("ε".to_owned(), Format::Setting)];
        for factor in &self.options.factors {
            columns.push((format!("ρ = {factor}: N of the first weights"), Format::Exact));
            columns.push(("median".to_owned(), Format::Exact));
            columns.push(("not reached".to_owned(), Format::Exact));
        }
        let mut table = Table::new(columns);
        let text = |n: f64, cap: u64| match n.is_finite() {
            true => format!("{n}"),
            false => format!("> {:e}", cap as f64),
        };
        for &epsilon in &self.options.epsilons {
            let mut row = vec![epsilon.into()];
            for factor in 0..self.options.factors.len() {
                let sorted = self.sorted(epsilon, factor);
                let first = self.runs_at(epsilon).next();
                let horizon = first.map(|run| match run.orbit.horizons()[factor] {
                    Some(n) => n.to_string(),
                    None => text(f64::INFINITY, run.iterations),
                });
                let median = sorted[(sorted.len() - 1) / 2];
                let never = sorted.iter().filter(|n| !n.is_finite()).count();
                row.push(horizon.into());
                row.push(text(median, self.options.iterations).into());
                row.push(format!("{never} of {}", sorted.len()).into());
            }
            table.push(row);
        }
        table
    }

    fn drifts(&self) -> Table {
        let powers = self.powers();
        let mut columns = vec![("ε".to_owned(), Format::Setting)];
        columns.extend(powers.iter().map(|n| (format!("D({:e})/ε", *n as f64), Format::Magnitude)));
        columns.push(("exponent in N".to_owned(), Format::Fixed(3)));
        let mut table = Table::new(columns);
        for &epsilon in &self.options.epsilons {
            let mut row = vec![epsilon.into()];
            let medians: Vec<f64> = powers
                .iter()
                .map(|n| self.drift(epsilon, *n).map_or(f64::NAN, |spread| spread.median))
                .collect();
            row.extend(medians.iter().map(|d| (d / epsilon).into()));
            row.push(self.exponent(&medians).into());
            table.push(row);
        }
        let mut row = vec!["0: D(N)".into()];
        row.extend(powers.iter().map(|n| self.drift(0.0, *n).map(|spread| spread.median).into()));
        row.push(None::<f64>.into());
        table.push(row);
        table
    }

    /// Of D(N) over the last powers of ten.
    fn exponent(&self, medians: &[f64]) -> f64 {
        const LAST: usize = 4;
        let first = medians.len().saturating_sub(LAST);
        let powers: Vec<f64> = self.powers().iter().map(|n| *n as f64).collect();
        log_slope(&powers[first..], &medians[first..])
    }

    fn meaning(&self) -> String {
        let last = self.powers().last().copied().unwrap_or(0);
        let floor = self.drift(0.0, last).map_or(f64::NAN, |spread| spread.upper);
        format!(
            "N(ε) compares an oscillation with what was seen of it in the first K(ε) iterations: that \
             it is finite says that these were not its largest ones, not that the invariant is lost. \
             What shows whether the invariant stays is D(N)/ε, the largest change of the first N \
             iterations, here its median over the weights; an exponent of 0 in N says that it does. \
             Rounding alone, at ε = 0, comes to {floor:.0e} in {:e} iterations (upper quartile).",
            last as f64
        )
    }

    fn data(&self) -> serde_json::Value {
        let each = |run: &Run| {
            json!({
                "epsilon": run.epsilon,
                "weights": run.number,
                "iterations": run.orbit.steps(),
                "horizons": run.orbit.horizons(),
                "drifts": run.orbit.drifts(),
                "initial": run.orbit.initial(),
                "largest": run.orbit.largest(),
            })
        };
        json!({ "factors": self.options.factors, "orbits": self.orbits.iter().map(each).collect::<Vec<_>>() })
    }

    fn figure(&self) -> Figure {
        let epsilons = &self.options.epsilons;
        let mut horizons = Vec::new();
        for (number, factor) in self.options.factors.iter().enumerate() {
            let first = |epsilon: &f64| {
                let n = self.runs_at(*epsilon).next()?.orbit.horizons()[number]?;
                Some((*epsilon, n as f64))
            };
            horizons.push(Series {
                name: format!("ρ = {factor}, first weights"),
                color: number,
                style: Style::Marked,
                points: epsilons.iter().filter_map(first).collect(),
            });
            let all = epsilons.iter().flat_map(|epsilon| {
                self.sorted(*epsilon, number).into_iter().map(move |n| (*epsilon, n))
            });
            horizons.push(Series::unnamed(number, Style::Dots, all.collect()));
        }
        let floor = |run: &Run| (run.epsilon, run.iterations as f64);
        horizons.push(Series {
            name: "iterations done, first weights".into(),
            color: 7,
            style: Style::Dashed,
            points: epsilons.iter().filter_map(|e| self.runs_at(*e).next()).map(floor).collect(),
        });
        let of = |run: &Run| -> Vec<(f64, f64)> {
            run.orbit.drifts().iter().map(|(n, d)| (*n as f64, *d)).collect()
        };
        let mut drifts = Vec::new();
        for (number, &epsilon) in epsilons.iter().chain([&0.0]).enumerate() {
            let (name, style) = match epsilon {
                0.0 => ("ε = 0: rounding".to_owned(), Style::Dashed),
                _ => (epsilon_name(epsilon), Style::Line),
            };
            let median = self
                .powers()
                .into_iter()
                .filter_map(|n| Some((n as f64, self.drift(epsilon, n)?.median)));
            drifts.push(Series { name, color: number, style, points: median.collect() });
            if let Some(long) =
                self.runs_at(epsilon).find(|run| run.iterations > self.options.iterations)
            {
                drifts.push(Series::unnamed(number, Style::Faint, of(long)));
            }
        }
        let log = |title: &str, x: &str, y: &str, series| Panel {
            title: title.into(),
            x_label: x.into(),
            y_label: y.into(),
            x: Axis::Log,
            y: Axis::Log,
            series,
            ..Panel::default()
        };
        let panels = vec![
            log("As the paper defines it", "ε", "N(ε)", horizons),
            log("Largest change of the first N iterations", "N", "D(N)", drifts),
        ];
        let caption = "Left: N(ε) of each of the weights (dots) and of the first (marks). Right: the \
                       largest |μ − μ(0)| of the first N iterations, median over the weights; pale: \
                       the first weights alone, further on.";
        Figure::in_a_row(HORIZON, caption, panels)
    }
}
