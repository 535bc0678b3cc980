//! The figures of `synthesize --sheet`. Their images are computed here and drawn by [`crate::report::sheet`].

use ndarray::Array2;

use crate::error::Result;
use crate::report::sheet::{self, LevelColumn, Signal};
use crate::synthesis::LightSettings;
use crate::synthesis::bayer::Bayer;
use crate::synthesis::noise::{self, Term};
use crate::synthesis::unprocess::unprocess;
use crate::synthesis::{Draws, NoiseKey, expose, ladder};
use crate::types::{AxisLevel, FrameId, Rgb, Severity};

fn severities(light: &LightSettings) -> Vec<Severity> {
    let levels = light.levels.iter();
    levels.filter_map(|level| level.severity()).collect()
}

/// The figure of a frame at each level, by exposure alone and with noise.
pub(super) fn levels(clean: &Rgb, frame: &FrameId, light: &LightSettings) -> Result<Rgb> {
    let severities = severities(light);
    let key = NoiseKey::new(light.sensor.seed, frame);
    let mut noisy: Vec<Rgb> = severities
        .iter()
        .map(|_| Rgb::black(clean.height(), clean.width()))
        .collect();
    let synthesis = light.sensor.readings.only()?;
    ladder(clean, &key, synthesis, &severities, &mut noisy);
    let levels = light.levels.iter().filter(|level| **level != AxisLevel::L0);
    let columns = levels.zip(severities).zip(noisy);
    let columns: Vec<LevelColumn> = columns
        .map(|((level, severity), noise)| LevelColumn {
            level: *level,
            exposure: expose(clean, severity),
            noise,
        })
        .collect();
    Ok(sheet::levels(clean, &columns))
}

/// The figure of the noise terms of a frame, at the darkest level asked for. The level matters if each has its own negative.
pub(super) fn terms(clean: &Rgb, frame: &FrameId, light: &LightSettings) -> Result<Rgb> {
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
    let name = format!(
        "noisy RAW (K {:.2}, r {:.0})",
        state.system_gain, state.ratio
    );
    signals.push(signal(name, with_terms(&Term::ALL)));
    Ok(sheet::noise(&signals))
}

fn adu(raw: &Bayer, range: f32) -> Array2<f32> {
    Array2::from_shape_fn((raw.height(), raw.width()), |(row, column)| {
        raw.sample(row, column) * range
    })
}
