//! Sections of a reply under headings: [`last_section`] finds the answer after a section of thoughts.

use std::sync::LazyLock;

use regex::Regex;

use super::clean::{compiled, is_blank};
use super::marks::{MarkWords, Meaning};

use darkqa_base::types::questions::UnreadReason;

/// A line that is a heading: `### Title`, `**Title:** text`, `[TITLE]`. The text after the colon of a heading belongs
/// to its section.
static HEADING: LazyLock<Regex> = LazyLock::new(|| {
    compiled(concat!(
        r"(?m)^[ \t]*(?:#{1,6}[ \t]+(?P<hash>[^\n:：]{1,60}?)[ \t#]*(?:[:：]|$)",
        r"|\*\*(?P<bold>[^*\n:：]{1,40})(?:[:：][ \t]*\*\*|\*\*[ \t]*[:：]|\*\*[ \t]*$)",
        r"|\[(?P<bracket>[\p{L} _-]{3,40})\][ \t]*$)"
    ))
});

/// A heading with the place of its section.
struct Heading {
    start: usize,
    content: usize,
    meaning: Meaning,
    /// True for `**Title**`, which may also be an emphasized answer.
    is_bold: bool,
}

/// The section with the answer, in a text that begins with another section; `None` if the whole text may be the answer.
///
/// The last section under the heading of an answer counts. Without such a heading, the last section counts if it is an
/// answer and nothing else, and no other section is; otherwise the text after a section of thoughts.
///
/// # Errors
/// If nothing follows the heading of the answer.
pub(super) fn last_section<'t>(
    text: &'t str,
    words: &MarkWords,
    is_answer: &dyn Fn(&str) -> bool,
) -> Result<Option<&'t str>, UnreadReason> {
    let headings = headings(text, words);
    let [first, .., _] = &headings[..] else {
        return Ok(None);
    };
    let is_thought = first.meaning == Meaning::Thought;
    if first.start > 0 || first.meaning == Meaning::Answer || (first.is_bold && !is_thought) {
        return Ok(None);
    }
    let section = |index: usize| {
        let end = headings.get(index + 1).map_or(text.len(), |next| next.start);
        text[headings[index].content..end].trim_matches(is_blank)
    };
    let titled = headings.iter().rposition(|heading| heading.meaning == Meaning::Answer);
    if let Some(titled) = titled {
        return match section(titled) {
            "" => Err(UnreadReason::Truncated),
            answer => Ok(Some(answer)),
        };
    }
    let others = headings.len() - 1;
    if is_answer(section(others)) && !(0..others).any(|index| is_answer(section(index))) {
        return Ok(Some(section(others)));
    }
    Ok(is_thought.then(|| text[headings[1].start..].trim_matches(is_blank)))
}

fn headings(text: &str, words: &MarkWords) -> Vec<Heading> {
    // Every heading has one of these.
    if !text.contains(['#', '*', '[']) {
        return Vec::new();
    }
    HEADING
        .captures_iter(text)
        .filter_map(|found| {
            let whole = found.get(0)?;
            let bold = found.name("bold");
            let title = found.name("hash").or(bold).or(found.name("bracket"))?;
            let meaning = words.title_meaning(title.as_str());
            let is_bold = bold.is_some();
            let heading = Heading { start: whole.start(), content: whole.end(), meaning, is_bold };
            (!is_bold || meaning != Meaning::Other).then_some(heading)
        })
        .collect()
}
