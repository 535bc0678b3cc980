//! Every rule on synthetic frames, on both sides of each threshold and with each reason for rejection.
//!
//! The frames have a million pixels, so that an area in pixels is also one in millionths.

#![allow(clippy::unwrap_used)]

mod affordance;
mod closest;
mod color;
mod presence;
mod room_type;
mod rooms;
mod whole;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::LazyLock;

use crate::balance::BalanceMode;
use crate::colors::{Color, NONE, Palette};
use crate::generate::{Generated, QuestionRequest, generate};
use crate::reason::Reason;
use crate::room::{NoRoom, RoomSigns, RoomSource, classify};
use crate::rule_context::{Candidate, RuleResult};
use crate::rules::Rules;
use crate::statistics::{
    DepthAxis, FrameDepth, FrameStatistics, Segment, SegmentDepth, SegmentPlace, WordSource, plain_word,
};
use darkqa_base::types::{Digest, Family, FrameId, Label, Labels, QuestionId};

/// A frame with the given segments: class, word of the data set, area in pixels.
pub(crate) fn frame(segments: &[(&str, &str, u64)]) -> FrameStatistics {
    let mut frame = FrameStatistics {
        frame: FrameId("scene/0".into()),
        key: Digest::from_bytes(b""),
        scene: "scene".into(),
        size: [1000, 1000],
        luma: [60, 120, 200],
        light: [255; 3],
        void: 0,
        effective_void: 0,
        lower_void: 0,
        classes: BTreeMap::new(),
        loose: BTreeMap::new(),
        unnamed: BTreeMap::new(),
        words: BTreeMap::new(),
        unknown: BTreeMap::new(),
        depth: Some(FrameDepth { holes: 0, median: 3000, along: DepthAxis::Ray }),
        segments: Vec::new(),
        room: None,
    };
    for (id, &(class, word, area)) in (1..).zip(segments) {
        let word = if word.is_empty() { default_word(class) } else { word };
        let (word, place) = plain_word(word);
        *frame.classes.entry(class.to_owned()).or_insert(0) += area;
        *frame.words.entry(word.clone()).or_insert(0) += area;
        let mut colors = [0; NONE + 1];
        colors[Color::Brown as usize] = area;
        frame.segments.push(Segment {
            id,
            class: class.to_owned(),
            word,
            source: WordSource::Label,
            place,
            region: None,
            parts: 0,
            area,
            pure: area,
            bbox: [100, 100, 300, 300],
            rim: 1000,
            rim_on_border: 0,
            core: area,
            depth: Some(depth_at(area, 2000 + 1000 * id)),
            colors,
            median: [110, 70, 40],
            around: None,
            bright: 0,
            crushed: 0,
        });
    }
    frame
}

/// Depth quantiles within 100 mm of the median.
fn depth_at(valid: u64, median: u32) -> SegmentDepth {
    SegmentDepth { valid, p10: median - 100, median, p90: median + 100 }
}

/// The first word of a class in questions; the class itself if questions do not name it.
fn default_word(class: &str) -> &str {
    static RULES: LazyLock<Rules> = LazyLock::new(|| Rules::built_in().unwrap());
    let rule = RULES.book().class.get(class);
    rule.and_then(|rule| rule.words.first()).map_or(class, String::as_str)
}

/// A label space in which every class is expressible, with a label for its first word.
pub(crate) fn labels() -> Labels {
    let rules = Rules::built_in().unwrap();
    let classes = (1..).zip(rules.book().class.keys()).map(|(id, class)| {
        let label = Label { name: default_word(class).to_owned(), canonical: class.clone() };
        (id, label)
    });
    let words = ["washing machine", "desk", "dining table", "dining chair", "stove"];
    let named = (100..).zip(words).map(|(id, word)| {
        let label = Label { name: word.to_owned(), canonical: "misc".to_owned() };
        (id, label)
    });
    Labels {
        labels: classes.chain(named).collect(),
        expressible: rules.book().class.keys().cloned().collect(),
        ..Labels::default()
    }
}

/// The questions about frames, and every candidate of the first frame.
struct RuleResults {
    generated: Generated,
    candidates: Vec<RuleResult>,
}

fn run_rules(frames: &[FrameStatistics], change: impl FnOnce(&mut QuestionRequest<'_>), rules: &Rules) -> RuleResults {
    run_rules_of(frames, change, rules, &labels())
}

fn run_rules_of(
    frames: &[FrameStatistics],
    change: impl FnOnce(&mut QuestionRequest<'_>),
    rules: &Rules,
    labels: &Labels,
) -> RuleResults {
    let palette = Palette::built_in().unwrap();
    let mut request = QuestionRequest {
        dataset: "test",
        labels,
        rules,
        palette: &palette,
        families: Family::by_rule().collect(),
        room_source: RoomSource::Signature,
        balance: BalanceMode::None,
        rejected: BTreeSet::new(),
    };
    change(&mut request);
    let mut candidates = Vec::new();
    let generated = generate(frames, &request, |name, result| {
        if *name == frames[0].frame {
            candidates.push(result.clone());
        }
    });
    RuleResults { generated: generated.unwrap(), candidates }
}

/// The candidate of a family, subject and answer, or why it is rejected. An empty subject or answer stands for any.
fn candidate(frame: &FrameStatistics, family: &Family, about: &str, answer: &str) -> Result<Candidate, Reason> {
    candidate_by(frame, family, about, answer, &Rules::built_in().unwrap())
}

fn candidate_by(
    frame: &FrameStatistics,
    family: &Family,
    about: &str,
    answer: &str,
    rules: &Rules,
) -> Result<Candidate, Reason> {
    let results = run_rules(std::slice::from_ref(frame), |_| {}, rules);
    let mut found: Vec<Result<Candidate, Reason>> = Vec::new();
    for result in results.candidates {
        match result {
            RuleResult::Viable(candidate) => {
                let same = candidate.about == about || about.is_empty();
                let answered = answer.is_empty() || candidate.answer() == answer;
                if candidate.family == *family && same && answered {
                    found.push(Ok(candidate));
                }
            }
            RuleResult::Rejected(rejection) => {
                let other = rejection.answer.as_deref().unwrap_or(answer);
                let answered = answer.is_empty() || other == answer;
                if rejection.family == *family && rejection.about == about && answered {
                    found.push(Err(rejection.reason));
                }
            }
        }
    }
    found.into_iter().next().unwrap_or_else(|| panic!("no candidate {family} {about} {answer}"))
}

/// The built-in rulebook with one text replaced.
fn rules(from: &str, to: &str) -> Rules {
    let text = include_str!("../rules.toml");
    assert!(text.contains(from), "{from}");
    Rules::parse(&text.replacen(from, to, 1)).unwrap()
}

fn signs(segments: &[(&str, &str, u64)]) -> RoomSigns {
    classify(&frame(segments), Rules::built_in().unwrap().book())
}

fn room(segments: &[(&str, &str, u64)]) -> Result<String, NoRoom> {
    signs(segments).room
}

const BEDROOM: [(&str, &str, u64); 3] =
    [("wall", "wall", 500_000), ("bed", "bed", 200_000), ("chest_of_drawers", "nightstand", 30_000)];
