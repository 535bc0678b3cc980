//! Columns of a set and their roles.

pub(super) mod answer_column;
mod column;
mod family_source;
pub(super) mod map;
mod roles;

pub(super) use column::SetColumn;
pub(super) use family_source::FamilySource;
pub(super) use roles::{
    ColumnRoles, ImageColumns, OptionsInQuestion, QuestionSource, describe_columns, embedded_images, find_column,
};
