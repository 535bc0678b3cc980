//! What the levels of runs do to the signal-to-noise ratio of images with sensor noise: [`of_noise`].

use std::collections::BTreeSet;

use crate::job::report::join::JoinedRun;
use crate::report::alert::{Alert, AlertKind};
use crate::types::manifest::RunManifest;

/// The light readings whose levels all have the same signal-to-noise ratio, if the runs have any.
pub(super) fn of_noise(runs: &[JoinedRun]) -> Option<Alert> {
    let readings: BTreeSet<&str> = runs
        .iter()
        .flat_map(|run| constant(&run.manifest))
        .collect();
    if readings.is_empty() {
        return None;
    }
    let names: Vec<&str> = readings.into_iter().collect();
    let text = format!(
        "With noise ({}) the signal-to-noise ratio is the same at every level: the levels are one noisy image at several brightnesses. --profile physical loses photons with the light.",
        names.join(", ")
    );
    Some(Alert::new(AlertKind::Noise, text))
}

/// The light readings of a run in which the light ratio r does not depend on the level: each level is then the same noisy sample,
/// multiplied.
fn constant(manifest: &RunManifest) -> impl Iterator<Item = &str> {
    let readings = manifest.columns.get("reading").into_iter().flatten();
    readings
        .filter(|(_, content)| content["--coupling"] == "independent")
        .map(|(name, _)| name.as_str())
}
