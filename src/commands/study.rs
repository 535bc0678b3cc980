//! `study`: collects human answers to the questions of a run.
//!
//! `study pack`: writes a page on which people answer the questions of a run.
//!
//! `study read`: imports human answers into a run in which people are listed like a model.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt::Write;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::NonEmptyStringValueParser;
use serde::Deserialize;
use serde_json::{Value, json};

use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, write};
use darkqa_base::types::manifests::{Counts, RunManifest, Status};
use darkqa_base::types::text::{counted, plural};
use darkqa_base::types::{
    ChoiceDetail, Condition, Decides, Digest, FrameId, ParsedAnswer, QuestionId, Record, Reply, RunQuestion,
    StoredDetail as _, TrialKey, TrialRef, Trials, UnreadReason,
};
use darkqa_engine::image_rebuilder::{ImageRebuilder, RebuildArgs};
use darkqa_engine::images::progress::Progress;
use darkqa_pictures::Payload;
use darkqa_report::joined::written;
use darkqa_report::study::{StudyImage, StudyQuestion, page};
use darkqa_runs::stored::StoredRun;
use darkqa_runs::{Outcome, PrintArgs, record_table};
use darkqa_score::answers::record::{Detail, answered};
use darkqa_store::{AddressChange, Store, now, read_questions};

/// The flags of `study pack`.
#[derive(Debug, Args)]
pub(crate) struct PackArgs {
    /// The folder of a run
    #[arg(value_name = "RUN", add = Decides::Nothing)]
    pub run: PathBuf,
    /// Where the page and its images go
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: PathBuf,
    /// Ask only N questions, chosen by a hash of their ids; default: all
    #[arg(long, value_name = "N", add = Decides::Trials)]
    pub items: Option<NonZeroUsize>,
    /// Only these conditions, as L3-noise+zerodce; repeatable; default: all of the run
    #[arg(long, value_name = "CONDITION", add = Decides::Nothing)]
    pub condition: Vec<Condition>,
    /// Where the data and enhancers are now.
    #[command(flatten)]
    pub rebuild: RebuildArgs,
}

/// Writes the page and its images. Each image has the same bytes as the one sent to the models.
///
/// # Errors
/// If the run has no questions about images, its data or enhancers are missing, or an image differs from the one sent.
pub(crate) fn pack(args: PackArgs, progress: &Progress) -> Result<Outcome> {
    let StoredRun { manifest, trials, questions, .. } =
        StoredRun::open_choices(&args.run, "openeqa --study DIR makes their page")?
            .with_truths("what people answer is scored by them")?;
    let conditions = conditions(&trials, &args.condition)?;
    if questions.is_empty() || conditions.is_empty() {
        return Err(run_error(&args.run, "this run has no questions about images".to_owned()));
    }
    let first_orders = first_orders(&trials);
    let mut frames = BTreeMap::<FrameId, Vec<RunQuestion>>::new();
    for question in choose_questions(questions, args.items.map_or(usize::MAX, usize::from)) {
        frames.entry(question.frame.clone()).or_default().push(question);
    }
    let sent = sent_digests(&trials);
    let mut rebuilder = ImageRebuilder::open(args.rebuild, &manifest, &args.run, &conditions)?;
    let bar = progress.bar("images", frames.len() * conditions.len());
    let (mut asked, mut images) = (Vec::new(), 0);
    for (number, (frame, questions)) in frames.into_iter().enumerate() {
        let mut shots = Vec::new();
        let rebuilt = rebuilder.images(&frame, &conditions)?;
        for (condition, payloads) in conditions.iter().zip(&rebuilt) {
            let now = Payload::joint_digest(payloads);
            if let Some(sent) = sent.get(&(frame.clone(), condition.clone()))
                && now.is_some_and(|now| now != *sent)
            {
                let problem = format!(
                    "{frame} at {condition} is not the image that was sent: the data, an enhancement model or this program has changed"
                );
                return Err(run_error(&args.run, problem));
            }
            // The name does not reveal the level.
            let name = Digest::from_parts([frame.0.as_bytes(), condition.to_string().as_bytes()]);
            let stem = format!("images/{}", &name.to_string()[..16]);
            let names = payloads.iter().enumerate().map(|(place, image)| {
                let place = match payloads.len() {
                    1 => String::new(),
                    _ => format!("-{}", place + 1),
                };
                let name = format!("{stem}{place}.{}", image.extension());
                write(&args.out.join(&name), image.file())?;
                Ok(name)
            });
            shots.push(StudyImage { condition: condition.to_string(), images: names.collect::<Result<_>>()? });
            images += payloads.len();
            bar.inc();
        }
        asked.extend(questions.into_iter().map(|question| StudyQuestion {
            frame: number,
            choices: first_orders.get(&question.id).cloned().unwrap_or(question.choices),
            id: question.id.0,
            text: question.text,
            shots: shots.clone(),
        }));
    }
    drop(bar);
    let path = args.out.join("study.html");
    write(&path, page(&asked)?.as_bytes())?;
    Ok(Outcome::wrote(
        &path,
        Status::Complete,
        format!(
            "{}: {}, {}, {}; with {} each image is seen by one of them\n",
            path.display(),
            counted(asked.len(), "question"),
            counted(images, "image"),
            counted(conditions.len(), "condition"),
            plural(conditions.len(), "person", "people")
        ),
    ))
}

