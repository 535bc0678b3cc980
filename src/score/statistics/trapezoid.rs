//! Weights of the trapezoid rule for the mean height of a curve: [`weights`].

use super::significance::gcd;
use darkqa_base::types::AxisLevel;

/// Weights of the levels in the trapezoid rule, as integers without a common divisor, so that sums are exact.
#[must_use]
pub(crate) fn weights(levels: &[AxisLevel]) -> Vec<u64> {
    let drops: Vec<u64> = levels.iter().map(|level| (100.0 * level.value()).round() as u64).collect();
    let last = drops.len().saturating_sub(1);
    let widths: Vec<u64> =
        (0..drops.len()).map(|index| drops[(index + 1).min(last)] - drops[index.saturating_sub(1)]).collect();
    let divisor = widths.iter().copied().fold(0, gcd).max(1);
    widths.into_iter().map(|width| width / divisor).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use darkqa_base::types::Severity;
    use darkqa_base::types::degradations::Kind;

    #[test]
    fn weights_follow_the_trapezoid_rule() {
        let paper = Severity::LADDER.map(|severity| AxisLevel::new(Kind::Sensor, severity));
        let paper = [&[AxisLevel::L0][..], &paper].concat();
        assert_eq!(weights(&paper), [4, 8, 8, 7, 6, 3]);
        let odd = [
            AxisLevel::L0,
            AxisLevel::new(Kind::Sensor, Severity::from_hundredths(330)),
            AxisLevel::new(Kind::Sensor, Severity::L5),
        ];
        assert_eq!(weights(&odd), [11, 30, 19]);
    }
}
