//! Interrupts: Ctrl-C; SIGTERM, which batch systems send before they kill a process; and SIGHUP, which a terminal sends
//! when it is closed. A run that asks listens for them ([`Interrupt`]); they end everything else at once
//! ([`end_at_interrupts`]).

use std::sync::atomic::{AtomicUsize, Ordering};

use darkqa_base::error::{Error, Result};

/// Exit code after an interrupt: that of a shell after Ctrl-C.
pub const INTERRUPTED: u8 = 130;

/// Number of listeners. Without one, interrupts end the process.
static LISTENERS: AtomicUsize = AtomicUsize::new(0);

/// Makes interrupts end the process with the code [`INTERRUPTED`] while there is no [`Interrupt`]. Signals that the
/// process was started to ignore, as by `nohup`, stay ignored.
///
/// Without this, the first process of a container ignores them, because the kernel ends it only by signals that it
/// handles; and every process does after its first listener, because that stays installed. Files are whole at any time:
/// they are written under another name.
#[cfg(unix)]
#[expect(unsafe_code, reason = "a signal handler")]
pub fn end_at_interrupts() {
    let handler: extern "C" fn(libc::c_int) = end;
    for signal in [libc::SIGINT, libc::SIGTERM, libc::SIGHUP] {
        // SAFETY: an all-zero `sigaction` is valid, both calls read or write only that structure, and the handler calls
        // only functions that POSIX allows in handlers. Later listeners call it first.
        unsafe {
            let mut action: libc::sigaction = std::mem::zeroed();
            let is_known = libc::sigaction(signal, std::ptr::null(), &raw mut action) == 0;
            if is_known && action.sa_sigaction == libc::SIG_DFL {
                action.sa_sigaction = handler as usize;
                action.sa_flags = libc::SA_RESTART;
                libc::sigaction(signal, &raw const action, std::ptr::null_mut());
            }
        }
    }
}

/// Windows ends a process at Ctrl-C by itself.
#[cfg(not(unix))]
pub fn end_at_interrupts() {}

/// Ends the process if there is no listener.
///
/// A process that Ctrl-C ends dies by the signal, so that the script that called it ends, too; the first process of a
/// container cannot.
#[cfg(unix)]
#[expect(unsafe_code, reason = "calls that are allowed in a signal handler")]
extern "C" fn end(signal: libc::c_int) {
    if LISTENERS.load(Ordering::SeqCst) > 0 {
        return;
    }
    // SAFETY: POSIX allows these calls in a signal handler. The signal that is raised is blocked until the handler
    // returns.
    unsafe {
        if signal == libc::SIGINT && libc::getpid() != 1 {
            libc::signal(signal, libc::SIG_DFL);
            libc::raise(signal);
        } else {
            libc::_exit(INTERRUPTED.into());
        }
    }
}

/// Counts a listener while it exists.
#[derive(Debug)]
struct Listening;

impl Listening {
    fn new() -> Self {
        LISTENERS.fetch_add(1, Ordering::SeqCst);
        Self
    }
}

impl Drop for Listening {
    fn drop(&mut self) {
        LISTENERS.fetch_sub(1, Ordering::SeqCst);
    }
}

/// A listener for interrupts. While it exists, interrupts do not end the process. An interrupt between two calls of
/// [`Self::next`] is kept for the second.
#[derive(Debug)]
pub struct Interrupt {
    #[cfg(unix)]
    ctrl_c: tokio::signal::unix::Signal,
    #[cfg(unix)]
    terminate: tokio::signal::unix::Signal,
    /// `None` if the process ignores SIGHUP, as under `nohup`.
    #[cfg(unix)]
    hang_up: Option<tokio::signal::unix::Signal>,
    #[cfg(windows)]
    ctrl_c: tokio::signal::windows::CtrlC,
    _listening: Listening,
}

impl Interrupt {
    /// Starts to listen.
    ///
    /// # Errors
    /// If the system does not allow it.
    pub fn listen() -> Result<Self> {
        #[cfg(unix)]
        {
            use tokio::signal::unix::{SignalKind, signal};
            let listen = |kind, name| signal(kind).map_err(|e| Error::file(name, "listen for", e));
            Ok(Self {
                ctrl_c: listen(SignalKind::interrupt(), "SIGINT")?,
                terminate: listen(SignalKind::terminate(), "SIGTERM")?,
                hang_up: if is_hang_up_ignored() { None } else { Some(listen(SignalKind::hangup(), "SIGHUP")?) },
                // Last: a signal before this line ends the process, and none is lost.
                _listening: Listening::new(),
            })
        }
        #[cfg(windows)]
        Ok(Self {
            ctrl_c: tokio::signal::windows::ctrl_c().map_err(|e| Error::file("Ctrl-C", "listen for", e))?,
            _listening: Listening::new(),
        })
    }

    /// Waits for the next interrupt.
    pub async fn next(&mut self) {
        #[cfg(unix)]
        tokio::select! {
            _ = self.ctrl_c.recv() => {}
            _ = self.terminate.recv() => {}
            Some(()) = async { self.hang_up.as_mut()?.recv().await } => {}
        }
        #[cfg(windows)]
        self.ctrl_c.recv().await;
    }
}

/// True if the process was started with SIGHUP ignored, as by `nohup`; a listener would undo that.
///
/// Linux lists the ignored signals in /proc. Other systems are assumed to have no `nohup` if standard error is a
/// terminal.
#[cfg(unix)]
fn is_hang_up_ignored() -> bool {
    /// The bit of SIGHUP, signal 1.
    const HANG_UP: u64 = 1;
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status
        .lines()
        .find_map(|line| line.strip_prefix("SigIgn:"))
        .and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.map_or_else(|| !std::io::IsTerminal::is_terminal(&std::io::stderr()), |mask| mask & HANG_UP != 0)
}

#[cfg(all(test, unix))]
mod tests {
    use std::process::{self, Command};
    use std::time::Duration;

    use super::*;

    #[tokio::test]
    async fn an_interrupt_that_comes_while_nobody_waits_is_not_lost() {
        let mut interrupt = Interrupt::listen().unwrap();
        for signal in ["-INT", "-TERM"] {
            // As in a loop that does something else after each wait.
            let early = tokio::time::timeout(Duration::from_millis(1), interrupt.next()).await;
            assert!(early.is_err());
            // Every shell has the command; the program of this name is a package of its own.
            let line = format!("kill {signal} {}", process::id());
            let status = Command::new("sh").args(["-c", &line]).status().unwrap();
            assert!(status.success());
            tokio::time::sleep(Duration::from_millis(50)).await;
            let late = tokio::time::timeout(Duration::from_secs(20), interrupt.next()).await;
            assert!(late.is_ok(), "{signal}");
        }
    }
}
