//! The value ranges of a model's input and output: [`RangePair`].

use std::fmt;

use crate::conventions::{ValueRange, ValueScale};

/// Scale of the values of a model's input, and that of its output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RangePair {
    pub(crate) input: ValueScale,
    pub(crate) output: ValueScale,
}

impl RangePair {
    /// All pairs of plain ranges with these stated ranges; `None` stands for every range.
    pub(super) fn plain(input: Option<ValueRange>, output: Option<ValueRange>) -> Vec<Self> {
        let ranges = ValueRange::ALL.map(ValueScale::Range);
        pairs(&scales(input, &ranges), &scales(output, &ranges))
    }

    /// All pairs of these scales that are normalised by a mean and a deviation on at least one side.
    pub(super) fn normalised(inputs: &[ValueScale], outputs: &[ValueScale]) -> Vec<Self> {
        let mut all = pairs(inputs, outputs);
        all.retain(|pair| !pair.is_plain());
        all
    }

    /// True if neither side is normalised.
    pub(super) fn is_plain(self) -> bool {
        matches!(self, Self { input: ValueScale::Range(_), output: ValueScale::Range(_) })
    }

    /// Sidecar lines that state the pair.
    pub(super) fn lines(self) -> Vec<String> {
        let mut lines = scale_lines(self.input, ["range_in", "mean", "std"]);
        lines.extend(scale_lines(self.output, ["range_out", "mean_out", "std_out"]));
        lines
    }

    /// The lines of [`Self::lines`], joined for a sentence.
    pub(super) fn stated(self) -> String {
        self.lines().into_iter().map(|line| format!("`{line}`")).collect::<Vec<_>>().join(" and ")
    }
}

impl fmt::Display for RangePair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} in and {} out", self.input, self.output)
    }
}

/// Only the stated range, or `all` scales if none is stated.
fn scales(stated: Option<ValueRange>, all: &[ValueScale]) -> Vec<ValueScale> {
    match stated {
        Some(range) => vec![ValueScale::Range(range)],
        None => all.to_vec(),
    }
}

/// Each input scale with each output scale, grouped by input.
fn pairs(inputs: &[ValueScale], outputs: &[ValueScale]) -> Vec<RangePair> {
    inputs.iter().flat_map(|&input| outputs.iter().map(move |&output| RangePair { input, output })).collect()
}

/// Sidecar lines for one side, with its keys for range, mean and deviation.
fn scale_lines(scale: ValueScale, [range, mean, std]: [&str; 3]) -> Vec<String> {
    match scale.mean_and_std() {
        None => vec![format!("{range} = \"{}\"", scale.range())],
        Some([means, deviations]) => vec![format!("{mean} = {means:?}"), format!("{std} = {deviations:?}")],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::conventions::Normalisation;

    #[test]
    fn a_mean_and_a_deviation_are_lines_of_a_sidecar() {
        let imagenet = RangePair {
            input: ValueScale::Normalised(Normalisation::ImageNet),
            output: ValueScale::Range(ValueRange::Unit),
        };
        assert_eq!(
            imagenet.lines(),
            ["mean = [0.485, 0.456, 0.406]", "std = [0.229, 0.224, 0.225]", "range_out = \"0..1\""]
        );
        let centred = RangePair { output: ValueScale::Normalised(Normalisation::Centred), ..imagenet };
        assert_eq!(centred.lines()[2], "mean_out = [0.5, 0.5, 0.5]");
    }

    #[test]
    fn only_ranges_that_are_not_stated_are_tried() {
        let unit = Some(ValueRange::Unit);
        assert_eq!(RangePair::plain(None, None).len(), 9);
        assert_eq!(RangePair::plain(Some(ValueRange::Signed), None).len(), 3);
        assert_eq!(RangePair::plain(unit, unit).len(), 1);
        let (all, plain) = (ValueScale::ALL, [ValueScale::Range(ValueRange::Unit)]);
        assert_eq!(RangePair::normalised(&all, &all).len(), 27);
        assert_eq!(RangePair::normalised(&all, &plain).len(), 3);
        assert!(RangePair::normalised(&plain, &plain).is_empty());
    }
}
