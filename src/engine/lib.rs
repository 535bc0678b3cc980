//! The engine of everything that is asked: a [`Job`] carries out an [`Experiment`](experiment::Experiment).
//!
//! A job opens the run folder. For each phase it plans the remaining trials, has their images made, asks about them,
//! and stores every reply when it arrives. At the end the experiment scores the run. Differences between questions with
//! choices and open questions are in their `Experiment`. Cost limits, resuming and batches are here, once.

#![allow(missing_docs, reason = "fields and variants of this workspace's own use, whose names say what they are")]
#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

pub mod batch;
pub mod circuit_breaker;
pub mod costs;
pub mod dark_already;
pub mod dispatch;
pub mod experiment;
pub mod image_cache;
pub mod image_rebuilder;
pub mod images;
pub mod interrupt;
pub mod job;
pub mod key_facts;
pub mod lanes;
pub mod manifest;
pub mod models;
pub mod observer;
pub mod open_files;
pub mod open_run;
pub mod refusals;
pub mod reply_checks;
pub mod settings;
pub mod stored_keys;

pub use job::Job;
pub use open_run::{image_limit, pipeline};
