//! The connections of the server, with bounds on their number and on how long a client may take: [`answer_until`].

use std::convert::Infallible;
use std::future::Future;
use std::sync::Arc;
use std::time::Duration;

use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::HttpService;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;

/// The connections that are open at once; further ones wait. Chosen.
const CONNECTIONS: usize = 64;
/// How long a client may take for the headers of a request, and how long a connection may stay open without one. Chosen.
const HEADER_TIME: Duration = Duration::from_secs(10);
/// How long requests may still take after the end. Chosen.
const LAST_TIME: Duration = Duration::from_secs(10);
/// The pause after a connection could not be taken, as when no file is left. Chosen.
const PAUSE: Duration = Duration::from_millis(100);

/// Answers requests until `end`, and then those that have begun.
pub(super) async fn answer_until<S>(
    listener: TcpListener,
    service: S,
    end: impl Future<Output = ()>,
) where
    S: HttpService<Incoming, ResBody = String, Error = Infallible, Future: Send>
        + Clone
        + Send
        + 'static,
{
    let free = Arc::new(Semaphore::new(CONNECTIONS));
    let open = GracefulShutdown::new();
    let mut end = std::pin::pin!(end);
    loop {
        let taken = async {
            let place = Arc::clone(&free).acquire_owned().await;
            (place, listener.accept().await)
        };
        let (place, accepted) = tokio::select! {
            () = &mut end => break,
            taken = taken => taken,
        };
        let Ok((stream, _)) = accepted else {
            tokio::time::sleep(PAUSE).await;
            continue;
        };
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(HEADER_TIME)
            .serve_connection(TokioIo::new(stream), service.clone());
        let connection = open.watch(connection);
        tokio::spawn(async move {
            // A client that breaks off or sends no HTTP has itself alone to tell.
            let _ = connection.await;
            drop(place);
        });
    }
    let _ = tokio::time::timeout(LAST_TIME, open.shutdown()).await;
}
