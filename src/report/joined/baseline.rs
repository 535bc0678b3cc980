//! `report --baseline`: comparison of new runs with an old one ([`Baseline`]).

use std::collections::{BTreeMap, BTreeSet};

use super::alerts::run_alerts;
use super::combine::{CombinedRuns, check_comparable, clusters};
use super::cost::{PricedRun, TrialCost};
use super::image_groups::has_same_image_settings;
use super::join::join;
use crate::content::Report;
use crate::sentences::{against_baseline, no_verdict};
use crate::tables::baseline;
use crate::text::alert::{Alert, AlertKind};
use crate::text::words::{first_names, name};
use darkqa_base::error::{Error, Result};
use darkqa_base::types::{ChoiceDetail, TrialRef};
use darkqa_runs::stored::StoredRun;
use darkqa_score::accuracies::healths;
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::{BaselineRow, baseline_rows};
use darkqa_score::findings::Findings;
use darkqa_score::grid::Grid;
use darkqa_score::model_in_condition::{ModelInCondition, is_control, is_observer};
use darkqa_score::significance::Verdict;

/// The flag that makes the command fail if a model got worse.
pub(super) const FAIL_IF_WORSE: &str = "--fail-if-worse";

/// Maximum number of conditions in a message; chosen.
const MAX_NAMED: usize = 3;

/// Comparison of new runs with an old one.
pub(super) struct Baseline {
    rows: Vec<BaselineRow>,
    /// The name of the old run.
    old: String,
    /// Differences between the new runs and the old one.
    alerts: Vec<Alert>,
    /// Models under test in conditions of the old run that are not compared, by their names in the old run.
    missing: Vec<ModelInCondition>,
    /// Models under test that only the new runs have.
    added: BTreeSet<String>,
}

/// Cost of each model in each condition, in US dollars. Subjects without a trial of known cost are missing.
#[derive(Default)]
struct SubjectCosts(BTreeMap<ModelInCondition, f64>);

impl SubjectCosts {
    /// The costs of joined runs.
    ///
    /// # Errors
    /// If the prices in a manifest are broken.
    fn from_joined(combined: &CombinedRuns) -> Result<Self> {
        let mut costs = Self::default();
        combined.each_cost(|trial, cost| costs.add(trial, cost))?;
        Ok(costs)
    }

    fn add(&mut self, trial: TrialRef<'_>, cost: Option<TrialCost>) {
        if let Some(dollars) = cost.and_then(TrialCost::all) {
            *self.0.entry(ModelInCondition::from_trial(trial)).or_default() += dollars;
        }
    }
}

impl Baseline {
    /// Compares the new runs with the old one. `combined` joins the runs of `new`.
    ///
    /// # Errors
    /// If they share no question, or a shared question has other choices or another true choice.
    pub(super) fn new(
        combined: &CombinedRuns,
        new: Vec<StoredRun<ChoiceDetail>>,
        old: StoredRun<ChoiceDetail>,
    ) -> Result<Self> {
        let name = old.name();
        let mut runs = new;
        runs.push(old.clone());
        check_comparable(&runs)?;
        // Models and conditions are matched by name: a new model is compared with the old one of the same name.
        let has_other_form = new_of(&runs).iter().any(|run| !run.manifest.has_same_image_bytes(&old.manifest));
        let takes_as_same =
            has_other_form && new_of(&runs).iter().all(|run| has_same_image_settings(&run.manifest, &old.manifest));
        let mut alerts = run_alerts(&join(runs, |_| true)?);
        if takes_as_same {
            let text = format!(
                "The PNG files of {name} have an earlier form: images count as the same because their settings are, and their bytes are not compared."
            );
            alerts.push(Alert::new(AlertKind::Images, text));
        }
        let (mut trials, mut old_trials) = (combined.trials.clone(), old.trials);
        old_trials.rename(|model| Some(baseline_name(&name, model)));
        let logs = trials.logs();
        for trial in old_trials.iter() {
            trials.copy(trial, logs);
        }
        let questions = combined.questions.iter().chain(&old.questions);
        let clusters = clusters(&trials, questions);
        let grid = Grid::for_models(&trials, &clusters, &combined.listing, |_| true);
        let pairs: Vec<(usize, usize)> = grid
            .subjects
            .iter()
            .enumerate()
            // Controls test the observer, not models.
            .filter(|(_, subject)| !is_control(&subject.model))
            .filter_map(|(index, subject)| {
                let old = ModelInCondition {
                    model: baseline_name(&name, combined.model_names.original_name(&subject.model)),
                    ..subject.in_any_light()
                };
                Some((index, grid.find(&old)?))
            })
            .collect();
        let mut costs = SubjectCosts::from_joined(combined)?;
        let suffix = baseline_name(&name, "");
        let mut old_run = PricedRun::new(&old.manifest)?;
        for trial in old_trials.iter() {
            let marked = trial.model();
            let model = marked.strip_suffix(&suffix).unwrap_or(marked);
            costs.add(trial, old_run.trial_cost(model, trial));
        }
        let rows = baseline_rows(&grid, &healths(&grid), &pairs, !takes_as_same, |index| {
            costs.0.get(&grid.subjects[index]).copied()
        });
        let compared: BTreeSet<usize> = pairs
            .iter()
            .filter(|(new, _)| rows.iter().any(|row| row.subject == grid.subjects[*new]))
            .map(|(_, old)| *old)
            .collect();
        let is_tested = |subject: &ModelInCondition| !subject.is_reference() && !is_control(&subject.model);
        let missing = grid
            .subjects
            .iter()
            .enumerate()
            .filter(|(index, _)| !compared.contains(index))
            .filter_map(|(_, subject)| {
                let model = subject.model.strip_suffix(&suffix)?.to_owned();
                Some(ModelInCondition { model, ..subject.clone() })
            })
            .filter(is_tested)
            .collect();
        let added = grid
            .subjects
            .iter()
            .filter(|subject| is_tested(subject) && !subject.model.ends_with(&suffix))
            .filter(|subject| !rows.iter().any(|row| row.subject.model == subject.model))
            .map(|subject| subject.model.clone())
            .collect();
        Ok(Self { rows, old: name, alerts, missing, added })
    }

