//! The HTML page of a run of open questions: [`page`]. It has only text, SVG and thumbnails; its script only filters.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

use super::coverage::coverage;
use super::open_report::{OpenReport, ReportedAnswer};
use super::tables::SECTION;
use crate::error::Result;
use crate::report::chart::Figure;
use crate::report::page::{CHART_SCRIPT, STYLE, manifest_facts, tables};
use crate::report::readable::readable;
use crate::report::table::Table;
use crate::report::template::filled;
use crate::score::open::AnswerOutcome;
use crate::score::subject::Subject;
use crate::types::{AxisLevel, View};

/// The template of the page.
const PAGE: &str = include_str!("page.html");

/// The page as HTML.
///
/// # Errors
/// If the template cannot be filled.
pub(super) fn page(
    report: &OpenReport<'_>,
    tables: &[Table],
    figures: &[Figure],
) -> Result<String> {
    let categories = report
        .questions
        .iter()
        .map(|question| question.family.name());
    filled(
        PAGE,
        json!({
            "title": format!("OpenEQA in the dark: {}", report.name),
            "alerts": alerts(report),
            "intro": intro(report),
            "figures": figures,
            "tables": tables::page_tables(tables, SECTION),
            "categories": categories.collect::<BTreeSet<_>>(),
            "walks": walks(report),
            "facts": manifest_facts(report.manifest),
            "css": STYLE,
            "script": CHART_SCRIPT,
        }),
    )
}

/// Warnings at the top of the page: missing marks, missing answers, no judge.
fn alerts(report: &OpenReport<'_>) -> Vec<String> {
    let (status, counts) = (report.manifest.status, report.manifest.counts);
    let mut alerts: Vec<String> = report
        .alerts
        .iter()
        .map(|alert| alert.text.clone())
        .collect();
    let unmarked = report.answers.iter();
    let unmarked = unmarked.filter(|answer| answer.outcome == AnswerOutcome::Unmarked);
    match unmarked.count() {
        0 => {}
        n => alerts.push(format!(
            "{n} answers are not scored: the judge's replies to them have no mark."
        )),
    }
    if counts.answered < counts.trials {
        alerts.push(format!(
            "{status}: {} of {} answers and marks there, {} failed; what is not there is not scored.",
            counts.answered, counts.trials, counts.failed
        ));
    }
    if report.judge.is_none() {
        alerts.push("Nothing is marked: no judge was named.".to_owned());
    }
    alerts
}

fn intro(report: &OpenReport<'_>) -> Vec<String> {
    let (summary, judge) = (report.summary, report.judge.unwrap_or("nobody"));
    let mut lines = vec![
        format!(
            "{} questions about {} walks. Score: 100 · mean((mark − 1) / 4), marks from 1 to 5 by {judge}, protocol {}. Intervals are \
             95 %, by {} ({} clusters); drops are of unrounded means, on the questions that are scored in both.",
            report.questions.len(),
            report
                .questions
                .iter()
                .map(|question| &question.frame)
                .collect::<BTreeSet<_>>()
                .len(),
            report.protocol,
            summary.unit,
            summary.clusters
        ),
        coverage(report).join("; ") + ".",
    ];
    lines.extend(report.light_readings().open_question());
    lines
}

/// The walks in the order of their questions, each with its thumbnails and questions.
fn walks(report: &OpenReport<'_>) -> Vec<Value> {
    let mut by_question = BTreeMap::<usize, Vec<&ReportedAnswer>>::new();
    for answer in report.answers {
        by_question.entry(answer.question).or_default().push(answer);
    }
    let mut walks: Vec<(&str, Vec<Value>)> = Vec::new();
    let mut indices = BTreeMap::new();
    for (index, question) in report.questions.iter().enumerate() {
        let episode = &*question.frame.0;
        let walk = *indices.entry(episode).or_insert_with(|| {
            walks.push((episode, Vec::new()));
            walks.len() - 1
        });
        let answers = by_question.remove(&index).unwrap_or_default();
        let extra = question.extra_answers.as_ref();
        let extra = extra.map(|extra| readable(&extra.join("; ")));
        walks[walk].1.push(json!({
            "id": question.id,
            "text": readable(&question.text),
            "answer": readable(question.answer.as_deref().unwrap_or_default()),
            "extra": extra,
            "category": question.family.name(),
            "marks": marks(&answers),
            "lost": lost(&answers),
            "rows": answers.into_iter().map(row).collect::<Vec<_>>(),
        }));
    }
    let walks = walks
        .into_iter()
        .map(|(name, items)| json!({"name": name, "images": images(report, name), "items": items}));
    walks.collect()
}

fn images(report: &OpenReport<'_>, episode: &str) -> Vec<Value> {
    let all = report.thumbnails.iter();
    let mut thumbnails: Vec<_> = all
        .filter(|thumbnail| thumbnail.frame.0 == episode)
        .collect();
    thumbnails.sort_by_key(|thumbnail| &thumbnail.condition);
    let image = |thumbnail: &&crate::types::Thumbnail| {
        let caption = format!(
            "{}, the frame in the middle of the walk",
            thumbnail.condition
        );
        json!({"url": thumbnail.small, "caption": caption})
    };
    thumbnails.iter().map(image).collect()
}

fn row(reported: &ReportedAnswer) -> Value {
    let mark = match reported.outcome {
        AnswerOutcome::Marked(mark) => mark.to_string(),
        AnswerOutcome::Null => "0 (no answer)".to_owned(),
        AnswerOutcome::Unmarked => "none in the judge's reply".to_owned(),
        AnswerOutcome::Unjudged => "not judged".to_owned(),
        AnswerOutcome::Missing => "–".to_owned(),
    };
    let answer = match (&reported.answer, reported.outcome) {
        (Some(answer), _) => readable(answer),
        (None, AnswerOutcome::Missing) => "not answered".to_owned(),
        (None, _) => "none".to_owned(),
    };
    let subject = &reported.subject;
    json!({"model": subject.model, "shown": subject.condition(), "mark": mark, "answer": answer})
}

/// A text for each model with images, for example `gpt-4o: L0 5 · L2-noise 4`.
fn marks(answers: &[&ReportedAnswer]) -> Vec<String> {
    let mut by_model = BTreeMap::<&str, Vec<String>>::new();
    for answer in answers {
        if answer.subject.view == Some(View::Image) {
            let mark = match answer.outcome {
                AnswerOutcome::Marked(mark) => mark.to_string(),
                AnswerOutcome::Null => "0".to_owned(),
                _ => "–".to_owned(),
            };
            let model = by_model.entry(&answer.subject.model).or_default();
            model.push(format!("{} {mark}", answer.subject.condition()));
        }
    }
    let models = by_model.into_iter();
    models
        .map(|(model, marks)| format!("{model}: {}", marks.join(" · ")))
        .collect()
}

/// Whether some subject with a level has fewer points than the same model on the clean frames.
fn lost(answers: &[&ReportedAnswer]) -> bool {
    let points = |subject: &Subject| {
        let mut of_subject = answers
            .iter()
            .filter(|answer| answer.subject.is_for(subject));
        of_subject.find_map(|answer| answer.outcome.points())
    };
    answers.iter().any(|answer| {
        let subject = &answer.subject;
        let clean = Subject::seeing(&subject.model, AxisLevel::L0, &subject.variant, None);
        let pair = points(&clean).zip(answer.outcome.points());
        subject.level.is_some() && pair.is_some_and(|(clean, here)| here < clean)
    })
}
