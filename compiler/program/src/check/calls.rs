//! Calls: functions, entities and operations with their blocks, `diff`, `bound` and `eval` (LANGUAGE 6.3, 8.1, 11.3,
//! 11.5, 13.1, 15.3). Knows nothing of how names are found.

use isograd_syntax::{
    Code, Diagnostic, Span,
    tree::{BlockId, ExprId, ExprKind, Ident},
};

use super::{
    body::{Body, FrameKind},
    messages::counted,
    statements::Want,
    tree,
};
use crate::{
    Type,
    names::{Callee, Lookup},
    typed::{ConceptId, DefinitionId, FunctionId, Instruction, Param},
};

/// Whose arguments are checked; decides where csg may be passed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Whose {
    Function,
    Definition,
    Concept,
}

impl<'a> Body<'a> {
    /// `f(args){ … }{ … }`.
    pub fn call(&mut self, callee: &'a Ident, args: &'a [ExprId], blocks: &'a [BlockId], span: Span) -> Type {
        let names = &self.world.names;
        let found = names.callee(self.space, &callee.text);
        if let Lookup::Found(found) = found
            && names.is_doubtful(found)
        {
            self.report.mute();
            self.arguments(args);
            self.subtrees(blocks, true);
            return if matches!(found, Callee::Definition(_)) { Type::Csg } else { Type::Error };
        }
        let missing = matches!(found, Lookup::Missing) && !names.may_exist(self.space, &callee.text);
        if missing && let Some((_, variable)) = self.variable(&callee.text) {
            return self.call_of_variable(callee, variable.slot, args, blocks, span);
        }
        let found = self.callee(callee);
        if let Some(found) = found {
            self.no_blocks(found, callee, blocks);
        }
        match found {
            None => {
                self.arguments(args);
                self.subtrees(blocks, false);
                Type::Error
            }
            Some(Callee::Definition(id)) => self.node(id, callee, args, blocks, span),
            Some(Callee::Function(id)) => self.function(id, callee, args, span),
            Some(Callee::Builtin(builtin)) => {
                let types = self.arguments(args);
                self.builtin(builtin, callee, args, types, span)
            }
            Some(Callee::Diff) => self.diff(callee, args, span),
            Some(Callee::Bound) => self.bound(callee, args, span),
        }
    }

    fn arguments(&mut self, args: &'a [ExprId]) -> Vec<Type> {
        args.iter().map(|a| self.value(*a, Want::Any)).collect()
    }

    /// Whether some of the arguments could not be read, so that their number means nothing.
    pub fn unread(&self, args: &[ExprId]) -> bool {
        args.iter().any(|a| matches!(tree::expr(self.tree, *a).kind, ExprKind::Error | ExprKind::Partial(_)))
    }

    /// E0604: blocks after anything but an operation. The blocks are checked all the same.
    fn no_blocks(&mut self, callee: Callee, name: &Ident, blocks: &'a [BlockId]) {
        let operation = match callee {
            Callee::Definition(id) => self.world.program.definitions.get(id.0 as usize).is_some_and(|d| d.operation),
            _ => false,
        };
        let Some(first) = blocks.first().filter(|_| !operation) else { return };
        let what = self.world.describe(callee);
        let help = match callee {
            Callee::Definition(_) => "an entity has no subtrees: remove the block, or declare it as an `operation`",
            _ => "only operations have subtrees: pass the value as an argument",
        };
        let span = self.block_span(*first);
        self.error(
            Diagnostic::new(Code::E0604, span, format!("`{}` is {what} and takes no blocks", name.text))
                .label(name.span, format!("this is {what}"))
                .help(help),
        );
        if !matches!(callee, Callee::Definition(_)) {
            self.subtrees(blocks, false);
        }
    }

    /// \[24\] `v()` for a csg variable; anything else that is no function is E0303, or E0604 if it has blocks.
    fn call_of_variable(
        &mut self,
        callee: &'a Ident,
        slot: crate::typed::Slot,
        args: &'a [ExprId],
        blocks: &'a [BlockId],
        span: Span,
    ) -> Type {
        let name = &callee.text;
        let ty = self.slot_type(slot);
        if ty == Type::Csg && args.is_empty() && blocks.is_empty() {
            self.error(
                Diagnostic::new(Code::W0603, span, format!("`{name}()` is the form of 2024"))
                    .help(format!("write `{name}`")),
            );
            return self.load(slot, span);
        }
        self.arguments(args);
        self.subtrees(blocks, false);
        if ty == Type::Error {
            return Type::Error;
        }
        if let Some(first) = blocks.first() {
            let span = self.block_span(*first);
            self.error(
                Diagnostic::new(Code::E0604, span, format!("`{name}` is a variable and takes no blocks"))
                    .label(callee.span, format!("this is a variable of type `{ty}`"))
                    .help("only operations have subtrees"),
            );
        } else {
            self.error(
                Diagnostic::new(
                    Code::E0303,
                    callee.span,
                    format!("`{name}` is a variable of type `{ty}`, not a function"),
                )
                .help(if ty == Type::Csg {
                    format!("interpret it: `eval {name}.Concept(…)`")
                } else {
                    format!("to use its value write `{name}`")
                }),
            );
        }
        Type::Error
    }

