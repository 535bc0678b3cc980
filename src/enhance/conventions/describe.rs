//! Description of a model's convention for users, with the source of each value: [`Description`].

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use super::convention::Locality;
use super::preset::Preset;
use super::sidecar::ModelSidecar;
use crate::graphs::Graph;
use crate::sizing::{MULTIPLES, SizeRule};
use darkqa_base::types::manifests::{ConventionLine, TRAINED_ON};

/// Source of value ranges that neither sidecar, preset nor element type states.
const ASSUMED: &str = "assumed";

/// Source of values that the graph declares.
const GRAPH: &str = "graph";

/// Sources of a model's convention, with caveats and the number of flushed weights.
#[derive(Debug)]
pub(crate) struct Description {
    /// The user's sidecar; empty without a file.
    pub(crate) sidecar: ModelSidecar,
    /// The preset, if one was named.
    pub(crate) preset: Option<Preset>,
    /// True if the usual value ranges are assumed, because they are not stated and the probe's images are plausible
    /// with them.
    pub(crate) has_assumed_ranges: bool,
    /// Caveats for readers of the results, as sentences that follow the model's name.
    pub(crate) remarks: Vec<String>,
    /// Operators for which the graph runs on one thread.
    pub(crate) one_thread: BTreeSet<String>,
    /// True if the shapes of intermediate tensors in the file were left out.
    pub(crate) has_wrong_shapes: bool,
    /// Number of subnormal weights that were set to zero.
    pub(crate) flushed: usize,
}

/// Rows of a table with the columns name, value and source.
struct Lines(Vec<ConventionLine>);

impl Lines {
    fn add(&mut self, name: &str, value: impl std::fmt::Display, source: impl Into<String>) {
        self.0.push(ConventionLine { key: name.to_owned(), value: value.to_string(), source: source.into() });
    }
}

impl Description {
    /// Rows of the table of the model's input and output convention.
    pub(crate) fn lines(&self, graph: &Graph, convention: &ModelSidecar) -> Vec<ConventionLine> {
        let mut lines = Lines(Vec::new());
        if let Some(preset) = &self.preset {
            lines.add("preset", &preset.name, preset.content.to_string());
        }
        for remark in &self.remarks {
            lines.add("remark", remark, GRAPH);
        }
        if let Some(differences) = &graph.preset_differences {
            lines.add("warning", differences, "graph");
        }
        if !self.one_thread.is_empty() {
            let names: Vec<&str> = self.one_thread.iter().map(String::as_str).collect();
            let source = format!(
                "graph: {} of two computed matrices, whose last bits may depend on the threads",
                names.join(", ")
            );
            lines.add("threads per image", 1, source);
        }
        if self.has_wrong_shapes {
            let source = "graph: exporters write wrong shapes for Fourier transforms";
            lines.add("value_info", "left out", source);
        }
        self.input(&mut lines, graph, convention);
        self.output(&mut lines, graph);
        let source = match convention.tile {
            Some(_) => self.source(|s| s.tile.is_some(), ""),
            None => "not set; --llie-options tile=N tries tiles and checks every seam".to_owned(),
        };
        lines.add("tile", convention.tile.unwrap_or(Locality::Global), source);
        if let Some(data) = &convention.trained_on {
            let source = self.source(|s| s.trained_on.is_some(), "");
            lines.add(TRAINED_ON, data, source);
        }
        lines.0
    }

    /// The table as text, with additional rows about weights and ONNX Runtime.
    pub(crate) fn text(&self, path: &Path, graph: &Graph, convention: &ModelSidecar) -> String {
        let mut lines = Lines(self.lines(graph, convention));
        lines.add("subnormal weights", self.flushed, "set to zero, which changes no byte");
        let runtime = graph.runtime();
        let source = format!("{}: {}", runtime.place(), runtime.path().display());
        lines.add("ONNX Runtime", runtime.version(), source);
        align(path, &lines.0)
    }

