//! Expressions: dispatch by kind, access and casts (LANGUAGE 3.4, 3.7). Chains of operators, casts and accesses are
//! walked from the inside out without recursion; knows nothing of statements.

use isograd_syntax::{
    Code, Diagnostic, Span,
    tree::{ExprId, ExprKind, Ident, TypeId},
};

use super::{body::Body, statements::Want, tree, types};
use crate::{Type, typed::Instruction};

const FIELDS: [&str; 4] = ["x", "y", "z", "w"];

impl<'a> Body<'a> {
    /// Checks an expression and emits code that leaves its value; the answer is its type.
    pub fn value(&mut self, id: ExprId, want: Want) -> Type {
        let mut spine = Vec::new();
        let mut at = id;
        loop {
            let inner = match &tree::expr(self.tree, at).kind {
                ExprKind::Binary { left, .. } => *left,
                ExprKind::Cast { value, .. } => *value,
                ExprKind::Access { base, .. } => *base,
                _ => break,
            };
            spine.push(at);
            at = inner;
        }
        let mut ty = self.primary(at, if spine.is_empty() { want } else { Want::Any });
        while let Some(outer) = spine.pop() {
            let expr = tree::expr(self.tree, outer);
            ty = match &expr.kind {
                ExprKind::Binary { op, op_span, right, .. } => self.binary(*op, *op_span, (at, ty), *right, expr.span),
                ExprKind::Cast { ty: to, .. } => self.cast(&ty, *to, at, expr.span),
                ExprKind::Access { field, .. } => self.access(&ty, field, at, expr.span),
                _ => Type::Error,
            };
            at = outer;
        }
        ty
    }

    fn primary(&mut self, id: ExprId, want: Want) -> Type {
        let expr = tree::expr(self.tree, id);
        match &expr.kind {
            ExprKind::Int(value) => {
                self.emit(Instruction::Int(*value), expr.span);
                Type::Int
            }
            ExprKind::Real(value) => {
                self.emit(Instruction::Real(*value), expr.span);
                Type::Real
            }
            ExprKind::Bool(value) => {
                self.emit(Instruction::Bool(*value), expr.span);
                Type::Bool
            }
            ExprKind::Name(name) => self.name(id, name),
            ExprKind::Unary { op, operand } => {
                let ty = self.value(*operand, Want::Any);
                self.unary(*op, &ty, *operand, expr.span)
            }
            ExprKind::Call { callee, args, blocks } => self.call(callee, args, blocks, expr.span),
            ExprKind::Eval { tree, concept, args, word } => self.eval(tree, concept, args, *word, expr.span),
            ExprKind::Tuple(elements) => self.tuple(elements, expr.span),
            ExprKind::List(elements) => self.list(elements, expr.span),
            ExprKind::Splat { element, count } => self.splat(*element, *count, expr.span),
            ExprKind::Interval { lo, hi } => self.interval(*lo, *hi, expr.span),
            ExprKind::Partial(read) => {
                self.value(*read, Want::Any);
                Type::Error
            }
            ExprKind::If { .. } => self.if_value(id, want),
            ExprKind::Loop { .. } => self.loop_value(id, want),
            ExprKind::Binary { .. } | ExprKind::Cast { .. } | ExprKind::Access { .. } | ExprKind::Error => Type::Error,
        }
    }

    /// `e::<T>` (LANGUAGE 3.4).
    fn cast(&mut self, from: &Type, to: TypeId, value: ExprId, span: Span) -> Type {
        let to = types::resolve(self.tree, to, self.report);
        if *from == Type::Error || to == Type::Error {
            return to;
        }
        if *from == to {
            self.error(
                Diagnostic::new(Code::W0401, span, format!("this is of type `{to}` already")).help("remove the cast"),
            );
            return to;
        }
        match (from, &to) {
            (Type::Real, Type::Int) | (Type::Int, Type::Real | Type::Bool) | (Type::Bool, Type::Int | Type::Real) => {
                self.emit(Instruction::Cast { from: from.clone(), to: to.clone() }, span);
            }
            (Type::Vector(n), Type::IntVector(m)) | (Type::IntVector(n), Type::Vector(m)) if n == m => {
                self.emit(Instruction::Cast { from: from.clone(), to: to.clone() }, span);
            }
            _ => {
                let mut diagnostic = Diagnostic::new(Code::E0408, span, format!("`{from}` cannot be cast to `{to}`"))
                    .note("casts exist between real and int, also of vectors, from bool to int and real, and from int to bool");
                if let Some(mend) = self.mend(value, from, &to) {
                    diagnostic = diagnostic.help(mend);
                }
                self.error(diagnostic);
            }
        }
        to
    }

