//! Checks of the images of the questions: [`check_images`].
//!
//! Findings of `check`, one per line: [`ImageFindings`].

use std::collections::{BTreeMap, HashMap, HashSet};

use rayon::prelude::*;
use serde::Serialize;

use darkqa_base::error::Result;
use darkqa_base::types::text::counted;
use darkqa_base::types::{Digest, FrameId, InputNote, InputSummary, Question};
use darkqa_data::{Dataset, Picture, SkipBad};
use darkqa_engine::dark_already::{DarkImages, advice};
use darkqa_engine::images::frames::first_question_per_frame;
use darkqa_engine::images::progress::Progress;
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
    facts: Result<UsableImage>,
    /// Size of the file.
    bytes: u64,
}

/// Properties of a usable image.
struct UsableImage {
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
    findings: &mut ImageFindings,
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
                findings.add_of_kind("images that cannot be used", FindingSeverity::Problem, e.to_string());
            }
            Ok(UsableImage { size, digest, note }) => {
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
                    findings.add_of_kind("images that occur twice", FindingSeverity::Warning, text);
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
        Ok(UsableImage { size, digest: picture.digest(), note: note.map(Box::new) })
    });
    Inspection { id, facts, bytes }
}

/// Measures the brightness of a sample of the images, and warns if they are already dark.
fn check_brightness(dataset: &Dataset, shown: &[&FrameId], dark: DarkImages, findings: &mut ImageFindings) {
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

/// Severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum FindingSeverity {
    /// No problem.
    Ok,
    /// A run would continue, but its numbers may be misleading.
    Warning,
    /// A run would stop.
    Problem,
}

impl FindingSeverity {
    fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok     ",
            Self::Warning => "warning",
            Self::Problem => "problem",
        }
    }
}

/// One finding.
#[derive(Debug, Clone, Serialize)]
pub(super) struct ImageFinding {
    pub(super) mark: FindingSeverity,
    pub(super) text: String,
}

/// Maximum number of findings of one kind that are shown.
const MAX_SHOWN: usize = 5;

/// All findings, in order.
#[derive(Debug, Default)]
pub(super) struct ImageFindings {
    all: Vec<ImageFinding>,
    /// Number of findings of each kind, and index of the last one shown.
    kinds: BTreeMap<&'static str, (usize, usize)>,
}

impl ImageFindings {
    pub(super) fn ok(&mut self, text: impl Into<String>) {
        self.add(FindingSeverity::Ok, text);
    }

    pub(super) fn warn(&mut self, text: impl Into<String>) {
        self.add(FindingSeverity::Warning, text);
    }

    pub(super) fn problem(&mut self, text: impl Into<String>) {
        self.add(FindingSeverity::Problem, text);
    }

    fn add(&mut self, mark: FindingSeverity, text: impl Into<String>) {
        let text = text.into();
        self.all.push(ImageFinding { mark, text });
    }

    /// Adds a finding of a kind. Only the first [`MAX_SHOWN`] of a kind are shown.
    pub(super) fn add_of_kind(&mut self, kind: &'static str, mark: FindingSeverity, text: impl Into<String>) {
        let count = self.kinds.entry(kind).or_default();
        count.0 += 1;
        if count.0 <= MAX_SHOWN {
            count.1 = self.all.len();
            self.add(mark, text);
        }
    }

    /// The findings, with a line for the number of each kind that is not shown.
    pub(super) fn finish(mut self) -> Vec<ImageFinding> {
        let mut rest: Vec<(usize, ImageFinding)> = self
            .kinds
            .iter()
            .filter(|(_, (count, _))| *count > MAX_SHOWN)
            .map(|(kind, (count, last))| {
                let mark = self.all[*last].mark;
                let text = format!("and {} more: {kind}", count - MAX_SHOWN);
                (*last, ImageFinding { mark, text })
            })
            .collect();
        rest.sort_by_key(|(last, _)| std::cmp::Reverse(*last));
        for (last, finding) in rest {
            self.all.insert(last + 1, finding);
        }
        self.all
    }

    /// Number of problems, including those that are not shown.
    pub(super) fn problem_count(&self) -> usize {
        let shown = self.all.iter().filter(|finding| finding.mark == FindingSeverity::Problem).count();
        let hidden: usize = self
            .kinds
            .values()
            .filter(|(_, last)| self.all[*last].mark == FindingSeverity::Problem)
            .map(|(count, _)| count.saturating_sub(MAX_SHOWN))
            .sum();
        shown + hidden
    }
}

/// The findings as lines of text.
pub(super) fn lines(findings: &[ImageFinding]) -> String {
    findings
        .iter()
        .map(|finding| {
            let text = finding.text.replace('\n', "\n         ");
            format!("{}  {text}\n", finding.mark.word())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_findings_of_a_kind_are_counted() {
        let mut findings = ImageFindings::default();
        findings.ok("files");
        for n in 0..7 {
            findings.add_of_kind("missing images", FindingSeverity::Problem, format!("{n}.png is missing"));
        }
        findings.add_of_kind("grey images", FindingSeverity::Warning, "x.png is grey");
        assert_eq!(findings.problem_count(), 7);
        let text = lines(&findings.finish());
        assert!(
            text.contains("problem  4.png is missing\nproblem  and 2 more: missing images\nwarning  x.png"),
            "{text}"
        );
        assert!(!text.contains("5.png"), "{text}");
    }
}
