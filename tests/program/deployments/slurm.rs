//! An evaluation as arrays of a real Slurm: killed, and gone on with in another number of parts.
#![cfg(unix)]

use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::json;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::process::wait_until;
use crate::support::run::{Bench, PROGRAM, assert_same_products, model_args, words};
use crate::support::tools::{skip, succeeds};

/// Frames of the set.
const FRAMES: u8 = 12;

/// Questions about each frame.
const QUESTIONS: usize = 8;

/// A folder with a ready-made set.
fn with_set() -> Bench {
    let bench = Bench::new();
    let mut lines = String::new();
    for frame in 0..FRAMES {
        let picture = image::RgbImage::from_pixel(64, 48, image::Rgb([90, 60, 20 * frame]));
        picture.save(bench.path(&format!("{frame}.png"))).unwrap();
        for number in 0..QUESTIONS {
            let question = json!({
                "id": format!("q{frame}-{number}"), "image": format!("{frame}.png"), "family": "color",
                "question": format!("What color is it, {number}?"),
                "choices": ["red", "blue", "brown"], "answer": "blue",
            });
            lines.push_str(&question.to_string());
            lines.push('\n');
        }
    }
    bench.file("set.jsonl", lines);
    bench
}

/// The call that submits the script as an array of `tasks` tasks, two at a time, and waits for it.
fn array(bench: &Bench, tasks: usize, args: &[&str]) -> Command {
    let program = std::path::Path::new(PROGRAM);
    let own = program.parent().map(std::path::Path::to_owned).into_iter();
    let others = std::env::var_os("PATH").unwrap_or_default();
    let search = std::env::join_paths(own.chain(std::env::split_paths(&others))).unwrap();
    let mut command = Command::new("sbatch");
    command
        .args(["--wait", &format!("--array=0-{}%2", tasks - 1)])
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/src/commands/cluster/slurm.sh"))
        .args(args)
        .current_dir(bench.path(""))
        .env("PATH", search)
        .env_remove("OPENAI_API_KEY")
        .stdout(Stdio::null());
    command
}

#[test]
#[ignore = "needs a Slurm that runs on this machine alone, and takes a minute"]
fn killed_tasks_resume_in_other_shards() {
    if !succeeds("sinfo", &[]) {
        skip("no Slurm answers");
        return;
    }
    let bench = with_set();
    let mock = MockEndpoint::answering(|_| {
        std::thread::sleep(Duration::from_millis(50));
        Answer::text("B")
    });
    let base = mock.base_url();
    let set = "--data set.jsonl --levels L0 --concurrency 1";
    bench.complete(&model_args(&base, &format!("{set} --out whole")));
    let trials = usize::from(FRAMES) * QUESTIONS;
    assert_eq!(mock.requests().len(), trials);

    let out = bench.path("parts").display().to_string();
    let own = format!("{set} --workers 2 --out {out}");
    let args = model_args(&base, &own);
    let mut first = array(&bench, 6, &args).spawn().unwrap();
    // In the middle of a part, whose requests are one at a time.
    let begun = mock.requests().len();
    wait_until(|| mock.requests().len() > begun + 5);
    let killed = Command::new("pkill").args(["-9", "--oldest", "--full", &format!("darkqa-eval .*{out}")]).status();
    assert!(killed.unwrap().success());
    assert!(!first.wait().unwrap().success(), "a killed task has failed");
    // Only what is missing is asked.
    let second = array(&bench, 4, &args).status();
    assert!(second.unwrap().success());
    let asked = mock.requests().len() - trials;
    assert!((trials..=trials + 1).contains(&asked), "nothing is asked twice but the request in flight: {asked}");
    bench.complete(&words("merge parts --out merged"));
    assert!(assert_same_products(&bench.path("whole"), &bench.path("merged")) > 5);
}
