//! Measures how well a vision-language model sees in the dark.
//!
//! From well-lit indoor frames it makes low-light versions (levels L0–L5 or any exposure drop, each by exposure drop alone and with the
//! noise of a sensor; or as a camera with automatic exposure takes them, or blurred by its motion), enhances them with any low-light model given as ONNX, asks OpenAI-compatible endpoints questions about each
//! image, scores the replies, and compares all of it.
//!
//! # The library
//!
//! The program `darkqa-eval` does all of this from the command line. The library has the pieces that other programs use:
//! [`synthesis`], [`enhance`], [`questions`], [`score::choice`] and [`StoredRun`]; their vocabulary is at the root.
//!
//! Degrade a frame. The noise follows from the seed and the name of the frame, so that the same call gives the same image:
//!
//! ```
//! use darkqa_eval::synthesis::{NoiseKey, Synthesis, degrade};
//! use darkqa_eval::{Degradation, FrameId, Rgb};
//!
//! let clean = Rgb::new(2, 2, vec![128; 12])?;
//! let how: Degradation = "L3-noise".parse()?;
//! let key = NoiseKey::new(0, &FrameId("kitchen/0001".to_owned()));
//! let degraded = degrade(&clean, Some(&how), &key, &Synthesis::default())?;
//! assert!(degraded.samples().iter().all(|sample| *sample < 64));
//! # Ok::<(), darkqa_eval::Error>(())
//! ```
//!
//! Enhance an image with an ONNX model of your own:
//!
//! ```no_run
//! use std::num::NonZeroUsize;
//! use std::path::Path;
//!
//! use darkqa_eval::Rgb;
//! use darkqa_eval::enhance::{Enhancer, Install, ModelFile, RuntimeSearch};
//!
//! let degraded = Rgb::new(480, 640, vec![9; 480 * 640 * 3])?;
//! let runtime = RuntimeSearch { library: None, install: Install::Allowed }.open()?;
//! let model = ModelFile::read(Path::new("zerodce.onnx"))?;
//! let mut enhancer = Enhancer::open(model, &runtime, NonZeroUsize::new(4))?;
//! let enhanced = enhancer.enhance(&degraded)?;
//! assert_eq!((enhanced.height(), enhanced.width()), (480, 640));
//! # Ok::<(), darkqa_eval::Error>(())
//! ```
//!
//! Read a reply and score it. The strict parsing takes the exact words of a choice alone, the lenient one finds them in a sentence:
//!
//! ```
//! use darkqa_eval::score::choice::readings;
//! use darkqa_eval::{Answer, Choices, Reply};
//!
//! let choices = Choices::new(vec!["kitchen".to_owned(), "bedroom".to_owned()], 1)?;
//! let reply = Reply::local("The answer is (B).".to_owned());
//! let (strict, lenient) = readings(&reply, &choices);
//! assert!(matches!(strict, Answer::Unparsed(_)));
//! assert_eq!(choices.truth(), Some(1));
//! assert_eq!(lenient, Answer::Chosen(1));
//! # Ok::<(), darkqa_eval::Error>(())
//! ```
//!
//! Read the records of a run, with the columns of `records.parquet`:
//!
//! ```
//! use darkqa_eval::StoredRun;
//!
//! let (mut right, mut replies) = (0, 0);
//! for record in StoredRun::open("results/reference")?.records()? {
//!     let record = record?;
//!     if record.text("level")? == Some("L3") {
//!         replies += usize::from(record.flag("right")?.is_some());
//!         right += usize::from(record.flag("right")? == Some(true));
//!     }
//! }
//! assert!(right < replies);
//! # Ok::<(), darkqa_eval::Error>(())
//! ```
//!
//! `tests/examples/accuracy.rs` computes the accuracy of each level.
//!
//! # The map
//!
//! The program is this crate. Its libraries are crates of their own, in `src/CRATE`, with names that begin with `darkqa-`. Data flows
//! one way, and the stages do not know each other:
//!
//! ```text
//!                            ┌──────► questions ─────────────┐            (words: what is asked)
//! labels ► rooms ► dataset ──┤                               ├─► ask → store → score → report
//!             import ──┘     └──────► light ──────► enhance ─┘            (light: what is seen)
//!
//! types, error, files = the ground    images → engine = all that is asked    runs, run_reports = what was asked    run = one folder a command    cli = words → calls
//! ```
//!
//! | crate | here | |
//! |---|---|---|
//! | `ground` | `error`, `files`, `types`, `labels` | the one error type; files read with bounds and written whole; the vocabulary; the label spaces NYU40, mpcat40, ADE150 and NYU13 |
//! | `light` | `darkqa_light` | a clean image × a degradation → a degraded one; pure, given a noise key |
//! | `python_light` | | the Python module `darkqa_light`: what `light` does, on arrays; the program does not use it |
//! | `picture` | `picture` | image files with their colour profiles and orientation, maps of numbers, scaling, and images encoded for a request |
//! | `scenes` | `rooms` | the built-in rooms, drawn by a seed with all their maps |
//! | `questions` | `darkqa_questions` | a frame with its maps → questions with one true answer, by rule; the observer: what the rules could still answer from given pixels; and answers from maps that a network predicted |
//! | `enhance` | `darkqa_enhance` | a degraded image → an enhanced one, by the user's ONNX model; `models` has the networks that the program carries |
//! | `choice` | `darkqa_score::choice` | a reply → its answer without thoughts: a choice, a mark or a text |
//! | `statistics` | `darkqa_score` | estimates with intervals, tests and thresholds of clustered replies |
//! | `score` | `darkqa_score` | records → numbers with their intervals |
//! | `store` | `store` | the folder of a run, `results/<run>/`: append-only and resumable |
//!
//! A [`Frame`] is seen, a [`Question`] is asked, a [`Degradation`] is what was done to a frame, a [`Condition`] is a
//! degradation with or without an enhancer, a [`Reply`] is what a model sent, and a `Record` is the result
//! of one trial: one question to one model in one condition. The modules of this crate:
//!
//! - `dataset`: a folder, a ready-made set or the built-in rooms → images, their maps and questions.
//! - `import`: other data sets → frames, one file a kind; `import/recording`, `import/lerobot`: recordings of robots and videos → frames.
//! - `calibrate`: frames of a sensor → the camera that the synthesis takes its noise from.
//! - `ask`: a prompt and images → a reply; the only asynchronous stage. `ask/wire`: the APIs of endpoints, their requests and replies.
//! - `image_store`: a folder of images that were made, shared by runs and processes; it may be deleted at any time.
//! - `text`: words, and the table model with its formats for the terminal, CSV and LaTeX.
//! - `sentences`: the findings of a report; `tables`: its tables; `drawing`: its figures, and figures of images that are handed in.
//! - `report`: the page, the files and the text of a report, from the records alone, and a leaderboard of many.
//! - `images`: from a frame to the images of a request, made once by one pipeline for everything that is asked or written.
//! - `runs`: runs on disk, read from their folders, joined from parts, and tabled.
//! - `run_reports`: reports on one run or several, from their records alone.
//! - `engine`: a `Job` carries out an `Experiment`: it plans, has images made, asks, keeps, and has the experiment score. Questions
//!   with choices and open ones differ in their `Experiment` alone.
//! - `run`: the commands; `run/evaluate` and `run/openeqa` are the two experiments.
//! - `cli`: the commands. A flag is a field of a structure in the room that uses it, in that room's own types; the environment and
//!   a file of flags are turned into words, and all words are parsed once.
//! - `internals`: what benchmarks and tests of this repository use besides.
//!
//! # Where to add what
//!
//! `CONTRIBUTING.md` has a checklist for each kind of change: a flag, a format to import, a kind of degradation, an API or a vendor of
//! endpoints, a rule of reading replies, a statistic, an experiment and others.
//!
//! # What must hold
//!
//! - The same inputs and seed give the same bytes, whatever the threads, order, shard or resume: a random draw is a function of where
//!   it is used, never of when.
//! - What was paid for is on disk before anything else happens, and is never asked again.
//! - No reply is guessed at: what cannot be read is counted apart, what failed is not scored.
//! - A key reaches no log, no file and no message.
//! - What decides a reply is in the key of its trial; a run's identity holds only what all trials share and no column tells apart.
//!
//! # Who may import whom
//!
//! `tests/program/architecture/` reads this table and fails on a breach. A room may use crates of the workspace and rooms whose rows are above its own. No file of
//! `run` uses another command's, and files import each other in no circles but those that `tests/program/architecture/mod.rs` lists with
//! a reason.
//!
//! | module | may use |
//! |---|---|
//! | `dataset` | `rooms`, `labels`, `files`, `picture`, `types`, `error` |
//! | `import` | `dataset`, `labels`, `files`, `picture`, `types`, `error` |
//! | `ask` | `files`, `picture`, `types`, `error` |
//! | `calibrate` | `dataset`, `light`, `files`, `picture`, `types`, `error` |
//! | `image_store` | `files`, `types`, `error` |
//! | `text` | `types`, `error`, `score` |
//! | `sentences` | `text`, `types`, `error`, `score` |
//! | `tables` | `sentences`, `text`, `types`, `error`, `score` |
//! | `drawing` | `tables`, `sentences`, `text`, `types`, `error`, `score` |
//! | `report` | `drawing`, `tables`, `sentences`, `text`, `types`, `error`, `score`, `questions`, `calibrate` |
//! | `images` | `text`, `sentences`, `tables`, `drawing`, `report`, `files`, `picture`, `types`, `error`, `rooms`, `labels`, `dataset`, `questions`, `light`, `enhance`, `ask`, `score`, `store`, `image_store` |
//! | `runs` | `images`, `ask`, `light`, `files`, `picture`, `types`, `error`, `dataset`, `enhance`, `score`, `store`, `image_store`, `text`, `sentences`, `tables`, `drawing`, `report` |
//! | `run_reports` | `runs`, `images`, `ask`, `files`, `types`, `error`, `questions`, `score`, `store`, `text`, `sentences`, `tables`, `drawing`, `report` |
//! | `engine` | `run_reports`, `runs`, `images`, `files`, `picture`, `types`, `error`, `rooms`, `labels`, `dataset`, `questions`, `light`, `enhance`, `ask`, `score`, `store`, `image_store`, `text`, `sentences`, `tables`, `drawing`, `report` |
//! | `run` | `engine`, `run_reports`, `runs`, `images`, `files`, `picture`, `types`, `error`, `rooms`, `labels`, `import`, `dataset`, `calibrate`, `questions`, `light`, `enhance`, `ask`, `score`, `store`, `image_store`, `text`, `sentences`, `tables`, `drawing`, `report` |
//! | `internals` | `ask`, `dataset`, `report` |
//! | `cli` | `run`, `engine`, `run_reports`, `runs`, `images`, `picture`, `image_store`, `files`, `rooms`, `dataset`, `ask`, `enhance`, `score`, `light`, `types`, `error` |
//! | `main` | `cli`, `enhance` |

