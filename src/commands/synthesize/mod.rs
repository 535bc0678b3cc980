//! `synthesize`: writes low-light versions of images, identical to those that an evaluation of the same folder would
//! send.
//!
//! `synthesize check`: compares images with the digests in their JSON files.

mod sheet;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use rayon::prelude::*;
use serde::Deserialize;

use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::manifests::PngForm;
use darkqa_base::types::text::counted;
use darkqa_base::types::{Condition, Decides, Degradation, FrameId, Rgb, SetLight};
use darkqa_data::frames::is_image;
use darkqa_data::inputs::{InputFrame, Inputs, stem};
use darkqa_data::{FolderArgs, Picture};
use darkqa_engine::images::frame_work::FrameWork;
use darkqa_engine::images::frames::{Frames, InputTally};
use darkqa_engine::images::progress::{Progress, StepBar};
use darkqa_engine::images::recipes::{ImageRecipe, Recipe};
use darkqa_engine::images::stored::{ImageCounts, ImageOutcome, ImageRefusals, OutputFile, OutputImage, Sidecar};
use darkqa_engine::images::timings::{ImageSteps, Timings};
use darkqa_engine::images::workers::{ThreadArgs, pool};
use darkqa_light::{LightArgs, LightSettings, NoiseKey};
use darkqa_report::text::words::first_names;
use darkqa_runs::Outcome;
use darkqa_runs::resolved_shard::{ShardArgs, keep_shard};
use sheet::SheetRecipe;

pub(crate) use sheet::SheetKind;

/// `synthesize`, or another form of it.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct SynthesizeCommand {
    /// The form; `None` for images of all levels.
    #[command(subcommand)]
    form: Option<SynthesizeForm>,
    /// Flags for images of all levels.
    #[command(flatten)]
    pub(crate) images: Option<SynthesizeArgs>,
}

/// The other forms of `synthesize`.
#[derive(Debug, Subcommand)]
enum SynthesizeForm {
    /// Compare the images of a folder with the digests in their JSON files; nothing is made or changed
    Check {
        /// The folder of the images, with its subfolders
        #[arg(value_name = "DIR", add = Decides::Nothing)]
        folder: PathBuf,
    },
    /// Make the image of a JSON file again, with the settings in it
    From(ReplayArgs),
}

/// The flags of `synthesize from`.
#[derive(Debug, Args)]
struct ReplayArgs {
    /// The JSON file of the image
    #[arg(value_name = "FILE", add = Decides::Pixels)]
    file: PathBuf,
    /// The image that it was made from, or the folder of its frame
    #[arg(value_name = "INPUT", add = Decides::Pixels)]
    input: PathBuf,
    /// Where the image goes, with its JSON file
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    out: PathBuf,
    /// Overwrite any file that has the name of the image
    #[arg(long, add = Decides::Nothing)]
    force: bool,
    /// The reading of images.
    #[command(flatten)]
    folders: FolderArgs,
}

/// The flags of `synthesize`.
#[derive(Debug, Args)]
#[group(arg = "inputs")]
pub(crate) struct SynthesizeArgs {
    /// Images, folders of images, or folders of frames (frames.jsonl)
    #[arg(required = true, value_name = "INPUT", add = Decides::Pixels)]
    pub inputs: Vec<PathBuf>,
    /// Where the images go, each with a JSON file of all settings that made it
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: PathBuf,
    /// The flags for the degradations.
    #[command(flatten)]
    pub light: LightArgs,
    /// One figure per input instead; default: images
    #[arg(long, value_enum, help_heading = "Synthesis", add = Decides::Nothing)]
    pub sheet: Option<SheetKind>,
    /// Overwrite any file that has the name of an image
    #[arg(long, help_heading = "Synthesis", add = Decides::Nothing)]
    pub force: bool,
    /// The reading of images.
    #[command(flatten)]
    pub folders: FolderArgs,
    /// The part of the frames.
    #[command(flatten)]
    pub part: ShardArgs,
    /// The number of threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// The flags, and the light settings that they give.
struct ImageMaking<'a> {
    args: &'a SynthesizeArgs,
    light: LightSettings,
    /// Images that are not made because others are in their places.
    refusals: ImageRefusals,
}

