//! What `serve` is told, checked once: [`Serve`].

use super::place;
use crate::cli::ServeArgs;
use crate::dataset::Place;
use crate::error::Result;

/// The port where nobody says otherwise.
const PORT: u16 = 8089;

/// A server of the built-in models.
#[derive(Debug)]
pub struct Serve {
    /// The frames that the observer knows.
    pub place: Place,
    /// The port on loopback.
    pub port: u16,
    /// What decides the guesses.
    pub seed: u64,
}

impl Serve {
    /// Checks what was said.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] with the flag that cannot be used.
    pub fn resolve(said: ServeArgs) -> Result<Self> {
        Ok(Self {
            place: place(said.data)?,
            port: said.port.unwrap_or(PORT),
            seed: said.seed.unwrap_or(0),
        })
    }
}
