//! Where an image lies: [`ImageSource`].

use std::path::PathBuf;
use std::sync::Arc;

use super::dark_photos::DarkPhoto;
use super::maps::MapPaths;
use super::ready_made::{Archive, EmbeddedImage};
use super::view::FrameFacts;
use crate::rooms;

/// The place of one image and of its maps.
#[derive(Debug, Clone)]
pub(crate) enum ImageSource {
    File(Box<FrameFile>),
    /// An image of this name in a ZIP file.
    Member(Arc<Archive>),
    /// An image inside a file of rows.
    Embedded(EmbeddedImage),
    /// A frame of the built-in rooms.
    Room(rooms::Room),
}

/// An image file, its map files, the other facts about the frame, and photographs of its scene in the dark.
#[derive(Debug, Clone)]
pub(crate) struct FrameFile {
    pub(crate) rgb: PathBuf,
    pub(crate) maps: MapPaths,
    pub(crate) view: FrameFacts,
    pub(crate) dark: Vec<DarkPhoto>,
}

impl ImageSource {
    /// An image file without maps.
    pub(super) fn image(rgb: PathBuf) -> Self {
        Self::File(Box::new(FrameFile {
            rgb,
            maps: MapPaths::default(),
            view: FrameFacts::default(),
            dark: Vec::new(),
        }))
    }
}
