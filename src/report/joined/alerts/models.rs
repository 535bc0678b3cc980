//! Alerts about models: their names, servers, providers, settings, constraints and limits.
//!
//! Alerts about models that a report lists under several names, with the reason: [`model_alerts`].
//!
//! Alerts about the model names in replies: [`served_alerts`].
//!
//! Alerts about servers that differ between runs: [`server_alerts`].
//!
//! Alerts about models that a router served by several providers: [`provider_alerts`].
//!
//! Alerts about settings that differ between runs: [`setting_alerts`].
//!
//! Alerts about replies that do not follow the requested constraint: [`constraint_alerts`].
//!
//! Alerts about models asked with another token limit than the run began with: [`limit_alerts`].
//!
//! Wording that alerts share: [`run_names`] and [`difference_sentence`].

use std::collections::{BTreeMap, BTreeSet};

use crate::joined::join::{Joined, JoinedRun};
use crate::joined::model_names::SplitModel;
use crate::joined::settings::{
    ENCODING, FlagValues, Setting, base_url, differing_settings, has_human_answers, identity_fields, joined_with_and,
    light_settings, remote_model_settings, without_explained,
};
use crate::text::alert::{Alert, AlertKind};
use darkqa_base::types::manifests::RunManifest;
use darkqa_base::types::text::{is_other_model, is_same_name, plural};
use darkqa_base::types::{ChoiceDetail, Trials};
use darkqa_score::answers::record::Detail;
use darkqa_score::model_in_condition::without_run;

/// Manifest fields of a built-in model, and their names in a sentence.
const FIELDS: [(&str, &str); 3] = [("random", "its seed"), ("script", "its file"), (DIGEST, "its digest")];

/// The field that holds the digest of everything that decides the replies of a built-in model.
const DIGEST: &str = "digest";

/// One alert for all models that are split for the same reason in the same runs.
pub(super) fn model_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let runs = run_names(&joined.runs);
    let mut by_reason = BTreeMap::<(String, Vec<&str>), Vec<&SplitModel>>::new();
    for split in &joined.model_names.split {
        let suffixes = split.names.iter().map(|name| &name[split.model.len()..]).collect();
        by_reason.entry((reason(split, &runs), suffixes)).or_default().push(split);
    }
    by_reason
        .into_iter()
        .map(|((reason, _), models)| {
            let text = format!("{}: {reason}.", stand_apart(&models));
            Alert::new(AlertKind::Models, text)
        })
        .collect()
}

/// Alerts about the models of each run whose replies are left out.
pub(super) fn left_out_alerts(runs: &[JoinedRun]) -> Vec<Alert> {
    runs.iter().filter(|run| !run.left_out.is_empty()).map(|run| {
        let names: Vec<&String> = run.left_out.iter().collect();
        let are = if names.len() == 1 { "is" } else { "are" };
        let text = format!(
            "{} {are} left out of {}: the file of models has no such model any more, or has it with other settings; report --all shows \
             all.",
            joined_with_and(&names),
            run.name
        );
        Alert::new(AlertKind::Models, text)
    }).collect()
}

/// The sentence about split models, with the names of the first one.
fn stand_apart(models: &[&SplitModel]) -> String {
    let names: Vec<&String> = models.iter().map(|split| &split.model).collect();
    let (all, apart) = (joined_with_and(&names), joined_with_and(&models[0].names));
    if models.len() == 1 {
        format!("{all} stands apart as {apart}")
    } else {
        format!("{all} stand apart, as in {apart}")
    }
}

/// The reason why a model is split: the settings that differ, and the replies or trials that do.
fn reason(split: &SplitModel, runs: &[String]) -> String {
    let mut reasons: Vec<String> =
        named_settings(&split.differences).iter().map(|setting| setting.words(runs)).collect();
    let overlap = split.overlap();
    let up_to = if split.names.len() > 2 { "up to " } else { "" };
    if overlap.other_replies > 0 {
        reasons.push(format!(
            "{up_to}{} of {} replies to the same trials differ",
            overlap.other_replies, overlap.repeated
        ));
    } else if overlap.other_served > 0 {
        reasons.push(format!(
            "{up_to}{} of {} replies to the same trials came from another model, by the name that the server gave",
            overlap.other_served, overlap.repeated
        ));
    }
    if reasons.is_empty() {
        reasons.push(format!(
            "{up_to}{} of the same questions in the same conditions are other trials, by their keys",
            overlap.other_trials
        ));
    }
    reasons.join("; ")
}

