//! Tables of an evaluation, one module for each topic: [`tables`].

mod agreement;
mod answers;
mod baseline;
mod best;
mod by_reading;
mod calibration;
mod comparisons;
mod enhancers;
mod fails_first;
mod families;
mod fidelity;
mod flips;
mod health;
mod levels;
mod observer;
mod pairs;
mod pooled;
mod sections;
mod strict_groups;
mod subjects;
mod summary;
mod thresholds;
mod training;

use crate::report::text::table::ColumnKind::Text;
use crate::report::text::table::{Table, TableBuilder, TableCell};
use crate::report::text::words::{family, name};
use crate::types::{EnhancerName, Family, ModelListing, Variant};
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::ModelInCondition;

pub(crate) use answers::{commonest_answers, counted_answers};
pub(crate) use baseline::BASELINE;
pub(crate) use baseline::baseline;
pub(crate) use comparisons::agreement_comparisons;
pub(crate) use enhancers::EnhancerRow;
pub(crate) use enhancers::enhancers;
pub(crate) use flips::{FLIPS, write_flips};
pub(crate) use health::health;
pub(crate) use levels::unread_note;
pub(crate) use observer::{control_text, notes as observer_notes};
pub(crate) use sections::{ENHANCERS, SECTIONS, Section};
pub(crate) use strict_groups::strict_groups;
pub(crate) use summary::{reading, summary as summary_rows};
pub(crate) use thresholds::missing_threshold_reason;
pub(crate) use training::with_training;

/// All tables of an evaluation; the first is the summary. A hidden observer is only in the files.
#[must_use]
pub(crate) fn tables(findings: &Findings<'_>) -> Vec<Table> {
    let Some(shown) = &findings.without_observer else {
        return all_tables(findings);
    };
    all_tables(findings)
        .into_iter()
        .map(Table::in_files_only)
        .chain(all_tables(shown).into_iter().map(Table::without_file))
        .collect()
}

fn all_tables(findings: &Findings<'_>) -> Vec<Table> {
    [
        vec![summary::summary(&findings.summary, &findings.grid.listing)],
        levels::levels(findings),
        observer::observer(findings),
        vec![subjects::subjects(&findings.summary)],
        thresholds::thresholds(findings),
        by_reading::by_reading(findings),
        vec![best::best(findings)],
        vec![families::families(findings)],
        fails_first::fails_first(findings).into(),
        strict_groups(findings),
        pooled::pooled(findings),
        comparisons::comparisons(findings),
        answers::answers(findings),
        calibration::calibration(findings),
        Vec::from_iter(fidelity::fidelity(findings.fidelity.as_ref())),
        vec![pairs::darkness(&findings.pairs)],
        vec![pairs::light_agreement(&findings.light_agreements)],
        vec![agreement::agreement(&findings.agreements)],
        vec![health::health(&findings.health)],
    ]
    .into_iter()
    .flatten()
    .collect()
}

impl<T> TableBuilder<T> {
    /// Adds columns for the model and condition of a row.
    pub(crate) fn subject(
        self,
        subject: impl Fn(&T) -> &ModelInCondition,
        variant: impl Fn(&Variant) -> String,
    ) -> Self {
        self.column(Text, "csv model", |row| subject(row).model.clone())
            .column(Text, "csv view", |row| TableCell::from(subject(row).view.map(|view| view.to_string())))
            .column(Text, "csv level", |row| TableCell::from(subject(row).level.map(|level| level.to_string())))
            .column(Text, "csv variant", |row| variant(&subject(row).variant))
            .column(Text, "csv enhancer", |row| {
                TableCell::from(subject(row).enhancer.as_ref().map(ToString::to_string))
            })
            .column(Text, "page subject", |row| name(subject(row)))
    }

    /// Adds columns for the models' group, in files if any model has one, and for the facts that the user gave about
    /// models.
    pub(crate) fn model_facts(mut self, listing: &ModelListing, subject: impl Fn(&T) -> &ModelInCondition) -> Self {
        if listing.has_groups() {
            self = self.column(Text, "csv model_group", |row| {
                TableCell::from(listing.group(&subject(row).model).map(str::to_owned))
            });
        }
        for column in listing.columns() {
            let head = format!("csv {}", column.word());
            self = self.column(Text, &*head, |row| {
                let fact = listing.cell(*column, &subject(row).model);
                TableCell::from(Some(fact).filter(|fact| !fact.is_empty()).map(str::to_owned))
            });
        }
        self
    }

    /// Adds columns for the model, variant and enhancer of a row's curve.
    fn curve(self, curve: impl Fn(&T) -> (&str, &Variant, Option<&EnhancerName>)) -> Self {
        self.column(Text, "csv model | terminal model | page model", |row| curve(row).0.to_owned())
            .column(Text, "csv variant", |row| curve(row).1.to_string())
            .column(Text, "csv enhancer", |row| curve(row).2.map(ToString::to_string))
    }

    /// Adds columns for the family of a row; no family stands for all families together.
    pub(crate) fn family(self, row_family: impl Fn(&T) -> Option<&Family>) -> Self {
        self.column(Text, "csv family", |row| row_family(row).map_or(Family::TOTAL, Family::name).to_owned()).column(
            Text,
            "page family",
            |row| family(row_family(row)).to_owned(),
        )
    }
}
