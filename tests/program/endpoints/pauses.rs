//! A process that is stopped for longer than its time limits (Ctrl-Z, `scontrol suspend`, a closed laptop): no reply is
//! paid for twice.
#![cfg(unix)]

use std::process::Stdio;
use std::thread;
use std::time::Duration;

use crate::support::endpoint::{Answer, MockEndpoint};
use crate::support::process::{signal, wait_until};
use crate::support::run::{Bench, model_args, records};
use crate::support::table::check_rows;

/// Longer than `--timeout` and `--grace` of these runs.
const STOPPED: Duration = Duration::from_millis(2500);

/// Requests of these runs: 6 questions at 2 levels.
const TRIALS: usize = 12;

const RUN: &str =
    "--data set.jsonl --levels L0,L3 --variant ev --concurrency 4 --timeout 1 --grace 1 --retries 0 --out run";

/// The way in which the endpoint answers.
#[derive(Debug, Clone, Copy)]
enum Reply {
    /// After a while, in one piece.
    Whole,
    /// At once, but slowly.
    Dripping,
    /// As a slow stream.
    Stream,
}

impl Reply {
    fn endpoint(self) -> MockEndpoint {
        MockEndpoint::answering(move |_| match self {
            Self::Whole => {
                thread::sleep(Duration::from_millis(400));
                Answer::text("C")
            }
            Self::Dripping => Answer::text("C").drip(2),
            Self::Stream => Answer::streamed_text("C").drip(4),
        })
    }

    fn wire(self) -> &'static str {
        match self {
            Self::Whole | Self::Dripping => "chat",
            Self::Stream => "chat-stream",
        }
    }
}

#[test]
fn pauses_longer_than_timeout_cost_nothing() {
    check_rows([Reply::Whole, Reply::Dripping, Reply::Stream], |reply| {
        let bench = Bench::with_questions(6);
        let endpoint = reply.endpoint();
        let (url, line) = (endpoint.base_url(), format!("{RUN} --wire {}", reply.wire()));
        let mut program = bench.spawn(&model_args(&url, &line), Stdio::null());
        for requests in [1, 4, 9] {
            wait_until(|| endpoint.requests().len() >= requests);
            thread::sleep(Duration::from_millis(60));
            signal(&program, "-STOP");
            thread::sleep(STOPPED);
            signal(&program, "-CONT");
        }
        assert_eq!(program.wait().unwrap().code(), Some(0));
        let stored = records(&bench.path("run"));
        assert_eq!((stored.len(), endpoint.requests().len()), (TRIALS, TRIALS));
        assert!(stored.iter().all(|record| record["failure"].is_null()));
    });
}

#[test]
fn pause_after_interrupt_loses_no_reply() {
    let bench = Bench::with_questions(6);
    let endpoint = Reply::Whole.endpoint();
    let url = endpoint.base_url();
    let mut program = bench.spawn(&model_args(&url, RUN), Stdio::null());
    wait_until(|| endpoint.requests().len() >= 3);
    signal(&program, "-TERM");
    thread::sleep(Duration::from_millis(150));
    signal(&program, "-STOP");
    thread::sleep(STOPPED);
    signal(&program, "-CONT");
    assert_eq!(program.wait().unwrap().code(), Some(130));
    let sent = endpoint.requests().len();
    assert!(sent < TRIALS, "the interrupt came too late");
    assert_eq!(records(&bench.path("run")).len(), sent);
}

#[test]
fn silent_server_times_out() {
    check_rows([Answer::silent(), Answer::stuck()], |answer| {
        let bench = Bench::with_questions(1);
        let endpoint = MockEndpoint::start([answer]);
        let url = endpoint.base_url();
        let line = "--data set.jsonl --levels L0 --timeout 1 --retries 0 --out run";
        let program = bench.call(&model_args(&url, line));
        assert_eq!(program.code, Some(1), "{program:?}");
        let failure = records(&bench.path("run"))[0]["failure"].to_string();
        assert!(failure.contains("did not answer within 1 s"), "{failure}");
        assert_eq!(endpoint.requests().len(), 1);
    });
}
