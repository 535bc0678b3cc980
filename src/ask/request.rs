//! One request, which may be sent several times: [`Request`].

use reqwest::header::HeaderMap;

use super::body::Parts;
use super::field::SentFields;
use super::service::ModelNumber;
use super::spending::Reservation;
use super::wire_kind::Wire;

/// One request, which may be sent several times.
pub(super) struct Request<'a> {
    /// The model at the endpoint.
    pub(super) model: ModelNumber,
    pub(super) wire: Wire,
    /// The headers for each replica.
    pub(super) headers: &'a [HeaderMap],
    pub(super) body: Parts,
    pub(super) sent: SentFields<'a>,
    /// A number that is the same for requests about the same images.
    pub(super) affinity: u64,
    /// The dollars that each sending holds; `None` if the model has no known price.
    pub(super) reservation: Option<&'a Reservation>,
}
