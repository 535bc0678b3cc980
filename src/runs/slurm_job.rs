//! Asks Slurm whether a job is a task of an array: [`ask_scontrol`].

use std::io::Read as _;
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

/// Maximum time for an answer of `scontrol` (chosen). A busy controller may answer late; `scontrol` itself waits 10 s
/// and more.
const TIME_LIMIT: Duration = Duration::from_secs(5);

/// Whether a job is a task of an array.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Membership {
    /// It is a task.
    Task,
    /// It is a plain job of this number: the variables of an array are inherited.
    PlainJob(u32),
    /// Slurm did not say it, for this reason.
    Unknown(String),
}

/// Asks `scontrol` whether a job is a task of an array, for at most [`TIME_LIMIT`].
pub(super) fn ask_scontrol(job: u32) -> Membership {
    let unknown = |problem: String| Membership::Unknown(format!("scontrol {problem}"));
    let child = Command::new("scontrol")
        .args(["--oneliner", "show", "job", &job.to_string()])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn();
    let mut child = match child {
        Ok(child) => child,
        Err(e) => return unknown(format!("cannot be started: {e}")),
    };
    let stdout = child.stdout.take();
    let (sender, receiver) = mpsc::channel();
    // The thread ends with the output. It is not joined, because a child of scontrol may keep the output open.
    thread::spawn(move || {
        let mut text = String::new();
        let read = stdout.map(|mut out| out.read_to_string(&mut text));
        let _ = sender.send(read.is_some_and(|read| read.is_ok()).then_some(text));
    });
    let answer = receiver.recv_timeout(TIME_LIMIT);
    // After its output has ended, the program has nothing more to do.
    let _ = child.kill();
    let _ = child.wait();
    match answer {
        Ok(text) => {
            parse(&text.unwrap_or_default(), job).unwrap_or_else(|| unknown(format!("does not know job {job}")))
        }
        Err(_) => unknown(format!("did not answer within {} s", TIME_LIMIT.as_secs())),
    }
}

/// Parses the answer of `scontrol`: `JobId=107 ArrayJobId=100 ArrayTaskId=2 JobName=…` for a task, `JobId=108
/// JobName=…` for a plain job. `None` if it does not describe this job. The fields after the name of the job may have
/// any text.
fn parse(answer: &str, job: u32) -> Option<Membership> {
    let own = format!("JobId={job}");
    let mut fields = answer
        .lines()
        .map(str::split_whitespace)
        .find_map(|mut fields| (fields.next() == Some(&*own)).then_some(fields))?;
    let is_task = fields
        .by_ref()
        .take_while(|field| !field.starts_with("JobName="))
        .any(|field| field.starts_with("ArrayJobId="));
    Some(if is_task { Membership::Task } else { Membership::PlainJob(job) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_of_scontrol_are_parsed() {
        for (answer, expected) in [
            ("JobId=107 ArrayJobId=100 ArrayTaskId=2 JobName=job.sh UserId=root(0)", Some(Membership::Task)),
            // The throttle of an array, and the form without --oneliner.
            (
                "JobId=107 ArrayJobId=100 ArrayTaskId=2 ArrayTaskThrottle=1 JobName=a\n   Comment=b",
                Some(Membership::Task),
            ),
            ("JobId=107 JobName=job.sh UserId=root(0)", Some(Membership::PlainJob(107))),
            // The name of a job is free text.
            ("JobId=107 JobName=x ArrayJobId=100", Some(Membership::PlainJob(107))),
            // Another job, and no answer.
            ("JobId=1070 ArrayJobId=100 ArrayTaskId=2 JobName=a", None),
            ("", None),
        ] {
            assert_eq!(parse(answer, 107), expected, "{answer}");
        }
    }
}
