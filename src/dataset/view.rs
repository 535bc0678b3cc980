//! What a data set says of a frame beside its files: [`View`]; and the files' bytes: [`FrameFiles`].

use std::collections::BTreeMap;
use std::sync::Arc;

use super::Picture;
use super::maps::MapFiles;
use crate::error::Result;
use crate::types::{DepthKind, Digest, Frame, FrameId, Intrinsics, SegmentName, Segmentation};

/// What a data set says of a frame beside its files.
#[derive(Debug, Clone, Default)]
pub(super) struct View {
    pub(super) scene: String,
    pub(super) depth_kind: DepthKind,
    pub(super) intrinsics: Option<Intrinsics>,
    pub(super) segmentation: Segmentation,
    pub(super) names: Arc<BTreeMap<u32, SegmentName>>,
    pub(super) room: Option<String>,
}

impl View {
    /// All of it that says what is seen.
    fn digest(&self) -> Digest {
        let camera = self.intrinsics.map_or_else(Vec::new, |camera| {
            let numbers = [camera.fx, camera.fy, camera.cx, camera.cy];
            numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
        });
        let kinds = format!("{:?} {:?}", self.depth_kind, self.segmentation);
        let names = self.names.iter().flat_map(|(id, name)| {
            let region = name
                .region
                .map_or_else(String::new, |region| region.to_string());
            [
                id.to_string(),
                name.name.clone(),
                name.canonical.clone(),
                region,
            ]
        });
        let names: Vec<String> = names.collect();
        let room = self.room.as_deref().unwrap_or_default();
        let head = [
            self.scene.as_bytes(),
            &camera,
            kinds.as_bytes(),
            room.as_bytes(),
        ];
        Digest::of_parts(head.into_iter().chain(names.iter().map(String::as_bytes)))
    }
}

/// The files of a frame as they lie in the data set, undecoded.
#[derive(Debug)]
pub struct FrameFiles<'a> {
    pub(super) id: &'a FrameId,
    pub(super) picture: Picture,
    pub(super) maps: MapFiles<'a>,
    pub(super) view: &'a View,
}

impl FrameFiles<'_> {
    /// The content of all files, and of what is said about them; not the name.
    #[must_use]
    pub fn digest(&self) -> Digest {
        let parts = [
            self.picture.digest(),
            self.maps.digest(),
            self.view.digest(),
        ];
        Digest::of_parts(parts.iter().map(|part| &part.as_bytes()[..]))
    }

    /// The frame.
    ///
    /// # Errors
    /// With the file: an image or a map that is broken, a map of another size than the image.
    pub fn decode(&self) -> Result<Frame> {
        if let Picture::Drawn(room) = &self.picture {
            return Ok(room.frame()?.as_ref().clone());
        }
        let rgb = self.picture.decode()?;
        let size = (rgb.height(), rgb.width());
        Ok(Frame {
            id: self.id.clone(),
            scene: self.view.scene.clone(),
            depth: self.maps.depth(size)?,
            depth_kind: self.view.depth_kind,
            intrinsics: self.view.intrinsics,
            semantic: self.maps.semantic(size)?,
            segments: self.maps.segments(size)?,
            segmentation: self.view.segmentation,
            names: Arc::clone(&self.view.names),
            room: self.view.room.clone(),
            rgb,
        })
    }
}
