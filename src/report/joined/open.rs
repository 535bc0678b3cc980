//! The scores of runs of open questions, and the report on them: [`Scores`].
//!
//! Checks that joined runs of open questions were marked by the same judge: [`check_same_judge`].

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::alerts::{empty_answer_alerts, joining_alerts, missing_alerts, open_early_ends, run_alerts};
use super::combine::command_path;
use super::enhancers;
use super::join::join;
use super::listing::listing;
use super::settings::{FlagValues, differing_settings, reply_settings};
use crate::content::Report;
use crate::openeqa::{MarkedAnswers, ReportedAnswer};
use crate::page::{PageInputs, PageRun};
use crate::tables::EnhancerRow;
use crate::text::alert::{Alert, AlertKind};
use crate::text::words;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::flags::read_word;
use darkqa_base::types::manifests::{JUDGES, RunManifest, judge_flag};
use darkqa_base::types::{ModelListing, OpenDetail, QuestionId, Record, RunQuestion, Step, Thumbnail, TrialRef};
use darkqa_runs::mark_index::{JUDGE, MarkIndex, PROTOCOL};
use darkqa_runs::predictions::{AnswerState, QuestionAnswer, predictions};
use darkqa_runs::stored::{RunLayout, StoredRun, sort_trials, text_setting};
use darkqa_score::choice::llm_match::{Protocol, mark};
use darkqa_score::model_in_condition::ModelInCondition;
use darkqa_score::open::{AnswerOutcome, Group, OpenSummary, QuestionGroups, ScoredAnswer, open_summary_listed};

/// Scored answers of a run, or of several joined into one.
pub struct Scores {
    pub run: OpenQuestionRun,
    judge: Option<String>,
    protocol: Protocol,
    summary: OpenSummary,
    answers: Vec<ReportedAnswer>,
    alerts: Vec<Alert>,
    enhancers: Vec<EnhancerRow>,
}

/// Alerts about answers without a score; empty if no answer is scored, because the run has no judge.
fn unscored_alerts(summary: &OpenSummary) -> Vec<Alert> {
    let cells = summary.cells.iter().filter(|cell| cell.group == Group::All);
    if cells.clone().all(|cell| cell.scored() == 0) {
        return Vec::new();
    }
    let counts: Vec<_> = cells.map(|cell| (&cell.subject, [cell.planned - cell.scored(), cell.planned])).collect();
    missing_alerts(&counts, "Scores")
}

impl Scores {
    /// Scores a run by the marks of the judge in its manifest.
    pub(super) fn new(joined: JoinedRuns) -> Result<Self> {
        let JoinedRuns { run, mut alerts, enhancers, listing } = joined;
        let judge = text_setting(&run.manifest, JUDGE).map(str::to_owned);
        let protocol = text_setting(&run.manifest, PROTOCOL).map_or(Ok(Protocol::Upstream), read_word)?;
        let ids: Vec<&QuestionId> = run.questions.iter().map(|question| &question.id).collect();
        let predictions = predictions(&run.records, &ids, protocol);
        let marks = marks(&run, judge.as_deref());
        let failures = failures(&run.records);
        let (mut scored, mut answers) = (Vec::new(), Vec::new());
        for prediction in predictions {
            let question = ids[prediction.question];
            let mark_record = match &prediction.state {
                AnswerState::Text { answer, .. } => marks.get(question, answer).copied(),
                AnswerState::Missing | AnswerState::Null => None,
            };
            let outcome = outcome(&prediction, mark_record, protocol);
            let failure =
                failures.get(&(question, prediction.subject.clone())).filter(|_| outcome == AnswerOutcome::Missing);
            scored.push(ScoredAnswer {
                subject: prediction.subject.clone(),
                question: prediction.question,
                outcome,
                cut: matches!(prediction.state, AnswerState::Text { cut: true, .. }),
            });
            answers.push(ReportedAnswer {
                subject: prediction.subject,
                question: prediction.question,
                answer: prediction.full_answer,
                outcome,
                judgement: mark_record.and_then(|record| record.reply.clone()),
                failure: failure.cloned(),
            });
        }
        let groups: Vec<QuestionGroups> = run.questions.iter().map(question_groups).collect();
        let summary = open_summary_listed(&scored, &groups, &listing);
        alerts.extend(unscored_alerts(&summary));
        alerts.sort_by_key(|alert| alert.kind);
        Ok(Self { run, judge, protocol, summary, answers, alerts, enhancers })
    }

