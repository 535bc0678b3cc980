//! [`Ladder`]: the cells of a table by series and level, and the columns of that table.

use std::collections::{BTreeMap, BTreeSet};

use crate::text::table::ColumnKind::{self, Text};
use crate::text::table::{TableBuilder, TableCell, TableFormat};
use crate::text::words::{light, marked_reference};
use darkqa_base::types::degradations::{Axis, Kind};
use darkqa_base::types::{AxisLevel, EnhancerName, ModelListing, RunGroup, SetLight, Variant, View};
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::{CHANCE, ModelInCondition, is_reference};
use darkqa_score::photographs::PairDarkness;

/// A model in one variant, raw or with one enhancer.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct LadderSeries<'a> {
    /// The place of the model among those of the ladder.
    place: usize,
    pub model: &'a str,
    enhancer: Option<&'a EnhancerName>,
    variant: &'a Variant,
}

impl<'a> LadderSeries<'a> {
    fn new(subject: &'a ModelInCondition, place: usize) -> Self {
        Self { place, model: &subject.model, enhancer: subject.enhancer.as_ref(), variant: &subject.variant }
    }

    /// True if the images are enhanced.
    pub fn is_enhanced(&self) -> bool {
        self.enhancer.is_some()
    }

    /// The axis of the levels, which is light for the darkness of pairs; `None` for untouched frames.
    pub fn axis(&self) -> Option<Axis> {
        let pair = self.variant.pair.as_ref().map(|_| Axis::LIGHT);
        self.variant.kind.map(Kind::axis).or(pair)
    }

    /// The variant and the enhancer in words; for photographs also their darkness.
    pub fn light(&self, pairs: &[PairDarkness]) -> String {
        let words = light(self.variant, self.enhancer);
        let pair = pairs.iter().find(|pair| Some(&pair.name) == self.variant.photograph());
        match pair {
            None => words,
            Some(pair) => words.replacen("(real)", &format!("(real, {})", pair.short()), 1),
        }
    }
}

/// The cells of one series by level.
pub type SeriesByLevel<'a, C> = BTreeMap<AxisLevel, &'a C>;

/// The cells of all subjects.
pub struct Ladder<'a, C> {
    /// The models in the order of their first cells.
    pub models: Vec<&'a str>,
    /// The levels of all series.
    pub levels: BTreeSet<AxisLevel>,
    /// Cells of models with images.
    pub series: BTreeMap<LadderSeries<'a>, SeriesByLevel<'a, C>>,
    /// Cells without a level: models without images, and chance.
    pub without_level: Vec<(&'a ModelInCondition, &'a C)>,
    /// The darkness of the photographs in the dark.
    pub pairs: &'a [PairDarkness],
    /// The light in which the photographs of the set were taken.
    pub set: SetLight,
}

impl<'a, C> Ladder<'a, C> {
    pub fn new(cells: impl Iterator<Item = (&'a ModelInCondition, &'a C)>) -> Self {
        let mut ladder = Self {
            models: Vec::new(),
            levels: BTreeSet::new(),
            series: BTreeMap::new(),
            without_level: Vec::new(),
            pairs: &[],
            set: SetLight::Lit,
        };
        for (subject, cell) in cells {
            let place = ladder.place(&subject.model).unwrap_or_else(|| {
                ladder.models.push(&subject.model);
                ladder.models.len() - 1
            });
            match (subject.view, subject.level) {
                (Some(View::Image), Some(level)) => {
                    ladder.levels.insert(level);
                    let series = ladder.series.entry(LadderSeries::new(subject, place));
                    series.or_default().insert(level, cell);
                }
                _ => ladder.without_level.push((subject, cell)),
            }
        }
        ladder
    }

    /// Adds the darkness of the photographs, and the light of the set, which decides the label of L0.
    #[must_use]
    pub fn with_pairs(self, findings: &'a Findings<'_>) -> Self {
        Self { pairs: &findings.pairs, set: findings.set.light, ..self }
    }

