//! The tables of the page.

use serde::Serialize;

use crate::report::ladder::Ladder;
use crate::report::subject::{
    family as family_name, light, name, p, percent, points, reach, stops,
};
use crate::score::choice::Mode;
use crate::score::comparison::{Comparison, Kind};
use crate::score::curve::Curve;
use crate::score::estimate::Estimate;
use crate::score::findings::Findings;
use crate::score::subject::Subject;
use crate::types::Why;

#[derive(Serialize)]
pub(super) struct Table {
    caption: String,
    /// Whether it is shown when it is asked for.
    pub(super) folded: bool,
    head: Vec<String>,
    pub(super) rows: Vec<Vec<Cell>>,
}

#[derive(Serialize)]
pub(super) struct Cell {
    text: String,
    class: &'static str,
}

impl Cell {
    fn new(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            class: "",
        }
    }

    fn of(text: impl Into<String>, class: &'static str) -> Self {
        Self {
            text: text.into(),
            class,
        }
    }
}

fn table(caption: impl Into<String>, head: &[&str], rows: Vec<Vec<Cell>>) -> Table {
    Table {
        caption: caption.into(),
        folded: rows.len() > 60,
        head: head.iter().map(|&text| text.to_owned()).collect(),
        rows,
    }
}

fn interval(estimate: Option<Estimate>) -> String {
    estimate.map_or("–".to_owned(), |e| {
        format!(
            "{} [{}, {}]",
            percent(e.value),
            percent(e.low),
            percent(e.high)
        )
    })
}

/// Accuracy by level, a line a row; and every subject with its interval and counts.
pub(super) fn accuracy(findings: &Findings<'_>) -> Vec<Table> {
    let mut whole = every_subject(findings);
    whole.folded = true;
    vec![by_level(findings), whole]
}

fn by_level(findings: &Findings<'_>) -> Table {
    let Ladder {
        levels,
        series,
        floors,
    } = Ladder::new(&findings.summary);
    let shown = |estimate: Option<Estimate>| {
        estimate.map_or("–".to_owned(), |e| {
            format!("{} ±{}", percent(e.value), percent((e.high - e.low) / 2.0))
        })
    };
    let rows = series.iter().map(|(series, cells)| {
        let at = levels.iter().map(|level| {
            let cell = cells.get(level);
            Cell::new(cell.map_or(String::new(), |cell| shown(cell.accuracy)))
        });
        let head = [Cell::new(series.model), Cell::of(series.light(), "text")];
        head.into_iter().chain(at).collect()
    });
    let mut rows: Vec<Vec<Cell>> = rows.collect();
    rows.extend(floors.into_iter().map(|cell| {
        let (light, value) = match (cell.subject.view, cell.accuracy) {
            (None, Some(chance)) => ("guessing", format!("{:.2}", 100.0 * chance.value)),
            (_, accuracy) => ("without images", shown(accuracy)),
        };
        let head = [&*cell.subject.model, light].map(|text| Cell::of(text, "text"));
        head.into_iter().chain([Cell::new(value)]).collect()
    }));
    let mut head = vec!["model".to_owned(), "light".to_owned()];
    head.extend(levels.iter().map(ToString::to_string));
    Table {
        head,
        ..table(
            "Accuracy in % by level, with half of the 95 % interval",
            &[],
            rows,
        )
    }
}

fn every_subject(findings: &Findings<'_>) -> Table {
    let summary = &findings.summary;
    let rows = summary.of(None, Mode::Strict).map(|cell| {
        let subject = &cell.subject;
        let lenient = summary.cell(subject, None, Mode::Lenient);
        let lenient = lenient.and_then(|cell| cell.accuracy);
        let shown = match subject.view {
            None => "guessing".to_owned(),
            Some(_) => subject.condition(),
        };
        let exact = |estimate: Estimate| format!("{:.2}", 100.0 * estimate.value);
        vec![
            Cell::new(&subject.model),
            Cell::of(shown, "text"),
            Cell::new(match subject.view {
                None => cell.accuracy.map_or("–".to_owned(), exact),
                Some(_) => interval(cell.accuracy),
            }),
            Cell::new(lenient.map_or("–".to_owned(), |e| percent(e.value))),
            Cell::new(cell.accuracy.map_or(0, |e| e.n).to_string()),
            Cell::new(cell.unparsed.to_string()),
            Cell::new(cell.failed.to_string()),
        ]
    });
    let head = [
        "model",
        "condition",
        "accuracy in % [95 %]",
        "lenient",
        "n",
        "not readable",
        "failed",
    ];
    table(
        "Accuracy of every subject, all families together",
        &head,
        rows.collect(),
    )
}

