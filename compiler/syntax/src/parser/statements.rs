//! Blocks and statements. A statement that is broken ends there; the next one is read as if nothing had happened.

use super::{Abort, K, Parse, Parser};
use crate::lexer::Token;
use crate::tree::{Block, BlockId, ExprId, ExprKind, Stmt, StmtKind};
use crate::{Code, Diagnostic};

/// What a block consists of.
enum Part {
    Stmt(Stmt),
    Value(ExprId),
}

impl Parser<'_> {
    pub(super) fn block(&mut self) -> Parse<BlockId> {
        let start = self.current();
        if start.kind != K::LBrace {
            return self.unexpected("`{`");
        }
        let read = self.bracketed(K::RBrace, Self::block_body)?;
        let (stmts, value) = read.unwrap_or_default();
        let span = self.since(start);
        Ok(self.push_block(Block { stmts, value, span }))
    }

    fn block_body(&mut self, open: Token) -> Parse<(Vec<Stmt>, Option<ExprId>)> {
        let mut stmts = Vec::new();
        let mut value = None;
        while !self.eat(K::RBrace) {
            if self.at(K::End) || self.at_item() {
                self.report_unclosed(open, K::RBrace);
                self.unclosed += 1;
                break;
            }
            let start = self.current();
            match self.part() {
                Ok(Part::Stmt(stmt)) => stmts.push(stmt),
                Ok(Part::Value(expr)) => value = Some(expr),
                Err(Abort) => {
                    self.sync_statement();
                    self.give_up(start);
                }
            }
        }
        Ok((stmts, value))
    }

    fn part(&mut self) -> Parse<Part> {
        let start = self.current();
        let next = self.peek(1).kind;
        let kind = match (start.kind, next) {
            (K::Semi, _) => {
                self.bump();
                StmtKind::Empty
            }
            (K::Let | K::Csg, _) => self.bind(start)?,
            (K::Ident, K::Assign) => {
                let name = self.ident(start);
                self.bump();
                self.bump();
                let value = self.value();
                StmtKind::Assign { name, value }
            }
            (word, K::Assign) if word.is_keyword() && !matches!(word, K::If | K::For) => {
                let name = self.name("a name", &[K::Assign])?;
                self.bump();
                let value = self.value();
                StmtKind::Assign { name, value }
            }
            (K::For, _) if self.peek(2).kind != K::Assign => self.for_statement()?,
            (K::LBrace, _) => {
                self.bare_block()?;
                StmtKind::Empty
            }
            (K::If, _) => StmtKind::If(self.branch()?),
            _ => {
                let value = self.expr()?;
                if matches!(self.kind(), K::RBrace | K::End) || self.at_item() {
                    return Ok(Part::Value(value));
                }
                if self.at(K::Assign) && matches!(self.expr_kind(value), ExprKind::Access { .. }) {
                    self.component_assignment(value);
                    StmtKind::Empty
                } else {
                    StmtKind::Expr(self.end_of_statement(value, "`;` or `}`"))
                }
            }
        };
        Ok(Part::Stmt(Stmt { kind, span: self.since(start) }))
    }

    /// `let x = e;` or `csg x = e;`
    fn bind(&mut self, start: Token) -> Parse<StmtKind> {
        self.bump();
        let name = match self.name("a name", &[K::Assign]) {
            Ok(name) => name,
            Err(Abort) => return self.bind_nothing(),
        };
        self.expect(K::Assign)?;
        let value = self.value();
        Ok(StmtKind::Bind { csg: start.kind == K::Csg, name, value })
    }

    /// `let ; = e;`: what stands in place of the name has been reported, and the value is read for its own errors.
    fn bind_nothing(&mut self) -> Parse<StmtKind> {
        if self.peek(1).kind != K::Assign {
            return Err(Abort);
        }
        let start = self.bump();
        self.bump();
        let value = self.value();
        self.give_up(start);
        let span = self.expr_span(value);
        Ok(StmtKind::Expr(self.push_expr(ExprKind::Partial(value), span)))
    }

    /// `for i in lo..hi { … }`
    fn for_statement(&mut self) -> Parse<StmtKind> {
        self.bump();
        let counter = self.name("the name of the counter", &[K::In])?;
        let (lo, hi) = self.range_head()?;
        let body = self.block()?;
        Ok(StmtKind::For { counter, lo, hi, body })
    }

    /// `e;` at the end of a statement. A statement whose value is broken remains one, so that its name is known.
    fn value(&mut self) -> ExprId {
        let start = self.current();
        match self.expr() {
            Ok(value) => self.end_of_statement(value, "`;`"),
            Err(Abort) => {
                self.sync_statement();
                self.give_up(start);
                self.hole(start)
            }
        }
    }

    /// The `;` of a statement. Where it is missing at the end of a line, or before what can only come after it, the
    /// statement is taken to end there; otherwise its value is known in part only, or, if all that was read is a
    /// name, not at all: it may be a word that the language does not have.
    fn end_of_statement(&mut self, value: ExprId, expected: &str) -> ExprId {
        if self.eat(K::Semi) {
            return value;
        }
        let found = self.current();
        if !matches!(self.expr_kind(value), ExprKind::Error) {
            let _: Parse<()> = self.unexpected(expected);
        }
        let between = self.text.get(self.previous.end..found.start).unwrap_or("");
        let starts_statement = matches!(found.kind, K::Ident | K::Let | K::Csg | K::For | K::If | K::RBrace | K::Eval);
        if starts_statement && (between.contains('\n') || found.kind == K::RBrace) {
            return value;
        }
        self.sync_statement();
        self.give_up(found);
        let span = self.expr_span(value);
        let kind = match self.expr_kind(value) {
            ExprKind::Name(_) | ExprKind::Error => ExprKind::Error,
            _ => ExprKind::Partial(value),
        };
        self.push_expr(kind, span)
    }

    /// A block that belongs to nothing: read for its own errors, and dropped.
    fn bare_block(&mut self) -> Parse<()> {
        if !self.in_bare_block {
            let _: Parse<()> = self.unexpected("a statement");
        }
        let outer = std::mem::replace(&mut self.in_bare_block, true);
        let block = self.block();
        self.in_bare_block = outer;
        block.map(|_| ())
    }

    /// `a.x = e;` is what the language does not have (LANGUAGE 2.7).
    fn component_assignment(&mut self, target: ExprId) {
        let span = self.expr_span(target);
        self.report(|_| {
            Diagnostic::new(Code::E0207, span, "a component cannot be assigned")
                .help("rebuild the whole value, for example `v = [e, v.y, v.z];`")
        });
        self.bump();
        self.value();
    }
}
