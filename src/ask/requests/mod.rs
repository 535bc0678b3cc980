//! Requests: the question, the parameters and the fields of the body.

mod call;
pub(super) mod constraint;
mod continued;
mod extra_fields;
mod field;
mod image_limit;
mod judge;
mod parameters;
mod request;
mod request_body;
mod temperature_range;
mod thinking;
mod token_field;

pub(crate) use call::ImagePlaces;
pub use call::{Call, Message, Query};
pub(super) use call::{MessagePart, images};
pub(crate) use continued::ChangedSetting;
pub use extra_fields::ExtraFields;
pub(crate) use extra_fields::RequestArgs;
pub(super) use extra_fields::ThinkingBudget;
pub(super) use field::{AdaptableField, FieldState, RequestField, RequestFields, SentFields, is_unsupported};
pub(crate) use image_limit::ImageLimit;
pub(super) use judge::for_judge;
pub(crate) use parameters::by_flag;
pub use parameters::{Constrain, ImageDetail, Parameters, SettingsOrigin, Temperature};
pub(super) use request::{AfterTimeout, Request};
pub(super) use request_body::RequestBody;
pub(super) use temperature_range::least_temperature;
pub use thinking::Thinking;
pub use token_field::TokenField;
