//! Holds the code to the map in the crate documentation: who may import whom, and where each library lives.
//!
//! The table under "Who may import whom" in `src/lib.rs` is read here, one row a module. A cell of "may use" is
//! `nothing`, or a list of `` `module` ``, `` `module` (only `path/in/src.rs`) ``, or `` everything except `module` ``.

#![allow(clippy::unwrap_used)]

#[path = "support/circles.rs"]
mod circles;

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

/// Libraries and the rooms (modules or files, as paths in `src/`) that they keep to; test code is free.
const ROOMS: [(&str, &[&str]); 12] = [
    ("axum", &["run/serve"]),
    ("glam", &["rooms"]),
    ("plotters", &["report"]),
    ("noto_sans_mono_bitmap", &["report/sheet"]),
    ("comfy_table", &["report"]),
    ("tokio", &["ask", "job", "run/serve"]),
    ("reqwest", &["ask"]),
    ("ort", &["enhance"]),
    ("rand", &["synthesis", "score/bootstrap.rs"]),
    ("rand_distr", &["synthesis", "score/bootstrap.rs"]),
    ("image", &["dataset", "enhance/planes.rs", "ask/payload.rs"]),
    ("png", &["dataset/raw_png.rs"]),
];

/// Where a future may be awaited.
const ASYNC_ROOMS: [&str; 3] = ["ask", "job", "run/serve"];

/// The longest a file may be, in lines.
const MOST_LINES: usize = 600;

#[test]
fn the_code_keeps_to_the_map() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let lib = fs::read_to_string(src.join("lib.rs")).unwrap();
    let map = Map::read(&lib);
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    let mut breaches = map.untrue(&modules(&src));
    for file in files {
        let source = fs::read_to_string(&file).unwrap();
        let path = file
            .strip_prefix(&src)
            .unwrap()
            .to_string_lossy()
            .replace('\\', "/");
        breaches.extend(inspect(&path, &source, &map));
    }
    let list: Vec<String> = breaches.iter().map(Breach::to_string).collect();
    assert!(
        list.is_empty(),
        "the house is not in order:\n{}",
        list.join("\n")
    );
}

/// One thing that is not as the map says.
#[derive(Debug, PartialEq, Eq)]
struct Breach {
    /// The file's path in `src/`.
    path: String,
    /// Its line, from 1.
    line: usize,
    /// The rule that is broken.
    rule: String,
}

impl fmt::Display for Breach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "src/{}:{}: {}", self.path, self.line, self.rule)
    }
}

/// The table of the crate documentation.
struct Map(BTreeMap<String, Uses>);

/// What a module may use.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Uses {
    /// These modules; one with a path in that file alone.
    Only(Vec<(String, Option<String>)>),
    /// Every module but these.
    AllBut(Vec<String>),
}

impl Map {
    fn read(lib: &str) -> Self {
        let docs = lib.lines().filter_map(|line| line.strip_prefix("//!"));
        let table = docs
            .skip_while(|line| line.trim() != "# Who may import whom")
            .skip(1)
            .take_while(|line| !line.trim_start().starts_with('#'))
            .filter(|line| line.trim_start().starts_with("| `"));
        let rows = table.flat_map(|line| {
            let mut cells = line.trim().trim_matches('|').splitn(2, '|').map(str::trim);
            let (names, uses) = (cells.next().unwrap(), Uses::read(cells.next().unwrap()));
            let rows = quoted(names)
                .into_iter()
                .map(move |name| (name, uses.clone()));
            rows.collect::<Vec<_>>()
        });
        let map: BTreeMap<String, Uses> = rows.collect();
        assert!(
            !map.is_empty(),
            "src/lib.rs has no table under \"# Who may import whom\""
        );
        Self(map)
    }

