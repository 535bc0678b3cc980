//! Faults of the machine under a run, of questions with choices and of open ones: kills, a full disk, folders that
//! cannot be written to, a second process, and a clock that jumps. Nothing is lost, nothing is asked twice but what was
//! in flight, and the end is that of a run without faults.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, SystemTime};

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::house::{House, flags};
use crate::support::process::{signal, wait_until};
use crate::support::run::{Bench, Called, PROGRAM, assert_same_products, files, records, words};
use crate::support::table::check_rows;

/// An experiment with all that one run of it needs.
struct Scene {
    bench: Bench,
    endpoint: MockEndpoint,
    is_open: bool,
    /// Records of a complete run.
    trials: usize,
}

/// Requests in flight at most.
const AT_ONCE: usize = 2;

impl Scene {
    /// The endpoint answers the same request in the same way, after a while.
    fn new(is_open: bool, wait: Duration) -> Self {
        let endpoint = MockEndpoint::answering(move |request| {
            std::thread::sleep(wait);
            let text = match (is_open, request["model"] == "j") {
                (true, true) => "4",
                (true, false) => "brown",
                (false, _) => "C",
            };
            Answer::text(text)
        });
        let bench = if is_open { House::new().0 } else { Bench::with_questions(6) };
        // 3 questions in 11 conditions and 3 marks; 6 questions in 11 conditions.
        let trials = if is_open { 33 + 3 } else { 66 };
        Self { bench, endpoint, is_open, trials }
    }

    /// The words of the run in a folder.
    fn words(&self, out: &str) -> Vec<String> {
        let base = self.endpoint.base_url();
        let line = format!(
            "--model m --base-url {base} --concurrency {AT_ONCE} --levels L0-L5 --variant both --no-parquet --shared --out {out}"
        );
        let open = format!("{line} --judge j");
        let choices = format!("{line} --data set.jsonl");
        let words = if self.is_open { flags(&words(&open)) } else { words(&choices) };
        words.into_iter().map(str::to_owned).collect()
    }

    /// The run in a folder, to its end.
    fn call(&self, out: &str) -> Called {
        let args = self.words(out);
        self.bench.call(&args.iter().map(String::as_str).collect::<Vec<_>>())
    }

    /// The run in a folder, to its end, with everything scored.
    fn complete(&self, out: &str) {
        let called = self.call(out);
        assert_eq!(called.code, Some(0), "{called:?}");
    }

    /// The run in a folder as a process, once there are so many records.
    fn spawned(&self, out: &str, records: usize) -> Child {
        let args = self.words(out);
        let args: Vec<&str> = args.iter().map(String::as_str).collect();
        let child = self.bench.spawn(&args, Stdio::null());
        wait_until(|| self.stored(out) >= records);
        child
    }

    /// Kills the run in a folder once it has `records` records.
    fn kill_at(&self, out: &str, records: usize) {
        let mut child = self.spawned(out, records);
        signal(&child, "-9");
        child.wait().unwrap();
    }

    /// The run as a command of a shell, after other commands.
    fn shell(&self, before: &str, out: &str) -> Output {
        let line = format!("{before} exec {} {}", PROGRAM, self.words(out).join(" "));
        let mut command = Command::new("sh");
        command.args(["-c", &line]).current_dir(self.bench.path(""));
        command.output().unwrap()
    }

    fn stored(&self, out: &str) -> usize {
        let text = fs::read(self.bench.path(out).join("records.jsonl")).unwrap_or_default();
        String::from_utf8_lossy(&text).matches('\n').count()
    }

    /// Completes the run in a folder, and asserts that it is what a run without faults is, for which so many requests
    /// were sent beyond those of its trials.
    fn assert_whole(&self, out: &str, beyond: usize) {
        self.complete(out);
        let run = self.bench.path(out);
        let keys: Vec<String> = records(&run).into_iter().map(|record| record["key"].to_string()).collect();
        let distinct: BTreeSet<&String> = keys.iter().collect();
        assert_eq!((distinct.len(), keys.len()), (self.trials, self.trials));
        let sent = self.endpoint.requests().len();
        assert!(sent <= self.trials + beyond, "{sent} requests for {} trials", self.trials);
        self.complete("whole");
        assert!(assert_same_products(&self.bench.path("whole"), &run) > 5);
    }
}

const BOTH: [bool; 2] = [false, true];

#[test]
fn kills_cost_what_was_in_flight() {
    check_rows(BOTH, |is_open| {
        let scene = Scene::new(is_open, Duration::from_millis(40));
        for records in [4, 11, 19] {
            scene.kill_at("run", records);
        }
        assert!(scene.stored("run") < scene.trials, "the kills came too late");
        scene.assert_whole("run", 3 * AT_ONCE);
    });
}