    fn function(&mut self, id: FunctionId, callee: &'a Ident, args: &'a [ExprId], span: Span) -> Type {
        self.uses.calls.push((id, callee.span));
        let world = self.world;
        let Some(function) = world.program.functions.get(id.0 as usize) else { return Type::Error };
        self.check_arguments(&function.params, callee, args, Whose::Function, &|| {
            format!("the signature is `{}`", signature("fn ", &function.name, &function.params, Some(&function.result)))
        });
        self.emit(Instruction::Call(id), span);
        function.result.clone()
    }

    fn node(
        &mut self,
        id: DefinitionId,
        callee: &'a Ident,
        args: &'a [ExprId],
        blocks: &'a [BlockId],
        span: Span,
    ) -> Type {
        self.uses.built.push((id, callee.span));
        let world = self.world;
        let Some(definition) = world.program.definitions.get(id.0 as usize) else { return Type::Error };
        let word = if definition.operation { "operation " } else { "entity " };
        self.check_arguments(&definition.params, callee, args, Whose::Definition, &|| {
            format!("the declaration is `{}`", signature(word, &definition.name, &definition.params, None))
        });
        self.subtrees(blocks, definition.operation);
        self.emit(
            Instruction::Node { definition: id, subtrees: u32::try_from(blocks.len()).unwrap_or(u32::MAX) },
            span,
        );
        Type::Csg
    }

    /// The blocks of a scoped call: each yields csg, if it is one of an operation, and writes to a copy of outer
    /// variables.
    fn subtrees(&mut self, blocks: &'a [BlockId], of_operation: bool) {
        for id in blocks {
            let span = self.block_span(*id);
            self.open_frame(FrameKind::Block);
            self.open_scope();
            let head = self.code.instructions.len();
            self.emit(Instruction::Block { restores: Vec::new() }, span);
            let ty = self.value_block(*id, Want::Any);
            self.emit(Instruction::EndBlock, span);
            self.close_scope();
            let slots = self.close_frame();
            if let Some((Instruction::Block { restores }, _)) = self.code.instructions.get_mut(head) {
                *restores = slots;
            }
            match ty {
                _ if !of_operation => {}
                Some(Type::Csg | Type::Error) => {}
                Some(ty) => {
                    let value = super::statements::tail(tree::block(self.tree, *id));
                    let at = value.map_or(span, |v| self.expr_span(v));
                    self.error(
                        Diagnostic::new(Code::E0409, at, format!("a subtree must be csg, this is `{ty}`"))
                            .help("end the block with a node, a csg variable or a function that returns csg"),
                    );
                }
                None => self.error(
                    Diagnostic::new(Code::E0505, span, "this block has no value, but a subtree must be csg")
                        .help("end the block with a csg expression without `;`"),
                ),
            }
        }
    }

    /// Checks arguments against parameters; E0402, E0403, E0603.
    fn check_arguments(
        &mut self,
        params: &[Param],
        callee: &Ident,
        args: &'a [ExprId],
        whose: Whose,
        signature: &dyn Fn() -> String,
    ) {
        let types = self.arguments(args);
        if params.len() != args.len() {
            if self.unread(args) {
                return;
            }
            self.error(
                Diagnostic::new(
                    Code::E0402,
                    callee.span,
                    format!("`{}` takes {}, not {}", callee.text, counted(params.len(), "argument"), args.len()),
                )
                .note(signature()),
            );
            return;
        }
        for ((param, id), ty) in params.iter().zip(args).zip(&types) {
            if *ty == Type::Error || param.ty == Type::Error || *ty == param.ty {
                continue;
            }
            if *ty == Type::Csg && whose != Whose::Function {
                let place = if whose == Whose::Definition {
                    "an argument of an entity or operation"
                } else {
                    "an argument of a concept"
                };
                self.csg_in(&[*id], &[Type::Csg], place);
                continue;
            }
            let message = match (whose, param.name.as_str()) {
                (Whose::Concept, _) | (_, "") => {
                    format!("`{}` takes `{}` here, not `{ty}`", callee.text, param.ty)
                }
                (_, name) => format!("`{name}` of `{}` is `{}`, but this is `{ty}`", callee.text, param.ty),
            };
            let mut diagnostic = Diagnostic::new(Code::E0403, self.expr_span(*id), message)
                .here(format!("this is `{ty}`"))
                .note(signature());
            if let Some(mend) = self.mend(*id, ty, &param.ty) {
                diagnostic = diagnostic.help(mend);
            }
            self.error(diagnostic);
        }
    }

