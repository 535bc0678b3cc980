//! The table at the end of a run.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use comfy_table::presets::UTF8_HORIZONTAL_ONLY;
use comfy_table::{CellAlignment, LineStyle, Table};

use super::subject::light;
use crate::score::accuracy::{Cell, Subject, Summary};
use crate::score::choice::Mode;
use crate::types::manifest::{Counts, RunManifest, Status};
use crate::types::{EnhancerName, Level, Variant, View, Why};

/// One line of the table: a model in one variant, raw or enhanced, over the levels.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct Series<'a> {
    model: &'a str,
    enhancer: Option<&'a EnhancerName>,
    variant: Variant,
}

impl<'a> Series<'a> {
    fn of(subject: &'a Subject) -> Self {
        Self {
            model: &subject.model,
            enhancer: subject.enhancer.as_ref(),
            variant: subject.variant,
        }
    }

    fn label(&self) -> String {
        light(self.variant, self.enhancer)
    }
}

/// The lenient figure in brackets where it is not the strict one.
fn differing(strict: &str, lenient: &str) -> String {
    if strict == lenient {
        String::new()
    } else {
        format!(" ({lenient})")
    }
}

/// The strict and the lenient cell of one subject, all families together.
#[derive(Debug, Clone, Copy)]
struct Pair<'a> {
    strict: &'a Cell,
    lenient: &'a Cell,
}

impl Pair<'_> {
    fn accuracy(self) -> String {
        let percent = |share: f64| format!("{:.1}", 100.0 * share);
        match (self.strict.accuracy, self.lenient.accuracy) {
            (Some(strict), Some(lenient)) => {
                let half = percent((strict.high - strict.low) / 2.0);
                let (strict, lenient) = (percent(strict.value), percent(lenient.value));
                format!("{strict} ±{half}{}", differing(&strict, &lenient))
            }
            _ => "–".to_owned(),
        }
    }

    /// The share of questions that were answered rightly every time.
    fn always(self) -> Option<String> {
        let always = self.strict.always?;
        Some(format!("{:.1}", 100.0 * always.value))
    }

    fn replies(self) -> usize {
        self.strict.accuracy.map_or(0, |share| share.n)
    }
}

/// Renders a summary: how far each run has come where it is not complete, accuracy by level, variant and enhancer, the
/// blind and chance lines, and the runs' folders.
#[must_use]
pub fn render(summary: &Summary, runs: &[(&RunManifest, &Path)]) -> String {
    let pairs = pairs(summary);
    let of_view = |view: Option<View>| {
        pairs
            .iter()
            .copied()
            .filter(move |pair| pair.strict.subject.view == view)
    };
    let mut text = String::new();
    for (run, folder) in runs {
        if run.status == Status::Complete {
            continue;
        }
        let Counts {
            trials,
            answered,
            failed,
        } = run.counts;
        if runs.len() > 1 {
            let _ = write!(text, "{}: ", folder.display());
        }
        let _ = writeln!(
            text,
            "{}: {answered} of {trials} trials answered, {failed} failed",
            run.status
        );
    }
    text.push_str(
        "Accuracy in %: strict ± half of the 95 % interval (lenient where it differs); n replies at each level\n",
    );
    let seen: Vec<Pair<'_>> = of_view(Some(View::Image)).collect();
    if !seen.is_empty() {
        let _ = writeln!(text, "{}", levels(&seen));
    }
    for pair in of_view(Some(View::Blind)) {
        let Cell {
            unparsed,
            failed,
            subject,
            ..
        } = pair.strict;
        let (accuracy, replies) = (pair.accuracy(), pair.replies());
        let lenient = differing(&unparsed.to_string(), &pair.lenient.unparsed.to_string());
        let _ = write!(
            text,
            "{} without images: {accuracy}, n {replies}",
            subject.model
        );
        if let Some(always) = pair.always() {
            let _ = write!(text, ", right every time {always}");
        }
        let _ = writeln!(text, ", unparsed {unparsed}{lenient}, failed {failed}");
    }
    for chance in of_view(None).filter_map(|pair| pair.strict.accuracy) {
        let _ = writeln!(
            text,
            "chance: {:.2} over {} {}",
            100.0 * chance.value,
            chance.n,
            if pairs.iter().any(|pair| pair.strict.always.is_some()) {
                "orders of choices"
            } else {
                "questions"
            }
        );
    }
    let _ = write!(text, "{}", unread(summary));
    for (_, folder) in runs {
        let _ = writeln!(text, "run: {}", folder.display());
    }
    text
}

