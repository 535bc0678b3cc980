//! LLM-Match, OpenEQA's score of open answers by a judging model (Majumdar et al. 2024, CVPR, section 4): what is done to an
//! answer before, how a mark is read, and what marks come to. After `facebookresearch/open-eqa` at cfa3fce.

use clap::ValueEnum;

use crate::types::flag::flag_words;

/// How answers are judged and a judge's reply is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Protocol {
    /// Answers [`shortened`], marks read as by upstream's `parse_score`, character for character.
    Upstream,
    /// Answers whole; marks the same, and those with space, a full stop, emphasis or a fraction of five about them.
    Tolerant,
}

flag_words!(Protocol);

/// An answer as it is judged: what follows its last full stop is cut off, where something does (`evaluate-predictions.py`).
///
/// It is meant for sentences that the token limit has cut; it also makes "about 1." of "about 1.5 meters". An answer without a
/// full stop, or with nothing behind it, stays.
#[must_use]
pub(crate) fn shortened(answer: &str) -> &str {
    match answer.rfind('.') {
        Some(at) if at + 1 < answer.len() => &answer[..=at],
        _ => answer,
    }
}

/// The mark in a judge's reply; `None` where there is none. Upstream takes any whole number, which [`points`] brings between 1
/// and 5; the tolerant reading takes 1 to 5 alone.
#[must_use]
pub(crate) fn mark(reply: &str, protocol: Protocol) -> Option<i64> {
    upstream(reply).or_else(|| match protocol {
        Protocol::Upstream => None,
        Protocol::Tolerant => tolerant(reply),
    })
}

/// `output.isdigit()`, else what stands behind the first "Your mark:" on its line.
fn upstream(reply: &str) -> Option<i64> {
    const CUE: &str = "Your mark:";
    if !reply.is_empty() && reply.bytes().all(|byte| byte.is_ascii_digit()) {
        return reply.parse().ok();
    }
    let behind = &reply[reply.find(CUE)? + CUE.len()..];
    let line = behind.split('\n').next().unwrap_or(behind);
    line.trim().parse().ok()
}

/// One digit from 1 to 5 alone, or behind a cue, with marks of writing about it.
fn tolerant(reply: &str) -> Option<i64> {
    let lower = reply.to_lowercase();
    let behind = ["your mark", "mark", "score", "rating"]
        .iter()
        .find_map(|cue| Some(&lower[lower.rfind(cue)? + cue.len()..]))
        .unwrap_or(&lower);
    let dressing = |c: char| c.is_whitespace() || "*_`:=\"'().[]".contains(c);
    let bare = behind.trim_matches(dressing);
    let bare = bare
        .strip_prefix("is ")
        .unwrap_or(bare)
        .trim_matches(dressing);
    let bare = bare
        .strip_suffix("/5")
        .or_else(|| bare.strip_suffix(" out of 5"))
        .unwrap_or(bare)
        .trim_matches(dressing);
    match bare.as_bytes() {
        [digit @ b'1'..=b'5'] => Some(i64::from(digit - b'0')),
        _ => None,
    }
}

/// What one item is worth, between 0 and 1: (clip(mark, 1, 5) − 1) / 4; an answer that was not given is worth 0, unjudged.
#[must_use]
pub(crate) fn points(mark: Option<i64>) -> f64 {
    mark.map_or(0.0, |mark| (mark.clamp(1, 5) - 1) as f64 / 4.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_are_cut_as_upstream_cuts_them() {
        for (answer, judged) in [
            ("The door is open. It also", "The door is open."),
            ("about 1.5 meters", "about 1."),
            ("no full stop", "no full stop"),
            ("Ends here.", "Ends here."),
            ("One. Two.", "One. Two."),
            ("", ""),
            ("Größe. ü", "Größe."),
        ] {
            assert_eq!(shortened(answer), judged, "{answer:?}");
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
        // Upstream takes whatever number there is, and clips it.
        assert_eq!(mark("17", Protocol::Upstream), Some(17));
        assert_eq!(mark("Your mark: -3", Protocol::Upstream), Some(-3));
    }

    #[test]
    fn points_are_upstreams() {
        let marks = [Some(5), Some(5), Some(3), Some(1), None];
        let score = 100.0 * marks.into_iter().map(points).sum::<f64>() / 5.0;
        assert!((score - 50.0).abs() < 1e-12);
        assert!((points(Some(17)) - 1.0).abs() < 1e-12 && points(Some(-3)).abs() < 1e-12);
    }
}
