//! Algorithm 1 of the paper: [`generate`].

use std::collections::{BTreeMap, BTreeSet};

use serde_json::json;

use super::balance::{BalanceMode, balance};
use super::colors::Palette;
use super::frequency::Frequency;
use super::reason::Reason;
use super::room::{RoomSigns, RoomSource, Views, classify};
use super::rule_context::{Candidate, GeneratedQuestion, Picker, RuleContext, RuleResult};
use super::rules::{RuleBook, Rules};
use super::statistics::FrameStatistics;
use super::vocabulary::Vocabulary;
use darkqa_base::error::Result;
use darkqa_base::types::{Choices, Digest, Family, FrameId, Labels, Question, QuestionId};

/// Settings for generating questions.
#[derive(Debug, Clone)]
pub struct QuestionRequest<'a> {
    /// Name of the data set; it enters the ids of questions.
    pub dataset: &'a str,
    /// Meaning of the numbers in the class maps.
    pub labels: &'a Labels,
    /// The rulebook with its digests.
    pub rules: &'a Rules,
    /// The table that names colours.
    pub palette: &'a Palette,
    /// The families to ask; families outside the paper are ignored.
    pub families: BTreeSet<Family>,
    /// Source of a frame's room type.
    pub room_source: RoomSource,
    pub balance: BalanceMode,
    /// Ids of the questions that a person has rejected.
    pub rejected: BTreeSet<QuestionId>,
}

/// Reason why a viable question is not asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum OmissionReason {
    /// Another question of the same family is asked of the frame.
    NotChosen,
    /// A person has rejected the question.
    Rejected,
    /// The answer would be too frequent.
    Unbalanced,
}

/// Numbers of a family's candidates, by outcome.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct FamilyCounts {
    /// Number of candidates that the rules accept: `asked` plus all of `omitted`.
    pub viable: u64,
    /// Number of questions that are asked.
    pub asked: u64,
    /// Number of viable candidates that are not asked, by reason.
    pub omitted: BTreeMap<OmissionReason, u64>,
    /// Number of candidates that the rules reject, by reason.
    pub rejections: BTreeMap<Reason, u64>,
}

impl FamilyCounts {
    /// Counts all results and returns the viable candidates.
    fn add(&mut self, results: Vec<RuleResult>) -> Vec<Candidate> {
        let mut candidates = Vec::new();
        for result in results {
            match result {
                RuleResult::Viable(candidate) => candidates.push(candidate),
                RuleResult::Rejected(rejection) => {
                    *self.rejections.entry(rejection.reason).or_insert(0) += 1;
                }
            }
        }
        self.viable += candidates.len() as u64;
        candidates
    }

    fn omit(&mut self, reason: OmissionReason, count: u64) {
        if count > 0 {
            *self.omitted.entry(reason).or_insert(0) += count;
        }
    }
}

/// The questions about a set of frames, with counts of all candidates.
#[derive(Debug, Default)]
pub struct Generated {
    /// The questions, sorted by scene, frame and family.
    pub asked: Vec<GeneratedQuestion>,
    /// Numbers of candidates by outcome, for each family.
    pub counts: BTreeMap<Family, FamilyCounts>,
    /// Evidence for the room type of each frame, sorted by scene and frame.
    pub rooms: Vec<(FrameId, RoomSigns)>,
    /// Frames that are too dark to ask anything about.
    pub dark: Vec<FrameId>,
    /// Warnings: a family has too few different answers to balance them.
    pub uneven: Vec<String>,
}

/// Generates questions about frames and calls `explain` for every candidate.
///
/// At most one question of a family is asked of a frame, because `Rule_k: (Φ_f, r_f) → (q, a)` of the paper returns one
/// pair. The frames are sorted by scene and name first, so their order does not matter.
///
/// # Errors
/// If a rulebook gives a question invalid choices, such as the same name twice.
pub fn generate(
    frames: &[FrameStatistics],
    request: &QuestionRequest<'_>,
    mut explain: impl FnMut(&FrameId, &RuleResult),
) -> Result<Generated> {
    let book = request.rules.book();
    let views = Views::new(frames, request.palette, book);
    let vocabulary = Vocabulary::new(frames, request.labels, book);
    let mut frames: Vec<&FrameStatistics> = frames.iter().collect();
    frames.sort_by(|a, b| (&a.scene, &a.frame).cmp(&(&b.scene, &b.frame)));
    let mut generated = Generated::default();
    let (dark, light) = frames.into_iter().partition::<Vec<_>, _>(|frame| frame.luma[1] < book.measure.dark_luma);
    generated.dark = dark.iter().map(|frame| frame.frame.clone()).collect();

    let mut frequency = Frequency::default();
    let rooms: Vec<(RoomSigns, Option<String>)> = light
        .iter()
        .map(|frame| {
            let signs = classify(frame, book);
            let room = asked_room(frame, &signs, request.room_source, book);
            frequency.add(frame, room.as_deref(), book);
            (signs, room)
        })
        .collect();

    let mut answer_counts = AnswerCounts::default();
    for (frame, (signs, room)) in light.iter().zip(&rooms) {
        let context = RuleContext {
            book,
            labels: request.labels,
            statistics: frame,
            signs,
            room: room.as_deref(),
            any_room: any_room(frame, signs, request.room_source),
            vocabulary: &vocabulary,
            views: &views,
            frequency: &frequency,
            picker: Picker { seed: book.seed, dataset: request.dataset, frame: &frame.frame },
        };
        for family in request.families.iter().filter(|family| family.row().is_some()) {
            let results = super::candidates(family, &context, request.palette);
            let counts = generated.counts.entry(family.clone()).or_default();
            for result in &results {
                explain(&frame.frame, result);
            }
            let candidates = counts.add(results);
            let others = candidates.len().saturating_sub(1) as u64;
            let Some(candidate) = answer_counts.choose(candidates, &context) else {
                continue;
            };
            counts.omit(OmissionReason::NotChosen, others);
            let asked = into_question(candidate, frame, request)?;
            if request.rejected.contains(&asked.question.id) {
                counts.omit(OmissionReason::Rejected, 1);
            } else {
                generated.asked.push(asked);
            }
        }
    }
    generated.rooms = light.iter().zip(rooms).map(|(frame, (signs, _))| (frame.frame.clone(), signs)).collect();
    Ok(balance_answers(generated, request))
}