/// Makes images, makes one again, or checks images.
///
/// # Errors
/// If images cannot be made, or none to check is found.
pub(crate) fn synthesize(command: &SynthesizeCommand, progress: &Progress) -> Result<Outcome> {
    match (&command.form, &command.images) {
        (Some(SynthesizeForm::Check { folder }), _) => check(folder),
        (Some(SynthesizeForm::From(args)), _) => replay(args),
        (None, Some(args)) => make_images(args, progress),
        (None, None) => Err(Error::usage("INPUT", "an image or a folder is missing")),
    }
}

/// Writes the images or figures of all inputs.
///
/// If one frame fails, the error is logged and counted, and the others continue. The reason of images that are refused
/// is logged once.
///
/// # Errors
/// If an input is missing, two frames have the same name, or the folder cannot be written to.
fn make_images(args: &SynthesizeArgs, progress: &Progress) -> Result<Outcome> {
    let out = &args.out;
    let making = ImageMaking {
        args,
        light: LightSettings::resolve(&args.light, SetLight::Lit)?,
        refusals: ImageRefusals::default(),
    };
    making.light.refuse_matches("synthesize knows none")?;
    let mut frames = Inputs::open(&args.inputs, &args.folders.root.data_root, args.folders.decode.rule())?;
    keep_shard(&mut frames.entries, args.part.resolve()?)?;
    let workers = pool(args.threads.threads)?;
    fs::create_dir_all(out).map_err(|e| Error::file(out, "make", e))?;
    let (files, tally) = (output_files(&making), InputTally::default());
    let bar = progress.bar("images", frames.entries.len() * files.len());
    let counts: Vec<ImageCounts> = workers.install(|| {
        let entries = frames.entries.par_iter();
        entries.map(|entry| write_files(&making, &frames, entry, &files, &bar, &tally)).collect()
    });
    drop(bar);
    tally.warn();
    making.refusals.log();
    let total = counts.iter().fold(ImageCounts::default(), |sum, counts| ImageCounts {
        written: sum.written + counts.written,
        unchanged: sum.unchanged + counts.unchanged,
        failed: sum.failed + counts.failed,
    });
    Ok(outcome(total, out, frames.entries.len()))
}

/// The outcome of a command that made images of frames.
fn outcome(counts: ImageCounts, out: &Path, frames: usize) -> Outcome {
    Outcome::wrote(
        out,
        Outcome::complete_if(counts.failed == 0),
        format!(
            "{}: {} made of {}{}\n",
            out.display(),
            counts.written,
            counted(frames, "frame"),
            counts.not_written_text()
        ),
    )
}

/// Content of an output file of a frame: an image with a degradation (`None` for the untouched frame), or a figure.
#[derive(Debug, Clone)]
enum OutputContent {
    Image(Option<Degradation>),
    Sheet(SheetKind),
}

/// The output files of each frame.
fn output_files(making: &ImageMaking<'_>) -> Vec<OutputContent> {
    if let Some(sheet) = making.args.sheet {
        return vec![OutputContent::Sheet(sheet)];
    }
    making.light.degradations().into_iter().map(OutputContent::Image).collect()
}

/// Writes all files of one frame.
fn write_files(
    making: &ImageMaking<'_>,
    frames: &Inputs,
    entry: &InputFrame,
    files: &[OutputContent],
    bar: &StepBar,
    tally: &InputTally,
) -> ImageCounts {
    let mut counts = ImageCounts::default();
    let frames = OneFrame { frames, entry };
    let recipe = Recipe::lossless(&making.light.kinds, &[]);
    let timings = Timings::default();
    let steps = ImageSteps {
        frames: &frames,
        recipe: &recipe,
        limit: None,
        timings: &timings,
        png: PngForm::NEWEST,
        stored: None,
    };
    let mut work = SynthesisWork { making, entry, frame: FrameWork::for_frame(steps, entry.id.clone()) };
    match work.frame.note() {
        Ok(note) => tally.add(&entry.id, &note),
        Err(e) => {
            tracing::error!("{e}");
            counts.failed = files.len();
            return counts;
        }
    }
    // A problem of the input recurs for each of its images, but is logged once.
    let mut logged = BTreeSet::new();
    for file in files {
        let outcome = match file {
            OutputContent::Image(degradation) => work.image(degradation.as_ref()),
            OutputContent::Sheet(sheet) => work.sheet(*sheet),
        };
        match outcome {
            Ok(outcome) => {
                if let Some(refusal) = counts.add(outcome) {
                    making.refusals.add(refusal);
                }
            }
            Err(e) => {
                if logged.insert(e.to_string()) {
                    tracing::error!("{e}");
                }
                counts.failed += 1;
            }
        }
        bar.inc();
    }
    counts
}

