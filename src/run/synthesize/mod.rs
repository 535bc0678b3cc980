//! `synthesize`: low-light versions of images as files, as an evaluation of the same folder would send them.

mod sheet;
mod sidecar;

use std::fs;
use std::path::Path;

use rayon::prelude::*;

use crate::ask::png;
use crate::config::{Existing, Light, Product, Synthesize};
use crate::dataset::Picture;
use crate::dataset::inputs::{Entry, Inputs, stem};
use crate::error::{Error, Result};
use crate::files::write;
use crate::job::Outcome;
use crate::job::frame_work::{FrameWork, Steps};
use crate::job::progress::{Bar, Progress};
use crate::job::recipe::Recipe;
use crate::job::source::Frames;
use crate::job::timings::Timings;
use crate::job::workers::pool;
use crate::synthesis::NoiseKey;
use crate::types::manifest::Status;
use crate::types::{Condition, Degradation, FrameId, Rgb};
use sidecar::Sidecar;

/// Makes the images that the command asks for.
///
/// What cannot be made of one frame is said, counted, and does not stop the others.
///
/// # Errors
/// Where nothing can be made: no such input, two frames of one name, no folder to write to.
pub fn synthesize(config: &Synthesize, progress: &Progress) -> Result<Outcome> {
    let frames = Inputs::open(&config.inputs, config.most_pixels)?;
    let cores = pool(config.threads)?;
    fs::create_dir_all(&config.out).map_err(|e| Error::file(&config.out, "make", e))?;
    if let Product::Replay(file) = &config.product {
        return cores.install(|| replay(config, &frames, file));
    }
    let files = files(config);
    let bar = progress.bar("images", frames.entries.len() * files.len());
    let made: Vec<Tally> = cores.install(|| {
        let entries = frames.entries.par_iter();
        entries
            .map(|entry| one(config, &frames, entry, &files, &bar))
            .collect()
    });
    drop(bar);
    let total = made.iter().fold(Tally::default(), |sum, tally| Tally {
        made: sum.made + tally.made,
        kept: sum.kept + tally.kept,
        failed: sum.failed + tally.failed,
    });
    Ok(total.verdict(config, frames.entries.len()))
}

/// What became of the images.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    made: usize,
    kept: usize,
    failed: usize,
}

impl Tally {
    fn verdict(self, config: &Synthesize, frames: usize) -> Outcome {
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
                config.out.display()
            ),
        }
    }
}

/// One file of a frame.
#[derive(Debug, Clone)]
enum File {
    Image(Option<Degradation>),
    LevelSheet,
    NoiseSheet,
}

/// The files of each frame.
fn files(config: &Synthesize) -> Vec<File> {
    match config.product {
        Product::LevelSheet => vec![File::LevelSheet],
        Product::NoiseSheet => vec![File::NoiseSheet],
        Product::Images | Product::Replay(_) => {
            let degradations = config.light.degradations().into_iter();
            degradations.map(File::Image).collect()
        }
    }
}

/// Makes all images of one frame.
fn one(config: &Synthesize, frames: &Inputs, entry: &Entry, files: &[File], bar: &Bar) -> Tally {
    let mut tally = Tally::default();
    let frames = OneFrame { frames, entry };
    let recipe = Recipe::lossless(&config.light.sensor, &[]);
    let timings = Timings::default();
    let steps = Steps {
        frames: &frames,
        recipe: &recipe,
        limit: None,
        timings: &timings,
    };
    let mut work = Work {
        config,
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
            File::Image(degradation) => work.image(degradation.as_ref()),
            File::LevelSheet => work.sheet("levels", sheet::levels),
            File::NoiseSheet => work.sheet("noise", sheet::terms),
        };
        match made {
            Ok(Made::New) => tally.made += 1,
            Ok(Made::Kept) => tally.kept += 1,
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
    entry: &'a Entry,
}

impl Frames for OneFrame<'_> {
    fn picture(&self, _: &FrameId) -> Result<Picture> {
        self.frames.picture(self.entry)
    }
}

/// One frame being worked on.
struct Work<'a> {
    config: &'a Synthesize,
    entry: &'a Entry,
    frame: FrameWork<'a>,
}

/// Whether an image was made.
enum Made {
    New,
    Kept,
}

impl Work<'_> {
    fn image(&mut self, how: Option<&Degradation>) -> Result<Made> {
        let light = &self.config.light;
        let key = NoiseKey::new(light.sensor.seed, &self.entry.id);
        let condition = Condition::raw(how.cloned());
        let name = format!("{}_{condition}", self.entry.stem);
        let picture = self.frame.picture()?;
        let sidecar = Sidecar::new(&self.entry.id, picture, how, light, &key)?;
        let [image, json] = [".png", ".json"].map(|end| self.config.out.join(name.clone() + end));
        if self.config.existing == Existing::Kept && image.exists() && json.exists() {
            if sidecar.is_at(&json)? {
                return Ok(Made::Kept);
            }
            let problem = "made from another image or with other settings; --force makes it again, another --out keeps both";
            return Err(Error::data(json.display(), problem));
        }
        write(&image, &png(self.frame.degraded(how)?)?)?;
        write(&json, sidecar.text().as_bytes())?;
        Ok(Made::New)
    }

    /// A figure; it has no file beside it, so one that is there is kept whatever it shows.
    fn sheet(
        &mut self,
        kind: &str,
        draw: fn(&Rgb, &FrameId, &Light) -> Result<Rgb>,
    ) -> Result<Made> {
        let path = self
            .config
            .out
            .join(format!("{}_{kind}.png", self.entry.stem));
        if self.config.existing == Existing::Kept && path.exists() {
            return Ok(Made::Kept);
        }
        let figure = draw(self.frame.clean()?, &self.entry.id, &self.config.light)?;
        write(&path, &png(&figure)?)?;
        Ok(Made::New)
    }
}

/// Makes the one image again that a file tells of.
fn replay(config: &Synthesize, frames: &Inputs, file: &Path) -> Result<Outcome> {
    let sidecar = Sidecar::read(file)?;
    let [entry] = &frames.entries[..] else {
        let problem = format_args!(
            "one image is made again from one INPUT, not from {}",
            frames.entries.len()
        );
        return Err(Error::usage("--from", problem));
    };
    let picture = frames.picture(entry)?;
    let dark = sidecar.replay(&picture, file)?;
    let path = config.out.join(sidecar.name(&stem(&sidecar.frame())?));
    if config.existing == Existing::Kept && path.exists() {
        let problem = "there already; --force makes it again";
        return Err(Error::data(path.display(), problem));
    }
    write(&path, &png(&dark)?)?;
    let made = Tally {
        made: 1,
        ..Tally::default()
    };
    Ok(made.verdict(config, 1))
}
