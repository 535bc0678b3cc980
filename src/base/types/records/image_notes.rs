//! Facts about images that were sent, stored next to the records of a run for its report: small copies ([`Thumbnail`])
//! and the similarity to the clean frame ([`ImageFidelity`]).

use serde::{Deserialize, Serialize};

use crate::types::degradations::Condition;
use crate::types::images::FrameId;
use crate::types::questions::PixelBox;
use crate::types::values::{Digest, Shared};

/// One line of a run's `thumbnails.jsonl`: a small copy of an image as it was sent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Thumbnail {
    /// The name of the frame.
    pub frame: FrameId,
    /// The condition in which the frame was sent.
    pub condition: Condition,
    /// The digest of the file that was sent.
    pub image: Digest,
    /// The whole image in reduced size, as a `data:` URL.
    pub small: String,
    /// The middle of the image at full resolution and brightened, as a `data:` URL.
    pub crop: String,
    /// The gain that brightens the crop, in EV.
    pub stops: f32,
    /// The width and height of the frame in pixels, the unit of boxes in evidence; not in the file for several frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<[u32; 2]>,
    /// Crops of the objects that questions are about, at full resolution and brightened as `crop` is; not in the file
    /// if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub objects: Vec<ObjectCrop>,
}

/// An object that a question is about, cropped from an image as it was sent.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ObjectCrop {
    /// The box of the object, in pixels of the frame.
    pub object: PixelBox,
    /// Crop of the object and its surroundings, as a `data:` URL.
    pub crop: String,
}

/// One line of a run's `fidelity.jsonl`: how similar an image is to its clean frame, both in the size sent, before any
/// JPEG.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageFidelity {
    /// The name of the frame.
    pub frame: Shared<FrameId>,
    /// The condition in which the frame was sent.
    pub condition: Shared<Condition>,
    /// The digest of the file that was sent.
    pub image: Digest,
    /// Peak signal-to-noise ratio in dB, peak 255, over all samples; `None` if the image equals the clean frame.
    pub psnr: Option<f64>,
    /// Structural similarity, at most 1; `None` if the image is smaller than the window of 11 × 11 pixels.
    pub ssim: Option<f64>,
}
