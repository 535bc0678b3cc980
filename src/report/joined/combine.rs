//! Joins several runs of questions with choices: [`combine`].

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

use serde_json::{Value, json};

use super::cost::{PricedRun, TrialCost};
use super::join::{Joined, JoinedRun, join};
use super::listing::listing;
use crate::page::{self, PageInputs, RunPrompts};
use darkqa_ask::prompts::Prompts;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::manifests::RunManifest;
use darkqa_base::types::{
    ChoiceDetail, QuestionId, RunQuestion, SetLight, TextPlace, TrialRef, Trials, Truths, shell_word,
};
use darkqa_runs::stored::StoredRun;
use darkqa_runs::{EXPOSURE_VALUE, LUX_AT_L0, PROMPTS};
use darkqa_score::accuracies::OfferedChoices;
use darkqa_score::cluster::{ClusterUnit, Clusters, FrameTies};
use darkqa_score::findings::Findings;
use darkqa_score::grid::Grid;
use darkqa_score::model_in_condition::without_run;
use darkqa_score::photographs::{PhotographedSet, lux_of_exposure_value};

/// Fields of a run's identity: the digest of the prompt templates, and whether images precede the text.
const IDENTITY_PROMPTS: &str = "--prompts";
const IMAGE_FIRST: &str = "--image-first";

/// Joined runs of questions with choices.
pub(super) type CombinedRuns = Joined<ChoiceDetail>;

