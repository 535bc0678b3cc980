//! Cells of a row, and the lists, objects and conversations in them.

mod cell;
mod python_list;
mod row;
mod step;
mod text_list;
mod turns;

pub(super) use cell::{Cell, Fields, FileFacts, LONGEST_NAME, decoded};
pub(super) use row::{FileLabel, JsonUnit, MOST_ROWS, Row, RowPlace, Table, too_many_rows};
pub(super) use step::Step;
pub(super) use text_list::{dict, list};
pub(super) use turns::Turns;
