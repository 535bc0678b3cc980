//! [`ReplyView`]: a plain text with every mention of a choice, and the state of each mention.
//!
//! A mention is called a name: the letter or the text of a choice.
//!
//! The texts of choices in a reply: [`texts`].

use super::choice_views::{ChoiceViews, Naming};
use super::letters::letters;
use super::name_index::Names;
use super::names::{Delimiting, Name, NameState, is_part_of_number, is_same_word};
use super::states::{conditional, denied, excluded, image_colors, questioned, repetitions};
use super::text::{Clauses, RANGE, Ranges, Token, TokenKind, tokens};
use crate::choice::states::denials;
use crate::choice::text::tokens::{Role, phrase_at};

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

/// An occurrence of the text of a choice, before overlaps are resolved.
struct Occurrence {
    start: usize,
    end: usize,
    choice: usize,
    /// True if the spaces differ from those of the choice: "livingroom".
    is_respaced: bool,
}

/// Every choice's text that occurs as whole words, from left to right. Longer texts take precedence. A hyphen counts as
/// a space, and spaces may be removed or inserted between two words: "living-room", "livingroom", "arm chair". A
/// thing's name that only modifies another noun is ignored: "table-lamp", "TV stand".
pub(super) fn texts(text: &str, folded: &str, tokens: &[Token], offered: &ChoiceViews) -> Vec<Name> {
    let mut candidates = exact(folded, offered);
    candidates.extend(respaced(folded, tokens, offered));
    candidates.sort_by_key(|c| (std::cmp::Reverse(c.end - c.start), c.start, c.is_respaced, c.choice));
    let mut covered = vec![false; folded.len()];
    let mut names: Vec<Name> = Vec::new();
    let mut last = (0, 0, false);
    for candidate in candidates {
        let span = candidate.start..candidate.end;
        // Two choices may differ only in markup or spelling; then every occurrence names both.
        let is_twin = last == (span.start, span.end, candidate.is_respaced);
        if !is_twin && covered[span.clone()].contains(&true) {
            continue;
        }
        covered[span.clone()].fill(true);
        last = (span.start, span.end, candidate.is_respaced);
        names.push(Name {
            start: span.start,
            end: span.end,
            choice: Some(candidate.choice),
            delimiting: Delimiting::Plain,
            state: NameState::Affirmed,
        });
    }
    names.sort_by_key(|name| name.start);
    names.iter().filter(|name| !is_modifier(text, folded, tokens, name, &names, offered)).copied().collect()
}

/// Occurrences of the texts as they are spelled.
fn exact(folded: &str, offered: &ChoiceViews) -> Vec<Occurrence> {
    let mut candidates = Vec::new();
    for (text, choice) in &offered.folded {
        for (start, _) in folded.match_indices(text.as_str()) {
            let end = start + text.len();
            if stands_alone(folded, start, end) {
                candidates.push(Occurrence { start, end, choice: *choice, is_respaced: false });
            }
        }
    }
    candidates
}

/// Minimum number of bytes of each part, if a word is written as two.
const MIN_PART: usize = 3;

/// Occurrences of the texts with a space removed ("livingroom") or inserted ("arm chair").
fn respaced<'a>(
    folded: &'a str,
    tokens: &'a [Token],
    offered: &'a ChoiceViews,
) -> impl Iterator<Item = Occurrence> + 'a {
    let longest = offered.joined.keys().map(String::len).max().unwrap_or(0);
    tokens.iter().enumerate().flat_map(move |(at, token)| {
        let word = token.slice(folded);
        if longest == 0 || token.kind != TokenKind::Word || word.len() > longest {
            return Vec::new();
        }
        let mut found = joined_choices(offered, word, token.start, token.end);
        if let Some(next) = tokens.get(at + 1).filter(|next| next.start == token.end + 1) {
            let second = next.slice(folded);
            let fits = word.len().min(second.len()) >= MIN_PART && word.len() + second.len() <= longest;
            if fits && folded.as_bytes()[token.end] == b' ' {
                let letters = format!("{word}{second}");
                found.extend(joined_choices(offered, &letters, token.start, next.end));
            }
        }
        found
    })
}

/// A candidate at `start..end` for each choice that consists of these letters, ignoring spaces.
fn joined_choices(offered: &ChoiceViews, letters: &str, start: usize, end: usize) -> Vec<Occurrence> {
    offered
        .joined
        .get(letters)
        .into_iter()
        .flatten()
        .map(|&choice| Occurrence { start, end, choice, is_respaced: true })
        .collect()
}

/// True if a span is not part of a word or a number, not an article, and not a "no" before a noun.
fn stands_alone(folded: &str, start: usize, end: usize) -> bool {
    let span = &folded[start..end];
    let (before, after) = (folded[..start].chars().next_back(), folded[end..].chars().next());
    let inside = is_same_word(before, span.chars().next()) || is_same_word(span.chars().next_back(), after);
    let article = span.len() == 1 && matches!(span, "a" | "i") && after == Some(' ');
    let determiner = span == "no" && !denials::is_answer(folded, start, end);
    !inside && !article && !determiner && !is_part_of_number(folded, start, end)
}

/// True if a thing's name only modifies the noun after it: always before a hyphen, and after a space only before a
/// listed noun. A hyphen or dash between two choices joins two names instead.
fn is_modifier(text: &str, folded: &str, tokens: &[Token], name: &Name, names: &[Name], offered: &ChoiceViews) -> bool {
    let is_thing = name.choice.is_some_and(|choice| offered.naming[choice] == Naming::Thing);
    if !is_thing {
        // "Brown-ish" is not brown, but "white-framed" is white.
        let suffix = folded[name.end..].strip_prefix(' ').unwrap_or_default();
        return text[name.end..].starts_with(['-', RANGE]) && (suffix.starts_with("ish") || suffix.starts_with("like"));
    }
    let mut after = text[name.end..].chars();
    let (joint, next) = (after.next(), after.next());
    let compound = matches!(joint, Some('-' | RANGE)) && next.is_some_and(char::is_alphabetic);
    if !compound && joint != Some(' ') {
        return false;
    }
    let after = tokens.partition_point(|token| token.start <= name.end);
    let next = tokens.get(after).filter(|next| next.start == name.end + 1);
    let is_head = next
        .and_then(|next| phrase_at(folded, std::slice::from_ref(next)))
        .is_some_and(|(_, roles)| roles.has(Role::Head));
    // "Kitchen-cum-bathroom" is both.
    let joins = next.is_some_and(|next| matches!(next.slice(folded), "cum" | "and" | "or"));
    let named = joins || names.binary_search_by_key(&(name.end + 1), |name| name.start).is_ok();
    match joint {
        Some(' ') => is_head,
        Some(RANGE) => !named,
        _ => is_head || !named,
    }
}