#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

mod ask;
mod calibrate;
#[doc(hidden)]
pub mod cli;
mod dataset;
mod drawing;
mod engine;
mod image_store;
mod images;
mod import;
#[doc(hidden)]
pub mod internals;
mod report;
mod run;
mod run_reports;
mod runs;
mod sentences;
mod tables;
mod text;

pub(crate) use darkqa_ground::{error, files, labels, types};
pub(crate) use darkqa_picture as picture;
pub(crate) use darkqa_scenes as rooms;
pub(crate) use darkqa_store as store;

pub use error::{Error, Result};
pub use runs::record_table::{Records, RunRecord, StoredRun};
pub use types::degradations::Kind;
pub use types::{
    Answer, Choices, Condition, Degradation, DepthKind, Digest, Family, Frame, FrameId, Intrinsics,
    Label, Labels, Question, QuestionId, Reply, Rgb, Segmentation, Severity, UnreadReason,
};

/// Degraded versions of a clean frame, as a camera would take it in less light.
pub mod synthesis {
    pub use darkqa_light::{
        Amplify, CameraModel, CameraState, NoiseKey, NoiseProfile, Sampling, Synthesis, degrade,
        develop_with_state,
    };
}

/// Enhancement of degraded images by an ONNX model.
pub mod enhance {
    pub use darkqa_enhance::{
        Enhancer, Install, MemoryLimit, ModelFile, Runtime, RuntimeSearch, Tiling, TimeLimit,
    };
}

/// Questions about a frame from its maps, by rule.
pub mod questions {
    pub use darkqa_questions::rules::Rules;
    pub use darkqa_questions::{Generated, GeneratedQuestion, QuestionRequest, generate};
}

/// Scores of replies.
pub mod score {
    /// The choice in a reply, by exact match.
    pub mod choice {
        pub use darkqa_score::choice::{ParsingMode, read, readings};
    }
}
