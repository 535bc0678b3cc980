//! Signals that end the program while it works: as an ordinary process, and as the first process of a container.
#![cfg(unix)]

use std::fs;
use std::io::Write as _;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::support::process::{signal, wait_until};
use crate::support::run::{Bench, PROGRAM, files, words};
use crate::support::tools::{skip, succeeds};

/// Maximum time from a signal to the end; a busy machine may need a few seconds.
const PROMPT: Duration = Duration::from_secs(20);

/// Commands that run for many seconds, and the folder that they write into from the start.
const LONG: [(&str, Option<&str>); 3] = [
    ("rooms --out rooms --frames 3000 --size 640x480", Some("rooms")),
    ("synthesize frames --levels 0..16:0.1 --out dark", Some("dark")),
    // It draws the rooms before it makes the folder of the run.
    ("--model observer --data rooms:frames=3000,size=640x480 --levels L0 --out run", None),
];

/// Waits until a process of the program handles all signals and does its work.
fn wait_for_work(process: u32) {
    /// SIGHUP, SIGINT and SIGTERM in a mask of `/proc`.
    const SIGNALS: u64 = 1 | 1 << 1 | 1 << 14;
    /// Processor time that a start does not take, in hundredths of a second.
    const WORK: u64 = 50;

    if !cfg!(target_os = "linux") {
        thread::sleep(Duration::from_secs(2));
        return;
    }
    let read = |name| fs::read_to_string(format!("/proc/{process}/{name}")).unwrap_or_default();
    wait_until(|| {
        let status = read("status");
        let handled = status
            .lines()
            .find_map(|line| line.strip_prefix("SigCgt:"))
            .map_or(0, |mask| u64::from_str_radix(mask.trim(), 16).unwrap());
        let stat = read("stat");
        // The name of the program, in parentheses, is the second field; the times are the 14th and 15th.
        let times = stat.rsplit(')').next().unwrap_or_default();
        let times = times.split_whitespace().skip(11).take(2);
        let used: u64 = times.map(|time| time.parse::<u64>().unwrap()).sum();
        handled & SIGNALS == SIGNALS && used >= WORK
    });
}

/// A folder with frames to degrade.
fn with_frames() -> Bench {
    let bench = Bench::new();
    bench.rooms("frames", 12, "640x480");
    bench
}

/// Waits for the end of a process that was sent a signal, and returns its exit code.
fn ended_promptly(process: &mut Child, what: &str) -> Option<i32> {
    let sent = Instant::now();
    loop {
        if let Some(status) = process.try_wait().unwrap() {
            return status.code();
        }
        if sent.elapsed() > PROMPT {
            let _ = process.kill();
            let _ = process.wait();
            panic!("{what} goes on after a signal");
        }
        thread::sleep(Duration::from_millis(10));
    }
}

/// Files that are not whole under their names: not readable as an image, or not ending with a whole line.
fn broken(folder: &std::path::Path) -> Vec<String> {
    let whole = |path: &std::path::Path| match path.extension().and_then(|e| e.to_str()) {
        Some("png" | "jpg") => image::open(path).is_ok(),
        Some("json") => serde_json::from_slice::<serde_json::Value>(&fs::read(path).unwrap()).is_ok(),
        _ => true,
    };
    files(folder).into_iter().filter(|path| !whole(path)).map(|path| path.display().to_string()).collect()
}

#[test]
fn sigterm_ends_long_commands() {
    for (line, begun) in LONG {
        let bench = with_frames();
        let mut process = bench.spawn(&words(line), Stdio::null());
        wait_for_work(process.id());
        wait_until(|| begun.is_none_or(|folder| bench.path(folder).exists()));
        signal(&process, "-TERM");
        assert_eq!(ended_promptly(&mut process, line), Some(130), "{line}");
        assert_eq!(broken(&bench.path("")), [""; 0], "{line}");
    }
}

#[test]
fn a_command_that_was_ended_can_be_repeated() {
    let line = "rooms --out rooms --frames 24 --size 320x240";
    let whole = Bench::new();
    whole.complete(&words(line));
    let bench = Bench::new();
    let mut process = bench.spawn(&words(line), Stdio::null());
    wait_until(|| bench.path("rooms").exists());
    signal(&process, "-TERM");
    assert_eq!(ended_promptly(&mut process, line), Some(130));
    bench.complete(&words(line));
    let content = |bench: &Bench| -> Vec<(String, Vec<u8>)> {
        let root = bench.path("rooms");
        let name = |path: &std::path::Path| path.strip_prefix(&root).unwrap().display().to_string();
        files(&root)
            .into_iter()
            // A killed process may leave an unfinished file, which no command reads.
            .filter(|path| !path.to_string_lossy().ends_with(".part"))
            .map(|path| (name(&path), fs::read(&path).unwrap()))
            .collect()
    };
    assert!(content(&bench) == content(&whole));
}

#[test]
fn signals_end_the_first_process_of_a_container() {
    let own = ["--pid", "--fork", "--mount-proc", "true"];
    if !succeeds("unshare", &own) {
        skip("it takes root and unshare");
        return;
    }
    for (line, _) in LONG {
        for name in ["TERM", "INT", "HUP"] {
            let bench = with_frames();
            let mut outer = Command::new("unshare")
                .args(&own[..3])
                .arg(PROGRAM)
                .args(words(line))
                .current_dir(bench.path(""))
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            let children = format!("/proc/{0}/task/{0}/children", outer.id());
            let child = || fs::read_to_string(&children).unwrap_or_default();
            wait_until(|| !child().trim().is_empty());
            let first = child().trim().to_owned();
            // The child of unshare becomes the program.
            wait_for_work(first.parse().unwrap());
            let kill = format!("kill -{name} {first}");
            assert!(succeeds("sh", &["-c", &kill]), "{kill}");
            let what = format!("{line} as process 1, {name}");
            assert_eq!(ended_promptly(&mut outer, &what), Some(130), "{what}");
        }
    }
}

/// The listener for interrupts of a run that asks stays installed. What follows, such as a report, must end
/// nevertheless.
#[test]
fn signals_end_a_run_after_its_last_reply() {
    let bench = Bench::new();
    let (reader, mut writer) = std::io::pipe().unwrap();
    // A pipe takes 64 KiB: the program waits at its first word on standard output.
    writer.write_all(&vec![0; 1 << 16]).unwrap();
    for name in ["-TERM", "-HUP"] {
        let out = format!("run{name}");
        let line = format!("--model random --levels L0 --data rooms:frames=2,size=96x64 --out {out}");
        let stdout = Stdio::from(writer.try_clone().unwrap());
        let mut process = bench.spawn(&words(&line), stdout);
        wait_until(|| bench.path(&out).join("summary.json").exists());
        thread::sleep(Duration::from_secs(2));
        assert!(process.try_wait().unwrap().is_none(), "it waits");
        signal(&process, name);
        assert_eq!(ended_promptly(&mut process, &line), Some(130));
    }
    drop(reader);
}
