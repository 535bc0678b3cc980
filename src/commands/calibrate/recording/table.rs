//! Recording listed in `frames.csv`, with the columns `file`, `setting`, `kind` and `exposure`.

use std::path::Path;

use serde::Deserialize;

use super::files::{Recording, SettingFiles};
use crate::error::{Error, Result};
use crate::files::reading;

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
pub(super) fn read(folder: &Path, list: &Path) -> Result<Recording> {
    let bytes = reading::bytes(list)?;
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
