//! Text forms of a call for inline snapshots, in which everything that varies between machines and days is redacted.

use std::fmt::{self, Display, Formatter};
use std::sync::LazyLock;

use regex::Regex;

use super::run::Called;

/// Longest line of a snapshot; a longer one continues on indented lines.
const WIDTH: usize = 110;

/// Patterns of varying text, in the order in which they are replaced.
static VARYING: LazyLock<Vec<(Regex, &str)>> = LazyLock::new(|| {
    let version = regex::escape(env!("CARGO_PKG_VERSION"));
    let tmp = regex::escape(env!("CARGO_TARGET_TMPDIR"));
    let temporary = std::env::temp_dir();
    let temporary = regex::escape(temporary.to_string_lossy().trim_end_matches(['/', '\\']));
    [
        (r"\x1b\[[0-9;]*[A-Za-z]".to_owned(), ""),
        // How long each step took, and what limited the speed.
        (r"(?m)^.*\btimings: .*\n?".to_owned(), ""),
        // A progress bar overwrites its line.
        (r"(?m)^.*\r".to_owned(), ""),
        (format!(r"{tmp}[/\\]rooms[/\\]\d+[/\\][\w-]+"), "[ROOMS]"),
        (format!(r"(?:/private)?{temporary}[/\\][\w.-]+"), "[TMP]"),
        (r"(127\.0\.0\.1|localhost|\[::1\]):\d{4,5}\b".to_owned(), "$1:[PORT]"),
        (r"\b(?:[0-9a-f]{2}/)?[0-9a-f]{32,64}\b".to_owned(), "[DIGEST]"),
        (r"[^:()\n]+ \(os error \d+\)".to_owned(), " [OS ERROR]"),
        // The library that was found, and its own words, which differ between its versions.
        (r"\S*onnxruntime\S*\.(?:so|dylib|dll)[\w.]*".to_owned(), "[LIBRARY]"),
        (r"(?s)\(Non-zero status code returned .*?\); ".to_owned(), "([ONNX RUNTIME]); "),
        (r"\b\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d(?::\d\d(?:\.\d+)?)?Z?)?".to_owned(), "[DATE]"),
        (format!(r"\b{version}\b"), "[VERSION]"),
        (r"\b\d+(?:\.\d+)?(?:/s| a (?:second|minute)| per (?:second|minute))\b".to_owned(), "[RATE]"),
        (r"\b\d+(?:\.\d+)? (?:ms|s|min|h|seconds?|minutes?|hours?)\b".to_owned(), "[TIME]"),
        (r"\b(files, )\d+ bytes\b".to_owned(), "$1[BYTES]"),
        (r"\b\d+(?:\.\d+)? (?:GB|GiB)\b".to_owned(), "[MEMORY]"),
    ]
    .map(|(pattern, redacted)| (Regex::new(&pattern).unwrap(), redacted))
    .into()
});

/// A text with all that varies redacted and long lines wrapped.
pub fn redacted(text: &str) -> String {
    let mut text = text.replace("\r\n", "\n");
    if cfg!(windows) {
        text = text.replace("darkqa-eval.exe", "darkqa-eval").replace('\\', "/");
    }
    for (pattern, redacted) in &*VARYING {
        text = pattern.replace_all(&text, *redacted).into_owned();
    }
    let mut lines: Vec<&str> = text.lines().collect();
    // Threads report in any order.
    for group in lines.chunk_by_mut(|a, b| is_report(a) && is_report(b)) {
        group.sort_unstable();
    }
    lines.into_iter().map(wrapped).collect::<Vec<_>>().join("\n")
}

/// True for a line of the log about one file or trial.
fn is_report(line: &str) -> bool {
    line.starts_with("ERROR ")
}

/// The redacted lines of a text that contain a part.
pub fn lines_with(text: &str, part: &str) -> String {
    let lines: Vec<&str> = text.lines().filter(|line| line.contains(part)).collect();
    match lines[..] {
        [line] => redacted(line.trim_start()),
        _ => redacted(&lines.join("\n")),
    }
}

/// The words of a text without its line breaks.
pub fn on_one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Every row of a table, and below each what came of it.
pub fn each<T: Display>(rows: impl IntoIterator<Item = T>, mut text: impl FnMut(&T) -> String) -> String {
    let rows = rows.into_iter().map(|row| {
        let name = row.to_string().trim_end().replace('\n', " \\n ");
        format!("{name}\n  {}\n", text(&row).replace('\n', "\n  "))
    });
    rows.collect()
}

/// A line in pieces of at most `WIDTH` characters, split at spaces.
fn wrapped(line: &str) -> String {
    let mut out = String::new();
    let mut width = 0;
    for word in line.trim_end().split_inclusive(' ') {
        let length = word.trim_end().chars().count();
        if width > 0 && width + length > WIDTH && !out.trim().is_empty() {
            out.truncate(out.trim_end().len());
            out.push_str("\n    ");
            width = 4;
        }
        out.push_str(word);
        width += word.chars().count();
    }
    out
}

/// Exit code, stdout and stderr; empty parts are omitted.
impl Display for Called {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.exit_code())?;
        for (name, text) in [("stdout", &self.stdout), ("stderr", &self.stderr)] {
            let text = redacted(text);
            if !text.is_empty() {
                write!(f, "\n{name}:\n{text}")?;
            }
        }
        Ok(())
    }
}

impl Called {
    /// Exit code and stderr.
    pub fn messages(&self) -> String {
        let text = redacted(&self.stderr);
        format!("{}\n{text}", self.exit_code()).trim_end().to_owned()
    }

    /// Exit code, and the lines of stdout and stderr that contain a part.
    pub fn lines_with(&self, part: &str) -> String {
        let lines = [&self.stdout, &self.stderr].map(|text| lines_with(text, part));
        let text = lines.join("\n");
        format!("{}\n{}", self.exit_code(), text.trim_matches('\n'))
    }

    fn exit_code(&self) -> String {
        match self.code {
            Some(code) => format!("exit code: {code}"),
            None => "stopped by a signal".to_owned(),
        }
    }
}
