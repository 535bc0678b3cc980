//! What is left to ask, as files of a Batch API: the answers first and, when all of them are there, the marks.

use super::Run;
use super::item::{Judged, Open};
use super::plan::{Plan, Shot};
use super::stage::some;
use super::theatre::{Shown, Theatre};
use crate::config::BatchFiles;
use crate::error::Result;
use crate::run::batch::requests::{Requests, remote, told};
use crate::run::trial::Slide;
use crate::run::{Verdict, open_enhancers};
use crate::types::Condition;
use crate::types::manifest::Status;

impl Run<'_> {
    /// Writes the files, and notes their trials in the run as out.
    pub(super) fn export(mut self, files: &BatchFiles) -> Result<Verdict> {
        let kept = self.kept()?;
        let (answered, out) = self.there(&kept)?;
        let there = answered.union(&out).copied().collect();
        let plan = Plan::new(&self.stage, &there)?;
        self.store.write_manifest(&self.manifest)?;
        let written = if plan.left() > 0 {
            self.export_answers(plan, files)?
        } else {
            let marks = self.left_to_mark(&kept, &there);
            let judge = self.stage.judge.as_slice();
            remote(judge)?;
            let mut requests = Requests::<Judged>::new(judge, files, &mut self.store)?;
            requests.add(&Slide::default(), &marks.left)?;
            requests.finish()?
        };
        let folder = self.store.folder();
        Ok(Verdict {
            status: Status::Complete,
            output: told(&written, answered.len(), out.len(), folder)
                + "and after that the same command again, for what is left and the marks\n",
        })
    }

    fn export_answers(
        &mut self,
        plan: Plan,
        files: &BatchFiles,
    ) -> Result<Vec<(std::path::PathBuf, usize)>> {
        remote(&self.stage.askers)?;
        let models = std::mem::take(&mut self.stage.files);
        let (_, enhancers) = open_enhancers(models, &self.config.enhancement)?;
        let mut theatre = Theatre::new(self.config, &self.stage, enhancers);
        let bar = self.progress.bar("writing requests", plan.left());
        let mut requests = Requests::<Open>::new(&self.stage.askers, files, &mut self.store)?;
        let mut unshown = Vec::new();
        for walk in plan.walks {
            let conditions: Vec<&Condition> = Plan::conditions(&walk).into_iter().collect();
            let name = &*self.stage.episodes[walk.episode].name;
            let mut shown = match self
                .cores
                .install(|| theatre.walk(walk.episode, &conditions))
            {
                Ok(shown) => shown,
                Err(problem) => {
                    tracing::debug!("{name}: {problem}");
                    unshown.push(name);
                    Shown::new()
                }
            };
            for Shot { condition, trials } in walk.shots {
                let images = condition.as_ref().map(|condition| shown.remove(condition));
                bar.advance(trials.len());
                let images = match images {
                    None => Vec::new(),
                    Some(Some(images)) => images,
                    // It cannot be shown.
                    Some(None) => continue,
                };
                requests.add(&Slide { condition, images }, &trials)?;
            }
        }
        drop(bar);
        if !unshown.is_empty() {
            tracing::warn!(
                "{} walks cannot be shown and are not in the files: {}",
                unshown.len(),
                some(&unshown)
            );
        }
        requests.finish()
    }
}
