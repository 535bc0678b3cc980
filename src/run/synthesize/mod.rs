//! `synthesize`: low-light versions of images as files, as an evaluation of the same folder would send them.

mod sheet;
mod sidecar;

use std::fs;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use rayon::prelude::*;

use crate::ask::png;
use crate::dataset::inputs::{InputFrame, Inputs, stem};
use crate::dataset::{Picture, PixelLimit};
use crate::error::{Error, Result};
use crate::files::write;
use crate::job::Outcome;
use crate::job::frame_work::{FrameWork, ImageSteps};
use crate::job::progress::{Progress, StepBar};
use crate::job::recipe::Recipe;
use crate::job::source::Frames;
use crate::job::timings::Timings;
use crate::job::workers::{ThreadArgs, pool};
use crate::synthesis::{LightArgs, LightSettings, NoiseKey};
use crate::types::Decides;
use crate::types::manifest::Status;
use crate::types::{Condition, Degradation, FrameId, Rgb};
use sidecar::ImageSidecar;

/// The flags of `synthesize`.
#[derive(Debug, Args)]
pub(crate) struct SynthesizeArgs {
    /// Images, folders of images, or folders of frames (frames.jsonl)
    #[arg(required = true, value_name = "INPUT", add = Decides::Pixels)]
    pub inputs: Vec<PathBuf>,
    /// Where the images go, each with a JSON file that holds all that made it
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: PathBuf,
    /// Light.
    #[command(flatten)]
    pub light: LightArgs,
    /// Make again the image that this JSON file stands beside, from the one INPUT that it was made from; default: make images of
    /// all levels
    #[arg(long, value_name = "FILE", help_heading = "Synthesis", add = Decides::Pixels)]
    pub from: Option<PathBuf>,
    /// One figure per input instead; default: images
    #[arg(long, value_enum, help_heading = "Synthesis", conflicts_with = "from", add = Decides::Nothing)]
    pub sheet: Option<Sheet>,
    /// Make again what is there already
    #[arg(long, help_heading = "Synthesis", add = Decides::Nothing)]
    pub force: bool,
    /// How large an image may be.
    #[command(flatten)]
    pub limit: PixelLimit,
    /// On how many threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// A figure of one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Sheet {
    /// Both variants by level, with amplified crops
    Levels,
    /// Each term of the noise alone
    Noise,
}

/// The flags, and the light that they say.
struct ImageMaking<'a> {
    args: &'a SynthesizeArgs,
    light: LightSettings,
}

/// Makes the images that the command asks for.
///
/// What cannot be made of one frame is said, counted, and does not stop the others.
///
/// # Errors
/// Where nothing can be made: no such input, two frames of one name, no folder to write to.
pub(crate) fn synthesize(args: &SynthesizeArgs, progress: &Progress) -> Result<Outcome> {
    let making = &ImageMaking {
        args,
        light: LightSettings::resolve(&args.light)?,
    };
    let frames = Inputs::open(&args.inputs, args.limit.max_pixels.get())?;
    let cores = pool(args.threads.threads)?;
    fs::create_dir_all(&args.out).map_err(|e| Error::file(&args.out, "make", e))?;
    if let Some(file) = &args.from {
        return cores.install(|| replay(args, &frames, file));
    }
    let files = files(making);
    let bar = progress.bar("images", frames.entries.len() * files.len());
    let made: Vec<ImageCounts> = cores.install(|| {
        let entries = frames.entries.par_iter();
        entries
            .map(|entry| one(making, &frames, entry, &files, &bar))
            .collect()
    });
    drop(bar);
    let total = made
        .iter()
        .fold(ImageCounts::default(), |sum, tally| ImageCounts {
            made: sum.made + tally.made,
            kept: sum.kept + tally.kept,
            failed: sum.failed + tally.failed,
        });
    Ok(total.outcome(&args.out, frames.entries.len()))
}

/// What became of the images.
#[derive(Debug, Clone, Copy, Default)]
struct ImageCounts {
    made: usize,
    kept: usize,
    failed: usize,
}

impl ImageCounts {
    fn outcome(self, out: &Path, frames: usize) -> Outcome {
        let Self { made, kept, failed } = self;
        let kept = match kept {
            0 => String::new(),
            n => format!(", {n} kept as they were (--force makes them again)"),
        };
        let lost = match failed {
            0 => String::new(),
            n => format!(", {n} failed"),
        };
        Outcome {
            status: if failed == 0 {
                Status::Complete
            } else {
                Status::Incomplete
            },
            output: format!(
                "{}: {made} made of {frames} frames{kept}{lost}\n",
                out.display()
            ),
        }
    }
}

/// One file of a frame.
#[derive(Debug, Clone)]
enum FrameFile {
    Image(Option<Degradation>),
    Sheet(Sheet),
}

