//! Items of multiple-choice questions for the page's script: [`packed`].
//!
//! Sample of the items for the page of a large run: [`sample`].

use std::collections::{BTreeMap, HashMap};

use super::data::{
    ABSENT, DistinctList, FAILED, PageConfusion, PageData, PageItem, PageKind, PageQuestion, PageRequests, PageSubject,
    SizeLimit, UNREAD, levels, packed_by, shortened, sizes, thumbnails,
};
use super::prompts::PagePrompts;
use super::run_usage::PageInputs;
use crate::text::words::{self, family};
use darkqa_base::error::Result;
use darkqa_base::types::questions::around;
use darkqa_base::types::{AxisLevel, Digest, FailureKind, Family, QuestionId, RunQuestion, TrialRef, UnreadReason};
use darkqa_score::answers::confusion;
use darkqa_score::choice::ParsingMode;
use darkqa_score::grid::{Grid, GridItem, TrialResult};
use darkqa_score::model_in_condition::ModelInCondition;

/// Packs the data of the script as compressed JSON in base64.
///
/// # Errors
/// If a reply or a question cannot be read, or the data cannot be serialized.
pub fn packed<'a>(
    grid: &'a Grid<'a>,
    confusions: &'a [confusion::Confusion],
    inputs: &PageInputs<'a>,
) -> Result<String> {
    let sample = sample(grid);
    let grid = sample.as_ref().unwrap_or(grid);
    let replies = Replies::read(grid, inputs)?;
    let questions = questions(grid, inputs)?;
    let requests = requests(grid, inputs, &questions)?;
    packed_by(|limit| data(grid, confusions, inputs, &questions, &replies, requests.clone(), limit))
}

