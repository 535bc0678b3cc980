//! Checks that the settings of a model do not contradict each other or its vendor: [`check_user_fields`],
//! [`check_vendor`].

use serde_json::Map;
use tracing::warn;

use crate::ask::requests::{Constrain, Parameters, RequestFields};
use crate::ask::vendors::Vendor;
use crate::error::{Error, Result};

/// Checks that the fields of `--extra-body` do not set the same as a flag.
pub(super) fn check_user_fields(parameters: &Parameters, initial: RequestFields) -> Result<()> {
    let extra = &parameters.extra;
    if parameters.constrain != Constrain::None
        && let Some(field) =
            ["response_format", "structured_outputs", "text"].into_iter().find(|field| extra.adds(field))
    {
        return conflict(field, "--request constrain");
    }
    if let Some(field) = initial.thinking_body().into_iter().flat_map(Map::keys).find(|field| extra.adds(field)) {
        return conflict(field, "--thinking");
    }
    // The field of the Responses API, which OpenRouter also accepts in chat completions.
    if initial.effort(parameters).is_some() && extra.adds_below("reasoning", "effort") {
        let flag = match parameters.reasoning_effort {
            Some(_) => "--reasoning-effort",
            None => "--thinking",
        };
        return conflict("reasoning.effort", flag);
    }
    if parameters.probabilities && extra.adds("include") {
        return conflict("include", "--request probabilities");
    }
    Ok(())
}

fn conflict(field: &str, flag: &str) -> Result<()> {
    let problem = format_args!("{field} is set by {flag}; leave one of them out");
    Err(Error::usage("--extra-body", problem))
}

/// Checks that the vendor supports a requested constraint and requested probabilities. Warns if requests to it are not
/// repeatable.
pub(super) fn check_vendor(vendor: &Vendor, parameters: &Parameters) -> Result<()> {
    if vendor.ignores_constraints() && parameters.constrain != Constrain::None {
        let problem =
            format_args!("{} takes a constraint and ignores it, so it would be none; leave it out", vendor.name);
        return Err(Error::usage("--request constrain", problem));
    }
    if parameters.probabilities
        && let Some(reason) = vendor.without_probabilities()
    {
        let problem = format_args!(
            "{} {reason}, so the confidence of {} would not be known; leave it out",
            vendor.name, parameters.model
        );
        return Err(Error::usage("--request probabilities", problem));
    }
    if let Some(field) = &vendor.pin
        && !parameters.extra.adds(field)
    {
        warn!(
            "{}: {} may answer each request in another way unless {field} is set in the body (--extra-body): the run may not be \
             repeatable",
            parameters.model, vendor.name
        );
    }
    Ok(())
}
