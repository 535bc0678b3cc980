//! The settings for sending and retrying requests: [`Sending`].

use std::time::Duration;

use clap::Args;

use crate::ask::pace::{ConcurrencyBounds, Quota};
use crate::types::Decides;
use crate::types::flags::{positive, seconds};

/// The settings for sending and retrying requests.
#[derive(Debug, Clone, Copy, PartialEq, Args)]
#[command(next_help_heading = "Sending")]
pub struct Sending {
    /// Requests in flight: N, fewer if the server is overloaded; MIN-MAX, from MIN up while replies do not slow down;
    /// auto is 8-32, down to 1
    #[arg(long, value_name = "N|MIN-MAX|auto", default_value = "auto", add = Decides::Nothing)]
    pub concurrency: ConcurrencyBounds,
    /// The user's limits per minute.
    #[command(flatten)]
    pub quota: Quota,
    /// Seconds for one attempt, reply included
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "120", add = Decides::Nothing)]
    pub timeout: Duration,
    /// Retries after a temporary failure
    #[arg(long, value_name = "N", default_value_t = 5, add = Decides::Nothing)]
    pub retries: u32,
    /// Retries of a trial after an attempt that was charged and gave no reply, in all calls together
    #[arg(long, value_name = "N", default_value_t = 1, add = Decides::Nothing)]
    pub paid_retries: u32,
    /// Wait before the first retry if the server does not ask for one. It doubles with each further retry; each wait is
    /// extended at random by up to its own length.
    #[arg(skip = FIRST_DELAY)]
    pub first_delay: Duration,
    /// Seconds for which an endpoint may turn all requests away (rate limit, overload, loading a model) before the run
    /// stops; these refusals do not count as retries
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "1800", add = Decides::Nothing)]
    pub patience: Duration,
    /// Longest wait in seconds that a server may ask for; a longer one fails the request
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "120", add = Decides::Nothing)]
    pub max_wait: Duration,
    /// Largest image file to send, in MB; default: the vendor's limit, else 20
    #[arg(long, value_name = "MB", value_parser = positive, add = Decides::Nothing)]
    pub max_image: Option<f64>,
}

/// Default of [`Sending::first_delay`]; chosen.
const FIRST_DELAY: Duration = Duration::from_millis(500);

impl Default for Sending {
    fn default() -> Self {
        Self {
            concurrency: ConcurrencyBounds::DEFAULT,
            quota: Quota::default(),
            timeout: Duration::from_mins(2),
            retries: 5,
            paid_retries: 1,
            first_delay: FIRST_DELAY,
            patience: Duration::from_mins(30),
            max_wait: Duration::from_mins(2),
            max_image: None,
        }
    }
}
