//! The items as the page's script reads them, as compressed JSON in base64: [`packed`].

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::Write;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use serde::Serialize;
use serde_json::Value;

use super::inputs::PageInputs;
use crate::error::{Error, Result};
use crate::report::outcome_words;
use crate::score::choice::ReadingMode;
use crate::score::confusion;
use crate::score::grid::{Grid, TrialResult};
use crate::types::outlines::PixelBox;
use crate::types::{
    Axis, AxisLevel, FailureKind, FrameId, ObjectCrop, QuestionId, Record, RunQuestion, Thumbnail,
    UnreadReason, View,
};

/// Codes of results that are not the index of a choice.
const UNREAD: u8 = 26;
const FAILED: u8 = 27;
const ABSENT: u8 = 28;

/// Maximum length of a reply on the page, in characters. The first value with which all replies fit is used.
const MAX_REPLY_CHARS: [usize; 5] = [20_000, 2_000, 400, 100, 30];
/// Size limits, tried in order until the packed items fit into [`MAX_PACKED_BYTES`].
const SIZE_LIMITS: [SizeLimit; 3] = [
    SizeLimit {
        text: 12_000_000,
        pictures: 8_500_000,
    },
    SizeLimit {
        text: 4_000_000,
        pictures: 4_000_000,
    },
    SizeLimit {
        text: 1_000_000,
        pictures: 1_000_000,
    },
];
/// Maximum size of the packed items in bytes, so that the page stays under 15 MB.
const MAX_PACKED_BYTES: usize = 13_500_000;

/// Maximum sizes of the parts that can be shortened.
#[derive(Debug, Clone, Copy)]
struct SizeLimit {
    /// Bytes of all different replies.
    text: usize,
    /// Bytes of all thumbnails.
    pictures: usize,
}

#[derive(Serialize)]
struct PageData<'a> {
    runs: Vec<String>,
    /// The folder of each run.
    folders: Vec<String>,
    levels: Vec<[String; 2]>,
    families: Vec<&'a str>,
    frames: Vec<&'a str>,
    /// Width and height of each frame of which there are small copies, in pixels.
    sizes: Vec<Option<[u32; 2]>>,
    subjects: Vec<Subject<'a>>,
    questions: Vec<Question<'a>>,
    choices: Vec<&'a [String]>,
    items: Vec<Item>,
    strict: Vec<Vec<u8>>,
    lenient: Vec<Vec<u8>>,
    reasons: Vec<String>,
    why: Vec<Vec<usize>>,
    texts: Vec<String>,
    replies: Vec<Vec<usize>>,
    confusions: Vec<Confusion<'a>>,
    thumbnails: BTreeMap<usize, BTreeMap<String, Picture<'a>>>,
}

#[derive(Serialize)]
struct Subject<'a> {
    name: String,
    model: &'a str,
    condition: String,
    /// Variant and enhancer in words, or `blind`.
    light: String,
    level: Option<AxisLevel>,
    variant: String,
    enhancer: Option<&'a str>,
    /// Index of the subject of the clean frames of the same images, if it was asked.
    clean: Option<usize>,
}

#[derive(Serialize)]
struct Question<'a> {
    id: &'a str,
    frame: usize,
    family: usize,
    text: &'a str,
    evidence: Option<&'a Value>,
    /// The boxes of the things that it is about, and the box of all of them, in pixels of its frame.
    outlines: Vec<PixelBox>,
    object: Option<PixelBox>,
}

#[derive(Serialize)]
struct Item {
    /// Id of the question; from its second item on with a number: `id#2`.
    name: String,
    question: usize,
    choices: usize,
    /// Index of the true choice; `None` if nobody knows it.
    truth: Option<usize>,
}

#[derive(Serialize)]
struct Confusion<'a> {
    subject: usize,
    family: &'a str,
    labels: &'a [String],
    counts: &'a [Vec<usize>],
}

#[derive(Serialize)]
struct Picture<'a> {
    small: &'a str,
    crop: &'a str,
    stops: f32,
    objects: &'a [ObjectCrop],
}

/// A list without repetition, and the index of each entry.
struct Distinct<T> {
    list: Vec<T>,
    indices: HashMap<T, usize>,
}

impl<T: Copy + Eq + std::hash::Hash> Distinct<T> {
    fn new() -> Self {
        Self {
            list: Vec::new(),
            indices: HashMap::new(),
        }
    }

    fn index_of(&mut self, entry: T) -> usize {
        *self.indices.entry(entry).or_insert_with(|| {
            self.list.push(entry);
            self.list.len() - 1
        })
    }
}

