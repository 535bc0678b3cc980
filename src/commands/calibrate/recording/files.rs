//! Frames of a recording by setting and exposure: [`Recording`], [`SettingFiles`], [`ExposureFiles`].

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// Minimum number of bias frames of a setting.
pub(super) const MIN_BIAS_FRAMES: usize = 2;

/// Minimum number of exposures of a setting, each with a pair of flats.
pub(crate) const MIN_EXPOSURES: usize = 3;

/// Name of the list of frames.
pub(super) const TABLE: &str = "frames.csv";

/// All frames of a camera.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Recording {
    /// Settings, sorted by the last number in their names, then by name.
    pub(crate) settings: Vec<SettingFiles>,
    /// Notes on files and folders that are left out.
    pub(crate) notes: Vec<String>,
}

/// Frames of one setting of the camera's gain, such as ISO 800.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct SettingFiles {
    pub(crate) name: String,
    /// Frames without light at the shortest exposure.
    pub(crate) bias: Vec<PathBuf>,
    /// Evenly lit frames by exposure.
    pub(crate) exposures: Vec<ExposureFiles>,
    /// Overexposed frames.
    pub(crate) white: Vec<PathBuf>,
}

/// Frames of one exposure.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct ExposureFiles {
    pub(crate) name: String,
    /// Evenly lit frames, in consecutive pairs.
    pub(crate) flats: Vec<PathBuf>,
    /// Frames of the same exposure without light.
    pub(crate) dark: Vec<PathBuf>,
}

impl SettingFiles {
    /// Last number in the name, such as 800 in `a7s2-iso800`; `None` without a number.
    pub(crate) fn number(&self) -> Option<f64> {
        let end = self.name.rfind(|c: char| c.is_ascii_digit())? + 1;
        let start = self.name[..end].rfind(|c: char| !c.is_ascii_digit() && c != '.');
        // The character before the number may have several bytes.
        let before = start.and_then(|start| Some(start + self.name[start..].chars().next()?.len_utf8()));
        self.name[before.unwrap_or(0)..end].trim_start_matches('.').parse().ok()
    }

    /// Exposure of this name; adds it if it is new.
    pub(super) fn exposure_mut(&mut self, name: &str) -> &mut ExposureFiles {
        let known = self.exposures.iter().position(|known| known.name == name);
        let index = known.unwrap_or(self.exposures.len());
        if known.is_none() {
            self.exposures.push(ExposureFiles { name: name.to_owned(), ..ExposureFiles::default() });
        }
        &mut self.exposures[index]
    }

    /// Removes flats without a partner, single dark frames, and exposures without flats, with notes.
    ///
    /// # Errors
    /// If too few frames are left.
    pub(super) fn pair_up(&mut self, folder: &Path, notes: &mut Vec<String>) -> Result<()> {
        let place = folder.join(&self.name);
        for exposure in &mut self.exposures {
            if exposure.flats.len() % 2 == 1
                && let Some(odd) = exposure.flats.pop()
            {
                notes.push(format!("{}: without a partner in its pair, left out", odd.display()));
            }
            if exposure.dark.len() == 1 {
                let one = exposure.dark[0].display();
                notes.push(format!("{one}: at least 2 dark frames are needed, left out"));
                exposure.dark.clear();
            }
            if exposure.flats.is_empty() && !exposure.dark.is_empty() {
                notes.push(format!(
                    "{}: dark frames of {}, an exposure without flats, left out",
                    place.display(),
                    exposure.name
                ));
            }
        }
        self.exposures.retain(|exposure| !exposure.flats.is_empty());
        let (bias, exposures) = (self.bias.len(), self.exposures.len());
        if bias < MIN_BIAS_FRAMES || exposures < MIN_EXPOSURES {
            return Err(Error::data(
                place.display(),
                format_args!(
                    "{bias} bias frames and {exposures} exposures with a pair of flats; at least {MIN_BIAS_FRAMES} and {MIN_EXPOSURES} are needed, 10 bias frames and 5 exposures of 2 pairs are better"
                ),
            ));
        }
        Ok(())
    }
}