    /// Whether `module` may use `other` in the file at `path`.
    fn allows(&self, module: &str, other: &str, path: &str) -> bool {
        module == other
            || match self.0.get(module) {
                None => false,
                Some(Uses::AllBut(not)) => !not.iter().any(|name| name == other),
                Some(Uses::Only(list)) => list.iter().any(|(name, file)| {
                    name == other && file.as_ref().is_none_or(|file| file == path)
                }),
            }
    }

    /// Modules that stand in the table and not in `src/`, or the other way round.
    fn untrue(&self, modules: &[String]) -> Vec<Breach> {
        let breach = |rule: String| Breach {
            path: "lib.rs".into(),
            line: 1,
            rule,
        };
        let named = self.0.iter().flat_map(|(name, uses)| {
            let used = match uses {
                Uses::Only(list) => list.iter().map(|(name, _)| name.clone()).collect(),
                Uses::AllBut(list) => list.clone(),
            };
            used.into_iter().chain([name.clone()])
        });
        let mut missing: Vec<String> = named.filter(|name| !modules.contains(name)).collect();
        missing.sort();
        missing.dedup();
        let absent = missing
            .into_iter()
            .map(|name| breach(format!("the map names `{name}`, which src/ has not")));
        let unlisted = modules.iter().filter(|name| !self.0.contains_key(*name));
        let unlisted = unlisted.map(|name| breach(format!("`{name}` has no row in the map")));
        absent.chain(unlisted).collect()
    }
}

impl Uses {
    fn read(cell: &str) -> Self {
        if let Some(rest) = cell.strip_prefix("everything") {
            return Self::AllBut(quoted(rest));
        }
        assert!(
            cell == "nothing" || cell.starts_with('`'),
            "not a cell of the map: {cell:?}"
        );
        let entry = |item: &str| {
            let names = quoted(item);
            Some((names.first()?.clone(), names.get(1).cloned()))
        };
        Self::Only(cell.split(',').filter_map(entry).collect())
    }
}

/// What stands between backticks.
fn quoted(cell: &str) -> Vec<String> {
    cell.split('`')
        .skip(1)
        .step_by(2)
        .map(str::to_owned)
        .collect()
}

/// The modules of `src/`: its folders and files, `lib.rs` left out.
fn modules(src: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(src)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.is_dir() || path.extension().is_some_and(|end| end == "rs"))
        .map(|path| path.file_stem().unwrap().to_string_lossy().into_owned())
        .filter(|name| name != "lib")
        .collect();
    names.sort();
    names.dedup();
    names
}

fn rust_files(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, files);
        } else if path.extension().is_some_and(|end| end == "rs") {
            files.push(path);
        }
    }
    files.sort();
}

/// Every breach of one file; `path` is its place in `src/`.
fn inspect(path: &str, source: &str, map: &Map) -> Vec<Breach> {
    let tokens = tokens(&code_only(source));
    let module = path
        .split('/')
        .next()
        .unwrap_or_default()
        .trim_end_matches(".rs");
    let mut breaches = Vec::new();
    let mut breach = |line: usize, rule: String| {
        breaches.push(Breach {
            path: path.to_owned(),
            line,
            rule,
        });
    };
    let lines = source.lines().count();
    if lines > MOST_LINES {
        breach(
            lines,
            format!("{lines} lines: {MOST_LINES} are the most a file may have"),
        );
    }
    let scopes = scopes(&tokens);
    for (i, token) in tokens.iter().enumerate() {
        let next = |offset: usize| {
            tokens
                .get(i + offset)
                .map_or("", |token| token.text.as_str())
        };
        let previous = i
            .checked_sub(1)
            .map_or("", |before| tokens[before].text.as_str());
        for (other, line) in imports(&tokens, i, path, scopes[i].nested) {
            if module != "lib" && map.0.contains_key(&other) && !map.allows(module, &other, path) {
                breach(line, format!("`{module}` may not use `{other}` here"));
            }
        }
        if matches!(token.text.as_str(), "todo" | "unimplemented") && next(1) == "!" {
            breach(token.line, format!("{}! is no code", token.text));
        }
        if scopes[i].test || path.ends_with("/tests.rs") {
            continue;
        }
        if token.text == "await" && previous == "." && !within(path, &ASYNC_ROOMS) {
            breach(
                token.line,
                format!("`.await` outside {}", ASYNC_ROOMS.join(", ")),
            );
        }
        let names_crate = (next(1) == "::" && previous != "::" && !scopes[i].in_tree)
            || (previous == "use" && matches!(next(1), ";" | "as"));
        let room = ROOMS.iter().find(|(name, _)| *name == token.text);
        if let Some((name, rooms)) = room.filter(|(_, rooms)| names_crate && !within(path, rooms)) {
            breach(token.line, format!("`{name}` outside {}", rooms.join(", ")));
        }
    }
    breaches
}

