//! Sends one trial to its model: [`send`].

use tokio::sync::watch;

use crate::ask::{AskError, Call, Reservation};
use crate::engine::costs::Permit;
use crate::engine::images::trials::Item;
use crate::engine::lanes::PreparedTrial;
use crate::engine::models::ModelUnderTest;
use crate::types::{LostAttempts, Reply};

/// One trial, with its reply or error.
pub(super) type Finished<I> = (PreparedTrial<I>, Result<Reply, AskError>);

/// Sends one trial to its model, unless it is given up first. Returns the trial with its reply or error, including the
/// cost of lost attempts. `has_timed_out` is true if a gateway gave up on it in an earlier call.
pub(super) async fn send<I: Item>(
    model: ModelUnderTest,
    ready: PreparedTrial<I>,
    permit: Permit,
    has_timed_out: bool,
    mut given_up: watch::Receiver<bool>,
) -> Finished<I> {
    let PreparedTrial { trial, stimulus } = &ready;
    let call = Call {
        query: trial.item.query(),
        condition: stimulus.condition.as_ref(),
        message: trial.prompt.message(&stimulus.images),
        turn: trial.item.turn(),
    };
    let reservation = match &permit {
        Permit::Reserved(reservation) => Some(&**reservation),
        Permit::Free | Permit::Refused => None,
    };
    let asked = tokio::select! {
        biased;
        result = model.model.ask_within(call, reservation, has_timed_out) => Some(result),
        _ = given_up.wait_for(|given_up| *given_up) => None,
    };
    let charged = reservation.map_or_else(LostAttempts::default, Reservation::charged);
    let result = match asked {
        Some(Ok(mut reply)) => {
            reply.lost.unstated = charged.unstated;
            Ok(reply)
        }
        Some(Err(mut error)) => {
            error.lost.unstated = charged.unstated;
            Err(error)
        }
        None => Err(AskError { lost: Box::new(charged), ..AskError::given_up() }),
    };
    (ready, result)
}