impl CombinedRuns {
    /// All results of the runs, computed from their records.
    pub(super) fn findings(&self) -> Findings<'_> {
        let findings = Findings::with_listing(
            &self.trials,
            &frame_ties(&self.questions),
            offered_choices(&self.trials, &self.questions),
            &self.fidelity,
            &self.listing,
        );
        let findings = findings.with_set(self.photographed_set()).with_groups(&self.questions);
        // A model whose replies vary is still the same model.
        self.model_names
            .split
            .iter()
            .filter(|split| split.differs_by_replies_alone())
            .fold(findings, |findings, split| findings.with_lights_between(&split.names))
    }

    /// The light in which the data set was photographed: dark if all runs state so, with the brightness of the first
    /// run that measured it; and in lux, if all runs state the same.
    pub(super) fn photographed_set(&self) -> PhotographedSet {
        let is_dark = |run: &JoinedRun| run.manifest.settings.get("--light") == Some(&json!(SetLight::Dark));
        let stated = |run: &JoinedRun| run.manifest.settings.get(LUX_AT_L0).and_then(Value::as_f64);
        let lux =
            self.runs.first().and_then(stated).filter(|lux| self.runs.iter().all(|run| stated(run) == Some(*lux)));
        let exposure = if lux.is_none() { self.exposure_value() } else { None };
        let lux = lux.or_else(|| exposure.map(|(mean, _)| lux_of_exposure_value(mean)));
        let exposed = exposure.map(|(_, images)| images);
        if self.runs.is_empty() || !self.runs.iter().all(is_dark) {
            return PhotographedSet { lux, exposed, ..PhotographedSet::default() };
        }
        let brightness = self.runs.iter().find_map(|run| {
            let measured = run.manifest.settings.get("brightness")?;
            Some((measured.get("mean")?.as_f64()?, measured.get("frames")?.as_u64()? as usize))
        });
        PhotographedSet { light: SetLight::Dark, brightness, lux, exposed }
    }

    /// Mean exposure value at ISO 100 of the images of all runs, and their number; `None` if a run does not state it.
    fn exposure_value(&self) -> Option<(f64, usize)> {
        let stated = |run: &JoinedRun| {
            let value = run.manifest.settings.get(EXPOSURE_VALUE)?;
            Some((value.get("mean")?.as_f64()?, value.get("frames")?.as_u64()? as usize))
        };
        let all: Vec<(f64, usize)> = self.runs.iter().map(stated).collect::<Option<_>>()?;
        let images: usize = all.iter().map(|(_, images)| images).sum();
        let sum: f64 = all.iter().map(|(mean, images)| mean * *images as f64).sum();
        (images > 0).then(|| (sum / images as f64, images))
    }

    /// Whether true answers are known. [`combine`] checks that they are known for all questions or for none.
    pub(super) fn truths(&self) -> Truths {
        match self.trials.first() {
            Some(trial) if trial.truth().is_none() => Truths::Unknown,
            _ => Truths::Known,
        }
    }

    /// The unit treated as independent, for example the scene.
    pub(super) fn unit(&self) -> ClusterUnit {
        clusters(&self.trials, &self.questions).unit()
    }

    /// The trials by subject and item.
    pub(super) fn grid(&self) -> Grid<'_> {
        Grid::new(&self.trials, &clusters(&self.trials, &self.questions))
    }

    /// Inputs of the HTML page that a report does not have: runs, questions, thumbnails and texts.
    pub(super) fn page_inputs(&self) -> PageInputs<'_> {
        PageInputs {
            runs: self
                .runs
                .iter()
                .map(|run| page::PageRun {
                    folder: command_path(&run.folder),
                    name: run.name.clone(),
                    manifest: &run.manifest,
                    usage: Some(page::RunUsage::new(self.trials_of(run), |model| {
                        run.manifest.is_built_in(without_run(model))
                    })),
                    cost: run.cost.clone(),
                })
                .collect(),
            questions: Box::new(|wanted| {
                let mut found = HashMap::new();
                for texts in &self.texts {
                    texts.questions(wanted, &mut found)?;
                }
                Ok(found)
            }),
            thumbnails: &self.thumbnails,
            costs: Box::new(|| {
                let mut costs = HashMap::new();
                self.each_cost(|trial, cost| {
                    costs.extend(cost.and_then(TrialCost::all).map(|dollars| (trial.text(), dollars)));
                })?;
                Ok(costs)
            }),
            prompts: self.prompts(),
            texts: Box::new(|place: TextPlace| self.texts[place.log()].text(place)),
        }
    }

    /// Calls `each` with every trial and its cost; `None` if the price of its model is unknown. A trial that several
    /// runs share comes once, at the prices of the first one.
    ///
    /// # Errors
    /// If the prices in a manifest are broken.
    pub(super) fn each_cost<'c>(&'c self, mut each: impl FnMut(TrialRef<'c>, Option<TrialCost>)) -> Result<()> {
        let mut is_counted = vec![false; self.trials.len()];
        for run in &self.runs {
            let mut priced = PricedRun::new(&run.manifest)?;
            for place in run.trials.iter() {
                if !std::mem::replace(&mut is_counted[place], true) {
                    let trial = self.trials.at(place);
                    let model = self.model_names.original_name(trial.model());
                    each(trial, priced.trial_cost(model, trial));
                }
            }
        }
        Ok(())
    }

    /// The prompts of the runs; `None` if a run does not store its templates, the runs have different prompts, or no model
    /// is at an endpoint.
    fn prompts(&self) -> Option<RunPrompts> {
        let (first, others) = self.runs.split_first()?;
        let identity = |run: &'_ JoinedRun, name: &str| run.manifest.identity.get(name).cloned();
        let is_same = |other: &JoinedRun| {
            [IDENTITY_PROMPTS, IMAGE_FIRST].iter().all(|name| identity(other, name) == identity(first, name))
        };
        if !others.iter().all(is_same) {
            return None;
        }
        let digest = identity(first, IDENTITY_PROMPTS)?;
        let templates = Prompts::from_stored(digest.as_str()?, first.manifest.settings.get(PROMPTS))?;
        let models: BTreeSet<&str> = self.trials.asked().into_iter().flatten().map(|(model, _)| model).collect();
        let sent = |model: &str| {
            let name = self.model_names.original_name(model);
            let column = self.runs.iter().find_map(|run| run.manifest.columns.get("model")?.get(name))?;
            // Built-in models are sent no prompt.
            column.get("--wire")?;
            Some((model.to_owned(), column.get("--system").and_then(Value::as_str).map(str::to_owned)))
        };
        let models: BTreeMap<String, Option<String>> = models.into_iter().filter_map(sent).collect();
        let image_first = identity(first, IMAGE_FIRST).is_some();
        (!models.is_empty()).then_some(RunPrompts { templates, image_first, models })
    }

    /// The manifest and the folder of each run.
    pub(super) fn manifests(&self) -> Vec<(&RunManifest, &Path)> {
        self.runs.iter().map(|run| (&run.manifest, &*run.folder)).collect()
    }
}

/// A folder as it is shown in a command, quoted for a shell. Of an absolute path only the name is shown, after `DIR/`,
/// so that a page does not reveal where the user's files are.
pub(super) fn command_path(folder: &Path) -> String {
    let shown = match folder.file_name() {
        Some(name) if folder.is_absolute() => Path::new("DIR").join(name),
        _ => folder.to_owned(),
    };
    shell_word(&shown.display().to_string()).into_owned()
}

/// The scenes, further images and digests that questions state for their frames. If runs have other files under the
/// same name, the first counts.
pub(super) fn frame_ties<'a>(questions: impl IntoIterator<Item = &'a RunQuestion>) -> FrameTies {
    let mut ties = FrameTies::default();
    for question in questions {
        let frame = &question.frame;
        if !question.scene.is_empty() {
            ties.scenes.insert(frame.clone(), question.scene.clone());
        }
        if !question.images.is_empty() {
            ties.images.insert(frame.clone(), question.images.clone());
        }
        if let Some(digest) = question.image {
            ties.digests.entry(frame.clone()).or_insert(digest);
        }
    }
    ties
}

