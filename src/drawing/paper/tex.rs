//! A chart of lines as source for pgfplots, in the letters of the paper, with its data beside it: [`tex`].

use std::fmt::Write;

use super::font::Font;
use super::legend::Legend;
use super::look::Look;
use super::sheet::{Colour, Stroke};
use crate::drawing::chart::{Chart, Panel, PanelContent, PlotLine};
use crate::text::latex::escape;
use crate::types::AxisLevel;
use crate::types::text::escape_hidden;

/// Room left of the first axes, between axes, and right of the last ones, in heights of letters.
const FIRST: f64 = 4.6;
const BETWEEN: f64 = 2.6;
const LAST: f64 = 1.0;

/// Room for the sample of a line in the legend, in points.
const SAMPLE: f64 = 43.0;
/// How much wider letters of a paper can be than those of Arial.
const WIDER: f64 = 1.08;

/// The source of a chart and the data of its panels, as files by name.
pub(crate) fn tex(name: &str, chart: &Chart, look: &Look) -> Vec<(String, Vec<u8>)> {
    let most = (look.width / (14.0 * look.letters)) as usize;
    let columns = chart.columns.min(most).min(chart.panels.len()).max(1);
    let rows = chart.panels.len().div_ceil(columns);
    // Room for what TeX sets beside the axes: numbers, and in the first column the title.
    let between = (10.0 * BETWEEN * look.letters).floor() / 10.0;
    let beside = (FIRST + LAST) * look.letters + between * (columns - 1) as f64;
    // Written with one decimal, and never more than there is.
    let width = (10.0 * (look.width - beside) / columns as f64).floor() / 10.0;
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
        rows_apart(chart, look, width),
        0.68 * width,
        legend_columns(chart, look),
    );
    let mut files = Vec::new();
    let mut named: Vec<&str> = Vec::new();
    for (index, panel) in chart.panels.iter().enumerate() {
        let data = format!("{name}-{}.dat", index + 1);
        let is_first = index % columns == 0;
        text += &head(panel, if is_first { chart.measure } else { "" });
        if index == 0 {
            let _ = write!(text, ", legend to name={{darkqa-{name}}}");
        }
        text += "]\n";
        let bands = panel
            .lines
            .iter()
            .filter(|line| matches!(line.content, PanelContent::Curve(_)))
            .count()
            <= 3;
        for (place, line) in panel.lines.iter().enumerate() {
            if line.is_empty() {
                continue;
            }
            let is_new = !named.contains(&&*line.name);
            text += &plot(line, place + 1, &data, (look, &legend), bands);
            if is_new {
                named.push(&line.name);
                // Later panels have no legend of their own: a name that they add stands in theirs.
                let room = (look.width - SAMPLE) / WIDER;
                let entry = Font::bundled().shortened(&line.name, look.letters, room);
                let _ = writeln!(text, "\\addlegendentry{{{}}}", escape(&entry));
            }
        }
        files.push((data, dat(panel).into_bytes()));
    }
    let _ = write!(
        text,
        "\\end{{groupplot}}\n\\end{{tikzpicture}}\n\n\\pgfplotslegendfromname{{darkqa-{name}}}\n"
    );
    files.insert(0, (format!("{name}.tex"), text.into_bytes()));
    files
}

/// Room between two rows of axes in points: for the levels, the title of the axis, and the lines of the longest title below.
fn rows_apart(chart: &Chart, look: &Look, width: f64) -> f64 {
    let font = Font::bundled();
    let lines = chart
        .panels
        .iter()
        .map(|panel| font.wrapped(&panel.title, look.letters, width).len());
    (6.3 + 1.25 * lines.max().unwrap_or(1) as f64) * look.letters
}

/// Columns of the legend, by its longest name.
fn legend_columns(chart: &Chart, look: &Look) -> usize {
    let widest = chart
        .panels
        .iter()
        .flat_map(|panel| &panel.lines)
        .map(|line| Font::bundled().width(&line.name, look.letters))
        .fold(0.0, f64::max)
        * WIDER
        + SAMPLE;
    (look.width / widest).max(1.0) as usize
}

