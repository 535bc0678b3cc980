//! Map files of a frame: [`MapFiles`].

use std::path::PathBuf;

use super::adapter::FrameMaps;
use super::files::{check_same_size, read_classes, read_frame_depth, read_segments};
use crate::error::Result;
use crate::types::Rgb;

/// Paths of the maps that a frame has, one file per map.
#[derive(Debug)]
pub(super) struct MapFiles {
    pub(super) depth: Option<PathBuf>,
    pub(super) classes: Option<PathBuf>,
    pub(super) segments: Option<PathBuf>,
}

impl MapFiles {
    /// Paths of all maps of several frames.
    pub(super) fn paths(all: &[Self]) -> impl Iterator<Item = &PathBuf> {
        all.iter().flat_map(|maps| [&maps.depth, &maps.classes, &maps.segments]).flatten()
    }

    /// Reads the maps. `depth_scale` is metres per unit of depth, as for [`read_frame_depth`].
    ///
    /// # Errors
    /// If a file cannot be read or does not have the size of the image.
    pub(super) fn read(&self, depth_scale: Option<f64>, rgb: &Rgb) -> Result<FrameMaps> {
        let mut maps =
            FrameMaps { depth: read_frame_depth(self.depth.as_deref(), depth_scale, rgb)?, ..FrameMaps::default() };
        if let Some(path) = &self.classes {
            let classes = read_classes(path)?;
            check_same_size(path, &classes, rgb)?;
            maps.semantic = Some(classes);
        }
        if let Some(path) = &self.segments {
            let segments = read_segments(path)?;
            check_same_size(path, &segments, rgb)?;
            maps.segments = Some(segments);
        }
        Ok(maps)
    }
}
