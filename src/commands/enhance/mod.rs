//! `enhance`: writes enhanced images, or describes or examines an enhancer.

mod doctor;

use std::path::PathBuf;

use clap::{Args, Subcommand};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::data::inputs::Inputs;
use crate::data::{FolderArgs, Picture};
use crate::engine::identity;
use crate::engine::images::enhancement::enhancers::{EnhancerModels, EnhancerRunArgs};
use crate::engine::images::enhancement::{dark_or_darkened, evenly_spaced_indices};
use crate::engine::images::frames::InputTally;
use crate::engine::images::progress::Progress;
use crate::engine::images::stored::{ImageCounts, ImageOrigin, OutputImage, Refusals};
use crate::error::{Error, Result};
use crate::runs::Outcome;
use crate::runs::shard_args::{ShardArgs, keep_shard};
use crate::types::manifests::Status;
use crate::types::{Decides, Digest, EnhancerName, FrameId, InputNote, Rgb};
use darkqa_enhance::{Enhancer, FRAMES, ImageOutput, ModelFile, SizeArgs, burnt_out, list_of_presets};
use doctor::DoctorFileArgs;

/// Maximum number of outputs tried as the image. Chosen: models that output each of their steps have fewer.
const MAX_OUTPUTS: usize = 16;

/// `enhance`, or another form of it.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(crate) struct EnhanceCommand {
    /// The form; `None` for enhanced images.
    #[command(subcommand)]
    form: Option<EnhanceForm>,
    /// Flags for enhanced images.
    #[command(flatten)]
    images: Option<EnhanceArgs>,
}

/// The other forms of `enhance`.
#[derive(Debug, Subcommand)]
enum EnhanceForm {
    /// Print how the model's input and output are read, and why; enhances nothing
    Describe(DescribeArgs),
    /// Run the model on dark versions of images with each convention that could be meant, and propose a sidecar
    ///
    /// Writes doctor.html and doctor.png into the folder of --out, with the sidecar that would repair it. Ends with 0
    /// if there is one plausible convention and the model takes the sizes of the images, else with 1.
    Doctor(DoctorArgs),
    /// Print the presets of published enhancers, each with repository, licence, conventions and the command that
    /// exports it
    Presets,
}

/// The enhancer, and how it is run.
#[derive(Debug, Args)]
struct ModelArgs {
    /// The enhancer: lift or gray-gain, which are built in; FILE.onnx; or PRESET:FILE.onnx (zero-dce, zero-dce++,
    /// ruas-lol, ruas-upe, ruas-dark, sci, iat, pairlie, pairlie-lol, enlightengan, uretinex, retinexformer, darkir,
    /// cidnet, llformer, restormer, mirnet, kind, agllnet, zero-dce-tf)
    #[arg(value_name = "MODEL", add = Decides::Trials)]
    model: PathBuf,
    /// The flags for running enhancers.
    #[command(flatten)]
    loading: EnhancerRunArgs,
}

/// The images, and how they are read.
#[derive(Debug, Args)]
struct InputArgs {
    /// Images (PNG, JPEG, WebP, TIFF, BMP) and folders of frames
    #[arg(value_name = "INPUT", required = true, add = Decides::Pixels)]
    inputs: Vec<PathBuf>,
    /// The reading of images.
    #[command(flatten)]
    folders: FolderArgs,
}

/// The flags of `enhance describe`.
#[derive(Debug, Args)]
struct DescribeArgs {
    /// The enhancer.
    #[command(flatten)]
    enhancer: ModelArgs,
}

/// The flags of `enhance doctor`.
#[derive(Debug, Args)]
struct DoctorArgs {
    /// The enhancer.
    #[command(flatten)]
    enhancer: ModelArgs,
    /// The images.
    #[command(flatten)]
    images: InputArgs,
    /// The files of the examination.
    #[command(flatten)]
    files: DoctorFileArgs,
}

