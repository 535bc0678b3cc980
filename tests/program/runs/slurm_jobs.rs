//! Which part a job of Slurm does: tasks of an array, tasks that are repeated, and jobs that inherit the variables of a
//! task.
//!
//! The variables are those that Slurm 22.05.8 sets. A script stands in for `scontrol`.

use std::collections::BTreeSet;
use std::fs;
use std::time::Instant;

use crate::support::run::{Bench, Called, called, files, records, words};

/// What `scontrol` says of a task of an array.
const TASK: &str = "echo \"JobId=$4 ArrayJobId=100 ArrayTaskId=2 JobName=job.sh UserId=root(0)\"";
/// What `scontrol` says of a plain job whose name looks like that of a task.
const PLAIN: &str = "echo \"JobId=$4 JobName=ArrayJobId=100 ArrayJobId=100\"";
/// A `scontrol` that must not be called.
const UNUSED: &str = "echo called > asked";

/// A task of a Slurm array: its number, the number of tasks, and their lowest and highest number.
#[derive(Clone, Copy)]
struct Task(u32, u32, u32, u32);

impl Bench {
    /// Runs an evaluation in `out` as a job whose variables are those of a task of array job 100.
    fn job(&self, scontrol: &str, id: u32, task: Task, line: &str) -> Called {
        self.program("scontrol", scontrol);
        let line = format!("--model random --levels L0,L2 --no-parquet {line}");
        let Task(number, count, first, last) = task;
        let variables = [
            ("SLURM_JOB_ID", id),
            ("SLURM_ARRAY_JOB_ID", 100),
            ("SLURM_ARRAY_TASK_ID", number),
            ("SLURM_ARRAY_TASK_COUNT", count),
            ("SLURM_ARRAY_TASK_MIN", first),
            ("SLURM_ARRAY_TASK_MAX", last),
            ("SLURM_ARRAY_TASK_STEP", 1),
        ];
        let mut command = self.command(&words(&line));
        command.envs(variables.map(|(name, value)| (name, value.to_string()))).env("PATH", self.search_path());
        called(&mut command)
    }

    /// Runs all four tasks of `--array=0-3`.
    fn array(&self, out: &str) {
        // The last task has the job number of the array.
        for (number, job) in [(0, 101), (1, 102), (2, 107), (3, 100)] {
            let done = self.job(TASK, job, Task(number, 4, 0, 3), &format!("--out {out}"));
            assert_eq!(done.code, Some(0), "{done:?}");
        }
    }

