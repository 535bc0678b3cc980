//! `calibrate`: measures a camera from frames of its sensor, and writes a file for `--noise camera`.
//!
//! TOML file of a measured camera, for `--noise camera`: [`camera_file`].
//!
//! Reports of a camera calibration: [`calibration_table`], [`calibration_json`] and `figure()`.
//!
//! Figure of a camera calibration, as SVG: [`calibration_figure`].

#[cfg(test)]
mod tests;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;

use super::{Measured, NoiseLine, SettingFit, SlopeSource};
use crate::commands::calibrate::{
    CalibrateSettings, CameraFit, Cfa, Crop, ReadOptions, Recording, calibrate as measure,
};
use darkqa_base::error::{Error, Result};
use darkqa_base::files::write;
use darkqa_base::types::Decides;
use darkqa_base::types::manifests::Status;
use darkqa_base::types::text::counted;
use darkqa_data::PixelLimit;
use darkqa_engine::images::progress::Progress;
use darkqa_engine::images::workers::{ThreadArgs, pool};
use darkqa_light::Calibration;
use darkqa_report::charts::chart::{LineContent, LineStyle, Panel, PlotLine, Scale};
use darkqa_report::charts::paper::point_figure;
use darkqa_report::text::table::ColumnKind::Text;
use darkqa_report::text::table::TableBuilder;
use darkqa_report::text::terminal;
use darkqa_runs::Outcome;

/// The flags of `calibrate`.
#[derive(Debug, Args)]
pub(crate) struct CalibrateArgs {
    /// The recording: DIR/SETTING/ for each ISO or gain, in it bias/, flat-NAME/ for each exposure (pairs of evenly lit
    /// frames), and if you have them dark-NAME/ and white/; or DIR/frames.csv with the columns file, setting, kind
    /// (bias, flat, dark, white), exposure
    ///
    /// Frames are mosaics of one channel as 16-bit PNG, TIFF or binary PGM, as `dcraw -D -4 -T -t 0` (`-t 0`: not
    /// turned) and rawpy's raw_image_visible give them. RAW files of makers (DNG, CR2, NEF) are not read.
    #[arg(value_name = "DIR", add = Decides::Pixels)]
    pub recording: PathBuf,
    /// The camera file to write, for --noise camera, with the ending .toml; its figure goes beside it, with the ending
    /// .svg
    #[arg(long, value_name = "FILE", add = Decides::Nothing)]
    pub out: PathBuf,
    /// The colour filters of the upper left corner of the frames, row by row; mono for none
    #[arg(long, value_enum, default_value_t, add = Decides::Pixels)]
    pub cfa: Cfa,
    /// The black level in ADU; default: the whole number nearest to the mean of all bias frames
    #[arg(long, value_name = "CODE", add = Decides::Pixels)]
    pub black: Option<u16>,
    /// The code of white; default: the greatest code of the frames in white/
    #[arg(long, value_name = "CODE", add = Decides::Pixels)]
    pub white: Option<u16>,
    /// Use only this part of each frame, in sites: to leave out a masked border; default: all of it
    #[arg(long, value_name = "X,Y,WIDTH,HEIGHT", add = Decides::Pixels)]
    pub crop: Option<Crop>,
    /// The name of the camera; default: the name of DIR
    #[arg(long, value_name = "NAME", add = Decides::Pixels)]
    pub name: Option<String>,
    /// Print the numbers as JSON instead of a table
    #[arg(long, help_heading = "Output", add = Decides::Nothing)]
    pub json: bool,
    /// The maximum size of a frame.
    #[command(flatten)]
    pub limit: PixelLimit,
    /// The number of threads.
    #[command(flatten)]
    pub threads: ThreadArgs,
}

/// Measures a camera and writes its file and figure.
///
/// # Errors
/// If a frame cannot be used, the recording is unsuitable, or a file cannot be written.
pub(crate) fn calibrate(args: &CalibrateArgs, progress: &Progress) -> Result<Outcome> {
    if args.out.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("toml")) {
        let problem = format!(
            "{} does not end in .toml, by which --noise camera recognises a camera file; its figure gets the ending .svg",
            args.out.display()
        );
        return Err(Error::usage("--out", problem));
    }
    let figure = args.out.with_extension("svg");
    let recording = Recording::open(&args.recording)?;
    let settings = settings(args)?;
    let workers = pool(args.threads.threads)?;
    let bar = progress.bar("settings", recording.settings());
    let camera = workers.install(|| measure(&args.recording, &recording, &settings, || bar.inc()))?;
    drop(bar);
    write(&args.out, camera_file(&camera)?.as_bytes())?;
    write(&figure, calibration_figure(&camera)?.as_bytes())?;
    Ok(Outcome::wrote(&args.out, Status::Complete, output(args, &camera, &figure)?))
}

fn settings(args: &CalibrateArgs) -> Result<CalibrateSettings> {
    let name = match &args.name {
        Some(name) => name.clone(),
        None => folder_name(&args.recording)?,
    };
    Ok(CalibrateSettings {
        read: ReadOptions { cfa: args.cfa, crop: args.crop, most_pixels: args.limit.max_pixels.get() },
        black: args.black,
        white: args.white,
        name,
    })
}

/// The name of a folder, also for `.`.
fn folder_name(folder: &Path) -> Result<String> {
    let whole = folder.canonicalize().map_err(|e| Error::file(folder, "read", e))?;
    let name = whole.file_name().unwrap_or_default();
    Ok(name.to_string_lossy().into_owned())
}

