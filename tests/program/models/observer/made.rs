//! Frames with questions and the observer's knowledge of them, images that are spoiled or invented, and their expected
//! scores.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use darkqa_base::types::{Digest, Family, Frame, FrameId, Labels};
use darkqa_eval::{Degradation, Question, Rgb};
use darkqa_light::{NoiseKey, Synthesis, degrade};
use darkqa_questions::balance::BalanceMode;
use darkqa_questions::colors::Palette;
use darkqa_questions::observer::Observation;
use darkqa_questions::observer::ObservedFrame;
use darkqa_questions::room::RoomSource;
use darkqa_questions::rules::Rules;
use darkqa_questions::statistics::measure;
use darkqa_questions::{QuestionRequest, generate};
use darkqa_rooms::Rooms;
use darkqa_rooms::labels;
use darkqa_score::estimate::Estimate;
use rayon::prelude::*;

/// A frame with its questions.
pub(super) struct Asked {
    pub(super) id: FrameId,
    pub(super) image: Rgb,
    /// Segment of each pixel, row by row.
    pub(super) segments: Vec<u32>,
    pub(super) known: ObservedFrame,
    pub(super) questions: Vec<Question>,
}

/// Frames with their questions, and the rules that made them.
pub(super) struct Set {
    pub(super) frames: Vec<Asked>,
    pub(super) rules: Rules,
    pub(super) palette: Palette,
}

/// Observations of one image of each frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Outcome {
    /// Expected score with its 95 % interval by frame: the 2.5 % and 97.5 % quantiles of 2,000 resamples.
    pub(super) score: Estimate,
    pub(super) chance: f64,
    /// Number of answers from evidence.
    pub(super) evidence: usize,
    pub(super) things: usize,
    pub(super) seen: usize,
    pub(super) detected: usize,
    /// Mean share of the image's variance that the untouched frame explains.
    pub(super) explained: f64,
}

impl Set {
    /// Some of the built-in rooms.
    pub(super) fn rooms(rooms: Rooms, is_wanted: impl Fn(&FrameId) -> bool + Sync) -> Self {
        let all: Vec<_> = rooms.all().filter(|(id, _)| is_wanted(id)).collect();
        let frames = all.into_par_iter().map(|(_, room)| room.frame().unwrap());
        Self::of(frames.map(Arc::new).collect(), &labels())
    }

    /// Frames with the questions that the built-in rules ask about them.
    fn of(frames: Vec<Arc<Frame>>, labels: &Labels) -> Self {
        let (rules, palette) = (Rules::built_in().unwrap(), Palette::built_in().unwrap());
        let statistics: Vec<_> = frames
            .par_iter()
            .map(|frame| {
                let key = Digest::from_bytes(frame.id.0.as_bytes());
                measure(frame, labels, &rules, &palette, key).unwrap()
            })
            .collect();
        let order = QuestionRequest {
            dataset: "set",
            labels,
            rules: &rules,
            palette: &palette,
            families: Family::by_rule().collect(),
            room_source: RoomSource::Signature,
            balance: BalanceMode::default(),
            rejected: BTreeSet::new(),
        };
        let made = generate(&statistics, &order, |_, _| {}).unwrap();
        let mut questions = BTreeMap::<FrameId, Vec<Question>>::new();
        for asked in made.asked {
            let of_frame = questions.entry(asked.question.frame.clone()).or_default();
            of_frame.push(asked.question);
        }
        let frames = frames.into_par_iter().map(|frame| Asked {
            known: ObservedFrame::new(&frame, labels, &rules, &palette).unwrap(),
            questions: questions.get(&frame.id).cloned().unwrap_or_default(),
            id: frame.id.clone(),
            image: frame.rgb.clone(),
            segments: frame.segments.iter().flatten().copied().collect(),
        });
        Self { frames: frames.collect(), rules, palette }
    }

    /// The frame that is another scene's, for each frame.
    pub(super) fn other(&self, place: usize) -> &Asked {
        let scene = |place: usize| self.frames[place].id.0.split('/').next().unwrap();
        let count = self.frames.len();
        let other = (1..count).map(|step| (place + step) % count).find(|other| scene(*other) != scene(place));
        &self.frames[other.unwrap()]
    }

    /// Observations of an image of each frame.
    pub(super) fn look(&self, image: impl Fn(usize, &Asked) -> Rgb + Sync) -> Outcome {
        self.judged(image, |asked, seen, question| {
            let _ = asked;
            seen.answer(question, &self.rules, &self.palette)
        })
    }

    /// The same with another way to answer.
    pub(super) fn judged(
        &self,
        image: impl Fn(usize, &Asked) -> Rgb + Sync,
        answer: impl Fn(&Asked, &Observation, &Question) -> Option<usize> + Sync,
    ) -> Outcome {
        self.judged_by(|place, asked| asked.known.observe(&image(place, asked)), answer)
    }

