//! Rebuilds the images of a run: [`ImageRebuilder`].

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;

use crate::images::enhancement::enhancers;
use crate::images::enhancement::enhancers::{EnhancerModels, EnhancerRunArgs};
use crate::images::frames::{Frames, Source, WalkArgs, WalkFolder, photographs};
use crate::images::image_pipeline::ImagePipeline;
use crate::images::recipes::Recipe;
use crate::images::recipes::image_recipe::ImageFlags;
use crate::images::timings::{ImageSteps, Timings};
use crate::images::trials::ASK;
use crate::images::workers::ThreadArgs;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::{PngForm, RunManifest};
use darkqa_base::types::{Condition, Decides, FrameId};
use darkqa_data::{DataArgs, DataSource, Dataset, Photographs, open_frames, parse_data_source};
use darkqa_enhance::{EnhancedFolder, Enhancer, Implausible, ProbeArgs, RuntimeArgs};
use darkqa_light::KindSettings;
use darkqa_pictures::Payload;

/// Flags for the current paths of a run's data and enhancers, and for running them.
///
/// Their environment variables are `DARKQA_MOVED_DATA`, `DARKQA_MOVED_LLIE` and `DARKQA_MOVED_ENHANCED`, because
/// `DARKQA_DATA` applies to new runs only.
#[derive(Debug, Clone, Args)]
pub struct RebuildArgs {
    /// The data, if they were moved; default: where they were
    #[arg(id = "moved_data", long = "data", value_name = "DIR|FILE|rooms:…", add = Decides::Nothing)]
    pub data: Option<PathBuf>,
    /// The enhancement models, if they were moved; repeatable; default: where they were
    #[arg(id = "moved_llie", long = "llie", value_name = "FILE", add = Decides::Nothing)]
    pub llie: Vec<PathBuf>,
    /// The folders of images that were enhanced elsewhere, if they were moved; repeatable; default: where they were
    #[arg(id = "moved_enhanced", long = "enhanced", value_name = "NAME=DIR", add = Decides::Nothing)]
    pub enhanced: Vec<EnhancedFolder>,
    /// The ONNX Runtime that runs enhancers.
    #[command(flatten)]
    pub runtime: RuntimeArgs,
    /// The number of threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// Rebuilds the images of a run with the settings in its manifest.
pub struct ImageRebuilder {
    data: FrameData,
    recipe: Recipe,
    png: PngForm,
    enhancers: Vec<Enhancer>,
}

/// The data set or the walks of a run.
#[allow(clippy::large_enum_variant, reason = "a run has one")]
enum FrameData {
    Frames(Dataset),
    Walks(WalkFolder, WalkArgs),
}

impl ImageRebuilder {
    /// Opens the data of a run, and the enhancers of these conditions.
    ///
    /// # Errors
    /// If the manifest has no image flags, or the data or an enhancer cannot be opened.
    pub fn open(args: RebuildArgs, manifest: &RunManifest, folder: &Path, conditions: &[Condition]) -> Result<Self> {
        let wrong = |problem: String| {
            let path = folder.to_owned();
            Error::Run { path, problem }
        };
        if manifest.images.is_empty() {
            return Err(wrong(
                "the manifest of the run has no image flags, so its images cannot be made again".to_owned(),
            ));
        }
        let flags = ImageFlags::read(&manifest.images).map_err(wrong)?;
        let flags = found_from(with_new_paths(flags, &args).map_err(wrong)?, folder);
        let has_enhanced = conditions.iter().any(|condition| condition.enhancer.is_some());
        let models = if has_enhanced { &*flags.llie } else { &[] };
        let elsewhere = if has_enhanced { &*flags.enhanced } else { &[] };
        let files = enhancers::read_models(models)?;
        let kinds = KindSettings::resolve(&flags.sensor, &flags.camera)?;
        let recipe = Recipe::new(&kinds, flags.images.image, flags.max_side, &files);
        let recipe = recipe.with_enhanced_images(elsewhere)?;
        let (data, recipe) = if let Some(walk) = flags.walk {
            let recipe = recipe.for_walks(&walk);
            let folder = WalkFolder::new(&walk, &flags.data.set.root, flags.decode.rule());
            (FrameData::Walks(folder, walk), recipe)
        } else {
            let dataset = if manifest.identity.contains_key(ASK) {
                Photographs::open(&flags.data.place(), &flags.data.set)?.dataset
            } else if let Some(dataset) =
                flags.scene.pairs_or_classes(&flags.data.place(), &flags.data.set.root.data_root)?
            {
                dataset
            } else {
                frames(&flags.data)?
            };
            let dataset = dataset.with_rule(flags.decode.rule());
            (FrameData::Frames(dataset), recipe)
        };
        let loading = EnhancerRunArgs {
            size: flags.size,
            probe: ProbeArgs::default(),
            runtime: args.runtime,
            threads: args.threads,
        };
        Ok(Self { data, recipe, png: manifest.png, enhancers: EnhancerModels::load(files, &loading)?.take()? })
    }

