//! The parts of the page on open questions: [`SECTIONS`], [`summary`] and [`intro`].
//!
//! Numbers of scored and unscored answers, as lines of text: [`coverage`].
//!
//! Items of open questions for the page's script: [`packed`].

use std::collections::{BTreeMap, BTreeSet};

use super::marked_answers::{MarkedAnswers, ReportedAnswer};
use super::tables::{SECTION, ladder};
use crate::page::data::{
    ABSENT, DistinctList, FAILED, PageData, PageItem, PageKind, PageQuestion, PageSubject, SizeLimit, UNREAD, levels,
    packed_by, shortened, sizes, thumbnails,
};
use crate::tables::Section;
use crate::text::words::{self, percent, points};
use darkqa_base::error::Result;
use darkqa_base::types::AxisLevel;
use darkqa_base::types::degradations::Axis;
use darkqa_base::types::text::counted;
use darkqa_score::model_in_condition::{self, ModelInCondition};
use darkqa_score::open::{AnswerOutcome, Baseline, Group, OpenCell};

/// Sections of the page before the items.
pub(super) const SECTIONS: [Section; 1] = [(SECTION, "Scores", "", &["scores", "categories"])];

/// Maximum number of clauses in the summary (chosen to fit one screen).
const MAX_CLAUSES: usize = 3;

/// One sentence with the scores at the darkest level: differences from L0, and of each enhancer from raw frames. The
/// differences are not tested.
pub(super) fn summary(report: &MarkedAnswers<'_>) -> Option<String> {
    let whole = ladder(report.summary, &Group::All);
    let clauses: Vec<String> = whole
        .series
        .iter()
        .filter(|(series, _)| series.axis() == Some(Axis::LIGHT))
        .filter_map(|(series, cells)| {
            let (level, cell) = cells.last_key_value()?;
            let score = percent(cell.score?.value);
            let model = report.summary.listing.label(series.model);
            let light = series.light(&[]);
            Some(if series.is_enhanced() {
                let gain = change_text(report, &cell.subject, Baseline::Raw)?;
                format!("{light}: {score} % ({gain} against raw)")
            } else {
                let loss = change_text(report, &cell.subject, Baseline::Clean)?;
                format!("{model} {light} scores {score} % at {level} ({loss} against L0)")
            })
        })
        .collect();
    match clauses.len() {
        0 => None,
        count if count > MAX_CLAUSES => {
            Some(format!("{}; {} more below.", clauses[..MAX_CLAUSES].join("; "), count - MAX_CLAUSES))
        }
        _ => Some(clauses.join("; ") + "."),
    }
}

/// Difference of a score from a baseline, with its interval; `None` if they share no questions.
fn change_text(report: &MarkedAnswers<'_>, subject: &ModelInCondition, baseline: Baseline) -> Option<String> {
    let change = report.summary.change(subject, baseline, &Group::All)?;
    let difference = change.difference;
    let [value, low, high] = [difference.value, difference.low, difference.high].map(points);
    Some(format!("{value} [{low}, {high}]"))
}

/// Lines at the top of the page on questions, score, intervals and coverage.
pub(super) fn intro(report: &MarkedAnswers<'_>) -> Vec<String> {
    let (summary, judge) = (report.summary, report.judge.unwrap_or("nobody"));
    let walks: BTreeSet<_> = report.questions.iter().map(|question| &question.frame).collect();
    let mut lines = vec![
        format!(
            "{} about {}. Score: 100 · mean((mark − 1) / 4), marks from 1 to 5 by {judge}, protocol {}. Intervals are \
             95 %, by {} ({}); differences are of unrounded means, on the questions that are scored in both.",
            counted(report.questions.len(), "question"),
            counted(walks.len(), "walk"),
            report.protocol,
            summary.unit,
            counted(summary.clusters, "cluster")
        ),
        coverage(report).join("; ") + ".",
    ];
    lines.extend(report.noise_profiles().open_question());
    lines
}

