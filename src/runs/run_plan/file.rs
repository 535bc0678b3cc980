//! The content of `plan.json`: [`PlanFile`].

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::report::forecast::Forecast;
use crate::types::Digest;
use crate::types::manifests::Identity;

/// The schema of a plan.
pub(super) const SCHEMA: &str = "darkqa.plan/1";
/// The file with the facts about the plan and the digests of the others. It is written last.
pub(super) const PLAN_FILE: &str = "plan.json";
/// The questions that are asked, in the form of a run's.
pub(super) const QUESTIONS: &str = "questions.jsonl";
/// The frames that questions are about.
pub(super) const FRAMES: &str = "frames.jsonl";

/// The content of `plan.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct PlanFile {
    pub(super) schema: String,
    /// The version of this program that wrote it.
    pub(super) version: String,
    /// Data, questions and light: a run that takes the plan has the same. Models and enhancers are not in it.
    pub(super) identity: Identity,
    /// The digest of each other file.
    pub(super) files: BTreeMap<String, Digest>,
    pub(super) counts: PlanCounts,
    /// The estimate for the whole run with the models and enhancers of the call that wrote the plan.
    pub(super) estimate: PlanEstimate,
    /// The models of that call.
    pub(super) models: Vec<String>,
    /// The words of that call, without `plan` and `--shard`; `None` if one of them may hold a secret.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) command: Option<Vec<String>>,
}

/// The numbers of what is planned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct PlanCounts {
    pub(super) questions: usize,
    pub(super) frames: usize,
    pub(super) scenes: usize,
    pub(super) trials: usize,
}

/// The estimate of a run, as `--dry-run` makes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct PlanEstimate {
    /// Number of images that are made.
    pub(crate) images: usize,
    /// Time to make them on the machine that wrote the plan, in seconds, as measured on a few.
    pub(crate) making_seconds: f64,
    /// Processor seconds of all frames in `frames.jsonl`, by which parts are cut.
    pub(crate) cpu_seconds: f64,
    /// Time of waiting for replies, in seconds.
    pub(crate) asking_seconds: f64,
    /// Bytes to be sent.
    pub(crate) bytes: f64,
    /// Tokens of requests and replies, if each reply is short; `None` if it is not known how a model counts images.
    pub(crate) tokens: Option<f64>,
    /// US dollars, if each reply is short; `None` if a price is not known.
    pub(crate) dollars: Option<f64>,
}

impl PlanEstimate {
    /// The estimate of a plan whose frames take this many processor seconds.
    pub(crate) fn new(forecast: &Forecast, cpu_seconds: f64) -> Self {
        let lines = &forecast.lines;
        let tokens = lines.iter().try_fold(0.0, |sum, line| {
            Some(sum + line.text_tokens + line.image_tokens? + line.reply_tokens)
        });
        let dollars = lines
            .iter()
            .try_fold(0.0, |sum, line| Some(sum + line.dollars?));
        Self {
            images: forecast.images,
            making_seconds: forecast.making_seconds,
            cpu_seconds,
            asking_seconds: forecast.asking_seconds,
            bytes: forecast.bytes,
            tokens,
            dollars,
        }
    }
}

/// Flags whose values may hold a secret.
const SECRET: [&str; 2] = ["--header", "--extra-body"];

/// The words of a call of `plan` as those of an evaluation; `None` if one of them may hold a secret: a header, a field of a request,
/// an address with a password or a query.
pub(crate) fn recorded_command(words: &[String]) -> Option<Vec<String>> {
    let may_be_secret = |word: &String| {
        let flag = word.split('=').next().unwrap_or_default();
        let is_address = word.contains("://");
        SECRET.contains(&flag) || (is_address && word.contains(['@', '?']))
    };
    if words.iter().any(may_be_secret) {
        return None;
    }
    let mut recorded = Vec::new();
    let mut words = words.iter();
    let mut is_named = false;
    while let Some(word) = words.next() {
        match &**word {
            "plan" if !is_named => is_named = true,
            "--shard" | "--workers" => drop(words.next()),
            "--dry-run" => {}
            flag if flag.starts_with("--shard=") || flag.starts_with("--workers=") => {}
            _ => recorded.push(word.clone()),
        }
    }
    Some(recorded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_secret_is_recorded() {
        let recorded = |line: &str| {
            let words: Vec<String> = line.split(' ').map(str::to_owned).collect();
            recorded_command(&words).map(|words| words.join(" "))
        };
        for (line, kept) in [
            (
                "plan --model a --shard 1/4 --out r",
                Some("--model a --out r"),
            ),
            (
                "--quiet plan --model plan --workers=3 --out r",
                Some("--quiet --model plan --out r"),
            ),
            (
                "plan --base-url http://h/v1 --model a",
                Some("--base-url http://h/v1 --model a"),
            ),
            ("plan --base-url http://u:p@h/v1 --model a", None),
            ("plan --base-url=http://h/v1?key=3 --model a", None),
            ("plan --header X-Key:3 --model a", None),
            ("plan --header=X-Key:3 --model a", None),
            ("plan --extra-body {} --model a", None),
        ] {
            assert_eq!(recorded(line).as_deref(), kept, "{line}");
        }
    }
}
