//! `check`: checks everything that a run needs before any cost arises. Uses no network and no key.
//!
//! Cheap steps come first. A problem skips only the steps that depend on the broken part.

mod findings;
mod images;
mod questions;
mod settings;

use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;
use sha2::{Digest as _, Sha256};

use super::estimate;
use super::power::power_forecast;
use super::settings::EvaluateArgs;
use super::unnamed_scenes::unnamed_scenes;
use crate::data::{DataPlace, Dataset, Picture};
use crate::engine::dark_already::DarkImages;
use crate::engine::images::progress::Progress;
use crate::engine::images::trials::questions::{QuestionBank, open_data, rules, select};
use crate::error::{Error, Result};
use crate::files::write;
use crate::runs::Outcome;
use crate::types::Decides;
use crate::types::Question;
use crate::types::text::counted;
use darkqa_light::LightSettings;
use darkqa_score::tested_sentences::RunContents;

use findings::{Finding, Findings, Mark, lines};
use images::Depth;

/// The flags of `check` besides those of the evaluation.
#[derive(Debug, Clone, Args)]
pub(crate) struct CheckArgs {
    /// The data, in place of --data; default: --data
    #[arg(value_name = "DATA", value_parser = crate::data::parse_data_place, add = Decides::Nothing)]
    pub place: Option<DataPlace>,
    /// Decode every image, so that damage inside a file is found; one that ends early is found without
    #[arg(long, help_heading = "Check", add = Decides::Nothing)]
    pub deep: bool,
    /// Write the questions as they were read, one a line, with the SHA-256 of each image; default: none
    #[arg(long, value_name = "FILE", help_heading = "Check", add = Decides::Nothing)]
    pub save_questions: Option<PathBuf>,
}

/// Checks data, questions, images, models, enhancers and prompts.
///
/// # Errors
/// If the flags contradict each other. Other problems are findings, and set the exit code to 1.
pub(crate) fn check(mut args: EvaluateArgs, check: &CheckArgs, progress: &Progress) -> Result<Outcome> {
    if let Some(place) = &check.place {
        args.data.data = vec![place.clone()];
    }
    let is_json = std::mem::take(&mut args.job.output.show.json);
    args.job.money.dry_run = true;
    let mut findings = Findings::default();
    settings::check_settings(&args, &mut findings);
    let asked = check_data(&args, check, progress, &mut findings)?;
    check_plan(args, progress, &mut findings);
    let problems = findings.problem_count();
    let findings = findings.finish();
    let warnings = findings.iter().filter(|finding| finding.mark == Mark::Warning).count();
    let output = if is_json {
        findings_json(&findings, asked, problems)
    } else {
        format!("{}{}\n", lines(&findings), verdict(asked, problems, warnings))
    };
    Ok(Outcome::text(Outcome::complete_if(problems == 0), output))
}

fn verdict(asked: usize, problems: usize, warnings: usize) -> String {
    let warnings = match warnings {
        0 => String::new(),
        count => format!(", {}", counted(count, "warning")),
    };
    match problems {
        0 => format!("ok: {}{warnings}", counted(asked, "question")),
        count => format!("{}{warnings}", counted(count, "problem")),
    }
}

fn findings_json(findings: &[Finding], questions: usize, problems: usize) -> String {
    let value = json!({"findings": findings, "questions": questions, "problems": problems});
    format!("{value:#}\n")
}

/// Checks data, questions and images; returns the number of questions that would be asked.
fn check_data(args: &EvaluateArgs, check: &CheckArgs, progress: &Progress, findings: &mut Findings) -> Result<usize> {
    let rule = args.decode.rule();
    let selection = &args.selection;
    let place = args.scene.place(args.data.place());
    let set = &args.data.set;
    let bank = QuestionBank::open(&args.bank);
    let opened = bank.and_then(|bank| {
        if let Some(bank) = bank {
            return bank.open_images(&place, set, rule, progress);
        }
        let rules = rules(selection.rules.as_deref())?;
        open_data(&place, &args.scene, set, selection, &rules, rule, progress)
    });
    let opened = opened.and_then(|dataset| Ok((dataset, args.scene.set_light(&place, &set.root.data_root)?)));
    let (mut dataset, light) = match opened {
        Ok(opened) => opened,
        Err(e) => {
            findings.problem(e.to_string());
            return Ok(0);
        }
    };
    for line in dataset.summary() {
        findings.ok(line);
    }
    let asked = match select(dataset.take_questions(), selection) {
        Ok(asked) => asked,
        Err(e) => {
            findings.problem(e.to_string());
            return Ok(0);
        }
    };
    questions::check_questions(&asked, findings);
    if let Some(warning) = unnamed_scenes(&dataset, &asked) {
        findings.warn(warning);
    }
    if args.job.models.is_empty() {
        // With a model, the estimate of the run includes this line.
        let sets = RunContents {
            models: 1,
            enhancers: args.job.enhancers.llie.len() + args.job.enhancers.enhanced.len(),
            lights: 1,
            has_noise: true,
        };
        if let Some(power) = power_forecast(&dataset, &asked, &HashMap::new(), sets) {
            findings.ok(power.line());
        }
    }
    let depth = if check.deep { Depth::Pixels } else { Depth::Headers };
    let enhancers = args.job.enhancers.clone().for_set(light);
    // Contradictory flags are a finding already.
    let dark = LightSettings::resolve(&args.job.light, light)
        .map_or(DarkImages::Unexpected, |levels| DarkImages::new(light, &levels, &enhancers));
    images::check_images(&dataset, dark, &asked, depth, progress, findings);
    if let Some(path) = &check.save_questions {
        save_questions(path, &dataset, &asked)?;
        findings.ok(format!("{}: the questions as they were read", path.display()));
    }
    Ok(asked.len())
}

/// Checks the models, and estimates the run. Nothing is sent, and no key is read.
fn check_plan(args: EvaluateArgs, progress: &Progress, findings: &mut Findings) {
    if args.job.models.is_empty() {
        findings.warn("no model is named: --model NAME adds it to the check, and what a run would take");
        return;
    }
    if findings.problem_count() > 0 {
        findings.warn("what a run would take is not estimated, as long as there are problems");
        return;
    }
    match estimate(args, progress) {
        Ok(estimate) => findings.ok(format!("a run would take:\n{}", estimate.trim_end())),
        Err(e) => findings.problem(e.to_string()),
    }
}

/// Writes the questions, one per line, with the SHA-256 of each image.
fn save_questions(path: &Path, dataset: &Dataset, questions: &[Question]) -> Result<()> {
    let mut text = String::new();
    for question in questions {
        let digests: Vec<Option<String>> = dataset
            .shown_frames(&question.frame)
            .iter()
            .map(|frame| match dataset.picture(frame) {
                Ok(Picture::Encoded(file)) => Some(hex(&Sha256::digest(file.bytes()))),
                _ => None,
            })
            .collect();
        let digest = match &*digests {
            [only] => json!(only),
            several => json!(several),
        };
        let line = json!({
            "id": question.id,
            "frame": question.frame,
            "family": question.family,
            "question": question.text,
            "choices": question.choices.texts(),
            "answer": question.choices.truth().map(|truth| &question.choices.texts()[truth]),
            "image_sha256": digest,
        });
        let line = serde_json::to_string(&line).map_err(|e| Error::data(path.display(), e))?;
        text.push_str(&line);
        text.push('\n');
    }
    write(path, text.as_bytes())
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}
