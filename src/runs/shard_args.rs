//! The `--shard` flag of commands that work on files: [`ShardArgs`], [`shard_from_flag`], [`keep_shard`].

use clap::Args;

use crate::error::{Error, Result};
use crate::runs::resolved_shard::ResolvedShard;
use crate::runs::shard::Shard;
use crate::runs::shard_sources::{WeightedSource, shard_range};
use crate::types::Decides;
use crate::types::text::counted;

/// The `--shard` flag.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct ShardArgs {
    /// Process only this shard of the frames, as 2/4, or auto/4 for the task of a Slurm array or the pod of an indexed
    /// Kubernetes job. All shards together write what one call does; default: all frames
    #[arg(long, value_name = "I/N|auto/N|auto", help_heading = "Scale", add = Decides::Trials)]
    pub shard: Option<String>,
}

impl ShardArgs {
    /// The shard in the flag.
    ///
    /// # Errors
    /// As for [`shard_from_flag`].
    pub(crate) fn resolve(&self) -> Result<Shard> {
        shard_from_flag(self.shard.as_deref())
    }
}

/// The shard in a flag; everything without the flag. A batch system alone does not select a shard, because each task of
/// its array may run another model.
///
/// # Errors
/// If there is no such shard, or the variables of the batch system do not determine it.
pub(crate) fn shard_from_flag(flag: Option<&str>) -> Result<Shard> {
    let flag = flag.unwrap_or("none");
    ResolvedShard::resolve(Some(flag), |name| std::env::var(name).ok(), None).map(|resolved| resolved.shard)
}

/// Keeps the frames of a shard. All frames cost the same.
///
/// # Errors
/// If the shard is empty.
pub(crate) fn keep_shard<T>(frames: &mut Vec<T>, shard: Shard) -> Result<()> {
    if !shard.is_part() {
        return Ok(());
    }
    let own = shard_range(&vec![WeightedSource::equal(); frames.len()], shard);
    if own.is_empty() {
        let problem = format!("{shard} is empty: only {}; use at most as many parts", counted(frames.len(), "frame"));
        return Err(Error::usage("--shard", problem));
    }
    frames.truncate(own.end);
    frames.drain(..own.start);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part(text: &str) -> Result<String> {
        let mut letters: Vec<char> = "abcdefg".chars().collect();
        let kept = keep_shard(&mut letters, text.parse().unwrap());
        kept.map(|()| letters.into_iter().collect::<String>())
    }

    #[test]
    fn parts_are_together_everything_in_order() {
        let parts = ["1/3", "2/3", "3/3"].map(|text| part(text).unwrap());
        assert_eq!(parts.concat(), "abcdefg");
        assert!(parts.iter().all(|part| (2..=3).contains(&part.len())));
        assert_eq!(part("1/1").unwrap(), "abcdefg");
        let error = part("8/8").unwrap_err().to_string();
        assert!(error.contains("8/8 is empty: only 7 frames"), "{error}");
    }
}
