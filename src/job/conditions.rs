//! In which conditions frames are shown: [`conditions`].

use crate::synthesis::LightSettings;
use crate::types::{Condition, Degradation, Digest, EnhancerName, KindSet};

/// Every condition in which a frame is shown: raw first, each enhancer after, level by level, so that a frame is developed once for
/// all that use it.
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
