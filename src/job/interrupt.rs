//! Interrupts: Ctrl-C; SIGTERM, which batch systems send before they kill a process; and SIGHUP, which a terminal sends when it is
//! closed.

use crate::error::{Error, Result};

/// A listener for interrupts. While it exists, they do not end the process.
#[derive(Debug)]
pub(crate) struct Interrupt {
    #[cfg(unix)]
    terminate: tokio::signal::unix::Signal,
    /// `None` if it is ignored, as under `nohup`.
    #[cfg(unix)]
    hang_up: Option<tokio::signal::unix::Signal>,
}

impl Interrupt {
    pub(crate) fn listen() -> Result<Self> {
        #[cfg(unix)]
        {
            use tokio::signal::unix::{SignalKind, signal};
            let listen = |kind, name| signal(kind).map_err(|e| Error::file(name, "listen for", e));
            Ok(Self {
                terminate: listen(SignalKind::terminate(), "SIGTERM")?,
                hang_up: if is_hang_up_ignored() {
                    None
                } else {
                    Some(listen(SignalKind::hangup(), "SIGHUP")?)
                },
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
            Some(()) = async { self.hang_up.as_mut()?.recv().await } => {}
        }
        #[cfg(not(unix))]
        let _ = tokio::signal::ctrl_c().await;
    }
}

/// Whether the process was started with SIGHUP ignored, as `nohup` does; a listener would undo that.
///
/// Linux tells the ignored signals in /proc. Elsewhere a terminal as standard error says that there was no `nohup`.
#[cfg(unix)]
fn is_hang_up_ignored() -> bool {
    /// The bit of SIGHUP, signal 1.
    const HANG_UP: u64 = 1;
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mut lines = status.lines();
    let mask = lines.find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.map_or_else(
        || !std::io::IsTerminal::is_terminal(&std::io::stderr()),
        |mask| mask & HANG_UP != 0,
    )
}
