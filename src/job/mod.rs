//! The engine of everything that is asked: a `Job` carries out an `Experiment`.
//!
//! A job opens the run folder. For each phase it plans the remaining trials, makes their images, asks about them, and stores every reply
//! when it arrives. At the end the experiment scores the run. Differences between questions with choices and open questions are in their
//! `Experiment`. Cost limits, resuming, batches, shards and images are here, once.

pub(crate) mod batch;
mod batch_system;
pub(crate) mod bilinear;
pub(crate) mod budget;
mod circuit_breaker;
pub(crate) mod conditions;
pub(crate) mod dark_already;
pub(crate) mod dark_frames;
mod dispatch;
mod engine;
pub(crate) mod enhancers;
mod estimate;
pub(crate) mod experiment;
mod first_source;
mod folder;
pub(crate) mod frame_work;
pub(crate) mod identity;
pub(crate) mod image_maker;
pub(crate) mod image_notes;
pub(crate) mod image_pipeline;
pub(crate) mod image_steps;
pub(crate) mod image_words;
pub(crate) mod input_tally;
pub(crate) mod interrupt;
mod lanes;
mod manifest;
mod measured_tokens;
pub(crate) mod merge;
pub(crate) mod models;
pub(crate) mod money;
pub(crate) mod montage;
pub(crate) mod observer;
mod open_run;
mod other_parts;
mod outcome;
pub(crate) mod part;
pub(crate) mod photograph;
pub(crate) mod photographs;
mod placed_trials;
pub(crate) mod plan;
pub(crate) mod predictions;
pub(crate) mod progress;
pub(crate) mod questions;
mod questions_by_rule;
pub(crate) mod rebuild;
pub(crate) mod recipe;
pub(crate) mod record_table;
mod renamed;
pub(crate) mod report;
mod resting_enhancer;
pub(crate) mod run_files;
pub(crate) mod run_plan;
mod run_texts;
pub(crate) mod scaling;
pub(crate) mod settings;
pub(crate) mod shard;
pub(crate) mod source;
pub(crate) mod stored;
mod stored_findings;
pub(crate) mod stored_images;
mod stored_thumbnails;
pub(crate) mod thumbnail;
pub(crate) mod timings;
pub(crate) mod trial;
mod truncation;
pub(crate) mod walk;
pub(crate) mod workers;

pub(crate) use engine::Job;
pub(crate) use folder::now;
pub(crate) use manifest::count;
pub(crate) use open_run::{limit, pipeline};
pub(crate) use outcome::{Outcome, ShowArgs, StdoutFormat};
