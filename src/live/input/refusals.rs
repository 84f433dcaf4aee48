//! Messages that reach no node: counted by kind, and the first of each mistake in words.

use std::collections::HashSet;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};

/// Maximum number of different mistakes that are reported: anybody can cause any number of them.
const MAX_TEXTS: usize = 32;

/// Reason for which a message is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// It cannot be parsed, or its numbers are not those of its kind.
    Malformed,
    /// No node reads its channel.
    Unclaimed,
    /// The node that reads its channel reads another kind of messages.
    WrongKind,
    /// Its node has no room for more, or it is a frame that is not later than the one before.
    Dropped,
    /// It is too far ahead.
    TooEarly,
    /// It sets a parameter that does not exist, or to a value that does not fit.
    NotSet,
}

impl Refusal {
    /// All of them, each at its own index.
    pub const ALL: [Self; 6] =
        [Self::Malformed, Self::Unclaimed, Self::WrongKind, Self::Dropped, Self::TooEarly, Self::NotSet];

    /// Its key in a report.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::Malformed => "malformed",
            Self::Unclaimed => "unclaimed",
            Self::WrongKind => "wrong_kind",
            Self::Dropped => "dropped",
            Self::TooEarly => "too_early",
            Self::NotSet => "not_set",
        }
    }

    /// In words, after a number.
    #[must_use]
    pub fn words(self) -> &'static str {
        match self {
            Self::Malformed => "malformed",
            Self::Unclaimed => "for no node",
            Self::WrongKind => "of the wrong kind",
            Self::Dropped => "dropped",
            Self::TooEarly => "too early",
            Self::NotSet => "that set nothing",
        }
    }
}

/// Counts of refused messages, and texts that wait to be reported.
#[derive(Default)]
pub struct Refusals {
    counts: [AtomicU64; Refusal::ALL.len()],
    texts: Mutex<Texts>,
}

#[derive(Default)]
struct Texts {
    known: HashSet<String>,
    waiting: Vec<String>,
}

impl Refusals {
    /// Returns the number of messages refused for a reason.
    pub fn count(&self, refusal: Refusal) -> u64 {
        self.counts[refusal as usize].load(Relaxed)
    }

    /// Counts a message whose mistake is reported elsewhere.
    pub fn add(&self, refusal: Refusal) {
        self.counts[refusal as usize].fetch_add(1, Relaxed);
    }

    /// Counts a message, and reports its mistake if it is the first of its kind.
    pub fn refuse(&self, refusal: Refusal, text: impl FnOnce() -> String) {
        self.add(refusal);
        self.note(text);
    }

    /// Reports unusual properties of a message once.
    pub fn note(&self, text: impl FnOnce() -> String) {
        let texts = || self.texts.lock().unwrap_or_else(PoisonError::into_inner);
        if texts().known.len() >= MAX_TEXTS {
            return;
        }
        let text = text();
        let mut texts = texts();
        if texts.known.insert(text.clone()) {
            texts.waiting.push(text);
        }
    }

    /// Takes the texts that are not reported yet.
    pub fn take_texts(&self) -> Vec<String> {
        std::mem::take(&mut self.texts.lock().unwrap_or_else(PoisonError::into_inner).waiting)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_of_each_mistake_is_reported_and_all_are_counted() {
        let refusals = Refusals::default();
        for k in 0..100 {
            refusals.refuse(Refusal::Unclaimed, || "no node reads `a`".to_owned());
            refusals.refuse(Refusal::Malformed, || format!("packet {k}"));
        }
        let texts = refusals.take_texts();
        assert_eq!(texts.len(), MAX_TEXTS);
        assert_eq!(texts[..2], ["no node reads `a`", "packet 0"]);
        assert!(refusals.take_texts().is_empty());
        let counts = Refusal::ALL.map(|refusal| refusals.count(refusal));
        assert_eq!(counts, [100, 100, 0, 0, 0, 0]);
        assert!(Refusal::ALL.iter().enumerate().all(|(k, refusal)| *refusal as usize == k));
    }
}