/// Whether a path in `src/` lies in one of the rooms.
fn within(path: &str, rooms: &[&str]) -> bool {
    rooms.iter().any(|room| {
        path == *room
            || path
                .strip_prefix(room)
                .is_some_and(|rest| rest.starts_with('/'))
    })
}

/// One word or sign of code.
#[derive(Debug)]
struct Token {
    text: String,
    line: usize,
}

/// What stands around a token.
#[derive(Clone, Copy, Default)]
struct Scope {
    /// How many `mod name {` it stands in.
    nested: usize,
    /// Whether one of them is for tests.
    test: bool,
    /// Whether it stands in the braces of a path, `a::{…}`.
    in_tree: bool,
}

/// The scope of each token.
fn scopes(tokens: &[Token]) -> Vec<Scope> {
    let text = |i: Option<usize>| {
        i.and_then(|i| tokens.get(i))
            .map_or("", |token| token.text.as_str())
    };
    let mut open = vec![Scope::default()];
    let mut scopes = Vec::with_capacity(tokens.len());
    for (i, token) in tokens.iter().enumerate() {
        let mut scope = open.last().copied().unwrap_or_default();
        scopes.push(scope);
        match token.text.as_str() {
            "{" => {
                scope.in_tree |= text(i.checked_sub(1)) == "::";
                if text(i.checked_sub(2)) == "mod" {
                    scope.nested += 1;
                    scope.test |= for_tests(tokens, i - 2);
                }
                open.push(scope);
            }
            "}" if open.len() > 1 => {
                open.pop();
            }
            _ => {}
        }
    }
    scopes
}

/// Whether `#[cfg(test)]` stands among the attributes before the `mod` at `at`.
fn for_tests(tokens: &[Token], at: usize) -> bool {
    let before = tokens[..at]
        .iter()
        .rev()
        .take_while(|token| !matches!(token.text.as_str(), "}" | ";" | "{"));
    let mut words: Vec<&str> = before.map(|token| token.text.as_str()).collect();
    words.reverse();
    words
        .windows(4)
        .any(|four| four == ["cfg", "(", "test", ")"])
}

/// The modules of this crate that a path beginning at token `at` names, with their lines.
fn imports(tokens: &[Token], at: usize, path: &str, nested: usize) -> Vec<(String, usize)> {
    let text = |i: usize| tokens.get(i).map_or("", |token| token.text.as_str());
    if at > 0 && text(at - 1) == "::" {
        return Vec::new();
    }
    let rest = match text(at) {
        "crate" | "darkqa_eval" if text(at + 1) == "::" => at + 2,
        "self" | "super" if text(at + 1) == "::" => {
            let mut end = at;
            let mut ups = 0;
            while matches!(text(end), "self" | "super") && text(end + 1) == "::" {
                ups += usize::from(text(end) == "super");
                end += 2;
            }
            if ups < depth(path) + nested {
                return Vec::new();
            }
            end
        }
        _ => return Vec::new(),
    };
    heads(tokens, rest)
}

/// How many modules deep a file stands: `score/choice/mod.rs` and `score/choice.rs` are two deep.
fn depth(path: &str) -> usize {
    match path {
        "lib.rs" | "main.rs" => 0,
        path => path.trim_end_matches("/mod.rs").split('/').count(),
    }
}

