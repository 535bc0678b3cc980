//! Stretches of a text in which names are questioned: [`questioned`].

use super::reach::ends;
use crate::named::Names;
use crate::text::words::Role;
use crate::text::{Boundary, Clauses, Ranges};

/// The sentences with a question mark, and what follows "whether", "you asked" and their like. A whole reply that is a bare
/// name with a question mark is a shy answer, and asks nothing.
pub(crate) fn questioned(clauses: &Clauses<'_>, names: &Names<'_>) -> Ranges {
    let mut ranges = Vec::new();
    let (mut sentence, mut open) = (0, None);
    let shy = is_bare_name(clauses, names);
    for (at, element) in clauses.elements.iter().enumerate() {
        if ends(clauses, names, open, at) {
            ranges.extend(open.take().map(|start| (start, element.start)));
        }
        if clauses.is_sign(at, &['?', '？', '؟']) && !shy {
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

/// Whether the text is a name and question marks: "Kitchen?", "(B)?", "B. kitchen?", "The kitchen?".
fn is_bare_name(clauses: &Clauses<'_>, names: &Names<'_>) -> bool {
    let text = clauses
        .folded
        .trim_end_matches(['?', '？', '؟', '!', '.', ' ']);
    if text.len() == clauses.folded.len() {
        return false;
    }
    let text_end = text.trim_end_matches([')', ']']).len();
    let fills = |start: usize| {
        names
            .text_at(start)
            .is_some_and(|name| name.end == text_end)
    };
    let letter = names.letters.first().filter(|letter| {
        text[..letter.start]
            .trim_matches(['(', '[', ' '])
            .is_empty()
    });
    let labelled = letter.is_some_and(|letter| {
        let text = names.labelled_text(letter);
        letter.end == text_end || text.is_some_and(|text| text.end == text_end)
    });
    labelled || fills(0)
}
