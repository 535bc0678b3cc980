//! Pairs of photographs as frames, each with a photograph in the dark: [`open`].

use std::collections::BTreeMap;
use std::path::Path;

use super::dark_photos::DarkPhoto;
use super::frame_facts::FrameFacts;
use super::image_source::FrameFile;
use super::maps::MapPaths;
use super::pairs::Pairs;
use super::{Dataset, ImageSource, stem};
use crate::error::{Error, Result};
use crate::types::{FrameId, PhotoName};

/// Makes a frame of each photograph in normal light, named by its file, with its partner in low light as dark
/// photograph. Warns about images without a partner. The data set has no questions.
///
/// # Errors
/// If two photographs in normal light have the same name.
pub(super) fn open(folder: &Path, pairs: Pairs) -> Result<Dataset> {
    if let Some(first) = pairs.unmatched.first() {
        tracing::warn!(
            "images without a partner in the other light, which are not asked: {}, first {}",
            pairs.unmatched.len(),
            first.display()
        );
    }
    let mut sources = BTreeMap::new();
    for pair in pairs.pairs {
        let name = pair.normal.file_name().unwrap_or_default();
        let id = FrameId(name.to_string_lossy().into_owned());
        let dark = DarkPhoto { name: PhotoName::numbered(0), path: pair.low, ev: None };
        let source = ImageSource::File(Box::new(FrameFile {
            rgb: pair.normal.clone(),
            maps: MapPaths::default(),
            facts: FrameFacts::default(),
            dark: vec![dark],
        }));
        if sources.insert(id, source).is_some() {
            return Err(Error::data(pair.normal.display(), "a second file of this name"));
        }
    }
    Ok(Dataset::new(stem(folder), sources, Vec::new()))
}