/// The files of each frame.
fn files(making: &ImageMaking<'_>) -> Vec<FrameFile> {
    if let Some(sheet) = making.args.sheet {
        return vec![FrameFile::Sheet(sheet)];
    }
    let degradations = making.light.degradations().into_iter();
    degradations.map(FrameFile::Image).collect()
}

/// Makes all images of one frame.
fn one(
    making: &ImageMaking<'_>,
    frames: &Inputs,
    entry: &InputFrame,
    files: &[FrameFile],
    bar: &StepBar,
) -> ImageCounts {
    let mut tally = ImageCounts::default();
    let frames = OneFrame { frames, entry };
    let recipe = Recipe::lossless(&making.light.sensor, &[]);
    let timings = Timings::default();
    let steps = ImageSteps {
        frames: &frames,
        recipe: &recipe,
        limit: None,
        timings: &timings,
    };
    let mut work = SynthesisWork {
        making,
        entry,
        frame: FrameWork::of(steps, entry.id.clone()),
    };
    if let Err(e) = work.frame.picture() {
        tracing::error!("{e}");
        tally.failed = files.len();
        return tally;
    }
    for file in files {
        let made = match file {
            FrameFile::Image(degradation) => work.image(degradation.as_ref()),
            FrameFile::Sheet(Sheet::Levels) => work.sheet("levels", sheet::levels),
            FrameFile::Sheet(Sheet::Noise) => work.sheet("noise", sheet::terms),
        };
        match made {
            Ok(ImageOutcome::New) => tally.made += 1,
            Ok(ImageOutcome::Kept) => tally.kept += 1,
            Err(e) => {
                tracing::error!("{e}");
                tally.failed += 1;
            }
        }
        bar.inc();
    }
    tally
}

/// One frame of the inputs, whose name may be that of a frame of another input.
struct OneFrame<'a> {
    frames: &'a Inputs,
    entry: &'a InputFrame,
}

impl Frames for OneFrame<'_> {
    fn picture(&self, _: &FrameId) -> Result<Picture> {
        self.frames.picture(self.entry)
    }
}

/// One frame being worked on.
struct SynthesisWork<'a> {
    making: &'a ImageMaking<'a>,
    entry: &'a InputFrame,
    frame: FrameWork<'a>,
}

/// Whether an image was made.
enum ImageOutcome {
    New,
    Kept,
}

impl SynthesisWork<'_> {
    fn image(&mut self, how: Option<&Degradation>) -> Result<ImageOutcome> {
        let light = &self.making.light;
        let key = NoiseKey::new(light.sensor.seed, &self.entry.id);
        let condition = Condition::raw(how.cloned());
        let name = format!("{}_{condition}", self.entry.stem);
        let picture = self.frame.picture()?;
        let sidecar = ImageSidecar::new(&self.entry.id, picture, how, light, &key)?;
        let [image, json] =
            [".png", ".json"].map(|end| self.making.args.out.join(name.clone() + end));
        if !self.making.args.force && image.exists() && json.exists() {
            if sidecar.is_at(&json)? {
                return Ok(ImageOutcome::Kept);
            }
            let problem = "made from another image or with other settings; --force makes it again, another --out keeps both";
            return Err(Error::data(json.display(), problem));
        }
        write(&image, &png(self.frame.degraded(how)?)?)?;
        write(&json, sidecar.text().as_bytes())?;
        Ok(ImageOutcome::New)
    }

    /// A figure; it has no file beside it, so one that is there is kept whatever it shows.
    fn sheet(
        &mut self,
        kind: &str,
        draw: fn(&Rgb, &FrameId, &LightSettings) -> Result<Rgb>,
    ) -> Result<ImageOutcome> {
        let path = self
            .making
            .args
            .out
            .join(format!("{}_{kind}.png", self.entry.stem));
        if !self.making.args.force && path.exists() {
            return Ok(ImageOutcome::Kept);
        }
        let figure = draw(self.frame.clean()?, &self.entry.id, &self.making.light)?;
        write(&path, &png(&figure)?)?;
        Ok(ImageOutcome::New)
    }
}

/// Makes the one image again that a file tells of.
fn replay(args: &SynthesizeArgs, frames: &Inputs, file: &Path) -> Result<Outcome> {
    let sidecar = ImageSidecar::read(file)?;
    let [entry] = &frames.entries[..] else {
        let problem = format_args!(
            "one image is made again from one INPUT, not from {}",
            frames.entries.len()
        );
        return Err(Error::usage("--from", problem));
    };
    let picture = frames.picture(entry)?;
    let dark = sidecar.replay(&picture, file)?;
    let path = args.out.join(sidecar.name(&stem(&sidecar.frame())?));
    if !args.force && path.exists() {
        let problem = "there already; --force makes it again";
        return Err(Error::data(path.display(), problem));
    }
    write(&path, &png(&dark)?)?;
    let made = ImageCounts {
        made: 1,
        ..ImageCounts::default()
    };
    Ok(made.outcome(&args.out, 1))
}
