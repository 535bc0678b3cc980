//! File format of one entry of the store: [`Entry`].
//!
//! A file consists of the encoded image as it is sent to models, facts about it as JSON, and a footer of [`FOOTER`]
//! bytes:
//!
//! | bytes | |
//! |---|---|
//! | 32 | BLAKE3 of the key, the next four numbers, the image and the facts |
//! | 8 | length of the image |
//! | 4, 4, 4 | length of the facts, width and height in pixels |
//! | 8 | `DQIMAGE1` |
//!
//! Numbers are little-endian. The digest covers the key, so that exchanged files are detected.
//!
//! Key of an entry in the store: [`Key`].
//!
//! Kinds of images that a store keeps: [`StoredKinds`].
//!
//! Estimate of the bytes that a run would store: [`ImageSet`].

use std::fmt;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use darkqa_base::error::Result;
use darkqa_base::types::Digest;
use darkqa_base::types::flags::flag_words;

/// Last bytes of each file: type and version of the format.
const MAGIC: &[u8; 8] = b"DQIMAGE1";

/// Length of the footer in bytes.
pub(super) const FOOTER: usize = 32 + 8 + 3 * 4 + 8;

/// An entry of the store: an image with facts, or only facts.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Encoded image or thumbnail; empty for an entry with facts only.
    pub image: Vec<u8>,
    /// Width and height in pixels; 0 without an image.
    pub size: [u32; 2],
    pub facts: EntryFacts,
}

/// Facts stored with an image, or without one.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct EntryFacts {
    /// Description of the entry, for listings of the store.
    pub shown: Shown,
    /// Time that the entry took to compute, in milliseconds.
    pub milliseconds: u64,
    /// Results recorded when the image was computed, in a format of the caller.
    #[serde(default)]
    pub notes: Value,
    /// Input of the key's digest.
    #[serde(default)]
    recipe: Value,
}

/// Type of an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum EntryType {
    /// An image, with its measures.
    #[default]
    Image,
    /// Measures of an image that is not stored.
    Measures,
    /// Findings of an enhancer's probe.
    Probe,
    /// Thumbnail of an image, for the report of a run.
    Thumbnail,
}

/// Description of an entry in listings.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
pub struct Shown {
    #[serde(default)]
    pub content: EntryType,
    /// Name of the enhancer; `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub enhancer: Option<String>,
    /// Degradation of the frame, such as `L3-noise`; empty for a probe.
    pub light: String,
    /// Image format, such as `png`; empty for a probe.
    pub format: String,
}

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let enhancer = self.enhancer.as_deref();
        match self.content {
            EntryType::Probe => {
                return write!(f, "tries of {}", enhancer.unwrap_or("an enhancer"));
            }
            EntryType::Measures => f.write_str("measures of ")?,
            EntryType::Thumbnail => f.write_str("small copies of ")?,
            EntryType::Image => {}
        }
        f.write_str(&self.light)?;
        if let Some(enhancer) = enhancer {
            write!(f, ", enhanced by {enhancer}")?;
        }
        write!(f, ", {}", self.format)
    }
}

impl EntryFacts {
    /// Facts about an entry that took this time to compute.
    pub fn new(shown: Shown, milliseconds: u64, notes: Value) -> Self {
        Self { shown, milliseconds, notes, recipe: Value::Null }
    }
}

/// Error for a file that is not a valid entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Damaged;

impl Entry {
    /// An entry without an image.
    pub fn from_facts(facts: EntryFacts) -> Self {
        Self { image: Vec::new(), size: [0, 0], facts }
    }

    /// Encodes the entry as the file for a key.
    pub(super) fn encode(&self, key: &Key) -> Vec<u8> {
        let facts = EntryFacts { recipe: key.recipe().clone(), ..self.facts.clone() };
        let facts = serde_json::json!(facts).to_string();
        let numbers = numbers(self.image.len() as u64, facts.len() as u32, self.size);
        let digest = digest(key, &numbers, &self.image, facts.as_bytes());
        [&self.image, facts.as_bytes(), digest.as_bytes(), &numbers, MAGIC].concat()
    }

