//! Simulated models, and the findings from their records.

use serde_json::json;

use crate::cluster::FrameTies;
use crate::comparisons::self_agreement::SelfAgreement;
use crate::comparisons::self_agreement::cell::AgreementCell;
use crate::statistics::bootstrap::SplitMix;
use darkqa_base::types::evidence::BANK_ID;
use darkqa_base::types::{
    ChoiceDetail, Condition, Digest, Family, FrameId, ModelListing, ParsedAnswer, QuestionId, Record, RunQuestion,
    TrialOutcome, UnreadReason,
};

/// 72 images with 25 questions each: 1,800 items.
pub(super) const IMAGES: usize = 72;
pub(super) const QUESTIONS: usize = 25;

/// Random numbers from 0 to 1.
pub(super) struct RandomNumbers(pub(super) SplitMix);

impl RandomNumbers {
    pub(super) fn next(&mut self) -> f64 {
        (self.0.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// “Yes” (0) with this chance, else “no” (1).
    pub(super) fn yes(&mut self, share: f64) -> usize {
        usize::from(self.next() >= share)
    }
}

/// The answer of a model: its answer in the light, and random numbers.
pub(super) type SimulatedAnswer = fn(usize, &mut RandomNumbers) -> usize;

/// A simulated model: its share of “yes” in the light, and its answers without an image, asked again in the light, and
/// in the dark.
pub(super) struct Simulated {
    pub(super) yes: f64,
    pub(super) blind: SimulatedAnswer,
    pub(super) again: SimulatedAnswer,
    pub(super) dark: SimulatedAnswer,
}

pub(super) fn keep(light: usize, _: &mut RandomNumbers) -> usize {
    light
}

pub(super) fn record(question: usize, image: usize, condition: &str, repeat: u32, chosen: Option<usize>) -> Record {
    let condition: Option<Condition> = (!condition.is_empty()).then(|| condition.parse().unwrap());
    let reading = ParsedAnswer { chosen, why: chosen.is_none().then_some(UnreadReason::Refused) };
    let detail = ChoiceDetail {
        frame: FrameId(format!("i{image:03}")),
        family: [Family::Presence, Family::Other("light".into())][question % 2].clone(),
        choices: ["yes", "no"].map(str::to_owned).to_vec(),
        truth: None,
        repeat,
        wording: None,
        order: 0,
        strict: Some(reading),
        lenient: Some(reading),
        outcome: chosen.map_or(TrialOutcome::Unparsed, |_| TrialOutcome::Answered),
        image: None,
        more_images: Vec::new(),
        shown_frame: None,
        observed: None,
        options: None,
    };
    let key = Digest::from_bytes(format!("{question} {image} {condition:?} {repeat}").as_bytes()).into();
    let id = QuestionId(format!("q{question:02}@i{image:03}"));
    Record::blank(key, id, "m", condition, detail)
}

/// The questions as a run stores them.
pub(super) fn questions() -> Vec<RunQuestion> {
    (0..IMAGES)
        .flat_map(|image| (0..QUESTIONS).map(move |question| [image, question]))
        .map(|[image, question]: [usize; 2]| RunQuestion {
            id: QuestionId(format!("q{question:02}@i{image:03}")),
            place: image * QUESTIONS + question,
            scene: String::new(),
            frame: FrameId(format!("i{image:03}")),
            family: [Family::Presence, Family::Other("light".into())][question % 2].clone(),
            text: format!("Is there thing {question}?"),
            choices: ["yes", "no"].map(str::to_owned).to_vec(),
            answer: None,
            extra_answers: None,
            group: None,
            evidence: json!({ BANK_ID: format!("q{question:02}") }).into(),
            image: None,
            images: Vec::new(),
        })
        .collect()
}

impl Simulated {
    /// The records: without an image, twice at L0, and at each level.
    pub(super) fn records(&self, levels: &[(&str, SimulatedAnswer)]) -> Vec<Record> {
        let mut draws = RandomNumbers(SplitMix(7));
        let mut records = Vec::new();
        for image in 0..IMAGES {
            for question in 0..QUESTIONS {
                let light = draws.yes(self.yes);
                records.push(record(question, image, "L0", 0, Some(light)));
                for (condition, repeat, answer) in
                    [("L0", 1, self.again), ("", 0, self.blind), ("L5-noise", 0, self.dark)]
                {
                    let chosen = Some(answer(light, &mut draws));
                    records.push(record(question, image, condition, repeat, chosen));
                }
                for (condition, answer) in levels {
                    let chosen = Some(answer(light, &mut draws));
                    records.push(record(question, image, condition, 0, chosen));
                }
            }
        }
        records
    }
}

/// Computes the self-agreement of records and reads a value from it.
pub(super) fn found<T>(records: &[Record], read: impl FnOnce(&SelfAgreement<'_>) -> T) -> T {
    let questions = questions();
    let listing = ModelListing::default();
    let trials = records.iter().cloned().collect();
    read(&SelfAgreement::new(&trials, &FrameTies::default(), &questions, &listing))
}

pub(super) fn cell(records: &[Record], condition: &str) -> AgreementCell {
    found(records, |found| at(found, condition).clone())
}

/// The cell of a condition.
pub(super) fn at<'f>(found: &'f SelfAgreement<'_>, condition: &str) -> &'f AgreementCell {
    let mut cells = found.whole();
    cells.find(|cell| cell.subject.condition() == condition).unwrap()
}
