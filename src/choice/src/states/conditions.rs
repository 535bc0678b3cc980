//! Conditional and counterfactual parts of a text: [`conditional`].

use crate::text::words::Role;
use crate::text::{Boundary, Clauses, Element, Ranges};

/// The conditions with their main clauses, and what precedes "would need" and its like. A condition that only makes the model
/// choose ("if I had to guess") is none.
pub(crate) fn conditional(clauses: &Clauses<'_>) -> Ranges {
    let mut ranges = Vec::new();
    let (mut first, mut unmet) = (0, false);
    let elements = &clauses.elements;
    for (at, element) in elements.iter().enumerate() {
        // A comma ends neither the condition nor its main clause, and a colon may stand between them.
        let is_colon = clauses.is_sign(at, &[':', '：']);
        if element.boundary == Boundary::Sentence || (element.cuts() && !is_colon) {
            let found = within(clauses, first..at, unmet && goes_on(clauses, first));
            unmet = !found.is_empty();
            ranges.extend(found);
            first = at + 1;
        }
    }
    let last = unmet && goes_on(clauses, first);
    ranges.extend(within(clauses, first..elements.len(), last));
    Ranges::new(ranges)
}

/// Whether a clause goes on with the condition before it: "Suppose there is a stove; then it is a kitchen."
fn goes_on(clauses: &Clauses<'_>, first: usize) -> bool {
    let element = clauses.elements.get(first);
    element.is_some_and(|element| element.slice(clauses.folded) == "then")
}

/// Words that speak of light.
const LIGHT: [Role; 3] = [Role::Given, Role::Better, Role::LightNoun];

/// The stretches in one condition with its main clause, from their elements; all of it, if it `goes_on` with one.
fn within(
    clauses: &Clauses<'_>,
    all: std::ops::Range<usize>,
    goes_on: bool,
) -> Vec<(usize, usize)> {
    let elements = &clauses.elements[all];
    let (Some(first), Some(last)) = (elements.first(), elements.last()) else {
        return Vec::new();
    };
    let has = |role: Role| elements.iter().any(|element| element.has(role));
    let head = elements
        .iter()
        .find(|element| !element.has(Role::And) && !element.has(Role::Adverb))
        .unwrap_or(first);
    // "Were it brighter, I would …", "I would …, were it brighter".
    let inverted = head.has(Role::Inverted)
        || (has(Role::ModalPast)
            && elements
                .iter()
                .zip(&elements[1..])
                .any(|(before, element)| {
                    before.boundary > Boundary::None && element.has(Role::Inverted)
                }));
    // "With more light".
    let in_light = elements
        .windows(LIGHT.len())
        .any(|words| words.iter().zip(LIGHT).all(|(word, role)| word.has(role)));
    if goes_on || in_light || has(Role::Condition) || inverted || is_unmet(elements, head) {
        return vec![(first.start, last.end)];
    }
    let forced = has(Role::Forced);
    let mut ranges = Vec::new();
    let (mut part, mut expects) = (first.start, None);
    for element in elements {
        if element.boundary == Boundary::Part {
            ranges.extend(expects.take().map(|start| (start, element.start)));
            part = element.end;
        }
        // "A bedroom would have a bed"; the left part of "… if that is a stove" is unsure, its right part is asked.
        if element.has(Role::Expected) || (element.has(Role::If) && !forced) {
            expects = Some(part);
        }
    }
    ranges.extend(expects.map(|start| (start, last.end)));
    ranges
}

/// True if the elements have an "if" that makes all of them uncertain: it begins them, or they are counterfactual.
fn is_unmet(elements: &[Element], head: &Element) -> bool {
    let has = |role: Role| elements.iter().any(|element| element.has(role));
    has(Role::If) && !has(Role::Forced) && (head.has(Role::If) || has(Role::ModalPast))
}
