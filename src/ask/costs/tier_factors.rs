//! Price factors of service tiers: [`TierFactors`].

use crate::types::ServiceTier;

/// Factor of each service tier relative to the price that it belongs to; `None` if unknown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TierFactors([Option<f64>; ServiceTier::COUNT]);

impl Default for TierFactors {
    fn default() -> Self {
        Self::new(std::iter::empty())
    }
}

impl TierFactors {
    /// Factors by the names of tiers, relative to the standard tier. Tiers with other names than those of
    /// [`ServiceTier`] are left out, because replies do not tell them apart.
    pub(super) fn new<'a>(stated: impl Iterator<Item = (&'a str, f64)>) -> Self {
        let mut factors = [None; ServiceTier::COUNT];
        factors[ServiceTier::Standard as usize] = Some(1.0);
        for (name, factor) in stated {
            match ServiceTier::from_name(name) {
                None | Some(ServiceTier::Other | ServiceTier::Standard) => {}
                Some(tier) => factors[tier as usize] = Some(factor),
            }
        }
        Self(factors)
    }

    /// The factors relative to the price at the tier `asked`, which has this factor.
    pub(super) fn relative_to(self, asked: Option<ServiceTier>, factor: f64) -> Self {
        let mut factors = self.0;
        if let Some(asked) = asked {
            factors[asked as usize] = Some(factor);
        }
        Self(factors.map(|other| other.map(|other| other / factor)))
    }

    /// The factor of a tier that a reply states; 1 for the tier that was asked for, and for one whose factor is
    /// unknown.
    pub(super) fn factor(&self, tier: Option<ServiceTier>) -> f64 {
        tier.and_then(|tier| self.0[tier as usize]).filter(|factor| factor.is_finite()).unwrap_or(1.0)
    }

    /// True if a reply states a tier whose factor is unknown.
    pub(crate) fn is_unknown(&self, tier: ServiceTier) -> bool {
        self.0[tier as usize].is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_relative_to_the_tier_asked_for() {
        let factors = TierFactors::new([("priority", 1.7), ("flex", 0.5), ("turbo", 9.0)].into_iter());
        assert!((factors.factor(Some(ServiceTier::Priority)) - 1.7).abs() < 1e-12);
        assert!((factors.factor(None) - 1.0).abs() < 1e-12);
        assert!(factors.is_unknown(ServiceTier::Other) && factors.is_unknown(ServiceTier::Scale));
        let priority = factors.relative_to(Some(ServiceTier::Priority), 1.7);
        assert!((priority.factor(Some(ServiceTier::Priority)) - 1.0).abs() < 1e-12);
        assert!((priority.factor(Some(ServiceTier::Standard)) - 1.0 / 1.7).abs() < 1e-12);
        let other = factors.relative_to(Some(ServiceTier::Other), 9.0);
        assert!(!other.is_unknown(ServiceTier::Other));
    }
}
