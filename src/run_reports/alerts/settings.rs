//! Settings that differ between runs: [`setting_alerts`].

use std::collections::BTreeMap;

use super::words::{names, sentence};
use crate::run_reports::join::Joined;
use crate::run_reports::settings::{
    ENCODING, Setting, Settings, differing, light, listed, parameter_flags, some, without_repeated,
};
use crate::text::alert::{Alert, AlertKind};
use crate::types::manifests::RunManifest;
use darkqa_score::answers::record::Detail;

/// The flags that decide the orders in which choices are shown.
const ORDERS: [&str; 2] = ["--shuffle-options", "--circular"];

/// Differences between the settings in the manifests.
pub(super) fn setting_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let names = names(&joined.runs);
    let manifests: Vec<&RunManifest> = joined.runs.iter().map(|run| &run.manifest).collect();
    let of = |read: &dyn Fn(&RunManifest) -> Settings| {
        let settings = manifests.iter().map(|run| Some(read(run)));
        differing(&settings.collect::<Vec<_>>())
    };
    let flags = |flags: &'static [&'static str]| of(&move |run| some(run, flags));
    let (constraints, parameters): (Vec<Setting>, Vec<Setting>) = {
        let settings = manifests.iter().map(|run| parameter_flags(run));
        let all = differing(&settings.collect::<Vec<_>>());
        all.into_iter()
            .partition(|setting| setting.flag == "--constrain")
    };
    let version = of(&|run| Settings::from([("the version".to_owned(), run.version.clone())]));
    let rows = [
        (AlertKind::Data, "The data differ", flags(&["--data"])),
        (
            AlertKind::Questions,
            "The rules of the questions differ",
            flags(&["--rules"]),
        ),
        (
            AlertKind::Questions,
            "The orders of choices differ",
            flags(&ORDERS),
        ),
        (
            AlertKind::Images,
            "The size or encoding of images differs",
            flags(&ENCODING),
        ),
        (
            AlertKind::Prompts,
            "The prompts differ",
            flags(&["--prompts"]),
        ),
        (
            AlertKind::Parameters,
            "The parameters of models differ",
            parameters,
        ),
        (
            AlertKind::Constrain,
            "Replies are constrained differently",
            constraints,
        ),
        (
            AlertKind::Version,
            "The versions of this program differ",
            version,
        ),
    ];
    let mut alerts: Vec<Alert> = rows
        .into_iter()
        .filter(|(_, _, settings)| !settings.is_empty())
        .map(|(kind, what, settings)| Alert::new(kind, sentence(what, &settings, &names)))
        .collect();
    let light = without_repeated(of(&|run| light(run, &manifests)));
    alerts.extend(light_alerts(joined, &light, &names));
    alerts
}

/// The settings of the light that differ, and the conditions that are kept apart for it.
fn light_alerts<D: Detail>(joined: &Joined<D>, light: &[Setting], names: &[String]) -> Vec<Alert> {
    let mut alerts = Vec::new();
    let mut sentences = Vec::new();
    if !light.is_empty() {
        sentences.push(sentence("The light differs", light, names));
    }
    let mut by_groups = BTreeMap::<_, (Vec<String>, usize, usize)>::new();
    for split in &joined.lights.split {
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
        let curves = listed(&curves);
        sentences.push(format!(
            "{curves} {stand} apart as {}: {why}.",
            listed(&groups)
        ));
    }
    if !sentences.is_empty() {
        alerts.push(Alert::new(AlertKind::Light, sentences.join(" ")));
    }
    if !joined.lights.undigested.is_empty() {
        let runs: Vec<&String> = joined
            .lights
            .undigested
            .iter()
            .map(|run| &names[*run])
            .collect();
        let text = format!(
            "The records of {} hold no digests of images: the settings in the manifests decide what was shown.",
            listed(&runs)
        );
        alerts.push(Alert::new(AlertKind::Light, text));
    }
    alerts
}