/// The first names of a path or of each branch of a tree of paths.
fn heads(tokens: &[Token], at: usize) -> Vec<(String, usize)> {
    let Some(first) = tokens.get(at) else {
        return Vec::new();
    };
    if first.text != "{" {
        return vec![(first.text.clone(), first.line)];
    }
    let mut heads = Vec::new();
    let mut depth = 0_usize;
    let mut expected = true;
    for token in &tokens[at..] {
        match token.text.as_str() {
            "{" => depth += 1,
            "}" => depth -= 1,
            "," => expected |= depth == 1,
            name if depth == 1 && expected => {
                heads.push((name.to_owned(), token.line));
                expected = false;
            }
            _ => {}
        }
        if depth == 0 {
            break;
        }
    }
    heads
}

/// Splits code into names, `::` and single signs.
fn tokens(code: &str) -> Vec<Token> {
    let mut tokens: Vec<Token> = Vec::new();
    let mut line = 1;
    let mut rest = code.chars().peekable();
    while let Some(c) = rest.next() {
        let mut text = String::from(c);
        if c == '\n' {
            line += 1;
        }
        if c.is_whitespace() {
            continue;
        }
        if c.is_alphanumeric() || c == '_' {
            while let Some(next) = rest.next_if(|next| next.is_alphanumeric() || *next == '_') {
                text.push(next);
            }
        } else if c == ':' && rest.next_if_eq(&':').is_some() {
            text.push(':');
        }
        tokens.push(Token { text, line });
    }
    tokens
}

/// The source with every comment, string and character literal blanked; lines stay where they are.
fn code_only(source: &str) -> String {
    let mut out = String::with_capacity(source.len());
    let mut rest = source;
    while let Some(c) = rest.chars().next() {
        let word = out
            .chars()
            .next_back()
            .is_some_and(|c| c.is_alphanumeric() || c == '_');
        let skipped = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            block_comment(rest)
        } else if let Some(length) = (!word).then(|| string(rest)).flatten() {
            length
        } else if c == '"' {
            quotation(rest)
        } else if c == '\'' {
            character(rest)
        } else {
            out.push(c);
            rest = &rest[c.len_utf8()..];
            continue;
        };
        out.push(' ');
        out.extend(rest[..skipped].chars().filter(|c| *c == '\n'));
        rest = &rest[skipped..];
    }
    out
}

/// The length of the block comment at the beginning, comments in it included.
fn block_comment(text: &str) -> usize {
    let mut depth = 0_usize;
    let mut at = 0;
    while at < text.len() {
        if text[at..].starts_with("/*") {
            depth += 1;
            at += 2;
        } else if text[at..].starts_with("*/") {
            depth -= 1;
            at += 2;
            if depth == 0 {
                break;
            }
        } else {
            at += text[at..].chars().next().map_or(1, char::len_utf8);
        }
    }
    at
}

/// The length of a raw, byte or C string at the beginning.
fn string(text: &str) -> Option<usize> {
    let prefix = ["br", "cr", "r", "b", "c"].into_iter().find(|prefix| {
        let rest = text.strip_prefix(prefix);
        rest.is_some_and(|rest| {
            rest.trim_start_matches('#').starts_with('"')
                && (prefix.ends_with('r') || rest.starts_with('"'))
        })
    })?;
    let rest = &text[prefix.len()..];
    let hashes = rest.len() - rest.trim_start_matches('#').len();
    if !prefix.ends_with('r') {
        return Some(prefix.len() + quotation(rest));
    }
    let close = format!("\"{}", "#".repeat(hashes));
    let body = prefix.len() + hashes + 1;
    Some(
        text[body..]
            .find(&close)
            .map_or(text.len(), |end| body + end + close.len()),
    )
}

