//! Tables of an evaluation, one module for each topic: [`tables`].
//!
//! Table of all accuracies: `summary.csv`, and the rows of `summary.json`.
//!
//! Table of the agreement between models in each condition.
//!
//! Table of the similarity of images to their clean frames, and of how well it predicts right answers.
//!
//! Tables on photographs in the dark: how dark they are, and how often answers agree between two lights.

mod answers;
mod by_profile;
mod calibration;
mod comparisons;
mod enhancer_use;
mod levels;
mod observer;
mod pooled;
mod sections;
mod strict_groups;
mod thresholds;
mod variation;

use crate::text::table::ColumnKind::{Count, Number, P, Percent, Ratio, Share, Text};
use crate::text::table::{SUMMARY, Table, TableBuilder, TableCell};
use crate::text::words::{family, light, name};
use darkqa_base::types::{EnhancerName, Family, ModelListing, Variant, View};
use darkqa_score::accuracies::AccuracySummary;
use darkqa_score::auc::Auc;
use darkqa_score::comparisons::Agreement;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::photographs::{ConditionFidelity, FidelityFindings, PairDarkness};
use darkqa_score::significance::ALPHA;
use sections::REAL;

pub use answers::{commonest_answers, counted_answers, health};
pub use comparisons::{FLIPS, agreement_comparisons, write_flips};
pub use enhancer_use::{EnhancerRow, enhancer_effects, enhancers, help_for_time};
pub use levels::{LEVELS, unread_note};
pub use observer::{control_text, notes as observer_notes};
pub use pooled::baseline;
pub use sections::{ACCURACY, BASELINE, ENHANCERS, SECTIONS, Section, with_training};
pub use strict_groups::strict_groups;
pub use thresholds::{in_lux, missing_threshold_reason};

/// All tables of an evaluation; the first is the summary. A hidden observer is only in the files.
#[must_use]
pub fn tables(findings: &Findings<'_>) -> Vec<Table> {
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
        vec![summary_rows(&findings.summary, &findings.grid.listing)],
        levels::levels(findings),
        observer::observer(findings),
        vec![sections::subjects(&findings.summary)],
        thresholds::thresholds(findings),
        by_profile::by_profile(findings),
        vec![pooled::best(findings)],
        vec![levels::families(findings)],
        thresholds::fails_first(findings).into(),
        strict_groups(findings),
        pooled::pooled(findings),
        comparisons::comparisons(findings),
        variation::variation(findings),
        answers::answers(findings),
        calibration::calibration(findings),
        Vec::from_iter(fidelity(findings.fidelity.as_ref())),
        vec![darkness(&findings.pairs)],
        vec![light_agreement(&findings.light_agreements)],
        vec![agreement(&findings.agreements)],
        vec![answers::health(&findings.health)],
    ]
    .into_iter()
    .flatten()
    .collect()
}

