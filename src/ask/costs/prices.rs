//! Prices of models per token: [`Prices`].
//!
//! Price factors of service tiers: [`TierFactors`].
//!
//! Upper bound on the tokens of a request: [`TokenBound`].

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::text::TomlFault;
use darkqa_base::types::{ServiceTier, Unstated, Usage};

/// Price of a model, in US dollars per million tokens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Price {
    /// Price of prompt tokens, including images, in US dollars per million.
    pub input: f64,
    /// Price of reply tokens, including hidden reasoning, in US dollars per million.
    pub output: f64,
    /// Price of cached prompt tokens, in US dollars per million; `None` if they cost as much as `input`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cached_input: Option<f64>,
    /// Tokens per image; `None` to use the rule of the model's family.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image_tokens: Option<u64>,
    /// Factors of the other service tiers; the numbers above are at the tier that is asked for.
    #[serde(skip)]
    pub tiers: TierFactors,
}

/// Ratio of a stated charge to the price of its tokens, or its inverse, up to which the charge is plausible. Chosen: a
/// cache and a batch make a prompt at most 20 times cheaper, and the dearest provider of a model costs about ten times
/// the cheapest.
const MAX_RATIO: f64 = 100.0;

impl Price {
    /// Cost of this many prompt and reply tokens, in US dollars.
    #[must_use]
    pub fn cost(&self, prompt: f64, reply: f64) -> f64 {
        (prompt * self.input + reply * self.output) / 1e6
    }

    /// Maximum cost of a request within a token bound, in US dollars.
    #[must_use]
    pub fn max_cost(&self, bound: TokenBound) -> f64 {
        let input = self.input.max(self.cached_input.unwrap_or(self.input));
        (bound.prompt as f64 * input + bound.reply as f64 * self.output) / 1e6
    }

    /// Charge for a request in US dollars: the charge that the server states, if it is plausible, else the price of its
    /// tokens.
    #[must_use]
    pub fn charged(&self, usage: Usage) -> f64 {
        self.charged_in_part(usage, 1.0)
    }

    /// Charge for a request whose tokens cost only a `share` of their price, as in a batch. A stated charge is what was
    /// charged in all.
    #[must_use]
    pub fn charged_in_part(&self, usage: Usage, share: f64) -> f64 {
        let list = share * self.list_charge(usage);
        stated_charge(usage, list).unwrap_or(list)
    }

    /// Price of the tokens of a request at its service tier, in US dollars. A token count that the server did not
    /// report counts as 0.
    #[must_use]
    pub fn list_charge(&self, usage: Usage) -> f64 {
        let prompt = tokens_or_zero(usage.prompt_tokens);
        let reply = tokens_or_zero(usage.completion_tokens);
        let cached = tokens_or_zero(usage.cached_tokens).min(prompt);
        let discount = self.input - self.cached_input.unwrap_or(self.input);
        let tier = self.tiers.factor(usage.service_tier);
        tier * (self.cost(prompt, reply) - cached * discount / 1e6)
    }

    /// The same price, as that of the service tier that is asked for, whatever its name.
    #[must_use]
    pub fn as_asked(self, tier: Option<&str>) -> Self {
        let kind = tier.and_then(ServiceTier::from_name);
        Self { tiers: self.tiers.relative_to(kind, 1.0), ..self }
    }

    /// The price at another tier, by its factor.
    fn times(self, factor: f64) -> Self {
        Self {
            input: factor * self.input,
            output: factor * self.output,
            cached_input: self.cached_input.map(|cached| factor * cached),
            ..self
        }
    }
}

/// The charge that the server states for a request whose tokens cost `list`, both in US dollars; `None` if it states
/// none, or one that is no plausible price of these tokens.
pub fn stated_charge(usage: Usage, list: f64) -> Option<f64> {
    let stated = usage.cost?.dollars();
    let is_plausible = list <= 0.0 || (list / MAX_RATIO..=list * MAX_RATIO).contains(&stated);
    is_plausible.then_some(stated)
}

