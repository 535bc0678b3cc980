//! The tables of a paper: models in rows, levels or families in columns: [`paper_tables`].

use std::collections::BTreeMap;

use super::{Names, Overview};
use crate::report::words::{family as family_name, points};
use crate::score::choice::ReadingMode;
use crate::score::estimate::Estimate;
use crate::score::findings::Findings;
use crate::score::pooled_kind::PooledKind;
use crate::score::subject::Subject;
use crate::types::degradation::{Axis, Kind};
use crate::types::{AxisLevel, EnhancerName, Family, KindReading, View};

/// A table of a paper.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PaperTable {
    /// Caption as plain text.
    pub caption: String,
    /// The names of the columns after the first one.
    pub heads: Vec<String>,
    /// Blocks of rows with a heading, which may be empty.
    pub blocks: Vec<(String, Vec<PaperRow>)>,
}

/// A row of a table of a paper.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct PaperRow {
    pub name: String,
    /// Whether the name is bold: the model is shown to be better than every other.
    pub is_best: bool,
    pub cells: Vec<PaperCell>,
}

/// A cell of a table of a paper.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum PaperCell {
    Empty,
    /// A number in percent or points, with its interval.
    Interval {
        value: String,
        ends: Estimate,
        mark: PaperMark,
    },
    /// A number without an interval.
    Number(String),
}

/// What is said of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PaperMark {
    None,
    /// Shown to be below the answers without images.
    Below,
    /// A difference that is shown.
    Shown,
}

/// The words about marks in captions.
const BELOW: &str = "↓: shown to be below the answers without images.";

/// The tables for which there are records: accuracy by level, accuracy by family at L0 and at the darkest level, and each enhancer.
pub(crate) fn paper_tables(findings: &Findings<'_>, names: &Names) -> Vec<PaperTable> {
    let overview = Overview::new(findings, names);
    let variants = overview.tested_variants();
    let mut tables: Vec<PaperTable> = variants
        .iter()
        .map(|variant| overview.by_level(variant))
        .collect();
    tables.extend(overview.main_variant().map(|of| overview.by_family(&of)));
    for variant in &variants {
        for enhancer in &overview.enhancers {
            tables.extend(overview.by_enhancer(variant, enhancer));
        }
    }
    tables.retain(|table| table.blocks.iter().any(|(_, rows)| !rows.is_empty()));
    tables
}

fn share(of: Estimate, mark: PaperMark) -> PaperCell {
    PaperCell::Interval {
        value: format!("{:.1}", 100.0 * of.value),
        ends: of,
        mark,
    }
}