/// The flags of `enhance`.
#[derive(Debug, Args)]
#[group(arg = "out")]
struct EnhanceArgs {
    /// The enhancer.
    #[command(flatten)]
    enhancer: ModelArgs,
    /// The images.
    #[command(flatten)]
    images: InputArgs,
    /// Where the enhanced images go, as PNG under their own names, each with a JSON file
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    out: PathBuf,
    /// The part of the images.
    #[command(flatten)]
    part: ShardArgs,
    /// Replace images that exist already, also those of other models and settings
    #[arg(long, help_heading = "Output", add = Decides::Nothing)]
    force: bool,
}

impl ModelArgs {
    fn file(&self) -> Result<ModelFile> {
        ModelFile::read(&self.model).map_err(|e| e.usage_at("MODEL"))
    }

    fn open(&self, file: ModelFile) -> Result<Enhancer> {
        EnhancerModels::load(vec![file], &self.loading)?
            .take()?
            .into_iter()
            .next()
            .ok_or_else(|| Error::usage("MODEL", "one model expected"))
    }
}

impl InputArgs {
    fn open(&self) -> Result<Inputs> {
        let FolderArgs { decode, root } = &self.folders;
        Inputs::open(&self.inputs, &root.data_root, decode.rule())
    }
}

/// Enhances images, or describes or examines the model.
///
/// # Errors
/// If the model or an input is missing, or the work of the command fails.
pub(crate) fn enhance(command: &EnhanceCommand, progress: &Progress) -> Result<Outcome> {
    match (&command.form, &command.images) {
        (Some(EnhanceForm::Describe(DescribeArgs { enhancer })), _) => {
            let enhancer = enhancer.open(enhancer.file()?)?;
            Ok(Outcome::text(Status::Complete, enhancer.describe()))
        }
        (Some(EnhanceForm::Doctor(args)), _) => examine(args, progress),
        (Some(EnhanceForm::Presets), _) => Ok(Outcome::text(Status::Complete, list_of_presets()?)),
        (None, Some(args)) => enhance_images(args, progress),
        (None, None) => Err(Error::usage("MODEL", "missing; try `darkqa-eval enhance lift IMAGES… --out DIR`")),
    }
}

/// Examines the model on dark versions of images.
fn examine(args: &DoctorArgs, progress: &Progress) -> Result<Outcome> {
    let (mut enhancer, image) = open_for_examination(&args.enhancer)?;
    let sample = sample(&args.images.open()?);
    if sample.is_empty() {
        let problem = "no image could be read; give at least one";
        return Err(Error::usage("INPUT", problem));
    }
    let dark = dark_or_darkened(&sample);
    let (model, n) = (args.enhancer.model.display(), dark.len());
    progress.print_on_terminal(&format!("{model}: enhancing {n} dark images with each value range and colour order"));
    doctor::doctor(&args.files, image, &mut enhancer, &dark, &sample)
}

/// A sample of the images. Unreadable ones are skipped here, and reported when they are enhanced.
fn sample(images: &Inputs) -> Vec<Rgb> {
    evenly_spaced_indices(images.entries.len(), FRAMES)
        .into_iter()
        .filter_map(|index| images.picture(&images.entries[index]).ok()?.decode().ok())
        .collect()
}

