//! Data that the report page embeds for its script: [`PageData`], as gzipped JSON in base64 ([`packed_by`]).

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::Write;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use serde::Serialize;

use super::prompts::PagePrompts;
use crate::text::words;
use darkqa_base::error::{Error, Result};
use darkqa_base::types::questions::PixelBox;
use darkqa_base::types::{Axis, AxisLevel, EnhancerName, Evidence, FrameId, ObjectCrop, Thumbnail, View};
use darkqa_score::model_in_condition;

/// Result code of a reply that could not be parsed. Smaller codes are choice indices or marks of the judge
/// ([`PageKind`]).
pub(crate) const UNREAD: u8 = 26;

/// Result code of a failed trial.
pub(crate) const FAILED: u8 = 27;

/// Result code of an item that the subject was not asked.
pub(crate) const ABSENT: u8 = 28;

/// Maximum lengths of a reply on the page in characters, tried in order until all replies fit into [`SizeLimit::text`].
const MAX_REPLY_CHARS: [usize; 5] = [20_000, 2_000, 400, 100, 30];

/// Size limits, tried in order until the packed items fit into [`MAX_PACKED_BYTES`].
const SIZE_LIMITS: [SizeLimit; 3] = [
    SizeLimit { text: 12_000_000, pictures: 7_000_000 },
    SizeLimit { text: 4_000_000, pictures: 4_000_000 },
    SizeLimit { text: 1_000_000, pictures: 1_000_000 },
];

/// Maximum size of the packed items in bytes, so that the page stays under 12 MB.
const MAX_PACKED_BYTES: usize = 10_500_000;

/// Maximum sizes of the replies and the thumbnails on the page.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SizeLimit {
    /// Total size of the distinct replies, in bytes.
    pub text: usize,
    /// Total size of the thumbnails and object crops, in bytes.
    pub pictures: usize,
}

/// Kind of the report's questions.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum PageKind {
    /// Multiple-choice questions; a result is the index of the chosen answer.
    Choice,
    /// Open questions; a result is the judge's mark from 1 to 5, or 0 for an empty answer.
    Open,
}

/// All data of the page's script. Entries refer to each other by their indices in these lists. Nested lists have a row
/// for each subject and a column for each item.
#[derive(Serialize)]
pub(crate) struct PageData<'a> {
    pub kind: PageKind,
    /// Name of each run.
    pub runs: Vec<String>,
    /// Folder of each run.
    pub folders: Vec<String>,
    /// Name and severity of each level.
    pub levels: Vec<[String; 2]>,
    /// Recorded name and display name of each family.
    pub families: Vec<[&'a str; 2]>,
    pub frames: Vec<&'a str>,
    /// Width and height of each frame in pixels; `None` if no thumbnail records them.
    pub sizes: Vec<Option<[u32; 2]>>,
    pub subjects: Vec<PageSubject<'a>>,
    pub questions: Vec<PageQuestion<'a>>,
    pub choices: Vec<&'a [String]>,
    pub items: Vec<PageItem>,
    /// Result codes by strict parsing.
    pub strict: Vec<Vec<u8>>,
    /// Result codes by lenient parsing; empty for open questions.
    pub lenient: Vec<Vec<u8>>,
    /// Distinct reasons for unparsed replies and failed trials.
    pub reasons: Vec<String>,
    /// Index into `reasons` of each result.
    pub why: Vec<Vec<usize>>,
    /// Distinct texts of replies.
    pub texts: Vec<String>,
    /// Index into `texts` of each reply.
    pub replies: Vec<Vec<usize>>,
    /// Index into `texts` of each judge's reply; empty without a judge.
    pub judged: Vec<Vec<usize>>,
    /// The requests behind the replies; omitted if no reply came from an endpoint.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub requests: Option<PageRequests>,
    pub confusions: Vec<PageConfusion<'a>>,
    /// Images by frame index and condition name.
    pub thumbnails: BTreeMap<usize, BTreeMap<String, Picture<'a>>>,
}

/// Facts about the requests of each subject and item; 0 is not known.
#[derive(Clone, Serialize)]
pub(crate) struct PageRequests {
    /// Duration of the last request, in milliseconds.
    pub latency: Vec<Vec<u64>>,
    /// Tokens of the prompt, with the images.
    pub prompt: Vec<Vec<u64>>,
    /// Tokens of the reply.
    pub reply: Vec<Vec<u64>>,
    /// Number of requests.
    pub attempts: Vec<Vec<u32>>,
    /// Cost in nanodollars; empty if no cost is known.
    pub cost: Vec<Vec<u64>>,
    /// Prompts; omitted if they are not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prompts: Option<PagePrompts>,
}