    /// The sentence about conditions of the old run that are not compared, with the reason; `None` if all are.
    fn missing_sentence(&self) -> Option<String> {
        let old = &self.old;
        let missing: Vec<String> = self.missing.iter().map(name).collect();
        let are = match missing.len() {
            0 => return None,
            1 => "is",
            _ => "are",
        };
        let named = first_names(&missing, MAX_NAMED);
        let conditions = format!("{named} of {old} {are} not compared");
        let reason = if !self.added.is_empty()
            && self.missing.iter().all(|subject| !self.rows.iter().any(|row| row.subject.model == subject.model))
        {
            let added: Vec<&str> = self.added.iter().map(String::as_str).collect();
            format!(
                "the new model is {}, and models are compared by their names, which `name` in a file of --models sets",
                added.join(", ")
            )
        } else {
            "the new run has no reply about the same images".to_owned()
        };
        Some(format!("{conditions}: {reason}"))
    }

    /// Adds the comparison to a report: its sentences first, its table below the table of levels. The observer is left
    /// out if a control has invalidated it.
    pub(super) fn add_to(&self, report: &mut Report<'_>, findings: &Findings<'_>) {
        let is_hidden = findings.observer.is_hidden();
        let rows: Vec<BaselineRow> =
            self.rows.iter().filter(|row| !(is_hidden && is_observer(&row.subject.model))).cloned().collect();
        let sentences = against_baseline(&rows, &self.old, findings.unit);
        report.sentences.splice(..0, sentences);
        let place = report.tables.len().min(2);
        report.tables.insert(place, baseline(&rows, &self.old));
        let missing_alert = self.missing_sentence().map(|text| Alert::new(AlertKind::Items, format!("{text}.")));
        for alert in self.alerts.iter().chain(&missing_alert) {
            if !report.alerts.contains(alert) {
                report.alerts.push(alert.clone());
            }
        }
        report.alerts.sort_by_key(|alert| alert.kind);
    }

    /// True if any model is significantly worse in any condition. `random`, the observer and its controls do not count
    /// as models.
    ///
    /// # Errors
    /// If a condition of the old run is not compared or has no verdict, or if no model can be compared.
    pub(super) fn is_worse(&self, unit: ClusterUnit) -> Result<bool> {
        let models: Vec<&BaselineRow> = self.rows.iter().filter(|row| !row.subject.is_reference()).collect();
        let old = &self.old;
        if models.iter().any(|row| row.paired.tested.verdict == Verdict::Worse) {
            return Ok(true);
        }
        if let Some(missing) = self.missing_sentence() {
            return refuse(&missing);
        }
        if models.is_empty() {
            return refuse(&format!(
                "no model can be compared with {old}: none answered the same question about the same image in both (random and the \
                 observer do not count)"
            ));
        }
        let undecided: Vec<&BaselineRow> =
            models.into_iter().filter(|row| !row.paired.tested.verdict.is_decided()).collect();
        if !undecided.is_empty() {
            let conditions: Vec<String> = undecided.iter().map(|row| name(&row.subject)).collect();
            return refuse(&format!(
                "no verdict against {old} is possible on {}: {}",
                first_names(&conditions, MAX_NAMED),
                no_verdict(&undecided, unit)
            ));
        }
        Ok(false)
    }
}

fn refuse(problem: &str) -> Result<bool> {
    let problem = format!("{problem}; leave the flag out to see the report");
    Err(Error::usage(FAIL_IF_WORSE, problem))
}

/// The new runs in a list that ends with the old one.
fn new_of(runs: &[StoredRun<ChoiceDetail>]) -> &[StoredRun<ChoiceDetail>] {
    runs.split_last().map_or(&[], |(_, new)| new)
}

fn baseline_name(name: &str, model: &str) -> String {
    format!("{model} (baseline {name})")
}
