//! The index of a log, `records.index`: its trials as a compact table. A large run is continued and reported from it in a
//! fraction of the time that its lines take.
//!
//! The log stays the source of truth. An index describes the first bytes of a log, and counts only if they have the digest
//! that it states ([`IndexedStart`]); lines that were appended since are parsed as usual. An index that is cut, damaged, of
//! another log or of another build of the program is ignored. [`read_log`] replaces it.

use std::env;
use std::fs::{self, File};
use std::io::{self, BufRead as _, BufReader, BufWriter, Read as _, Write};
use std::path::Path;
use std::sync::LazyLock;
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};

use super::folder::{RECORDS, merge_by_key};
use super::lines::each_placed_line_after;
use super::pieces::{LinePlace, LineStart};
use super::stored_trial::{RereadRecord, StoredTrial};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, unfinished, write_with};
use darkqa_base::types::{Digest, Distinct, FailureKind, Record, Shared, TextPlace, Trials};
use darkqa_score::answers::record::Detail;

/// The file of the index.
pub const INDEX: &str = "records.index";

/// Number of bytes of lines that an index does not describe, from which on it is written again. Chosen: they are parsed
/// in a tenth of a second, and small runs have no index.
const MIN_BYTES: u64 = 16 << 20;

/// Size of the digest at the end of an index, in bytes.
const DIGEST_BYTES: u64 = 32;

/// Number of bytes that are read at once.
const BUFFER_BYTES: usize = 1 << 20;

/// Maximum length of the first line, in bytes. Chosen: ten times a usual one.
const MAX_HEAD_BYTES: u64 = 4 << 10;

/// The first line of an index. The trials follow, then the digest of everything before it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Head {
    /// The build of the program ([`program_build`]).
    build: String,
    /// The schema of the run.
    schema: String,
    /// Number of bytes of the log that the index describes.
    log_bytes: u64,
    /// The digest of these bytes.
    log_digest: Digest,
    /// Number of lines in these bytes.
    lines: usize,
    /// The rules by which every stored answer is the one in its reply; `None` if the replies were not parsed again.
    reply_reading: Option<String>,
}

impl Head {
    /// Reads the first line of an index, and leaves the file after it; `None` if it is of another build, or of a run of
    /// another kind.
    fn read<D: Detail>(index: &mut BufReader<File>) -> Option<Self> {
        let mut line = Vec::new();
        index.take(MAX_HEAD_BYTES).read_until(b'\n', &mut line).ok()?;
        let head: Self = serde_json::from_slice(&line).ok()?;
        (head.build == program_build() && head.schema == D::SCHEMA).then_some(head)
    }
}

impl Head {
    /// The digest of the log, if the index is of a log of this length.
    fn digest_of_whole(&self, folder: &Path) -> Option<Digest> {
        let bytes = fs::metadata(folder.join(RECORDS)).ok()?.len();
        (bytes == self.log_bytes).then_some(self.log_digest)
    }
}

/// The version of the program, with the size and time of its file, because versions under development share a number.
/// A file that another build has derived from a run is made again.
pub fn program_build() -> &'static str {
    static BUILD: LazyLock<String> = LazyLock::new(|| {
        let program = env::current_exe().and_then(fs::metadata).ok();
        let time = program.as_ref().and_then(|program| program.modified().ok()?.duration_since(UNIX_EPOCH).ok());
        let bytes = program.map_or(0, |program| program.len());
        format!("{} {bytes} {}", env!("CARGO_PKG_VERSION"), time.unwrap_or_default().as_nanos())
    });
    &BUILD
}

/// The beginning of a log that its index describes, after it was compared with the log.
#[derive(Debug, Clone)]
pub struct IndexedStart {
    head: Head,
    /// The state after the described bytes.
    hasher: blake3::Hasher,
}

