//! How requests are sent and sent again: [`Sending`].

use std::time::Duration;

use super::pace::{Bounds, Quota};

/// How requests are sent and sent again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sending {
    /// The time one try may take, from connecting to the last byte of the reply.
    pub timeout: Duration,
    /// How many times a request is sent again after it failed.
    pub retries: u32,
    /// The wait before the first retry where the server asks for none; each further one doubles, and each is drawn out at
    /// random by up to its length.
    pub first_delay: Duration,
    /// The longest wait that a server may ask for; beyond it the request is given up at once.
    pub max_wait: Duration,
    /// How many requests are on the wire at once.
    pub concurrency: Bounds,
    /// What may be sent in a minute.
    pub quota: Quota,
}

impl Default for Sending {
    fn default() -> Self {
        Self {
            timeout: Duration::from_mins(2),
            retries: 5,
            first_delay: Duration::from_millis(500),
            max_wait: Duration::from_mins(2),
            concurrency: Bounds::DEFAULT,
            quota: Quota::default(),
        }
    }
}
