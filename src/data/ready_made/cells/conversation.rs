//! Question and answer in a conversation: [`ConversationPaths`].
//!
//! A conversation is a list of turns. LLaVA writes a turn as `{"from": "human", "value": "…"}`, chat interfaces as
//! `{"role": "user", "content": "…"}`, where the content may be a list of parts, `{"type": "text", "text": "…"}`.

use std::borrow::Cow;

use super::cell::Cell;
use super::row::Table;

/// Roles that ask.
const ASKING: [&str; 2] = ["human", "user"];
/// Roles that answer.
const ANSWERING: [&str; 4] = ["gpt", "assistant", "model", "bot"];

/// Paths of the first question and its answer in a column of conversations, in the notation of `--map`.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct ConversationPaths {
    pub(crate) question: String,
    /// `None` if the question has no answer.
    pub(crate) answer: Option<String>,
}

impl ConversationPaths {
    /// Paths in the first column of conversations; `None` if there is no such column.
    pub(crate) fn find(table: &Table) -> Option<Self> {
        let row = table.rows.first()?;
        table.columns.iter().enumerate().find_map(|(index, name)| Self::from_cell(name, row.cell(index)))
    }

    /// Paths in a cell of a column; `None` if the cell is not a conversation.
    pub(crate) fn from_cell(column: &str, cell: &Cell) -> Option<Self> {
        let cell = cell.parsed().map_or(Cow::Borrowed(cell), Cow::Owned);
        let Cell::List(turns) = &*cell else {
            return None;
        };
        let (index, question) = first_turn(column, turns, &ASKING, 0)?;
        let answer = first_turn(column, turns, &ANSWERING, index).map(|(_, path)| path);
        Some(Self { question, answer })
    }
}

/// Index of the first turn from `start` that has one of the roles, and the path of its text.
fn first_turn(column: &str, turns: &[Cell], roles: &[&str], start: usize) -> Option<(usize, String)> {
    let (index, turn) = turns.iter().enumerate().skip(start).find(|(_, turn)| has_role(turn, roles))?;
    Some((index, format!("{column}.{index}.{}", text_path(turn)?)))
}

/// True if a turn is by one of these roles.
fn has_role(turn: &Cell, roles: &[&str]) -> bool {
    ["from", "role"]
        .iter()
        .find_map(|field| turn.field(field)?.text())
        .is_some_and(|role| roles.contains(&role.trim().to_ascii_lowercase().as_str()))
}

/// Path of the text inside a turn.
fn text_path(turn: &Cell) -> Option<String> {
    ["value", "content", "text"].iter().find_map(|field| match turn.field(field)? {
        Cell::Text(_) => Some((*field).to_owned()),
        Cell::List(parts) => {
            let index = parts.iter().position(|part| matches!(part.field("text"), Some(Cell::Text(_))))?;
            Some(format!("{field}.{index}.text"))
        }
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn paths(cell: Value) -> Option<(String, Option<String>)> {
        let paths = ConversationPaths::from_cell("chat", &Cell::from(cell))?;
        Some((paths.question, paths.answer))
    }

    #[test]
    fn the_first_question_and_its_answer_are_found() {
        let llava = json!([{"from": "human", "value": "?"}, {"from": "gpt", "value": "A"}]);
        let expected = Some(("chat.0.value".to_owned(), Some("chat.1.value".to_owned())));
        assert_eq!(paths(llava.clone()), expected);
        assert_eq!(paths(json!(llava.to_string())), expected);
        let parts = json!([
            {"role": "system", "content": "Be brief."},
            {"role": "user", "content": [{"type": "image"}, {"type": "text", "text": "?"}]},
        ]);
        assert_eq!(paths(parts), Some(("chat.1.content.1.text".to_owned(), None)));
        for other in [json!("[\"x\"]"), json!(["human"]), json!({"from": "human"}), json!([])] {
            assert_eq!(paths(other), None);
        }
    }
}
