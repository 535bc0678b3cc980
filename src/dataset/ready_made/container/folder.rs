//! The files of a set in a folder, a repository of a hub on disk, a pattern or a file: [`find`].

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use glob::{MatchOptions, Pattern};

use super::card::{Config, configs};
use super::{READ, SetFile, ending, splits};
use crate::dataset::ready_made::settings::SetArgs;
use crate::error::{Error, Result};
use crate::files::reading;

/// The names of the tables of an image folder (Hugging Face, "ImageFolder").
const METADATA: [&str; 3] = ["metadata.jsonl", "metadata.csv", "metadata.parquet"];

/// The files of a set, and the folders that the files they name may lie in.
#[derive(Debug)]
pub(in crate::dataset::ready_made) struct FoundFiles {
    pub(in crate::dataset::ready_made) files: Vec<SetFile>,
    /// The folder of the set.
    pub(in crate::dataset::ready_made) folder: PathBuf,
    /// A folder outside it into which the links of a hub's cache lead.
    pub(in crate::dataset::ready_made) blobs: Option<PathBuf>,
    /// What was passed over, in words.
    pub(in crate::dataset::ready_made) notes: Vec<String>,
}

/// The files at a place.
///
/// # Errors
/// If there are none, or it is not clear which are meant; the error names what is there.
pub(in crate::dataset::ready_made) fn find(place: &Path, args: &SetArgs) -> Result<FoundFiles> {
    if place.is_dir() {
        return of_folder(place, args);
    }
    if place.is_file() {
        let folder = place.parent().unwrap_or(Path::new("")).to_owned();
        let notes = shard_alone(place).into_iter().collect();
        return found(vec![(String::new(), place.to_owned())], folder, None, notes);
    }
    let text = place.to_string_lossy();
    if !text.contains(['*', '?', '[']) {
        let problem = format_args!("{text}: no such file or folder");
        return Err(Error::usage("--data", problem));
    }
    let paths = glob::glob(&text)
        .map_err(|e| Error::usage("--data", format_args!("{text}: not a pattern: {e}")))?;
    let files: Vec<PathBuf> = paths
        .filter_map(Result::ok)
        .filter(|path| path.is_file())
        .collect();
    if files.is_empty() {
        return Err(Error::usage(
            "--data",
            format_args!("{text}: no file has such a name"),
        ));
    }
    check_shards(&files)?;
    let wild = |part: &std::ffi::OsStr| part.to_string_lossy().contains(['*', '?', '[']);
    let folder = place.iter().take_while(|part| !wild(part)).collect();
    let files = files.into_iter().map(|file| (String::new(), file));
    found(files.collect(), folder, None, Vec::new())
}

/// Opens files, each with the name of its configuration.
fn found(
    files: Vec<(String, PathBuf)>,
    folder: PathBuf,
    blobs: Option<PathBuf>,
    notes: Vec<String>,
) -> Result<FoundFiles> {
    let files = files
        .into_iter()
        .map(|(config, path)| SetFile::open(path, config))
        .collect::<Result<_>>()?;
    Ok(FoundFiles {
        files,
        folder,
        blobs,
        notes,
    })
}

/// The files of a folder: those that its card names, else its metadata, else by their endings.
fn of_folder(place: &Path, args: &SetArgs) -> Result<FoundFiles> {
    let (folder, blobs) = in_cache(place)?;
    if folder.join("dataset_info.json").is_file() && folder.join("state.json").is_file() {
        let problem = "a folder of Arrow files, which are not read; write Parquet: python -c \"import datasets; datasets.load_from_disk('.').to_parquet('set.parquet')\" in it";
        return Err(Error::data(folder.display(), problem));
    }
    let mut scan = Scan::of(&folder, blobs.as_deref());
    let all = scan.files(&folder, 0)?;
    let card = folder.join("README.md");
    let named = if card.is_file() {
        configs(&reading::text(&card)?)
    } else {
        Vec::new()
    };
    let files = if named.is_empty() {
        if let Some(name) = &args.config_name {
            let problem = format_args!(
                "{}: no configurations to choose {name:?} from",
                folder.display()
            );
            return Err(Error::usage("--config-name", problem));
        }
        let kinds = by_kind(&folder, all)?;
        let files = kinds.into_iter().map(|path| {
            let below = path.strip_prefix(&folder).unwrap_or(&path).to_owned();
            (splits::of_name(&below), path)
        });
        let files = splits::chosen(&folder, files.collect(), args.split.as_deref())?;
        files
            .into_iter()
            .map(|path| (String::new(), path))
            .collect()
    } else {
        of_card(&folder, &named, &all, args)?
    };
    let paths: Vec<PathBuf> = files.iter().map(|(_, path)| path.clone()).collect();
    check_shards(&paths)?;
    found(files, folder, blobs, scan.notes())
}

