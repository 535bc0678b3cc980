//! The items of open questions, as the page's script reads them: [`packed`].

use std::collections::{BTreeMap, HashMap};

use super::open_report::{OpenReport, ReportedAnswer};
use crate::error::Result;
use crate::report::page::data::{
    ABSENT, Distinct, FAILED, Item, ModelInCondition, PageData, PageKind, Question, SizeLimit,
    UNREAD, levels, packed_by, shortened, sizes, thumbnails,
};
use crate::text::words;
use crate::types::{AxisLevel, View};
use darkqa_score::model_in_condition;
use darkqa_score::open::{AnswerOutcome, Group};

/// Why an answer has no mark, by the index that `why` has of it.
const REASONS: [&str; 3] = ["", "the judge’s reply has no mark", "no judge was asked"];

/// Everything that the script shows, as compressed JSON in base64.
///
/// # Errors
/// If the data cannot be written.
pub(super) fn packed(report: &OpenReport<'_>) -> Result<String> {
    let subjects: Vec<&model_in_condition::ModelInCondition> = report
        .summary
        .cells
        .iter()
        .filter(|cell| cell.group == Group::All)
        .map(|cell| &cell.subject)
        .collect();
    packed_by(|limit| data(report, &subjects, limit))
}

/// The results of all subjects, a row each, a column for each item.
struct Results<'a> {
    items: Vec<Item>,
    codes: Vec<Vec<u8>>,
    why: Vec<Vec<usize>>,
    reasons: Vec<String>,
    texts: Vec<&'a str>,
    replies: Vec<Vec<usize>>,
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
            family: families.index_of([
                question.family.name(),
                words::family(Some(&question.family)),
            ]),
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
        subjects: subjects.iter().map(|own| shown(own, subjects)).collect(),
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

fn shown<'a>(
    own: &'a model_in_condition::ModelInCondition,
    all: &[&model_in_condition::ModelInCondition],
) -> ModelInCondition<'a> {
    let clean = own.level.and_then(|_| {
        let clean = model_in_condition::ModelInCondition::with_images(
            &own.model,
            AxisLevel::L0,
            &own.variant,
            None,
        );
        all.iter()
            .position(|other| other.matches_up_to_group(&clean))
    });
    ModelInCondition {
        name: words::name(own),
        model: &own.model,
        condition: own.condition(),
        light: match own.view {
            Some(View::Blind) => "blind".to_owned(),
            _ => words::light(&own.variant, own.enhancer.as_ref()),
        },
        level: own.level,
        variant: own.variant.to_string(),
        enhancer: own
            .enhancer
            .as_ref()
            .map(crate::types::EnhancerName::as_str),
        clean,
    }
}

/// The answers, an item for each question; where several people answered, further items of the same question.
fn results<'a>(
    report: &'a OpenReport<'_>,
    subjects: &[&model_in_condition::ModelInCondition],
) -> Results<'a> {
    let places: BTreeMap<&model_in_condition::ModelInCondition, usize> =
        subjects.iter().copied().zip(0..).collect();
    let mut cells = HashMap::<(usize, usize), Vec<&ReportedAnswer>>::new();
    for answer in report.answers {
        if let Some(&place) = places.get(&answer.subject) {
            let cell = cells.entry((answer.question, place)).or_default();
            cell.push(answer);
        }
    }
    let mut texts = Distinct::new();
    texts.index_of("");
    let mut reasons = Distinct::new();
    for reason in REASONS {
        reasons.index_of(reason);
    }
    let mut items = Vec::new();
    let empty = || vec![Vec::new(); subjects.len()];
    let (mut codes, mut why, mut replies, mut judged) =
        (vec![Vec::new(); subjects.len()], empty(), empty(), empty());
    for (number, question) in report.questions.iter().enumerate() {
        let of = |subject: usize| cells.get(&(number, subject)).map_or(&[][..], Vec::as_slice);
        let times = (0..subjects.len()).map(|subject| of(subject).len()).max();
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
            for subject in 0..subjects.len() {
                let answer = of(subject).get(time).copied();
                let (code, reason) = answer.map_or((ABSENT, ""), result);
                codes[subject].push(code);
                why[subject].push(reasons.index_of(reason));
                let text = answer.and_then(|answer| answer.answer.as_deref());
                replies[subject].push(texts.index_of(text.unwrap_or_default()));
                let said = answer.and_then(|answer| answer.judgement.as_deref());
                judged[subject].push(texts.index_of(said.unwrap_or_default()));
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

/// The code of an answer: its mark, clipped to 1 to 5 as it is scored; and why it has none.
fn result(answer: &ReportedAnswer) -> (u8, &str) {
    match answer.outcome {
        AnswerOutcome::Marked(mark) => (mark.clamp(1, 5) as u8, REASONS[0]),
        AnswerOutcome::Null => (0, REASONS[0]),
        AnswerOutcome::Unmarked => (UNREAD, REASONS[1]),
        AnswerOutcome::Unjudged => (UNREAD, REASONS[2]),
        AnswerOutcome::Missing => (FAILED, answer.failure.as_deref().unwrap_or_default()),
    }
}
