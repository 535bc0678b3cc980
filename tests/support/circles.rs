//! Circles of files: files of one room that import each other, directly or around corners.
//!
//! A name is followed through re-exports to the file that defines it. A `use` that only re-exports what lies below its own
//! file is no import; what a file uses in its tests is none either.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::{Scope, Token, code_only, rust_files, scopes, tokens};

/// Circles of files that may be, and why. A part of one may be, too. All but the first are to be cut, by what is said beside.
const CIRCLES: [(&[&str], &str); 2] = [
    (
        &[
            "score/choice/lenient.rs",
            "score/choice/stated.rs",
            "score/choice/structured.rs",
        ],
        "to stay: a reply within a reply is read by the reader that found it",
    ),
    (
        &[
            "dataset/frames.rs",
            "dataset/mod.rs",
            "dataset/multiple_choice.rs",
            "dataset/table.rs",
        ],
        "Dataset, Source and stem leave dataset/mod.rs; what opens a place stays there",
    ),
];

#[test]
fn files_do_not_import_each_other_in_circles() {
    let sources = sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
    let found = circles(&sources);
    let within = |circle: &[String], files: &[&str]| {
        let mut circle = circle.iter();
        circle.all(|file| files.contains(&file.as_str()))
    };
    let is_allowed = |circle: &&Vec<String>| CIRCLES.iter().any(|(files, _)| within(circle, files));
    let new = found.iter().filter(|circle| !is_allowed(circle));
    let mut wrong: Vec<String> = new.map(|circle| told(circle, &sources)).collect();
    let is_there = |files: &[&str]| found.iter().any(|circle| within(circle, files));
    let gone = CIRCLES.iter().filter(|(files, _)| !is_there(files));
    wrong
        .extend(gone.map(|(files, _)| format!("{files:?} is no circle any more: delete its line")));
    assert!(
        wrong.is_empty(),
        "the house is not in order:\n{}",
        wrong.join("\n")
    );
}

/// All files of `src/` by their path in it.
fn sources(src: &Path) -> BTreeMap<String, String> {
    let mut files = Vec::new();
    rust_files(src, &mut files);
    let named = files.into_iter().map(|file| {
        let path = file.strip_prefix(src).unwrap();
        let path = path.to_string_lossy().replace('\\', "/");
        (path, fs::read_to_string(&file).unwrap())
    });
    named.collect()
}

/// What a file imports, by the file: the names, for the message.
type Imports = BTreeMap<String, BTreeMap<String, BTreeSet<String>>>;

/// One file as far as its imports go.
struct File {
    /// Its place as a module, from the crate's root.
    module: Vec<String>,
    /// Names that `use` brings in, with the paths behind them.
    names: BTreeMap<String, Vec<String>>,
    /// Paths that its code uses.
    paths: Vec<Vec<String>>,
    /// Paths that it re-exports.
    exports: Vec<Vec<String>>,
}

/// The circles of a house of files, each a sorted list of paths in `src/`.
fn circles(sources: &BTreeMap<String, String>) -> Vec<Vec<String>> {
    let imports = imports(sources);
    let reached: BTreeMap<&String, BTreeSet<&String>> = imports
        .keys()
        .map(|file| (file, reachable(file, &imports)))
        .collect();
    let mut circles = BTreeSet::new();
    for (file, others) in &reached {
        if others.contains(file) {
            let circle = others.iter().filter(|other| reached[*other].contains(file));
            circles.insert(circle.map(|other| (*other).clone()).collect::<Vec<_>>());
        }
    }
    circles.into_iter().collect()
}

/// A circle with the names that close it.
fn told(circle: &[String], sources: &BTreeMap<String, String>) -> String {
    let imports = imports(sources);
    let mut text = format!("a circle of files: {}", circle.join(", "));
    for file in circle {
        for (other, names) in imports[file]
            .iter()
            .filter(|(other, _)| circle.contains(other))
        {
            let names = names.iter().cloned().collect::<Vec<_>>().join(", ");
            let _ = write!(text, "\n  {file} uses {names} of {other}");
        }
    }
    text
}