/// Thresholds and areas: all families together, and each.
pub(super) fn thresholds(findings: &Findings<'_>) -> Vec<Table> {
    let (whole, parts): (Vec<&Curve>, Vec<&Curve>) = findings
        .curves
        .iter()
        .partition(|curve| curve.family.is_none());
    let mut parts = curves("Thresholds and areas by family", &parts);
    parts.folded = true;
    vec![curves("Thresholds and areas", &whole), parts]
}

fn curves(caption: &str, curves: &[&Curve]) -> Table {
    let rows = curves.iter().map(|curve| {
        let darkest = curve.darkest.value();
        let threshold = curve
            .threshold
            .map_or("not above chance at L0".to_owned(), |t| {
                let reach = reach(t.low, t.high, darkest);
                format!("{} [{reach}]", stops(t.value, darkest))
            });
        vec![
            Cell::new(&curve.model),
            Cell::of(light(&curve.variant, curve.enhancer.as_ref()), "text"),
            Cell::of(family_name(curve.family.as_ref()), "text"),
            Cell::new(threshold),
            Cell::new(interval(Some(curve.area))),
            Cell::new(format!("0–{darkest}")),
        ]
    });
    let head = [
        "model",
        "light",
        "family",
        "threshold in EV [95 %]",
        "area in % [95 %]",
        "EV",
    ];
    table(caption, &head, rows.collect())
}

pub(super) fn families(findings: &Findings<'_>) -> Table {
    let all = findings.grid.groups();
    let row = |model: &str, condition: String, subject: Option<&Subject>| {
        let cells = all.iter().map(|family| {
            let mut cells = findings.summary.of(*family, Mode::Strict);
            let cell = cells.find(|cell| match subject {
                Some(subject) => cell.subject == *subject,
                None => cell.subject.view.is_none(),
            });
            let text = cell
                .and_then(|cell| cell.accuracy)
                .map(|e| percent(e.value));
            let below = subject.is_some_and(|subject| findings.below_blind(subject, *family));
            let class = if below { "below" } else { "" };
            Cell::of(text.unwrap_or("–".to_owned()), class)
        });
        let name = [Cell::new(model), Cell::of(condition, "text")];
        name.into_iter().chain(cells).collect()
    };
    let subjects = findings.grid.subjects.iter();
    let mut rows: Vec<Vec<Cell>> = subjects
        .map(|subject| row(&subject.model, subject.condition(), Some(subject)))
        .collect();
    rows.push(row("chance", String::new(), None));
    let mut head = vec!["model", "condition"];
    head.extend(all.iter().map(|family| family_name(*family)));
    table("Accuracy in % by family", &head, rows)
}

/// The comparisons of some kinds: all families together, and by family.
pub(super) fn compared(findings: &Findings<'_>, kinds: &[Kind]) -> Vec<Table> {
    let mut tables = Vec::new();
    for kind in kinds {
        let caption = match kind {
            Kind::Level => "Each dark level less L0, raw",
            Kind::Variant => "Sensor noise less exposure drop alone",
            Kind::Enhancer => "Enhanced less raw",
            Kind::Model => "Model less model",
            Kind::Blind => "With images less without",
        };
        let head = [
            "first",
            "second",
            "family",
            "difference [95 %]",
            "only first",
            "only second",
            "n",
            "p (McNemar)",
            "p",
            "p (Holm)",
            "",
        ];
        let all = findings.comparisons.iter().filter(|one| one.kind == *kind);
        let (whole, parts): (Vec<&Comparison>, Vec<&Comparison>) =
            all.partition(|one| one.family.is_none());
        let rows = |list: Vec<&Comparison>| list.into_iter().map(comparison).collect();
        let mut whole = table(caption, &head, rows(whole));
        whole.folded |= *kind != Kind::Enhancer;
        let mut parts = table(format!("{caption}, by family"), &head, rows(parts));
        parts.folded = true;
        tables.extend([whole, parts]);
    }
    tables
}

