//! Prices of models per token: [`Prices`].

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::token_bound::TokenBound;
use crate::error::{Error, Result};
use crate::files::reading;
use crate::types::Usage;
use crate::types::text::TomlFault;

/// Price of a model, in US dollars per million tokens.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Price {
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
}

impl Price {
    /// Cost of this many prompt and reply tokens, in US dollars.
    #[must_use]
    pub(crate) fn cost(&self, prompt: f64, reply: f64) -> f64 {
        (prompt * self.input + reply * self.output) / 1e6
    }

    /// Maximum cost of a request within a token bound, in US dollars.
    #[must_use]
    pub(crate) fn max_cost(&self, bound: TokenBound) -> f64 {
        let input = self.input.max(self.cached_input.unwrap_or(self.input));
        (bound.prompt as f64 * input + bound.reply as f64 * self.output) / 1e6
    }

    /// Cost of a request from its reported usage, in US dollars. A token count that the server did not report counts as 0.
    #[must_use]
    pub(crate) fn charged(&self, usage: Usage) -> f64 {
        let prompt = tokens_or_zero(usage.prompt_tokens);
        let reply = tokens_or_zero(usage.completion_tokens);
        let cached = tokens_or_zero(usage.cached_tokens).min(prompt);
        let discount = self.input - self.cached_input.unwrap_or(self.input);
        self.cost(prompt, reply) - cached * discount / 1e6
    }
}

fn tokens_or_zero(tokens: Option<u64>) -> f64 {
    tokens.unwrap_or(0) as f64
}

/// A dated table of prices by model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct Prices {
    /// Date of the prices.
    pub as_of: String,
    /// Price in the Batch API, as a share of the normal price.
    pub batch: f64,
    models: BTreeMap<String, Price>,
    /// True for a table from `--prices`.
    #[serde(skip)]
    is_custom: bool,
}

impl Prices {
    /// The built-in table, `src/ask/prices.toml`.
    ///
    /// # Errors
    /// Never in practice: a test parses the table.
    pub(crate) fn built_in() -> Result<Self> {
        toml::from_str(include_str!("../prices.toml"))
            .map_err(|e| Error::usage("src/ask/prices.toml", e.message()))
    }

    /// Reads a custom table in the format of the built-in one.
    ///
    /// # Errors
    /// If the file cannot be read or parsed, or a price or the batch share is negative or not finite.
    pub(crate) fn load(path: &Path) -> Result<Self> {
        let text = reading::settings(path)?;
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
            .find(|(_, number)| !is_finite_and_not_negative(*number));
        if let Some((name, number)) = first_invalid {
            return Err(invalid_table(
                path,
                &format!("{name}: {number} is not a number of 0 or more"),
            ));
        }
        Ok(Self {
            is_custom: true,
            ..prices
        })
    }

    /// Key of a custom table in the settings of a manifest.
    pub(crate) const SETTING: &str = "prices";

    /// The table in the form of a manifest; `None` for the built-in table.
    pub(crate) fn setting(&self) -> Option<Value> {
        self.is_custom.then(|| serde_json::json!(self))
    }

    /// The table of a stored run: the custom table in its settings, or the built-in table.
    ///
    /// # Errors
    /// If the table in the settings cannot be parsed.
    pub(crate) fn from_settings(settings: &BTreeMap<String, Value>) -> Result<Self> {
        let Some(stored) = settings.get(Self::SETTING) else {
            return Self::built_in();
        };
        let prices: Self = serde_json::from_value(stored.clone())
            .map_err(|e| Error::data("the prices in the manifest", e))?;
        Ok(Self {
            is_custom: true,
            ..prices
        })
    }

    /// Source of the prices, as a phrase that follows "at".
    pub(crate) fn source(&self) -> String {
        let date = &self.as_of;
        if self.is_custom {
            format!("the prices of {date} of --prices")
        } else {
            format!("the list prices of {date}")
        }
    }

