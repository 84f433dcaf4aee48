//! Keys that steer: from standard input, or from a script for machines without a terminal.

use std::io::BufRead;
use std::sync::mpsc::{Receiver, channel};

/// Source of keys.
pub enum Keys {
    /// No keys.
    None,
    /// Characters of standard input, as their lines arrive.
    Typed(Receiver<char>),
    /// Times in seconds and keys, in order of time.
    Script(std::collections::VecDeque<(f64, char)>),
}

impl Keys {
    /// Reads standard input in a thread of its own.
    pub fn typed() -> Self {
        let (keys, pressed) = channel();
        std::thread::spawn(move || {
            for line in std::io::stdin().lock().lines().map_while(Result::ok) {
                if line.chars().any(|key| keys.send(key).is_err()) {
                    return;
                }
            }
        });
        Self::Typed(pressed)
    }

    /// Reads a script: in each line a time in seconds, a space, and keys that are pressed then. `#` begins a comment.
    ///
    /// # Errors
    /// The number of the line without a time, or with one earlier than before.
    pub fn script(text: &str) -> Result<Self, String> {
        let mut all = std::collections::VecDeque::new();
        for (k, line) in text.lines().enumerate() {
            let line = line.split('#').next().unwrap_or_default().trim_start();
            if line.trim().is_empty() {
                continue;
            }
            let (time, keys) = line.split_once(' ').unwrap_or((line, ""));
            let time = time.parse::<f64>().ok().filter(|t| t.is_finite() && *t >= 0.0);
            let time = time.filter(|t| all.back().is_none_or(|(last, _)| last <= t));
            let time =
                time.ok_or(format!("script, line {}: {line:?}: a time from the last on is needed", k + 1))?;
            // A space alone is a jump; spaces beside letters are not.
            let keys = if keys.trim().is_empty() { keys.get(..1).unwrap_or("") } else { keys.trim() };
            all.extend(keys.chars().map(|key| (time, key)));
        }
        Ok(Self::Script(all))
    }

    /// Time of the last key of a script, s.
    pub fn end(&self) -> Option<f64> {
        match self {
            Self::Script(keys) => keys.back().map(|(time, _)| *time),
            _ => None,
        }
    }

    /// Keys pressed up to a time since the last call.
    pub fn pressed(&mut self, until: f64) -> Vec<char> {
        match self {
            Self::None => Vec::new(),
            Self::Typed(keys) => keys.try_iter().collect(),
            Self::Script(keys) => {
                let due = keys.iter().take_while(|(time, _)| *time <= until).count();
                keys.drain(..due).map(|(_, key)| key).collect()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_presses_its_keys_at_their_times() {
        let mut keys = Keys::script("# start\n0.5 dd\n1  \n2.5 wj # and a jump\n").unwrap();
        assert_eq!(keys.end(), Some(2.5));
        assert_eq!(keys.pressed(0.4), []);
        assert_eq!(keys.pressed(1.0), ['d', 'd', ' ']);
        assert_eq!(keys.pressed(9.0), ['w', 'j']);
        assert!(Keys::script("1 a\n0.5 b").err().unwrap().contains("line 2"));
    }
}
