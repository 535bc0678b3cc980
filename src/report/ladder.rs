//! Numbers over the levels, a line a series: [`Ladder`], and the columns of its table.

use std::collections::{BTreeMap, BTreeSet};

use super::table::ColumnKind::Text;
use super::table::{ColumnKind, TableBuilder, TableCell, TableFormat};
use super::words::light;
use crate::score::subject::Subject;
use crate::types::{AxisLevel, EnhancerName, KindReading, View};

/// A model in one variant, raw or enhanced.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Series<'a> {
    pub(super) model: &'a str,
    enhancer: Option<&'a EnhancerName>,
    variant: &'a KindReading,
}

impl<'a> Series<'a> {
    fn of(subject: &'a Subject) -> Self {
        Self {
            model: &subject.model,
            enhancer: subject.enhancer.as_ref(),
            variant: &subject.variant,
        }
    }

    /// The variant in words, with its enhancer.
    pub(super) fn light(&self) -> String {
        light(self.variant, self.enhancer)
    }
}

/// The numbers of one series by level.
pub(super) type SeriesByLevel<'a, C> = BTreeMap<AxisLevel, &'a C>;

/// The numbers of all subjects.
pub(super) struct Ladder<'a, C> {
    /// The levels of all series.
    pub(super) levels: BTreeSet<AxisLevel>,
    /// The numbers of models that see.
    pub(super) series: BTreeMap<Series<'a>, SeriesByLevel<'a, C>>,
    /// The numbers without a level: those of models without images, and of guessing.
    pub(super) floors: Vec<(&'a Subject, &'a C)>,
}

impl<'a, C> Ladder<'a, C> {
    pub(super) fn new(cells: impl Iterator<Item = (&'a Subject, &'a C)>) -> Self {
        let mut ladder = Self {
            levels: BTreeSet::new(),
            series: BTreeMap::new(),
            floors: Vec::new(),
        };
        for (subject, cell) in cells {
            match (subject.view, subject.level) {
                (Some(View::Image), Some(level)) => {
                    ladder.levels.insert(level);
                    let series = ladder.series.entry(Series::of(subject));
                    series.or_default().insert(level, cell);
                }
                _ => ladder.floors.push((subject, cell)),
            }
        }
        ladder
    }

    /// Each series begins with the lit frames of its model, which are a series of their own only if there is no other.
    pub(super) fn with_lit(mut self) -> Self {
        let is_lit = |series: &Series<'_>| series.variant.kind.is_none();
        let (lit, mut dark): (BTreeMap<_, _>, BTreeMap<_, _>) = self
            .series
            .into_iter()
            .partition(|(series, _)| is_lit(series));
        for (series, steps) in lit {
            let own = dark.iter_mut();
            let mut own = own
                .filter(|(other, _)| other.model == series.model)
                .peekable();
            if own.peek().is_some() {
                own.for_each(|(_, other)| other.extend(&steps));
            } else {
                dark.insert(series, steps);
            }
        }
        self.series = dark;
        self
    }

    /// A table with a row a series and, on the page and in LaTeX, a row a subject without a level; and a column a level.
    pub(super) fn layout(
        &'a self,
        name: &'static str,
        cell: impl Fn(Option<&C>) -> TableCell,
    ) -> TableBuilder<LadderRow<'a, C>> {
        let series = self.series.iter();
        let series = series.map(|(series, steps)| LadderRow::Series(series, steps));
        let floors = self.floors.iter();
        let floors = floors.map(|&(subject, cell)| LadderRow::Floor(subject, cell));
        let mut layout = TableBuilder::new(name, series.chain(floors))
            .hide(TableFormat::Terminal, |line| {
                matches!(line, LadderRow::Floor(..))
            })
            .column(Text, "page model | terminal model", |line| {
                line.model().to_owned()
            })
            .column(Text, "page light | terminal light", LadderRow::light)
            .column(Text, "latex Model", LadderRow::label)
            .column(Text, "latex Light", |line| match line {
                LadderRow::Series(series, _) => TableCell::from(series.light()),
                LadderRow::Floor(..) => TableCell::Blank,
            });
        for (place, level) in self.levels.iter().enumerate() {
            let names = format!("page {level} | terminal {level} | latex {level}");
            layout = layout.column(ColumnKind::Accuracy, &*names, |line| match line {
                LadderRow::Series(_, steps) => cell(steps.get(level).copied()),
                LadderRow::Floor(_, floor) if place == 0 => cell(Some(floor)),
                LadderRow::Floor(..) => TableCell::Blank,
            });
        }
        if self.levels.is_empty() {
            layout = layout.column(ColumnKind::Accuracy, "page", |line| match line {
                LadderRow::Floor(_, floor) => cell(Some(floor)),
                LadderRow::Series(..) => TableCell::Blank,
            });
        }
        layout
    }
}

/// A row of a ladder's table.
pub(super) enum LadderRow<'a, C> {
    /// A series with its numbers by level.
    Series(&'a Series<'a>, &'a SeriesByLevel<'a, C>),
    /// A subject without a level, and its number.
    Floor(&'a Subject, &'a C),
}

impl<C> LadderRow<'_, C> {
    fn model(&self) -> &str {
        match self {
            Self::Series(series, _) => series.model,
            Self::Floor(subject, _) => &subject.model,
        }
    }

    fn light(&self) -> String {
        match self {
            Self::Series(series, _) => series.light(),
            Self::Floor(subject, _) if subject.view.is_none() => "guessing".to_owned(),
            Self::Floor(..) => "without images".to_owned(),
        }
    }

    /// The model; with what it lacks in the same cell.
    pub(super) fn label(&self) -> String {
        match self {
            Self::Floor(subject, _) if subject.view.is_some() => {
                format!("{} without images", subject.model)
            }
            _ => self.model().to_owned(),
        }
    }

    /// A count over all levels of a series.
    pub(super) fn sum(&self, count: impl Fn(&C) -> usize) -> usize {
        self.steps().map(count).sum()
    }

    /// The numbers of a series.
    pub(super) fn steps(&self) -> impl Iterator<Item = &C> + Clone {
        let steps = match self {
            Self::Series(_, steps) => Some(*steps),
            Self::Floor(..) => None,
        };
        steps.into_iter().flat_map(|steps| steps.values().copied())
    }
}
