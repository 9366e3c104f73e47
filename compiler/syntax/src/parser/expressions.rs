//! Expressions (LANGUAGE 2.2, 2.3). Operator, cast, access and else-if chains are loops over flat data; the stack
//! grows only with brackets and with heads inside heads.

use super::{Abort, K, Parse, Parser};
use crate::lexer::{Token, int_value, real_value};
use crate::tree::{BinaryOp, ExprId, ExprKind, UnaryOp};
use crate::{Code, Diagnostic, Span};

/// An operator waiting for its right side.
struct Pending {
    left: ExprId,
    op: BinaryOp,
    op_span: Span,
}

impl Parser<'_> {
    /// An expression, by precedence. At most one operator per level waits at a time, for all associate to the left.
    pub(super) fn expr(&mut self) -> Parse<ExprId> {
        let mut pending: Vec<Pending> = Vec::new();
        loop {
            let mut value = self.cast()?;
            let token = self.current();
            let next = binary_operator(token.kind);
            let binds = next.map_or(0, precedence);
            while let Some(Pending { left, op, op_span }) = pending.pop_if(|p| precedence(p.op) >= binds) {
                let span = self.expr_span(left).to(self.expr_span(value));
                value = self.push_expr(ExprKind::Binary { op, op_span, left, right: value }, span);
            }
            let Some(op) = next else { return Ok(value) };
            self.bump();
            pending.push(Pending { left: value, op, op_span: self.span(token) });
        }
    }

    /// `e::<T>.x::<U>…`
    fn cast(&mut self) -> Parse<ExprId> {
        let mut value = self.unary()?;
        while self.at(K::ColonColon) {
            let word = self.bump();
            let Some(ty) = self.element(word)? else { return self.unexpected("`<`, as in `x::<int>`") };
            let span = self.whole(value);
            value = self.push_expr(ExprKind::Cast { value, ty }, span);
            value = self.accesses(value)?;
        }
        Ok(value)
    }

    /// Prefix operators count as nesting, but are no recursion.
    fn unary(&mut self) -> Parse<ExprId> {
        let depth = self.depth;
        let mut prefixes = Vec::new();
        while let Some(op) = unary_operator(self.kind()) {
            if self.depth >= self.nesting {
                let token = self.current();
                self.report_too_deep(token);
                while unary_operator(self.kind()).is_some() {
                    self.bump();
                }
                self.depth = depth;
                return Err(Abort);
            }
            self.depth += 1;
            let token = self.bump();
            prefixes.push((op, self.span(token)));
        }
        let operand = self.postfix();
        self.depth = depth;
        let mut value = operand?;
        for (op, op_span) in prefixes.into_iter().rev() {
            let span = op_span.to(self.expr_span(value));
            value = self.push_expr(ExprKind::Unary { op, operand: value }, span);
        }
        Ok(value)
    }

    fn postfix(&mut self) -> Parse<ExprId> {
        let value = self.primary()?;
        self.accesses(value)
    }

    /// `.x.0…`
    fn accesses(&mut self, mut value: ExprId) -> Parse<ExprId> {
        while self.eat(K::Dot) {
            let token = self.current();
            let field = if token.kind == K::Index {
                self.bump();
                self.ident(token)
            } else {
                let follow = [self.peek(1).kind];
                self.name("a field or an index", &follow)?
            };
            if token.kind != K::Index && self.at(K::LParen) {
                let span = self.expr_span(value);
                self.args()?;
                value = self.not_a_name(span);
                continue;
            }
            let span = self.whole(value);
            value = self.push_expr(ExprKind::Access { base: value, field }, span);
        }
        Ok(value)
    }

    /// From the start of `value` to the token consumed last.
    fn whole(&self, value: ExprId) -> Span {
        self.range(self.expr_span(value).start as usize, self.previous.end)
    }

    fn primary(&mut self) -> Parse<ExprId> {
        let token = self.current();
        let constant = match token.kind {
            K::Ident => return self.name_or_call(token),
            K::Eval => return self.eval(token),
            word if self.is_keyword_name(word) => ExprKind::Name(self.written(token).to_owned()),
            K::LParen => return self.parentheses(token),
            K::LBracket => return self.list_literal(token),
            K::If | K::For => return self.nested_head(token),
            K::Int => match int_value(self.written(token)) {
                Some(value) => ExprKind::Int(value),
                None => ExprKind::Error,
            },
            K::Real => match real_value(self.written(token)) {
                Some(value) => ExprKind::Real(value),
                None => ExprKind::Error,
            },
            K::Inf => ExprKind::Real(f64::INFINITY),
            K::Pi => ExprKind::Real(std::f64::consts::PI),
            K::Euler => ExprKind::Real(std::f64::consts::E),
            K::True => ExprKind::Bool(true),
            K::False => ExprKind::Bool(false),
            K::Bad(_) => ExprKind::Error,
            K::Dot if self.peek(1).kind == K::Index => {
                self.bump();
                let index = self.current();
                let whole = Token { start: token.start, ..index };
                self.report_bad(crate::lexer::Fault::Number, whole);
                ExprKind::Error
            }
            _ => return self.unexpected("an expression"),
        };
        self.bump();
        Ok(self.push_expr(constant, self.since(token)))
    }

    /// Whether a keyword stands for a name that it was wrongly given to, and can mean nothing else here.
    fn is_keyword_name(&mut self, word: K) -> bool {
        let has_meaning = match word {
            K::For => self.peek(1).kind == K::Ident,
            K::If | K::Let | K::Csg | K::True | K::False | K::Inf | K::Pi | K::Euler => true,
            _ => !word.is_keyword(),
        };
        !has_meaning && self.keyword_names.contains(&word)
    }

    /// `x`, `f(args)`, `N(args){ … }{ … }`, or the \[24\] form `x.C(args)`.
    fn name_or_call(&mut self, token: Token) -> Parse<ExprId> {
        if self.peek(1).kind == K::Dot && self.peek(2).kind == K::Ident && self.peek(3).kind == K::LParen {
            return self.eval_name(token, false);
        }
        self.bump();
        if !self.at(K::LParen) {
            return Ok(self.push_expr(ExprKind::Name(self.written(token).to_owned()), self.span(token)));
        }
        let args = self.args()?;
        let mut blocks = Vec::new();
        while !self.in_head && self.at(K::LBrace) {
            blocks.push(self.block()?);
        }
        let callee = self.ident(token);
        Ok(self.push_expr(ExprKind::Call { callee, args, blocks }, self.since(token)))
    }

    /// `(args)`
    pub(super) fn args(&mut self) -> Parse<Vec<ExprId>> {
        if !self.at(K::LParen) {
            return self.unexpected("`(`");
        }
        let start = self.current();
        match self.bracketed(K::RParen, |p, open| p.exprs(open, K::RParen, Vec::new()))? {
            Some((args, _)) => Ok(args),
            None => Ok(vec![self.hole(start)]),
        }
    }

    fn exprs(&mut self, open: Token, close: K, items: Vec<ExprId>) -> Parse<(Vec<ExprId>, bool)> {
        self.list(open, close, items, Self::expr, |p, start| Some(p.hole(start)))
    }

    /// What stands for an expression that could not be read.
    pub(super) fn hole(&mut self, start: Token) -> ExprId {
        self.push_expr(ExprKind::Error, self.since(start))
    }

    /// `eval v.C(args)`
    fn eval(&mut self, start: Token) -> Parse<ExprId> {
        self.bump();
        let operand = self.current();
        let after = [self.peek(1).kind, self.peek(2).kind, self.peek(3).kind];
        match (operand.kind, after) {
            (K::Ident, [K::Dot, K::Ident, last]) if last != K::Dot => {
                let value = self.eval_name(operand, true)?;
                let span = self.since(start);
                if let Some(expr) = self.tree.exprs.get_mut(value.0 as usize) {
                    expr.span = span;
                }
                Ok(value)
            }
            (K::Ident, [next, ..]) if !matches!(next, K::Dot | K::LParen) => {
                self.bump();
                self.unexpected("`.` and a concept, as in `eval tree.C(x)`")
            }
            (K::Ident | K::LParen | K::LBracket | K::If | K::For, _) => self.eval_of_no_name(),
            _ => self.unexpected("the name of a csg variable"),
        }
    }

    /// `v.C(args)`, the first two known to be there.
    fn eval_name(&mut self, tree: Token, word: bool) -> Parse<ExprId> {
        self.bump();
        self.bump();
        let concept = self.bump();
        let args = self.args()?;
        let (tree_name, concept) = (self.ident(tree), self.ident(concept));
        Ok(self.push_expr(ExprKind::Eval { tree: tree_name, concept, args, word }, self.since(tree)))
    }

    /// `eval f().C(x)`: read, so that what follows makes sense, and rejected.
    fn eval_of_no_name(&mut self) -> Parse<ExprId> {
        let operand = self.primary()?;
        let mut span = self.expr_span(operand);
        let mut args = false;
        while !args && self.eat(K::Dot) {
            let field = self.current();
            if !matches!(field.kind, K::Ident | K::Index) {
                return self.unexpected("the name of a concept");
            }
            self.bump();
            args = self.at(K::LParen);
            if args {
                self.args()?;
            } else {
                span = self.whole(operand);
            }
        }
        Ok(self.not_a_name(span))
    }

    fn not_a_name(&mut self, span: Span) -> ExprId {
        self.report(|_| {
            Diagnostic::new(Code::E0206, span, "`eval` of something that is no name")
                .here("only a csg variable can be interpreted")
                .help("bind it first: `csg tree = …; eval tree.C(x)`")
        });
        self.push_expr(ExprKind::Error, self.range(span.start as usize, self.previous.end))
    }

    /// `(e)`, which is `e`, or a tuple.
    fn parentheses(&mut self, start: Token) -> Parse<ExprId> {
        let read = self.bracketed(K::RParen, |p, open| p.exprs(open, K::RParen, Vec::new()))?;
        let span = self.since(start);
        let Some((items, last_comma)) = read else { return Ok(self.push_expr(ExprKind::Error, span)) };
        match items.as_slice() {
            [only] if !last_comma => {
                if let Some(expr) = self.tree.exprs.get_mut(only.0 as usize) {
                    expr.span = span;
                }
                Ok(*only)
            }
            [] | [_] => {
                if last_comma {
                    let what = if items.is_empty() { "an empty tuple" } else { "a tuple of one element" };
                    self.report(|_| {
                        Diagnostic::new(Code::E0205, span, format!("{what} does not exist"))
                            .help("the smallest tuple is `(a, b)`")
                    });
                }
                Ok(self.push_expr(ExprKind::Error, span))
            }
            _ => Ok(self.push_expr(ExprKind::Tuple(items), span)),
        }
    }

    /// `[a, b]`, `[e; N]` or `[lo .. hi]`: decided after the first expression (LANGUAGE 2.1).
    fn list_literal(&mut self, start: Token) -> Parse<ExprId> {
        let read = self.bracketed(K::RBracket, |p, open| {
            if p.eat(K::RBracket) {
                let span = p.since(start);
                p.report(|_| {
                    Diagnostic::new(Code::E0205, span, "an empty list does not exist")
                        .help("the smallest list is `[a, b]`")
                });
                return Ok(ExprKind::Error);
            }
            if p.ends_brackets() {
                p.report_unclosed(open, K::RBracket);
                return Ok(ExprKind::Error);
            }
            let first = p.element_or_hole()?;
            match p.kind() {
                K::Semi => p.splat(open, first),
                K::DotDot => {
                    p.bump();
                    let hi = p.element_or_hole()?;
                    p.close(open, K::RBracket, "")?;
                    Ok(ExprKind::Interval { lo: first, hi })
                }
                _ => {
                    let (more, complete) = p.separator(open, K::RBracket)?;
                    let mut items = vec![first];
                    if !complete {
                        items.push(p.hole(open));
                    }
                    if more {
                        items = p.exprs(open, K::RBracket, items)?.0;
                    }
                    Ok(ExprKind::List(items))
                }
            }
        })?;
        Ok(self.push_expr(read.unwrap_or(ExprKind::Error), self.since(start)))
    }

    fn element_or_hole(&mut self) -> Parse<ExprId> {
        let start = self.current();
        match self.expr() {
            Ok(value) => Ok(value),
            Err(Abort) => {
                self.sync_list(K::RBracket)?;
                self.give_up(start);
                Ok(self.hole(start))
            }
        }
    }

    /// `; N]` of a splat: an integer literal, nothing else (LANGUAGE 2.6).
    fn splat(&mut self, open: Token, element: ExprId) -> Parse<ExprKind> {
        self.bump();
        let start = self.current();
        if start.kind == K::Int && self.peek(1).kind == K::RBracket {
            let count = int_value(self.written(start)).and_then(|n| u32::try_from(n).ok()).unwrap_or(0);
            self.bump();
            self.bump();
            return Ok(ExprKind::Splat { element, count });
        }
        if self.ends_brackets() {
            self.report_unclosed(open, K::RBracket);
            return Err(Abort);
        }
        let mut end = self.sync_list(K::RBracket);
        while end.is_ok() && self.eat(K::Comma) {
            end = self.sync_list(K::RBracket);
        }
        if !matches!(start.kind, K::Bad(_)) {
            let span = if self.previous.end > start.start { self.since(start) } else { self.span(start) };
            self.report(|p| {
                let found = super::clip(p.text.get(span.start as usize..span.end as usize).unwrap_or(""));
                Diagnostic::new(Code::E0203, span, format!("the count of a splat is `{found}`, not an integer literal"))
                    .here("expected an integer literal")
                    .help("write the number itself, as in `[0.0; 3]`")
            });
        }
        end?;
        self.bump();
        Ok(ExprKind::Error)
    }

    /// An `if` or `for` as a value. Heads may hold further ones without any bracket, which is nesting as well.
    fn nested_head(&mut self, token: Token) -> Parse<ExprId> {
        if self.heads >= self.nesting {
            self.report_too_deep(token);
            self.skip_to_end();
            return Err(Abort);
        }
        self.heads += 1;
        let value = if token.kind == K::If { self.branch() } else { self.carried_loop(token) };
        self.heads -= 1;
        value
    }

    /// `if c { … } else if d { … } else { … }`
    pub(super) fn branch(&mut self) -> Parse<ExprId> {
        let start = self.bump();
        let mut arms = Vec::new();
        let mut otherwise = None;
        loop {
            let at = self.current();
            let condition = self.head(Self::expr, |p| p.hole(at))?;
            arms.push((condition, self.block()?));
            if !self.eat(K::Else) {
                break;
            }
            if !self.eat(K::If) {
                if !self.at(K::LBrace) {
                    return self.unexpected("`if` or `{`");
                }
                otherwise = Some(self.block()?);
                break;
            }
        }
        Ok(self.push_expr(ExprKind::If { arms, otherwise }, self.since(start)))
    }

    /// `for v = init in lo..hi { … }` \[24\]
    fn carried_loop(&mut self, start: Token) -> Parse<ExprId> {
        self.bump();
        let name = self.name("a name", &[K::Assign])?;
        self.expect(K::Assign)?;
        let init = self.expr()?;
        let (lo, hi) = self.range_head()?;
        let body = self.block()?;
        Ok(self.push_expr(ExprKind::Loop { name, init, lo, hi, body }, self.since(start)))
    }

    /// `in lo..hi`, up to the block.
    pub(super) fn range_head(&mut self) -> Parse<(ExprId, ExprId)> {
        let start = self.current();
        self.head(
            |p| {
                p.expect(K::In)?;
                let lo = p.expr()?;
                p.expect(K::DotDot)?;
                Ok((lo, p.expr()?))
            },
            |p| (p.hole(start), p.hole(start)),
        )
    }

    /// What stands before a block: calls in it take no blocks (LANGUAGE 2.2). A broken head is skipped, so that its
    /// block is read as one.
    fn head<T>(&mut self, read: impl FnOnce(&mut Self) -> Parse<T>, hole: impl FnOnce(&mut Self) -> T) -> Parse<T> {
        let start = self.current();
        let in_head = std::mem::replace(&mut self.in_head, true);
        self.open_heads += 1;
        let mut result = read(self);
        self.open_heads -= 1;
        if result.is_ok() && !self.at(K::LBrace) {
            result = self.unexpected("`{`");
        }
        self.in_head = in_head;
        match result {
            Ok(value) => Ok(value),
            Err(Abort) => {
                self.sync_block()?;
                self.give_up(start);
                Ok(hole(self))
            }
        }
    }
}