/// Subject of the report: a model in a condition.
#[derive(Serialize)]
pub(crate) struct PageSubject<'a> {
    pub name: String,
    pub model: &'a str,
    /// True if the model is a reference and not under test.
    pub reference: bool,
    pub condition: String,
    /// Display text of variant and enhancer; `blind` without images.
    pub light: String,
    pub level: Option<AxisLevel>,
    pub variant: String,
    pub enhancer: Option<&'a str>,
    /// Index of the subject with the same model at L0 and no enhancer; `None` if it does not exist.
    pub clean: Option<usize>,
}

impl<'a> PageSubject<'a> {
    /// A subject as the script needs it.
    pub(crate) fn new(subject: &'a model_in_condition::ModelInCondition, clean: Option<usize>) -> Self {
        Self {
            name: words::name(subject),
            model: &subject.model,
            reference: subject.is_reference(),
            condition: subject.condition(),
            light: match subject.view {
                Some(View::Blind) => "blind".to_owned(),
                _ => words::light(&subject.variant, subject.enhancer.as_ref()),
            },
            level: subject.level,
            variant: subject.variant.to_string(),
            enhancer: subject.enhancer.as_ref().map(EnhancerName::as_str),
            clean,
        }
    }
}

#[derive(Serialize)]
pub(crate) struct PageQuestion<'a> {
    pub id: &'a str,
    pub frame: usize,
    pub family: usize,
    pub text: &'a str,
    pub evidence: Option<&'a Evidence>,
    /// Bounding boxes of the objects in question, in pixels of the frame.
    pub outlines: Vec<PixelBox>,
    /// Bounding box of all objects in question together.
    pub object: Option<PixelBox>,
    /// Reference answer to an open question.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub answer: Option<&'a str>,
    /// Further accepted answers to an open question.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub also_right: &'a [String],
}

#[derive(Serialize)]
pub(crate) struct PageItem {
    /// Question id, with the item's number if it is not the question's first item, as in `id#2`.
    pub name: String,
    pub question: usize,
    /// Index into the lists of choices.
    pub choices: usize,
    /// Index of the true choice; `None` if the truth is unknown.
    pub truth: Option<usize>,
    /// Wording, order and draw in words; empty for a run with one of each.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub combination: String,
    /// Draw of the noise; absent for the first.
    #[serde(skip_serializing_if = "is_first")]
    pub draw: u16,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde hands a reference")]
fn is_first(draw: &u16) -> bool {
    *draw == 0
}

#[derive(Serialize)]
pub(crate) struct PageConfusion<'a> {
    pub subject: usize,
    pub family: &'a str,
    pub labels: &'a [String],
    pub counts: &'a [Vec<usize>],
}

/// Images of a frame in one condition.
#[derive(Serialize)]
pub(crate) struct Picture<'a> {
    /// Small copy of the whole image, as a data URL.
    pub small: &'a str,
    /// Middle of the image, as a data URL.
    pub crop: &'a str,
    /// Gain applied to the crop, in EV.
    pub stops: f32,
    pub objects: &'a [ObjectCrop],
}

/// List of distinct entries, and the index of each entry.
pub(crate) struct DistinctList<T> {
    pub list: Vec<T>,
    pub indices: HashMap<T, usize>,
}

impl<T: Copy + Eq + std::hash::Hash> DistinctList<T> {
    pub(crate) fn new() -> Self {
        Self { list: Vec::new(), indices: HashMap::new() }
    }

    /// Returns the index of an entry; adds the entry if it is new.
    pub(crate) fn index_of(&mut self, entry: T) -> usize {
        *self.indices.entry(entry).or_insert_with(|| {
            self.list.push(entry);
            self.list.len() - 1
        })
    }
}

/// Packs the data that `data` builds for a size limit. Tries [`SIZE_LIMITS`] in order until the packed data fit into
/// [`MAX_PACKED_BYTES`]; the last limit is used even if they do not fit.
///
/// # Errors
/// If the data cannot be serialized.
pub(crate) fn packed_by<'a>(data: impl Fn(SizeLimit) -> PageData<'a>) -> Result<String> {
    let mut packed = String::new();
    for limit in SIZE_LIMITS {
        packed = pack(&data(limit))?;
        if packed.len() <= MAX_PACKED_BYTES {
            break;
        }
    }
    Ok(packed)
}

/// Compresses data and encodes them in base64.
fn pack(data: &PageData<'_>) -> Result<String> {
    let compressed = compress(data).map_err(|e| Error::data("report.html", e))?;
    Ok(STANDARD.encode(compressed))
}

/// Serializes data as JSON and compresses it with gzip.
fn compress(data: &PageData<'_>) -> std::io::Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::new(6));
    serde_json::to_writer(std::io::BufWriter::new(&mut encoder), data)?;
    encoder.flush()?;
    encoder.finish()
}

