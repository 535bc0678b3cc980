//! Movement of the camera during an exposure, and its blur.

pub mod blur;
mod motion;
mod streak;

pub use motion::{FrameView, Motion, MotionAngle};
pub use streak::{Streak, Tap};
