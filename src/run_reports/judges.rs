//! The judges of runs of open questions that are joined: marks of two judges are not compared ([`check`]).

use std::path::PathBuf;

use serde_json::Value;

use super::settings::{Settings, decisive, differing};
use crate::error::{Error, Result};
use crate::runs::mark_index::{JUDGE, PROTOCOL};
use crate::runs::stored::StoredRun;
use crate::types::OpenDetail;
use crate::types::manifests::{JUDGES, RunManifest, judge_flag};

/// Checks that all runs were marked by one judge and protocol.
///
/// # Errors
/// If they were not.
pub(super) fn check(runs: &[StoredRun<OpenDetail>]) -> Result<()> {
    let mut marked: Option<(&PathBuf, [Option<Value>; 2])> = None;
    for run in runs {
        let by = [JUDGE, PROTOCOL].map(|name| run.manifest.settings.get(name).cloned());
        match &marked {
            Some((other, other_by)) if *other_by != by => {
                let path = run.folder.clone();
                let problem = format!(
                    "its answers were marked by {} and those of {} by {}: marks of two judges or protocols cannot be compared; report \
                     each run alone, or run openeqa on its folder again with the other's --judge and --protocol: only marks are asked",
                    judged(&by),
                    other.display(),
                    judged(other_by)
                );
                return Err(Error::Run { path, problem });
            }
            Some(_) => {}
            None => marked = Some((&run.folder, by)),
        }
    }
    check_one_name(runs)
}

/// Checks that judges of one name are the same: their marks are not told apart.
fn check_one_name(runs: &[StoredRun<OpenDetail>]) -> Result<()> {
    let judges: Vec<Option<Settings>> = runs
        .iter()
        .map(|run| judge_settings(&run.manifest))
        .collect();
    let names: Vec<String> = runs.iter().map(StoredRun::name).collect();
    let differences = differing(&judges);
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

/// Settings that determine the marks of a run's judge; `None` if no judge was asked, or the run does not state them.
fn judge_settings(manifest: &RunManifest) -> Option<Settings> {
    let judge = manifest.settings.get(JUDGE)?.as_str()?;
    // Runs of earlier versions have the judge among the models alone.
    let columns = [JUDGES, "model"].map(|column| manifest.columns.get(column)?.get(judge));
    let settings = columns.into_iter().flatten().next().map(decisive)?;
    let of_judge = settings
        .into_iter()
        .map(|(flag, value)| (judge_flag(&flag), value));
    Some(of_judge.collect())
}

/// A judge and a protocol in words.
fn judged([judge, protocol]: &[Option<Value>; 2]) -> String {
    let word = |value: &Option<Value>, other: &str| {
        let word = value.as_ref().and_then(Value::as_str);
        word.unwrap_or(other).to_owned()
    };
    format!("{} ({})", word(judge, "nobody"), word(protocol, "upstream"))
}
