//! Families of questions in files: [`unnamed`], [`check_family`].

use crate::error::{Error, Result};
use crate::types::Family;

/// Family of a question that names none.
pub(super) fn unnamed() -> Family {
    Family::Other("other".to_owned())
}

/// Returns the family unchanged.
///
/// # Errors
/// If its name is the one that tables use for the total over all families.
pub(super) fn check_family(family: Family) -> Result<Family> {
    if family.name().trim() == Family::TOTAL {
        return Err(Error::data(
            "family",
            format_args!("the family {:?} is the name of the total over all families; rename it", Family::TOTAL),
        ));
    }
    Ok(family)
}
