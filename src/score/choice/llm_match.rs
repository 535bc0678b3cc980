//! LLM-Match, OpenEQA's score of open answers by a judge model (Majumdar et al. 2024, CVPR, section 4): truncation of
//! an answer, parsing of a mark, and points of a mark. It follows `facebookresearch/open-eqa` at cfa3fce.
//!
//! The tolerant parsing of a judge's reply ([`tolerant_mark`]): a mark from 1 to 5 where a person finds one.
//!
//! The first form that occurs decides: JSON, a box or tag, a label ("Your mark: 4"), the only number, a fraction ("4
//! out of 5"), a verb ("deserves a 4"). Two different marks in the same form, and ranges, fractions and other maxima
//! ("4 or 5", "4.5", "4/10") are no mark.

use std::sync::LazyLock;

use clap::ValueEnum;
use regex::Regex;
use serde_json::Value;

use super::text::reasoning::{Asked, separate};
use crate::choice::text::plain::{compiled, tidy};
use darkqa_base::types::flags::flag_words;

/// Words for a mark.
macro_rules! cue {
    () => {
        r"(?:mark|score|rating|grade|points?|评分|分数|得分|评级)"
    };
}

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
        Protocol::Tolerant => tolerant_mark(text),
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

/// A key of JSON whose value is the mark.
static KEY: LazyLock<Regex> =
    LazyLock::new(|| compiled(concat!(r"(?i)\A.*", cue!(), r"\z|\A(?:answer|result|verdict)\z")));

/// The range of marks, as prompts and labels state it.
static SCALE: LazyLock<Regex> = LazyLock::new(|| {
    compiled(
        r"(?i)\(\s*(?:out )?of 5\s*\)|[(\[]\s*1\s*(?:-|–|—|to)\s*5\s*[)\]]|\b(?:on )?(?:a |the )?scale (?:of|from) (?:1 )?(?:-|–|to) 5|\b(?:on )?(?:a |the )?(?:scale )?(?:of |from )?1 ?(?:-|–|to) ?5\b",
    )
});

/// A mark in a box, double brackets or a tag.
static BOXED: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?i)\\boxed\s*\{(?P<box>[^{}]*)\}|\[\[(?P<double>[^\[\]]*)\]\]|<(?:\w*[_-])?",
        cue!(),
        r">(?P<tag>[^<>]*)</|<answer>(?P<answer>[^<>]*)</answer>"
    ))
});

/// The label of upstream's prompt, with what follows.
static YOUR_MARK: LazyLock<Regex> = LazyLock::new(|| compiled(r"(?i)\byour\W{0,3}mark\b(?P<after>.*)"));

/// Another label at the start of a line or sentence, with what follows: "Score: 4", "The rating is 4".
static LABEL: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?im)(?:^|[.!?]\s)\W{0,6}(?:(?:final|overall|total|the|my|llm|match)\W{1,3}){0,3}",
        cue!(),
        r"(?P<after>\W{0,3}(?:is|[:：=]).*|\W{0,3}$|\W{1,4}\d.*)"
    ))
});

/// A fraction of 5.
static FRACTION: LazyLock<Regex> =
    LazyLock::new(|| compiled(r"(?i)(?P<after>\b\d+(?:[.,]\d+)?\s*(?:/\s*5|out of 5|of 5)\b.*)"));

/// A verb of marking, with what follows.
static VERB: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?i)\b(?:give|assign|award|deserve|merit|earn|rate|grade|mark)[sd]?\b(?P<after>(?:\W+(?:it|this|that|the|a|an|my|with|as|at|of|response|answer|",
        cue!(),
        r")){0,6}\W+\d.*)"
    ))
});

/// Words that make a sentence say what the mark is not, or might be.
static HEDGE: LazyLock<Regex> = LazyLock::new(|| {
    compiled(
        r"(?i)\b(?:not|never|cannot|\w+n['’]t|too|between|either|if|than|instead|need|needs|require|requires|could|might|maybe|perhaps)\b|\bwould be\b",
    )
});

