//! The shards of a set: [`check_shards`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// The name, the number of a shard and that of all shards in a path, as `test-00000-of-00003.parquet`.
fn shard(path: &Path) -> Option<(String, usize, usize)> {
    let stem = path.file_stem()?.to_str()?;
    let (head, all) = stem.rsplit_once("-of-")?;
    let (name, number) = head.rsplit_once('-')?;
    let all = all
        .chars()
        .take_while(char::is_ascii_digit)
        .collect::<String>();
    let name = path.with_file_name(name).display().to_string();
    Some((name, number.parse().ok()?, all.parse().ok()?))
}

/// Refuses shards of which one is missing.
pub(super) fn check_shards(files: &[PathBuf]) -> Result<()> {
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
pub(super) fn shard_alone(path: &Path) -> Option<String> {
    let (_, number, all) = shard(path)?;
    (all > 1).then(|| format!("shard {number} of {all} alone is read, as it was named"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_shard_is_named() {
        let files = |numbers: &[usize]| {
            numbers
                .iter()
                .map(|n| PathBuf::from(format!("d/test-0000{n}-of-00003.jsonl.gz")))
                .collect::<Vec<PathBuf>>()
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
}