impl IndexedStart {
    /// Reads the first line of the index of a run folder, and compares it with the log; `None` if there is no index of
    /// this log.
    pub fn check<D: Detail>(folder: &Path) -> Option<Self> {
        if !D::HAS_BYTES {
            return None;
        }
        let mut index = open(folder)?;
        let head = Head::read::<D>(&mut index)?;
        let log = files::open(&folder.join(RECORDS)).ok()?;
        let hasher = hash_first(log, head.log_bytes).ok()?;
        (Digest::from_hasher(&hasher) == head.log_digest).then_some(Self { head, hasher })
    }

    /// The digest of the log as an index states it, which must have been written or compared before; `None` if there is
    /// none of all its lines.
    pub fn stated_digest<D: Detail>(folder: &Path) -> Option<Digest> {
        let head = Head::read::<D>(&mut open(folder)?)?;
        head.digest_of_whole(folder)
    }

    /// The place in the log after the described lines.
    pub(super) fn end(&self) -> LineStart {
        LineStart { bytes: self.head.log_bytes, lines: self.head.lines }
    }

    /// The digest of the log, if the index describes all its lines.
    pub fn digest_of_whole(&self, folder: &Path) -> Option<Digest> {
        self.head.digest_of_whole(folder)
    }

    /// The trials of the described lines; `None` if the index is damaged or was replaced.
    pub(super) fn trials<D: Detail>(&self, folder: &Path) -> Option<Trials<D>> {
        let mut index = open(folder)?;
        let length = index.get_ref().metadata().ok()?.len().checked_sub(DIGEST_BYTES)?;
        let mut digest = [0; DIGEST_BYTES as usize];
        let mut end = files::open(&folder.join(INDEX)).ok()?;
        let hasher = hash_first(&mut end, length).ok()?;
        end.read_exact(&mut digest).ok()?;
        if Digest::from_hasher(&hasher).as_bytes() != &digest || Head::read::<D>(&mut index)? != self.head {
            return None;
        }
        D::read_trials(&mut index).ok()
    }

    /// The states of the described trials, one for each line; `None` as for [`trials`](Self::trials).
    pub(super) fn stored_trials<D: Detail>(&self, folder: &Path) -> Option<Vec<StoredTrial>> {
        let trials = self.trials::<D>(folder)?;
        let models: Vec<Option<Shared<String>>> =
            trials.asked().into_iter().map(|asked| asked.map(|(model, _)| model.to_owned().into())).collect();
        trials.iter().map(|trial| Some(StoredTrial::from_trial(trial, models[trial.asked_number()].clone()?))).collect()
    }
}

fn open(folder: &Path) -> Option<BufReader<File>> {
    let file = files::open(&folder.join(INDEX)).ok()?;
    Some(BufReader::with_capacity(BUFFER_BYTES, file))
}

/// The hasher after the first bytes of a file.
///
/// # Errors
/// If the file cannot be read, or is shorter.
fn hash_first(file: impl io::Read, bytes: u64) -> io::Result<blake3::Hasher> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(file.take(bytes))?;
    if hasher.count() < bytes { Err(io::ErrorKind::UnexpectedEof.into()) } else { Ok(hasher) }
}

/// The last state of each trial in a run folder, in the order of [`read_records`](super::read_records).
pub fn read_trials<D: Detail>(folder: &Path) -> Result<Vec<StoredTrial>> {
    trials_after::<D>(folder, IndexedStart::check::<D>(folder).as_ref())
}

/// The trials of [`read_trials`], from the index as far as it goes.
pub(super) fn trials_after<D: Detail>(folder: &Path, indexed: Option<&IndexedStart>) -> Result<Vec<StoredTrial>> {
    let known = indexed.and_then(|start| Some((start.stored_trials::<D>(folder)?, start.end())));
    let (mut trials, from) = known.unwrap_or_default();
    let mut models = Distinct::default();
    each_placed_line_after(
        &folder.join(RECORDS),
        from,
        |_| {},
        |mut trial: StoredTrial, _| {
            models.share(&mut trial.model);
            trials.push(trial);
        },
    )?;
    Ok(merge_by_key(trials, |trial| trial.key, StoredTrial::add_earlier))
}

