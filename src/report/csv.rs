//! The findings as tables of numbers: one CSV file a kind.

use crate::error::{Error, Result};
use crate::score::estimate::Estimate;
use crate::score::findings::Findings;
use crate::score::subject::Subject;
use crate::types::{AxisLevel, FailureKind, Family, Why};

/// All tables beside `summary.csv`, by file name; those without a row are left out.
///
/// # Errors
/// Where one cannot be written.
pub fn tables(findings: &Findings<'_>) -> Result<Vec<(&'static str, Vec<u8>)>> {
    let tables = [
        ("comparisons.csv", comparisons(findings)),
        ("thresholds.csv", thresholds(findings)),
        ("hallucination.csv", hallucination(findings)),
        ("collapse.csv", collapse(findings)),
        ("confusion.csv", confusion(findings)),
        ("flips.csv", flips(findings)),
        ("agreement.csv", agreement(findings)),
        ("health.csv", health(findings)),
    ];
    let mut written = Vec::new();
    for (name, table) in tables {
        if !table.rows.is_empty() {
            written.push((name, table_of(&table.header, table.rows.into_iter())?));
        }
    }
    Ok(written)
}

struct Table {
    header: Vec<&'static str>,
    rows: Vec<Vec<String>>,
}

/// A header and rows as CSV.
pub(super) fn table_of(
    header: &[&str],
    rows: impl Iterator<Item = Vec<String>>,
) -> Result<Vec<u8>> {
    let failed = |e: ::csv::Error| Error::data("CSV", e);
    let mut table = ::csv::Writer::from_writer(Vec::new());
    table.write_record(header).map_err(failed)?;
    for row in rows {
        table.write_record(row).map_err(failed)?;
    }
    table.into_inner().map_err(|e| Error::data("CSV", e))
}

const SUBJECT: [&str; 5] = ["model", "view", "level", "variant", "enhancer"];

fn subject(subject: &Subject) -> Vec<String> {
    let said = |text: Option<String>| text.unwrap_or_default();
    vec![
        subject.model.clone(),
        said(subject.view.map(|view| view.to_string())),
        said(subject.level.map(|level| level.to_string())),
        subject.variant.to_string(),
        said(subject.enhancer.as_ref().map(ToString::to_string)),
    ]
}

fn family(family: Option<&Family>) -> String {
    family.map_or(Family::TOTAL, Family::name).to_owned()
}

fn with(first: Vec<&'static str>, rest: &[&'static str]) -> Vec<&'static str> {
    [first, rest.to_vec()].concat()
}

/// Value, low and high; empty where there is no number.
fn numbers(estimate: Option<Estimate>) -> [String; 3] {
    estimate.map_or_else(Default::default, |e| {
        [e.value, e.low, e.high].map(|x| x.to_string())
    })
}

fn comparisons(findings: &Findings<'_>) -> Table {
    let header = [
        "kind",
        "model",
        "condition",
        "against_model",
        "against_condition",
        "family",
        "n",
        "first",
        "second",
        "difference",
        "low",
        "high",
        "only_first",
        "only_second",
        "p_mcnemar",
        "p",
        "p_holm",
        "verdict",
    ];
    let rows = findings.comparisons.iter().map(|one| {
        let paired = &one.paired;
        let [value, low, high] = numbers(Some(paired.difference));
        vec![
            one.kind.name().to_owned(),
            one.first.model.clone(),
            one.first.condition(),
            one.second.model.clone(),
            one.second.condition(),
            family(one.family.as_ref()),
            paired.difference.n.to_string(),
            paired.first.to_string(),
            paired.second.to_string(),
            value,
            low,
            high,
            paired.gained.to_string(),
            paired.lost.to_string(),
            paired.mcnemar.to_string(),
            paired.p.to_string(),
            one.holm.to_string(),
            one.verdict.word().to_owned(),
        ]
    });
    Table {
        header: header.to_vec(),
        rows: rows.collect(),
    }
}

/// Thresholds in EV, `inf` beyond the darkest level; empty where the light is not above chance.
fn thresholds(findings: &Findings<'_>) -> Table {
    let header = [
        "model",
        "variant",
        "enhancer",
        "family",
        "darkest_ev",
        "threshold_ev",
        "low",
        "high",
        "area",
        "area_low",
        "area_high",
        "n",
    ];
    let rows = findings.curves.iter().map(|curve| {
        let threshold = curve.threshold.map_or_else(Default::default, |t| {
            [t.value, t.low, t.high].map(|ev| ev.to_string())
        });
        let head = [
            curve.model.clone(),
            curve.variant.to_string(),
            curve
                .enhancer
                .as_ref()
                .map(ToString::to_string)
                .unwrap_or_default(),
            family(curve.family.as_ref()),
            curve.darkest.value().to_string(),
        ];
        let area = numbers(Some(curve.area));
        let row = head.into_iter().chain(threshold).chain(area);
        row.chain([curve.area.n.to_string()]).collect()
    });
    Table {
        header: header.to_vec(),
        rows: rows.collect(),
    }
}