fn tokens_or_zero(tokens: Option<u64>) -> f64 {
    tokens.unwrap_or(0) as f64
}

/// A dated table of prices by model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Prices {
    /// Date of the prices.
    pub as_of: String,
    /// Price in the Batch API, as a share of the normal price.
    pub batch: f64,
    models: BTreeMap<String, Price>,
    /// For models in `models`: versions, as in `gpt-4o-2024-08-06`, that the vendor's list gives no other price.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    versions: BTreeMap<String, Vec<String>>,
    /// Factors of the price by service tier, and by model in `models`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    tiers: BTreeMap<String, BTreeMap<String, f64>>,
    /// True for a table from `--prices`.
    #[serde(skip)]
    is_custom: bool,
}

impl Prices {
    /// The built-in table, `src/ask/prices.toml`.
    ///
    /// # Errors
    /// Never in practice: a test parses the table.
    pub fn built_in() -> Result<Self> {
        toml::from_str(include_str!("../prices.toml")).map_err(|e| Error::usage("src/ask/prices.toml", e.message()))
    }

    /// Reads a custom table in the format of the built-in one.
    ///
    /// # Errors
    /// If the file cannot be read or parsed, or a price or the batch share is negative or not finite.
    pub fn load(path: &Path) -> Result<Self> {
        let text = files::settings(path)?;
        let prices: Self = toml::from_str(&text).map_err(|e| {
            let TomlFault { line, problem } = TomlFault::new(&text, &e);
            invalid_table(path, &format!("line {line}: {problem}"))
        })?;
        let first_invalid = prices
            .models
            .iter()
            .flat_map(|(name, price)| {
                let cached = price.cached_input.unwrap_or(0.0);
                [price.input, price.output, cached].map(|number| (name.as_str(), number))
            })
            .chain([("batch", prices.batch)])
            .chain(prices.tiers.values().flatten().map(|(name, factor)| (name.as_str(), *factor)))
            .find(|(_, number)| !is_finite_and_not_negative(*number));
        if let Some((name, number)) = first_invalid {
            return Err(invalid_table(path, &format!("{name}: {number} is not a number of 0 or more")));
        }
        Ok(Self { is_custom: true, ..prices })
    }

    /// Key of a custom table in the settings of a manifest.
    pub const SETTING: &str = "prices";

    /// The table in the form of a manifest; `None` for the built-in table.
    pub fn setting(&self) -> Option<Value> {
        self.is_custom.then(|| serde_json::json!(self))
    }

    /// The table of a stored run: the custom table in its settings, or the built-in table.
    ///
    /// # Errors
    /// If the table in the settings cannot be parsed.
    pub fn from_settings(settings: &BTreeMap<String, Value>) -> Result<Self> {
        let Some(stored) = settings.get(Self::SETTING) else {
            return Self::built_in();
        };
        let prices: Self =
            serde_json::from_value(stored.clone()).map_err(|e| Error::data("the prices in the manifest", e))?;
        Ok(Self { is_custom: true, ..prices })
    }

    /// Source of the prices, as a phrase that follows "at".
    pub fn source(&self) -> String {
        let date = &self.as_of;
        if self.is_custom { format!("the prices of {date} of --prices") } else { format!("the list prices of {date}") }
    }

    /// Finds the price of a model at the standard tier; `None` if the table does not state it.
    #[must_use]
    pub fn find(&self, model: &str) -> Option<Price> {
        self.price(model, None).ok()
    }

