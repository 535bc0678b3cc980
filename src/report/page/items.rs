//! The items as the page's script reads them: [`packed`], compressed JSON in base64.

use std::collections::{BTreeMap, HashMap};
use std::io::Write;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use serde::Serialize;
use serde_json::Value;

use super::shown::PageInputs;
use crate::error::{Error, Result};
use crate::score::choice::ReadingMode;
use crate::score::findings::Findings;
use crate::score::grid::{Grid, TrialResult};
use crate::types::{AxisLevel, FrameId, QuestionId, RunQuestion, Thumbnail, UnreadReason, View};

/// The codes of marks beside the indices of choices.
const UNREAD: u8 = 26;
const FAILED: u8 = 27;
const ABSENT: u8 = 28;

/// The longest reply on the page, in characters; shorter where all of them together are too long.
const LONGEST: [usize; 5] = [20_000, 2_000, 400, 100, 30];
/// How many bytes of different replies, and how many of small copies, are packed: the first that fit are taken.
const ROOM: [SizeLimit; 3] = [
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
/// The most bytes that the items may take of the page, which is to stay under 15 MB.
const MOST_PACKED: usize = 13_500_000;

/// Room for what can be left out of a page.
#[derive(Debug, Clone, Copy)]
struct SizeLimit {
    text: usize,
    pictures: usize,
}

#[derive(Serialize)]
struct PageData<'a> {
    runs: Vec<String>,
    drops: BTreeMap<String, f64>,
    families: Vec<&'a str>,
    frames: Vec<&'a str>,
    subjects: Vec<Subject<'a>>,
    questions: Vec<Question<'a>>,
    choices: Vec<&'a [String]>,
    items: Vec<Item>,
    strict: Vec<Vec<u8>>,
    lenient: Vec<Vec<u8>>,
    reasons: Vec<Value>,
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
    /// What the levels of one line have in common.
    light: String,
    level: Option<AxisLevel>,
    variant: String,
    enhancer: Option<&'a str>,
}

#[derive(Serialize)]
struct Question<'a> {
    id: &'a str,
    frame: usize,
    family: usize,
    text: &'a str,
    evidence: Option<&'a Value>,
}

#[derive(Serialize)]
struct Item {
    /// The question's name; with the order and turn where it was asked more than once.
    name: String,
    question: usize,
    choices: usize,
    truth: usize,
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
}

/// A list without repetition, and the place of each of its entries.
struct Distinct<T> {
    list: Vec<T>,
    places: HashMap<T, usize>,
}

impl<T: Copy + Eq + std::hash::Hash> Distinct<T> {
    fn new() -> Self {
        Self {
            list: Vec::new(),
            places: HashMap::new(),
        }
    }

    fn place(&mut self, entry: T) -> usize {
        *self.places.entry(entry).or_insert_with(|| {
            self.list.push(entry);
            self.list.len() - 1
        })
    }
}