/// Writes an index. A folder that cannot be written to has none.
fn write<D: Detail>(folder: &Path, head: &Head, trials: &Trials<D>) {
    let path = folder.join(INDEX);
    let written = write_with(&path, |out| {
        let mut hasher = blake3::Hasher::new();
        let mut body = || {
            let mut out = BufWriter::with_capacity(BUFFER_BYTES, Hashed { out: &mut *out, hasher: &mut hasher });
            serde_json::to_writer(&mut out, head)?;
            out.write_all(b"\n")?;
            D::write_trials(trials, &mut out)?;
            out.flush()
        };
        body()
            .and_then(|()| out.write_all(Digest::from_hasher(&hasher).as_bytes()))
            .map_err(|e| Error::file(&path, "write", e))
    });
    if let Err(e) = written {
        let _ = fs::remove_file(unfinished(&path));
        tracing::debug!("no index of the records: {e}");
    }
}

/// A writer that hashes what it writes.
struct Hashed<'w> {
    out: &'w mut dyn Write,
    hasher: &'w mut blake3::Hasher,
}

impl Write for Hashed<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.hasher.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// Whether the answers of records are taken as they are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answers {
    /// As they are stored.
    Stored,
    /// Parsed again from the replies, by the rules of this version.
    Reread,
}

/// The trials of a run's log in the order of its lines, from its index as far as `start` goes. `convert` changes a
/// record before it becomes a trial. The index is written again if it lacks many lines.
///
/// # Errors
/// If a line is not a record, `convert` fails, or the choices of a record that is parsed again are not valid.
pub fn read_log<D: Detail>(
    folder: &Path,
    start: Option<IndexedStart>,
    answers: Answers,
    convert: impl Fn(Record<D>) -> Result<Record<D>>,
) -> Result<Trials<D>> {
    read_log_indexing(folder, start, answers, MIN_BYTES, convert)
}

/// [`read_log`], which writes an index for `min_bytes` of lines that no index describes.
pub(super) fn read_log_indexing<D: Detail>(
    folder: &Path,
    start: Option<IndexedStart>,
    answers: Answers,
    min_bytes: u64,
    convert: impl Fn(Record<D>) -> Result<Record<D>>,
) -> Result<Trials<D>> {
    let start =
        start.filter(|start| answers == Answers::Stored || start.head.reply_reading.as_deref() == D::REPLY_READING);
    let known = start.and_then(|start| Some((start.trials::<D>(folder)?, start)));
    let (mut trials, from, mut hasher) = match known {
        Some((trials, start)) => (trials, start.end(), start.hasher),
        None => (Trials::default(), LineStart::default(), blake3::Hasher::new()),
    };
    // An index has the answers and failures as the log has them.
    let mut is_as_stored = true;
    let mut result = Ok(());
    let mut add = |record: Record<D>, place: LinePlace| {
        is_as_stored &= record.failure.as_ref().is_none_or(|failure| failure.kind != FailureKind::Filtered);
        match convert(record) {
            Ok(record) => trials.add(record, TextPlace::new(place.start)),
            Err(e) if result.is_ok() => result = Err(e),
            Err(_) => {}
        }
    };
    let path = folder.join(RECORDS);
    let see = |bytes: &[u8]| {
        hasher.update(bytes);
    };
    let mut is_changed = false;
    let end = match answers {
        Answers::Stored => each_placed_line_after(&path, from, see, add)?,
        Answers::Reread => each_placed_line_after(&path, from, see, |line: RereadRecord<D>, place| {
            is_changed |= line.is_changed;
            add(line.record, place);
        })?,
    };
    result?;
    if D::HAS_BYTES && is_as_stored && !is_changed && end.bytes - from.bytes >= min_bytes {
        let head = Head {
            build: program_build().to_owned(),
            schema: D::SCHEMA.to_owned(),
            log_bytes: end.bytes,
            log_digest: Digest::from_hasher(&hasher),
            lines: end.lines,
            reply_reading: D::REPLY_READING.filter(|_| answers == Answers::Reread).map(str::to_owned),
        };
        write(folder, &head, &trials);
    }
    Ok(trials)
}

#[cfg(test)]
mod tests {
    use std::fs::OpenOptions;
    use std::ops::Range;

