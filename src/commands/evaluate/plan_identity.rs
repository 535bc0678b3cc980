//! Settings that a run must share with its plan: [`plan_identity`].

use serde_json::{Value, json};

use super::settings::Evaluation;
use crate::data::{DataPlace, Dataset};
use crate::engine::identity;
use crate::engine::images::recipes::Recipe;
use crate::engine::images::trials::questions::ASK;
use crate::error::Result;
use crate::pictures::DecodeRule;
use crate::types::manifests::Identity;
use crate::types::{AxisLevel, Family, SetLight};
use darkqa_questions::rules::Rules;

/// The settings of data, questions and light. Models, enhancers and request settings are not included, so that they may
/// be added later.
pub(super) fn plan_identity(config: &Evaluation, dataset: &Dataset) -> Result<Identity> {
    let (selection, rule) = (&config.selection, config.rule);
    let data = match &config.place {
        rooms @ DataPlace::Rooms(_) => rooms.to_string(),
        _ => dataset.name().to_owned(),
    };
    let rules = config.rules.digest();
    let is_own = Rules::built_in().is_ok_and(|built_in| built_in.digest() != rules);
    let families: Vec<&str> = selection.families.iter().map(Family::name).collect();
    let bank = config.bank.as_ref();
    let usual = DecodeRule::default();
    let job = &config.job;
    let levels: Vec<String> = job.light.levels.iter().map(AxisLevel::to_string).collect();
    let fields = [
        Some(("--data", json!(data))),
        is_own.then(|| ("--rules", json!(rules))),
        selection.limit.map(|limit| ("--limit", json!(limit))),
        (!families.is_empty()).then(|| ("--families", json!(families))),
        bank.map(|bank| bank.digest().map(|digest| (ASK, json!(digest)))).transpose()?,
        bank.map(|bank| ("--ask-per-image", json!(bank.questions_per_image()))),
        (rule.colour != usual.colour).then(|| ("--colour", json!(rule.colour.to_string()))),
        (rule.transfer != usual.transfer).then(|| ("--transfer", json!(rule.transfer.to_string()))),
        rule.exposure_ev.map(|ev| ("--exposure", json!(ev))),
        (job.set_light == SetLight::Dark).then(|| ("--light", json!(job.set_light))),
        Some(("--levels", json!(levels))),
        (!job.light.matches.is_empty()).then(|| ("--levels match", json!(job.light.matches))),
        Some(("--variant", json!(job.light.variants.to_string()))),
        Some(("--seed", json!(job.light.kinds.sensor.seed))),
    ];
    let fields = fields.into_iter().flatten().map(|(field, value)| (field.to_owned(), value));
    Ok(fields.chain(light_settings(config)).collect())
}

/// The settings of each noise profile and of each further variant, and the version of the synthesis.
fn light_settings(config: &Evaluation) -> Vec<(String, Value)> {
    let job = &config.job;
    let recipe = Recipe::lossless(&job.light.kinds, &[]);
    let version = identity::images(&recipe).filter(|(field, _)| field == "synthesis");
    let columns = identity::columns([], &recipe, job).into_iter().flat_map(|(column, values)| {
        values.into_iter().flat_map(move |(name, content)| {
            let place = format!("{column} {name}");
            let settings = content.as_object().cloned().unwrap_or_default();
            settings.into_iter().map(move |(flag, value)| (format!("{flag} of the {place}"), value))
        })
    });
    version.chain(columns).collect()
}
