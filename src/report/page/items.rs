//! The items of questions with choices, as the page's script reads them: [`packed`].

use std::collections::HashMap;

use super::data::{
    ABSENT, Confusion, Distinct, FAILED, Item, ModelInCondition, PageData, PageKind, Question,
    SizeLimit, UNREAD, levels, packed_by, shortened, sizes, thumbnails,
};
use super::inputs::PageInputs;
use super::sample::sample;
use crate::error::Result;
use crate::text::outcome_words;
use crate::text::words::family;
use crate::types::{AxisLevel, FailureKind, QuestionId, RunQuestion, TrialRef, UnreadReason, View};
use darkqa_score::answers::confusion;
use darkqa_score::choice::ReadingMode;
use darkqa_score::grid::{Grid, TrialResult};

/// Everything that the script shows, as compressed JSON in base64.
///
/// # Errors
/// If a reply cannot be read, or the data cannot be written.
pub(super) fn packed<'a>(
    grid: &'a Grid<'a>,
    confusions: &'a [confusion::Confusion],
    inputs: &PageInputs<'a>,
) -> Result<String> {
    let sample = sample(grid);
    let grid = sample.as_ref().unwrap_or(grid);
    let replies = Replies::read(grid, inputs)?;
    let questions = questions(grid, inputs)?;
    packed_by(|limit| data(grid, confusions, inputs, (&questions, &replies, limit)))
}

fn data<'a>(
    grid: &'a Grid<'a>,
    confusions: &'a [confusion::Confusion],
    inputs: &PageInputs<'a>,
    (run_questions, replies, limit): (&'a RunQuestions, &Replies, SizeLimit),
) -> PageData<'a> {
    let (mut frames, mut families) = (Distinct::new(), Distinct::new());
    let (mut question_ids, mut choices) = (Distinct::new(), Distinct::new());
    let mut questions = Vec::new();
    let mut items = Vec::new();
    let mut times = HashMap::<&QuestionId, usize>::new();
    for item in &grid.items {
        let asked = item.asked;
        let number = question_ids.index_of(&*asked.question);
        if number == questions.len() {
            let run_question = run_questions.get(&*asked.question);
            questions.push(Question {
                id: &asked.question.0,
                frame: frames.index_of(&*asked.frame.0),
                family: families.index_of([asked.family.name(), family(Some(&asked.family))]),
                text: run_question.map_or("", |run_question| &run_question.text),
                outlines: run_question.map_or_else(Vec::new, RunQuestion::outlines),
                object: run_question.and_then(RunQuestion::object),
                answer: None,
                also_right: &[],
                evidence: run_question
                    .map(|run_question| &run_question.evidence)
                    .filter(|e| !e.is_null()),
            });
        }
        let time = times.entry(&asked.question).or_default();
        *time += 1;
        items.push(Item {
            name: match time {
                1 => asked.question.to_string(),
                time => format!("{}#{time}", asked.question),
            },
            question: number,
            choices: choices.index_of(asked.choices.as_slice()),
            truth: asked.truth,
        });
    }
    let marks = |mode| {
        let of =
            |subject| (0..grid.items.len()).map(move |item| code(grid.result(subject, item), mode));
        (0..grid.subjects.len())
            .map(|subject| of(subject).collect())
            .collect()
    };
    let (reasons, why) = reasons(grid);
    PageData {
        kind: PageKind::Choice,
        judged: Vec::new(),
        runs: inputs.runs.iter().map(|run| run.name.clone()).collect(),
        folders: inputs.runs.iter().map(|run| run.folder.clone()).collect(),
        sizes: sizes(inputs.thumbnails, &frames.list),
        levels: levels(grid.subjects.iter().filter_map(|subject| subject.level)),
        thumbnails: thumbnails(inputs.thumbnails, &frames.indices, limit.pictures),
        families: families.list,
        frames: frames.list,
        subjects: subjects(grid),
        questions,
        choices: choices.list,
        items,
        strict: marks(ReadingMode::Strict),
        lenient: marks(ReadingMode::Lenient),
        reasons,
        why,
        texts: shortened(&replies.texts(), limit.text),
        replies: replies.indices.clone(),
        confusions: confusions_of(grid, confusions),
    }
}

/// The stored questions, by name.
type RunQuestions = HashMap<QuestionId, RunQuestion>;

/// The stored questions of the items.
fn questions(grid: &Grid<'_>, inputs: &PageInputs<'_>) -> Result<RunQuestions> {
    let asked = grid.items.iter().map(|item| &*item.asked.question);
    (inputs.questions)(&asked.collect())
}

