//! Hostile files: the program is called with damaged files of every kind that it reads, and with damaged replies and
//! requests. It may refuse them, but not panic, end by a signal, hang, take memory without bound, move the terminal, or
//! touch a file beside its working folder.
//!
//! The short form runs with the other tests. The long form is
//! `HOSTILE_RUNS=100000 HOSTILE_SEED=7 cargo test --test program hostile:: -- --ignored --nocapture`; it writes each
//! failure as a folder into `target/tmp/hostile`, named by its seed and number. `HOSTILE_FIRST` is the number of its
//! first run (default: 0), so that one run is done again by its number. `HOSTILE_CALLS` are words of the calls to try,
//! such as `import lerobot` (default: all).

#![cfg(unix)]

mod campaign;
mod canary;
mod cases;
mod coverage;
mod doors;
mod found;
mod judge;
mod memory;
mod mutators;
mod place;
mod process;
mod random;
mod replies;
mod requests;
mod seeds;
mod texts;
mod trial;

/// The number of runs of the short form: about ten seconds on two cores.
const SHORT: usize = 450;

#[test]
fn damaged_files_are_read_or_refused() {
    let summary = campaign::run(20, 0..SHORT, "");
    assert!(summary.faults.is_empty(), "{summary}");
    let count = |code: i32| summary.codes.get(&code).copied().unwrap_or_default();
    assert!(count(0) > SHORT / 10 && count(2) > SHORT / 10, "{summary}");
    assert!(summary.named * 100 >= summary.errors * 80, "{summary}");
}

#[test]
#[ignore = "hours"]
#[expect(clippy::print_stdout, reason = "the summary is what it is run for")]
fn damaged_inputs_are_read_or_refused() {
    let number = |name: &str, default: u64| {
        let value = std::env::var(name).ok();
        value.map_or(default, |value| value.parse().unwrap())
    };
    let seed = number("HOSTILE_SEED", 1);
    let runs = number("HOSTILE_RUNS", 100_000);
    let first = number("HOSTILE_FIRST", 0);
    println!("seed {seed}, {runs} runs from number {first}");
    let calls = std::env::var("HOSTILE_CALLS").unwrap_or_default();
    let summary = campaign::run(seed, first as usize..(first + runs) as usize, &calls);
    println!("{summary}");
    for (count, example) in summary.unnamed.values() {
        println!("{count} errors without the file, as\n{example}");
    }
    assert!(summary.faults.is_empty(), "{summary}");
}
