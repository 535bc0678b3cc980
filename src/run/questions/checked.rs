//! The check of questions by people: the page, and the verdicts that it saves.

use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

use serde::Deserialize;

use crate::dataset::Dataset;
use crate::error::{Error, Result};
use crate::files::{reading, write};
use crate::questions::GeneratedQuestion;
use crate::questions::statistics::FrameStatistics;
use crate::report::questions::review::{ReviewItem, page};
use crate::types::QuestionId;

/// A line of a file of verdicts.
#[derive(Deserialize)]
struct CheckedLine {
    id: QuestionId,
    verdict: Decision,
}

#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Decision {
    Accept,
    Reject,
}

/// The questions that people rejected. If several lines are about one question, the last one counts.
///
/// # Errors
/// If a line is not a verdict; the error names the file and the line.
pub(super) fn rejected(files: &[PathBuf]) -> Result<BTreeSet<QuestionId>> {
    let mut rejected = BTreeSet::new();
    for path in files {
        let text = reading::text(path)?;
        let lines = text.trim_start_matches('\u{feff}').lines().enumerate();
        for (i, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
            let verdict_line: CheckedLine =
                serde_json::from_str(line).map_err(|e| Error::json_line(path, i + 1, &e))?;
            match verdict_line.verdict {
                Decision::Reject => drop(rejected.insert(verdict_line.id)),
                Decision::Accept => drop(rejected.remove(&verdict_line.id)),
            }
        }
    }
    Ok(rejected)
}

/// Writes the page on which people check all questions.
pub(super) fn review(
    path: &Path,
    dataset: &Dataset,
    frames: &[FrameStatistics],
    questions: &[GeneratedQuestion],
) -> Result<()> {
    let folder = path.parent().unwrap_or(Path::new(""));
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
    let absolute = |path: &Path| {
        let absolute_path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        absolute_path.canonicalize().unwrap_or(absolute_path)
    };
    let (from, to) = (absolute(from), absolute(to));
    let common = from
        .components()
        .zip(to.components())
        .take_while(|(a, b)| a == b)
        .count();
    let up = from.components().skip(common).map(|_| "..".to_owned());
    let down = to.components().skip(common).filter_map(|part| match part {
        Component::Normal(name) => Some(escaped(&name.to_string_lossy())),
        _ => None,
    });
    up.chain(down).collect::<Vec<_>>().join("/")
}

/// A name, percent-encoded as a part of a link (RFC 3986, section 2.3).
fn escaped(name: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~".contains(&byte);
    name.bytes()
        .map(|byte| {
            if plain(byte) {
                char::from(byte).to_string()
            } else {
                format!("%{byte:02X}")
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn the_last_verdict_counts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("v.jsonl");
        let lines = [
            ("a", "reject"),
            ("b", "reject"),
            ("a", "accept"),
            ("c", "accept"),
        ]
        .map(|(id, verdict)| format!(r#"{{"id":"{id}","verdict":"{verdict}","frame":"x"}}"#));
        fs::write(&path, lines.join("\n\n")).unwrap();
        let rejected = rejected(std::slice::from_ref(&path)).unwrap();
        assert_eq!(rejected, [QuestionId("b".into())].into());
        fs::write(&path, "\n{\"id\":\"a\",\"verdict\":\"perhaps\"}\n").unwrap();
        let error = super::rejected(&[path]).unwrap_err().to_string();
        assert!(
            error.contains("v.jsonl, line 2: unknown variant `perhaps`"),
            "{error}"
        );
    }

    #[test]
    fn links_lead_from_the_page_to_the_image() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("data/a b")).unwrap();
        fs::create_dir_all(at("out")).unwrap();
        fs::write(at("data/a b/#1.png"), "").unwrap();
        assert_eq!(
            link(&at("out"), &at("data/a b/#1.png")),
            "../data/a%20b/%231.png"
        );
        assert_eq!(link(&at("data"), &at("data/a b/#1.png")), "a%20b/%231.png");
    }
}
