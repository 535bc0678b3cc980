//! Thumbnails in the image store: [`ThumbnailPlace`].

use serde::Serialize;

use crate::engine::image_cache::{Content, Entry, EntryFacts, ImageStore, Key, Shown};
use crate::engine::images::notes::thumbnail::{self, ShownObjects};
use crate::types::questions::PixelBox;
use crate::types::{Condition, Digest, FrameId, Thumbnail};

/// The place of the thumbnail of an image in the store.
#[derive(Debug)]
pub(crate) struct ThumbnailPlace<'a> {
    store: &'a ImageStore,
    key: Key,
    shown: Shown,
}

/// The facts that decide a thumbnail.
#[derive(Serialize)]
struct ThumbnailRecipe<'a> {
    content: Content,
    version: u32,
    /// Digest of the image's key.
    image: &'a Digest,
    frame: &'a FrameId,
    condition: &'a Condition,
    /// Width and height of the frame, and the boxes of the cropped objects in it.
    objects: Option<([u32; 2], &'a [PixelBox])>,
}

impl<'a> ThumbnailPlace<'a> {
    /// The place of the thumbnail of the image with this key; `None` if no key can be made.
    pub(crate) fn new(
        store: &'a ImageStore,
        image: &Key,
        shown: &Shown,
        frame: &FrameId,
        condition: &Condition,
        objects: Option<ShownObjects<'_>>,
    ) -> Option<Self> {
        let key = Key::from_recipe(&ThumbnailRecipe {
            content: Content::Thumbnail,
            version: thumbnail::VERSION,
            image: image.digest(),
            frame,
            condition,
            objects: objects.map(|shown| (shown.size, shown.objects)),
        })
        .ok()?;
        Some(Self { store, key, shown: Shown { content: Content::Thumbnail, ..shown.clone() } })
    }

    /// Reads the thumbnail of the image with this digest; `None` if the store does not have it.
    pub(crate) fn read(&self, image: Digest) -> Option<Thumbnail> {
        let mut stored = None;
        self.store.get(&self.key, Content::Thumbnail, |entry| {
            let read: Option<Thumbnail> = serde_json::from_slice(&entry.image).ok();
            stored = read.filter(|thumbnail| thumbnail.image == image);
            stored.is_some()
        })?;
        stored
    }

    /// Adds a thumbnail that took this many milliseconds to make.
    pub(crate) fn write(&self, thumbnail: &Thumbnail, milliseconds: u64) {
        let entry = Entry {
            image: serde_json::json!(thumbnail).to_string().into_bytes(),
            size: [0, 0],
            facts: EntryFacts::new(self.shown.clone(), milliseconds, serde_json::Value::Null),
        };
        self.store.put(&self.key, &entry);
    }
}
