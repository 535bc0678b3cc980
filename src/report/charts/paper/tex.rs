//! Writer of a line chart as pgfplots source, set in the font of the paper, with its data in separate files: [`tex`].

use std::fmt::Write;

use super::figure::fitting_columns;
use super::font::Font;
use super::legend::Legend;
use super::look::Look;
use super::panel::MAX_BANDS;
use super::sheet::{Colour, Stroke};
use crate::charts::chart::{Chart, LineContent, Panel, PlotLine};
use crate::text::latex::escape;
use darkqa_base::types::text::escape_hidden;

/// Space left of the first axes in a row, in em.
const FIRST: f64 = 4.6;
/// Space between two axes in em.
const BETWEEN: f64 = 2.6;
/// Space right of the last axes in a row, in em.
const LAST: f64 = 1.0;

/// Width of a line sample in the legend, in points.
const SAMPLE: f64 = 43.0;
/// Maximum width of a text in the font of a paper, relative to Arial.
const WIDER: f64 = 1.08;
/// Writes a chart over levels as files by name: its source, and the data of each panel.
pub fn tex(name: &str, chart: &Chart, look: &Look) -> Vec<(String, Vec<u8>)> {
    let columns = fitting_columns(chart, look);
    let rows = chart.panels.len().div_ceil(columns);
    // Space for tick labels, and in the first column for the axis title.
    let between = (10.0 * BETWEEN * look.font_size).floor() / 10.0;
    let margins = (FIRST + LAST) * look.font_size + between * (columns - 1) as f64;
    // Rounded down to the one decimal that is written, so that the figure never gets too wide.
    let width = (10.0 * (look.width - margins) / columns as f64).floor() / 10.0;
    let legend = Legend::for_chart(chart, look);
    let mut text = format!(
        "% Made by darkqa-eval. In the preamble: \\usepackage{{pgfplots}}\n\
         % \\usepgfplotslibrary{{groupplots,fillbetween}} \\pgfplotsset{{compat=1.17}}\n\
         % If the data are in another folder than the paper: \\newcommand{{\\darkqadata}}{{FOLDER}} before \\input.\n\
         \\providecommand{{\\darkqadata}}{{.}}\n\
         \\begin{{tikzpicture}}\n\
         \\begin{{groupplot}}[\n  group style={{group size={columns} by {rows}, horizontal sep={:.1}pt, vertical sep={:.1}pt}},\n  \
         scale only axis, width={width:.1}pt, height={:.1}pt, ymin=0, ymax=100, ytick distance=20,\n  \
         axis lines*=left, ymajorgrids, grid style={{black!15}}, tick align=outside,\n  \
         tick label style={{font=\\scriptsize}}, ylabel style={{font=\\footnotesize}},\n  \
         xlabel style={{font=\\footnotesize, text width={width:.1}pt, align=center}}, title style={{font=\\footnotesize, text width={width:.1}pt, align=center}},\n  \
         legend style={{font=\\footnotesize, draw=none}}, legend columns={}, legend cell align=left]\n",
        between,
        row_spacing(chart, look, width),
        0.68 * width,
        legend_columns(chart, look),
    );
    let mut files = Vec::new();
    let mut named: Vec<&str> = Vec::new();
    for (index, panel) in chart.panels.iter().enumerate() {
        let data = format!("{name}-{}.dat", index + 1);
        let is_first = index % columns == 0;
        let measure = if is_first { panel.y.title(panel) } else { String::new() };
        text += &axes_options(panel, &measure);
        if index == 0 {
            let _ = write!(text, ", legend to name={{darkqa-{name}}}");
        }
        text += "]\n";
        let curves = panel.lines.iter().filter(|line| line.is_curve());
        let source = PanelSource { look, legend: &legend, data: &data, has_bands: curves.count() <= MAX_BANDS };
        for (index, line) in panel.lines.iter().enumerate() {
            if line.is_empty() {
                continue;
            }
            text += &source.plot(line, index + 1);
            // All panels share one legend, with one entry for each name.
            if !named.contains(&&*line.name) {
                named.push(&line.name);
                let max_width = (look.width - SAMPLE) / WIDER;
                let entry = Font::bundled().shortened(&line.name, look.font_size, max_width);
                let _ = writeln!(text, "\\addlegendentry{{{}}}", escape(&entry));
            }
        }
        files.push((data, data_file(panel).into_bytes()));
    }
    let _ = write!(text, "\\end{{groupplot}}\n\\end{{tikzpicture}}\n\n\\pgfplotslegendfromname{{darkqa-{name}}}\n");
    files.insert(0, (format!("{name}.tex"), text.into_bytes()));
    files
}

/// Space between two rows of axes in points: tick labels, axis title, and the lines of the longest panel title.
fn row_spacing(chart: &Chart, look: &Look, width: f64) -> f64 {
    let font = Font::bundled();
    let lines =
        chart.panels.iter().map(|panel| font.wrapped(&panel.title, look.font_size, width).len()).max().unwrap_or(1);
    (6.3 + 1.25 * lines as f64) * look.font_size
}

/// Number of legend columns that fit the longest name.
fn legend_columns(chart: &Chart, look: &Look) -> usize {
    let widest = chart
        .panels
        .iter()
        .flat_map(|panel| &panel.lines)
        .map(|line| Font::bundled().width(&line.name, look.font_size))
        .fold(0.0, f64::max)
        * WIDER
        + SAMPLE;
    (look.width / widest).max(1.0) as usize
}

