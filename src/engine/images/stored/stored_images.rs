//! Images in the image store: [`StoredImages`], and the place of one image ([`StoredPlace`]).
//!
//! Thumbnails in the image store: [`ThumbnailPlace`].
//!
//! Cached findings about enhancers in the image store: opened models and results of their probes ([`StoredFindings`]).

#[cfg(test)]
mod tests;

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::image_cache::{Entry, EntryFacts, EntryType, ImageStore, Key, Shown, StoredKinds};
use crate::images::enhancement::enhancers::{EnhancerModels, Model};
use crate::images::frames::{Source, SourceFrame};
use crate::images::notes::{self, ShownObjects};
use crate::images::recipes::{ImageKeyFacts, Maker, Recipe};
use darkqa_base::error::Result;
use darkqa_base::types::manifests::PngForm;
use darkqa_base::types::questions::PixelBox;
use darkqa_base::types::{Condition, Digest, FrameId, Thumbnail};
use darkqa_enhance::{ImageUse, ProbeFindings};
use darkqa_pictures::{Payload, PayloadFormat};

/// The image store, with the settings that decide images besides their recipes.
#[derive(Debug, Clone, Copy)]
pub struct StoredImages<'a> {
    store: &'a ImageStore,
    maker: &'a Maker,
    png: PngForm,
}

/// The facts that decide the file of an image.
#[derive(Serialize)]
struct StoredRecipe<'a> {
    /// Content that is stored instead of the image; `None` if the image itself is stored.
    #[serde(skip_serializing_if = "Option::is_none")]
    content: Option<EntryType>,
    image: ImageKeyFacts<'a>,
    program: &'static str,
    /// The form of a PNG file; `None` for the first one, and for JPEG.
    #[serde(skip_serializing_if = "Option::is_none")]
    png: Option<PngForm>,
    /// `None` without an enhancer, because a degraded image depends neither on the machine nor on the runtime.
    enhanced_with: Option<&'a Maker>,
}

impl<'a> StoredImages<'a> {
    pub fn new(store: &'a ImageStore, maker: &'a Maker, png: PngForm) -> Self {
        Self { store, maker, png }
    }

    /// The findings about enhancers in the same store.
    pub fn findings(self) -> StoredFindings<'a> {
        StoredFindings::new(self.store, self.maker)
    }

    /// True if the store has the images of all frames of a source in a condition. They may be damaged.
    ///
    /// # Errors
    /// If a frame cannot be shown in the condition.
    pub fn has_all(self, recipe: &Recipe, source: &Source, condition: &Condition) -> Result<bool> {
        if condition.photograph().is_some() {
            // Photographs in the dark are not stored.
            return Ok(false);
        }
        for frame in &source.frames {
            if !self.place(recipe, &source.name, frame, condition)?.exists() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The place of the image of a frame in a condition, or of its similarity alone if such images are not stored.
    /// `source` is the name of the frame's source.
    ///
    /// # Errors
    /// If the recipe lacks the noise profile of the condition.
    pub fn place(
        self,
        recipe: &Recipe,
        source: &FrameId,
        frame: &SourceFrame,
        condition: &Condition,
    ) -> Result<StoredPlace<'a>> {
        let stored_content = match (self.store.kinds(), &condition.enhancer) {
            (StoredKinds::All, _) | (StoredKinds::Enhanced, Some(_)) => EntryType::Image,
            (StoredKinds::Enhanced, None) => EntryType::Measures,
        };
        let key = |content: EntryType| {
            Key::from_recipe(&StoredRecipe {
                content: (content != EntryType::Image).then_some(content),
                image: recipe.key_facts(source, frame, condition)?,
                program: self.maker.program(),
                png: (recipe.format == PayloadFormat::Png && !self.png.is_first()).then_some(self.png),
                enhanced_with: condition.enhancer.is_some().then_some(self.maker),
            })
        };
        let raw = Condition { enhancer: None, ..condition.clone() };
        let shown = Shown {
            content: stored_content,
            enhancer: condition.enhancer.as_ref().map(ToString::to_string),
            light: raw.to_string(),
            format: recipe.format.to_string(),
        };
        Ok(StoredPlace {
            store: self.store,
            image: key(EntryType::Image)?,
            similarity: match stored_content {
                EntryType::Image => None,
                EntryType::Measures | EntryType::Probe | EntryType::Thumbnail => Some(key(EntryType::Measures)?),
            },
            shown,
        })
    }
}

/// The place of one image in the store, or of its similarity to the clean frame.
#[derive(Debug, Clone)]
pub struct StoredPlace<'a> {
    store: &'a ImageStore,
    image: Key,
    /// Key of the similarity alone; `None` if the image is stored, whose notes include it.
    similarity: Option<Key>,
    shown: Shown,
}

