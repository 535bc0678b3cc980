//! Measures how well a vision-language model sees in the dark.
//!
//! From well-lit indoor frames it makes low-light versions (levels L0–L5 or any exposure drop, each by exposure drop
//! alone and with the noise of a sensor; or as a camera with automatic exposure takes them, or blurred by its motion),
//! enhances them with any low-light model given as ONNX, asks OpenAI-compatible endpoints questions about each image,
//! scores the replies, and compares all of it.
//!
//! # The library
//!
//! The program `darkqa-eval` does all of this from the command line. The library has the pieces that other programs
//! use: [`synthesis`], [`enhance`], [`questions`], [`score::choice`] and [`StoredRun`]; their vocabulary is at the
//! root.
//!
//! Degrade a frame. The noise follows from the seed and the name of the frame, so that the same call gives the same
//! image:
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
//! Read a reply and score it. The strict parsing takes the exact words of a choice alone, the lenient one finds them in
//! a sentence:
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
//! Twelve rooms, in the order of the data. A room is a folder of `src` and a crate of its own, so that it builds beside
//! others, and again only after a change below it; `commands` is a part of this crate. The main arrows; the table below
//! has all:
//!
//! ```text
//! base ─┬─ pictures ─┬─ data ──────────┐
//!       ├─ light ────┤                 ├─ engine ─┐
//!       ├─ questions ┤    enhance ─────┤          ├─ commands
//!       ├─ ask ──────┼─────────────────┘          │
//!       └─ score ────┴─ runs ─── report ──────────┘
//! ```
//!
//! | room | |
//! |---|---|
//! | `base` | the one error type; files read with bounds and written whole; the label spaces NYU40, mpcat40, ADE150 and NYU13; the vocabulary of a trial |
//! | `pictures` | image files with their colour profiles and orientation, maps of numbers, scaling, and images encoded for a request |
//! | `light` | a clean image × a degradation → a degraded one, given a noise key; `light/python` is the Python module `darkqa_light` |
//! | `data` | a folder, a ready-made set or the built-in rooms (`data/rooms`, drawn by a seed) → images, their maps and questions; `data/import`: other data sets, recordings of robots and videos → frames |
//! | `questions` | a frame with its maps → questions with one true answer, by rule; the observer: what the rules could still answer from given pixels |
//! | `enhance` | a degraded image → an enhanced one, by the user's ONNX model; `models` has the networks that the program carries |
//! | `ask` | a prompt and images → a reply; `ask/wire`: the APIs of endpoints, their requests and replies; `prompts` has the prompts that the program carries |
//! | `score` | `score/choice`: a reply → a choice, a mark or a text; `score/statistics`: estimates, tests and thresholds of clustered replies; records → numbers with their intervals |
//! | `runs` | what is on disk: `runs/store`, the append-only folder of a run; shards and their merge; records as a table; `runs/python` reads it |
//! | `report` | records → `report/sentences`, `report/tables`, `report/charts`, the page and its files; `report/joined`: of one run or several |
//! | `engine` | a `Job` carries out an `Experiment`: it plans, has images made (`engine/images`, kept in `engine/image_cache`), asks, keeps, and has the experiment score |
//! | `commands` | one file or folder a command; `commands/evaluate` and `commands/openeqa` are the two experiments. `commands/cli`: a flag is a field of a structure in the room that uses it, in that room's own types; the environment and a file of flags are turned into words, and all words are parsed once |
//!
//! A [`Frame`] is seen, a [`Question`] is asked, a [`Degradation`] is what was done to a frame, a [`Condition`] is a
//! degradation with or without an enhancer, a [`Reply`] is what a model sent, and a `Record` is the result
//! of one trial: one question to one model in one condition. `internals` is what benchmarks and tests of this
//! repository use besides.
//!
//! # Where to add what
//!
//! `CONTRIBUTING.md` has a checklist for each kind of change: a flag, a format to import, a kind of degradation, an API
//! or a vendor of endpoints, a rule of reading replies, a statistic, an experiment and others.
//!
//! # What must hold
//!
//! - The same inputs and seed give the same bytes, whatever the threads, order, shard or resume: a random draw is a
//!   function of where it is used, never of when.
//! - What was paid for is on disk before anything else happens, and is never asked again.
//! - No reply is guessed at: what cannot be read is counted apart, what failed is not scored.
//! - A key reaches no log, no file and no message.
//! - What decides a reply is in the key of its trial; a run's identity holds only what all trials share and no column
//!   tells apart.
//!
//! # Who may import whom
//!
//! `tests/program/architecture/` reads this table and fails on a breach. No file of `commands` but the command line
//! uses another command's, and files import each other in no circles but those that `tests/program/architecture/mod.rs`
//! lists with a reason.
//!
//! | room | may use |
//! |---|---|
//! | `base` | nothing |
//! | `pictures` | `base` |
//! | `light` | `base` |
//! | `data` | `base`, `pictures` |
//! | `questions` | `base` |
//! | `enhance` | `base`, `light` |
//! | `ask` | `base`, `pictures` |
//! | `score` | `base` |
//! | `runs` | `base`, `data`, `enhance`, `ask`, `score` |
//! | `report` | `base`, `questions`, `ask`, `score`, `runs` |
//! | `engine` | `base`, `pictures`, `light`, `data`, `questions`, `enhance`, `ask`, `score`, `runs`, `report` |
//! | `commands` | `base`, `pictures`, `light`, `data`, `questions`, `enhance`, `ask`, `score`, `runs`, `report`, `engine` |
//! | `internals` | `data`, `ask`, `report` |
//! | `main` | `enhance`, `commands` |

#![cfg_attr(test, allow(clippy::unwrap_used, reason = "a test may panic"))]

mod commands;
#[doc(hidden)]
pub mod internals;

#[doc(hidden)]
pub use commands::cli;

pub use darkqa_base::error::{Error, Result};
pub use darkqa_base::types::degradations::Kind;
pub use darkqa_base::types::{
    Answer, Choices, Condition, Degradation, DepthKind, Digest, Family, Frame, FrameId, Intrinsics, Label, Labels,
    Question, QuestionId, Reply, Rgb, Segmentation, Severity, UnreadReason,
};
pub use darkqa_runs::record_table::{Records, RunRecord, StoredRun};

/// Degraded versions of a clean frame, as a camera would take it in less light.
pub mod synthesis {
    pub use darkqa_light::{
        Amplify, CameraModel, CameraState, NoiseKey, NoiseProfile, Sampling, Synthesis, degrade, develop_with_state,
    };
}

/// Enhancement of degraded images by an ONNX model.
pub mod enhance {
    pub use darkqa_enhance::{Enhancer, Install, MemoryLimit, ModelFile, Runtime, RuntimeSearch, Tiling, TimeLimit};
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
