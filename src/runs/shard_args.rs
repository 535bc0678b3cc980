//! The part of the files that a command works on: [`PartArgs`], [`part_of`], [`keep_part`].

use clap::Args;

use crate::error::{Error, Result};
use crate::runs::part::{Divided, own_sources};
use crate::runs::shard::Shard;
use crate::types::Decides;

/// Flag of commands that can do a part of their files.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct PartArgs {
    /// Do only this part of the frames, as 2/4, or auto/4 for the task of this process in a Slurm array or the pod of an indexed Kubernetes
    /// job. All parts together write what one call does; default: all frames
    #[arg(long, value_name = "I/N|auto/N|auto", help_heading = "Scale", add = Decides::Trials)]
    pub shard: Option<String>,
}

impl PartArgs {
    /// The part that the flag names.
    ///
    /// # Errors
    /// As of [`part_of`].
    pub(crate) fn resolve(&self) -> Result<Shard> {
        part_of(self.shard.as_deref())
    }
}

/// The part that a flag names; everything without it, in a batch system as well: an array may be one of models.
///
/// # Errors
/// If there is no such part, or the batch system does not say which one this process is.
pub(crate) fn part_of(flag: Option<&str>) -> Result<Shard> {
    let flag = flag.unwrap_or("none");
    Shard::resolve(Some(flag), |name| std::env::var(name).ok())
}

/// Keeps the part of these frames, or of other things that cost the same each.
///
/// # Errors
/// If the part is empty.
pub(crate) fn keep_part<T>(things: &mut Vec<T>, shard: Shard) -> Result<()> {
    if !shard.is_part() {
        return Ok(());
    }
    let divided = things.iter().map(|_| Divided {
        scene: String::new(),
        cost: 1,
    });
    let own = own_sources(&divided.collect::<Vec<_>>(), shard);
    if own.is_empty() {
        let problem = format!(
            "{shard} is empty: there are {} frames; use at most as many parts",
            things.len()
        );
        return Err(Error::usage("--shard", problem));
    }
    things.truncate(own.end);
    things.drain(..own.start);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_together_everything_in_order() {
        let part = |text: &str| {
            let mut letters: Vec<char> = "abcdefg".chars().collect();
            let kept = keep_part(&mut letters, text.parse().unwrap());
            kept.map(|()| letters.into_iter().collect::<String>())
        };
        let parts = ["1/3", "2/3", "3/3"].map(|text| part(text).unwrap());
        assert_eq!(parts.concat(), "abcdefg");
        assert!(parts.iter().all(|part| (2..=3).contains(&part.len())));
        assert_eq!(part("1/1").unwrap(), "abcdefg");
        let error = part("8/8").unwrap_err().to_string();
        assert!(
            error.contains("8/8 is empty: there are 7 frames"),
            "{error}"
        );
    }
}