/// Everything that the script shows, as compressed JSON in base64.
///
/// # Errors
/// If the data cannot be written.
pub(super) fn packed<'a>(
    grid: &'a Grid<'a>,
    confusions: &'a [confusion::Confusion],
    inputs: &PageInputs<'a>,
) -> Result<String> {
    let mut packed = String::new();
    for limit in SIZE_LIMITS {
        packed = pack(&data(grid, confusions, inputs, limit))?;
        if packed.len() <= MAX_PACKED_BYTES {
            break;
        }
    }
    Ok(packed)
}

fn pack(data: &PageData<'_>) -> Result<String> {
    let failed = |e: &dyn std::fmt::Display| Error::data("report.html", e);
    let mut packed = GzEncoder::new(Vec::new(), Compression::new(6));
    serde_json::to_writer(std::io::BufWriter::new(&mut packed), data).map_err(|e| failed(&e))?;
    packed.flush().map_err(|e| failed(&e))?;
    let bytes = packed.finish().map_err(|e| failed(&e))?;
    Ok(STANDARD.encode(bytes))
}

fn data<'a>(
    grid: &'a Grid<'a>,
    confusions: &'a [confusion::Confusion],
    inputs: &PageInputs<'a>,
    limit: SizeLimit,
) -> PageData<'a> {
    let run_questions: HashMap<&QuestionId, &RunQuestion> = inputs
        .questions
        .iter()
        .map(|question| (&question.id, question))
        .collect();
    let (mut frames, mut families) = (Distinct::new(), Distinct::new());
    let (mut question_ids, mut choices) = (Distinct::new(), Distinct::new());
    let mut questions = Vec::new();
    let mut items = Vec::new();
    let mut times = HashMap::<&QuestionId, usize>::new();
    for item in &grid.items {
        let record = item.record;
        let number = question_ids.index_of(&record.question);
        if number == questions.len() {
            let run_question = run_questions.get(&record.question);
            questions.push(Question {
                id: &record.question.0,
                frame: frames.index_of(&*record.detail.frame.0),
                family: families.index_of(record.detail.family.name()),
                text: run_question.map_or("", |run_question| &run_question.text),
                outlines: run_question.map_or_else(Vec::new, |question| question.outlines()),
                object: run_question.and_then(|question| question.object()),
                evidence: run_question
                    .map(|run_question| &run_question.evidence)
                    .filter(|e| !e.is_null()),
            });
        }
        let time = times.entry(&record.question).or_default();
        *time += 1;
        items.push(Item {
            name: match time {
                1 => record.question.to_string(),
                time => format!("{}#{time}", record.question),
            },
            question: number,
            choices: choices.index_of(record.detail.choices.as_slice()),
            truth: record.detail.truth,
        });
    }
    let (texts, replies) = replies(grid, limit.text);
    let marks = |mode| {
        let of =
            |subject| (0..grid.items.len()).map(move |item| code(grid.result(subject, item), mode));
        (0..grid.subjects.len())
            .map(|subject| of(subject).collect())
            .collect()
    };
    let (reasons, why) = reasons(grid);
    PageData {
        runs: inputs.runs.iter().map(|run| run.name.clone()).collect(),
        folders: inputs.runs.iter().map(|run| run.folder.clone()).collect(),
        sizes: sizes(inputs.thumbnails, &frames.list),
        levels: levels(grid),
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
        texts,
        replies,
        confusions: confusions_of(grid, confusions),
    }
}

/// The size of each frame that small copies state.
fn sizes(thumbnails: &[Thumbnail], frames: &[&str]) -> Vec<Option<[u32; 2]>> {
    let stated = thumbnails.iter();
    let stated = stated.filter_map(|thumbnail| Some((&*thumbnail.frame.0, thumbnail.size?)));
    let stated: HashMap<&str, [u32; 2]> = stated.collect();
    frames
        .iter()
        .map(|frame| stated.get(frame).copied())
        .collect()
}

/// The name of each level of the grid, in the order of tables, and its severity in words: `6 EV`.
fn levels(grid: &Grid<'_>) -> Vec<[String; 2]> {
    let levels = grid.subjects.iter().filter_map(|subject| subject.level);
    let levels: BTreeSet<AxisLevel> = levels.collect();
    let named = levels.into_iter().map(|level| {
        let unit = level.axis().unwrap_or(Axis::LIGHT).unit;
        let severity = match level {
            AxisLevel::PAIR => "by frame".to_owned(),
            _ => format!("{} {unit}", level.value()),
        };
        [level.to_string(), severity]
    });
    named.collect()
}

fn code(result: TrialResult, mode: ReadingMode) -> u8 {
    match result {
        TrialResult::Absent => ABSENT,
        TrialResult::Failed => FAILED,
        TrialResult::Read { .. } => result.reading(mode).flatten().unwrap_or(UNREAD),
    }
}

