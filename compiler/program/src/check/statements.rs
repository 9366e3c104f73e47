//! Blocks and statements: bindings, assignments, dropped values (LANGUAGE 2.4, 6.4, 6.5, 11.4). Knows nothing of what
//! an expression means.

use isograd_syntax::{
    Code, Diagnostic, Span,
    tree::{Block, BlockId, ExprId, ExprKind, Ident, Stmt, StmtKind},
};

use super::{
    body::{Body, Variable},
    tree,
};
use crate::{
    Type,
    typed::{Instruction, Slot},
};

/// What a value is for, where that decides how a wrong kind of value is reported.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Want {
    /// Whatever it is.
    Any,
    /// A csg value for the `csg` variable named here.
    Csg(Span),
    /// Anything else for the `let` variable named here.
    Plain(Span),
}

/// The expression whose value is the block's value, if the block needs one: the final expression, or a final `if`.
pub(super) fn tail(block: &Block) -> Option<ExprId> {
    block.value.or_else(|| match block.stmts.last().map(|s| &s.kind) {
        Some(StmtKind::If(id)) => Some(*id),
        _ => None,
    })
}

impl<'a> Body<'a> {
    /// A block that needs a value, in a scope that is open already. `None` if it has no value.
    pub fn value_block(&mut self, id: BlockId, want: Want) -> Option<Type> {
        let block = tree::block(self.tree, id);
        let Some(value) = tail(block) else {
            self.statements(&block.stmts);
            return None;
        };
        let statements = match block.value {
            Some(_) => block.stmts.as_slice(),
            None => block.stmts.split_last().map_or(&[][..], |(_, rest)| rest),
        };
        self.statements(statements);
        Some(self.value(value, want))
    }

    /// A block in statement position, in a scope that is open already.
    pub fn plain_block(&mut self, id: BlockId) {
        let block = tree::block(self.tree, id);
        self.statements(&block.stmts);
        if let Some(value) = block.value {
            self.dropped(value);
        }
    }

    fn statements(&mut self, statements: &'a [Stmt]) {
        for statement in statements {
            match &statement.kind {
                StmtKind::Bind { csg, name, value } => self.bind(*csg, name, *value),
                StmtKind::Assign { name, value } => self.assign(name, *value, statement.span),
                StmtKind::For { counter, lo, hi, body } => self.for_loop(counter, *lo, *hi, *body, statement.span),
                StmtKind::If(id) => self.if_statement(*id),
                StmtKind::Expr(id) => self.dropped(*id),
                StmtKind::Empty => {
                    self.error(Diagnostic::new(Code::W0501, statement.span, "empty statement").help("remove the `;`"))
                }
            }
        }
    }

    /// An expression whose value nobody uses.
    fn dropped(&mut self, id: ExprId) {
        let expr = tree::expr(self.tree, id);
        if matches!(expr.kind, ExprKind::If { .. }) {
            self.if_statement(id);
            return;
        }
        let ty = self.value(id, Want::Any);
        self.emit(Instruction::Drop, expr.span);
        self.warn_dropped(expr.span, &ty);
    }

    fn warn_dropped(&mut self, span: Span, ty: &Type) {
        if *ty != Type::Error {
            self.error(
                Diagnostic::new(Code::W0501, span, format!("this value of type `{ty}` is dropped"))
                    .help("bind it with `let`, assign it, or remove it"),
            );
        }
    }

    fn bind(&mut self, csg: bool, name: &'a Ident, value: ExprId) {
        let want = if csg { Want::Csg(name.span) } else { Want::Plain(name.span) };
        let mut ty = self.value(value, want);
        if !self.fits(&ty, csg, value, name) {
            ty = Type::Error;
        }
        if csg && ty == Type::Error {
            // The word says what it is meant to be: a later `eval` is no second error.
            ty = Type::Csg;
        }
        let slot = self.slot(&name.text, ty, name.span);
        self.emit(Instruction::Store(slot), name.span);
        self.define(&name.text, name.span, slot, Some(value));
    }

    /// Whether csg meets csg; reports E0601 and E0602 (LANGUAGE 11.4).
    fn fits(&mut self, ty: &Type, csg: bool, value: ExprId, name: &Ident) -> bool {
        if *ty == Type::Error || (*ty == Type::Csg) == csg {
            return true;
        }
        self.wrong_kind(csg, ty, value, name.span);
        false
    }

