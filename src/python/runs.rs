//! Scenes from Python: a run in this process, and its jobs for an engine that schedules.

use super::interrupt::goes_on_after;
use crate::error::Error;
use crate::scene::{
    Event, Folder, Job, JobEnd, JobRequest, MergeEnd, Observer, Scene, check_merge, merge, parse,
    run, run_job,
};
use pyo3::prelude::*;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Listens to a run in another thread than the one which hears signals.
struct RunObserver<'a> {
    stopped: Arc<AtomicBool>,
    callback: Option<&'a Py<PyAny>>,
    /// The exception that the callback raised, if it raised one.
    raised: Option<PyErr>,
}

impl RunObserver<'_> {
    fn call(&mut self, name: &str, of_iteration: Option<(u64, f64, Option<f64>)>) {
        let Some(callback) = self.callback.filter(|_| !self.stopped.load(Ordering::Relaxed)) else {
            return;
        };
        let (iteration, loss) = of_iteration.map(|(iteration, loss, _)| (iteration, loss)).unzip();
        let validation = of_iteration.and_then(|(.., validation)| validation);
        let goes_on = Python::attach(|py| -> PyResult<bool> {
            let answer = callback.bind(py).call1((name, iteration, loss, validation))?;
            Ok(goes_on_after(&answer))
        });
        match goes_on {
            Ok(true) => return,
            Ok(false) => {}
            Err(raised) => self.raised = Some(raised),
        }
        self.stopped.store(true, Ordering::Relaxed);
    }
}

impl Observer for RunObserver<'_> {
    fn event(&mut self, event: Event<'_>) {
        match event {
            Event::Stage(name) => self.call(name, None),
            Event::Iteration { model, record, .. } => {
                self.call(model, Some((record.iteration, record.loss, record.validation)));
            }
            Event::Progress { .. } | Event::Trained { .. } | Event::Lost { .. } => {}
        }
    }

    fn interrupted(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    fn interruption(&self) -> Option<Arc<AtomicBool>> {
        Some(Arc::clone(&self.stopped))
    }
}

