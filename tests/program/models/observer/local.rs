//! Changes of a part of an image, or of the light on it: what they leave of the things elsewhere.

use std::collections::BTreeSet;

use darkqa_eval::{Question, Rgb};
use darkqa_questions::observer::Observation;
use darkqa_score::estimate::Estimate;
use rayon::prelude::*;

use super::made::{Asked, Draws, Set, interval, mapped};

/// A change of a part of an image, or of its light by the place.
#[derive(Debug, Clone, Copy)]
pub(super) enum Change {
    /// A box of this code and this share of the frame, with the frame's proportions, at a random place.
    Box { code: u8, share: f64 },
    /// Lines of random characters, white on the lower 40 % of the frame.
    Text,
    /// Light that falls from 1 to a tenth with the distance from a random place, like that of a lamp.
    Lamp,
    /// Light that rises from a twentieth at the left edge to 1 at the right.
    Gradient,
    /// Codes that rise by 80 from the left edge to the right, like stray light.
    StrayLight,
}

/// The changes that are measured.
pub(super) const CHANGES: [Change; 8] = [
    Change::Box { code: 255, share: 0.05 },
    Change::Box { code: 255, share: 0.10 },
    Change::Box { code: 255, share: 0.25 },
    Change::Box { code: 0, share: 0.25 },
    Change::Text,
    Change::Lamp,
    Change::Gradient,
    Change::StrayLight,
];

impl Change {
    /// Whether a part of the pixels stays as it is.
    pub(super) fn is_partial(self) -> bool {
        matches!(self, Self::Box { .. } | Self::Text)
    }

    /// The changed image; `seed` decides what is drawn at random.
    pub(super) fn apply(self, image: &Rgb, seed: u64) -> Rgb {
        let mut draws = Draws(seed);
        let [width, height] = [image.width(), image.height()];
        let in_light = |code: f64, gain: f64| code * gain.powf(1.0 / 2.2);
        match self {
            Self::Box { code: new, share } => {
                let size = [width, height].map(|side| (side as f64 * share.sqrt()) as usize);
                let [left, top] = [draws.below(width - size[0]), draws.below(height - size[1])];
                let (columns, rows) = (left..left + size[0], top..top + size[1]);
                mapped(
                    image,
                    |y, x, _, code| {
                        if columns.contains(&x) && rows.contains(&y) { f64::from(new) } else { code }
                    },
                )
            }
            Self::Text => {
                let ink = Ink::new([width, height], &mut draws);
                mapped(image, |y, x, _, code| if ink.covers(x, y) { 255.0 } else { code })
            }
            Self::Lamp => {
                let [x0, y0] = [draws.unit() * width as f64, draws.unit() * height as f64];
                let radius = 0.2 * width as f64;
                mapped(image, |y, x, _, code| {
                    let distance = ((x as f64 - x0).hypot(y as f64 - y0)) / radius;
                    in_light(code, 0.1 + 0.9 * (-0.5 * distance * distance).exp())
                })
            }
            Self::Gradient => mapped(image, |_, x, _, code| in_light(code, 0.05 + 0.95 * x as f64 / width as f64)),
            Self::StrayLight => mapped(image, |_, x, _, code| code + 80.0 * x as f64 / width as f64),
        }
    }
}

/// Characters of 5 × 7 dots, about as large as the text of a sign.
struct Ink {
    /// Side of a dot, in pixels.
    dot: usize,
    /// First row of the text, in pixels.
    top: usize,
    /// Dots in a row.
    columns: usize,
    dots: Vec<bool>,
}

impl Ink {
    fn new([width, height]: [usize; 2], draws: &mut Draws) -> Self {
        let dot = (height / 160).max(1);
        let top = height * 6 / 10;
        let columns = width.div_ceil(dot);
        let rows = (height - top).div_ceil(dot);
        // A character with its space takes 6 × 10 dots.
        let is_space = |i: usize| i % columns % 6 == 5 || i / columns % 10 > 6;
        let dots = (0..columns * rows).map(|i| draws.unit() < 0.5 && !is_space(i));
        Self { dot, top, columns, dots: dots.collect() }
    }

    fn covers(&self, x: usize, y: usize) -> bool {
        let row = y.checked_sub(self.top).map(|y| y / self.dot);
        row.is_some_and(|row| self.dots[row * self.columns + x / self.dot])
    }
}

/// Detection of unchanged objects after a local change.
#[derive(Debug, Clone, Copy)]
pub(super) struct Elsewhere {
    /// Expected score of the questions about untouched things alone, without the change and with it.
    pub(super) scores: [Estimate; 2],
    /// Number of untouched things that are seen, without the change and with it.
    pub(super) seen: [usize; 2],
}

impl Elsewhere {
    pub(super) fn of(set: &Set, change: Change) -> Self {
        let looks: Vec<([[f64; 2]; 2], [usize; 2])> = set
            .frames
            .par_iter()
            .enumerate()
            .map(|(place, asked)| {
                let changed = change.apply(&asked.image, place as u64);
                let untouched = untouched(asked, &changed);
                let looks = [&asked.image, &changed].map(|image| asked.known.observe(image));
                let about: Vec<&Question> =
                    asked.questions.iter().filter(|question| is_about(question, &untouched)).collect();
                let sums = looks.each_ref().map(|seen| {
                    let scores = about.iter().map(|question| set.score(seen, question));
                    [scores.sum(), about.len() as f64]
                });
                let seen =
                    looks.map(|seen: Observation| untouched.iter().filter(|thing| seen.is_seen(**thing)).count());
                (sums, seen)
            })
            .collect();
        let scores = [0, 1].map(|image| {
            let sums: Vec<[f64; 2]> = looks.iter().map(|(sums, _)| sums[image]).collect();
            let n = sums.iter().map(|[_, n]| *n as usize).sum();
            interval(&sums, n)
        });
        let seen = [0, 1].map(|image| looks.iter().map(|(_, seen)| seen[image]).sum());
        Self { scores, seen }
    }
}

/// Segments without a changed pixel.
fn untouched(asked: &Asked, changed: &Rgb) -> BTreeSet<u32> {
    let mut segments: BTreeSet<u32> = asked.segments.iter().copied().collect();
    let pixels = asked.image.samples().chunks(3).zip(changed.samples().chunks(3));
    for ((before, after), segment) in pixels.zip(&asked.segments) {
        if before != after {
            segments.remove(segment);
        }
    }
    segments
}

/// Whether all segments that decide the answer are among these.
fn is_about(question: &Question, segments: &BTreeSet<u32>) -> bool {
    let evidence = question.evidence.value();
    let deciding = evidence["segments"].as_array();
    deciding.is_some_and(|deciding| {
        let among = |segment: &serde_json::Value| {
            let id = segment["id"].as_u64();
            id.is_some_and(|id| segments.contains(&(id as u32)))
        };
        !deciding.is_empty() && deciding.iter().all(among)
    })
}