/// Cuts all texts to one maximum length: the first of [`MAX_REPLY_CHARS`] at which they fit together into `limit`
/// bytes, else the last.
pub(crate) fn shortened(texts: &[&str], limit: usize) -> Vec<String> {
    let max_chars = MAX_REPLY_CHARS
        .into_iter()
        .find(|max| {
            let bytes: usize = texts.iter().map(|text| cut(text, *max).len()).sum();
            bytes <= limit
        })
        .unwrap_or(MAX_REPLY_CHARS[MAX_REPLY_CHARS.len() - 1]);
    texts
        .iter()
        .map(|text| {
            let short = cut(text, max_chars);
            if short.len() == text.len() {
                return short.to_owned();
            }
            let all = text.chars().count();
            format!("{short} … [cut here after {max_chars} of {all} characters; records.jsonl has all]")
        })
        .collect()
}

/// The first `max_chars` characters of a text.
fn cut(text: &str, max_chars: usize) -> &str {
    let end = text.char_indices().nth(max_chars);
    end.map_or(text, |(end, _)| &text[..end])
}

/// Width and height of each frame in pixels; `None` if no thumbnail records them.
pub(crate) fn sizes(thumbnails: &[Thumbnail], frames: &[&str]) -> Vec<Option<[u32; 2]>> {
    let recorded: HashMap<&str, [u32; 2]> =
        thumbnails.iter().filter_map(|thumbnail| Some((&*thumbnail.frame.0, thumbnail.size?))).collect();
    frames.iter().map(|frame| recorded.get(frame).copied()).collect()
}

/// Name and severity of each distinct level in ascending order, such as `L3` and `6 EV`.
pub(crate) fn levels(levels: impl Iterator<Item = AxisLevel>) -> Vec<[String; 2]> {
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

/// Selects the thumbnails of `frames` that fit into the largest size limit. Removes object crops that do not fit.
pub fn fitting_thumbnails<'a>(all: &[Thumbnail], frames: impl IntoIterator<Item = &'a FrameId>) -> Vec<Thumbnail> {
    let indices: HashMap<&str, usize> =
        frames.into_iter().enumerate().map(|(index, frame)| (&*frame.0, index)).collect();
    let fitting = thumbnails(all, &indices, SIZE_LIMITS[0].pictures);
    all.iter()
        .filter_map(|thumbnail| {
            let index = indices.get(&*thumbnail.frame.0)?;
            let picture = fitting.get(index)?.get(&thumbnail.condition.to_string())?;
            Some(Thumbnail { objects: picture.objects.to_vec(), ..thumbnail.clone() })
        })
        .collect()
}

/// Selects thumbnails, in the order of frame ids, until a frame exceeds `bytes_left`. The result is by frame index,
/// from `indices`, and condition name. The object crops of a frame are included if they fit into the bytes that remain.
pub(crate) fn thumbnails<'a>(
    all: &'a [Thumbnail],
    indices: &HashMap<&str, usize>,
    mut bytes_left: usize,
) -> BTreeMap<usize, BTreeMap<String, Picture<'a>>> {
    let mut by_frame = BTreeMap::<&FrameId, Vec<&Thumbnail>>::new();
    for thumbnail in all {
        by_frame.entry(&thumbnail.frame).or_default().push(thumbnail);
    }
    // Thumbnails of all frames take precedence over object crops of the first frames.
    let mut kept = Vec::new();
    for (frame, thumbnails) in by_frame {
        let Some(index) = indices.get(&*frame.0) else {
            continue;
        };
        let size: usize = thumbnails.iter().map(|thumbnail| thumbnail.small.len() + thumbnail.crop.len()).sum();
        if size > bytes_left {
            break;
        }
        bytes_left -= size;
        kept.push((*index, thumbnails));
    }
    let mut by_index = BTreeMap::new();
    for (index, thumbnails) in kept {
        let size: usize =
            thumbnails.iter().flat_map(|thumbnail| &thumbnail.objects).map(|object| object.crop.len()).sum();
        let has_room = size <= bytes_left;
        bytes_left -= if has_room { size } else { 0 };
        let pictures = thumbnails
            .into_iter()
            .map(|thumbnail| {
                let picture = Picture {
                    small: &thumbnail.small,
                    crop: &thumbnail.crop,
                    stops: thumbnail.stops,
                    objects: if has_room { &thumbnail.objects } else { &[] },
                };
                (thumbnail.condition.to_string(), picture)
            })
            .collect();
        by_index.insert(index, pictures);
    }
    by_index
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reply_limit_counts_bytes() {
        let reply = "é".repeat(15_000);
        let [short] = &shortened(&[&reply], 20_000)[..] else {
            panic!("one text expected");
        };
        assert!(short.len() < 20_000, "{}", short.len());
    }
}
