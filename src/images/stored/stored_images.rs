//! The image store as the image pipeline uses it: [`StoredImages`], and the place of one image in it ([`StoredPlace`]).

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::error::Result;
use crate::image_store::{Content, Entry, EntryFacts, ImageStore, Key, Shown, StoredKinds};
use crate::images::frames::{Source, SourceFrame};
use crate::images::notes::thumbnail::ShownObjects;
use crate::images::recipes::{ImageKeyFacts, Maker, Recipe};
use crate::images::stored::stored_findings::StoredFindings;
use crate::images::stored::stored_thumbnails::ThumbnailPlace;
use crate::picture::Payload;
use crate::types::{Condition, FrameId};
use darkqa_enhance::ImageUse;

/// A store, with what decides images besides their recipes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StoredImages<'a> {
    store: &'a ImageStore,
    maker: &'a Maker,
}

/// All that decides the file of an image.
#[derive(Serialize)]
struct StoredRecipe<'a> {
    /// The content that is kept in place of the image; `None` if the image itself is kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    content: Option<Content>,
    image: ImageKeyFacts<'a>,
    program: &'static str,
    /// `None` without an enhancer: neither machine nor runtime decides a degraded image.
    enhanced_with: Option<&'a Maker>,
}

impl<'a> StoredImages<'a> {
    pub(crate) fn new(store: &'a ImageStore, maker: &'a Maker) -> Self {
        Self { store, maker }
    }

    /// The store's findings about enhancers.
    pub(crate) fn findings(self) -> StoredFindings<'a> {
        StoredFindings::new(self.store, self.maker)
    }

    /// Whether the store has the images of all frames of a source in a condition. They may be damaged.
    ///
    /// # Errors
    /// If the condition cannot be made of a frame.
    pub(crate) fn has_all(
        self,
        recipe: &Recipe,
        source: &Source,
        condition: &Condition,
    ) -> Result<bool> {
        if condition.photograph().is_some() {
            // Photographs in the dark are not kept.
            return Ok(false);
        }
        for frame in &source.frames {
            if !self
                .place(recipe, (&source.name, frame), condition)?
                .exists()
            {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The place of a frame in a condition: of its image, or of the measures of one that is not kept. `source` is the name of what the
    /// frame is shown in.
    ///
    /// # Errors
    /// If the condition has a reading that the recipe lacks.
    pub(crate) fn place(
        self,
        recipe: &Recipe,
        (source, frame): (&FrameId, &SourceFrame),
        condition: &Condition,
    ) -> Result<StoredPlace<'a>> {
        let keeps = match (self.store.kinds(), &condition.enhancer) {
            (StoredKinds::All, _) | (StoredKinds::Enhanced, Some(_)) => Content::Image,
            (StoredKinds::Enhanced, None) => Content::Measures,
        };
        let key = |content: Content| {
            Key::from_recipe(&StoredRecipe {
                content: (content != Content::Image).then_some(content),
                image: recipe.facts(source, frame, condition)?,
                program: self.maker.program(),
                enhanced_with: condition.enhancer.is_some().then_some(self.maker),
            })
        };
        let light = Condition {
            enhancer: None,
            ..condition.clone()
        };
        let shown = Shown {
            content: keeps,
            enhancer: condition.enhancer.as_ref().map(ToString::to_string),
            light: light.to_string(),
            format: recipe.format.to_string(),
        };
        Ok(StoredPlace {
            store: self.store,
            image: key(Content::Image)?,
            measures: match keeps {
                Content::Image => None,
                Content::Measures | Content::Probe | Content::Thumbnail => {
                    Some(key(Content::Measures)?)
                }
            },
            shown,
        })
    }
}

/// The place of one image in a store, or of its measures.
#[derive(Debug, Clone)]
pub(crate) struct StoredPlace<'a> {
    store: &'a ImageStore,
    image: Key,
    /// Key of the measures; `None` if the image is kept, with them.
    measures: Option<Key>,
    shown: Shown,
}

/// Similarity of an image to its clean frame, both in the size sent; `None` for what cannot be measured.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct Similarity {
    /// PSNR in dB.
    pub(crate) psnr: Option<f64>,
    pub(crate) ssim: Option<f64>,
}

/// Findings about an image when it was made.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct MadeNotes {
    /// The image's part in the enhancer's note; `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) enhanced: Option<ImageUse>,
    /// `None` if it was not measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) similarity: Option<Similarity>,
}

/// The facts needed about an image besides its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Needed {
    /// Nothing.
    Image,
    /// How similar it is to its clean frame.
    Similarity,
}

/// An image from the store.
pub(crate) struct StoredImage {
    pub(crate) payload: Payload,
    pub(crate) notes: MadeNotes,
}

impl<'a> StoredPlace<'a> {
    /// Whether the image itself is kept.
    pub(crate) fn keeps_image(&self) -> bool {
        self.measures.is_none()
    }

    /// Whether there is a file of the image. It may be damaged.
    fn exists(&self) -> bool {
        self.store.contains(&self.image)
    }

    /// The image, if it is there with all that is needed. `format` is that of the recipe.
    pub(crate) fn read(&self, recipe: &Recipe, needed: Needed) -> Option<StoredImage> {
        if self.measures.is_some() {
            return None;
        }
        let mut notes = None;
        let is_enough = |entry: &Entry| {
            let read: Option<MadeNotes> = serde_json::from_value(entry.facts.notes.clone()).ok();
            notes = read.filter(|notes| {
                let is_enhanced = self.shown.enhancer.is_some();
                (!is_enhanced || notes.enhanced.is_some())
                    && (needed == Needed::Image || notes.similarity.is_some())
            });
            notes.is_some()
        };
        let entry = self.store.get(&self.image, Content::Image, is_enough)?;
        let [width, height] = entry.size;
        Some(StoredImage {
            payload: Payload::from_file(entry.image, (width, height), recipe.format),
            notes: notes?,
        })
    }

    /// How similar the image is to its clean frame, if that is kept without the image.
    pub(crate) fn measures(&self) -> Option<Similarity> {
        let mut measures = None;
        let is_enough = |entry: &Entry| {
            let notes: Option<MadeNotes> = serde_json::from_value(entry.facts.notes.clone()).ok();
            measures = notes.and_then(|notes| notes.similarity);
            measures.is_some()
        };
        let alone = self.measures.as_ref()?;
        self.store.get(alone, Content::Measures, is_enough)?;
        measures
    }

    /// The place of the small copy of the image of a frame in a condition, with these things.
    pub(crate) fn thumbnail(
        &self,
        of: (&FrameId, &Condition),
        objects: Option<ShownObjects<'_>>,
    ) -> Option<ThumbnailPlace<'a>> {
        ThumbnailPlace::new((self.store, &self.image), &self.shown, of, objects)
    }

    /// Adds facts about an image that took this time to make: with the image, if images like it are kept, else without it.
    pub(crate) fn write(&self, image: &Payload, notes: &MadeNotes, took: Duration) {
        let facts = EntryFacts::new(
            self.shown.clone(),
            took.as_millis() as u64,
            serde_json::json!(notes),
        );
        if let Some(measures) = &self.measures {
            if notes.similarity.is_some() {
                self.store.put(measures, &Entry::from_facts(facts));
            }
            return;
        }
        let side = |pixels: usize| u32::try_from(pixels).unwrap_or(u32::MAX);
        let entry = Entry {
            image: image.file().to_vec(),
            size: [side(image.facts().width), side(image.facts().height)],
            facts,
        };
        self.store.put(&self.image, &entry);
    }
}

#[cfg(test)]
mod tests;