    /// Adds the lines about the input.
    fn input(&self, lines: &mut Lines, graph: &Graph, convention: &ModelSidecar) {
        let (signature, encoding) = (&graph.signature, &graph.encoding);
        lines.add("input", &signature.input.port, GRAPH);
        let source = self.source(|s| s.layout_in.is_some(), "graph: the dimension of size 3");
        lines.add("layout_in", encoding.layout, source);
        let [height, width] =
            [signature.height, signature.width].map(|side| side.map_or("any".to_owned(), |side| side.to_string()));
        lines.add("height × width", format!("{height} × {width}"), GRAPH);
        if let Some([width, height]) = convention.fixed {
            let source = self.source(|s| s.fixed.is_some(), "");
            lines.add("fixed", format!("{height} × {width}"), source);
        }
        if graph.batch() > 1 {
            let cost = format!("graph: each image is repeated {0} times, which takes {0} times as long", graph.batch());
            lines.add("batch", graph.batch(), cost);
        }
        let default = "default; a graph does not contain it";
        if let Some(input) = &convention.input {
            let source = self.source(|s| s.input.is_some(), "");
            lines.add("input = ", input, source);
        }
        if let Some(channels) = convention.channels {
            let source = self.source(|s| s.channels.is_some(), "");
            lines.add("channels", channels, source);
        }
        let source = self.source(|s| s.color.is_some(), "default, cannot be checked");
        lines.add("color", encoding.color, source);
        let source = self.source(|s| s.range_in.is_some(), self.range_source("default for its type"));
        lines.add("range_in", encoding.range, source);
        if convention.mean.is_some() || convention.std.is_some() {
            let value = format!("{:?}, {:?}", encoding.mean, encoding.std);
            let source = self.source(|s| s.mean.is_some() || s.std.is_some(), default);
            lines.add("mean, std", value, source);
        }
        let fixed = [signature.height, signature.width];
        match convention.multiple {
            Some(multiple) => {
                lines.add("multiple", multiple, self.source(|s| s.multiple.is_some(), ""));
            }
            None if SizeRule::new(fixed, convention, encoding.pad).takes_any_size() => {
                let others = MULTIPLES[1..].iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
                let source = format!("tried first, then {others} if it fails");
                lines.add("multiple", MULTIPLES[0], source);
            }
            None => lines.add("multiple", 1, "fixed size: other images are padded or tiled if the model is local"),
        }
        lines.add("pad", encoding.pad, self.source(|s| s.pad.is_some(), "default"));
        if convention.pad_always == Some(true) {
            let source = self.source(|s| s.pad_always.is_some(), "");
            lines.add("pad_always", "at least one row and one column", source);
        }
        for extra in &signature.extras {
            let source = self.source(|s| s.extra.contains_key(&extra.port.name), "");
            lines.add(&format!("extra.{}", extra.port.name), &extra.value, source);
        }
    }

    /// Adds the lines about the output.
    fn output(&self, lines: &mut Lines, graph: &Graph) {
        let (outputs, composition) = (&graph.signature.outputs, &graph.decoding);
        if let Some(image) = &graph.convention.image {
            let fallback = self.preset.as_ref().map_or(GRAPH.to_owned(), |preset| format!("preset {}", preset.name));
            let source = self.source(|s| s.image.is_some(), &fallback);
            lines.add("image = ", image, source);
        }
        for (output, decoding) in outputs.iter().zip(&composition.outputs) {
            let source = match (output.reason, &self.preset) {
                ("stated", Some(preset)) => self.source(|s| s.output.is_some(), &format!("preset {}", preset.name)),
                ("stated", None) => "sidecar".to_owned(),
                (reason, _) => reason.to_owned(),
            };
            lines.add("output", &output.port, source);
            let fallback = match decoding.layout {
                Some(_) => "graph: the dimension of size 3",
                None => "like the input; the actual output decides",
            };
            let source = self.source(|s| s.layout_out.is_some(), fallback);
            let layout = decoding.layout.unwrap_or(decoding.preferred);
            lines.add("layout_out", layout, source);
        }
        for port in &graph.signature.unread {
            lines.add("not read", port, GRAPH);
        }
        let decoding = &composition.outputs[0];
        let source = self.source(|s| s.color_out.is_some(), "like the input");
        lines.add("color_out", decoding.color, source);
        let checked = "like the input; the actual output is checked";
        let source = self.source(|s| s.range_out.is_some(), self.range_source(checked));
        lines.add("range_out", decoding.range, source);
        if let Some([mean, std]) = decoding.mean_and_std {
            let source = self.source(|s| s.mean_out.is_some() || s.std_out.is_some(), "default");
            lines.add("mean_out, std_out", format!("{mean:?}, {std:?}"), source);
        }
        let source = self.source(|s| s.rounding.is_some(), "default");
        lines.add("rounding", composition.rounding, source);
    }

    /// Source of an unstated value range: `otherwise`, unless ranges were assumed after the probe.
    fn range_source(&self, otherwise: &'static str) -> &'static str {
        if self.has_assumed_ranges { ASSUMED } else { otherwise }
    }

    /// Source of a value: the sidecar or the preset if `states` holds for it, else `otherwise`.
    fn source(&self, states: impl Fn(&ModelSidecar) -> bool, otherwise: &str) -> String {
        match &self.preset {
            _ if states(&self.sidecar) => "sidecar".to_owned(),
            Some(preset) if states(&preset.content.sidecar) => format!("preset {}", preset.name),
            _ => otherwise.to_owned(),
        }
    }
}

/// Widest cell, in characters, that sets the width of its column; longer remarks do not. Chosen.
const MAX_PADDED: usize = 60;

/// Table as text, with aligned columns and the model's path as its title.
fn align(path: &Path, lines: &[ConventionLine]) -> String {
    let widths = [
        column_width(lines.iter().map(|line| line.key.as_str())),
        column_width(lines.iter().map(|line| line.value.as_str())),
    ];
    let mut text = format!("{}\n", path.display());
    for ConventionLine { key, value, source } in lines {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "  {key:0$}  {value:1$}  {source}", widths[0], widths[1]);
    }
    text
}

/// Width of the widest cell of at most [`MAX_PADDED`] characters.
fn column_width<'a>(cells: impl Iterator<Item = &'a str>) -> usize {
    cells.map(|cell| cell.chars().count()).filter(|width| *width <= MAX_PADDED).max().unwrap_or(0)
}
