//! Small copies of images in the image store: [`ThumbnailPlace`].

use serde::Serialize;

use crate::image_store::{Content, Entry, EntryFacts, ImageStore, Key, Shown};
use crate::images::notes::thumbnail::{self, ShownObjects};
use crate::types::questions::PixelBox;
use crate::types::{Condition, Digest, FrameId, Thumbnail};

/// The place of the small copy of an image in a store.
#[derive(Debug)]
pub(crate) struct ThumbnailPlace<'a> {
    store: &'a ImageStore,
    key: Key,
    shown: Shown,
}

/// All that decides a small copy.
#[derive(Serialize)]
struct ThumbnailRecipe<'a> {
    content: Content,
    version: u32,
    /// Digest of all that decides the image.
    image: &'a Digest,
    frame: &'a FrameId,
    condition: &'a Condition,
    /// Width and height in which the boxes of the things are, and these boxes.
    objects: Option<([u32; 2], &'a [PixelBox])>,
}

impl<'a> ThumbnailPlace<'a> {
    /// The place of the small copy of the image with this key; `None` if there can be none.
    pub(crate) fn new(
        (store, image): (&'a ImageStore, &Key),
        shown: &Shown,
        (frame, condition): (&FrameId, &Condition),
        objects: Option<ShownObjects<'_>>,
    ) -> Option<Self> {
        let key = Key::from_recipe(&ThumbnailRecipe {
            content: Content::Thumbnail,
            version: thumbnail::VERSION,
            image: image.digest(),
            frame,
            condition,
            objects: objects.map(|shown| (shown.size, shown.objects)),
        });
        Some(Self {
            store,
            key: key.ok()?,
            shown: Shown {
                content: Content::Thumbnail,
                ..shown.clone()
            },
        })
    }

    /// The small copy of the image with this digest; `None` if the store has none.
    pub(crate) fn read(&self, image: Digest) -> Option<Thumbnail> {
        let mut kept = None;
        let is_enough = |entry: &Entry| {
            let read: Option<Thumbnail> = serde_json::from_slice(&entry.image).ok();
            kept = read.filter(|kept| kept.image == image);
            kept.is_some()
        };
        self.store.get(&self.key, Content::Thumbnail, is_enough)?;
        kept
    }

    /// Adds a small copy that took this many milliseconds to make.
    pub(crate) fn write(&self, thumbnail: &Thumbnail, milliseconds: u64) {
        let entry = Entry {
            image: serde_json::json!(thumbnail).to_string().into_bytes(),
            size: [0, 0],
            facts: EntryFacts::new(self.shown.clone(), milliseconds, serde_json::Value::Null),
        };
        self.store.put(&self.key, &entry);
    }
}
