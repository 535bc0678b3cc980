//! One call of the program with one damaged file, made again from its numbers whenever it is needed.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use crate::robustness::hostile::canary::{self, Canary};
use crate::robustness::hostile::cases::Case;
use crate::robustness::hostile::judge::{Fault, Limits, faults, names};
use crate::robustness::hostile::mutators::{Form, step};
use crate::robustness::hostile::place::Place;
use crate::robustness::hostile::process::{Finished, Running, program};
use crate::robustness::hostile::random::Random;
use crate::robustness::hostile::replies::endpoint;
use crate::robustness::hostile::requests;
use crate::robustness::hostile::seeds::Seeds;
use crate::support::endpoint::MockEndpoint;
use crate::support::run::files;

/// Damage to a file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Damage {
    /// The numbers of the steps.
    Steps(Vec<u64>),
    Replaced(Place),
}

/// A call and the damage to one of its files.
#[derive(Clone)]
pub(crate) struct Trial<'a> {
    pub(crate) case: &'a Case,
    /// The file, by its path in the working folder.
    pub(crate) file: PathBuf,
    pub(crate) damage: Damage,
}

/// Result of a trial.
pub(crate) struct Verdict {
    pub(crate) code: Option<i32>,
    pub(crate) faults: Vec<Fault>,
    pub(crate) memory: u64,
    pub(crate) took: Duration,
    /// Whether the error names the file; `None` if there is none, or the file is none of the user's.
    pub(crate) is_named: Option<bool>,
    pub(crate) stderr: String,
}

impl<'a> Trial<'a> {
    pub(crate) fn draw(case: &'a Case, seeds: &Seeds, random: &mut Random) -> Self {
        let files = seeds.files(case.reads);
        let file = random.pick(&files).clone();
        let is_ours = ["reply", "request"].iter().any(|folder| file.starts_with(folder));
        // What a mock sends stays a file.
        let damage = if !is_ours && random.percent(8) {
            let is_typed = case.line.split(' ').any(|word| file.to_str() == word.rsplit(':').next());
            Damage::Replaced(Place::draw(random, is_typed))
        } else {
            let steps = 1 + random.below(4);
            Damage::Steps((0..steps).map(|_| random.next()).collect())
        };
        Self { case, file, damage }
    }

    /// The call without damage.
    pub(crate) fn sound(case: &'a Case) -> Self {
        Self { case, file: PathBuf::new(), damage: Damage::Steps(Vec::new()) }
    }

    /// Writes the folders `work` and `canary` into an empty folder.
    pub(crate) fn write(&self, seeds: &Seeds, folder: &Path) -> Canary {
        let canary = Canary::make(folder);
        let work = folder.join("work");
        for name in seeds.files(&[self.case.reads, self.case.needs].concat()) {
            let path = work.join(&name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::copy(seeds.path(&name), &path).unwrap();
        }
        let path = work.join(&self.file);
        match &self.damage {
            Damage::Steps(steps) if !steps.is_empty() => {
                let mut bytes = fs::read(&path).unwrap();
                for seed in steps {
                    step(Form::of(&self.file), &mut bytes, *seed);
                }
                fs::write(&path, bytes).unwrap();
            }
            Damage::Steps(_) => {}
            Damage::Replaced(place) => place.put(&path, &folder.join("canary")),
        }
        canary
    }

    /// Makes the call in a folder, which is emptied before.
    pub(crate) fn run(&self, seeds: &Seeds, folder: &Path) -> Verdict {
        empty(folder);
        let canary = self.write(seeds, folder);
        let work = folder.join("work");
        let mock = self.case.asks().then(|| endpoint(&work));
        let url = mock.as_ref().map_or(String::new(), MockEndpoint::base_url);
        let address = url.trim_start_matches("http://").trim_end_matches("/v1");
        if mock.is_some() {
            name_port(&work, address.rsplit(':').next().unwrap_or_default());
        }
        let running = Running::start(&mut command(self.case.line, &url, &work), folder);
        let mut sent = Vec::new();
        let mut patience = self.case.waits().then_some(Duration::from_secs(3));
        if self.case.serves() {
            sent = requests::send(&running, &work);
            patience = Some(Duration::ZERO);
        }
        let finished = running.end(Limits::PROGRAM.time, patience);
        for request in mock.iter().flat_map(MockEndpoint::requests) {
            sent.extend(request.body);
        }
        self.judged(&finished, &canary, &sent, folder)
    }

    fn judged(&self, finished: &Finished, canary: &Canary, sent: &[u8], folder: &Path) -> Verdict {
        let mut faults = faults(finished, self.case.codes(), Limits::PROGRAM);
        if self.case.waits() {
            // The test itself has sent it.
            faults.retain(|fault| *fault != Fault::Signal(libc::SIGTERM));
        }
        if self.case.serves() {
            // The address is written before anything is asked, and a signal is how a server ends.
            faults.retain(|fault| *fault != Fault::Output);
        }
        if let Some(path) = canary.change() {
            faults.push(Fault::Canary(format!("{path} was changed")));
        }
        let shown = [&finished.stdout[..], &finished.stderr].concat();
        // A second name of a file cannot be told from the first.
        let is_hidden = self.damage != Damage::Replaced(Place::HardLink);
        if is_hidden && (canary::is_in(sent) || canary::is_in(&shown)) {
            faults.push(Fault::Canary("its content was sent or shown".to_owned()));
        }
        let is_ours = |name: &str| ["work", "canary", "stdout", "stderr"].contains(&name);
        for entry in fs::read_dir(folder).unwrap() {
            let name = entry.unwrap().file_name().to_string_lossy().into_owned();
            if !is_ours(&name) {
                faults.push(Fault::Canary(format!("{name} was written")));
            }
        }
        let file = self.file.to_string_lossy();
        let is_of_user = !["reply", "request"].iter().any(|folder| file.starts_with(folder));
        Verdict {
            code: finished.code,
            faults,
            memory: finished.memory,
            took: finished.took,
            is_named: (finished.code == Some(2) && is_of_user).then(|| names(finished, &file)),
            stderr: String::from_utf8_lossy(&finished.stderr).into_owned(),
        }
    }

    /// The call and the damage in words.
    pub(crate) fn words(&self) -> String {
        let mut text = format!("darkqa-eval {}\n{}: ", self.case.line, self.file.display());
        let _ = write!(text, "{:?}", self.damage);
        text
    }
}

/// The program in a folder with the words of a line.
fn command(line: &str, url: &str, work: &Path) -> Command {
    let mut command = program(work);
    command.args(line.split(' ').map(|word| word.replace("URL", url)));
    command
}

/// Writes the port of the endpoint into the files that name it.
fn name_port(work: &Path, port: &str) {
    for path in files(work) {
        let is_file = fs::symlink_metadata(&path).is_ok_and(|meta| meta.is_file() && meta.len() > 0);
        if is_file && let Ok(bytes) = fs::read(&path) {
            let named = requests::with_port(&bytes, port);
            if named != bytes {
                fs::write(path, named).unwrap();
            }
        }
    }
}

/// Makes a folder empty, whatever a case has left there.
fn empty(folder: &Path) {
    if folder.exists() {
        fs::remove_dir_all(folder).unwrap();
    }
    fs::create_dir_all(folder).unwrap();
}
