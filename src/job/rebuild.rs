//! The images of a run, made again: `ImageRebuilder`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::enhancers::{self, EnhancerRunArgs, OpenEnhancers};
use super::frame_work::ImageSteps;
use super::image_pipeline::ImagePipeline;
use super::image_words::ImageFlags;
use super::recipe::Recipe;
use super::source::{Frames, Source, SourceFrame};
use super::timings::Timings;
use super::walk::{Walk, WalkFolder};
use super::workers::ThreadArgs;
use crate::dataset::{DataPlace, Dataset, place};
use crate::enhance::{Enhancer, RuntimeArgs};
use crate::error::{Error, Result};
use crate::synthesis::SensorSettings;
use crate::types::Decides;
use crate::types::manifest::RunManifest;
use crate::types::{Condition, Digest, FrameId};

/// Where the data and the enhancers of a run lie by now, and how they are run.
///
/// The variables are `DARKQA_MOVED_DATA` and `DARKQA_MOVED_LLIE`: what `DARKQA_DATA` says of new runs says nothing of this one.
#[derive(Debug, Clone, Args)]
pub(crate) struct RebuildArgs {
    /// The data, if they lie elsewhere by now; default: where they were
    #[arg(id = "moved_data", long = "data", value_name = "DIR|FILE|rooms:…", add = Decides::Nothing)]
    pub data: Option<PathBuf>,
    /// The enhancement models, if they lie elsewhere by now; repeatable; default: where they were
    #[arg(id = "moved_llie", long = "llie", value_name = "FILE", add = Decides::Nothing)]
    pub llie: Vec<PathBuf>,
    /// By which ONNX Runtime.
    #[command(flatten)]
    pub runtime: RuntimeArgs,
    /// On how many threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// What makes the images of a run again, as its manifest says that they were made.
pub(crate) struct ImageRebuilder {
    place: FrameFolder,
    recipe: Recipe,
    enhancers: Vec<Enhancer>,
}

/// Where the frames lie.
enum FrameFolder {
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
        args: RebuildArgs,
        manifest: &RunManifest,
        folder: &Path,
        conditions: &[Condition],
    ) -> Result<Self> {
        let wrong = |problem: String| {
            let path = folder.to_owned();
            Error::Run { path, problem }
        };
        if manifest.images.is_empty() {
            return Err(wrong(
                "the run does not say how its images were made".to_owned(),
            ));
        }
        let pictures = ImageFlags::read(&manifest.images).map_err(wrong)?;
        let pictures = moved(pictures, &args).map_err(wrong)?;
        let mut conditions = conditions.iter();
        let enhanced = conditions.any(|condition| condition.enhancer.is_some());
        let models = if enhanced { &*pictures.llie } else { &[] };
        let files = enhancers::read(models)?;
        let sensor = SensorSettings::resolve(&pictures.sensor)?;
        let recipe = Recipe::new(&sensor, pictures.images.image, pictures.max_side, &files);
        let (place, recipe) = if let Some(walk) = pictures.walk {
            let recipe = recipe.of_walks(&walk);
            let folder = WalkFolder::new(&walk, pictures.limit);
            (FrameFolder::Walks(folder, walk), recipe)
        } else {
            let frames = frames(&pictures.data.data)?;
            let frames = frames.with_most_pixels(pictures.limit.max_pixels.get());
            (FrameFolder::Frames(frames), recipe)
        };
        let loading = EnhancerRunArgs {
            size: pictures.size,
            runtime: args.runtime,
            threads: args.threads,
        };
        Ok(Self {
            place,
            recipe,
            enhancers: OpenEnhancers::load(files, &loading)?.take()?,
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
            FrameFolder::Frames(dataset) => dataset,
            FrameFolder::Walks(folder, _) => folder,
        };
        let mut pipeline = ImagePipeline {
            steps: ImageSteps {
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
            FrameFolder::Frames(dataset) => {
                SourceFrame::inspect(dataset, name).map(Source::of_frame)
            }
            FrameFolder::Walks(folder, walk) => folder.source(&name.0, walk),
        }
    }
}

/// The same images, made of what lies elsewhere by now. The folder of walks is data, too.
fn moved(mut pictures: ImageFlags, args: &RebuildArgs) -> Result<ImageFlags, String> {
    if let Some(data) = &args.data {
        match &mut pictures.walk {
            Some(walk) => walk.folder.clone_from(data),
            None => pictures.data.data = place(&data.to_string_lossy())?,
        }
    }
    if !args.llie.is_empty() {
        pictures.llie.clone_from(&args.llie);
    }
    Ok(pictures)
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
fn frames(place: &DataPlace) -> Result<Dataset> {
    match place {
        DataPlace::Path(path) if path.join("frames.jsonl").is_file() => Dataset::of_frames(path),
        DataPlace::Path(_) => Dataset::open(place, None),
        DataPlace::Rooms(_) => Dataset::open_unasked(place),
    }
}
