//! Rows and cells of a table, and the lists, objects and conversations in cells.

mod cell;
mod row;
mod text_list;

pub(super) use cell::{Cell, DroppedFile, Fields, MAX_NAME_LENGTH, PathStep, decode_base64};
pub(super) use row::{ConversationPaths, FileLabel, JsonUnit, MAX_ROWS, Row, RowPlace, SetRows, too_many_rows};
pub(super) use text_list::{parse_list, parse_object};
