//! Report of a measured camera: [`table`], [`json`] and [`figure()`].

mod figure;

pub(crate) use figure::figure;

use crate::calibrate::{CameraFit, Measured, NoiseLine, SettingFit, SlopeSource};
use crate::error::{Error, Result};
use crate::text::table::ColumnKind::Text;
use crate::text::table::TableBuilder;
use crate::text::terminal;
use crate::text::words::counted;

/// The numbers of a camera as JSON.
///
/// # Errors
/// If a number cannot be written.
pub(crate) fn json(camera: &CameraFit) -> Result<String> {
    let mut value = serde_json::to_value(camera).map_err(|e| Error::data("summary", e))?;
    value["adu_range"] = camera.adu_range().into();
    for (setting, fit) in (0..).zip(&camera.settings) {
        let bias = serde_json::to_value(camera.bias(fit));
        let setting: usize = setting;
        value["settings"][setting]["bias"] = bias.map_err(|e| Error::data("summary", e))?;
    }
    Ok(format!("{value:#}\n"))
}

/// The table of a camera: a row a setting, below it the two lines, and everything that is doubtful.
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
    let planes = format!("terminal bias {} ADU", camera.cfa.plane_names().join(" / "));
    let layout = TableBuilder::new("calibration", &camera.settings)
        .column(Text, "terminal", |fit| fit.name.clone())
        .column(Text, "terminal K ADU/e", |fit| text(fit.gain, 4))
        .column(Text, "terminal σ_TL ADU", |fit| text(fit.read_scale, 4))
        .column(Text, "terminal λ", |fit| text(fit.read_shape, 4))
        .column(Text, "terminal λ by PPCC", |fit| number(fit.plot.shape, 4))
        .column(Text, "terminal σ_row ADU", |fit| {
            text(fit.row_deviation, 4)
        })
        .column(Text, &*planes, |fit| bias(camera, fit));
    let table = terminal::table(&[layout.build()]);
    let lines = [
        line("σ_TL", &camera.read_scale),
        line("σ_row", &camera.row_deviation),
    ];
    let checks = if camera.warnings.is_empty() {
        "checks: nothing to report\n".to_owned()
    } else {
        let warnings = camera
            .warnings
            .iter()
            .map(|warning| format!("  {warning}\n"));
        format!("checks:\n{}", warnings.collect::<String>())
    };
    let one_pair = camera
        .settings
        .iter()
        .any(|fit| fit.gain.error.is_none() || fit.read_scale.error.is_none());
    let no_error = if one_pair {
        "no ±: a standard error needs 2 pairs of frames or more (10 bias frames are recommended)\n"
    } else {
        ""
    };
    format!("{title}\n{table}{}{no_error}{checks}", lines.concat())
}

/// Offsets of the planes with the largest standard error of them.
fn bias(camera: &CameraFit, fit: &SettingFit) -> String {
    let bias = camera.bias(fit);
    let values = bias
        .iter()
        .map(|bias| number(bias.value, 3))
        .collect::<Vec<_>>()
        .join(" / ");
    let errors = bias.iter().filter_map(|bias| bias.error);
    match errors.reduce(f64::max) {
        Some(error) => format!("{values} ± {error:.3}"),
        None => values,
    }
}

fn number(value: f64, digits: usize) -> String {
    format!("{value:.digits$}").replace('-', "−")
}

/// A number with its standard error.
fn text(number: Measured, digits: usize) -> String {
    let value = self::number(number.value, digits);
    match number.error {
        Some(error) => format!("{value} ± {error:.digits$}"),
        None => value,
    }
}

/// A line over K in words.
fn line(name: &str, line: &NoiseLine) -> String {
    let formula = format!(
        "ln {name} = {} ln K {} {:.4}",
        number(line.slope, 4),
        if line.intercept < 0.0 { '−' } else { '+' },
        line.intercept.abs()
    );
    let source = match line.slope_from {
        SlopeSource::Settings => String::new(),
        SlopeSource::Preset => {
            "; fewer than 3 settings count: the slope is that of sony-a7s2".to_owned()
        }
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
