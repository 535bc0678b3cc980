//! Conditional and counterfactual parts of a text: [`conditional`].

use crate::choice::text::words::Role;
use crate::choice::text::{Boundary, Clauses, Element, Ranges};

/// Ranges of conditions with their main clauses, and of the words before phrases such as "would need". A condition that
/// only forces a choice ("if I had to guess") is not included.
pub(crate) fn conditional(clauses: &Clauses<'_>) -> Ranges {
    let mut ranges = Vec::new();
    let (mut first, mut unmet) = (0, false);
    let elements = &clauses.elements;
    for (at, element) in elements.iter().enumerate() {
        // A comma ends neither the condition nor its main clause, and a colon may stand between them.
        let is_colon = clauses.is_sign(at, &[':', '：']);
        if element.boundary == Boundary::Sentence || (element.ends_clause() && !is_colon) {
            let found = conditional_ranges(clauses, first..at, unmet && continues_condition(clauses, first));
            unmet = !found.is_empty();
            ranges.extend(found);
            first = at + 1;
        }
    }
    let last = unmet && continues_condition(clauses, first);
    ranges.extend(conditional_ranges(clauses, first..elements.len(), last));
    Ranges::new(ranges)
}

/// True if a clause continues the condition before it: "Suppose there is a stove; then it is a kitchen."
fn continues_condition(clauses: &Clauses<'_>, first: usize) -> bool {
    clauses.elements.get(first).is_some_and(|element| element.slice(clauses.folded) == "then")
}

/// The roles of a phrase about more light, such as "with better lighting".
const MORE_LIGHT: [Role; 3] = [Role::Given, Role::Better, Role::LightNoun];

/// The conditional ranges in the clauses with these elements; all of them if they continue an earlier condition.
fn conditional_ranges(clauses: &Clauses<'_>, all: std::ops::Range<usize>, continues: bool) -> Vec<(usize, usize)> {
    let elements = &clauses.elements[all];
    let (Some(first), Some(last)) = (elements.first(), elements.last()) else {
        return Vec::new();
    };
    let head = elements.iter().find(|element| !element.has(Role::And) && !element.has(Role::Adverb)).unwrap_or(first);
    // "Were it brighter, I would …", "I would …, were it brighter".
    let inverted = head.has(Role::Inverted)
        || (any_has(elements, Role::ModalPast)
            && elements
                .iter()
                .zip(&elements[1..])
                .any(|(before, element)| before.boundary > Boundary::None && element.has(Role::Inverted)));
    // "With more light".
    let in_light =
        elements.windows(MORE_LIGHT.len()).any(|words| words.iter().zip(MORE_LIGHT).all(|(word, role)| word.has(role)));
    if continues || in_light || any_has(elements, Role::Condition) || inverted || is_unmet(elements, head) {
        return vec![(first.start, last.end)];
    }
    let forced = any_has(elements, Role::Forced);
    let mut ranges = Vec::new();
    let (mut part, mut expects) = (first.start, None);
    for element in elements {
        if element.boundary == Boundary::Part {
            ranges.extend(expects.take().map(|start| (start, element.start)));
            part = element.end;
        }
        // In "a bedroom would have a bed" and "a kitchen if that is a stove", the whole part of the clause is
        // uncertain.
        if element.has(Role::Expected) || (element.has(Role::If) && !forced) {
            expects = Some(part);
        }
    }
    ranges.extend(expects.map(|start| (start, last.end)));
    ranges
}

/// True if an "if" makes all elements uncertain, because they begin with it or are counterfactual.
fn is_unmet(elements: &[Element], head: &Element) -> bool {
    any_has(elements, Role::If)
        && !any_has(elements, Role::Forced)
        && (head.has(Role::If) || any_has(elements, Role::ModalPast))
}

fn any_has(elements: &[Element], role: Role) -> bool {
    elements.iter().any(|element| element.has(role))
}
