//! Tables of the known-signal observer: its score in each condition, and its controls.

use crate::text::table::ColumnKind::{Count, Percent, Share, Text};
use crate::text::table::{Table, TableBuilder, TableFormat};
use crate::text::words::percent;
use darkqa_base::types::Control;
use darkqa_base::types::replies::OBSERVER;
use darkqa_score::findings::Findings;
use darkqa_score::observed::{ObserverCell, ObserverSummary};

/// Heading of the tables, which defines the observer.
const HEADING: &str = "Known-signal observer (given the untouched frame; not a model)";

/// Minimum share of an image's variance that the clean frame explains if the image still resembles it (chosen).
const MIN_ALIKE: f64 = 0.5;

/// Formats for readers, as opposed to CSV files.
const READER_FORMATS: [TableFormat; 3] = [TableFormat::Terminal, TableFormat::Page, TableFormat::Latex];

pub(super) fn observer(findings: &Findings<'_>) -> Vec<Table> {
    let observer = &findings.observer;
    if observer.cells.is_empty() {
        return Vec::new();
    }
    let mut table = conditions(observer);
    table.heading =
        Some(format!("{HEADING}: expected score in % with its 95 % interval, a guess among k choices counts 1/k"));
    if !observer.is_hidden() && observer.is_asked() {
        let control =
            observer.standing_controls().first().map(|control| format!(" Control: {}.", control_text(control)));
        table.latex = Some(format!(
            "{HEADING}: expected score in \\% with its 95\\,\\% interval. A guess among $k$ choices counts $1/k$.{}",
            control.unwrap_or_default()
        ));
    }
    let mut tables = vec![table];
    if observer.controls.iter().any(|cell| !cell.is_standing()) {
        tables.push(controls(observer));
    }
    tables
}

/// A row for each condition. The file has rows for the controls, too.
fn conditions(observer: &ObserverSummary) -> Table {
    let is_hidden = observer.is_hidden();
    let mut builder = TableBuilder::new("observer", &observer.cells);
    for format in READER_FORMATS {
        builder = builder.hide(format, |cell| is_hidden || cell.is_control());
    }
    builder
        .page("observer", HEADING)
        .column(Text, "csv model", |cell| cell.subject.model.clone())
        .column(Text, "csv condition", |cell| cell.subject.condition())
        .column(Text, "terminal condition | page condition | latex Condition", |cell| {
            // If several runs are compared, each may have its own observer.
            let run = cell.subject.model.strip_prefix(OBSERVER).unwrap_or_default();
            cell.subject.condition() + run
        })
        .column(
            Share,
            "csv score low high | terminal expected score | page expected score in % [95 %] | latex Expected score",
            |cell| cell.score,
        )
        .column(Percent, "csv chance | terminal chance | page chance in % | latex Chance", |cell| cell.chance)
        .column(Share, "terminal control | page control in % [95 %] | latex Control", |cell| {
            observer.control_of(cell).map(|control| control.score)
        })
        .column(
            Percent,
            "csv from_evidence | terminal from evidence | page answers from evidence in % | latex From evidence",
            |cell| cell.evidence,
        )
        .column(Percent, "csv things_seen | terminal things seen | page things seen in % | latex Things seen", |cell| {
            cell.seen
        })
        .column(Percent, "csv things_detected | page detected in %", |cell| cell.detected)
        .column(Percent, "csv r2 | terminal R² | page R² in % | latex $R^2$", |cell| cell.explained)
        .column(Count, "csv n | terminal n | page n | latex $n$", |cell| cell.score.n)
        .build()
}

/// A row for each control, over all conditions.
fn controls(observer: &ObserverSummary) -> Table {
    let mut table = TableBuilder::new("observer", &observer.controls)
        .page("observer", "Controls of the observer, over all conditions")
        .column(Text, "terminal control | page control", |cell| cell.subject.model.clone())
        .column(Share, "terminal expected score | page expected score in % [95 %]", |cell| cell.score)
        .column(Percent, "terminal chance | page chance in %", |cell| cell.chance)
        .column(Percent, "terminal from evidence | page answers from evidence in %", |cell| cell.evidence)
        .column(Percent, "terminal things seen | page things seen in %", |cell| cell.seen)
        .column(Count, "terminal n | page n", |cell| cell.score.n)
        .build();
    table.heading = Some("Controls of the observer, over all conditions".to_owned());
    table
}

/// Warnings: a control that is not at chance, a missing control, and images of changed geometry.
pub fn notes(observer: &ObserverSummary) -> Vec<String> {
    if !observer.is_asked() {
        return Vec::new();
    }
    if let Some(control) = observer.failed_controls().next() {
        let [value, low, high] = [control.score.value, control.score.low, control.score.high].map(percent);
        let place = match control.subject.level {
            Some(_) => format!("at {}", control.subject.condition()),
            None => "over all conditions".to_owned(),
        };
        return vec![format!(
            "the observer is not shown: its control {} {place} scores {value} [{low}, {high}], and chance is {}, so its answers do not \
             follow from the pixels alone (observer.csv has all numbers)",
            control.subject.model,
            percent(control.chance)
        )];
    }
    if observer.is_hidden() {
        return vec![
            "the observer is not shown: none of its controls has a reply, so that it guesses without the right image is not shown \
             (observer.csv has all numbers)"
                .to_owned(),
        ];
    }
    observer
        .cells
        .iter()
        .filter(|cell| !cell.is_control())
        .filter(|cell| cell.seen <= 0.0)
        .map(nothing_seen_note)
        .collect()
}

/// Text that describes a standing control by the images it is shown.
pub fn control_text(control: &ObserverCell) -> &'static str {
    if Control::from_model_name(&control.subject.model) == Some(Control::OtherRoom) {
        "the same observer, shown images of other rooms"
    } else {
        "the same observer, shown the tiles of the right images in another order"
    }
}

/// Warning about a condition in which the observer sees nothing.
fn nothing_seen_note(cell: &ObserverCell) -> String {
    let (condition, explained) = (cell.subject.condition(), percent(cell.explained));
    if cell.explained >= MIN_ALIKE {
        format!(
            "{condition}: nothing is seen, although the untouched frame explains {explained} % of the images: they may be shifted, \
             cropped or warped by a few pixels, which the observer takes for other images"
        )
    } else {
        format!(
            "{condition}: nothing is seen, and the untouched frame explains {explained} % of the images: they may be of other \
             frames or of changed geometry, or hold nothing of it"
        )
    }
}
