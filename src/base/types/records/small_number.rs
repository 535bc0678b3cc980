//! Numbers of records in four bytes: [`SmallNumber`], [`Tokens`].

use serde::{Deserialize, Deserializer};

use crate::types::replies::{ServiceTier, StatedCost, Usage};

/// An optional number in four bytes. Larger numbers become the maximum, 4,294,967,294.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SmallNumber(u32);

impl SmallNumber {
    /// An unknown number.
    pub const UNKNOWN: Self = Self(u32::MAX);

    /// The number as it is kept in memory.
    pub(super) fn to_word(self) -> u32 {
        self.0
    }

    /// The number from [`to_word`](Self::to_word).
    pub(super) fn from_word(word: u32) -> Self {
        Self(word)
    }

    /// The number; `None` if it is not known.
    pub fn get(self) -> Option<u64> {
        (self != Self::UNKNOWN).then_some(u64::from(self.0))
    }
}

impl Default for SmallNumber {
    fn default() -> Self {
        Self::UNKNOWN
    }
}

impl From<Option<u64>> for SmallNumber {
    fn from(number: Option<u64>) -> Self {
        let most = u64::from(u32::MAX) - 1;
        number.map_or(Self::UNKNOWN, |number| Self(number.min(most) as u32))
    }
}

/// Reads a number or `null`.
impl<'de> Deserialize<'de> for SmallNumber {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Option::<u64>::deserialize(deserializer).map(Self::from)
    }
}

/// The tokens and the cost that a server charged, as a [`Usage`] in 24 bytes, without the total.
#[derive(Debug, Clone, Copy, Default)]
pub struct Tokens {
    prompt: SmallNumber,
    completion: SmallNumber,
    cached: SmallNumber,
    /// Lower and upper half of the cost in units of [`StatedCost`].
    cost: [u32; 2],
    /// False if the server stated no cost.
    has_cost: bool,
    tier: Option<ServiceTier>,
}

impl From<Option<Usage>> for Tokens {
    fn from(usage: Option<Usage>) -> Self {
        let usage = usage.unwrap_or_default();
        Self {
            prompt: usage.prompt_tokens.into(),
            completion: usage.completion_tokens.into(),
            cached: usage.cached_tokens.into(),
            cost: {
                let units = usage.cost.map_or(0, StatedCost::units);
                [units as u32, (units >> 32) as u32]
            },
            has_cost: usage.cost.is_some(),
            tier: usage.service_tier,
        }
    }
}

/// All tiers, by their numbers in [`Tokens::to_words`].
const TIERS: [ServiceTier; ServiceTier::COUNT] = [
    ServiceTier::Standard,
    ServiceTier::Flex,
    ServiceTier::Priority,
    ServiceTier::Scale,
    ServiceTier::Performance,
    ServiceTier::Other,
];

impl Tokens {
    /// The tokens and the cost as numbers; the last one has 1 if there is a cost, and twice the number of the tier,
    /// from 1.
    pub(super) fn to_words(self) -> [u32; 6] {
        let [lower, upper] = self.cost;
        let tier = self.tier.and_then(|tier| TIERS.iter().position(|known| *known == tier));
        let tier = tier.map_or(0, |place| place as u32 + 1);
        let Self { prompt, completion, cached, has_cost, .. } = self;
        [prompt.0, completion.0, cached.0, lower, upper, u32::from(has_cost) + 2 * tier]
    }

    /// The tokens from [`to_words`](Self::to_words); `None` if the numbers are none of these.
    pub(super) fn from_words([prompt, completion, cached, lower, upper, cost_and_tier]: [u32; 6]) -> Option<Self> {
        Some(Self {
            prompt: SmallNumber(prompt),
            completion: SmallNumber(completion),
            cached: SmallNumber(cached),
            cost: [lower, upper],
            has_cost: cost_and_tier % 2 == 1,
            tier: match cost_and_tier / 2 {
                0 => None,
                number => Some(*TIERS.get(number as usize - 1)?),
            },
        })
    }

    /// The tokens; `None` if the server stated no number.
    pub fn usage(self) -> Option<Usage> {
        let usage = Usage {
            prompt_tokens: self.prompt.get(),
            completion_tokens: self.completion.get(),
            cached_tokens: self.cached.get(),
            total_tokens: None,
            cost: self.has_cost.then(|| {
                let [lower, upper] = self.cost.map(u64::from);
                StatedCost::from_units(upper << 32 | lower)
            }),
            service_tier: self.tier,
        };
        (usage != Usage::default()).then_some(usage)
    }
}

/// Reads a [`Usage`] or `null`.
impl<'de> Deserialize<'de> for Tokens {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Option::<Usage>::deserialize(deserializer).map(Self::from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_are_read_back() {
        let usage = Usage {
            prompt_tokens: Some(1200),
            completion_tokens: None,
            cached_tokens: Some(0),
            total_tokens: None,
            cost: StatedCost::from_dollars(7.25),
            service_tier: Some(ServiceTier::Priority),
        };
        assert_eq!(Tokens::from(Some(usage)).usage(), Some(usage));
        assert_eq!(Tokens::from(None).usage(), None);
        let large = Usage { prompt_tokens: Some(u64::MAX), ..usage };
        let capped = Tokens::from(Some(large)).usage().unwrap();
        assert_eq!(capped.prompt_tokens, Some(u64::from(u32::MAX) - 1));
        let parsed: Tokens = serde_json::from_str(r#"{"prompt_tokens":3}"#).unwrap();
        assert_eq!(parsed.usage().and_then(|usage| usage.prompt_tokens), Some(3));
        let parsed: Tokens = serde_json::from_str("null").unwrap();
        assert_eq!(parsed.usage(), None);
    }
}
