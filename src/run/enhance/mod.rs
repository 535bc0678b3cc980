//! `enhance`: writing images that an enhancer made, describing the enhancer, or examining it.

mod doctor;
mod origin;

use std::path::{Path, PathBuf};

use clap::Args;

use crate::dataset::inputs::Inputs;
use crate::dataset::{CodesArgs, PixelLimit, RootArgs};
use crate::error::{Error, Result};
use crate::images::dark_frames::{darkened, evenly};
use crate::images::enhancers::{EnhancerRunArgs, OpenEnhancers};
use crate::images::input_tally::InputTally;
use crate::images::placed_image::{ImageOutcome, Placed};
use crate::images::progress::Progress;
use crate::runs::Outcome;
use crate::runs::part_args::{PartArgs, keep_part};
use crate::types::manifest::Status;
use crate::types::{Decides, Rgb};
use darkqa_enhance::{Enhancer, FRAMES, ImageOutput, ModelFile, list_of_presets};
use doctor::DoctorArgs;
use origin::EnhancedOrigin;

/// Number of outputs that are tried as the image; chosen: models that give each of their steps have fewer.
const MOST_OUTPUTS: usize = 16;

/// The flags of `enhance`.
#[derive(Debug, Args)]
pub(crate) struct EnhanceArgs {
    /// The enhancer: lift or gray-gain, which are built in; FILE.onnx; or PRESET:FILE.onnx (zero-dce, zero-dce++, ruas-lol,
    /// ruas-upe, ruas-dark, sci, iat, pairlie, pairlie-lol, enlightengan, uretinex, retinexformer, darkir, cidnet, llformer,
    /// restormer, mirnet, kind, agllnet, zero-dce-tf)
    #[arg(value_name = "MODEL", required_unless_present = "presets", add = Decides::Trials)]
    pub model: Option<PathBuf>,
    /// Images (PNG, JPEG, WebP, TIFF, BMP) and folders of frames
    #[arg(value_name = "INPUT", required_unless_present_any = ["describe", "presets"], add = Decides::Pixels)]
    pub inputs: Vec<PathBuf>,
    /// Where the enhanced images go, as PNG under their own names, each with a JSON file; default: nowhere, with --describe
    #[arg(long, value_name = "DIR", required_unless_present_any = ["describe", "presets"], add = Decides::Nothing)]
    pub out: Option<PathBuf>,
    /// Print how the model's input and output are read, and why; enhances nothing
    #[arg(long, conflicts_with_all = ["inputs", "out", "shard"], add = Decides::Nothing)]
    pub describe: bool,
    /// Print the presets of published enhancers, each with repository, licence, conventions and the command that exports it
    #[arg(long, conflicts_with_all = ["model", "inputs", "out", "describe", "shard"], add = Decides::Nothing)]
    pub presets: bool,
    /// The flags of the examination.
    #[command(flatten)]
    pub doctor: DoctorArgs,
    /// The flags for running enhancers.
    #[command(flatten)]
    pub loading: EnhancerRunArgs,
    /// The part of the images.
    #[command(flatten)]
    pub part: PartArgs,
    /// Replace images that exist already, also those of other models and settings
    #[arg(long, help_heading = "Output", add = Decides::Nothing)]
    pub force: bool,
    /// The maximum size of an image.
    #[command(flatten)]
    pub limit: PixelLimit,
    /// What the codes of images mean.
    #[command(flatten)]
    pub codes: CodesArgs,
    /// Further folders of the images.
    #[command(flatten)]
    pub root: RootArgs,
}