/// One line with the number of scored answers, then one line for each other outcome that occurs.
#[must_use]
pub(super) fn coverage(report: &MarkedAnswers<'_>) -> Vec<String> {
    let scored = total(report, OpenCell::scored);
    let planned = total(report, |cell| cell.planned);
    let unjudged = match report.judge {
        Some(_) => total(report, |cell| cell.unjudged),
        None => 0,
    };
    let outcomes = [
        (total(report, |cell| cell.missing), "not answered: not scored"),
        (unjudged, "not judged yet: not scored"),
        (
            total(report, |cell| cell.unmarked),
            "without a mark in the judge's reply: not scored (--protocol tolerant reads more, --judge-max-tokens gives it more room)",
        ),
        (
            total(report, |cell| cell.null),
            "without an answer (none in a file, only thoughts, no \"A:\" of a blind model): scored 0, unjudged",
        ),
        (total(report, |cell| cell.cut), "cut after their last full stop before they were judged, as upstream does"),
    ];
    let mut lines = vec![format!("{scored} of {planned} answers scored")];
    for (count, outcome) in outcomes {
        if count > 0 {
            lines.push(format!("{count} {outcome}"));
        }
    }
    lines
}

/// Sum of a count over all models and conditions.
fn total(report: &MarkedAnswers<'_>, count: fn(&OpenCell) -> usize) -> usize {
    report.summary.cells.iter().filter(|cell| cell.group == Group::All).map(count).sum()
}

/// Reasons why an answer has no mark. `why` has indices into this list, which failures of answers extend.
const REASONS: [&str; 3] = ["", "the judge’s reply has no mark", "no judge was asked"];

/// Packs the data of the script as compressed JSON in base64.
///
/// # Errors
/// If the data cannot be serialized.
pub(super) fn packed(report: &MarkedAnswers<'_>) -> Result<String> {
    let subjects: Vec<&model_in_condition::ModelInCondition> =
        report.summary.cells.iter().filter(|cell| cell.group == Group::All).map(|cell| &cell.subject).collect();
    packed_by(|limit| data(report, &subjects, limit))
}

/// Results of all answers. Nested lists have a row for each subject and a column for each item.
struct Results<'a> {
    items: Vec<PageItem>,
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
    report: &'a MarkedAnswers<'_>,
    subjects: &[&'a model_in_condition::ModelInCondition],
    limit: SizeLimit,
) -> PageData<'a> {
    let (mut frames, mut families) = (DistinctList::new(), DistinctList::new());
    let questions: Vec<PageQuestion<'_>> = report
        .questions
        .iter()
        .map(|question| PageQuestion {
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
        requests: None,
        confusions: Vec::new(),
    }
}

/// A subject as the script needs it, with the index of the same model at L0.
fn subject_data<'a>(
    subject: &'a model_in_condition::ModelInCondition,
    all: &[&model_in_condition::ModelInCondition],
) -> PageSubject<'a> {
    let clean = subject.level.and_then(|_| {
        let clean =
            model_in_condition::ModelInCondition::with_images(&subject.model, AxisLevel::L0, &subject.variant, None);
        all.iter().position(|other| other.matches_up_to_group(&clean))
    });
    PageSubject::new(subject, clean)
}

/// Answers by subject, with one item for each question; if several people answered a question, each answer is an item
/// of its own.
fn results<'a>(report: &'a MarkedAnswers<'_>, subjects: &[&model_in_condition::ModelInCondition]) -> Results<'a> {
    let indices: BTreeMap<&model_in_condition::ModelInCondition, usize> = subjects.iter().copied().zip(0..).collect();
    let mut cells = vec![vec![Vec::<&ReportedAnswer>::new(); subjects.len()]; report.questions.len()];
    for answer in report.answers {
        if let Some(&subject) = indices.get(&answer.subject) {
            cells[answer.question][subject].push(answer);
        }
    }
    let mut texts = DistinctList::new();
    texts.index_of("");
    let mut reasons = DistinctList::new();
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
            items.push(PageItem {
                name: match time {
                    0 => question.id.to_string(),
                    time => format!("{}#{}", question.id, time + 1),
                },
                question: number,
                choices: 0,
                truth: None,
                combination: String::new(),
                draw: 0,
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