    /// Finds the price of a model: by its full name, then by the name after the provider prefix (`openai/gpt-4o`), each first exactly and
    /// then without a version suffix (`gpt-4o-2024-08-06`).
    #[must_use]
    pub(crate) fn find(&self, model: &str) -> Option<Price> {
        let bare = model.rsplit('/').next().unwrap_or(model);
        [model, bare].into_iter().find_map(|name| {
            self.models
                .get(name)
                .or_else(|| self.find_unversioned(name))
                .copied()
        })
    }

    /// Price of the model whose name is `name` without a version suffix.
    fn find_unversioned(&self, name: &str) -> Option<&Price> {
        self.models
            .iter()
            .find(|(model, _)| name.strip_prefix(model.as_str()).is_some_and(is_version))
            .map(|(_, price)| price)
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

/// True if the suffix of a model name is a version: a date, `latest`, or `preview` with or without a date. `preview-tts` is another model
/// with another price.
fn is_version(suffix: &str) -> bool {
    suffix.strip_prefix(['-', '@']).is_some_and(|version| {
        let date = version.strip_prefix("preview").unwrap_or(version);
        version == "latest"
            || version == "preview"
            || (date.len() >= 4 && date.chars().all(|c| c.is_ascii_digit() || c == '-'))
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

    fn input_price(prices: &Prices, model: &str) -> Option<f64> {
        prices.find(model).map(|price| price.input)
    }

    fn with_cached(usage: Usage, tokens: u64) -> Usage {
        Usage {
            cached_tokens: Some(tokens),
            ..usage
        }
    }

    #[test]
    fn versioned_names_have_the_price_of_their_model() {
        let prices = Prices::built_in().unwrap();
        assert_eq!(input_price(&prices, "gpt-4o"), Some(2.5));
        assert_eq!(input_price(&prices, "gpt-4o-2024-08-06"), Some(2.5));
        assert_eq!(input_price(&prices, "gpt-4-0613"), Some(30.0));
        assert_eq!(input_price(&prices, "gpt-4-1106-preview"), Some(10.0));
        assert_eq!(
            input_price(&prices, "openai/gpt-4o-mini-2024-07-18"),
            Some(0.15)
        );
        assert_eq!(input_price(&prices, "claude-haiku-4-5-20251001"), Some(1.0));
        assert_eq!(
            input_price(&prices, "gemini-2.5-flash-preview-04-17"),
            input_price(&prices, "gemini-2.5-flash")
        );
        for unknown in [
            "gpt-4o-audio",
            "gpt-3",
            "my-model",
            "gpt-4o-",
            "gemini-2.5-flash-preview-tts",
        ] {
            assert_eq!(input_price(&prices, unknown), None, "{unknown}");
        }
        let price = prices.find("gpt-4o").unwrap();
        let usage = Usage {
            prompt_tokens: Some(1_000_000),
            completion_tokens: Some(100_000),
            cached_tokens: None,
            total_tokens: None,
        };
        assert!((price.charged(usage) - 3.5).abs() < 1e-12);
        // Half of the prompt is cached and costs half the price. A count of cached tokens above the prompt is capped.
        assert!((price.charged(with_cached(usage, 500_000)) - 2.875).abs() < 1e-12);
        assert!((price.charged(with_cached(usage, u64::MAX)) - 2.25).abs() < 1e-12);
        let opus = prices.find("claude-opus-4-8").unwrap();
        assert!((opus.charged(usage) - opus.charged(with_cached(usage, 9))).abs() < 1e-12);
    }

    fn load_text(path: &Path, text: &str) -> Result<Prices> {
        std::fs::write(path, text).unwrap();
        Prices::load(path)
    }

    #[test]
    fn invalid_custom_tables_are_rejected() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let good = "as-of = \"2026-01-01\"\nbatch = 0.5\n[models]\n\"m/x\" = { input = 1, output = 2, image-tokens = 900 }\n";
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
}
