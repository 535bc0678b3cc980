//! `synthesize check`: holding images to the digests in their JSON files.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::files::reading;
use crate::images::placed_image::OutputFile;
use crate::runs::Outcome;

/// The schemas of JSON files that vouch for an image. Other JSON files of the folder are left alone.
const SCHEMAS: [&str; 3] = ["darkqa.image/1", "darkqa.image/2", "darkqa.sheet/1"];

/// Checks all JSON files of a folder against their images. Nothing is changed.
///
/// # Errors
/// If the folder cannot be read, or no JSON file of an image is in it.
pub(super) fn check(folder: &Path) -> Result<Outcome> {
    let entries = fs::read_dir(folder).map_err(|e| Error::file(folder, "read", e))?;
    let files: std::io::Result<Vec<PathBuf>> = entries.map(|entry| Ok(entry?.path())).collect();
    let mut files = files.map_err(|e| Error::file(folder, "read", e))?;
    files.retain(|file| file.extension().is_some_and(|end| end == "json"));
    files.sort();
    let (mut intact, mut wrong) = (0, 0);
    for file in files {
        match fault(&file) {
            Ok(Some(())) => intact += 1,
            Ok(None) => {}
            Err(e) => {
                tracing::error!("{e}");
                wrong += 1;
            }
        }
    }
    if intact + wrong == 0 {
        let problem = "no JSON file of an image of `synthesize` is in it";
        return Err(Error::data(folder.display(), problem));
    }
    Ok(Outcome::text(
        Outcome::complete_if(wrong == 0),
        format!(
            "{}: images as they were written: {intact}; not as they were written: {wrong}\n",
            folder.display()
        ),
    ))
}

/// The part of a JSON file that is checked. All schemas share it.
#[derive(Deserialize)]
struct Vouched {
    schema: String,
    output: Option<OutputFile>,
}

/// Holds one image to the digest in its JSON file; `None` for a JSON file of something else.
///
/// # Errors
/// If the image is missing, has other bytes, or the JSON file has no digest of it.
fn fault(file: &Path) -> Result<Option<()>> {
    let text = reading::text(file)?;
    let Ok(vouched) = serde_json::from_str::<Vouched>(&text) else {
        return Ok(None);
    };
    if !SCHEMAS.contains(&&*vouched.schema) {
        return Ok(None);
    }
    let wrong = |problem: &str| Err(Error::data(file.display(), problem));
    let Some(output) = vouched.output else {
        return wrong(
            "has no digest of its image: an older version wrote it; run `synthesize` again to add it",
        );
    };
    if Path::new(&output.file).components().count() != 1 {
        return wrong("names an image outside of its folder");
    }
    let image = file.with_file_name(&output.file);
    let bytes = reading::bytes(&image)?;
    match output.fault(&bytes) {
        None => Ok(Some(())),
        Some(fault) => Err(Error::data(image.display(), fault)),
    }
}
