//! Alerts about noise profiles with the same signal-to-noise ratio at every level ([`noise_alerts`]), and about levels
//! that leave too few 8-bit codes ([`rounding_alert`]).

use std::collections::{BTreeMap, BTreeSet, HashSet};

use serde_json::Value;

use crate::report::joined::join::Joined;
use crate::report::text::alert::{Alert, AlertKind};
use crate::types::degradations::Kind;
use crate::types::{Condition, Degradation, Severity, TrialRef};
use darkqa_score::answers::record::Detail;

/// The exposure drop, in hundredths of EV, above which an image has at most nine codes: white gets code 255 ·
/// 2^(−EV/2.2) = 8.
const FEW_CODES: u16 = 1100;

/// Alerts about noise profiles whose levels all have the same signal-to-noise ratio, for runs with several levels with
/// noise.
pub(super) fn noise_alerts<D: Detail>(joined: &Joined<D>) -> Vec<Alert> {
    let mut profiles_by_reason = BTreeMap::<&str, BTreeSet<&str>>::new();
    for run in &joined.runs {
        let mut levels = BTreeMap::<String, BTreeSet<Severity>>::new();
        for condition in conditions(joined.trials_of(run)) {
            let Some(degradation) = condition.degradation() else {
                continue;
            };
            if let Some(profile) = degradation.reading() {
                let levels = levels.entry(profile.to_string()).or_default();
                levels.insert(degradation.severity());
            }
        }
        let contents = run.manifest.columns.get("reading").into_iter().flatten();
        for (profile, content) in contents {
            let several = levels.get(profile).is_some_and(|levels| levels.len() > 1);
            if several && content["--coupling"] == "independent" {
                profiles_by_reason.entry(same_noise(content)).or_default().insert(profile);
            }
        }
    }
    profiles_by_reason.into_iter().map(|(why, names)| {
        let names: Vec<&str> = names.into_iter().collect();
        let text = format!(
            "With noise ({}) the signal-to-noise ratio is the same at every level: {why}. --profile physical loses photons with the light.",
            names.join(", ")
        );
        Alert::new(AlertKind::Noise, text)
    }).collect()
}

/// The reason why all levels of a noise profile have the same signal-to-noise ratio, if its light ratio r does not
/// depend on the level.
fn same_noise(profile: &Value) -> &'static str {
    if profile["--draws"] == "shared" {
        "the levels are one noisy image at several brightnesses"
    } else {
        "each level has other noise of the same strength"
    }
}

/// The alert about levels at which an image has too few codes, so that rounding dominates.
pub(super) fn rounding_alert<D: Detail>(joined: &Joined<D>) -> Option<Alert> {
    let levels: BTreeSet<Severity> = conditions(joined.trials.iter())
        .into_iter()
        .filter_map(Condition::degradation)
        .filter(|degradation| {
            matches!(degradation.kind(), Kind::Exposure | Kind::Sensor)
                && degradation.severity().hundredths() > FEW_CODES
        })
        .map(Degradation::severity)
        .collect();
    if levels.is_empty() {
        return None;
    }
    let names: Vec<String> = levels.iter().map(|level| format!("{} EV", level.value())).collect();
    let text = format!(
        "Above 11 EV an image has at most nine codes ({}): such levels test the rounding to 8 bits more than the model.",
        names.join(", ")
    );
    Some(Alert::new(AlertKind::Noise, text))
}

/// The distinct conditions of trials.
fn conditions<'t, D: Detail + 't>(trials: impl Iterator<Item = TrialRef<'t, D>>) -> HashSet<&'t Condition> {
    trials.filter_map(TrialRef::condition).collect()
}