fn data<'a>(
    grid: &'a Grid<'a>,
    confusions: &'a [confusion::Confusion],
    inputs: &PageInputs<'a>,
    run_questions: &'a RunQuestions,
    replies: &Replies,
    requests: Option<PageRequests>,
    limit: SizeLimit,
) -> PageData<'a> {
    let (mut frames, mut families) = (DistinctList::new(), DistinctList::new());
    let (mut question_ids, mut choices) = (DistinctList::new(), DistinctList::new());
    let mut questions = Vec::new();
    let mut items = Vec::new();
    let mut times = HashMap::<&QuestionId, usize>::new();
    for item in &grid.items {
        let asked = item.asked;
        let number = question_ids.index_of(&*asked.question);
        if number == questions.len() {
            let run_question = run_questions.get(&*asked.question);
            let outlines = run_question.map_or_else(Vec::new, RunQuestion::outlines);
            questions.push(PageQuestion {
                id: &asked.question.0,
                frame: frames.index_of(&*asked.frame.0),
                family: families.index_of([asked.family.name(), family(Some(&asked.family))]),
                text: run_question.map_or("", |run_question| &run_question.text),
                object: around(&outlines),
                outlines,
                answer: None,
                also_right: &[],
                evidence: run_question
                    .map(|run_question| &run_question.evidence)
                    .filter(|evidence| !evidence.is_none()),
            });
        }
        let time = times.entry(&asked.question).or_default();
        *time += 1;
        items.push(PageItem {
            name: match time {
                1 => asked.question.to_string(),
                time => format!("{}#{time}", asked.question),
            },
            question: number,
            choices: choices.index_of(asked.choices.as_slice()),
            truth: asked.truth,
            combination: combination(item),
            draw: item.draw,
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
        requests,
        confusions: confusion_data(grid, confusions),
    }
}

/// Wording, order and draw of an item, as `terse, order 1, draw 2`; empty for the first order and draw of a run with one
/// set of prompts. The numbers are those of the records.
fn combination(item: &GridItem<'_>) -> String {
    let wording = item.asked.key().wording.map(str::to_owned);
    let order = (item.asked.order > 0).then(|| format!("order {}", item.asked.order));
    let draw = (item.draw > 0).then(|| format!("draw {}", item.draw));
    [wording, order, draw].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// The requests behind the replies; `None` if no reply came from an endpoint.
fn requests(grid: &Grid<'_>, inputs: &PageInputs<'_>, questions: &RunQuestions) -> Result<Option<PageRequests>> {
    let is_endpoint = |trial: TrialRef<'_>| trial.latency_ms().is_some() || trial.usage().is_some();
    let places = (0..grid.subjects.len()).flat_map(|subject| (0..grid.items.len()).map(move |item| (subject, item)));
    if !places.into_iter().any(|(subject, item)| grid.trial(subject, item).is_some_and(is_endpoint)) {
        return Ok(None);
    }
    let costs = (inputs.costs)()?;
    let tokens = |trial: TrialRef<'_>| trial.usage().unwrap_or_default();
    let asked = grid.items.iter().map(|item| {
        let text = questions.get(&*item.asked.question).map_or("", |question| &question.text);
        (text, item.asked.choices.as_slice())
    });
    Ok(Some(PageRequests {
        latency: trial_values(grid, |trial| trial.latency_ms().unwrap_or(0)),
        prompt: trial_values(grid, |trial| tokens(trial).prompt_tokens.unwrap_or(0)),
        reply: trial_values(grid, |trial| tokens(trial).completion_tokens.unwrap_or(0)),
        attempts: trial_values(grid, |trial| if is_endpoint(trial) { trial.attempts() } else { 0 }),
        cost: if costs.values().any(|dollars| *dollars > 0.0) {
            trial_values(grid, |trial| costs.get(&trial.text()).map_or(0, |dollars| (dollars * 1e9).round() as u64))
        } else {
            Vec::new()
        },
        prompts: inputs.prompts.as_ref().map(|prompts| PagePrompts::new(prompts, asked)),
    }))
}

/// A value of each trial, with a row for each subject and a column for each item; the default without a trial.
fn trial_values<T: Default>(grid: &Grid<'_>, value: impl Fn(TrialRef<'_>) -> T) -> Vec<Vec<T>> {
    (0..grid.subjects.len())
        .map(|subject| {
            (0..grid.items.len()).map(|item| grid.trial(subject, item).map(&value).unwrap_or_default()).collect()
        })
        .collect()
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
        .map(|subject| (0..grid.items.len()).map(|item| code(grid.compared_result(subject, item), mode)).collect())
        .collect()
}

fn code(result: TrialResult, mode: ParsingMode) -> u8 {
    match result {
        TrialResult::Absent => ABSENT,
        TrialResult::Failed => FAILED,
        TrialResult::Read { .. } => result.parsed(mode).flatten().unwrap_or(UNREAD),
    }
}

/// Subjects of the grid as the script needs them.
fn subjects<'a>(grid: &'a Grid<'_>) -> Vec<PageSubject<'a>> {
    grid.subjects.iter().map(|subject| PageSubject::new(subject, clean_index(grid, subject))).collect()
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
            Self::Unread(why) => words::unread_reason(why).to_owned(),
            Self::Failed(kind, status) => words::failure_reason(kind, status),
        }
    }
}

/// Distinct reasons for results without an answer, the first one empty, and the index of the reason by subject and
/// item.
fn reasons(grid: &Grid<'_>) -> (Vec<String>, Vec<Vec<usize>>) {
    let mut reasons = DistinctList::new();
    reasons.index_of(NoAnswerReason::None);
    let mut indices = Vec::new();
    for subject in 0..grid.subjects.len() {
        let row = (0..grid.items.len())
            .map(|item| reasons.index_of(NoAnswerReason::new(grid.compared_trial(subject, item))))
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
                let text = match grid.compared_trial(subject, item) {
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

fn confusion_data<'a>(grid: &Grid<'_>, confusions: &'a [confusion::Confusion]) -> Vec<PageConfusion<'a>> {
    confusions
        .iter()
        .filter_map(|confusion| {
            Some(PageConfusion {
                subject: grid.find(&confusion.subject)?,
                family: confusion.family.name(),
                labels: &confusion.labels,
                counts: &confusion.counts,
            })
        })
        .collect()
}

/// Maximum number of replies on a page (chosen): they fit on a page of 12 MB, and a browser loads them in two seconds.
const MAX_REPLIES: usize = 200_000;

/// Strongest effect of darkness and enhancement on the answers to an item, over all models. The variants are in order
/// of precedence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum AnswerChange {
    /// Right in the dark, and wrong after an enhancer.
    Harmed,
    /// Wrong in the dark, and right after an enhancer.
    Rescued,
    /// Right at L0, and wrong in the dark.
    Lost,
    /// None of these changes.
    Stable,
}

/// Maximum number of items on the page.
fn max_items(grid: &Grid<'_>) -> usize {
    MAX_REPLIES / grid.subjects.len().max(1)
}

/// Draws a sample of the items; `None` if all of them fit on the page. The strata of family and answer change have
/// equal shares; small strata are kept in full. The sample depends only on the names of the questions.
pub(super) fn sample<'a>(grid: &Grid<'a>) -> Option<Grid<'a>> {
    let max = max_items(grid);
    (grid.items.len() > max).then(|| grid.select_items(&selection(grid, max)))
}

