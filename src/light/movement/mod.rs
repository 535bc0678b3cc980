//! Movement of the camera during an exposure, and its blur.

pub mod blur;
mod motion;

pub use motion::{FrameView, Motion, MotionAngle, Streak, Tap};
