//! Many trials, two at once, and what came of them in all.

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

use crate::robustness::hostile::cases::{CASES, Case};
use crate::robustness::hostile::random::Random;
use crate::robustness::hostile::seeds::Seeds;
use crate::robustness::hostile::trial::{Damage, Trial, Verdict};

/// How many processes run at once.
const AT_ONCE: usize = 2;

/// Result of a campaign.
#[derive(Default)]
pub(crate) struct Summary {
    pub(crate) seed: u64,
    pub(crate) runs: usize,
    /// Runs by exit code; those that a signal ended are under -1.
    pub(crate) codes: BTreeMap<i32, usize>,
    pub(crate) faults: BTreeMap<&'static str, usize>,
    pub(crate) memory: u64,
    pub(crate) longest: Duration,
    /// Errors about a file of the user, and those that name it.
    pub(crate) errors: usize,
    pub(crate) named: usize,
    /// Errors that do not name the file, one of each call.
    pub(crate) unnamed: BTreeMap<&'static str, (usize, String)>,
    /// The folders of the failures.
    pub(crate) failures: Vec<PathBuf>,
}

impl Summary {
    fn add(&mut self, trial: &Trial<'_>, verdict: &Verdict) {
        self.runs += 1;
        *self.codes.entry(verdict.code.unwrap_or(-1)).or_default() += 1;
        for fault in &verdict.faults {
            *self.faults.entry(fault.kind()).or_default() += 1;
        }
        self.memory = self.memory.max(verdict.memory);
        self.longest = self.longest.max(verdict.took);
        if let Some(is_named) = verdict.is_named {
            self.errors += 1;
            self.named += usize::from(is_named);
            if !is_named {
                let example = || (0, format!("{}\n{}", trial.words(), verdict.stderr));
                self.unnamed.entry(trial.case.line).or_insert_with(example).0 += 1;
            }
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "seed {}, {} runs", self.seed, self.runs)?;
        let count = |kind: &str| self.faults.get(kind).copied().unwrap_or_default();
        for kind in ["panic", "signal", "hang", "memory", "exit code", "canary"] {
            write!(f, "{kind} {}, ", count(kind))?;
        }
        let (control, output) = (count("control character"), count("output with code 2"));
        writeln!(f, "control character {control}, output with code 2 {output}")?;
        writeln!(f, "exit codes {:?}", self.codes)?;
        writeln!(f, "most memory {} MB, longest {:.1} s", self.memory >> 20, self.longest.as_secs_f64())?;
        writeln!(f, "errors that name the file: {} of {}", self.named, self.errors)?;
        for folder in &self.failures {
            writeln!(f, "failure: {}", folder.display())?;
        }
        Ok(())
    }
}

/// Runs the trials with these numbers; the calls that contain these words take turns.
pub(crate) fn run(seed: u64, numbers: Range<usize>, words: &str) -> Summary {
    let seeds = Seeds::make();
    let cases: Vec<&Case> = CASES.iter().filter(|case| case.line.contains(words)).collect();
    let next = AtomicUsize::new(numbers.start);
    let summary = Mutex::new(Summary { seed, ..Summary::default() });
    thread::scope(|scope| {
        for _ in 0..AT_ONCE {
            scope.spawn(|| {
                let folder = tempfile::tempdir().unwrap();
                let folder = folder.path().join("case");
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= numbers.end {
                        break;
                    }
                    one(seed, number, &cases, &seeds, &folder, &summary);
                }
            });
        }
    });
    summary.into_inner().unwrap()
}

#[expect(clippy::print_stderr, reason = "a long campaign says what it finds at once")]
fn one(seed: u64, number: usize, cases: &[&'static Case], seeds: &Seeds, folder: &Path, summary: &Mutex<Summary>) {
    let case = cases[number % cases.len()];
    let trial = Trial::draw(case, seeds, &mut Random::of_run(seed, number));
    let verdict = trial.run(seeds, folder);
    summary.lock().unwrap().add(&trial, &verdict);
    if let Some(fault) = verdict.faults.first() {
        let trial = reduced(&trial, fault.kind(), seeds, folder);
        let kept = keep(&trial, seed, number, seeds, folder);
        eprintln!("{fault}: {}", kept.display());
        summary.lock().unwrap().failures.push(kept);
    }
}

/// The same trial with as few steps as show the same kind of fault, found by leaving out halves.
fn reduced<'a>(trial: &Trial<'a>, kind: &str, seeds: &Seeds, folder: &Path) -> Trial<'a> {
    let mut trial = trial.clone();
    while let Damage::Steps(steps) = &trial.damage
        && steps.len() > 1
    {
        let (first, second) = steps.split_at(steps.len() / 2);
        let halves = [first, second].map(|half| Trial { damage: Damage::Steps(half.to_vec()), ..trial.clone() });
        let shows = |half: &Trial<'_>| {
            let verdict = half.run(seeds, folder);
            verdict.faults.iter().any(|fault| fault.kind() == kind)
        };
        let Some(half) = halves.into_iter().find(shows) else {
            break;
        };
        trial = half;
    }
    trial
}

/// Writes a failure as a folder: its files before the call, the command, and what came of it.
fn keep(trial: &Trial<'_>, seed: u64, number: usize, seeds: &Seeds, folder: &Path) -> PathBuf {
    let verdict = trial.run(seeds, folder);
    let place = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("hostile/{seed}-{number}"));
    let _ = fs::remove_dir_all(&place);
    fs::create_dir_all(&place).unwrap();
    trial.write(seeds, &place);
    for name in ["stdout", "stderr"] {
        fs::copy(folder.join(name), place.join(name)).unwrap();
    }
    let faults: Vec<String> = verdict.faults.iter().map(ToString::to_string).collect();
    let text = format!("cd work\n{}\n{}\n", trial.words(), faults.join(", "));
    fs::write(place.join("command.txt"), text).unwrap();
    place
}
