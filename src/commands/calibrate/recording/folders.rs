//! Recording in folders: one folder for each setting, with the subfolders `bias`, `flat-NAME` for each exposure, and
//! optionally `dark-NAME` for the same exposures and `white`.

use std::path::{Path, PathBuf};

use super::files::{Recording, SettingFiles, TABLE};
use super::order::by_numbers;
use crate::error::{Error, Result};
use crate::files::reading::entries;

/// Names of the subfolders of a setting, for messages.
const NAMES: &str = "bias/, flat-NAME/ for each exposure, and if you have them dark-NAME/ and white/";

/// Finds the frames in a folder. Files and folders with other names are left out, with a note.
pub(super) fn read(folder: &Path) -> Result<Recording> {
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
