//! Columns of a set, and the role of each.

pub(super) mod answer_column;
mod column;
mod family_column;
pub(super) mod map;
pub(super) mod names;
mod roles;
mod template;

pub(super) use family_column::FamilyOf;
pub(super) use roles::{Asked, Column, Images, InQuestion, Roles, column, shown};
