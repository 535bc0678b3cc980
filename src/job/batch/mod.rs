//! A run through the files of a Batch API, which takes a day and costs half.
//!
//! What is left to ask is written as input files into `RUN/batch/`, each trial beside it as the record that it will become. The user
//! hands the files to the API and brings its output back; until then the run leaves those trials alone. What failed or expired is
//! asked again by the next export, or directly.

pub(super) mod export;
mod file;
pub(crate) mod replies;
mod requests;
