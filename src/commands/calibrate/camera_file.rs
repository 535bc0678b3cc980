//! TOML file of a measured camera, for `--noise camera`: [`camera_file`].

use std::fmt::Write as _;

use super::{CameraFit, Measured, NoiseLine, SettingFit, SlopeSource};
use crate::error::{Error, Result};
use darkqa_light::Calibration;

/// Writes the file of a camera. Comments state the source of the numbers, their standard errors and all warnings.
///
/// # Errors
/// If a number is outside the valid range of a camera file.
pub(crate) fn camera_file(camera: &CameraFit) -> Result<String> {
    let mut text = head(camera);
    let gains: Vec<String> = camera.settings.iter().map(|fit| number(fit.gain.value)).collect();
    let [low, high] = [gains.first(), gains.last()].map(|gain| gain.map_or("", String::as_str));
    let _ = writeln!(text, "name = {}\nadu-range = {:.1}", toml::Value::from(&*camera.name), camera.adu_range());
    let _ = writeln!(text, "# The least and the greatest K that was measured.\ngain = [{low}, {high}]");
    text +=
        "# Of the DarkQA paper, for every camera: a recording of a sensor says nothing of r.\nratio = [100.0, 300.0]\n";
    let settings = camera.settings.len();
    line(&mut text, "read-scale", &camera.read_scale, settings);
    line(&mut text, "row-deviation", &camera.row_deviation, settings);
    for fit in &camera.settings {
        step(&mut text, camera, fit);
    }
    // Check that --noise camera accepts the file.
    Calibration::parse(&text, "the measured camera").map_err(|e| {
        let problem = format!("{e}; leave out the setting, or see its frames");
        Error::data(&camera.name, problem)
    })?;
    Ok(text)
}

/// Writes the comments before the first key.
fn head(camera: &CameraFit) -> String {
    let version = env!("CARGO_PKG_VERSION");
    let mut text = format!("# Measured by darkqa-eval {version} calibrate");
    let _ = match &camera.camera {
        Some(name) => writeln!(text, ", from frames of {}.", one_line(name)),
        None => writeln!(text, "."),
    };
    let [width, height] = camera.size;
    let _ = writeln!(
        text,
        "# {} frames of {width} × {height} sites, filters {}, black {}, white {}; BLAKE3 of the list of frames:\n# {}",
        camera.frames, camera.cfa, camera.black, camera.white, camera.frames_digest
    );
    if let Some([first, last]) = &camera.dates {
        let _ = writeln!(text, "# Taken from {} to {}.", one_line(first), one_line(last));
    }
    text += "# ± is a standard error by bootstrap over frame pairs.\n";
    for warning in &camera.warnings {
        let _ = writeln!(text, "# Warning: {}", one_line(warning));
    }
    text
}

/// Writes the table of a line, with its source and uncertainty as comments. `total` is the number of settings of the
/// camera.
fn line(text: &mut String, key: &str, line: &NoiseLine, total: usize) {
    let through = match line.settings {
        1 => "1 setting".to_owned(),
        n => format!("the mean of {n} settings"),
    };
    let source = match line.slope_from {
        SlopeSource::Settings => format!("# Fitted to {} settings.\n", line.settings),
        SlopeSource::Preset => format!(
            "# The slope is that of the preset sony-a7s2, because a slope needs 3 settings; the line passes through {through}.\n"
        ),
        SlopeSource::NoNoise => "# No setting has noise of this kind.\n".to_owned(),
    };
    let left_out = match total - line.settings {
        0 => "",
        _ if line.settings == 0 => "",
        1 => "# 1 setting without visible noise is left out; the line holds for it, too.\n",
        n => &format!("# {n} settings without visible noise are left out; the line holds for them, too.\n"),
    };
    let error = match (line.deviation_error(), line.slope_from) {
        (Some(error), _) => format!("# The deviation is known to ± {:.0} % of itself.\n", 100.0 * error),
        (None, SlopeSource::Preset) => "# A single setting has no deviation.\n".to_owned(),
        (None, SlopeSource::Settings | SlopeSource::NoNoise) => String::new(),
    };
    let _ = writeln!(
        text,
        "\n[{key}]\n{source}{left_out}slope = {}\nintercept = {}\n{error}deviation = {}",
        number(line.slope),
        number(line.intercept),
        number(line.deviation)
    );
}

/// Writes the table of a setting.
fn step(text: &mut String, camera: &CameraFit, fit: &SettingFit) {
    let _ = writeln!(
        text,
        "\n[[step]]\n# {}: {} bias frames, {} pairs of flats at {} exposures; K {}, σ_TL {} ADU, λ {} ({:.4} by the probability plot), σ_r {} ADU",
        one_line(&fit.name),
        fit.frames.bias,
        fit.frames.flat_pairs,
        fit.frames.exposures,
        with_error(fit.gain),
        with_error(fit.read_scale),
        with_error(fit.read_shape),
        fit.plot.shape,
        with_error(fit.row_deviation)
    );
    let bias = camera.bias(fit);
    // The order of planes is R, G1, G2, B; the order in a camera file is R, G1, B, G2.
    let [r, g1, b, g2] = [0, 1, 3, 2].map(|plane| {
        let bias = bias.get(plane).or(bias.first());
        number(bias.map_or(0.0, |bias| bias.value))
    });
    let _ = writeln!(
        text,
        "gain = {}\nshape = [{}]\nbias = [[{r}, {g1}, {b}, {g2}]]",
        number(fit.gain.value),
        number(fit.read_shape.value)
    );
}

/// Formats a number with its standard error.
fn with_error(number: Measured) -> String {
    match number.error {
        Some(error) => format!("{:.4} ± {error:.4}", number.value),
        None => format!("{:.4}", number.value),
    }
}

/// Formats a number with six significant digits as a TOML float.
fn number(value: f64) -> String {
    if value == 0.0 {
        return "0.0".to_owned();
    }
    let magnitude = libm::log10(value.abs()).floor() as i32;
    let decimals = (5 - magnitude).clamp(1, 12) as usize;
    format!("{value:.decimals$}")
}

/// Replaces line breaks and other control characters by spaces, for a comment.
fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

#[cfg(test)]
mod tests;
