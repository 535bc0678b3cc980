//! The columns of a record that are derived from the condition of its images: [`ConditionColumns`].

use serde::Serialize;

use super::degradation::{Degradation, ProfileName};
use super::severity::{Axis, Severity};
use crate::types::{AxisLevel, Condition, EnhancerName, PairDark};

/// The columns derived from a condition. Without a condition no image was shown.
#[derive(Debug, Serialize)]
pub struct ConditionColumns<'a> {
    /// The condition; `None` without an image.
    pub condition: Option<&'a Condition>,
    /// The level, such as L3, 3.3 or `dark`.
    pub level: Option<AxisLevel>,
    /// The kind of degradation, the darkness of a pair, or `none`.
    pub variant: String,
    /// The exposure drop in EV; `None` where it is not measured in EV, or differs by frame.
    pub ev: Option<f64>,
    /// The severity of kinds that are not measured in EV; they have no `ev`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub severity: Option<Severity>,
    /// The noise profile.
    pub reading: Option<&'a ProfileName>,
    /// The enhancer; `None` for a raw image.
    pub enhancer: Option<&'a EnhancerName>,
}

impl<'a> ConditionColumns<'a> {
    /// The columns of a condition.
    pub fn new(condition: Option<&'a Condition>) -> Self {
        let degradation = condition.and_then(|condition| condition.degradation());
        let level = condition.map(Condition::level);
        // The darkness of pairs differs by frame; it is stored with each image (`PairFacts`).
        let light = level
            .filter(|level| *level != AxisLevel::PAIR)
            .filter(|level| level.axis().is_none_or(|axis| axis == Axis::LIGHT));
        let severity = degradation.map(Degradation::severity);
        Self {
            condition,
            level,
            variant: match condition.and_then(Condition::pair) {
                Some(pair) => pair.to_string(),
                None => degradation.map_or("none", |how| how.kind().word()).to_owned(),
            },
            ev: light.map(AxisLevel::value),
            severity: severity.filter(|_| light.is_none()),
            reading: degradation
                .and_then(Degradation::reading)
                .or_else(|| condition.and_then(Condition::pair).and_then(PairDark::reading)),
            enhancer: condition.and_then(|condition| condition.enhancer.as_ref()),
        }
    }
}
