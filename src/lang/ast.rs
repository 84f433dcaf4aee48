//! The values of a document as plain data with spans.
//!
//! Malformed parts of the text are [`ValueKind::Error`], and all others are as written:
//! entries and fields in order, with duplicates. A span covers the value alone, without the white space
//! and comments around it.

use super::error::Span;
use super::syntax::{Parse, SyntaxKind, SyntaxNode};

mod read;

/// A document: its attributes and its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Document {
    /// The attributes before the value, in order.
    pub attributes: Vec<Attribute>,
    /// The value, if there is one.
    pub value: Option<Value>,
}

/// An attribute `#![...]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Attribute {
    /// The whole attribute.
    pub span: Span,
    /// Its kind.
    pub kind: AttributeKind,
}

/// Kind of an attribute.
#[derive(Clone, Debug, PartialEq)]
pub enum AttributeKind {
    /// `#![enable(...)]`
    Enable(Vec<Name>),
    /// `#![schema = "..."]` or `#![type = "..."]`; the second part is the string.
    Text(Name, Spanned<String>),
    /// An attribute with a syntax error.
    Error,
}

/// An element with a location in the text.
#[derive(Clone, Debug, PartialEq)]
pub struct Spanned<T> {
    /// Its location.
    pub span: Span,
    /// The value.
    pub value: T,
}

impl<T> Spanned<T> {
    /// Its location.
    pub fn span(&self) -> Span {
        self.span.clone()
    }
}

/// An identifier, without `r#`.
pub type Name = Spanned<String>;

/// A value.
pub type Value = Spanned<ValueKind>;

/// Kind of a value.
#[derive(Clone, Debug, PartialEq)]
pub enum ValueKind {
    /// `()`
    Unit,
    /// `true` or `false`
    Bool(bool),
    /// `'c'`
    Char(char),
    /// An integer, or a byte literal `b'c'`.
    Int(i128),
    /// A number with a point or an exponent, or too large for an integer.
    Float(f64),
    /// A string, decoded.
    Str(String),
    /// A byte string, decoded.
    Bytes(Vec<u8>),
    /// `[a, b]`
    List(Vec<Value>),
    /// `{k: v}`
    Map(Vec<Entry>),
    /// `(a, b)`
    Tuple(Vec<Value>),
    /// `Name(a, b)`, also `Name()`
    NamedTuple(Name, Vec<Value>),
    /// `(f: v)` or `Name(f: v)`
    Struct(Option<Name>, Vec<Field>),
    /// A name alone, such as the variant of an enum.
    Name(Name),
    /// `None` or `Some(v)`
    Option(Option<Box<Value>>),
    /// `a..b`, `a..=b`, and those with one end or none.
    Range(Box<RangeValue>),
    /// Something with a syntax error in itself.
    Error,
}

/// The ends of a range.
#[derive(Clone, Debug, PartialEq)]
pub struct RangeValue {
    /// The number before the dots.
    pub start: Option<Value>,
    /// The number after the dots.
    pub end: Option<Value>,
    /// True if it is `..=`.
    pub inclusive: bool,
}

/// One entry of a map. What is missing is a [`ValueKind::Error`] with an empty span.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Span from the key to the value.
    pub span: Span,
    /// The key.
    pub key: Value,
    /// The value.
    pub value: Value,
}

/// One field of a struct. A missing value is a [`ValueKind::Error`] with an empty span.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Span from the name to the value.
    pub span: Span,
    /// The name.
    pub name: Name,
    /// The value.
    pub value: Value,
}

impl Parse {
    /// The document's values with their spans, also where the text has errors elsewhere.
    pub fn document(&self) -> Document {
        Document::read(self)
    }

    /// The values with exactly this span, the outermost first.
    ///
    /// # Complexity
    /// Linear in the depth of the tree, the children on the way, and the size of the values.
    pub fn values_at(&self, span: &Span) -> Vec<Value> {
        read::nodes_at(self, span)
            .filter(|node| node.kind().is_value())
            .map(|node| read::value(&node))
            .collect()
    }

    /// The values that contain an item with exactly this span, the outermost first.
    pub(super) fn holders_of(&self, span: &Span) -> Vec<Value> {
        let parents = read::nodes_at(self, span).filter_map(|node| node.parent());
        parents.filter(|node| node.kind().is_value()).map(|node| read::value(&node)).collect()
    }
}

impl Document {
    pub(super) fn read(parse: &Parse) -> Self {
        read::document(&parse.syntax())
    }

