//! Writes a plan: [`NewPlan`].

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::file::{FRAMES, PLAN_FILE, PlanCounts, PlanEstimate, PlanFile, QUESTIONS, SCHEMA};
use super::{PlannedFrame, RunPlan};
use crate::error::{Error, Result};
use crate::files::{UNFINISHED, reading};
use crate::runs::forecast::Forecast;
use crate::store::{self, PLAN};
use crate::types::manifests::Identity;
use crate::types::{Digest, RunQuestion};

/// The contents of a plan to write.
pub(crate) struct NewPlan {
    pub(crate) identity: Identity,
    pub(crate) questions: Vec<RunQuestion>,
    pub(crate) frames: Vec<PlannedFrame>,
    pub(crate) models: Vec<String>,
    pub(crate) command: Option<Vec<String>>,
    /// Number of trials of the whole run.
    pub(crate) trials: usize,
}

impl NewPlan {
    /// Writes the plan into the folder of a run, by renaming a temporary folder. Returns the folder of the plan.
    ///
    /// If an earlier plan of the run has the same questions and frames, the new plan reuses the earlier costs. With new
    /// costs, frames could move to other shards.
    ///
    /// # Errors
    /// If the run has shards of an earlier plan with other questions or frames, or a file cannot be written.
    pub(crate) fn write(mut self, run: &Path, forecast: &Forecast) -> Result<PathBuf> {
        let folder = run.join(PLAN);
        let earlier = RunPlan::read(run)?;
        if let Some(earlier) = &earlier {
            if self.has_same_content(earlier) {
                self.frames.clone_from(&earlier.frames);
            } else if let Some(shard) = first_shard(run)? {
                let problem = format!(
                    "the run has parts of another plan, with other questions or frames ({}); use another --out, or delete the parts",
                    shard.display()
                );
                return Err(Error::Run { path: folder, problem });
            }
        }
        let questions = json_lines(&self.questions)?;
        let frames = json_lines(&self.frames)?;
        let file = serde_json::to_vec_pretty(&self.to_plan_file(&questions, &frames, forecast))
            .map_err(|e| Error::data(PLAN_FILE, e))?;
        let unfinished = run.join(format!(".{PLAN}{UNFINISHED}"));
        if unfinished.exists() {
            remove_folder(&unfinished)?;
        }
        fs::create_dir_all(&unfinished).map_err(|e| Error::file(&unfinished, "create", e))?;
        for (name, content) in [(QUESTIONS, &questions), (FRAMES, &frames), (PLAN_FILE, &file)] {
            let path = unfinished.join(name);
            File::create(&path)
                .and_then(|mut file| {
                    file.write_all(content)?;
                    file.sync_all()
                })
                .map_err(|e| Error::file(&path, "write", e))?;
        }
        if folder.exists() {
            remove_folder(&folder)?;
        }
        fs::rename(&unfinished, &folder).map_err(|e| Error::file(&folder, "write", e))?;
        Ok(folder)
    }

    /// True if an earlier plan has the same questions and frames.
    fn has_same_content(&self, earlier: &RunPlan) -> bool {
        self.questions == earlier.questions
            && self.frames.len() == earlier.frames.len()
            && self.frames.iter().zip(&earlier.frames).all(|(now, before)| now.is_same(before))
    }

    fn to_plan_file(&self, questions: &[u8], frames: &[u8], forecast: &Forecast) -> PlanFile {
        let files = [(QUESTIONS, questions), (FRAMES, frames)]
            .map(|(name, content)| (name.to_owned(), Digest::from_bytes(content)));
        let scenes: BTreeSet<&str> = self.frames.iter().map(|frame| &*frame.scene).collect();
        let seconds = self.frames.iter().map(|frame| frame.cost.seconds).sum();
        PlanFile {
            schema: SCHEMA.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            identity: self.identity.clone(),
            files: BTreeMap::from(files),
            counts: PlanCounts {
                questions: self.questions.len(),
                frames: self.frames.len(),
                scenes: scenes.into_iter().filter(|scene| !scene.is_empty()).count(),
                trials: self.trials,
            },
            estimate: PlanEstimate::new(forecast, seconds),
            models: self.models.clone(),
            command: self.command.clone(),
        }
    }
}

/// Folder of the first shard of a run, if any.
fn first_shard(run: &Path) -> Result<Option<PathBuf>> {
    for path in reading::entries(run)? {
        if path.is_dir() && store::schema(&path)?.is_some() {
            return Ok(Some(path));
        }
    }
    Ok(None)
}

fn remove_folder(folder: &Path) -> Result<()> {
    fs::remove_dir_all(folder).map_err(|e| Error::file(folder, "remove", e))
}

fn json_lines<T: Serialize>(values: &[T]) -> Result<Vec<u8>> {
    let mut lines = Vec::new();
    for value in values {
        serde_json::to_writer(&mut lines, value).map_err(|e| Error::data("plan", e))?;
        lines.push(b'\n');
    }
    Ok(lines)
}
