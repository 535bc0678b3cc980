//! Algorithm 1 of the paper: [`generate`].

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

use super::balance::{BalanceMode, balance};
use super::colors::Palette;
use super::frequency::Frequency;
use super::pick::Picker;
use super::reason::Reason;
use super::room::{RoomSigns, RoomSource, classify};
use super::rule_context::{Candidate, GeneratedQuestion, RuleContext, RuleResult};
use super::rules::{RuleBook, Rules};
use super::statistics::FrameStatistics;
use super::{affordance, closest, color, presence, room_type};
use crate::error::Result;
use crate::types::{Choices, Digest, Family, FrameId, Labels, Question, QuestionId};

/// What is asked for.
#[derive(Debug, Clone)]
pub struct QuestionRequest<'a> {
    /// The data set's name.
    pub dataset: &'a str,
    /// What its numbers stand for.
    pub labels: &'a Labels,
    /// The rulebook.
    pub rules: &'a Rules,
    /// The names of colours.
    pub palette: &'a Palette,
    /// The families that are wanted.
    pub families: BTreeSet<Family>,
    /// Who says what room a frame shows.
    pub room_source: RoomSource,
    /// How the answers are evened out.
    pub balance: BalanceMode,
    /// The questions that a person has rejected.
    pub rejected: BTreeSet<QuestionId>,
}

/// Why a question that holds is not asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum OmissionReason {
    /// Another one of its family is asked of the frame.
    NotChosen,
    /// A person has rejected it.
    Rejected,
    /// Its answer would be too frequent.
    Unbalanced,
}

/// What became of all candidates of a family.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct FamilyCounts {
    /// Those that hold.
    pub viable: u64,
    /// Those that are asked.
    pub asked: u64,
    /// Those that hold and are not asked.
    pub left: BTreeMap<OmissionReason, u64>,
    /// Those that do not hold.
    pub fallen: BTreeMap<Reason, u64>,
}

impl FamilyCounts {
    /// Those that hold, all counted.
    fn sift(&mut self, verdicts: Vec<RuleResult>) -> Vec<Candidate> {
        let mut claims = Vec::new();
        for verdict in verdicts {
            match verdict {
                RuleResult::Holds(claim) => claims.push(claim),
                RuleResult::Falls(fallen) => *self.fallen.entry(fallen.reason).or_insert(0) += 1,
            }
        }
        self.viable += claims.len() as u64;
        claims
    }

    fn leave(&mut self, why: OmissionReason, count: u64) {
        if count > 0 {
            *self.left.entry(why).or_insert(0) += count;
        }
    }
}

/// What came of the frames.
#[derive(Debug, Default)]
pub struct Generated {
    /// The questions, by scene, frame and family.
    pub asked: Vec<GeneratedQuestion>,
    /// What became of the candidates, by family.
    pub tallies: BTreeMap<Family, FamilyCounts>,
    /// What each frame says of its room, in the order of the frames.
    pub rooms: Vec<(FrameId, RoomSigns)>,
    /// Frames that are too dark to ask anything about.
    pub dark: Vec<FrameId>,
    /// Answers that stayed too frequent, since there are too few others.
    pub uneven: Vec<String>,
}

/// Makes the questions about frames; `explain` is told of every candidate.
///
/// At most one question of a family is asked of a frame, as `Rule_k: (Φ_f, r_f) → (q, a)` of the paper returns one pair. The
/// frames are taken by scene and name, whatever their order here.
///
/// # Errors
/// Where a rulebook makes choices that are none, as two of one name.
pub fn generate(
    frames: &[FrameStatistics],
    order: &QuestionRequest<'_>,
    mut explain: impl FnMut(&FrameId, &RuleResult),
) -> Result<Generated> {
    let book = order.rules.book();
    let mut frames: Vec<&FrameStatistics> = frames.iter().collect();
    frames.sort_by(|a, b| (&a.scene, &a.frame).cmp(&(&b.scene, &b.frame)));
    let mut made = Generated::default();
    let (dark, light): (Vec<_>, Vec<_>) = frames
        .into_iter()
        .partition(|frame| frame.luma[1] < book.measure.dark_luma);
    made.dark = dark.into_iter().map(|frame| frame.frame.clone()).collect();

    let mut frequency = Frequency::default();
    let rooms: Vec<(RoomSigns, Option<String>)> = light
        .iter()
        .map(|frame| {
            let signs = classify(frame, book);
            let room = room(frame, &signs, order.room_source, book);
            frequency.add(frame, room.as_deref(), book);
            (signs, room)
        })
        .collect();

    let mut running = AnswerCounts::default();
    for (frame, (signs, room)) in light.iter().zip(&rooms) {
        let survey = RuleContext {
            book,
            labels: order.labels,
            statistics: frame,
            signs,
            room: room.as_deref(),
            frequency: &frequency,
            picker: Picker {
                seed: book.seed,
                dataset: order.dataset,
                frame: &frame.frame,
            },
        };
        let families = order.families.iter();
        for family in families.filter(|family| Family::PAPER.contains(family)) {
            let verdicts = verdicts(family, &survey, order.palette);
            let tally = made.tallies.entry(family.clone()).or_default();
            for verdict in &verdicts {
                explain(&frame.frame, verdict);
            }
            let claims = tally.sift(verdicts);
            let spare = claims.len().saturating_sub(1) as u64;
            let Some(claim) = running.choose(claims, &survey) else {
                continue;
            };
            tally.leave(OmissionReason::NotChosen, spare);
            let asked = ask(claim, frame, order)?;
            if order.rejected.contains(&asked.question.id) {
                tally.leave(OmissionReason::Rejected, 1);
            } else {
                made.asked.push(asked);
            }
        }
    }
    let seen = light.iter().zip(rooms);
    made.rooms = seen
        .map(|(frame, (signs, _))| (frame.frame.clone(), signs))
        .collect();
    Ok(finish(made, order))
}