    /// The variant and the enhancer of a series in words.
    pub fn light(&self, series: &LadderSeries<'_>) -> String {
        let words = series.light(self.pairs);
        match self.set {
            SetLight::Lit => words,
            SetLight::Dark => words.replacen("untouched", self.set.l0_label(), 1),
        }
    }

    /// The column head of a level.
    pub fn head(&self, level: AxisLevel) -> String {
        match level {
            AxisLevel::L0 => self.set.l0_label().to_owned(),
            level => level.to_string(),
        }
    }

    /// The place of a model among those of the ladder.
    fn place(&self, model: &str) -> Option<usize> {
        self.models.iter().position(|known| *known == model)
    }

    /// Adds the cells of the clean frames to every series of the same model without an enhancer, and those of the
    /// enhanced clean frames to every series with that enhancer. They stay a separate series only if the model has no
    /// such series.
    #[must_use]
    pub fn with_clean(mut self) -> Self {
        let (clean, mut degraded): (BTreeMap<_, _>, BTreeMap<_, _>) =
            self.series.into_iter().partition(|(series, _)| series.variant.is_untouched());
        for (series, cells) in clean {
            let mut same_model = degraded
                .iter_mut()
                .filter(|(other, _)| {
                    let groups = [other, &series].map(|series| series.variant.group.as_ref());
                    (other.model, other.enhancer) == (series.model, series.enhancer)
                        && RunGroup::overlap(groups[0], groups[1])
                })
                .peekable();
            if same_model.peek().is_some() {
                same_model.for_each(|(_, other)| other.extend(&cells));
            } else {
                degraded.insert(series, cells);
            }
        }
        self.series = degraded;
        self
    }

    /// The ladder of each axis, light first. Series and cells without an axis are in each of them.
    pub fn by_axis(&self) -> Vec<(Axis, Self)> {
        Axis::present(|axis| self.series.keys().any(|series| series.axis() == Some(axis)))
            .into_iter()
            .map(|axis| {
                let ladder = Self {
                    models: self.models.clone(),
                    levels: self.levels.iter().copied().filter(|level| level.belongs_to(axis)).collect(),
                    series: self
                        .series
                        .iter()
                        .filter(|(series, _)| series.axis().is_none_or(|own| own == axis))
                        .map(|(series, cells)| (series.clone(), cells.clone()))
                        .collect(),
                    without_level: self.without_level.clone(),
                    pairs: self.pairs,
                    set: self.set,
                };
                (axis, ladder)
            })
            .collect()
    }

