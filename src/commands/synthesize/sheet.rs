//! The figures of `synthesize --sheet` ([`SheetKind`]) and the facts that determine them ([`SheetRecipe`]). They are drawn
//! by [`darkqa_report::charts::sheet`].

use std::fmt;

use clap::ValueEnum;
use ndarray::Array2;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use darkqa_base::error::Result;
use darkqa_base::types::degradations::{Axis, Kind};
use darkqa_base::types::{AxisLevel, Degradation, FrameId, Rgb, Severity, Variant};
use darkqa_data::Picture;
use darkqa_engine::images::frame_work::FrameWork;
use darkqa_engine::images::stored::ImageOrigin;
use darkqa_light::raw::noise::{self, Term};
use darkqa_light::raw::{Bayer, unprocess_with_headroom};
use darkqa_light::{Coupling, Draws, LightSettings, NoiseKey, Synthesis, version};
use darkqa_report::charts::sheet::{self, LevelBlock, LevelImage, LevelRow, Signal};

/// The kind of a figure of one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum SheetKind {
    /// Each variant by level, with amplified crops
    Levels,
    /// Each term of the noise alone
    Noise,
}

impl fmt::Display for SheetKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Levels => "levels",
            Self::Noise => "noise",
        })
    }
}

/// All facts that determine a figure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct SheetRecipe {
    sheet: SheetKind,
    /// Version of the drawing, [`sheet::VERSION`].
    drawing: u32,
    frame: String,
    /// Digest of the input image.
    source: String,
    /// Degradations that may be shown.
    images: Vec<String>,
    /// Versions of all kinds of degradation.
    synthesis: Vec<u32>,
    /// Settings of the kinds: seed, noise profiles, automatic exposure and motion.
    light: Value,
}

impl ImageOrigin for SheetRecipe {
    const SCHEMAS: &'static [&'static str] = &["darkqa.sheet/1"];
    const REPLACES_OTHER_SETTINGS: bool = true;
}

impl SheetRecipe {
    pub(super) fn new(kind: SheetKind, frame: &FrameId, picture: &Picture, light: &LightSettings) -> Result<Self> {
        if kind == SheetKind::Noise {
            light.kinds.sensor.readings.only()?;
        }
        let degradations = light.degradations().into_iter().flatten();
        Ok(Self {
            sheet: kind,
            drawing: sheet::VERSION,
            frame: frame.0.clone(),
            source: picture.digest().to_string(),
            images: degradations.map(|how| how.to_string()).collect(),
            synthesis: Kind::ALL.map(version).to_vec(),
            light: serde_json::json!(light.kinds),
        })
    }
}

impl SheetKind {
    /// Draws the figure of a frame.
    pub(super) fn draw(self, frame: &mut FrameWork<'_>, light: &LightSettings) -> Result<Rgb> {
        match self {
            Self::Levels => draw_levels(frame, light),
            Self::Noise => draw_terms(frame, light),
        }
    }
}

/// The footer of a figure: camera and seed, gain and light ratio in each noise profile, and the flags of further
/// variants.
fn footer(light: &LightSettings, frame: &FrameId, degradations: &[Degradation]) -> String {
    let mut facts = Vec::new();
    if has_kind(degradations, Kind::has_noise) {
        facts.push(camera_and_seed(light));
    }
    if has_kind(degradations, Kind::has_profiles) {
        let key = NoiseKey::new(light.kinds.sensor.seed, frame);
        facts.extend(
            light
                .kinds
                .sensor
                .readings
                .iter()
                .map(|(name, synthesis)| format!("{name}: {}", gain_and_ratio(synthesis, &key))),
        );
    }
    if has_kind(degradations, |kind| kind == Kind::Auto) {
        facts.push(format!("--auto {}", light.kinds.auto));
    }
    if has_kind(degradations, Kind::has_motion) {
        facts.push(format!("--motion {}", light.kinds.motion));
    }
    facts.join("; ")
}

fn has_kind(degradations: &[Degradation], test: fn(Kind) -> bool) -> bool {
    degradations.iter().any(|how| test(how.kind()))
}

