//! `figures`: draws the figures of runs for a paper, at the width of its columns.
//!
//! Column widths of papers: [`Width`].

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::{Args, ValueEnum};

use darkqa_base::error::{Error, Result};
use darkqa_base::files;
use darkqa_base::types::Decides;
use darkqa_base::types::manifests::Status;
use darkqa_base::types::text::escape_hidden;
use darkqa_pictures::{decode_data_url, png};
use darkqa_report::charts::figures::{
    DisplayNames, FIGURES, FigureSpec, KnownNames, figure_specs, missing_threshold_message, overview, paper_tables,
};
use darkqa_report::charts::paper::{
    FigureColours, Look, OverviewSheet, Sheet, overview_sheet, pdf, sheet, svg, tables, tex,
};
use darkqa_report::joined::FigureRuns;
use darkqa_report::text::table::Table;
use darkqa_runs::Outcome;

/// Name of the sheet with an overview of a run in four panels.
const PAPER: &str = "paper";

/// Name of the tables.
const TABLES: &str = "tables";

/// File name of the captions.
const CAPTIONS: &str = "captions.txt";

/// Maximum side of a thumbnail that is read, in pixels; chosen, and more than a run stores.
const MAX_SIDE: u32 = 2048;

/// Font sizes accepted by `--font-size`, in points; chosen.
const FONT_SIZES: std::ops::RangeInclusive<f64> = 4.0..=24.0;

/// The flags of `figures`.
#[derive(Debug, Args)]
pub(crate) struct FiguresArgs {
    /// The folders of the runs, or ZIP files of bundles; several runs are drawn together
    #[arg(value_name = "RUN", required = true, add = Decides::Nothing)]
    pub runs: Vec<PathBuf>,
    /// Where the figures and their captions go
    #[arg(long, value_name = "DIR", add = Decides::Nothing)]
    pub out: PathBuf,
    /// The forms of the figures
    #[arg(long, value_name = "FORMATS", value_enum, value_delimiter = ',', default_value = "pdf,svg", add = Decides::Nothing)]
    pub format: Vec<FigureFormat>,
    /// The columns of the paper: ieee, cvpr, acl, neurips, or the width of a figure in millimetres
    #[arg(long, value_name = "VENUE|MM", default_value = "ieee", add = Decides::Nothing)]
    pub width: Width,
    /// How many columns a figure is wide, 1 or 2; default: 1, and for the sheet `paper` the whole text
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=2), add = Decides::Nothing)]
    pub columns: Option<u8>,
    /// Another name for a model, an enhancer or a family of questions; repeatable;
    /// default: none
    #[arg(long, value_name = "OLD=NEW", value_parser = label, add = Decides::Nothing)]
    pub label: Vec<(String, String)>,
    /// The models and enhancers that come first, by their names in the runs, separated by commas; the others follow;
    /// default: none
    #[arg(long, value_name = "NAMES", value_delimiter = ',', add = Decides::Nothing)]
    pub order: Vec<String>,
    /// The colours of lines; grey is for papers that are printed without colour
    #[arg(long, value_enum, default_value = "colour", add = Decides::Nothing)]
    pub palette: FigureColours,
    /// Height of the letters in points, from 4 to 24; default: that of the captions of the venue
    #[arg(long, value_name = "PT", value_parser = font_size, add = Decides::Nothing)]
    pub font_size: Option<f64>,
    /// The figures to draw, separated by commas; default: all for which there are records
    #[arg(long, value_name = "FIGURES", value_delimiter = ',', add = Decides::Nothing)]
    pub only: Vec<String>,
    /// The model that is drawn black, as an upper reference; default: none
    #[arg(long, value_name = "MODEL", add = Decides::Nothing)]
    pub reference: Option<String>,
}

/// A form of figures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FigureFormat {
    /// Vectors with their font
    Pdf,
    /// Vectors for drawing programs and pages
    Svg,
    /// Source of charts of lines for pgfplots, with their data
    Tex,
}

fn label(text: &str) -> std::result::Result<(String, String), String> {
    match text.split_once('=') {
        Some((old, new)) if !old.is_empty() && !new.trim().is_empty() => Ok((old.to_owned(), new.trim().to_owned())),
        _ => Err("OLD=NEW expected: a name in the runs, and the one to show".to_owned()),
    }
}

fn font_size(text: &str) -> std::result::Result<f64, String> {
    text.parse()
        .ok()
        .filter(|size| FONT_SIZES.contains(size))
        .ok_or_else(|| format!("a size from {} to {} points expected", FONT_SIZES.start(), FONT_SIZES.end()))
}

