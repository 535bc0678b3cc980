//! Table of the similarity of images to their clean frames, and of how well it predicts right answers.

use crate::report::text::table::ColumnKind::{Count, Number, P, Percent, Ratio, Text};
use crate::report::text::table::{Table, TableBuilder, TableCell};
use crate::report::text::words::light;
use crate::types::View;
use darkqa_score::auc::Auc;
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::photographs::{ConditionFidelity, FidelityFindings};
use darkqa_score::significance::ALPHA;

/// Measures in the order of [`ConditionFidelity::means`]: name in CSV files, and in texts.
const MEASURES: [(&str, &str); 2] = [("psnr", "PSNR"), ("ssim", "SSIM")];

pub(super) fn fidelity(findings: Option<&FidelityFindings>) -> Option<Table> {
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
pub(crate) fn notes(findings: &FidelityFindings) -> Vec<String> {
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
    notes
}

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