/// Note that the page has only a sample of the items; `None` if it has all.
pub fn note(grid: &Grid<'_>) -> Option<String> {
    let (all, max) = (grid.items.len(), max_items(grid));
    (all > max).then(|| {
        format!(
            "All numbers are of all {all} items. The list of items has {max} of them, drawn by family and by what darkness and enhancement \
             did to them; records.jsonl has all, and `darkqa-eval show` shows any."
        )
    })
}

/// Selects `max` items; true for each selected item.
fn selection(grid: &Grid<'_>, max: usize) -> Vec<bool> {
    let changes = answer_changes(grid);
    let mut strata = BTreeMap::<(&Family, AnswerChange), Vec<(Digest, usize)>>::new();
    for (index, (item, change)) in grid.items.iter().zip(changes).enumerate() {
        let name = format!("{} {}", item.asked.question, item.asked.repeat);
        // Sorting by digest draws items at random, but reproducibly.
        let draw = (Digest::from_bytes(name.as_bytes()), index);
        strata.entry((&item.asked.family, change)).or_default().push(draw);
    }
    for draws in strata.values_mut() {
        draws.sort_unstable();
    }
    let mut selected = vec![false; grid.items.len()];
    let mut items_left = max;
    let mut strata: Vec<Vec<(Digest, usize)>> = strata.into_values().collect();
    // The smallest strata come first; the part of their share that they do not need goes to the others.
    strata.sort_by_key(Vec::len);
    let mut strata_left = strata.len();
    for draws in strata {
        let share = items_left.div_ceil(strata_left).min(draws.len()).min(items_left);
        for (_, index) in &draws[..share] {
            selected[*index] = true;
        }
        items_left -= share;
        strata_left -= 1;
    }
    selected
}

/// Change of the answers to each item.
fn answer_changes(grid: &Grid<'_>) -> Vec<AnswerChange> {
    let mut changes = vec![AnswerChange::Stable; grid.items.len()];
    for (subject, condition) in grid.subjects.iter().enumerate() {
        let is_clean = condition.level == Some(AxisLevel::L0) && condition.enhancer.is_none();
        if condition.level.is_none() || is_clean {
            continue;
        }
        let mut base = condition.clone();
        let [if_lost, if_gained] = if base.enhancer.take().is_some() {
            [AnswerChange::Harmed, AnswerChange::Rescued]
        } else {
            base = ModelInCondition::with_images(&condition.model, AxisLevel::L0, &condition.variant, None);
            [AnswerChange::Lost, AnswerChange::Stable]
        };
        let Some(base) = grid.find_up_to_group(&base) else {
            continue;
        };
        for (item, change) in changes.iter_mut().enumerate() {
            let right = grid.results([base, subject], item).map(|result| {
                let answer = result.parsed(ParsingMode::Strict)?;
                Some(grid.items[item].is_right(answer))
            });
            match right {
                [Some(true), Some(false)] => *change = (*change).min(if_lost),
                [Some(false), Some(true)] => *change = (*change).min(if_gained),
                _ => {}
            }
        }
    }
    changes
}
