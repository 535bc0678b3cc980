//! The engine of everything that is asked: a [`Job`] carries out an [`Experiment`](experiment::Experiment).
//!
//! A job opens the run folder. For each phase it plans the remaining trials, has their images made, asks about them,
//! and stores every reply when it arrives. At the end the experiment scores the run. Differences between questions with
//! choices and open questions are in their `Experiment`. Cost limits, resuming and batches are here, once.

pub(crate) mod batch;
pub(crate) mod circuit_breaker;
pub(crate) mod costs;
pub(crate) mod dark_already;
pub(crate) mod dispatch;
pub(crate) mod experiment;
pub(crate) mod image_cache;
pub(crate) mod image_rebuilder;
pub(crate) mod images;
pub(crate) mod interrupt;
pub(crate) mod job;
pub(crate) mod key_facts;
pub(crate) mod lanes;
pub(crate) mod manifest;
pub(crate) mod models;
pub(crate) mod observer;
pub(crate) mod open_files;
pub(crate) mod open_run;
pub(crate) mod refusals;
pub(crate) mod reply_checks;
pub(crate) mod settings;
pub(crate) mod stored_keys;

pub(crate) use job::Job;
pub(crate) use open_run::{image_limit, pipeline};
