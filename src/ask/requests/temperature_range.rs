//! The range of temperatures in a server's refusal: [`least_temperature`].

use std::sync::LazyLock;

use regex::Regex;

/// Matches a lower bound that is accepted itself: `[0.01, 2]`, `between 0.01 and 2`, `0.01 … 2`, `at least 0.01`. One
/// group has the bound.
static CLOSED: LazyLock<Regex> = LazyLock::new(|| {
    compiled(
        r"(?i)\[\s*(\d*\.?\d+)\s*[,;]|\b(?:between|range(?: of)?|from|at least|no less than|minimum(?: is| of| value:?)?)\s+\[?(\d*\.?\d+)|(?:>=|≥|⩾|greater than or equal to|不小于|大于等于|不低于)\s*(\d*\.?\d+)|(\d*\.?\d+)\s*(?:…|\.\.+|~|–|\bto\b|至|到)\s*\d",
    )
});

/// Matches a lower bound that is not accepted itself: `(0, 1]`, `greater than 0`, `> 0`. One group has the bound.
static OPEN: LazyLock<Regex> = LazyLock::new(|| {
    compiled(
        r"(?i)\(\s*(\d*\.?\d+)\s*[,;]|\b(?:greater|higher|larger|more|bigger) than\s+(\d*\.?\d+)|\babove\s+(\d*\.?\d+)|>\s*(\d*\.?\d+)|大于\s*(\d*\.?\d+)",
    )
});

/// Words for a bound of 0 that is not accepted itself.
const POSITIVE: [&str; 5] = ["positive", "non-zero", "nonzero", "正数", "positiv"];

/// Step above a bound that is not accepted itself, in hundredths; chosen, the least temperature of several servers.
const STEP: u16 = 1;

/// Largest bound that is not a mistake of this parser, in hundredths: servers take temperatures up to 2.
const MAX_BOUND: u16 = 200;

/// Least temperature that a server accepts by its refusal of a lower one, in hundredths. `None` if the refusal states
/// no range.
pub(crate) fn least_temperature(message: &str) -> Option<u16> {
    let lower = message.to_lowercase();
    // Only one temperature is accepted: the server's own.
    if lower.contains("only") {
        return None;
    }
    let open = first_bound(&OPEN, &lower).map(|bound| bound + STEP);
    let closed = first_bound(&CLOSED, &lower).map(|bound| bound.max(STEP));
    let positive = POSITIVE.iter().any(|word| lower.contains(word)).then_some(STEP);
    closed.or(open).or(positive).filter(|bound| *bound <= MAX_BOUND)
}

/// First number in a group of the pattern, in hundredths, rounded up.
fn first_bound(pattern: &Regex, text: &str) -> Option<u16> {
    let captures = pattern.captures(text)?;
    let number: f64 = captures.iter().skip(1).flatten().next()?.as_str().parse().ok()?;
    let hundredths = (number * 100.0).ceil();
    (0.0..=f64::from(MAX_BOUND)).contains(&hundredths).then_some(hundredths as u16)
}

fn compiled(pattern: &str) -> Regex {
    Regex::new(pattern).unwrap_or_else(|e| unreachable!("a test compiles it: {e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_found() {
        for (message, least) in [
            ("Input validation error: `temperature` must be strictly positive", Some(1)),
            ("invalid params, temperature should be in (0, 1] (2013)", Some(1)),
            ("temperature must be in (0,1]", Some(1)),
            ("temperature should be in the range 0.01 … 2", Some(1)),
            ("temperature: Input should be greater than 0", Some(1)),
            ("temperature must be > 0.1", Some(11)),
            ("temperature must be at least 0.05", Some(5)),
            ("temperature: Input should be greater than or equal to 0.01", Some(1)),
            ("temperature must be between 0.1 and 1.0", Some(10)),
            ("temperature 取值范围 [0.01, 2]", Some(1)),
            ("temperature 必须大于0", Some(1)),
            ("temperature must be in [0, 1]", Some(1)),
            ("invalid temperature: only 1 is allowed for this model", None),
            ("invalid temperature: only 0.6 is allowed for this model", None),
            ("`temperature` is deprecated for this model.", None),
            ("`temperature` may only be set to 1 when thinking is enabled.", None),
            ("'temperature' does not support 0.0 with this model.", None),
            ("temperature must be at least 500", None),
        ] {
            assert_eq!(least_temperature(message), least, "{message}");
        }
    }
}
