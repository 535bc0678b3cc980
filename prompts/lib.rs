//! The prompts that darkqa-eval carries. `README.md` beside this file describes them.

/// The template of a question about an image, and that of the same question without its image.
#[derive(Debug, Clone, Copy)]
pub struct Templates {
    /// Of `choice.txt`.
    pub choice: &'static str,
    /// Of `blind.txt`.
    pub blind: &'static str,
}

/// The prompts of the paper, and the default.
pub const PAPER: Templates = Templates { choice: include_str!("choice.txt"), blind: include_str!("blind.txt") };

/// A prompt of few words.
pub const TERSE: Templates =
    Templates { choice: include_str!("terse/choice.txt"), blind: include_str!("terse/blind.txt") };

/// A prompt that asks for the letter alone.
pub const LETTER: Templates =
    Templates { choice: include_str!("letter/choice.txt"), blind: include_str!("letter/blind.txt") };

/// The questions of `--ask home`, one JSON object a line.
pub const HOME: &str = include_str!("ask/home.jsonl");

/// The templates of OpenEQA (MIT, Meta Platforms), byte for byte.
pub mod openeqa {
    /// A question with the frames of a walk.
    pub const VISION: &str = include_str!("openeqa/vision.txt");
    /// A question without them.
    pub const BLIND: &str = include_str!("openeqa/blind.txt");
    /// The prompt of the judge.
    pub const MATCH: &str = include_str!("openeqa/match.txt");
    /// The prompt of the judge for a question with further right answers.
    pub const MATCH_EXTRA: &str = include_str!("openeqa/match-extra.txt");
}
