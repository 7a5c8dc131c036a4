//! Long computations that Ctrl-C ends.

use crate::error::Error;
use crate::measure::internals::unless_stopped;
use crate::network::Pace;
use pyo3::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

/// Runs something without the lock of the interpreter, at a pace that lets Ctrl-C take effect.
pub(super) fn interruptible<T: Send>(
    py: Python<'_>,
    run: impl FnOnce(&mut Pace<'_>) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let mut raised = None;
    let result = py.detach(|| {
        let mut go_on = || {
            raised = Python::attach(|py| py.check_signals()).err();
            raised.is_none()
        };
        run(&mut Pace::asking(&mut go_on))
    });
    match raised {
        Some(raised) => Err(raised),
        None => Ok(result?),
    }
}

/// Whether what a callback returned lets a computation go on: only False, also that of NumPy, does not.
pub(super) fn goes_on_after(answer: &Bound<'_, PyAny>) -> bool {
    !matches!(answer.extract::<bool>(), Ok(false))
}

/// Whether a computation on another thread is to end.
#[derive(Clone, Default)]
pub(super) struct Stop(Arc<AtomicBool>);

impl Stop {
    pub(super) fn go_on(&self) -> bool {
        !self.0.load(Ordering::Relaxed)
    }

    /// Fails where it is to end.
    pub(super) fn check(&self) -> Result<(), Error> {
        if self.go_on() { Ok(()) } else { Err(Error::Stopped { what: "computation".into() }) }
    }
}

/// The time between two checks of whether Ctrl-C was pressed.
const PAUSE: Duration = Duration::from_millis(50);

/// Runs something without the lock of the interpreter on a thread of its own, to which `Stop` says whether Ctrl-C was
/// pressed: for what asks it from deep inside, or from several threads, which cannot ask the interpreter.
pub(super) fn stoppable<T: Send>(
    py: Python<'_>,
    run: impl FnOnce(&Stop) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let stop = Stop::default();
    let (result, raised) = py.detach(|| {
        std::thread::scope(|scope| {
            let (done, ends) = std::sync::mpsc::channel::<()>();
            let own = &stop;
            let worker = scope.spawn(move || {
                // It ends the wait when it is dropped, also by a panic.
                let _done = done;
                run(own)
            });
            let mut raised = None;
            while ends.recv_timeout(PAUSE) == Err(RecvTimeoutError::Timeout) {
                if raised.is_none()
                    && let Err(signal) = Python::attach(|py| py.check_signals())
                {
                    raised = Some(signal);
                    stop.0.store(true, Ordering::Relaxed);
                }
            }
            (worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)), raised)
        })
    });
    match raised {
        Some(raised) => Err(raised),
        None => Ok(result?),
    }
}

/// Runs something without the lock of the interpreter on a thread of its own. After Ctrl-C nobody waits for that
/// thread, which may ask `Stop` when it can, and its result is dropped: for long computations of other crates, which
/// ask nothing.
pub(super) fn abandonable<T: Send + 'static>(
    py: Python<'_>,
    run: impl FnOnce(&Stop) -> Result<T, Error> + Send + 'static,
) -> PyResult<T> {
    let stop = Stop::default();
    let (own, (sender, receiver)) = (stop.clone(), std::sync::mpsc::channel());
    let worker = std::thread::spawn(move || {
        // Nobody receives what was abandoned.
        let _ = sender.send(run(&own));
    });
    let wait = move || loop {
        match receiver.recv_timeout(PAUSE) {
            Ok(result) => return Ok(result),
            Err(RecvTimeoutError::Timeout) => {
                if let Err(signal) = Python::attach(|py| py.check_signals()) {
                    stop.0.store(true, Ordering::Relaxed);
                    return Err(signal);
                }
            }
            Err(RecvTimeoutError::Disconnected) => {
                let panic = worker.join().expect_err("it sends what it computes");
                std::panic::resume_unwind(panic);
            }
        }
    };
    Ok(py.detach(wait)??)
}

/// As [`stoppable`], for a measurement that asks between its samples.
pub(super) fn measured<T: Send>(
    py: Python<'_>,
    measure: impl FnOnce() -> Result<T, Error> + Send,
) -> PyResult<T> {
    stoppable(py, |stop| {
        let asked = stop.clone();
        match unless_stopped(move || asked.go_on(), measure) {
            Some(found) => found,
            None => Err(Error::Stopped { what: "measurement".into() }),
        }
    })
}

/// What `of` makes of points, `size` numbers each, of some of them after another.
pub(super) fn by_parts<T: Send>(
    py: Python<'_>,
    what: &str,
    size: usize,
    points: &[f64],
    of: impl Fn(&[f64]) -> Result<Vec<T>, Error> + Sync,
) -> PyResult<Vec<T>> {
    interruptible(py, |pace| {
        let (mut out, mut rest) = (Vec::new(), points);
        while !rest.is_empty() {
            let count = pace.part(1).min(rest.len() / size);
            let (part, after) = rest.split_at(count * size);
            out.extend(of(part)?);
            pace.pause(what, count)?;
            rest = after;
        }
        Ok(out)
    })
}
