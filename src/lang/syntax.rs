//! The kinds of tokens and nodes, and the parsed tree.

use super::error::SyntaxError;

macro_rules! kinds {
    ($($(#[$doc:meta])* $name:ident,)*) => {
        /// Every kind of token and node of the tree.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[repr(u16)]
        pub enum SyntaxKind { $($(#[$doc])* $name,)* }
        const ALL: &[SyntaxKind] = &[$(SyntaxKind::$name,)*];
    };
}

kinds! {
    /// A run of white space.
    Whitespace,
    /// `// ...` up to, not including, the line feed.
    LineComment,
    /// `/* ... */`, which nests.
    BlockComment,
    /// `(`
    LParen,
    /// `)`
    RParen,
    /// `[`
    LBracket,
    /// `]`
    RBracket,
    /// `{`
    LBrace,
    /// `}`
    RBrace,
    /// `,`
    Comma,
    /// `:`
    Colon,
    /// `=`
    Eq,
    /// `#`
    Hash,
    /// `!`
    Bang,
    /// `..`
    DotDot,
    /// `..=`
    DotDotEq,
    /// An identifier, also `true`, `Some`, `inf`.
    Ident,
    /// `r#...`
    RawIdent,
    /// An integer or floating-point number with its sign and suffix.
    Number,
    /// `b'.'`
    Byte,
    /// `'.'`
    Char,
    /// `"..."`
    Str,
    /// `r"..."`, `r#"..."#`
    RawStr,
    /// `b"..."`
    ByteStr,
    /// `br"..."`, `br#"..."#`
    RawByteStr,
    /// Characters that start no token.
    Unknown,
    /// The root: attributes, then one value.
    Document,
    /// `#![...]`
    Attribute,
    /// One literal token.
    Literal,
    /// `()`
    Unit,
    /// A name that stands alone: a unit struct or variant.
    Name,
    /// `[...]`
    List,
    /// `{...}`
    Map,
    /// `key: value` in a map.
    Entry,
    /// Positional values in parentheses, with or without a name before them.
    Tuple,
    /// Named fields in parentheses, with or without a name before them.
    Struct,
    /// `name: value` in a struct.
    Field,
    /// `None` or `Some(...)`
    Optional,
    /// `a..b`, `a..=b`, `a..`, `..b`, `..=b`, `..`
    Range,
    /// Text that fits nowhere; an error covers or adjoins it.
    Error,
}

impl SyntaxKind {
    /// Returns true if a token of this kind is white space or a comment.
    pub fn is_trivia(self) -> bool {
        matches!(self, Self::Whitespace | Self::LineComment | Self::BlockComment)
    }

    /// Returns true if a token of this kind is a comment.
    pub fn is_comment(self) -> bool {
        matches!(self, Self::LineComment | Self::BlockComment)
    }

    /// Returns true if a node of this kind is a value.
    pub fn is_value(self) -> bool {
        matches!(
            self,
            Self::Literal
                | Self::Unit
                | Self::Name
                | Self::List
                | Self::Map
                | Self::Tuple
                | Self::Struct
                | Self::Optional
                | Self::Range
        )
    }

    /// The bracket that closes this one.
    pub(super) fn closer(self) -> Option<SyntaxKind> {
        Some(match self {
            Self::LParen => Self::RParen,
            Self::LBracket => Self::RBracket,
            Self::LBrace => Self::RBrace,
            _ => return None,
        })
    }

    pub(super) fn is_closer(self) -> bool {
        matches!(self, Self::RParen | Self::RBracket | Self::RBrace)
    }
}

/// The language tag of the `rowan` tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RonLanguage {}

impl rowan::Language for RonLanguage {
    type Kind = SyntaxKind;

    fn kind_from_raw(raw: rowan::SyntaxKind) -> SyntaxKind {
        ALL.get(usize::from(raw.0)).copied().unwrap_or(SyntaxKind::Error)
    }

    fn kind_to_raw(kind: SyntaxKind) -> rowan::SyntaxKind {
        rowan::SyntaxKind(kind as u16)
    }
}

/// A node of the tree.
pub type SyntaxNode = rowan::SyntaxNode<RonLanguage>;
/// A token of the tree.
pub type SyntaxToken = rowan::SyntaxToken<RonLanguage>;

/// The extensions a document enables with `#![enable(...)]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extensions {
    /// Newtype structs are written as their content.
    pub unwrap_newtypes: bool,
    /// Optional values are written without `Some(...)`.
    pub implicit_some: bool,
    /// The content of `Some(...)` is written without its own parentheses.
    pub unwrap_variant_newtypes: bool,
    /// Structs must have their names.
    pub explicit_struct_names: bool,
}

/// A parsed text: the whole text as a tree, and all its errors in text order.
#[derive(Clone, Debug)]
pub struct Parse {
    pub(super) green: rowan::GreenNode,
    pub(super) errors: Vec<SyntaxError>,
    pub(super) extensions: Extensions,
}

impl Parse {
    /// The root of the tree; its text is the parsed text, byte for byte.
    pub fn syntax(&self) -> SyntaxNode {
        SyntaxNode::new_root(self.green.clone())
    }

    /// All syntax errors, in text order.
    pub fn errors(&self) -> &[SyntaxError] {
        &self.errors
    }

    /// Returns true if the text has no syntax error, that is, if `ron` accepts it.
    pub fn is_ok(&self) -> bool {
        self.errors.is_empty()
    }

    /// The extensions that the document enables.
    pub fn extensions(&self) -> Extensions {
        self.extensions
    }
}