/// The clusters of trials, based on the scenes and images that the questions state.
pub(super) fn clusters<'a>(
    trials: &Trials<ChoiceDetail>,
    questions: impl IntoIterator<Item = &'a RunQuestion>,
) -> Clusters {
    Clusters::new(trials.questions(), &frame_ties(questions))
}

/// Joins runs after checking that they can be compared.
///
/// # Errors
/// If a run shares no question with the others, a question has other choices or another truth in two runs, or the true
/// answers are known for some questions and not for others.
pub(super) fn combine(runs: Vec<StoredRun<ChoiceDetail>>) -> Result<CombinedRuns> {
    check_one_measure(&runs)?;
    if runs.len() > 1 {
        check_comparable(&runs)?;
    }
    let mut combined = join(runs, |_| true)?;
    combined.listing = listing(&combined);
    Ok(combined)
}

/// The number of choices of each question, for chance accuracy, with the number of orders in which they were asked,
/// because each order is answered separately. A question that is not asked yet has one order. Questions come from both
/// the trials and the stored questions.
fn offered_choices(trials: &Trials<ChoiceDetail>, questions: &[RunQuestion]) -> Vec<OfferedChoices> {
    let mut orders = BTreeMap::<&QuestionId, BTreeSet<&[String]>>::new();
    let mut all = BTreeMap::<&QuestionId, OfferedChoices>::new();
    for item in trials.items().into_iter().flatten() {
        orders.entry(&item.question).or_default().insert(&item.choices);
        all.entry(&item.question).or_insert_with(|| OfferedChoices {
            family: item.family.as_ref().clone(),
            choices: item.choices.len(),
            orders: 1,
        });
    }
    for question in questions {
        all.entry(&question.id).or_insert_with(|| OfferedChoices {
            family: question.family.clone(),
            choices: question.choices.len(),
            orders: 1,
        });
    }
    all.into_iter()
        .map(|(question, offer)| OfferedChoices { orders: orders.get(question).map_or(1, BTreeSet::len), ..offer })
        .collect()
}

/// Checks that true answers are known for all questions or for none, because accuracy and self-agreement are different
/// measures.
fn check_one_measure(runs: &[StoredRun<ChoiceDetail>]) -> Result<()> {
    let mut first: Option<(&Path, bool)> = None;
    for run in runs {
        for item in run.trials.items().into_iter().flatten() {
            let is_known = item.truth.is_some();
            let (folder, known) = *first.get_or_insert((&run.folder, is_known));
            if known == is_known {
                continue;
            }
            let problem = if folder == run.folder {
                format!(
                    "nobody knows the true choice of the question {} or of others, and that of the rest is known: these are not the records of one \
                     run",
                    item.question
                )
            } else {
                format!(
                    "the true answers are known of the questions of one run and not of the other, {}: accuracy and agreement are different \
                     measures; report each run alone",
                    folder.display()
                )
            };
            let path = run.folder.clone();
            return Err(Error::Run { path, problem });
        }
    }
    Ok(())
}

/// Checks that runs can be compared.
///
/// # Errors
/// As for [`combine`].
pub(super) fn check_comparable(runs: &[StoredRun<ChoiceDetail>]) -> Result<()> {
    check_one_measure(runs)?;
    let mut questions = BTreeMap::<&QuestionId, (usize, BTreeSet<&String>, Option<&String>)>::new();
    for (index, run) in runs.iter().enumerate() {
        let (mut shared, others) = (false, !questions.is_empty());
        // The first by name, because the order of the replies varies.
        let mut differing: Option<(&QuestionId, usize)> = None;
        for item in run.trials.items().into_iter().flatten() {
            let choices: BTreeSet<&String> = item.choices.iter().collect();
            let truth = item.truth.map(|truth| item.choices.get(truth));
            if truth == Some(None) {
                let problem = format!("a record of the question {} has no true choice", item.question);
                return refuse(run, problem);
            }
            let truth = truth.flatten();
            let (first, known, known_truth) =
                questions.entry(&item.question).or_insert_with(|| (index, choices.clone(), truth));
            shared |= *first != index;
            let differs = (&*known, *known_truth) != (&choices, truth);
            if differs && differing.is_none_or(|(other, _)| *item.question < *other) {
                differing = Some((&item.question, *first));
            }
        }
        if let Some((question, first)) = differing {
            let problem = format!(
                "the question {question} has other choices or another true choice in {}; report each run alone",
                runs[first].folder.display()
            );
            return refuse(run, problem);
        }
        if others && !shared {
            let problem =
                format!("the run shares no question with {}; report each run alone", runs[0].folder.display());
            return refuse(run, problem);
        }
    }
    Ok(())
}

fn refuse(run: &StoredRun<ChoiceDetail>, problem: String) -> Result<()> {
    let path = run.folder.clone();
    Err(Error::Run { path, problem })
}