    fn judged_by(
        &self,
        look: impl Fn(usize, &Asked) -> Observation + Sync,
        answer: impl Fn(&Asked, &Observation, &Question) -> Option<usize> + Sync,
    ) -> Outcome {
        let looks: Vec<_> = self
            .frames
            .par_iter()
            .enumerate()
            .map(|(place, asked)| {
                let seen = look(place, asked);
                let scores = asked.questions.iter().map(|question| {
                    let guess = 1.0 / question.choices.len() as f64;
                    match answer(asked, &seen, question) {
                        None => (guess, guess, 0),
                        Some(choice) => {
                            let right = Some(choice) == question.choices.truth();
                            (f64::from(u8::from(right)), guess, 1)
                        }
                    }
                });
                (scores.collect::<Vec<_>>(), seen)
            })
            .collect();
        let all = || looks.iter().flat_map(|(scores, _)| scores);
        let n = all().count();
        let sums: Vec<[f64; 2]> = looks
            .iter()
            .map(|(scores, _)| {
                let sum = scores.iter().map(|(score, ..)| score).sum::<f64>();
                [sum, scores.len() as f64]
            })
            .collect();
        let count = |of: fn(&Observation) -> usize| looks.iter().map(|(_, seen)| of(seen)).sum();
        let explained: f64 = looks.iter().map(|(_, seen)| seen.explained_variance()).sum();
        Outcome {
            score: interval(&sums, n),
            chance: all().map(|(_, guess, _)| guess).sum::<f64>() / n as f64,
            evidence: all().map(|(.., evidence)| evidence).sum(),
            things: count(Observation::thing_count),
            seen: count(Observation::seen_count),
            detected: count(Observation::detected_count),
            explained: explained / looks.len() as f64,
        }
    }

    /// The same, with another share of an outline that must be confirmed.
    pub(super) fn look_with(&self, share: f64, image: impl Fn(usize, &Asked) -> Rgb + Sync) -> Outcome {
        self.judged_by(
            |place, asked| asked.known.observe_with(&image(place, asked), share),
            |_, seen, question| seen.answer(question, &self.rules, &self.palette),
        )
    }

    /// The expected score of a question.
    pub(super) fn score(&self, seen: &Observation, question: &Question) -> f64 {
        match seen.answer(question, &self.rules, &self.palette) {
            None => 1.0 / question.choices.len() as f64,
            Some(choice) => f64::from(u8::from(Some(choice) == question.choices.truth())),
        }
    }

    /// The scores by frame of two kinds of image, the second less the first, with the interval of their paired
    /// difference.
    pub(super) fn gain(
        &self,
        before: impl Fn(usize, &Asked) -> Rgb + Sync,
        after: impl Fn(usize, &Asked) -> Rgb + Sync,
    ) -> Estimate {
        let sums: Vec<[f64; 2]> = self
            .frames
            .par_iter()
            .enumerate()
            .map(|(place, asked)| {
                let looks = [before(place, asked), after(place, asked)];
                let [before, after] = looks.map(|image| asked.known.observe(&image));
                let questions = asked.questions.iter();
                let differences =
                    questions.map(|question| self.score(&after, question) - self.score(&before, question));
                [differences.sum(), asked.questions.len() as f64]
            })
            .collect();
        interval(&sums, sums.iter().map(|[_, n]| *n as usize).sum())
    }
}

/// The mean, and the 2.5 % and 97.5 % quantiles of 2,000 resamples of the frames.
pub(super) fn interval(sums: &[[f64; 2]], n: usize) -> Estimate {
    let mean = |of: &mut dyn Iterator<Item = &[f64; 2]>| {
        let [sum, count] = of.fold([0.0, 0.0], |[sum, count], [s, c]| [sum + s, count + c]);
        sum / f64::max(count, 1.0)
    };
    let mut draws = Draws(7);
    let mut means: Vec<f64> = (0..2000)
        .map(|_| {
            let picks: Vec<usize> = sums.iter().map(|_| draws.below(sums.len())).collect();
            mean(&mut picks.iter().map(|pick| &sums[*pick]))
        })
        .collect();
    means.sort_by(f64::total_cmp);
    Estimate { value: mean(&mut sums.iter()), low: means[50], high: means[1949], n }
}

impl Outcome {
    /// Whether chance lies in the interval.
    pub(super) fn is_chance(&self) -> bool {
        self.score.low <= self.chance + 1e-9 && self.chance <= self.score.high + 1e-9
    }
}

