//! Check of questions by people: writes the page ([`write_review`]), and reads the verdicts that it saves
//! ([`read_verdicts`]).
//!
//! Cache of frame statistics in a file next to the questions: [`StatisticsCache`].
//!
//! The file has one line per frame. Each line is added as soon as its frame is measured, so that an interrupted command
//! can continue. At the end the file is rewritten in the order of the frames.

use std::collections::{BTreeSet, HashMap};
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use serde::Deserialize;

use darkqa_base::error::{Error, Result};
use darkqa_base::files::{self, write};
use darkqa_base::types::{Digest, Family, FrameId, QuestionId};
use darkqa_data::Dataset;
use darkqa_questions::GeneratedQuestion;
use darkqa_questions::statistics::FrameStatistics;
use darkqa_report::questions::{ReviewItem, page};
use darkqa_score::answers::record::{Check, CheckFinding, Checks};

/// A line of a file of verdicts.
#[derive(Deserialize)]
struct CheckedLine {
    id: QuestionId,
    verdict: Decision,
    /// Name of the person; empty in files without names.
    #[serde(default)]
    person: String,
    /// The person's finding before the true answer was shown; `None` in files with verdicts only.
    #[serde(default)]
    found: Option<Found>,
    #[serde(default)]
    family: Option<Family>,
    #[serde(default)]
    frame: Option<FrameId>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Found {
    Right,
    Wrong,
    Ambiguous,
}

impl CheckedLine {
    /// The person's finding about the question, if the line states one.
    fn check(&self) -> Option<Check> {
        let frame = &self.frame.as_ref()?.0;
        let scene = frame.rsplit_once('/').map_or(&**frame, |(scene, _)| scene);
        Some(Check {
            person: self.person.clone(),
            family: self.family.clone()?,
            scene: scene.to_owned(),
            finding: match self.found? {
                Found::Right => CheckFinding::Right,
                Found::Wrong => CheckFinding::Wrong,
                Found::Ambiguous => CheckFinding::Ambiguous,
            },
        })
    }
}

/// People's decisions about questions.
#[derive(Default)]
pub(super) struct Verdicts {
    /// The questions that some person rejected.
    pub(super) rejected: BTreeSet<QuestionId>,
    /// The findings of each person about each question.
    pub(super) checks: Checks,
}

#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Decision {
    Accept,
    Reject,
}

/// Reads the verdicts in files. If a person has several lines about a question, the last one counts. A question is
/// rejected if any person rejects it.
///
/// # Errors
/// If a line is not a verdict; names the file and the line.
pub(super) fn read_verdicts(files: &[PathBuf]) -> Result<Verdicts> {
    let mut rejections: BTreeSet<(QuestionId, String)> = BTreeSet::new();
    let mut verdicts = Verdicts::default();
    for path in files {
        for (_, verdict_line) in files::json_lines::<CheckedLine>(path)? {
            if let Some(check) = verdict_line.check() {
                let key = (verdict_line.person.clone(), verdict_line.id.clone());
                verdicts.checks.insert(key, check);
            }
            let key = (verdict_line.id, verdict_line.person);
            match verdict_line.verdict {
                Decision::Reject => drop(rejections.insert(key)),
                Decision::Accept => drop(rejections.remove(&key)),
            }
        }
    }
    verdicts.rejected = rejections.into_iter().map(|(id, _)| id).collect();
    Ok(verdicts)
}

/// Writes the page on which people check all questions.
pub(super) fn write_review(
    path: &Path,
    dataset: &Dataset,
    frames: &[FrameStatistics],
    questions: &[GeneratedQuestion],
) -> Result<()> {
    // The parent of a bare file name is empty, which means the working directory.
    let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // Relative links depend on the canonical path of the folder, so it must exist before they are made.
    fs::create_dir_all(folder).map_err(|e| Error::file(folder, "make", e))?;
    let items = questions.iter().filter_map(|generated| {
        let frame = &generated.question.frame;
        let size = frames.iter().find(|known| known.frame == *frame)?.size;
        let image = dataset.image_file(frame)?;
        Some(ReviewItem::new(generated, link(folder, image), size))
    });
    write(path, page(&items.collect::<Vec<_>>())?.as_bytes())
}

/// The relative link from a folder to a file.
fn link(from: &Path, to: &Path) -> String {
    let (from, to) = (absolute(from), absolute(to));
    let common = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    let up = from.components().skip(common).map(|_| "..".to_owned());
    let down = to.components().skip(common).filter_map(|part| match part {
        Component::Normal(name) => Some(escaped(&name.to_string_lossy())),
        _ => None,
    });
    up.chain(down).collect::<Vec<_>>().join("/")
}

fn absolute(path: &Path) -> PathBuf {
    let absolute_path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    absolute_path.canonicalize().unwrap_or(absolute_path)
}

/// Percent-encodes a name for a link (RFC 3986, section 2.3).
fn escaped(name: &str) -> String {
    name.bytes()
        .map(|byte| {
            if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
                char::from(byte).to_string()
            } else {
                format!("%{byte:02X}")
            }
        })
        .collect()
}

/// Frame statistics, by the digest of everything that determines them.
pub(super) struct StatisticsCache {
    path: PathBuf,
    known: HashMap<Digest, FrameStatistics>,
    file: Mutex<File>,
}

