//! Location of an image: [`ImageSource`].

use std::path::PathBuf;
use std::sync::Arc;

use super::dark_photos::DarkPhoto;
use super::frame_facts::FrameFacts;
use super::maps::MapPaths;
use super::ready_made::{Archive, EmbeddedImage};
use crate::rooms;

/// Location of one image and its maps.
#[derive(Debug, Clone)]
pub(crate) enum ImageSource {
    /// An image file.
    File(Box<FrameFile>),
    /// An image in a ZIP file, under the name of the frame.
    Member(Arc<Archive>),
    /// An image inside a table.
    Embedded(EmbeddedImage),
    /// A frame of the built-in rooms.
    Room(rooms::Room),
}

/// Image file of a frame, with its maps, metadata and photographs of its scene in the dark.
#[derive(Debug, Clone)]
pub(crate) struct FrameFile {
    pub(crate) rgb: PathBuf,
    pub(crate) maps: MapPaths,
    pub(crate) facts: FrameFacts,
    pub(crate) dark: Vec<DarkPhoto>,
}

impl ImageSource {
    /// An image file without maps.
    pub(super) fn image(rgb: PathBuf) -> Self {
        Self::File(Box::new(FrameFile {
            rgb,
            maps: MapPaths::default(),
            facts: FrameFacts::default(),
            dark: Vec::new(),
        }))
    }
}
