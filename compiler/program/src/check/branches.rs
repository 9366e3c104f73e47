//! `if` and `for`, as statements and as values (LANGUAGE 7). Chains of `else if` are walked, not recursed into;
//! knows nothing of conditions' operators.

use isograd_syntax::{
    Code, Diagnostic, Span,
    tree::{BlockId, ExprId, ExprKind, Ident},
};

use super::{
    body::{Body, FrameKind},
    statements::{Want, tail},
    tree,
};
use crate::{
    Type,
    typed::{Branch, Instruction, Loop},
};

/// A branch that was checked: its type, and where its value is written.
struct Side {
    ty: Type,
    value: ExprId,
}

impl<'a> Body<'a> {
    /// `if` whose values, if any, are dropped.
    pub fn if_statement(&mut self, id: ExprId) {
        let expr = tree::expr(self.tree, id);
        let ExprKind::If { arms, otherwise } = &expr.kind else { return };
        let heads = self.open_arms(arms, FrameKind::Through, |body, block| {
            body.open_scope();
            body.plain_block(block);
            body.close_scope();
        });
        if let Some(block) = otherwise {
            self.open_scope();
            self.plain_block(*block);
            self.close_scope();
        }
        self.close_arms(&heads, None, expr.span);
    }

    /// `if` used as a value: all branches yield one type, and `else` is there.
    pub fn if_value(&mut self, id: ExprId, want: Want) -> Type {
        let expr = tree::expr(self.tree, id);
        let ExprKind::If { arms, otherwise } = &expr.kind else { return Type::Error };
        let mut sides = Vec::new();
        let mut complete = true;
        let heads = self.open_arms(arms, FrameKind::Value, |body, block| {
            complete &= body.side(block, want, &mut sides);
        });
        match otherwise {
            Some(block) => complete &= self.side(*block, want, &mut sides),
            None => {
                complete = false;
                self.error(
                    Diagnostic::new(Code::E0503, expr.span, "this `if` is used as a value but has no `else`")
                        .help("add `else { … }` with the value for the other case"),
                );
            }
        }
        let ty = self.common(&sides, want, expr.span);
        let ty = if complete { ty } else { Type::Error };
        self.close_arms(&heads, Some(&ty), expr.span);
        ty
    }

    /// Emits conditions and blocks up to the last `Else`; answers where the `If`s are.
    fn open_arms(
        &mut self,
        arms: &'a [(ExprId, BlockId)],
        kind: FrameKind,
        mut branch: impl FnMut(&mut Self, BlockId),
    ) -> Vec<usize> {
        let limit = self.world.limits.csg_depth;
        let allowed = usize::try_from(limit).unwrap_or(usize::MAX);
        if let Some((condition, _)) = arms.get(allowed) {
            // `else if` nests (LANGUAGE 2.5), and every level keeps a list of what is written below it.
            self.error(
                Diagnostic::new(
                    Code::E1005,
                    self.expr_span(*condition),
                    format!("more than {limit} branches in a chain"),
                )
                .note(format!("the limit `csg_depth` is {limit}"))
                .help("compute the case from a formula, split the chain, or raise the limit `csg_depth`"),
            );
        }
        let mut heads = Vec::new();
        for (condition, block) in arms.iter().take(allowed) {
            let span = self.expr_span(*condition);
            let ty = self.value(*condition, Want::Any);
            self.condition(*condition, &ty);
            self.open_frame(kind);
            heads.push(self.code.instructions.len());
            let facts = Branch { value: None, writes: Vec::new(), restores: Vec::new() };
            self.emit(Instruction::If(facts), span);
            branch(self, *block);
            self.emit(Instruction::Else, span);
        }
        heads
    }

    /// Ends the `If`s, innermost first, and fills in their facts.
    fn close_arms(&mut self, heads: &[usize], value: Option<&Type>, span: Span) {
        for head in heads.iter().rev() {
            self.emit(Instruction::EndIf, span);
            let slots = self.close_frame();
            if let Some(ty) = value {
                self.keep(ty, span);
            }
            if let Some((Instruction::If(facts), _)) = self.code.instructions.get_mut(*head) {
                facts.value = value.cloned();
                match value {
                    Some(_) => facts.restores = slots,
                    None => facts.writes = slots,
                }
            }
        }
    }

    fn condition(&mut self, id: ExprId, ty: &Type) {
        if matches!(ty, Type::Bool | Type::Error) {
            return;
        }
        let text = self.operand_text(id);
        let help = match ty {
            Type::Real => format!("compare it, for example `{text} > 0.0`"),
            Type::Int => format!("compare it, for example `{text} != 0`"),
            _ => "compare two reals or two ints, for example a component or a length".to_owned(),
        };
        self.error(
            Diagnostic::new(Code::E0501, self.expr_span(id), format!("the condition of an `if` is `{ty}`, not `bool`"))
                .here(format!("this is `{ty}`"))
                .help(help),
        );
    }

    /// A branch that needs a value; false if it has none.
    fn side(&mut self, id: BlockId, want: Want, sides: &mut Vec<Side>) -> bool {
        self.open_scope();
        let ty = self.value_block(id, want);
        self.close_scope();
        let block = tree::block(self.tree, id);
        match (ty, tail(block)) {
            (Some(ty), Some(value)) => {
                sides.push(Side { ty, value });
                true
            }
            _ => {
                self.error(
                    Diagnostic::new(
                        Code::E0503,
                        block.span,
                        "this branch has no value, but the `if` is used as a value",
                    )
                    .help("end the branch with an expression without `;`"),
                );
                false
            }
        }
    }

