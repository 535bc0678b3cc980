//! Progress on standard error: [`Progress`].

use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use tracing_subscriber::fmt::MakeWriter;

use darkqa_base::types::text::escape_hidden;
use darkqa_base::types::text::{hours, money};

/// Progress on standard error: bars on a terminal, otherwise one line a minute about the trials.
#[derive(Debug, Clone)]
pub struct Progress {
    bars: MultiProgress,
    form: ProgressForm,
}

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ProgressForm {
    Bars,
    Lines,
    Nothing,
}

/// Time between two lines of progress.
pub const LINE_INTERVAL: Duration = Duration::from_mins(1);

/// Whether progress is shown (`--quiet`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verbosity {
    /// Show progress; the default.
    Normal,
    /// Show no progress.
    Quiet,
}

impl Progress {
    /// Progress on standard error.
    #[must_use]
    pub fn new(verbosity: Verbosity) -> Self {
        let form = match verbosity {
            Verbosity::Quiet => ProgressForm::Nothing,
            Verbosity::Normal if io::stderr().is_terminal() => ProgressForm::Bars,
            Verbosity::Normal => ProgressForm::Lines,
        };
        let target = match form {
            ProgressForm::Bars => ProgressDrawTarget::stderr(),
            ProgressForm::Lines | ProgressForm::Nothing => ProgressDrawTarget::hidden(),
        };
        Self { bars: MultiProgress::with_draw_target(target), form }
    }

    /// Prints one line above the bars. Nothing is printed without bars: if standard error is not a terminal, or with
    /// `--quiet`.
    pub fn print_on_terminal(&self, line: &str) {
        // A line that cannot be printed is no reason to stop.
        let _ = self.bars.println(line);
    }

    /// Prints one line in all cases: above the bars, into a pipe, and with `--quiet`.
    pub fn note(&self, line: &str) {
        // A line that cannot be printed is no reason to stop.
        let _ = writeln!(self.make_writer(), "{line}");
    }

    /// A plain bar for a step of known length.
    pub fn bar(&self, what: &'static str, length: usize) -> StepBar {
        let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len}");
        let bar = self.bars.add(ProgressBar::new(length as u64).with_message(what));
        let bar = style.map_or(bar.clone(), |style| bar.with_style(style));
        // Shown from the start, not only after the first step.
        bar.tick();
        StepBar(bar)
    }

    /// The progress of the trials: answered, failed, cost, rate, remaining time.
    pub fn trials(&self, trials: usize, answered: usize) -> TrialProgress {
        let bar = ProgressBar::new(trials as u64).with_position(answered as u64);
        let bar = self.bars.add(bar);
        bar.reset_eta();
        bar.enable_steady_tick(Duration::from_millis(500));
        let style = ProgressStyle::with_template("{wide_bar} {msg} of {len}{prefix} · {rate} · {eta} left");
        let bar = StepBar(style.map_or(bar.clone(), |style| bar.with_style(style.with_key("rate", rate))));
        let lines = TrialLines::new(trials, answered, Instant::now());
        let progress = TrialProgress {
            bar,
            lines: (self.form == ProgressForm::Lines).then(|| Mutex::new(lines)),
            log: self.clone(),
        };
        progress.count(answered, 0, None, "");
        progress
    }
}

/// Writes the trials per second, with one decimal.
fn rate(state: &ProgressState, out: &mut dyn fmt::Write) {
    // A rate that cannot be printed is no reason to stop.
    let _ = write!(out, "{:.1}/s", state.per_sec());
}

/// The bar of one step, removed when it is dropped.
pub struct StepBar(ProgressBar);

impl StepBar {
    pub fn inc(&self) {
        self.0.inc(1);
    }

    pub fn advance(&self, steps: usize) {
        self.0.inc(steps as u64);
    }
}

impl Drop for StepBar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// The progress of the trials, as a bar or as lines.
pub struct TrialProgress {
    bar: StepBar,
    /// The lines; `None` unless they are printed.
    lines: Option<Mutex<TrialLines>>,
    log: Progress,
}

impl TrialProgress {
    /// Shows the numbers of answered and failed trials, the US dollars spent, and a note about the request rate.
    pub fn count(&self, answered: usize, failed: usize, spent: Option<f64>, pace: &str) {
        if let Some(lines) = &self.lines {
            let mut lines = lines.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(line) = lines.next_line(answered, failed, spent, pace, Instant::now()) {
                self.log.note(&line);
            }
        }
        let StepBar(bar) = &self.bar;
        bar.set_prefix(pace.to_owned());
        bar.set_position((answered + failed) as u64);
        let spent = spent.map_or(String::new(), |dollars| format!(", {}", money(dollars)));
        bar.set_message(format!("{answered} answered, {failed} failed{spent}"));
    }
}

/// Source of the progress lines, at most one a minute.
#[derive(Debug)]
struct TrialLines {
    trials: usize,
    /// Trials that were answered before this call.
    answered_before: usize,
    start: Instant,
    /// Time of the last line; initially the start.
    last: Instant,
}

impl TrialLines {
    fn new(trials: usize, answered_before: usize, start: Instant) -> Self {
        Self { trials, answered_before, start, last: start }
    }

    /// The line for these numbers of trials and US dollars; `None` within a minute after the last line.
    fn next_line(
        &mut self,
        answered: usize,
        failed: usize,
        spent: Option<f64>,
        pace: &str,
        now: Instant,
    ) -> Option<String> {
        if now.duration_since(self.last) < LINE_INTERVAL {
            return None;
        }
        self.last = now;
        let done = answered + failed;
        let left = self.trials.saturating_sub(done);
        let seconds = now.duration_since(self.start).as_secs_f64();
        let rate = done.saturating_sub(self.answered_before) as f64 / seconds;
        let spent = spent.map_or(String::new(), |dollars| format!(" · {}", money(dollars)));
        let time =
            if rate > 0.0 { format!("{} left", hours(left as f64 / rate)) } else { "time left unknown".to_owned() };
        Some(format!(
            "{answered} of {} trials answered, {failed} failed, {left} left{pace} · {rate:.1}/s{spent} · {time}",
            self.trials
        ))
    }
}

/// Writer of log lines to standard error, above the bars.
#[derive(Debug)]
pub struct LogWriter(MultiProgress);

impl Write for LogWriter {
    /// Writes a line with hidden characters escaped, because it may quote a file. Errors of a closed terminal or pipe
    /// are ignored.
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        let text = String::from_utf8_lossy(line);
        let shown = escape_hidden(&text);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_once_a_minute() {
        let start = Instant::now();
        let mut lines = TrialLines::new(1000, 100, start);
        assert_eq!(lines.next_line(110, 0, None, "", start + Duration::from_secs(59)), None);
        assert_eq!(
            lines.next_line(218, 2, Some(1.2), "", start + LINE_INTERVAL).as_deref(),
            Some("218 of 1000 trials answered, 2 failed, 780 left · 2.0/s · $1.20 · 6 min left")
        );
        let second_line = start + 2 * LINE_INTERVAL;
        let too_early = start + Duration::from_secs(119);
        assert_eq!(lines.next_line(230, 2, None, "", too_early), None);
        assert!(lines.next_line(230, 2, None, "", second_line).is_some());
    }

    #[test]
    fn without_a_reply_the_time_left_is_unknown() {
        let start = Instant::now();
        let mut lines = TrialLines::new(10, 4, start);
        let line = lines.next_line(4, 0, None, "", start + LINE_INTERVAL);
        assert_eq!(line.as_deref(), Some("4 of 10 trials answered, 0 failed, 6 left · 0.0/s · time left unknown"));
    }
}
