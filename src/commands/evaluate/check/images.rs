//! Checks of the images of the questions: [`check_images`].

use std::collections::{BTreeMap, HashMap, HashSet};

use rayon::prelude::*;

use super::findings::{Findings, Mark};
use crate::data::{Dataset, Picture, SkipBad};
use crate::engine::dark_already::{DarkImages, advice};
use crate::engine::images::frames::first_question_per_frame;
use crate::engine::images::progress::Progress;
use crate::error::Result;
use crate::types::text::counted;
use crate::types::{Digest, FrameId, InputNote, InputSummary, Question};
use darkqa_enhance::brightness;

/// Whether all pixels of images are decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Depth {
    /// Read the header of each file, and decode a sample of the images.
    Headers,
    /// Decode all images.
    Pixels,
}

/// Number of images whose brightness is measured.
const SAMPLE_SIZE: usize = 32;

/// The result of inspecting an image.
struct Inspection<'a> {
    id: &'a FrameId,
    facts: Result<ImageFacts>,
    /// Size of the file.
    bytes: u64,
}

/// Properties of a usable image.
struct ImageFacts {
    size: (u32, u32),
    digest: Digest,
    /// Changes made when the image was read, if any.
    note: Option<Box<InputNote>>,
}

/// Checks the images of the questions.
pub(super) fn check_images(
    dataset: &Dataset,
    dark: DarkImages,
    questions: &[Question],
    depth: Depth,
    progress: &Progress,
    findings: &mut Findings,
) {
    let shown = shown_frames(dataset, questions);
    let bar = progress.bar("reading images", shown.len());
    let inspections: Vec<Inspection<'_>> = shown
        .par_iter()
        .map(|frame| {
            let inspection = inspect(dataset, frame, depth);
            bar.inc();
            inspection
        })
        .collect();
    drop(bar);
    let (mut by_digest, mut sizes) = (HashMap::new(), BTreeMap::new());
    let (mut total_bytes, mut notes, mut unusable) = (0, InputSummary::default(), 0);
    for Inspection { id, facts, bytes } in inspections {
        match facts {
            Err(e) => {
                unusable += 1;
                findings.add_of_kind("images that cannot be used", Mark::Problem, e.to_string());
            }
            Ok(ImageFacts { size, digest, note }) => {
                total_bytes += bytes;
                *sizes.entry(size).or_insert(0_usize) += 1;
                if let Some(note) = note {
                    notes.add(id, &note);
                }
                if let Some(first) = by_digest.insert(digest, id) {
                    let text = format!(
                        "{:?} and {:?} are the same image under two names: each gets its own noise",
                        first.0, id.0
                    );
                    findings.add_of_kind("images that occur twice", Mark::Warning, text);
                }
            }
        }
    }
    if unusable > 0 {
        findings.warn(format!(
            "{} leaves out the questions about {} that cannot be used",
            SkipBad::allowing(unusable, shown.len()).flag(),
            counted(unusable, "image")
        ));
    }
    let usable = shown.len() - unusable;
    if usable > 0 {
        findings.ok(format!("{}, {}, {}", counted(usable, "image"), megabytes(total_bytes), size_list(&sizes)));
    }
    for line in notes.lines() {
        findings.warn(line);
    }
    check_brightness(dataset, &shown, dark, findings);
}

/// The distinct frames that the questions show, in the order of the questions.
fn shown_frames<'a>(dataset: &'a Dataset, questions: &'a [Question]) -> Vec<&'a FrameId> {
    let mut seen = HashSet::new();
    first_question_per_frame(questions)
        .into_iter()
        .flat_map(|question| dataset.shown_frames(&question.frame))
        .filter(|frame| seen.insert(*frame))
        .collect()
}

fn inspect<'a>(dataset: &Dataset, id: &'a FrameId, depth: Depth) -> Inspection<'a> {
    let picture = dataset.picture(id);
    let bytes = match &picture {
        Ok(Picture::Encoded(file)) => file.bytes().len() as u64,
        _ => 0,
    };
    let facts = picture.and_then(|picture| {
        let size = picture.check()?;
        if depth == Depth::Pixels {
            picture.decode()?;
        }
        let note = Some(picture.note()).filter(|note| *note != InputNote::default());
        Ok(ImageFacts { size, digest: picture.digest(), note: note.map(Box::new) })
    });
    Inspection { id, facts, bytes }
}

/// Measures the brightness of a sample of the images, and warns if they are already dark.
fn check_brightness(dataset: &Dataset, shown: &[&FrameId], dark: DarkImages, findings: &mut Findings) {
    let number = shown.len().min(SAMPLE_SIZE);
    let mut sample: Vec<f64> = (0..number)
        .into_par_iter()
        .filter_map(|index| {
            let frame = shown[index * shown.len() / number];
            let picture = dataset.picture(frame).ok()?;
            Some(brightness(&picture.decode().ok()?))
        })
        .collect();
    sample.sort_by(f64::total_cmp);
    let Some(median) = sample.get(sample.len() / 2) else {
        return;
    };
    match advice(*median).filter(|_| dark == DarkImages::Unexpected) {
        Some(advice) => findings.warn(advice),
        None => findings.ok(format!("median brightness {median:.0} of 255 ({})", counted(number, "image"))),
    }
}

fn size_list(sizes: &BTreeMap<(u32, u32), usize>) -> String {
    let text = |((width, height), count): (&(u32, u32), &usize)| format!("{count} of {width}×{height}");
    if sizes.len() <= 4 {
        let sizes: Vec<String> = sizes.iter().map(text).collect();
        return sizes.join(", ");
    }
    let first = sizes.first_key_value().map_or_else(String::new, text);
    let last = sizes.last_key_value().map_or_else(String::new, text);
    format!("{} sizes, {first} to {last}", sizes.len())
}

fn megabytes(bytes: u64) -> String {
    match bytes {
        0..1_000_000 => format!("{:.0} kB", bytes as f64 / 1e3),
        _ => format!("{:.1} MB", bytes as f64 / 1e6),
    }
}
