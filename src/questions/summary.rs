//! Statistics of a set of questions, including the statistics in the paper's figure: [`QuestionSummary`].

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::generate::{FamilyCounts, Generated, OmissionReason, QuestionRequest, stated_room};
use super::reason::Reason;
use super::rule_context::GeneratedQuestion;
use super::rules::RuleBook;
use super::statistics::FrameStatistics;
use darkqa_base::types::{Digest, Family};

/// Schema of the JSON summary.
const SCHEMA: &str = "darkqa.questions/1";

/// Statistics of a set of questions. Shares are stored as counts.
#[derive(Debug, Serialize)]
pub struct QuestionSummary {
    schema: &'static str,
    pub dataset: String,
    /// Digest of the rulebook.
    pub rules: Digest,
    /// Digest of the colour table.
    pub colors: Digest,
    pub rules_version: String,
    /// Balancing of the answers: none, binary or full.
    pub balance: String,
    pub scenes: usize,
    /// Number of frames that were measured.
    pub frames: usize,
    /// Number of frames that could not be measured.
    pub failed: usize,
    /// Number of frames that are too dark to ask about.
    pub dark: usize,
    pub questions: usize,
    /// Numbers of candidates by outcome, for each family.
    pub candidates: BTreeMap<Family, CandidateCounts>,
    /// Number of frames by their number of questions.
    pub per_frame: BTreeMap<usize, usize>,
    /// Number of questions by family and answer.
    pub answers: BTreeMap<Family, BTreeMap<String, usize>>,
    /// Number of questions by text.
    pub texts: BTreeMap<String, usize>,
    /// Number of questions by the number of choices.
    pub choices: BTreeMap<usize, usize>,
    /// Numbers of yes and no answers by subject, for the yes-no families.
    pub polarity: BTreeMap<Family, BTreeMap<String, [usize; 2]>>,
    /// Pixels, segments, frames and questions of each class.
    pub classes: BTreeMap<String, ClassCoverage>,
    /// Frames and questions of each room type.
    pub rooms: BTreeMap<String, RoomCoverage>,
    /// Number of frames whose room type is both stated and classified, and number of these frames where both agree.
    pub room_agreement: [usize; 2],
    /// Number of questions by the gap between the two nearest objects, in mm, rounded down to a multiple of 250.
    pub gaps: BTreeMap<u64, usize>,
    /// Number of questions with the same scene, text and answer as an earlier one.
    pub repeats: usize,
    /// Number of pixels by label ID, for IDs in the maps that the label space does not define.
    pub unknown: BTreeMap<u16, u64>,
    /// Baselines that ignore the image, by family; "all" is the total.
    pub baselines: BTreeMap<String, Baselines>,
}

/// Counts of a family's candidate questions, by outcome.
#[derive(Debug, Default, Serialize)]
pub struct CandidateCounts {
    /// Number of candidates that the rules accept.
    pub viable: u64,
    pub asked: u64,
    /// Number of viable candidates in whose place another question of the same family and frame was asked.
    pub not_chosen: u64,
    /// Number of questions that a person has rejected.
    pub rejected: u64,
    /// Number of questions dropped because their answer would be too frequent.
    pub unbalanced: u64,
    /// Number of candidates that the rules reject, by reason.
    #[serde(rename = "fallen")]
    pub rejections: BTreeMap<Reason, u64>,
}

/// Counts of one class in a set of frames and questions.
#[derive(Debug, Default, Serialize)]
pub struct ClassCoverage {
    /// Number of pixels over all frames.
    pub pixels: u64,
    /// Number of segments, without the tiny ones.
    pub segments: u64,
    /// Number of frames that show the class.
    pub frames: u64,
    /// Number of questions about the class.
    pub questions: u64,
}

/// Counts of one room type in a set of frames and questions.
#[derive(Debug, Default, Serialize)]
pub struct RoomCoverage {
    /// Number of frames that show this type of room.
    pub frames: usize,
    /// Number of room-type questions whose right answer is this type.
    pub questions: usize,
}

/// Baselines that ignore the image. Each score is a number, or expected number, of right answers.
#[derive(Debug, Default, Serialize)]
pub struct Baselines {
    pub questions: usize,
    /// Expected number of right answers if every reply is a uniform guess.
    pub chance: f64,
    /// Number of right answers if every reply is the most common answer of the family.
    pub majority: usize,
    /// Expected number of right answers if a model knows the answers in other scenes. Among the choices of the
    /// question, it replies with the most common answer to the same text. If no other scene has one of them for that
    /// text, it replies with the most common answer of the family; if no other scene has one of them in the family, it
    /// guesses.
    pub prior: f64,
}

