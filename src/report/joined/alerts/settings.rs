//! Alerts about settings that differ between runs: [`setting_alerts`].

use std::collections::BTreeMap;

use super::words::{difference_sentence, run_names};
use crate::report::joined::join::Joined;
use crate::report::joined::settings::{
    ENCODING, Setting, Settings, differing_settings, identity_fields, joined_with_and, light_settings,
    remote_model_settings, without_explained,
};
use crate::report::text::alert::{Alert, AlertKind};
use crate::types::manifests::RunManifest;
use darkqa_score::answers::record::Detail;

/// Flags that determine the orders of choices.
const ORDERS: [&str; 2] = ["--shuffle-options", "--circular"];

/// Alerts about differences between the settings in the manifests.
pub(super) fn setting_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let names = run_names(&joined.runs);
    let manifests: Vec<&RunManifest> = joined.runs.iter().map(|run| &run.manifest).collect();
    let differing = |settings_of: &dyn Fn(&RunManifest) -> Option<Settings>| {
        let settings: Vec<_> = manifests.iter().map(|run| settings_of(run)).collect();
        differing_settings(&settings)
    };
    let flags = |flags: &[&str]| differing(&|run| Some(identity_fields(run, flags)));
    let (constraints, parameters) = differing(&remote_model_settings)
        .into_iter()
        .partition::<Vec<Setting>, _>(|setting| setting.flag == "--constrain");
    let version = differing(&|run| {
        let version = ("the version".to_owned(), run.version.clone());
        Some(Settings::from([version]))
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
