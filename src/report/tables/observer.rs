//! The tables of the observer: what could still be read in each condition, and its controls.

use crate::report::table::ColumnKind::{Count, Percent, Share, Text};
use crate::report::table::{Table, TableBuilder, TableFormat};
use crate::report::words::percent;
use crate::score::findings::Findings;
use crate::score::observed::{OTHER_ROOM, ObserverCell, ObserverSummary};

/// What the observer is, above its table.
const HEADING: &str = "Known-signal observer (given the untouched frame; not a model)";

/// Share of an image's variance that the untouched frame explains, from which on the image is still like it (chosen).
const ALIKE: f64 = 0.5;

const SHOWN: [TableFormat; 3] = [TableFormat::Terminal, TableFormat::Page, TableFormat::Latex];

pub(super) fn observer(findings: &Findings<'_>) -> Vec<Table> {
    let observer = &findings.observer;
    if observer.cells.is_empty() {
        return Vec::new();
    }
    let mut table = conditions(observer);
    table.heading = Some(format!(
        "{HEADING}: expected score in % with its 95 % interval, a guess among k choices counts 1/k"
    ));
    if !observer.is_refuted() && observer.is_asked() {
        table.latex = Some(format!(
            "{HEADING}: expected score in \\% with its 95\\,\\% interval. A guess among $k$ choices counts $1/k$. Control: \
             the same observer with the image of another scene."
        ));
    }
    let mut tables = vec![table];
    if observer
        .controls
        .iter()
        .any(|cell| cell.subject.model != OTHER_ROOM)
    {
        tables.push(controls(observer));
    }
    tables
}

/// A row for each condition. The file has rows for the controls, too.
fn conditions(observer: &ObserverSummary) -> Table {
    let is_refuted = observer.is_refuted();
    let mut builder = TableBuilder::new("observer", &observer.cells);
    for format in SHOWN {
        builder = builder.hide(format, |cell| is_refuted || cell.is_control());
    }
    builder
        .page("observer", HEADING)
        .column(Text, "csv model", |cell| cell.subject.model.clone())
        .column(
            Text,
            "csv condition | terminal condition | page condition | latex Condition",
            |cell| cell.subject.condition(),
        )
        .column(
            Share,
            "csv score low high | terminal expected score | page expected score in % [95 %] | latex Expected score",
            |cell| cell.score,
        )
        .column(Percent, "csv chance | terminal chance | page chance in % | latex Chance", |cell| {
            cell.chance
        })
        .column(
            Percent,
            "csv from_evidence | terminal from evidence | page answers from evidence in % | latex From evidence",
            |cell| cell.evidence,
        )
        .column(
            Percent,
            "csv things_seen | terminal things seen | page things seen in % | latex Things seen",
            |cell| cell.seen,
        )
        .column(Percent, "csv things_detected | page detected in %", |cell| cell.detected)
        .column(Percent, "csv r2 | terminal R² | page R² in % | latex $R^2$", |cell| {
            cell.explained
        })
        .column(Count, "csv n | terminal n | page n | latex $n$", |cell| cell.score.n)
        .column(
            Share,
            "terminal another room | page control: another room in % [95 %] | latex Control",
            |cell| observer.other_room(cell).map(|control| control.score),
        )
        .build()
}

/// A row for each control, over all conditions.
fn controls(observer: &ObserverSummary) -> Table {
    let mut table = TableBuilder::new("observer", &observer.controls)
        .page("observer", "Controls of the observer, over all conditions")
        .column(Text, "terminal control | page control", |cell| {
            cell.subject.model.clone()
        })
        .column(
            Share,
            "terminal expected score | page expected score in % [95 %]",
            |cell| cell.score,
        )
        .column(Percent, "terminal chance | page chance in %", |cell| {
            cell.chance
        })
        .column(
            Percent,
            "terminal from evidence | page answers from evidence in %",
            |cell| cell.evidence,
        )
        .column(
            Percent,
            "terminal things seen | page things seen in %",
            |cell| cell.seen,
        )
        .column(Count, "terminal n | page n", |cell| cell.score.n)
        .build();
    table.heading = Some("Controls of the observer, over all conditions".to_owned());
    table
}

/// What the reader must know: a control that is not at chance, a missing control, and images of changed geometry.
pub(in crate::report) fn notes(observer: &ObserverSummary) -> Vec<String> {
    if !observer.is_asked() {
        return Vec::new();
    }
    if let Some(control) = observer.refutations().next() {
        let [value, low, high] =
            [control.score.value, control.score.low, control.score.high].map(percent);
        return vec![format!(
            "the observer is not shown: its control {} at {} scores {value} [{low}, {high}], and chance is {}; it answers from the \
             labels, not from the pixels (observer.csv has all numbers)",
            control.subject.model,
            control.subject.condition(),
            percent(control.chance)
        )];
    }
    let mut notes = Vec::new();
    if !observer.cells.iter().any(ObserverCell::is_control) {
        notes.push(
            "no control was asked: that the observer guesses without the right image is not shown"
                .to_owned(),
        );
    }
    let own = observer.cells.iter().filter(|cell| !cell.is_control());
    notes.extend(own.filter(|cell| cell.seen <= 0.0).map(blank));
    notes
}

/// The note on a condition in which nothing is seen.
fn blank(cell: &ObserverCell) -> String {
    let (condition, explained) = (cell.subject.condition(), percent(cell.explained));
    if cell.explained >= ALIKE {
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
