//! Images and their maps: [`Frame`], [`FrameId`].

#[cfg(feature = "program")]
use std::collections::BTreeMap;
use std::fmt;
#[cfg(feature = "program")]
use std::sync::Arc;

#[cfg(feature = "program")]
use ndarray::Array2;
use serde::{Deserialize, Serialize};

#[cfg(feature = "program")]
use super::image::Rgb;
#[cfg(feature = "program")]
use super::labels::SegmentName;

/// The name of a frame, unique in its data set: `scene/frame`, or the path of an image in a ready-made set.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct FrameId(pub String);

impl FrameId {
    /// The name without the extension of an image file, if it has one.
    #[must_use]
    pub fn bare(&self) -> &str {
        match self.0.rsplit_once('.') {
            Some((bare, ending)) if is_image_ending(ending) && !bare.is_empty() && !bare.ends_with('/') => bare,
            _ => &self.0,
        }
    }
}

impl fmt::Display for FrameId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

/// The extensions of supported image files, in lower case.
const IMAGE_ENDINGS: [&str; 8] = ["png", "jpg", "jpeg", "webp", "tif", "tiff", "bmp", "exr"];

/// True if the extension, in any case, is that of a supported image format.
pub fn is_image_ending(ending: &str) -> bool {
    IMAGE_ENDINGS.iter().any(|known| ending.eq_ignore_ascii_case(known))
}

/// One view of a scene: an image and, if the data set has them, its maps of the same height and width.
#[cfg(feature = "program")]
#[derive(Debug, Clone)]
pub struct Frame {
    /// The name of the frame, unique in its data set.
    pub id: FrameId,
    /// The scene of the frame; empty if the data set names no scenes.
    pub scene: String,
    /// The pixels of the image, 8-bit sRGB.
    pub rgb: Rgb,
    /// The depth of each pixel in millimetres, 0 where it is unknown.
    pub depth: Option<Array2<u32>>,
    /// The direction along which depth is measured.
    pub depth_kind: DepthKind,
    /// The camera's projection; `None` if the data set does not state it.
    pub intrinsics: Option<Intrinsics>,
    /// The class of each pixel, as a number in the data set's label space.
    pub semantic: Option<Array2<u16>>,
    /// The segment of each pixel, 0 for none.
    pub segments: Option<Array2<u32>>,
    /// Whether a segment is a whole object or a part of one.
    pub segmentation: Segmentation,
    /// The names of the scene's segments, by segment; some may be missing.
    pub names: Arc<BTreeMap<u32, SegmentName>>,
    /// The type of the room; `None` if the data set does not state it.
    pub room: Option<String>,
}

/// The direction along which depth is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "program", derive(clap::ValueEnum))]
#[serde(rename_all = "snake_case")]
pub enum DepthKind {
    /// The optical axis: z.
    #[default]
    Planar,
    /// The ray through the pixel: the distance itself.
    Euclid,
}

/// The meaning of a segment in a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Segmentation {
    /// Each object is one segment.
    #[default]
    Instances,
    /// A segment may be a part of an object, such as a superpixel; neighbouring segments of one class are one object.
    Parts,
}

/// A pinhole camera; all values are in pixels, and (0, 0) is the centre of the first pixel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// The focal length along a row, in pixels.
    pub fx: f64,
    /// The focal length along a column, in pixels.
    pub fy: f64,
    /// The position of the optical axis along a row, in pixels.
    pub cx: f64,
    /// The position of the optical axis along a column, in pixels.
    pub cy: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bare_name_has_no_image_extension() {
        for (name, bare) in [
            ("a/b.PNG", "a/b"),
            ("a.b.jpeg", "a.b"),
            ("a.WebP", "a"),
            ("a.heic", "a.heic"),
            ("a.b", "a.b"),
            ("a/.png", "a/.png"),
            ("scene/1", "scene/1"),
        ] {
            assert_eq!(FrameId(name.into()).bare(), bare);
        }
    }
}
