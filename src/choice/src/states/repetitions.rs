//! Lists of all choices in a text, which repeat the prompt: [`repetitions`].

use crate::choice_views::ChoiceViews;
use crate::named::Names;
use crate::names::Name;
use crate::text::Ranges;

/// Maximum number of bytes between two choices of a list.
const MAX_GAP: usize = 24;

/// The stretches that list all choices in the order shown, by their texts or letters, with nothing between them but labels and
/// separators. Two choices alone make a list only with labels or a heading, on a line of their own, or if they are yes and no.
pub(crate) fn repetitions(names: &Names<'_>, offered: &ChoiceViews) -> Ranges {
    let count = offered.texts.len();
    let by_text = lists(names, &names.texts, count, offered);
    let by_letter = lists(names, &names.letters, count, offered);
    Ranges::new(by_text.into_iter().chain(by_letter).collect())
}

/// The lists among names of one kind.
fn lists(
    names: &Names<'_>,
    all: &[Name],
    count: usize,
    offered: &ChoiceViews,
) -> Vec<(usize, usize)> {
    let mut lists = Vec::new();
    // First name of the list that is being followed, and number of its names so far.
    let (mut first, mut length) = (0, 0);
    for (at, name) in all.iter().enumerate() {
        let follows = length > 0
            && name.choice == Some(length)
            && separates(names.folded, all[at - 1].end, name.start);
        if follows {
            length += 1;
        } else {
            (first, length) = (at, usize::from(name.choice == Some(0)));
        }
        if length == count {
            let (start, end) = with_labels(names.folded, all[first].start, name.end);
            if count > 2 || is_list_of_two(names, offered, &all[first..=at], (start, end)) {
                lists.push((start, end));
            }
            length = 0;
        }
    }
    lists
}

/// Whether only separators, labels and words of a list stand between two bytes.
fn separates(folded: &str, start: usize, end: usize) -> bool {
    let Some(gap) = folded.get(start..end).filter(|gap| gap.len() <= MAX_GAP) else {
        return false;
    };
    !gap.is_empty()
        && !gap.contains(['?', '!'])
        && gap.split(|c: char| !c.is_alphabetic()).all(|word| {
            word.len() <= 1 || matches!(word, "and" | "or" | "the" | "an" | "option" | "choice")
        })
}

/// The list with the label before its first choice and the one behind its last.
fn with_labels(folded: &str, start: usize, end: usize) -> (usize, usize) {
    let before = folded[..start].trim_end_matches(['(', '[', ')', ']', '.', ':', '-', ' ']);
    let label =
        before.ends_with('a') && !before[..before.len() - 1].ends_with(char::is_alphanumeric);
    let after = &folded[end..];
    let label_after = after
        .trim_start_matches(' ')
        .strip_prefix(['(', '['])
        .and_then(|rest| rest.get(1..2))
        .is_some_and(|close| matches!(close, ")" | "]"));
    (
        if label { before.len() - 1 } else { start },
        if label_after {
            end + after.len() - after.trim_start_matches(' ').len() + 3
        } else {
            end
        },
    )
}

/// Whether two choices are listed, and not stated in a sentence.
fn is_list_of_two(
    names: &Names<'_>,
    offered: &ChoiceViews,
    list: &[Name],
    (start, end): (usize, usize),
) -> bool {
    let folded = names.folded;
    let (before, after) = (
        folded[..start].trim_end_matches(' '),
        folded[end..].trim_start_matches(['.', ' ']),
    );
    let headed = before.ends_with(':') && {
        let heading = before
            .trim_end_matches(':')
            .rsplit(|c: char| !c.is_alphabetic())
            .next();
        matches!(heading, Some("options" | "choices" | "answers"))
    };
    let labelled = start < list[0].start && {
        let from = names.letters.partition_point(|letter| letter.start < start);
        names.letters[from..]
            .iter()
            .take_while(|letter| letter.start < end)
            .filter(|letter| names.labelled_text(letter).is_some())
            .count()
            >= 2
    };
    let gap = folded[list[0].end..list[1].start].trim();
    let paired = offered.yes_no.is_some() && matches!(gap, "or" | "/" | "and/or");
    let whole = (before.is_empty() || before.ends_with('\n'))
        && (after.is_empty() || after.starts_with('\n'));
    headed || labelled || paired || (whole && !gap.is_empty() && !gap.contains('.'))
}