/// All files that a file imports, directly or not.
fn reachable<'a>(file: &'a String, imports: &'a Imports) -> BTreeSet<&'a String> {
    let mut reached = BTreeSet::new();
    let mut open = vec![file];
    while let Some(next) = open.pop() {
        for other in imports[next].keys() {
            if reached.insert(other) {
                open.push(other);
            }
        }
    }
    reached
}

/// What each file imports of its own room, itself left out.
fn imports(sources: &BTreeMap<String, String>) -> Imports {
    let files: BTreeMap<&String, File> = sources
        .iter()
        .filter(|(path, _)| path.contains('/') && !path.ends_with("/tests.rs"))
        .map(|(path, source)| (path, File::read(path, source)))
        .collect();
    let modules: BTreeMap<&[String], &String> = files
        .iter()
        .map(|(path, file)| (file.module.as_slice(), *path))
        .collect();
    let house = House {
        files: &files,
        modules,
    };
    let mut imports = Imports::new();
    for (path, file) in &files {
        let own = imports.entry((*path).clone()).or_default();
        let exports = file.exports.iter().map(|path| (path, true));
        for (used, is_export) in file.paths.iter().map(|path| (path, false)).chain(exports) {
            let Some(target) = house.target(&file.module, used, 0) else {
                continue;
            };
            let below = files[target].module.starts_with(&file.module);
            let same_room = files[target].module[0] == file.module[0];
            if target != *path && same_room && !(is_export && below) {
                let name = used.last().cloned().unwrap_or_default();
                own.entry(target.clone()).or_default().insert(name);
            }
        }
    }
    imports
}

/// All files, and where each module lies.
struct House<'a> {
    files: &'a BTreeMap<&'a String, File>,
    modules: BTreeMap<&'a [String], &'a String>,
}

impl<'a> House<'a> {
    /// The file that defines what a path in a module names; `None` if it is none of the house.
    fn target(&self, from: &[String], path: &[String], depth: usize) -> Option<&'a String> {
        let mut at = from.to_vec();
        let mut rest = path.iter().peekable();
        match rest.peek()?.as_str() {
            "crate" => {
                at.clear();
                rest.next();
            }
            "self" => drop(rest.next()),
            "super" => {}
            _ if !self
                .modules
                .contains_key([from, &path[..1]].concat().as_slice()) =>
            {
                return None;
            }
            _ => {}
        }
        for name in rest {
            if name == "super" {
                at.pop();
                continue;
            }
            let inner = [at.as_slice(), std::slice::from_ref(name)].concat();
            if self.modules.contains_key(inner.as_slice()) {
                at = inner;
                continue;
            }
            // An item: defined here, or brought in from elsewhere.
            let file = self.modules.get(at.as_slice())?;
            let behind = self.files[*file].names.get(name).filter(|_| depth < 8);
            let found = behind.and_then(|behind| self.target(&at, behind, depth + 1));
            return found.or(Some(file));
        }
        self.modules.get(at.as_slice()).copied()
    }
}

impl File {
    fn read(path: &str, source: &str) -> Self {
        let module = path.trim_end_matches(".rs").trim_end_matches("/mod");
        let mut file = Self {
            module: module.split('/').map(str::to_owned).collect(),
            names: BTreeMap::new(),
            paths: Vec::new(),
            exports: Vec::new(),
        };
        let tokens = tokens(&code_only(source));
        let scopes: Vec<Scope> = scopes(&tokens);
        let mut at = 0;
        while at < tokens.len() {
            if scopes[at].test {
                at += 1;
            } else if tokens[at].text == "use" {
                let is_export = at > 0 && matches!(tokens[at - 1].text.as_str(), "pub" | ")");
                let (uses, end) = tree(&tokens, at + 1, &[]);
                at = end;
                for (alias, path) in uses {
                    let list = if is_export {
                        &mut file.exports
                    } else {
                        &mut file.paths
                    };
                    list.push(path.clone());
                    file.names.insert(alias, path);
                }
            } else if tokens[at].text == "in" && at > 1 && tokens[at - 2].text == "pub" {
                // `pub(in super::super)` imports nothing.
                at = path_at(&tokens, at + 1).1;
            } else {
                let (path, end) = path_at(&tokens, at);
                at = end;
                if path.len() > 1 {
                    file.paths.push(path);
                }
            }
        }
        file
    }
}

