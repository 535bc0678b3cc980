//! The file of one image in the store: [`Entry`].
//!
//! A file is the image as it is sent, then facts about it as JSON, then a footer of [`FOOTER`] bytes:
//!
//! | bytes | |
//! |---|---|
//! | 32 | BLAKE3 of the key, the next four numbers, the image and the facts |
//! | 8 | length of the image |
//! | 4, 4, 4 | length of the facts, width and height in pixels |
//! | 8 | `DQIMAGE1` |
//!
//! Numbers are little-endian. The key is in the digest, so that an entry in the place of another is noticed.

use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::key::Key;

/// Last bytes of each file: kind and version of the form.
const MAGIC: &[u8; 8] = b"DQIMAGE1";
/// Length of the footer in bytes.
pub(super) const FOOTER: usize = 32 + 8 + 3 * 4 + 8;

/// An image as it is in the store.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Entry {
    /// The file of the image, as it is sent, or of its small copy; empty if there are facts alone.
    pub(crate) image: Vec<u8>,
    /// Width and height in pixels; 0 without an image.
    pub(crate) size: [u32; 2],
    pub(crate) facts: EntryFacts,
}

/// Facts stored beside an image, or alone.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct EntryFacts {
    /// The subject of the entry, for lists of the store.
    pub(crate) shown: Shown,
    /// Time that it took to make, in milliseconds.
    pub(crate) milliseconds: u64,
    /// Findings about the image when it was made, in a form of the store's user.
    #[serde(default)]
    pub(crate) notes: Value,
    /// The input of the key's digest.
    #[serde(default)]
    recipe: Value,
}

/// The content of an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Content {
    /// An image, with what was found out about it.
    #[default]
    Image,
    /// Measures of an image that is not kept.
    Measures,
    /// The findings of an enhancer's probe.
    Probe,
    /// A small copy of an image, for the report of a run.
    Thumbnail,
}

/// The subject of an entry, in words.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
pub(crate) struct Shown {
    #[serde(default)]
    pub(crate) content: Content,
    /// Name of the enhancer; `None` without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) enhancer: Option<String>,
    /// The degradation of the frame, as `L3-noise`; empty for a probe.
    pub(crate) light: String,
    /// Format, as `png`; empty for a probe.
    pub(crate) format: String,
}

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let enhancer = self.enhancer.as_deref();
        match self.content {
            Content::Probe => {
                return write!(f, "tries of {}", enhancer.unwrap_or("an enhancer"));
            }
            Content::Measures => f.write_str("measures of ")?,
            Content::Thumbnail => f.write_str("small copies of ")?,
            Content::Image => {}
        }
        f.write_str(&self.light)?;
        if let Some(enhancer) = enhancer {
            write!(f, ", enhanced by {enhancer}")?;
        }
        write!(f, ", {}", self.format)
    }
}

impl EntryFacts {
    /// Facts of an image that took so many milliseconds to make.
    pub(crate) fn new(shown: Shown, milliseconds: u64, notes: Value) -> Self {
        Self {
            shown,
            milliseconds,
            notes,
            recipe: Value::Null,
        }
    }
}

/// Why a file is no entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Damaged;

impl Entry {
    /// An entry without an image.
    pub(crate) fn from_facts(facts: EntryFacts) -> Self {
        Self {
            image: Vec::new(),
            size: [0, 0],
            facts,
        }
    }

    /// The bytes of the file for a key.
    pub(super) fn file(&self, key: &Key) -> Vec<u8> {
        let facts = EntryFacts {
            recipe: key.recipe().clone(),
            ..self.facts.clone()
        };
        let facts = serde_json::json!(facts).to_string();
        let numbers = numbers(self.image.len() as u64, facts.len() as u32, self.size);
        let digest = digest(key, &numbers, &self.image, facts.as_bytes());
        [
            &self.image,
            facts.as_bytes(),
            digest.as_bytes(),
            &numbers,
            MAGIC,
        ]
        .concat()
    }

    /// The entry in the bytes of a file.
    ///
    /// # Errors
    /// If the file is cut or changed, has another form, or is that of another key.
    pub(super) fn read(key: &Key, mut file: Vec<u8>) -> Result<Self, Damaged> {
        let footer = Footer::read(&file)?;
        let (image, rest) = file.split_at(footer.image);
        let facts = rest.get(..footer.facts).ok_or(Damaged)?;
        if digest(key, &footer.numbers, image, facts) != footer.digest {
            return Err(Damaged);
        }
        let facts = serde_json::from_slice(facts).map_err(|_| Damaged)?;
        file.truncate(footer.image);
        Ok(Self {
            image: file,
            size: footer.size,
            facts,
        })
    }
}

