//! The page of questions and answers: the messages that it explains are those of the program.

use std::fs;

use crate::support::run::files;

use super::page::{Page, root};

/// The texts in “ ” in the headings of a page.
fn quoted(page: &str) -> Vec<&str> {
    page.lines()
        .filter(|line| line.starts_with("## "))
        .flat_map(|heading| heading.split('“').skip(1))
        .filter_map(|text| text.split('”').next())
        .collect()
}

#[test]
fn quoted_messages_are_in_program() {
    let page = Page::read("src/docs/faq.md");
    let program: Vec<String> = files(&root().join("src"))
        .into_iter()
        .filter(|path| path.extension().is_some_and(|end| end == "rs"))
        .map(|path| {
            let text = fs::read_to_string(path).unwrap();
            // A string over several lines of the source is one line of a message.
            let lines: Vec<&str> = text.lines().map(str::trim).collect();
            lines.join("\n").replace("\\\n", "")
        })
        .collect();
    let quoted = quoted(&page.text);
    assert!(quoted.len() > 12, "{quoted:?}");
    let gone: Vec<&&str> = quoted.iter().filter(|quoted| !program.iter().any(|text| text.contains(**quoted))).collect();
    assert!(gone.is_empty(), "no message of the program: {gone:?}");
}

#[test]
fn texts_in_headings_are_found() {
    let page = "## “a b”\ntext “c”\n## “d” or “e f”\n## g";
    assert_eq!(quoted(page), ["a b", "d", "e f"]);
}
