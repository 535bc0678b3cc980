//! `enhance`: writes enhanced images, or describes or examines an enhancer.
//!
//! `enhance doctor`: runs a model on dark frames with each convention, and writes a page, a picture and a proposed
//! sidecar.
//!
//! HTML page of an examined enhancer: [`page`].

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use darkqa_base::error::{Error, Result};
use darkqa_base::files::write;
use darkqa_base::types::manifests::Status;
use darkqa_base::types::{Decides, Digest, EnhancerName, FrameId, InputNote, Rgb, Severity};
use darkqa_data::inputs::Inputs;
use darkqa_data::{FolderArgs, Picture};
use darkqa_engine::images::enhancement::enhancers::{EnhancerModels, EnhancerRunArgs};
use darkqa_engine::images::enhancement::latency::Latency;
use darkqa_engine::images::enhancement::{dark_or_darkened, evenly_spaced_indices};
use darkqa_engine::images::frames::InputTally;
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::stored::{ImageCounts, ImageOrigin, ImageRefusals, OutputImage};
use darkqa_engine::manifest;
use darkqa_enhance::{
    Enhancer, Examination, FRAMES, ImageOutput, ModelFile, Settled, SizeArgs, burnt_out, list_of_presets,
};
use darkqa_light::expose;
use darkqa_pictures::{Payload, PayloadFormat, png};
use darkqa_report::charts::sheet::{ContactColumn, contact};
use darkqa_report::template::render;
use darkqa_runs::Outcome;
use darkqa_runs::resolved_shard::{ShardArgs, keep_shard};

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
struct OneEnhancerArgs {
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
    enhancer: OneEnhancerArgs,
}

