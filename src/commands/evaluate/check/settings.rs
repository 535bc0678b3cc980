//! Checks of the flags and of the files that they name: [`check_settings`].

use std::path::Path;

use super::super::settings::EvaluateArgs;
use super::findings::Findings;
use crate::ask::Prompts;
use crate::engine::images::enhancement::enhancers::{self, EnhancerModels, EnhancerRunArgs};
use crate::engine::images::trials::check_used;
use crate::engine::images::trials::questions::rules;
use crate::error::Result;
use crate::types::Rgb;
use darkqa_enhance::{Install, RuntimeSearch};
use darkqa_light::LightSettings;

/// Checks the flags and the files that they name. No data is read.
pub(super) fn check_settings(args: &EvaluateArgs, findings: &mut Findings) {
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
    let folder = args.choice.prompts.as_deref();
    let prompts = folder.map_or_else(Prompts::built_in, Prompts::load);
    add(findings, prompts.map(|_| file_line("prompts", folder)));
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
fn add(findings: &mut Findings, result: Result<Option<String>>) {
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