    /// Decodes the file of a key.
    ///
    /// # Errors
    /// If the file is truncated or changed, has another format, or belongs to another key.
    pub(super) fn decode(key: &Key, mut file: Vec<u8>) -> Result<Self, Damaged> {
        let footer = EntryFooter::read(&file)?;
        let (image, rest) = file.split_at(footer.image);
        let facts = rest.get(..footer.facts).ok_or(Damaged)?;
        if digest(key, &footer.numbers, image, facts) != footer.digest {
            return Err(Damaged);
        }
        let facts = serde_json::from_slice(facts).map_err(|_| Damaged)?;
        file.truncate(footer.image);
        Ok(Self { image: file, size: footer.size, facts })
    }
}

/// Decodes the facts and the image's length in bytes from the end of a file, `tail`, without checking the digest.
/// `length` is the length of the whole file.
pub(super) fn facts_at_end(tail: &[u8], length: u64) -> Option<(EntryFacts, u64)> {
    let start = tail.len().checked_sub(FOOTER)?;
    let (body, footer) = tail.split_at(start);
    let (image, facts) = lengths(footer, length)?;
    let facts = body.get(body.len().checked_sub(facts as usize)?..)?;
    Some((serde_json::from_slice(facts).ok()?, image))
}

/// True if a file of this length can end in this footer.
pub(super) fn is_footer_valid(footer: &[u8], length: u64) -> bool {
    lengths(footer, length).is_some()
}

/// Lengths of image and facts that a footer states; `None` if they contradict the file's length.
fn lengths(footer: &[u8], length: u64) -> Option<(u64, u32)> {
    let image = u64::from_le_bytes(footer.get(32..40)?.try_into().ok()?);
    let facts = u32::from_le_bytes(footer.get(40..44)?.try_into().ok()?);
    let whole = image.checked_add(u64::from(facts) + FOOTER as u64)?;
    (footer.get(52..)? == MAGIC && whole == length).then_some((image, facts))
}

/// Decoded footer of a file.
struct EntryFooter {
    digest: blake3::Hash,
    /// The encoded lengths and sides, which the digest covers.
    numbers: [u8; 20],
    /// Length of the image in bytes.
    image: usize,
    /// Length of the facts in bytes.
    facts: usize,
    /// Width and height in pixels.
    size: [u32; 2],
}

impl EntryFooter {
    fn read(file: &[u8]) -> Result<Self, Damaged> {
        let start = file.len().checked_sub(FOOTER).ok_or(Damaged)?;
        let (digest, rest) = file[start..].split_at(32);
        let (numbers, magic) = rest.split_at(20);
        let digest: [u8; 32] = digest.try_into().map_err(|_| Damaged)?;
        let numbers: [u8; 20] = numbers.try_into().map_err(|_| Damaged)?;
        let (words, _) = numbers.as_chunks::<4>();
        let words: [u32; 5] = std::array::from_fn(|index| u32::from_le_bytes(words[index]));
        let [image_low, image_high, facts, width, height] = words;
        let image = u64::from(image_low) | u64::from(image_high) << 32;
        let facts = u64::from(facts);
        if magic != MAGIC || image.checked_add(facts) != Some(start as u64) {
            return Err(Damaged);
        }
        Ok(Self {
            digest: blake3::Hash::from_bytes(digest),
            numbers,
            image: image as usize,
            facts: facts as usize,
            size: [width, height],
        })
    }
}

fn numbers(image: u64, facts: u32, [width, height]: [u32; 2]) -> [u8; 20] {
    let mut numbers = [0; 20];
    numbers[..8].copy_from_slice(&image.to_le_bytes());
    for (place, number) in [facts, width, height].into_iter().enumerate() {
        numbers[8 + 4 * place..][..4].copy_from_slice(&number.to_le_bytes());
    }
    numbers
}

fn digest(key: &Key, numbers: &[u8; 20], image: &[u8], facts: &[u8]) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    hasher.update(MAGIC).update(key.digest().as_bytes());
    hasher.update(numbers).update(image).update(facts);
    hasher.finalize()
}

