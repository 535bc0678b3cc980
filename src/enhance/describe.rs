//! What was found of a model, and why it is taken to be so: [`Description`].

use std::fmt::Write as _;
use std::path::Path;

use super::convention::Tile;
use super::graph::Graph;
use super::preset::Preset;
use super::sidecar::ModelSidecar;
use super::tiles::MULTIPLES;

/// The source of what the graph itself says.
const GRAPH: &str = "graph";

/// What is needed beside the convention itself to tell where it comes from.
#[derive(Debug)]
pub(super) struct Description {
    /// What the sidecar states.
    pub(super) sidecar: ModelSidecar,
    /// What a preset states.
    pub(super) preset: Option<Preset>,
    /// Weights that were set to zero.
    pub(super) flushed: usize,
}

/// A table of what, how and why.
struct Lines(Vec<[String; 3]>);

impl Lines {
    fn add(&mut self, what: &str, how: impl std::fmt::Display, why: impl Into<String>) {
        self.0.push([what.to_owned(), how.to_string(), why.into()]);
    }
}

impl Description {
    /// The table as text.
    pub(super) fn text(&self, path: &Path, graph: &Graph, stated: &ModelSidecar) -> String {
        let mut lines = Lines(Vec::new());
        self.input(&mut lines, graph, stated);
        self.output(&mut lines, graph);
        let why = match stated.tile {
            Some(_) => self.why(|s| s.tile.is_some(), ""),
            None => "not said; --tile N tries, and checks every seam".to_owned(),
        };
        lines.add("tile", stated.tile.unwrap_or(Tile::None), why);
        lines.add(
            "subnormal weights",
            self.flushed,
            "set to zero; they change no byte",
        );
        written(path, &lines.0)
    }

    /// How the model is fed.
    fn input(&self, lines: &mut Lines, graph: &Graph, stated: &ModelSidecar) {
        let (signature, feeding) = (&graph.signature, &graph.feeding);
        let side = |size: Option<usize>| size.map_or("any".to_owned(), |size| size.to_string());
        lines.add("input", &signature.input.port, GRAPH);
        let why = self.why(|s| s.layout_in.is_some(), "graph: where its 3 is");
        lines.add("layout_in", feeding.layout, why);
        let height_width = format!("{} × {}", side(signature.height), side(signature.width));
        lines.add("height × width", height_width, GRAPH);
        let usual = "usual; a graph cannot say";
        let why = self.why(|s| s.color.is_some(), usual);
        lines.add("color", feeding.color, why);
        let why = self.why(|s| s.range_in.is_some(), "usual for its type");
        lines.add("range_in", feeding.range, why);
        if stated.mean.is_some() || stated.std.is_some() {
            let said = format!("{:?}, {:?}", feeding.mean, feeding.std);
            let why = self.why(|s| s.mean.is_some() || s.std.is_some(), usual);
            lines.add("mean, std", said, why);
        }
        match stated.multiple {
            Some(multiple) => {
                lines.add("multiple", multiple, self.why(|s| s.multiple.is_some(), ""));
            }
            None if signature.takes_any_size() => {
                let others = MULTIPLES[1..].iter().map(ToString::to_string);
                let others = others.collect::<Vec<_>>().join(", ");
                let why = format!("tried; then {others} where it fails");
                lines.add("multiple", MULTIPLES[0], why);
            }
            None => lines.add("multiple", 1, "its size is fixed"),
        }
        lines.add("pad", feeding.pad, self.why(|s| s.pad.is_some(), "usual"));
        for extra in &signature.extras {
            let why = self.why(|s| s.extra.contains_key(&extra.port.name), "");
            lines.add(&format!("extra.{}", extra.port.name), extra.value, why);
        }
    }

    /// How it is read.
    fn output(&self, lines: &mut Lines, graph: &Graph) {
        let (output, reading) = (&graph.signature.output, &graph.reading);
        let why = match output.why {
            "stated" => self.why(|s| s.output.is_some(), GRAPH),
            why => why.to_owned(),
        };
        lines.add("output", &output.port, why);
        let fallback = match reading.layout {
            Some(_) => "graph: where its 3 is",
            None => "as the input; what comes decides",
        };
        let why = self.why(|s| s.layout_out.is_some(), fallback);
        lines.add("layout_out", reading.layout.unwrap_or(reading.likely), why);
        let checked = "as the input; what comes is checked";
        let why = self.why(|s| s.range_out.is_some(), checked);
        lines.add("range_out", reading.range, why);
        let why = self.why(|s| s.rounding.is_some(), "usual");
        lines.add("rounding", reading.rounding, why);
    }

    /// Where a statement comes from.
    fn why(&self, states: impl Fn(&ModelSidecar) -> bool, otherwise: &str) -> String {
        match &self.preset {
            _ if states(&self.sidecar) => "sidecar".to_owned(),
            Some(preset) if states(&preset.states) => format!("preset {}", preset.name),
            _ => otherwise.to_owned(),
        }
    }
}

fn written(path: &Path, lines: &[[String; 3]]) -> String {
    let widths = [0, 1].map(|column| {
        let cells = lines.iter().map(|line| line[column].chars().count());
        cells.max().unwrap_or(0)
    });
    let mut text = format!("{}\n", path.display());
    for [what, how, why] in lines {
        // Writing to a text cannot fail.
        let _ = writeln!(text, "  {what:0$}  {how:1$}  {why}", widths[0], widths[1]);
    }
    text
}