/// The path that begins at a token, and where it ends: at the next token, if none does.
fn path_at(tokens: &[Token], at: usize) -> (Vec<String>, usize) {
    let text = |i: usize| tokens.get(i).map_or("", |token| token.text.as_str());
    let is_name = |i: usize| text(i).starts_with(|c: char| c.is_alphabetic() || c == '_');
    let mut path = Vec::new();
    let mut end = at;
    while is_name(end) {
        path.push(text(end).to_owned());
        end += 1;
        if text(end) != "::" || !is_name(end + 1) {
            break;
        }
        end += 1;
    }
    (path, end.max(at + 1))
}

/// The branches of a tree of paths from a token on, each with the name that it brings in, and where the tree ends.
fn tree(tokens: &[Token], at: usize, before: &[String]) -> (Vec<(String, Vec<String>)>, usize) {
    let text = |i: usize| tokens.get(i).map_or("", |token| token.text.as_str());
    let (path, mut end) = if matches!(text(at), "{" | "*") {
        (Vec::new(), at)
    } else {
        path_at(tokens, at)
    };
    let path = [before, &path].concat();
    if text(end) == "::" {
        end += 1;
    }
    match text(end) {
        "{" => {
            let mut branches = Vec::new();
            end += 1;
            while end < tokens.len() && text(end) != "}" {
                if text(end) == "," {
                    end += 1;
                    continue;
                }
                let (more, next) = tree(tokens, end, &path);
                branches.extend(more);
                end = next;
            }
            (branches, end + 1)
        }
        "*" => (vec![("*".to_owned(), path)], end + 1),
        "as" => (vec![(text(end + 1).to_owned(), path)], end + 2),
        _ => {
            // `a::{self}` brings in `a`.
            let path = match path.split_last() {
                Some((last, rest)) if last == "self" && !rest.is_empty() => rest.to_vec(),
                _ => path,
            };
            (vec![(path.last().cloned().unwrap_or_default(), path)], end)
        }
    }
}

#[test]
fn circles_are_found() {
    let case = |files: &[(&str, &str)]| {
        let files = files.iter();
        let files = files.map(|(path, source)| (format!("ask/{path}.rs"), (*source).to_owned()));
        circles(&files.collect())
    };
    let two = |circle: [&str; 2]| vec![circle.map(|name| format!("ask/{name}.rs")).to_vec()];
    // By `super`, by `crate`, in the middle of the code, and through a re-export, under another name.
    for (front, a, b) in [
        ("", "use super::b::B;", "use crate::ask::a::A;"),
        (
            "",
            "fn f() { super::b::f() }",
            "use super::{a::{self, A as X}};",
        ),
        ("pub use b::B;", "use super::B;", "use super::a;"),
        (
            "pub use b::B as C;",
            "use crate::ask::{C, x};",
            "fn f() { crate::ask::a::f() }",
        ),
    ] {
        let files = [("mod", front), ("a", a), ("b", b)];
        assert_eq!(case(&files), two(["a", "b"]), "{front} {a} {b}");
    }
    // A folder's own code beside its files.
    let own = [
        ("mod", "pub use a::A; struct M; fn f() { a::f() }"),
        ("a", "use super::M;"),
    ];
    assert_eq!(case(&own), two(["a", "mod"]));
    let around = [
        ("a", "use super::b;"),
        ("b", "use super::c;"),
        ("c", "use super::a::A;"),
    ];
    assert_eq!(case(&around)[0].len(), 3);
    for (front, a, b) in [
        (
            "pub use a::A; pub use b::B;",
            "use super::B;",
            "use crate::types::A;",
        ),
        (
            "",
            "use super::b::B;",
            "#[cfg(test)]\nmod tests { use super::super::a::A; }",
        ),
        (
            "struct M;",
            "use super::{M, b::B};",
            "use super::M; pub(in super::super) fn f() {}",
        ),
    ] {
        let files = [("mod", front), ("a", a), ("b", b)];
        assert!(case(&files).is_empty(), "{front} {a} {b}");
    }
}