fn comparison(one: &Comparison) -> Vec<Cell> {
    let (paired, difference) = (&one.paired, one.paired.difference);
    let [value, low, high] = [difference.value, difference.low, difference.high].map(points);
    vec![
        Cell::new(name(&one.first)),
        Cell::of(name(&one.second), "text"),
        Cell::of(family_name(one.family.as_ref()), "text"),
        Cell::new(format!("{value} [{low}, {high}]")),
        Cell::new(paired.gained.to_string()),
        Cell::new(paired.lost.to_string()),
        Cell::new(difference.n.to_string()),
        Cell::new(p(paired.mcnemar)),
        Cell::new(p(paired.p)),
        Cell::new(p(one.holm)),
        Cell::of(one.verdict.word(), one.verdict.word()),
    ]
}

pub(super) fn collapse(findings: &Findings<'_>) -> Table {
    let rows = findings.confusions.iter().filter_map(|confusion| {
        let collapse = confusion.collapse()?;
        let bits = |bits: f64| format!("{bits:.2}");
        Some(vec![
            Cell::new(name(&confusion.subject)),
            Cell::of(family_name(Some(&confusion.family)), "text"),
            Cell::of(collapse.top, "text"),
            Cell::new(percent(collapse.share)),
            Cell::new(percent(collapse.truth)),
            Cell::new(bits(collapse.entropy)),
            Cell::new(bits(collapse.true_entropy)),
            Cell::new(collapse.n.to_string()),
        ])
    });
    let head = [
        "subject",
        "family",
        "given most often",
        "given in %",
        "true in %",
        "entropy in bits",
        "of the truth",
        "n",
    ];
    table(
        "The answer given most often, and how often it is true",
        &head,
        rows.collect(),
    )
}

pub(super) fn agreement(findings: &Findings<'_>) -> Table {
    let rows = findings.agreements.iter().map(|agreement| {
        let kappa = agreement.kappa.map_or("–".to_owned(), |k| {
            format!("{:.2} [{:.2}, {:.2}]", k.value, k.low, k.high)
        });
        vec![
            Cell::new(agreement.first.condition()),
            Cell::of(&*agreement.first.model, "text"),
            Cell::of(&*agreement.second.model, "text"),
            Cell::new(interval(Some(agreement.same))),
            Cell::new(kappa),
            Cell::new(agreement.same.n.to_string()),
        ]
    });
    let head = [
        "condition",
        "model",
        "and",
        "same answer in % [95 %]",
        "κ [95 %]",
        "n",
    ];
    table("Agreement in each condition", &head, rows.collect())
}

pub(super) fn health(findings: &Findings<'_>) -> Table {
    let rows = findings.health.iter().map(|health| {
        let share = |count: usize| {
            let of = health.replies.max(1) as f64;
            format!("{count} ({} %)", percent(count as f64 / of))
        };
        let told = health.unread_for(&[Why::Refused, Why::Filtered, Why::Truncated, Why::Empty]);
        // A foreign record may give a reason beside a choice.
        let form = (health.replies - health.read).saturating_sub(told);
        vec![
            Cell::new(name(&health.subject)),
            Cell::new(health.replies.to_string()),
            Cell::new(share(health.read)),
            Cell::new(share(health.lenient_only)),
            Cell::new(form.to_string()),
            Cell::new(
                health
                    .unread_for(&[Why::Refused, Why::Filtered])
                    .to_string(),
            ),
            Cell::new(health.unread_for(&[Why::Truncated]).to_string()),
            Cell::new(health.unread_for(&[Why::Empty]).to_string()),
            Cell::of(
                health.failures().to_string(),
                if health.failures() > 0 { "worse" } else { "" },
            ),
        ]
    });
    let head = [
        "subject",
        "replies",
        "read",
        "lenient alone",
        "other form",
        "refused or filtered",
        "truncated",
        "empty",
        "failed",
    ];
    table("Replies and failures by subject", &head, rows.collect())
}
