//! How the choices of a question are shown: [`Showing`].

use std::num::NonZeroU32;

use crate::cli::DataArgs;

/// In which orders the choices of a question are shown, and how often it is asked in each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Showing {
    /// Which order is the first.
    pub order: Order,
    /// Whether the others follow.
    pub rotations: Rotations,
    /// How often each is asked.
    pub repeats: NonZeroU32,
}

/// The order in which choices are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// As the data set has them.
    Given,
    /// Drawn for each question from this seed.
    Shuffled(u64),
}

/// Which rotations of an order are shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rotations {
    /// The order alone.
    One,
    /// Every rotation, each as a question of its own.
    Every,
}

impl Showing {
    /// What was said; orders are drawn from this seed.
    pub(super) fn said(said: &DataArgs, seed: u64) -> Self {
        Self {
            order: if said.shuffle_options {
                Order::Shuffled(seed)
            } else {
                Order::Given
            },
            rotations: if said.circular {
                Rotations::Every
            } else {
                Rotations::One
            },
            repeats: said.repeats.unwrap_or(NonZeroU32::MIN),
        }
    }
}
