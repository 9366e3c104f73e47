//! Types as written. Accepts any word as a type: which exist, and of what, is the checker's business.

use super::{K, Parse, Parser};
use crate::lexer::Token;
use crate::tree::{TypeId, TypeKind};
use crate::{Code, Diagnostic};

impl Parser<'_> {
    pub(super) fn ty(&mut self) -> Parse<TypeId> {
        let start = self.current();
        match start.kind {
            K::Ident if self.written(start) == "tensor" => self.tensor(start),
            K::Ident if self.written(start) == "interval" => {
                self.bump();
                match self.element(start)? {
                    Some(inner) => Ok(self.push_type(TypeKind::Interval(inner), self.since(start))),
                    None => self.unexpected("`<`"),
                }
            }
            K::Ident | K::Csg => {
                self.bump();
                let element = self.element(start)?;
                let name = self.written(start).to_owned();
                Ok(self.push_type(TypeKind::Word { name, element }, self.since(start)))
            }
            K::LParen => self.tuple_type(start),
            _ => self.unexpected("a type"),
        }
    }

    pub(super) fn error_type(&mut self, at: Token) -> TypeId {
        self.push_type(TypeKind::Error, self.place(at))
    }

    /// `<T>`, if it is there.
    pub(super) fn element(&mut self, word: Token) -> Parse<Option<TypeId>> {
        if !self.at(K::Lt) {
            return Ok(None);
        }
        if self.depth >= self.nesting {
            self.report_too_deep(word);
            return Err(super::Abort);
        }
        self.bump();
        self.depth += 1;
        let inner = self.ty();
        self.depth -= 1;
        let inner = inner?;
        self.close_angle()?;
        Ok(Some(inner))
    }

    /// `tensor<2, 3, 4><real>`.
    fn tensor(&mut self, start: Token) -> Parse<TypeId> {
        self.bump();
        self.expect(K::Lt)?;
        loop {
            if !self.eat(K::Int) {
                return self.unexpected("an extent of the tensor, an integer");
            }
            if !self.eat(K::Comma) {
                break;
            }
        }
        self.close_angle()?;
        self.element(start)?;
        Ok(self.push_type(TypeKind::Tensor, self.since(start)))
    }

    /// `(T, U)`; `(T)` is `T` (LANGUAGE 3.1).
    fn tuple_type(&mut self, start: Token) -> Parse<TypeId> {
        let items = self.bracketed(K::RParen, |p, open| {
            p.list(open, K::RParen, Vec::new(), Self::ty, |p, at| Some(p.error_type(at)))
        })?;
        let span = self.since(start);
        let Some((items, _)) = items else { return Ok(self.push_type(TypeKind::Error, span)) };
        match items.as_slice() {
            [] => {
                self.report(|_| {
                    Diagnostic::new(Code::E0205, span, "an empty tuple is no type")
                        .help("the smallest tuple is `(real, real)`")
                });
                Ok(self.push_type(TypeKind::Error, span))
            }
            [only] => {
                if let Some(ty) = self.tree.types.get_mut(only.0 as usize) {
                    ty.span = span;
                }
                Ok(*only)
            }
            _ => Ok(self.push_type(TypeKind::Tuple(items), span)),
        }
    }
}
