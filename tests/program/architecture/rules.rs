//! The rules about single files and lines. Each gives one line for each breach.

use super::files::Files;
use super::map::Map;
use super::source::{Kind, Part, Source};

/// The files that have too many lines of code.
pub(crate) fn long_files(files: &Files, most: usize) -> Vec<String> {
    files
        .iter()
        .filter(|source| source.code_lines > most)
        .map(|source| {
            let rule = format!("{} lines of code, and a file may have {most}", source.code_lines);
            at(source, 1, &rule)
        })
        .collect()
}

/// The imports of rooms that the map does not allow; those of tests count, too. `aliases` has the rooms behind other
/// names.
pub(crate) fn imports(files: &Files, map: &Map, aliases: &[(&str, &str)]) -> Vec<String> {
    let mut wrong = Vec::new();
    for (source, part, path) in paths(files) {
        let Some(room) = source.module.first() else {
            continue;
        };
        let rule = match path.first().map(|name| behind(name, aliases)) {
            None | Some("*") => format!("`{room}` uses the whole crate: name the room"),
            Some(other) if !map.has(other) => {
                format!("`{room}` uses `crate::{other}`, which is no room of the map")
            }
            Some(other) if !map.allows(room, other) => format!("`{room}` may not use `{other}`"),
            Some(_) => continue,
        };
        wrong.push(at(source, part.line, &rule));
    }
    wrong
}

/// The imports by which a crate of the workspace uses another that the map does not allow to its room.
pub(crate) fn crate_imports(files: &Files, map: &Map, aliases: &[(&str, &str)]) -> Vec<String> {
    let mut wrong = Vec::new();
    for (source, part) in files.parts_outside_tests().filter(|(_, part)| part.is_path()) {
        let room = source.path.split('/').next().unwrap_or_default();
        let name = part.names.first().and_then(|name| name.strip_prefix("darkqa_"));
        // Networks and prompts are data.
        if let Some(other) = name.map(|name| behind(name, aliases))
            && !matches!(other, "models" | "prompts")
            && !map.allows(room, other)
        {
            wrong.push(at(source, part.line, &format!("`{room}` may not use `{other}`")));
        }
    }
    wrong
}

/// The room behind a name.
fn behind<'n>(name: &'n str, aliases: &[(&str, &'n str)]) -> &'n str {
    let alias = aliases.iter().find(|(alias, _)| *alias == name);
    alias.map_or(name, |(_, room)| *room)
}

/// The paths by which one command's folder or file uses another command's; those of tests count, too.
pub(crate) fn commands(files: &Files) -> Vec<String> {
    let mut wrong = Vec::new();
    for (source, part, path) in paths(files) {
        let is_command = |module: &[String]| {
            let is_room = module.first().is_some_and(|room| room == "commands");
            is_room && module.get(1).is_none_or(|command| command != "cli")
        };
        let is_own = source.module.get(1) == path.get(1);
        if is_command(&source.module) && is_command(&path) && !is_own {
            let rule = format!("a command uses `{}`, which is not its own", path.join("::"));
            wrong.push(at(source, part.line, &rule));
        }
    }
    wrong
}

/// The calls of `todo!` and `unimplemented!`.
pub(crate) fn unfinished(files: &Files) -> Vec<String> {
    let mut wrong = Vec::new();
    for (source, part) in files.parts() {
        let name = part.names.last().map_or("", String::as_str);
        if matches!(part.kind, Kind::Macro) && matches!(name, "todo" | "unimplemented") {
            let rule = format!("`{name}!` stands for code that is missing");
            wrong.push(at(source, part.line, &rule));
        }
    }
    wrong
}

/// Where a library is used outside of its places, and its places that do not use it; tests are free.
pub(crate) fn library<'a>(files: impl IntoIterator<Item = &'a Files>, name: &str, places: &[&str]) -> Vec<String> {
    let uses = files.into_iter().flat_map(Files::parts_outside_tests).filter(|(_, part)| {
        let is_whole = part.names.len() > 1 || matches!(part.kind, Kind::Import { .. });
        part.is_path() && is_whole && part.names[0] == name
    });
    misplaced(&uses.collect::<Vec<_>>(), &format!("`{name}`"), places)
}

/// Where folders are listed or files are opened by the standard library in `readers`, outside of some files; and the
/// places that do neither, or are folders, in which nothing would be checked. Tests are free.
pub(crate) fn listings<'a>(
    files: impl IntoIterator<Item = &'a Files>,
    readers: &[&str],
    places: &[&str],
) -> Vec<String> {
    const WAYS: [[&str; 2]; 6] = [
        ["files", "entries"],
        ["fs", "read"],
        ["fs", "read_dir"],
        ["fs", "read_to_string"],
        ["File", "open"],
        ["glob", "glob"],
    ];
    let uses = files.into_iter().flat_map(Files::parts_outside_tests).filter(|(source, part)| {
        let is_reader = readers.iter().any(|reader| {
            let rest = source.path.strip_prefix(reader);
            rest.is_some_and(|rest| rest.starts_with('/'))
        });
        let end: Vec<&str> = part.names.iter().rev().take(2).rev().map(String::as_str).collect();
        is_reader && part.is_path() && WAYS.iter().any(|way| way[..] == end)
    });
    let mut wrong = misplaced(&uses.collect::<Vec<_>>(), "a list of a folder or an open file", places);
    let folders = places.iter().filter(|place| !place.contains('.'));
    wrong.extend(folders.map(|place| format!("{place} is a folder: name its files")));
    wrong
}

/// Where a future is awaited outside of some places, and the places that await none; tests are free.
pub(crate) fn awaits<'a>(files: impl IntoIterator<Item = &'a Files>, places: &[&str]) -> Vec<String> {
    let parts = files.into_iter().flat_map(Files::parts_outside_tests);
    let uses = parts.filter(|(_, part)| matches!(part.kind, Kind::Await));
    misplaced(&uses.collect::<Vec<_>>(), "`.await`", places)
}

/// The uses outside of the places (folders or files in `src/`), and the places without a use.
fn misplaced(uses: &[(&Source, &Part)], what: &str, places: &[&str]) -> Vec<String> {
    let is_in = |source: &Source, place: &str| {
        let rest = source.path.strip_prefix(place);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    };
    let mut wrong = Vec::new();
    for (source, part) in uses {
        if !places.iter().any(|place| is_in(source, place)) {
            let rule = format!("{what} may stand only in {}", places.join(", "));
            wrong.push(at(source, part.line, &rule));
        }
    }
    for place in places {
        if !uses.iter().any(|(source, _)| is_in(source, place)) {
            wrong.push(format!("{what} may stand in {place}, but does not: delete this place"));
        }
    }
    wrong
}

/// The paths into this crate, from its root.
fn paths(files: &Files) -> impl Iterator<Item = (&Source, &Part, Vec<String>)> {
    files.parts().filter_map(|(source, part)| Some((source, part, files.path_from_root(part)?)))
}

fn at(source: &Source, line: usize, rule: &str) -> String {
    format!("src/{}:{line}: {rule}", source.path)
}
