//! Accuracies over the levels, a line a series: [`Ladder`].

use std::collections::{BTreeMap, BTreeSet};

use super::subject::light;
use crate::score::accuracy::{Cell, Summary};
use crate::score::choice::Mode;
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

    /// The variant in words, with what mended it.
    pub(super) fn light(&self) -> String {
        light(self.variant, self.enhancer)
    }
}

/// The accuracies of models that see, all families together, in the strict reading.
pub(super) struct Ladder<'a> {
    /// The levels of all series.
    pub(super) levels: BTreeSet<AxisLevel>,
    /// The cells of each series by level.
    pub(super) series: BTreeMap<Series<'a>, BTreeMap<AxisLevel, &'a Cell>>,
    /// The cells without a level: models without images, and chance.
    pub(super) floors: Vec<&'a Cell>,
}

impl<'a> Ladder<'a> {
    pub(super) fn new(summary: &'a Summary) -> Self {
        let mut ladder = Self {
            levels: BTreeSet::new(),
            series: BTreeMap::new(),
            floors: Vec::new(),
        };
        for cell in summary.of(None, Mode::Strict) {
            match (cell.subject.view, cell.subject.level) {
                (Some(View::Image), Some(level)) => {
                    ladder.levels.insert(level);
                    let series = ladder.series.entry(Series::of(&cell.subject));
                    series.or_default().insert(level, cell);
                }
                _ => ladder.floors.push(cell),
            }
        }
        ladder
    }
}
