//! The mean height of a curve by the trapezoid rule: [`weights`].

use super::significance::gcd;
use darkqa_ground::types::AxisLevel;

/// Weights of the levels in the trapezoid rule: whole numbers without a common divisor, so that sums of them are exact.
#[must_use]
pub fn weights(levels: &[AxisLevel]) -> Vec<u64> {
    let drop = |level: &AxisLevel| (100.0 * level.value()).round() as u64;
    let last = levels.len().saturating_sub(1);
    let width = |index: usize| {
        drop(&levels[(index + 1).min(last)]) - drop(&levels[index.saturating_sub(1)])
    };
    let widths: Vec<u64> = (0..levels.len()).map(width).collect();
    let divisor = widths.iter().copied().fold(0, gcd).max(1);
    widths.into_iter().map(|width| width / divisor).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_ground::types::Severity;
    use darkqa_ground::types::degradations::Kind;

    #[test]
    fn weights_are_those_of_the_trapezoid_rule() {
        let level = |severity| AxisLevel::new(Kind::Sensor, severity);
        let paper = Severity::LADDER.map(level);
        let paper = [&[AxisLevel::L0][..], &paper].concat();
        assert_eq!(weights(&paper), [4, 8, 8, 7, 6, 3]);
        let odd = [
            AxisLevel::L0,
            level(Severity::from_hundredths(330)),
            level(Severity::L5),
        ];
        assert_eq!(weights(&odd), [11, 30, 19]);
    }
}
