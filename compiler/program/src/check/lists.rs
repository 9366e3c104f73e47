//! Lists, splats, tuples and intervals (LANGUAGE 3.5). Knows nothing of how their elements are computed.

use isograd_syntax::{
    Code, Diagnostic, Span,
    tree::{ExprId, ExprKind},
};

use super::{body::Body, messages::counted, statements::Want, types};
use crate::{Type, typed::Instruction};

impl<'a> Body<'a> {
    /// `[a, b]`: a vector of reals or a matrix of column vectors.
    pub fn list(&mut self, elements: &'a [ExprId], span: Span) -> Type {
        let types: Vec<Type> = elements.iter().map(|e| self.value(*e, Want::Any)).collect();
        self.emit(Instruction::Pack(u32::try_from(elements.len()).unwrap_or(u32::MAX)), span);
        if types.contains(&Type::Error) {
            return Type::Error;
        }
        if self.csg_in(elements, &types, "a list") {
            return Type::Error;
        }
        let size = u8::try_from(elements.len()).ok().filter(|n| (2..=4).contains(n));
        let element = types.first().cloned().unwrap_or(Type::Error);
        if let Some(at) = types.iter().position(|t| *t != element || !matches!(t, Type::Real | Type::Vector(_))) {
            self.bad_element(elements, &types, at);
            return Type::Error;
        }
        let Some(size) = size else {
            self.error(
                Diagnostic::new(
                    Code::E0406,
                    span,
                    format!("a list has 2 to 4 elements, this one has {}", elements.len()),
                )
                .help(if elements.len() == 1 {
                    "write the element without brackets"
                } else {
                    "use a tuple: `(a, b, …)`"
                }),
            );
            return Type::Error;
        };
        listed(&element, size)
    }

    fn bad_element(&mut self, elements: &[ExprId], types: &[Type], at: usize) {
        let (Some(id), Some(ty), Some(first)) = (elements.get(at), types.get(at), types.first()) else { return };
        let fits = matches!(ty, Type::Real | Type::Vector(_));
        let message = if fits {
            format!("a list cannot hold `{first}` and `{ty}`")
        } else {
            format!("a list cannot hold a value of type `{ty}`")
        };
        let mut diagnostic = Diagnostic::new(Code::E0405, self.expr_span(*id), message)
            .here(format!("this is `{ty}`"))
            .note("a list holds 2 to 4 reals (a vector), or 2 to 4 vectors of one size (the columns of a matrix)");
        if let Some(first_id) = elements.first().filter(|_| fits && at > 0) {
            diagnostic = diagnostic.label(self.expr_span(*first_id), format!("this is `{first}`"));
        }
        let help = match self.real_list(elements, types) {
            Some(list) => Some(format!("write `{list}`")),
            None if matches!(ty, Type::Tuple(_) | Type::Quat | Type::Matrix { .. } | Type::Int | Type::Bool) => {
                Some("use a tuple: `(a, b, …)`".to_owned())
            }
            None => None,
        };
        if let Some(help) = help {
            diagnostic = diagnostic.help(help);
        }
        self.error(diagnostic);
    }

    /// `[e; N]`.
    pub fn splat(&mut self, element: ExprId, count: u32, span: Span) -> Type {
        let ty = self.value(element, Want::Any);
        self.emit(Instruction::Splat(count), span);
        if ty == Type::Error {
            return Type::Error;
        }
        if self.csg_in(&[element], std::slice::from_ref(&ty), "a list") {
            return Type::Error;
        }
        if !matches!(ty, Type::Real | Type::Vector(_)) {
            let mut diagnostic = Diagnostic::new(
                Code::E0405,
                self.expr_span(element),
                format!("a list cannot hold a value of type `{ty}`"),
            )
            .note("a list holds 2 to 4 reals (a vector), or 2 to 4 vectors of one size (the columns of a matrix)");
            if let Some(mend) = self.mend(element, &ty, &Type::Real) {
                diagnostic = diagnostic.help(mend);
            }
            self.error(diagnostic);
            return Type::Error;
        }
        match u8::try_from(count).ok().filter(|n| (2..=4).contains(n)) {
            Some(size) => listed(&ty, size),
            None => {
                self.error(
                    Diagnostic::new(Code::E0406, span, format!("a list has 2 to 4 elements, this one has {count}"))
                        .help("the count after `;` is 2, 3 or 4"),
                );
                Type::Error
            }
        }
    }

    /// `(a, b)`.
    pub fn tuple(&mut self, elements: &'a [ExprId], span: Span) -> Type {
        let types: Vec<Type> = elements.iter().map(|e| self.value(*e, Want::Any)).collect();
        self.emit(Instruction::Pack(u32::try_from(elements.len()).unwrap_or(u32::MAX)), span);
        let csg = self.csg_in(elements, &types, "a tuple");
        if csg || types.contains(&Type::Error) {
            return Type::Error;
        }
        let ty = Type::Tuple(types);
        let limit = self.world.limits.export_scalars;
        if u64::from(ty.len()) > limit {
            self.error(
                Diagnostic::new(
                    Code::E1010,
                    span,
                    format!("this tuple holds {}", counted(ty.len() as usize, "scalar")),
                )
                .note(format!("the limit `export_scalars` is {limit}"))
                .help("use smaller tuples, or raise the limit `export_scalars`"),
            );
            return Type::Error;
        }
        ty
    }

    /// `[lo .. hi]`: not yet.
    pub fn interval(&mut self, lo: ExprId, hi: ExprId, span: Span) -> Type {
        let ends = [lo, hi];
        let types = ends.map(|e| self.value(e, Want::Any));
        if !self.csg_in(&ends, &types, "an interval") {
            types::later(self.report, span, "intervals are");
        }
        Type::Error
    }

    /// E0603 for the first csg value among operands that may not be csg.
    pub fn csg_in(&mut self, values: &[ExprId], types: &[Type], place: &str) -> bool {
        let Some(at) = types.iter().position(|t| *t == Type::Csg) else { return false };
        let Some(id) = values.get(at) else { return false };
        let help = match &super::tree::expr(self.tree, *id).kind {
            ExprKind::Name(name) => format!("interpret it: `eval {name}.Concept(…)`"),
            _ => "bind it with `csg name = …;` and interpret it with `eval name.Concept(…)`".to_owned(),
        };
        let span = self.expr_span(*id);
        self.error(
            Diagnostic::new(Code::E0603, span, format!("csg may not stand in {place}"))
                .note("csg may be bound with `csg`, passed to and returned by functions, and be a subtree of an operation")
                .help(help),
        );
        true
    }
}

/// The type of a list of so many elements of a type.
fn listed(element: &Type, size: u8) -> Type {
    match element {
        Type::Real => Type::Vector(size),
        Type::Vector(rows) => Type::Matrix { columns: size, rows: *rows },
        _ => Type::Error,
    }
}
