//! Parts of a long computation, between which its caller is asked whether to go on.

use crate::error::Error;
use std::time::{Duration, Instant};

/// How a long computation is divided, so that it can be stopped.
///
/// A computation at a pace asks a callback on the calling thread, some ten times a second, whether to
/// go on. No result depends on the pace: parts end where the computation may be interrupted
/// without a trace.
///
/// ```
/// use gyroceptron::network::Pace;
///
/// let mut asked = 0;
/// let mut go_on = || {
///     asked += 1;
///     asked < 3
/// };
/// let mut pace = Pace::asking(&mut go_on);
/// assert!(pace.pause("a sum", 1).is_ok() && pace.pause("a sum", 1).is_ok());
/// let stopped = pace.pause("a sum", 1).unwrap_err();
/// assert_eq!(stopped.to_string(), "a sum: stopped before its end");
/// ```
pub struct Pace<'a> {
    go_on: Option<&'a mut dyn FnMut() -> bool>,
    /// The number of evaluations in the next part.
    size: usize,
    start: Instant,
}

impl<'a> Pace<'a> {
    /// Of the first part: a few milliseconds.
    const FIRST: usize = 1024;
    /// A part that takes less is followed by a larger one.
    const SHORT: Duration = Duration::from_millis(40);
    /// A part that takes more is followed by a smaller one.
    const LONG: Duration = Duration::from_millis(160);

    /// A pace without interruption: one part, to the end.
    pub fn unbroken() -> Self {
        Self { go_on: None, size: usize::MAX, start: Instant::now() }
    }

    /// A pace that calls `go_on` between parts, and stops the computation when it returns false.
    pub fn asking(go_on: &'a mut dyn FnMut() -> bool) -> Self {
        Self { go_on: Some(go_on), size: Self::FIRST, start: Instant::now() }
    }

    /// The number of items, of `evaluations` evaluations each, to compute before the next pause; at
    /// least one.
    pub fn part(&self, evaluations: usize) -> usize {
        (self.size / evaluations.max(1)).max(1)
    }

    /// Asks whether to go on, and sets the size of the next part from the time that the last one, of
    /// `evaluations` evaluations, took. `what` names the computation in the error.
    ///
    /// # Errors
    /// [`Error::Stopped`] when the answer is no.
    pub fn pause(&mut self, what: &str, evaluations: usize) -> Result<(), Error> {
        let Some(go_on) = &mut self.go_on else { return Ok(()) };
        let time = self.start.elapsed();
        if time < Self::SHORT {
            // A part that was small for other reasons says nothing of a larger one.
            if evaluations >= self.size / 2 {
                self.size = self.size.saturating_mul(2);
            }
        } else if time > Self::LONG {
            self.size = (self.size / 2).max(1);
        }
        if !go_on() {
            return Err(Error::Stopped { what: what.to_owned() });
        }
        self.start = Instant::now();
        Ok(())
    }
}