impl StatisticsCache {
    /// Reads the file, if it exists, and the files of shards. Broken lines, such as the last one of an interrupted
    /// command, are ignored: their frames are measured again.
    pub(super) fn open(path: &Path, shard_files: &[PathBuf]) -> Result<Self> {
        let mut known = HashMap::new();
        for file in shard_files {
            read(file, &mut known)?;
        }
        let end = read(path, &mut known)?;
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|e| Error::file(folder, "make", e))?;
        }
        let mut file =
            OpenOptions::new().create(true).append(true).open(path).map_err(|e| Error::file(path, "write", e))?;
        if end == FileEnd::Broken {
            // The next line must not continue a half-written one.
            file.write_all(b"\n").map_err(|e| Error::file(path, "write", e))?;
        }
        Ok(Self { path: path.to_owned(), known, file: Mutex::new(file) })
    }

    /// The statistics with a key.
    pub(super) fn get(&self, key: Digest) -> Option<FrameStatistics> {
        self.known.get(&key).cloned()
    }

    /// Appends the statistics of a frame to the file.
    pub(super) fn add(&self, statistics: &FrameStatistics) -> Result<()> {
        let line = line(statistics)?;
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        file.write_all(&line).map_err(|e| Error::file(&self.path, "write", e))
    }

    /// Rewrites the file with exactly these frames, in this order.
    pub(super) fn finish(self, frames: &[FrameStatistics]) -> Result<()> {
        let lines = frames.iter().map(line).collect::<Result<Vec<_>>>()?;
        drop(self.file);
        write(&self.path, &lines.concat())
    }
}

/// State of the lines of a file of statistics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FileEnd {
    /// All lines are complete, or the file does not exist.
    Complete,
    /// A line cannot be parsed, because a command was interrupted while writing it.
    Broken,
}

/// Adds the statistics in a file, if it exists, to `known`.
fn read(path: &Path, known: &mut HashMap<Digest, FrameStatistics>) -> Result<FileEnd> {
    let file = match files::open(path) {
        Ok(file) => file,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(FileEnd::Complete),
        Err(e) => return Err(Error::file(path, "read", e)),
    };
    let mut end = FileEnd::Complete;
    for line in BufReader::new(file).split(b'\n') {
        let line = line.map_err(|e| Error::file(path, "read", e))?;
        match serde_json::from_slice::<FrameStatistics>(&line) {
            Ok(statistics) => drop(known.insert(statistics.key, statistics)),
            Err(_) => end = FileEnd::Broken,
        }
    }
    Ok(end)
}

fn line(statistics: &FrameStatistics) -> Result<Vec<u8>> {
    let mut line = serde_json::to_vec(statistics).map_err(|e| Error::data("statistics", e))?;
    line.push(b'\n');
    Ok(line)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn the_last_verdict_counts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("v.jsonl");
        let lines = [("a", "reject"), ("b", "reject"), ("a", "accept"), ("c", "accept")]
            .map(|(id, verdict)| format!(r#"{{"id":"{id}","verdict":"{verdict}","frame":"x"}}"#));
        fs::write(&path, lines.join("\n\n")).unwrap();
        let found = read_verdicts(std::slice::from_ref(&path)).unwrap();
        assert_eq!(found.rejected, [QuestionId("b".into())].into());
        assert!(found.checks.is_empty());
        fs::write(&path, "\n{\"id\":\"a\",\"verdict\":\"perhaps\"}\n").unwrap();
        let error = read_verdicts(&[path]).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains("v.jsonl, line 2: unknown variant `perhaps`"), "{error}");
    }

    fn line(person: &str, id: &str, verdict: &str, found: &str) -> String {
        let line = serde_json::json!({
            "id": id, "person": person, "verdict": verdict, "found": found,
            "family": "color", "frame": "scene-1/a",
        });
        format!("{line}\n")
    }

    #[test]
    fn one_of_two_people_rejects() {
        let folder = tempfile::tempdir().unwrap();
        let anna = line("anna", "a", "reject", "wrong") + &line("anna", "b", "accept", "right");
        let ben = line("ben", "a", "accept", "right") + &line("ben", "b", "accept", "right");
        fs::write(folder.path().join("anna.jsonl"), anna).unwrap();
        fs::write(folder.path().join("ben.jsonl"), ben).unwrap();
        let found = read_verdicts(&[folder.path().join("anna.jsonl"), folder.path().join("ben.jsonl")]).unwrap();
        assert_eq!(found.rejected, [QuestionId("a".into())].into());
        assert_eq!(found.checks.len(), 4);
        let check = &found.checks[&("anna".to_owned(), QuestionId("a".into()))];
        assert_eq!((&*check.scene, check.finding), ("scene-1", CheckFinding::Wrong));
    }

    #[test]
    fn links_lead_from_the_page_to_the_image() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        fs::create_dir_all(root.join("data/a b")).unwrap();
        fs::create_dir_all(root.join("out")).unwrap();
        fs::write(root.join("data/a b/#1.png"), "").unwrap();
        assert_eq!(link(&root.join("out"), &root.join("data/a b/#1.png")), "../data/a%20b/%231.png");
        assert_eq!(link(&root.join("data"), &root.join("data/a b/#1.png")), "a%20b/%231.png");
    }
}
