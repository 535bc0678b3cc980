//! Models and levels that pooled findings leave out: [`models_left_out`].

use std::collections::{BTreeMap, BTreeSet};

use super::PooledFamily;
use crate::comparisons::pooled_kind::PooledKind;
use crate::grid::Grid;
use darkqa_base::types::{AxisLevel, EnhancerName, Variant};

/// Models that a set of findings leaves out because they answered fewer items than others at some levels, or levels
/// that it leaves out because only these models were asked there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ModelsLeftOut {
    pub kind: PooledKind,
    pub variant: Variant,
    pub enhancer: Option<EnhancerName>,
    /// Models, sorted.
    pub models: Vec<String>,
    /// Levels at which the models answered fewer items than others, or the levels left out; sorted.
    pub levels: Vec<AxisLevel>,
    /// All levels of the findings, sorted.
    pub asked: Vec<AxisLevel>,
    /// Number of items of the findings at `levels`, and of those that each of the models answered.
    pub items: [usize; 2],
    /// True if the findings include the models, but leave out these levels.
    pub is_more: bool,
}

/// Returns the models that the findings leave out, by set and by the levels that they lack.
#[must_use]
pub(crate) fn models_left_out(grid: &Grid<'_>) -> Vec<ModelsLeftOut> {
    let mut all = Vec::new();
    // Two enhancers leave out the models that one of them leaves out.
    for set in PooledFamily::of_enhancers_and_raw(grid) {
        let levels = set.levels(grid);
        let models = set.models(grid, &levels);
        let asked: Vec<AxisLevel> = levels
            .iter()
            .copied()
            .filter(|level| models.pooled.iter().all(|[model, other]| set.sides(grid, model, other, *level).is_some()))
            .collect();
        let mut groups = BTreeMap::<(Vec<AxisLevel>, [usize; 2]), BTreeSet<&str>>::new();
        for (model, lacking) in models.left_out {
            let items = [0, 1].map(|side| lacking.iter().map(|(_, items)| items[side]).sum());
            let levels = lacking.iter().map(|(level, _)| *level).collect();
            groups.entry((levels, items)).or_default().insert(model);
        }
        all.extend(groups.into_iter().map(|((levels, items), models)| ModelsLeftOut {
            kind: set.kind,
            variant: set.variant.clone(),
            enhancer: set.enhancer.clone(),
            models: models.into_iter().map(str::to_owned).collect(),
            levels,
            asked: asked.clone(),
            items,
            is_more: false,
        }));
        let mut more = BTreeMap::<Vec<AxisLevel>, BTreeSet<&str>>::new();
        for (model, levels) in models.extra_levels {
            more.entry(levels).or_default().insert(model);
        }
        all.extend(more.into_iter().map(|(levels, models)| ModelsLeftOut {
            kind: set.kind,
            variant: set.variant.clone(),
            enhancer: set.enhancer.clone(),
            models: models.into_iter().map(str::to_owned).collect(),
            asked: levels.clone(),
            levels,
            items: [0, 0],
            is_more: true,
        }));
    }
    all
}