/// Reads the end of a file without checking its digest: the facts, and the length of the image in bytes. `tail` is the end of the
/// file, `length` the length of the whole.
pub(super) fn facts_at_end(tail: &[u8], length: u64) -> Option<(EntryFacts, u64)> {
    let start = tail.len().checked_sub(FOOTER)?;
    let (body, footer) = tail.split_at(start);
    let (image, facts) = lengths(footer, length)?;
    let facts = body.get(body.len().checked_sub(facts as usize)?..)?;
    Some((serde_json::from_slice(facts).ok()?, image))
}

/// Whether a file of such a length can end in this footer.
pub(super) fn fits(footer: &[u8], length: u64) -> bool {
    lengths(footer, length).is_some()
}

/// The lengths of the image and of the facts, as a footer states them; `None` if the file has another length.
fn lengths(footer: &[u8], length: u64) -> Option<(u64, u32)> {
    let image = u64::from_le_bytes(footer.get(32..40)?.try_into().ok()?);
    let facts = u32::from_le_bytes(footer.get(40..44)?.try_into().ok()?);
    let whole = image.checked_add(u64::from(facts) + FOOTER as u64)?;
    (footer.get(52..)? == MAGIC && whole == length).then_some((image, facts))
}

/// The footer of a file whose length fits.
struct Footer {
    digest: blake3::Hash,
    numbers: [u8; 20],
    image: usize,
    facts: usize,
    size: [u32; 2],
}

impl Footer {
    fn read(file: &[u8]) -> Result<Self, Damaged> {
        let start = file.len().checked_sub(FOOTER).ok_or(Damaged)?;
        let (digest, rest) = file[start..].split_at(32);
        let (numbers, magic) = rest.split_at(20);
        let digest: [u8; 32] = digest.try_into().map_err(|_| Damaged)?;
        let numbers: [u8; 20] = numbers.try_into().map_err(|_| Damaged)?;
        let word = |at: usize| {
            let bytes = [
                numbers[at],
                numbers[at + 1],
                numbers[at + 2],
                numbers[at + 3],
            ];
            u32::from_le_bytes(bytes)
        };
        let image = u64::from(word(0)) | u64::from(word(4)) << 32;
        let facts = u64::from(word(8));
        if magic != MAGIC || image.checked_add(facts) != Some(start as u64) {
            return Err(Damaged);
        }
        Ok(Self {
            digest: blake3::Hash::from_bytes(digest),
            numbers,
            image: image as usize,
            facts: facts as usize,
            size: [word(12), word(16)],
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

#[cfg(test)]
mod tests {
    use super::*;

    fn entry() -> Entry {
        Entry {
            image: (0..=255).collect(),
            size: [16, 9],
            facts: EntryFacts {
                milliseconds: 120,
                notes: serde_json::json!({"psnr": 21.5}),
                ..EntryFacts::default()
            },
        }
    }

    #[test]
    fn an_entry_reads_back_and_no_changed_byte_does() {
        let (key, other) = (
            Key::from_recipe(&["a"]).unwrap(),
            Key::from_recipe(&["b"]).unwrap(),
        );
        let file = entry().file(&key);
        let read = Entry::read(&key, file.clone()).unwrap();
        assert_eq!((&read.image, read.size), (&entry().image, [16, 9]));
        assert_eq!(read.facts.notes, entry().facts.notes);
        assert_eq!(Entry::read(&other, file.clone()), Err(Damaged));
        for place in 0..file.len() {
            let mut changed = file.clone();
            changed[place] ^= 1;
            assert_eq!(Entry::read(&key, changed), Err(Damaged), "{place}");
            assert_eq!(Entry::read(&key, file[..place].to_vec()), Err(Damaged));
        }
        assert_eq!(Entry::read(&key, [&file[..], b"x"].concat()), Err(Damaged));
    }

    #[test]
    fn the_end_of_a_file_tells_what_it_shows() {
        let key = Key::from_recipe(&["a"]).unwrap();
        let file = entry().file(&key);
        let (facts, image) = facts_at_end(&file[200..], file.len() as u64).unwrap();
        assert_eq!((facts.milliseconds, image), (120, 256));
        assert_eq!(facts.recipe, serde_json::json!(["a"]));
        assert_eq!(facts_at_end(&file, file.len() as u64 + 1), None);
        assert_eq!(facts_at_end(&file[file.len() - FOOTER..], 1), None);
        assert_eq!(facts_at_end(b"short", 5), None);
    }
}