/// Domain and version of the digests. The version is raised when the same recipe gives another image, or when entries
/// get other facts. Entries of other versions are not found any more, and are evicted when they are old.
const DOMAIN: &str = "darkqa.image-store/1";

/// Digest of a recipe (everything that determines the file of an image), with the recipe as canonical JSON.
#[derive(Debug, Clone, PartialEq)]
pub struct Key {
    digest: Digest,
    recipe: Value,
}

impl Key {
    /// The key of a recipe, which must contain everything that determines the bytes of an image, and nothing else.
    ///
    /// # Errors
    /// If a number of the recipe is infinite or NaN.
    pub fn from_recipe(recipe: &impl Serialize) -> Result<Self> {
        let (digest, recipe) = Digest::canonical_value(DOMAIN, recipe)?;
        Ok(Self { digest, recipe })
    }

    pub fn digest(&self) -> &Digest {
        &self.digest
    }

    /// The recipe as canonical JSON.
    pub(super) fn recipe(&self) -> &Value {
        &self.recipe
    }
}

/// Which images are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum StoredKinds {
    /// Enhanced images; of the others PSNR and SSIM alone
    Enhanced,
    /// Degraded ones too, which are made faster than a network share is read: for slow processors and fast disks
    All,
}

flag_words!(StoredKinds);

/// Estimated size of a run's images that a store would keep, and the store's capacity, in bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageSet {
    kinds: StoredKinds,
    bytes: f64,
    room: f64,
}

impl ImageSet {
    /// An empty set, for a store with this capacity in bytes.
    pub(super) fn new(kinds: StoredKinds, room: f64) -> Self {
        Self { kinds, bytes: 0.0, room }
    }

    /// Adds images of this total size in bytes, if the store keeps images of this kind.
    pub fn add(&mut self, is_enhanced: bool, bytes: f64) {
        if is_enhanced || self.kinds == StoredKinds::All {
            self.bytes += bytes;
        }
    }

    /// Description of the images that the store keeps.
    pub fn description(&self) -> &'static str {
        match self.kinds {
            StoredKinds::Enhanced => "enhanced images",
            StoredKinds::All => "images",
        }
    }

    pub fn bytes(&self) -> f64 {
        self.bytes
    }

    pub fn room(&self) -> f64 {
        self.room
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry() -> Entry {
        Entry {
            image: (0..=255).collect(),
            size: [16, 9],
            facts: EntryFacts { milliseconds: 120, notes: serde_json::json!({"psnr": 21.5}), ..EntryFacts::default() },
        }
    }

    #[test]
    fn decoding_inverts_encoding_and_detects_every_changed_byte() {
        let (key, other) = (Key::from_recipe(&["a"]).unwrap(), Key::from_recipe(&["b"]).unwrap());
        let file = entry().encode(&key);
        let read = Entry::decode(&key, file.clone()).unwrap();
        assert_eq!((&read.image, read.size), (&entry().image, [16, 9]));
        assert_eq!(read.facts.notes, entry().facts.notes);
        assert_eq!(Entry::decode(&other, file.clone()), Err(Damaged));
        for place in 0..file.len() {
            let mut changed = file.clone();
            changed[place] ^= 1;
            assert_eq!(Entry::decode(&key, changed), Err(Damaged), "{place}");
            assert_eq!(Entry::decode(&key, file[..place].to_vec()), Err(Damaged));
        }
        assert_eq!(Entry::decode(&key, [&file[..], b"x"].concat()), Err(Damaged));
    }

    #[test]
    fn facts_are_decoded_from_the_end_of_a_file() {
        let key = Key::from_recipe(&["a"]).unwrap();
        let file = entry().encode(&key);
        let (facts, image) = facts_at_end(&file[200..], file.len() as u64).unwrap();
        assert_eq!((facts.milliseconds, image), (120, 256));
        assert_eq!(facts.recipe, serde_json::json!(["a"]));
        assert_eq!(facts_at_end(&file, file.len() as u64 + 1), None);
        assert_eq!(facts_at_end(&file[file.len() - FOOTER..], 1), None);
        assert_eq!(facts_at_end(b"short", 5), None);
    }
}
