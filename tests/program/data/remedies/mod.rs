//! Remedies in messages about data, imports and enhancers: each is followed as printed, in the state that printed it,
//! and must lead on.
//!
//! [`every_remedy_has_a_row`] finds the messages with a command or a flag in the source, so that a new one needs a row
//! here.

mod enhancers;
mod imports;
mod python;
mod sets;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::architecture;
use crate::support::run::{Bench, Called, words};

/// A message of a command, with a remedy that it prints.
struct Remedy {
    /// Words that the message has in the source and on the terminal; following the remedy must end it.
    says: &'static str,
    /// Makes the state in which the message is printed.
    state: fn(&Bench),
    /// The command that prints the message. `@` stands for the folder of the bench.
    command: &'static str,
    /// The remedy as printed.
    printed: &'static str,
    /// Does what the remedy asks for outside of this program.
    effect: fn(&Bench),
    /// The command with the remedy.
    followed: &'static str,
}

const ROW: Remedy = Remedy { says: "", state: nothing, command: "", printed: "", effect: nothing, followed: "" };

/// A message with a flag or a command whose remedy no row follows.
struct Unfollowed {
    /// Words of the message in the source.
    says: &'static str,
    why: Why,
}

/// Reason why no row follows a remedy.
enum Why {
    /// The message has no remedy: it names a flag or a program for another purpose.
    NoRemedy,
    /// A test follows it: its file and its name.
    Test(&'static str, &'static str),
    /// It cannot be followed here.
    Cannot(&'static str),
}

/// Folders and files with messages about data, imports and enhancers, in `src/`.
const PLACES: [&str; 6] =
    ["data/", "enhance/", "engine/images/enhancement/", "commands/import", "commands/enhance", "commands/realism/"];

fn nothing(_: &Bench) {}

fn rows() -> impl Iterator<Item = &'static Remedy> {
    sets::ROWS.iter().chain(imports::ROWS).chain(enhancers::ROWS)
}

fn unfollowed() -> impl Iterator<Item = &'static Unfollowed> {
    let all = [sets::UNFOLLOWED, imports::UNFOLLOWED, enhancers::UNFOLLOWED];
    all.into_iter().flatten()
}

/// Writes a small photograph of a shade.
fn photograph(bench: &Bench, name: &str, shade: u8) {
    let path = bench.path(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let image = image::RgbImage::from_fn(96, 64, |x, y| image::Rgb([x as u8 + shade, y as u8, shade]));
    image.save(path).unwrap();
}

/// A text with its breaks of lines as spaces.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Calls the program with the words of a line.
fn call(bench: &Bench, line: &str) -> Called {
    let folder = bench.path("");
    let line = line.replace('@', folder.to_str().unwrap().trim_end_matches('/'));
    bench.call(&words(&line))
}

/// All that a call printed, in one line.
fn printed(called: &Called) -> String {
    one_line(&format!("{} {}", called.stdout, called.stderr))
}

/// The problem of a row: its remedy is not printed as stated, or does not lead on.
fn problem(row: &Remedy) -> Option<String> {
    let bench = Bench::new();
    (row.state)(&bench);
    let first = printed(&call(&bench, row.command));
    for part in [row.says, row.printed] {
        if !first.contains(part) {
            return Some(format!("`{}` does not print {part:?}: {first}", row.command));
        }
    }
    (row.effect)(&bench);
    let called = call(&bench, row.followed);
    let second = printed(&called);
    if called.code != Some(0) || second.contains(row.says) {
        let code = called.code;
        return Some(format!("`{}` ends with {code:?}: {second}", row.followed));
    }
    None
}

/// Follows each remedy, and fails with all that do not lead on.
fn follow(rows: &[Remedy]) {
    let problems: Vec<String> =
        rows.iter().filter_map(|row| Some(format!("{:?}: {}", row.says, problem(row)?))).collect();
    assert!(problems.is_empty(), "\n{}", problems.join("\n\n"));
}

fn is_installed(program: &str) -> bool {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&folders).any(|folder| folder.join(program).is_file())
}