/// Evens out the answers, and counts.
fn finish(mut made: Generated, order: &QuestionRequest<'_>) -> Generated {
    let kept = balance(
        std::mem::take(&mut made.asked),
        order.balance,
        &order.rules.book().balance,
    );
    for family in kept.dropped {
        let tally = made.tallies.entry(family).or_default();
        tally.leave(OmissionReason::Unbalanced, 1);
    }
    for asked in &kept.asked {
        made.tallies
            .entry(asked.question.family.clone())
            .or_default()
            .asked += 1;
    }
    (made.asked, made.uneven) = (kept.asked, kept.uneven);
    made
}

/// The room that questions go by.
fn room(
    frame: &FrameStatistics,
    signs: &RoomSigns,
    source: RoomSource,
    book: &RuleBook,
) -> Option<String> {
    match source {
        RoomSource::Signature => signs.room.clone().ok(),
        RoomSource::Stated => stated(frame, book),
    }
}

/// The room that a person has stated, where questions ask about such a room.
#[must_use]
pub(crate) fn stated(frame: &FrameStatistics, book: &RuleBook) -> Option<String> {
    let stated = frame
        .room
        .as_deref()?
        .to_lowercase()
        .replace(['_', '-'], " ");
    book.room
        .order
        .iter()
        .find(|room| **room == stated)
        .cloned()
}

fn verdicts(family: &Family, survey: &RuleContext<'_>, palette: &Palette) -> Vec<RuleResult> {
    match family {
        Family::RoomType => room_type::candidates(survey),
        Family::Affordance => affordance::candidates(survey),
        Family::Presence => presence::candidates(survey),
        Family::Color => color::candidates(survey, palette),
        Family::Closest => closest::candidates(survey),
        Family::Other(_) => Vec::new(),
    }
}

/// How often each answer has been chosen so far, by family and subject.
#[derive(Default)]
struct AnswerCounts(BTreeMap<(Family, String), [u64; 2]>);

impl AnswerCounts {
    /// Chooses one of a family's claims.
    ///
    /// Of yes and no, the side is picked where both can be had. Of the claims of one side, the one whose subject lacks that
    /// side most, then the one whose subject was asked about least, then the one that is picked.
    fn choose(&mut self, claims: Vec<Candidate>, survey: &RuleContext<'_>) -> Option<Candidate> {
        let family = claims.first()?.family.clone();
        let binary = matches!(family, Family::Affordance | Family::Presence);
        if !binary {
            let chosen = survey.picker.pick(family.name(), "candidate", claims.len());
            return claims.into_iter().nth(chosen);
        }
        let side = survey.picker.pick(family.name(), "polarity", 2);
        let (wanted, others): (Vec<Candidate>, Vec<Candidate>) =
            claims.into_iter().partition(|claim| claim.truth == side);
        let side = if wanted.is_empty() { others } else { wanted };
        let rank = |claim: &Candidate| {
            let counts = self.0.get(&(family.clone(), claim.about.clone()));
            let counts = counts.copied().unwrap_or_default();
            let (own, other) = (counts[claim.truth], counts[1 - claim.truth]);
            let bits = survey.picker.bits(family.name(), &claim.about);
            (i128::from(own) - i128::from(other), own + other, bits)
        };
        let chosen = side.into_iter().min_by_key(rank)?;
        let counts = self.0.entry((family, chosen.about.clone())).or_default();
        counts[chosen.truth] += 1;
        Some(chosen)
    }
}

/// A claim as a question.
fn ask(
    claim: Candidate,
    frame: &FrameStatistics,
    order: &QuestionRequest<'_>,
) -> Result<GeneratedQuestion> {
    let id = id(&claim, frame, order.dataset);
    let mut evidence = claim.evidence;
    let rules = json!({
        "version": order.rules.book().version,
        "digest": order.rules.digest(),
        "colors": order.palette.digest(),
    });
    if let Some(evidence) = evidence.as_object_mut() {
        evidence.insert("about".to_owned(), json!(claim.about));
        evidence.insert("scene".to_owned(), json!(frame.scene));
        evidence.insert("rules".to_owned(), rules);
    }
    let choices = Choices::new(claim.choices, claim.truth).map_err(|e| e.at("rules"))?;
    let question = Question {
        id,
        frame: frame.frame.clone(),
        family: claim.family,
        text: claim.text,
        choices,
        evidence: Value::clone(&evidence),
    };
    Ok(GeneratedQuestion {
        question,
        about: claim.about,
        scene: frame.scene.clone(),
    })
}

/// The name of a question: its family, and the content of all that is asked, so that another place in the file, other evidence
/// or another rulebook that asks the same changes nothing.
fn id(claim: &Candidate, frame: &FrameStatistics, dataset: &str) -> QuestionId {
    let head = [
        dataset,
        &frame.scene,
        &frame.frame.0,
        claim.family.name(),
        &claim.text,
    ];
    let choices = claim.choices.iter().map(String::as_str);
    let parts = head.into_iter().chain(choices).chain([claim.answer()]);
    let digest = Digest::of_parts(parts.map(str::as_bytes)).to_string();
    QuestionId(format!("{}-{}", claim.family, &digest[..16]))
}