/// The settings that differ, with manifest fields replaced by their names in a sentence. The digest is left out if
/// other settings explain it.
fn named_settings(differences: &[Setting]) -> Vec<Setting> {
    let is_explained = differences.iter().any(|setting| setting.flag != DIGEST);
    differences
        .iter()
        .filter(|setting| !is_explained || setting.flag != DIGEST)
        .map(|setting| Setting {
            flag: FIELDS
                .iter()
                .find(|(field, _)| *field == setting.flag)
                .map_or(&*setting.flag, |(_, words)| *words)
                .to_owned(),
            ..setting.clone()
        })
        .collect()
}

/// Alerts about models with several names in the replies of one run, with the number of replies of each name at each
/// level, and about models whose only name is evidently that of another model.
pub(super) fn served_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let mut served = BTreeMap::<&str, BTreeSet<&str>>::new();
    let mut mixed = BTreeSet::new();
    for run in joined.runs.iter().filter(|run| !has_human_answers(&run.manifest)) {
        for (model, names) in &run.served {
            served.entry(model).or_default().extend(names.iter().map(String::as_str));
            if has_several(names) {
                mixed.insert(without_run(model));
            }
        }
    }
    let other = served.iter().filter_map(|(model, names)| {
        let [name] = *names.iter().copied().collect::<Vec<_>>().as_slice() else {
            return None;
        };
        is_other_model(asked_id(&joined.runs, model), name).then(|| {
            format!("Replies of {model} name another model: {name}. Check which model the server has loaded, or serves under this name.")
        })
    });
    let mixed = mixed_names(joined, &mixed);
    other.chain(mixed).map(|text| Alert::new(AlertKind::Served, text)).collect()
}

/// True if names differ in more than case and path.
fn has_several(names: &BTreeSet<String>) -> bool {
    names.first().is_some_and(|first| names.iter().any(|name| !is_same_name(first, name)))
}

/// The id of a model at its endpoint, or its name in tables if no run states it.
fn asked_id<'a>(runs: &'a [JoinedRun], model: &'a str) -> &'a str {
    runs.iter()
        .find_map(|run| {
            let models = run.manifest.columns.get("model")?;
            models.get(without_run(model))?.get("--model")?.as_str()
        })
        .unwrap_or(model)
}

/// One sentence for each of these models, with the number of replies of each name at each level.
fn mixed_names<D: Detail>(joined: &Joined<D>, models: &BTreeSet<&str>) -> Vec<String> {
    let mut counts = BTreeMap::<&str, BTreeMap<&str, BTreeMap<String, usize>>>::new();
    for trial in joined.trials.iter() {
        let Some(name) = trial.served_model().filter(|_| models.contains(without_run(trial.model()))) else {
            continue;
        };
        let level =
            trial.condition().map_or_else(|| "without images".to_owned(), |condition| format!("at {condition}"));
        let levels = counts.entry(trial.model()).or_default().entry(name).or_default();
        *levels.entry(level).or_default() += 1;
    }
    counts
        .iter()
        .filter(|(_, names)| names.len() > 1)
        .map(|(model, names)| {
            let names: Vec<String> = names
                .iter()
                .map(|(name, levels)| {
                    let levels: Vec<String> = levels
                        .iter()
                        .map(|(level, count)| format!("{count} {level}"))
                        .collect();
                    format!("{name} ({})", levels.join(", "))
                })
                .collect();
            format!(
                "{model} was served as {}: {} in one column are no comparison of light. A --model with a date or version, or a gateway \
                 without fallbacks, keeps one.",
                joined_with_and(&names),
                plural(names.len(), "model", "models")
            )
        })
        .collect()
}

