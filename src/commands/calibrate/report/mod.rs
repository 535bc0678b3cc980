//! Reports of a camera calibration: [`table`], [`json`] and [`figure()`].

mod figure;

pub(crate) use figure::figure;

use crate::commands::calibrate::{CameraFit, Measured, NoiseLine, SettingFit, SlopeSource};
use crate::error::{Error, Result};
use crate::report::text::table::ColumnKind::Text;
use crate::report::text::table::TableBuilder;
use crate::report::text::terminal;
use crate::types::text::counted;

/// The calibration of a camera as JSON, with the ADU range and the bias of each setting.
///
/// # Errors
/// If the calibration cannot be serialized.
pub(crate) fn json(camera: &CameraFit) -> Result<String> {
    let mut value = serde_json::to_value(camera).map_err(|e| Error::data("summary", e))?;
    value["adu_range"] = camera.adu_range().into();
    for (index, fit) in camera.settings.iter().enumerate() {
        let bias = serde_json::to_value(camera.bias(fit));
        value["settings"][index]["bias"] = bias.map_err(|e| Error::data("summary", e))?;
    }
    Ok(format!("{value:#}\n"))
}

/// The calibration of a camera as text: a table with one row per setting, the two fitted noise lines, and the warnings.
#[must_use]
pub(crate) fn table(camera: &CameraFit) -> String {
    let title = format!(
        "{}: {} of {} × {} sites, black {}, white {}; ± standard error by bootstrap over frame pairs",
        camera.name,
        counted(camera.frames, "frame"),
        camera.size[0],
        camera.size[1],
        camera.black,
        camera.white
    );
    let bias_head = format!("terminal bias {} ADU", camera.cfa.plane_names().join(" / "));
    let settings = TableBuilder::new("calibration", &camera.settings)
        .column(Text, "terminal", |fit| fit.name.clone())
        .column(Text, "terminal K ADU/e", |fit| with_error(fit.gain, 4))
        .column(Text, "terminal σ_TL ADU", |fit| with_error(fit.read_scale, 4))
        .column(Text, "terminal λ", |fit| with_error(fit.read_shape, 4))
        .column(Text, "terminal λ by PPCC", |fit| decimal(fit.plot.shape, 4))
        .column(Text, "terminal σ_row ADU", |fit| with_error(fit.row_deviation, 4))
        .column(Text, &*bias_head, |fit| bias_cell(camera, fit))
        .build();
    let table = terminal::table(&[settings]);
    let noise_lines = [noise_line("σ_TL", &camera.read_scale), noise_line("σ_row", &camera.row_deviation)];
    let checks = if camera.warnings.is_empty() {
        "checks: nothing to report\n".to_owned()
    } else {
        let warnings: String = camera.warnings.iter().map(|warning| format!("  {warning}\n")).collect();
        format!("checks:\n{warnings}")
    };
    let lacks_error = camera.settings.iter().any(|fit| fit.gain.error.is_none() || fit.read_scale.error.is_none());
    let error_note = if lacks_error {
        "no ±: a standard error needs 2 pairs of frames or more (10 bias frames are recommended)\n"
    } else {
        ""
    };
    format!("{title}\n{table}{}{error_note}{checks}", noise_lines.concat())
}

/// Bias of each colour plane, with the largest standard error of the planes.
fn bias_cell(camera: &CameraFit, fit: &SettingFit) -> String {
    let planes = camera.bias(fit);
    let values = planes.iter().map(|bias| decimal(bias.value, 3)).collect::<Vec<_>>().join(" / ");
    let largest_error = planes.iter().filter_map(|bias| bias.error).reduce(f64::max);
    match largest_error {
        Some(error) => format!("{values} ± {error:.3}"),
        None => values,
    }
}

/// Number with `digits` decimals and the minus sign U+2212.
fn decimal(value: f64, digits: usize) -> String {
    format!("{value:.digits$}").replace('-', "−")
}

/// A measured value ± its standard error, if known.
fn with_error(measured: Measured, digits: usize) -> String {
    let value = decimal(measured.value, digits);
    match measured.error {
        Some(error) => format!("{value} ± {error:.digits$}"),
        None => value,
    }
}

/// Equation of a fitted noise line, ln σ over ln K, with the deviation about it and the source of its slope.
fn noise_line(name: &str, line: &NoiseLine) -> String {
    let formula = format!(
        "ln {name} = {} ln K {} {:.4}",
        decimal(line.slope, 4),
        if line.intercept < 0.0 { '−' } else { '+' },
        line.intercept.abs()
    );
    let source = match line.slope_from {
        SlopeSource::Settings => String::new(),
        SlopeSource::Preset => "; fewer than 3 settings count: the slope is that of sony-a7s2".to_owned(),
        SlopeSource::NoNoise => return format!("{name}: no setting has any\n"),
    };
    let deviation = match line.deviation_error() {
        Some(error) => format!(
            ", deviation {:.4} (known to ± {:.0} % of itself: {})",
            line.deviation,
            100.0 * error,
            counted(line.settings, "setting")
        ),
        None => ", no deviation from 1 setting".to_owned(),
    };
    format!("{formula}{deviation}{source}\n")
}