impl Overview<'_> {
    /// What holds for all numbers of a table.
    fn basis(&self) -> String {
        let (grid, unit) = (&self.findings.grid, self.findings.unit);
        format!(
            "Strict reading; below each number its 95 % interval by {unit}; {} items in {} {unit}s.",
            grid.items.len(),
            grid.clusters
        )
    }

    /// The name of a level, with its value on the axis.
    fn heads(levels: &[AxisLevel]) -> Vec<String> {
        levels.iter().map(ToString::to_string).collect()
    }

    fn by_level(&self, variant: &KindReading) -> PaperTable {
        let on = |level: &&AxisLevel| {
            let axis = variant.kind.map_or(Axis::LIGHT, Kind::axis);
            level.is_shown_on(axis)
        };
        let rows = self.models.iter().map(|model| {
            let mut below = Vec::new();
            let points = self.points(model, variant, None, |subject| {
                if !self.findings.below_blind(subject, None).is_empty() {
                    below.extend(subject.level);
                }
                self.accuracy_of(subject, None)
            });
            let cells = points.into_iter().map(|(level, of)| {
                let mark = if below.contains(&level) {
                    PaperMark::Below
                } else {
                    PaperMark::None
                };
                (level, share(of, mark))
            });
            (*model, cells.collect())
        });
        let rows: Vec<(&str, BTreeMap<AxisLevel, PaperCell>)> = rows.collect();
        let has = |level: &&AxisLevel| rows.iter().any(|(_, cells)| cells.contains_key(level));
        let levels: Vec<AxisLevel> = self.levels.iter().filter(on).filter(has).copied().collect();
        let rows = rows.into_iter().map(|(model, mut cells)| PaperRow {
            name: self.names.of(model),
            is_best: self.is_best(model, variant),
            cells: levels
                .iter()
                .map(|level| cells.remove(level).unwrap_or(PaperCell::Empty))
                .collect(),
        });
        let rows = rows.collect();
        let axis = variant.kind.map_or(Axis::LIGHT, Kind::axis);
        let values = levels.iter().map(|of| format!("{of} {}", of.value()));
        let values: Vec<String> = values.collect();
        PaperTable {
            caption: format!(
                "Accuracy in % by level, {} ({} in {}: {}). {} {BELOW} Bold: shown to be better than every other model over the levels.",
                self.light(variant, None),
                axis.title,
                axis.unit,
                values.join(", "),
                self.basis()
            ),
            blocks: vec![
                (String::new(), rows),
                (
                    "without images".to_owned(),
                    self.without_images(None, levels.len()),
                ),
            ],
            heads: Self::heads(&levels),
        }
    }

    /// Models without images, and chance, in the first of `columns` cells.
    fn without_images(&self, family: Option<&Family>, columns: usize) -> Vec<PaperRow> {
        let cells = self.findings.summary.of(family, ReadingMode::Strict);
        let cells = cells.filter(|cell| cell.subject.view != Some(View::Image));
        let rows = cells.filter_map(|cell| {
            let of = cell.accuracy?;
            let first = match cell.subject.view {
                // The expected share of guesses is known without an interval.
                None => PaperCell::Number(format!("{:.1}", 100.0 * of.value)),
                Some(_) => share(of, PaperMark::None),
            };
            let mut cells = vec![PaperCell::Empty; columns];
            *cells.first_mut()? = first;
            Some(PaperRow {
                name: self.names.of(&cell.subject.model),
                is_best: false,
                cells,
            })
        });
        rows.collect()
    }

    fn is_best(&self, model: &str, variant: &KindReading) -> bool {
        self.findings.best.as_ref().is_some_and(|best| {
            best.variant == *variant
                && best.models.len() > 1
                && best.not_shown_better_than.is_empty()
                && best.leader().model == model
        })
    }

    fn by_family(&self, variant: &KindReading) -> PaperTable {
        let families = self.findings.grid.families();
        let of_variant = self.models.iter().flat_map(|model| {
            let points = self.points(model, variant, None, |subject| {
                self.accuracy_of(subject, None)
            });
            points.into_iter().map(|(level, _)| level)
        });
        let darkest = of_variant.max().unwrap_or(AxisLevel::L0);
        let blocks = [AxisLevel::L0, darkest].map(|level| {
            let rows = self.models.iter().map(|model| PaperRow {
                name: self.names.of(model),
                is_best: false,
                cells: families
                    .iter()
                    .map(|family| self.at(model, level, variant, family))
                    .collect(),
            });
            (level.to_string(), rows.collect())
        });
        PaperTable {
            caption: format!(
                "Accuracy in % by family at L0 and at {darkest} ({} {}), {}. {} {BELOW}",
                darkest.value(),
                darkest.axis().unwrap_or(Axis::LIGHT).unit,
                self.light(variant, None),
                self.basis()
            ),
            heads: families
                .iter()
                .map(|family| self.names.of(family_name(Some(family))))
                .collect(),
            blocks: blocks.to_vec(),
        }
    }

    /// The accuracy of a model on a family at a level.
    fn at(
        &self,
        model: &str,
        level: AxisLevel,
        variant: &KindReading,
        family: &Family,
    ) -> PaperCell {
        let grid = &self.findings.grid;
        let place = grid.stand_in(&Subject::seeing(model, level, variant, None));
        let subject = place.map(|place| &grid.subjects[place]);
        let of = subject.and_then(|subject| {
            let below = !self.findings.below_blind(subject, Some(family)).is_empty();
            let mark = if below {
                PaperMark::Below
            } else {
                PaperMark::None
            };
            Some(share(self.accuracy_of(subject, Some(family))?, mark))
        });
        of.unwrap_or(PaperCell::Empty)
    }

    /// The effect of an enhancer over the models, then the accuracy of each model with it; `None` if it was not asked in the variant.
    fn by_enhancer(&self, variant: &KindReading, enhancer: &EnhancerName) -> Option<PaperTable> {
        let pooled = self.findings.pooled.iter().filter(|of| {
            of.kind == PooledKind::Enhancer
                && of.family.is_none()
                && of.variant == *variant
                && of.enhancer.as_ref() == Some(enhancer)
        });
        let pooled: Vec<_> = pooled.collect();
        let rows = self.models.iter().map(|model| {
            let points = self.points(model, variant, Some(enhancer), |subject| {
                subject.enhancer.as_ref()?;
                self.accuracy_of(subject, None)
            });
            (*model, points)
        });
        let rows: Vec<(&str, Vec<(AxisLevel, Estimate)>)> = rows.collect();
        let asked = rows.iter().flat_map(|(_, points)| points);
        let asked = asked.map(|(level, _)| *level);
        let mut levels: Vec<AxisLevel> = asked.chain(pooled.iter().map(|of| of.level)).collect();
        levels.sort_unstable();
        levels.dedup();
        if levels.is_empty() {
            return None;
        }
        let models = pooled.first().map_or(0, |of| of.models.len());
        let effect = levels.iter().map(|level| {
            let of = pooled.iter().find(|of| of.level == *level);
            of.map_or(PaperCell::Empty, |of| PaperCell::Interval {
                value: points(of.strict.difference.value),
                ends: of.strict.difference,
                mark: if of.strict.verdict.is_shown() {
                    PaperMark::Shown
                } else {
                    PaperMark::None
                },
            })
        });
        let effect = PaperRow {
            name: match models {
                1 => "enhanced − raw".to_owned(),
                several => format!("{several} models, enhanced − raw"),
            },
            is_best: false,
            cells: effect.collect(),
        };
        let cells = |points: &[(AxisLevel, Estimate)], level: &AxisLevel| {
            let at = points.iter().find(|(at, _)| at == level);
            at.map_or(PaperCell::Empty, |(_, of)| share(*of, PaperMark::None))
        };
        let own = rows.iter().filter(|(_, points)| !points.is_empty());
        let own = own.map(|(model, points)| PaperRow {
            name: self.names.of(model),
            is_best: false,
            cells: levels.iter().map(|level| cells(points, level)).collect(),
        });
        Some(PaperTable {
            caption: format!(
                "Effect of {} in points, and accuracy with it in %, {}. {} Bold: a difference that is shown (p < 0.05 after Holm's correction over the levels).",
                self.names.of(enhancer.as_str()),
                self.light(variant, None),
                self.basis()
            ),
            heads: Self::heads(&levels),
            blocks: vec![
                (String::new(), vec![effect]),
                (String::new(), own.collect()),
            ],
        })
    }
}
