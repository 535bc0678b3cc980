//! `check`: checks everything that a run needs before any cost arises. Uses no network and no key.
//!
//! Cheap steps come first. A problem skips only the steps that depend on the broken part.
//!
//! Checks of the flags and of the files that they name: [`check_settings`].
//!
//! Checks of the questions: [`check_questions`].

mod images;

use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;
use sha2::{Digest as _, Sha256};

use super::estimate;
use super::settings::EvaluateArgs;
use super::setup::unnamed_scenes;
use super::write_plan::power_forecast;
use darkqa_ask::{PromptSet, Wording};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::write;
use darkqa_base::types::questions::letter;
use darkqa_base::types::text::{counted, excerpt};
use darkqa_base::types::{Decides, Question, Rgb};
use darkqa_data::{DataSource, Dataset, Picture};
use darkqa_engine::dark_already::DarkImages;
use darkqa_engine::images::enhancement::enhancers::{self, EnhancerModels, EnhancerRunArgs};
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::trials::{QuestionBank, check_used, open_data, rules, select};
use darkqa_enhance::{Install, RuntimeSearch};
use darkqa_light::LightSettings;
use darkqa_report::text::words::first_names;
use darkqa_runs::Outcome;
use darkqa_score::accuracies::MAX_ANSWER_SHARE;
use darkqa_score::tested_sentences::RunContents;
use images::{Depth, FindingSeverity, ImageFinding, ImageFindings, lines};

