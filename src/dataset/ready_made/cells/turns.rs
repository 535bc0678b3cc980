//! Questions and answers as the turns of a conversation in a list: [`Turns`].
//!
//! LLaVA has `{"from": "human", "value": "…"}`, chat interfaces `{"role": "user", "content": "…"}`, where the content may be a list of
//! parts, `{"type": "text", "text": "…"}`.

use std::borrow::Cow;

use super::cell::Cell;
use super::row::Table;

/// The names of those who ask and who answer.
const ASKING: [&str; 2] = ["human", "user"];
const ANSWERING: [&str; 4] = ["gpt", "assistant", "model", "bot"];

/// The paths of the first question and its answer in a column of conversations, as `--map` takes them.
#[derive(Debug, PartialEq, Eq)]
pub(in crate::dataset::ready_made) struct Turns {
    pub(in crate::dataset::ready_made) question: String,
    /// `None` if nobody answers.
    pub(in crate::dataset::ready_made) answer: Option<String>,
}

impl Turns {
    /// The turns in the first column that holds conversations; `None` if none does.
    pub(in crate::dataset::ready_made) fn find(table: &Table) -> Option<Self> {
        let row = table.rows.first()?;
        table
            .columns
            .iter()
            .enumerate()
            .find_map(|(at, name)| Self::from_cell(name, row.cell(at)))
    }

    /// The turns in a cell of a column.
    pub(in crate::dataset::ready_made) fn from_cell(column: &str, cell: &Cell) -> Option<Self> {
        let cell = cell.parsed().map_or(Cow::Borrowed(cell), Cow::Owned);
        let Cell::List(turns) = &*cell else {
            return None;
        };
        let path = |names: &[&str], from: usize| {
            let mut turns = turns.iter().enumerate().skip(from);
            let (at, turn) = turns.find(|(_, turn)| is_by(turn, names))?;
            Some((at, format!("{column}.{at}.{}", text(turn)?)))
        };
        let (at, question) = path(&ASKING, 0)?;
        let answer = path(&ANSWERING, at).map(|(_, path)| path);
        Some(Self { question, answer })
    }
}

/// Whether a turn is by someone of these names.
fn is_by(turn: &Cell, names: &[&str]) -> bool {
    let name = ["from", "role"]
        .iter()
        .find_map(|field| turn.field(field)?.text());
    name.is_some_and(|name| names.contains(&name.trim().to_ascii_lowercase().as_str()))
}

/// The path of the text in a turn.
fn text(turn: &Cell) -> Option<String> {
    ["value", "content", "text"]
        .iter()
        .find_map(|field| match turn.field(field)? {
            Cell::Text(_) => Some((*field).to_owned()),
            Cell::List(parts) => {
                let is_text = |part: &Cell| matches!(part.field("text"), Some(Cell::Text(_)));
                let at = parts.iter().position(is_text)?;
                Some(format!("{field}.{at}.text"))
            }
            _ => None,
        })
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn turns(cell: Value) -> Option<(String, Option<String>)> {
        let turns = Turns::from_cell("chat", &Cell::from(cell))?;
        Some((turns.question, turns.answer))
    }

    #[test]
    fn the_first_question_and_its_answer_are_found() {
        let llava = json!([{"from": "human", "value": "?"}, {"from": "gpt", "value": "A"}]);
        let paths = Some(("chat.0.value".to_owned(), Some("chat.1.value".to_owned())));
        assert_eq!(turns(llava.clone()), paths);
        assert_eq!(turns(json!(llava.to_string())), paths);
        let parts = json!([
            {"role": "system", "content": "Be brief."},
            {"role": "user", "content": [{"type": "image"}, {"type": "text", "text": "?"}]},
        ]);
        assert_eq!(
            turns(parts),
            Some(("chat.1.content.1.text".to_owned(), None))
        );
        for other in [
            json!("[\"x\"]"),
            json!(["human"]),
            json!({"from": "human"}),
            json!([]),
        ] {
            assert_eq!(turns(other), None);
        }
    }
}
