//! The tables of a paper: models in rows, levels or families in columns: [`paper_tables`].

use std::collections::BTreeMap;

use super::{Names, Overview};
use crate::text::table::{Column, ColumnHeads, ColumnKind, Table, TableCell, TableRow};
use crate::text::words::family as family_name;
use crate::types::degradations::{Axis, Kind};
use crate::types::{AxisLevel, EnhancerName, Family, Variant, View};
use darkqa_score::choice::ReadingMode;
use darkqa_score::comparisons::PooledKind;
use darkqa_score::estimate::Estimate;
use darkqa_score::findings::Findings;
use darkqa_score::model_in_condition::ModelInCondition;

/// The words about marks in captions.
const BELOW: &str = "↓: shown to be below the answers without images.";

/// The tables for which there are records: accuracy by level, accuracy by family at L0 and at the darkest level, and each enhancer.
pub(crate) fn paper_tables(findings: &Findings<'_>, names: &Names) -> Vec<Table> {
    let overview = Overview::new(findings, names);
    let variants = overview.tested_variants();
    let mut tables: Vec<Table> = variants
        .iter()
        .map(|variant| overview.by_level(variant))
        .collect();
    tables.extend(overview.main_variant().map(|of| overview.by_family(&of)));
    for variant in &variants {
        for enhancer in &overview.enhancers {
            tables.extend(overview.by_enhancer(variant, enhancer));
        }
    }
    tables.retain(|table| !table.rows.is_empty());
    tables
}

/// A table with the names of its columns after the first one, which holds the names of its rows.
fn table(caption: String, heads: impl IntoIterator<Item = String>, rows: Vec<TableRow>) -> Table {
    let names = Column {
        kind: ColumnKind::Text,
        heads: ColumnHeads::default(),
    };
    let numbers = heads.into_iter().map(|head| Column {
        kind: ColumnKind::Accuracy,
        heads: ColumnHeads {
            page: Some(head),
            ..ColumnHeads::default()
        },
    });
    Table {
        name: "paper",
        caption,
        columns: std::iter::once(names).chain(numbers).collect(),
        rows,
        ..Table::default()
    }
}

/// A row with its name, below a heading.
fn row(
    name: String,
    group: Option<&str>,
    numbers: impl IntoIterator<Item = TableCell>,
) -> TableRow {
    TableRow {
        cells: std::iter::once(name.into()).chain(numbers).collect(),
        group: group.map(str::to_owned),
        ..TableRow::default()
    }
}

/// An accuracy, marked if it is below that without images.
fn accuracy(of: Estimate, is_below: bool) -> TableCell {
    if is_below {
        TableCell::Below(of)
    } else {
        TableCell::Estimate(of)
    }
}