fn hallucination(findings: &Findings<'_>) -> Table {
    let rest = [
        "false_positive",
        "fp_low",
        "fp_high",
        "fp_n",
        "false_negative",
        "fn_low",
        "fn_high",
        "fn_n",
    ];
    let rate = |rate: Option<Estimate>| {
        let n = rate.map_or(0, |rate| rate.n).to_string();
        numbers(rate).into_iter().chain([n])
    };
    let rows = findings.hallucinations.iter().map(|rates| {
        let row = subject(&rates.subject).into_iter();
        row.chain(rate(rates.false_positive))
            .chain(rate(rates.false_negative))
            .collect()
    });
    Table {
        header: with(SUBJECT.to_vec(), &rest),
        rows: rows.collect(),
    }
}

fn collapse(findings: &Findings<'_>) -> Table {
    let rest = [
        "family",
        "top_answer",
        "top_share",
        "true_share",
        "entropy_bits",
        "true_entropy_bits",
        "n",
    ];
    let rows = findings.confusions.iter().filter_map(|confusion| {
        let collapse = confusion.collapse()?;
        let mut row = subject(&confusion.subject);
        row.extend([
            confusion.family.name().to_owned(),
            collapse.top,
            collapse.share.to_string(),
            collapse.truth.to_string(),
            collapse.entropy.to_string(),
            collapse.true_entropy.to_string(),
            collapse.n.to_string(),
        ]);
        Some(row)
    });
    Table {
        header: with(SUBJECT.to_vec(), &rest),
        rows: rows.collect(),
    }
}

/// A row for each true answer and each answer given to it; the given one is empty where none could be read.
fn confusion(findings: &Findings<'_>) -> Table {
    let rows = findings.confusions.iter().flat_map(|confusion| {
        let labels = &confusion.labels;
        let cells = confusion
            .counts
            .iter()
            .enumerate()
            .flat_map(|(truth, row)| {
                let given = row.iter().enumerate().filter(|(_, count)| **count > 0);
                given.map(move |(given, count)| (truth, given, *count))
            });
        cells.map(|(truth, given, count)| {
            let mut row = subject(&confusion.subject);
            row.extend([
                confusion.family.name().to_owned(),
                labels[truth].clone(),
                labels.get(given).cloned().unwrap_or_default(),
                count.to_string(),
            ]);
            row
        })
    });
    Table {
        header: with(SUBJECT.to_vec(), &["family", "truth", "given", "count"]),
        rows: rows.collect(),
    }
}

/// A row an item and curve: the level at which it is first not answered rightly; empty where it never fails.
fn flips(findings: &Findings<'_>) -> Table {
    let header = [
        "question",
        "frame",
        "family",
        "repeat",
        "model",
        "variant",
        "enhancer",
        "first_failing",
    ];
    let rows = findings.falls.iter().flat_map(|fall| {
        let items = findings.grid.items.iter().zip(&fall.first);
        items.map(|(item, first)| {
            let record = item.record;
            vec![
                record.question.to_string(),
                record.detail.frame.to_string(),
                record.detail.family.to_string(),
                record.detail.repeat.to_string(),
                fall.model.clone(),
                fall.variant.to_string(),
                fall.enhancer
                    .as_ref()
                    .map(ToString::to_string)
                    .unwrap_or_default(),
                first
                    .map(|level: AxisLevel| level.to_string())
                    .unwrap_or_default(),
            ]
        })
    });
    Table {
        header: header.to_vec(),
        rows: rows.collect(),
    }
}

fn agreement(findings: &Findings<'_>) -> Table {
    let header = [
        "condition",
        "model",
        "against",
        "n",
        "same_answer",
        "same_low",
        "same_high",
        "kappa",
        "kappa_low",
        "kappa_high",
    ];
    let rows = findings.agreements.iter().map(|agreement| {
        let head = [
            agreement.first.condition(),
            agreement.first.model.clone(),
            agreement.second.model.clone(),
            agreement.same.n.to_string(),
        ];
        let same = numbers(Some(agreement.same));
        head.into_iter()
            .chain(same)
            .chain(numbers(agreement.kappa))
            .collect()
    });
    Table {
        header: header.to_vec(),
        rows: rows.collect(),
    }
}

fn health(findings: &Findings<'_>) -> Table {
    let rest = [
        "replies",
        "read",
        "lenient_only",
        "empty",
        "refused",
        "truncated",
        "filtered",
        "ambiguous",
        "out_of_range",
        "contradiction",
        "negated",
        "no_choice",
        "failed_connection",
        "failed_timeout",
        "failed_rate_limit",
        "failed_server",
        "failed_request",
        "failed_filtered",
        "failed_response",
        "failed_image",
    ];
    let rows = findings.health.iter().map(|health| {
        let mut row = subject(&health.subject);
        let counts = [health.replies, health.read, health.lenient_only].into_iter();
        let unread = Why::ALL.map(|why| health.unread.get(&why).copied().unwrap_or(0));
        let failed = FailureKind::ALL.map(|kind| health.failed.get(&kind).copied().unwrap_or(0));
        row.extend(
            counts
                .chain(unread)
                .chain(failed)
                .map(|count| count.to_string()),
        );
        row
    });
    Table {
        header: with(SUBJECT.to_vec(), &rest),
        rows: rows.collect(),
    }
}
