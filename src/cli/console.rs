//! Standard output and standard error: they receive text, and their reader may have ended.

use crate::diag::plain;
use std::fmt::Display;
use std::io::{self, IsTerminal as _, StderrLock, StdoutLock, Write};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Writes text without its control characters.
pub struct PlainText<W>(W);

impl<W: Write> Write for PlainText<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write_all(plain(&String::from_utf8_lossy(bytes)).as_bytes())?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// Standard output.
pub fn stdout() -> PlainText<StdoutLock<'static>> {
    PlainText(io::stdout().lock())
}

/// Prints a line on standard output at once.
///
/// # Errors
/// When the reader has gone.
pub fn print_line(line: &str) -> io::Result<()> {
    let mut out = stdout();
    writeln!(out, "{line}")?;
    out.flush()
}

/// Writes to standard error. Failures are ignored: a closed standard error does not end the process.
fn write_error(write: impl FnOnce(&mut StderrLock<'_>) -> io::Result<()>) {
    let _ = write(&mut io::stderr().lock());
}

/// Prints a message of the command on standard error.
pub fn print_message(message: impl Display) {
    write_error(|err| writeln!(err, "foley: {}", plain(&message.to_string())));
}

/// Prints a text on standard error with its control characters, for colours or a line that is written again.
pub fn print_styled(text: &str) {
    write_error(|err| {
        err.write_all(text.as_bytes())?;
        err.flush()
    });
}

/// Messages of a kind that anybody can cause in any number: ten a second are shown, and the rest are counted.
pub struct Throttle(Mutex<Shown>);

/// The messages of the present second.
struct Shown {
    since: Instant,
    shown: usize,
    left_out: usize,
}

impl Default for Throttle {
    fn default() -> Self {
        Self(Mutex::new(Shown { since: Instant::now(), shown: 0, left_out: 0 }))
    }
}

impl Throttle {
    /// Messages a second.
    pub const MOST: usize = 10;

    /// Returns the number of `wanted` messages that may be shown now.
    pub fn allow(&self, wanted: usize) -> usize {
        self.flush();
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let allowed = wanted.min(Self::MOST - state.shown);
        state.shown += allowed;
        state.left_out += wanted - allowed;
        allowed
    }

    /// Prints a message as [`print_message`] does, if it may be shown.
    pub fn print_message(&self, message: impl Display) {
        if self.allow(1) == 1 {
            print_message(message);
        }
    }

    /// Prints the number of messages that were left out, when their second is over.
    pub fn flush(&self) {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if state.since.elapsed() >= Duration::from_secs(1) {
            if state.left_out > 0 {
                print_message(format_args!("{} more", state.left_out));
            }
            *state = Shown { since: Instant::now(), shown: 0, left_out: 0 };
        }
    }
}

/// True if messages may have colours.
pub fn colours() -> bool {
    io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_shown_as_pictures() {
        assert_eq!(plain("a\tb\nä"), "a\tb\nä");
        assert_eq!(plain("\x1b]0;x\x07\r\x7f\u{9b}2J"), "␛]0;x␇␍␡\u{fffd}2J");
        let mut out = PlainText(Vec::new());
        write!(out, "\x1b[2J is {}", 3).unwrap();
        assert_eq!(out.0, "␛[2J is 3".as_bytes());
    }
}
