//! The images of a check: [`images`].

use std::collections::{BTreeMap, HashMap, HashSet};

use rayon::prelude::*;

use super::findings::{Findings, Mark};
use crate::dataset::{Dataset, Picture, SkipBad};
use crate::engine::dark_already::{DarkImages, advice};
use crate::error::Result;
use crate::images::frames::first_asked;
use crate::images::progress::Progress;
use crate::text::words::counted;
use crate::types::{Digest, FrameId, InputNote, InputSummary, Question};
use darkqa_enhance::brightness;

/// Whether the pixels of images are looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Depth {
    /// The head of each file, and the pixels of a sample.
    Heads,
    /// Every pixel.
    Pixels,
}

/// The number of images whose brightness is measured.
const SAMPLED: usize = 32;

/// Facts about one image.
struct Looked<'a> {
    id: &'a FrameId,
    facts: Result<Facts>,
    bytes: u64,
}

/// The properties of an image.
struct Facts {
    size: (u32, u32),
    digest: Digest,
    /// Changes made when it was read, if any.
    note: Option<Box<InputNote>>,
}

/// Looks at the images that the questions are about.
pub(super) fn images(
    dataset: &Dataset,
    dark: DarkImages,
    questions: &[Question],
    depth: Depth,
    progress: &Progress,
    findings: &mut Findings,
) {
    let shown = first_shown(dataset, questions);
    let bar = progress.bar("reading images", shown.len());
    let looked: Vec<Looked<'_>> = shown
        .par_iter()
        .map(|frame| {
            let looked = look(dataset, frame, depth);
            bar.inc();
            looked
        })
        .collect();
    drop(bar);
    let (mut by_digest, mut sizes) = (HashMap::new(), BTreeMap::new());
    let (mut bytes, mut notes, mut unusable) = (0, InputSummary::default(), 0);
    for Looked {
        id,
        facts,
        bytes: of,
    } in looked
    {
        match facts {
            Err(e) => {
                unusable += 1;
                findings.one_of("images that cannot be used", Mark::Problem, e.to_string());
            }
            Ok(Facts { size, digest, note }) => {
                bytes += of;
                *sizes.entry(size).or_insert(0_usize) += 1;
                if let Some(note) = note {
                    notes.add(id, &note);
                }
                if let Some(first) = by_digest.insert(digest, id) {
                    let text = format!(
                        "{:?} and {:?} are the same image under two names: each gets its own noise",
                        first.0, id.0
                    );
                    findings.one_of("images that occur twice", Mark::Warning, text);
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
    findings.ok(format!(
        "{}, {}, {}",
        counted(shown.len(), "image"),
        megabytes(bytes),
        listed(&sizes)
    ));
    for line in notes.lines() {
        findings.warn(line);
    }
    light(dataset, &shown, dark, findings);
}

/// The frames that the questions show, each once, in the order of the questions.
fn first_shown<'a>(dataset: &'a Dataset, questions: &'a [Question]) -> Vec<&'a FrameId> {
    let mut seen = HashSet::new();
    first_asked(questions)
        .into_iter()
        .flat_map(|question| dataset.shown_frames(&question.frame))
        .filter(|frame| seen.insert(*frame))
        .collect()
}

fn look<'a>(dataset: &Dataset, id: &'a FrameId, depth: Depth) -> Looked<'a> {
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
        Ok(Facts {
            size,
            digest: picture.digest(),
            note: note.map(Box::new),
        })
    });
    Looked { id, facts, bytes }
}

/// Measures the brightness of a sample of the images.
fn light(dataset: &Dataset, shown: &[&FrameId], dark: DarkImages, findings: &mut Findings) {
    let number = shown.len().min(SAMPLED);
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
    match advice(*median).filter(|_| dark == DarkImages::Odd) {
        Some(advice) => findings.warn(advice),
        None => findings.ok(format!(
            "median brightness {median:.0} of 255 ({})",
            counted(number, "image")
        )),
    }
}

fn listed(sizes: &BTreeMap<(u32, u32), usize>) -> String {
    let text =
        |((width, height), count): (&(u32, u32), &usize)| format!("{count} of {width}×{height}");
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