/// The flags of `check` besides those of the evaluation.
#[derive(Debug, Clone, Args)]
pub(crate) struct CheckArgs {
    /// The data, in place of --data; default: --data
    #[arg(value_name = "DATA", value_parser = darkqa_data::parse_data_source, add = Decides::Nothing)]
    pub place: Option<DataSource>,
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
    let mut findings = ImageFindings::default();
    check_settings(&args, &mut findings);
    let asked = check_data(&args, check, progress, &mut findings)?;
    check_plan(args, progress, &mut findings);
    let problems = findings.problem_count();
    let findings = findings.finish();
    let warnings = findings.iter().filter(|finding| finding.mark == FindingSeverity::Warning).count();
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

fn findings_json(findings: &[ImageFinding], questions: usize, problems: usize) -> String {
    let value = json!({"findings": findings, "questions": questions, "problems": problems});
    format!("{value:#}\n")
}

/// Checks data, questions and images; returns the number of questions that would be asked.
fn check_data(
    args: &EvaluateArgs,
    check: &CheckArgs,
    progress: &Progress,
    findings: &mut ImageFindings,
) -> Result<usize> {
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
    check_questions(&asked, findings);
    if let Some(warning) = unnamed_scenes(&dataset, asked.iter()) {
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
        if let Some(power) = power_forecast(&dataset, asked.iter().map(|question| (question, None)), sets) {
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
fn check_plan(args: EvaluateArgs, progress: &Progress, findings: &mut ImageFindings) {
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

/// Checks the flags and the files that they name. No data is read.
fn check_settings(args: &EvaluateArgs, findings: &mut ImageFindings) {
    let place = args.scene.place(args.data.place());
    let set = args.scene.set_light(&place, &args.data.set.root.data_root);
    let light = set.and_then(|set| Ok((set, LightSettings::resolve(&args.job.light, set)?)));
    match &light {
        Ok((set, light)) => {
            let used = check_used(light, &args.job.enhancers.clone().for_set(*set));
            add(findings, used.map(|()| None));
        }
        Err(e) => findings.problem(e.to_string()),
    }
    let rulebook = args.selection.rules.as_deref();
    add(findings, rules(rulebook).map(|_| file_line("rules", rulebook)));
    let folders = || args.choice.prompts.iter().filter_map(PromptSet::folder);
    match Wording::open(&args.choice.prompts) {
        Ok(_) => folders().for_each(|folder| findings.ok(format!("prompts: {}", folder.display()))),
        Err(e) => findings.problem(e.to_string()),
    }
    if !args.job.models.is_empty() {
        let models = args
            .job
            .check_models(&args.experiment())
            .map(|names| Some(format!("models: {}; the keys that they need are there", names.join(", "))));
        add(findings, models);
    }
    add(findings, try_enhancers(args));
}

/// The line about a usable file or folder; `None` if none was named.
fn file_line(what: &str, path: Option<&Path>) -> Option<String> {
    path.map(|path| format!("{what}: {}", path.display()))
}

/// Adds the line or the error of a step to the findings.
fn add(findings: &mut ImageFindings, result: Result<Option<String>>) {
    match result {
        Ok(Some(line)) => findings.ok(line),
        Ok(None) => {}
        Err(e) => findings.problem(e.to_string()),
    }
}

/// Loads the enhancers and enhances one image with each. A missing runtime is not installed.
fn try_enhancers(args: &EvaluateArgs) -> Result<Option<String>> {
    let files = enhancers::read_models(&args.job.enhancers.llie)?;
    if files.is_empty() {
        return Ok(None);
    }
    let names: Vec<String> = files.iter().map(|file| file.name().to_string()).collect();
    let search = RuntimeSearch { install: Install::Offline, ..args.job.loading.runtime.search() };
    let version = search.open()?.version().to_owned();
    let mut loading: EnhancerRunArgs = args.job.loading.clone();
    loading.runtime.offline = true;
    let mut enhancers = EnhancerModels::load(files, &loading)?.take()?;
    // A gradient, because an image of a single value has no structure.
    let samples = (0..64 * 64 * 3).map(|index| (index / 192) as u8);
    let image = Rgb::new(64, 64, samples.collect())?;
    for enhancer in &mut enhancers {
        enhancer.enhance(&image)?;
    }
    Ok(Some(format!("enhancers: {}, each tried on an image of 64×64; ONNX Runtime {version}", names.join(", "))))
}

/// Maximum number of families listed.
const MAX_FAMILIES: usize = 12;

/// Reports families, numbers of choices and chance accuracy, and warns of questions that give their answers away.
fn check_questions(questions: &[Question], findings: &mut ImageFindings) {
    let (mut families, mut sizes) = (BTreeMap::new(), BTreeMap::new());
    let mut chance = 0.0;
    for question in questions {
        *families.entry(question.family.name()).or_insert(0_usize) += 1;
        *sizes.entry(question.choices.len()).or_insert(0_usize) += 1;
        chance += 1.0 / question.choices.len() as f64;
    }
    let sizes: Vec<String> = sizes.iter().map(|(size, count)| format!("{count} with {size} choices")).collect();
    findings.ok(format!(
        "{}, {}; chance {:.1} %",
        counted(questions.len(), "question"),
        sizes.join(", "),
        100.0 * chance / questions.len().max(1) as f64
    ));
    let mut families: Vec<(&str, usize)> = families.into_iter().collect();
    families.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let families: Vec<String> =
        families.iter().map(|(family, count)| format!("{} {count}", excerpt(family, 30))).collect();
    findings.ok(format!("families: {}", first_names(&families, MAX_FAMILIES)));
    warn_of_common_answers(questions, findings);
    warn_of_repeats(questions, findings);
    warn_of_contained_answers(questions, findings);
}

/// Warns of an answer or letter that is true so often that a constant reply scores well.
fn warn_of_common_answers(questions: &[Question], findings: &mut ImageFindings) {
    let letters: Vec<String> =
        questions.iter().filter_map(|question| Some(letter(question.choices.truth()?).to_string())).collect();
    let texts: Vec<String> = questions
        .iter()
        .filter_map(|question| {
            let truth = question.choices.truth()?;
            Some(question.choices.texts()[truth].to_lowercase())
        })
        .collect();
    for (what, answers) in [("letter", letters), ("answer", texts)] {
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        for answer in &answers {
            *counts.entry(answer).or_default() += 1;
        }
        let most = counts.iter().max_by_key(|(_, count)| **count);
        let Some((answer, count)) = most else {
            continue;
        };
        let share = *count as f64 / questions.len() as f64;
        if share >= MAX_ANSWER_SHARE {
            findings.warn(format!(
                "always the {what} {:?} scores {:.0} %; ask the model without images too (--blind-model NAME), or show the choices in other orders (--choice-order shuffle)",
                excerpt(answer, 60),
                100.0 * share
            ));
        }
    }
}

/// Warns of questions that occur twice.
fn warn_of_repeats(questions: &[Question], findings: &mut ImageFindings) {
    let mut seen = HashMap::new();
    for question in questions {
        let content = (&question.frame, &question.text, question.choices.texts());
        if let Some(first) = seen.insert(content, &question.id) {
            let text =
                format!("the questions {:?} and {:?} are the same", excerpt(&first.0, 60), excerpt(&question.id.0, 60));
            findings.add_of_kind("questions that occur twice", FindingSeverity::Warning, text);
        }
    }
}

/// Warns of questions whose text contains the true choice and no other.
fn warn_of_contained_answers(questions: &[Question], findings: &mut ImageFindings) {
    for question in questions {
        let text = format!(" {} ", words(&question.text));
        let texts = question.choices.texts();
        let Some(truth) = question.choices.truth().map(|truth| &texts[truth]) else {
            continue;
        };
        let is_other_contained = texts.iter().any(|choice| choice != truth && contains_words(&text, choice));
        if words(truth).len() > 2 && contains_words(&text, truth) && !is_other_contained {
            let line = format!(
                "the question {:?} holds its answer {:?}: {:?}",
                excerpt(&question.id.0, 60),
                excerpt(truth, 60),
                excerpt(&question.text, 120)
            );
            findings.add_of_kind("questions that hold their answers", FindingSeverity::Warning, line);
        }
    }
}

fn contains_words(text: &str, choice: &str) -> bool {
    text.contains(&format!(" {} ", words(choice)))
}

/// The words of a text in lower case, separated by single spaces.
fn words(text: &str) -> String {
    let lower = text.to_lowercase();
    lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect::<Vec<&str>>().join(" ")
}
