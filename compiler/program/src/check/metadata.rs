//! Defaults and ranges of the parameters of exports (LANGUAGE 9.3): constant expressions, checked and turned into code.
//! Whether a range holds its default is found out when they are evaluated, by elaboration.

use isograd_syntax::{
    Code, Diagnostic, Span,
    tree::{self as syntax, ExprId, ExprKind, ItemKind, Tree},
};

use super::{Report, World, body::Body, statements::Want, tree};
use crate::{
    Type,
    names::{Callee, Lookup, item},
    typed::{Constant, Param},
};

/// Fills in the metadata of all exports.
pub(super) fn exports(world: &mut World, report: &mut Report) {
    for (index, place) in world.names.functions.clone().into_iter().enumerate() {
        let found = item(world.modules, place).map(|item| &item.kind);
        let Some(ItemKind::Function { export: true, params: written, .. }) = found else { continue };
        let Some(tree) = world.modules.get(place.module).map(|m| &m.tree) else { continue };
        let Some(params) = world.program.functions.get(index).map(|f| f.params.clone()) else { continue };
        let checker = Checker { world, tree, space: world.names.space(place.module) };
        let params = written.iter().zip(params).map(|(w, param)| checker.param(w, param, report)).collect();
        if let Some(function) = world.program.functions.get_mut(index) {
            function.params = params;
        }
    }
}

struct Checker<'a> {
    world: &'a World<'a>,
    tree: &'a Tree,
    space: usize,
}

impl Checker<'_> {
    fn param(&self, written: &syntax::Param, mut param: Param, report: &mut Report) -> Param {
        let name = &written.name.text;
        if param.ty == Type::Csg {
            // E0901 says it all.
            return param;
        }
        if let Some(default) = written.default {
            param.default = self.constant(default, &[&param.ty], &format!("the default of `{name}`"), report);
        }
        let Some((lo, hi)) = written.range else { return param };
        let Some(component) = component(&param.ty) else {
            if param.ty != Type::Error {
                let span = tree::expr(self.tree, lo).span.to(tree::expr(self.tree, hi).span);
                let message = format!("`{name}` is `{}` and cannot have a range", param.ty);
                report.push(
                    Diagnostic::new(Code::E0904, span, message)
                        .note("ranges are for reals, ints, their vectors, and matrices")
                        .help("remove the range"),
                );
            }
            return param;
        };
        let allowed: &[&Type] = if component == param.ty { &[&param.ty] } else { &[&param.ty, &component] };
        let lower = self.constant(lo, allowed, &format!("the lower end of the range of `{name}`"), report);
        let upper = self.constant(hi, allowed, &format!("the upper end of the range of `{name}`"), report);
        param.range = lower.zip(upper);
        param
    }

    /// A constant expression of one of the types; E0902 otherwise.
    fn constant(&self, id: ExprId, allowed: &[&Type], what: &str, report: &mut Report) -> Option<Constant> {
        let span = tree::expr(self.tree, id).span;
        if let Some((at, found)) = self.variable_part(id) {
            report.push(
                Diagnostic::new(Code::E0902, at, format!("{what} must be constant, but this is {found}"))
                    .note("literals, `INF`, `PI`, `EULER`, operators and built-in functions are constant")
                    .help("write the value out"),
            );
            return None;
        }
        let mut body = Body::new(self.world, self.tree, self.space, report);
        let ty = body.value(id, Want::Any);
        let expected = allowed.first().copied().unwrap_or(&Type::Error);
        if ty != Type::Error && *expected != Type::Error && !allowed.contains(&&ty) {
            let names: Vec<String> = allowed.iter().map(|t| format!("`{t}`")).collect();
            let mut diagnostic = Diagnostic::new(
                Code::E0902,
                span,
                format!("{what} must be {}, but this is `{ty}`", names.join(" or ")),
            );
            if let Some(mend) = allowed.iter().rev().find_map(|want| body.mend(id, &ty, want)) {
                diagnostic = diagnostic.help(mend);
            }
            body.error(diagnostic);
            return None;
        }
        let (code, _) = body.finish();
        (ty != Type::Error && *expected != Type::Error).then_some(Constant { code, ty, span })
    }

    /// The first part of an expression that is not constant, and what it is.
    fn variable_part(&self, id: ExprId) -> Option<(Span, String)> {
        let mut work = vec![id];
        while let Some(id) = work.pop() {
            let expr = tree::expr(self.tree, id);
            let found = match &expr.kind {
                ExprKind::Int(_) | ExprKind::Real(_) | ExprKind::Bool(_) | ExprKind::Error | ExprKind::Partial(_) => {
                    continue;
                }
                ExprKind::Unary { operand: inner, .. }
                | ExprKind::Cast { value: inner, .. }
                | ExprKind::Access { base: inner, .. }
                | ExprKind::Splat { element: inner, .. } => {
                    work.push(*inner);
                    continue;
                }
                ExprKind::Binary { left: a, right: b, .. } | ExprKind::Interval { lo: a, hi: b } => {
                    work.extend([*b, *a]);
                    continue;
                }
                ExprKind::Tuple(elements) | ExprKind::List(elements) => {
                    work.extend(elements.iter().rev());
                    continue;
                }
                ExprKind::Call { callee, args, blocks } => match self.world.names.callee(self.space, &callee.text) {
                    Lookup::Found(Callee::Builtin(_) | Callee::Diff | Callee::Bound) if blocks.is_empty() => {
                        work.extend(args.iter().rev());
                        continue;
                    }
                    // Unknown names are reported as such.
                    Lookup::Missing | Lookup::Ambiguous(_) => continue,
                    Lookup::Found(found) => format!("a call of {}", self.world.describe(found)),
                },
                ExprKind::Name(name) => format!("the name `{name}`"),
                ExprKind::Eval { .. } => "an `eval`".to_owned(),
                ExprKind::If { .. } => "an `if`".to_owned(),
                ExprKind::Loop { .. } => "a loop".to_owned(),
            };
            return Some((expr.span, found));
        }
        None
    }
}

/// The type whose one value can stand for every component in a range.
const fn component(ty: &Type) -> Option<Type> {
    match ty {
        Type::Real | Type::Vector(_) | Type::Matrix { .. } => Some(Type::Real),
        Type::Int | Type::IntVector(_) => Some(Type::Int),
        _ => None,
    }
}