    /// The parts of a run that exist, by the names of their folders.
    fn parts(&self, out: &str) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(self.path(out))
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

const ALL: [&str; 4] = ["shard-1-of-4", "shard-2-of-4", "shard-3-of-4", "shard-4-of-4"];

#[test]
fn repeated_tasks_do_the_same_parts() {
    let bench = Bench::new();
    bench.array("run");
    assert_eq!(bench.parts("run"), ALL);
    let keys = |part: &str| {
        let records = records(&bench.path("run").join(part));
        let keys = records.iter().map(|record| record["key"].to_string());
        keys.collect::<BTreeSet<_>>()
    };
    let before = ALL.map(keys);
    // --array=2, --array=1,3 and --array=2-3.
    for (tasks, count, first, last) in [(&[2][..], 1, 2, 2), (&[1, 3], 2, 1, 3), (&[2, 3], 2, 2, 3)] {
        for number in tasks {
            fs::remove_dir_all(bench.path("run").join(ALL[*number as usize])).unwrap();
        }
        for number in tasks {
            let again = bench.job(TASK, 120 + number, Task(*number, count, first, last), "--out run");
            assert_eq!(again.code, Some(0), "{again:?}");
            let said = format!("task {number} of the Slurm array 0-3 again: this process does shard");
            assert!(again.stderr.contains(&said), "{again:?}");
        }
        assert_eq!(bench.parts("run"), ALL, "{tasks:?}");
        assert_eq!(ALL.map(keys), before, "{tasks:?}");
    }
    bench.complete(&words("merge run --out merged"));
    let manifest = fs::read_to_string(bench.path("merged/manifest.json")).unwrap();
    assert!(!manifest.contains("Slurm"), "{manifest}");
}

#[test]
fn a_smaller_array_from_the_same_number_is_another_division() {
    let bench = Bench::new();
    bench.array("run");
    let task = bench.job(TASK, 130, Task(0, 2, 0, 1), "--out run");
    assert_eq!(task.code, Some(0), "{task:?}");
    assert!(task.stderr.contains("does shard 1/2"), "{task:?}");
    assert!(task.stderr.contains("copied from parts of another division"), "{task:?}");
}

#[test]
fn a_repeated_task_of_parts_named_by_hand_is_refused() {
    let bench = Bench::new();
    for part in ["1/4", "2/4", "4/4"] {
        let line = format!("--model random --levels L0,L2 --no-parquet --out run --shard {part}");
        bench.complete(&words(&line));
    }
    let before = files(&bench.path("run"));
    let task = bench.job(TASK, 110, Task(2, 1, 2, 2), "--out run");
    insta::assert_snapshot!(task.messages(), @"
    exit code: 2
    error: --shard: task 2 is the only one of its Slurm array (SLURM_ARRAY_TASK_COUNT=1), and run has the parts of
        a run: name the part, --shard 3/4 for task 2 of 0-3, --shard 2/4 for task 2 of 1-4, or do everything in
        another --out with --shard none
    ");
    assert_eq!(files(&bench.path("run")), before);
    // The remedy of the message.
    let named = bench.job(UNUSED, 110, Task(2, 1, 2, 2), "--out run --shard 3/4");
    assert_eq!(named.code, Some(0), "{named:?}");
    assert_eq!(bench.parts("run"), ALL);
}

#[test]
fn the_only_task_of_a_new_array_says_that_it_does_everything() {
    let bench = Bench::new();
    let task = bench.job(UNUSED, 110, Task(2, 1, 2, 2), "--out run");
    insta::assert_snapshot!(task.messages(), @"
    exit code: 0
     WARN SLURM_ARRAY_TASK_COUNT is 1: the only task of a Slurm array does everything; --shard I/N does one part
    ");
    assert!(bench.path("run/records.jsonl").exists());
    assert!(!bench.path("asked").exists(), "the answer would change nothing");
}

#[test]
fn an_array_with_gaps_is_refused() {
    let bench = Bench::new();
    let task = bench.job(TASK, 110, Task(1, 3, 0, 3), "--out run");
    insta::assert_snapshot!(task.messages(), @"
    exit code: 2
    error: --shard: the Slurm array has only 3 tasks of 0-3, and no variable has the place of a task in such an
        array: number the tasks without gaps, as --array=0-2, or name the part of each with --shard I/N, or do
        everything in each with --shard none
    ");
    assert!(!bench.path("run").exists());
}

#[test]
fn a_plain_job_that_a_task_submitted_is_no_part() {
    let bench = Bench::new();
    let plain = bench.job(PLAIN, 108, Task(2, 4, 0, 3), "--out run");
    insta::assert_snapshot!(plain.messages(), @"
    exit code: 0
     WARN scontrol: job 108 is no task of a Slurm array, only submitted by one (SLURM_ARRAY_TASK_ID is inherited):
        this process does everything; --shard I/N does one part
    ");
    assert!(bench.path("run/records.jsonl").exists());
    let auto = bench.job(PLAIN, 108, Task(2, 4, 0, 3), "--out auto --shard auto");
    insta::assert_snapshot!(auto.messages(), @"
    exit code: 2
    error: --shard: auto is for a task of a Slurm array, and scontrol says that job 108 is none
        (SLURM_ARRAY_TASK_ID is inherited from the task that submitted it): name the part, as --shard 2/4, or do
        everything with --shard none
    ");
    // The same variables in a task, and in a part that is named.
    let task = bench.job(TASK, 108, Task(2, 4, 0, 3), "--out parts");
    assert!(task.stderr.contains("does shard 3/4"), "{task:?}");
    let named = bench.job(UNUSED, 108, Task(2, 4, 0, 3), "--out parts --shard 1/4");
    assert_eq!(named.code, Some(0), "{named:?}");
    assert!(!named.stderr.contains("Slurm"), "{named:?}");
    assert!(!bench.path("asked").exists());
}

#[test]
fn a_task_is_a_part_if_slurm_does_not_answer() {
    let bench = Bench::new();
    let begun = Instant::now();
    let slow = bench.job("sleep 120", 107, Task(2, 4, 0, 3), "--out run");
    assert!(begun.elapsed().as_secs() < 60, "{:?}", begun.elapsed());
    insta::assert_snapshot!(slow.messages(), @"
    exit code: 0
     WARN task 3 of a Slurm array of 4: this process does shard 3/4; --shard none does everything. scontrol did
        not answer within [TIME], so that it is not known whether this job is the task or was submitted by it
        (then --shard none is right)
    ");
    let error = "echo slurm_load_jobs error: Invalid job id specified >&2; exit 1";
    let unknown = bench.job(error, 107, Task(1, 4, 0, 3), "--out run");
    insta::assert_snapshot!(unknown.messages(), @"
    exit code: 0
     WARN task 2 of a Slurm array of 4: this process does shard 2/4; --shard none does everything. scontrol does
        not know job 107, so that it is not known whether this job is the task or was submitted by it (then
        --shard none is right)
    ");
    // The last task of an array has its number.
    let last = bench.job(UNUSED, 100, Task(3, 4, 0, 3), "--out run");
    assert!(!last.stderr.contains("scontrol"), "{last:?}");
    assert_eq!(bench.parts("run"), [ALL[1], ALL[2], ALL[3]]);
    assert!(!bench.path("asked").exists());
}
