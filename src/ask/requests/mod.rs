//! Requests: the question, the parameters and the fields of the body.

mod call;
mod continued;
mod extra_fields;
pub(super) mod field;
mod image_limit;
mod parameters;

pub use call::{Call, ImagePlaces, Message, Query};
pub use continued::ChangedSetting;
pub use extra_fields::{ExtraFields, RequestArgs, Thinking};
pub use image_limit::ImageLimit;
pub use parameters::{Constrain, ImageDetail, Parameters, SettingsOrigin, Temperature, TokenField, by_flag};

pub(super) use call::{AfterTimeout, MessagePart, Request, RequestBody, images};
pub(super) use extra_fields::ThinkingBudget;
pub(super) use field::{
    AdaptableField, FieldState, RequestField, RequestFields, SentFields, is_unsupported, least_temperature,
};
pub(super) use parameters::for_judge;
