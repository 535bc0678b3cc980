//! LeRobot data sets, versions 2.0 to 3.0: episodes of robots with the images of their cameras.
//!
//! ```text
//! meta/info.json ─ Info: version, frames per second, cameras, patterns of paths
//! meta/episodes, tasks ─ LeRobotSet ─ Episode: its data file, and its video of each camera
//! data/…parquet ─ rows ─ DataRow: episode, time, task
//! ```
//!
//! The input is untrusted: paths from patterns lead to no file outside the folder, and numbers of rows are limited.

mod episodes;
mod info;
mod path_pattern;
mod rows;
mod set;

pub(crate) use episodes::{Episode, FilePlace};
pub(crate) use info::{Camera, ImageForm};
pub(crate) use rows::DataRow;
pub(crate) use set::LeRobotSet;
