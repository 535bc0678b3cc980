//! The usage of a run's trials: [`RunUsage`].

use std::collections::BTreeSet;

use crate::types::{ChoiceDetail, TrialRef, Usage};

/// The usage of a run's trials at endpoints: requests, tokens, bytes of images, waiting, and the models that the servers named.
/// Built-in models take none of these.
#[derive(Debug, Clone, Default)]
pub struct RunUsage {
    /// Number of trials of models at endpoints.
    trials: usize,
    /// Number of trials of built-in models.
    built_in: usize,
    requests: u64,
    prompt_tokens: u64,
    completion_tokens: u64,
    image_bytes: u64,
    /// The median and the 95 % quantile of the duration of the last tries in milliseconds; `None` if none is known.
    latency: Option<[u64; 2]>,
    served: BTreeSet<String>,
}

impl RunUsage {
    /// The sums over some trials; `is_built_in` says of a model's name whether it is asked at no endpoint.
    pub(crate) fn new<'t>(
        trials: impl Iterator<Item = TrialRef<'t, ChoiceDetail>>,
        is_built_in: impl Fn(&str) -> bool,
    ) -> Self {
        let (mut usage, mut waits) = (Self::default(), Vec::new());
        for trial in trials {
            if is_built_in(trial.model()) {
                usage.built_in += 1;
                continue;
            }
            let tokens: Usage = trial.usage().unwrap_or_default();
            usage.trials += 1;
            usage.requests += u64::from(trial.attempts());
            usage.prompt_tokens = usage
                .prompt_tokens
                .saturating_add(tokens.prompt_tokens.unwrap_or(0));
            usage.completion_tokens = usage
                .completion_tokens
                .saturating_add(tokens.completion_tokens.unwrap_or(0));
            usage.image_bytes = usage
                .image_bytes
                .saturating_add(trial.images().map_or(0, |images| images.bytes));
            waits.extend(trial.latency_ms().map(|ms| ms as u32));
            if let Some(model) = trial.served_model()
                && !usage.served.contains(model)
            {
                usage.served.insert(model.to_owned());
            }
        }
        usage.latency = quantiles(&mut waits);
        usage
    }

    /// Rows of names and values.
    pub(super) fn facts(&self) -> Vec<(String, String)> {
        let [median, most] = match self.latency {
            None => ["–".to_owned(), "–".to_owned()],
            Some(latency) => latency.map(|ms| format!("{ms} ms")),
        };
        let served: Vec<&str> = self.served.iter().map(String::as_str).collect();
        let rows = [
            (
                "requests",
                match self.built_in {
                    0 => format!("{} for {} trials", self.requests, self.trials),
                    own => format!(
                        "{} for {} trials; {own} trials of built-in models took none",
                        self.requests, self.trials
                    ),
                },
            ),
            (
                "tokens",
                format!(
                    "{} of prompts, {} of replies",
                    self.prompt_tokens, self.completion_tokens
                ),
            ),
            ("image bytes", self.image_bytes.to_string()),
            ("latency", format!("median {median}, 95 % within {most}")),
            ("served as", served.join(", ")),
        ];
        rows.into_iter()
            .map(|(name, value)| (name.to_owned(), value))
            .collect()
    }
}

/// The median and the 95 % quantile.
fn quantiles(waits: &mut [u32]) -> Option<[u64; 2]> {
    let last = waits.len().checked_sub(1)?;
    let mut at = |share: f64| {
        let place = (last as f64 * share).round() as usize;
        u64::from(*waits.select_nth_unstable(place).1)
    };
    Some([at(0.5), at(0.95)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_of_sorted_waits() {
        let mut waits: Vec<u32> = (0..101).map(|wait| (wait * 37) % 101).collect();
        assert_eq!(quantiles(&mut waits), Some([50, 95]));
        assert_eq!(quantiles(&mut [7]), Some([7, 7]));
        assert_eq!(quantiles(&mut []), None);
    }
}