/// The length of the string literal at the beginning.
fn quotation(text: &str) -> usize {
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => return at + 1,
            _ => {}
        }
    }
    text.len()
}

/// The length of the character literal at the beginning; of a lifetime, that of its quote.
fn character(text: &str) -> usize {
    let mut chars = text.char_indices().skip(1);
    match (chars.next(), chars.next()) {
        (Some((_, '\\')), Some((at, c))) => {
            let from = at + c.len_utf8();
            text[from..]
                .find('\'')
                .map_or(text.len(), |end| from + end + 1)
        }
        (Some(_), Some((at, '\''))) => at + 1,
        _ => 1,
    }
}

/// A small house to break rules in.
fn sample() -> Map {
    Map::read(
        "//! # Who may import whom\n//!\n//! | module | may use |\n//! |---|---|\n//! | `error` | nothing |\n\
         //! | `types` | `error` |\n//! | `ask`, `enhance` | `types`, `error` |\n\
         //! | `score` | `types`, `error`, `ask` (only `score/judge.rs`) |\n//! | `run` | everything except `cli` |\n\
         //! | `cli` | nothing |\n//!\n//! # More\n//! | `x` | nothing |\n",
    )
}

#[test]
fn breaches_are_found() {
    for (path, source, line, rule) in [
        (
            "ask/mod.rs",
            "use crate::types::Rgb;\nuse crate::score::read;",
            2,
            "`ask` may not use `score` here",
        ),
        (
            "ask/mod.rs",
            "use crate::{types::{Rgb, Frame}, error::Error,\n enhance};",
            2,
            "`ask` may not use `enhance` here",
        ),
        (
            "ask/mod.rs",
            "fn f() { crate::run::go(); }",
            1,
            "`ask` may not use `run` here",
        ),
        (
            "ask/mod.rs",
            "use super::score::read;",
            1,
            "`ask` may not use `score` here",
        ),
        (
            "ask/remote.rs",
            "use super::super::run;",
            1,
            "`ask` may not use `run` here",
        ),
        (
            "ask/mod.rs",
            "#[cfg(test)]\nmod tests { use super::super::run; }",
            2,
            "`ask` may not use `run` here",
        ),
        (
            "score/choice.rs",
            "use crate::ask::Model;",
            1,
            "`score` may not use `ask` here",
        ),
        (
            "run/mod.rs",
            "use crate::cli::Cli;",
            1,
            "`run` may not use `cli` here",
        ),
        (
            "error.rs",
            "fn f(_: crate::types::Rgb) {}",
            1,
            "`error` may not use `types` here",
        ),
        ("types/mod.rs", "fn f() { todo!() }", 1, "todo! is no code"),
        (
            "types/mod.rs",
            "fn f() { g().await }",
            1,
            "`.await` outside ask, job, run/serve",
        ),
        (
            "types/mod.rs",
            "use axum::Router;",
            1,
            "`axum` outside run/serve",
        ),
        (
            "ask/mod.rs",
            "fn f() { ::ort::x(); }\nuse ort;",
            2,
            "`ort` outside enhance",
        ),
        (
            "ask/wire.rs",
            "use image::Rgb;",
            1,
            "`image` outside dataset, enhance/planes.rs, ask/payload.rs",
        ),
    ] {
        let found = inspect(path, source, &sample());
        let first = found
            .first()
            .unwrap_or_else(|| panic!("nothing found in {source}"));
        assert_eq!((first.line, first.rule.as_str()), (line, rule), "{source}");
        assert_eq!(first.path, path);
    }
    let long = "\n".repeat(MOST_LINES + 1);
    assert_eq!(inspect("types/mod.rs", &long, &sample()).len(), 1);
}

