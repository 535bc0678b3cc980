//! The files of `src/`, and which of them a path leads to.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use super::source::{Kind, Part, Source};

/// How many imports a name is followed through.
const MOST_STEPS: usize = 8;

/// All files of a crate.
pub(crate) struct Files {
    sources: Vec<Source>,
    /// The place of each module's file in `sources`.
    places: BTreeMap<Vec<String>, usize>,
}

impl Files {
    /// The Rust files of a folder and of the folders in it, without other crates.
    pub(crate) fn read(folder: &Path) -> Self {
        let mut texts = Vec::new();
        collect(folder, "", &mut texts);
        Self::of(&texts)
    }

    /// The same files, with paths below a folder of `src/`.
    pub(crate) fn below(mut self, folder: &str) -> Self {
        for source in &mut self.sources {
            source.path.insert_str(0, folder);
        }
        self
    }

    /// The files with these paths and texts.
    pub(crate) fn of(texts: &[(String, String)]) -> Self {
        let read = |(path, text): &(String, String)| {
            Source::read(path, text).unwrap_or_else(|problem| panic!("src/{path}: {problem}"))
        };
        let mut sources: Vec<Source> = texts.iter().map(read).collect();
        let for_tests: Vec<Vec<String>> = sources
            .iter()
            .flat_map(|source| &source.parts)
            .filter(|part| matches!(part.kind, Kind::TestFile))
            .map(|part| [&part.scope[..], &part.names].concat())
            .collect();
        for source in &mut sources {
            source.is_test = for_tests.iter().any(|test| source.module.starts_with(test));
        }
        let places = sources.iter().enumerate().map(|(at, source)| (source.module.clone(), at));
        Self { places: places.collect(), sources }
    }

    /// All files, in the order of their paths.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Source> {
        self.sources.iter()
    }

    /// All parts of all files.
    pub(crate) fn parts(&self) -> impl Iterator<Item = (&Source, &Part)> {
        self.sources.iter().flat_map(|source| source.parts.iter().map(move |part| (source, part)))
    }

    /// The parts outside of tests.
    pub(crate) fn parts_outside_tests(&self) -> impl Iterator<Item = (&Source, &Part)> {
        self.parts().filter(|(source, part)| !source.is_test && !part.in_test)
    }

    /// The rooms: the folders and files beside `lib.rs`.
    pub(crate) fn rooms(&self) -> BTreeSet<&str> {
        self.places.keys().filter_map(|module| Some(module.first()?.as_str())).collect()
    }

    /// The path of a part from the crate's root. It is `None` if the path begins with a library, or with a name that a
    /// `use` brings in: that `use` is a part of its own. A crate of the workspace counts as a room.
    pub(crate) fn path_from_root(&self, part: &Part) -> Option<Vec<String>> {
        if !part.is_path() {
            return None;
        }
        match part.names.first()?.strip_prefix("darkqa_") {
            Some(name) if name != "eval" => Some([&[name.to_owned()], &part.names[1..]].concat()),
            _ => self.absolute(&part.scope, &part.names),
        }
    }

    /// The file that defines what a part names. Every `use` on the way is followed.
    pub(crate) fn defining(&self, part: &Part) -> Option<&Source> {
        if part.is_path() { self.follow(&part.scope, &part.names, 0) } else { None }
    }

    /// The path from the crate's root that a path in a module stands for.
    fn absolute(&self, scope: &[String], names: &[String]) -> Option<Vec<String>> {
        let mut path = match names.first()?.as_str() {
            "crate" | "darkqa_eval" => Vec::new(),
            "self" | "super" => scope.to_vec(),
            _ => {
                let child = [scope, &names[..1]].concat();
                let is_child = names.len() > 1 && self.places.contains_key(&child);
                return is_child.then(|| [scope, names].concat());
            }
        };
        for name in names {
            match name.as_str() {
                "super" => drop(path.pop()),
                "crate" | "darkqa_eval" | "self" => {}
                _ => path.push(name.clone()),
            }
        }
        Some(path)
    }

    /// The file that defines what a path in a module names; `steps` imports were followed before.
    fn follow(&self, scope: &[String], names: &[String], steps: usize) -> Option<&Source> {
        let Some(path) = self.absolute(scope, names) else {
            return self.imported(scope, names, steps);
        };
        let is_module = |length: &usize| self.places.contains_key(&path[..*length]);
        let depth = (1..=path.len()).take_while(is_module).last().unwrap_or(0);
        let (module, rest) = path.split_at(depth);
        self.imported(module, rest, steps).or_else(|| self.source(module))
    }

    /// The same, if the first name is one that a `use` of the module brings in.
    fn imported(&self, module: &[String], names: &[String], steps: usize) -> Option<&Source> {
        let imported = self.source(module)?.imported(names.first()?)?;
        if steps == MOST_STEPS {
            return None;
        }
        self.follow(module, &[imported, &names[1..]].concat(), steps + 1)
    }

    fn source(&self, module: &[String]) -> Option<&Source> {
        self.places.get(module).map(|at| &self.sources[*at])
    }
}

/// Adds the paths and texts of a folder's Rust files, in the order of their paths.
fn collect(folder: &Path, before: &str, texts: &mut Vec<(String, String)>) {
    let entries = fs::read_dir(folder).unwrap();
    let mut entries: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for entry in entries {
        let path = format!("{before}{}", entry.file_name().unwrap().to_str().unwrap());
        if entry.is_dir() && !entry.join("Cargo.toml").exists() {
            collect(&entry, &format!("{path}/"), texts);
        } else if entry.extension().is_some_and(|end| end == "rs") {
            texts.push((path, fs::read_to_string(&entry).unwrap()));
        }
    }
}
