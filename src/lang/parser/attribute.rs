//! `#![enable(...)]`, `#![type = "..."]` and `#![schema = "..."]`.

use super::*;

const EXTENSIONS: &str =
    "one of unwrap_newtypes, implicit_some, unwrap_variant_newtypes, explicit_struct_names";

impl Parser<'_> {
    pub(super) fn attribute(&mut self) {
        self.node(Attribute, |p| {
            if p.attribute_inside().is_none() {
                p.skip_attribute();
            }
        });
    }

    fn expect(&mut self, kind: SyntaxKind, what: &str) -> Option<()> {
        if self.eat(kind) {
            return Some(());
        }
        self.missing(ErrorKind::BadAttribute, what);
        None
    }

    fn attribute_inside(&mut self) -> Option<()> {
        self.bump();
        self.expect(Bang, "`!`, as in `#![schema = \"...\"]`")?;
        self.expect(LBracket, "`[`, as in `#![schema = \"...\"]`")?;
        match (self.kind(), self.text_ahead(0)) {
            (Some(Ident), "enable") => {
                self.bump();
                self.expect(LParen, "`(`, as in `#![enable(implicit_some)]`")?;
                self.extensions()?;
                self.expect(RParen, "`)`")?;
            }
            (Some(Ident), "schema" | "type") => {
                self.bump();
                self.expect(Eq, "`=`")?;
                if !(self.at(Str) || self.at(RawStr)) {
                    self.missing(ErrorKind::BadAttribute, "a string");
                    return None;
                }
                self.bump();
            }
            _ => {
                self.error_here(ErrorKind::BadAttribute, "`schema`, `type` or `enable`");
                return None;
            }
        }
        self.expect(RBracket, "`]`")
    }

    fn extensions(&mut self) -> Option<()> {
        loop {
            if !is_name(self.kind()) {
                self.error_here(ErrorKind::BadAttribute, EXTENSIONS);
                return None;
            }
            let name = self.text_ahead(0);
            match name.strip_prefix("r#").unwrap_or(name) {
                "unwrap_newtypes" => self.extensions.unwrap_newtypes = true,
                "implicit_some" => self.extensions.implicit_some = true,
                "unwrap_variant_newtypes" => self.extensions.unwrap_variant_newtypes = true,
                "explicit_struct_names" => self.extensions.explicit_struct_names = true,
                _ => self.error_here(ErrorKind::UnknownExtension, EXTENSIONS),
            }
            self.bump();
            if self.at(RParen) || self.kind().is_none() {
                return Some(());
            }
            if !self.eat(Comma) {
                if !is_name(self.kind()) {
                    return Some(());
                }
                self.missing(ErrorKind::MissingComma, "`,`");
            }
            if self.at(RParen) {
                return Some(());
            }
        }
    }

    /// Leaves a broken attribute at its `]`, or at the end of its line.
    fn skip_attribute(&mut self) {
        while self.kind().is_some() && self.same_line(0) {
            if self.eat(RBracket) {
                return;
            }
            self.bump();
        }
    }
}
