//! Bounds of the memory that all requests take together: [`MemoryBound`].

use std::sync::Arc;
use std::time::Duration;

use hyper::StatusCode;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::completion::RequestFault;

/// Maximum time that a request waits for others to end (chosen).
const MAX_WAIT: Duration = Duration::from_secs(10);

/// Amount that all requests in flight may take together. A request waits until its share is free.
pub(super) struct MemoryBound {
    free: Arc<Semaphore>,
    /// Size of a permit: one permit is this much.
    unit: usize,
    /// In units.
    whole: usize,
    /// Name of what is bounded, with its whole amount.
    name: String,
}

impl MemoryBound {
    /// A bound of `whole` units of `unit` each.
    pub(super) fn new(whole: usize, unit: usize, name: String) -> Self {
        Self { free: Arc::new(Semaphore::new(whole)), unit, whole, name }
    }

    /// Takes a share until the returned permit is dropped.
    ///
    /// # Errors
    /// 503 if the share is not free in time.
    pub(super) async fn take(&self, amount: usize) -> Result<OwnedSemaphorePermit, RequestFault> {
        let units = amount.div_ceil(self.unit).min(self.whole) as u32;
        let free = Arc::clone(&self.free).acquire_many_owned(units);
        if let Ok(Ok(permit)) = tokio::time::timeout(MAX_WAIT, free).await {
            return Ok(permit);
        }
        let message =
            format!("the requests in flight together have {}: send fewer or smaller ones at a time", self.name);
        Err(RequestFault::new(StatusCode::SERVICE_UNAVAILABLE, message))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test(start_paused = true)]
    async fn a_share_is_taken_until_it_is_dropped() {
        let bound = MemoryBound::new(4, 1024, "4 KiB".to_owned());
        let first = bound.take(2048).await.ok();
        let second = bound.take(2000).await.ok();
        assert!(first.is_some() && second.is_some());
        let fault = bound.take(1).await.err().unwrap();
        let response = hyper::Response::<String>::from(fault);
        assert_eq!(response.status(), StatusCode::SERVICE_UNAVAILABLE);
        assert!(response.body().contains("4 KiB"), "{}", response.body());
        drop(first);
        assert!(bound.take(1).await.is_ok());
        drop(second);
        // More than the whole takes the whole.
        assert!(bound.take(1 << 20).await.is_ok());
    }
}