/// Alerts about models that were served under several names or asked at several base URLs.
pub(super) fn server_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let run_names = run_names(&joined.runs);
    let mut served = BTreeMap::<&str, BTreeMap<usize, &BTreeSet<String>>>::new();
    for (index, run) in joined.runs.iter().enumerate().filter(|(_, run)| !has_human_answers(&run.manifest)) {
        for (model, names) in &run.served {
            served.entry(model).or_default().insert(index, names);
        }
    }
    let mut alerts = Vec::new();
    for (model, runs) in &served {
        let distinct: BTreeSet<&String> = runs.values().copied().flatten().collect();
        // Names that change within a run have their own alert.
        let is_mixed = runs.values().any(|names| has_several(names));
        if distinct.len() > 1 && !is_mixed {
            let runs: Vec<String> = runs
                .iter()
                .map(|(run, served)| {
                    let served: Vec<&String> = served.iter().collect();
                    format!("{} in {}", joined_with_and(&served), run_names[*run])
                })
                .collect();
            let text = format!("{model} was served as {}.", joined_with_and(&runs));
            alerts.push(Alert::new(AlertKind::Served, text));
        }
    }
    let models: BTreeSet<&String> =
        joined.runs.iter().filter_map(|run| run.manifest.columns.get("model")).flat_map(BTreeMap::keys).collect();
    for model in models {
        let base_urls: Vec<Option<FlagValues>> = joined
            .runs
            .iter()
            .map(|run| {
                let base_url = base_url(&run.manifest, model)?;
                Some(FlagValues::from([("--base-url".to_owned(), base_url)]))
            })
            .collect();
        let differences = differing_settings(&base_urls);
        if !differences.is_empty() {
            let what = format!("{model} was asked at several addresses");
            alerts.push(Alert::new(AlertKind::Served, difference_sentence(&what, &differences, &run_names)));
        }
    }
    alerts
}

/// One alert for each model whose replies name several providers, with the number of replies of each.
pub(super) fn provider_alerts<D: Detail>(trials: &Trials<D>) -> Vec<Alert> {
    let mut counts = BTreeMap::<&str, BTreeMap<&str, usize>>::new();
    for trial in trials.iter() {
        if let Some(provider) = trial.provider() {
            let of_model = counts.entry(trial.model()).or_default();
            *of_model.entry(provider).or_default() += 1;
        }
    }
    counts.iter().filter(|(_, providers)| providers.len() > 1).map(|(model, providers)| {
        let named: Vec<String> = providers
            .iter()
            .map(|(name, count)| format!("{name} ({})", plural(*count, "reply", "replies"))).collect();
        let text = format!(
            "{model} was served by {}: providers and quantisations are mixed. --extra-body with provider names one.",
            named.join(", ")
        );
        Alert::new(AlertKind::Served, text)
    }).collect()
}

/// Flags that determine the orders of choices.
const ORDERS: [&str; 2] = ["--shuffle-options", "--circular"];

/// Alerts about differences between the settings in the manifests.
pub(super) fn setting_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let names = run_names(&joined.runs);
    let manifests: Vec<&RunManifest> = joined.runs.iter().map(|run| &run.manifest).collect();
    let differing = |settings_of: &dyn Fn(&RunManifest) -> Option<FlagValues>| {
        let settings: Vec<_> = manifests.iter().map(|run| settings_of(run)).collect();
        differing_settings(&settings)
    };
    let flags = |flags: &[&str]| differing(&|run| Some(identity_fields(run, flags)));
    let (constraints, parameters) = differing(&remote_model_settings)
        .into_iter()
        .partition::<Vec<Setting>, _>(|setting| setting.flag == "--constrain");
    let version = differing(&|run| {
        let version = ("the version".to_owned(), run.version.clone());
        Some(FlagValues::from([version]))
    });
    let rows = [
        (AlertKind::Data, "The data differ", flags(&["--data"])),
        (AlertKind::Questions, "The rules of the questions differ", flags(&["--rules"])),
        (AlertKind::Questions, "The orders of choices differ", flags(&ORDERS)),
        (AlertKind::Images, "The size or encoding of images differs", flags(&ENCODING)),
        (AlertKind::Prompts, "The prompts differ", flags(&["--prompts"])),
        (AlertKind::Parameters, "The parameters of models differ", parameters),
        (AlertKind::Constrain, "Replies are constrained differently", constraints),
        (AlertKind::Version, "The versions of this program differ", version),
    ];
    let mut alerts: Vec<Alert> = rows
        .into_iter()
        .filter(|(_, _, settings)| !settings.is_empty())
        .map(|(kind, what, settings)| Alert::new(kind, difference_sentence(what, &settings, &names)))
        .collect();
    let light = without_explained(differing(&|run| Some(light_settings(run, &manifests))));
    alerts.extend(light_alerts(joined, &light, &names));
    alerts
}