    /// `e.x`, `e.0` (LANGUAGE 3.7).
    fn access(&mut self, base: &Type, field: &Ident, value: ExprId, span: Span) -> Type {
        if *base == Type::Error {
            return Type::Error;
        }
        if let Type::Interval(ends) = base {
            return self.access_interval(ends, field, value, span);
        }
        let name = field.text.as_str();
        let index = match name {
            "start" if *base != Type::Quat => Some(0),
            "end" if *base != Type::Quat => Some(1),
            _ => FIELDS.iter().position(|f| *f == name).or_else(|| name.parse().ok()),
        };
        let element = index.and_then(|index| element(base, index));
        let Some((offset, ty)) = element else {
            self.no_field(base, field, value);
            return Type::Error;
        };
        self.emit(Instruction::Pick { offset, length: ty.width() }, span);
        ty
    }

    /// `i.start`, `i.x`, `i.may_be_nan`: numbers mean ends, letters mean components.
    fn access_interval(&mut self, ends: &Type, field: &Ident, value: ExprId, span: Span) -> Type {
        let end = match field.text.as_str() {
            "start" | "0" => Some(false),
            "end" | "1" => Some(true),
            "may_be_nan" => {
                self.emit(Instruction::MayBeNan, span);
                return Type::Bool;
            }
            _ => None,
        };
        if let Some(upper) = end {
            self.emit(Instruction::End { ty: ends.clone(), upper }, span);
            return ends.clone();
        }
        let component = FIELDS.iter().position(|f| *f == field.text).and_then(|index| element(ends, index));
        let Some((offset, ty)) = component else {
            self.no_field(&ends.clone().interval(), field, value);
            return Type::Error;
        };
        self.emit(Instruction::PickInterval { ends: ends.len(), offset, length: ty.len() }, span);
        ty.interval()
    }

    fn no_field(&mut self, base: &Type, field: &Ident, value: ExprId) {
        let fields = |n: usize| FIELDS.iter().take(n).map(|f| format!("`.{f}`")).collect::<Vec<_>>().join(", ");
        let offers = match base {
            Type::Vector(n) | Type::IntVector(n) => {
                format!("`{base}` has the components {}", fields(usize::from(*n)))
            }
            Type::Interval(ends) => {
                let components = match &**ends {
                    Type::Vector(n) | Type::Matrix { columns: n, .. } => {
                        format!(", and the intervals of its components {}", fields(usize::from(*n)))
                    }
                    _ => String::new(),
                };
                format!("`{base}` has `.start` (`.0`), `.end` (`.1`) and `.may_be_nan`{components}")
            }
            Type::Matrix { columns, .. } => format!("`{base}` has the columns {}", fields(usize::from(*columns))),
            Type::Quat => format!("`quat` has the components {}", fields(4)),
            Type::Tuple(elements) => {
                format!("`{base}` has the elements `.0` to `.{}`", elements.len().saturating_sub(1))
            }
            Type::Csg => "csg has no components".to_owned(),
            _ => format!("`{base}` has no components"),
        };
        let text = field.text.as_str();
        let mut diagnostic =
            Diagnostic::new(Code::E0407, field.span, format!("`{base}` has no `.{text}`")).note(offers);
        let swizzle = text.len() > 1 && text.chars().all(|c| "xyzw".contains(c));
        if *base == Type::Csg {
            diagnostic = diagnostic.help(format!("interpret it: `eval {}.Concept(…)`", self.quote(value)));
        } else if swizzle && matches!(base, Type::Vector(_) | Type::Quat) && text.len() <= 4 {
            let base = self.operand_text(value);
            let parts: Vec<String> = text.chars().map(|c| format!("{base}.{c}")).collect();
            diagnostic = diagnostic.help(format!("write `[{}]`", parts.join(", ")));
        }
        self.error(diagnostic);
    }
}

/// The first scalar and the type of an element (LANGUAGE 3.7).
fn element(base: &Type, index: usize) -> Option<(u32, Type)> {
    let at = u32::try_from(index).ok()?;
    match base {
        Type::Vector(n) => (at < u32::from(*n)).then_some((at, Type::Real)),
        Type::IntVector(n) => (at < u32::from(*n)).then_some((at, Type::Int)),
        Type::Quat => (at < 4).then_some((at, Type::Real)),
        Type::Matrix { columns, rows } => {
            (at < u32::from(*columns)).then(|| (at * u32::from(*rows), Type::Vector(*rows)))
        }
        Type::Tuple(elements) => {
            let ty = elements.get(index)?.clone();
            Some((elements.iter().take(index).map(Type::width).sum(), ty))
        }
        _ => None,
    }
}
