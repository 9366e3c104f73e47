//! Phrases of messages: quoting source text and proposing the form that would work (LANGUAGE 3.3). Reports nothing
//! itself.

use isograd_syntax::tree::{ExprId, ExprKind, UnaryOp};

use super::{body::Body, tree};
use crate::Type;

/// Longer source text is not repeated in a message.
const LONGEST: usize = 40;

impl Body<'_> {
    /// The source text of an expression, short enough for a sentence.
    pub fn quote(&self, id: ExprId) -> String {
        let text = self.text(self.expr_span(id));
        if text.is_empty() || text.len() > 4 * LONGEST || text.contains('\n') || text.chars().count() > LONGEST {
            return "…".to_owned();
        }
        text.to_owned()
    }

    /// The same, with parentheses where an operator or cast behind it would take a part of it only.
    pub fn operand_text(&self, id: ExprId) -> String {
        let text = self.quote(id);
        let loose = match &tree::expr(self.tree, id).kind {
            ExprKind::Binary { .. } | ExprKind::If { .. } | ExprKind::Loop { .. } => true,
            ExprKind::Eval { word, .. } => *word,
            _ => false,
        };
        if loose && !text.starts_with('(') { format!("({text})") } else { text }
    }

    /// How to turn a value of type `have` into one of type `want`, if there is a short way.
    pub fn mend(&self, id: ExprId, have: &Type, want: &Type) -> Option<String> {
        if let Some(real) = self.real_literal(id)
            && *want == Type::Real
        {
            return Some(format!("write `{real}`"));
        }
        let text = self.operand_text(id);
        match (have, want) {
            (Type::Interval(ends), want) if **ends == *want => {
                Some(format!("take an end: `{text}.start` or `{text}.end`"))
            }
            (have, Type::Interval(ends)) if *have == **ends => {
                let text = self.quote(id);
                Some(format!("write the interval `[{text} .. {text}]`"))
            }
            (Type::Vector(n), Type::IntVector(m)) if n == m => {
                Some(format!("cast it: `{text}::<{want}>` (truncates toward zero)"))
            }
            (Type::IntVector(n), Type::Vector(m)) if n == m => Some(format!("cast it: `{text}::<{want}>`")),
            (Type::Int | Type::Bool, Type::Real) => Some(format!("cast it: `{text}::<real>`")),
            (Type::Real, Type::Int) => Some(format!("cast it: `{text}::<int>` (truncates toward zero)")),
            (Type::Bool, Type::Int) => Some(format!("cast it: `{text}::<int>`")),
            (Type::Real, Type::Bool) => Some(format!("compare it: `{text} > 0.0`")),
            (Type::Int, Type::Bool) => Some(format!("compare it: `{text} != 0`")),
            (Type::Real, Type::Vector(n)) => Some(format!("repeat it: `[{}; {n}]`", self.quote(id))),
            (Type::Vector(n), Type::Real) => {
                let last = ["x", "y", "z", "w"].get(usize::from(*n).saturating_sub(1)).copied().unwrap_or("w");
                Some(format!("take a component (`{text}.x` to `{text}.{last}`) or `length({})`", self.quote(id)))
            }
            (Type::Quat, Type::Vector(4)) => Some(format!("write `[{text}.x, {text}.y, {text}.z, {text}.w]`")),
            (Type::Vector(4), Type::Quat) => Some(format!("write `quat({text}.x, {text}.y, {text}.z, {text}.w)`")),
            (Type::Vector(3), Type::Quat) => Some("write `quat(axis, angle)`".to_owned()),
            (Type::Csg, _) => Some("interpret the csg value with `eval name.Concept(…)`".to_owned()),
            _ => None,
        }
    }

    /// An int literal, with its sign, as a real.
    fn real_literal(&self, id: ExprId) -> Option<String> {
        match &tree::expr(self.tree, id).kind {
            ExprKind::Int(value) => Some(format!("{value}.0")),
            ExprKind::Unary { op: UnaryOp::Neg, operand } => match tree::expr(self.tree, *operand).kind {
                ExprKind::Int(value) => Some(format!("-{value}.0")),
                _ => None,
            },
            _ => None,
        }
    }

    /// The elements of a list with int literals written as reals, if that is all it takes.
    pub fn real_list(&self, elements: &[ExprId], types: &[Type]) -> Option<String> {
        if elements.len() > 4 {
            return None;
        }
        let parts: Option<Vec<String>> = elements
            .iter()
            .zip(types)
            .map(|(id, ty)| match ty {
                Type::Real => Some(self.quote(*id)),
                Type::Int | Type::Bool => {
                    Some(self.real_literal(*id).unwrap_or_else(|| format!("{}::<real>", self.operand_text(*id))))
                }
                _ => None,
            })
            .collect();
        parts.map(|p| format!("[{}]", p.join(", ")))
    }
}

/// `a`, `a` or `b`, …
pub(super) fn alternatives(names: &[&str]) -> String {
    let quoted: Vec<String> = names.iter().map(|n| format!("`{n}`")).collect();
    match quoted.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
        None => String::new(),
    }
}

/// `1 argument`, `2 arguments`.
pub(super) fn counted(n: usize, what: &str) -> String {
    if n == 1 { format!("1 {what}") } else { format!("{n} {what}s") }
}
