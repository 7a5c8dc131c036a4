//! Ending a measurement or a flow before it is done.

use std::cell::RefCell;
use std::time::{Duration, Instant};

/// The callback of the measuring thread that decides whether to go on.
struct Asking {
    go_on: Box<dyn FnMut() -> bool>,
    last: Instant,
    stopped: bool,
}

thread_local! {
    static ASKING: RefCell<Option<Asking>> = const { RefCell::new(None) };
}

/// The shortest time between two calls of it.
const PAUSE: Duration = Duration::from_millis(50);

/// Whether the measurement of this thread is to end; its result is discarded then.
pub fn is_stopped() -> bool {
    let due = ASKING.with_borrow_mut(|asking| match asking {
        None => Err(false),
        Some(asking) if asking.stopped => Err(true),
        Some(asking) if asking.last.elapsed() < PAUSE => Err(false),
        // It is out of its place while it is called: it may measure too.
        Some(_) => Ok(asking.take()),
    });
    let mut asking = match due {
        Err(stopped) => return stopped,
        Ok(None) => return false,
        Ok(Some(asking)) => asking,
    };
    asking.stopped = !(asking.go_on)();
    asking.last = Instant::now();
    let stopped = asking.stopped;
    ASKING.set(Some(asking));
    stopped
}

/// Whether somebody may stop this thread.
pub fn is_asked() -> bool {
    ASKING.with_borrow(Option::is_some)
}

/// Iterates over the samples until they end or the measurement is to stop.
pub fn until_stopped<I: IntoIterator>(samples: I) -> impl Iterator<Item = I::Item> {
    samples.into_iter().take_while(|_| !is_stopped())
}

/// Puts back what was asked before, also where a measurement panics.
struct Restored(Option<Asking>);

impl Drop for Restored {
    fn drop(&mut self) {
        ASKING.set(self.0.take());
    }
}

/// Runs `measure` and returns its result, or None when `go_on`, which is called from time to time
/// between samples, has returned false.
pub fn unless_stopped<T>(
    go_on: impl FnMut() -> bool + 'static,
    measure: impl FnOnce() -> T,
) -> Option<T> {
    let asking = Asking { go_on: Box::new(go_on), last: Instant::now(), stopped: false };
    let _earlier = Restored(ASKING.replace(Some(asking)));
    let out = measure();
    let stopped = ASKING.with_borrow(|asking| asking.as_ref().is_some_and(|own| own.stopped));
    (!stopped).then_some(out)
}
