//! Probes of a model on dark frames, and plausibility of its images.

mod burnt_out;
mod doctor;
mod endpoints;
mod expressions;
mod findings;
mod plausible;
mod probe;
mod probe_run;
mod range_pair;
mod trial_images;
mod usage;

pub use burnt_out::burnt_out;
pub use doctor::{Examination, ImageOutput, ProposedLine, Settled};
pub use findings::Findings;
pub(super) use plausible::UnclampedImage;
pub use plausible::{DARK, brightness, shows_nothing};
pub use probe::FRAMES;
pub(super) use range_pair::RangePair;
pub use usage::{ImageUse, Implausible, Usage};
