//! Connections of the server, with limits for their number and for the time of clients: [`answer_until`].

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

/// Maximum number of open connections; further ones wait (chosen).
const MAX_CONNECTIONS: usize = 64;
/// Maximum time for receiving the headers of a request, which also limits idle connections (chosen).
const HEADER_TIMEOUT: Duration = Duration::from_secs(10);
/// Time for finishing open requests after `end` (chosen).
const SHUTDOWN_TIMEOUT: Duration = Duration::from_secs(10);
/// Pause after a connection could not be accepted, for example because no file descriptor is free (chosen).
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Answers requests until `end`, then finishes the open ones.
pub(super) async fn answer_until<S>(listener: TcpListener, service: S, end: impl Future<Output = ()>)
where
    S: HttpService<Incoming, ResBody = String, Error = Infallible, Future: Send> + Clone + Send + 'static,
{
    let free = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    let open = GracefulShutdown::new();
    let mut end = std::pin::pin!(end);
    loop {
        let next = async {
            let permit = Arc::clone(&free).acquire_owned().await;
            (permit, listener.accept().await)
        };
        let (permit, accepted) = tokio::select! {
            () = &mut end => break,
            next = next => next,
        };
        let Ok((stream, _)) = accepted else {
            tokio::time::sleep(ACCEPT_PAUSE).await;
            continue;
        };
        let connection = http1::Builder::new()
            .timer(TokioTimer::new())
            .header_read_timeout(HEADER_TIMEOUT)
            .serve_connection(TokioIo::new(stream), service.clone());
        let connection = open.watch(connection);
        tokio::spawn(async move {
            // Errors such as a broken connection or invalid HTTP concern only the client.
            let _ = connection.await;
            drop(permit);
        });
    }
    let _ = tokio::time::timeout(SHUTDOWN_TIMEOUT, open.shutdown()).await;
}
