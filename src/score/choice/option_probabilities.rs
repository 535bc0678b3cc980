//! The probability of each choice, from the token probabilities of a reply: [`option_probabilities`].

use std::ops::Range;

use darkqa_base::types::questions::letter;
use darkqa_base::types::{OptionProbabilities, Thought, TokenChances, TokenPosition};

/// The answer must begin within this many tokens; chosen.
const FIRST_TOKENS: usize = 8;

/// Minimum total probability of the tokens that name a choice; chosen. Below it, the model did not begin with a choice.
const MIN_MASS: f64 = 0.5;

/// Probabilities are rounded to multiples of its inverse, six decimals.
const SCALE: f64 = 1e6;

/// Maximum length of a stored token, in characters.
const MAX_TOKEN_CHARS: usize = 40;

/// The probabilities of these choices in the order shown; `None` if the reply does not begin with one.
///
/// The tokens are taken from the first position that is more than white space, brackets, punctuation or the word
/// “Answer”; in a JSON object, from the start of its value. A token counts for the choice of its letter, ignoring case,
/// spaces and brackets (“ B”, “(b”). If tokens of letters have too little probability, a token counts for the only
/// choice whose text begins with it. The probabilities are scaled to a sum of 1.
pub fn option_probabilities(chances: &TokenChances, choices: &[String]) -> Option<OptionProbabilities> {
    let position = &chances.positions[answer_position(&chances.positions)?];
    let letters = masses(position, choices.len(), |token| choice_by_letter(token, choices.len()));
    let masses = if letters.iter().sum::<f64>() >= MIN_MASS {
        letters
    } else {
        masses(position, choices.len(), |token| choice_by_text(token, choices))
    };
    let mass: f64 = masses.iter().sum();
    if mass < MIN_MASS {
        return None;
    }
    Some(OptionProbabilities {
        p: masses.iter().map(|own| round(own / mass)).collect(),
        mass: round(mass),
        bound: round(bound(position)),
        token: position.token.chars().take(MAX_TOKEN_CHARS).collect(),
        reasoned: chances.thought == Thought::Before,
    })
}

fn round(value: f64) -> f64 {
    (value * SCALE).round() / SCALE
}

/// The index of the position at which the answer begins; `None` if the reply does not begin with an answer.
fn answer_position(positions: &[TokenPosition]) -> Option<usize> {
    let first = positions.iter().position(|at| !is_before_answer(&at.token)).filter(|index| *index < FIRST_TOKENS);
    let whole: String = positions.iter().map(|at| at.token.as_str()).collect();
    if !whole.trim_start().starts_with('{') {
        return first;
    }
    let value = answer_value(&whole)?;
    positions
        .iter()
        .scan(0, |end, at| {
            *end += at.token.len();
            Some(*end)
        })
        .enumerate()
        .find(|(_, end)| *end > value.start)
        .map(|(index, _)| index)
}

/// The byte range of the value of `"answer"` in the beginning of a JSON object, without the opening quotation mark.
fn answer_value(object: &str) -> Option<Range<usize>> {
    const FIELD: &str = "\"answer\"";
    let field = object.find(FIELD)? + FIELD.len();
    let after = object.get(field..)?;
    let start = after.find(|c: char| !c.is_whitespace() && c != ':' && c != '"')?;
    Some(field + start..object.len())
}

/// True for a token that may precede an answer: only white space and punctuation, or the word “Answer”.
fn is_before_answer(token: &str) -> bool {
    let bare = bare(token);
    bare.is_empty() || bare == "answer" || bare == "answer:"
}

/// A token in lower case, without surrounding white space, brackets, quotation marks, punctuation and tokenizer marks
/// for a space (`Ġ` of byte-level BPE, `▁` of SentencePiece).
fn bare(token: &str) -> String {
    const AROUND: &str = "\"'`“”‘’*#([{<.:,)]}>\u{120}\u{2581}\u{10a}";
    token.trim_matches(|c: char| c.is_whitespace() || AROUND.contains(c)).to_lowercase()
}

/// The choice whose letter is the token.
fn choice_by_letter(token: &str, choices: usize) -> Option<usize> {
    (0..choices).find(|index| letter(*index).to_lowercase().eq(token.chars()))
}

/// The only choice whose text begins with the token. A token of one letter must be the whole text.
fn choice_by_text(token: &str, choices: &[String]) -> Option<usize> {
    let mut named = choices.iter().enumerate().filter(|(_, text)| {
        let text = text.to_lowercase();
        text == token || (token.chars().count() > 1 && text.starts_with(token))
    });
    let (index, _) = named.next()?;
    named.next().is_none().then_some(index)
}

/// The sum of the token probabilities for each choice; `option` returns the choice of a token.
fn masses(position: &TokenPosition, choices: usize, option: impl Fn(&str) -> Option<usize>) -> Vec<f64> {
    let mut masses = vec![0.0; choices];
    for (token, logprob) in &position.likeliest {
        if let Some(index) = option(&bare(token)) {
            masses[index] += libm::exp(*logprob);
        }
    }
    masses
}

