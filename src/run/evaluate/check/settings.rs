//! The flags of a check, and the files that they name: [`settings`].

use std::path::Path;

use super::super::settings::EvaluateArgs;
use super::findings::Findings;
use crate::ask::Prompts;
use crate::error::Result;
use crate::images::enhancement::enhancers::{self, EnhancerRunArgs, OpenEnhancers};
use crate::images::trials::check_used;
use crate::images::trials::questions::rules;
use crate::types::Rgb;
use darkqa_enhance::{Install, RuntimeSearch};
use darkqa_light::LightSettings;

/// Looks at the flags and the files that they name; no data is read.
pub(super) fn settings(args: &EvaluateArgs, findings: &mut Findings) {
    let place = args.scene.place(args.data.place());
    let set = args.scene.set_light(&place);
    let enhancers = |set| args.job.enhancers.clone().for_set(set);
    let light = set.and_then(|set| Ok((set, LightSettings::resolve(&args.job.light, set)?)));
    match &light {
        Ok((set, light)) => {
            let used = check_used(light, &enhancers(*set));
            said(findings, used.map(|()| None));
        }
        Err(e) => findings.problem(e.to_string()),
    }
    let rulebook = args.selection.rules.as_deref();
    said(findings, rules(rulebook).map(|_| file("rules", rulebook)));
    let folder = args.choice.prompts.as_deref();
    let prompts = folder.map_or_else(Prompts::built_in, Prompts::load);
    said(findings, prompts.map(|_| file("prompts", folder)));
    if !args.job.models.is_empty() {
        let models = args.job.check_models(&args.experiment());
        let line = |names: Vec<String>| {
            Some(format!(
                "models: {}; the keys that they need are there",
                names.join(", ")
            ))
        };
        said(findings, models.map(line));
    }
    said(findings, enhance(args));
}

/// One line for a file that was named and can be used.
fn file(what: &str, path: Option<&Path>) -> Option<String> {
    path.map(|path| format!("{what}: {}", path.display()))
}

fn said(findings: &mut Findings, result: Result<Option<String>>) {
    match result {
        Ok(Some(line)) => findings.ok(line),
        Ok(None) => {}
        Err(e) => findings.problem(e.to_string()),
    }
}

/// Loads the enhancers and puts one image through each. A runtime that is not there is not installed.
fn enhance(args: &EvaluateArgs) -> Result<Option<String>> {
    let files = enhancers::read(&args.job.enhancers.llie)?;
    if files.is_empty() {
        return Ok(None);
    }
    let names: Vec<String> = files.iter().map(|file| file.name().to_string()).collect();
    let search = RuntimeSearch {
        install: Install::Offline,
        ..args.job.loading.runtime.search()
    };
    let version = search.open()?.version().to_owned();
    let mut loading: EnhancerRunArgs = args.job.loading.clone();
    loading.runtime.offline = true;
    let mut enhancers = OpenEnhancers::load(files, &loading)?.take()?;
    // A gradient: an image of one value has no structure that a model could keep.
    let samples = (0..64 * 64 * 3).map(|at| (at / 192) as u8);
    let image = Rgb::new(64, 64, samples.collect())?;
    for enhancer in &mut enhancers {
        enhancer.enhance(&image)?;
    }
    Ok(Some(format!(
        "enhancers: {}, each tried on an image of 64×64; ONNX Runtime {version}",
        names.join(", ")
    )))
}
