//! The table at the end of a run.

use std::fmt::Write;
use std::path::Path;

use comfy_table::presets::UTF8_HORIZONTAL_ONLY;
use comfy_table::{CellAlignment, LineStyle, Table};

use super::ladder::{Ladder, Series};
use super::subject::percent;
use crate::score::accuracy::{Cell, Summary};
use crate::score::choice::Mode;
use crate::types::manifest::{Counts, RunManifest, Status};
use crate::types::{AxisLevel, Why};

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

impl<'a> Pair<'a> {
    fn of(summary: &'a Summary, strict: &'a Cell) -> Option<Self> {
        let lenient = summary.cell(&strict.subject, strict.family.as_ref(), Mode::Lenient)?;
        Some(Self { strict, lenient })
    }

    fn accuracy(self) -> String {
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
        Some(percent(self.strict.always?.value))
    }

    fn replies(self) -> usize {
        self.strict.accuracy.map_or(0, |share| share.n)
    }
}

/// Renders a summary: how far each run has come where it is not complete, accuracy by level, variant and enhancer, the
/// blind and chance lines, and the runs' folders.
#[must_use]
pub fn render(summary: &Summary, runs: &[(&RunManifest, &Path)]) -> String {
    let ladder = Ladder::new(summary);
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
    if !ladder.series.is_empty() {
        let _ = writeln!(text, "{}", levels(summary, &ladder));
    }
    let floors = ladder.floors.iter();
    let (chance, blind): (Vec<&Cell>, Vec<&Cell>) =
        floors.partition(|cell| cell.subject.view.is_none());
    let blind = blind.into_iter();
    for pair in blind.filter_map(|strict| Pair::of(summary, strict)) {
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
    let mut all = summary.of(None, Mode::Strict);
    let repeated = all.any(|cell| cell.always.is_some());
    for chance in chance.into_iter().filter_map(|cell| cell.accuracy) {
        let _ = writeln!(
            text,
            "chance: {:.2} over {} {}",
            100.0 * chance.value,
            chance.n,
            if repeated {
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

/// An empty table in the style of all of them.
pub(super) fn plain() -> Table {
    let mut table = Table::new();
    table.load_style(UTF8_HORIZONTAL_ONLY.row_separator(LineStyle::none()));
    table
}

fn levels(summary: &Summary, ladder: &Ladder<'_>) -> Table {
    let names = ladder.levels.iter().map(ToString::to_string);
    let head = ["model", "light"]
        .map(str::to_owned)
        .into_iter()
        .chain(names)
        .chain(["n", "unparsed", "failed"].map(str::to_owned));
    let mut table = plain();
    table.set_header(head);
    for (series, cells) in &ladder.series {
        let pair = |level: &AxisLevel| Pair::of(summary, cells.get(level).copied()?);
        let pairs: Vec<Option<Pair<'_>>> = ladder.levels.iter().map(pair).collect();
        table.add_row(row(series, &pairs));
        if cells.values().any(|cell| cell.always.is_some()) {
            let always = pairs
                .iter()
                .map(|pair| pair.and_then(Pair::always).unwrap_or_default());
            let label = [String::new(), "  right every time".to_owned()];
            table.add_row(label.into_iter().chain(always));
        }
    }
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

fn row(series: &Series<'_>, pairs: &[Option<Pair<'_>>]) -> Vec<String> {
    let accuracies = pairs
        .iter()
        .map(|pair| pair.map_or(String::new(), Pair::accuracy));
    let pairs: Vec<&Pair<'_>> = pairs.iter().flatten().collect();
    let sum = |count: fn(&Pair<'_>) -> usize| pairs.iter().map(|pair| count(pair)).sum::<usize>();
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
    [series.model.to_owned(), series.light()]
        .into_iter()
        .chain(accuracies)
        .chain(counts)
        .collect()
}