fn code(result: TrialResult, mode: ReadingMode) -> u8 {
    match result {
        TrialResult::Absent => ABSENT,
        TrialResult::Failed => FAILED,
        TrialResult::Read { .. } => result.reading(mode).flatten().unwrap_or(UNREAD),
    }
}

fn subjects<'a>(grid: &'a Grid<'_>) -> Vec<ModelInCondition<'a>> {
    let subject =
        |subject: &'a darkqa_score::model_in_condition::ModelInCondition| ModelInCondition {
            name: crate::text::words::name(subject),
            model: &subject.model,
            condition: subject.condition(),
            light: match subject.view {
                Some(View::Blind) => "blind".to_owned(),
                _ => crate::text::words::light(&subject.variant, subject.enhancer.as_ref()),
            },
            level: subject.level,
            variant: subject.variant.to_string(),
            enhancer: subject
                .enhancer
                .as_ref()
                .map(crate::types::EnhancerName::as_str),
            clean: clean(grid, subject),
        };
    grid.subjects.iter().map(subject).collect()
}

/// Index of the subject of the clean frames of a subject with images.
fn clean(
    grid: &Grid<'_>,
    of: &darkqa_score::model_in_condition::ModelInCondition,
) -> Option<usize> {
    of.level?;
    let clean = darkqa_score::model_in_condition::ModelInCondition::with_images(
        &of.model,
        AxisLevel::L0,
        &of.variant,
        None,
    );
    grid.find_up_to_group(&clean)
}

/// Why a reply was not read, or why none came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Why {
    Nothing,
    Unread(UnreadReason),
    Failed(FailureKind, Option<u16>),
}

impl Why {
    fn new(trial: Option<TrialRef<'_>>) -> Self {
        let unread = trial.and_then(|trial| trial.strict()?.why);
        let failed = trial.and_then(TrialRef::failure);
        match (unread, failed) {
            (Some(why), _) => Self::Unread(why),
            (None, Some((kind, status))) => Self::Failed(kind, status),
            (None, None) => Self::Nothing,
        }
    }

    fn words(self) -> String {
        match self {
            Self::Nothing => String::new(),
            Self::Unread(why) => outcome_words::unread(why).to_owned(),
            Self::Failed(kind, status) => outcome_words::failed(kind, status),
        }
    }
}

/// The different reasons in words why replies were not read or did not come, with none first, and for each subject and item the
/// index of its reason.
fn reasons(grid: &Grid<'_>) -> (Vec<String>, Vec<Vec<usize>>) {
    let mut reasons = Distinct::new();
    reasons.index_of(Why::Nothing);
    let mut indices = Vec::new();
    for subject in 0..grid.subjects.len() {
        let why =
            (0..grid.items.len()).map(|item| reasons.index_of(Why::new(grid.trial(subject, item))));
        indices.push(why.collect());
    }
    (reasons.list.into_iter().map(Why::words).collect(), indices)
}

/// The different replies, and for each subject and item the index of its reply; the first is empty.
///
/// Refusals and failure messages take the place of a reply.
struct Replies {
    numbers: HashMap<String, usize>,
    indices: Vec<Vec<usize>>,
}

impl Replies {
    fn read(grid: &Grid<'_>, inputs: &PageInputs<'_>) -> Result<Self> {
        let mut numbers = HashMap::from([(String::new(), 0)]);
        let mut indices = Vec::new();
        for subject in 0..grid.subjects.len() {
            let mut of_subject = Vec::with_capacity(grid.items.len());
            for item in 0..grid.items.len() {
                let text = match grid.trial(subject, item) {
                    None => String::new(),
                    Some(trial) => (inputs.texts)(trial.text())?,
                };
                let next = numbers.len();
                of_subject.push(*numbers.entry(text).or_insert(next));
            }
            indices.push(of_subject);
        }
        Ok(Self { numbers, indices })
    }

    /// The replies in the order of their indices.
    fn texts(&self) -> Vec<&str> {
        let mut texts = vec![""; self.numbers.len()];
        for (text, number) in &self.numbers {
            texts[*number] = text;
        }
        texts
    }
}

fn confusions_of<'a>(
    grid: &Grid<'_>,
    confusions: &'a [confusion::Confusion],
) -> Vec<Confusion<'a>> {
    confusions
        .iter()
        .filter_map(|confusion| {
            Some(Confusion {
                subject: grid.find(&confusion.subject)?,
                family: confusion.family.name(),
                labels: &confusion.labels,
                counts: &confusion.counts,
            })
        })
        .collect()
}