/// Balances the answers and completes the counts.
fn balance_answers(mut generated: Generated, request: &QuestionRequest<'_>) -> Generated {
    let balanced = balance(std::mem::take(&mut generated.asked), request.balance, &request.rules.book().balance);
    for family in balanced.dropped {
        let counts = generated.counts.entry(family).or_default();
        counts.omit(OmissionReason::Unbalanced, 1);
    }
    for asked in &balanced.asked {
        let counts = generated.counts.entry(asked.question.family.clone());
        counts.or_default().asked += 1;
    }
    (generated.asked, generated.uneven) = (balanced.asked, balanced.uneven);
    generated
}

/// Room type of a frame; `None` if it is unknown or if questions do not ask about it.
fn asked_room(frame: &FrameStatistics, signs: &RoomSigns, source: RoomSource, book: &RuleBook) -> Option<String> {
    match source {
        RoomSource::Signature => signs.room.clone().ok(),
        RoomSource::Stated => stated_room(frame, book),
    }
}

/// Room type of a frame, even if questions do not ask about it; `None` if it is unknown.
fn any_room<'a>(frame: &'a FrameStatistics, signs: &'a RoomSigns, source: RoomSource) -> Option<&'a str> {
    match source {
        RoomSource::Signature => signs.winner.as_deref(),
        RoomSource::Stated => frame.room.as_deref(),
    }
}

/// Room type that the data set states for a frame; `None` if questions do not ask about such rooms.
#[must_use]
pub fn stated_room(frame: &FrameStatistics, book: &RuleBook) -> Option<String> {
    let stated = frame.room.as_deref()?.to_lowercase().replace(['_', '-'], " ");
    book.room.order.iter().find(|room| **room == stated).cloned()
}

/// Numbers of yes and no answers chosen so far, by family and text.
#[derive(Default)]
struct AnswerCounts(BTreeMap<(Family, String), [u64; 2]>);

impl AnswerCounts {
    /// Chooses one of a family's candidates.
    ///
    /// For yes-no families, the answer is picked first, if both are possible. Among the candidates with this answer,
    /// the question whose answers it balances best is preferred, then the question asked least. Hashes break ties.
    fn choose(&mut self, candidates: Vec<Candidate>, context: &RuleContext<'_>) -> Option<Candidate> {
        let family = candidates.first()?.family.clone();
        let binary = family.is_yes_no();
        if !binary {
            let chosen = context.picker.pick(family.name(), "candidate", candidates.len());
            return candidates.into_iter().nth(chosen);
        }
        let answer = context.picker.pick(family.name(), "polarity", 2);
        let (wanted, others) = candidates.into_iter().partition::<Vec<_>, _>(|candidate| candidate.truth == answer);
        let eligible = if wanted.is_empty() { others } else { wanted };
        let chosen = eligible.into_iter().min_by_key(|candidate| {
            let counts = self.0.get(&(family.clone(), candidate.text.clone()));
            let counts = counts.copied().unwrap_or_default();
            let (own, other) = (counts[candidate.truth], counts[1 - candidate.truth]);
            let bits = context.picker.bits(family.name(), &candidate.text);
            (i128::from(own) - i128::from(other), own + other, bits)
        })?;
        let counts = self.0.entry((family, chosen.text.clone())).or_default();
        counts[chosen.truth] += 1;
        Some(chosen)
    }
}

/// Turns a candidate into a question, with the digests of the rules in its evidence.
fn into_question(
    candidate: Candidate,
    frame: &FrameStatistics,
    request: &QuestionRequest<'_>,
) -> Result<GeneratedQuestion> {
    let id = question_id(&candidate, frame, request.dataset);
    let mut evidence = candidate.evidence;
    let rules = json!({
        "version": request.rules.book().version,
        "digest": request.rules.digest(),
        "colors": request.palette.digest(),
    });
    if let Some(evidence) = evidence.as_object_mut() {
        evidence.insert("about".to_owned(), json!(candidate.about));
        evidence.insert("scene".to_owned(), json!(frame.scene));
        evidence.insert("rules".to_owned(), rules);
    }
    let choices = Choices::new(candidate.choices, candidate.truth).map_err(|e| e.at("rules"))?;
    let question = Question {
        id,
        frame: frame.frame.clone(),
        family: candidate.family,
        text: candidate.text,
        choices,
        group: None,
        evidence: evidence.into(),
    };
    Ok(GeneratedQuestion { question, about: candidate.about, scene: frame.scene.clone() })
}

/// Id of a question: the family and a digest of frame, text, choices and answer. It depends neither on the position in
/// the file nor on the evidence or the rulebook.
fn question_id(candidate: &Candidate, frame: &FrameStatistics, dataset: &str) -> QuestionId {
    let parts = [dataset, &frame.scene, &frame.frame.0, candidate.family.name(), &candidate.text]
        .into_iter()
        .chain(candidate.choices.iter().map(String::as_str))
        .chain([candidate.answer()])
        .map(str::as_bytes);
    let digest = Digest::from_parts(parts).to_string();
    QuestionId(format!("{}-{}", candidate.family, &digest[..16]))
}
