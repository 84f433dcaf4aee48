//! Errors of nodes.

use super::time::{Rate, Tick};
use std::fmt;

/// Reason why a node's parameters and inputs are incompatible, found before anything runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Reject {
    /// Stable code of the message, such as `F031`.
    pub code: &'static str,
    /// Description of the mistake.
    pub message: String,
    /// The parameter or input port that it is about.
    pub field: Option<String>,
    /// Advice on the correct form.
    pub help: Option<String>,
    /// Rate that the stream at `field` should have, if it has another one.
    pub rate: Option<Rate>,
}

impl Reject {
    /// A rejection with its code and the finding.
    #[must_use]
    pub fn new(code: &'static str, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), field: None, help: None, rate: None }
    }

    /// Names the rate that the stream should have.
    #[must_use]
    pub fn rate(mut self, rate: Rate) -> Self {
        self.rate = Some(rate);
        self
    }
}

/// An error while a node was built or ran.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Stable code of the message.
    pub code: &'static str,
    /// Description of the mistake.
    pub message: String,
    /// The parameter or input port that it is about.
    pub field: Option<String>,
    /// Advice on the correct form.
    pub help: Option<String>,
    /// Time in the piece, if it is known.
    pub time: Option<Tick>,
}

impl Fault {
    /// A fault with its code and the finding.
    #[must_use]
    pub fn new(code: &'static str, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), field: None, help: None, time: None }
    }

    /// The fault of a computation that was stopped on demand.
    #[must_use]
    pub fn stopped() -> Self {
        Self::new("F091", "stopped before the end")
    }

    /// Adds its time in the piece.
    #[must_use]
    pub fn when(mut self, time: Tick) -> Self {
        self.time = Some(time);
        self
    }
}

impl From<Reject> for Fault {
    fn from(reject: Reject) -> Self {
        let Reject { code, message, field, help, .. } = reject;
        Self { code, message, field, help, time: None }
    }
}

/// What both kinds of errors have: a field that they are about, advice, and the message with the advice as text.
macro_rules! advised {
    ($error:ident) => {
        impl $error {
            /// Names the parameter or input that it is about.
            #[must_use]
            pub fn at(mut self, field: impl Into<String>) -> Self {
                self.field = Some(field.into());
                self
            }

            /// Adds advice on the correct form.
            #[must_use]
            pub fn help(mut self, help: impl Into<String>) -> Self {
                self.help = Some(help.into());
                self
            }
        }

        impl fmt::Display for $error {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(&self.message)?;
                if let Some(help) = &self.help {
                    write!(f, " ({help})")?;
                }
                Ok(())
            }
        }

        impl std::error::Error for $error {}
    };
}
advised!(Reject);
advised!(Fault);
