//! The items as the page's script reads them, whatever was asked: [`PageData`], as compressed JSON in base64 ([`packed_by`]).

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::Write;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use serde::Serialize;
use serde_json::Value;

use crate::error::{Error, Result};
use crate::types::questions::PixelBox;
use crate::types::{Axis, AxisLevel, FrameId, ObjectCrop, Thumbnail};

/// Codes of results that are not the index of a choice.
pub(in crate::report) const UNREAD: u8 = 26;
pub(in crate::report) const FAILED: u8 = 27;
pub(in crate::report) const ABSENT: u8 = 28;

/// Maximum length of a reply on the page, in characters. The first value with which all replies fit is used.
const MAX_REPLY_CHARS: [usize; 5] = [20_000, 2_000, 400, 100, 30];
/// Size limits, tried in order until the packed items fit into [`MAX_PACKED_BYTES`].
const SIZE_LIMITS: [SizeLimit; 3] = [
    SizeLimit {
        text: 12_000_000,
        pictures: 7_000_000,
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
/// Maximum size of the packed items in bytes, so that the page stays under 12 MB.
const MAX_PACKED_BYTES: usize = 10_500_000;

/// Maximum sizes of the parts that can be shortened.
#[derive(Debug, Clone, Copy)]
pub(in crate::report) struct SizeLimit {
    /// Bytes of all different replies.
    pub(in crate::report) text: usize,
    /// Bytes of all thumbnails.
    pub(in crate::report) pictures: usize,
}

/// The kind of questions.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(rename_all = "lowercase")]
pub(in crate::report) enum PageKind {
    /// Questions with choices; a result is the index of the choice.
    Choice,
    /// Open questions; a result is the mark of the judge from 1 to 5, or 0 for an answer that says nothing.
    Open,
}

#[derive(Serialize)]
pub(in crate::report) struct PageData<'a> {
    pub(in crate::report) kind: PageKind,
    pub(in crate::report) runs: Vec<String>,
    /// The folder of each run.
    pub(in crate::report) folders: Vec<String>,
    pub(in crate::report) levels: Vec<[String; 2]>,
    /// Each family: its name in the run, and in words.
    pub(in crate::report) families: Vec<[&'a str; 2]>,
    pub(in crate::report) frames: Vec<&'a str>,
    /// Width and height of each frame of which there are small copies, in pixels.
    pub(in crate::report) sizes: Vec<Option<[u32; 2]>>,
    pub(in crate::report) subjects: Vec<ModelInCondition<'a>>,
    pub(in crate::report) questions: Vec<Question<'a>>,
    pub(in crate::report) choices: Vec<&'a [String]>,
    pub(in crate::report) items: Vec<Item>,
    pub(in crate::report) strict: Vec<Vec<u8>>,
    pub(in crate::report) lenient: Vec<Vec<u8>>,
    pub(in crate::report) reasons: Vec<String>,
    pub(in crate::report) why: Vec<Vec<usize>>,
    pub(in crate::report) texts: Vec<String>,
    pub(in crate::report) replies: Vec<Vec<usize>>,
    /// The texts of the judge's replies, as `replies`; empty where nobody judges.
    pub(in crate::report) judged: Vec<Vec<usize>>,
    pub(in crate::report) confusions: Vec<Confusion<'a>>,
    pub(in crate::report) thumbnails: BTreeMap<usize, BTreeMap<String, Picture<'a>>>,
}

#[derive(Serialize)]
pub(in crate::report) struct ModelInCondition<'a> {
    pub(in crate::report) name: String,
    pub(in crate::report) model: &'a str,
    pub(in crate::report) condition: String,
    /// Variant and enhancer in words, or `blind`.
    pub(in crate::report) light: String,
    pub(in crate::report) level: Option<AxisLevel>,
    pub(in crate::report) variant: String,
    pub(in crate::report) enhancer: Option<&'a str>,
    /// Index of the subject of the clean frames of the same images, if it was asked.
    pub(in crate::report) clean: Option<usize>,
}

#[derive(Serialize)]
pub(in crate::report) struct Question<'a> {
    pub(in crate::report) id: &'a str,
    pub(in crate::report) frame: usize,
    pub(in crate::report) family: usize,
    pub(in crate::report) text: &'a str,
    pub(in crate::report) evidence: Option<&'a Value>,
    /// The boxes of the things that it is about, and the box of all of them, in pixels of its frame.
    pub(in crate::report) outlines: Vec<PixelBox>,
    pub(in crate::report) object: Option<PixelBox>,
    /// The right answer of an open question, and further ones.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(in crate::report) answer: Option<&'a str>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(in crate::report) also_right: &'a [String],
}