impl Overview<'_> {
    /// The basis of all numbers of a table.
    fn basis(&self) -> String {
        let (grid, unit) = (&self.findings.grid, self.findings.unit);
        format!(
            "Strict parsing; below each number its 95 % interval by {unit}; {} items in {} {unit}s.",
            grid.items.len(),
            grid.clusters
        )
    }

    fn by_level(&self, variant: &Variant) -> Table {
        let axis = variant.kind.map_or(Axis::LIGHT, Kind::axis);
        let rows: Vec<(&str, BTreeMap<AxisLevel, TableCell>)> = self
            .models
            .iter()
            .map(|model| {
                let mut below = Vec::new();
                let points = self.points(model, variant, None, |subject| {
                    if !self.findings.below_blind(subject, None).is_empty() {
                        below.extend(subject.level);
                    }
                    self.accuracy_of(subject, None)
                });
                let cells = points
                    .into_iter()
                    .map(|(level, of)| (level, accuracy(of, below.contains(&level))));
                (*model, cells.collect())
            })
            .collect();
        let levels: Vec<AxisLevel> = self
            .levels
            .iter()
            .copied()
            .filter(|level| level.is_shown_on(axis))
            .filter(|level| rows.iter().any(|(_, cells)| cells.contains_key(level)))
            .collect();
        let rows = rows
            .into_iter()
            .map(|(model, mut cells)| {
                let numbers = levels
                    .iter()
                    .map(|level| cells.remove(level).unwrap_or(TableCell::Blank));
                TableRow {
                    is_best: self.is_best(model, variant),
                    ..row(self.names.shown(model), None, numbers)
                }
            })
            .chain(self.without_images(levels.len()))
            .collect();
        let values: Vec<String> = levels
            .iter()
            .map(|of| format!("{of} {}", of.value()))
            .collect();
        let caption = format!(
            "Accuracy in % by level, {} ({} in {}: {}). {} {BELOW} Bold: shown to be better than every other model over the levels.",
            self.light(variant, None),
            axis.title,
            axis.unit,
            values.join(", "),
            self.basis()
        );
        table(caption, levels.iter().map(ToString::to_string), rows)
    }

    /// Models without images, and chance, in the first of `columns` cells.
    fn without_images(&self, columns: usize) -> impl Iterator<Item = TableRow> {
        let cells = self
            .findings
            .summary
            .family_cells(None, ReadingMode::Strict);
        cells
            .filter(|cell| cell.subject.view != Some(View::Image))
            .filter_map(move |cell| {
                let of = cell.accuracy?;
                let first = match cell.subject.view {
                    // The expected share of guesses is known without an interval.
                    None => TableCell::Guess(of),
                    Some(_) => TableCell::Estimate(of),
                };
                let mut numbers = vec![TableCell::Blank; columns];
                *numbers.first_mut()? = first;
                let name = self.names.shown(&cell.subject.model);
                Some(row(name, Some("without images"), numbers))
            })
    }

    fn is_best(&self, model: &str, variant: &Variant) -> bool {
        self.findings.best.as_ref().is_some_and(|best| {
            best.variant == *variant
                && best.models.len() > 1
                && best.not_shown_better_than.is_empty()
                && best.leader().model == model
        })
    }

    fn by_family(&self, variant: &Variant) -> Table {
        let families = self.findings.grid.families();
        let darkest = self
            .models
            .iter()
            .flat_map(|model| {
                let points = self.points(model, variant, None, |subject| {
                    self.accuracy_of(subject, None)
                });
                points.into_iter().map(|(level, _)| level)
            })
            .max()
            .unwrap_or(AxisLevel::L0);
        let rows = [AxisLevel::L0, darkest]
            .into_iter()
            .flat_map(|level| self.models.iter().map(move |model| (level, *model)))
            .map(|(level, model)| {
                let numbers = families
                    .iter()
                    .map(|family| self.at(model, level, variant, family));
                row(self.names.shown(model), Some(&level.to_string()), numbers)
            })
            .collect();
        let caption = format!(
            "Accuracy in % by family at L0 and at {darkest} ({} {}), {}. {} {BELOW}",
            darkest.value(),
            darkest.axis().unwrap_or(Axis::LIGHT).unit,
            self.light(variant, None),
            self.basis()
        );
        let heads = families
            .iter()
            .map(|family| self.names.shown(family_name(Some(family))));
        table(caption, heads, rows)
    }

    /// The accuracy of a model on a family at a level.
    fn at(&self, model: &str, level: AxisLevel, variant: &Variant, family: &Family) -> TableCell {
        let grid = &self.findings.grid;
        let place =
            grid.find_up_to_group(&ModelInCondition::with_images(model, level, variant, None));
        let subject = place.map(|place| &grid.subjects[place]);
        let of = subject.and_then(|subject| {
            let below = !self.findings.below_blind(subject, Some(family)).is_empty();
            Some(accuracy(self.accuracy_of(subject, Some(family))?, below))
        });
        of.unwrap_or(TableCell::Blank)
    }

    /// The effect of an enhancer over the models, then the accuracy of each model with it; `None` if it was not asked in the variant.
    fn by_enhancer(&self, variant: &Variant, enhancer: &EnhancerName) -> Option<Table> {
        let pooled: Vec<_> = self
            .findings
            .pooled
            .iter()
            .filter(|of| {
                of.kind == PooledKind::Enhancer
                    && of.family.is_none()
                    && of.variant == *variant
                    && of.enhancer.as_ref() == Some(enhancer)
            })
            .collect();
        let rows: Vec<(&str, Vec<(AxisLevel, Estimate)>)> = self
            .models
            .iter()
            .map(|model| {
                let points = self.points(model, variant, Some(enhancer), |subject| {
                    subject.enhancer.as_ref()?;
                    self.accuracy_of(subject, None)
                });
                (*model, points)
            })
            .collect();
        let mut levels: Vec<AxisLevel> = rows
            .iter()
            .flat_map(|(_, points)| points)
            .map(|(level, _)| *level)
            .chain(pooled.iter().map(|of| of.level))
            .collect();
        levels.sort_unstable();
        levels.dedup();
        if levels.is_empty() {
            return None;
        }
        let models = pooled.first().map_or(0, |of| of.models.len());
        let effect = levels.iter().map(|level| {
            let of = pooled.iter().find(|of| of.level == *level);
            of.map_or(TableCell::Blank, |of| {
                TableCell::Effect(of.strict.difference, of.strict.verdict)
            })
        });
        let name = match models {
            1 => "enhanced − raw".to_owned(),
            several => format!("{several} models, enhanced − raw"),
        };
        let effect = row(name, None, effect);
        let own = rows
            .iter()
            .filter(|(_, points)| !points.is_empty())
            .map(|(model, points)| {
                let numbers = levels.iter().map(|level| {
                    let at = points.iter().find(|(at, _)| at == level);
                    at.map_or(TableCell::Blank, |(_, of)| TableCell::Estimate(*of))
                });
                row(self.names.shown(model), Some(""), numbers)
            });
        let rows = std::iter::once(effect).chain(own).collect();
        let caption = format!(
            "Effect of {} in points, and accuracy with it in %, {}. {} Bold: a difference that is shown (p < 0.05 after Holm's correction over the levels).",
            self.names.shown(enhancer.as_str()),
            self.light(variant, None),
            self.basis()
        );
        Some(table(caption, levels.iter().map(ToString::to_string), rows))
    }
}
