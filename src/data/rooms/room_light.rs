//! [`RoomLight`]: encoding of the pixels of the built-in rooms.

use clap::ValueEnum;

use darkqa_base::types::flags::flag_words;

/// Encoding of the pixels of the rooms.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum RoomLight {
    /// 8-bit codes of a display, with highlights compressed
    #[default]
    Display,
    /// Linear light: windows and lamps keep their ratio to the room
    Linear,
}

flag_words!(RoomLight);
