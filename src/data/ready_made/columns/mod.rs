//! Columns of a set and their roles.

pub(super) mod answer_column;
mod column;
mod family_source;
pub(super) mod map;
mod roles;

pub(super) use column::Column;
pub(super) use family_source::FamilySource;
pub(super) use roles::{
    ImageColumns, OptionsInQuestion, QuestionSource, Roles, describe_columns, embedded_images, find_column,
};