impl QuestionSummary {
    /// Computes the statistics of generated questions; `failed` is the number of frames that could not be measured.
    #[must_use]
    pub fn new(
        frames: &[FrameStatistics],
        generated: &Generated,
        request: &QuestionRequest<'_>,
        failed: usize,
    ) -> Self {
        let asked = &generated.asked;
        let mut summary = Self {
            schema: SCHEMA,
            dataset: request.dataset.to_owned(),
            rules: request.rules.digest(),
            colors: request.palette.digest(),
            rules_version: request.rules.book().version.clone(),
            balance: request.balance.to_string(),
            scenes: frames.iter().map(|frame| &frame.scene).collect::<BTreeSet<_>>().len(),
            frames: frames.len(),
            failed,
            dark: generated.dark.len(),
            questions: asked.len(),
            candidates: generated
                .counts
                .iter()
                .map(|(family, counts)| (family.clone(), CandidateCounts::new(counts)))
                .collect(),
            per_frame: BTreeMap::new(),
            answers: BTreeMap::new(),
            texts: count(asked, |asked| asked.question.text.clone()),
            choices: count(asked, |asked| asked.question.choices.len()),
            polarity: BTreeMap::new(),
            classes: coverage(frames, asked),
            rooms: count_room_frames(generated),
            room_agreement: room_agreement(frames, generated, request.rules.book()),
            gaps: BTreeMap::new(),
            repeats: 0,
            unknown: BTreeMap::new(),
            baselines: baselines(asked),
        };
        let per_frame = count(asked, |asked| asked.question.frame.clone());
        for frame in frames {
            let questions = per_frame.get(&frame.frame).copied().unwrap_or(0);
            *summary.per_frame.entry(questions).or_insert(0) += 1;
            for (id, pixels) in &frame.unknown {
                *summary.unknown.entry(*id).or_insert(0) += pixels;
            }
        }
        for asked in asked {
            summary.add(asked);
        }
        summary.repeats = count(asked, GeneratedQuestion::repeat_key).values().map(|count| count - 1).sum();
        summary
    }

    /// Counts one question by answer, polarity, gap and room.
    fn add(&mut self, asked: &GeneratedQuestion) {
        let question = &asked.question;
        let answers = self.answers.entry(question.family.clone()).or_default();
        *answers.entry(asked.answer().to_owned()).or_insert(0) += 1;
        if question.family.is_yes_no() {
            let subjects = self.polarity.entry(question.family.clone()).or_default();
            let counts = subjects.entry(asked.about.clone()).or_default();
            if let Some(truth) = question.choices.truth() {
                counts[truth] += 1;
            }
        }
        if let Some(gap) = question.evidence.value().get("gap_mm").and_then(serde_json::Value::as_u64) {
            *self.gaps.entry(gap / 250 * 250).or_insert(0) += 1;
        }
        if question.family == Family::RoomType {
            self.rooms.entry(asked.answer().to_owned()).or_default().questions += 1;
        }
    }
}

impl CandidateCounts {
    fn new(counts: &FamilyCounts) -> Self {
        let [not_chosen, rejected, unbalanced] =
            [OmissionReason::NotChosen, OmissionReason::Rejected, OmissionReason::Unbalanced]
                .map(|reason| counts.omitted.get(&reason).copied().unwrap_or(0));
        Self {
            viable: counts.viable,
            asked: counts.asked,
            not_chosen,
            rejected,
            unbalanced,
            rejections: counts.rejections.clone(),
        }
    }
}

/// Counts questions by a key.
fn count<'a, K: Ord>(
    asked: impl IntoIterator<Item = &'a GeneratedQuestion>,
    key: impl Fn(&'a GeneratedQuestion) -> K,
) -> BTreeMap<K, usize> {
    let mut counts = BTreeMap::new();
    for asked in asked {
        *counts.entry(key(asked)).or_insert(0) += 1;
    }
    counts
}

/// Expected number of right answers of uniform guesses. `questions` maps a number of choices to a number of questions.
fn expected_by_chance(questions: &BTreeMap<usize, usize>) -> f64 {
    questions.iter().map(|(choices, count)| *count as f64 / *choices as f64).sum()
}

/// Counts of each class in frames and questions.
fn coverage(frames: &[FrameStatistics], asked: &[GeneratedQuestion]) -> BTreeMap<String, ClassCoverage> {
    let mut classes: BTreeMap<String, ClassCoverage> = BTreeMap::new();
    for frame in frames {
        for (class, pixels) in &frame.classes {
            let coverage = classes.entry(class.clone()).or_default();
            coverage.pixels += pixels;
            coverage.frames += 1;
        }
        for segment in &frame.segments {
            classes.entry(segment.class.clone()).or_default().segments += 1;
        }
    }
    for asked in asked {
        if asked.question.family.row().is_some_and(|row| row.has_outline) {
            classes.entry(asked.about.clone()).or_default().questions += 1;
        }
    }
    classes
}

