//! Mean of curves: [`mean`].

use std::collections::BTreeSet;

use crate::types::AxisLevel;
use darkqa_score::estimate::Estimate;

/// Mean of curves at the levels that all of them have, with the curves' range as interval. A single curve is returned
/// unchanged.
pub(super) fn mean(curves: &[Vec<(AxisLevel, Estimate)>]) -> Vec<(AxisLevel, Estimate)> {
    if let [single] = curves {
        return single.clone();
    }
    let levels: BTreeSet<AxisLevel> = curves.iter().flatten().map(|(level, _)| *level).collect();
    levels.into_iter().filter_map(|level| Some((level, mean_at(curves, level)?))).collect()
}

/// Mean of curves at one level, with their range; `None` if a curve has no point there.
fn mean_at(curves: &[Vec<(AxisLevel, Estimate)>], level: AxisLevel) -> Option<Estimate> {
    let values: Option<Vec<f64>> = curves
        .iter()
        .map(|curve| {
            let point = curve.iter().find(|(other, _)| *other == level);
            point.map(|(_, estimate)| estimate.value)
        })
        .collect();
    let values = values.filter(|values| !values.is_empty())?;
    Some(Estimate {
        value: values.iter().sum::<f64>() / values.len() as f64,
        low: values.iter().copied().fold(f64::INFINITY, f64::min),
        high: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        n: values.len(),
    })
}