    use darkqa_base::types::records::{Failure, ImageFacts, ParsedAnswer, TrialOutcome};
    use darkqa_base::types::{
        AnswerSource, ChoiceDetail, Family, Finish, FrameId, LostAttempts, Observed, OptionProbabilities, QuestionId,
        TrialKey, Usage, Via,
    };

    use super::*;

    /// A number below `bound`, which `seed` decides.
    fn draw(seed: &str, bound: u64) -> u64 {
        let digest = Digest::from_bytes(seed.as_bytes());
        let bytes = digest.as_bytes();
        u64::from_le_bytes([0, 1, 2, 3, 4, 5, 6, 7].map(|place| bytes[place])) % bound
    }

    /// A record of any kind: answered, refused, failed or cut; with an image, several or none; with usage and cost; asked
    /// again.
    fn record(run: &str, number: u64) -> Record {
        let draw = |what: &str, bound: u64| draw(&format!("{run} {number} {what}"), bound);
        // One of five trials is asked again.
        let trial = if draw("again", 5) == 0 { number / 2 } else { number };
        let key: TrialKey = Digest::from_bytes(format!("{run} {trial}").as_bytes()).into();
        let condition = ["L0", "L3-noise", "L5-ev+lift"][draw("condition", 3) as usize].parse().unwrap();
        let has_image = draw("image", 4) > 0;
        let digest = Digest::from_bytes(format!("{}", draw("digest", 9)).as_bytes());
        let image = |side: usize| ImageFacts {
            digest,
            bytes: side * 7,
            width: side,
            height: side + 1,
            format: "png".into(),
            orientation: None,
            exposure: None,
            pair: None,
        };
        let failed = draw("failed", 6) == 0;
        let letter = ["A", "B", "the answer is B", "neither", "A\u{2028} \"", ""][draw("letter", 6) as usize];
        let reading = |what: &str| ParsedAnswer { chosen: Some(draw(what, 2) as usize), why: None };
        let mut record = Record::blank(
            key,
            QuestionId(format!("question {}", trial % 7)),
            ["m", "other", "ünïcode"][draw("model", 3) as usize],
            has_image.then_some(condition),
            ChoiceDetail {
                frame: FrameId(format!("frame {}", trial % 3)),
                family: Family::Color,
                choices: vec!["a".into(), "b".into()],
                truth: Some(0),
                repeat: draw("repeat", 2) as u32,
                wording: (draw("wording", 4) == 0).then(|| "terse".into()),
                order: draw("order", 2) as u32,
                strict: (!failed).then(|| reading("strict")),
                lenient: (!failed).then(|| reading("lenient")),
                outcome: if failed { TrialOutcome::Failed } else { TrialOutcome::Right },
                image: has_image.then(|| image(64)),
                more_images: if has_image && draw("more", 3) == 0 { vec![image(32)] } else { Vec::new() },
                shown_frame: (draw("shown", 6) == 0).then(|| FrameId("another".into())),
                observed: (draw("observed", 5) == 0).then(|| Observed {
                    from: AnswerSource::Guess,
                    things: 7,
                    seen: draw("seen", 7) as usize,
                    detected: 1,
                    explained_ppm: 12,
                    outlines: [(3, 50)].into(),
                }),
                options: (draw("options", 5) == 0).then(|| OptionProbabilities {
                    p: vec![0.1 + draw("p", 100) as f64 / 300.0, 1.0 / 3.0],
                    mass: 0.9,
                    bound: 1e-9,
                    token: "A".into(),
                    reasoned: draw("reasoned", 2) == 0,
                }),
            },
        );
        let number_of = |what: &str| (draw(what, 3) > 0).then(|| draw(what, 4000));
        let usage: Usage = serde_json::from_value(serde_json::json!({
            "prompt_tokens": number_of("prompt"),
            "completion_tokens": number_of("completion"),
            "cached_tokens": number_of("cached"),
            "cost": number_of("cost").map(|cost| cost as f64 / 1e6),
            "service_tier": (["standard", "flex", "other"][draw("tier", 3) as usize]),
        }))
        .unwrap();
        record.usage = (draw("usage", 3) > 0).then_some(usage);
        record.latency_ms = number_of("latency");
        record.attempts = draw("attempts", 4) as u32;
        record.max_tokens = (draw("limit", 5) == 0).then_some(2000);
        record.via = [Via::Direct, Via::Batch][draw("via", 2) as usize];
        record.finish = [Some(Finish::Stop), Some(Finish::Length), Some(Finish::Other("odd".into())), None]
            [draw("finish", 4) as usize]
            .clone();
        record.served_model = (draw("served", 2) == 0).then(|| "served".into());
        record.provider = (draw("provider", 3) == 0).then(|| "router".into());
        record.lost = LostAttempts { attempts: draw("lost", 2) as u32, usage, ..LostAttempts::default() };
        if failed {
            let kind = [FailureKind::Timeout, FailureKind::Server][draw("kind", 2) as usize];
            record.failure = Some(Failure { kind, status: number_of("status").map(|_| 504), message: "no".into() });
        } else {
            record.reply = (draw("reply", 8) > 0).then(|| letter.into());
            record.refusal = (draw("refusal", 8) == 0).then(|| "400: no".into());
        }
        record
    }

