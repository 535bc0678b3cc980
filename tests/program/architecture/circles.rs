//! Circles of files: files that import each other, directly or through others.
//!
//! A name is followed through each `use` to the file that defines it. A `pub use` of names from a folder's own files is
//! no import, unless it ends with `*`: then it counts, because its names are not known. Tests do not count.

use std::collections::{BTreeMap, BTreeSet};

use super::files::Files;
use super::source::Kind;

/// The paths by which each file uses each other file.
type Imports<'a> = BTreeMap<&'a str, BTreeMap<&'a str, BTreeSet<String>>>;

/// The circles that are not listed, and the listed ones that are no circles.
pub(crate) fn wrong<'a>(crates: impl Iterator<Item = &'a Files>, listed: &[(&[&str], &str)]) -> Vec<String> {
    let imports: Imports<'_> = crates.flat_map(imports).collect();
    let found = circles(&imports);
    let is_listed = |circle: &&Vec<&str>| listed.iter().any(|(files, _)| files == circle);
    let is_found = |files: &[&str]| found.iter().any(|circle| circle == files);
    let mut wrong: Vec<String> =
        found.iter().filter(|circle| !is_listed(circle)).map(|circle| message(circle, &imports)).collect();
    let gone = listed.iter().filter(|(files, _)| !is_found(files));
    wrong.extend(gone.map(|(files, _)| {
        let files = files.join(", ");
        format!("a listed circle is none: {files}: delete it, or list what is left of it")
    }));
    wrong
}

/// A circle, with the paths by which its files use each other.
fn message(circle: &[&str], imports: &Imports<'_>) -> String {
    let mut lines = vec![format!("a circle of files: {}", circle.join(", "))];
    for file in circle {
        let others = imports[file].iter();
        for (other, paths) in others.filter(|(other, _)| circle.contains(*other)) {
            let paths: Vec<&str> = paths.iter().map(String::as_str).collect();
            lines.push(format!("  {file} uses {other}: {}", paths.join(", ")));
        }
    }
    lines.join("\n")
}

/// The circles, each with its files in order.
fn circles<'a>(imports: &Imports<'a>) -> BTreeSet<Vec<&'a str>> {
    let reached: BTreeMap<&str, BTreeSet<&str>> =
        imports.keys().map(|file| (*file, reachable(file, imports))).collect();
    let in_circle = reached.iter().filter(|(file, others)| others.contains(*file));
    let circle = |(file, others): (&&str, &BTreeSet<&'a str>)| {
        let back = others.iter().filter(|other| reached[*other].contains(file));
        back.copied().collect()
    };
    in_circle.map(circle).collect()
}

/// The files that a file imports, directly or through others.
fn reachable<'a>(file: &str, imports: &Imports<'a>) -> BTreeSet<&'a str> {
    let mut reached = BTreeSet::new();
    let mut open = vec![file];
    while let Some(next) = open.pop() {
        for other in imports[next].keys() {
            if reached.insert(*other) {
                open.push(other);
            }
        }
    }
    reached
}

/// Imports between files, without tests.
fn imports(files: &Files) -> Imports<'_> {
    let mut imports: Imports<'_> = files.iter().map(|source| (source.path.as_str(), BTreeMap::new())).collect();
    for (source, part) in files.parts_outside_tests() {
        let Some(used) = files.defining(part) else {
            continue;
        };
        let is_export = matches!(part.kind, Kind::Import { is_export, .. } if is_export);
        let is_named = part.names.last().is_some_and(|name| name != "*");
        let is_below = used.module.starts_with(&source.module);
        if used.path != source.path && !(is_export && is_named && is_below) {
            let others = imports.entry(&source.path).or_default();
            let paths = others.entry(&used.path).or_default();
            paths.insert(part.names.join("::"));
        }
    }
    imports
}