#[test]
fn remedies_about_sets_lead_on() {
    follow(sets::ROWS);
}

#[test]
fn remedies_of_imports_lead_on() {
    follow(imports::ROWS);
}

#[test]
fn remedies_about_enhancers_lead_on() {
    follow(enhancers::ROWS);
}

/// The flags and commands in a text.
fn commands(text: &str) -> BTreeSet<String> {
    let programs = ["ffmpeg", "python", "python3", "rosbags-convert", "zstd", "hf"];
    let managers = ["git", "pip", "apt", "brew", "conda"];
    let is_sign = |sign: char| !sign.is_alphanumeric() && !"-_".contains(sign);
    let words: Vec<&str> = text.split_whitespace().map(|word| word.trim_matches(is_sign)).collect();
    let mut found = BTreeSet::new();
    for (at, word) in words.iter().enumerate() {
        let next = words.get(at + 1).copied().unwrap_or_default();
        let is_flag =
            word.strip_prefix("--").is_some_and(|name| name.starts_with(|sign: char| sign.is_ascii_lowercase()));
        let is_command = programs.contains(word) && next.starts_with('-')
            || managers.contains(word) && ["install", "lfs", "config"].contains(&next)
            || *word == "darkqa-eval" && !next.is_empty();
        if is_flag || is_command {
            let flag = word.split('=').next().unwrap_or_default();
            found.insert(flag.to_owned());
        }
    }
    found
}

/// True for a name of a flag, such as `--read split`, which is the place of an error and no message.
fn is_name(text: &str) -> bool {
    let mut words = text.split(' ');
    let is_word = |word: &str| word.chars().all(|sign| sign.is_ascii_lowercase() || sign == '-');
    words.clone().count() <= 2 && words.all(is_word)
}

#[test]
fn every_remedy_has_a_row() {
    let texts = architecture::texts(&PLACES);
    assert!(texts.len() > 1000, "{}", texts.len());
    let all: Vec<String> = texts.iter().map(|(_, text)| one_line(text)).collect();
    let messages: Vec<(String, String, BTreeSet<String>)> = texts
        .into_iter()
        .filter(|(_, text)| text.trim().contains(' ') && !is_name(text))
        .map(|(place, text)| (place, one_line(&text)))
        .map(|(place, text)| (place, text.clone(), commands(&text)))
        .filter(|(_, _, commands)| !commands.is_empty())
        .collect();
    let mut problems = Vec::new();
    for (place, text, commands) in &messages {
        if unfollowed().any(|row| text.contains(row.says)) {
            continue;
        }
        let own: Vec<&Remedy> = rows().filter(|row| text.contains(row.says)).collect();
        let followed: BTreeSet<String> = own.iter().flat_map(|row| self::commands(row.printed)).collect();
        let missing: Vec<&String> = commands.difference(&followed).collect();
        if !missing.is_empty() {
            problems.push(format!("{place}: no row follows {missing:?} of {text:?}"));
        }
    }
    // Rows whose message is no longer in the source.
    let says = rows().map(|row| row.says).chain(unfollowed().map(|row| row.says));
    for says in says {
        if !all.iter().any(|text| text.contains(says)) {
            problems.push(format!("no message has the words {says:?}"));
        }
    }
    for row in unfollowed() {
        let is_true = match row.why {
            Why::NoRemedy => true,
            Why::Cannot(reason) => !reason.is_empty(),
            Why::Test(file, name) => {
                let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
                let text = fs::read_to_string(path).unwrap();
                text.contains(&format!("fn {name}("))
            }
        };
        if !is_true {
            problems.push(format!("the reason of {:?} is not true", row.says));
        }
    }
    assert!(problems.is_empty(), "\n{}", problems.join("\n"));
}