#[test]
fn what_is_allowed_passes() {
    for (path, source) in [
        (
            "ask/mod.rs",
            "use crate::types::Rgb; use crate::{error::Error, ask::remote}; use super::types::Rgb;",
        ),
        ("ask/remote.rs", "use super::pace; use super::super::types;"),
        ("ask/remote.rs", "mod tests { use super::super::run; }"),
        ("score/judge.rs", "use crate::ask::Model;"),
        ("run/mod.rs", "use crate::{ask, score, enhance};"),
        (
            "score/mod.rs",
            "// crate::ask\n/* crate::run /* todo!() */ crate::ask */\n/// crate::ask\nfn f() {}",
        ),
        (
            "score/mod.rs",
            r##"const A: &str = "crate::ask \" todo!()"; const B: &str = r#"crate::run " x"#;"##,
        ),
        (
            "score/mod.rs",
            "fn f<'a>(x: &'a str) -> char { '\"' } // \"\nconst Q: char = '\\''; const B: &[u8] = b\"ort::x\";",
        ),
        (
            "score/mod.rs",
            "#[cfg(test)]\nmod tests { use axum::Router; async fn f() { g().await } }",
        ),
        (
            "types/frame.rs",
            "use self::image::Rgb; use super::{image::Rgb, tokio}; fn f(image: u8) { image; x.image() }",
        ),
        ("ask/payload.rs", "use image::RgbImage; use tokio::time;"),
    ] {
        assert_eq!(inspect(path, source, &sample()), [], "{source}");
    }
}

#[test]
fn the_map_must_be_true() {
    let names = |list: &[&str]| list.iter().map(|&name| name.to_owned()).collect::<Vec<_>>();
    let all = names(&["ask", "cli", "enhance", "error", "run", "score", "types"]);
    assert_eq!(sample().untrue(&all), []);
    let rules: Vec<String> = sample()
        .untrue(&names(&[
            "ask", "cli", "enhance", "error", "run", "types", "new",
        ]))
        .into_iter()
        .map(|breach| breach.rule)
        .collect();
    assert_eq!(
        rules,
        [
            "the map names `score`, which src/ has not",
            "`new` has no row in the map"
        ]
    );
}

/// What several commands need is in `job` or below.
#[test]
fn no_command_uses_another() {
    let run = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/run");
    let mut files = Vec::new();
    rust_files(&run, &mut files);
    for file in files {
        let path = file.strip_prefix(&run).unwrap();
        let first = path.iter().next().unwrap().to_str().unwrap();
        let own = first.trim_end_matches(".rs");
        let text = fs::read_to_string(&file).unwrap();
        for used in text.split("crate::run::").skip(1) {
            assert!(used.starts_with(own), "{}: {used:.40}", path.display());
        }
        assert!(!text.contains("super::super::"), "{}", path.display());
    }
}

/// Functions that make a digest, and use debug output in what they tell the user.
const TELLING: [(&str, &str); 4] = [
    ("job/observer.rs", "open"),
    ("run/questions/mod.rs", "one"),
    ("run/serve/mod.rs", "answer"),
    ("types/digest.rs", "from_str"),
];

/// Debug output has no promised form: a new field would change every digest that it enters.
#[test]
fn no_digest_is_made_of_debug_output() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    let (mut digests, mut found) = (0, Vec::new());
    for path in files {
        let text = fs::read_to_string(&path).unwrap();
        let code = text.split("#[cfg(test)]").next().unwrap();
        let path = path.strip_prefix(&src).unwrap().to_string_lossy();
        let path = path.replace('\\', "/");
        let makes_digests = |function: &&str| {
            let makers = ["Digest::of", "Digest::canonical", "blake3::"];
            makers.iter().any(|maker| function.contains(maker))
        };
        for function in code.split("fn ").skip(1).filter(makes_digests) {
            digests += 1;
            let name = function.split(['(', '<']).next().unwrap();
            if function.contains(":?}") || function.contains(":#?}") {
                found.push((path.clone(), name.to_owned()));
            }
        }
    }
    assert!(digests > 20, "{digests}");
    let found = found.iter().map(|(path, name)| (&**path, &**name));
    assert_eq!(found.collect::<Vec<_>>(), TELLING);
}
