//! Tables of an evaluation, with one file for each topic: [`tables`].

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

use crate::text::table::ColumnKind::Text;
use crate::text::table::{Table, TableBuilder, TableCell};
use crate::text::words::{family, name};
use crate::types::{EnhancerName, Family, ModelListing, Variant};
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::ModelInCondition;

pub(crate) use answers::{commonest_answers, counted_answers};
pub(crate) use baseline::BASELINE;
pub(crate) use baseline::baseline;
pub(crate) use comparisons::comparisons_of;
pub(crate) use enhancers::EnhancerRow;
pub(crate) use enhancers::enhancers;
pub(crate) use fails_first::first_to_fail;
pub(crate) use flips::{FLIPS, write_flips};
pub(crate) use health::health;
pub(crate) use levels::unread;
pub(crate) use observer::{notes as observer_notes, what_it_is};
pub(crate) use sections::{ENHANCERS, SECTIONS, Section};
pub(crate) use strict_groups::strict_groups;
pub(crate) use summary::{reading, summary as summary_rows};
pub(crate) use thresholds::why as level_words;
pub(crate) use training::with_training;

/// All tables of an evaluation; the first is the summary. What is not shown is in the files alone.
#[must_use]
pub(crate) fn tables(findings: &Findings<'_>) -> Vec<Table> {
    let Some(shown) = &findings.without_observer else {
        return all(findings);
    };
    all(findings)
        .into_iter()
        .map(Table::in_files_only)
        .chain(all(shown).into_iter().map(Table::without_file))
        .collect()
}

fn all(findings: &Findings<'_>) -> Vec<Table> {
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
    /// Adds the columns of the subject of a row.
    pub(crate) fn subject(
        self,
        of: impl Fn(&T) -> &ModelInCondition,
        variant: impl Fn(&Variant) -> String,
    ) -> Self {
        let cell = |text: Option<String>| TableCell::from(text);
        self.column(Text, "csv model", |row| of(row).model.clone())
            .column(Text, "csv view", |row| {
                cell(of(row).view.map(|view| view.to_string()))
            })
            .column(Text, "csv level", |row| {
                cell(of(row).level.map(|level| level.to_string()))
            })
            .column(Text, "csv variant", |row| variant(&of(row).variant))
            .column(Text, "csv enhancer", |row| {
                cell(of(row).enhancer.as_ref().map(ToString::to_string))
            })
            .column(Text, "page subject", |row| name(of(row)))
    }

    /// Adds the column of the models' group in files, if any model has one, and the further columns of models.
    pub(crate) fn model_facts(
        mut self,
        listing: &ModelListing,
        of: impl Fn(&T) -> &ModelInCondition,
    ) -> Self {
        if listing.has_groups() {
            self = self.column(Text, "csv model_group", |row| {
                TableCell::from(listing.group(&of(row).model).map(str::to_owned))
            });
        }
        for column in listing.columns() {
            let head = format!("csv {}", column.word());
            self = self.column(Text, &*head, |row| {
                let fact = listing.fact(*column, &of(row).model);
                TableCell::from(
                    Some(fact)
                        .filter(|fact| !fact.is_empty())
                        .map(str::to_owned),
                )
            });
        }
        self
    }

    /// Adds the columns of the curve of a row: model, variant and enhancer.
    fn line(self, of: impl Fn(&T) -> (&str, &Variant, Option<&EnhancerName>)) -> Self {
        self.column(Text, "csv model | terminal model | page model", |row| {
            of(row).0.to_owned()
        })
        .column(Text, "csv variant", |row| of(row).1.to_string())
        .column(Text, "csv enhancer", |row| {
            of(row).2.map(ToString::to_string)
        })
    }

    /// Adds the columns of the family; `None` is all families together.
    pub(crate) fn family(self, of: impl Fn(&T) -> Option<&Family>) -> Self {
        self.column(Text, "csv family", |row| {
            of(row).map_or(Family::TOTAL, Family::name).to_owned()
        })
        .column(Text, "page family", |row| family(of(row)).to_owned())
    }
}
