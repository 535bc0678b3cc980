//! A table of trials with choices as bytes, for the index of a log: [`Trials::write_to`], [`Trials::read_from`].

use std::borrow::Cow;
use std::io::{self, BufRead, ErrorKind, Write};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::Trials;
use super::asked_model::{AskedModel, Ending};
use super::choice_facts::{ChoiceFacts, ChoiceTables, TrialFacts};
use super::interner::{Interner, TextPlace};
use crate::types::ChoiceDetail;
use crate::types::records::record::TrialKey;
use crate::types::records::small_number::{SmallNumber, Tokens};

/// Number of words (little-endian, 4 bytes) of one trial: its key, the place of its line, the hash of its reply, the
/// indices of its item, model and ending, its tokens, latency and [`ChoiceFacts`].
const WORDS: usize = 4 + 2 + 2 + 3 + 6 + 1 + 4;

/// What the words of trials refer to, written as a line of JSON. A line for each item follows.
#[derive(Serialize, Deserialize)]
struct Tables<'t> {
    /// Number of trials.
    trials: usize,
    /// Number of items.
    items: usize,
    asked: Cow<'t, Interner<AskedModel>>,
    endings: Cow<'t, Interner<Ending>>,
    choices: Cow<'t, ChoiceTables>,
}

impl Trials<ChoiceDetail> {
    /// Writes the trials of one file, with their keys. Equal trials give equal bytes.
    ///
    /// # Errors
    /// If `out` cannot be written.
    pub fn write_to(&self, out: &mut dyn Write) -> io::Result<()> {
        let tables = Tables {
            trials: self.facts.len(),
            items: self.items.len(),
            asked: Cow::Borrowed(&self.asked),
            endings: Cow::Borrowed(&self.endings),
            choices: Cow::Borrowed(&self.tables),
        };
        write_line(out, &tables)?;
        for item in self.items.all() {
            write_line(out, item)?;
        }
        for (facts, key) in self.facts.iter().zip(&self.keys) {
            out.write_all(to_words(facts, *key).map(u32::to_le_bytes).as_flattened())?;
        }
        Ok(())
    }

    /// Reads what [`write_to`](Self::write_to) has written.
    ///
    /// # Errors
    /// If `from` cannot be read, or has other bytes.
    pub fn read_from(from: &mut dyn BufRead) -> io::Result<Self> {
        let mut line = Vec::new();
        let tables: Tables<'_> = read_line(from, &mut line)?;
        let mut trials = Self {
            asked: tables.asked.into_owned(),
            endings: tables.endings.into_owned(),
            tables: tables.choices.into_owned(),
            ..Self::default()
        };
        for _ in 0..tables.items {
            let item = trials.share_texts(read_line(from, &mut line)?);
            trials.items.push(item);
        }
        if !trials.tables.is_complete() {
            return Err(ErrorKind::InvalidData.into());
        }
        for _ in 0..tables.trials {
            let mut bytes = [[0; 4]; WORDS];
            from.read_exact(bytes.as_flattened_mut())?;
            let (key, facts) =
                trials.decode(bytes.map(u32::from_le_bytes)).ok_or_else(|| io::Error::from(ErrorKind::InvalidData))?;
            trials.keys.push(key);
            trials.facts.push(facts);
        }
        Ok(trials)
    }

    /// The key and the facts of a trial from their words; `None` if these do not fit the tables.
    fn decode(&self, words: [u32; WORDS]) -> Option<(TrialKey, TrialFacts<ChoiceFacts>)> {
        #[rustfmt::skip]
        let [
            k0, k1, k2, k3, low, high, reply0, reply1, item, asked, ending,
            prompt, completion, cached, cost0, cost1, tier, latency, images, rare, answers, outcome,
        ] = words;
        let is_complete = (item as usize) < self.items.len()
            && (asked as usize) < self.asked.len()
            && (ending as usize) < self.endings.len();
        let facts = TrialFacts {
            text: TextPlace::new(u64::from(high) << 32 | u64::from(low)),
            reply: [reply0, reply1],
            item,
            asked,
            ending,
            tokens: Tokens::from_words([prompt, completion, cached, cost0, cost1, tier])?,
            latency: SmallNumber::from_word(latency),
            facts: ChoiceFacts::from_words([images, rare, answers, outcome], &self.tables)?,
        };
        is_complete.then_some((TrialKey::from_words([k0, k1, k2, k3]), facts))
    }
}

/// The words of a trial.
fn to_words(facts: &TrialFacts<ChoiceFacts>, key: TrialKey) -> [u32; WORDS] {
    let TrialFacts { text, reply: [reply0, reply1], item, asked, ending, tokens, latency, facts } = *facts;
    let [k0, k1, k2, k3] = key.to_words();
    let [low, high] = [text.start() as u32, (text.start() >> 32) as u32];
    let [prompt, completion, cached, cost0, cost1, tier] = tokens.to_words();
    let [images, rare, answers, outcome] = facts.to_words();
    let latency = latency.to_word();
    #[rustfmt::skip]
    let words = [
        k0, k1, k2, k3, low, high, reply0, reply1, item, asked, ending,
        prompt, completion, cached, cost0, cost1, tier, latency, images, rare, answers, outcome,
    ];
    words
}

fn write_line(out: &mut dyn Write, value: &impl Serialize) -> io::Result<()> {
    serde_json::to_writer(&mut *out, value)?;
    out.write_all(b"\n")
}

/// The value in the next line; `line` is the memory to read it into.
fn read_line<T: DeserializeOwned>(from: &mut dyn BufRead, line: &mut Vec<u8>) -> io::Result<T> {
    line.clear();
    from.read_until(b'\n', line)?;
    Ok(serde_json::from_slice(line)?)
}