fn unary_operator(kind: K) -> Option<UnaryOp> {
    match kind {
        K::Minus => Some(UnaryOp::Neg),
        K::Not => Some(UnaryOp::Not),
        _ => None,
    }
}

fn binary_operator(kind: K) -> Option<BinaryOp> {
    Some(match kind {
        K::Plus => BinaryOp::Add,
        K::Minus => BinaryOp::Sub,
        K::Star => BinaryOp::Mul,
        K::Slash => BinaryOp::Div,
        K::Percent => BinaryOp::Rem,
        K::Lt => BinaryOp::Lt,
        K::Gt => BinaryOp::Gt,
        K::Le => BinaryOp::Le,
        K::Ge => BinaryOp::Ge,
        K::EqEq => BinaryOp::Eq,
        K::NotEq => BinaryOp::Ne,
        K::AndAnd => BinaryOp::And,
        K::OrOr => BinaryOp::Or,
        _ => return None,
    })
}

/// How tightly an operator binds (LANGUAGE 2.3), from 1.
const fn precedence(op: BinaryOp) -> u8 {
    match op {
        BinaryOp::Or => 1,
        BinaryOp::And => 2,
        BinaryOp::Lt | BinaryOp::Gt | BinaryOp::Le | BinaryOp::Ge | BinaryOp::Eq | BinaryOp::Ne => 3,
        BinaryOp::Add | BinaryOp::Sub => 4,
        BinaryOp::Mul | BinaryOp::Div | BinaryOp::Rem => 5,
    }
}
