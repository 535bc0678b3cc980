//! `--baseline`: new runs against an old one ([`Baseline`]).

use std::collections::{BTreeMap, BTreeSet};

use super::alerts::run_alerts;
use super::combine::{Combined, check_comparable, clusters};
use super::cost::{Charged, PricedRun};
use super::join::join;
use crate::error::{Error, Result};
use crate::report::choice_report::ChoiceReport;
use crate::runs::stored::StoredRun;
use crate::sentences::{against_baseline, no_verdict};
use crate::tables::baseline;
use crate::text::alert::{Alert, AlertKind};
use crate::text::words::{first_names, name};
use crate::types::{ChoiceDetail, TrialRef};
use darkqa_score::accuracies::healths;
use darkqa_score::cluster::ClusterUnit;
use darkqa_score::comparisons::{BaselineRow, baseline_rows};
use darkqa_score::grid::Grid;
use darkqa_score::significance::Significance;
use darkqa_score::subject::{ModelInCondition, is_control, is_observer};

/// The flag that makes a worse model a failure.
pub(super) const FAIL_IF_WORSE: &str = "--fail-if-worse";

/// The most conditions that a message names; chosen.
const MAX_NAMED: usize = 3;

/// New runs against an old one.
pub(super) struct Baseline {
    rows: Vec<BaselineRow>,
    /// The name of the old run.
    old: String,
    /// Differences between the new runs and the old one.
    alerts: Vec<Alert>,
    /// Models under test in conditions of the old run that are not compared, with their names there.
    missing: Vec<ModelInCondition>,
    /// Models under test of the new runs that the old one does not have.
    added: BTreeSet<String>,
}

/// The cost of each model in each condition, in US dollars. A subject of which no trial states its cost has none.
#[derive(Default)]
struct SubjectCosts(BTreeMap<ModelInCondition, f64>);

impl SubjectCosts {
    /// The costs of joined runs, each trial at the prices of the first run that has it.
    ///
    /// # Errors
    /// If the prices in a manifest are broken.
    fn from_joined(combined: &Combined) -> Result<Self> {
        let mut costs = Self::default();
        let mut is_counted = vec![false; combined.trials.len()];
        for run in &combined.runs {
            let mut priced = PricedRun::new(&run.manifest)?;
            for place in run.trials.iter() {
                if !std::mem::replace(&mut is_counted[place], true) {
                    let trial = combined.trials.at(place);
                    let model = combined.models.asked(trial.model());
                    costs.add(trial, priced.charged(model, trial));
                }
            }
        }
        Ok(costs)
    }

    fn add(&mut self, trial: TrialRef<'_>, charged: Option<Charged>) {
        let parts = charged
            .into_iter()
            .flat_map(|charged| [charged.reply, charged.lost]);
        for dollars in parts.flatten() {
            *self
                .0
                .entry(ModelInCondition::from_trial(trial))
                .or_default() += dollars;
        }
    }
}

