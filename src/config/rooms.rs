//! What `rooms` is told, checked once: [`MakeRooms`].

use std::num::NonZeroUsize;
use std::path::PathBuf;

use super::layers::Shared;
use super::{Existing, threads};
use crate::cli::RoomsArgs;
use crate::dataset::Rooms;
use crate::error::Result;

/// Rooms that are written to a folder.
#[derive(Debug)]
pub struct MakeRooms {
    /// Which ones.
    pub rooms: Rooms,
    /// Where they go.
    pub out: PathBuf,
    /// What happens to frames that are there already.
    pub existing: Existing,
    /// Threads; `None` for all cores.
    pub threads: Option<NonZeroUsize>,
}

impl MakeRooms {
    /// Checks what was said by flags, environment and `--config` file; of the last two, what concerns threads.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] with the flag that cannot be used.
    pub fn resolve(said: RoomsArgs) -> Result<Self> {
        let shared = Shared {
            threads: said.threads,
            config: said.config,
            ..Shared::default()
        }
        .merge()?;
        let mut rooms = Rooms::default();
        for (flag, value) in [
            ("frames", said.frames.map(|value| value.to_string())),
            ("seed", said.seed.map(|value| value.to_string())),
            ("size", said.size),
        ] {
            if let Some(value) = value {
                rooms
                    .set(flag, &value)
                    .map_err(|e| e.at(format!("--{flag}")))?;
            }
        }
        Ok(Self {
            rooms,
            out: said.out,
            existing: Existing::said(said.force),
            threads: threads(shared.threads)?,
        })
    }
}