/// Draws the figures of the runs, from the numbers of their report.
///
/// # Errors
/// If a run cannot be read or asked open questions, a name is unknown, or a file cannot be written.
pub(crate) fn figures(args: &FiguresArgs) -> Result<Outcome> {
    let look = Look {
        width: args.width.points(args.columns)?,
        font_size: args.font_size.unwrap_or_else(|| args.width.font_size()),
        palette: args.palette,
    };
    check_only(&args.only)?;
    let runs = FigureRuns::open(&args.runs)?;
    let all = runs.findings();
    let findings = all.shown();
    let names =
        DisplayNames::new(&args.label, &args.order, args.reference.as_ref(), &KnownNames::from_findings(findings))?;
    let mut output = String::new();
    for alert in runs.alerts(&all) {
        let _ = writeln!(output, "note: {}", alert.text);
    }
    let figure_specs = figure_specs(findings, &names);
    let mut files = Files::default();
    for name in wanted_names(&args.only) {
        if name == PAPER {
            let width = args.width.text();
            let look = Look { width, ..look };
            let sheet = overview_sheet(&overview(findings, &names), runs.thumbnails(), &look, &|url| {
                decode_data_url(url, MAX_SIDE)
            })?;
            files.add_overview(&sheet, &args.format, &look)?;
            continue;
        }
        if name == TABLES {
            files.add_tables(&paper_tables(findings, &names), args, &look);
            continue;
        }
        if let Some(drawing) = figure_specs.iter().find(|drawing| drawing.name == name) {
            files.add_drawing(drawing, &args.format, &look)?;
        } else {
            let reason = missing_threshold_message(findings, name);
            let reason = reason.as_deref();
            files.leave_out(name, reason.unwrap_or("the runs have no records for it"));
        }
    }
    let name_note = names.short_names_note();
    if !name_note.is_empty() {
        let _ = writeln!(files.captions, "{name_note}\n");
        let _ = writeln!(output, "note: {name_note}");
    }
    output += &files.write(&args.out)?;
    Ok(Outcome::wrote(&args.out, Status::Complete, output))
}

/// The names of all figures, in order.
fn all_names() -> impl Iterator<Item = &'static str> {
    std::iter::once(PAPER).chain(FIGURES).chain([TABLES])
}

fn check_only(only: &[String]) -> Result<()> {
    match only.iter().find(|name| all_names().all(|known| known != *name)) {
        Some(name) => {
            let all: Vec<&str> = all_names().collect();
            let problem = format!("there is no figure {name:?}; there are {}", all.join(", "));
            Err(Error::usage("--only", problem))
        }
        None => Ok(()),
    }
}

/// The names of the figures to draw, in order.
fn wanted_names(only: &[String]) -> impl Iterator<Item = &'static str> {
    all_names().filter(|name| only.is_empty() || only.iter().any(|wanted| wanted == name))
}

/// The same look with its width in TeX points.
fn in_tex(look: &Look) -> Look {
    let width = look.width * TEX;
    Look { width, ..*look }
}

/// The files of the figures. All are made before any is written.
#[derive(Default)]
struct Files {
    /// Content of each file, with its name.
    contents: Vec<(String, Vec<u8>)>,
    captions: String,
    left_out: String,
}

impl Files {
    fn add_drawing(&mut self, drawing: &FigureSpec, formats: &[FigureFormat], look: &Look) -> Result<()> {
        let name = drawing.name;
        self.add(name, &sheet(&drawing.chart, look), formats)?;
        if formats.contains(&FigureFormat::Tex) {
            if drawing.chart.is_over_levels() {
                self.contents.extend(tex(name, &drawing.chart, &in_tex(look)));
            } else {
                self.leave_out(&format!("{name}.tex"), "it is not a chart of lines");
            }
        }
        let _ = writeln!(self.captions, "{name}\n{} ({}.)\n", drawing.caption, drawing.chart.note);
        Ok(())
    }

    fn add_overview(&mut self, overview: &OverviewSheet, formats: &[FigureFormat], look: &Look) -> Result<()> {
        for (panel, why) in &overview.left_out {
            self.leave_out(&format!("{PAPER}, the panel {panel}"), why);
        }
        if overview.sheet.shapes.is_empty() {
            self.leave_out(PAPER, "it has no panel");
            return Ok(());
        }
        self.add(PAPER, &overview.sheet, formats)?;
        if formats.contains(&FigureFormat::Tex) {
            let width = in_tex(look).width / 2.0;
            for (letter, chart) in ('a'..).zip(&overview.charts) {
                let half = Look { width, ..*look };
                self.contents.extend(tex(&format!("{PAPER}-{letter}"), chart, &half));
            }
        }
        let _ = writeln!(self.captions, "{PAPER}\n{}\n", overview.caption);
        Ok(())
    }

    fn add_tables(&mut self, all: &[Table], args: &FiguresArgs, look: &Look) {
        if !args.format.contains(&FigureFormat::Tex) {
            // Mention missing tables only if figures were selected by name.
            if !args.only.is_empty() {
                self.leave_out(TABLES, "they are made with --format tex");
            }
            return;
        }
        if all.is_empty() {
            self.leave_out(TABLES, "no image was asked about");
            return;
        }
        let (files, long) = tables(all, &in_tex(look), args.columns == Some(2));
        self.contents.extend(files);
        if long > 0 {
            let why = format!("{long} of more than 40 rows are in tables-full.tex, for text in one column");
            self.leave_out("tables.tex", &why);
        }
    }

