//! Operators (LANGUAGE 4): which operands they take and what they yield. Knows nothing of how a value was computed,
//! but proposes what to write instead.

use isograd_syntax::{
    Code, Diagnostic, Span,
    tree::{BinaryOp, ExprId, ExprKind, UnaryOp},
};

use super::{body::Body, constants, statements::Want, tree};
use crate::{Type, typed::Instruction};

/// The result's type of `left op right`; `None` if the operator is not defined for them (LANGUAGE 4.1).
fn result(op: BinaryOp, left: &Type, right: &Type) -> Option<Type> {
    use Type::{Bool, Int, IntVector, Interval, Matrix, Quat, Real, Vector};
    if matches!(left, Interval(_)) || matches!(right, Interval(_)) {
        return enclosed(op, left, right);
    }
    let number = matches!(left, Real | Int | Vector(_) | IntVector(_) | Matrix { .. });
    let identical = left == right;
    match op {
        BinaryOp::Add | BinaryOp::Sub => (identical && (number || *left == Quat)).then(|| left.clone()),
        BinaryOp::Mul => match (left, right) {
            (Real, Real) | (Int, Int) | (Quat, Quat) => Some(left.clone()),
            (Vector(a), Vector(b)) | (IntVector(a), IntVector(b)) => (a == b).then(|| left.clone()),
            (Vector(_) | Matrix { .. } | Quat, Real) => Some(left.clone()),
            (Real, Vector(_) | Matrix { .. } | Quat) => Some(right.clone()),
            (Matrix { columns, rows }, Matrix { columns: width, rows: inner }) => {
                (columns == inner).then_some(Matrix { columns: *width, rows: *rows })
            }
            (Matrix { columns, rows }, Vector(n)) => (columns == n).then_some(Vector(*rows)),
            (Vector(n), Matrix { columns, rows }) => (rows == n).then_some(Vector(*columns)),
            _ => None,
        },
        BinaryOp::Div => match (left, right) {
            (Vector(_) | Matrix { .. } | Quat, Real) => Some(left.clone()),
            _ => (identical && number).then(|| left.clone()),
        },
        BinaryOp::Rem => (identical && number).then(|| left.clone()),
        BinaryOp::Lt | BinaryOp::Gt | BinaryOp::Le | BinaryOp::Ge | BinaryOp::Eq | BinaryOp::Ne => {
            (identical && matches!(left, Real | Int)).then_some(Bool)
        }
        BinaryOp::And | BinaryOp::Or => (*left == Bool && *right == Bool).then_some(Bool),
    }
}

/// Two intervals, or an interval and a plain value that is read as an interval of one point: of the type of the ends,
/// or a real that scales them (LANGUAGE 4.2).
fn enclosed(op: BinaryOp, left: &Type, right: &Type) -> Option<Type> {
    let arithmetic = matches!(op, BinaryOp::Add | BinaryOp::Sub | BinaryOp::Mul | BinaryOp::Div | BinaryOp::Rem);
    let readable = match (left, right) {
        (Type::Interval(_), Type::Interval(_)) | (Type::Interval(_), Type::Real) | (Type::Real, Type::Interval(_)) => {
            true
        }
        _ => left.ends() == right.ends(),
    };
    if !arithmetic || !readable {
        return None;
    }
    result(op, left.ends(), right.ends()).map(Type::interval)
}

fn is_comparison(op: BinaryOp) -> bool {
    matches!(op, BinaryOp::Lt | BinaryOp::Gt | BinaryOp::Le | BinaryOp::Ge | BinaryOp::Eq | BinaryOp::Ne)
}

