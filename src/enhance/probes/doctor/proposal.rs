//! Conclusion of an examination: proposed lines of a sidecar ([`Proposal`]).

use crate::conventions::ChannelOrder;
use crate::probes::probe::{Conclusion, Probe};
use crate::probes::range_pair::RangePair;
use darkqa_base::types::Flaw;

/// Whether an examination found one convention.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Settled {
    /// Exactly one convention is plausible.
    Yes,
    /// No or several conventions are plausible.
    No,
}

/// A proposed line of a sidecar.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProposedLine {
    /// The line, such as `range_in = "0..1"`.
    pub line: String,
    /// Reason for the proposal.
    pub reason: String,
}

/// Conclusion of an examination, with proposed lines.
pub(super) struct Proposal {
    pub(super) lines: Vec<ProposedLine>,
    pub(super) conclusion: String,
    pub(super) settled: Settled,
}

impl Proposal {
    fn without_lines(conclusion: String) -> Self {
        Self { lines: Vec::new(), conclusion, settled: Settled::No }
    }

    /// No lines, because the stated ranges are plausible.
    pub(super) fn for_stated(pair: RangePair) -> Self {
        let conclusion = format!(
            "With {pair}, as set by MODEL.onnx.toml, the preset or the element types, its images are plausible."
        );
        Self { settled: Settled::Yes, ..Self::without_lines(conclusion) }
    }

    /// No lines, because several outputs could be the image: `first`, which is read, and `others`, which are plausible.
    pub(super) fn for_unknown_output(first: &str, probe: &Probe, others: &[String]) -> Self {
        let mut plausible: Vec<&str> = Vec::new();
        if !probe.plausible().is_empty() {
            plausible.push(first);
        }
        plausible.extend(others.iter().map(String::as_str));
        Self::without_lines(format!(
            "It is unknown which output is the image; plausible: {}. Choose one in MODEL.onnx.toml next to it, `output = \"NAME\"`, or name its preset (PRESET:FILE).",
            if plausible.is_empty() { "none".to_owned() } else { plausible.join("; ") }
        ))
    }

    /// Adds to the conclusion that other outputs give plausible images, too.
    pub(super) fn mention_outputs(&mut self, others: &[String]) {
        for output in others {
            let found = " gives plausible images, too; check which one the model's code uses.";
            self.conclusion += &[" The ", output, found].concat();
        }
    }

    /// Lines that state a pair of ranges.
    fn for_ranges(pair: RangePair, conclusion: String) -> Self {
        let reason = "with these value ranges its images are plausible";
        let lines = pair.lines().into_iter().map(|line| ProposedLine { line, reason: reason.to_owned() });
        Self { lines: lines.collect(), conclusion, settled: Settled::Yes }
    }
}

/// Proposes the only plausible pair of ranges. `swapped` is the probe with the output in the other channel order,
/// `order`. It is used if no pair is plausible in the present order and swapped colours are the flaw; if several of its
/// pairs are plausible, the `stated` one is proposed.
pub(super) fn propose(probe: &Probe, stated: Option<RangePair>, swapped: &Probe, order: ChannelOrder) -> Proposal {
    match probe.plausible().as_slice() {
        several @ [_, _, ..] if stated.is_none() && probe.conclusion() == Conclusion::Assumed => {
            let others: Vec<String> =
                several.iter().filter(|pair| **pair != probe.usual).map(ToString::to_string).collect();
            return Proposal::without_lines(format!(
                "With {} its images are plausible; a run assumes these usual ranges and warns. They are with {}, too; compare the page with the model's own examples.",
                probe.usual,
                others.join("; ")
            ));
        }
        [pair] => {
            let stated = stated.map_or_else(String::new, |stated| format!(" With {stated}, as set, they are not."));
            let conclusion = format!("With {pair}, and with no other ranges, its images are plausible.{stated}");
            return Proposal::for_ranges(*pair, conclusion);
        }
        [] => {}
        several => {
            let list: Vec<String> = several.iter().map(ToString::to_string).collect();
            if let Some(pair) = probe.likeliest() {
                let conclusion = format!(
                    "With {pair} its images are plausible, and black and white change least. Other plausible ranges: {}.",
                    list[1..].join("; ")
                );
                return Proposal::for_ranges(pair, conclusion);
            }
            let stated = stated.map_or_else(String::new, |pair| format!(" {pair}, as set, is not one of them."));
            return Proposal::without_lines(format!(
                "Its images are plausible with several value ranges: {}.{stated} Compare the page with the model's own examples, and set the ranges of its code.",
                list.join("; ")
            ));
        }
    }
    let is_hue = probe.pairs.iter().any(|pair| {
        pair.ranges == probe.usual && pair.verdict().is_some_and(|verdict| verdict.example.flaw == Flaw::Hue)
    });
    let plausible = swapped.plausible();
    let pair = match &plausible[..] {
        [pair] => Some(*pair),
        several => stated.filter(|pair| several.contains(pair)),
    };
    if let Some(pair) = pair.filter(|_| is_hue) {
        let order_of_input = order.to_string().to_lowercase();
        let conclusion = format!(
            "With {pair} and {order} in the output its images are plausible; or with it in the input: `color = \"{order_of_input}\"` and the other order for `color_out`."
        );
        let mut found = Proposal::for_ranges(pair, conclusion);
        if stated == Some(pair) {
            found.lines.clear();
        }
        found.lines.push(ProposedLine {
            line: format!("color_out = \"{}\"", order.to_string().to_lowercase()),
            reason: "with the other order, its images are blue where the frames are red".to_owned(),
        });
        return found;
    }
    Proposal::without_lines(
        "No value range or colour order gives plausible images. Perhaps it needs the `mean` and `std`, or `mean_out` and `std_out`, of its code, another output is the image, the dimensions have another order, or the export has lost its weights.".to_owned(),
    )
}
