//! LLM-Match, OpenEQA's score of open answers by a judge model (Majumdar et al. 2024, CVPR, section 4): truncation of
//! an answer, parsing of a mark, and points of a mark. It follows `facebookresearch/open-eqa` at cfa3fce.

mod tolerant;

use clap::ValueEnum;

use super::text::reasoning::{Asked, separate};

use darkqa_base::types::flags::flag_words;

/// Rules for preparing answers and parsing a judge's reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Protocol {
    /// Text after the last full stop of an answer is cut off; marks are read exactly as by upstream's `parse_score`.
    Upstream,
    /// Answers stay whole; a mark may also stand in JSON, in a box, after other words, or before an explanation.
    Tolerant,
}

flag_words!(Protocol);

/// Cuts off the text after the last full stop of an answer, as upstream does (`evaluate-predictions.py`).
///
/// The rule is meant for sentences that were truncated at the token limit; it also turns "about 1.5 meters" into "about
/// 1.". An answer without a full stop, or with nothing after it, stays whole.
#[must_use]
pub fn truncate_answer(answer: &str) -> &str {
    match answer.rfind('.') {
        Some(at) if at + 1 < answer.len() => &answer[..=at],
        _ => answer,
    }
}

/// Parses the mark in a judge's reply, without its thoughts; `None` without a mark. The upstream rules accept any
/// integer, which [`points`] clips to 1 to 5. The tolerant protocol parses other replies as well, and there accepts
/// only 1 to 5.
#[must_use]
pub fn mark(reply: &str, protocol: Protocol) -> Option<i64> {
    let has_mark = |text: &str| upstream(text).is_some();
    let separated = separate(reply, Asked::Mark(&has_mark)).ok()?;
    // Without thoughts, upstream sees the reply as it is.
    let text = if separated.has_thoughts { separated.text } else { reply };
    upstream(text).or_else(|| match protocol {
        Protocol::Upstream => None,
        Protocol::Tolerant => tolerant::mark(text),
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

/// Points of one item, between 0 and 1: (clip(mark, 1, 5) − 1) / 4. A null answer (`None`) has 0 points without a
/// judge.
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
            ("{\"mark\": 5}", none, five),
            ("```json\n{\"score\": \"5\", \"reason\": \"2 of 2 chairs\"}\n```", none, five),
            ("{\"reason\": \"it fits\", \"rating\": 5.0}", none, five),
            ("{\"mark\": 7}", none, none),
            ("{\"mark\": 4, \"score\": 5}", none, none),
            ("\\boxed{5}", none, five),
            ("[[5]]", none, five),
            ("<score>5</score>", none, five),
            ("Your mark: 5 (fits)", none, five),
            ("Your mark: 5. It names 2 chairs.", none, five),
            ("5 - the response fits", none, five),
            ("5 (out of 5): 3 chairs", none, five),
            ("The response fits.\n\n5", none, five),
            ("Score (1-5): 5", none, five),
            ("On a scale of 1 to 5, I would give it a 5.", none, five),
            ("The response deserves 5 out of 5.", none, five),
            ("Score: 5. A score of 4 would be too low.", none, five),
            ("Score: 5/10", none, none),
            ("Your mark: 4.5", none, none),
            ("Your mark: 4-5", none, none),
            ("Your mark: 4 or 5", none, none),
            ("I would not give it a 5.", none, none),
            ("The response names 5 chairs.", none, none),
            ("Score: 55", none, none),
        ] {
            assert_eq!(mark(reply, Protocol::Upstream), upstream, "{reply:?}");
            assert_eq!(mark(reply, Protocol::Tolerant), tolerant, "{reply:?}");
        }
        for (reply, upstream, tolerant) in [
            ("<think>\nYour mark: 1\nNo.</think>\nYour mark: 5", five, five),
            ("<think>Maybe 1.</think>\n\n5", five, five),
            ("</think>5", five, five),
            ("<ponder>Your mark: 1</ponder>Your mark: 5", five, five),
            ("<think>Your mark: 1", none, none),
            ("Your mark: 5<|im_end|>", none, five),
            ("5<|zork|>", none, five),
            ("<evaluation>Your mark: 5\n</evaluation>", five, five),
            ("<evaluation>fits\nYour mark: 5", five, five),
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
