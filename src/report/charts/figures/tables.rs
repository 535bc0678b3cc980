//! Tables for a paper, with models in rows and levels or families in columns: [`paper_tables`].
//!
//! Figures of thresholds: one of darkness thresholds, one of blur thresholds.

use std::collections::{BTreeMap, BTreeSet};

use super::{DisplayNames, FigureBuilder, FigureSpec};
use crate::charts::chart::{Chart, LineContent, LineStyle, Panel, PlotLine, Scale};
use crate::tables::missing_threshold_reason;
use crate::text::table::{Column, ColumnHeads, ColumnKind, Table, TableCell, TableRow};
use crate::text::words::{family as family_name, stops};
use darkqa_base::types::degradations::{Axis, Kind};
use darkqa_base::types::text::counted;
use darkqa_base::types::{AxisLevel, EnhancerName, Family, Variant, View};
use darkqa_score::accuracies::Curve;
use darkqa_score::choice::ParsingMode;
use darkqa_score::comparisons::PooledKind;
use darkqa_score::estimate::Estimate;
use darkqa_score::findings::Findings;
use darkqa_score::significance::Verdict;

/// Caption sentence about the mark ↓.
const BELOW: &str = "↓: detected to be below the answers without images.";

/// All tables that have data: accuracy by level, accuracy by family at L0 and at the darkest level, and a table for
/// each enhancer.
pub fn paper_tables(findings: &Findings<'_>, names: &DisplayNames) -> Vec<Table> {
    let builder = FigureBuilder::new(findings, names);
    let variants = builder.tested_variants();
    let mut tables: Vec<Table> = variants.iter().map(|variant| builder.by_level(variant)).collect();
    tables.extend(builder.main_variant().map(|variant| builder.by_family(&variant)));
    for variant in &variants {
        for enhancer in &builder.enhancers {
            tables.extend(builder.by_enhancer(variant, enhancer));
        }
    }
    tables.retain(|table| !table.rows.is_empty());
    tables
}

/// Table whose first column has the row names; `heads` are the names of the other columns.
fn table(caption: String, heads: impl IntoIterator<Item = String>, rows: Vec<TableRow>) -> Table {
    let names = Column { kind: ColumnKind::Text, heads: ColumnHeads::default() };
    let numbers = heads.into_iter().map(|head| Column {
        kind: ColumnKind::Accuracy,
        heads: ColumnHeads { page: Some(head), ..ColumnHeads::default() },
    });
    Table { name: "paper", caption, columns: std::iter::once(names).chain(numbers).collect(), rows, ..Table::default() }
}

/// Table row below the heading of its group.
fn row(name: String, group: Option<&str>, numbers: impl IntoIterator<Item = TableCell>) -> TableRow {
    TableRow {
        cells: std::iter::once(name.into()).chain(numbers).collect(),
        group: group.map(str::to_owned),
        ..TableRow::default()
    }
}

/// Cell with an accuracy, marked if it is below the accuracy without images.
fn accuracy_cell(accuracy: Estimate, is_below_blind: bool) -> TableCell {
    if is_below_blind { TableCell::Below(accuracy) } else { TableCell::Estimate(accuracy) }
}