/// The files of the configuration and the split that are asked.
fn of_card(
    folder: &Path,
    configs: &[Config],
    all: &[PathBuf],
    args: &SetArgs,
) -> Result<Vec<(String, PathBuf)>> {
    let names: Vec<&str> = configs.iter().map(|config| config.name.as_str()).collect();
    let default = || {
        let default = configs.iter().find(|config| config.is_default);
        let default = default.or_else(|| configs.iter().find(|config| config.name == "default"));
        default.or(match configs {
            [only] => Some(only),
            _ => None,
        })
    };
    let chosen: Vec<&Config> = match args.config_name.as_deref() {
        Some("all") => configs.iter().collect(),
        Some(name) => {
            let found = configs.iter().find(|config| config.name == name);
            let found = found.ok_or_else(|| {
                let problem = format_args!("no configuration {name:?}; there are {}", names.join(", "));
                Error::usage("--config-name", problem)
            })?;
            vec![found]
        }
        None => vec![default().ok_or_else(|| {
            let problem = format_args!(
                "{} configurations, {}; --config-name NAME names one, --config-name all takes them together",
                names.len(),
                names.join(", ")
            );
            Error::data(folder.display(), problem)
        })?],
    };
    let mut files = Vec::new();
    for config in &chosen {
        for (split, pattern) in &config.files {
            let paths = matching(folder, pattern, all)?;
            files.extend(paths.into_iter().map(|path| {
                let below = path.strip_prefix(folder).unwrap_or(&path).to_owned();
                let split = match &**split {
                    "" => splits::of_name(&below),
                    split => split.to_owned(),
                };
                (split, path)
            }));
        }
    }
    let of: BTreeMap<PathBuf, &str> = chosen
        .iter()
        .flat_map(|config| {
            let paths = config.files.iter();
            paths.filter_map(|(_, pattern)| {
                Some((matching(folder, pattern, all).ok()?, &*config.name))
            })
        })
        .flat_map(|(paths, name)| paths.into_iter().map(move |path| (path, name)))
        .collect();
    let files = splits::chosen(folder, files, args.split.as_deref())?;
    let names = files.into_iter().map(|path| {
        let config = if chosen.len() > 1 {
            of.get(&path).copied()
        } else {
            None
        };
        (config.unwrap_or_default().to_owned(), path)
    });
    Ok(names.collect())
}

/// The files of a folder that fit a pattern of its card.
fn matching(folder: &Path, pattern: &str, all: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let wrong = |problem: String| Error::data(folder.join("README.md").display(), problem);
    if pattern.split('/').any(|part| part == "..") || pattern.starts_with('/') {
        let problem = format!("the files {pattern:?} lie outside the folder of the card");
        return Err(wrong(problem));
    }
    let glob = Pattern::new(pattern.trim_start_matches("./"))
        .map_err(|e| wrong(format!("the files {pattern:?}: not a pattern: {e}")))?;
    let options = MatchOptions {
        require_literal_separator: true,
        ..MatchOptions::default()
    };
    let files: Vec<PathBuf> = all
        .iter()
        .filter(|path| {
            let below = path.strip_prefix(folder).unwrap_or(path);
            glob.matches_path_with(below, options)
        })
        .cloned()
        .collect();
    if files.is_empty() {
        let problem = format!("no file {pattern:?} in its folder; download the whole repository");
        return Err(wrong(problem));
    }
    Ok(files)
}

