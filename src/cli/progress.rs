//! A progress bar on a terminal, nothing elsewhere.

use crate::run::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Shows how far a run is until it ends.
pub struct Watch {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Watch {
    /// Starts to show.
    pub fn start(title: &str, progress: Arc<Progress>, quiet: bool) -> Self {
        let over = Arc::new(AtomicBool::new(false));
        let target = ProgressDrawTarget::stderr();
        if quiet || target.is_hidden() {
            return Self { over, thread: None };
        }
        let bar = ProgressBar::with_draw_target(None, target).with_message(title.to_owned());
        if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} % {eta}") {
            bar.set_style(style);
        }
        let watched = Arc::clone(&over);
        let thread = std::thread::spawn(move || {
            while !watched.load(Ordering::Relaxed) {
                bar.set_length(progress.total.load(Ordering::Relaxed).max(1));
                bar.set_position(progress.done.load(Ordering::Relaxed));
                std::thread::park_timeout(Duration::from_millis(100));
            }
            bar.finish_and_clear();
        });
        Self { over, thread: Some(thread) }
    }

    /// Takes the bar away.
    pub fn end(mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            let _ = thread.join();
        }
    }
}
