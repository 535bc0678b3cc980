//! The figures of `synthesize --sheet`: [`Sheet`], with what they are made from, [`SheetRecipe`]. They are drawn by
//! [`crate::report::sheet`].

use std::fmt;

use clap::ValueEnum;
use ndarray::Array2;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::placed::ImageOrigin;
use crate::dataset::Picture;
use crate::error::Result;
use crate::report::sheet::{self, LevelColumn, Signal};
use crate::synthesis::bayer::Bayer;
use crate::synthesis::noise::{self, Term};
use crate::synthesis::unprocess::unprocess;
use crate::synthesis::{
    self, Coupling, Draws, LightSettings, NoiseKey, Synthesis, expose, exposure, ladder,
};
use crate::types::{AxisLevel, FrameId, ReadingName, Rgb, Severity};

/// The kind of a figure of one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Sheet {
    /// Both variants by level, with amplified crops
    Levels,
    /// Each term of the noise alone
    Noise,
}

impl fmt::Display for Sheet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Levels => "levels",
            Self::Noise => "noise",
        })
    }
}

/// Everything that decides a figure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct SheetRecipe {
    sheet: Sheet,
    /// The version of the drawing, [`sheet::VERSION`].
    drawing: u32,
    frame: String,
    /// The digest of the image that the figure is of.
    source: String,
    /// The levels besides L0.
    levels: Vec<String>,
    seed: u64,
    /// The versions of the exposure and the sensor branch.
    synthesis: [u32; 2],
    /// The light readings by name, each with its whole definition.
    readings: Value,
    /// The factors of light of the insets.
    insets: Vec<u16>,
}

impl ImageOrigin for SheetRecipe {
    const SCHEMAS: &'static [&'static str] = &["darkqa.sheet/1"];
    const IS_REPLACED: bool = true;
}

impl SheetRecipe {
    pub(super) fn new(
        kind: Sheet,
        frame: &FrameId,
        picture: &Picture,
        light: &LightSettings,
    ) -> Result<Self> {
        if kind == Sheet::Noise {
            light.sensor.readings.only()?;
        }
        let levels = dark_levels(light);
        let insets = match kind {
            Sheet::Levels => sheet::insets(&levels),
            Sheet::Noise => Vec::new(),
        };
        Ok(Self {
            sheet: kind,
            drawing: sheet::VERSION,
            frame: frame.0.clone(),
            source: picture.digest().to_string(),
            levels: levels.iter().map(ToString::to_string).collect(),
            seed: light.sensor.seed,
            synthesis: [exposure::VERSION, synthesis::VERSION],
            readings: serde_json::json!(light.sensor.readings),
            insets,
        })
    }
}

impl Sheet {
    /// The figure of a frame.
    pub(super) fn draw(self, clean: &Rgb, frame: &FrameId, light: &LightSettings) -> Result<Rgb> {
        match self {
            Self::Levels => Ok(levels(clean, frame, light)),
            Self::Noise => terms(clean, frame, light),
        }
    }
}

fn dark_levels(light: &LightSettings) -> Vec<AxisLevel> {
    let levels = light.levels.iter().copied();
    levels.filter(|level| *level != AxisLevel::L0).collect()
}

fn severities(light: &LightSettings) -> Vec<Severity> {
    let levels = light.levels.iter();
    levels.filter_map(|level| level.severity()).collect()
}

/// The figure of a frame at each level, by exposure alone and with noise in each light reading.
fn levels(clean: &Rgb, frame: &FrameId, light: &LightSettings) -> Rgb {
    let severities = severities(light);
    let key = NoiseKey::new(light.sensor.seed, frame);
    let mut rows = vec!["EV".to_owned()];
    let exposed = severities.iter().map(|severity| expose(clean, *severity));
    let mut columns: Vec<LevelColumn> = dark_levels(light)
        .into_iter()
        .zip(exposed)
        .map(|(level, image)| LevelColumn {
            level,
            images: vec![image],
        })
        .collect();
    let mut facts = Vec::new();
    for (name, synthesis) in light.sensor.readings.iter() {
        let black = || Rgb::black(clean.height(), clean.width());
        let mut noisy: Vec<Rgb> = severities.iter().map(|_| black()).collect();
        ladder(clean, &key, synthesis, &severities, &mut noisy);
        for (column, image) in columns.iter_mut().zip(noisy) {
            column.images.push(image);
        }
        rows.push(match *name == ReadingName::PAPER {
            true => "noise".to_owned(),
            false => format!("@{name}"),
        });
        facts.push(format!("{name}: {}", state(synthesis, &key)));
    }
    let foot = format!("{}; {}", camera(light), facts.join("; "));
    sheet::levels(clean, &rows, &columns, &foot)
}

/// Camera and seed in words.
fn camera(light: &LightSettings) -> String {
    let mut readings = light.sensor.readings.iter();
    let camera = readings.next().map_or_else(String::new, |(_, synthesis)| {
        synthesis.camera.name().to_owned()
    });
    format!("{camera}, seed {}", light.sensor.seed)
}

/// Gain and light ratio of a frame in words.
fn state(synthesis: &Synthesis, key: &NoiseKey) -> String {
    if synthesis.draws == Draws::Fresh {
        return "K and r drawn for each level".to_owned();
    }
    let state = synthesis.state(key, Severity::L5);
    let ratio = match synthesis.coupling == Coupling::Photon {
        true => "r 2^EV".to_owned(),
        false => format!("r {:.0}", state.ratio),
    };
    format!("K {:.2}, {ratio}", state.system_gain)
}

/// The figure of the noise terms of a frame, at the darkest level asked for. The level matters if each has its own negative.
fn terms(clean: &Rgb, frame: &FrameId, light: &LightSettings) -> Result<Rgb> {
    let level = severities(light).pop().unwrap_or(Severity::L5);
    let (synthesis, frame) = (
        light.sensor.readings.only()?,
        NoiseKey::new(light.sensor.seed, frame),
    );
    let key = match synthesis.draws {
        Draws::Shared => frame,
        Draws::Fresh => frame.at(level),
    };
    let state = synthesis.state(&frame, level);
    let raw = unprocess(clean, &state);
    let range = state.adu_range as f32;
    let with_terms = |terms: &[Term]| {
        let mut noisy = raw.clone();
        noise::add(&mut noisy, &state, &key, synthesis.amplify, terms);
        adu(&noisy, range)
    };
    let clean = with_terms(&[]);
    let signal = |name: String, adu| Signal { name, adu };
    let mut signals = vec![signal("RAW".to_owned(), clean.clone())];
    for (name, term) in [
        ("shot noise", Term::Shot),
        ("read noise", Term::Read),
        ("row noise", Term::Row),
        ("quantisation noise", Term::Quantisation),
    ] {
        signals.push(signal(name.to_owned(), with_terms(&[term]) - &clean));
    }
    signals.push(signal("noisy RAW".to_owned(), with_terms(&Term::ALL)));
    let foot = format!(
        "{}; {}: K {:.2}, r {:.0}",
        camera(light),
        synthesis.name(),
        state.system_gain,
        state.ratio
    );
    Ok(sheet::noise(&signals, &foot))
}

fn adu(raw: &Bayer, range: f32) -> Array2<f32> {
    Array2::from_shape_fn((raw.height(), raw.width()), |(row, column)| {
        raw.sample(row, column) * range
    })
}
