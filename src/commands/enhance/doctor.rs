//! `enhance doctor`: runs a model on dark frames with each convention, and writes a page, a picture and a proposed
//! sidecar.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::error::{Error, Result};
use crate::files::write;
use crate::pictures::{Payload, PayloadFormat, png};
use crate::report::charts::sheet::{ContactColumn, contact};
use crate::report::doctor::{DoctorCell, DoctorColumn, DoctorPage, page};
use crate::runs::Outcome;
use crate::types::manifests::Status;
use crate::types::{Decides, Rgb, Severity};
use darkqa_enhance::{Enhancer, Examination, ImageOutput, Settled, burnt_out};
use darkqa_light::expose;

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
pub(super) fn doctor(
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
