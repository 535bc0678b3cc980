//! Tables of differences pooled over all models.
//!
//! Table of pairwise differences between models in mean accuracy in the dark, with tests.
//!
//! Table of new runs compared with an old run, with a row for each model and condition.

use std::collections::BTreeSet;

use super::sections::{BASELINE, COMPARISONS};
use crate::sentences::{dark_levels, left_out};
use crate::text::latex::escape;
use crate::text::table::ColumnKind::{self, Count, Number, P, Percent, Points, Text};
use crate::text::table::{Table, TableBuilder, TableCell};
use crate::text::words::{light, p, points};
use darkqa_base::types::EnhancerName;
use darkqa_base::types::text::counted;
use darkqa_score::answers::confusion::FalseAnswer;
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::{
    BaselineRow, BaselineSide, BestInTheDark, DarkAccuracy, DarkPair, MIN_PAIRS, PooledFinding, PooledKind,
};
use darkqa_score::findings::Findings;
use darkqa_score::significance::{SwapMethod, Verdict};

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
        .page(COMPARISONS, caption)
        .column(Text, "csv kind", |finding| finding.kind.name_on(finding.variant.kind))
        .column(Text, "csv level", |finding| levels(finding))
        .column(Text, "csv variant", |finding| finding.variant.to_string())
        .column(Text, "csv enhancer", |finding| enhancers(finding))
        .column(Text, "terminal | page difference", |finding| title(finding))
        .family(|finding| finding.family.as_ref())
        .column(Count, models, |finding| finding.models.len());
    number_columns(builder, mode)
        .column(ColumnKind::Verdict, "terminal | page", |finding| TableCell::verdict(finding.verdict()))
        .column(Text, "csv verdict", |finding| finding.verdict().map_or("", Verdict::word))
        .column(Text, "csv shown", |finding| {
            let verdict = finding.verdict();
            verdict.is_some_and(Verdict::is_shown).to_string()
        })
        .column(Text, "csv names", |finding| finding.models.join(";"))
        .column(Text, "csv mode", |_| mode.name())
        .column(P, "csv p_report", |finding| finding.parsed(mode).tested.p_report)
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
            |finding| finding.parsed(mode).tested.difference,
        )
        .column(P, "csv p | page p", |finding| finding.parsed(mode).tested.p)
        .column(Text, "csv p_by", |finding| finding.parsed(mode).tested.p_by.map(|method| method.to_string()))
        .column(P, "csv p_holm | terminal p (Holm) | page p (Holm)", |finding| finding.parsed(mode).tested.holm)
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
        .filter_map(|finding| finding.strict.tested.p_by)
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

/// Two models with the comparison that they belong to.
struct PooledPair<'b> {
    best: &'b BestInTheDark,
    pair: &'b DarkPair,
}

impl<'b> PooledPair<'b> {
    /// Accuracy of the first model over the dark levels.
    fn first(&self) -> Option<&'b DarkAccuracy> {
        self.accuracy(&self.pair.first)
    }

    /// Accuracy of the second model over the dark levels.
    fn second(&self) -> Option<&'b DarkAccuracy> {
        self.accuracy(&self.pair.second)
    }

    fn accuracy(&self, model: &str) -> Option<&'b DarkAccuracy> {
        self.best.models.iter().find(|row| row.model == model)
    }
}

/// Difference of a model from its accuracy at L0; `None` if that is not above chance.
fn loss(accuracy: Option<&DarkAccuracy>) -> Option<String> {
    Some(points(accuracy?.loss?.value))
}

/// Builds the table; it has no rows if there are fewer than two models.
pub(super) fn best(findings: &Findings<'_>) -> Table {
    let is_detected = findings.detected_best().is_some();
    let pairs = findings.best.iter().flat_map(|best| best.pairs.iter().map(move |pair| PooledPair { best, pair }));
    let variant = findings.best.as_ref().map(|best| light(&best.variant, None));
    let levels = findings.best.as_ref().map(dark_levels);
    let caption = format!(
        "Mean accuracy over the dark levels ({}), {}: model less model, on shared items",
        levels.unwrap_or_default(),
        variant.unwrap_or_default()
    );
    let mut table = TableBuilder::new("best", pairs)
        .page("thresholds", &caption)
        .column(Text, "csv model | page model", |row| row.pair.first.clone())
        .column(Text, "csv against_model | page against", |row| row.pair.second.clone())
        .column(Text, "csv variant", |row| row.best.variant.to_string())
        .column(Number, "csv first", |row| row.first().map(|model| model.mean.value))
        .column(Number, "csv second", |row| row.second().map(|model| model.mean.value))
        .column(Percent, "page first", |row| row.first().map(|model| model.mean.value))
        .column(Percent, "page second", |row| row.second().map(|model| model.mean.value))
        .column(Text, "page first less L0", |row| loss(row.first()))
        .column(Text, "page second less L0", |row| loss(row.second()))
        .column(Points, "csv difference low high n | page difference [95 %]", |row| row.pair.tested.difference)
        .column(P, "csv p | page p", |row| row.pair.tested.p)
        .column(Text, "csv p_by", |row| row.pair.tested.p_by.map(|method| method.to_string()))
        .column(P, "csv p_holm | page p (Holm)", |row| row.pair.tested.holm)
        .column(ColumnKind::Verdict, "page", |row| TableCell::verdict(row.best.verdict(row.pair, is_detected)))
        .column(Text, "csv verdict", |row| {
            let verdict = row.best.verdict(row.pair, is_detected);
            verdict.map_or("", |verdict| verdict.word())
        })
        .column(Text, "csv shown", |row| {
            let verdict = row.best.verdict(row.pair, is_detected);
            verdict.is_some_and(darkqa_score::significance::Verdict::is_shown).to_string()
        })
        .column(Text, "csv levels", |row| row.best.levels.iter().map(ToString::to_string).collect::<Vec<_>>().join(";"))
        .build();
    table.is_folded = true;
    table
}