/// Number of frames whose room type is both stated and classified, and number of these frames where both agree.
fn room_agreement(frames: &[FrameStatistics], generated: &Generated, book: &RuleBook) -> [usize; 2] {
    let signs: BTreeMap<_, _> = generated.rooms.iter().map(|(frame, signs)| (frame, signs)).collect();
    let mut agreement = [0, 0];
    for frame in frames {
        let signs = signs.get(&frame.frame);
        let classified = signs.and_then(|signs| signs.room.as_ref().ok());
        if let (Some(classified), Some(stated)) = (classified, stated_room(frame, book)) {
            agreement[0] += 1;
            agreement[1] += usize::from(*classified == stated);
        }
    }
    agreement
}

/// Number of frames of each classified room type; the numbers of questions are 0.
fn count_room_frames(generated: &Generated) -> BTreeMap<String, RoomCoverage> {
    let mut rooms: BTreeMap<String, RoomCoverage> = BTreeMap::new();
    for room in generated.rooms.iter().filter_map(|(_, signs)| signs.room.as_ref().ok()) {
        rooms.entry(room.clone()).or_default().frames += 1;
    }
    rooms
}

/// Baselines of each family and of all questions.
fn baselines(asked: &[GeneratedQuestion]) -> BTreeMap<String, Baselines> {
    let mut families: BTreeMap<&Family, Vec<&GeneratedQuestion>> = BTreeMap::new();
    for asked in asked {
        families.entry(&asked.question.family).or_default().push(asked);
    }
    let mut all: BTreeMap<String, Baselines> = BTreeMap::new();
    let mut total = Baselines::default();
    for (family, questions) in families {
        let answers = count(questions.iter().copied(), GeneratedQuestion::answer);
        let by_choices = count(questions.iter().copied(), |asked| asked.question.choices.len());
        let baselines = Baselines {
            questions: questions.len(),
            chance: expected_by_chance(&by_choices),
            majority: answers.values().copied().max().unwrap_or(0),
            prior: prior(&questions),
        };
        total.questions += baselines.questions;
        total.chance += baselines.chance;
        total.majority += baselines.majority;
        total.prior += baselines.prior;
        all.insert(family.name().to_owned(), baselines);
    }
    all.insert(Family::TOTAL.to_owned(), total);
    all
}

/// Computes [`Baselines::prior`] for the questions of one family.
fn prior(questions: &[&GeneratedQuestion]) -> f64 {
    // Counts by text, answer and scene. The empty text is the key for all questions of the family.
    let mut counts: BTreeMap<&str, BTreeMap<&str, BTreeMap<&str, usize>>> = BTreeMap::new();
    for asked in questions {
        for text in ["", &asked.question.text] {
            let scenes = counts.entry(text).or_default().entry(asked.answer()).or_default();
            *scenes.entry(&asked.scene).or_insert(0) += 1;
        }
    }
    let (mut right, mut guesses) = (0_usize, BTreeMap::<usize, usize>::new());
    for asked in questions {
        let most_common = [&*asked.question.text, ""].into_iter().find_map(|text| {
            counts
                .get(text)
                .into_iter()
                .flatten()
                .filter(|(answer, _)| {
                    let choices = asked.question.choices.texts();
                    choices.iter().any(|choice| choice == *answer)
                })
                .map(|(answer, scenes)| {
                    let count: usize =
                        scenes.iter().filter(|(scene, _)| **scene != asked.scene).map(|(_, count)| count).sum();
                    (*answer, count)
                })
                .filter(|(_, count)| *count > 0)
                .min_by_key(|&(answer, count)| (std::cmp::Reverse(count), answer))
                .map(|(answer, _)| answer)
        });
        match most_common {
            Some(answer) => right += usize::from(answer == asked.answer()),
            None => *guesses.entry(asked.question.choices.len()).or_insert(0) += 1,
        }
    }
    right as f64 + expected_by_chance(&guesses)
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::{Choices, Evidence, FrameId, Question, QuestionId};

    fn closest(scene: &str, choices: [&str; 2]) -> GeneratedQuestion {
        GeneratedQuestion {
            question: Question {
                id: QuestionId(scene.to_owned()),
                frame: FrameId(scene.to_owned()),
                family: Family::Closest,
                text: "Which object is closest?".to_owned(),
                choices: Choices::new(choices.map(str::to_owned).to_vec(), 0).unwrap(),
                group: None,
                evidence: Evidence::default(),
            },
            about: choices[0].to_owned(),
            scene: scene.to_owned(),
        }
    }

    #[test]
    fn prior_replies_with_own_choices() {
        let questions = [
            closest("a", ["chair", "bed"]),
            closest("b", ["chair", "bed"]),
            closest("c", ["sofa", "lamp"]),
            closest("d", ["sofa", "lamp"]),
            closest("e", ["chair", "lamp"]),
        ];
        // In other scenes the chair is as common as the sofa, or more, but the questions about the sofa do not offer
        // it.
        let right = prior(&questions.iter().collect::<Vec<_>>());
        assert!((right - 5.0).abs() < 1e-12, "{right}");
    }
}
