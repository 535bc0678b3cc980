//! One request, which may be sent several times: [`Request`].

use reqwest::header::HeaderMap;

use super::field::SentFields;
use super::request_body::RequestBody;
use crate::ask::costs::Reservation;
use crate::ask::endpoints::ModelIndex;
use crate::ask::wire_kind::Wire;

/// What follows if a gateway gives up on a request.
#[derive(Debug, Clone, Copy)]
pub(in crate::ask) struct AfterTimeout {
    /// Number of earlier requests of the question that were charged, certainly or probably, and gave no reply that counts.
    pub(in crate::ask) charged: u32,
    /// True if the caller asks the question in another way, so that the request is not repeated.
    pub(in crate::ask) asks_otherwise: bool,
    /// What the user can do, for the message.
    pub(in crate::ask) remedy: &'static str,
}

/// One request, which may be sent several times.
pub(in crate::ask) struct Request<'a> {
    /// Index of the model at the endpoint.
    pub(in crate::ask) model: ModelIndex,
    pub(in crate::ask) wire: Wire,
    /// Headers for each replica.
    pub(in crate::ask) headers: &'a [HeaderMap],
    pub(in crate::ask) body: RequestBody,
    pub(in crate::ask) sent: SentFields<'a>,
    /// Hash of the images: requests about the same images prefer the same replica.
    pub(in crate::ask) affinity: u64,
    /// Handling of gateway timeouts.
    pub(in crate::ask) timeouts: AfterTimeout,
    /// Reservation of the cost of each attempt; `None` if the model has no known price.
    pub(in crate::ask) reservation: Option<&'a Reservation>,
}