/// The files of a folder without a card: metadata files, else Parquet, else the other tables, of one kind.
fn by_kind(folder: &Path, all: Vec<PathBuf>) -> Result<Vec<PathBuf>> {
    let is_metadata = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default();
        METADATA.iter().any(|known| name == *known)
    };
    let (metadata, others): (Vec<PathBuf>, Vec<PathBuf>) = all.into_iter().partition(is_metadata);
    if !metadata.is_empty() {
        let kinds: BTreeSet<String> = metadata.iter().map(|path| ending(path)).collect();
        return one_kind(folder, metadata, &kinds);
    }
    let is_parquet = |path: &PathBuf| ending(path) == "parquet";
    let (parquet, others): (Vec<PathBuf>, Vec<PathBuf>) = others.into_iter().partition(is_parquet);
    if !parquet.is_empty() {
        return Ok(parquet);
    }
    // Tables deeper in the folder may be anything.
    let is_table = |path: &PathBuf| {
        let is_own = ["dataset.json", "classes.json", "info.json"]
            .iter()
            .any(|own| path.ends_with(own));
        let is_here = path.parent() == Some(folder);
        is_here && !is_own && matches!(&*ending(path), "tsv" | "csv" | "jsonl" | "ndjson" | "json")
    };
    let tables: Vec<PathBuf> = others.into_iter().filter(is_table).collect();
    if tables.is_empty() {
        let problem = format_args!("no file of questions in it: {READ} expected");
        return Err(Error::data(folder.display(), problem));
    }
    let kinds: BTreeSet<String> = tables.iter().map(|path| ending(path)).collect();
    one_kind(folder, tables, &kinds)
}

/// The files, if they are of one kind.
fn one_kind(folder: &Path, files: Vec<PathBuf>, kinds: &BTreeSet<String>) -> Result<Vec<PathBuf>> {
    if kinds.len() == 1 {
        return Ok(files);
    }
    let names: Vec<String> = files
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    let problem = format_args!(
        "files of several kinds, {}; name the one that is meant: --data {}",
        names.join(", "),
        names.first().map_or("", String::as_str)
    );
    Err(Error::data(folder.display(), problem))
}

/// Whether a folder holds a file of questions of other tools.
pub(in crate::dataset) fn holds_files(folder: &Path) -> bool {
    let Ok((folder, blobs)) = in_cache(folder) else {
        return true;
    };
    let is_arrow = folder.join("state.json").is_file();
    let mut scan = Scan::of(&folder, blobs.as_deref());
    let files = scan.files(&folder, 0).and_then(|all| by_kind(&folder, all));
    is_arrow || files.is_ok() || !configs_at(&folder).is_empty() || {
        let several = scan.files(&folder, 0).unwrap_or_default();
        several
            .iter()
            .any(|path| METADATA.iter().any(|name| path.ends_with(name)))
    }
}

fn configs_at(folder: &Path) -> Vec<Config> {
    let card = reading::text(&folder.join("README.md"));
    card.map_or_else(|_| Vec::new(), |card| configs(&card))
}

/// The snapshot of a repository in a hub's cache, and the folder of its blobs; any other folder stays.
fn in_cache(place: &Path) -> Result<(PathBuf, Option<PathBuf>)> {
    let name = place.canonicalize().unwrap_or_else(|_| place.to_owned());
    let is_cached = |path: &Path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("datasets--")
    };
    if is_cached(&name) && place.join("snapshots").is_dir() {
        let head = reading::text(&place.join("refs/main"))?;
        let snapshot = place.join("snapshots").join(head.trim());
        if !snapshot.is_dir() || head.trim().contains(['/', '\\']) {
            let problem = "refs/main names no folder in snapshots; download the repository again";
            return Err(Error::data(place.display(), problem));
        }
        return Ok((snapshot, Some(place.join("blobs"))));
    }
    let repository = name.ancestors().nth(2).filter(|path| is_cached(path));
    Ok((place.to_owned(), repository.map(|path| path.join("blobs"))))
}

/// A walk over a folder.
struct Scan {
    root: PathBuf,
    blobs: Option<PathBuf>,
    outside: Vec<PathBuf>,
}

impl Scan {
    /// The deepest folder that is looked into, counted from the first.
    const DEEPEST: usize = 4;

    fn of(folder: &Path, blobs: Option<&Path>) -> Self {
        let real = |path: &Path| path.canonicalize().unwrap_or_else(|_| path.to_owned());
        Self {
            root: real(folder),
            blobs: blobs.map(real),
            outside: Vec::new(),
        }
    }

