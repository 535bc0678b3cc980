//! [`ReplyView`]: a plain text with every mention of a choice, and the state of each mention.
//!
//! A mention is called a name: the letter or the text of a choice.

use super::choice_views::ChoiceViews;
use super::letters::letters;
use super::name_index::Names;
use super::names::{Delimiting, Name, NameState};
use super::states::{conditional, denied, excluded, image_colors, questioned, repetitions};
use super::text::{Clauses, Ranges, tokens};
use super::texts::texts;

/// A plain text and the names of choices in it.
pub(super) struct ReplyView<'a> {
    pub(super) text: &'a str,
    /// The text in lower case, with the same byte positions.
    pub(super) folded: &'a str,
    /// The choices of the question.
    pub(super) offered: &'a ChoiceViews,
    /// The words, phrases and clauses.
    pub(super) clauses: Clauses<'a>,
    /// The names of choices, each with its state.
    pub(super) names: Names<'a>,
    scopes: Scopes,
}

/// Ranges of the text in which a name is not simply affirmed.
struct Scopes {
    repeated: Ranges,
    questioned: Ranges,
    conditional: Ranges,
    image_color: Ranges,
    excluded: Ranges,
    denied: Ranges,
}

impl Scopes {
    /// State of a name that begins at a byte. The first rule that applies decides.
    fn state(&self, byte: usize) -> NameState {
        let states = [
            (&self.repeated, NameState::Repeated),
            (&self.questioned, NameState::Questioned),
            (&self.conditional, NameState::Conditional),
            (&self.image_color, NameState::ImageColor),
            (&self.excluded, NameState::Excluded),
            (&self.denied, NameState::Denied),
        ];
        states.iter().find(|(ranges, _)| ranges.contain(byte)).map_or(NameState::Affirmed, |(_, state)| *state)
    }
}

impl<'a> ReplyView<'a> {
    /// The view of a text; `folded` is [`fold`](super::text::fold) of it.
    pub(super) fn new(text: &'a str, folded: &'a str, offered: &'a ChoiceViews) -> Self {
        let tokens = tokens(folded);
        let mut clauses = Clauses::new(folded, &tokens);
        let texts = texts(text, folded, &tokens, offered);
        let mut letters = letters(text, offered.texts.len(), &clauses);
        letters.retain(|letter| !is_within(letter, &texts));
        let mut names = Names { text, folded, letters, texts };
        for letter in &names.letters {
            let has_sign = text[letter.end..].starts_with(['.', ':']);
            if has_sign && names.labelled_text(letter).is_some() {
                clauses.remove_boundary(letter.end);
            }
        }
        let scopes = Scopes {
            repeated: repetitions(&names, offered),
            questioned: questioned(&clauses, &names),
            conditional: conditional(&clauses),
            image_color: image_colors(&clauses, &names.texts, offered),
            excluded: excluded(&clauses, &names),
            denied: denied(&clauses, &names),
        };
        names.set_states(|name| scopes.state(name.start));
        Self { text, folded, offered, clauses, names, scopes }
    }

    /// State of a name that begins at a byte.
    pub(super) fn state(&self, byte: usize) -> NameState {
        self.scopes.state(byte)
    }

    /// The affirmed letters that are delimited from the words around them.
    pub(super) fn affirmed_letters(&self) -> impl Iterator<Item = &Name> + Clone {
        self.names.letters.iter().filter(|name| name.is_affirmed() && name.delimiting > Delimiting::Loose)
    }

    /// The affirmed texts.
    pub(super) fn affirmed_texts(&self) -> impl Iterator<Item = &Name> + Clone {
        self.names.texts.iter().filter(|name| name.is_affirmed())
    }
}

/// True if a letter is inside the text of a choice.
fn is_within(letter: &Name, texts: &[Name]) -> bool {
    let after = texts.partition_point(|name| name.start <= letter.start);
    texts[..after].last().is_some_and(|name| name.end > letter.end)
}
