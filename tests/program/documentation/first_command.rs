//! The first command of the README, at its full size: the pages show its numbers.
//!
//! The images of an ONNX model may differ by a code between kinds of processors, and with them an answer or two of 177.
//! Numbers may differ by so much; a table of another version differs by more.

use super::page::{Block, BlockKind, Page, pages};
use super::{arguments, shell};
use crate::support::run::{Bench, called, words};

/// The arguments of the first command of the README.
fn first_command() -> Vec<String> {
    let readme = Page::read("README.md");
    let block = readme.blocks.iter().find(|block| block.kind == BlockKind::ParseOnly).unwrap();
    let (_, words) = shell::commands(&block.lines).remove(0);
    arguments(&words).unwrap().to_vec()
}

/// The largest difference between a number of a page and the printed one: two of 177 answers, in points.
const TOLERANCE: f64 = 1.2;

/// Whether a page shows a printed line. A page may show a table narrower than it is printed.
fn shows(shown: &str, printed: &str) -> bool {
    let (shown, printed) = (words(shown), words(printed));
    shown.len() == printed.len()
        && shown.iter().zip(&printed).all(|(shown, printed)| shown == printed || is_near(shown, printed))
}

fn is_near(shown: &str, printed: &str) -> bool {
    let number = |word: &str| {
        let digits = word.trim_matches(|c| "[],".contains(c)).replace('−', "-");
        digits.parse::<f64>().ok()
    };
    match (number(shown), number(printed)) {
        (Some(shown), Some(printed)) => (shown - printed).abs() <= TOLERANCE,
        _ => false,
    }
}

fn is_frame(line: &str) -> bool {
    !line.chars().any(char::is_alphanumeric)
}

/// The lines of a block that are not printed, with their places.
fn missing_lines(page: &Page, block: &Block, printed: &[String]) -> Vec<String> {
    (block.line + 1..)
        .zip(&block.lines)
        .filter(|(_, line)| !is_frame(line) && !printed.iter().any(|one| shows(line, one)))
        .map(|(number, line)| format!("{}: {line}", page.at(number)))
        .collect()
}

#[test]
fn pages_show_what_first_command_prints() {
    let bench = Bench::new();
    let mut arguments = first_command();
    arguments.extend(["--out".to_owned(), "run".to_owned()]);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let ran = called(bench.command(&arguments).env_remove("DARKQA_DATA")).ended(0);
    let full = bench.complete(&["report", "run", "--full"]);
    let printed: Vec<String> = ran.stdout.lines().chain(full.lines()).map(str::to_owned).collect();

    let (mut missing, mut count) = (Vec::new(), 0);
    for page in pages() {
        for block in &page.blocks {
            if block.kind == BlockKind::FirstCommand {
                count += 1;
                missing.extend(missing_lines(&page, block, &printed));
            }
        }
    }
    assert!(count >= 3, "{count} blocks of the first command");
    assert!(missing.is_empty(), "not printed: {missing:#?}");
}

#[test]
fn numbers_of_another_version_are_missing() {
    let row = " with noise + lift         96.6   96.6   96.6   97.7   97.2   −10.1 +2.4";
    for (printed, is_shown) in [
        ("with noise + lift 96.6 96.6 96.6 97.7 97.2 −10.1 +2.4", true),
        ("with noise + lift 96.6 96.6 96.6 97.2 97.2 −10.1 +2.4", true),
        ("with noise + lift 94.4 93.2 91.5 91.0 91.5 −10.1 +2.4", false),
        ("with noise + lift 96.6 96.6 96.6 97.7 97.2 10.1 +2.4", false),
        ("with noise + ruas 96.6 96.6 96.6 97.7 97.2 −10.1 +2.4", false),
        ("with noise + lift 96.6 96.6 96.6 97.7", false),
    ] {
        assert_eq!(shows(row, printed), is_shown, "{printed}");
    }
}