    /// E0402 for `diff` and `bound`, unless some argument could not be read.
    fn miscounted(&mut self, callee: &Ident, count: usize, args: &[ExprId], signature: &str) -> Type {
        if !self.unread(args) {
            let message = format!("`{}` takes {count} arguments, not {}", callee.text, args.len());
            let diagnostic = Diagnostic::new(Code::E0402, callee.span, message);
            self.error(diagnostic.note(format!("the signature is `{signature}`")));
        }
        Type::Error
    }

    /// `diff(e, wrt)` (LANGUAGE 13.1).
    fn diff(&mut self, callee: &Ident, args: &'a [ExprId], span: Span) -> Type {
        let types = self.arguments(args);
        let ([e, wrt], [e_type, wrt_type]) = (args, types.as_slice()) else {
            return self.miscounted(callee, 2, args, "diff(expression, variable)");
        };
        if self.csg_in(args, &types, "an argument of a built-in function") {
            return Type::Error;
        }
        let place = |code, id: ExprId, message: String, ty: &Type| {
            let mut diagnostic = Diagnostic::new(code, self.expr_span(id), message)
                .here(format!("this is `{ty}`"))
                .note("a real, a vector or a quaternion is needed");
            match ty {
                Type::Matrix { .. } | Type::Tuple(_) => {
                    diagnostic = diagnostic.help(format!("take a part of it first: `{}.0`", self.operand_text(id)));
                }
                Type::Interval(_) => {
                    diagnostic = diagnostic.help(format!("take an end first: `{}.start`", self.operand_text(id)));
                }
                Type::Int | Type::IntVector(_) => {
                    diagnostic = diagnostic.help("an int has no derivative; compute with reals and cast at the end");
                }
                _ => {}
            }
            diagnostic
        };
        let mut wrong = Vec::new();
        if extent(e_type).is_none() && *e_type != Type::Error {
            wrong.push(place(Code::E0701, *e, format!("`{e_type}` cannot be differentiated"), e_type));
        }
        if extent(wrt_type).is_none() && *wrt_type != Type::Error {
            let message = format!("a derivative with respect to `{wrt_type}` does not exist");
            wrong.push(place(Code::E0702, *wrt, message, wrt_type));
        }
        for diagnostic in wrong {
            self.error(diagnostic);
        }
        let (Some(rows), Some(columns)) = (extent(e_type), extent(wrt_type)) else { return Type::Error };
        self.emit(Instruction::Diff, span);
        match (rows, columns) {
            (1, 1) => Type::Real,
            (rows, 1) => Type::Vector(rows),
            (1, columns) => Type::Vector(columns),
            (rows, columns) => Type::Matrix { columns, rows },
        }
    }

    /// `bound(e, dyn, iv)` (LANGUAGE 15.3).
    fn bound(&mut self, callee: &Ident, args: &'a [ExprId], span: Span) -> Type {
        let types = self.arguments(args);
        let ([e, by, iv], [e_type, by_type, iv_type]) = (args, types.as_slice()) else {
            return self.miscounted(callee, 3, args, "bound(expression, variable, interval)");
        };
        if self.csg_in(args, &types, "an argument of a built-in function") {
            return Type::Error;
        }
        let mut wrong = Vec::new();
        if !matches!(e_type, Type::Real | Type::Vector(_) | Type::Matrix { .. } | Type::Error) {
            let mut diagnostic =
                Diagnostic::new(Code::E0801, self.expr_span(*e), format!("`{e_type}` cannot be enclosed"))
                    .note("a real, or a vector or matrix of reals is needed");
            if matches!(e_type, Type::Tuple(_)) {
                diagnostic = diagnostic.help(format!("take a part of it first: `{}.0`", self.operand_text(*e)));
            } else if let Some(mend) = self.mend(*e, e_type, &Type::Real) {
                diagnostic = diagnostic.help(mend);
            }
            wrong.push(diagnostic);
        }
        let variable = matches!(by_type, Type::Real | Type::Vector(_));
        if !variable && *by_type != Type::Error {
            let message = format!("`bound` varies a real or a vector, this is `{by_type}`");
            let shown = format!("the interval is `{iv_type}`");
            wrong.push(Diagnostic::new(Code::E0802, self.expr_span(*by), message).label(self.expr_span(*iv), shown));
        }
        match iv_type {
            Type::Error => {}
            Type::Interval(ends) => {
                if variable && **ends != *by_type {
                    let message = format!("`bound` varies a value of type `{by_type}`, but in `{iv_type}`");
                    wrong.push(
                        Diagnostic::new(Code::E0802, self.expr_span(*iv), message)
                            .label(self.expr_span(*by), format!("this is `{by_type}`"))
                            .help(format!("the interval must be `interval<{by_type}>`")),
                    );
                }
            }
            _ => {
                let message = format!("the third argument of `bound` is an interval, this is `{iv_type}`");
                let mut diagnostic = Diagnostic::new(Code::E0803, self.expr_span(*iv), message);
                if variable {
                    diagnostic = diagnostic.help(format!("write `[lower .. upper]` with ends of type `{by_type}`"));
                }
                wrong.push(diagnostic);
            }
        }
        let fits = wrong.is_empty() && !types.contains(&Type::Error);
        for diagnostic in wrong {
            self.error(diagnostic);
        }
        if !fits {
            return Type::Error;
        }
        self.emit(Instruction::Bound { value: e_type.clone(), by: by_type.clone() }, span);
        e_type.clone().interval()
    }