    /// True if the mark of an answer cannot be parsed.
    pub(super) fn has_unmarked(&self) -> bool {
        self.answers.iter().any(|answer| answer.outcome == AnswerOutcome::Unmarked)
    }

    pub(super) fn summary(&self) -> &OpenSummary {
        &self.summary
    }

    /// The report on the scores.
    pub(super) fn report(&self) -> Report<'_> {
        let answers = MarkedAnswers {
            summary: &self.summary,
            manifest: &self.run.manifest,
            judge: self.judge.as_deref(),
            protocol: self.protocol,
            runs: self.run.runs(),
            folder: command_path(&self.run.folder),
            questions: &self.run.questions,
            answers: &self.answers,
            thumbnails: &self.run.thumbnails,
        };
        Report::from_marked_answers(answers, &self.alerts, &self.enhancers)
    }
}

/// A run of open questions, or several joined into one, with complete records.
pub struct OpenQuestionRun {
    /// Name of the run; the first one's if several are joined.
    name: String,
    pub folder: PathBuf,
    pub layout: RunLayout,
    pub manifest: RunManifest,
    /// Ordered by question, condition and model.
    pub records: Vec<Record<OpenDetail>>,
    pub questions: Vec<RunQuestion>,
    pub thumbnails: Vec<Thumbnail>,
    /// Joined runs after the first.
    others: Vec<OtherRun>,
}

/// A run joined to the first one.
struct OtherRun {
    name: String,
    folder: PathBuf,
    manifest: RunManifest,
}

impl OpenQuestionRun {
    /// Names and manifests of all runs.
    fn runs(&self) -> Vec<(&str, &RunManifest)> {
        let first = std::iter::once((&*self.name, &self.manifest));
        let others = self.others.iter().map(|run| (&*run.name, &run.manifest));
        first.chain(others).collect()
    }

    /// Manifests and folders of all runs.
    pub(super) fn manifests(&self) -> Vec<(&RunManifest, &Path)> {
        let others = self.others.iter().map(|run| (&run.manifest, &*run.folder));
        std::iter::once((&self.manifest, &*self.folder)).chain(others).collect()
    }

    /// Inputs of the HTML page that its report does not have. The report has questions, replies and thumbnails itself.
    pub(super) fn page_inputs(&self) -> PageInputs<'_> {
        PageInputs {
            runs: self
                .runs()
                .into_iter()
                .zip(self.manifests())
                .map(|((name, manifest), (_, folder))| PageRun {
                    name: name.to_owned(),
                    folder: command_path(folder),
                    manifest,
                    usage: None,
                    cost: None,
                })
                .collect(),
            questions: Box::new(|_| Ok(HashMap::new())),
            thumbnails: &[],
            costs: Box::new(|| Ok(HashMap::new())),
            prompts: None,
            texts: Box::new(|_| Ok(String::new())),
        }
    }
}

/// Several runs joined into one.
pub(super) struct JoinedRuns {
    pub(super) run: OpenQuestionRun,
    /// Alerts about differences between the runs and faults in their numbers.
    pub(super) alerts: Vec<Alert>,
    /// Use of each enhancer.
    enhancers: Vec<EnhancerRow>,
    /// Order, groups and marks of the models.
    pub(super) listing: ModelListing,
}

/// Joins several runs into one by [`join`], with alerts about differences between them.
///
/// # Errors
/// If the runs have different judges or protocols, or different questions under the same name.
pub(super) fn combine(runs: Vec<StoredRun<OpenDetail>>) -> Result<JoinedRuns> {
    check_same_judge(&runs)?;
    check_questions(&runs)?;
    let joined = join(runs, is_answer)?;
    let mut alerts = run_alerts(&joined);
    alerts.extend(joining_alerts(&joined));
    alerts.extend(open_early_ends(&joined));
    if joined.runs.len() == 1 {
        // The text and the page of a single run describe what is missing in more detail.
        alerts.retain(|alert| alert.kind != AlertKind::NotComplete);
    }
    let enhancers = enhancers::rows(&joined.runs);
    let listing = listing(&joined);
    let mut runs = joined.runs.into_iter();
    let first = runs.next().ok_or_else(|| Error::usage("RUN", "no run is named"))?;
    let mut trials = joined.trials;
    let ids = joined.questions.iter().map(|question| &question.id);
    sort_trials(&mut trials, ids, &first.manifest.models);
    let mut records: Vec<Record<OpenDetail>> = trials.iter().map(TrialRef::record).collect();
    // Marks keep the name under which the judge was asked, because a model listed under two names may also be the
    // judge.
    for record in records.iter_mut().filter(|record| record.detail.step == Step::Mark) {
        record.model = joined.model_names.original_name(&record.model).to_owned();
    }
    alerts.extend(empty_answer_alerts(&records));
    let run = OpenQuestionRun {
        records,
        others: runs.map(|run| OtherRun { name: run.name, folder: run.folder, manifest: run.manifest }).collect(),
        name: first.name,
        folder: first.folder,
        layout: first.layout,
        manifest: first.manifest,
        questions: joined.questions,
        thumbnails: joined.thumbnails,
    };
    Ok(JoinedRuns { run, alerts, enhancers, listing })
}