/// Enhances the images, or describes the model.
///
/// If one image fails, the error is logged and counted, and the others continue.
///
/// # Errors
/// If the model or an input is missing, two images have the same name, or the folder cannot be written to.
pub(crate) fn enhance(args: &EnhanceArgs, progress: &Progress) -> Result<Outcome> {
    let Some(model) = &args.model else {
        return Ok(Outcome::text(Status::Complete, list_of_presets()?));
    };
    let file = ModelFile::read(model).map_err(|e| e.usage_at("MODEL"))?;
    let digest = file.digest();
    let (mut enhancer, image) = open(file, model, args)?;
    let Some(out) = &args.out else {
        return Ok(Outcome::text(Status::Complete, enhancer.describe()));
    };
    let mut images = Inputs::open(
        &args.inputs,
        &args.root.data_root,
        args.codes.rule(args.limit),
    )?;
    keep_part(&mut images.entries, args.part.resolve()?)?;
    let sample = evenly(images.entries.len(), FRAMES).into_iter();
    let sample = sample.map(|place| images.picture(&images.entries[place])?.decode());
    // An image that cannot be read is named when its turn comes.
    let sample: Vec<Rgb> = sample.filter_map(Result::ok).collect();
    if args.doctor.doctor {
        if sample.is_empty() {
            let problem = "needs at least one image that can be read";
            return Err(Error::usage("INPUT", problem));
        }
        let dark = darkened(&sample);
        let (model, n) = (model.display(), dark.len());
        progress.say(&format!(
            "{model} enhances {n} dark images with each convention"
        ));
        return doctor::doctor(&args.doctor, image, &mut enhancer, &dark, out);
    }
    if !sample.is_empty() {
        enhancer.probe(&darkened(&sample), args.loading.probe.implausible())?;
    }
    let (bar, tally) = (
        progress.bar("images", images.entries.len()),
        InputTally::default(),
    );
    let settings = origin::settings(&digest, &args.loading.size);
    let used_anyway = enhancer.used_anyway();
    let (mut written, mut unchanged, mut failed) = (0, 0, 0);
    for entry in &images.entries {
        let picture = images.picture(entry);
        let outcome = picture.and_then(|picture| {
            tally.add(&entry.id, &picture.note());
            let origin = EnhancedOrigin::new(&entry.id, &picture, &settings);
            let place = Placed::new(out, &entry.stem, args.force).used_anyway(used_anyway.clone());
            place.put(&origin, || {
                let enhanced = enhancer.enhance(&picture.decode()?);
                enhanced.map_err(|e| Error::data(format_args!("image {:?}", entry.id.0), e))
            })
        });
        match outcome {
            Ok(ImageOutcome::Written) => written += 1,
            Ok(ImageOutcome::Unchanged) => unchanged += 1,
            Err(e) => {
                failed += 1;
                tracing::error!("{e}");
            }
        }
        bar.inc();
    }
    drop(bar);
    tally.warn();
    let count = |n: usize, what: &str| match n {
        0 => String::new(),
        n => format!(", {n} {what}"),
    };
    Ok(Outcome::wrote(
        out,
        if failed == 0 {
            Status::Complete
        } else {
            Status::Incomplete
        },
        format!(
            "{}: {written} made by {}{}{}{}\n",
            out.display(),
            enhancer.name(),
            if used_anyway.is_some() && written > 0 {
                " because of --llie-anyway"
            } else {
                ""
            },
            count(unchanged, "left as they were (--force makes them again)"),
            count(failed, "failed")
        ),
    ))
}

/// The enhancer, and whether it is known which of its outputs is the image. If it is not, `--doctor` examines all of them.
fn open(file: ModelFile, model: &Path, args: &EnhanceArgs) -> Result<(Enhancer, ImageOutput)> {
    let load = |file: ModelFile| -> Result<Enhancer> {
        let enhancers = OpenEnhancers::load(vec![file], &args.loading)?.take()?;
        let mut enhancers = enhancers.into_iter();
        let only = enhancers.next();
        only.ok_or_else(|| Error::usage("MODEL", "one model expected"))
    };
    let problem = match load(file) {
        Ok(enhancer) => return Ok((enhancer, ImageOutput::Known)),
        Err(problem) => problem,
    };
    if args.doctor.doctor {
        for place in 0..MOST_OUTPUTS {
            if let Ok(enhancer) = load(ModelFile::read(model)?.with_output(place)) {
                return Ok((enhancer, ImageOutput::Unknown));
            }
        }
    }
    Err(problem)
}
