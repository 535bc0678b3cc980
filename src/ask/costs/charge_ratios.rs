//! Charges that a server states, compared with the price table: [`ChargeRatios`].

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::prices::{Price, stated_charge};
use crate::types::{ServiceTier, Usage};

/// Relative difference between a stated charge and the price table from which it is said; chosen: more than rounding.
const TOLERANCE: f64 = 0.05;

/// Ratio of the highest to the lowest charge per list price from which charges vary from reply to reply; chosen.
const VARYING: f64 = 1.1;

/// Assumed ratio of the dearest charge to the list price if the charges vary; chosen: the dearest provider of a model
/// costs about ten times the cheapest. A higher ratio replaces it once a reply has it.
const MAX_VARYING: f64 = 10.0;

/// A charge that a server states, and the price of its tokens by the table; in US dollars.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StatedAndListed {
    pub(crate) stated: f64,
    pub(crate) listed: f64,
}

/// Ratios of the charges that a server states for a model to the price table.
#[derive(Debug, Default)]
pub(crate) struct ChargeRatios(Mutex<Ratios>);

#[derive(Debug, Clone, Copy, Default)]
struct Ratios {
    /// Lowest and highest ratio; `None` without a stated charge.
    range: Option<(f64, f64)>,
    /// Sums of stated charges and of the list prices of the same requests, in US dollars.
    sums: (f64, f64),
    /// First charge that differs from the price table.
    differing: Option<StatedAndListed>,
    /// First charge that is no plausible price of its tokens.
    implausible: Option<StatedAndListed>,
    /// First service tier without a known price.
    unknown_tier: Option<ServiceTier>,
}

impl ChargeRatios {
    /// Adds the charge of a request whose tokens cost a `share` of their price.
    pub(crate) fn record(&self, price: Price, usage: Usage, share: f64) {
        let listed = share * price.list_charge(usage);
        let mut ratios = self.lock();
        if let Some(tier) = usage.service_tier.filter(|tier| price.tiers.is_unknown(*tier)) {
            ratios.unknown_tier.get_or_insert(tier);
        }
        let Some(cost) = usage.cost.filter(|_| listed > 0.0) else {
            return;
        };
        let stated = cost.dollars();
        let pair = StatedAndListed { stated, listed };
        if stated_charge(usage, listed).is_none() {
            ratios.implausible.get_or_insert(pair);
            return;
        }
        let ratio = stated / listed;
        let (lowest, highest) = ratios.range.unwrap_or((ratio, ratio));
        ratios.range = Some((lowest.min(ratio), highest.max(ratio)));
        ratios.sums.0 += stated;
        ratios.sums.1 += listed;
        if (ratio - 1.0).abs() > TOLERANCE {
            ratios.differing.get_or_insert(pair);
        }
    }

    /// Factor by which the upper bound of the next request exceeds its list price; at least 1.
    pub(crate) fn factor(&self) -> f64 {
        let Some((lowest, highest)) = self.lock().range else {
            return 1.0;
        };
        let spread = highest / lowest;
        let is_dear = highest > 1.0 + TOLERANCE;
        if is_dear && spread > VARYING { highest.max((highest * spread).min(MAX_VARYING)) } else { highest.max(1.0) }
    }

    /// Mean ratio of the stated charges to the list price; `None` without a stated charge.
    pub(crate) fn mean(&self) -> Option<f64> {
        let (stated, listed) = self.lock().sums;
        (listed > 0.0).then(|| stated / listed)
    }

    /// The first stated charge that differs from the price table by more than [`TOLERANCE`].
    pub(crate) fn differing(&self) -> Option<StatedAndListed> {
        self.lock().differing
    }

    /// The first stated charge that is no plausible price of its tokens.
    pub(crate) fn implausible(&self) -> Option<StatedAndListed> {
        self.lock().implausible
    }

    /// True if a reply was at a service tier without a known price.
    pub(crate) fn has_unknown_tier(&self) -> bool {
        self.lock().unknown_tier.is_some()
    }

    fn lock(&self) -> MutexGuard<'_, Ratios> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::StatedCost;

    fn price() -> Price {
        Price {
            input: 1e6,
            output: 0.0,
            cached_input: None,
            image_tokens: None,
            tiers: crate::ask::costs::TierFactors::default(),
        }
    }

    /// Records charges for one token, which costs a dollar.
    fn ratios(charges: &[f64]) -> ChargeRatios {
        let ratios = ChargeRatios::default();
        for charge in charges {
            let usage = Usage { prompt_tokens: Some(1), cost: StatedCost::from_dollars(*charge), ..Usage::default() };
            ratios.record(price(), usage, 1.0);
        }
        ratios
    }

    #[test]
    fn the_factor_follows_the_stated_charges() {
        for (charges, factor) in [
            (&[][..], 1.0),
            (&[1.0, 1.0], 1.0),
            (&[0.4, 0.5], 1.0),
            (&[5.0], 5.0),
            (&[5.0, 5.2], 5.2),
            (&[1.0, 2.0], 4.0),
            (&[1.0, 4.0], 10.0),
            (&[1.0, 12.0], 12.0),
        ] {
            let found = ratios(charges).factor();
            assert!((found - factor).abs() < 1e-9, "{charges:?}: {found}");
        }
    }

    #[test]
    fn only_differing_charges_are_said() {
        assert_eq!(ratios(&[1.0, 1.03]).differing(), None);
        let dear = ratios(&[1.0, 5.0]);
        let expected = StatedAndListed { stated: 5.0, listed: 1.0 };
        assert_eq!(dear.differing(), Some(expected));
        assert_eq!(dear.mean(), Some(3.0));
    }

    #[test]
    fn implausible_charges_do_not_count() {
        for (charge, is_counted) in [(0.0, false), (0.001, false), (0.02, true), (99.0, true)] {
            let ratios = ratios(&[charge]);
            assert_eq!(ratios.mean().is_some(), is_counted, "{charge}");
            assert_eq!(ratios.implausible().is_none(), is_counted, "{charge}");
        }
    }
}
