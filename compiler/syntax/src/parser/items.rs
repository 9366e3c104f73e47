//! Items: modules, definitions, concepts, impls, functions, with their attributes and documentation.

use super::balance::Balance;
use super::{Abort, K, Parse, Parser};
use crate::lexer::Token;
use crate::tree::{Attribute, ExprId, Faults, Ident, Item, ItemKind, Param, TypeId};

/// What stands between an impl's word and its body.
struct ImplHeader {
    node: Ident,
    operands: Vec<Ident>,
    concept: Ident,
    args: Vec<Ident>,
}

impl Parser<'_> {
    pub(super) fn file(&mut self) {
        // Whether what was read last has errors, and whether its brackets do not match.
        let (mut broken, mut guessing) = (false, false);
        while !self.at(K::End) {
            let start = self.current();
            let (first, errors) = (self.diagnostics.len(), self.errors());
            let read = self.item();
            if read.is_err() {
                self.sync_item();
                self.lost.push((start.start, self.previous.end));
            }
            let nothing_new = self.errors() == errors;
            let remainder = matches!(start.kind, K::RBrace | K::RParen | K::RBracket | K::Semi);
            if read.is_err() && !starts_item(start.kind) && (guessing || broken && remainder) {
                // It may well belong to the item before it.
                self.diagnostics.truncate(first);
            } else if nothing_new {
                (broken, guessing) = (false, false);
            } else {
                let balance = self.balance(start.start);
                broken = true;
                guessing = !matches!(&balance, Balance::Statements(wrong) if wrong.is_empty());
                self.drop_guesses(first, &balance);
            }
            if let Ok(mut item) = read {
                item.faults.nesting |= guessing;
                self.tree.items.push(item);
            }
        }
    }

    /// What follows the item read last is none: that item may have ended too early.
    fn distrust_last(&mut self) {
        if let Some(last) = self.tree.items.last_mut() {
            last.faults = Faults { head: last.faults.head, any: true, nesting: true };
        }
    }

    /// Whether a \[24\] `define` starts here.
    pub(super) fn at_define(&mut self) -> bool {
        let token = self.current();
        token.kind == K::Ident
            && self.written(token) == "define"
            && self.peek(1).kind == K::Ident
            && self.peek(2).kind == K::LParen
    }

    fn item(&mut self) -> Parse<Item> {
        self.too_deep = false;
        self.broken_head = false;
        self.keyword_names.clear();
        let mut doc = self.doc();
        let (errors, mismatches) = (self.errors(), self.mismatches);
        let mut attributes = Vec::new();
        while self.at(K::Hash) {
            attributes.push(self.attribute()?);
            doc.extend(self.doc());
        }
        let start = self.current();
        let kind = self.item_kind(start)?;
        let doc = if doc.is_empty() { None } else { Some(doc.join("\n")) };
        let faults = Faults {
            head: self.broken_head,
            any: self.errors() != errors || self.mismatches != mismatches,
            nesting: self.mismatches != mismatches,
        };
        Ok(Item { doc, attributes, kind, span: self.since(start), faults })
    }

    fn item_kind(&mut self, start: Token) -> Parse<ItemKind> {
        match start.kind {
            K::Module => self.module(),
            K::Entity | K::Operation => self.definition(start),
            K::Concept => self.concept(),
            K::Impl => self.implementation(),
            K::Fn => {
                self.bump();
                self.function(false)
            }
            K::Export => {
                self.bump();
                if self.eat(K::Fn) { self.function(true) } else { self.untyped_function(true) }
            }
            _ if self.at_define() => {
                self.bump();
                self.untyped_function(false)
            }
            _ => {
                self.distrust_last();
                if self.unclosed > 0 {
                    self.unclosed -= 1;
                } else {
                    let _: Parse<()> = self
                        .unexpected("an item: `module`, `entity`, `operation`, `concept`, `impl`, `fn` or `export`");
                }
                self.bump();
                Err(Abort)
            }
        }
    }

    /// The documentation between the previous token and this one (LANGUAGE 1.3). Groups of lines with something
    /// else between them become paragraphs.
    fn doc(&mut self) -> Vec<String> {
        let end = self.current().start;
        let between = self.text.get(self.previous.end..end).unwrap_or("").trim_start_matches('\u{feff}');
        let code_before = usize::from(self.previous.end > 0);
        let mut lines = Vec::new();
        let mut gap = false;
        for line in between.split('\n').skip(code_before) {
            let line = line.strip_suffix('\r').unwrap_or(line).trim_start_matches([' ', '\t', '\r']);
            match line.strip_prefix("///").filter(|text| !text.starts_with('/')) {
                Some(text) => {
                    if gap && !lines.is_empty() {
                        lines.push(String::new());
                    }
                    gap = false;
                    lines.push(text.strip_prefix(' ').unwrap_or(text).to_owned());
                }
                None => gap = true,
            }
        }
        lines
    }

    /// `#[name(args)]`
    fn attribute(&mut self) -> Parse<Attribute> {
        let start = self.bump();
        if !self.at(K::LBracket) {
            return self.unexpected("`[`");
        }
        let read = self.bracketed(K::RBracket, |p, open| {
            let name = p.name("the name of the attribute", &[K::LParen])?;
            let args = p.args()?;
            p.close(open, K::RBracket, "")?;
            Ok((name, args))
        })?;
        let (name, args) = read.ok_or(Abort)?;
        Ok(Attribute { name, args, span: self.since(start) })
    }

    /// `module a::b;`
    fn module(&mut self) -> Parse<ItemKind> {
        self.bump();
        let mut path = Vec::new();
        loop {
            path.push(self.name("an element of the module's path", &[K::ColonColon, K::Semi])?);
            if !self.eat(K::ColonColon) {
                break;
            }
        }
        self.end_of_item();
        Ok(ItemKind::Module { path })
    }

    fn definition(&mut self, start: Token) -> Parse<ItemKind> {
        self.bump();
        let name = self.name("a name", &[K::LParen])?;
        self.doubt_name();
        let errors = self.errors();
        let params = self.params()?;
        self.broken_head = self.errors() != errors;
        self.end_of_item();
        Ok(ItemKind::Definition { operation: start.kind == K::Operation, name, params })
    }

    fn concept(&mut self) -> Parse<ItemKind> {
        self.bump();
        let name = self.name("the name of the concept", &[K::Colon])?;
        self.expect(K::Colon)?;
        let source = if self.at(K::Arrow) { None } else { Some(self.ty()?) };
        self.expect(K::Arrow)?;
        let target = self.ty()?;
        self.end_of_item();
        Ok(ItemKind::Concept { name, source, target })
    }

    fn end_of_item(&mut self) {
        if self.expect(K::Semi).is_err() && !self.at_define() {
            self.sync_item();
        }
    }

    fn implementation(&mut self) -> Parse<ItemKind> {
        self.bump();
        let errors = self.errors();
        let header = self.impl_header();
        self.broken_head = self.errors() != errors;
        if header.is_err() {
            self.sync_block()?;
        }
        let body = self.block()?;
        let ImplHeader { node, operands, concept, args } = header?;
        Ok(ItemKind::Impl { node, operands, concept, args, body })
    }

    /// `N<a, b> for C(p)`
    fn impl_header(&mut self) -> Parse<ImplHeader> {
        let node = self.name("the name of an entity or operation", &[K::Lt, K::For])?;
        let mut operands = Vec::new();
        if self.eat(K::Lt) {
            loop {
                operands.push(self.name("the name of an operand", &[K::Comma, K::Gt])?);
                if !self.eat(K::Comma) || self.at(K::Gt) {
                    break;
                }
            }
            self.close_angle()?;
        }
        self.expect(K::For)?;
        let concept = self.name("the name of a concept", &[K::LParen, K::LBrace])?;
        let mut args = Vec::new();
        if self.at(K::LParen) {
            let read = self.bracketed(K::RParen, |p, open| {
                let name = |p: &mut Self| p.name("the name of an argument", &[K::Comma, K::RParen]);
                p.list(open, K::RParen, Vec::new(), name, |_, _| None)
            })?;
            args = read.unwrap_or_default().0;
        }
        if !self.at(K::LBrace) {
            return self.unexpected("`{`");
        }
        Ok(ImplHeader { node, operands, concept, args })
    }

    /// `fn name(params) -> R { … }`, after the word.
    fn function(&mut self, export: bool) -> Parse<ItemKind> {
        let name = self.name("the name of the function", &[K::LParen])?;
        self.doubt_name();
        let (start, errors) = (self.current(), self.errors());
        let params = self.params();
        let result = if params.is_ok() { self.result_type() } else { Err(Abort) };
        let result = self.typed_head(result)?;
        self.end_of_head(start, errors);
        let body = self.block()?;
        let params = params.unwrap_or_default();
        Ok(ItemKind::Function { export, name, params, result: Some(result), define: false, body })
    }

    /// A name without the parenthesis that must follow may have become one with what comes after it.
    fn doubt_name(&mut self) {
        self.tree.incomplete |= !self.at(K::LParen);
    }

    fn result_type(&mut self) -> Parse<TypeId> {
        if !self.eat(K::Arrow) {
            return self.unexpected("`->` and the type of the result");
        }
        let ty = self.ty()?;
        if self.at(K::LBrace) { Ok(ty) } else { self.unexpected("`{`") }
    }

    fn typed_head(&mut self, result: Parse<TypeId>) -> Parse<TypeId> {
        match result {
            Ok(ty) => Ok(ty),
            Err(Abort) => {
                self.sync_block()?;
                let at = self.current();
                Ok(self.error_type(at))
            }
        }
    }

    /// Before the block of a function: whether its head has errors, so that names in it may be parameters.
    fn end_of_head(&mut self, start: Token, errors: u64) {
        self.broken_head = self.errors() != errors;
        if self.broken_head {
            self.give_up(start);
        }
    }

    /// `export name(params) { … }` and `define name(params) { … }`, after the word \[24\].
    fn untyped_function(&mut self, export: bool) -> Parse<ItemKind> {
        let what = if export { "`fn` or the name of the export" } else { "the name of the function" };
        let name = self.name(what, &[K::LParen])?;
        self.doubt_name();
        let (start, errors) = (self.current(), self.errors());
        let params = self.params();
        if params.is_err() {
            self.sync_block()?;
        }
        self.end_of_head(start, errors);
        let body = self.block()?;
        let params = params.unwrap_or_default();
        Ok(ItemKind::Function { export, name, params, result: None, define: !export, body })
    }

    fn params(&mut self) -> Parse<Vec<Param>> {
        if !self.at(K::LParen) {
            return self.unexpected("`(`");
        }
        let read =
            self.bracketed(K::RParen, |p, open| p.list(open, K::RParen, Vec::new(), Self::param, |_, _| None))?;
        Ok(read.unwrap_or_default().0)
    }

    /// `name: T = default in [lo .. hi]`
    fn param(&mut self) -> Parse<Param> {
        let name = self.name("the name of a parameter", &[K::Colon])?;
        self.expect(K::Colon)?;
        let ty = self.ty()?;
        let default = if self.eat(K::Assign) { Some(self.expr()?) } else { None };
        let range = if self.eat(K::In) { self.param_range()? } else { None };
        Ok(Param { name, ty, default, range })
    }

    fn param_range(&mut self) -> Parse<Option<(ExprId, ExprId)>> {
        if !self.at(K::LBracket) {
            return self.unexpected("`[`");
        }
        self.bracketed(K::RBracket, |p, open| {
            let lo = p.expr()?;
            p.expect(K::DotDot)?;
            let hi = p.expr()?;
            p.close(open, K::RBracket, "")?;
            Ok((lo, hi))
        })
    }
}

/// Whether an item can begin with this.
const fn starts_item(kind: K) -> bool {
    matches!(kind, K::Module | K::Entity | K::Operation | K::Concept | K::Impl | K::Fn | K::Export | K::Hash)
}
