//! The charge for a request as the server states it: [`StatedCost`], [`ServiceTier`].

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// Units per US dollar: xAI's ticks, the finest unit in which a vendor states charges
/// (docs.x.ai/developers/cost-tracking).
const PER_DOLLAR: f64 = 1e10;

/// A charge that a server states for a request, 0 or more, in units of 10⁻¹⁰ US dollars. A number of US dollars in a
/// file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct StatedCost(u64);

impl StatedCost {
    /// Maximum plausible charge for one request, in US dollars; chosen: ten times the dearest known request, a million
    /// tokens of reply at 10 dollars per million.
    pub const MAX: f64 = 100.0;

    /// A charge in US dollars; `None` for a negative number, one above [`Self::MAX`], or none at all.
    #[must_use]
    pub fn from_dollars(dollars: f64) -> Option<Self> {
        (0.0..=Self::MAX).contains(&dollars).then(|| Self((dollars * PER_DOLLAR).round() as u64))
    }

    /// The charge in US dollars.
    #[must_use]
    pub fn dollars(self) -> f64 {
        self.0 as f64 / PER_DOLLAR
    }

    /// The charge in US dollars, multiplied.
    #[must_use]
    pub fn times(self, factor: f64) -> Self {
        Self((self.0 as f64 * factor).round() as u64)
    }

    /// The sum of two charges.
    #[must_use]
    pub fn plus(self, more: Self) -> Self {
        Self(self.0.saturating_add(more.0))
    }

    /// The number of units; only to hold a charge in memory.
    pub(crate) fn units(self) -> u64 {
        self.0
    }

    pub(crate) fn from_units(units: u64) -> Self {
        Self(units)
    }
}

impl Serialize for StatedCost {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(self.dollars())
    }
}

impl<'de> Deserialize<'de> for StatedCost {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let dollars = f64::deserialize(deserializer)?;
        // Sums of attempts may exceed the maximum of one request.
        if dollars.is_finite() && dollars >= 0.0 {
            Ok(Self((dollars * PER_DOLLAR).round() as u64))
        } else {
            Err(de::Error::custom("a cost of 0 or more expected"))
        }
    }
}

/// The service tier at which a server answered. Vendors charge tiers at different prices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ServiceTier {
    /// The tier of the list price.
    Standard,
    /// OpenAI, Groq, Google: slower and cheaper.
    Flex,
    /// OpenAI, Anthropic, Google: faster and dearer.
    Priority,
    /// OpenAI: paid in advance.
    Scale,
    /// Groq: faster.
    Performance,
    /// A tier of another name.
    #[serde(other)]
    Other,
}

impl ServiceTier {
    /// Number of tiers.
    pub const COUNT: usize = 6;

    /// Reads the name of a tier in a reply or a request; `None` if it leaves the tier open or names the way of a batch.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        match name.trim().to_lowercase().as_str() {
            "" | "auto" | "batch" => None,
            "default" | "standard" | "standard_only" | "on_demand" => Some(Self::Standard),
            "flex" => Some(Self::Flex),
            "priority" => Some(Self::Priority),
            "scale" => Some(Self::Scale),
            "performance" => Some(Self::Performance),
            _ => Some(Self::Other),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charges_are_read_back_as_written() {
        for dollars in [0.0, 0.026, 0.13, 1.05e-6, 0.0037756, 99.5] {
            let cost = StatedCost::from_dollars(dollars).unwrap();
            let text = serde_json::to_string(&cost).unwrap();
            let parsed: StatedCost = serde_json::from_str(&text).unwrap();
            assert_eq!(parsed, cost, "{text}");
            assert!((parsed.dollars() - dollars).abs() < 1e-10, "{text}");
        }
        assert_eq!(serde_json::to_string(&StatedCost::from_dollars(0.13)).unwrap(), "0.13");
    }

    #[test]
    fn implausible_charges_are_rejected() {
        for dollars in [-0.01, f64::NAN, f64::INFINITY, 101.0] {
            assert_eq!(StatedCost::from_dollars(dollars), None, "{dollars}");
        }
        assert!(serde_json::from_str::<StatedCost>("-1").is_err());
    }
}