    /// Finds the price of a model at the service tier that is asked for: by its full name, then by the name after the
    /// provider prefix (`openai/gpt-4o`). A name with a version (`gpt-4o-2024-08-06`) has the price of the name without
    /// it only if the table says so.
    ///
    /// # Errors
    /// The reason why the table has no such price.
    pub fn price(&self, model: &str, tier: Option<&str>) -> std::result::Result<Price, Unpriced> {
        let bare = model.rsplit('/').next().unwrap_or(model);
        let mut reason = Unpriced::Model;
        for name in [model, bare] {
            let listed = self.models.get_key_value(name);
            let listed = listed.or_else(|| self.find_versioned(name));
            if let Some((name, price)) = listed {
                return self.at_tier(name, *price, tier);
            }
            if let Some(alias) = self.alias(name) {
                reason = Unpriced::Version { alias: alias.to_owned() };
            }
        }
        Err(reason)
    }

    /// The price of a listed model at a service tier.
    fn at_tier(&self, name: &str, price: Price, tier: Option<&str>) -> std::result::Result<Price, Unpriced> {
        let stated = self.tiers.iter().filter_map(|(tier, models)| Some((tier.as_str(), *models.get(name)?)));
        let factors = TierFactors::new(stated.clone());
        let Some(asked) = tier else {
            return Ok(Price { tiers: factors, ..price });
        };
        let kind = ServiceTier::from_name(asked);
        let factor = match kind {
            None | Some(ServiceTier::Standard) => Some(1.0),
            Some(_) => {
                stated.clone().find(|(name, _)| name.eq_ignore_ascii_case(asked.trim())).map(|(_, factor)| factor)
            }
        };
        let factor = factor.ok_or_else(|| Unpriced::Tier { tier: asked.to_owned(), listed: name.to_owned() })?;
        Ok(Price { tiers: factors.relative_to(kind, factor), ..price.times(factor) })
    }

    /// The model that costs the same as `name`, by the list of its versions.
    fn find_versioned(&self, name: &str) -> Option<(&String, &Price)> {
        self.models.iter().find(|(model, _)| {
            let version = version_of(name, model);
            let versions = self.versions.get(*model);
            version.is_some_and(|version| {
                versions.is_some_and(|versions| versions.iter().any(|listed| listed == "all" || listed == version))
            })
        })
    }

    /// The listed model of which `name` is a version.
    fn alias(&self, name: &str) -> Option<&str> {
        self.models
            .keys()
            .filter(|model| version_of(name, model).is_some())
            .max_by_key(|model| model.len())
            .map(String::as_str)
    }
}

/// The reason why a table has no price of a model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Unpriced {
    /// The model is not in the table.
    Model,
    /// The table has the price of `alias`, and does not say that this version costs the same.
    Version { alias: String },
    /// The table has no factor for the service tier of the `listed` model.
    Tier { tier: String, listed: String },
}

impl Unpriced {
    /// The reason with the remedy, for a model and a table of this date.
    pub fn words(&self, model: &str, as_of: &str) -> String {
        match self {
            Self::Model => format!(
                "the price of {model} is not in the table of {as_of}; add it to your own table and name that with --prices FILE, or set \
                 price in a file of models"
            ),
            Self::Version { alias } => format!(
                "the table of {as_of} has a price of {alias}, and does not say that {model} costs the same; add {model} to your own table \
                 and name that with --prices FILE, or set price in a file of models"
            ),
            Self::Tier { tier, listed } => format!(
                "the table of {as_of} has no price of {model} at the service tier {tier:?}; add [tiers.{tier}] with {listed:?} = FACTOR \
                 to your own table and name that with --prices FILE, or set price in a file of models"
            ),
        }
    }
}

fn invalid_table(path: &Path, problem: &str) -> Error {
    let expected = "expected as-of = \"2026-11-20\", batch = 0.5 and [models] with lines like \
                            gpt-4o = { input = 2.5, output = 10 }";
    let problem = format!("{}: {problem}; {expected}", path.display());
    Error::usage("--prices", problem)
}

fn is_finite_and_not_negative(number: f64) -> bool {
    number.is_finite() && number >= 0.0
}

