//! The families of questions in files: [`other`], [`checked`].

use crate::error::{Error, Result};
use crate::types::Family;

/// The family of a question that names none.
pub(super) fn other() -> Family {
    Family::Other("other".to_owned())
}

/// The family, unless it has the name that the tables use for the total.
///
/// # Errors
/// If it has.
pub(super) fn checked(family: Family) -> Result<Family> {
    if family.name().trim() == Family::TOTAL {
        return Err(Error::data(
            "family",
            format_args!(
                "the family {:?} is the name of the total over all families; rename it",
                Family::TOTAL
            ),
        ));
    }
    Ok(family)
}
