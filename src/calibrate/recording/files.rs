//! The frames of a recording by setting and exposure: [`Recording`], [`SettingFiles`], [`ExposureFiles`].

use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// Least number of bias frames of a setting, and least number of exposures of flats, each with a pair.
pub(in super::super) const LEAST: [usize; 2] = [2, 3];

/// The name of the list of frames.
pub(super) const TABLE: &str = "frames.csv";

/// All frames of a camera.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Recording {
    /// The settings, in the order of the last numbers in their names, then of the names.
    pub(in super::super) settings: Vec<SettingFiles>,
    /// Lines about files and folders that are left out.
    pub(in super::super) notes: Vec<String>,
}

/// The frames of one setting of the camera's gain, such as ISO 800.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(in super::super) struct SettingFiles {
    pub(in super::super) name: String,
    /// Frames without light at the shortest exposure.
    pub(in super::super) bias: Vec<PathBuf>,
    /// Evenly lit frames by exposure.
    pub(in super::super) exposures: Vec<ExposureFiles>,
    /// Overexposed frames.
    pub(in super::super) white: Vec<PathBuf>,
}

/// The frames of one exposure.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(in super::super) struct ExposureFiles {
    pub(in super::super) name: String,
    /// Evenly lit frames; the first and the second are a pair, and so on.
    pub(in super::super) flats: Vec<PathBuf>,
    /// Frames of the same exposure without light.
    pub(in super::super) dark: Vec<PathBuf>,
}

impl SettingFiles {
    /// The last number in the name, as 800 in `a7s2-iso800`; `None` if there is none.
    pub(in super::super) fn number(&self) -> Option<f64> {
        let end = self.name.rfind(|c: char| c.is_ascii_digit())? + 1;
        let start = self.name[..end].rfind(|c: char| !c.is_ascii_digit() && c != '.');
        // A character before the number may have several bytes.
        let before =
            start.and_then(|start| Some(start + self.name[start..].chars().next()?.len_utf8()));
        self.name[before.unwrap_or(0)..end]
            .trim_start_matches('.')
            .parse()
            .ok()
    }

    /// The exposure of this name, which is added if it is new.
    pub(super) fn exposure(&mut self, name: &str) -> &mut ExposureFiles {
        let known = self.exposures.iter().position(|known| known.name == name);
        let index = known.unwrap_or(self.exposures.len());
        if known.is_none() {
            self.exposures.push(ExposureFiles {
                name: name.to_owned(),
                ..ExposureFiles::default()
            });
        }
        &mut self.exposures[index]
    }
}

impl SettingFiles {
    /// Takes out flats without a partner, and checks that enough frames are left.
    pub(super) fn pair_up(&mut self, folder: &Path, notes: &mut Vec<String>) -> Result<()> {
        let place = folder.join(&self.name);
        for exposure in &mut self.exposures {
            if exposure.flats.len() % 2 == 1
                && let Some(odd) = exposure.flats.pop()
            {
                notes.push(format!(
                    "{}: without a partner in its pair, left out",
                    odd.display()
                ));
            }
            if exposure.dark.len() == 1 {
                let one = exposure.dark[0].display();
                notes.push(format!(
                    "{one}: at least 2 dark frames are needed, left out"
                ));
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
        let [bias, exposures] = LEAST;
        let found = [self.bias.len(), self.exposures.len()];
        if found[0] < bias || found[1] < exposures {
            return Err(Error::data(
                place.display(),
                format_args!(
                    "{} bias frames and {} exposures with a pair of flats; at least {bias} and {exposures} are needed, 10 bias frames and 5 exposures of 2 pairs are better",
                    found[0], found[1]
                ),
            ));
        }
        Ok(())
    }
}
