//! The conditions in which frames are shown: [`conditions`].

use crate::synthesis::LightSettings;
use crate::types::{Condition, Degradation, Digest, EnhancerName, KindSet};

/// Every condition in which a frame is shown, level by level: first raw, then with each enhancer. In this order a frame is degraded
/// once for all enhancers.
pub(crate) fn conditions(
    light: &LightSettings,
    on: KindSet,
    enhancers: &[(EnhancerName, Digest)],
) -> Vec<Condition> {
    let mut all = Vec::new();
    for degradation in light.degradations() {
        let kind = degradation.as_ref().map(Degradation::kind);
        let raw = Condition::raw(degradation);
        let enhanced = |(name, _): &(EnhancerName, Digest)| Condition {
            enhancer: Some(name.clone()),
            ..raw.clone()
        };
        let enhanced: Vec<Condition> = if kind.is_some_and(|kind| on.includes(kind)) {
            enhancers.iter().map(enhanced).collect()
        } else {
            Vec::new()
        };
        all.push(raw);
        all.extend(enhanced);
    }
    all
}
