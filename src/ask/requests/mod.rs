//! Requests: the question, the parameters and the fields of the body.

mod call;
pub(super) mod constraint;
mod extra_fields;
mod field;
mod image_limit;
mod parameters;
mod request;
mod request_body;
mod thinking;
mod token_field;

pub(crate) use call::ImagePlaces;
pub use call::{Call, Message, Query};
pub(super) use call::{MessagePart, images};
pub use extra_fields::ExtraFields;
pub(crate) use extra_fields::RequestArgs;
pub(super) use extra_fields::ThinkingBudget;
pub(super) use field::{
    AdaptableField, FieldState, RequestField, RequestFields, SentFields, is_unsupported,
};
pub(crate) use image_limit::ImageLimit;
pub(crate) use parameters::by_flag;
pub use parameters::{Constrain, ImageDetail, Parameters, Temperature};
pub(super) use request::{AfterTimeout, Request};
pub(super) use request_body::RequestBody;
pub use thinking::Thinking;
pub use token_field::TokenField;