    /// The string of the attribute `schema` or `type`.
    pub fn attribute(&self, name: &str) -> Option<&Spanned<String>> {
        self.attributes.iter().find_map(|attribute| match &attribute.kind {
            AttributeKind::Text(key, text) if key.value == name => Some(text),
            _ => None,
        })
    }
}

impl Value {
    /// The value as a string.
    pub fn as_str(&self) -> Option<&str> {
        if let ValueKind::Str(text) = &self.value { Some(text) } else { None }
    }

    /// The value as an integer.
    pub fn as_int(&self) -> Option<i128> {
        if let ValueKind::Int(number) = self.value { Some(number) } else { None }
    }

    /// The value as a number; an integer is converted.
    pub fn as_f64(&self) -> Option<f64> {
        match self.value {
            ValueKind::Int(number) => Some(number as f64),
            ValueKind::Float(number) => Some(number),
            _ => None,
        }
    }

    /// The value as a truth value.
    pub fn as_bool(&self) -> Option<bool> {
        if let ValueKind::Bool(truth) = self.value { Some(truth) } else { None }
    }

    /// The elements of a list.
    pub fn as_list(&self) -> Option<&[Value]> {
        if let ValueKind::List(values) = &self.value { Some(values) } else { None }
    }

    /// The entries of a map.
    pub fn as_map(&self) -> Option<&[Entry]> {
        if let ValueKind::Map(entries) = &self.value { Some(entries) } else { None }
    }

    /// The name and the fields of a value like `Name(field: value)`. `Name`, `Name()` and an anonymous
    /// `(field: value)` count as well; positional values do not.
    pub fn as_struct(&self) -> Option<(Option<&Name>, &[Field])> {
        match &self.value {
            ValueKind::Struct(name, fields) => Some((name.as_ref(), fields)),
            ValueKind::NamedTuple(name, values) if values.is_empty() => Some((Some(name), &[])),
            ValueKind::Name(name) => Some((Some(name), &[])),
            _ => None,
        }
    }

    /// The value of the first field of this name.
    pub fn field(&self, name: &str) -> Option<&Value> {
        let (_, fields) = self.as_struct()?;
        fields.iter().find(|field| field.name.value == name).map(|field| &field.value)
    }

    /// The value of the first entry with this string as its key.
    pub fn get(&self, key: &str) -> Option<&Value> {
        self.as_map()?.iter().find(|entry| entry.key.as_str() == Some(key)).map(|entry| &entry.value)
    }

    /// Returns true if the value itself is broken; its parts may still be.
    pub fn is_error(&self) -> bool {
        self.value == ValueKind::Error
    }

    /// Describes the value, for messages such as "expected a number, found a string".
    pub fn describe(&self) -> &'static str {
        match &self.value {
            ValueKind::Unit => "the unit `()`",
            ValueKind::Bool(_) => "a truth value",
            ValueKind::Char(_) => "a character",
            ValueKind::Int(_) => "an integer",
            ValueKind::Float(_) => "a number",
            ValueKind::Str(_) => "a string",
            ValueKind::Bytes(_) => "a byte string",
            ValueKind::List(_) => "a list",
            ValueKind::Map(_) => "a map",
            ValueKind::Tuple(_) => "a tuple",
            ValueKind::NamedTuple(..) => "a named tuple",
            ValueKind::Struct(Some(_), _) => "a named struct",
            ValueKind::Struct(None, _) => "a struct",
            ValueKind::Name(_) => "a name",
            ValueKind::Option(None) => "`None`",
            ValueKind::Option(Some(_)) => "`Some`",
            ValueKind::Range(_) => "a range",
            ValueKind::Error => "a syntax error",
        }
    }

    /// Calls `visit` with this value and all values in it, keys included, each before its parts.
    pub fn walk<'a>(&'a self, visit: &mut impl FnMut(&'a Value)) {
        visit(self);
        match &self.value {
            ValueKind::List(values) | ValueKind::Tuple(values) | ValueKind::NamedTuple(_, values) => {
                values.iter().for_each(|value| value.walk(visit));
            }
            ValueKind::Map(entries) => {
                for entry in entries {
                    entry.key.walk(visit);
                    entry.value.walk(visit);
                }
            }
            ValueKind::Struct(_, fields) => fields.iter().for_each(|field| field.value.walk(visit)),
            ValueKind::Option(Some(value)) => value.walk(visit),
            ValueKind::Range(range) => {
                range.start.iter().chain(&range.end).for_each(|value| value.walk(visit));
            }
            _ => {}
        }
    }
}