/// Builds the table of paired differences; `old` is the name of the baseline run.
#[must_use]
pub fn baseline(rows: &[BaselineRow], old: &str) -> Table {
    let difference = "csv difference low high | terminal new less old, 95 % interval | page new less old [95 %] \
                      | latex Difference [95\\,\\%]";
    let builder = TableBuilder::new(BASELINE, rows)
        .page(BASELINE, &format!("New less {old}"))
        .column(Text, "csv model | terminal model | page model | latex Model", |row| row.subject.model.clone())
        .column(Text, "csv condition | terminal condition | page condition | latex Condition", |row| {
            row.subject.condition()
        })
        .column(Count, "csv n | terminal n | page n | latex $n$", |row| row.paired.tested.difference.n)
        .column(Count, "csv other_images", |row| row.other_images)
        .column(Percent, "csv old | page old in %", |row| row.paired.second)
        .column(Percent, "csv new | page new in %", |row| row.paired.first)
        .column(Points, difference, |row| row.paired.tested.difference)
        .column(Count, "csv only_new | terminal only new | page only new | latex Only new", |row| row.paired.gained)
        .column(Count, "csv only_old | terminal only old | page only old | latex Only old", |row| row.paired.lost)
        .column(P, "csv p", |row| row.paired.tested.p)
        .column(P, "csv p_holm | terminal p (Holm) | page p (Holm) | latex $p$ (Holm)", |row| row.paired.tested.holm);
    let mut table = reply_columns(builder)
        .column(ColumnKind::Verdict, "csv verdict | terminal | page | latex", |row| row.paired.tested.verdict)
        .build();
    table.heading = Some(format!("New less {old}, paired by question and image"));
    table.latex = Some(format!("New less {}, paired by question, in percentage points.", escape(old)));
    let too_few = rows.iter().filter(|row| row.paired.tested.verdict == Verdict::TooFew).count();
    if too_few > 0 {
        let line = format!("too few: fewer than {MIN_PAIRS} items are shared, so no verdict is given");
        table.notes.push(line);
    }
    if rows.is_empty() {
        table.notes.push(format!("no model answered the same item about the same image in {old}"));
    }
    table
}

/// An old and a new count, as in `3 → 5`.
fn old_and_new(row: &BaselineRow, count: fn(&BaselineSide) -> usize) -> String {
    let [new, old] = row.sides.each_ref().map(count);
    format!("{old} → {new}")
}

/// Adds columns of unreadable replies, failures and costs in the old and the new run.
fn reply_columns(builder: TableBuilder<&BaselineRow>) -> TableBuilder<&BaselineRow> {
    builder
        .column(Count, "csv unread_old", |row| row.sides[1].unread)
        .column(Count, "csv unread_new", |row| row.sides[0].unread)
        .column(Count, "csv failed_old", |row| row.sides[1].failed)
        .column(Count, "csv failed_new", |row| row.sides[0].failed)
        .column(Number, "csv cost_old", |row| row.sides[1].cost)
        .column(Number, "csv cost_new", |row| row.sides[0].cost)
        .column(Count, "terminal unread | page unread", |row| old_and_new(row, |side| side.unread))
        .column(Count, "terminal failed | page failed", |row| old_and_new(row, |side| side.failed))
        .column(Number, "terminal cost in $ | page cost in $", |row| {
            let [new, old] = row.sides.map(|side| side.cost);
            match new.zip(old) {
                Some((new, old)) => TableCell::Text(format!("{old:.2} → {new:.2}")),
                None => TableCell::Missing,
            }
        })
}
