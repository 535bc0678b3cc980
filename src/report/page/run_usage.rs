//! Usage of a run: [`RunUsage`].
//!
//! Data of the page other than the findings: [`PageInputs`].

use std::collections::{BTreeSet, HashMap, HashSet};

use super::prompts::RunPrompts;
use crate::sentences::with_separators;
use darkqa_base::error::Result;
use darkqa_base::types::manifests::RunManifest;
use darkqa_base::types::text::counted;
use darkqa_base::types::{ChoiceDetail, QuestionId, RunQuestion, TextPlace, Thumbnail, TrialRef, Usage};

/// Usage of a run's trials at endpoints: requests, tokens, bytes of images, latency, and the model names that the
/// servers returned. Built-in models need no endpoint.
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
    /// Median and 95 % quantile of the duration of each trial's last request, in milliseconds; `None` if no duration is
    /// known.
    latency: Option<[u64; 2]>,
    /// Model names that the servers returned.
    served: BTreeSet<String>,
}

impl RunUsage {
    /// Sums the usage of trials. `is_built_in` returns true for the name of a model that needs no endpoint.
    pub fn new<'t>(
        trials: impl Iterator<Item = TrialRef<'t, ChoiceDetail>>,
        is_built_in: impl Fn(&str) -> bool,
    ) -> Self {
        let (mut usage, mut latencies) = (Self::default(), Vec::new());
        for trial in trials {
            if is_built_in(trial.model()) {
                usage.built_in += 1;
                continue;
            }
            let tokens: Usage = trial.usage().unwrap_or_default();
            usage.trials += 1;
            usage.requests += u64::from(trial.attempts());
            usage.prompt_tokens = usage.prompt_tokens.saturating_add(tokens.prompt_tokens.unwrap_or(0));
            usage.completion_tokens = usage.completion_tokens.saturating_add(tokens.completion_tokens.unwrap_or(0));
            usage.image_bytes = usage.image_bytes.saturating_add(trial.images().map_or(0, |images| images.bytes));
            latencies.extend(trial.latency_ms().map(|ms| ms as u32));
            if let Some(model) = trial.served_model()
                && !usage.served.contains(model)
            {
                usage.served.insert(model.to_owned());
            }
        }
        usage.latency = median_and_95(&mut latencies);
        usage
    }

    /// Facts about the usage: names and values. Unknown ones are left out.
    pub(super) fn facts(&self) -> Vec<(String, String)> {
        let latency = self.latency.map(|[median, most]| format!("median {median} ms, 95 % within {most} ms"));
        let served: Vec<&str> = self.served.iter().map(String::as_str).collect();
        let trials = counted(self.trials, "trial");
        let rows = [
            (
                "requests",
                match self.built_in {
                    0 => format!("{} for {trials}", self.requests),
                    built_in => format!(
                        "{} for {trials}; {} of built-in models took none",
                        self.requests,
                        counted(built_in, "trial")
                    ),
                },
            ),
            (
                "tokens",
                match [self.prompt_tokens, self.completion_tokens] {
                    [0, 0] => String::new(),
                    tokens => {
                        let [prompts, replies] = tokens.map(with_separators);
                        format!("{prompts} of prompts, {replies} of replies")
                    }
                },
            ),
            ("image bytes", if self.image_bytes == 0 { String::new() } else { with_separators(self.image_bytes) }),
            ("latency", latency.unwrap_or_default()),
            ("served as", served.join(", ")),
        ];
        let known = rows.into_iter().filter(|(_, value)| !value.is_empty());
        known.map(|(name, value)| (name.to_owned(), value)).collect()
    }
}

/// Median and 95 % quantile by nearest rank; `None` without values. The values are reordered.
fn median_and_95(values: &mut [u32]) -> Option<[u64; 2]> {
    let last = values.len().checked_sub(1)?;
    Some([0.5, 0.95].map(|share| {
        let rank = (last as f64 * share).round() as usize;
        u64::from(*values.select_nth_unstable(rank).1)
    }))
}

/// A run on the page.
#[derive(Debug, Clone)]
pub struct PageRun<'a> {
    /// Name of the run: its folder.
    pub name: String,
    /// Folder of the run, as for use in a command; an absolute path is shortened to `DIR/` and the folder's name.
    pub folder: String,
    pub manifest: &'a RunManifest,
    /// Requests, tokens and times; `None` if the report does not count them.
    pub usage: Option<RunUsage>,
    /// Text for the cost of the replies; `None` if it is unknown.
    pub cost: Option<String>,
}

/// Function that reads questions by id.
pub(super) type ReadQuestions<'a> = Box<dyn Fn(&HashSet<&QuestionId>) -> Result<HashMap<QuestionId, RunQuestion>> + 'a>;

/// Data of the page other than the findings.
pub struct PageInputs<'a> {
    /// Runs on the page.
    pub runs: Vec<PageRun<'a>>,
    /// Reads the wanted questions, as far as the runs store them.
    pub questions: ReadQuestions<'a>,
    /// Thumbnails of the images; empty if the runs do not store them.
    pub thumbnails: &'a [Thumbnail],
    /// Cost of the trials in US dollars, as far as it is known, by the place of their texts.
    pub costs: Box<dyn Fn() -> Result<HashMap<TextPlace, f64>> + 'a>,
    /// Prompts of the runs; `None` if the runs do not store them, or have different ones.
    pub prompts: Option<RunPrompts>,
    /// Reads the text of a reply, of a refusal, or of an error message.
    pub texts: Box<dyn Fn(TextPlace) -> Result<String> + 'a>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_trial_is_singular() {
        let usage = RunUsage { requests: 1, trials: 1, built_in: 1, ..RunUsage::default() };
        let expected = "1 for 1 trial; 1 trial of built-in models took none";
        assert_eq!(usage.facts()[0].1, expected);
    }

    #[test]
    fn quantiles_ignore_the_order_of_values() {
        let mut values: Vec<u32> = (0..101).map(|value| (value * 37) % 101).collect();
        assert_eq!(median_and_95(&mut values), Some([50, 95]));
        assert_eq!(median_and_95(&mut [7]), Some([7, 7]));
        assert_eq!(median_and_95(&mut []), None);
    }
}
