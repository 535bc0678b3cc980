//! `batch`: an evaluation through the files of a Batch API, which takes a day and costs half.
//!
//! What an evaluation has left to ask is written as input files into `RUN/batch/`, each trial beside it as the record that it
//! will become. The user hands the files to the API and brings its output back; until then an evaluation of the same run
//! leaves those trials alone. What failed or expired is asked again by the next export, or directly.

mod export;
mod file;
mod import;
mod replies;
pub(in crate::run) mod requests;

pub use export::export;
pub use import::import;
