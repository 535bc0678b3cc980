//! Files of a recording, by setting and exposure: [`Recording`], from folders or from the list `frames.csv`.

mod files;
mod folders;
mod order;
mod table;

use std::path::{Path, PathBuf};

use crate::error::Result;
pub(crate) use files::Recording;
use files::TABLE;
pub(super) use files::{ExposureFiles, MIN_EXPOSURES, SettingFiles};
use order::by_numbers;

impl Recording {
    /// Finds the frames of a recording: from the list `frames.csv` if it exists, otherwise by the names of subfolders.
    ///
    /// # Errors
    /// If the folder cannot be read, or a setting has too few frames.
    pub(crate) fn open(folder: &Path) -> Result<Self> {
        let list = folder.join(TABLE);
        let mut recording = if list.exists() { table::read(folder, &list)? } else { folders::read(folder)? };
        recording.settings.sort_by(|a, b| {
            let [number, other] = [a, b].map(|setting| setting.number().unwrap_or(f64::INFINITY));
            number.total_cmp(&other).then_with(|| by_numbers(&a.name, &b.name))
        });
        for setting in &mut recording.settings {
            setting.pair_up(folder, &mut recording.notes)?;
        }
        Ok(recording)
    }

    /// First bias frame of the first setting.
    pub(super) fn first(&self) -> &Path {
        self.settings.iter().find_map(|setting| setting.bias.first()).map_or(Path::new(""), PathBuf::as_path)
    }

    /// Number of settings.
    pub(crate) fn settings(&self) -> usize {
        self.settings.len()
    }
}

#[cfg(test)]
mod tests;