impl Baseline {
    /// The new runs, which `combined` joins, against the old one.
    ///
    /// # Errors
    /// If they share no question, or one has other choices or another truth.
    pub(super) fn new(
        combined: &Combined,
        new: Vec<StoredRun<ChoiceDetail>>,
        old: StoredRun<ChoiceDetail>,
    ) -> Result<Self> {
        let name = old.name();
        let mut runs = new;
        runs.push(old.clone());
        check_comparable(&runs)?;
        // The names of models and conditions tell nothing apart here: a new model is held against the old one of its name.
        let alerts = run_alerts(&join(runs, |_| true)?);
        let mark = |model: &str| format!("{model} (baseline {name})");
        let (mut trials, mut old_trials) = (combined.trials.clone(), old.trials);
        old_trials.rename(|model| Some(mark(model)));
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
            // A control shows whether the observer can be trusted, not whether a model got worse.
            .filter(|(_, subject)| !is_control(&subject.model))
            .filter_map(|(index, subject)| {
                let old = ModelInCondition {
                    model: mark(combined.models.asked(&subject.model)),
                    ..subject.in_any_light()
                };
                Some((index, grid.find(&old)?))
            })
            .collect();
        let mut costs = SubjectCosts::from_joined(combined)?;
        let mut run = PricedRun::new(&old.manifest)?;
        for trial in old_trials.iter() {
            let marked = trial.model();
            let model = marked.strip_suffix(&mark("")).unwrap_or(marked);
            costs.add(trial, run.charged(model, trial));
        }
        let rows = baseline_rows(&grid, &healths(&grid), &pairs, |index| {
            costs.0.get(&grid.subjects[index]).copied()
        });
        let compared: BTreeSet<usize> = pairs
            .iter()
            .filter(|(new, _)| rows.iter().any(|row| row.subject == grid.subjects[*new]))
            .map(|(_, old)| *old)
            .collect();
        let suffix = mark("");
        let is_tested =
            |subject: &ModelInCondition| !subject.is_reference() && !is_control(&subject.model);
        let missing = grid
            .subjects
            .iter()
            .enumerate()
            .filter(|(index, _)| !compared.contains(index))
            .filter_map(|(_, subject)| {
                let model = subject.model.strip_suffix(&suffix)?.to_owned();
                Some(ModelInCondition {
                    model,
                    ..subject.clone()
                })
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
        Ok(Self {
            rows,
            old: name,
            alerts,
            missing,
            added,
        })
    }

    /// The conditions of the old run that are not compared, with the reason; `None` if all are.
    fn gap(&self) -> Option<String> {
        let old = &self.old;
        let missing: Vec<String> = self.missing.iter().map(name).collect();
        let are = match missing.len() {
            0 => return None,
            1 => "is",
            _ => "are",
        };
        let named = first_names(&missing, MAX_NAMED);
        let conditions = format!("{named} of {old} {are} not compared");
        let is_renamed = |subject: &ModelInCondition| {
            !self
                .rows
                .iter()
                .any(|row| row.subject.model == subject.model)
        };
        let reason = if !self.added.is_empty() && self.missing.iter().all(is_renamed) {
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

    /// Puts the comparison first among the sentences of a report, and below its table of levels. The observer is left out where a
    /// control shows that it proves nothing.
    pub(super) fn add_to(&self, report: &mut ChoiceReport<'_>) {
        let is_hidden = report.findings.observer.is_hidden();
        let rows = self
            .rows
            .iter()
            .filter(|row| !(is_hidden && is_observer(&row.subject.model)));
        let rows: Vec<BaselineRow> = rows.cloned().collect();
        let sentences = against_baseline(&rows, &self.old, report.findings.unit);
        report.sentences.splice(..0, sentences);
        let place = report.tables.len().min(2);
        report.tables.insert(place, baseline(&rows, &self.old));
        let gap = self
            .gap()
            .map(|text| Alert::new(AlertKind::Items, format!("{text}.")));
        for alert in self.alerts.iter().chain(&gap) {
            if !report.alerts.contains(alert) {
                report.alerts.push(alert.clone());
            }
        }
        report.alerts.sort_by_key(|alert| alert.kind);
    }

    /// Whether any model is shown to be worse. `random`, the observer and its controls are no models.
    ///
    /// # Errors
    /// If a model in a condition of the old run is not compared, none can be, or no verdict is possible about any.
    pub(super) fn is_worse(&self, unit: ClusterUnit) -> Result<bool> {
        let models: Vec<&BaselineRow> = self
            .rows
            .iter()
            .filter(|row| !row.subject.is_reference())
            .collect();
        let old = &self.old;
        let none = |problem: String| {
            let problem = format!("{problem}; leave the flag out to see the report");
            Err(Error::usage(FAIL_IF_WORSE, problem))
        };
        let mut verdicts = models.iter().map(|row| row.significance);
        if verdicts.any(|verdict| verdict == Significance::Worse) {
            return Ok(true);
        }
        if let Some(gap) = self.gap() {
            return none(gap);
        }
        if models.is_empty() {
            return none(format!(
                "no model can be compared with {old}: none answered the same question about the same image in both (random and the \
                 observer do not count)"
            ));
        }
        if !models.iter().any(|row| row.significance.is_possible()) {
            return none(format!(
                "no verdict against {old} is possible: {}",
                no_verdict(&models, unit)
            ));
        }
        Ok(false)
    }
}
