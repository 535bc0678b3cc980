//! The settings of the rooms: [`Rooms`].

use std::fmt;
use std::str::FromStr;

use clap::{Args, ValueEnum};

use super::light::RoomLight;
use darkqa_base::error::Result;
use darkqa_base::types::Decides;

/// Settings of the rooms, such as `frames=48,seed=7,size=1280x720`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Args)]
pub struct Rooms {
    /// The number of frames, two of each room
    #[arg(long, value_name = "N", value_parser = parse_frames, default_value = "48", add = Decides::Trials)]
    pub frames: usize,
    /// The seed of the rooms
    #[arg(long, value_name = "N", default_value_t = 7, add = Decides::Pixels)]
    pub seed: u64,
    /// Width and height in pixels
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = parse_size, default_value = "640x480", add = Decides::Pixels)]
    pub size: [usize; 2],
    /// Encoding of the pixels; with linear light, OpenEXR files are written beside the PNG files
    #[arg(long, value_enum, default_value_t, add = Decides::Pixels)]
    pub light: RoomLight,
}

impl Default for Rooms {
    fn default() -> Self {
        Self { frames: 48, seed: 7, size: [640, 480], light: RoomLight::default() }
    }
}

/// Maximum width and height of a frame, in pixels (chosen).
const MAX_SIDE: usize = 8192;

/// Maximum number of frames (chosen).
const MAX_FRAMES: usize = 1_000_000;

impl fmt::Display for Rooms {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size;
        write!(f, "frames={},seed={},size={width}x{height}", self.frames, self.seed)?;
        match self.light {
            RoomLight::Display => Ok(()),
            RoomLight::Linear => write!(f, ",light={}", self.light),
        }
    }
}

impl FromStr for Rooms {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut rooms = Self::default();
        for part in text.split(',').filter(|part| !part.is_empty()) {
            let (key, value) = part.split_once('=').unwrap_or((part, ""));
            match (key.trim(), value.trim()) {
                ("frames", value) => parse_frames(value).map(|frames| rooms.frames = frames),
                ("seed", value) => {
                    value.parse().map(|seed| rooms.seed = seed).map_err(|_| "a whole number expected".to_owned())
                }
                ("size", value) => parse_size(value).map(|size| rooms.size = size),
                ("light", value) => RoomLight::from_str(value, false)
                    .map(|light| rooms.light = light)
                    .map_err(|_| "display or linear expected".to_owned()),
                _ => Err("frames=N, seed=N, size=WIDTHxHEIGHT or light=linear expected".to_owned()),
            }
            .map_err(|expected| format!("{key}={value}: {expected}"))?;
        }
        Ok(rooms)
    }
}

/// Parses a number of frames.
fn parse_frames(text: &str) -> Result<usize, String> {
    text.parse()
        .ok()
        .filter(|frames| (1..=MAX_FRAMES).contains(frames))
        .ok_or_else(|| format!("a number from 1 to {MAX_FRAMES} expected"))
}

/// Parses a width and height in pixels, such as `640x480`.
fn parse_size(text: &str) -> Result<[usize; 2], String> {
    text.split_once('x')
        .and_then(|(width, height)| Some([parse_side(width)?, parse_side(height)?]))
        .ok_or_else(|| format!("WIDTHxHEIGHT of 32 to {MAX_SIDE} pixels expected"))
}

/// Parses a width or a height in pixels; `None` if it is out of range.
fn parse_side(text: &str) -> Option<usize> {
    text.parse().ok().filter(|side| (32..=MAX_SIDE).contains(side))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_read_back() {
        for text in [
            "frames=3,seed=9,size=1280x720",
            "frames=48,seed=7,size=640x480",
            "frames=48,seed=7,size=640x480,light=linear",
        ] {
            let rooms: Rooms = text.parse().unwrap();
            assert_eq!(rooms.to_string(), text);
        }
        assert_eq!("".parse::<Rooms>().unwrap(), Rooms::default());
    }
}
