//! Progress on standard error: a bar on a terminal, lines elsewhere.

use gyroceptron::scene::{Event, Observer, stop_words};
use gyroceptron::train::TrainingRecord;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Where there is no terminal, a line at most so often.
const QUIET: Duration = Duration::from_secs(15);

pub struct Progress {
    terminal: bool,
    bar: Option<ProgressBar>,
    /// What the bar is of.
    model: String,
    last_line: Instant,
    /// When the first iteration seen here was, and its number.
    start: Option<(Instant, u64)>,
    validation: Option<f64>,
    interrupted: Arc<AtomicBool>,
    /// True while there is a checkpoint to write before ending.
    training: Arc<AtomicBool>,
}

impl Progress {
    /// Also takes Ctrl-C: in training the first asks for a checkpoint and an
    /// orderly end; outside it, and the second time, the program ends at once.
    pub fn new() -> Self {
        let interrupted = Arc::new(AtomicBool::new(false));
        let training = Arc::new(AtomicBool::new(false));
        let (flag, in_training) = (Arc::clone(&interrupted), Arc::clone(&training));
        // Without a handler Ctrl-C ends the program at once; the checkpoint of
        // the last hundred iterations is there all the same.
        let _ = ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::SeqCst) || !in_training.load(Ordering::SeqCst) {
                std::process::exit(130);
            }
        });
        Self {
            terminal: std::io::stderr().is_terminal(),
            bar: None,
            model: String::new(),
            last_line: Instant::now(),
            start: None,
            validation: None,
            interrupted,
            training,
        }
    }

    pub fn note(&self, text: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| line(text)),
            None => line(text),
        }
    }

    pub fn iteration(&mut self, model: &str, record: TrainingRecord, iterations: u64) {
        if self.model != model {
            // Another stage of a training has errors and a pace of its own.
            self.finish();
            model.clone_into(&mut self.model);
        }
        self.training.store(true, Ordering::SeqCst);
        self.validation = record.validation.or(self.validation);
        let held_out = self.validation.map(|v| format!(", held out {v:.2e}")).unwrap_or_default();
        self.start.get_or_insert_with(|| (Instant::now(), record.iteration));
        let state = format!("loss {:.2e}{held_out}", record.loss);
        if self.terminal {
            let bar = self.bar.get_or_insert_with(|| {
                let template = "{prefix} {bar:24} {pos}/{len} {msg}, {per_sec}, {eta} left";
                let style = ProgressStyle::with_template(template)
                    .unwrap_or_else(|_| ProgressStyle::default_bar());
                let target = ProgressDrawTarget::stderr_with_hz(5);
                ProgressBar::with_draw_target(Some(iterations), target)
                    .with_position(record.iteration)
                    .with_message(state.clone())
                    .with_prefix(model.to_owned())
                    .with_style(style)
            });
            bar.set_message(state);
            bar.set_position(record.iteration);
        } else if self.last_line.elapsed() >= QUIET {
            self.last_line = Instant::now();
            let (start, first) = self.start.unwrap_or((Instant::now(), record.iteration));
            let rate = (record.iteration - first) as f64 / start.elapsed().as_secs_f64();
            let left = (iterations - record.iteration.min(iterations)) as f64 / rate;
            let pace = if rate > 0.0 {
                format!(", {rate:.1} a second, {left:.0} s left")
            } else {
                String::new()
            };
            line(&format!(
                "{model}: iteration {} of {iterations}, {state}{pace}",
                record.iteration
            ));
        }
    }

    /// A part of something that takes long, which leaves a checkpoint when it is
    /// interrupted.
    fn part(&mut self, what: &str, done: u64, total: u64) {
        self.training.store(true, Ordering::SeqCst);
        if self.terminal {
            let bar = self.bar.get_or_insert_with(|| {
                let template = "{bar:24} {human_pos} of {human_len} {prefix}, {eta} left";
                let style = ProgressStyle::with_template(template)
                    .unwrap_or_else(|_| ProgressStyle::default_bar());
                let target = ProgressDrawTarget::stderr_with_hz(5);
                ProgressBar::with_draw_target(Some(total), target)
                    .with_prefix(what.to_owned())
                    .with_style(style)
            });
            bar.set_position(done);
        } else if self.last_line.elapsed() >= QUIET {
            self.last_line = Instant::now();
            line(&format!("{done} of {total} {what}"));
        }
    }

    pub fn finish(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
        self.training.store(false, Ordering::SeqCst);
        self.validation = None;
        self.start = None;
    }
}

/// A line on standard error.
pub fn line(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

impl Observer for Progress {
    fn event(&mut self, event: Event<'_>) {
        match event {
            Event::Stage(stage) => {
                self.finish();
                self.note(&format!("{stage} …"));
            }
            Event::Iteration { model, record, iterations } => {
                self.iteration(model, record, iterations);
            }
            Event::Progress { what, done, total } => self.part(what, done, total),
            Event::Trained { model, stop, best } => {
                self.finish();
                let held_out = best
                    .validation
                    .map(|v| format!(", held-out mean squared error {v:.3e}"))
                    .unwrap_or_default();
                self.note(&format!(
                    "{model}: {}; kept iteration {}, loss {:.3e}{held_out}",
                    stop_words(stop),
                    best.iteration,
                    best.loss
                ));
            }
            Event::Lost { model, reason } => {
                self.finish();
                self.note(&format!("{model} is lost: {reason}"));
            }
        }
    }

    fn interrupted(&self) -> bool {
        self.interrupted.load(Ordering::SeqCst)
    }
}
