//! The MCAP files of a recording: [`files`], [`open_reader`] and the [`overview`] of their topics.

use std::fs::File;
use std::path::{Path, PathBuf};

use super::conversion::conversion;
use super::frame_writer::COPIED;
use crate::data::Root;
use crate::data::import::recording::{FileImage, ForeignData, McapReader, Overview};
use crate::engine::images::progress::Progress;
use crate::error::{Error, Result};
use crate::files::reading::open;
use crate::pictures::ImageFile;
use crate::pictures::decode_rule::DecodeRule;

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
            let problem = conversion(path);
            let problem = problem.unwrap_or_else(|| "no .mcap file in this folder".to_owned());
            return Err(Error::data(path.display(), problem));
        }
        inside.sort_by_cached_key(|file| {
            let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let name = stem.trim_end_matches(|c: char| c.is_ascii_digit()).to_owned();
            let number: u64 = stem[name.len()..].parse().unwrap_or(0);
            (name, number, stem)
        });
        files.extend(inside);
    }
    Ok(files)
}

/// A topic as part of a file name.
pub(super) fn slug(topic: &str) -> String {
    let name: String =
        topic.chars().map(|c| if c.is_alphanumeric() || matches!(c, '-' | '.') { c } else { '_' }).collect();
    name.trim_matches(['_', '.']).to_owned()
}

/// The name of a drive: the stem of its first file, without the number that bags append.
pub(super) fn drive_name(file: &Path) -> String {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let name = slug(stem.strip_suffix("_0").unwrap_or(&stem));
    if name.is_empty() { "drive".to_owned() } else { name }
}

/// Total size of files, in bytes.
pub(super) fn total_bytes(files: &[PathBuf]) -> u64 {
    files.iter().filter_map(|file| file.metadata().ok()).map(|metadata| metadata.len()).sum()
}

pub(super) fn open_reader(path: &Path) -> Result<McapReader<File>> {
    let file = open(path).map_err(|e| Error::file(path, "read", e))?;
    McapReader::open(file).map_err(|problem| {
        let problem = conversion(path).unwrap_or(problem);
        Error::data(path.display(), problem)
    })
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
        overview.add(&file.display().to_string(), reader, file_image);
    }
    Ok(overview)
}

/// The image file in a message with this format.
fn file_image(format: &str, bytes: &[u8]) -> FileImage {
    let name = "an image".to_owned();
    let file = ImageFile::new(bytes.to_vec(), name, DecodeRule::default());
    let ending = file.extension();
    if !COPIED.contains(&ending) {
        let kind = ForeignData::detect(format, bytes, ending);
        let words = kind.words(format);
        return match kind {
            ForeignData::Video(_) => FileImage::Video(words),
            _ => FileImage::Unread(words),
        };
    }
    match file.check() {
        Ok((width, height)) => FileImage::Readable([width, height]),
        Err(Error::Data { problem, .. }) => FileImage::Unread(problem),
        Err(other) => FileImage::Unread(other.to_string()),
    }
}