/// A number at the start of a text, after words and signs that belong to a label.
static NUMBER: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?i)\A(?:[\s*_`:：=|~$>#\x22'“”‘’(\[{\\)\]-]|\b(?:is|a|an|the|of|it|this|that|with|as|at|my|would be|should be|for|response|answer|equals|",
        cue!(),
        r")\b)*(?P<number>\d+)(?P<fraction>[.,]\d+)?(?P<rest>.*)"
    ))
});

/// A maximum after a mark: "/5", "out of 10".
static MAXIMUM: LazyLock<Regex> =
    LazyLock::new(|| compiled(r"(?i)\A[\s*_`)\]]*(?:/|out of|of)\s*[*_`]*(?P<maximum>\d+)(?P<rest>.*)"));

/// A second number after a mark: "4-5", "4 or 5".
static RANGE: LazyLock<Regex> = LazyLock::new(|| {
    compiled(
        r"(?i)\A[\s*_`)\](]*(?:-|–|—|~|～|to|or|and|,|maybe|perhaps|[,(]?\s*(?:or|maybe|perhaps))\s*(?:maybe |perhaps |a )?[*_`]*\d",
    )
});

/// The mark in the reply of a judge, without its thoughts.
fn tolerant_mark(reply: &str) -> Option<i64> {
    let tidy = tidy(reply);
    if let Some(Stated(found)) = json(&tidy) {
        return found;
    }
    let text = SCALE.replace_all(&tidy, " ");
    for (form, groups) in [(&BOXED, &["box", "double", "tag", "answer"][..]), (&YOUR_MARK, &["after"][..])] {
        let found: Vec<Option<i64>> = form
            .captures_iter(&text)
            .filter_map(|found| groups.iter().find_map(|group| found.name(group)))
            .map(|after| number(after.as_str()))
            .collect();
        if !found.is_empty() {
            return common(&found);
        }
    }
    None.or_else(|| in_sentences(&text, &LABEL))
        .or_else(|| at_an_end(&text))
        .or_else(|| in_sentences(&text, &FRACTION))
        .or_else(|| in_sentences(&text, &VERB))?
        .0
}

/// The marks that a reply states in one form; `None` in it if they differ.
struct Stated(Option<i64>);

/// The marks after a pattern in the sentences that state them; `None` without any.
fn in_sentences(text: &str, pattern: &Regex) -> Option<Stated> {
    let found: Vec<Option<i64>> = text
        .lines()
        .flat_map(sentences)
        .filter(|sentence| !HEDGE.is_match(sentence))
        .filter_map(|sentence| Some(number(pattern.captures(sentence)?.name("after")?.as_str())))
        .collect();
    (!found.is_empty()).then(|| Stated(common(&found)))
}

/// The sentences of a line. A full stop inside a number ends none.
fn sentences(line: &str) -> impl Iterator<Item = &str> {
    line.split_inclusive(". ").flat_map(|part| part.split_inclusive(['!', '?', ';']))
}

/// The mark that the reply begins or ends with: "4 - close", or 4 on the last line.
fn at_an_end(text: &str) -> Option<Stated> {
    let lines = || text.lines().map(|line| line.trim_matches(is_sign)).filter(|line| !line.is_empty());
    let first = lines().next()?;
    let last = lines().next_back()?;
    let is_alone = |line: &str| !line.is_empty() && line.chars().all(|c| c.is_ascii_digit());
    if is_alone(last) {
        return Some(Stated(number(last)));
    }
    let digits = first.find(|c: char| !c.is_ascii_digit()).unwrap_or(first.len());
    let after = first[digits..].trim_start();
    let is_explained =
        after.is_empty() || after.starts_with([':', '：', '-', '–', '—', '.', ',', '(', '/', '*', '_', '`', ')', '"']);
    (digits > 0 && is_explained).then(|| Stated(number(first)))
}

/// The marks in JSON objects under a key for a mark; `None` without any.
fn json(text: &str) -> Option<Stated> {
    let (mut found, mut from) = (Vec::new(), 0);
    while let Some(at) = text[from..].find('{') {
        let start = from + at;
        let mut values = serde_json::Deserializer::from_str(&text[start..]).into_iter::<Value>();
        from = match values.next() {
            Some(Ok(value)) => {
                let fields = value.as_object().into_iter().flatten();
                found.extend(fields.filter(|(key, _)| KEY.is_match(key)).map(|(_, value)| value_mark(value)));
                start + values.byte_offset()
            }
            _ => start + 1,
        };
    }
    (!found.is_empty()).then(|| Stated(common(&found)))
}

fn value_mark(value: &Value) -> Option<i64> {
    match value {
        Value::Number(number) => {
            let whole = number.as_f64().filter(|number| number.fract() == 0.0)? as i64;
            (1..=5).contains(&whole).then_some(whole)
        }
        Value::String(text) => number(text),
        _ => None,
    }
}

/// The mark on which all agree.
fn common(found: &[Option<i64>]) -> Option<i64> {
    let first = *found.first()?;
    found.iter().all(|mark| *mark == first).then_some(first)?
}

/// The mark at the start of a text; `None` for a number that is no mark from 1 to 5, and if another follows it.
fn number(text: &str) -> Option<i64> {
    let found = NUMBER.captures(text)?;
    let is_whole = found.name("fraction").is_none_or(|fraction| fraction.as_str()[1..].chars().all(|c| c == '0'));
    let mut rest = found.name("rest")?.as_str();
    if let Some(maximum) = MAXIMUM.captures(rest) {
        if &maximum["maximum"] != "5" {
            return None;
        }
        rest = maximum.name("rest")?.as_str();
    }
    let is_word = rest.starts_with(|c: char| c.is_alphanumeric() && c.is_ascii());
    if !is_whole || is_word || RANGE.is_match(rest) {
        return None;
    }
    found["number"].parse().ok().filter(|mark| (1..=5).contains(mark))
}

/// True for blanks and markup around a mark.
fn is_sign(c: char) -> bool {
    c.is_whitespace() || "*_`:=\"'()[]#>".contains(c)
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
