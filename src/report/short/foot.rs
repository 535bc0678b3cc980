//! Lines below the short table: models without images and chance ([`baselines`]), and marks and facts of models
//! ([`about_models`]).

use crate::report::choice_report::ChoiceReport;
use crate::report::tables::{control_text, unread_note};
use crate::report::text::ladder::Ladder;
use crate::report::text::words::{percent, with_interval};
use crate::report::text::wrapped::wrapped;
use crate::types::replies::OBSERVER;
use darkqa_score::accuracies::AccuracyCell;
use darkqa_score::choice::ParsingMode;
use darkqa_score::model_in_condition::{CHANCE, is_observer, without_run};

/// Mark of an accuracy that is detected to be below the accuracy without images.
pub(super) const BELOW: char = '▼';

/// Lines below the table: models without images, chance, and explanations of the last column and of the mark.
pub(super) fn baselines(report: &ChoiceReport<'_>, ladder: &Ladder<'_, AccuracyCell>) -> String {
    let mut parts = Vec::new();
    for (subject, cell) in &ladder.without_level {
        let Some(share) = cell.accuracy else {
            continue;
        };
        parts.push(match subject.view {
            None => {
                let once = report.findings.summary.chance_of_questions;
                let once = once.map(|once| {
                    format!(" over all orders of choices ({} with each question once)", percent(once.value))
                });
                format!("chance {}{}", percent(share.value), once.unwrap_or_default())
            }
            Some(_) if parts.is_empty() => {
                format!("without images: {} {}", subject.model, with_interval(share))
            }
            Some(_) => format!("{} {}", subject.model, with_interval(share)),
        });
    }
    let has_mark = report
        .findings
        .summary
        .family_cells(None, ParsingMode::Strict)
        .filter(|cell| cell.subject.level.is_some())
        .any(|cell| !report.findings.below_blind(&cell.subject, None).is_empty());
    if has_mark {
        parts.push(format!("{BELOW} less often right than without images"));
    }
    let mut text = String::new();
    if !ladder.series.is_empty() {
        let line = "95 %: how far the widest interval of the row reaches down and up";
        text += &wrapped(" ", line, " ");
    }
    let lenient: usize = report.findings.health.iter().map(|health| health.lenient_only).sum();
    if lenient > 0 {
        let replies = if lenient == 1 { "reply is" } else { "replies are" };
        let line = format!("{lenient} more {replies} read by the lenient parsing alone: --full");
        text += &wrapped(" ", &line, " ");
    }
    if !parts.is_empty() {
        text += &wrapped(" ", &parts.join(" · "), " ");
    }
    text += &observer_control(report);
    if let Some(reasons) = unread_note(&report.findings.summary) {
        text += &wrapped(" ", &reasons, " ");
    }
    text
}

/// Line that defines the observer, with the score of its standing control in each run; empty if the observer is not in
/// the report.
fn observer_control(report: &ChoiceReport<'_>) -> String {
    let findings = report.findings;
    let is_shown = findings.grid.subjects.iter().any(|subject| is_observer(&subject.model));
    let controls = findings.observer.standing_controls();
    let Some(first) = controls.first().filter(|_| is_shown) else {
        return String::new();
    };
    let scores: Vec<String> = controls
        .iter()
        .map(|cell| {
            let run = &cell.subject.model[without_run(&cell.subject.model).len()..];
            with_interval(cell.score) + run
        })
        .collect();
    let line = format!(
        "{OBSERVER}: known-signal observer, given the untouched frame; not a model. Control: {}, scores {}; chance is {}",
        control_text(first),
        scores.join(" and "),
        percent(first.chance)
    );
    wrapped(" ", &line, " ")
}

/// Explanations of the marks of models, training data of enhancers, and a line for each model with the facts that the
/// user gave about it.
pub(super) fn about_models(report: &ChoiceReport<'_>, models: &[&str]) -> String {
    let listing = &report.findings.grid.listing;
    let mut text = listing.footnote(models.iter().copied()).map_or_else(String::new, |foot| wrapped(" ", &foot, "   "));
    for (enhancer, training) in listing.trainings() {
        text += &wrapped(" ", &format!("{enhancer}: {training}"), "   ");
    }
    for model in models.iter().filter(|model| **model != CHANCE) {
        let facts: Vec<String> = listing
            .columns()
            .iter()
            .map(|column| {
                let fact = Some(listing.cell(*column, model)).filter(|fact| !fact.is_empty());
                format!("{} {}", column.head(), fact.unwrap_or("–"))
            })
            .collect();
        if !facts.is_empty() {
            text += &wrapped(" ", &format!("{model}: {}", facts.join(" · ")), "   ");
        }
    }
    text
}
