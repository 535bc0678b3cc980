//! The README and the pages in `src/docs`: their commands parse and run, their links lead somewhere, their flags exist.
//!
//! A block with the fence `sh` is run, one with `sh no-run` is only parsed: it needs large data, another machine or an
//! installer. All blocks of a page are run by one shell in an empty folder, with a mock endpoint, which has batches, at
//! `OPENAI_BASE_URL`, few and small rooms where no data are named, the folder `models` at `$MODELS`, a recording of a
//! robot at `$DRIVE`, and a LeRobot data set at `$LEROBOT`. A comment `<!-- test: … -->` is a command that readers do
//! not see. A block with the fence `text` shows what commands of its page print, `text first-command` what the first
//! command of the README prints, with its numbers; `text no-run` shows what others print.

mod faq;
mod first_command;
mod page;
mod shell;

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use crate::support::batches::{Course, MockBatches};
use crate::support::endpoint::Answer;
use crate::support::lerobot::Set;
use crate::support::recording::{Compression, drive};
use crate::support::rooms::rooms;
use crate::support::run::{Bench, PROGRAM};
use crate::support::snapshot::on_one_line;
use crate::support::table::check_rows;
use darkqa_eval::cli;
use page::{Block, BlockKind, Page, files, pages, root};
use regex::Regex;

/// Flags of other programs that pages name: `sbatch`, `hf`, `pip`, `cargo`, `inspect eval`, `promptfoo`,
/// VLMEvalKit, and servers of models.
const OF_OTHERS: [&str; 31] = [
    "--repo-type",
    "--local-dir",
    "--revision",
    "--dst",
    "--dst-storage",
    "--array",
    "--no-deps",
    "--release",
    "--path",
    "--no-log-images",
    "--max-connections",
    "--max-samples",
    "--display",
    "--no-cache",
    "--api-mode",
    "--api-nproc",
    "--bench",
    "--test",
    "--ignored",
    "--nocapture",
    "--hm3d",
    "--walks",
    "--cover",
    "--scenes",
    "--height",
    "--generation-config",
    "--limit-mm-per-prompt",
    "--model-path",
    "--mmproj",
    "--parallel",
    "--model-id",
];

/// The words that follow the name of the program in a command, or `cargo run … --`; `None` for other commands.
fn arguments(words: &[String]) -> Option<&[String]> {
    if words.starts_with(&["cargo".to_owned(), "run".to_owned()]) {
        let dashes = words.iter().position(|word| word == "--")?;
        return Some(&words[dashes + 1..]);
    }
    let is_prefix = |word: &&String| *word == "uvx" || word.split('=').next().is_some_and(is_variable);
    let start = words.iter().take_while(is_prefix).count();
    let (program, arguments) = words[start..].split_first()?;
    (program == "darkqa-eval").then_some(arguments)
}

/// Whether a word is the name of a variable in front of a command, as in `DARKQA_LEVELS=L0 darkqa-eval`.
fn is_variable(name: &str) -> bool {
    name.contains('_') && name.chars().all(|c| c.is_ascii_uppercase() || c == '_')
}