/// Enhances the images. If one fails, the error is logged and counted, and the others continue.
///
/// # Errors
/// If the model or an input is missing, two images have the same name, or the folder cannot be written to.
fn enhance_images(args: &EnhanceArgs, progress: &Progress) -> Result<Outcome> {
    let file = args.enhancer.file()?;
    let digest = file.digest();
    let mut enhancer = args.enhancer.open(file)?;
    let (out, loading) = (&args.out, &args.enhancer.loading);
    let mut images = args.images.open()?;
    keep_shard(&mut images.entries, args.part.resolve()?)?;
    let sample = sample(&images);
    if !sample.is_empty() {
        enhancer.probe(&dark_or_darkened(&sample), loading.probe.implausible())?;
    }
    let (bar, tally) = (progress.bar("images", images.entries.len()), InputTally::default());
    let settings = pixel_settings(&digest, &loading.size);
    let overruled_problem = enhancer.overruled_problem();
    let mut counts = ImageCounts::default();
    let refusals = Refusals::default();
    let mut burnt = Vec::new();
    for entry in &images.entries {
        let picture = images.picture(entry);
        let outcome = picture.and_then(|picture| {
            tally.add(&entry.id, &picture.note());
            let origin = EnhancedOrigin::new(&entry.id, &picture, &settings);
            let place =
                OutputImage::new(out, &entry.stem, args.force).with_overruled_problem(overruled_problem.clone());
            place.write_unless_present(&origin, || {
                let degraded = picture.decode()?;
                let enhanced =
                    enhancer.enhance(&degraded).map_err(|e| Error::data(format_args!("image {:?}", entry.id.0), e))?;
                burnt.extend(burnt_out([&degraded, &enhanced]).map(|share| (&entry.id, share)));
                Ok(enhanced)
            })
        });
        match outcome {
            Ok(outcome) => {
                if let Some(refusal) = counts.add(outcome) {
                    refusals.add(refusal);
                }
            }
            Err(e) => {
                counts.failed += 1;
                tracing::error!("{e}");
            }
        }
        bar.inc();
    }
    drop(bar);
    tally.warn();
    refusals.log();
    warn_of_burnt_out(&burnt, counts.written, enhancer.name());
    let used = enhancer.usage().note();
    let sizes = if used.size_counts.whole < used.size_counts.images { used.sizes + "\n" } else { String::new() };
    Ok(Outcome::wrote(
        out,
        Outcome::complete_if(counts.failed == 0),
        format!(
            "{}: {} made by {}{}{}\n{sizes}",
            out.display(),
            counts.written,
            enhancer.name(),
            if overruled_problem.is_some() && counts.written > 0 { " because of --allow bad-enhancer" } else { "" },
            counts.not_written_text()
        ),
    ))
}

/// Warns of burnt-out images, given with their shares of white pixels, among `made` images.
fn warn_of_burnt_out(burnt: &[(&FrameId, f64)], made: usize, enhancer: &EnhancerName) {
    let Some((example, _)) = burnt.first() else {
        return;
    };
    let mean = burnt.iter().map(|(_, share)| share).sum::<f64>() / burnt.len() as f64;
    tracing::warn!(
        "{enhancer}: {} of {} burnt out, with codes of 254 or 255 where the dark ones have detail: {:.0} % of the pixels (for example {})",
        burnt.len(),
        if made == 1 { "1 image is".to_owned() } else { format!("{made} images are") },
        100.0 * mean,
        example.0
    );
}

/// All facts that determine the pixels of an enhanced image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct EnhancedOrigin {
    frame: String,
    /// Digest of the input image.
    source: String,
    /// Changes made to the image when its file was read; no fields if there were none.
    #[serde(flatten)]
    read: InputNote,
    /// Digest of the model with its sidecar, and its size settings, by flag.
    enhancer: Value,
}

impl ImageOrigin for EnhancedOrigin {
    const SCHEMAS: &'static [&'static str] = &["darkqa.enhanced/1"];
    const REPLACES_OTHER_SETTINGS: bool = false;
}

/// Settings of the enhancer that determine the pixels. The digest has a name that is understandable in messages.
fn pixel_settings(digest: &Digest, size: &SizeArgs) -> Value {
    let mut settings = identity::enhancer_definition(digest, size);
    if let Some(fields) = settings.as_object_mut()
        && let Some(digest) = fields.remove("--llie")
    {
        fields.insert("model with its sidecar".to_owned(), digest);
    }
    settings
}

impl EnhancedOrigin {
    /// The origin of a frame's image, enhanced with these settings.
    fn new(frame: &FrameId, picture: &Picture, enhancer: &Value) -> Self {
        Self {
            frame: frame.0.clone(),
            source: picture.digest().to_string(),
            read: picture.note(),
            enhancer: enhancer.clone(),
        }
    }
}

/// Opens an enhancer, and returns whether it is known which of its outputs is the image. If unknown, the first usable
/// output is opened.
fn open_for_examination(args: &ModelArgs) -> Result<(Enhancer, ImageOutput)> {
    let problem = match args.open(args.file()?) {
        Ok(enhancer) => return Ok((enhancer, ImageOutput::Known)),
        Err(problem) => problem,
    };
    for output in 0..MAX_OUTPUTS {
        if let Ok(enhancer) = args.open(args.file()?.with_output(output)) {
            return Ok((enhancer, ImageOutput::Unknown));
        }
    }
    Err(problem)
}
