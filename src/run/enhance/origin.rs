//! What an enhanced image was made from, as the JSON file beside it holds it: [`EnhancedOrigin`].

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::dataset::Picture;
use crate::engine::identity;
use crate::images::placed_image::ImageOrigin;
use crate::types::{Digest, FrameId, InputNote};
use darkqa_enhance::SizeArgs;

/// Everything that decides the pixels of an enhanced image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct EnhancedOrigin {
    frame: String,
    /// The digest of the image that was enhanced.
    source: String,
    /// What reading the file did besides taking its codes; no fields if nothing.
    #[serde(flatten)]
    read: InputNote,
    /// The digest of the model with its sidecar, and the sizes it takes, by flag.
    enhancer: Value,
}

impl ImageOrigin for EnhancedOrigin {
    const SCHEMAS: &'static [&'static str] = &["darkqa.enhanced/1"];
    const IS_REPLACED: bool = false;
}

/// What decides the pixels besides the image, with a name for the digest that a reader of the message understands.
pub(super) fn settings(digest: &Digest, size: &SizeArgs) -> Value {
    let mut settings = identity::enhancer(digest, size);
    if let Some(fields) = settings.as_object_mut()
        && let Some(digest) = fields.remove("--llie")
    {
        fields.insert("model with its sidecar".to_owned(), digest);
    }
    settings
}

impl EnhancedOrigin {
    /// The origin of a frame's image, enhanced with these settings.
    pub(super) fn new(frame: &FrameId, picture: &Picture, enhancer: &Value) -> Self {
        Self {
            frame: frame.0.clone(),
            source: picture.digest().to_string(),
            read: picture.note(),
            enhancer: enhancer.clone(),
        }
    }
}
