//! One evaluation in parts: the same records and the same summary as in one piece, whoever names the parts.

use std::collections::BTreeMap;
use std::fs;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::process::{signal, wait_until};
use crate::support::run::{Bench, PROGRAM, assert_same_products, called, model_args, records, words};
use crate::support::snapshot::redacted;
use serde_json::Value;

/// The arguments of every evaluation here, and more of them.
fn args(more: &str) -> Vec<&str> {
    let models = words("--model random --blind-model random");
    let trials = words("--levels L0,L2");
    [models, trials, words(more)].concat()
}

/// The records by key, without the time they took.
fn timeless(run: &std::path::Path) -> BTreeMap<String, Value> {
    let mut all = BTreeMap::new();
    for mut record in records(run) {
        record["latency_ms"] = Value::Null;
        let key = record["key"].as_str().unwrap().to_owned();
        assert!(all.insert(key, record).is_none(), "no trial twice");
    }
    all
}

#[test]
fn shards_equal_one_run() {
    let bench = Bench::new();
    bench.complete(&args("--out whole"));
    for part in ["1/4", "2/4", "3/4", "4/4"] {
        bench.complete(&args(&format!("--out parts --shard {part}")));
    }
    let folders: Vec<String> = fs::read_dir(bench.path("parts"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    assert_eq!(folders.len(), 4);
    assert!(folders.contains(&"shard-2-of-4".to_owned()), "{folders:?}");
    let table = bench.complete(&["merge", "parts", "--out", "merged"]);
    let (whole, merged) = (bench.path("whole"), bench.path("merged"));
    assert_eq!(timeless(&whole), timeless(&merged));
    let compared = assert_same_products(&whole, &merged);
    assert!(compared > 8, "{compared}");
    let rows = |run: &std::path::Path| -> Value {
        let text = fs::read(run.join("summary.json")).unwrap();
        serde_json::from_slice::<Value>(&text).unwrap()["rows"].take()
    };
    assert_eq!(rows(&whole), rows(&merged));
    // It is the run that the whole command goes on with, and there is nothing left to ask.
    let before = fs::read(merged.join("records.jsonl")).unwrap();
    assert_eq!(bench.complete(&args("--out merged")), table);
    assert_eq!(fs::read(merged.join("records.jsonl")).unwrap(), before);
    // Merging again changes nothing.
    assert_eq!(bench.complete(&["merge", "parts", "--out", "merged"]), table);
    assert_eq!(fs::read(merged.join("records.jsonl")).unwrap(), before);
}

#[test]
fn batch_system_names_the_shard() {
    let bench = Bench::new();
    let task = |variables: &[(&str, &str)], more: &str| {
        let mut command = bench.command(&args(more));
        command.envs(variables.iter().copied());
        called(&mut command)
    };
    let slurm = [("SLURM_ARRAY_TASK_ID", "3"), ("SLURM_ARRAY_TASK_MIN", "2"), ("SLURM_ARRAY_TASK_COUNT", "2")];
    let array = task(&slurm, "--out array");
    insta::assert_snapshot!(array.messages(), @"
    exit code: 0
     WARN task 2 of a Slurm array of 2: this process does shard 2/2; --shard none does everything
    ");
    assert!(bench.path("array/shard-2-of-2/manifest.json").exists());
    let whole = task(&slurm, "--out all --shard none");
    assert_eq!(whole.code, Some(0), "{whole:?}");
    assert!(bench.path("all/manifest.json").exists());
    let pod = [("JOB_COMPLETION_INDEX", "1")];
    let lost = task(&pod, "--out pod");
    insta::assert_snapshot!(lost.messages(), @"
    exit code: 2
    error: --shard: JOB_COMPLETION_INDEX is the index of this pod, but the number of pods is unknown: set it with
        --shard auto/N, or do everything in each pod with --shard none
    ");
    let found = task(&pod, "--out pod --shard auto/3");
    assert_eq!(found.code, Some(0), "{found:?}");
    assert!(bench.path("pod/shard-2-of-3/manifest.json").exists());
}

#[test]
fn missing_and_foreign_shards_are_named() {
    let bench = Bench::new();
    bench.complete(&args("--out parts --shard 1/3"));
    bench.complete(&args("--out parts --shard 3/3"));
    let refused = |line: &str, message: &str| {
        let called = bench.call(&words(&format!("merge {line}")));
        assert_eq!(called.code, Some(2), "{called:?}");
        assert!(called.stderr.contains(message), "{message}: {}", called.stderr);
    };
    refused("parts --out m", "1 shard is missing: 2/3; --partial");
    assert!(!bench.path("m").exists());
    let partial = bench.call(&["merge", "parts", "--out", "m", "--partial"]);
    insta::assert_snapshot!(partial.lines_with("incomplete"), @"
    exit code: 1
    ! m: incomplete: all 48 trials are answered, but shards are missing.
    ");
    bench.complete(&args("--out other --shard 2/3 --seed 9"));
    refused("parts other --out n", "is of another run than");
    bench.complete(&args("--out four --shard 2/4"));
    refused("parts four --out n", "frames or walks 4 of 6 are in no part");
    bench.complete(&args("--out whole"));
    refused("whole --out n", "the run is not a shard");
    refused("nowhere --out n", "nowhere");
    let empty = bench.call(&args("--out x --shard 7/7"));
    insta::assert_snapshot!(empty.messages(), @"
    exit code: 2
    error: --shard: 7/7 is empty: only 6 frames or walks; use at most as many shards
    ");
}

/// A mock that gives the same reply to the same request, and the arguments of an evaluation with it.
fn asked_of(mock: &MockEndpoint) -> String {
    format!("--model a --base-url {} --levels L0,L2", mock.base_url())
}

#[test]
fn stopped_shards_resume_in_other_number() {
    let bench = Bench::new();
    let mock = MockEndpoint::start([Answer::text("B")]);
    let flags = asked_of(&mock);
    bench.complete(&words(&format!("{flags} --out whole")));
    let whole = mock.requests().len();
    for part in ["1/3", "3/3"] {
        bench.complete(&words(&format!("{flags} --out parts --shard {part}")));
    }
    let before = mock.requests().len();
    // While a part of another division is written, no part of this one begins.
    let own = bench.path("parts/shard-1-of-3/records.jsonl");
    let locked = fs::File::open(own).unwrap();
    locked.lock().unwrap();
    let refused = bench.call(&words(&format!("{flags} --out parts --shard 1/2")));
    insta::assert_snapshot!(refused.messages(), @"
    exit code: 2
    error: parts/shard-1-of-3: another process is writing to this part of another division, and both might ask the
        same; wait for it, or end it, before --shard 1/2 begins
    ");
    drop(locked);
    for part in ["1/2", "2/2"] {
        let said = bench.call(&words(&format!("{flags} --out parts --shard {part}")));
        assert_eq!(said.code, Some(0), "{said:?}");
        assert!(said.stderr.contains("replies copied"), "{}", said.stderr);
    }
    let all = mock.requests().len() - whole;
    assert_eq!(all, whole, "nothing is asked twice");
    assert!(mock.requests().len() > before);
    let merged = bench.call(&words("merge parts --out merged"));
    assert_eq!(merged.code, Some(0), "{merged:?}");
    assert!(!merged.stderr.contains("twice"), "{}", merged.stderr);
    assert_same_products(&bench.path("whole"), &bench.path("merged"));
    // A part of another run beside them is refused.
    let other = bench.call(&words(&format!("{flags} --seed 7 --out parts --shard 1/4")));
    insta::assert_snapshot!(other.messages(), @"
    exit code: 2
    error: parts/shard-1-of-3: this part is of another run: its --seed is 0, now it is 7; use another --out, or
        the same --seed
    ");
}

#[test]
fn doubly_paid_replies_are_reported() {
    let bench = Bench::new();
    let mock = MockEndpoint::start([Answer::text("A"), Answer::text("B")]);
    let flags = asked_of(&mock);
    for out in ["one", "two"] {
        bench.complete(&words(&format!("{flags} --out {out} --shard 1/2")));
    }
    bench.complete(&words(&format!("{flags} --out one --shard 2/2")));
    let merged = bench.call(&words("merge one two --out merged"));
    assert_eq!(merged.code, Some(0), "{merged:?}");
    // How many depends on the order of the replies.
    let said = "replies differ in two parts: they were paid for twice";
    assert!(merged.stderr.contains(said), "{}", merged.stderr);
    let first = bench.call(&words("merge one --out first"));
    assert_eq!(first.code, Some(0), "{first:?}");
    assert_same_products(&bench.path("first"), &bench.path("merged"));
}

#[test]
fn shards_share_limits_and_resources() {
    let bench = Bench::with_questions(6);
    let mock = MockEndpoint::start([Answer::text("B")]);
    let base = mock.base_url();
    let requests_per_minute = |run: &str| {
        let text = fs::read(bench.path(run).join("manifest.json")).unwrap();
        let manifest: Value = serde_json::from_slice(&text).unwrap();
        manifest["settings"]["--rpm"].clone()
    };
    let whole = "--data set.jsonl --levels L0 --rpm 7000 --out run --shard 1/1";
    bench.complete(&model_args(&base, whole));
    assert_eq!(requests_per_minute("run"), 7000);
    let half = "--levels L0 --rpm 7001 --out part --shard 2/2";
    bench.complete(&model_args(&base, half));
    assert_eq!(requests_per_minute("part/shard-2-of-2"), 3500);
    // What a part leaves of its half is said and noted; a whole run has no share.
    let paid = |more: &str| {
        let flags = format!("--model gpt-4o --base-url {base} --data set.jsonl --levels L0");
        bench.call(&words(&format!("{flags} --max-cost 8 {more}")))
    };
    bench.complete(&words("rooms --out rooms --frames 2 --size 96x64"));
    let of_part = bench.call(&words(&format!(
        "--model gpt-4o --base-url {base} --data rooms --levels L0 --max-cost 8 --out paid --shard 1/2"
    )));
    assert_eq!(of_part.code, Some(0), "{of_part:?}");
    let words_of = of_part.stderr.split("shard 1/2: ").nth(1).unwrap();
    insta::assert_snapshot!(redacted(words_of), @"$4.00 of its $4.00 of --max-cost are left; other parts do not get them");
    let text = fs::read(bench.path("paid/shard-1-of-2/manifest.json")).unwrap();
    let manifest: Value = serde_json::from_slice(&text).unwrap();
    let noted = &manifest["settings"]["--max-cost of this part"];
    let number = |name: &str| noted[name].as_f64().unwrap();
    assert!(number("spent") > 0.0, "{noted}");
    assert!((number("share") - number("spent") - number("left")).abs() < 1e-9, "{noted}");
    let whole = paid("--out unshared");
    assert_eq!(whole.code, Some(0), "{whole:?}");
    assert!(!whole.stderr.contains("are left"), "{}", whole.stderr);
    // Half of what may be spent is less than a reply costs.
    let dear = format!("--model gpt-4o --base-url {base} --levels L0 --max-cost 0.0001 --out dear --shard 1/2");
    assert_eq!(bench.call(&words(&dear)).code, Some(3));
}

/// The script as a node runs it, with a `scontrol` that writes down what it is told.
#[cfg(unix)]
#[test]
fn slurm_script_restarts_stopped_task() {
    use std::time::Duration;

    let bench = Bench::with_questions(400);
    let mock = MockEndpoint::answering(|_| {
        std::thread::sleep(Duration::from_millis(20));
        Answer::text("B")
    });
    bench.program("scontrol", "echo \"$@\" >> told");
    std::os::unix::fs::symlink(PROGRAM, bench.path("bin/darkqa-eval")).unwrap();
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/src/commands/cluster/slurm.sh");
    let base = mock.base_url();
    let args = model_args(&base, "--data set.jsonl --levels L0 --concurrency 1 --out run");
    let variables = [
        ("SLURM_JOB_ID", "8"),
        ("SLURM_ARRAY_JOB_ID", "7"),
        ("SLURM_ARRAY_TASK_ID", "0"),
        ("SLURM_ARRAY_TASK_COUNT", "1"),
    ];
    let mut task = std::process::Command::new("bash")
        .arg(script)
        .args(args)
        .current_dir(bench.path(""))
        .envs(variables)
        .env("PATH", bench.search_path())
        .env_remove("OPENAI_API_KEY")
        .spawn()
        .unwrap();
    wait_until(|| mock.requests().len() >= 5);
    signal(&task, "-TERM");
    assert_eq!(task.wait().unwrap().code(), Some(130));
    assert_eq!(fs::read_to_string(bench.path("told")).unwrap(), "requeue 7_0\n");
    let answered = records(&bench.path("run")).len();
    assert!((5..400).contains(&answered), "{answered}");
}
