//! The prices of models: [`Prices`].

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::token_bound::TokenBound;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::types::Usage;
use crate::types::toml_fault::TomlFault;

/// The price of a model, in dollars per million tokens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Price {
    /// The price of prompts, images included, in dollars per million tokens.
    pub input: f64,
    /// The price of replies, hidden reasoning included, in dollars per million tokens.
    pub output: f64,
    /// The price of what the server had in its cache, in dollars per million tokens; `None` if it is that of `input`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cached_input: Option<f64>,
    /// The number of tokens of an image; `None` to use the rule of the model's family.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image_tokens: Option<u64>,
}

impl Price {
    /// The price in dollars of these numbers of prompt and reply tokens.
    #[must_use]
    pub(crate) fn cost(&self, prompt: f64, reply: f64) -> f64 {
        (prompt * self.input + reply * self.output) / 1e6
    }

    /// The most that a request within a bound costs, in dollars.
    #[must_use]
    pub(crate) fn most(&self, bound: TokenBound) -> f64 {
        let input = self.input.max(self.cached_input.unwrap_or(self.input));
        (bound.prompt as f64 * input + bound.reply as f64 * self.output) / 1e6
    }

    /// The price in dollars of a request; tokens that the server did not state count as 0.
    #[must_use]
    pub(crate) fn charged(&self, usage: Usage) -> f64 {
        let tokens = |tokens: Option<u64>| tokens.unwrap_or(0) as f64;
        let prompt = tokens(usage.prompt_tokens);
        let cached = tokens(usage.cached_tokens).min(prompt);
        let saved = self.input - self.cached_input.unwrap_or(self.input);
        self.cost(prompt, tokens(usage.completion_tokens)) - cached * saved / 1e6
    }
}

/// A table of prices by model, with its date.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Prices {
    /// The date of the prices.
    pub as_of: String,
    /// The share of the price that the Batch API charges.
    pub batch: f64,
    models: BTreeMap<String, Price>,
    /// Whether it is a table of the user (`--prices`).
    #[serde(skip)]
    is_own: bool,
}

impl Prices {
    /// The table that comes with the program, `src/ask/prices.toml`.
    ///
    /// # Errors
    /// None in practice: a test reads the table.
    pub(crate) fn built_in() -> Result<Self> {
        toml::from_str(include_str!("prices.toml"))
            .map_err(|e| Error::usage("src/ask/prices.toml", e.message()))
    }

    /// Reads a custom table in the form of the built-in one.
    ///
    /// # Errors
    /// If it cannot be read, or a price is negative or not finite.
    pub(crate) fn load(path: &Path) -> Result<Self> {
        let text = reading::settings(path)?;
        let wrong = |problem: String| {
            let expected = "expected as-of = \"2026-11-20\", batch = 0.5 and [models] with lines like \
                            gpt-4o = { input = 2.5, output = 10 }";
            let problem = format!("{}: {problem}; {expected}", path.display());
            Error::usage("--prices", problem)
        };
        let prices: Self = toml::from_str(&text).map_err(|e| {
            let TomlFault { line, problem } = TomlFault::new(&text, &e);
            wrong(format!("line {line}: {problem}"))
        })?;
        let numbers = prices.models.iter().flat_map(|(name, price)| {
            let cached = price.cached_input.unwrap_or(0.0);
            [price.input, price.output, cached].map(|n| (name.as_str(), n))
        });
        let is_price = |n: f64| n.is_finite() && n >= 0.0;
        let mut numbers = numbers.chain([("batch", prices.batch)]);
        if let Some((name, number)) = numbers.find(|(_, n)| !is_price(*n)) {
            return Err(wrong(format!(
                "{name}: {number} is not a number of 0 or more"
            )));
        }
        drop(numbers);
        Ok(Self {
            is_own: true,
            ..prices
        })
    }

    /// The key of the settings in a manifest under which a run keeps the user's table.
    pub(crate) const SETTING: &str = "prices";

    /// The table as a manifest keeps it; `None` for the built-in one.
    pub(crate) fn setting(&self) -> Option<Value> {
        self.is_own.then(|| serde_json::json!(self))
    }