/// A single frame of the inputs, because frames of different inputs may have the same name.
struct OneFrame<'a> {
    frames: &'a Inputs,
    entry: &'a InputFrame,
}

impl Frames for OneFrame<'_> {
    fn picture(&self, _: &FrameId) -> Result<Picture> {
        self.frames.picture(self.entry)
    }

    fn focal(&self, _: &FrameId) -> Option<f64> {
        self.frames.focal(self.entry)
    }
}

/// The state of the work on one frame.
struct SynthesisWork<'a> {
    making: &'a ImageMaking<'a>,
    entry: &'a InputFrame,
    frame: FrameWork<'a>,
}

impl SynthesisWork<'_> {
    fn image(&mut self, how: Option<&Degradation>) -> Result<ImageOutcome> {
        let seed = self.making.light.kinds.sensor.seed;
        let key = NoiseKey::new(seed, &self.entry.id);
        let condition = Condition::raw(how.cloned());
        let name = format!("{}_{condition}", self.entry.stem);
        let applied = how.map(|how| self.frame.apply(how)).transpose()?;
        let picture = self.frame.picture()?;
        let recipe =
            ImageRecipe::new(&self.entry.id, picture.digest(), picture.note(), how, applied.as_ref(), &key, seed);
        let place = OutputImage::new(&self.making.args.out, &name, self.making.args.force);
        place.write_unless_present(&recipe, || Ok(Rgb::clone(self.frame.degraded(how)?)))
    }

    fn sheet(&mut self, kind: SheetKind) -> Result<ImageOutcome> {
        let light = &self.making.light;
        let recipe = SheetRecipe::new(kind, &self.entry.id, self.frame.picture()?, light)?;
        let name = format!("{}_{kind}", self.entry.stem);
        let place = OutputImage::new(&self.making.args.out, &name, self.making.args.force);
        place.write_unless_present(&recipe, || kind.draw(&mut self.frame, light))
    }
}

/// Makes the image of a JSON file again, with the settings in it.
fn replay(args: &ReplayArgs) -> Result<Outcome> {
    let input = std::slice::from_ref(&args.input);
    let rule = args.folders.decode.rule();
    let frames = Inputs::open(input, &args.folders.root.data_root, rule)?;
    let file = &args.file;
    let sidecar = Sidecar::<ImageRecipe>::read(file)?;
    let [entry] = &frames.entries[..] else {
        let problem = format_args!("one image expected, which FILE was made from; got {}", frames.entries.len());
        return Err(Error::usage("INPUT", problem));
    };
    let picture = frames.picture(entry)?;
    let tally = InputTally::default();
    tally.add(&entry.id, &picture.note());
    tally.warn();
    let degraded = ImageRecipe::replay(&sidecar, &picture, file)?;
    let name = sidecar.recipe.name(&stem(&sidecar.recipe.frame())?);
    fs::create_dir_all(&args.out).map_err(|e| Error::file(&args.out, "make", e))?;
    let place = OutputImage::new(&args.out, &name, args.force);
    let mut counts = ImageCounts::default();
    if let Some(refusal) = counts.add(place.write_unless_present(&sidecar.recipe, || Ok(degraded))?) {
        return Err(refusal.into_error());
    }
    Ok(outcome(counts, &args.out, 1))
}