    /// E0601 or E0602, at the expression that produced the value.
    pub fn wrong_kind(&mut self, csg: bool, ty: &Type, value: ExprId, name: Span) {
        let variable = self.text(name);
        let (at, trail) = self.producer(value);
        let here = if at == value { "this" } else { "it comes from here; this" };
        let mut diagnostic = if csg {
            Diagnostic::new(
                Code::E0601,
                self.expr_span(at),
                format!("`{variable}` holds csg, but this is a value of type `{ty}`"),
            )
            .here(format!("{here} is `{ty}`"))
            .label(name, "`csg` takes csg only")
            .help(format!("write `let {variable} = …;` for a value that is no csg"))
        } else {
            Diagnostic::new(Code::E0602, self.expr_span(at), format!("`{variable}` cannot hold csg, but this is csg"))
                .here(format!("{here} is `csg`"))
                .label(name, "this takes anything but csg")
                .help(format!("write `csg {variable} = …;`"))
        };
        for (span, text) in trail {
            diagnostic = diagnostic.label(span, text);
        }
        self.error(diagnostic);
    }

    /// The expression that a value comes from, looking through variables, branches and calls.
    fn producer(&self, value: ExprId) -> (ExprId, Vec<(Span, String)>) {
        let mut at = value;
        let mut trail = Vec::new();
        for _ in 0..16 {
            let next = match &tree::expr(self.tree, at).kind {
                ExprKind::Name(name) => self.variable(name).and_then(|(_, v)| {
                    trail.push((v.span, format!("`{name}` is defined here")));
                    v.value
                }),
                ExprKind::If { arms, otherwise } => {
                    let first = arms.first().map(|(_, b)| *b).or(*otherwise);
                    first.and_then(|b| tail(tree::block(self.tree, b)))
                }
                ExprKind::Loop { init, .. } => Some(*init),
                ExprKind::Call { callee, .. } => {
                    if let Some((span, result)) = self.function_named(&callee.text) {
                        trail.push((span, format!("`{}` returns `{result}`", callee.text)));
                    }
                    None
                }
                _ => None,
            };
            match next {
                Some(next) => at = next,
                None => break,
            }
        }
        (at, trail)
    }

    fn assign(&mut self, name: &'a Ident, value: ExprId, span: Span) {
        let target = self.variable(&name.text);
        let old = target.map_or(Type::Error, |(_, v)| self.slot_type(v.slot));
        let want = match old {
            Type::Csg => Want::Csg(name.span),
            Type::Error => Want::Any,
            _ => Want::Plain(name.span),
        };
        let new = self.value(value, want);
        let Some((scope, variable)) = target else {
            self.unknown_variable(&name.text, name.span, "to assign to");
            return;
        };
        if let Some(only) = self.only(scope)
            && only != variable.slot
        {
            self.error(
                Diagnostic::new(
                    Code::E0507,
                    span,
                    format!("a loop used as a value may assign its own variable only, not `{}`", name.text),
                )
                .label(variable.span, "defined outside of the loop")
                .help("use the statement `for i in lo..hi { … }`, which may assign outer variables"),
            );
            return;
        }
        if old == Type::Error || new == Type::Error || old == new {
            if new == Type::Error {
                // What the variable holds now is unknown, so later uses are not judged.
                self.poison(variable.slot);
            }
            self.emit(Instruction::Store(variable.slot), span);
            self.written(variable.slot);
            return;
        }
        if !self.fits(&new, old == Type::Csg, value, name) {
            return;
        }
        self.change_type(name, scope, variable, &old, new, value, span);
    }

    /// An assignment of another type: a slot of its own in straight-line code, an error in a branch or loop.
    #[expect(clippy::too_many_arguments, reason = "all of them describe the one assignment")]
    fn change_type(
        &mut self,
        name: &'a Ident,
        scope: usize,
        variable: Variable,
        old: &Type,
        new: Type,
        value: ExprId,
        span: Span,
    ) {
        if self.is_conditional(scope) {
            let mut diagnostic = Diagnostic::new(
                Code::E0412,
                span,
                format!("`{}` changes its type from `{old}` to `{new}` in a branch or loop", name.text),
            )
            .here(format!("`{new}` is assigned here"))
            .label(variable.span, format!("`{}` is `{old}` outside", name.text));
            diagnostic = match self.mend(value, &new, old) {
                Some(mend) => diagnostic.help(mend),
                None => diagnostic.help("define a variable of its own with `let`"),
            };
            self.error(diagnostic);
            // Which of both types is meant is unknown, so later uses are not judged.
            self.poison(variable.slot);
            return;
        }
        self.error(
            Diagnostic::new(Code::W0402, span, format!("`{}` changes its type from `{old}` to `{new}`", name.text))
                .label(variable.span, format!("`{old}` so far"))
                .help("define a variable of another name with `let`"),
        );
        let slot = self.slot(&name.text, new, name.span);
        self.emit(Instruction::Store(slot), span);
        self.rebind(&name.text, scope, Variable { slot, value: Some(value), ..variable });
    }

    /// Reads a variable.
    pub fn load(&mut self, slot: Slot, span: Span) -> Type {
        self.emit(Instruction::Load(slot), span);
        self.slot_type(slot)
    }
}
