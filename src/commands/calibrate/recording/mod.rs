//! Files of a recording, by setting and exposure: [`Recording`], from folders or from the list `frames.csv`.
//!
//! Frames of a recording by setting and exposure: [`Recording`], [`SettingFiles`], [`ExposureFiles`].
//!
//! Recording in folders: one folder for each setting, with the subfolders `bias`, `flat-NAME` for each exposure, and
//! optionally `dark-NAME` for the same exposures and `white`.
//!
//! Recording listed in `frames.csv`, with the columns `file`, `setting`, `kind` and `exposure`.
//!
//! Natural sort order of names with numbers: [`by_numbers`].

#[cfg(test)]
mod tests;

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, entries};

impl Recording {
    /// Finds the frames of a recording: from the list `frames.csv` if it exists, otherwise by the names of subfolders.
    ///
    /// # Errors
    /// If the folder cannot be read, or a setting has too few frames.
    pub(crate) fn open(folder: &Path) -> Result<Self> {
        let list = folder.join(TABLE);
        let mut recording = if list.exists() { read_table(folder, &list)? } else { read_folders(folder)? };
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

/// Minimum number of bias frames of a setting.
const MIN_BIAS_FRAMES: usize = 2;

/// Minimum number of exposures of a setting, each with a pair of flats.
pub(super) const MIN_EXPOSURES: usize = 3;

/// Name of the list of frames.
const TABLE: &str = "frames.csv";

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
    fn exposure_mut(&mut self, name: &str) -> &mut ExposureFiles {
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
    fn pair_up(&mut self, folder: &Path, notes: &mut Vec<String>) -> Result<()> {
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

/// Names of the subfolders of a setting, for messages.
const NAMES: &str = "bias/, flat-NAME/ for each exposure, and if you have them dark-NAME/ and white/";

/// Finds the frames in a folder. Files and folders with other names are left out, with a note.
fn read_folders(folder: &Path) -> Result<Recording> {
    let mut recording = Recording { settings: Vec::new(), notes: Vec::new() };
    for path in visible(folder)? {
        if !path.is_dir() {
            let problem = "no folder of a setting, left out";
            recording.notes.push(format!("{}: {problem}", path.display()));
            continue;
        }
        let setting = setting(&path, &mut recording.notes)?;
        recording.settings.push(setting);
    }
    if recording.settings.is_empty() {
        let problem = format!(
            "no folder of a setting in it; expected: DIR/SETTING/ (such as DIR/iso800/), in it {NAMES}; or a list DIR/{TABLE}"
        );
        return Err(Error::data(folder.display(), problem));
    }
    Ok(recording)
}

/// Finds the frames of a setting.
fn setting(folder: &Path, notes: &mut Vec<String>) -> Result<SettingFiles> {
    let mut setting = SettingFiles { name: name(folder), ..SettingFiles::default() };
    let mut found = 0;
    for path in visible(folder)? {
        let Some(frames) = frames_mut(&mut setting, &path) else {
            let problem = format!("none of {NAMES}; left out");
            notes.push(format!("{}: {problem}", path.display()));
            continue;
        };
        *frames = visible(&path)?;
        found += 1;
    }
    if found == 0 {
        let problem = format!("no frames of a setting; expected in it: {NAMES}");
        return Err(Error::data(folder.display(), problem));
    }
    Ok(setting)
}

/// List for the frames of a subfolder, by its name; `None` for a file or another name.
fn frames_mut<'a>(setting: &'a mut SettingFiles, path: &Path) -> Option<&'a mut Vec<PathBuf>> {
    let kind = name(path);
    if !path.is_dir() {
        return None;
    }
    match (kind.strip_prefix("flat-"), kind.strip_prefix("dark-")) {
        (Some(exposure), _) => Some(&mut setting.exposure_mut(exposure).flats),
        (_, Some(exposure)) => Some(&mut setting.exposure_mut(exposure).dark),
        _ if kind == "bias" => Some(&mut setting.bias),
        _ if kind == "white" => Some(&mut setting.white),
        _ => None,
    }
}

/// Files and folders in a folder, sorted by name, without hidden ones.
fn visible(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = entries(folder)?;
    paths.retain(|path| !name(path).starts_with('.'));
    paths.sort_by(|a, b| by_numbers(&name(a), &name(b)));
    Ok(paths)
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Row of the list.
#[derive(Deserialize)]
struct FrameRow {
    /// Path of the frame, relative to the folder of the list.
    file: String,
    setting: String,
    kind: FrameKind,
    /// Name of the exposure of a flat or dark frame.
    #[serde(default)]
    exposure: String,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum FrameKind {
    Bias,
    Flat,
    Dark,
    White,
}

/// Reads a list of frames in `folder`.
fn read_table(folder: &Path, list: &Path) -> Result<Recording> {
    let bytes = files::bytes(list)?;
    let mut reader = csv::ReaderBuilder::new();
    let mut reader = reader.trim(csv::Trim::All).from_reader(&*bytes);
    let mut settings: Vec<SettingFiles> = Vec::new();
    // The header is line 1.
    for (number, line) in (2..).zip(reader.deserialize::<FrameRow>()) {
        let line = line.map_err(|e| {
            let problem = format!(
                "{}; columns file, setting, kind (bias, flat, dark or white) and exposure expected",
                message_without_position(&e)
            );
            Error::line(list, number, problem)
        })?;
        let path = folder.join(&line.file);
        if !path.is_file() {
            let problem = format!("{}: no such file", path.display());
            return Err(Error::line(list, number, problem));
        }
        let is_lit = matches!(line.kind, FrameKind::Flat | FrameKind::Dark);
        if is_lit && line.exposure.is_empty() {
            let problem = "a flat or dark frame needs the name of its exposure";
            return Err(Error::line(list, number, problem));
        }
        let known = settings.iter().position(|known| known.name == line.setting);
        let index = known.unwrap_or_else(|| {
            settings.push(SettingFiles { name: line.setting.clone(), ..SettingFiles::default() });
            settings.len() - 1
        });
        let setting = &mut settings[index];
        match line.kind {
            FrameKind::Bias => setting.bias.push(path),
            FrameKind::White => setting.white.push(path),
            FrameKind::Flat => setting.exposure_mut(&line.exposure).flats.push(path),
            FrameKind::Dark => setting.exposure_mut(&line.exposure).dark.push(path),
        }
    }
    if settings.is_empty() {
        return Err(Error::data(list.display(), "no frames in the list"));
    }
    Ok(Recording { settings, notes: Vec::new() })
}

/// Message of a parse error, without the position that the parser adds.
fn message_without_position(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::Deserialize { err, .. } => err.kind().to_string(),
        _ => error.to_string(),
    }
}

/// Compares names in natural order: `2.tif` comes before `10.tif`. Runs of digits are compared by value, other
/// characters as text. Names that differ only in leading zeros are compared as text.
fn by_numbers(a: &str, b: &str) -> Ordering {
    let (mut left, mut right) = (a, b);
    while !left.is_empty() && !right.is_empty() {
        let (first, second);
        (first, left) = split(left);
        (second, right) = split(right);
        let order = match (value(first), value(second)) {
            (Some(first), Some(second)) => (first.len(), first).cmp(&(second.len(), second)),
            _ => first.cmp(second),
        };
        if order.is_ne() {
            return order;
        }
    }
    (left.len(), a).cmp(&(right.len(), b))
}

/// Splits a name after its first run of digits or of other characters.
fn split(name: &str) -> (&str, &str) {
    let begins_with_digit = name.starts_with(|c: char| c.is_ascii_digit());
    let end = name.find(|c: char| c.is_ascii_digit() != begins_with_digit);
    name.split_at(end.unwrap_or(name.len()))
}

/// Digits of a run without leading zeros; `None` for other characters. Their number and then their text give the order
/// of values.
fn value(run: &str) -> Option<&str> {
    let is_number = run.starts_with(|c: char| c.is_ascii_digit());
    is_number.then(|| run.trim_start_matches('0'))
}