/// Start of a panel: its options without the closing bracket.
fn axes_options(panel: &Panel, measure: &str) -> String {
    let levels = panel.levels();
    let ticks: Vec<String> = levels.iter().map(|level| level.value().to_string()).collect();
    let labels: Vec<String> = levels.iter().map(|level| format!("{{{level}\\\\{}}}", level.value())).collect();
    format!(
        "\\nextgroupplot[title={{{}}}, xlabel={{{}}}, ylabel={{{}}}, xmin={}, xmax={},\n  xtick={{{}}}, xticklabels={{{}}}, \
         xticklabel style={{align=center}}",
        escape(&panel.title),
        escape(&panel.axis_title()),
        escape(measure),
        -0.035 * panel.axis_end(),
        1.035 * panel.axis_end(),
        ticks.join(","),
        labels.join(",")
    )
}

fn rgb([red, green, blue]: Colour) -> String {
    format!("{{rgb,255:red,{red};green,{green};blue,{blue}}}")
}

/// Options of a stroke: colour, width and dashes.
fn stroke_options(stroke: &Stroke) -> String {
    let mut text = format!("color={}, line width={:.2}pt", rgb(stroke.colour), stroke.width);
    if !stroke.dash.is_empty() {
        let pattern: Vec<String> = stroke
            .dash
            .iter()
            .enumerate()
            .map(|(index, length)| {
                let word = if index % 2 == 0 { "on" } else { "off" };
                format!("{word} {length:.2}pt")
            })
            .collect();
        let _ = write!(text, ", dash pattern={}", pattern.join(" "));
    }
    text
}

/// Source of the plots in one panel.
struct PanelSource<'a> {
    look: &'a Look,
    legend: &'a Legend<'a>,
    /// Name of the panel's data file.
    data: &'a str,
    /// True if intervals are drawn as bands, false if as bars.
    has_bands: bool,
}

impl PanelSource<'_> {
    /// Plot commands of a line. `number` counts the lines of the panel from 1 and names its columns in the data file.
    fn plot(&self, line: &PlotLine, number: usize) -> String {
        let colour = rgb(self.look.colour(line.style));
        match &line.content {
            LineContent::Flat(share) => format!(
                "\\addplot[{}, domain=\\pgfkeysvalueof{{/pgfplots/xmin}}:\\pgfkeysvalueof{{/pgfplots/xmax}}, samples=2] {{{}}};\n",
                stroke_options(&self.legend.flat_stroke(line.into(), self.look)),
                100.0 * share
            ),
            LineContent::Marks(marks) => {
                let mut text = String::new();
                for (index, mark) in marks.iter().enumerate() {
                    let [low, middle, high] = mark.ev;
                    let share = mark.share;
                    let forget = if index == 0 { "" } else { ", forget plot" };
                    let _ = writeln!(
                        text,
                        "\\addplot[color={colour}, only marks, mark=o{forget}, error bars/.cd, x dir=both, x explicit, y dir=both, y explicit] \
                         coordinates {{({middle},{}) += ({},{}) -= ({},{})}};",
                        100.0 * share.value,
                        high - middle,
                        100.0 * (share.high - share.value),
                        middle - low,
                        100.0 * (share.value - share.low)
                    );
                }
                text
            }
            LineContent::Curve(_) => {
                let file = format!("{{\\darkqadata/{}}}", self.data);
                let pen = self.look.pen(line.style);
                let solid = "mark options={solid}";
                let mark = Look::pgf_mark(&pen);
                let stroke = stroke_options(&pen.stroke);
                if self.has_bands {
                    format!(
                        "\\addplot[draw=none, forget plot, name path=low{number}] table[x=x, y=low{number}]{file};\n\
                         \\addplot[draw=none, forget plot, name path=high{number}] table[x=x, y=high{number}]{file};\n\
                         \\addplot[fill={colour}, fill opacity=0.16, forget plot] fill between[of=low{number} and high{number}];\n\
                         \\addplot[{stroke}, mark={mark}, mark size=1.6pt, {solid}] table[x=x, y=y{number}]{file};\n"
                    )
                } else {
                    format!(
                        "\\addplot[{stroke}, mark={mark}, mark size=1.6pt, {solid}, error bars/.cd, y dir=both, y explicit, error mark=none]\n  \
                         table[x=x, y=y{number}, y error plus expr=\\thisrow{{high{number}}}-\\thisrow{{y{number}}}, y error minus \
                         expr=\\thisrow{{y{number}}}-\\thisrow{{low{number}}}]{file};\n"
                    )
                }
            }
            // Other contents are not over levels.
            _ => String::new(),
        }
    }
}

/// Data of a panel: one row for each level; for each curve its value and both ends of its interval in percent, `nan`
/// without a point.
fn data_file(panel: &Panel) -> String {
    let mut text = String::new();
    let curves: Vec<_> = panel
        .lines
        .iter()
        .enumerate()
        .filter_map(|(index, line)| match &line.content {
            LineContent::Curve(points) if !points.is_empty() => Some((index + 1, line, points)),
            _ => None,
        })
        .collect();
    for (number, line, _) in &curves {
        let name = line.name.replace(['\n', '\r'], " ");
        let name = escape_hidden(&name);
        let _ = writeln!(text, "# y{number}, low{number}, high{number}: {name}, in percent");
    }
    text += "level x";
    for (number, ..) in &curves {
        let _ = write!(text, " y{number} low{number} high{number}");
    }
    text.push('\n');
    for level in panel.levels() {
        let _ = write!(text, "{level} {}", level.value());
        for (.., points) in &curves {
            match points.iter().find(|(other, _)| *other == level) {
                Some((_, share)) => {
                    let [value, low, high] = [share.value, share.low, share.high].map(|share| 100.0 * share);
                    let _ = write!(text, " {value} {low} {high}");
                }
                None => text += " nan nan nan",
            }
        }
        text.push('\n');
    }
    text
}
