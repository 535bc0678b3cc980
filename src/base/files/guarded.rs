//! Calls of third-party decoders whose panics become errors: [`guarded`].
//!
//! A decoder should return an error for every broken file. Some panic instead: the OpenEXR decoder on a few damaged
//! blocks of lossy compression (found by mutated files). One file must not end a run.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Once;

thread_local! {
    /// Whether a decoder runs in this thread, so that its panic is not printed.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Runs a decoder and returns its result, or an error if it panics. Callers use nothing that the decoder worked on
/// after a panic.
pub fn guarded<T>(decode: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let print = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !GUARDED.get() {
                print(info);
            }
        }));
    });
    let outer = GUARDED.replace(true);
    let decoded = panic::catch_unwind(AssertUnwindSafe(decode));
    GUARDED.set(outer);
    decoded.unwrap_or_else(|_| {
        let problem = "not a whole file: its decoder broke down; copy or export it again";
        Err(problem.to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_error() {
        let broken = guarded(|| -> Result<u8, String> { panic!("in a decoder") });
        assert!(broken.unwrap_err().contains("broke down"));
        assert_eq!(guarded(|| Ok(1)), Ok(1));
        assert_eq!(guarded(|| Err::<u8, _>("no".to_owned())), Err("no".to_owned()));
        let nested = guarded(|| {
            let inner = guarded(|| -> Result<u8, String> { panic!("in an inner decoder") });
            inner.or(Ok(2))
        });
        assert_eq!(nested, Ok(2));
    }
}
