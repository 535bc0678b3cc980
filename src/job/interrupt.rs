//! Interrupts: Ctrl-C, and SIGTERM, which batch systems send before they kill a process.

use crate::error::{Error, Result};

/// A listener for interrupts. While it exists, they do not end the process.
#[derive(Debug)]
pub(crate) struct Interrupt {
    #[cfg(unix)]
    terminate: tokio::signal::unix::Signal,
}

impl Interrupt {
    pub(crate) fn listen() -> Result<Self> {
        #[cfg(unix)]
        {
            use tokio::signal::unix::{SignalKind, signal};
            let cannot_listen = |e| Error::file("SIGTERM", "listen for", e);
            Ok(Self {
                terminate: signal(SignalKind::terminate()).map_err(cannot_listen)?,
            })
        }
        #[cfg(not(unix))]
        Ok(Self {})
    }

    /// Waits for the next interrupt.
    pub(crate) async fn next(&mut self) {
        #[cfg(unix)]
        tokio::select! {
            _ = tokio::signal::ctrl_c() => {}
            _ = self.terminate.recv() => {}
        }
        #[cfg(not(unix))]
        let _ = tokio::signal::ctrl_c().await;
    }
}
