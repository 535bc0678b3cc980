//! Items of open questions for the page's script: [`packed`].

use std::collections::BTreeMap;

use super::open_report::{OpenReport, ReportedAnswer};
use crate::error::Result;
use crate::report::page::data::{
    ABSENT, Distinct, FAILED, Item, ModelInCondition, PageData, PageKind, Question, SizeLimit, UNREAD, levels,
    packed_by, shortened, sizes, thumbnails,
};
use crate::report::text::words;
use crate::types::AxisLevel;
use darkqa_score::model_in_condition;
use darkqa_score::open::{AnswerOutcome, Group};

/// Reasons why an answer has no mark. `why` has indices into this list, which failures of answers extend.
const REASONS: [&str; 3] = ["", "the judge’s reply has no mark", "no judge was asked"];

/// Packs the data of the script as compressed JSON in base64.
///
/// # Errors
/// If the data cannot be serialized.
pub(super) fn packed(report: &OpenReport<'_>) -> Result<String> {
    let subjects: Vec<&model_in_condition::ModelInCondition> =
        report.summary.cells.iter().filter(|cell| cell.group == Group::All).map(|cell| &cell.subject).collect();
    packed_by(|limit| data(report, &subjects, limit))
}

/// Results of all answers. Nested lists have a row for each subject and a column for each item.
struct Results<'a> {
    items: Vec<Item>,
    /// Mark of each answer, or the code of another outcome.
    codes: Vec<Vec<u8>>,
    /// Index into `reasons` for each answer.
    why: Vec<Vec<usize>>,
    reasons: Vec<String>,
    texts: Vec<&'a str>,
    /// Index into `texts` for each answer.
    replies: Vec<Vec<usize>>,
    /// Index into `texts` for the judge's reply to each answer.
    judged: Vec<Vec<usize>>,
}

fn data<'a>(
    report: &'a OpenReport<'_>,
    subjects: &[&'a model_in_condition::ModelInCondition],
    limit: SizeLimit,
) -> PageData<'a> {
    let (mut frames, mut families) = (Distinct::new(), Distinct::new());
    let questions: Vec<Question<'_>> = report
        .questions
        .iter()
        .map(|question| Question {
            id: &question.id.0,
            frame: frames.index_of(&*question.frame.0),
            family: families.index_of([question.family.name(), words::family(Some(&question.family))]),
            text: &question.text,
            evidence: None,
            outlines: Vec::new(),
            object: None,
            answer: question.answer.as_deref(),
            also_right: question.extra_answers.as_deref().unwrap_or_default(),
        })
        .collect();
    let results = results(report, subjects);
    PageData {
        kind: PageKind::Open,
        runs: report.names(),
        folders: vec![report.folder.clone()],
        levels: levels(subjects.iter().filter_map(|subject| subject.level)),
        sizes: sizes(report.thumbnails, &frames.list),
        thumbnails: thumbnails(report.thumbnails, &frames.indices, limit.pictures),
        families: families.list,
        frames: frames.list,
        subjects: subjects.iter().map(|subject| subject_data(subject, subjects)).collect(),
        questions,
        choices: vec![&[]],
        items: results.items,
        lenient: Vec::new(),
        strict: results.codes,
        reasons: results.reasons,
        why: results.why,
        texts: shortened(&results.texts, limit.text),
        replies: results.replies,
        judged: results.judged,
        confusions: Vec::new(),
    }
}

/// A subject as the script needs it, with the index of the same model at L0.
fn subject_data<'a>(
    subject: &'a model_in_condition::ModelInCondition,
    all: &[&model_in_condition::ModelInCondition],
) -> ModelInCondition<'a> {
    let clean = subject.level.and_then(|_| {
        let clean =
            model_in_condition::ModelInCondition::with_images(&subject.model, AxisLevel::L0, &subject.variant, None);
        all.iter().position(|other| other.matches_up_to_group(&clean))
    });
    ModelInCondition::new(subject, clean)
}

/// Answers by subject, with one item for each question; if several people answered a question, each answer is an item
/// of its own.
fn results<'a>(report: &'a OpenReport<'_>, subjects: &[&model_in_condition::ModelInCondition]) -> Results<'a> {
    let indices: BTreeMap<&model_in_condition::ModelInCondition, usize> = subjects.iter().copied().zip(0..).collect();
    let mut cells = vec![vec![Vec::<&ReportedAnswer>::new(); subjects.len()]; report.questions.len()];
    for answer in report.answers {
        if let Some(&subject) = indices.get(&answer.subject) {
            cells[answer.question][subject].push(answer);
        }
    }
    let mut texts = Distinct::new();
    texts.index_of("");
    let mut reasons = Distinct::new();
    for reason in REASONS {
        reasons.index_of(reason);
    }
    let mut items = Vec::new();
    let mut codes = vec![Vec::new(); subjects.len()];
    let mut why = vec![Vec::new(); subjects.len()];
    let mut replies = vec![Vec::new(); subjects.len()];
    let mut judged = vec![Vec::new(); subjects.len()];
    for (number, (question, answers)) in report.questions.iter().zip(&cells).enumerate() {
        let times = answers.iter().map(Vec::len).max();
        for time in 0..times.unwrap_or(0).max(1) {
            items.push(Item {
                name: match time {
                    0 => question.id.to_string(),
                    time => format!("{}#{}", question.id, time + 1),
                },
                question: number,
                choices: 0,
                truth: None,
            });
            for (subject, answers) in answers.iter().enumerate() {
                let answer = answers.get(time).copied();
                let (code, reason) = answer.map_or((ABSENT, ""), code_and_reason);
                codes[subject].push(code);
                why[subject].push(reasons.index_of(reason));
                let text = answer.and_then(|answer| answer.answer.as_deref());
                replies[subject].push(texts.index_of(text.unwrap_or_default()));
                let judgement = answer.and_then(|answer| answer.judgement.as_deref());
                judged[subject].push(texts.index_of(judgement.unwrap_or_default()));
            }
        }
    }
    Results {
        items,
        codes,
        why,
        reasons: reasons.list.into_iter().map(str::to_owned).collect(),
        texts: texts.list,
        replies,
        judged,
    }
}

/// Code of an answer, and the reason if it has no mark. A mark is clamped to 1 to 5, as for the score.
fn code_and_reason(answer: &ReportedAnswer) -> (u8, &str) {
    match answer.outcome {
        AnswerOutcome::Marked(mark) => (mark.clamp(1, 5) as u8, REASONS[0]),
        AnswerOutcome::Null => (0, REASONS[0]),
        AnswerOutcome::Unmarked => (UNREAD, REASONS[1]),
        AnswerOutcome::Unjudged => (UNREAD, REASONS[2]),
        AnswerOutcome::Missing => (FAILED, answer.failure.as_deref().unwrap_or_default()),
    }
}