/// Why replies could not be read, where that is not the model's own way of answering.
fn unread(summary: &Summary) -> String {
    let count = |why| summary.unread.get(&why).copied().unwrap_or(0);
    let told: Vec<String> = [
        (
            count(Why::Truncated),
            "cut at the token limit (--max-tokens)",
        ),
        (count(Why::Refused), "refused"),
        (count(Why::Filtered), "withheld by a filter"),
        (count(Why::Empty), "empty"),
    ]
    .into_iter()
    .filter(|(count, _)| *count > 0)
    .map(|(count, what)| format!("{count} {what}"))
    .collect();
    if told.is_empty() {
        String::new()
    } else {
        format!("of the unparsed replies {}\n", told.join(", "))
    }
}

fn levels(seen: &[Pair<'_>]) -> Table {
    let levels: BTreeSet<Level> = seen
        .iter()
        .filter_map(|pair| pair.strict.subject.level)
        .collect();
    let series: BTreeSet<Series<'_>> = seen
        .iter()
        .map(|pair| Series::of(&pair.strict.subject))
        .collect();
    let mut table = Table::new();
    table.load_style(UTF8_HORIZONTAL_ONLY.row_separator(LineStyle::none()));
    let names = levels.iter().map(ToString::to_string);
    let head = ["model", "light"]
        .map(str::to_owned)
        .into_iter()
        .chain(names);
    table.set_header(head.chain(["n", "unparsed", "failed"].map(str::to_owned)));
    for line in &series {
        let pairs = seen
            .iter()
            .copied()
            .filter(|pair| Series::of(&pair.strict.subject) == *line);
        let pairs: Vec<Pair<'_>> = pairs.collect();
        table.add_row(row(line, &pairs, &levels));
        if pairs.iter().any(|pair| pair.strict.always.is_some()) {
            let always = levels.iter().map(|level| {
                let at = pairs
                    .iter()
                    .find(|pair| pair.strict.subject.level == Some(*level));
                at.and_then(|pair| pair.always()).unwrap_or_default()
            });
            let label = [String::new(), "  right every time".to_owned()];
            table.add_row(label.into_iter().chain(always).collect::<Vec<_>>());
        }
    }
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

fn row(line: &Series<'_>, pairs: &[Pair<'_>], levels: &BTreeSet<Level>) -> Vec<String> {
    let at = |level: &Level| {
        pairs
            .iter()
            .find(|pair| pair.strict.subject.level.as_ref() == Some(level))
    };
    let accuracies = levels
        .iter()
        .map(|level| at(level).map_or(String::new(), |pair| pair.accuracy()));
    let sum = |count: fn(&Pair<'_>) -> usize| pairs.iter().map(count).sum::<usize>();
    let replies = pairs.iter().map(|pair| pair.replies());
    let n = match (replies.clone().min(), replies.max()) {
        (Some(least), Some(most)) if least != most => format!("{least}–{most}"),
        (least, _) => least.unwrap_or(0).to_string(),
    };
    let (strict, lenient) = (
        sum(|pair| pair.strict.unparsed).to_string(),
        sum(|pair| pair.lenient.unparsed).to_string(),
    );
    let unparsed = format!("{strict}{}", differing(&strict, &lenient));
    let counts = [n, unparsed, sum(|pair| pair.strict.failed).to_string()];
    [line.model.to_owned(), line.label()]
        .into_iter()
        .chain(accuracies)
        .chain(counts)
        .collect()
}

fn pairs(summary: &Summary) -> Vec<Pair<'_>> {
    let all = |mode: Mode| {
        summary
            .cells
            .iter()
            .filter(move |cell| cell.family.is_none() && cell.mode == mode)
    };
    all(Mode::Strict)
        .filter_map(|strict| {
            Some(Pair {
                strict,
                lenient: all(Mode::Lenient).find(|cell| cell.subject == strict.subject)?,
            })
        })
        .collect()
}
