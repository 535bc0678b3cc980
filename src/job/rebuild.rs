//! The images of a run, made again: [`ImageRebuilder`].

use std::path::Path;

use super::enhancers::OpenEnhancers;
use super::frame_work::Steps;
use super::identity;
use super::image_pipeline::ImagePipeline;
use super::recipe::Recipe;
use super::source::{Frames, Source, SourceFrame};
use super::timings::Timings;
use super::walk::WalkFolder;
use crate::config::{Again, Walk};
use crate::dataset::{Dataset, Place};
use crate::enhance::Enhancer;
use crate::error::{Error, Result};
use crate::types::manifest::RunManifest;
use crate::types::{Condition, Digest, FrameId};

/// What makes the images of a run again, as its manifest says that they were made.
pub(crate) struct ImageRebuilder {
    place: Images,
    recipe: Recipe,
    enhancers: Vec<Enhancer>,
}

/// Where the frames lie.
enum Images {
    Frames(Dataset),
    Walks(WalkFolder, Walk),
}

/// A file of an image, as it would be sent.
pub(crate) struct RebuiltImage {
    pub(crate) file: Vec<u8>,
    pub(crate) digest: Digest,
    /// What the name of such a file ends in.
    pub(crate) ending: &'static str,
}

impl ImageRebuilder {
    /// Opens the data, and the enhancers of these conditions.
    pub(crate) fn open(
        again: Again,
        manifest: &RunManifest,
        folder: &Path,
        conditions: &[Condition],
    ) -> Result<Self> {
        if manifest.images.is_empty() {
            let problem = "the run does not say how its images were made".to_owned();
            let path = folder.to_owned();
            return Err(Error::Run { path, problem });
        }
        let pictures = again.pictures(&manifest.images)?;
        let enhanced = conditions
            .iter()
            .any(|condition| condition.enhancer.is_some());
        let models = if enhanced {
            &*pictures.enhancement.models
        } else {
            &[]
        };
        let files = identity::enhancers(models)?;
        let recipe = Recipe::new(&pictures.sensor, &pictures.images, &files);
        let (place, recipe) = if let Some(walk) = pictures.walk {
            let recipe = recipe.of_walks(&walk);
            (Images::Walks(WalkFolder::new(&walk), walk), recipe)
        } else {
            let frames = frames(&pictures.data.place)?;
            let frames = frames.with_most_pixels(pictures.data.most_pixels);
            (Images::Frames(frames), recipe)
        };
        Ok(Self {
            place,
            recipe,
            enhancers: OpenEnhancers::load(files, &pictures.enhancement)?.take()?,
        })
    }

    /// The images of a frame or walk in each of these conditions, in the order shown.
    pub(crate) fn images(
        &mut self,
        name: &FrameId,
        conditions: &[Condition],
    ) -> Result<Vec<Vec<RebuiltImage>>> {
        let source = self.source(name).map_err(|e| {
            let problem =
                format_args!("{e}; where the data lie elsewhere by now, --data says where");
            Error::data(name, problem)
        })?;
        let frames: &dyn Frames = match &self.place {
            Images::Frames(dataset) => dataset,
            Images::Walks(folder, _) => folder,
        };
        let mut pipeline = ImagePipeline {
            steps: Steps {
                frames,
                recipe: &self.recipe,
                limit: None,
                timings: &Timings::default(),
            },
            enhancers: std::mem::take(&mut self.enhancers),
        };
        let conditions: Vec<&Condition> = conditions.iter().collect();
        let images = pipeline.images(&source, &conditions);
        self.enhancers = pipeline.enhancers;
        let images = images?.into_iter();
        images
            .map(|images| images.iter().map(|image| rebuilt(image)).collect())
            .collect()
    }

    fn source(&self, name: &FrameId) -> Result<Source> {
        match &self.place {
            Images::Frames(dataset) => SourceFrame::inspect(dataset, name).map(Source::of_frame),
            Images::Walks(folder, walk) => folder.source(&name.0, walk),
        }
    }
}

fn rebuilt(image: &crate::ask::Payload) -> Result<RebuiltImage> {
    let facts = image.facts();
    Ok(RebuiltImage {
        file: image.file()?,
        digest: facts.digest,
        ending: if facts.format == "png" { "png" } else { "jpg" },
    })
}

/// The frames at a place; questions that come with them are ignored.
fn frames(place: &Place) -> Result<Dataset> {
    match place {
        Place::Path(path) if path.join("frames.jsonl").is_file() => Dataset::of_frames(path),
        Place::Path(_) => Dataset::open(place, None),
        Place::Rooms(_) => Dataset::open_unasked(place),
    }
}
