//! The table at the end of a run.

use std::collections::BTreeSet;
use std::fmt::Write;

use comfy_table::presets::UTF8_HORIZONTAL_ONLY;
use comfy_table::{CellAlignment, LineStyle, Table};

use crate::score::accuracy::{Cell, Subject, Summary};
use crate::score::choice::Mode;
use crate::types::{EnhancerName, Level, Variant, View};

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
        let variant = match self.variant {
            Variant::None => "untouched",
            Variant::Ev => "exposure drop",
            Variant::Noise => "with noise",
        };
        self.enhancer
            .map_or(variant.to_owned(), |name| format!("{variant} + {name}"))
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
        let percent = |cell: &Cell| {
            cell.accuracy.map_or("–".to_owned(), |share| {
                format!("{:.1}", 100.0 * share.value)
            })
        };
        format!("{} ({})", percent(self.strict), percent(self.lenient))
    }

    fn replies(self) -> usize {
        self.strict.accuracy.map_or(0, |share| share.n)
    }
}

/// Renders a summary: accuracy by level, variant and enhancer, the blind and chance lines below.
#[must_use]
pub fn render(summary: &Summary) -> String {
    let pairs = pairs(summary);
    let seen: Vec<Pair<'_>> = pairs
        .iter()
        .copied()
        .filter(|pair| pair.strict.subject.view == Some(View::Image))
        .collect();
    let mut text = String::from("Accuracy in %, strict (lenient) reading\n");
    if !seen.is_empty() {
        let _ = writeln!(text, "{}", levels(&seen));
    }
    for pair in pairs
        .iter()
        .filter(|pair| pair.strict.subject.view == Some(View::Blind))
    {
        let Cell {
            unparsed,
            failed,
            subject,
            ..
        } = pair.strict;
        let _ = write!(
            text,
            "{} without images: {}, n {}",
            subject.model,
            pair.accuracy(),
            pair.replies()
        );
        let _ = writeln!(
            text,
            ", unparsed {unparsed} ({}), failed {failed}",
            pair.lenient.unparsed
        );
    }
    for pair in pairs
        .iter()
        .filter(|pair| pair.strict.subject.view.is_none())
    {
        if let Some(chance) = pair.strict.accuracy {
            let _ = writeln!(
                text,
                "chance: {:.2} over {} questions",
                100.0 * chance.value,
                chance.n
            );
        }
    }
    text
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
    let head = ["model", "light"].map(str::to_owned).into_iter();
    let tail = ["n", "unparsed", "failed"].map(str::to_owned);
    table.set_header(
        head.chain(levels.iter().map(ToString::to_string))
            .chain(tail),
    );
    for line in &series {
        let of_line: Vec<Pair<'_>> = seen
            .iter()
            .copied()
            .filter(|pair| Series::of(&pair.strict.subject) == *line)
            .collect();
        let at = |level: &Level| {
            of_line
                .iter()
                .find(|pair| pair.strict.subject.level.as_ref() == Some(level))
        };
        let accuracies = levels
            .iter()
            .map(|level| at(level).map_or(String::new(), |pair| pair.accuracy()));
        let sum =
            |count: fn(&Pair<'_>) -> usize| of_line.iter().map(count).sum::<usize>().to_string();
        let unparsed = format!(
            "{} ({})",
            sum(|pair| pair.strict.unparsed),
            sum(|pair| pair.lenient.unparsed)
        );
        let counts = [
            sum(|pair| pair.replies()),
            unparsed,
            sum(|pair| pair.strict.failed),
        ];
        table.add_row(
            [line.model.to_owned(), line.label()]
                .into_iter()
                .chain(accuracies)
                .chain(counts),
        );
    }
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
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