/// Checks that questions with the same name are the same in all runs; their images may differ.
fn check_questions(runs: &[StoredRun<OpenDetail>]) -> Result<()> {
    let mut first_seen = HashMap::<&QuestionId, &RunQuestion>::new();
    for run in runs {
        for question in &run.questions {
            let known = first_seen.entry(&question.id).or_insert(question);
            if !known.is_same(&RunQuestion { image: None, ..question.clone() }) {
                let problem =
                    format!("the question {} is different in the other runs; report each run alone", question.id);
                let path = run.folder.clone();
                return Err(Error::Run { path, problem });
            }
        }
    }
    Ok(())
}

/// True if the trial asked for an answer, false if it asked for a mark. `TrialRef::is_answer` does not coerce to the
/// `Fn` that [`join`] takes.
fn is_answer(trial: TrialRef<'_, OpenDetail>) -> bool {
    trial.is_answer()
}

/// Successful marks by the judge of a run.
fn marks<'a>(run: &'a OpenQuestionRun, judge: Option<&str>) -> MarkIndex<&'a Record<OpenDetail>> {
    let mut marks = MarkIndex::new(&run.questions);
    for record in &run.records {
        if Some(&*record.model) != judge || record.failure.is_some() {
            continue;
        }
        if let (Step::Mark, Some(answer)) = (record.detail.step, &record.detail.judged) {
            marks.add(&record.question, answer, record);
        }
    }
    marks
}

/// Kind and message of the error of each failed answer, by question and subject.
fn failures(records: &[Record<OpenDetail>]) -> BTreeMap<(&QuestionId, ModelInCondition), String> {
    records
        .iter()
        .filter(|record| record.detail.step == Step::Answer)
        .filter_map(|record| {
            let failure = record.failure.as_ref()?;
            let kind = words::failure_reason(failure.kind, failure.status);
            let subject = ModelInCondition::new(&record.model, record.condition.as_ref());
            let text = format!("{kind}: {}", failure.message);
            Some(((&record.question, subject), text))
        })
        .collect()
}

/// Outcome of an answer, given the record of its mark.
fn outcome(prediction: &QuestionAnswer, mark_record: Option<&Record<OpenDetail>>, protocol: Protocol) -> AnswerOutcome {
    match (&prediction.state, mark_record) {
        (AnswerState::Missing, _) => AnswerOutcome::Missing,
        (AnswerState::Null, _) => AnswerOutcome::Null,
        (AnswerState::Text { .. }, None) => AnswerOutcome::Unjudged,
        (AnswerState::Text { .. }, Some(record)) => {
            // Marks of earlier versions are parsed again, so that all tables use the same reading.
            let reply = record.reply.as_deref().unwrap_or_default();
            mark(reply, protocol).map_or(AnswerOutcome::Unmarked, AnswerOutcome::Marked)
        }
    }
}

/// Groups of a question. Its split is the first part of the episode's name.
fn question_groups(question: &RunQuestion) -> QuestionGroups {
    let episode = question.frame.0.clone();
    QuestionGroups {
        split: episode.split('/').next().unwrap_or_default().to_owned(),
        category: question.family.name().to_owned(),
        episode,
    }
}

/// Checks that all runs were marked by the same judge and protocol.
///
/// # Errors
/// If two judges or protocols differ.
fn check_same_judge(runs: &[StoredRun<OpenDetail>]) -> Result<()> {
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
    let judges: Vec<Option<FlagValues>> = runs.iter().map(|run| judge_settings(&run.manifest)).collect();
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
fn judge_settings(manifest: &RunManifest) -> Option<FlagValues> {
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
