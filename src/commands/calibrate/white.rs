//! Code of white from overexposed frames: [`white_code`].

use std::path::{Path, PathBuf};

use super::batches::in_batches;
use super::frames::FrameReader;
use super::inputs::Inputs;
use super::mosaic::FrameFacts;
use super::recording::Recording;
use crate::error::{Error, Result};

/// Minimum share of the samples of an overexposed frame at its maximum code (chosen).
const MIN_AT_WHITE: f64 = 0.5;

/// Maximum code of all overexposed frames.
///
/// # Errors
/// If no such frame exists, a frame is not overexposed, or their maximum codes differ.
pub(super) fn white_code(
    reader: &FrameReader,
    recording: &Recording,
    folder: &Path,
    inputs: &mut Inputs,
) -> Result<u16> {
    let files: Vec<&PathBuf> = recording.settings.iter().flat_map(|setting| &setting.white).collect();
    let mut white: Option<(u16, &PathBuf)> = None;
    in_batches(
        &files,
        reader.bytes_of_frame(),
        |path| top_code(reader, path),
        |path, (top, facts)| {
            inputs.add(path, &facts);
            match white {
                Some((known, first)) if known != top => {
                    let problem = format!(
                        "white is {top}, but {known} in {}: state one code of white with --white",
                        first.display()
                    );
                    Err(Error::data(path.display(), problem))
                }
                _ => {
                    white = Some((top, path));
                    Ok(())
                }
            }
        },
    )?;
    let problem = "the code of white is not known: state it with --white, or add overexposed frames in SETTING/white/";
    white.map_or_else(|| Err(Error::data(folder.display(), problem)), |(code, _)| Ok(code))
}

/// Maximum code of an overexposed frame, with the facts of its file.
fn top_code(reader: &FrameReader, path: &Path) -> Result<(u16, FrameFacts)> {
    let frame = reader.read(path)?;
    let top = frame.samples.iter().copied().max().unwrap_or(0);
    let with_it = frame.samples.iter().filter(|sample| **sample == top).count();
    let share = with_it as f64 / frame.samples.len() as f64;
    if share < MIN_AT_WHITE {
        let problem = format!(
            "{:.1} % of the samples are at the greatest code, {top}, and a frame in white/ needs {:.0} %: overexpose it more, or state the code of white with --white",
            100.0 * share,
            100.0 * MIN_AT_WHITE
        );
        return Err(Error::data(path.display(), problem));
    }
    Ok((top, frame.facts))
}
