//! Every code of a diagnostic, with what it means and how to mend it.

/// One code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Code {
    /// The code.
    pub code: &'static str,
    /// What it means in a few words.
    pub title: &'static str,
    /// What it means, why it is so, and how to mend it.
    pub text: &'static str,
}

/// The code of a name.
#[must_use]
pub fn find(code: &str) -> Option<&'static Code> {
    ALL.iter().find(|c| c.code == code)
}

/// All codes, in order.
pub const ALL: &[Code] = &[Code { code: "F001", title: "syntax error", text: "The text is not RON." }];
