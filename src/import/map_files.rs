//! The files of the maps of a frame, one file a map: [`MapFiles`].

use std::path::PathBuf;

use super::adapter::FrameMaps;
use super::files::{check_same_size, classes, depth_of, segments};
use crate::error::Result;
use crate::types::Rgb;

/// The files of a frame's maps; `None` for a map that the frame lacks.
#[derive(Debug)]
pub(super) struct MapFiles {
    pub(super) depth: Option<PathBuf>,
    pub(super) classes: Option<PathBuf>,
    pub(super) segments: Option<PathBuf>,
}

impl MapFiles {
    /// The files of some frames.
    pub(super) fn paths(all: &[Self]) -> impl Iterator<Item = &PathBuf> {
        all.iter()
            .flat_map(|maps| [&maps.depth, &maps.classes, &maps.segments])
            .flatten()
    }

    /// Reads the maps. `depth_scale` is the metres in one unit of a depth map in PNG.
    ///
    /// # Errors
    /// If a file cannot be read, or has another size than the image.
    pub(super) fn read(&self, depth_scale: Option<f64>, rgb: &Rgb) -> Result<FrameMaps> {
        let mut read = FrameMaps {
            depth: depth_of(self.depth.as_deref(), depth_scale, rgb)?,
            ..FrameMaps::default()
        };
        if let Some(path) = &self.classes {
            let classes = classes(path)?;
            check_same_size(path, &classes, rgb)?;
            read.semantic = Some(classes);
        }
        if let Some(path) = &self.segments {
            let segments = segments(path)?;
            check_same_size(path, &segments, rgb)?;
            read.segments = Some(segments);
        }
        Ok(read)
    }
}
