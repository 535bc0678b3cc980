//! Measures how well a vision-language model sees in the dark.
//!
//! From well-lit indoor frames it makes low-light versions (levels L0–L5, each by exposure drop alone and with the noise
//! of a sensor), mends them with any enhancement model given as ONNX, asks OpenAI-compatible endpoints multiple-choice
//! questions about each image, scores the replies by exact match, and compares all of it.
//!
//! # The map
//!
//! Data flows one way. Each folder is a stage; the stages do not know each other. What is asked (words) and what is seen
//! (light) are two corridors that meet only where a question is put to a model.
//!
//! ```text
//!                  ┌──────► questions ─────────────┐            (words: what is asked)
//!  cli → config → dataset                           ├─► ask → score → store → report
//!                  └──────► synthesis ──► enhance ──┘            (light: what is seen)
//!                        run = the conductor; types = the shared vocabulary
//! ```
//!
//! - [`types`]: the vocabulary. [`Frame`](types::Frame)s are seen, [`Question`](types::Question)s are asked, a
//!   [`Condition`](types::Condition) is a degradation with or without an enhancer, a [`Reply`](types::Reply) is what a
//!   model said, and a [`Record`](types::Record) is what came of one question for one model in one condition; of an open
//!   question, or of a mark for an answer, its detail is an [`OpenDetail`](types::OpenDetail).
//! - [`dataset`]: a folder, a ready-made set or the built-in rooms → images, their maps and questions.
//! - [`questions`]: a frame with its maps → questions with one true answer, by rule; pure integers. And the observer: what
//!   the rules could still answer from given pixels.
//! - [`synthesis`]: a clean image → the same with less light; pure, given a noise key.
//! - [`enhance`]: a dark image → a mended one, by the user's ONNX model.
//! - [`ask`]: a prompt and an image → a reply; the only asynchronous stage.
//! - [`score`]: a reply → a choice; records → numbers with their intervals.
//! - [`store`]: `results/<run>/`, append-only and resumable.
//! - [`report`]: tables, figures and one HTML file, from the records alone; figures of pictures that are handed in.
//! - [`run`]: the only place that sees every stage, and the only bridge between CPU work and waiting.
//! - [`cli`] is what the user typed; [`config`] is what it means, checked once.
//!
//! # What must hold
//!
//! - The same inputs and seed give the same bytes, whatever the threads, order or resume: a random draw is a function of
//!   where it is used, never of when.
//! - What was paid for is on disk before anything else happens, and is never asked again.
//! - No reply is guessed at: what cannot be read is counted apart, what failed is not scored.
//! - A key reaches no log, no file and no message.
//!
//! # Who may import whom
//!
//! `tests/architecture.rs` reads this table and fails on a breach.
//!
//! | module | may use |
//! |---|---|
//! | `error` | nothing |
//! | `types` | `error` |
//! | `dataset` | `types`, `error` |
//! | `questions` | `types`, `error` |
//! | `synthesis` | `types`, `error` |
//! | `enhance` | `types`, `error` |
//! | `ask` | `types`, `error` |
//! | `score` | `types`, `error` |
//! | `store` | `types`, `error` |
//! | `report` | `types`, `error`, `score`, `questions` |
//! | `cli` | nothing |
//! | `config` | `types`, `error`, `cli`, `dataset`, `questions`, `synthesis`, `enhance`, `ask`, `score` |
//! | `run` | `types`, `error`, `config`, `dataset`, `questions`, `synthesis`, `enhance`, `ask`, `score`, `store`, `report` |
//! | `main` | `cli`, `config`, `run`, `enhance`, `types` |
//!
//! `config` uses the stages for the settings that each of them defines, and for nothing else.

#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

pub mod ask;
pub mod cli;
pub mod config;
pub mod dataset;
pub mod enhance;
pub mod error;
pub mod files;
pub mod job;
pub mod questions;
pub mod report;
pub mod run;
pub mod score;
pub mod store;
pub mod synthesis;
pub mod types;
