//! The MCAP files of a recording: [`files`], [`open_reader`] and the [`overview`] of their topics.

use std::fs::File;
use std::path::{Path, PathBuf};

use super::frame_writer::COPIED;
use crate::dataset::Root;
use crate::error::{Error, Result};
use crate::files::reading::{entries, open};
use crate::images::progress::Progress;
use crate::import::recording::{COMPRESSED_FILE, McapReader, Overview, SQLITE_BAG};
use crate::picture::ImageFile;
use crate::picture::decode_rule::DecodeRule;

/// Replaces folders by the MCAP files in them, in the order of their numbers.
pub(super) fn files(paths: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for path in paths {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let is_mcap = |file: &PathBuf| file.extension().is_some_and(|ending| ending == "mcap");
        let mut links_out = Vec::new();
        let mut inside = Root::new(path, &[])?.entries(path, &mut links_out)?;
        if let Some(link) = links_out.into_iter().find(is_mcap) {
            let problem = "this link leads out of the folder of the recording; name the file itself to read it";
            return Err(Error::data(link.display(), problem));
        }
        inside.retain(is_mcap);
        if inside.is_empty() {
            return Err(Error::data(path.display(), no_mcap_problem(path)?));
        }
        inside.sort_by_cached_key(|file| {
            let stem = file
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            let name = stem
                .trim_end_matches(|c: char| c.is_ascii_digit())
                .to_owned();
            let number: u64 = stem[name.len()..].parse().unwrap_or(0);
            (name, number, stem)
        });
        files.extend(inside);
    }
    Ok(files)
}

/// The message for a folder without MCAP files.
fn no_mcap_problem(folder: &Path) -> Result<&'static str> {
    let files = entries(folder)?;
    Ok(if has_ending(&files, "db3") {
        SQLITE_BAG
    } else if has_ending(&files, "zstd") || has_ending(&files, "zst") {
        COMPRESSED_FILE
    } else {
        "no .mcap file in this folder"
    })
}

fn has_ending(files: &[PathBuf], ending: &str) -> bool {
    files
        .iter()
        .any(|file| file.extension().is_some_and(|own| own == ending))
}

/// Total size of files, in bytes.
pub(super) fn total_bytes(files: &[PathBuf]) -> u64 {
    files
        .iter()
        .filter_map(|file| file.metadata().ok())
        .map(|metadata| metadata.len())
        .sum()
}

pub(super) fn open_reader(path: &Path) -> Result<McapReader<File>> {
    let file = open(path).map_err(|e| Error::file(path, "read", e))?;
    McapReader::open(file).map_err(|problem| Error::data(path.display(), problem))
}

/// The topics of all files.
pub(super) fn overview(files: &[PathBuf], progress: &Progress) -> Result<Overview> {
    let bar = progress.bar("files", files.len());
    let mut overview = Overview::default();
    for file in files {
        bar.inc();
        let reader = match open_reader(file) {
            Ok(reader) => reader,
            Err(e) if files.len() == 1 => return Err(e),
            Err(e) => {
                overview.problems.push(e.to_string());
                continue;
            }
        };
        overview.add(&file.display().to_string(), reader, image_size);
    }
    Ok(overview)
}

/// Width and height of an image file in a message.
fn image_size(bytes: &[u8]) -> Result<(u32, u32), String> {
    let name = "the first image".to_owned();
    let file = ImageFile::new(bytes.to_vec(), name, DecodeRule::default());
    let ending = file.extension();
    if !COPIED.contains(&ending) {
        return Err(format!("a file .{ending}; JPEG, PNG or WebP expected"));
    }
    file.check().map_err(|e| e.to_string())
}
