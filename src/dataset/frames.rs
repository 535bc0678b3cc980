//! A folder of frames.
//!
//! With a `frames.jsonl` it is the common interface: one frame a line, `{"scene", "frame", "rgb", …}`, paths relative
//! to the folder, and a frame's name is `scene/frame`. Without one, every PNG and JPEG file in the folder is a frame,
//! named by its file name. The questions lie beside them in `questions.jsonl`.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::{Dataset, Source, questions, stem};
use crate::error::{Error, Result};
use crate::types::FrameId;

/// The file that lists the frames of the common interface.
const FRAMES: &str = "frames.jsonl";
/// The questions about a folder of frames.
const QUESTIONS: &str = "questions.jsonl";

/// The keys of a line of `frames.jsonl` that an evaluation needs.
#[derive(Debug, Deserialize)]
struct Line {
    scene: String,
    frame: String,
    rgb: PathBuf,
}

pub(super) fn open(folder: &Path, questions: Option<&Path>) -> Result<Dataset> {
    let list = folder.join(FRAMES);
    let sources = if list.exists() {
        listed(folder, &list)?
    } else {
        images(folder)?
    };
    let file = questions.map_or_else(|| folder.join(QUESTIONS), Path::to_owned);
    if questions.is_none() && !file.exists() {
        let problem = format_args!(
            "no {QUESTIONS} in this folder; write one, or name one with --questions FILE"
        );
        return Err(Error::data(folder.display(), problem));
    }
    let questions = questions::read(&file)?;
    if let Some(stray) = questions
        .iter()
        .find(|question| !sources.contains_key(&question.frame))
    {
        let example = sources.keys().next().map_or("", |id| id.0.as_str());
        let problem = format_args!(
            "question {:?} is about the frame {:?}, which {} does not have (its frames are named like {example:?})",
            stray.id.0,
            stray.frame.0,
            folder.display()
        );
        return Err(Error::data(file.display(), problem));
    }
    Ok(Dataset {
        name: stem(folder),
        sources,
        questions,
    })
}

fn listed(folder: &Path, list: &Path) -> Result<BTreeMap<FrameId, Source>> {
    let text = fs::read_to_string(list).map_err(|e| Error::file(list, "read", e))?;
    let mut sources = BTreeMap::new();
    for (i, line) in text
        .lines()
        .enumerate()
        .filter(|(_, line)| !line.trim().is_empty())
    {
        let line: Line = serde_json::from_str(line).map_err(|e| Error::line(list, i + 1, e))?;
        let id = FrameId(format!("{}/{}", line.scene, line.frame));
        let path = folder.join(&line.rgb);
        if !path.is_file() {
            return Err(Error::line(
                list,
                i + 1,
                format_args!("no such file: {}", path.display()),
            ));
        }
        if sources.insert(id.clone(), Source::File(path)).is_some() {
            return Err(Error::line(
                list,
                i + 1,
                format_args!("a second frame {:?}", id.0),
            ));
        }
    }
    Ok(sources)
}

fn images(folder: &Path) -> Result<BTreeMap<FrameId, Source>> {
    let unread = |e| Error::file(folder, "read", e);
    let mut sources = BTreeMap::new();
    for entry in fs::read_dir(folder).map_err(unread)? {
        let path = entry.map_err(unread)?.path();
        let ending = path
            .extension()
            .map(|ending| ending.to_string_lossy().to_lowercase());
        if path.is_file() && matches!(ending.as_deref(), Some("png" | "jpg" | "jpeg")) {
            let name = path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            sources.insert(FrameId(name), Source::File(path));
        }
    }
    if sources.is_empty() {
        return Err(Error::data(
            folder.display(),
            format_args!("neither a {FRAMES} nor any PNG or JPEG image in this folder"),
        ));
    }
    Ok(sources)
}