/// The start of a panel's axes.
fn head(panel: &Panel, measure: &str) -> String {
    let levels = panel.levels();
    let ticks: Vec<String> = levels.iter().map(|of| of.value().to_string()).collect();
    let labels: Vec<String> = levels
        .iter()
        .map(|of| format!("{of}\\\\{}", of.value()))
        .map(|label| format!("{{{label}}}"))
        .collect();
    format!(
        "\\nextgroupplot[title={{{}}}, xlabel={{{}}}, ylabel={{{}}}, xmin={}, xmax={},\n  xtick={{{}}}, xticklabels={{{}}}, \
         xticklabel style={{align=center}}",
        escape(&panel.title),
        escape(&panel.axis_title()),
        escape(measure),
        -0.035 * panel.farthest(),
        1.035 * panel.farthest(),
        ticks.join(","),
        labels.join(",")
    )
}

fn rgb([red, green, blue]: Colour) -> String {
    format!("{{rgb,255:red,{red};green,{green};blue,{blue}}}")
}

fn stroke(stroke: &Stroke) -> String {
    let mut text = format!(
        "color={}, line width={:.2}pt",
        rgb(stroke.colour),
        stroke.width
    );
    if !stroke.dash.is_empty() {
        let pattern: Vec<String> = stroke
            .dash
            .iter()
            .enumerate()
            .map(|(place, length)| {
                let word = if place % 2 == 0 { "on" } else { "off" };
                format!("{word} {length:.2}pt")
            })
            .collect();
        let _ = write!(text, ", dash pattern={}", pattern.join(" "));
    }
    text
}

fn plot(
    line: &PlotLine,
    place: usize,
    data: &str,
    (look, legend): (&Look, &Legend<'_>),
    bands: bool,
) -> String {
    let file = format!("{{\\darkqadata/{data}}}");
    let colour = rgb(look.colour(line.style));
    match &line.content {
        PanelContent::Flat(share) => format!(
            "\\addplot[{}, domain=\\pgfkeysvalueof{{/pgfplots/xmin}}:\\pgfkeysvalueof{{/pgfplots/xmax}}, samples=2] {{{}}};\n",
            stroke(&legend.flat(line.into(), look)),
            100.0 * share
        ),
        PanelContent::Marks(marks) => {
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
        PanelContent::Curve(_) => {
            let pen = look.pen(line.style);
            let solid = "mark options={solid}";
            let mark = Look::pgf_mark(&pen);
            let drawn = stroke(&pen.stroke);
            if bands {
                format!(
                    "\\addplot[draw=none, forget plot, name path=low{place}] table[x=x, y=low{place}]{file};\n\
                     \\addplot[draw=none, forget plot, name path=high{place}] table[x=x, y=high{place}]{file};\n\
                     \\addplot[fill={colour}, fill opacity=0.16, forget plot] fill between[of=low{place} and high{place}];\n\
                     \\addplot[{drawn}, mark={mark}, mark size=1.6pt, {solid}] table[x=x, y=y{place}]{file};\n"
                )
            } else {
                format!(
                    "\\addplot[{drawn}, mark={mark}, mark size=1.6pt, {solid}, error bars/.cd, y dir=both, y explicit, error mark=none]\n  \
                     table[x=x, y=y{place}, y error plus expr=\\thisrow{{high{place}}}-\\thisrow{{y{place}}}, y error minus \
                     expr=\\thisrow{{y{place}}}-\\thisrow{{low{place}}}]{file};\n"
                )
            }
        }
    }
}

/// The data of a panel: a row a level; for each curve its value and both ends in percent, `nan` where it has no point.
fn dat(panel: &Panel) -> String {
    let mut text = String::new();
    let curves: Vec<_> = panel
        .lines
        .iter()
        .enumerate()
        .filter_map(|(place, line)| match &line.content {
            PanelContent::Curve(points) if !points.is_empty() => Some((place + 1, line, points)),
            _ => None,
        })
        .collect();
    for (place, line, _) in &curves {
        let name = line.name.replace(['\n', '\r'], " ");
        let name = escape_hidden(&name);
        let _ = writeln!(
            text,
            "# y{place}, low{place}, high{place}: {name}, in percent"
        );
    }
    text += "level x";
    for (place, ..) in &curves {
        let _ = write!(text, " y{place} low{place} high{place}");
    }
    text.push('\n');
    for level in panel.levels() {
        let _ = write!(text, "{level} {}", level.value());
        for (.., points) in &curves {
            let at = points.iter().find(|(at, _): &&(AxisLevel, _)| *at == level);
            match at {
                Some((_, of)) => {
                    let [value, low, high] = [of.value, of.low, of.high].map(|share| 100.0 * share);
                    let _ = write!(text, " {value} {low} {high}");
                }
                None => text += " nan nan nan",
            }
        }
        text.push('\n');
    }
    text
}
