//! LLM-Match, OpenEQA's score of open answers by a judge model (Majumdar et al. 2024, CVPR, section 4): truncation of an answer,
//! parsing of a mark, and points of a mark. It follows `facebookresearch/open-eqa` at cfa3fce.

use clap::ValueEnum;

use darkqa_ground::types::flags::flag_words;

/// Rules for preparing answers and parsing a judge's reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Protocol {
    /// Text after the last full stop of an answer is cut off; marks are read exactly as by upstream's `parse_score`.
    Upstream,
    /// Answers stay whole; a mark may also have spaces, a full stop, emphasis or "/5" around it.
    Tolerant,
}

flag_words!(Protocol);

/// Cuts off the text after the last full stop of an answer, as upstream does (`evaluate-predictions.py`).
///
/// The rule is meant for sentences that were truncated at the token limit; it also turns "about 1.5 meters" into "about 1.".
/// An answer without a full stop, or with nothing after it, stays whole.
#[must_use]
pub fn truncate_answer(answer: &str) -> &str {
    match answer.rfind('.') {
        Some(at) if at + 1 < answer.len() => &answer[..=at],
        _ => answer,
    }
}

/// Parses the mark in a judge's reply; `None` without a mark. The upstream rules accept any integer, which [`points`] clips to 1 to 5.
/// The tolerant protocol parses other replies as well, and there accepts only 1 to 5.
#[must_use]
pub fn mark(reply: &str, protocol: Protocol) -> Option<i64> {
    upstream(reply).or_else(|| match protocol {
        Protocol::Upstream => None,
        Protocol::Tolerant => tolerant(reply),
    })
}

/// Upstream's rules: `output.isdigit()`, else the rest of the line after the first "Your mark:".
fn upstream(reply: &str) -> Option<i64> {
    const CUE: &str = "Your mark:";
    if !reply.is_empty() && reply.bytes().all(|byte| byte.is_ascii_digit()) {
        return reply.parse().ok();
    }
    let after_cue = &reply[reply.find(CUE)? + CUE.len()..];
    let line = after_cue.split('\n').next().unwrap_or(after_cue);
    line.trim().parse().ok()
}

/// The tolerant rules: one digit from 1 to 5, alone or after a cue word, with punctuation or emphasis around it.
fn tolerant(reply: &str) -> Option<i64> {
    let lower = reply.to_lowercase();
    let after_cue = ["your mark", "mark", "score", "rating"]
        .iter()
        .find_map(|cue| Some(&lower[lower.rfind(cue)? + cue.len()..]))
        .unwrap_or(&lower);
    let digits = after_cue.trim_matches(is_decoration);
    let digits = digits
        .strip_prefix("is ")
        .unwrap_or(digits)
        .trim_matches(is_decoration);
    let digits = digits
        .strip_suffix("/5")
        .or_else(|| digits.strip_suffix(" out of 5"))
        .unwrap_or(digits)
        .trim_matches(is_decoration);
    match digits.as_bytes() {
        [digit @ b'1'..=b'5'] => Some(i64::from(digit - b'0')),
        _ => None,
    }
}

fn is_decoration(c: char) -> bool {
    c.is_whitespace() || "*_`:=\"'().[]".contains(c)
}

/// Points of one item, between 0 and 1: (clip(mark, 1, 5) − 1) / 4. A null answer (`None`) has 0 points without a judge.
#[must_use]
pub fn points(mark: Option<i64>) -> f64 {
    mark.map_or(0.0, |mark| (mark.clamp(1, 5) - 1) as f64 / 4.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_truncated_as_upstream() {
        for (answer, judged) in [
            ("The door is open. It also", "The door is open."),
            ("about 1.5 meters", "about 1."),
            ("no full stop", "no full stop"),
            ("Ends here.", "Ends here."),
            ("One. Two.", "One. Two."),
            ("", ""),
            ("Größe. ü", "Größe."),
        ] {
            assert_eq!(truncate_answer(answer), judged, "{answer:?}");
        }
    }

    #[test]
    fn marks_are_read_by_protocol() {
        let (five, none) = (Some(5), None);
        for (reply, upstream, tolerant) in [
            ("5", five, five),
            ("Your mark: 5", five, five),
            ("Your mark: 5\nbecause", five, five),
            ("The response fits.\nYour mark:  5 ", five, five),
            ("5\n", none, five),
            ("5.", none, five),
            ("**5**", none, five),
            ("Your mark: **5**", none, five),
            ("Score: 5/5", none, five),
            ("My rating is 5 out of 5.", none, five),
            ("Your mark: five", none, none),
            ("I would say between 4 and 5", none, none),
            ("It is a good answer.", none, none),
            ("", none, none),
            ("0 or 6", none, none),
        ] {
            assert_eq!(mark(reply, Protocol::Upstream), upstream, "{reply:?}");
            assert_eq!(mark(reply, Protocol::Tolerant), tolerant, "{reply:?}");
        }
        // Upstream accepts any integer and clips it.
        assert_eq!(mark("17", Protocol::Upstream), Some(17));
        assert_eq!(mark("Your mark: -3", Protocol::Upstream), Some(-3));
    }

    #[test]
    fn points_match_upstream() {
        let marks = [Some(5), Some(5), Some(3), Some(1), None];
        let score = 100.0 * marks.into_iter().map(points).sum::<f64>() / 5.0;
        assert!((score - 50.0).abs() < 1e-12);
        assert!((points(Some(17)) - 1.0).abs() < 1e-12 && points(Some(-3)).abs() < 1e-12);
    }
}