    /// Adds a sheet as PDF and SVG, if these formats are requested.
    fn add(&mut self, name: &str, sheet: &Sheet, formats: &[FigureFormat]) -> Result<()> {
        sheet.check_characters()?;
        if formats.contains(&FigureFormat::Pdf) {
            self.contents.push((format!("{name}.pdf"), pdf(sheet, name)?));
        }
        if formats.contains(&FigureFormat::Svg) {
            let file = (format!("{name}.svg"), svg(sheet, &png)?.into_bytes());
            self.contents.push(file);
        }
        Ok(())
    }

    fn leave_out(&mut self, name: &str, why: &str) {
        let _ = writeln!(self.left_out, "{name}: left out, {why}");
    }

    /// Writes the files; returns a line for each.
    fn write(self, out: &Path) -> Result<String> {
        let mut lines = String::new();
        for (name, content) in &self.contents {
            files::write(&out.join(name), content)?;
            let _ = writeln!(lines, "{}", out.join(name).display());
        }
        let captions = out.join(CAPTIONS);
        let text = self.captions + &self.left_out;
        files::write(&captions, escape_hidden(&text).as_bytes())?;
        let _ = writeln!(lines, "{}", captions.display());
        Ok(lines + &self.left_out)
    }
}

/// PDF points per millimetre (72 per inch).
const POINTS: f64 = 72.0 / 25.4;

/// TeX points (72.27 per inch) per PDF point.
const TEX: f64 = 72.27 / 72.0;

/// Accepted widths in millimetres; chosen.
const MILLIMETRES: std::ops::RangeInclusive<f64> = 40.0..=600.0;

/// Width of a figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Width {
    Venue(&'static Venue),
    /// A custom width, in PDF points.
    Custom(f64),
}

/// Layout of a venue's papers.
#[derive(Debug, PartialEq)]
pub(crate) struct Venue {
    name: &'static str,
    /// Width of a column, in TeX points.
    column: f64,
    /// Width of the text of two columns, in TeX points; `None` if the text has one column.
    text: Option<f64>,
    /// Font size of captions, in points.
    font_size: f64,
}

/// `\columnwidth` and `\textwidth` of the LaTeX classes and style files of these venues.
const VENUES: [Venue; 4] = [
    Venue { name: "ieee", column: 252.0, text: Some(516.0), font_size: 8.0 },
    Venue { name: "cvpr", column: 237.1, text: Some(496.9), font_size: 8.0 },
    Venue { name: "acl", column: 219.1, text: Some(455.2), font_size: 8.0 },
    Venue { name: "neurips", column: 397.5, text: None, font_size: 9.0 },
];

impl FromStr for Width {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        if let Some(venue) = VENUES.iter().find(|venue| venue.name == text) {
            return Ok(Self::Venue(venue));
        }
        match text.parse::<f64>() {
            Ok(millimetres) if MILLIMETRES.contains(&millimetres) => Ok(Self::Custom(millimetres * POINTS)),
            _ => Err(format!(
                "ieee, cvpr, acl, neurips, or a width from {} to {} in millimetres expected",
                MILLIMETRES.start(),
                MILLIMETRES.end()
            )),
        }
    }
}

impl Width {
    /// Width of a figure over `columns` columns (one by default), in PDF points.
    ///
    /// # Errors
    /// If the width is custom, or the paper has only one column.
    fn points(self, columns: Option<u8>) -> Result<f64> {
        let problem = match (self, columns) {
            (Self::Custom(_), Some(_)) => "a width in millimetres is that of the figure: leave it out",
            (Self::Custom(width), None) => return Ok(width),
            (Self::Venue(Venue { text: None, .. }), Some(2)) => "this paper has one column: leave it out",
            (Self::Venue(_), Some(2)) => return Ok(self.text()),
            (Self::Venue(venue), _) => return Ok(venue.column / TEX),
        };
        Err(Error::usage("--columns", problem))
    }

    /// Width of the text, in PDF points.
    fn text(self) -> f64 {
        match self {
            Self::Venue(venue) => venue.text.unwrap_or(venue.column) / TEX,
            Self::Custom(width) => width,
        }
    }

    /// Font size, in points.
    fn font_size(self) -> f64 {
        match self {
            Self::Venue(venue) => venue.font_size,
            Self::Custom(_) => 8.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tex_points(text: &str, columns: Option<u8>) -> f64 {
        points(text, columns).unwrap() * 72.27 / 72.0
    }

    fn points(text: &str, columns: Option<u8>) -> Result<f64> {
        text.parse::<Width>().unwrap().points(columns)
    }

    #[test]
    fn widths_are_those_of_columns_or_millimetres() {
        assert!((tex_points("ieee", None) - 252.0).abs() < 1e-9);
        assert!((tex_points("ieee", Some(2)) - 516.0).abs() < 1e-9);
        assert!((tex_points("neurips", Some(1)) - 397.5).abs() < 1e-9);
        assert!(points("neurips", Some(2)).is_err() && points("85", Some(1)).is_err());
        assert!((points("254", None).unwrap() - 720.0).abs() < 1e-9);
        for wrong in ["", "nature", "-3", "39", "601", "nan", "inf"] {
            assert!(wrong.parse::<Width>().is_err(), "{wrong}");
        }
    }
}
