//! Text edits that keep comments.