    /// The one type of all branches. Where a binding says whether csg is meant, the branches of the other kind are
    /// reported (E0601, E0602), otherwise all of them (E0502).
    fn common(&mut self, sides: &[Side], want: Want, span: Span) -> Type {
        let mut known = sides.iter().filter(|s| s.ty != Type::Error);
        let Some(first) = known.next() else { return Type::Error };
        if known.all(|s| s.ty == first.ty) {
            let broken = sides.iter().any(|s| s.ty == Type::Error);
            return if broken { Type::Error } else { first.ty.clone() };
        }
        let known = || sides.iter().filter(|s| s.ty != Type::Error);
        let mixed = known().any(|s| s.ty == Type::Csg);
        let meant = match want {
            Want::Csg(name) => Some((true, name)),
            Want::Plain(name) => Some((false, name)),
            Want::Any => None,
        };
        if let (true, Some((csg, name))) = (mixed, meant) {
            for side in known().filter(|s| (s.ty == Type::Csg) != csg) {
                self.wrong_kind(csg, &side.ty, side.value, name);
            }
            return Type::Error;
        }
        let mut types: Vec<String> = Vec::new();
        for side in known() {
            let name = format!("`{}`", side.ty);
            if !types.contains(&name) {
                types.push(name);
            }
        }
        let mut diagnostic =
            Diagnostic::new(Code::E0502, span, format!("the branches yield different types: {}", types.join(", ")));
        for side in known().take(8) {
            diagnostic = diagnostic.label(self.expr_span(side.value), format!("`{}`", side.ty));
        }
        let mend = known().find_map(|s| self.mend(s.value, &s.ty, &first.ty));
        self.error(diagnostic.help(mend.unwrap_or_else(|| "let every branch yield the same type".to_owned())));
        Type::Error
    }

    /// `for i in lo..hi { … }`.
    pub fn for_loop(&mut self, counter: &'a Ident, lo: ExprId, hi: ExprId, block: BlockId, span: Span) {
        self.bounds(lo, hi);
        let head_span = Span::new(span.file, span.start, self.expr_span(hi).end);
        let head = self.open_loop(FrameKind::Through, &counter.text, counter.span, head_span);
        if let Some(slot) = self.counter(head) {
            self.define(&counter.text, counter.span, slot, None);
        }
        self.plain_block(block);
        self.close_loop(head, span);
    }

    /// \[24\] `for v = init in lo..hi { … }`: the final content of `v` (LANGUAGE 7.3).
    pub fn loop_value(&mut self, id: ExprId, want: Want) -> Type {
        let expr = tree::expr(self.tree, id);
        let ExprKind::Loop { name, init, lo, hi, body } = &expr.kind else { return Type::Error };
        let ty = self.value(*init, want);
        let carried = self.slot(&name.text, ty, name.span);
        self.emit(Instruction::Store(carried), name.span);
        self.bounds(*lo, *hi);
        self.open_scope();
        self.define(&name.text, name.span, carried, Some(*init));
        // `v` belongs to a scope around the body, so that the body's writes to it are writes to an outer variable.
        let head = self.open_loop(FrameKind::Only(carried), "", name.span, expr.span);
        if let Some(value) = tree::block(self.tree, *body).value {
            self.error(
                Diagnostic::new(
                    Code::E0507,
                    self.expr_span(value),
                    "the body of a loop used as a value ends with a value",
                )
                .help(format!("assign it: `{} = …;`", name.text)),
            );
        }
        self.plain_block(*body);
        self.close_loop(head, expr.span);
        self.close_scope();
        self.load(carried, expr.span)
    }

    fn bounds(&mut self, lo: ExprId, hi: ExprId) {
        for (id, which) in [(lo, "lower"), (hi, "upper")] {
            let ty = self.value(id, Want::Any);
            if matches!(ty, Type::Int | Type::Error) {
                continue;
            }
            let mut diagnostic = Diagnostic::new(
                Code::E0504,
                self.expr_span(id),
                format!("the {which} bound of a loop is `{ty}`, not `int`"),
            )
            .here(format!("this is `{ty}`"));
            if let Some(mend) = self.mend(id, &ty, &Type::Int) {
                diagnostic = diagnostic.help(mend);
            }
            self.error(diagnostic);
        }
    }

    /// Opens frame and scope of a loop and emits its head, whose place is the answer.
    fn open_loop(&mut self, kind: FrameKind, counter: &str, at: Span, span: Span) -> usize {
        self.open_frame(kind);
        self.open_scope();
        let counter = self.slot(counter, Type::Int, at);
        self.emit(Instruction::For(Loop { counter, writes: Vec::new() }), span);
        self.code.instructions.len() - 1
    }

    fn counter(&self, head: usize) -> Option<crate::typed::Slot> {
        match self.code.instructions.get(head) {
            Some((Instruction::For(facts), _)) => Some(facts.counter),
            _ => None,
        }
    }

    fn close_loop(&mut self, head: usize, span: Span) {
        self.close_scope();
        self.emit(Instruction::EndFor, span);
        let slots = self.close_frame();
        if let Some((Instruction::For(facts), _)) = self.code.instructions.get_mut(head) {
            facts.writes = slots;
        }
    }
}
