//! The episodes of a LeRobot data set: [`Episode`].

use std::path::Path;

use serde::Deserialize;

use super::info::{Info, Layout};
use crate::data::ParquetColumns;
use crate::error::{Error, Result};
use crate::files::reading::json_lines;

/// Maximum number of episodes (chosen). The largest sets have some hundred thousand.
pub(super) const MAX_EPISODES: usize = 1_000_000;

/// Largest index of an episode, chunk or file; larger ones are not exact as a float.
const MAX_INDEX: f64 = 1e15;

/// Numbers in the path of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct FilePlace {
    pub(crate) chunk: u64,
    /// Number of the file, which is that of the episode in versions 2.0 and 2.1.
    pub(crate) file: u64,
}

/// The part of a video file that shows an episode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct VideoPart {
    pub(crate) place: FilePlace,
    /// Time of the first frame of the episode in the file, in seconds.
    pub(crate) from: f64,
}

/// An episode.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Episode {
    pub(crate) index: u32,
    /// Number of frames.
    pub(crate) length: u64,
    pub(crate) data: FilePlace,
    /// Its video of each requested camera; `None` if the set does not state it.
    pub(crate) videos: Vec<Option<VideoPart>>,
}

/// A line of `meta/episodes.jsonl`.
#[derive(Deserialize)]
struct EpisodeLine {
    episode_index: u32,
    length: u64,
}

/// Reads `meta/episodes.jsonl` of versions 2.0 and 2.1, in which each episode has its own files.
pub(super) fn read_lines(path: &Path, info: &Info, cameras: usize) -> Result<Vec<Episode>> {
    let lines = json_lines::<EpisodeLine>(path)?;
    Ok(lines
        .into_iter()
        .map(|(_, line)| {
            let place = FilePlace {
                chunk: u64::from(line.episode_index) / info.chunk_size,
                file: u64::from(line.episode_index),
            };
            let video = VideoPart { place, from: 0.0 };
            Episode { index: line.episode_index, length: line.length, data: place, videos: vec![Some(video); cameras] }
        })
        .collect())
}

/// Adds the episodes in a file of `meta/episodes` of version 3.0, with the videos of these cameras.
pub(super) fn add_table(path: &Path, cameras: &[&str], episodes: &mut Vec<Episode>) -> Result<()> {
    let table = ParquetColumns::open(path)?;
    let mut columns: Vec<String> =
        ["episode_index", "length", "data/chunk_index", "data/file_index"].map(str::to_owned).to_vec();
    for camera in cameras {
        columns
            .extend(["chunk_index", "file_index", "from_timestamp"].map(|column| format!("videos/{camera}/{column}")));
    }
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    table.numbers(&columns, |batch| {
        for row in 0..batch.numbers[0].len() {
            let number = |column: usize| batch.numbers[column][row];
            let place =
                |column: usize| Some(FilePlace { chunk: index(number(column))?, file: index(number(column + 1))? });
            let episode = index(number(0)).and_then(|index| u32::try_from(index).ok());
            let (Some(index), Some(length)) = (episode, index(number(1))) else {
                let problem = "an episode without index or length";
                return Err(Error::data(path.display(), problem));
            };
            let Some(data) = place(2) else {
                let problem = format_args!("episode {index} without a data file");
                return Err(Error::data(path.display(), problem));
            };
            let videos = (0..cameras.len())
                .map(|camera| {
                    let column = 4 + 3 * camera;
                    let from = number(column + 2);
                    (0.0..=1e9).contains(&from).then_some(())?;
                    Some(VideoPart { place: place(column)?, from })
                })
                .collect();
            if episodes.len() == MAX_EPISODES {
                let problem = format_args!("more than {MAX_EPISODES} episodes, which are not read");
                return Err(Error::data(path.display(), problem));
            }
            episodes.push(Episode { index, length, data, videos });
        }
        Ok(())
    })
}

/// Converts a number to an index; `None` for NaN, negative and too large numbers, and fractions.
pub(super) fn index(number: f64) -> Option<u64> {
    ((0.0..=MAX_INDEX).contains(&number) && number.fract() == 0.0).then_some(number as u64)
}

impl Layout {
    /// The file or folder with the episodes.
    pub(super) fn episodes_path(self) -> &'static str {
        match self {
            Self::V2 => "meta/episodes.jsonl",
            Self::V3 => "meta/episodes",
        }
    }

    /// The file with the tasks.
    pub(super) fn tasks_path(self) -> &'static str {
        match self {
            Self::V2 => "meta/tasks.jsonl",
            Self::V3 => "meta/tasks.parquet",
        }
    }
}
