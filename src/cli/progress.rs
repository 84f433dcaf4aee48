//! A progress bar on a terminal, a plain line now and then elsewhere.

use crate::run::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::Write as _;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Interval between two updates of the progress.
const LOOK: Duration = Duration::from_millis(100);
/// Minimum time between two plain lines, and from the start to the first.
const PAUSE: Duration = Duration::from_secs(5);

/// Shows the progress of a run until it ends.
pub struct Watch {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Watch {
    /// Starts to show.
    pub fn start(title: &str, progress: Arc<Progress>, quiet: bool) -> Self {
        let over = Arc::new(AtomicBool::new(false));
        let target = ProgressDrawTarget::stderr();
        if quiet {
            return Self { over, thread: None };
        }
        if target.is_hidden() {
            let (title, watched) = (title.to_owned(), Arc::clone(&over));
            let thread = std::thread::spawn(move || write_lines(&title, &progress, &watched));
            return Self { over, thread: Some(thread) };
        }
        let bar = ProgressBar::with_draw_target(None, target).with_message(title.to_owned());
        if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} % {eta}") {
            bar.set_style(style);
        }
        let (title, watched) = (title.to_owned(), Arc::clone(&over));
        let thread = std::thread::spawn(move || {
            while !watched.load(Ordering::Relaxed) {
                bar.set_length(progress.total.load(Ordering::Relaxed).max(1));
                bar.set_position(progress.done.load(Ordering::Relaxed));
                let value = progress.value_text().map_or_else(String::new, |text| format!(", {text}"));
                bar.set_message(format!("{title}{value}"));
                std::thread::park_timeout(LOOK);
            }
            bar.finish_and_clear();
        });
        Self { over, thread: Some(thread) }
    }

    /// Takes the bar away, or writes no more lines.
    pub fn end(mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            let _ = thread.join();
        }
    }
}

/// Writes a line now and then until the run is over.
fn write_lines(title: &str, progress: &Progress, over: &AtomicBool) {
    let (start, mut lines) = (Instant::now(), Lines::default());
    while !over.load(Ordering::Relaxed) {
        let (done, total) = (progress.done.load(Ordering::Relaxed), progress.total.load(Ordering::Relaxed));
        let value = progress.value_text();
        if let Some(line) = lines.due(start.elapsed(), done, total, value.as_deref()) {
            // A run continues even if its progress cannot be shown.
            let _ = writeln!(std::io::stderr(), "{title}: {line}");
        }
        std::thread::park_timeout(LOOK);
    }
}

/// The lines written so far.
#[derive(Debug, Default)]
struct Lines {
    last: Duration,
    reported: String,
}

impl Lines {
    /// The line that is due after some time: never two within [`PAUSE`], nor two of the same. `value` is what a value node reports.
    fn due(&mut self, spent: Duration, done: u64, total: u64, value: Option<&str>) -> Option<String> {
        let percent = 100 * done.min(total) / total.max(1);
        let state = value.map_or_else(|| format!("{percent} %"), str::to_owned);
        if spent < self.last + PAUSE || state == self.reported || state == "0 %" {
            return None;
        }
        let line = format!("{state} after {:.0} s", spent.as_secs_f64());
        (self.last, self.reported) = (spent, state);
        Some(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_come_now_and_then_and_only_where_there_is_something_new() {
        let mut lines = Lines::default();
        let mut due = |seconds, done| lines.due(Duration::from_secs(seconds), done, 200, None);
        assert_eq!(due(4, 100), None, "too early");
        assert_eq!(due(5, 100).as_deref(), Some("50 % after 5 s"));
        assert_eq!(due(9, 150), None, "too soon");
        assert_eq!(due(11, 101), None, "the same");
        assert_eq!(due(12, 300).as_deref(), Some("100 % after 12 s"));
        assert_eq!(Lines::default().due(PAUSE, 0, 0, None), None, "nothing to do yet");
        let value = Lines::default().due(PAUSE, 0, 0, Some("model: 40 %"));
        assert_eq!(value.as_deref(), Some("model: 40 % after 5 s"));
    }
}
