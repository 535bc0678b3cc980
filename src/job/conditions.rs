//! In which conditions frames are shown: [`conditions`].

use crate::config::Light;
use crate::types::{Condition, Degradation, Digest, EnhancerName, Variants};

/// Every condition in which a frame is shown: raw first, each enhancer after, level by level, so that a frame is developed once for
/// all that use it.
pub(crate) fn conditions(
    light: &Light,
    on: Variants,
    enhancers: &[(EnhancerName, Digest)],
) -> Vec<Condition> {
    let mut all = Vec::new();
    for level in &light.levels {
        let Some(dark) = level.dark() else {
            all.push(Condition::raw(Degradation::None));
            continue;
        };
        for degradation in [Degradation::Exposure(dark), Degradation::Sensor(dark)] {
            if !light.variants.include(degradation.variant()) {
                continue;
            }
            all.push(Condition::raw(degradation));
            if on.include(degradation.variant()) {
                let enhanced = |(name, _): &(EnhancerName, Digest)| Condition {
                    degradation,
                    enhancer: Some(name.clone()),
                };
                all.extend(enhancers.iter().map(enhanced));
            }
        }
    }
    all
}