    fn lines(run: &str, numbers: Range<u64>) -> Vec<u8> {
        let records = numbers.map(|number| serde_json::to_string(&record(run, number)).unwrap() + "\n");
        records.collect::<String>().into_bytes()
    }

    /// The trials of a run as bytes, and its stored trials as text. `start` is the part that is read from the index.
    fn content(folder: &Path, start: Option<IndexedStart>, answers: Answers) -> (Vec<u8>, String) {
        let stored = trials_after::<ChoiceDetail>(folder, start.as_ref()).unwrap();
        let trials = read_log_indexing::<ChoiceDetail>(folder, start, answers, u64::MAX, Ok).unwrap();
        let mut bytes = Vec::new();
        trials.write_to(&mut bytes).unwrap();
        (bytes, format!("{stored:?}"))
    }

    /// Checks that a run reads the same with its index as without. Returns whether the index was used.
    fn reads_alike(folder: &Path, what: &str) -> bool {
        let start = IndexedStart::check::<ChoiceDetail>(folder);
        for answers in [Answers::Stored, Answers::Reread] {
            assert!(content(folder, start.clone(), answers) == content(folder, None, answers), "{what}, {answers:?}");
        }
        start.is_some_and(|start| start.trials::<ChoiceDetail>(folder).is_some())
    }

    /// Writes the index of a run.
    fn index(folder: &Path, answers: Answers) -> Vec<u8> {
        read_log_indexing::<ChoiceDetail>(folder, None, answers, 1, Ok).unwrap();
        fs::read(folder.join(INDEX)).unwrap_or_default()
    }