#[cfg(unix)]
#[test]
fn full_disk_stops_until_room() {
    check_rows(BOTH, |is_open| {
        let scene = Scene::new(is_open, Duration::ZERO);
        // A limit of 16 blocks of 512 bytes for each file, as a write error in place of a signal.
        let stopped = scene.shell("trap '' XFSZ; ulimit -f 16;", "run");
        let said = String::from_utf8_lossy(&stopped.stderr);
        assert_eq!(stopped.status.code(), Some(2), "{said}");
        assert!(said.contains("error: run/") && said.contains(".jsonl: cannot write"), "{said}");
        assert!(!said.contains("panicked"), "{said}");
        let stored = scene.stored("run");
        assert!(stored > 0 && stored < scene.trials, "{stored}");
        // The reply that found no room, and those in flight beside it.
        scene.assert_whole("run", AT_ONCE);
    });
}

#[test]
fn second_process_is_refused() {
    check_rows(BOTH, |is_open| {
        let scene = Scene::new(is_open, Duration::from_millis(40));
        let mut first = scene.spawned("run", 2);
        let second = scene.call("run");
        assert_eq!(second.code, Some(2), "{second:?}");
        assert!(second.stderr.contains("another process is writing to this run"), "{second:?}");
        assert_eq!(first.wait().unwrap().code(), Some(0));
        scene.assert_whole("run", 0);
    });
}

#[test]
fn the_time_of_files_decides_nothing() {
    check_rows(BOTH, |is_open| {
        let scene = Scene::new(is_open, Duration::from_millis(20));
        let before = SystemTime::UNIX_EPOCH + Duration::from_secs(1);
        let after = SystemTime::now() + Duration::from_hours(24 * 365 * 50);
        for (time, records) in [(after, 5), (before, 12)] {
            scene.kill_at("run", records);
            set_times(&scene.bench.path("run"), time);
        }
        scene.assert_whole("run", 2 * AT_ONCE);
        let sent = scene.endpoint.requests().len();
        for time in [before, after] {
            set_times(&scene.bench.path("run"), time);
            scene.complete("run");
            assert!(assert_same_products(&scene.bench.path("whole"), &scene.bench.path("run")) > 5);
        }
        assert_eq!(scene.endpoint.requests().len(), sent);
    });
}

/// Sets the time of the last change of all files of a folder.
fn set_times(folder: &Path, time: SystemTime) {
    for path in files(folder) {
        let file = File::options().write(true).open(path).unwrap();
        file.set_modified(time).unwrap();
    }
}

#[cfg(unix)]
#[test]
fn unwritable_folder_costs_no_request() {
    use std::os::unix::fs::PermissionsExt as _;

    check_rows(BOTH, |is_open| {
        let scene = Scene::new(is_open, Duration::ZERO);
        scene.assert_whole("run", 0);
        let sent = scene.endpoint.requests().len();
        let before = contents(&scene.bench.path("run"));
        // The folder of the build may be closed to other users.
        let program = scene.bench.path("darkqa-eval");
        fs::copy(PROGRAM, &program).unwrap();
        let set_mode = |name: &str, mode: u32| {
            let permissions = fs::Permissions::from_mode(mode);
            fs::set_permissions(scene.bench.path(name), permissions).unwrap();
        };
        for path in files(&scene.bench.path("run")) {
            fs::set_permissions(path, fs::Permissions::from_mode(0o444)).unwrap();
        }
        for name in ["run/figures", "run", ""] {
            set_mode(name, 0o555);
        }
        for out in ["run", "new"] {
            let refused = as_nobody(&scene, &program, out);
            let said = String::from_utf8_lossy(&refused.stderr);
            assert_eq!(refused.status.code(), Some(2), "{out}: {said}");
            let last = said.lines().last().unwrap_or_default();
            assert!(last.starts_with("error: --out: cannot write to "), "{said}");
        }
        for name in ["", "run", "run/figures"] {
            set_mode(name, 0o755);
        }
        assert_eq!(scene.endpoint.requests().len(), sent);
        assert_eq!(contents(&scene.bench.path("run")), before);
    });
}

/// The files of a folder with their bytes.
#[cfg(unix)]
fn contents(folder: &Path) -> Vec<(std::path::PathBuf, Vec<u8>)> {
    let mut all: Vec<_> = files(folder).into_iter().map(|path| (path.clone(), fs::read(path).unwrap())).collect();
    all.sort();
    all
}

/// The user and the group `nobody`.
#[cfg(unix)]
const NOBODY: u32 = 65534;

/// The run by a user whom modes of files bind. They do not bind root, who becomes nobody.
#[cfg(unix)]
fn as_nobody(scene: &Scene, program: &Path, out: &str) -> Output {
    use std::os::unix::process::CommandExt as _;

    let mut command = Command::new(program);
    command.args(scene.words(out)).current_dir(scene.bench.path(""));
    if is_root() {
        command.uid(NOBODY).gid(NOBODY);
    }
    command.output().unwrap()
}

/// True if this process runs as root.
#[cfg(unix)]
fn is_root() -> bool {
    let id = Command::new("id").arg("-u").output().unwrap();
    id.stdout.trim_ascii() == b"0"
}
