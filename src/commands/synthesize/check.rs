//! `synthesize check`: compares images with the digests in their JSON files.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::data::image_paths::is_image;
use crate::engine::images::stored::OutputFile;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::report::text::words::first_names;
use crate::runs::Outcome;

/// Schemas of JSON files with the digest of an image. Other JSON files are ignored.
const SCHEMAS: [&str; 3] = ["darkqa.image/1", "darkqa.image/2", "darkqa.sheet/1"];

/// Maximum number of images without a JSON file that are named; chosen.
const MAX_NAMED: usize = 3;

/// Checks that each image in a folder has a JSON file and the digest in it. Nothing is changed.
///
/// # Errors
/// If the folder cannot be read, or has no JSON file of an image.
pub(super) fn check(folder: &Path) -> Result<Outcome> {
    let entries = fs::read_dir(folder).map_err(|e| Error::file(folder, "read", e))?;
    let files: std::io::Result<Vec<PathBuf>> = entries.map(|entry| Ok(entry?.path())).collect();
    let mut files = files.map_err(|e| Error::file(folder, "read", e))?;
    files.sort();
    let (mut intact, mut wrong) = (0, 0);
    let mut unknown: BTreeSet<String> = files
        .iter()
        .filter(|file| is_image(file))
        .filter_map(|file| Some(file.file_name()?.to_string_lossy().into_owned()))
        .collect();
    for file in files.iter().filter(|file| file.extension().is_some_and(|end| end == "json")) {
        match read_output(file) {
            Ok(Some(output)) => {
                unknown.remove(&output.file);
                match check_image(file, &output) {
                    Ok(()) => intact += 1,
                    Err(e) => {
                        tracing::error!("{e}");
                        wrong += 1;
                    }
                }
            }
            Ok(None) => {}
            Err(e) => {
                // The image has a JSON file, although an unusable one.
                unknown.retain(|image| Path::new(image).file_stem() != file.file_stem());
                tracing::error!("{e}");
                wrong += 1;
            }
        }
    }
    if intact + wrong == 0 {
        let problem = "no JSON file of an image of `synthesize` is in it";
        return Err(Error::data(folder.display(), problem));
    }
    if !unknown.is_empty() {
        let unknown: Vec<String> = unknown.iter().cloned().collect();
        tracing::error!(
            "{}: no JSON file says how they were made: {}",
            folder.display(),
            first_names(&unknown, MAX_NAMED)
        );
    }
    Ok(Outcome::text(
        Outcome::complete_if(wrong == 0 && unknown.is_empty()),
        format!(
            "{}: images as they were written: {intact}; not as they were written: {wrong}; without a JSON file: {}\n",
            folder.display(),
            unknown.len()
        ),
    ))
}

/// The fields of a JSON file that are checked, in all schemas.
#[derive(Deserialize)]
struct SidecarOutput {
    schema: String,
    output: Option<OutputFile>,
}

/// Reads the file name and digest of the image of a JSON file; `None` for a JSON file with another schema.
///
/// # Errors
/// If the JSON file has no digest of its image, or names an image outside of its folder.
fn read_output(file: &Path) -> Result<Option<OutputFile>> {
    let text = reading::text(file)?;
    let Ok(sidecar) = serde_json::from_str::<SidecarOutput>(&text) else {
        return Ok(None);
    };
    if !SCHEMAS.contains(&&*sidecar.schema) {
        return Ok(None);
    }
    let Some(output) = sidecar.output else {
        return Err(Error::data(
            file.display(),
            "has no digest of its image: an older version wrote it; run `synthesize` again to add it",
        ));
    };
    if Path::new(&output.file).components().count() != 1 {
        return Err(Error::data(file.display(), "names an image outside of its folder"));
    }
    Ok(Some(output))
}

/// Compares an image with the digest in its JSON file.
///
/// # Errors
/// If the image is missing or has other bytes.
fn check_image(file: &Path, output: &OutputFile) -> Result<()> {
    let image = file.with_file_name(&output.file);
    let bytes = reading::bytes(&image)?;
    match output.fault(&bytes) {
        None => Ok(()),
        Some(fault) => Err(Error::data(image.display(), fault)),
    }
}
