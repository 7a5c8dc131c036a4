//! How a law is run over random networks.

use crate::tolerances;
use gyroceptron::measure::{
    certificate::{Row, Tally, merged},
    ratios::Conditioned,
};
use proptest::prelude::*;
use proptest::test_runner::{
    Config, FileFailurePersistence, RngAlgorithm, TestCaseError, TestRng, TestRunner,
};
use std::cell::RefCell;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The seed of the whole suite, in its snapshots. `GYROCEPTRON_SEED` gives
/// another one, for which laws are checked and snapshots are not.
pub const SEED: u64 = 20_231;
/// Random networks of the statistics.
pub const NETWORKS: usize = 10_000;

/// The seed of this run.
pub fn seed() -> u64 {
    match std::env::var("GYROCEPTRON_SEED") {
        Ok(text) => text.parse().expect("GYROCEPTRON_SEED: a whole number"),
        Err(_) => SEED,
    }
}

/// Whether this run is the one that [`the_suite_holds_on_ten_times_the_samples`] starts: of ten
/// times the samples and all configurations.
pub fn extensive() -> bool {
    std::env::var("GYROCEPTRON_EXTENSIVE").is_ok_and(|value| value == "1")
}

/// How often each law runs its stated samples.
pub fn times() -> usize {
    if extensive() { 10 } else { 1 }
}

/// The file that keeps the failures of a law.
fn regressions(law: &str) -> &'static str {
    format!("{}/verification/regressions/{law}.txt", env!("CARGO_MANIFEST_DIR")).leak()
}

/// Runs `test` on `cases` cases of the strategy (ten times as many in an
/// extensive run), the same ones every time, and gives the rows of the tallies.
///
/// # Panics
/// With the smallest case that violates one of the laws.
pub fn run<S: Strategy>(
    law: &str,
    cases: usize,
    strategy: S,
    test: impl Fn(&S::Value) -> Vec<Tally>,
) -> Vec<Row> {
    let mut bytes = [0_u8; 32];
    bytes[..8].copy_from_slice(&seed().to_le_bytes());
    for (slot, byte) in bytes[8..].iter_mut().zip(law.bytes()) {
        *slot = byte;
    }
    let config = Config {
        cases: u32::try_from(cases * times()).expect("a small number"),
        failure_persistence: Some(Box::new(FileFailurePersistence::Direct(regressions(law)))),
        max_shrink_iters: 2000,
        ..Config::default()
    };
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &bytes);
    let mut runner = TestRunner::new_with_rng(config, rng);
    let all: RefCell<Vec<Tally>> = RefCell::default();
    let result = runner.run(&strategy, |case| {
        let tallies = test(&case);
        for tally in &tallies {
            violation(tally).map_or(Ok(()), |reason| Err(TestCaseError::fail(reason)))?;
        }
        let mut all = all.borrow_mut();
        *all = merged(all.drain(..).chain(tallies).collect::<Vec<_>>());
        Ok(())
    });
    if let Err(failure) = result {
        panic!("{law}: {failure}");
    }
    let all = all.into_inner();
    all.iter().map(Tally::row).collect()
}

/// What becomes of each, by as many threads as there are processors. They are threads of their own: what waits for
/// another thing that is made once must not stand on a task that makes it.
pub fn at_once<T: Sync, R: Send>(all: &[T], make: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let mut made: Vec<(usize, R)> = std::thread::scope(|scope| {
        let work = || {
            let mut own = Vec::new();
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                let Some(one) = all.get(index) else { return own };
                own.push((index, make(one)));
            }
        };
        let handles: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        handles.into_iter().flat_map(|handle| handle.join().expect("no panic")).collect()
    });
    made.sort_by_key(|(index, _)| *index);
    made.into_iter().map(|(_, result)| result).collect()
}

/// What a single case does wrong. Whether the samples show anything is asked of
/// all of them together.
fn violation(tally: &Tally) -> Option<String> {
    let row = tally.row();
    let testable = row.samples > row.ill_conditioned;
    let fine = match row.largest {
        Some(largest) => largest < row.limit,
        None => !testable,
    };
    (!fine).then(|| format!("{}: {}: {:?}", row.law, row.equation, row.largest))
}

/// The law holds on all its samples, of which there are as many as it states.
pub fn assert_holds(rows: &[Row], stated: usize) {
    assert!(!rows.is_empty());
    for row in rows {
        use gyroceptron::measure::certificate::Verdict::{Holds, Reported};
        assert!(matches!(row.verdict, Holds | Reported), "{row:?}");
        assert!(row.samples >= stated * times(), "{} samples stated: {row:?}", stated * times());
        let share = row.ill_conditioned as f64 / row.samples as f64;
        assert!(share <= tolerances::ILL_CONDITIONED_SHARE, "{row:?}");
    }
}

#[test]
fn a_violated_case_is_found_and_made_small() {
    let caught = std::panic::catch_unwind(|| {
        run("self-test", 200, 0..1000_u32, |case| {
            let result = Conditioned::Ratio(if *case >= 17 { f64::NAN } else { 0.0 });
            vec![Tally::of_ratios("self-test", "case < 17").extend([result])]
        })
    });
    std::fs::remove_file(regressions("self-test")).expect("the failure was kept");
    let panic = caught.expect_err("a NaN violates");
    let text = panic.downcast_ref::<String>().expect("a message");
    assert!(text.contains("minimal failing input: 17"), "{text}");
}

#[test]
fn a_law_with_too_few_samples_fails() {
    let row = || vec![Tally::of_ratios("law", "1 = 1").extend([Conditioned::Ratio(0.1)]).row()];
    assert_holds(&row(), 0);
    assert!(std::panic::catch_unwind(|| assert_holds(&row(), 2)).is_err());
    assert!(std::panic::catch_unwind(|| assert_holds(&[], 0)).is_err());
}

#[test]
#[ignore = "takes five to eight minutes in a release build: run it with --ignored"]
fn the_suite_holds_on_ten_times_the_samples() {
    let suite = std::env::current_exe().expect("this program");
    let run = std::process::Command::new(suite).env("GYROCEPTRON_EXTENSIVE", "1").status();
    assert!(run.expect("it starts").success(), "see above");
}
