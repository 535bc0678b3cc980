//! The facts about a frame that are not in its images: [`FrameFacts`]; and the bytes of its files: [`FrameFiles`].

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Serialize, Serializer};

use super::Picture;
use super::maps::MapFiles;
use crate::error::Result;
use crate::types::{
    DepthKind, Digest, Frame, FrameId, InputNote, Intrinsics, SegmentName, Segmentation,
};

/// The facts about a frame that are not in its images: scene, camera, names of segments, room.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct FrameFacts {
    pub(crate) scene: String,
    pub(crate) depth_kind: DepthKind,
    pub(crate) intrinsics: Option<Intrinsics>,
    pub(crate) segmentation: Segmentation,
    #[serde(serialize_with = "pairs")]
    pub(crate) names: Arc<BTreeMap<u32, SegmentName>>,
    pub(crate) room: Option<String>,
}

/// Writes a map as a list of pairs, because the keys of a JSON object can only be texts.
fn pairs<S: Serializer>(
    names: &BTreeMap<u32, SegmentName>,
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    serializer.collect_seq(names)
}

/// The files of a frame as they are stored, not decoded.
#[derive(Debug)]
pub struct FrameFiles<'a> {
    pub(crate) id: &'a FrameId,
    pub(crate) picture: Picture,
    pub(crate) maps: MapFiles<'a>,
    pub(crate) view: &'a FrameFacts,
}

impl FrameFiles<'_> {
    /// The digest of all files and facts, without the name of the frame.
    ///
    /// # Errors
    /// If a number of the camera intrinsics is not finite.
    pub fn digest(&self) -> Result<Digest> {
        let parts = [
            self.picture.digest(),
            self.maps.digest(),
            Digest::canonical("darkqa.view/1", self.view)?,
        ];
        Ok(Digest::from_parts(
            parts.iter().map(|part| &part.as_bytes()[..]),
        ))
    }

    /// Changes that reading the image makes besides decoding its codes.
    #[must_use]
    pub fn note(&self) -> InputNote {
        self.picture.note()
    }

    /// The frame with its image and maps decoded.
    ///
    /// # Errors
    /// If an image or a map is broken, or a map has another size than the image; the error names the file.
    pub fn decode(&self) -> Result<Frame> {
        if let Picture::Drawn(room, _) = &self.picture {
            return room.frame_with(self.picture.decode()?);
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
