//! Tables of differences pooled over all models.

use std::collections::BTreeSet;

use crate::report::sentences::left_out;
use crate::report::text::table::ColumnKind::{self, Count, Number, P, Percent, Points, Text};
use crate::report::text::table::{Table, TableBuilder, TableCell};
use crate::report::text::words::{light, p};
use crate::types::EnhancerName;
use crate::types::text::counted;
use darkqa_score::answers::confusion::FalseAnswer;
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::{PooledFinding, PooledKind};
use darkqa_score::findings::Findings;
use darkqa_score::significance::{Significance, SwapMethod};

/// Three tables: all families together, by family, and both with lenient parsing (in files only).
pub(super) fn pooled(findings: &Findings<'_>) -> Vec<Table> {
    let (all_families, by_family): (Vec<&PooledFinding>, Vec<&PooledFinding>) =
        findings.pooled.iter().partition(|finding| finding.family.is_none());
    let model_counts: BTreeSet<usize> = findings.pooled.iter().map(|finding| finding.models.len()).collect();
    let models = model_counts.last().copied();
    let of_models = if model_counts.len() > 1 {
        // A column states the number of models of each row.
        "all models".to_owned()
    } else {
        counted(models.unwrap_or(0), "model")
    };
    let column = if model_counts.len() > 1 { "csv models | terminal models | page models" } else { "csv models" };
    let caption = format!("Pooled over {of_models}");
    let all: Vec<&PooledFinding> = all_families.iter().copied().chain(&findings.averaged).collect();
    let mut total = table(&caption, column, &all, ParsingMode::Strict);
    if models.is_some_and(|models| models > 1) {
        total.heading = Some(format!("Pooled over {of_models}, paired by question, in percentage points"));
    }
    total.notes = left_out(findings)
        .into_iter()
        .map(|sentence| sentence.text.trim_end_matches('.').to_owned())
        .chain(notes(&all_families, &findings.unit.to_string()))
        .collect();
    let mut by_family = table(&format!("Pooled over {of_models}, by family"), column, &by_family, ParsingMode::Strict);
    by_family.is_folded = true;
    let all: Vec<&PooledFinding> = findings.pooled.iter().chain(&findings.averaged).collect();
    let lenient = table("", column, &all, ParsingMode::Lenient).in_files_only();
    vec![total, by_family, lenient]
}

fn table(caption: &str, models: &str, findings: &[&PooledFinding], mode: ParsingMode) -> Table {
    let builder = TableBuilder::new("pooled", findings.iter().copied())
        .page("comparisons", caption)
        .column(Text, "csv kind", |finding| finding.kind.name_on(finding.variant.kind))
        .column(Text, "csv level", |finding| levels(finding))
        .column(Text, "csv variant", |finding| finding.variant.to_string())
        .column(Text, "csv enhancer", |finding| enhancers(finding))
        .column(Text, "terminal | page difference", |finding| title(finding))
        .family(|finding| finding.family.as_ref())
        .column(Count, models, |finding| finding.models.len());
    number_columns(builder, mode)
        .column(ColumnKind::Significance, "terminal | page", |finding| TableCell::verdict(finding.verdict()))
        .column(Text, "csv verdict", |finding| finding.verdict().map_or("", Significance::word))
        .column(Text, "csv shown", |finding| {
            let verdict = finding.verdict();
            verdict.is_some_and(Significance::is_shown).to_string()
        })
        .column(Text, "csv names", |finding| finding.models.join(";"))
        .column(Text, "csv mode", |_| mode.name())
        .column(P, "csv p_report", |finding| finding.parsed(mode).p_report)
        .build()
}

