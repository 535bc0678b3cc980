//! Items of multiple-choice questions for the page's script: [`packed`].

use std::collections::HashMap;

use super::data::{
    ABSENT, Confusion, Distinct, FAILED, Item, ModelInCondition, PageData, PageKind, Question, SizeLimit, UNREAD,
    levels, packed_by, shortened, sizes, thumbnails,
};
use super::inputs::PageInputs;
use super::sample::sample;
use crate::error::Result;
use crate::report::text::outcome_words;
use crate::report::text::words::family;
use crate::types::{AxisLevel, FailureKind, QuestionId, RunQuestion, TrialRef, UnreadReason};
use darkqa_score::answers::confusion;
use darkqa_score::choice::ParsingMode;
use darkqa_score::grid::{Grid, TrialResult};

/// Packs the data of the script as compressed JSON in base64.
///
/// # Errors
/// If a reply or a question cannot be read, or the data cannot be serialized.
pub(super) fn packed<'a>(
    grid: &'a Grid<'a>,
    confusions: &'a [confusion::Confusion],
    inputs: &PageInputs<'a>,
) -> Result<String> {
    let sample = sample(grid);
    let grid = sample.as_ref().unwrap_or(grid);
    let replies = Replies::read(grid, inputs)?;
    let questions = questions(grid, inputs)?;
    packed_by(|limit| data(grid, confusions, inputs, &questions, &replies, limit))
}

fn data<'a>(
    grid: &'a Grid<'a>,
    confusions: &'a [confusion::Confusion],
    inputs: &PageInputs<'a>,
    run_questions: &'a RunQuestions,
    replies: &Replies,
    limit: SizeLimit,
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
                evidence: run_question.map(|run_question| &run_question.evidence).filter(|e| !e.is_null()),
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
        strict: codes(grid, ParsingMode::Strict),
        lenient: codes(grid, ParsingMode::Lenient),
        reasons,
        why,
        texts: shortened(&replies.texts(), limit.text),
        replies: replies.indices.clone(),
        confusions: confusion_data(grid, confusions),
    }
}

/// Stored questions by id.
type RunQuestions = HashMap<QuestionId, RunQuestion>;

/// Reads the stored questions of the items.
fn questions(grid: &Grid<'_>, inputs: &PageInputs<'_>) -> Result<RunQuestions> {
    let ids = grid.items.iter().map(|item| &*item.asked.question).collect();
    (inputs.questions)(&ids)
}

/// Result codes with a row for each subject and a column for each item.
fn codes(grid: &Grid<'_>, mode: ParsingMode) -> Vec<Vec<u8>> {
    (0..grid.subjects.len())
        .map(|subject| (0..grid.items.len()).map(|item| code(grid.result(subject, item), mode)).collect())
        .collect()
}

fn code(result: TrialResult, mode: ParsingMode) -> u8 {
    match result {
        TrialResult::Absent => ABSENT,
        TrialResult::Failed => FAILED,
        TrialResult::Read { .. } => result.reading(mode).flatten().unwrap_or(UNREAD),
    }
}

/// Subjects of the grid as the script needs them.
fn subjects<'a>(grid: &'a Grid<'_>) -> Vec<ModelInCondition<'a>> {
    grid.subjects.iter().map(|subject| ModelInCondition::new(subject, clean_index(grid, subject))).collect()
}

/// Index of the same model at L0 without an enhancer; `None` for models without images.
fn clean_index(grid: &Grid<'_>, subject: &darkqa_score::model_in_condition::ModelInCondition) -> Option<usize> {
    subject.level?;
    let clean = darkqa_score::model_in_condition::ModelInCondition::with_images(
        &subject.model,
        AxisLevel::L0,
        &subject.variant,
        None,
    );
    grid.find_up_to_group(&clean)
}

/// Reason why a result is not a parsed answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum NoAnswerReason {
    /// No reason: the reply was parsed, or the item was not asked.
    None,
    Unread(UnreadReason),
    /// Kind of failure, and HTTP status if there was one.
    Failed(FailureKind, Option<u16>),
}

impl NoAnswerReason {
    fn new(trial: Option<TrialRef<'_>>) -> Self {
        let unread = trial.and_then(|trial| trial.strict()?.why);
        let failed = trial.and_then(TrialRef::failure);
        match (unread, failed) {
            (Some(why), _) => Self::Unread(why),
            (None, Some((kind, status))) => Self::Failed(kind, status),
            (None, None) => Self::None,
        }
    }

    fn text(self) -> String {
        match self {
            Self::None => String::new(),
            Self::Unread(why) => outcome_words::unread_reason(why).to_owned(),
            Self::Failed(kind, status) => outcome_words::failure_reason(kind, status),
        }
    }
}

/// Distinct reasons for results without an answer, the first one empty, and the index of the reason by subject and
/// item.
fn reasons(grid: &Grid<'_>) -> (Vec<String>, Vec<Vec<usize>>) {
    let mut reasons = Distinct::new();
    reasons.index_of(NoAnswerReason::None);
    let mut indices = Vec::new();
    for subject in 0..grid.subjects.len() {
        let row = (0..grid.items.len())
            .map(|item| reasons.index_of(NoAnswerReason::new(grid.trial(subject, item))))
            .collect();
        indices.push(row);
    }
    let texts = reasons.list.into_iter().map(NoAnswerReason::text).collect();
    (texts, indices)
}

/// Distinct texts of replies, the first one empty. Refusals and error messages count as replies.
struct Replies {
    /// Index of each text.
    numbers: HashMap<String, usize>,
    /// Index of the text by subject and item.
    indices: Vec<Vec<usize>>,
}

impl Replies {
    fn read(grid: &Grid<'_>, inputs: &PageInputs<'_>) -> Result<Self> {
        let mut numbers = HashMap::from([(String::new(), 0)]);
        let mut indices = Vec::new();
        for subject in 0..grid.subjects.len() {
            let mut row = Vec::with_capacity(grid.items.len());
            for item in 0..grid.items.len() {
                let text = match grid.trial(subject, item) {
                    None => String::new(),
                    Some(trial) => (inputs.texts)(trial.text())?,
                };
                let next = numbers.len();
                row.push(*numbers.entry(text).or_insert(next));
            }
            indices.push(row);
        }
        Ok(Self { numbers, indices })
    }

    /// Texts in the order of their indices.
    fn texts(&self) -> Vec<&str> {
        let mut texts = vec![""; self.numbers.len()];
        for (text, number) in &self.numbers {
            texts[*number] = text;
        }
        texts
    }
}

fn confusion_data<'a>(grid: &Grid<'_>, confusions: &'a [confusion::Confusion]) -> Vec<Confusion<'a>> {
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