/// Alerts about light settings that differ, and about the conditions that are split because of them.
fn light_alerts<D: Detail>(joined: &Joined<D>, light: &[Setting], names: &[String]) -> Vec<Alert> {
    let mut alerts = Vec::new();
    let mut sentences = Vec::new();
    if !light.is_empty() {
        sentences.push(difference_sentence("The light differs", light, names));
    }
    let mut by_groups = BTreeMap::<_, (Vec<String>, usize, usize)>::new();
    for split in &joined.image_groups.split_curves {
        let (curves, shared, differing) = by_groups.entry(&split.groups).or_default();
        curves.push(split.curve.name());
        *shared += split.shared;
        *differing += split.differing;
    }
    for (groups, (curves, shared, differing)) in by_groups {
        let groups: Vec<String> = groups.iter().map(|name| format!("@{name}")).collect();
        let why = match shared {
            0 => "no image is shared, and the settings differ".to_owned(),
            _ => format!("{differing} of {shared} shared images differ"),
        };
        let stand = if curves.len() == 1 { "stands" } else { "stand" };
        let curves = joined_with_and(&curves);
        sentences.push(format!("{curves} {stand} apart as {}: {why}.", joined_with_and(&groups)));
    }
    if !sentences.is_empty() {
        alerts.push(Alert::new(AlertKind::Light, sentences.join(" ")));
    }
    if !joined.image_groups.undigested.is_empty() {
        let runs: Vec<&String> = joined.image_groups.undigested.iter().map(|run| &names[*run]).collect();
        let text = format!(
            "The records of {} hold no digests of images: the settings in the manifests decide what was shown.",
            joined_with_and(&runs)
        );
        alerts.push(Alert::new(AlertKind::Light, text));
    }
    alerts
}

/// One alert for each model that was asked with `--request constrain` and has replies of another form. A reply that
/// follows the constraint is stored as a single letter.
pub(super) fn constraint_alerts(runs: &[JoinedRun], trials: &Trials<ChoiceDetail>) -> Vec<Alert> {
    let constrained: BTreeMap<&String, &str> = runs
        .iter()
        .filter_map(|run| run.manifest.columns.get("model"))
        .flat_map(BTreeMap::iter)
        .filter_map(|(name, content)| Some((name, content["--constrain"].as_str()?)))
        .filter(|(_, constraint)| *constraint != "none")
        .collect();
    constrained.iter().filter_map(|(model, constraint)| {
        let (all, other) = trials
            .iter()
            .filter(|trial| trial.model() == **model && !trial.failed())
            .fold((0_usize, 0_usize), |(all, other), trial| {
                (all + 1, other + usize::from(!trial.is_letter()))
            });
        (other > 0).then(|| {
            let replies = plural(all, "reply", "replies");
            let text = format!(
                "Constraint not followed: {other} of {replies} of {model} have another form than --request constrain={constraint} asks for, \
                 and are read as any reply."
            );
            Alert::new(AlertKind::Constrain, text)
        })
    }).collect()
}

/// One alert for each model asked with more than its first token limit, with the number of replies at each limit.
pub(super) fn limit_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let mut counts = BTreeMap::<&str, BTreeMap<Option<u32>, usize>>::new();
    for trial in joined.trials.iter().filter(|trial| trial.has_reply()) {
        let limits = counts.entry(trial.model()).or_default();
        *limits.entry(trial.max_tokens()).or_default() += 1;
    }
    counts
        .iter()
        .filter(|(_, limits)| limits.keys().any(Option::is_some)).map(|(model, limits)| {
        let first = first_limit(&joined.runs, without_run(model));
        let words: Vec<String> = limits.iter().map(|(limit, count)| {
            let limit = limit.map_or_else(|| first.clone(), |limit| limit.to_string());
            format!("{} with {limit}", plural(*count, "reply", "replies"))
        }).collect();
        let count = if limits.len() == 1 { "another token limit than the run began with" } else { "several token limits" };
        let text = format!(
            "{model} was asked with {count} (--max-tokens): {}. A truncated reply is asked again when the limit grows.",
            words.join(", ")
        );
        Alert::new(AlertKind::Parameters, text)
    }).collect()
}

/// The first token limit of a model in its runs, as text.
fn first_limit(runs: &[JoinedRun], model: &str) -> String {
    runs.iter()
        .filter_map(|run| {
            let models = run.manifest.columns.get("model")?;
            models.get(model)?.get("--max-tokens")?.as_u64()
        })
        .min()
        .map_or_else(|| "the first limit".to_owned(), |limit| limit.to_string())
}

/// The names of runs.
fn run_names(runs: &[JoinedRun]) -> Vec<String> {
    runs.iter().map(|run| run.name.clone()).collect()
}

/// The sentence about a difference, with the settings that cause it: `The light differs: --seed is 0 in a and 1 in b.`
fn difference_sentence(what: &str, settings: &[Setting], names: &[String]) -> String {
    let settings: Vec<String> = settings.iter().map(|setting| setting.words(names)).collect();
    format!("{what}: {}.", settings.join("; "))
}
