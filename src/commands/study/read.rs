//! `study read`: imports human answers into a run in which people are listed like a model.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::NonEmptyStringValueParser;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::files::reading;
use crate::report::joined::choice;
use crate::runs::Outcome;
use crate::runs::ShowArgs;
use crate::runs::record_table;
use crate::runs::stored::StoredRun;
use crate::store::now;
use crate::store::{AddressChange, Store, read_questions};
use crate::types::manifests::{Counts, RunManifest, Status};
use crate::types::{
    ChoiceDetail, Condition, Decides, Digest, ParsedAnswer, QuestionId, Record, Reply, StoredDetail as _, TrialKey,
    TrialRef, Trials, UnreadReason,
};
use darkqa_score::answers::record::{Detail, answered};

/// The flags of `study read`.
#[derive(Debug, Args)]
pub(crate) struct ReadArgs {
    /// The folder of the run whose questions were answered
    #[arg(value_name = "RUN", add = Decides::Nothing)]
    pub run: PathBuf,
    /// Files of answers, as the page saves them: lines of {"question", "condition", "person", "answer"}
    #[arg(value_name = "FILE", required = true, add = Decides::Nothing)]
    pub files: Vec<PathBuf>,
    /// The folder of the people's run
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: PathBuf,
    /// The name of the people in tables, next to the names of models
    #[arg(long, value_name = "NAME", default_value = "human", value_parser = NonEmptyStringValueParser::new(), add = Decides::Reply)]
    pub name: String,
    /// How the report is printed.
    #[command(flatten)]
    pub show: ShowArgs,
}

/// A line of a file of answers.
#[derive(Debug, Deserialize)]
struct AnswerLine {
    question: Value,
    condition: String,
    #[serde(default)]
    person: Value,
    /// A letter or the text of a choice; `None` if the person could not answer.
    answer: Option<String>,
}

/// Counts of the imported and rejected lines.
#[derive(Debug, Default)]
struct AnswerCounts {
    answers: usize,
    /// Items that the run did not ask.
    unknown: BTreeSet<String>,
    /// Descriptions of answers that are not a choice of their question.
    no_choice: Vec<String>,
}

/// Maximum number of answers listed in a warning.
const MAX_LISTED: usize = 10;

/// An answer with its place in the files.
struct PlacedAnswer<'a> {
    file: &'a Path,
    /// Number of the line, from 1.
    line: usize,
    answer: AnswerLine,
}

/// Imports answers. Importing a file again changes nothing, and further files add to the run. A later answer of a
/// person to the same question in the same condition replaces the earlier one.
///
/// # Errors
/// If the folder has no run, a line is not an answer, or no answer is to an item of the run.
pub(crate) fn read(args: &ReadArgs) -> Result<Outcome> {
    let instead = "openeqa --answers NAME=FILE reads what people answered";
    let asked_run = StoredRun::open_choices(&args.run, instead)?.with_truths("what people answer is scored by them")?;
    let asked = trials_by_item(&asked_run.trials);
    let mut counts = AnswerCounts::default();
    let mut lines = Vec::new();
    for path in &args.files {
        lines.extend(read_answers(path)?);
    }
    // Checked before the folder is created, so that files of another study do not leave an empty run.
    let known: Vec<(TrialRef<'_>, PlacedAnswer<'_>)> = lines
        .into_iter()
        .filter_map(|line| {
            let answer = &line.answer;
            let (question, condition) = (value_text(&answer.question), answer.condition.clone());
            let place = (&QuestionId(question), &condition.parse::<Condition>().ok()?);
            let trial = asked.get(&place).copied();
            if trial.is_none() {
                counts.unknown.insert(format!("{} at {condition}", place.0));
            }
            Some((trial?, line))
        })
        .collect();
    if known.is_empty() {
        let problem = "no answer in the files is to a question and condition of this run".to_owned();
        let path = args.run.clone();
        return Err(Error::Run { path, problem });
    }
    let people_manifest = people_manifest(&asked_run.manifest, args);
    let mut store = Store::open(&args.out, &people_manifest, AddressChange::Allowed)?;
    store.write_questions(&read_questions(&args.run)?)?;
    let mut people = People::new(store.records()?);
    for (asked, line) in known {
        counts.answers += 1;
        let asked = asked_run.record(asked)?;
        let record = people.record(&asked, &line.answer, &args.name)?;
        counts.no_choice.extend(no_choice_problem(&line, &record));
        if people.is_new(&record) {
            store.append(&record)?;
            people.add(record);
        }
    }
    store.sync()?;
    warn_of_no_choice(&counts.no_choice);
    let mut run = StoredRun::reread(&args.out, people_manifest)?;
    let failed = run.trials.iter().map(TrialRef::failed);
    run.manifest.set_counts(Counts::new(run.trials.len(), failed));
    let mut outcome = choice::write(&store, run, args.show.format())?;
    record_table::update(&args.out, args.show.record_table())?;
    if !args.show.format().is_json() {
        outcome.output.insert_str(0, &summary(&counts));
    }
    Ok(outcome)
}

fn read_answers(path: &Path) -> Result<Vec<PlacedAnswer<'_>>> {
    Ok(reading::json_lines(path)?.into_iter().map(|(line, answer)| PlacedAnswer { file: path, line, answer }).collect())
}

