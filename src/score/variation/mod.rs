//! Where the variation of accuracy comes from: runs that ask each question under several wordings of the prompt, orders
//! of the choices, draws of the noise, and repeats.
//!
//! Everything is computed from [`Observation`]s: the parsed replies of one model in one condition, or the differences
//! of two sides ([`paired`]). The design is fully crossed, or each question has a balanced random half of the
//! combinations; replies may be missing. All numbers are shares: 0.03 is 3 percentage points.
//!
//! - [`Components::new`]: the standard deviation that each [`Source`] adds to a reply.
//! - [`facet_ranges`]: how far apart the levels of a [`Facet`] are.
//! - [`FacetedDifference::new`]: a difference, with an interval for other questions and other levels of the facets, and
//!   the number of combinations in which it has the same sign.
//! - [`PositionPreference`]: the position of the choices that a model prefers, and its change in the dark.
//! - [`rank_agreement`]: Kendall's W of the ranks of models over the levels of a facet.
//! - [`Design`]: standard error, power and number of requests of a planned run; [`random_half`] of its combinations.
//!
//! ```
//! use darkqa_score::variation::{Components, Design, FacetedDifference, Observation, facet_ranges, paired};
//!
//! // 12 questions of 6 scenes under 3 wordings, 2 orders and 2 draws, at L0 and in the dark.
//! let mut light = Vec::new();
//! let mut dark = Vec::new();
//! for question in 0..12_u32 {
//!     for (wording, order, draw) in (0..12_u16).map(|cell| (cell % 3, cell / 3 % 2, cell / 6)) {
//!         let reply = |is_right: bool| Observation {
//!             question,
//!             scene: question / 2,
//!             wording,
//!             order,
//!             draw,
//!             repeat: 0,
//!             value: f64::from(u8::from(is_right)),
//!         };
//!         light.push(reply(question % 4 > 0));
//!         dark.push(reply((question + u32::from(wording + draw)) % 3 > 0 && question % 5 > 0));
//!     }
//! }
//! let components = Components::new(&light);
//! let ranges = facet_ranges(&light);
//! let loss = paired(&light, &dark);
//! let difference = FacetedDifference::new(&loss).expect("pairs");
//! assert_eq!((ranges.len(), difference.signs.of), (3, 12));
//! let design =
//!     Design { scenes: 60, questions: 240, wordings: 3, orders: 2, draws: 2, repeats: 1, is_half: true };
//! assert_eq!(design.requests(), 1440);
//! let spread = Components::new(&loss).spread(&design);
//! assert!(spread.error > 0.0 && components.deviation(darkqa_score::variation::Source::Question).is_some());
//! ```

mod advice;
mod by_run;
mod components;
mod difference;
mod facets;
mod matrix;
mod observation;
mod positions;
mod ranks;
#[cfg(test)]
mod tests;

pub use advice::{Design, random_half};
pub use by_run::{AccuracyVariation, DifferenceVariation, Needed, Plan, RunVariation};
pub use components::{Component, Components, Source};
pub use difference::{FacetedDifference, SignCount};
pub use facets::{FacetRange, facet_ranges};
pub use observation::{Facet, Observation, paired};
pub use positions::PositionPreference;
pub use ranks::rank_agreement;