/// The flags of `enhance doctor`.
#[derive(Debug, Args)]
struct DoctorArgs {
    /// The enhancer.
    #[command(flatten)]
    enhancer: OneEnhancerArgs,
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
    enhancer: OneEnhancerArgs,
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

impl OneEnhancerArgs {
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
    let mut outcome = doctor(&args.files, image, &mut enhancer, &dark, &sample)?;
    if outcome.status == Status::Complete {
        outcome.output += &Latency::measure(&mut enhancer, &dark).to_string();
    }
    Ok(outcome)
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
    let refusals = ImageRefusals::default();
    let mut burnt = Vec::new();
    let mut latency = Latency::new(enhancer.threads());
    for entry in &images.entries {
        let picture = images.picture(entry);
        let outcome = picture.and_then(|picture| {
            tally.add(&entry.id, &picture.note());
            let origin = EnhancedOrigin::new(&entry.id, &picture, &settings);
            let place =
                OutputImage::new(out, &entry.stem, args.force).with_overruled_problem(overruled_problem.clone());
            place.write_unless_present(&origin, || {
                let degraded = picture.decode()?;
                let enhanced = latency
                    .time((degraded.width(), degraded.height()), || enhancer.enhance(&degraded))
                    .map_err(|e| Error::data(format_args!("image {:?}", entry.id.0), e))?;
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
            "{}: {} made by {}{}{}\n{sizes}{latency}",
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
    let mut settings = manifest::enhancer_definition(digest, size);
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
fn open_for_examination(args: &OneEnhancerArgs) -> Result<(Enhancer, ImageOutput)> {
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

/// File names of the page and the picture.
const PAGE: &str = "doctor.html";
const PICTURE: &str = "doctor.png";

/// The flags of the files of an examination.
#[derive(Debug, Args)]
pub(super) struct DoctorFileArgs {
    /// Where doctor.html and doctor.png go
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    out: PathBuf,
    /// Write the sidecar that is proposed beside the model; an existing one is never replaced
    #[arg(long, add = Decides::Nothing)]
    write: bool,
}

/// Examines the model on dark frames, and writes the page and the picture, with `--write` also the proposed sidecar.
///
/// # Errors
/// If the model accepts none of the sizes of the probe, a file cannot be written, or `--write` is set and a sidecar
/// exists.
fn doctor(
    args: &DoctorFileArgs,
    image: ImageOutput,
    enhancer: &mut Enhancer,
    dark: &[Rgb],
    sample: &[Rgb],
) -> Result<Outcome> {
    let out = &args.out;
    let examination = enhancer.examine(dark, image)?;
    let burnt = match examination.settled {
        Settled::Yes => burnt_out_text(enhancer, sample),
        Settled::No => None,
    };
    let model = enhancer.path();
    let lines: Vec<String> = examination.proposal.iter().map(|line| format!("`{}`", line.line)).collect();
    let mut sidecar = String::new();
    for line in &examination.proposal {
        let _ = writeln!(sidecar, "{} # {}", line.line, line.reason);
    }
    let html = html(model, enhancer, &examination, &sidecar)?;
    write(&out.join(PAGE), html.as_bytes())?;
    write(&out.join(PICTURE), &png(&picture(&examination))?)?;
    let mut output = format!("{}\n", examination.conclusion);
    if let Some(burnt) = burnt {
        let _ = writeln!(output, "{burnt}");
    }
    if !lines.is_empty() {
        let path = enhancer.sidecar_path();
        let _ = writeln!(output, "\nProposed for {}:\n{sidecar}", path.display());
        if args.write {
            if !model.is_file() {
                let problem = "a built-in enhancer is not a file, so no settings can be written next to it";
                return Err(Error::usage("--write", problem));
            }
            if path.exists() {
                return Err(Error::usage(
                    "--write",
                    format_args!(
                        "{} exists and is never replaced; edit these lines in it: {}; {} shows why",
                        path.display(),
                        lines.join(", "),
                        out.join(PAGE).display()
                    ),
                ));
            }
            write(&path, sidecar.as_bytes())?;
            let _ = writeln!(output, "written: {}", path.display());
        }
    }
    if lines.is_empty() && args.write {
        let path = enhancer.sidecar_path();
        let _ = writeln!(output, "not written, because no line is proposed: {}", path.display());
    }
    let _ = writeln!(output, "page: {}", out.join(PAGE).display());
    let _ = writeln!(output, "picture: {}", out.join(PICTURE).display());
    Ok(Outcome::text(
        match examination.settled {
            Settled::Yes => Status::Complete,
            Settled::No => Status::Incomplete,
        },
        output,
    ))
}

/// A sentence about burnt-out images of the sample as given and at L1, which are brighter than the frames of the
/// examination; `None` if no image is burnt out.
fn burnt_out_text(enhancer: &mut Enhancer, sample: &[Rgb]) -> Option<String> {
    let mut parts = Vec::new();
    for (words, drop) in [("as they are", None), ("at L1", Some(Severity::L1))] {
        let shares: Vec<f64> = sample
            .iter()
            .filter_map(|image| {
                let image = match drop {
                    None => image.clone(),
                    Some(drop) => expose(image, drop),
                };
                burnt_out([&image, &enhancer.enhance(&image).ok()?])
            })
            .collect();
        if !shares.is_empty() {
            let mean = shares.iter().sum::<f64>() / shares.len() as f64;
            let (burnt, all) = (shares.len(), sample.len());
            parts.push(format!("{burnt} of {all} {words} ({:.0} % of the pixels)", 100.0 * mean));
        }
    }
    (!parts.is_empty()).then(|| {
        format!(
            "Brighter images are burnt out, with codes of 254 or 255 where the dark ones have detail: {}.",
            parts.join(", ")
        )
    })
}

fn html(model: &Path, enhancer: &Enhancer, examination: &Examination, sidecar: &str) -> Result<String> {
    let columns = examination.columns.iter().map(|column| {
        let cells = column.images.iter().map(|image| {
            let facts = image.facts;
            Ok(DoctorCell {
                image: data_url(&image.image)?,
                facts: format!(
                    "mean {:.0}, {:.0} to {:.0}, {:.0} % cut off",
                    facts.brightness,
                    facts.darkest,
                    facts.brightest,
                    100.0 * facts.clipped
                ),
                problem: image.problem.clone(),
            })
        });
        Ok(DoctorColumn {
            title: column.title.clone(),
            problem: column.problem.clone(),
            cells: cells.collect::<Result<_>>()?,
        })
    });
    let frames = examination.frames.iter().map(data_url);
    let file = model.file_name().unwrap_or_default();
    page(&DoctorPage {
        model: file.to_string_lossy().into_owned(),
        conclusion: examination.conclusion.clone(),
        is_settled: examination.settled == Settled::Yes,
        sidecar: sidecar.to_owned(),
        frames: frames.collect::<Result<_>>()?,
        columns: columns.collect::<Result<_>>()?,
        description: enhancer.describe(),
        sizes: examination.sizes.clone(),
    })
}

fn data_url(image: &Rgb) -> Result<String> {
    let payload = Payload::encode(image, PayloadFormat::Png)?;
    Ok(String::from_utf8_lossy(&payload.data_url()).into_owned())
}

fn picture(examination: &Examination) -> Rgb {
    let mut columns =
        vec![ContactColumn { label: "dark frame".to_owned(), images: examination.frames.iter().collect() }];
    columns.extend(examination.columns.iter().map(|column| ContactColumn {
        label: column.title.clone(),
        images: column.images.iter().map(|image| &image.image).collect(),
    }));
    contact(&columns)
}

/// Template of the page.
const TEMPLATE: &str = include_str!("enhance.html");

/// Values of the page.
#[derive(Debug, Serialize)]
pub(crate) struct DoctorPage {
    /// Name of the model's file.
    pub(crate) model: String,
    /// The conclusion from the images.
    pub(crate) conclusion: String,
    /// True if exactly one convention is plausible.
    pub(crate) is_settled: bool,
    /// The lines of the proposed sidecar.
    pub(crate) sidecar: String,
    /// The dark frames, as data URLs.
    pub(crate) frames: Vec<String>,
    pub(crate) columns: Vec<DoctorColumn>,
    /// Current input and output conventions of the model.
    pub(crate) description: String,
    /// Resizing or padding that the sizes of the frames require.
    pub(crate) sizes: String,
}

/// Images made with one convention of the model's input and output.
#[derive(Debug, Serialize)]
pub(crate) struct DoctorColumn {
    pub(crate) title: String,
    /// Reason why the images are implausible; `None` if they are plausible.
    pub(crate) problem: Option<String>,
    /// One image for each frame.
    pub(crate) cells: Vec<DoctorCell>,
}

/// One image with its numbers.
#[derive(Debug, Serialize)]
pub(crate) struct DoctorCell {
    /// The image as a data URL.
    pub(crate) image: String,
    /// Brightness, and share of values that clamping changes.
    pub(crate) facts: String,
    /// Reason why the image is implausible; `None` if it is plausible.
    pub(crate) problem: Option<String>,
}

/// Renders the page as one HTML file.
///
/// # Errors
/// If the template cannot be rendered.
pub(crate) fn page(page: &DoctorPage) -> Result<String> {
    render(TEMPLATE, page)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_texts_are_escaped() {
        let text = page(&DoctorPage {
            model: "<b>.onnx".to_owned(),
            conclusion: "a & b".to_owned(),
            is_settled: false,
            sidecar: String::new(),
            frames: vec!["data:image/png;base64,AAAA".to_owned()],
            columns: vec![DoctorColumn {
                title: "0..1 in and 0..1 out".to_owned(),
                problem: Some("\"><script>".to_owned()),
                cells: vec![DoctorCell {
                    image: "data:image/png;base64,BBBB".to_owned(),
                    facts: "mean 3".to_owned(),
                    problem: None,
                }],
            }],
            description: String::new(),
            sizes: String::new(),
        })
        .unwrap();
        assert!(text.contains("&lt;b&gt;.onnx") && text.contains("a &amp; b"));
        assert!(!text.contains("<script>") && text.contains("BBBB"));
    }
}