/// Describes an answer that is not a choice of its question; `None` if it is one, or if the person could not tell.
fn no_choice_problem(line: &PlacedAnswer<'_>, record: &Record) -> Option<String> {
    let why = record.detail.strict?.why?;
    let found = line.answer.answer.as_deref().unwrap_or_default();
    let choices = record.detail.choices.join(", ");
    let (file, number, question) = (line.file.display(), line.line, &record.question);
    (why != UnreadReason::CannotTell)
        .then(|| format!("{file}, line {number}: {found:?} is not a choice of {question}: {choices}"))
}

/// Warns about answers that are not a choice. Like those of a model, they count as wrong.
fn warn_of_no_choice(answers: &[String]) {
    let count = answers.len();
    if count == 0 {
        return;
    }
    let mut text = match count {
        1 => "1 answer is not a choice of its question and counts as wrong".to_owned(),
        _ => format!("{count} answers are not choices of their questions and count as wrong"),
    };
    for answer in answers.iter().take(MAX_LISTED) {
        let _ = write!(text, "\n  {answer}");
    }
    if count > MAX_LISTED {
        let _ = write!(text, "\n  and {} more", count - MAX_LISTED);
    }
    tracing::warn!("{text}");
}

/// The text of a string or a number.
fn value_text(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// The first trial with an image of each question and condition.
fn trials_by_item(trials: &Trials<ChoiceDetail>) -> HashMap<(&QuestionId, &Condition), TrialRef<'_>> {
    let mut asked = HashMap::new();
    for trial in trials.iter() {
        if let Some(condition) = trial.condition() {
            asked.entry((trial.question(), condition)).or_insert(trial);
        }
    }
    asked
}

/// The manifest of the run of human answers. Its images are those of the run that the questions came from.
fn people_manifest(run: &RunManifest, args: &ReadArgs) -> RunManifest {
    let identity = [("--model", json!([args.name])), ("people asked about", json!(run.identity))];
    RunManifest {
        schema: ChoiceDetail::SCHEMA.to_owned(),
        status: Status::Started,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        created: now(),
        updated: now(),
        platform: BTreeMap::new(),
        identity: identity.map(|(name, value)| (name.to_owned(), value)).into(),
        columns: BTreeMap::new(),
        models: Vec::new(),
        enhancers: BTreeMap::new(),
        inputs: run.inputs.clone(),
        shard: None,
        part: None,
        settings: BTreeMap::new(),
        images: run.images.clone(),
        reply_reading: ChoiceDetail::REPLY_READING.map(str::to_owned),
        counts: Counts::default(),
    }
}

/// The stored human answers. The first person to answer an item gets repeat 0, the next repeat 1, so that people and
/// models are compared by item.
struct People {
    answers: HashMap<TrialKey, Record>,
    /// The next free repeat of each item.
    next: HashMap<(QuestionId, Option<Condition>), u32>,
}

impl People {
    fn new(stored: Vec<Record>) -> Self {
        let mut people = Self { answers: HashMap::new(), next: HashMap::new() };
        for record in stored {
            let item = (record.question.clone(), record.condition.clone());
            let next = people.next.entry(item).or_default();
            *next = (*next).max(record.detail.repeat + 1);
            people.answers.insert(record.key, record);
        }
        people
    }

    /// The record of an answer.
    fn record(&mut self, asked: &Record, line: &AnswerLine, name: &str) -> Result<Record> {
        let person = value_text(&line.person);
        let place = asked.condition.as_ref().map(ToString::to_string).unwrap_or_default();
        let head = ["darkqa.person/1", name, &person, &asked.question.0, &place];
        let key: TrialKey = Digest::from_parts(head.map(str::as_bytes)).into();
        let next = self.next.entry((asked.question.clone(), asked.condition.clone())).or_default();
        let stored = self.answers.get(&key);
        let repeat = stored.map_or(*next, |stored| stored.detail.repeat);
        *next = (*next).max(repeat + 1);
        let detail = ChoiceDetail { repeat, observed: None, options: None, ..asked.detail.clone() };
        let (question, condition) = (asked.question.clone(), asked.condition.clone());
        let blank = Record::blank(key, question, name, condition, detail);
        let reply = Reply { served_model: Some(person), ..Reply::local(line.answer.clone().unwrap_or_default()) };
        let mut answered = answered(blank, reply)?;
        if line.answer.is_none() {
            let cannot_tell = Some(ParsedAnswer { chosen: None, why: Some(UnreadReason::CannotTell) });
            (answered.detail.strict, answered.detail.lenient) = (cannot_tell, cannot_tell);
        }
        answered.latency_ms = None;
        Ok(answered)
    }

    /// True if a record is not stored yet, or differs from the stored one.
    fn is_new(&self, record: &Record) -> bool {
        self.answers.get(&record.key) != Some(record)
    }

    fn add(&mut self, record: Record) {
        self.answers.insert(record.key, record);
    }
}

fn summary(counts: &AnswerCounts) -> String {
    let mut text = format!("answers imported: {}\n", counts.answers);
    if let Some(first) = counts.unknown.first() {
        let count = counts.unknown.len();
        let _ = writeln!(text, "items in the files that the run did not ask: {count}, as {first}");
    }
    text
}
