//! Items between two brackets, and the recovery of the parser from errors.

use super::*;

/// Content of a pair of brackets.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Body {
    /// Values.
    Elements,
    /// `key: value`.
    Entries,
    /// `name: value`.
    Fields,
    /// The one value of `Some(...)`.
    Some,
}

impl Body {
    fn item(self) -> &'static str {
        match self {
            Body::Elements | Body::Some => "a value",
            Body::Entries => "a key",
            Body::Fields => "a field name",
        }
    }
}

fn bracket(kind: SyntaxKind) -> char {
    match kind {
        LParen => '(',
        RParen => ')',
        LBracket => '[',
        RBracket => ']',
        LBrace => '{',
        _ => '}',
    }
}

impl Parser<'_> {
    /// Reads from the opening bracket to the closing one.
    pub(super) fn enter(&mut self, body: Body) {
        let Some(closer) = self.kind().and_then(SyntaxKind::closer) else { return };
        if body != Body::Some && self.budget == 0 {
            return self.deeper(|_| {});
        }
        self.open.push((closer, self.next));
        self.bump();
        // `ron` counts one step for the brackets, and one for each of the elements.
        let cost = usize::from(body != Body::Some);
        self.budget -= cost;
        match body {
            Body::Some => self.inside_some(closer),
            _ => self.items(body, closer),
        }
        self.budget += cost;
        let ended = self.ended(self.opener(), closer);
        let opener = self.span_of(self.opener());
        self.open.pop();
        if ended || !self.eat(closer) {
            let open = self.text[opener.clone()].to_owned();
            let message = format!("`{open}` is not closed before {}", self.found());
            self.error(opener, ErrorKind::MissingBracket, message, &format!("`{}`", bracket(closer)));
        }
    }

    fn span_of(&self, significant: usize) -> Span {
        self.significant.get(significant).map_or(0..0, |&i| self.tokens[i].start..self.tokens[i].end)
    }

    fn inside_some(&mut self, closer: SyntaxKind) {
        if !self.extensions.unwrap_variant_newtypes {
            return self.items(Body::Some, closer);
        }
        if self.at(closer) {
            // The extension lets `Some()` stand for `Some(())`.
            return self.deeper(|_| {});
        }
        // The brackets of a struct or tuple in `Some` are left out.
        let inner = match () {
            () if self.field_at(0) => (Struct, Body::Fields),
            () if self.has_second_element() => (Tuple, Body::Elements),
            () => return self.items(Body::Some, closer),
        };
        self.deeper(|p| {
            p.deeper(|p| p.node(inner.0, |p| p.items(inner.1, closer)));
        });
    }

    /// Returns true if a comma and another element stand between here and the closing bracket.
    fn has_second_element(&self) -> bool {
        let mut depth = 0_usize;
        for n in 0.. {
            match self.kind_ahead(n) {
                None => return false,
                Some(kind) if kind.closer().is_some() => depth += 1,
                Some(kind) if kind.is_closer() && depth == 0 => return false,
                Some(kind) if kind.is_closer() => depth -= 1,
                Some(Comma) if depth == 0 => return self.kind_ahead(n + 1) != Some(RParen),
                Some(_) => {}
            }
        }
        false
    }

    /// Reads items to the closing bracket, which is left.
    fn items(&mut self, body: Body, closer: SyntaxKind) {
        let mut count = 0;
        while self.more(body, closer) {
            if self.budget == 0 {
                self.error_here(ErrorKind::TooDeep, "values nested less deeply");
                self.node(Error, |p| p.skip_to(closer));
                return;
            }
            self.budget -= 1;
            count += self.one_item(body, closer);
            self.budget += 1;
        }
        if body == Body::Some && count != 1 && self.at(closer) {
            let expected = "exactly one value in `Some(...)`";
            self.error_here(ErrorKind::MissingValue, expected);
        }
    }

    fn skip_to(&mut self, closer: SyntaxKind) {
        let mut depth = 0_usize;
        while let Some(kind) = self.kind() {
            if kind.closer().is_some() {
                depth += 1;
            } else if kind.is_closer() {
                if depth == 0 && kind == closer {
                    return;
                }
                depth = depth.saturating_sub(1);
            }
            self.bump();
        }
    }

    /// Returns true if another item stands before the closing bracket. Stray brackets are passed over.
    fn more(&mut self, body: Body, closer: SyntaxKind) -> bool {
        loop {
            let Some(kind) = self.kind() else { return false };
            let opener = self.opener();
            if self.ended(opener, closer) || body != Body::Entries && self.at_outer_key(closer) {
                return false;
            }
            if !kind.is_closer() {
                return true;
            }
            if kind == closer {
                let strays =
                    self.layout.as_ref().is_some_and(|layout| layout.strays(opener, self.next, kind));
                if !strays {
                    return false;
                }
            }
            let excess = self.layout.as_mut().is_some_and(|layout| layout.take_excess(kind));
            let belongs = self.open.iter().rev().skip(1).any(|&(outer, _)| outer == kind);
            if !excess && belongs {
                return false;
            }
            let expected = format!("`{}` to close `{}`", bracket(closer), &self.text[self.span_of(opener)]);
            self.error_here(ErrorKind::StrayBracket, &expected);
            self.node(Error, Self::bump);
            // The comma belongs to the item before the bracket.
            self.eat(Comma);
        }
    }

    /// Reads one item and the comma after it. Returns how many values it was.
    fn one_item(&mut self, body: Body, closer: SyntaxKind) -> usize {
        if self.at(Comma) {
            self.error_here(ErrorKind::MissingValue, &format!("{} before the comma", body.item()));
            self.node(Error, Self::bump);
            return 0;
        }
        let keyed = matches!(body, Body::Entries | Body::Fields);
        if !(self.starts_value() || keyed && self.at(Colon)) {
            self.stray_tokens(&format!("{} or `{}`", body.item(), bracket(closer)));
            self.eat(Comma);
            return 0;
        }
        match body {
            Body::Elements | Body::Some => self.element(),
            Body::Entries => self.entry(),
            Body::Fields => self.field(),
        }
        self.separator(body, closer);
        1
    }

    /// Returns true if the layout indicates that the bracket opened at `opener` should have been closed before here.
    fn ended(&self, opener: usize, closer: SyntaxKind) -> bool {
        self.layout.as_ref().is_some_and(|layout| layout.ended(opener, self.next, self.at(closer)))
    }

    /// Returns true if a quoted key stands here, in no map, because a bracket is missing before it.
    fn at_outer_key(&self, closer: SyntaxKind) -> bool {
        self.layout.as_ref().is_some_and(|layout| layout.lacks(closer))
            && self.at(Str)
            && self.kind_ahead(1) == Some(Colon)
            && self.open.iter().any(|&(outer, _)| outer == RBrace)
    }

    fn opener(&self) -> usize {
        self.open.last().map_or(0, |&(_, at)| at)
    }

    fn separator(&mut self, body: Body, closer: SyntaxKind) {
        let Some(kind) = self.kind() else { return };
        if self.eat(Comma) || kind.is_closer() {
            return;
        }
        if self.ended(self.opener(), closer) {
            return;
        }
        if self.starts_value() {
            // A comma was read as part of an item that lacks its closing bracket.
            if self.last_kind() == Some(Comma) {
                return;
            }
            self.missing(ErrorKind::MissingComma, &format!("`,` or `{}`", bracket(closer)));
        } else {
            self.stray_tokens(&format!("`,` or `{}` after {}", bracket(closer), body.item()));
            self.eat(Comma);
        }
    }

    /// Reads tokens that fit nowhere, up to something that does.
    fn stray_tokens(&mut self, expected: &str) {
        if !self.at(Unknown) {
            self.error_here(ErrorKind::Unexpected, expected);
        }
        let semicolon = self.text_ahead(0) == ";";
        self.node(Error, |p| {
            p.bump();
            while !semicolon && p.same_line(0) && p.kind().is_some_and(|k| k != Comma && !k.is_closer()) {
                if p.starts_value() { p.value() } else { p.bump() }
            }
        });
    }

    fn element(&mut self) {
        if matches!(self.kind_ahead(1), Some(Colon | Eq))
            && !matches!(self.kind(), Some(LParen | LBracket | LBrace))
        {
            let expected =
                "a value without a name: fields are named all or not at all, and only maps `{}` have keys";
            self.error_here(ErrorKind::MixedFields, expected);
            return self.node(Error, |p| {
                p.bump();
                p.bump();
                if p.starts_value() {
                    p.value();
                }
            });
        }
        self.value();
    }

    fn entry(&mut self) {
        self.node(Entry, |p| {
            if p.at(Colon) {
                p.error_here(ErrorKind::MissingKey, "a key before `:`");
            } else {
                p.value();
            }
            p.colon_and_value("the key");
        });
    }

    fn field(&mut self) {
        if !(self.field_at(0) || self.at(Colon)) {
            self.error_here(ErrorKind::MixedFields, "a field name: fields are named all or not at all");
            return self.node(Error, Self::value);
        }
        self.node(Field, |p| {
            if p.at(Colon) {
                p.error_here(ErrorKind::MissingKey, "a field name before `:`");
            } else {
                if p.at(Str) {
                    p.error_here(ErrorKind::MissingKey, "a field name without quotes");
                }
                p.bump();
            }
            p.colon_and_value("the field name");
        });
    }

    fn colon_and_value(&mut self, after: &str) {
        if self.at(Eq) {
            self.error_here(ErrorKind::MissingColon, &format!("`:` after {after}"));
            self.node(Error, Self::bump);
        } else if !self.eat(Colon) {
            self.missing(ErrorKind::MissingColon, &format!("`:` after {after}"));
            if !self.same_line(0) {
                return;
            }
        }
        // `a: b: 1` lacks the value of `a`.
        let next_key = self.kind_ahead(1) == Some(Colon) && (is_name(self.kind()) || self.at(Str));
        let ended = self.open.last().is_some_and(|&(closer, opener)| self.ended(opener, closer));
        if self.starts_value() && !next_key && !ended {
            self.value();
        } else if !self.at(Unknown) {
            self.missing(ErrorKind::MissingValue, "a value after `:`");
        }
    }
}