    /// The cell of a series at L0, after [`with_clean`](Self::with_clean). For an enhancer without clean frames, the
    /// cell without an enhancer.
    pub fn l0_cell(&self, series: &LadderSeries<'_>) -> Option<&'a C> {
        let raw = self.series.iter().filter(|(other, _)| {
            let is_clean = other.variant.is_untouched();
            let groups = [*other, series].map(|series| series.variant.group.as_ref());
            (other.model, other.enhancer) == (series.model, None)
                && (other.variant == series.variant || is_clean && RunGroup::overlap(groups[0], groups[1]))
        });
        let mut cells = self.series.get(series).into_iter().chain(raw.map(|(_, cells)| cells));
        cells.find_map(|cells| cells.get(&AxisLevel::L0).copied())
    }

    /// The rows of a table: the series of each model, and below them the model without images; chance at the end.
    pub fn rows(&'a self) -> Vec<LadderRow<'a, C>> {
        let series = self.series.iter().map(|(series, cells)| (series.place, LadderRow::Series(series, cells)));
        let without_level = self.without_level.iter().map(|&(subject, cell)| {
            let place = subject.view.and_then(|_| self.place(&subject.model));
            let row = LadderRow::WithoutLevel(subject, cell);
            (place.unwrap_or(usize::MAX), row)
        });
        let mut rows: Vec<(usize, LadderRow<'a, C>)> = series.chain(without_level).collect();
        // The sort is stable, so the rows of a model keep their order.
        rows.sort_by_key(|(place, _)| *place);
        rows.into_iter().map(|(_, row)| row).collect()
    }

    /// A table with a row for each series and a column for each level, with the groups, marks and extra columns of the
    /// models. The page and LaTeX also have a row for each subject without a level.
    pub fn table(
        &'a self,
        name: &'static str,
        listing: &ModelListing,
        cell: impl Fn(Option<&C>) -> TableCell,
    ) -> TableBuilder<LadderRow<'a, C>> {
        let has_models_under_test = self.models.iter().any(|model| !is_reference(model) && *model != CHANCE);
        let mut table = TableBuilder::new(name, self.rows())
            .hide(TableFormat::Terminal, |line| matches!(line, LadderRow::WithoutLevel(..)))
            .group(|line| listing.group(line.model()).map(str::to_owned))
            .column(Text, "page model | terminal model", |line| listing.label(line.model()))
            .column(Text, "page light | terminal light", |line| line.light(self))
            .column(Text, "latex Model", |line| {
                let is_reference = is_reference(line.model()) && has_models_under_test;
                marked_reference(line.label(listing), is_reference)
            })
            .column(Text, "latex Light", |line| match line {
                LadderRow::Series(series, _) => TableCell::from(self.light(series)),
                LadderRow::WithoutLevel(..) => TableCell::Blank,
            });
        for (index, level) in self.levels.iter().enumerate() {
            let head = self.head(*level);
            let names = format!("page {head} | terminal {head} | latex {head}");
            table = table.column(ColumnKind::Accuracy, &*names, |line| match line {
                LadderRow::Series(_, cells) => cell(cells.get(level).copied()),
                LadderRow::WithoutLevel(_, number) if index == 0 => cell(Some(number)),
                LadderRow::WithoutLevel(..) => TableCell::Blank,
            });
        }
        if self.levels.is_empty() {
            table = table.column(ColumnKind::Accuracy, "page", |line| match line {
                LadderRow::WithoutLevel(_, number) => cell(Some(number)),
                LadderRow::Series(..) => TableCell::Blank,
            });
        }
        for column in listing.columns() {
            let head = column.head();
            let heads = format!("page {head} | terminal {head} | latex {head}");
            table = table.column(Text, &*heads, |line| listing.cell(*column, line.model()).to_owned());
        }
        table.foot(listing.footnote(self.models.iter().copied()))
    }
}

/// A row of the table of a [`Ladder`].
pub enum LadderRow<'a, C> {
    /// A series with its cells by level.
    Series(&'a LadderSeries<'a>, &'a SeriesByLevel<'a, C>),
    /// A subject without a level, and its cell.
    WithoutLevel(&'a ModelInCondition, &'a C),
}

impl<C> LadderRow<'_, C> {
    fn model(&self) -> &str {
        match self {
            Self::Series(series, _) => series.model,
            Self::WithoutLevel(subject, _) => &subject.model,
        }
    }

    fn light(&self, ladder: &Ladder<'_, C>) -> String {
        match self {
            Self::Series(series, _) => ladder.light(series),
            Self::WithoutLevel(subject, _) if subject.view.is_none() => "guessing".to_owned(),
            Self::WithoutLevel(..) => "without images".to_owned(),
        }
    }

    /// The model, with "without images" in the same cell if it saw none.
    fn label(&self, listing: &ModelListing) -> String {
        let model = listing.label(self.model());
        match self {
            Self::WithoutLevel(subject, _) if subject.view.is_some() => {
                format!("{model} without images")
            }
            _ => model,
        }
    }

    /// Sum of a count over all levels of a series; 0 for a subject without a level.
    pub fn sum(&self, count: impl Fn(&C) -> usize) -> usize {
        self.cells().map(count).sum()
    }

    /// The cells of a series; none for a subject without a level.
    pub fn cells(&self) -> impl Iterator<Item = &C> + Clone {
        let cells = match self {
            Self::Series(_, cells) => Some(*cells),
            Self::WithoutLevel(..) => None,
        };
        cells.into_iter().flat_map(|cells| cells.values().copied())
    }
}