fn run_error(run: &Path, problem: String) -> Error {
    let path = run.to_owned();
    Error::Run { path, problem }
}

/// The conditions of the run with images, limited to the `wanted` ones if there are any.
fn conditions(trials: &Trials<ChoiceDetail>, wanted: &[Condition]) -> Result<Vec<Condition>> {
    let asked: BTreeSet<Condition> =
        trials.asked().into_iter().flatten().filter_map(|(_, condition)| condition.cloned()).collect();
    if let Some(missing) = wanted.iter().find(|condition| !asked.contains(condition)) {
        let problem = format_args!("nothing was asked at {missing} in this run");
        return Err(Error::usage("--condition", problem));
    }
    if wanted.is_empty() {
        return Ok(asked.into_iter().collect());
    }
    Ok(wanted.to_vec())
}

/// The choices of each question, in the first order in which they were shown.
fn first_orders(trials: &Trials<ChoiceDetail>) -> BTreeMap<QuestionId, Vec<String>> {
    let mut orders = BTreeMap::new();
    for trial in trials.iter() {
        orders.entry(trial.question().clone()).or_insert_with(|| trial.choices().to_vec());
    }
    orders
}

/// Chooses the `count` questions whose ids have the lowest digests.
fn choose_questions(mut questions: Vec<RunQuestion>, count: usize) -> Vec<RunQuestion> {
    questions.sort_by_cached_key(|question| *Digest::from_bytes(question.id.0.as_bytes()).as_bytes());
    questions.truncate(count);
    questions
}

/// The digest of the images sent, by frame and condition.
fn sent_digests(trials: &Trials<ChoiceDetail>) -> BTreeMap<(FrameId, Condition), Digest> {
    trials
        .iter()
        .filter_map(|trial| {
            let place = (trial.sent_frame().clone(), trial.condition()?.clone());
            Some((place, trial.sent_digest()?))
        })
        .collect()
}

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
    pub show: PrintArgs,
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
struct ImportCounts {
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
    let mut counts = ImportCounts::default();
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
    let mut run = StoredRun::reread(&args.out, people_manifest, None)?;
    let failed = run.trials.iter().map(TrialRef::failed);
    run.manifest.set_counts(Counts::new(run.trials.len(), failed));
    let mut outcome = written::write(&store, run, args.show.format())?;
    record_table::update(&args.out, args.show.record_table())?;
    if !args.show.format().is_json() {
        outcome.output.insert_str(0, &summary(&counts));
    }
    Ok(outcome)
}

fn read_answers(path: &Path) -> Result<Vec<PlacedAnswer<'_>>> {
    Ok(files::json_lines(path)?.into_iter().map(|(line, answer)| PlacedAnswer { file: path, line, answer }).collect())
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
        png: run.png,
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

fn summary(counts: &ImportCounts) -> String {
    let mut text = format!("answers imported: {}\n", counts.answers);
    if let Some(first) = counts.unknown.first() {
        let count = counts.unknown.len();
        let _ = writeln!(text, "items in the files that the run did not ask: {count}, as {first}");
    }
    text
}
