//! Checks that joined runs of open questions were marked by the same judge: [`check_same_judge`].

use std::path::PathBuf;

use serde_json::Value;

use super::settings::{Settings, differing_settings, reply_settings};
use crate::error::{Error, Result};
use crate::runs::mark_index::{JUDGE, PROTOCOL};
use crate::runs::stored::{StoredRun, text_setting};
use crate::types::OpenDetail;
use crate::types::manifests::{JUDGES, RunManifest, judge_flag};

/// Checks that all runs were marked by the same judge and protocol.
///
/// # Errors
/// If two judges or protocols differ.
pub(super) fn check_same_judge(runs: &[StoredRun<OpenDetail>]) -> Result<()> {
    let mut marked: Option<(&PathBuf, [Option<Value>; 2])> = None;
    for run in runs {
        let by = [JUDGE, PROTOCOL].map(|name| run.manifest.settings.get(name).cloned());
        match &marked {
            Some((other, other_by)) if *other_by != by => {
                let path = run.folder.clone();
                let problem = format!(
                    "its answers were marked by {} and those of {} by {}: marks of two judges or protocols cannot be compared; report \
                     each run alone, or run openeqa on its folder again with the other's --judge and --protocol: only marks are asked",
                    judge_words(&by),
                    other.display(),
                    judge_words(other_by)
                );
                return Err(Error::Run { path, problem });
            }
            Some(_) => {}
            None => marked = Some((&run.folder, by)),
        }
    }
    check_same_settings(runs)
}

/// Checks that judges of the same name have the same settings, because marks are identified by the judge's name.
fn check_same_settings(runs: &[StoredRun<OpenDetail>]) -> Result<()> {
    let judges: Vec<Option<Settings>> = runs.iter().map(|run| judge_settings(&run.manifest)).collect();
    let names: Vec<String> = runs.iter().map(StoredRun::name).collect();
    let differences = differing_settings(&judges);
    let Some(first) = differences.first() else {
        return Ok(());
    };
    let path = runs[first.values[0].0].folder.clone();
    let words: Vec<String> = differences.iter().map(|one| one.words(&names)).collect();
    let problem = format!(
        "the judges of the runs have one name and differ: {}; marks of two judges cannot be compared: report each run alone",
        words.join("; ")
    );
    Err(Error::Run { path, problem })
}

/// Settings that determine the marks of a run's judge; `None` if no judge was asked, or the manifest does not state
/// them.
fn judge_settings(manifest: &RunManifest) -> Option<Settings> {
    let judge = text_setting(manifest, JUDGE)?;
    // Runs of earlier versions list the judge only among the models.
    let columns = [JUDGES, "model"].map(|column| manifest.columns.get(column)?.get(judge));
    let settings = columns.into_iter().flatten().next().map(reply_settings)?;
    Some(settings.into_iter().map(|(flag, value)| (judge_flag(&flag), value)).collect())
}

/// A judge and a protocol in words.
fn judge_words([judge, protocol]: &[Option<Value>; 2]) -> String {
    let judge = judge.as_ref().and_then(Value::as_str);
    let protocol = protocol.as_ref().and_then(Value::as_str);
    format!("{} ({})", judge.unwrap_or("nobody"), protocol.unwrap_or("upstream"))
}
