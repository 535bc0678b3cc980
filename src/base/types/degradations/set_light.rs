//! The light in which the photographs of a set were taken: [`SetLight`].

use serde::{Deserialize, Serialize};

/// The light in which the photographs of a set were taken.
#[cfg_attr(feature = "program", derive(clap::ValueEnum))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SetLight {
    /// Well lit: L0 is the frame in the light
    #[default]
    Lit,
    /// In the dark: L0 is the photograph as it was taken, and nothing is darker by default
    Dark,
}

impl SetLight {
    /// The label of L0 in tables and figures: `L0`, or `as photographed`.
    #[must_use]
    pub fn l0_label(self) -> &'static str {
        match self {
            Self::Lit => "L0",
            Self::Dark => "as photographed",
        }
    }
}
