//! What was found of a model, and why it is taken to be so: [`Description`].

use std::fmt::Write as _;
use std::path::Path;

use super::convention::Tile;
use super::feeding::Feeding;
use super::onnx::MULTIPLES;
use super::preset::Preset;
use super::reading::Reading;
use super::sidecar::Sidecar;
use super::signature::Signature;

/// What is needed beside the convention itself to tell where it comes from.
#[derive(Debug)]
pub(super) struct Description {
    /// What the sidecar states.
    pub(super) sidecar: Sidecar,
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
    pub(super) fn text(
        &self,
        path: &Path,
        signature: &Signature,
        feeding: &Feeding,
        reading: &Reading,
        stated: &Sidecar,
    ) -> String {
        let mut lines = Lines(Vec::new());
        let graph = "graph";
        let side = |size: Option<usize>| size.map_or("any".to_owned(), |size| size.to_string());
        lines.add("input", &signature.input.port, graph);
        let why = self.why(|s| s.layout_in.is_some(), "graph: where its 3 is");
        lines.add("layout_in", feeding.layout, why);
        let height_width = format!("{} × {}", side(signature.height), side(signature.width));
        lines.add("height × width", height_width, graph);
        let usual = "usual; a graph cannot say";
        lines.add(
            "color",
            feeding.color,
            self.why(|s| s.color.is_some(), usual),
        );
        let range_in = self.why(|s| s.range_in.is_some(), "usual for its type");
        lines.add("range_in", feeding.range, range_in);
        if stated.mean.is_some() || stated.std.is_some() {
            let said = format!("{:?}, {:?}", feeding.mean, feeding.std);
            lines.add(
                "mean, std",
                said,
                self.why(|s| s.mean.is_some() || s.std.is_some(), usual),
            );
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
        let why = match signature.output.why {
            "stated" => self.why(|s| s.output.is_some(), graph),
            why => why.to_owned(),
        };
        lines.add("output", &signature.output.port, why);
        let layout_out = reading.layout.unwrap_or(reading.likely);
        let fallback = if reading.layout.is_some() {
            "graph: where its 3 is"
        } else {
            "as the input; what comes decides"
        };
        lines.add(
            "layout_out",
            layout_out,
            self.why(|s| s.layout_out.is_some(), fallback),
        );
        let why = self.why(
            |s| s.range_out.is_some(),
            "as the input; what comes is checked",
        );
        lines.add("range_out", reading.range, why);
        lines.add(
            "rounding",
            reading.rounding,
            self.why(|s| s.rounding.is_some(), "usual"),
        );
        match stated.tile {
            Some(tile) => lines.add("tile", tile, self.why(|s| s.tile.is_some(), "")),
            None => lines.add(
                "tile",
                Tile::None,
                "not said; --tile N tries, and checks every seam",
            ),
        }
        lines.add(
            "subnormal weights",
            self.flushed,
            "set to zero; they change no byte",
        );
        written(path, &lines.0)
    }

    /// Where a statement comes from.
    fn why(&self, states: impl Fn(&Sidecar) -> bool, otherwise: &str) -> String {
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