/// Similarity of an image to its clean frame, both in the size sent; `None` for a measure that is undefined.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Similarity {
    /// PSNR in dB; undefined for equal images.
    pub psnr: Option<f64>,
    /// SSIM; undefined for images smaller than its window.
    pub ssim: Option<f64>,
}

/// Notes about an image from the time it was made, stored with it.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct StoredNotes {
    /// The image's part of its enhancer's usage note; `None` without an enhancer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enhanced: Option<ImageUse>,
    /// Similarity to the clean frame; `None` if it was not measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub similarity: Option<Similarity>,
}

/// Parts of an image that a caller needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Needed {
    /// Only the image file.
    Image,
    /// The image file and its similarity to the clean frame.
    Similarity,
}

/// An image from the store.
pub struct StoredImage {
    pub payload: Payload,
    pub notes: StoredNotes,
}

impl<'a> StoredPlace<'a> {
    /// True if the store keeps the image itself.
    pub fn keeps_image(&self) -> bool {
        self.similarity.is_none()
    }

    /// True if the store has a file of the image. It may be damaged.
    fn exists(&self) -> bool {
        self.store.contains(&self.image)
    }

    /// Reads the image; `None` if it or a needed note is missing. The recipe gives the file format.
    pub fn read(&self, recipe: &Recipe, needed: Needed) -> Option<StoredImage> {
        if self.similarity.is_some() {
            return None;
        }
        let mut notes = None;
        let entry = self.store.get(&self.image, EntryType::Image, |entry| {
            let read: Option<StoredNotes> = serde_json::from_value(entry.facts.notes.clone()).ok();
            notes = read.filter(|notes| {
                let is_enhanced = self.shown.enhancer.is_some();
                (!is_enhanced || notes.enhanced.is_some()) && (needed == Needed::Image || notes.similarity.is_some())
            });
            notes.is_some()
        })?;
        let [width, height] = entry.size;
        Some(StoredImage { payload: Payload::from_file(entry.image, width, height, recipe.format), notes: notes? })
    }

    /// Similarity of the image to its clean frame; `None` if the store does not have it without the image.
    pub fn similarity(&self) -> Option<Similarity> {
        let key = self.similarity.as_ref()?;
        let mut similarity = None;
        self.store.get(key, EntryType::Measures, |entry| {
            let notes: Option<StoredNotes> = serde_json::from_value(entry.facts.notes.clone()).ok();
            similarity = notes.and_then(|notes| notes.similarity);
            similarity.is_some()
        })?;
        similarity
    }

    /// The place of the thumbnail of a frame in a condition, with crops of these objects.
    pub fn thumbnail(
        &self,
        frame: &FrameId,
        condition: &Condition,
        objects: Option<ShownObjects<'_>>,
    ) -> Option<ThumbnailPlace<'a>> {
        ThumbnailPlace::new(self.store, &self.image, &self.shown, frame, condition, objects)
    }

    /// Adds an image and its notes to the store, or the similarity alone if such images are not stored. `took` is the
    /// time to make it.
    pub fn write(&self, image: &Payload, notes: &StoredNotes, took: Duration) {
        let facts = EntryFacts::new(self.shown.clone(), took.as_millis() as u64, serde_json::json!(notes));
        if let Some(key) = &self.similarity {
            if notes.similarity.is_some() {
                self.store.put(key, &Entry::from_facts(facts));
            }
            return;
        }
        let entry = Entry {
            image: image.file().to_vec(),
            size: [image.facts().width, image.facts().height].map(|pixels| u32::try_from(pixels).unwrap_or(u32::MAX)),
            facts,
        };
        self.store.put(&self.image, &entry);
    }
}

/// The place of the thumbnail of an image in the store.
#[derive(Debug)]
pub struct ThumbnailPlace<'a> {
    store: &'a ImageStore,
    key: Key,
    shown: Shown,
}

/// The facts that decide a thumbnail.
#[derive(Serialize)]
struct ThumbnailRecipe<'a> {
    content: EntryType,
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
    pub fn new(
        store: &'a ImageStore,
        image: &Key,
        shown: &Shown,
        frame: &FrameId,
        condition: &Condition,
        objects: Option<ShownObjects<'_>>,
    ) -> Option<Self> {
        let key = Key::from_recipe(&ThumbnailRecipe {
            content: EntryType::Thumbnail,
            version: notes::VERSION,
            image: image.digest(),
            frame,
            condition,
            objects: objects.map(|shown| (shown.size, shown.objects)),
        })
        .ok()?;
        Some(Self { store, key, shown: Shown { content: EntryType::Thumbnail, ..shown.clone() } })
    }

    /// Reads the thumbnail of the image with this digest; `None` if the store does not have it.
    pub fn read(&self, image: Digest) -> Option<Thumbnail> {
        let mut stored = None;
        self.store.get(&self.key, EntryType::Thumbnail, |entry| {
            let read: Option<Thumbnail> = serde_json::from_slice(&entry.image).ok();
            stored = read.filter(|thumbnail| thumbnail.image == image);
            stored.is_some()
        })?;
        stored
    }

    /// Adds a thumbnail that took this many milliseconds to make.
    pub fn write(&self, thumbnail: &Thumbnail, milliseconds: u64) {
        let entry = Entry {
            image: serde_json::json!(thumbnail).to_string().into_bytes(),
            size: [0, 0],
            facts: EntryFacts::new(self.shown.clone(), milliseconds, serde_json::Value::Null),
        };
        self.store.put(&self.key, &entry);
    }
}

