//! One request, which may be sent several times: [`Request`].

use reqwest::header::HeaderMap;

use super::field::SentFields;
use super::request_body::RequestBody;
use crate::ask::costs::Reservation;
use crate::ask::endpoints::ModelIndex;
use crate::ask::wire_kind::Wire;

/// What follows if a gateway gives up on a request.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AfterTimeout {
    /// Number of earlier requests of the question that were charged, certainly or probably, and gave no reply that
    /// counts.
    pub(crate) charged: u32,
    /// True if the caller asks the question in another way, so that the request is not repeated.
    pub(crate) asks_otherwise: bool,
    /// What the user can do, for the message.
    pub(crate) remedy: &'static str,
}

/// One request, which may be sent several times.
pub(crate) struct Request<'a> {
    /// Index of the model at the endpoint.
    pub(crate) model: ModelIndex,
    pub(crate) wire: Wire,
    /// Headers for each replica.
    pub(crate) headers: &'a [HeaderMap],
    pub(crate) body: RequestBody,
    pub(crate) sent: SentFields<'a>,
    /// Hash of the images: requests about the same images prefer the same replica.
    pub(crate) affinity: u64,
    /// Handling of gateway timeouts.
    pub(crate) timeouts: AfterTimeout,
    /// Reservation of the cost of each attempt; `None` if the model has no known price.
    pub(crate) reservation: Option<&'a Reservation>,
}