/// Schemas of JSON files with the digest of an image. Other JSON files are ignored.
const SCHEMAS: [&str; 3] = ["darkqa.image/1", "darkqa.image/2", "darkqa.sheet/1"];

/// Maximum number of images without a JSON file that are named; chosen.
const MAX_NAMED: usize = 3;

/// The files in a folder and its subfolders, sorted. Links to folders are not followed.
fn files_below(folder: &Path) -> Result<Vec<PathBuf>> {
    let unread = |e| Error::file(folder, "read", e);
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(unread)? {
        let entry = entry.map_err(unread)?;
        if entry.file_type().map_err(unread)?.is_dir() {
            files.extend(files_below(&entry.path())?);
        } else {
            files.push(entry.path());
        }
    }
    files.sort();
    Ok(files)
}

/// Checks that each image in a folder and its subfolders has a JSON file and the digest in it. Nothing is changed.
///
/// # Errors
/// If a folder cannot be read, or none has a JSON file of an image.
fn check(folder: &Path) -> Result<Outcome> {
    let files = files_below(folder)?;
    let (mut intact, mut wrong) = (0, 0);
    let mut unknown: BTreeSet<PathBuf> = files.iter().filter(|file| is_image(file)).cloned().collect();
    for file in files.iter().filter(|file| file.extension().is_some_and(|end| end == "json")) {
        match read_output(file) {
            Ok(Some(output)) => {
                unknown.remove(&file.with_file_name(&output.file));
                match check_image(file, &output) {
                    Ok(()) => intact += 1,
                    Err(e) => {
                        tracing::error!("{e}");
                        wrong += 1;
                    }
                }
            }
            Ok(None) => {}
            Err(e) => {
                // The image has a JSON file, although an unusable one.
                unknown.retain(|image| image.with_extension("") != file.with_extension(""));
                tracing::error!("{e}");
                wrong += 1;
            }
        }
    }
    if intact + wrong == 0 {
        let problem = "no JSON file of an image of `synthesize` is in it";
        return Err(Error::data(folder.display(), problem));
    }
    if !unknown.is_empty() {
        let below = unknown.iter().map(|image| image.strip_prefix(folder).unwrap_or(image));
        let unknown: Vec<String> = below.map(|image| image.display().to_string()).collect();
        tracing::error!(
            "{}: no JSON file says how they were made: {}",
            folder.display(),
            first_names(&unknown, MAX_NAMED)
        );
    }
    Ok(Outcome::text(
        Outcome::complete_if(wrong == 0 && unknown.is_empty()),
        format!(
            "{}: images as they were written: {intact}; not as they were written: {wrong}; without a JSON file: {}\n",
            folder.display(),
            unknown.len()
        ),
    ))
}

/// The fields of a JSON file that are checked, in all schemas.
#[derive(Deserialize)]
struct SidecarOutput {
    schema: String,
    output: Option<OutputFile>,
}

/// Reads the file name and digest of the image of a JSON file; `None` for a JSON file with another schema.
///
/// # Errors
/// If the JSON file has no digest of its image, or names an image outside of its folder.
fn read_output(file: &Path) -> Result<Option<OutputFile>> {
    let text = files::text(file)?;
    let Ok(sidecar) = serde_json::from_str::<SidecarOutput>(&text) else {
        return Ok(None);
    };
    if !SCHEMAS.contains(&&*sidecar.schema) {
        return Ok(None);
    }
    let Some(output) = sidecar.output else {
        return Err(Error::data(
            file.display(),
            "has no digest of its image: an older version wrote it; run `synthesize` again to add it",
        ));
    };
    if Path::new(&output.file).components().count() != 1 {
        return Err(Error::data(file.display(), "names an image outside of its folder"));
    }
    Ok(Some(output))
}

/// Compares an image with the digest in its JSON file.
///
/// # Errors
/// If the image is missing or has other bytes.
fn check_image(file: &Path, output: &OutputFile) -> Result<()> {
    let image = file.with_file_name(&output.file);
    let bytes = files::bytes(&image)?;
    match output.fault(&bytes) {
        None => Ok(()),
        Some(fault) => Err(Error::data(image.display(), fault)),
    }
}
