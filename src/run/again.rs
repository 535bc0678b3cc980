//! The images of a run, made again: [`Album`].

use std::path::Path;

use super::darkroom::{Darkroom, Desk};
use super::gallery::{Gallery, look_at};
use super::recipe::Recipe;
use super::timings::Timings;
use super::{identity, open_enhancers};
use crate::config::Again;
use crate::dataset::{Dataset, Place};
use crate::enhance::Enhancer;
use crate::error::{Error, Result};
use crate::types::manifest::RunManifest;
use crate::types::{Condition, Digest, FrameId};

/// What makes the images of a run again, as its manifest says that they were made.
pub(super) struct Album {
    dataset: Dataset,
    gallery: Gallery,
    recipe: Recipe,
    enhancers: Vec<Enhancer>,
}

/// A file of an image, as it would be sent.
pub(super) struct Made {
    pub(super) file: Vec<u8>,
    pub(super) digest: Digest,
    /// What the name of such a file ends in.
    pub(super) ending: &'static str,
}

impl Album {
    /// Opens the data, and the enhancers of these conditions.
    pub(super) fn open(
        again: Again,
        manifest: &RunManifest,
        folder: &Path,
        conditions: &[Condition],
    ) -> Result<Self> {
        if manifest.images.is_empty() {
            let problem =
                "the run does not say how its images were made: an earlier version made it"
                    .to_owned();
            let path = folder.to_owned();
            return Err(Error::Run { path, problem });
        }
        let pictures = again.pictures(&manifest.images)?;
        let dataset = frames(&pictures.data.place)?.with_most_pixels(pictures.data.most_pixels);
        let mended = conditions
            .iter()
            .any(|condition| condition.enhancer.is_some());
        let models = if mended {
            &*pictures.enhancement.models
        } else {
            &[]
        };
        let files = identity::enhancers(models)?;
        let recipe = Recipe::new(&pictures.sensor, &pictures.images, &files);
        let (_, enhancers) = open_enhancers(files, &pictures.enhancement)?;
        Ok(Self {
            dataset,
            gallery: Gallery::new(),
            recipe,
            enhancers,
        })
    }

    /// Takes up a frame.
    pub(super) fn desk(&mut self, frame: &FrameId) -> Result<Desk> {
        let found = look_at(&self.dataset, frame).map_err(|e| {
            let problem =
                format_args!("{e}; where the data lie elsewhere by now, --data says where");
            Error::data(frame, problem)
        })?;
        self.gallery.insert(frame.clone(), found);
        Ok(Desk::new(frame.clone()))
    }

    /// A frame in a condition.
    pub(super) fn image(&mut self, desk: &mut Desk, condition: &Condition) -> Result<Made> {
        let mut darkroom = Darkroom {
            dataset: &self.dataset,
            pictures: &self.gallery,
            recipe: &self.recipe,
            enhancers: std::mem::take(&mut self.enhancers),
            limit: None,
            timings: &Timings::default(),
        };
        let image = darkroom.image(desk, condition);
        self.enhancers = darkroom.enhancers;
        let image = image?;
        let facts = image.facts();
        Ok(Made {
            file: image.file()?,
            digest: facts.digest,
            ending: if facts.format == "png" { "png" } else { "jpg" },
        })
    }
}

/// The frames at a place; questions that come with them are of no interest.
fn frames(place: &Place) -> Result<Dataset> {
    match place {
        Place::Path(path) if path.join("frames.jsonl").is_file() => Dataset::of_frames(path),
        Place::Path(_) => Dataset::open(place, None),
        Place::Rooms(_) => Dataset::open_unasked(place),
    }
}
