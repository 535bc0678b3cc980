//! A record as the rules of this version read its reply: [`RereadRecord`].

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use crate::score::record::{Detail, reread};
use crate::types::Record;

/// A record whose reply is read again as its line is parsed.
pub(super) struct RereadRecord<D>(pub(super) Record<D>);

impl<'de, D: Detail> Deserialize<'de> for RereadRecord<D> {
    fn deserialize<S: Deserializer<'de>>(deserializer: S) -> std::result::Result<Self, S::Error> {
        let record = Record::<D>::deserialize(deserializer)?;
        reread(record).map(Self).map_err(S::Error::custom)
    }
}