/// Runs something in a thread of its own, on so many threads, while this one listens to Ctrl-C.
fn listening<T: Send>(
    py: Python<'_>,
    threads: Option<usize>,
    callback: Option<Py<PyAny>>,
    work: impl FnOnce(&mut dyn Observer) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let pool = match threads {
        None => None,
        Some(count) => {
            Error::check_count_range("threads", count, 1, 1024)?;
            let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build();
            Some(pool.map_err(|reason| Error::invalid("threads", count, reason))?)
        }
    };
    let stopped = Arc::new(AtomicBool::new(false));
    let mut signal = None;
    let (result, raised) = py.detach(|| {
        let (heard_by, callback) = (Arc::clone(&stopped), callback.as_ref());
        let mut observer = RunObserver { stopped: heard_by, callback, raised: None };
        std::thread::scope(|scope| {
            let thread = scope.spawn(move || {
                let result = match pool {
                    None => work(&mut observer),
                    Some(pool) => pool.install(|| work(&mut observer)),
                };
                (result, observer.raised)
            });
            while !thread.is_finished() {
                std::thread::sleep(Duration::from_millis(5));
                if let Err(heard) = Python::attach(|py| py.check_signals()) {
                    signal = Some(heard);
                    stopped.store(true, Ordering::Relaxed);
                }
            }
            thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    });
    match signal.or(raised) {
        Some(raised) => Err(raised),
        None => Ok(result?),
    }
}

/// The scene of a name or a file as text, whole; and the parts that are left out, since they need a file of weights.
#[pyfunction]
#[pyo3(signature = (scene, seed, quick, weights))]
pub(super) fn _scene(
    scene: &str,
    seed: Option<i128>,
    quick: bool,
    weights: Option<PathBuf>,
) -> PyResult<(String, String, Vec<String>)> {
    let mut read = Scene::read(scene)?;
    if let Some(seed) = seed {
        let expected = format!("from 0 to {}", i64::MAX);
        let valid = u64::try_from(seed).map_err(|_| Error::invalid("seed", seed, expected))?;
        read = read.with_seed(valid);
    }
    if quick {
        read = read.quick();
    }
    if let Some(file) = weights {
        let file = std::path::absolute(&file).map_err(|reason| Error::read(&file, reason))?;
        let (with, any) = read.with_weights(&file);
        read = with;
        if !any {
            let expected = "a scene with a network of kind \"file\" that names none";
            return Err(Error::invalid("weights", scene, expected).into());
        }
    }
    let (read, lacking) = read.without_parts_that_lack_files();
    read.complete()?;
    let text = read.to_toml()?;
    Ok((read.name.clone(), text, lacking))
}

#[derive(Serialize)]
struct Line<'a> {
    #[serde(flatten)]
    job: &'a Job,
    seconds: Option<f64>,
}

/// The jobs of a scene, as JSON.
#[pyfunction]
pub(super) fn _plan(py: Python<'_>, text: &str, estimate: bool) -> PyResult<String> {
    let scene = parse("scene", text)?;
    let found = listening(py, None, None, |observer| scene.with_found_actions(observer))?;
    let scene = found.ok_or_else(|| Error::Stopped { what: "plan".into() })?;
    let jobs = scene.plan()?;
    let seconds = match estimate {
        true => listening(py, None, None, |observer| Ok(scene.estimate(&jobs, observer)))?,
        false => vec![None; jobs.len()],
    };
    let lines: Vec<Line<'_>> =
        jobs.iter().zip(seconds).map(|(job, seconds)| Line { job, seconds }).collect();
    let text = serde_json::to_string(&lines);
    Ok(text.map_err(|reason| Error::content("plan", "numbers that JSON can hold", reason))?)
}

/// Does a job: "done", "was done before", or "interrupted" by the callback.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "the keywords of Python")]
pub(super) fn _run_job(
    py: Python<'_>,
    text: &str,
    id: &str,
    digest: Option<&str>,
    out: PathBuf,
    overwrite: bool,
    threads: Option<usize>,
    callback: Option<Py<PyAny>>,
) -> PyResult<&'static str> {
    let scene = parse("scene", text)?;
    let request = JobRequest { id, digest };
    let end = listening(py, threads, callback, |observer| {
        run_job(&scene, request, &out, overwrite, observer)
    })?;
    Ok(match end {
        JobEnd::Done => "done",
        JobEnd::WasDone => "was done before",
        JobEnd::Interrupted => "interrupted",
    })
}

/// Fails where a report of all jobs would take the place of another run.
#[pyfunction]
pub(super) fn _check_merge(text: &str, out: PathBuf, overwrite: bool) -> PyResult<()> {
    Ok(check_merge(&parse("scene", text)?, &out, overwrite)?)
}

/// Makes the report of all jobs; whether it is there.
#[pyfunction]
pub(super) fn _merge(
    py: Python<'_>,
    text: &str,
    digest: Option<&str>,
    out: PathBuf,
    overwrite: bool,
    threads: Option<usize>,
    callback: Option<Py<PyAny>>,
) -> PyResult<bool> {
    let scene = parse("scene", text)?;
    let end = listening(py, threads, callback, |observer| {
        merge(&scene, digest, &out, overwrite, observer)
    })?;
    Ok(!matches!(end, MergeEnd::Interrupted))
}

/// Runs a scene in this process; whether its report is there.
#[pyfunction]
pub(super) fn _run(
    py: Python<'_>,
    text: &str,
    out: PathBuf,
    resume: bool,
    overwrite: bool,
    threads: Option<usize>,
    callback: Option<Py<PyAny>>,
) -> PyResult<bool> {
    let scene = parse("scene", text)?;
    let report = listening(py, threads, callback, |observer| {
        scene.check_networks(&out)?;
        let folder = Folder::open(&out, resume, overwrite)?;
        run(&scene, &folder, observer)
    })?;
    Ok(report.is_some())
}