    /// The images of a frame or walk in each of these conditions, in the order in which they would be sent.
    ///
    /// # Errors
    /// If the frame is missing, or an image cannot be made.
    pub fn images(&mut self, name: &FrameId, conditions: &[Condition]) -> Result<Vec<Vec<Arc<Payload>>>> {
        let mut source = self.source(name).map_err(|e| {
            let problem = format_args!("{e}; if the data were moved, name their folder with --data");
            Error::data(name, problem)
        })?;
        let frames: &dyn Frames = match &self.data {
            FrameData::Frames(dataset) => dataset,
            FrameData::Walks(folder, _) => folder,
        };
        if conditions.iter().any(|condition| condition.pair().is_some()) {
            photographs::measure(frames, std::slice::from_mut(&mut source))?;
        }
        let timings = Timings::default();
        let steps =
            ImageSteps { frames, recipe: &self.recipe, limit: None, timings: &timings, png: self.png, stored: None };
        let enhancers = std::mem::take(&mut self.enhancers);
        let mut pipeline = ImagePipeline::new(steps, enhancers, Implausible::NotLookedFor);
        let conditions: Vec<&Condition> = conditions.iter().collect();
        let images = pipeline.images(&source, &conditions);
        self.enhancers = pipeline.enhancers;
        images
    }

    fn source(&self, name: &FrameId) -> Result<Source> {
        match &self.data {
            FrameData::Frames(dataset) => Source::from_questions(dataset, name),
            FrameData::Walks(folder, walk) => folder.source(&name.0, walk),
        }
    }
}

/// The image flags with the paths of moved data and enhancers. `--data` also replaces the folder of walks.
fn with_new_paths(mut flags: ImageFlags, args: &RebuildArgs) -> Result<ImageFlags, String> {
    if let Some(data) = &args.data {
        match &mut flags.walk {
            Some(walk) => walk.folder.clone_from(data),
            None => flags.data.data = vec![parse_data_source(&data.to_string_lossy())?],
        }
    }
    if !args.llie.is_empty() {
        flags.llie.clone_from(&args.llie);
    }
    if !args.enhanced.is_empty() {
        flags.enhanced.clone_from(&args.enhanced);
    }
    Ok(flags)
}

/// The image flags with the paths of data and enhancers as they can be opened from here (see [`found`]).
fn found_from(mut flags: ImageFlags, run: &Path) -> ImageFlags {
    for place in &mut flags.data.data {
        match place {
            DataSource::Rooms(_) => {}
            DataSource::Path(path) | DataSource::Known { path, .. } => *path = found(path, run),
            DataSource::Files(paths) => paths.iter_mut().for_each(|path| *path = found(path, run)),
        }
    }
    for path in &mut flags.data.set.root.data_root {
        *path = found(path, run);
    }
    for images in &mut flags.enhanced {
        images.folder = found(&images.folder, run);
    }
    if let Some(walk) = &mut flags.walk {
        walk.folder = found(&walk.folder, run);
    }
    // A name without an extension is that of a built-in enhancer.
    for path in flags.llie.iter_mut().filter(|path| path.extension().is_some()) {
        *path = found(path, run);
    }
    flags
}

/// A path of a run, which is relative to the folder that the run was made in. If nothing is there from the working
/// folder, it is sought from each folder above that of the run, the nearest first.
fn found(path: &Path, run: &Path) -> PathBuf {
    if path.is_absolute() || path.exists() {
        return path.to_owned();
    }
    let run = std::path::absolute(run).unwrap_or_else(|_| run.to_owned());
    match run.ancestors().skip(1).map(|folder| folder.join(path)).find(|path| path.exists()) {
        Some(found) => {
            tracing::warn!("{}: read from {}, above the folder of the run", path.display(), found.display());
            found
        }
        None => path.to_owned(),
    }
}

/// The frames of a data set. Its questions are ignored.
fn frames(data: &DataArgs) -> Result<Dataset> {
    match &data.place() {
        DataSource::Path(path) if path.join("frames.jsonl").is_file() => open_frames(path, &data.set.root.data_root),
        place @ (DataSource::Path(_) | DataSource::Files(_) | DataSource::Known { .. }) => place.open(None, &data.set),
        place @ DataSource::Rooms(_) => place.open_without_questions(&[]),
    }
}
