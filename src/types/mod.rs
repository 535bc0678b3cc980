//! The shared vocabulary: no input or output, no pixel mathematics.

pub mod condition;
pub mod digest;
pub mod frame;
pub mod light;
pub mod manifest;
pub mod question;
pub mod reply;
pub mod trial;

pub use condition::{Condition, EnhancerName};
pub use digest::Digest;
pub use frame::{Frame, FrameId, Rgb};
pub use light::{DarkLevel, Degradation, Level, Stops, Variant, Variants};
pub use question::{Answer, Choices, Family, Question, QuestionId, Why};
pub use reply::{Finish, Reply, Usage};
pub use trial::{Failure, FailureKind, ImageFacts, Outcome, Reading, Record, TrialKey, View};