/// Camera and seed in words.
fn camera_and_seed(light: &LightSettings) -> String {
    let camera = light
        .kinds
        .sensor
        .readings
        .iter()
        .next()
        .map_or_else(String::new, |(_, synthesis)| synthesis.camera.name().to_owned());
    format!("{camera}, seed {}", light.kinds.sensor.seed)
}

/// Gain and light ratio of a frame in words.
fn gain_and_ratio(synthesis: &Synthesis, key: &NoiseKey) -> String {
    if synthesis.draws == Draws::Fresh {
        return "K and r drawn for each level".to_owned();
    }
    let state = synthesis.state(key, Severity::L5);
    let ratio =
        if synthesis.coupling == Coupling::Photon { "r 2^EV".to_owned() } else { format!("r {:.0}", state.ratio) };
    format!("K {:.2}, {ratio}", state.system_gain)
}

/// Draws a frame at each level, in each variant.
fn draw_levels(frame: &mut FrameWork<'_>, light: &LightSettings) -> Result<Rgb> {
    let degradations: Vec<Degradation> = light.degradations().into_iter().flatten().collect();
    let mut blocks = Vec::new();
    for axis in Axis::ALL {
        let on_axis = degradations.iter().filter(|how| how.kind().axis() == axis);
        let mut by_variant: Vec<(Variant, Vec<&Degradation>)> = Vec::new();
        for how in on_axis {
            let variant = Variant::from(Some(how));
            match by_variant.iter_mut().find(|(other, _)| *other == variant) {
                Some((_, all)) => all.push(how),
                None => by_variant.push((variant, vec![how])),
            }
        }
        let Some((_, first)) = by_variant.first() else {
            continue;
        };
        let levels = first.iter().map(|how| AxisLevel::from(Some(*how))).collect();
        let rows = by_variant
            .into_iter()
            .map(|(variant, all)| {
                let images = all.into_iter().map(|how| {
                    let dark_ev = frame.apply(how)?.drop_ev();
                    let image = Rgb::clone(frame.degraded(Some(how))?);
                    Ok(LevelImage { image, dark_ev })
                });
                let name = match variant.kind {
                    Some(Kind::Exposure) => "EV".to_owned(),
                    _ => variant.kind_and_profile(),
                };
                let images = images.collect::<Result<_>>()?;
                Ok(LevelRow { name, images })
            })
            .collect::<Result<_>>()?;
        blocks.push(LevelBlock { levels, rows });
    }
    let footer = footer(light, frame.frame(), &degradations);
    Ok(sheet::levels(frame.clean()?, &blocks, &footer))
}

/// Draws the noise terms of a frame at the darkest requested level. The level matters if each level has its own
/// negative.
fn draw_terms(frame: &mut FrameWork<'_>, light: &LightSettings) -> Result<Rgb> {
    let mut levels = light.levels.iter().filter(|level| level.axis() == Some(Axis::LIGHT));
    let level = levels.next_back().and_then(|level| level.severity());
    let level = level.unwrap_or(Severity::L5);
    let sensor = &light.kinds.sensor;
    let synthesis = sensor.readings.only()?;
    let clean = frame.pixels()?.clone();
    let frame = NoiseKey::new(sensor.seed, frame.frame());
    let key = match synthesis.draws {
        Draws::Shared => frame,
        Draws::Fresh => frame.at(level),
    };
    let state = synthesis.state(&frame, level);
    let raw = unprocess_with_headroom(&clean, &state, synthesis.headroom_ev(level.value()));
    let range = state.adu_range as f32;
    let with_terms = |terms: &[Term]| {
        let mut noisy = raw.clone();
        noise::add(&mut noisy, &state, &key, synthesis.amplify, terms);
        adu(&noisy, range)
    };
    let clean = with_terms(&[]);
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
    let footer =
        format!("{}; {}: K {:.2}, r {:.0}", camera_and_seed(light), synthesis.name(), state.system_gain, state.ratio);
    Ok(sheet::noise(&signals, &footer))
}

fn signal(name: String, adu: ndarray::Array2<f32>) -> Signal {
    Signal { name, adu }
}

/// The samples of a RAW image in ADU.
fn adu(raw: &Bayer, range: f32) -> Array2<f32> {
    Array2::from_shape_fn((raw.height(), raw.width()), |(row, column)| raw.sample(row, column) * range)
}
