//! Progress on standard error: [`Progress`].

use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use tracing_subscriber::fmt::MakeWriter;

use crate::report::forecast::money;
use crate::types::shown_text::shown;

/// Progress bars on standard error, or nowhere if it is not a terminal.
#[derive(Debug, Clone)]
pub(crate) struct Progress {
    bars: MultiProgress,
}

/// Whether progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verbosity {
    /// Show progress if standard error is a terminal.
    Normal,
    /// Show no progress (`--quiet`).
    Quiet,
}

impl Progress {
    /// Progress on standard error.
    #[must_use]
    pub(crate) fn new(verbosity: Verbosity) -> Self {
        let shown = verbosity == Verbosity::Normal && io::stderr().is_terminal();
        let target = if shown {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        };
        Self {
            bars: MultiProgress::with_draw_target(target),
        }
    }

    /// Prints one line above the bars, but nothing into a pipe or with `--quiet`.
    pub(crate) fn say(&self, line: &str) {
        // A line that cannot be printed is no reason to stop.
        let _ = self.bars.println(line);
    }

    /// Prints one line above the bars, also into a pipe and with `--quiet`.
    pub(crate) fn note(&self, line: &str) {
        // A line that cannot be printed is no reason to stop.
        let _ = writeln!(self.make_writer(), "{line}");
    }

    /// A plain bar for a step of known length, removed when it is dropped.
    pub(crate) fn bar(&self, what: &'static str, length: usize) -> StepBar {
        let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len}");
        let bar = self
            .bars
            .add(ProgressBar::new(length as u64).with_message(what));
        let bar = style.map_or(bar.clone(), |style| bar.with_style(style));
        // Shown from the start, not only after the first step.
        bar.tick();
        StepBar(bar)
    }

    /// The bar of the trials: answered, failed, rate, remaining time.
    pub(crate) fn trials(&self, trials: usize, answered: usize) -> StepBar {
        let bar = ProgressBar::new(trials as u64).with_position(answered as u64);
        let bar = self.bars.add(bar);
        bar.reset_eta();
        bar.enable_steady_tick(Duration::from_millis(500));
        let style =
            ProgressStyle::with_template("{wide_bar} {msg} of {len}{prefix} · {rate} · {eta} left");
        let bar = StepBar(style.map_or(bar.clone(), |style| {
            bar.with_style(style.with_key("rate", rate))
        }));
        bar.count(answered, 0, None, "");
        bar
    }
}

/// Writes the trials per second, with one decimal.
fn rate(state: &ProgressState, out: &mut dyn fmt::Write) {
    // A rate that cannot be printed is no reason to stop.
    let _ = write!(out, "{:.1}/s", state.per_sec());
}

/// The bar of one step, removed when it is dropped.
pub(crate) struct StepBar(ProgressBar);

impl StepBar {
    pub(crate) fn inc(&self) {
        self.0.inc(1);
    }

    pub(crate) fn advance(&self, steps: usize) {
        self.0.inc(steps as u64);
    }

    /// Shows the numbers of answered and failed trials, the US dollars spent, and a note about the pace.
    pub(crate) fn count(&self, answered: usize, failed: usize, spent: Option<f64>, pace: &str) {
        self.0.set_prefix(pace.to_owned());
        self.0.set_position((answered + failed) as u64);
        let spent = spent.map_or(String::new(), |dollars| format!(", {}", money(dollars)));
        self.0
            .set_message(format!("{answered} answered, {failed} failed{spent}"));
    }
}

impl Drop for StepBar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// Writer of log lines to standard error, above the bars.
#[derive(Debug)]
pub(crate) struct LogWriter(MultiProgress);

impl Write for LogWriter {
    /// Hidden characters are written out, because a line may quote a file. A terminal that was closed, or a reader that has gone, is
    /// no reason to stop: what cannot be written is dropped.
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        let text = String::from_utf8_lossy(line);
        let shown = shown(&text);
        let _ = self.0.suspend(|| io::stderr().write_all(shown.as_bytes()));
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let _ = io::stderr().flush();
        Ok(())
    }
}

impl<'a> MakeWriter<'a> for Progress {
    type Writer = LogWriter;

    fn make_writer(&'a self) -> LogWriter {
        LogWriter(self.bars.clone())
    }
}
