//! The first command of the README, at its full size: the pages show its numbers.

use super::page::{Block, BlockKind, Page, pages};
use super::{arguments, shell};
use crate::support::run::{Bench, called};

/// The arguments of the first command of the README.
fn first_command() -> Vec<String> {
    let readme = Page::read("README.md");
    let shown = readme.blocks.iter();
    let mut shown = shown.filter(|block| block.kind == BlockKind::ParseOnly);
    let block = shown.next().unwrap();
    let (_, words) = shell::commands(&block.lines).remove(0);
    arguments(&words).unwrap().to_vec()
}

/// One space between words, so that a page may show a table narrower than it is printed.
fn one_space(line: &str) -> String {
    line.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn is_frame(line: &str) -> bool {
    !line.chars().any(char::is_alphanumeric)
}

/// The lines of a block that are not printed, with their places.
fn missing_lines(page: &Page, block: &Block, printed: &[String]) -> Vec<String> {
    let lines = (block.line + 1..).zip(&block.lines);
    lines
        .filter(|(_, line)| !is_frame(line) && !printed.contains(&one_space(line)))
        .map(|(number, line)| format!("{}: {line}", page.at(number)))
        .collect()
}

#[test]
fn pages_show_what_the_first_command_prints() {
    let bench = Bench::new();
    let mut arguments = first_command();
    arguments.extend(["--out".to_owned(), "run".to_owned()]);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let ran = called(bench.command(&arguments).env_remove("DARKQA_DATA")).ended(0);
    let full = bench.complete(&["report", "run", "--full"]);
    let printed: Vec<String> = ran
        .stdout
        .lines()
        .chain(full.lines())
        .map(one_space)
        .collect();

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
fn a_changed_digit_is_missing() {
    let page = Page::read("README.md");
    let mut blocks = page.blocks.iter();
    let block = blocks.find(|block| block.kind == BlockKind::FirstCommand);
    let block = block.unwrap();
    let mut printed: Vec<String> = block.lines.iter().map(|line| one_space(line)).collect();
    assert_eq!(missing_lines(&page, block, &printed), [""; 0]);
    let row = printed.iter().position(|line| line.contains("with noise"));
    let row = &mut printed[row.unwrap()];
    *row = row.replace('0', "1");
    assert_eq!(missing_lines(&page, block, &printed).len(), 1);
}
