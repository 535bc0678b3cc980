//! Training data of the enhancers of a run: [`training_data`].

use std::collections::BTreeMap;

use serde_json::Value;

use darkqa_base::types::manifests::RunManifest;
use darkqa_enhance::ModelFile;

/// The data that each enhancer of a run was trained on, by the enhancer's name. Taken from the run's manifest, or else
/// from the built-in enhancer with the same digest.
pub fn training_data(run: &RunManifest) -> BTreeMap<&str, String> {
    run.columns
        .get("enhancer")
        .into_iter()
        .flatten()
        .filter_map(|(name, content)| {
            let noted = run.enhancers.get(name).and_then(|note| note.trained_on());
            let data = noted.map(str::to_owned).or_else(|| {
                let digest = content.get("--llie").and_then(Value::as_str)?;
                ModelFile::built_in_with(digest)?.trained_on().map(str::to_owned)
            })?;
            Some((&**name, data))
        })
        .collect()
}
