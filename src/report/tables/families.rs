//! Table of accuracy by family, with a row for each model in a condition. An accuracy is marked if it is detected to be
//! below that of a model without images.

use crate::report::text::latex::escape;
use crate::report::text::table::ColumnKind::{Percent, Text};
use crate::report::text::table::{ColumnHeads, Table, TableBuilder, TableCell};
use crate::report::text::words::{family as family_name, marked_reference};
use crate::types::Family;
use darkqa_score::choice::ParsingMode;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::ModelInCondition;

pub(super) fn families(findings: &Findings<'_>) -> Table {
    let subjects = findings.grid.subjects.iter().map(Some);
    let has_models_under_test = subjects.clone().flatten().any(|subject| !subject.is_reference());
    // The last row is chance.
    let mut builder = TableBuilder::new("families", subjects.chain([None]))
        .page("families", "Accuracy in % by family")
        .column(Text, "page model", |subject| model(*subject))
        .column(Text, "latex Model", |subject| {
            let is_reference = subject.is_some_and(ModelInCondition::is_reference);
            marked_reference(model(*subject), is_reference && has_models_under_test)
        })
        .column(Text, "page condition | latex Condition", |subject| {
            subject.map_or(String::new(), ModelInCondition::condition)
        });
    for family in findings.grid.groups() {
        let name = family_name(family);
        let names =
            ColumnHeads { page: Some(name.to_owned()), latex: family.map(|_| escape(name)), ..ColumnHeads::default() };
        builder = builder.column(Percent, names, |subject| accuracy_cell(findings, *subject, family));
    }
    let mut table = builder.build();
    table.latex = Some(
        "Accuracy in \\% by family, with 95\\,\\% intervals. $\\downarrow$: detected to be below a model without images (its own, if it was asked so)."
            .to_owned(),
    );
    table
}

/// Name of the model of a row.
fn model(subject: Option<&ModelInCondition>) -> String {
    subject.map_or("chance", |subject| &subject.model).to_owned()
}

/// Accuracy of a subject on a family. No subject stands for chance, no family for all families.
fn accuracy_cell(findings: &Findings<'_>, subject: Option<&ModelInCondition>, family: Option<&Family>) -> TableCell {
    let cell = findings.summary.family_cells(family, ParsingMode::Strict).find(|cell| match subject {
        Some(subject) => cell.subject == *subject,
        None => cell.subject.view.is_none(),
    });
    let below = subject.is_some_and(|subject| !findings.below_blind(subject, family).is_empty());
    match cell.and_then(|cell| cell.accuracy) {
        None => TableCell::Missing,
        Some(chance) if subject.is_none() => TableCell::Number(chance.value),
        Some(share) if below => TableCell::Below(share),
        Some(share) => TableCell::Estimate(share),
    }
}