    #[test]
    fn a_run_reads_the_same_with_any_index() {
        let base = tempfile::tempdir().unwrap();
        let folder = base.path();
        let (log, other) = (lines("run", 0..60), lines("other", 0..60));
        let [log_path, index_path] = [RECORDS, INDEX].map(|name| folder.join(name));
        fs::write(&log_path, &other).unwrap();
        let foreign = index(folder, Answers::Stored);
        fs::write(&log_path, &log).unwrap();
        let whole = index(folder, Answers::Stored);
        assert!(reads_alike(folder, "whole") && whole != foreign);
        let mut used = 0;
        for case in 0..300 {
            let at = |bytes: &[u8]| draw(&format!("place {case}"), bytes.len() as u64) as usize;
            let (mut case_index, mut case_log) = (whole.clone(), log.clone());
            let what = match case % 10 {
                0 => {
                    case_index.truncate(at(&whole));
                    "a cut index"
                }
                1 => {
                    case_index[at(&whole)] ^= 1 << (case % 8);
                    "a changed byte in the index"
                }
                2 => {
                    let place = at(&whole);
                    case_index[place..].fill(0);
                    "zeros in the index"
                }
                3 => {
                    case_index.clone_from(&foreign);
                    "an index of another run"
                }
                4 => {
                    case_log.extend(lines("run", 60..61 + case % 7));
                    "lines that were appended"
                }
                5 => {
                    case_log.extend(&lines("run", 60..61)[..at(&lines("run", 60..61))]);
                    "a line that a killed process has not completed"
                }
                6 => {
                    let lengths = log.split_inclusive(|byte| *byte == b'\n').map(<[u8]>::len);
                    case_log.truncate(lengths.take(1 + case as usize % 59).sum());
                    "a log that lacks lines"
                }
                7 => {
                    // Another outcome in a line of the same length.
                    let text = String::from_utf8(log.clone()).unwrap();
                    let places: Vec<usize> = text.match_indices("\"latency_ms\":1").map(|(place, _)| place).collect();
                    case_log[places[case as usize % places.len()] + 13] = b'2';
                    "an edited line"
                }
                8 => {
                    let head = String::from_utf8_lossy(&whole).replacen(program_build(), "0.0.1 7 7", 1);
                    let end = head.find('\n').unwrap();
                    let old = whole.iter().position(|byte| *byte == b'\n').unwrap();
                    case_index = [&head.as_bytes()[..end], &whole[old..]].concat();
                    "an index of another build"
                }
                _ => {
                    case_index.clear();
                    "no index"
                }
            };
            fs::write(&log_path, &case_log).unwrap();
            fs::write(&index_path, &case_index).unwrap();
            if case_index.is_empty() {
                fs::remove_file(&index_path).unwrap();
            }
            let is_used = reads_alike(folder, &format!("{what}, case {case}"));
            assert_eq!(is_used, matches!(case % 10, 4 | 5), "{what}, case {case}");
            used += usize::from(is_used);
        }
        assert_eq!(used, 60);
    }

    #[test]
    fn an_index_grows_with_its_log() {
        let base = tempfile::tempdir().unwrap();
        let folder = base.path();
        let path = folder.join(RECORDS);
        fs::write(&path, lines("run", 0..20)).unwrap();
        index(folder, Answers::Stored);
        let mut log = OpenOptions::new().append(true).open(&path).unwrap();
        log.write_all(&lines("run", 20..40)).unwrap();
        let start = IndexedStart::check::<ChoiceDetail>(folder);
        assert_eq!(start.as_ref().map(|start| start.end().lines), Some(20));
        read_log_indexing::<ChoiceDetail>(folder, start, Answers::Stored, 1, Ok).unwrap();
        let grown = fs::read(folder.join(INDEX)).unwrap();
        fs::remove_file(folder.join(INDEX)).unwrap();
        assert!(grown == index(folder, Answers::Stored), "equal to an index of all lines at once");
    }

    #[test]
    fn only_answers_that_were_parsed_again_serve_a_reader_that_does() {
        let base = tempfile::tempdir().unwrap();
        let folder = base.path();
        let reread = |record: Record| darkqa_score::answers::record::reread(record).unwrap();
        let records = (0..20).map(|number| serde_json::to_string(&reread(record("run", number))).unwrap() + "\n");
        fs::write(folder.join(RECORDS), records.collect::<String>()).unwrap();
        for (answers, rules) in [(Answers::Stored, None), (Answers::Reread, ChoiceDetail::REPLY_READING)] {
            index(folder, answers);
            let start = IndexedStart::check::<ChoiceDetail>(folder).unwrap();
            assert_eq!(start.head.reply_reading.as_deref(), rules);
        }
        fs::remove_file(folder.join(INDEX)).unwrap();
        fs::write(folder.join(RECORDS), lines("run", 0..20)).unwrap();
        assert!(index(folder, Answers::Reread).is_empty(), "the stored answers are others");
    }

    #[test]
    fn small_runs_have_no_index() {
        let base = tempfile::tempdir().unwrap();
        fs::write(base.path().join(RECORDS), lines("run", 0..20)).unwrap();
        read_log::<ChoiceDetail>(base.path(), None, Answers::Stored, Ok).unwrap();
        assert!(!base.path().join(INDEX).exists());
    }
}
