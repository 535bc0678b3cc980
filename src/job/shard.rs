//! The part of the questions that a process asks: [`part`].

use std::collections::HashMap;

use crate::config::Shard;
use crate::error::{Error, Result};

/// The questions about the sources of a shard, which are dealt out one by one in the order in which they are first asked about;
/// `source` names that of a question.
///
/// # Errors
/// If none is left.
pub(crate) fn part<Q>(
    questions: Vec<Q>,
    shard: Shard,
    source: impl Fn(&Q) -> String,
) -> Result<Vec<Q>> {
    if !shard.is_part() {
        return Ok(questions);
    }
    let mut places = HashMap::<String, usize>::new();
    for question in &questions {
        let next = places.len();
        places.entry(source(question)).or_insert(next);
    }
    let own = questions.into_iter();
    let own = own.filter(|question| shard.has(places[&source(question)]));
    let own: Vec<Q> = own.collect();
    if own.is_empty() {
        let problem = format!(
            "{shard} is empty: there are {} frames or walks; as many parts at most expected",
            places.len()
        );
        return Err(Error::usage("--shard", problem));
    }
    Ok(own)
}