/// Adds the columns of numbers.
fn number_columns(builder: TableBuilder<&PooledFinding>, mode: ParsingMode) -> TableBuilder<&PooledFinding> {
    builder
        .column(Count, "csv n | page n", |finding| finding.items)
        .column(Count, "csv dropped | page dropped", |finding| finding.dropped)
        .column(Count, "csv clusters", |finding| finding.clusters)
        .column(Number, "csv first", |finding| finding.parsed(mode).first)
        .column(Number, "csv second", |finding| finding.parsed(mode).second)
        .column(Percent, "terminal first | page first", |finding| finding.parsed(mode).first)
        .column(Percent, "terminal second | page second", |finding| finding.parsed(mode).second)
        .column(
            Points,
            "csv difference low high | terminal difference, 95 % interval | page difference [95 %]",
            |finding| finding.parsed(mode).difference,
        )
        .column(P, "csv p | page p", |finding| finding.parsed(mode).p)
        .column(Text, "csv p_by", |finding| finding.parsed(mode).p_by.to_string())
        .column(P, "csv p_holm | terminal p (Holm) | page p (Holm)", |finding| finding.parsed(mode).holm)
        .column(Number, "csv p_least", |finding| finding.least_p)
}

/// Level of a finding, or range of levels of a mean, as in `L4–L5`.
fn levels(finding: &PooledFinding) -> String {
    match &*finding.mean_over {
        [first, .., last] => format!("{first}–{last}"),
        _ => finding.level.to_string(),
    }
}

/// The enhancer of a finding, or the two of which the second is subtracted, as in `lift − zerodce`.
fn enhancers(finding: &PooledFinding) -> Option<String> {
    let enhancer = finding.enhancer.as_ref()?;
    Some(match &finding.against {
        None => enhancer.to_string(),
        Some(against) => format!("{enhancer} − {against}"),
    })
}

/// Both sides of the difference, as in `L3 with noise − L0`.
fn title(finding: &PooledFinding) -> String {
    let first = light(&finding.variant, finding.enhancer.as_ref());
    let second = match finding.kind {
        PooledKind::Darkness => "L0",
        PooledKind::Hallucination(answer) => return false_answers(finding, &first, answer),
        PooledKind::Noise => "exposure drop",
        PooledKind::Enhancer => "raw",
        PooledKind::EnhancerPair => finding.against.as_ref().map_or("", EnhancerName::as_str),
        PooledKind::Blind => "without images",
    };
    format!("{} {first} − {second}", levels(finding))
}

/// Both sides of a difference in false answers, and the answers that are counted.
fn false_answers(finding: &PooledFinding, first: &str, answer: FalseAnswer) -> String {
    let to = match answer {
        FalseAnswer::No => "what is there",
        FalseAnswer::Yes => "what is not there",
    };
    format!("{} {first} − L0, “{}” to {to}", finding.level, answer.word())
}

/// Notes below the table: items left out, p-values by random swaps, and too few clusters for a verdict.
fn notes(findings: &[&PooledFinding], unit: &str) -> Vec<String> {
    let mut notes = Vec::new();
    let most = findings.iter().max_by_key(|finding| finding.dropped);
    if let Some(most) = most.filter(|finding| finding.dropped > 0) {
        notes.push(format!(
            "left out because a model has no reply: up to {} of {}",
            most.dropped,
            counted(most.items + most.dropped, "item")
        ));
    }
    notes.extend(random_swaps_note(findings));
    let least = findings.iter().map(|finding| (finding.least_holm, finding.clusters));
    notes.extend(too_few_clusters(least, unit));
    notes
}

/// Note on the methods of p-values for which not all swaps were counted.
fn random_swaps_note(findings: &[&PooledFinding]) -> Option<String> {
    let methods: BTreeSet<String> = findings
        .iter()
        .map(|finding| finding.strict.p_by)
        .filter(|method| *method != SwapMethod::Counted)
        .map(|method| method.to_string())
        .collect();
    let methods: Vec<String> = methods.into_iter().collect();
    (!methods.is_empty()).then(|| {
        let methods = methods.join(" or ");
        format!("p by {methods} where the table of all swaps would be too large (`p_by` in pooled.csv)")
    })
}

/// Note that too few clusters make a verdict impossible; `None` if every test can have one. `least` has, for each test,
/// the smallest corrected p-value that its clusters allow, and their number.
pub(super) fn too_few_clusters(least: impl Iterator<Item = (f64, usize)>, unit: &str) -> Option<String> {
    let (least, clusters) = least.filter(|(least, _)| *least >= 0.05).min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(format!(
        "no verdict if p cannot be below 0.05: with {}, p (Holm) is {} at least",
        counted(clusters, unit),
        p(least)
    ))
}
