//! The content of `plan.json`: [`PlanFile`].

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::runs::forecast::Forecast;
use crate::types::Digest;
use crate::types::manifests::Identity;

/// Schema of a plan.
pub(super) const SCHEMA: &str = "darkqa.plan/1";
/// File with the facts about the plan and the digests of its other files. It is written last.
pub(super) const PLAN_FILE: &str = "plan.json";
/// File with the planned questions, in the format of a run's questions.
pub(super) const QUESTIONS: &str = "questions.jsonl";
/// File with the frames of the planned questions.
pub(super) const FRAMES: &str = "frames.jsonl";

/// The content of `plan.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct PlanFile {
    pub(super) schema: String,
    /// Version of the program that wrote the plan.
    pub(super) version: String,
    /// Data, questions and light, which must be the same in every run that uses the plan. Models and enhancers are not
    /// included.
    pub(super) identity: Identity,
    /// Digests of the other files, by name.
    pub(super) files: BTreeMap<String, Digest>,
    pub(super) counts: PlanCounts,
    /// Estimate for the whole run with the models and enhancers of the command that wrote the plan.
    pub(super) estimate: PlanEstimate,
    /// Models of the command that wrote the plan.
    pub(super) models: Vec<String>,
    /// Words of the command that wrote the plan, without `plan` and `--shard`; `None` if one of them may be a secret.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) command: Option<Vec<String>>,
}

/// Numbers of planned questions, frames, scenes and trials.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct PlanCounts {
    pub(super) questions: usize,
    pub(super) frames: usize,
    pub(super) scenes: usize,
    pub(super) trials: usize,
}

/// Estimate of a run, as printed by `--dry-run`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct PlanEstimate {
    /// Number of images to make.
    pub(crate) images: usize,
    /// Time to make the images on the machine that wrote the plan, in seconds, extrapolated from a few.
    pub(crate) making_seconds: f64,
    /// CPU time of all frames in `frames.jsonl`, in seconds. Shards are divided by it.
    pub(crate) cpu_seconds: f64,
    /// Time waiting for replies, in seconds.
    pub(crate) asking_seconds: f64,
    /// Bytes to send.
    pub(crate) bytes: f64,
    /// Tokens of requests and replies, assuming short replies; `None` if the image tokens of a model are unknown.
    pub(crate) tokens: Option<f64>,
    /// Cost in US dollars, assuming short replies; `None` if a price is unknown.
    pub(crate) dollars: Option<f64>,
}

impl PlanEstimate {
    /// The estimate of a plan whose frames take `cpu_seconds` of CPU time.
    pub(crate) fn new(forecast: &Forecast, cpu_seconds: f64) -> Self {
        let lines = &forecast.lines;
        let tokens = lines
            .iter()
            .try_fold(0.0, |sum, line| Some(sum + line.text_tokens + line.image_tokens? + line.reply_tokens));
        let dollars = lines.iter().try_fold(0.0, |sum, line| Some(sum + line.dollars?));
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

/// Flags whose values may be secret.
const SECRET_FLAGS: [&str; 2] = ["--header", "--extra-body"];

/// Converts the words of a `plan` command to those of an evaluation. `None` if one of them may be secret: a header, a
/// request field, or a URL with a password or a query.
pub(crate) fn recorded_command(words: &[String]) -> Option<Vec<String>> {
    if words.iter().any(|word| may_be_secret(word)) {
        return None;
    }
    let mut recorded = Vec::new();
    let mut words = words.iter();
    let mut has_plan = false;
    while let Some(word) = words.next() {
        match &**word {
            "plan" if !has_plan => has_plan = true,
            "--shard" | "--workers" => drop(words.next()),
            "--dry-run" => {}
            flag if flag.starts_with("--shard=") || flag.starts_with("--workers=") => {}
            _ => recorded.push(word.clone()),
        }
    }
    Some(recorded)
}

fn may_be_secret(word: &str) -> bool {
    let flag = word.split('=').next().unwrap_or_default();
    let is_url = word.contains("://");
    SECRET_FLAGS.contains(&flag) || (is_url && word.contains(['@', '?']))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorded(line: &str) -> Option<String> {
        let words: Vec<String> = line.split(' ').map(str::to_owned).collect();
        recorded_command(&words).map(|words| words.join(" "))
    }

    #[test]
    fn no_secret_is_recorded() {
        for (line, kept) in [
            ("plan --model a --shard 1/4 --out r", Some("--model a --out r")),
            ("--quiet plan --model plan --workers=3 --out r", Some("--quiet --model plan --out r")),
            ("plan --base-url http://h/v1 --model a", Some("--base-url http://h/v1 --model a")),
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