    /// All files below a folder, sorted, without hidden ones. Links that lead out are passed over.
    fn files(&mut self, folder: &Path, depth: usize) -> Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        for path in reading::entries(folder)? {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if name.starts_with('.') {
                continue;
            }
            let is_link = fs::symlink_metadata(&path).is_ok_and(|facts| facts.is_symlink());
            if is_link && !self.stays_inside(&path) {
                self.outside.push(path);
            } else if path.is_dir() && !is_link {
                if depth < Self::DEEPEST {
                    files.extend(self.files(&path, depth + 1)?);
                }
            } else if path.is_file() {
                files.push(path);
            }
        }
        Ok(files)
    }

    fn stays_inside(&self, link: &Path) -> bool {
        let Ok(real) = link.canonicalize() else {
            return false;
        };
        let blobs = self.blobs.iter();
        blobs.chain([&self.root]).any(|root| real.starts_with(root))
    }

    fn notes(&self) -> Vec<String> {
        let Some(first) = self.outside.first() else {
            return Vec::new();
        };
        vec![format!(
            "{} links lead out of the folder or nowhere, as {}, and were passed over",
            self.outside.len(),
            first.display()
        )]
    }
}

/// The number of a shard and of all shards in a name, as `-00000-of-00003`.
fn shard(path: &Path) -> Option<(String, usize, usize)> {
    let stem = path.file_stem()?.to_str()?;
    let (head, all) = stem.rsplit_once("-of-")?;
    let (name, number) = head.rsplit_once('-')?;
    let folder = path.parent()?.display();
    Some((
        format!("{folder}/{name}"),
        number.parse().ok()?,
        all.parse().ok()?,
    ))
}

/// Refuses shards of which one is missing.
fn check_shards(files: &[PathBuf]) -> Result<()> {
    let mut found: BTreeMap<(String, usize), BTreeSet<usize>> = BTreeMap::new();
    for (name, number, all) in files.iter().filter_map(|path| shard(path)) {
        found.entry((name, all)).or_default().insert(number);
    }
    for ((name, all), numbers) in found {
        if let Some(missing) = (0..all).find(|number| !numbers.contains(number)) {
            let problem = format_args!(
                "{} of {all} shards are there; number {missing} is missing: download it, or name the files that are meant",
                numbers.len()
            );
            return Err(Error::data(name, problem));
        }
    }
    Ok(())
}

/// Words for a file that is one of several shards.
fn shard_alone(path: &Path) -> Option<String> {
    let (_, number, all) = shard(path)?;
    (all > 1).then(|| format!("shard {number} of {all} alone is read, as it was named"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_shard_is_named() {
        let files = |numbers: &[usize]| {
            let files = numbers
                .iter()
                .map(|n| PathBuf::from(format!("d/test-0000{n}-of-00003.parquet")));
            files.collect::<Vec<PathBuf>>()
        };
        assert!(check_shards(&files(&[0, 1, 2])).is_ok());
        let problem = check_shards(&files(&[0, 2])).unwrap_err().to_string();
        assert!(
            problem.contains("2 of 3 shards are there; number 1 is missing"),
            "{problem}"
        );
        assert_eq!(shard_alone(Path::new("a-00000-of-00001.parquet")), None);
        assert!(shard_alone(Path::new("a-00000-of-00002.parquet")).is_some());
    }

    #[cfg(unix)]
    #[test]
    fn links_that_lead_out_are_passed_over_and_said() {
        let outer = tempfile::tempdir().unwrap();
        let at = |name: &str| outer.path().join(name);
        fs::create_dir_all(at("set/inner")).unwrap();
        for name in ["secret.csv", "set/a.csv", "set/.hidden.csv"] {
            fs::write(at(name), "a").unwrap();
        }
        std::os::unix::fs::symlink(at("secret.csv"), at("set/b.csv")).unwrap();
        std::os::unix::fs::symlink(at("set/a.csv"), at("set/inner/c.csv")).unwrap();
        let mut scan = Scan::of(&at("set"), None);
        let files = scan.files(&at("set"), 0).unwrap();
        assert_eq!(files, [at("set/a.csv"), at("set/inner/c.csv")]);
        assert!(
            scan.notes()[0].contains("1 links lead out"),
            "{:?}",
            scan.notes()
        );
    }
}
