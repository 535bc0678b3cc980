//! One request, which may be sent several times: [`Request`].

use reqwest::header::HeaderMap;

use super::body::Parts;
use super::field::SentFields;
use crate::ask::costs::Reservation;
use crate::ask::endpoints::ModelIndex;
use crate::ask::wire_kind::Wire;

/// One request, which may be sent several times.
pub(in crate::ask) struct Request<'a> {
    /// The model at the endpoint.
    pub(in crate::ask) model: ModelIndex,
    pub(in crate::ask) wire: Wire,
    /// The headers for each replica.
    pub(in crate::ask) headers: &'a [HeaderMap],
    pub(in crate::ask) body: Parts,
    pub(in crate::ask) sent: SentFields<'a>,
    /// A number that is the same for requests about the same images.
    pub(in crate::ask) affinity: u64,
    /// The dollars that each sending holds; `None` if the model has no known price.
    pub(in crate::ask) reservation: Option<&'a Reservation>,
}
