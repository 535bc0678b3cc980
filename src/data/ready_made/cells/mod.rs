//! Rows and cells of a table, and the lists, objects and conversations in cells.

mod cell;
mod conversation;
mod python_list;
mod row;
mod step;
mod text_list;

pub(super) use cell::{Cell, Fields, FileFacts, MAX_NAME_LENGTH, decode_base64};
pub(super) use conversation::ConversationPaths;
pub(super) use row::{FileLabel, JsonUnit, MAX_ROWS, Row, RowPlace, Table, too_many_rows};
pub(super) use step::Step;
pub(super) use text_list::{parse_list, parse_object};
