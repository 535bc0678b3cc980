//! Shards of a set: [`check_shards`], [`single_shard_note`].

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// Parts of the path of a shard, such as `test-00000-of-00003.parquet`.
struct ShardPath {
    /// Path up to the number of the shard.
    name: String,
    /// Number of the shard, counted from 0.
    number: usize,
    /// Number of all shards.
    count: usize,
}

impl ShardPath {
    /// Parses a path; `None` if it is not the path of a shard.
    fn parse(path: &Path) -> Option<Self> {
        let stem = path.file_stem()?.to_str()?;
        let (head, count) = stem.rsplit_once("-of-")?;
        let (name, number) = head.rsplit_once('-')?;
        // The extension `.jsonl.gz` leaves `.jsonl` in the stem.
        let count: String = count.chars().take_while(char::is_ascii_digit).collect();
        Some(Self {
            name: path.with_file_name(name).display().to_string(),
            number: number.parse().ok()?,
            count: count.parse().ok()?,
        })
    }
}

/// Checks that no shard is missing.
pub(super) fn check_shards(files: &[PathBuf]) -> Result<()> {
    let mut found: BTreeMap<(String, usize), BTreeSet<usize>> = BTreeMap::new();
    for shard in files.iter().filter_map(|path| ShardPath::parse(path)) {
        found.entry((shard.name, shard.count)).or_default().insert(shard.number);
    }
    for ((name, count), numbers) in found {
        if let Some(missing) = (0..count).find(|number| !numbers.contains(number)) {
            let problem = format_args!(
                "{} of {count} shards are there; number {missing} is missing: download it, or name the files that are meant",
                numbers.len()
            );
            return Err(Error::data(name, problem));
        }
    }
    Ok(())
}

/// Note about a file that is one of several shards.
pub(super) fn single_shard_note(path: &Path) -> Option<String> {
    let ShardPath { number, count, .. } = ShardPath::parse(path)?;
    (count > 1).then(|| format!("shard {number} of {count} alone is read, as it was named"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(numbers: &[usize]) -> Vec<PathBuf> {
        numbers.iter().map(|n| PathBuf::from(format!("d/test-0000{n}-of-00003.jsonl.gz"))).collect::<Vec<PathBuf>>()
    }

    #[test]
    fn missing_shard_is_an_error() {
        assert!(check_shards(&files(&[0, 1, 2])).is_ok());
        let problem = check_shards(&files(&[0, 2])).unwrap_err().to_string();
        assert!(problem.contains("2 of 3 shards are there; number 1 is missing"), "{problem}");
        assert_eq!(single_shard_note(Path::new("a-00000-of-00001.parquet")), None);
        assert!(single_shard_note(Path::new("a-00000-of-00002.parquet")).is_some());
    }
}