    /// The table that a run had: its own, if its settings have one, else the built-in one.
    ///
    /// # Errors
    /// If the table in the settings is broken.
    pub(crate) fn from_settings(settings: &BTreeMap<String, Value>) -> Result<Self> {
        let Some(own) = settings.get(Self::SETTING) else {
            return Self::built_in();
        };
        let read: Self = serde_json::from_value(own.clone())
            .map_err(|e| Error::data("the prices in the manifest", e))?;
        Ok(Self {
            is_own: true,
            ..read
        })
    }

    /// The source of the prices, in words that follow "at".
    pub(crate) fn source(&self) -> String {
        let date = &self.as_of;
        if self.is_own {
            format!("the prices of {date} of --prices")
        } else {
            format!("the list prices of {date}")
        }
    }

    /// The price of a model: by its name, by the name after a provider's (`openai/gpt-4o`), or by the name without a version
    /// (`gpt-4o-2024-08-06`). `None` if the table has none of these.
    #[must_use]
    pub(crate) fn find(&self, model: &str) -> Option<Price> {
        let bare = model.rsplit('/').next().unwrap_or(model);
        [model, bare].into_iter().find_map(|name| {
            let exact = self.models.get(name).copied();
            exact.or_else(|| {
                let mut models = self.models.iter();
                let unversioned =
                    models.find(|(known, _)| name.strip_prefix(&***known).is_some_and(is_version));
                unversioned.map(|(_, price)| *price)
            })
        })
    }
}

/// Whether the rest of a model's name is only a version: a date, `latest` or `preview`.
fn is_version(rest: &str) -> bool {
    rest.strip_prefix(['-', '@']).is_some_and(|version| {
        version == "latest"
            || version.starts_with("preview")
            || (version.len() >= 4 && version.chars().all(|c| c.is_ascii_digit() || c == '-'))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_table_is_complete() {
        let prices = Prices::built_in().unwrap();
        assert!(prices.models.len() > 50);
        assert!(prices.as_of.starts_with("20"));
    }

    #[test]
    fn a_version_has_the_price_of_its_model() {
        let prices = Prices::built_in().unwrap();
        let input = |model| prices.find(model).map(|price| price.input);
        assert_eq!(input("gpt-4o"), Some(2.5));
        assert_eq!(input("gpt-4o-2024-08-06"), Some(2.5));
        assert_eq!(input("gpt-4-0613"), Some(30.0));
        assert_eq!(input("gpt-4-1106-preview"), Some(10.0));
        assert_eq!(input("openai/gpt-4o-mini-2024-07-18"), Some(0.15));
        assert_eq!(input("claude-haiku-4-5-20251001"), Some(1.0));
        for unknown in ["gpt-4o-audio", "gpt-3", "my-model", "gpt-4o-"] {
            assert_eq!(input(unknown), None, "{unknown}");
        }
        let price = prices.find("gpt-4o").unwrap();
        let usage = Usage {
            prompt_tokens: Some(1_000_000),
            completion_tokens: Some(100_000),
            cached_tokens: None,
            total_tokens: None,
        };
        assert!((price.charged(usage) - 3.5).abs() < 1e-12);
        // Half of the prompt from the cache, at half the price; a server cannot cache more than the prompt.
        let cached = |tokens| Usage {
            cached_tokens: Some(tokens),
            ..usage
        };
        assert!((price.charged(cached(500_000)) - 2.875).abs() < 1e-12);
        assert!((price.charged(cached(u64::MAX)) - 2.25).abs() < 1e-12);
        let opus = prices.find("claude-opus-4-8").unwrap();
        assert!((opus.charged(usage) - opus.charged(cached(9))).abs() < 1e-12);
    }

    #[test]
    fn a_custom_table_is_checked() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let load = |text: &str| {
            std::fs::write(file.path(), text).unwrap();
            Prices::load(file.path())
        };
        let good = "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\n\"m/x\" = { input = 1, output = 2, image-tokens = 900 }\n";
        let price = load(good).unwrap().find("m/x").unwrap();
        assert_eq!((price.input, price.image_tokens), (1.0, Some(900)));
        for wrong in [
            "",
            &good.replace("input = 1", "input = -1"),
            &good.replace("input = 1", "inptu = 1"),
            &good.replace("batch = 0.5", "batch = nan"),
            "models = 3",
        ] {
            let error = load(wrong).unwrap_err().to_string();
            assert!(error.starts_with("--prices: "), "{error}");
            assert!(error.contains("gpt-4o ="), "{error}");
        }
    }
}
