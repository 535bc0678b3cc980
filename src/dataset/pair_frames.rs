//! Pairs of photographs as frames with their photographs in the dark: [`dataset`].

use std::collections::BTreeMap;
use std::path::Path;

use super::dark_photos::DarkPhoto;
use super::image_source::FrameFile;
use super::maps::MapPaths;
use super::pairs::Pairs;
use super::view::FrameFacts;
use super::{Dataset, ImageSource, stem};
use crate::error::{Error, Result};
use crate::types::{FrameId, PhotoName};

/// The frames in normal light, named by their files, each with its photograph in low light; without questions. Says how many images
/// have no partner.
///
/// # Errors
/// If two of the photographs in normal light have the same name.
pub(super) fn dataset(folder: &Path, pairs: Pairs) -> Result<Dataset> {
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
        let dark = DarkPhoto {
            name: PhotoName::numbered(0),
            path: pair.low,
            ev: None,
        };
        let source = ImageSource::File(Box::new(FrameFile {
            rgb: pair.normal.clone(),
            maps: MapPaths::default(),
            view: FrameFacts::default(),
            dark: vec![dark],
        }));
        if sources.insert(id, source).is_some() {
            return Err(Error::data(
                pair.normal.display(),
                "a second file of this name",
            ));
        }
    }
    Ok(Dataset::new(stem(folder), sources, Vec::new()))
}