/// Upper bound for the probability of an unlisted token: the probability of the least likely listed token, and at most
/// 1 minus the sum of the listed ones.
fn bound(position: &TokenPosition) -> f64 {
    let listed = position.likeliest.iter().map(|(_, logprob)| libm::exp(*logprob));
    let least = listed.clone().fold(f64::INFINITY, f64::min);
    let rest = (1.0 - listed.sum::<f64>()).max(0.0);
    least.min(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(token: &str, likeliest: &[(&str, f64)]) -> TokenPosition {
        TokenPosition {
            token: token.to_owned(),
            likeliest: likeliest.iter().map(|(token, logprob)| ((*token).to_owned(), *logprob)).collect(),
        }
    }

    fn read(positions: &[TokenPosition], choices: &[&str]) -> Option<OptionProbabilities> {
        let choices: Vec<String> = choices.iter().map(|&text| text.to_owned()).collect();
        let chances = TokenChances { positions: positions.to_vec(), thought: Thought::None };
        option_probabilities(&chances, &choices)
    }

    const FOUR: [&str; 4] = ["chair", "table", "lamp", "bed"];

    #[test]
    fn tokens_of_a_letter_are_added_up_and_scaled() {
        // e^-0.1 + e^-3.0 of B, e^-3.2 of A, e^-5.0 of C; e^-6.0 names no choice.
        let position = at("B", &[("B", -0.1), (" B", -3.0), ("A", -3.2), ("C", -5.0), ("The", -6.0)]);
        let options = read(&[position], &FOUR).unwrap();
        let masses = [(-3.2_f64).exp(), (-0.1_f64).exp() + (-3.0_f64).exp(), (-5.0_f64).exp()];
        let mass: f64 = masses.iter().sum();
        for (p, own) in options.p.iter().zip(masses) {
            assert!((p - own / mass).abs() < 1e-6, "{options:?}");
        }
        assert!(options.p[3] == 0.0);
        assert!((options.mass - mass).abs() < 1e-6);
        // An unlisted token has at most the remaining probability; e^-6.0 is less or more than that.
        let rest = 1.0 - mass - (-6.0_f64).exp();
        assert!((options.bound - rest.max(0.0).min((-6.0_f64).exp())).abs() < 1e-6);
        assert!((options.confidence() - options.p[1]).abs() < 1e-12);
    }

    #[test]
    fn answer_may_follow_marks() {
        for before in [
            &[][..],
            &["\n", "**", "("],
            &["Answer", ":", " "],
            &["\u{120}", "\u{2581}"],
            &["{\"", "answer", "\":", " \""],
            &["{", "\n", "  ", "\"answer\"", ": ", "\""],
        ] {
            let options = read(&with_answer(before), &FOUR);
            assert!(options.is_some_and(|o| o.p[1] > 0.9), "{before:?}");
        }
        // A quotation mark may be in the token of the letter.
        let quoted = [at("{\"answer\":", &[]), at("\"B", &[("\"B", -0.01)])];
        assert!(read(&quoted, &FOUR).is_some());
        // Replies that do not begin with a choice have no probabilities of choices.
        for before in [&["The", " answer", " is"][..], &[" "; 8]] {
            assert_eq!(read(&with_answer(before), &FOUR), None, "{before:?}");
        }
        assert_eq!(read(&[], &FOUR), None);
        assert_eq!(read(&[at("{\"", &[]), at("why", &[])], &FOUR), None);
    }

    /// Positions with these tokens, then one with the answer B.
    fn with_answer(tokens: &[&str]) -> Vec<TokenPosition> {
        tokens.iter().map(|token| at(token, &[(*token, 0.0)])).chain([at("B", &[("B", -0.01), ("A", -5.0)])]).collect()
    }

    #[test]
    fn every_spelling_of_a_letter_counts() {
        for token in ["B", " B", "b", "B.", "(B", "(B)", "\u{120}B", "\u{2581}b", "**B", "\"B\"", "B:"] {
            let options = read(&[at(token, &[(token, -0.2)])], &FOUR).unwrap();
            assert_eq!(options.p, [0.0, 1.0, 0.0, 0.0], "{token}");
        }
        for token in ["E", "BB", "Because", "1"] {
            assert_eq!(read(&[at(token, &[(token, -0.2)])], &FOUR), None, "{token}");
        }
    }

    #[test]
    fn texts_count_where_no_letter_is_named() {
        let position = at("Yes", &[("Yes", -0.5), ("no", -1.2), (" no", -3.0)]);
        let options = read(&[position], &["yes", "no"]).unwrap();
        let no = (-1.2_f64).exp() + (-3.0_f64).exp();
        assert!((options.p[1] - no / (no + (-0.5_f64).exp())).abs() < 1e-6);
        // Texts that begin alike are not told apart by their first token.
        let position = at("dark", &[("dark", -0.1)]);
        assert_eq!(read(&[position], &["dark red", "dark blue"]), None);
    }

    #[test]
    fn half_of_the_probability_must_name_a_choice() {
        let [enough, too_little] = [-0.69, -0.70].map(|logprob| at("A", &[("A", logprob), ("I", -0.7)]));
        assert!(read(&[enough], &FOUR).is_some());
        assert_eq!(read(&[too_little], &FOUR), None);
    }
}