/// The version in a name that begins with a model's: a date, `latest`, or `preview` with or without a date. `None` for
/// another model: `preview-tts` has another price.
fn version_of<'n>(name: &'n str, model: &str) -> Option<&'n str> {
    let version = name.strip_prefix(model)?.strip_prefix(['-', '@'])?;
    let date = version.strip_prefix("preview").unwrap_or(version);
    let is_version = version == "latest"
        || version == "preview"
        || (date.len() >= 4 && date.chars().all(|c| c.is_ascii_digit() || c == '-'));
    is_version.then_some(version)
}

/// Factor of each service tier relative to the price that it belongs to; `None` if unknown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TierFactors([Option<f64>; ServiceTier::COUNT]);

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
    pub fn is_unknown(&self, tier: ServiceTier) -> bool {
        self.0[tier as usize].is_none()
    }
}

/// Upper bound on the tokens of one request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TokenBound {
    pub prompt: u64,
    /// Tokens of the reply, hidden reasoning included.
    pub reply: u64,
}

impl TokenBound {
    /// Returns the bound as the unreported tokens of one request.
    pub fn unstated(self) -> Unstated {
        Unstated { requests: 1, prompt_tokens: self.prompt, completion_tokens: self.reply }
    }

    /// Returns the bound on the counts that are missing from `usage`; reported counts become 0.
    ///
    /// Nothing is missing if the server states what it charges. Without prompt tokens (absent or 0), the server does
    /// not count tokens: 0 reply tokens are then also missing.
    #[must_use]
    pub fn missing_from(self, usage: Usage) -> Self {
        if usage.cost.is_some_and(|cost| cost.dollars() > 0.0) {
            return Self::default();
        }
        let prompt = usage.prompt_tokens.filter(|tokens| *tokens > 0);
        let reply = match (prompt, usage.completion_tokens) {
            (None, Some(0)) => None,
            (_, reply) => reply,
        };
        Self { prompt: prompt.map_or(self.prompt, |_| 0), reply: reply.map_or(self.reply, |_| 0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::StatedCost;

    #[test]
    fn the_built_in_table_is_complete() {
        let prices = Prices::built_in().unwrap();
        assert!(prices.models.len() > 50);
        assert!(prices.as_of.starts_with("20"));
    }

    fn input_price(prices: &Prices, model: &str) -> Option<f64> {
        prices.find(model).map(|price| price.input)
    }

    fn with_cached(usage: Usage, tokens: u64) -> Usage {
        Usage { cached_tokens: Some(tokens), ..usage }
    }

    #[test]
    fn versioned_names_have_the_price_of_their_model() {
        let prices = Prices::built_in().unwrap();
        assert_eq!(input_price(&prices, "gpt-4o"), Some(2.5));
        assert_eq!(input_price(&prices, "gpt-4o-2024-08-06"), Some(2.5));
        assert_eq!(input_price(&prices, "gpt-4-0613"), Some(30.0));
        assert_eq!(input_price(&prices, "gpt-4-1106-preview"), Some(10.0));
        assert_eq!(input_price(&prices, "openai/gpt-4o-mini-2024-07-18"), Some(0.15));
        assert_eq!(input_price(&prices, "claude-haiku-4-5-20251001"), Some(1.0));
        assert_eq!(input_price(&prices, "gpt-4o-2024-05-13"), Some(5.0));
        assert_eq!(input_price(&prices, "gemini-2.5-flash-preview-09-2025"), input_price(&prices, "gemini-2.5-flash"));
        for unknown in [
            "gpt-4o-2031-01-01",
            "gemini-2.5-flash-preview-04-17",
            "deepseek-v4-flash-0731",
            "gpt-4o-audio",
            "gpt-3",
            "my-model",
            "gpt-4o-",
            "gemini-2.5-flash-preview-tts",
        ] {
            assert_eq!(input_price(&prices, unknown), None, "{unknown}");
        }
        let price = prices.find("gpt-4o").unwrap();
        let usage = Usage { prompt_tokens: Some(1_000_000), completion_tokens: Some(100_000), ..Usage::default() };
        assert!((price.charged(usage) - 3.5).abs() < 1e-12);
        // Half of the prompt is cached and costs half the price. A count of cached tokens above the prompt is capped.
        assert!((price.charged(with_cached(usage, 500_000)) - 2.875).abs() < 1e-12);
        assert!((price.charged(with_cached(usage, u64::MAX)) - 2.25).abs() < 1e-12);
        let opus = prices.find("claude-opus-4-8").unwrap();
        assert!((opus.charged(usage) - opus.charged(with_cached(usage, 9))).abs() < 1e-12);
    }

    #[test]
    fn prices_follow_the_service_tier() {
        let prices = Prices::built_in().unwrap();
        let usage = |service_tier| Usage {
            prompt_tokens: Some(1_000_000),
            completion_tokens: Some(100_000),
            service_tier,
            ..Usage::default()
        };
        let priority = prices.price("gpt-4o", Some("priority")).unwrap();
        assert!((priority.input - 4.25).abs() < 1e-12);
        for (asked, answered, dollars) in [
            (None, None, 3.5),
            (None, Some(ServiceTier::Priority), 5.95),
            (None, Some(ServiceTier::Other), 3.5),
            (Some("priority"), None, 5.95),
            (Some("priority"), Some(ServiceTier::Priority), 5.95),
            (Some("priority"), Some(ServiceTier::Standard), 3.5),
            (Some("auto"), Some(ServiceTier::Priority), 5.95),
            (Some("default"), None, 3.5),
        ] {
            let price = prices.price("gpt-4o", asked).unwrap();
            let charged = price.charged(usage(answered));
            assert!((charged - dollars).abs() < 1e-9, "{asked:?} {answered:?}: {charged}");
        }
        let reason = prices.price("gpt-4o", Some("turbo")).unwrap_err();
        assert!(matches!(reason, Unpriced::Tier { .. }), "{reason:?}");
        let reason = prices.price("gpt-4o-2031-01-01", None).unwrap_err();
        assert_eq!(reason, Unpriced::Version { alias: "gpt-4o".to_owned() });
    }

    #[test]
    fn plausible_stated_charges_count() {
        let prices = Prices::built_in().unwrap();
        let price = prices.find("gpt-4o").unwrap();
        let charged = |dollars: f64, share: f64| {
            let usage = Usage {
                prompt_tokens: Some(10_000),
                completion_tokens: Some(100),
                cost: StatedCost::from_dollars(dollars),
                ..Usage::default()
            };
            price.charged_in_part(usage, share)
        };
        // The tokens cost $0.026.
        for (stated, share, dollars) in [
            (0.13, 1.0, 0.13),
            (0.013, 1.0, 0.013),
            (0.0, 1.0, 0.026),
            (2.7, 1.0, 0.026),
            (0.02, 0.5, 0.02),
            (0.0, 0.5, 0.013),
        ] {
            let found = charged(stated, share);
            assert!((found - dollars).abs() < 1e-9, "{stated} {share}: {found}");
        }
    }

    fn load_text(path: &Path, text: &str) -> Result<Prices> {
        std::fs::write(path, text).unwrap();
        Prices::load(path)
    }

    #[test]
    fn invalid_custom_tables_are_rejected() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let good =
            "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\n\"m/x\" = { input = 1, output = 2, image-tokens = 900 }\n";
        let price = load_text(file.path(), good).unwrap().find("m/x").unwrap();
        assert_eq!((price.input, price.image_tokens), (1.0, Some(900)));
        for wrong in [
            "",
            &good.replace("input = 1", "input = -1"),
            &good.replace("input = 1", "inptu = 1"),
            &good.replace("batch = 0.5", "batch = nan"),
            "models = 3",
        ] {
            let error = load_text(file.path(), wrong).unwrap_err().to_string();
            assert!(error.starts_with("--prices: "), "{error}");
            assert!(error.contains("gpt-4o ="), "{error}");
        }
    }

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