/// The text for standard output.
fn output(args: &CalibrateArgs, camera: &CameraFit, figure: &Path) -> Result<String> {
    if args.json {
        for warning in &camera.warnings {
            tracing::warn!("{warning}");
        }
        return calibration_json(camera);
    }
    Ok(format!(
        "{}{}: the camera, for --noise camera; {}: its fits\n",
        calibration_table(camera),
        args.out.display(),
        figure.display()
    ))
}

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

/// The calibration of a camera as JSON, with the ADU range and the bias of each setting.
///
/// # Errors
/// If the calibration cannot be serialized.
fn calibration_json(camera: &CameraFit) -> Result<String> {
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
fn calibration_table(camera: &CameraFit) -> String {
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
        .column(Text, "terminal K ADU/e", |fit| text_with_error(fit.gain, 4))
        .column(Text, "terminal σ_TL ADU", |fit| text_with_error(fit.read_scale, 4))
        .column(Text, "terminal λ", |fit| text_with_error(fit.read_shape, 4))
        .column(Text, "terminal λ by PPCC", |fit| decimal(fit.plot.shape, 4))
        .column(Text, "terminal σ_row ADU", |fit| text_with_error(fit.row_deviation, 4))
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
fn text_with_error(measured: Measured, digits: usize) -> String {
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

/// Draws three panels: photon transfer, probability plots of the read noise, and the deviations of read and row noise
/// over the gain K.
///
/// # Errors
/// If the figure cannot be drawn.
fn calibration_figure(camera: &CameraFit) -> Result<String> {
    point_figure(vec![transfer(camera), probability(camera), deviations(camera)])
}

/// Panel of numbers on two axes.
fn number_panel(title: &str, [x, y]: [&'static str; 2], lines: Vec<PlotLine>) -> Panel {
    Panel { title: title.to_owned(), x: Scale::Numbers(x), y: Scale::Numbers(y), lines, model: None }
}

/// A fitted line and the points it is fitted to.
fn fit_lines(name: &str, style: LineStyle, line: Vec<[f64; 2]>, points: Vec<[f64; 2]>) -> [PlotLine; 2] {
    [LineContent::Path(line), LineContent::points(points)].map(|content| PlotLine::new(name.to_owned(), style, content))
}

/// The lines of each camera setting.
fn setting_lines(camera: &CameraFit, lines: impl Fn(&SettingFit, LineStyle) -> [PlotLine; 2]) -> Vec<PlotLine> {
    camera.settings.iter().enumerate().flat_map(|(style, fit)| lines(fit, LineStyle(style))).collect()
}

/// Panel of variance over signal for each exposure and colour plane on logarithmic axes, with the fitted line of K.
fn transfer(camera: &CameraFit) -> Panel {
    let lines = setting_lines(camera, |fit, style| {
        let points: Vec<[f64; 2]> = fit
            .figure
            .transfer
            .iter()
            .filter(|[signal, variance]| *signal > 0.0 && *variance > 0.0)
            .map(|point| point.map(libm::log10))
            .collect();
        let signals = points.iter().map(|[signal, _]| *signal);
        let ends = [signals.clone().reduce(f64::min), signals.reduce(f64::max)];
        let line = ends.into_iter().flatten().map(|signal| [signal, signal + libm::log10(fit.gain.value)]).collect();
        fit_lines(&format!("{}: K {:.4}", fit.name, fit.gain.value), style, line, points)
    });
    number_panel("photon transfer", ["log10 of light in ADU", "log10 of variance in ADU²"], lines)
}

/// Panel of scaled residuals over the quantiles of the fitted distribution; the points are on a straight line if the
/// fit is good.
fn probability(camera: &CameraFit) -> Panel {
    let lines = setting_lines(camera, |fit, style| {
        let points = &fit.figure.plot;
        let ends = [points.first(), points.last()].into_iter().flatten();
        let name = format!("{}: λ {:.4}", fit.name, fit.read_shape.value);
        fit_lines(&name, style, ends.map(|end| [end[0]; 2]).collect(), points.clone())
    });
    number_panel("read noise", ["quantile of the Tukey-λ distribution", "residual / σ_TL"], lines)
}

/// Panel of ln σ over ln K for read and row noise, with their fitted lines.
fn deviations(camera: &CameraFit) -> Panel {
    let read = deviation_points(camera, |fit| fit.read_scale.value, &camera.read_scale);
    let row = deviation_points(camera, |fit| fit.row_deviation.value, &camera.row_deviation);
    let names = ["σ_TL", "σ_row"].into_iter().zip([read, row]).enumerate();
    let lines = names.flat_map(|(style, (name, [line, points]))| fit_lines(name, LineStyle(style), line, points));
    number_panel("noise over gain", ["ln K", "ln σ"], lines.collect())
}

/// Fitted line and points of ln σ over ln K. Settings without noise are left out.
fn deviation_points(camera: &CameraFit, sigma: fn(&SettingFit) -> f64, line: &NoiseLine) -> [Vec<[f64; 2]>; 2] {
    let points: Vec<[f64; 2]> = camera
        .settings
        .iter()
        .map(|fit| [fit.gain.value, sigma(fit)])
        .filter(|[_, sigma]| *sigma > 0.0)
        .map(|point| point.map(libm::log))
        .collect();
    [points.iter().map(|[x, _]| [*x, libm::log(line.at(libm::exp(*x)))]).collect(), points]
}