/// Everything that the script shows, packed.
///
/// # Errors
/// Where it cannot be written.
pub(super) fn packed<'a>(findings: &'a Findings<'a>, shown: &PageInputs<'a>) -> Result<String> {
    let mut packed = String::new();
    for room in ROOM {
        packed = pack(&data(findings, shown, room))?;
        if packed.len() <= MOST_PACKED {
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

fn data<'a>(findings: &'a Findings<'a>, shown: &PageInputs<'a>, room: SizeLimit) -> PageData<'a> {
    let grid = &findings.grid;
    let listed: HashMap<&QuestionId, &RunQuestion> = shown
        .questions
        .iter()
        .map(|question| (&question.id, question))
        .collect();
    let (mut frames, mut families) = (Distinct::new(), Distinct::new());
    let (mut asked, mut choices) = (Distinct::new(), Distinct::new());
    let mut questions = Vec::new();
    let mut items = Vec::new();
    let mut times = HashMap::<&QuestionId, usize>::new();
    for item in &grid.items {
        let record = item.record;
        let number = asked.place(&record.question);
        if number == questions.len() {
            let listed = listed.get(&record.question);
            questions.push(Question {
                id: &record.question.0,
                frame: frames.place(&*record.detail.frame.0),
                family: families.place(record.detail.family.name()),
                text: listed.map_or("", |listed| &listed.text),
                evidence: listed
                    .map(|listed| &listed.evidence)
                    .filter(|e| !e.is_null()),
            });
        }
        let turn = times.entry(&record.question).or_default();
        *turn += 1;
        items.push(Item {
            name: match turn {
                1 => record.question.to_string(),
                turn => format!("{}#{turn}", record.question),
            },
            question: number,
            choices: choices.place(record.detail.choices.as_slice()),
            truth: record.detail.truth,
        });
    }
    let (texts, replies) = replies(grid, room.text);
    let marks = |mode| {
        let of =
            |subject| (0..grid.items.len()).map(move |item| code(grid.mark(subject, item), mode));
        (0..grid.subjects.len())
            .map(|subject| of(subject).collect())
            .collect()
    };
    let (reasons, why) = reasons(grid);
    PageData {
        runs: shown.runs.iter().map(|run| run.name.clone()).collect(),
        drops: drops(grid),
        thumbnails: thumbnails(shown.thumbnails, &frames.places, room.pictures),
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
        confusions: confusions(findings),
    }
}

/// The severity of each level that stands in the grid, by its name.
fn drops(grid: &Grid<'_>) -> BTreeMap<String, f64> {
    let levels = grid.subjects.iter().filter_map(|subject| subject.level);
    levels
        .map(|level| (level.to_string(), level.value()))
        .collect()
}

fn code(mark: TrialResult, mode: ReadingMode) -> u8 {
    match mark {
        TrialResult::Absent => ABSENT,
        TrialResult::Failed => FAILED,
        TrialResult::Read { .. } => mark.reading(mode).flatten().unwrap_or(UNREAD),
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
    };
    grid.subjects.iter().map(subject).collect()
}

/// The reasons for which replies are unread, with none first, and the place of each mark's.
fn reasons(grid: &Grid<'_>) -> (Vec<Value>, Vec<Vec<usize>>) {
    let mut reasons: Distinct<Option<UnreadReason>> = Distinct::new();
    reasons.place(None);
    let mut places = Vec::new();
    for subject in 0..grid.subjects.len() {
        let why = (0..grid.items.len()).map(|item| {
            let record = grid.record(subject, item);
            reasons.place(record.and_then(|record| record.detail.strict?.why))
        });
        places.push(why.collect());
    }
    let named = reasons.list.iter().map(|why| serde_json::json!(why));
    (named.collect(), places)
}

/// The different replies, cut where they are too long for a page, and the place of each mark's.
fn replies(grid: &Grid<'_>, room: usize) -> (Vec<String>, Vec<Vec<usize>>) {
    let mut texts: Distinct<&str> = Distinct::new();
    texts.place("");
    let mut places = Vec::new();
    for subject in 0..grid.subjects.len() {
        let said = (0..grid.items.len()).map(|item| {
            let Some(record) = grid.record(subject, item) else {
                return 0;
            };
            let failure = || record.failure.as_ref().map(|failure| &*failure.message);
            let text = record.reply.as_deref().filter(|text| !text.is_empty());
            let text = text.or(record.refusal.as_deref()).or_else(failure);
            texts.place(text.unwrap_or_default())
        });
        places.push(said.collect());
    }
    let fits = |longest: &&usize| {
        let lengths = texts.list.iter().map(|text| text.len().min(**longest));
        lengths.sum::<usize>() <= room
    };
    let longest = LONGEST
        .iter()
        .find(fits)
        .unwrap_or(&LONGEST[LONGEST.len() - 1]);
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
    (texts.list.iter().map(cut).collect(), places)
}

fn confusions<'a>(findings: &'a Findings<'_>) -> Vec<Confusion<'a>> {
    let all = findings.confusions.iter();
    let named = all.filter_map(|confusion| {
        Some(Confusion {
            subject: findings.grid.find(&confusion.subject)?,
            family: confusion.family.name(),
            labels: &confusion.labels,
            counts: &confusion.counts,
        })
    });
    named.collect()
}

/// The small copies of as many frames as there is room for, by the number of each.
fn thumbnails<'a>(
    all: &'a [Thumbnail],
    numbers: &HashMap<&str, usize>,
    mut room: usize,
) -> BTreeMap<usize, BTreeMap<String, Picture<'a>>> {
    let mut by_frame = BTreeMap::<&FrameId, Vec<&Thumbnail>>::new();
    for thumbnail in all {
        by_frame
            .entry(&thumbnail.frame)
            .or_default()
            .push(thumbnail);
    }
    let mut kept = BTreeMap::new();
    for (frame, thumbnails) in by_frame {
        let size: usize = thumbnails
            .iter()
            .map(|t| t.small.len() + t.crop.len())
            .sum();
        let Some(number) = numbers.get(&*frame.0) else {
            continue;
        };
        if size > room {
            break;
        }
        room -= size;
        let pictures = thumbnails.into_iter().map(|t| {
            let picture = Picture {
                small: &t.small,
                crop: &t.crop,
                stops: t.stops,
            };
            (t.condition.to_string(), picture)
        });
        kept.insert(*number, pictures.collect());
    }
    kept
}