impl Body<'_> {
    /// Checks the right operand, the left being on the stack already.
    pub fn binary(
        &mut self,
        op: BinaryOp,
        op_span: Span,
        (left, left_type): (ExprId, Type),
        right: ExprId,
        span: Span,
    ) -> Type {
        let right_type = self.value(right, Want::Any);
        let poisoned = left_type == Type::Error || right_type == Type::Error;
        if poisoned {
            // The operands do not matter for the type of a comparison.
            let logical = is_comparison(op) || matches!(op, BinaryOp::And | BinaryOp::Or);
            return if logical { Type::Bool } else { Type::Error };
        }
        let types = [left_type, right_type];
        if self.csg_in(&[left, right], &types, &format!("an operand of `{}`", op.text())) {
            return Type::Error;
        }
        let [left_type, right_type] = types;
        let Some(ty) = result(op, &left_type, &right_type) else {
            let diagnostic = self.refused(op, op_span, (left, &left_type), (right, &right_type));
            self.error(diagnostic);
            return Type::Error;
        };
        if left_type.ends() == &Type::Int
            && matches!(op, BinaryOp::Div | BinaryOp::Rem)
            && constants::int(self.tree, right) == Some(0)
        {
            self.error(
                Diagnostic::new(Code::W0403, span, format!("int `{}` by 0 is always 0", op.text()))
                    .help("divide by something else, or write `0`"),
            );
        }
        self.emit(Instruction::Binary { op, left: left_type, right: right_type }, span);
        ty
    }

    fn refused(
        &self,
        op: BinaryOp,
        op_span: Span,
        (left, left_type): (ExprId, &Type),
        (right, right_type): (ExprId, &Type),
    ) -> Diagnostic {
        let interval = matches!(left_type, Type::Interval(_)) || matches!(right_type, Type::Interval(_));
        if interval && is_comparison(op) {
            let message = format!("`{}` cannot compare `{left_type}` and `{right_type}`", op.text());
            let name = if matches!(left_type, Type::Interval(_)) { left } else { right };
            let name = self.operand_text(name);
            return Diagnostic::new(Code::E0804, op_span, message)
                .label(self.expr_span(left), format!("this is `{left_type}`"))
                .label(self.expr_span(right), format!("this is `{right_type}`"))
                .note("intervals have no order")
                .help(format!("compare an end: `{name}.start` or `{name}.end`"));
        }
        if op == BinaryOp::Mul
            && let Some(diagnostic) = self.shapes(op_span, (left, left_type), (right, right_type))
        {
            return diagnostic;
        }
        let message = format!("`{}` is not defined for `{left_type}` and `{right_type}`", op.text());
        let mut diagnostic = Diagnostic::new(Code::E0401, op_span, message)
            .label(self.expr_span(left), format!("this is `{left_type}`"))
            .label(self.expr_span(right), format!("this is `{right_type}`"));
        if let Some(help) = self.way_out(op, (left, left_type), (right, right_type)) {
            diagnostic = diagnostic.help(help);
        }
        diagnostic
    }

    /// E0404: a product whose shapes do not fit.
    fn shapes(
        &self,
        op_span: Span,
        (left, left_type): (ExprId, &Type),
        (right, right_type): (ExprId, &Type),
    ) -> Option<Diagnostic> {
        if matches!(left_type, Type::Interval(_)) != matches!(right_type, Type::Interval(_)) {
            return None;
        }
        let rule = match (left_type.ends(), right_type.ends()) {
            (Type::Matrix { columns, .. }, Type::Matrix { rows, .. }) => {
                format!("the left matrix has {columns} columns, the right one {rows} rows; they must agree")
            }
            (Type::Matrix { columns, .. }, Type::Vector(n)) => {
                format!("the matrix has {columns} columns, the vector {n} components; they must agree")
            }
            (Type::Vector(n), Type::Matrix { rows, .. }) => {
                format!("the vector has {n} components, the matrix {rows} rows; they must agree")
            }
            _ => return None,
        };
        let message = format!("the shapes of `{left_type}` and `{right_type}` do not fit a product");
        let diagnostic = Diagnostic::new(Code::E0404, op_span, message)
            .label(self.expr_span(left), format!("this is `{left_type}`"))
            .label(self.expr_span(right), format!("this is `{right_type}`"))
            .note(rule)
            .note("`matWxH` has W columns of H rows; `[a, b]` of vectors lists columns");
        let exchanged = match (left_type.ends(), right_type.ends()) {
            (Type::Matrix { columns, .. }, Type::Matrix { rows: n, .. })
            | (Type::Matrix { rows: columns, .. }, Type::Vector(n))
            | (Type::Vector(n), Type::Matrix { columns, .. }) => columns == n,
            _ => false,
        };
        Some(if exchanged {
            let (left, right) = (self.operand_text(left), self.operand_text(right));
            diagnostic.help(format!("the other way round they fit: `{right} * {left}`"))
        } else {
            diagnostic
        })
    }

    fn way_out(
        &self,
        op: BinaryOp,
        (left, left_type): (ExprId, &Type),
        (right, right_type): (ExprId, &Type),
    ) -> Option<String> {
        use Type::{Bool, Int, Real, Vector};
        if is_comparison(op)
            && let ExprKind::Binary { op: inner, right: middle, .. } = tree::expr(self.tree, left).kind
            && is_comparison(inner)
        {
            let (all, middle, right) = (self.quote(left), self.quote(middle), self.quote(right));
            return Some(format!("write `{all} && {middle} {} {right}`", op.text()));
        }
        if let (Type::Interval(_), plain) | (plain, Type::Interval(_)) = (left_type, right_type) {
            let at = if plain == right_type { right } else { left };
            if matches!(plain, Int | Bool) {
                return self.mend(at, plain, &Real);
            }
            let point = plain.clone().interval();
            let (a, b) = if at == right { (left_type, &point) } else { (&point, right_type) };
            return result(op, a, b).and_then(|_| self.mend(at, plain, &point));
        }
        match (left_type, right_type) {
            (Bool, Bool) if op == BinaryOp::Eq => Some("write `(a && b) || (!a && !b)`".to_owned()),
            (Bool, Bool) if op == BinaryOp::Ne => Some("write `(a || b) && !(a && b)`".to_owned()),
            (Vector(_), Vector(_)) if is_comparison(op) => {
                Some("compare components or lengths, for example `a.x < b.x`".to_owned())
            }
            (Real, Int | Bool) => self.mend(right, right_type, &Real),
            (Int | Bool, Real) => self.mend(left, left_type, &Real),
            (Type::IntVector(n), Vector(_)) => self.mend(left, left_type, &Vector(*n)),
            (Vector(_), Type::IntVector(n)) => self.mend(right, right_type, &Vector(*n)),
            (Vector(_), Int) => self.mend(right, right_type, &Real),
            (Int, Vector(_)) => self.mend(left, left_type, &Real),
            (Vector(_), Real) => self.mend(right, right_type, left_type),
            (Real, Vector(_)) => self.mend(left, left_type, right_type),
            (_, Bool) if matches!(op, BinaryOp::And | BinaryOp::Or) => self.mend(left, left_type, &Bool),
            (Bool, _) if matches!(op, BinaryOp::And | BinaryOp::Or) => self.mend(right, right_type, &Bool),
            (Type::Quat, Vector(3)) if op == BinaryOp::Mul => {
                Some(format!("to turn a vector write `rotate({}, {})`", self.quote(left), self.quote(right)))
            }
            _ => None,
        }
    }

    /// `-a`, `!a`, the operand being on the stack.
    pub fn unary(&mut self, op: UnaryOp, ty: &Type, operand: ExprId, span: Span) -> Type {
        if *ty == Type::Error {
            return if op == UnaryOp::Not { Type::Bool } else { Type::Error };
        }
        if self.csg_in(&[operand], std::slice::from_ref(ty), &format!("an operand of `{}`", op.text())) {
            return Type::Error;
        }
        match (op, ty) {
            (UnaryOp::Not, Type::Bool) => self.emit(Instruction::Not, span),
            (
                UnaryOp::Neg,
                Type::Real
                | Type::Int
                | Type::Vector(_)
                | Type::IntVector(_)
                | Type::Matrix { .. }
                | Type::Quat
                | Type::Interval(_),
            ) => {
                self.emit(Instruction::Neg(ty.clone()), span);
            }
            _ => {
                let mut diagnostic =
                    Diagnostic::new(Code::E0401, span, format!("`{}` is not defined for `{ty}`", op.text()));
                let help = match (op, ty) {
                    (UnaryOp::Neg, Type::Bool) => Some(format!("write `!{}`", self.operand_text(operand))),
                    (UnaryOp::Not, _) => self.mend(operand, ty, &Type::Bool),
                    _ => None,
                };
                if let Some(help) = help {
                    diagnostic = diagnostic.help(help);
                }
                self.error(diagnostic);
                return Type::Error;
            }
        }
        ty.clone()
    }
}