fn subjects<'a>(grid: &'a Grid<'_>) -> Vec<Subject<'a>> {
    let subject = |subject: &'a crate::score::subject::Subject| Subject {
        name: crate::report::words::name(subject),
        model: &subject.model,
        condition: subject.condition(),
        light: match subject.view {
            Some(View::Blind) => "blind".to_owned(),
            _ => crate::report::words::light(&subject.variant, subject.enhancer.as_ref()),
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
fn clean(grid: &Grid<'_>, of: &crate::score::subject::Subject) -> Option<usize> {
    of.level?;
    let clean = crate::score::subject::Subject::seeing(&of.model, AxisLevel::L0, &of.variant, None);
    grid.stand_in(&clean)
}

/// Why a reply was not read, or why none came.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Why {
    Nothing,
    Unread(UnreadReason),
    Failed(FailureKind, Option<u16>),
}

impl Why {
    fn of(record: Option<&Record>) -> Self {
        let unread = record.and_then(|record| record.detail.strict?.why);
        let failed = record.and_then(|record| record.failure.as_ref());
        match (unread, failed) {
            (Some(why), _) => Self::Unread(why),
            (None, Some(failure)) => Self::Failed(failure.kind, failure.status),
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
            (0..grid.items.len()).map(|item| reasons.index_of(Why::of(grid.record(subject, item))));
        indices.push(why.collect());
    }
    (reasons.list.into_iter().map(Why::words).collect(), indices)
}

/// The different replies, cut if they are too long, and for each subject and item the index of its reply.
///
/// Refusals and failure messages take the place of a reply.
fn replies(grid: &Grid<'_>, limit: usize) -> (Vec<String>, Vec<Vec<usize>>) {
    let mut texts: Distinct<&str> = Distinct::new();
    texts.index_of("");
    let mut indices = Vec::new();
    for subject in 0..grid.subjects.len() {
        let of_subject = (0..grid.items.len()).map(|item| {
            let Some(record) = grid.record(subject, item) else {
                return 0;
            };
            texts.index_of(record.text_or_error().unwrap_or_default())
        });
        indices.push(of_subject.collect());
    }
    let fits = |longest: &&usize| {
        let lengths = texts.list.iter().map(|text| text.len().min(**longest));
        lengths.sum::<usize>() <= limit
    };
    let longest = MAX_REPLY_CHARS
        .iter()
        .find(fits)
        .unwrap_or(&MAX_REPLY_CHARS[MAX_REPLY_CHARS.len() - 1]);
    let cut = |text: &&str| match text.char_indices().nth(*longest) {
        None => (*text).to_owned(),
        Some((end, _)) => {
            let all = text.chars().count();
            format!(
                "{} … [cut here after {longest} of {all} characters; records.jsonl has all]",
                &text[..end]
            )
        }
    };
    (texts.list.iter().map(cut).collect(), indices)
}

fn confusions_of<'a>(
    grid: &Grid<'_>,
    confusions: &'a [confusion::Confusion],
) -> Vec<Confusion<'a>> {
    let named = confusions.iter().filter_map(|confusion| {
        Some(Confusion {
            subject: grid.find(&confusion.subject)?,
            family: confusion.family.name(),
            labels: &confusion.labels,
            counts: &confusion.counts,
        })
    });
    named.collect()
}

/// Thumbnails of as many frames as the size limit allows, by the index of the frame; crops of things as there is room behind them.
fn thumbnails<'a>(
    all: &'a [Thumbnail],
    numbers: &HashMap<&str, usize>,
    mut bytes_left: usize,
) -> BTreeMap<usize, BTreeMap<String, Picture<'a>>> {
    let mut by_frame = BTreeMap::<&FrameId, Vec<&Thumbnail>>::new();
    for thumbnail in all {
        by_frame
            .entry(&thumbnail.frame)
            .or_default()
            .push(thumbnail);
    }
    // Small copies of all frames go before the things of the first ones.
    let mut kept = Vec::new();
    for (frame, thumbnails) in by_frame {
        let Some(number) = numbers.get(&*frame.0) else {
            continue;
        };
        let sizes = thumbnails.iter().map(|t| t.small.len() + t.crop.len());
        let size: usize = sizes.sum();
        if size > bytes_left {
            break;
        }
        bytes_left -= size;
        kept.push((*number, thumbnails));
    }
    let mut by_number = BTreeMap::new();
    for (number, thumbnails) in kept {
        let crops = thumbnails.iter().flat_map(|thumbnail| &thumbnail.objects);
        let size: usize = crops.map(|object| object.crop.len()).sum();
        let has_room = size <= bytes_left;
        bytes_left -= if has_room { size } else { 0 };
        let pictures = thumbnails.into_iter().map(|t| {
            let picture = Picture {
                small: &t.small,
                crop: &t.crop,
                stops: t.stops,
                objects: if has_room { &t.objects } else { &[] },
            };
            (t.condition.to_string(), picture)
        });
        by_number.insert(number, pictures.collect());
    }
    by_number
}