#[derive(Serialize)]
pub(in crate::report) struct Item {
    /// Id of the question; from its second item on with a number: `id#2`.
    pub(in crate::report) name: String,
    pub(in crate::report) question: usize,
    pub(in crate::report) choices: usize,
    /// Index of the true choice; `None` if nobody knows it.
    pub(in crate::report) truth: Option<usize>,
}

#[derive(Serialize)]
pub(in crate::report) struct Confusion<'a> {
    pub(in crate::report) subject: usize,
    pub(in crate::report) family: &'a str,
    pub(in crate::report) labels: &'a [String],
    pub(in crate::report) counts: &'a [Vec<usize>],
}

#[derive(Serialize)]
pub(in crate::report) struct Picture<'a> {
    pub(in crate::report) small: &'a str,
    pub(in crate::report) crop: &'a str,
    pub(in crate::report) stops: f32,
    pub(in crate::report) objects: &'a [ObjectCrop],
}

/// A list without repetition, and the index of each entry.
pub(in crate::report) struct Distinct<T> {
    pub(in crate::report) list: Vec<T>,
    pub(in crate::report) indices: HashMap<T, usize>,
}

impl<T: Copy + Eq + std::hash::Hash> Distinct<T> {
    pub(in crate::report) fn new() -> Self {
        Self {
            list: Vec::new(),
            indices: HashMap::new(),
        }
    }

    pub(in crate::report) fn index_of(&mut self, entry: T) -> usize {
        *self.indices.entry(entry).or_insert_with(|| {
            self.list.push(entry);
            self.list.len() - 1
        })
    }
}

/// Data in base64, with as much of the replies and images as there is room for.
///
/// # Errors
/// If the data cannot be written.
pub(in crate::report) fn packed_by<'a>(data: impl Fn(SizeLimit) -> PageData<'a>) -> Result<String> {
    let mut packed = String::new();
    for limit in SIZE_LIMITS {
        packed = pack(&data(limit))?;
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

/// Texts, all cut to the greatest length with which they have room.
pub(in crate::report) fn shortened(texts: &[&str], limit: usize) -> Vec<String> {
    let fits = |longest: &&usize| {
        texts
            .iter()
            .map(|text| text.len().min(**longest))
            .sum::<usize>()
            <= limit
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
    texts.iter().map(cut).collect()
}

/// The size of each frame that small copies state.
pub(in crate::report) fn sizes(thumbnails: &[Thumbnail], frames: &[&str]) -> Vec<Option<[u32; 2]>> {
    let stated: HashMap<&str, [u32; 2]> = thumbnails
        .iter()
        .filter_map(|thumbnail| Some((&*thumbnail.frame.0, thumbnail.size?)))
        .collect();
    frames
        .iter()
        .map(|frame| stated.get(frame).copied())
        .collect()
}

/// The name of each level, in the order of tables, and its severity in words: `6 EV`.
pub(in crate::report) fn levels(levels: impl Iterator<Item = AxisLevel>) -> Vec<[String; 2]> {
    let levels: BTreeSet<AxisLevel> = levels.collect();
    levels
        .into_iter()
        .map(|level| {
            let unit = level.axis().unwrap_or(Axis::LIGHT).unit;
            let severity = match level {
                AxisLevel::PAIR => "by frame".to_owned(),
                _ => format!("{} {unit}", level.value()),
            };
            [level.to_string(), severity]
        })
        .collect()
}

/// The thumbnails that a page shows of these frames, of which it may have no room for all.
pub(crate) fn shown_thumbnails<'a>(
    all: &[Thumbnail],
    frames: impl IntoIterator<Item = &'a FrameId>,
) -> Vec<Thumbnail> {
    let numbers: HashMap<&str, usize> = frames
        .into_iter()
        .enumerate()
        .map(|(n, frame)| (&*frame.0, n))
        .collect();
    let shown = thumbnails(all, &numbers, SIZE_LIMITS[0].pictures);
    let picture = |thumbnail: &Thumbnail| {
        let number = numbers.get(&*thumbnail.frame.0)?;
        shown.get(number)?.get(&thumbnail.condition.to_string())
    };
    all.iter()
        .filter_map(|thumbnail| {
            let objects = picture(thumbnail)?.objects.to_vec();
            Some(Thumbnail {
                objects,
                ..thumbnail.clone()
            })
        })
        .collect()
}

/// Thumbnails of as many frames as the size limit allows, by the index of the frame; crops of things as there is room behind them.
pub(in crate::report) fn thumbnails<'a>(
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
        let size: usize = thumbnails
            .iter()
            .map(|t| t.small.len() + t.crop.len())
            .sum();
        if size > bytes_left {
            break;
        }
        bytes_left -= size;
        kept.push((*number, thumbnails));
    }
    let mut by_number = BTreeMap::new();
    for (number, thumbnails) in kept {
        let size: usize = thumbnails
            .iter()
            .flat_map(|thumbnail| &thumbnail.objects)
            .map(|object| object.crop.len())
            .sum();
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