impl<T> TableBuilder<T> {
    /// Adds columns for the model and condition of a row.
    #[must_use]
    pub fn subject(self, subject: impl Fn(&T) -> &ModelInCondition, variant: impl Fn(&Variant) -> String) -> Self {
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
    #[must_use]
    pub fn model_facts(mut self, listing: &ModelListing, subject: impl Fn(&T) -> &ModelInCondition) -> Self {
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
    #[must_use]
    pub fn family(self, row_family: impl Fn(&T) -> Option<&Family>) -> Self {
        self.column(Text, "csv family", |row| row_family(row).map_or(Family::TOTAL, Family::name).to_owned()).column(
            Text,
            "page family",
            |row| family(row_family(row)).to_owned(),
        )
    }
}

/// Builds the table, with a row for each model in a condition, family and way of parsing.
pub fn summary_rows(summary: &AccuracySummary, listing: &ModelListing) -> Table {
    let builder = TableBuilder::new(SUMMARY, &summary.cells)
        .subject(|cell| &cell.subject, |variant| variant.word().into_owned())
        .family(|cell| cell.family.as_ref())
        .column(Text, "csv mode", |cell| cell.mode.name())
        .column(Count, "csv n", |cell| cell.replies())
        .column(Count, "csv right", |cell| cell.subject.view.map(|_| cell.right))
        .column(Count, "csv unparsed", |cell| cell.unparsed)
        .column(Count, "csv failed", |cell| cell.failed)
        .column(Share, "csv value low high", |cell| cell.accuracy);
    let builder = if summary.cells.iter().any(|cell| cell.always.is_some()) {
        builder.column(Share, "csv always", |cell| cell.always)
    } else {
        builder
    };
    let builder = if summary.unbalanced.is_empty() {
        builder
    } else {
        builder.column(Number, "csv balanced", |cell| cell.balanced)
    };
    let builder = if summary.cells.iter().any(|cell| cell.bounds().is_some()) {
        builder
            .column(Number, "csv if_wrong", |cell| Some(cell.bounds()?[0]))
            .column(Number, "csv if_right", |cell| Some(cell.bounds()?[1]))
    } else {
        builder
    };
    let builder = builder
        .column(Text, "csv reading", |cell| TableCell::profile(&cell.subject))
        .model_facts(listing, |cell| &cell.subject);
    if summary.cells.iter().any(|cell| cell.subject.run_group().is_some()) {
        // Runs have different images of the same condition, so each row states its run group.
        return builder.column(Text, "csv light", |cell| cell.subject.run_group()).build();
    }
    builder.build()
}

fn agreement(agreements: &[Agreement]) -> Table {
    TableBuilder::new("agreement", agreements)
        .page("agreement", "Agreement in each condition")
        .column(Text, "csv condition | page condition", |agreement| agreement.first.condition())
        .column(Text, "csv model | page model", |agreement| agreement.first.model.clone())
        .column(Text, "csv against | page and", |agreement| agreement.second.model.clone())
        .column(Count, "csv n", |agreement| agreement.same.n)
        .column(Share, "csv same_answer same_low same_high | page same answer in % [95 %]", |agreement| agreement.same)
        .column(Ratio, "csv kappa kappa_low kappa_high | page κ [95 %]", |agreement| agreement.kappa)
        .column(Count, "page n", |agreement| agreement.same.n)
        .build()
}

/// Measures in the order of [`ConditionFidelity::means`]: name in CSV files, and in texts.
const MEASURES: [(&str, &str); 2] = [("psnr", "PSNR"), ("ssim", "SSIM")];

fn fidelity(findings: Option<&FidelityFindings>) -> Option<Table> {
    let findings = findings?;
    let caption = "Similarity of the images to their clean frames, and how well it tells right from wrong answers within a \
                   condition (0.5: not at all)";
    let mut table = TableBuilder::new("fidelity", &findings.conditions)
        .page("fidelity", caption)
        .column(Text, "csv condition", |row| condition(row))
        .column(Text, "csv level | terminal level | page level", |row| row.level.to_string())
        .column(Text, "csv variant", |row| row.variant.to_string())
        .column(Text, "csv enhancer", |row| TableCell::from(row.enhancer.as_ref().map(ToString::to_string)))
        .column(Text, "terminal light | page light", |row| light(&row.variant, row.enhancer.as_ref()))
        .column(Count, "csv images | page images", |row| row.images)
        .column(Number, "csv psnr | terminal PSNR in dB | page PSNR in dB", |row| row.means[0])
        .column(Number, "csv ssim | terminal SSIM | page SSIM", |row| row.means[1])
        .column(Count, "csv n", |row| row.replies)
        .column(Percent, "csv accuracy | terminal right in % | page right in %", |row| row.accuracy)
        .column(Count, "page n", |row| row.replies);
    for (index, (csv, name)) in MEASURES.into_iter().enumerate() {
        let heads =
            format!("csv {csv}_auc {csv}_auc_low {csv}_auc_high | terminal AUC of {name} | page AUC of {name} [95 %]");
        table = table
            .column(Ratio, &*heads, move |row| row.predicts[index].map(|prediction| prediction.auc.estimate))
            .column(P, &*format!("csv {csv}_p"), move |row| row.predicts[index].map(|prediction| prediction.auc.p))
            .column(P, &*format!("csv {csv}_p_holm | page p (Holm)"), move |row| {
                row.predicts[index].map(|prediction| prediction.holm)
            });
    }
    let mut table = table.build();
    table.is_folded = true;
    table.heading = Some("Fidelity: does a better picture mean better answers?".to_owned());
    table.notes = notes(findings);
    Some(table)
}

fn condition(row: &ConditionFidelity) -> String {
    let subject = ModelInCondition {
        model: String::new(),
        view: Some(View::Image),
        level: Some(row.level),
        variant: row.variant.clone(),
        enhancer: row.enhancer.clone(),
    };
    subject.condition()
}

/// Notes below the table: AUC within conditions, and rank correlation between conditions.
fn notes(findings: &FidelityFindings) -> Vec<String> {
    let mut notes = Vec::new();
    let is_detected = findings.p_report.is_some_and(|p| p < ALPHA);
    for (index, (_, name)) in MEASURES.into_iter().enumerate() {
        // The sentences test PSNR alone.
        notes.push(within_note(name, findings.within[index], is_detected && index == 0));
        if let Some(correlation) = findings.between[index] {
            let correlation = format!("{correlation:+.2}").replace('-', "−");
            notes.push(format!(
                "between {} conditions, the rank correlation of mean {name} and accuracy is {correlation} (a description, without a test)",
                findings.conditions.len()
            ));
        }
    }
    notes.push(SAMPLED_SSIM.to_owned());
    notes
}

/// Note on the error of [`sampled_ssim`](darkqa_score::photographs::realism::ssim::sampled_ssim), as measured.
const SAMPLED_SSIM: &str =
    "SSIM of images of 266 rows or more is from a part of their rows: at most 0.0006 from that of all rows";

/// Note on the AUC of a measure within conditions, and whether the sentences detect that it differs from chance.
fn within_note(name: &str, auc: Option<Auc>, is_detected: bool) -> String {
    let Some(Auc { estimate, .. }) = auc else {
        return format!(
            "within conditions, too few right or wrong answers or clusters to know whether {name} tells them apart"
        );
    };
    let numbers = format!("AUC {:.2} [{:.2}, {:.2}]", estimate.value, estimate.low, estimate.high);
    if is_detected && estimate.value > 0.5 {
        format!("within conditions, {name} tells right from wrong answers: {numbers}")
    } else if is_detected {
        format!("within conditions, a higher {name} goes with wrong answers: {numbers}")
    } else {
        format!("within conditions, {name}: {numbers}, 0.5 is chance")
    }
}

/// Exposure drop of the photographs relative to their frames, with a row for each named set.
fn darkness(pairs: &[PairDarkness]) -> Table {
    let mut table = TableBuilder::new("pairs", pairs)
        .page(REAL, "How much darker the photographs are than their frames")
        .column(Text, "csv name | terminal photographs | page photographs", |pair| pair.name.to_string())
        .column(Count, "csv frames | terminal frames | page frames", |pair| pair.frames)
        .column(Number, "csv ev_low_quartile", |pair| Some(pair.ev[0]))
        .column(Number, "csv ev", |pair| Some(pair.ev[1]))
        .column(Number, "csv ev_high_quartile", |pair| Some(pair.ev[2]))
        .column(Text, "terminal EV (quartiles) | page EV (quartiles)", |pair| pair.long())
        .column(Text, "csv lower_bound", |pair| pair.is_lower_bound.to_string())
        .column(Count, "csv stated", |pair| pair.stated)
        .column(Count, "csv unknown", |pair| pair.unknown)
        .column(Count, "csv not_darker", |pair| pair.brighter)
        .column(Number, "csv ev_of_pixels", |pair| pair.mean_and_median.map(|[_, median]| median))
        .column(Number, "csv ev_of_synthesis", |pair| Some(pair.synthesis))
        .build();
    table.heading = (!pairs.is_empty()).then(|| "Photographed in the dark".to_owned());
    table.notes = pairs.iter().flat_map(PairDarkness::warnings).collect();
    table
}

/// Agreement of each model with itself in two lights.
fn light_agreement(agreements: &[Agreement]) -> Table {
    let mut table = TableBuilder::new("light_agreement", agreements)
        .page(REAL, "The same answers in two lights")
        .column(Text, "csv model | terminal model | page model", |agreement| agreement.first.model.clone())
        .column(Text, "csv condition | terminal condition | page condition", |agreement| agreement.first.condition())
        .column(Text, "csv against_condition | terminal and | page and", |agreement| agreement.second.condition())
        .column(Count, "csv n | terminal n", |agreement| agreement.same.n)
        .column(
            Share,
            "csv same_answer same_low same_high | terminal same answer in % | page same answer in % [95 %]",
            |agreement| agreement.same,
        )
        .column(Ratio, "csv kappa kappa_low kappa_high | terminal κ | page κ [95 %]", |agreement| agreement.kappa)
        .column(Count, "page n", |agreement| agreement.same.n)
        .build();
    table.heading =
        (!agreements.is_empty()).then(|| "The same answers in two lights, with κ of being right".to_owned());
    table
}
