//! [`questioned`]: ranges of a text in which choices are questioned.

use super::scope::ends_scope;
use crate::choice::name_index::Names;
use crate::choice::text::words::Role;
use crate::choice::text::{Boundary, Clauses, Ranges};

/// Ranges of sentences with a question mark, and of the words after phrases such as "whether" and "you asked". A reply
/// that is only a name with a question mark is an unsure answer and not a question.
pub(crate) fn questioned(clauses: &Clauses<'_>, names: &Names<'_>) -> Ranges {
    let mut ranges = Vec::new();
    let (mut sentence, mut open) = (0, None);
    let is_unsure_answer = is_bare_name(clauses, names);
    for (at, element) in clauses.elements.iter().enumerate() {
        if ends_scope(clauses, names, open, at) {
            ranges.extend(open.take().map(|start| (start, element.start)));
        }
        if clauses.is_sign(at, &['?', '？', '؟']) && !is_unsure_answer {
            ranges.push((sentence, element.end));
        }
        if element.boundary == Boundary::Sentence {
            sentence = element.end;
        }
        if element.has(Role::Question) {
            open.get_or_insert(element.end);
        }
    }
    ranges.extend(open.map(|start| (start, clauses.folded.len())));
    Ranges::new(ranges)
}

/// True if the text is a name with question marks: "Kitchen?", "(B)?", "B. kitchen?", "The kitchen?".
fn is_bare_name(clauses: &Clauses<'_>, names: &Names<'_>) -> bool {
    let text = clauses.folded.trim_end_matches(['?', '？', '؟', '!', '.', ' ']);
    if text.len() == clauses.folded.len() {
        return false;
    }
    let text_end = text.trim_end_matches([')', ']']).len();
    if names.text_at(0).is_some_and(|name| name.end == text_end) {
        return true;
    }
    let letter = names.letters.first().filter(|letter| text[..letter.start].trim_matches(['(', '[', ' ']).is_empty());
    letter.is_some_and(|letter| {
        let text = names.labelled_text(letter);
        letter.end == text_end || text.is_some_and(|text| text.end == text_end)
    })
}