    /// `eval v.C(args)` (LANGUAGE 11.5).
    pub fn eval(
        &mut self,
        variable: &'a Ident,
        concept: &'a Ident,
        args: &'a [ExprId],
        word: bool,
        span: Span,
    ) -> Type {
        let name = &variable.text;
        match self.variable(name) {
            None => self.unknown_variable(name, variable.span, "to evaluate"),
            Some((_, found)) => {
                let ty = self.load(found.slot, variable.span);
                if !matches!(ty, Type::Csg | Type::Error) {
                    self.error(
                        Diagnostic::new(Code::E0609, variable.span, format!("`{name}` is `{ty}`, not csg"))
                            .here(format!("this is `{ty}`"))
                            .label(found.span, "defined here")
                            .help("`eval` interprets a csg variable: `csg tree = …; eval tree.Concept(…)`"),
                    );
                }
            }
        }
        let Some(id) = self.concept(concept) else {
            self.arguments(args);
            return Type::Error;
        };
        if !word {
            self.error(
                Diagnostic::new(Code::W0603, span, format!("`{name}.{}(…)` is the form of 2024", concept.text))
                    .help(format!("write `eval {name}.{}(…)`", concept.text)),
            );
        }
        self.evaluate(id, concept, args, span)
    }

    fn evaluate(&mut self, id: ConceptId, name: &'a Ident, args: &'a [ExprId], span: Span) -> Type {
        let world = self.world;
        let Some(concept) = world.program.concepts.get(id.0 as usize) else { return Type::Error };
        let param = |ty: &Type| Param::new(String::new(), ty.clone());
        let mut pack = None;
        let params: Vec<Param> = match &concept.source {
            Type::Tuple(elements) if elements.is_empty() => Vec::new(),
            Type::Tuple(elements) if elements.len() == args.len() => {
                pack = u32::try_from(elements.len()).ok();
                elements.iter().map(param).collect()
            }
            Type::Error => {
                self.report.mute();
                self.arguments(args);
                return Type::Error;
            }
            source => vec![param(source)],
        };
        self.check_arguments(&params, name, args, Whose::Concept, &|| match &concept.source {
            Type::Tuple(elements) if elements.is_empty() => {
                format!("the concept is `concept {}: -> {}`", concept.name, concept.target)
            }
            source => format!("the concept is `concept {}: {source} -> {}`", concept.name, concept.target),
        });
        if let Some(n) = pack {
            self.emit(Instruction::Pack(n), span);
        }
        self.emit(Instruction::Eval { concept: id, live: true }, span);
        concept.target.clone()
    }
}

/// The number of reals that a derivative is taken of or by; a quaternion counts as the `vec4` of its components.
fn extent(ty: &Type) -> Option<u8> {
    match ty {
        Type::Real => Some(1),
        Type::Vector(n) => Some(*n),
        Type::Quat => Some(4),
        _ => None,
    }
}

/// `fn f(a: real) -> real`.
pub(super) fn signature(word: &str, name: &str, params: &[Param], result: Option<&Type>) -> String {
    let params: Vec<String> = params.iter().map(|p| format!("{}: {}", p.name, p.ty)).collect();
    let result = result.map_or(String::new(), |r| format!(" -> {r}"));
    format!("{word}{name}({}){result}", params.join(", "))
}