#[test]
fn every_command_parses() {
    let (mut wrong, mut count) = (Vec::new(), 0);
    for page in pages() {
        let shown = page
            .blocks
            .iter()
            .filter(|block| matches!(block.kind, BlockKind::SetUp | BlockKind::Run | BlockKind::ParseOnly));
        for block in shown {
            for (line, words) in shell::commands(&block.lines) {
                let Some(arguments) = arguments(&words) else {
                    continue;
                };
                count += 1;
                let mut words = vec!["darkqa-eval".to_owned()];
                words.extend_from_slice(arguments);
                // The file is made when the page runs.
                if let Some(place) = words.iter().position(|word| word == "--config") {
                    words.drain(place..place + 2);
                }
                if let Err(error) = cli::check_words(words.into_iter().map(OsString::from)) {
                    let place = page.at(block.line + 1 + line);
                    wrong.push(format!("{place}: {error}"));
                }
            }
        }
    }
    assert!(count > 60, "{count} commands found");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn documented_commands_print_shown_output() {
    check_rows(pages(), |page| {
        let bench = Bench::new();
        let ran = run(&page, bench.path("").as_path());
        let said = String::from_utf8_lossy(&ran.stderr);
        assert!(ran.status.success(), "{}: {}\n{said}", page.name, ran.status);
        let printed = std::fs::read_to_string(bench.path(PRINTED)).unwrap_or_default();
        let missing = missing_lines(&page, &printed);
        assert!(missing.is_empty(), "not printed: {missing:#?}");
    });
}

/// The file with all that the commands of a page print.
const PRINTED: &str = "printed.txt";

/// The file with a recording of a robot.
const DRIVE: &str = "recording.mcap";

const LEROBOT: &str = "lerobot-set";

/// Runs the commands of a page in a folder.
fn run(page: &Page, folder: &Path) -> Output {
    if page.text.contains("$DRIVE") {
        std::fs::write(folder.join(DRIVE), drive(12, Compression::Zstd)).unwrap();
    }
    if page.text.contains("$LEROBOT") {
        let set = Set { lengths: vec![4; 10], ..Set::default() };
        set.write(&folder.join(LEROBOT));
    }
    let mock = MockBatches::start([Course::of("in_progress completed").text("A")]);
    mock.chat(|body| {
        let is_judge = body.to_string().contains("Your mark");
        Answer::text(if is_judge { "4" } else { "A" })
    });
    let program = Path::new(PROGRAM);
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders = program.parent().map(Path::to_owned).into_iter();
    let path = std::env::join_paths(folders.chain(std::env::split_paths(&path))).unwrap();
    let mut shell = Command::new("bash");
    for (name, _) in std::env::vars() {
        let begins = ["OPENAI_", "DARKQA_", "RUST_LOG"];
        if begins.iter().any(|begin| name.starts_with(begin)) {
            shell.env_remove(name);
        }
    }
    shell
        .args(["-c", &script(page)])
        .current_dir(folder)
        .env("PATH", path)
        .env("OPENAI_BASE_URL", mock.base_url())
        .env("DARKQA_DATA", rooms(2, "96x64"))
        .env("MODELS", root().join("models"))
        .env("DRIVE", folder.join(DRIVE))
        .env("LEROBOT", folder.join(LEROBOT))
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

/// The commands of a page that are run, as one script that stops at the first failure.
fn script(page: &Page) -> String {
    let run = |block: &&Block| matches!(block.kind, BlockKind::SetUp | BlockKind::Run);
    let blocks = page.blocks.iter().filter(run).map(|block| {
        let place = page.at(block.line + 1);
        let lines = block.lines.join("\n");
        // Braces run the lines in this shell, so that variables stay set.
        format!("echo '{place}' >&2\n{{\n{lines}\n}} >> {PRINTED}\n")
    });
    format!("set -eu\n{}", blocks.collect::<String>())
}

/// The lines of the page's `text` blocks of which no printed line has the beginning. The numbers of a page are from a
/// larger run, so each line counts up to its first digit; lines that frame a table do not count.
fn missing_lines(page: &Page, printed: &str) -> Vec<String> {
    let printed: Vec<String> = printed.lines().map(on_one_line).collect();
    page.blocks
        .iter()
        .filter(|block| block.kind == BlockKind::Output)
        .flat_map(|block| (block.line + 1..).zip(&block.lines))
        .filter(|(_, line)| {
            let begin = line.split(|c: char| c.is_ascii_digit()).next();
            let begin = on_one_line(begin.unwrap_or_default());
            begin.chars().any(char::is_alphabetic) && !printed.iter().any(|line| line.starts_with(&begin))
        })
        .map(|(number, line)| format!("{}: {line}", page.at(number)))
        .collect()
}

#[test]
fn links_lead_to_existing_headings() {
    let mut wrong = Vec::new();
    for page in pages().into_iter().chain([Page::read("src/docs/SUMMARY.md")]) {
        for (line, link) in page.links() {
            let Some((path, anchor)) = page.target(link) else {
                continue;
            };
            let place = page.at(line);
            if link.starts_with("../") {
                wrong.push(format!("{place}: {link}: the site has no file outside of src/docs"));
            } else if !path.exists() {
                wrong.push(format!("{place}: {link}: no such file"));
            } else if !anchor.is_empty() {
                let name = path.strip_prefix(root()).unwrap_or(&path);
                if !Page::read(&name.to_string_lossy()).has_anchor(anchor) {
                    wrong.push(format!("{place}: {link}: no such heading"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_page_is_in_the_summary() {
    let pages = pages();
    let pages = &pages[1..];
    let listed: BTreeSet<&str> = pages.iter().map(|page| &*page.name).collect();
    assert_eq!(listed.len(), pages.len(), "a page is listed twice");
    let files = files();
    let files: BTreeSet<&str> = files.iter().map(String::as_str).collect();
    assert_eq!(listed, files);
}

/// The long flags of a command and of the commands in it, without hidden ones.
fn flags(command: &clap::Command) -> BTreeSet<String> {
    command
        .get_arguments()
        .filter(|arg| !arg.is_hide_set())
        .flat_map(|arg| {
            let second = arg.get_visible_aliases().into_iter().flatten();
            arg.get_long().into_iter().chain(second)
        })
        .map(|flag| format!("--{flag}"))
        .chain(command.get_subcommands().flat_map(flags))
        .collect()
}

/// Pages that name settings as manifests do, or say what flags were called before.
const WITH_EARLIER_FLAGS: [&str; 2] = ["src/docs/report.md", "src/docs/settings.md"];

#[test]
fn pages_name_exactly_all_flags() {
    let mut command = cli::command();
    command.build();
    let all = flags(&command);
    let flag = Regex::new("(?:^|[^-[:alnum:]])(--[a-z][a-z0-9-]*)").unwrap();
    let (mut named, mut unknown) = (BTreeSet::new(), Vec::new());
    // The list of all flags is written from the program, and says of none what it is for.
    let pages = pages().into_iter();
    for page in pages.filter(|page| page.name != "src/docs/flags.md") {
        for (number, line) in (1..).zip(page.text.lines()) {
            for found in flag.captures_iter(line) {
                let name = &found[1];
                let may_be_earlier = WITH_EARLIER_FLAGS.contains(&&*page.name);
                if !all.contains(name) && !OF_OTHERS.contains(&name) && !may_be_earlier {
                    unknown.push(format!("{}: {name}", page.at(number)));
                }
                named.insert(name.to_owned());
            }
        }
    }
    assert!(unknown.is_empty(), "no such flag: {unknown:#?}");
    let builtin = ["--help", "--version"];
    let silent: Vec<&String> =
        all.iter().filter(|flag| !named.contains(*flag) && !builtin.contains(&&***flag)).collect();
    assert!(silent.is_empty(), "on no page: {silent:?}");
}

#[test]
fn readme_works_in_a_clone() {
    let readme = Page::read("README.md");
    let words = readme.text.split_whitespace().count();
    let lines = readme.text.lines().count();
    assert!(words < 1200 && lines <= 120, "{words} words, {lines} lines");
    // Links to this repository are relative, so that they work in a clone; `.ci/absolute_links.py` changes them for
    // package indexes.
    let absolute: Vec<(usize, &str)> =
        readme.links().into_iter().filter(|(_, link)| link.contains("github.com/darkqa-eval")).collect();
    assert!(absolute.is_empty(), "{absolute:?}");
}
