//! Rows of the data files of a LeRobot data set: [`read`].

use std::path::Path;

use super::episodes::index;
use crate::data::ParquetColumns;
use crate::error::Result;

/// A row of a data file: one time of an episode. Small, because there are millions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DataRow {
    /// Index of the episode.
    pub(crate) episode: u32,
    /// Number in the episode, from 0.
    pub(crate) frame: u32,
    /// Seconds from the start of the episode.
    pub(crate) time: f64,
    /// Number of the task.
    pub(crate) task: Option<u32>,
    /// Row group.
    pub(crate) group: u32,
    /// Index of the row in its row group.
    pub(crate) row: u32,
}

/// Columns of a data file that are read, in the order of [`DataRow`].
const COLUMNS: [&str; 4] = ["episode_index", "frame_index", "timestamp", "task_index"];

/// Reads the rows of a data file in order. Rows without a number of episode, frame or time are counted, and not given
/// to `add`.
///
/// # Errors
/// If the file cannot be read or is damaged.
pub(super) fn read(path: &Path, mut add: impl FnMut(DataRow)) -> Result<usize> {
    let table = ParquetColumns::open(path)?;
    let has_tasks = table.names().contains(&COLUMNS[3]);
    let columns = if has_tasks { &COLUMNS[..] } else { &COLUMNS[..3] };
    let mut unread = 0;
    table.numbers(columns, |batch| {
        for row in 0..batch.numbers[0].len() {
            let number = |column: usize| batch.numbers[column][row];
            let time = Some(number(2)).filter(|time| (0.0..=1e9).contains(time));
            let small = |column: usize| u32::try_from(index(number(column))?).ok();
            match (small(0), small(1), time) {
                (Some(episode), Some(frame), Some(time)) => add(DataRow {
                    episode,
                    frame,
                    time,
                    task: has_tasks.then(|| small(3)).flatten(),
                    group: batch.group as u32,
                    row: (batch.first_row + row) as u32,
                }),
                _ => unread += 1,
            }
        }
        Ok(())
    })?;
    Ok(unread)
}
