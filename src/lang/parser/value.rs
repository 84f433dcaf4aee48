//! One value.

use super::body::Body;
use super::*;

impl Parser<'_> {
    /// Reads a value. The next token must begin one.
    pub(super) fn value(&mut self) {
        match self.kind() {
            Some(LParen) => self.parenthesised(),
            Some(LBracket) => self.bracketed(List, Body::Elements),
            Some(LBrace) => self.bracketed(Map, Body::Entries),
            Some(DotDot | DotDotEq | Number | Byte) => self.number_or_range(),
            Some(RawIdent) => self.parenthesised(),
            Some(Ident) => match self.text_ahead(0) {
                "true" | "false" => self.node(Literal, Self::bump),
                "None" => self.node(Optional, Self::bump),
                "Some" => self.some(),
                text if number::named(text).is_some() => self.number_or_range(),
                _ => self.parenthesised(),
            },
            _ => self.node(Literal, Self::bump),
        }
    }

    /// A number, or a range. The parts of a range touch each other.
    fn number_or_range(&mut self) {
        let is_dots = |kind| matches!(kind, Some(DotDot | DotDotEq));
        let has_start = !is_dots(self.kind());
        if has_start && !(is_dots(self.kind_ahead(1)) && self.touches(1)) {
            return self.node(Literal, Self::bump);
        }
        self.node(Range, |p| {
            if has_start {
                p.node(Literal, Self::bump);
            }
            let needs_end = p.at(DotDotEq);
            p.bump();
            if p.touches(0) && is_number(p.kind(), p.text_ahead(0)) {
                p.node(Literal, Self::bump);
            } else if needs_end {
                p.missing(ErrorKind::MissingValue, "a number right after `..=`");
            }
        });
    }

    /// A tuple or a struct with or without a name, `()`, or a name alone.
    fn parenthesised(&mut self) {
        let named = usize::from(!self.at(LParen));
        if named == 1 && self.fields_in_braces() {
            return self.node(Struct, |p| {
                p.bump();
                p.error_here(ErrorKind::Unexpected, "`(`: fields are enclosed in parentheses");
                p.enter(Body::Fields);
            });
        }
        if self.kind_ahead(named) != Some(LParen) {
            return self.node(Name, Self::bump);
        }
        if named == 0 && self.kind_ahead(1) == Some(RParen) && self.touches(1) {
            return self.node(Unit, |p| {
                p.bump();
                p.bump();
            });
        }
        if self.field_at(named + 1) {
            self.bracketed(Struct, Body::Fields);
        } else {
            self.bracketed(Tuple, Body::Elements);
        }
    }

    /// Returns true if a name stands here with fields in braces, as other languages write them.
    fn fields_in_braces(&self) -> bool {
        let braced = self.kind_ahead(1) == Some(LBrace) && self.same_line(1);
        braced && (self.kind_ahead(2) == Some(RBrace) || self.field_at(2))
    }

    /// Returns true if a named field begins `n` tokens ahead. Only a name with a colon is right; the others are
    /// wrong in any case, and most probably meant as fields.
    pub(super) fn field_at(&self, n: usize) -> bool {
        let (first, second) = (self.kind_ahead(n), self.kind_ahead(n + 1));
        match second {
            Some(Colon | Eq) => matches!(first, Some(Ident | RawIdent | Str)),
            Some(Number | Str | LBracket | LBrace) => {
                is_name(first) && self.text_ahead(n) != "Some" && self.same_line(n + 1)
            }
            _ => false,
        }
    }

    /// A value in brackets, with a name before the bracket if there is one.
    fn bracketed(&mut self, kind: SyntaxKind, body: Body) {
        self.node(kind, |p| {
            if is_name(p.kind()) {
                p.bump();
            }
            p.enter(body);
        });
    }

    fn some(&mut self) {
        self.node(Optional, |p| {
            p.bump();
            if p.at(LParen) {
                p.enter(Body::Some);
            } else if p.extensions.implicit_some && p.starts_value() {
                // `ron` reads on after the word `Some`, as if it were not there.
                p.deeper(|p| p.value());
            } else {
                p.missing(ErrorKind::BareSome, "`(` and a value after `Some`");
            }
        });
    }

    /// Reads an element that must cost one step of depth, or passes over it.
    pub(super) fn deeper(&mut self, content: impl FnOnce(&mut Self)) {
        if let Some(budget) = self.budget.checked_sub(1) {
            self.budget = budget;
            content(self);
            self.budget += 1;
        } else {
            self.error_here(ErrorKind::TooDeep, "values nested less deeply");
            self.node(Error, Self::skip_balanced);
        }
    }

    /// Passes over one element without looking into its brackets.
    fn skip_balanced(&mut self) {
        let mut depth = 0_usize;
        while let Some(kind) = self.kind() {
            if kind.closer().is_some() {
                depth += 1;
            } else if kind.is_closer() {
                if depth == 0 {
                    return;
                }
                depth -= 1;
            } else if kind == Comma && depth == 0 {
                return;
            }
            self.bump();
        }
    }
}
