//! Metadata of a frame ([`FrameFacts`]), and its files before decoding ([`FrameFiles`]).

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Serialize, Serializer};

use super::Picture;
use super::maps::MapFiles;
use crate::error::Result;
use crate::types::{DepthKind, Digest, Frame, FrameId, InputNote, Intrinsics, SegmentName, Segmentation};

/// Metadata of a frame: scene, camera, names of segments, room.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct FrameFacts {
    pub(crate) scene: String,
    pub(crate) depth_kind: DepthKind,
    pub(crate) intrinsics: Option<Intrinsics>,
    pub(crate) segmentation: Segmentation,
    #[serde(serialize_with = "serialize_as_pairs")]
    pub(crate) names: Arc<BTreeMap<u32, SegmentName>>,
    pub(crate) room: Option<String>,
}

/// Serializes a map as a list of pairs, because keys of a JSON object must be strings.
fn serialize_as_pairs<S: Serializer>(
    names: &BTreeMap<u32, SegmentName>,
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    serializer.collect_seq(names)
}

/// Files of a frame, not decoded.
#[derive(Debug)]
pub struct FrameFiles<'a> {
    pub(crate) id: &'a FrameId,
    pub(crate) picture: Picture,
    pub(crate) maps: MapFiles<'a>,
    pub(crate) facts: &'a FrameFacts,
}

impl FrameFiles<'_> {
    /// Digest of all files and metadata, without the name of the frame.
    ///
    /// # Errors
    /// If a number of the camera intrinsics is not finite.
    pub fn digest(&self) -> Result<Digest> {
        let parts = [self.picture.digest(), self.maps.digest(), Digest::canonical("darkqa.view/1", self.facts)?];
        Ok(Digest::from_parts(parts.iter().map(|part| &part.as_bytes()[..])))
    }

    /// Changes made to the samples while decoding, such as color conversion.
    #[must_use]
    pub fn note(&self) -> InputNote {
        self.picture.note()
    }

    /// Decodes the image and the maps.
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
            scene: self.facts.scene.clone(),
            depth: self.maps.depth(size)?,
            depth_kind: self.facts.depth_kind,
            intrinsics: self.facts.intrinsics,
            semantic: self.maps.semantic(size)?,
            segments: self.maps.segments(size)?,
            segmentation: self.facts.segmentation,
            names: Arc::clone(&self.facts.names),
            room: self.facts.room.clone(),
            rgb,
        })
    }
}