/// Findings in the image store that were made with one set of enhancer settings.
#[derive(Debug, Clone, Copy)]
pub struct StoredFindings<'a> {
    store: &'a ImageStore,
    maker: &'a Maker,
}

/// Inputs of a store key: everything that can change the findings about a model.
#[derive(Serialize)]
struct FindingsRecipe<'a> {
    /// Digest of the model, its sidecar and its preset.
    stated: Digest,
    version: u32,
    maker: &'a Maker,
    /// Inputs of the probe's dark images, one list per source. `None` in the key that records an opened model.
    frames: Option<Vec<Vec<ImageKeyFacts<'a>>>>,
}

impl<'a> StoredFindings<'a> {
    pub fn new(store: &'a ImageStore, maker: &'a Maker) -> Self {
        Self { store, maker }
    }

    fn key(self, model: &Model, frames: Option<Vec<Vec<ImageKeyFacts<'_>>>>) -> Result<Key> {
        Key::from_recipe(&FindingsRecipe {
            stated: model.stated()?,
            version: darkqa_enhance::VERSION,
            maker: self.maker,
            frames,
        })
    }

    /// True if all models of a command were opened and probed before. Such models need not be opened again to be
    /// checked.
    ///
    /// # Errors
    /// If a sidecar has a number that is infinite or NaN.
    pub fn has_all(self, models: &EnhancerModels<'_>) -> Result<bool> {
        for model in models.models() {
            if !self.store.contains(&self.key(model, None)?) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Location in the store of the findings of a model's probe on these frames and conditions.
    ///
    /// # Errors
    /// If a frame cannot be shown in one of its conditions, or a sidecar has a number that is infinite or NaN.
    pub fn place(
        self,
        recipe: &Recipe,
        model: &Model,
        frames: &[(&Source, Vec<Condition>)],
    ) -> Result<FindingsPlace<'a>> {
        let facts = frames
            .iter()
            .map(|(source, conditions)| middle_frame_facts(recipe, source, conditions))
            .collect::<Result<Vec<_>>>()?;
        Ok(FindingsPlace {
            store: self.store,
            opened_key: self.key(model, None)?,
            probe_key: self.key(model, Some(facts))?,
            shown: Shown { content: EntryType::Probe, enhancer: Some(model.name().to_string()), ..Shown::default() },
        })
    }
}

/// Key facts of a source's middle frame in each condition, before enhancement; empty if the source has no middle frame.
fn middle_frame_facts<'a>(
    recipe: &'a Recipe,
    source: &'a Source,
    conditions: &[Condition],
) -> Result<Vec<ImageKeyFacts<'a>>> {
    let Some(frame) = source.middle() else {
        return Ok(Vec::new());
    };
    conditions
        .iter()
        .map(|condition| {
            let unenhanced = Condition { enhancer: None, ..condition.clone() };
            recipe.key_facts(&source.name, frame, &unenhanced)
        })
        .collect()
}

/// Location of the findings of a probe in the image store.
#[derive(Debug, Clone)]
pub struct FindingsPlace<'a> {
    store: &'a ImageStore,
    /// Key of the entry that marks the model as opened.
    opened_key: Key,
    /// Key of the entry with the findings.
    probe_key: Key,
    shown: Shown,
}

impl FindingsPlace<'_> {
    /// Reads the findings; `None` if the store does not have them.
    pub fn read(&self) -> Option<ProbeFindings> {
        let mut findings: Option<ProbeFindings> = None;
        self.store.get(&self.probe_key, EntryType::Probe, |entry| {
            findings = serde_json::from_value(entry.facts.notes.clone()).ok();
            findings.is_some()
        })?;
        findings
    }

    /// Writes the findings, then marks the model as opened. `took` is the duration of opening and probing.
    pub fn write(&self, findings: &ProbeFindings, took: Duration) {
        let milliseconds = took.as_millis() as u64;
        for (key, milliseconds, notes) in [
            (&self.probe_key, milliseconds, serde_json::json!(findings)),
            (&self.opened_key, 0, serde_json::Value::Null),
        ] {
            let facts = EntryFacts::new(self.shown.clone(), milliseconds, notes);
            self.store.put(key, &Entry::from_facts(facts));
        }
    }
}
