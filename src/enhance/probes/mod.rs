//! Probes of a model on dark frames, and plausibility of its images.

pub(crate) mod doctor;
mod plausible;
mod probe;
mod probe_run;
mod usage;

pub use doctor::{Examination, ImageOutput, ProposedLine, Settled};
pub use plausible::{DARK, brightness, shows_nothing};
pub use probe::FRAMES;
pub use probe_run::ProbeFindings;
pub use usage::{ImageUse, Implausible, Usage, burnt_out};

pub(super) use plausible::UnclampedImage;
pub(super) use probe::RangePair;