impl FigureBuilder<'_> {
    /// Caption sentence on parsing, intervals and number of items.
    fn basis(&self) -> String {
        let (grid, unit) = (&self.findings.grid, self.findings.unit);
        format!(
            "Strict parsing; below each number its 95 % interval by {unit}; {} in {}.",
            counted(grid.items.len(), "item"),
            counted(grid.clusters, &unit.to_string())
        )
    }

    /// Accuracy of each model by level in one variant.
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
                    .map(|(level, accuracy)| (level, accuracy_cell(accuracy, below.contains(&level))))
                    .collect();
                (*model, cells)
            })
            .collect();
        let levels: Vec<AxisLevel> = self
            .levels
            .iter()
            .copied()
            .filter(|level| level.belongs_to(axis))
            .filter(|level| rows.iter().any(|(_, cells)| cells.contains_key(level)))
            .collect();
        let rows = rows
            .into_iter()
            .map(|(model, mut cells)| {
                let numbers = levels.iter().map(|level| cells.remove(level).unwrap_or(TableCell::Blank));
                TableRow { is_best: self.is_best(model, variant), ..row(self.curve_name(model), None, numbers) }
            })
            .chain(self.without_images(levels.len()))
            .collect();
        let values: Vec<String> = levels.iter().map(|level| format!("{level} {}", level.value())).collect();
        let caption = format!(
            "Accuracy in % by level, {} ({} in {}: {}). {} {BELOW} Bold: detected to be better than every other model in the dark.",
            self.condition_text(variant, None),
            axis.title,
            axis.unit,
            values.join(", "),
            self.basis()
        );
        table(caption, levels.iter().map(ToString::to_string), rows)
    }

    /// Rows of models without images, and of chance: the accuracy in the first column, the other `columns` − 1 cells
    /// blank.
    fn without_images(&self, columns: usize) -> impl Iterator<Item = TableRow> {
        self.findings
            .summary
            .family_cells(None, ParsingMode::Strict)
            .filter(|cell| cell.subject.view != Some(View::Image))
            .filter_map(move |cell| {
                let accuracy = cell.accuracy?;
                let first = match cell.subject.view {
                    // The expected accuracy of guessing is exact and has no interval.
                    None => TableCell::Guess(accuracy),
                    Some(_) => TableCell::Estimate(accuracy),
                };
                let mut numbers = vec![TableCell::Blank; columns];
                *numbers.first_mut()? = first;
                let name = self.names.display_name(&cell.subject.model);
                Some(row(name, Some("without images"), numbers))
            })
    }

    /// True if the model is detected to be better than every other model in the variant.
    fn is_best(&self, model: &str, variant: &Variant) -> bool {
        let best = self.findings.detected_best();
        best.is_some_and(|best| best.variant == *variant && best.leader().model == model)
    }

    /// Accuracy of each model by family, at L0 and at the darkest level of the variant.
    fn by_family(&self, variant: &Variant) -> Table {
        let families = self.findings.grid.families();
        let darkest = self
            .models
            .iter()
            .flat_map(|model| self.accuracy_points(model, variant, None))
            .map(|(level, _)| level)
            .max()
            .unwrap_or(AxisLevel::L0);
        let rows = [AxisLevel::L0, darkest]
            .into_iter()
            .flat_map(|level| self.models.iter().map(move |model| (level, *model)))
            .map(|(level, model)| {
                let numbers = families.iter().map(|family| self.family_cell(model, level, variant, family));
                row(self.curve_name(model), Some(&level.to_string()), numbers)
            })
            .collect();
        let caption = format!(
            "Accuracy in % by family at L0 and at {darkest} ({} {}), {}. {} {BELOW}",
            darkest.value(),
            darkest.axis().unwrap_or(Axis::LIGHT).unit,
            self.condition_text(variant, None),
            self.basis()
        );
        let heads = families.iter().map(|family| self.names.display_name(family_name(Some(family))));
        table(caption, heads, rows)
    }

    /// Accuracy of a model on a family at a level.
    fn family_cell(&self, model: &str, level: AxisLevel, variant: &Variant, family: &Family) -> TableCell {
        let Some(subject) = self.subject(model, level, variant, None) else {
            return TableCell::Blank;
        };
        let Some(accuracy) = self.accuracy_of(subject, Some(family)) else {
            return TableCell::Blank;
        };
        let below = self.findings.below_blind(subject, Some(family));
        accuracy_cell(accuracy, !below.is_empty())
    }

    /// Effect of an enhancer over all models, then the accuracy of each model with it; `None` if it was not asked in
    /// the variant.
    fn by_enhancer(&self, variant: &Variant, enhancer: &EnhancerName) -> Option<Table> {
        let pooled: Vec<_> = self
            .findings
            .pooled
            .iter()
            .filter(|finding| {
                finding.kind == PooledKind::Enhancer
                    && finding.family.is_none()
                    && finding.variant == *variant
                    && finding.enhancer.as_ref() == Some(enhancer)
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
            .chain(pooled.iter().map(|finding| finding.level))
            .collect();
        levels.sort_unstable();
        levels.dedup();
        if levels.is_empty() {
            return None;
        }
        let name = match pooled.first().map_or(0, |finding| finding.models.len()) {
            1 => "enhanced − raw".to_owned(),
            several => format!("{several} models, enhanced − raw"),
        };
        let effects = levels.iter().map(|level| {
            let finding = pooled.iter().find(|finding| finding.level == *level);
            finding.map_or(TableCell::Blank, |finding| {
                let verdict = finding.verdict().unwrap_or(Verdict::NotShown);
                TableCell::Effect(finding.strict.tested.difference, verdict)
            })
        });
        let effect_row = row(name, None, effects);
        let model_rows = rows.iter().filter(|(_, points)| !points.is_empty()).map(|(model, points)| {
            let numbers = levels.iter().map(|level| {
                let point = points.iter().find(|(other, _)| other == level);
                point.map_or(TableCell::Blank, |(_, accuracy)| TableCell::Estimate(*accuracy))
            });
            row(self.curve_name(model), Some(""), numbers)
        });
        let rows = std::iter::once(effect_row).chain(model_rows).collect();
        let caption = format!(
            "Effect of {} in points, and accuracy with it in %, {}. {} Bold: a difference that is detected (p < 0.05 after one correction over all tests of the report).",
            self.names.display_name(enhancer.as_str()),
            self.condition_text(variant, None),
            self.basis()
        );
        Some(table(caption, levels.iter().map(ToString::to_string), rows))
    }
}

/// Name and axis of each figure.
const NAMES: [(&str, Axis); 2] = [("thresholds", Axis::LIGHT), ("blur_thresholds", Axis::MOTION)];

/// Message that a threshold figure is missing because no curve has a threshold, with the reasons; `None` if that is not
/// the cause.
pub fn missing_threshold_message(findings: &Findings<'_>, figure: &str) -> Option<String> {
    let (_, axis) = NAMES.into_iter().find(|(name, _)| *name == figure)?;
    let reasons: BTreeSet<String> = curves_on(findings, axis)
        .filter_map(|curve| curve.summary.threshold.as_ref().err())
        .map(missing_threshold_reason)
        .collect();
    let reasons: Vec<String> = reasons.into_iter().collect();
    (!reasons.is_empty()).then(|| format!("no curve has a threshold: {}", reasons.join("; ")))
}

/// Curves on an axis that are over all families together.
fn curves_on<'f>(findings: &'f Findings<'_>, axis: Axis) -> impl Iterator<Item = &'f Curve> {
    findings.curves.iter().filter(move |curve| curve.family.is_none() && curve.axis() == axis)
}

impl FigureBuilder<'_> {
    /// One figure for each axis on which a curve has a threshold.
    pub(super) fn thresholds(&self) -> Vec<FigureSpec> {
        Axis::ALL.into_iter().filter_map(|axis| self.thresholds_on(axis)).collect()
    }

    /// One row for each curve on an axis, with its threshold and interval; `None` if no curve has a threshold.
    fn thresholds_on(&self, axis: Axis) -> Option<FigureSpec> {
        let lines: Vec<PlotLine> = curves_on(self.findings, axis)
            .filter_map(|curve| {
                let threshold = *curve.summary.threshold.as_ref().ok()?;
                let darkest = curve.summary.darkest.value();
                let light = self.condition_text(&curve.variant, curve.enhancer.as_ref());
                let text = format!(
                    "{} [{}, {}]",
                    stops(threshold.value, darkest),
                    stops(threshold.low, darkest),
                    stops(threshold.high, darkest)
                );
                let name = format!("{}, {light}", self.curve_name(&curve.model));
                Some(PlotLine::new(name, LineStyle(0), LineContent::Range { threshold, text }))
            })
            .collect();
        if lines.is_empty() {
            return None;
        }
        let panel = Panel { title: String::new(), x: Scale::thresholds(axis), y: Scale::Names, lines, model: None };
        let (name, caption) = if axis == Axis::MOTION {
            (
                "blur_thresholds",
                "Threshold of motion blur: the exposure time at which accuracy is half-way between that at L0 and that without images (or guessing, if that is higher). Arrows: \
                 beyond the longest time asked.",
            )
        } else {
            (
                "thresholds",
                "Darkness threshold: the exposure drop at which accuracy is half-way between that at L0 and that without images (or guessing, if that is higher). Arrows: \
                 beyond the darkest level asked.",
            )
        };
        Some(FigureSpec {
            name,
            caption: caption.to_owned(),
            chart: Chart {
                panels: vec![panel],
                columns: 1,
                note: format!("lines are 95 % intervals by {}", self.findings.unit),
            },
        })
    }
}