/// A frame in a degradation; the noise is that of seed 0.
pub(super) fn degraded(asked: &Asked, how: &str, reading: &Synthesis) -> Rgb {
    if how == "L0" {
        return asked.image.clone();
    }
    let how: Degradation = how.parse().unwrap();
    degrade(&asked.image, Some(&how), &NoiseKey::new(0, &asked.id), reading).unwrap()
}

/// Random numbers: `SplitMix64`.
pub(super) struct Draws(pub(super) u64);

impl Draws {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut value = self.0;
        value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        value ^ (value >> 31)
    }

    pub(super) fn below(&mut self, count: usize) -> usize {
        (self.next() % count as u64) as usize
    }

    pub(super) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A normal number, as the sum of twelve uniform ones.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
}

/// The image with each sample replaced: by its row, column, channel and code.
pub(super) fn mapped(image: &Rgb, mut new: impl FnMut(usize, usize, usize, f64) -> f64) -> Rgb {
    let width = image.width();
    let mut mapped = image.clone();
    for (i, code) in mapped.samples_mut().iter_mut().enumerate() {
        let (y, x) = (i / 3 / width, i / 3 % width);
        *code = new(y, x, i % 3, f64::from(*code)).round().clamp(0.0, 255.0) as u8;
    }
    mapped
}

/// Means over squares of `side` pixels around each pixel.
pub(super) fn smoothed(image: &Rgb, side: usize) -> Vec<f64> {
    let [width, height] = [image.width(), image.height()];
    let half = side as isize / 2;
    let pass = |values: &[f64], step: usize, count: usize, place: &dyn Fn(usize) -> usize| {
        let mut out = vec![0.0; values.len()];
        for (i, out) in out.iter_mut().enumerate() {
            let own = place(i) as isize;
            let near = own - half..=own + half;
            let value = |at: isize| {
                let at = at.clamp(0, count as isize - 1);
                values[(i as isize + (at - own) * step as isize) as usize]
            };
            *out = near.map(value).sum::<f64>() / side as f64;
        }
        out
    };
    let values: Vec<f64> = image.samples().iter().map(|code| f64::from(*code)).collect();
    let across = pass(&values, 3, width, &|i| i / 3 % width);
    pass(&across, 3 * width, height, &|i| i / 3 / width)
}

/// Enhancers that invent something, applied to a dark image; each first brightens it so that its mean is 110.
pub(super) const INVENTING: [&str; 7] =
    ["gain alone", "blotches", "stripes", "unsharp mask", "own-noise edges", "foreign edges", "half blend"];

/// A dark image after an enhancer of this name. `other` is the untouched image of another room.
pub(super) fn invented(name: &str, dark: &Rgb, other: &Rgb, seed: u64) -> Rgb {
    let samples = dark.samples();
    let mean = samples.iter().map(|code| f64::from(*code)).sum::<f64>() / samples.len() as f64;
    let gain = 110.0 / mean.max(0.1);
    let bright = mapped(dark, |_, _, _, code| code * gain);
    let width = dark.width();
    let mut draws = Draws(seed);
    let edges = |image: &Rgb, y: usize, x: usize| -> f64 {
        let at = |y: usize, x: usize| {
            let y = y.min(image.height() - 1);
            let x = x.min(width - 1);
            f64::from(image.samples()[(y * width + x) * 3 + 1])
        };
        (at(y, x + 1) - at(y, x)).abs() + (at(y + 1, x) - at(y, x)).abs()
    };
    match name {
        "gain alone" => bright,
        "blotches" => {
            let columns = width / 24 + 2;
            let knots: Vec<f64> = (0..columns * (dark.height() / 24 + 2) * 3).map(|_| 40.0 * draws.normal()).collect();
            mapped(&bright, |y, x, c, code| code + knots[(y / 24 * columns + x / 24) * 3 + c])
        }
        "stripes" => mapped(&bright, |_, x, _, code| code + 60.0 * (std::f64::consts::TAU * x as f64 / 9.0).sin()),
        "unsharp mask" => {
            let smooth = smoothed(&bright, 9);
            mapped(&bright, |y, x, c, code| code + 3.0 * (code - smooth[(y * width + x) * 3 + c]))
        }
        "own-noise edges" => {
            let smooth = smoothed(&bright, 3);
            let smooth = mapped(&bright, |y, x, c, _| smooth[(y * width + x) * 3 + c]);
            mapped(&bright, |y, x, _, code| if edges(&smooth, y, x) > 40.0 { 0.0 } else { code })
        }
        "foreign edges" => mapped(&bright, |y, x, _, code| if edges(other, y, x) > 20.0 { 0.0 } else { code }),
        _ => mapped(&bright, |y, x, c, code| {
            let foreign = f64::from(other.samples()[(y * width + x) * 3 + c]);
            f64::midpoint(code, foreign)
        }),
    }
}
