//! Lists, splats, tuples and intervals (LANGUAGE 3.5). Knows nothing of how their elements are computed.

use isograd_syntax::{
    Code, Diagnostic, Span,
    tree::{ExprId, ExprKind},
};

use super::{
    body::Body,
    constants::{self, Constant},
    messages::counted,
    statements::Want,
    tree,
};
use crate::{Type, typed::Instruction};

/// What may stand in a list.
const ELEMENTS: &str = "a list holds 2 to 4 reals (a vector), 2 to 4 vectors of one size (the columns of a matrix), or 2 to \
     4 intervals of reals (an interval of vectors)";

impl<'a> Body<'a> {
    /// `[a, b]`: a vector of reals, a matrix of column vectors, or an interval of vectors.
    pub fn list(&mut self, elements: &'a [ExprId], span: Span) -> Type {
        let types: Vec<Type> = elements.iter().map(|e| self.value(*e, Want::Any)).collect();
        let count = u32::try_from(elements.len()).unwrap_or(u32::MAX);
        let intervals = matches!(types.first(), Some(Type::Interval(_)));
        self.emit(if intervals { Instruction::PackIntervals(count) } else { Instruction::Pack(count) }, span);
        if types.contains(&Type::Error) {
            return Type::Error;
        }
        if self.csg_in(elements, &types, "a list") {
            return Type::Error;
        }
        let size = u8::try_from(elements.len()).ok().filter(|n| (2..=4).contains(n));
        let element = types.first().cloned().unwrap_or(Type::Error);
        if let Some(at) = types.iter().position(|t| *t != element || listed(t, 2) == Type::Error) {
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
        let fits = listed(ty, 2) != Type::Error;
        let message = if fits {
            format!("a list cannot hold `{first}` and `{ty}`")
        } else {
            format!("a list cannot hold a value of type `{ty}`")
        };
        let mut diagnostic =
            Diagnostic::new(Code::E0405, self.expr_span(*id), message).here(format!("this is `{ty}`")).note(ELEMENTS);
        if let Some(first_id) = elements.first().filter(|_| fits && at > 0) {
            diagnostic = diagnostic.label(self.expr_span(*first_id), format!("this is `{first}`"));
        }
        let help = match self.real_list(elements, types).or_else(|| self.interval_of_lists(elements, types)) {
            Some(list) => Some(format!("write `{list}`")),
            None if fits => {
                let plain = types.iter().position(|t| t.clone().interval() == *first);
                let plain = plain.or_else(|| (ty.clone() == first.clone().interval()).then_some(0));
                plain.and_then(|at| self.mend(*elements.get(at)?, types.get(at)?, &types.get(at)?.clone().interval()))
            }
            None => Some("use a tuple: `(a, b, …)`".to_owned()),
        };
        if let Some(help) = help {
            diagnostic = diagnostic.help(help);
        }
        self.error(diagnostic);
    }

    /// A list of intervals of vectors, written as what there is: an interval of lists.
    fn interval_of_lists(&self, elements: &[ExprId], types: &[Type]) -> Option<String> {
        let of_vectors = types.iter().all(|t| matches!(t, Type::Interval(ends) if matches!(**ends, Type::Vector(_))));
        if !of_vectors || !(2..=4).contains(&elements.len()) {
            return None;
        }
        let (lower, upper): (Vec<String>, Vec<String>) = elements.iter().map(|e| self.ends_text(*e)).unzip();
        Some(format!("[[{}] .. [{}]]", lower.join(", "), upper.join(", ")))
    }

    /// How to write the ends of an interval.
    fn ends_text(&self, id: ExprId) -> (String, String) {
        if let ExprKind::Interval { lo, hi } = &tree::expr(self.tree, id).kind {
            return (self.quote(*lo), self.quote(*hi));
        }
        let text = self.operand_text(id);
        (format!("{text}.start"), format!("{text}.end"))
    }

    /// `[e; N]`.
    pub fn splat(&mut self, element: ExprId, count: u32, span: Span) -> Type {
        let ty = self.value(element, Want::Any);
        let interval = matches!(ty, Type::Interval(_));
        self.emit(if interval { Instruction::SplatInterval(count) } else { Instruction::Splat(count) }, span);
        if ty == Type::Error {
            return Type::Error;
        }
        if self.csg_in(&[element], std::slice::from_ref(&ty), "a list") {
            return Type::Error;
        }
        if listed(&ty, 2) == Type::Error {
            let mut diagnostic = Diagnostic::new(
                Code::E0405,
                self.expr_span(element),
                format!("a list cannot hold a value of type `{ty}`"),
            )
            .note(ELEMENTS);
            let (lower, upper) = self.ends_text(element);
            if matches!(&ty, Type::Interval(ends) if matches!(**ends, Type::Vector(_))) {
                diagnostic = diagnostic.help(format!("write `[[{lower}; {count}] .. [{upper}; {count}]]`"));
            } else if let Some(mend) = self.mend(element, &ty, &Type::Real).filter(|_| !interval) {
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

    /// `[lo .. hi]` (LANGUAGE 3.5).
    pub fn interval(&mut self, lo: ExprId, hi: ExprId, span: Span) -> Type {
        let ends = [lo, hi];
        let types = ends.map(|e| self.value(e, Want::Any));
        if self.csg_in(&ends, &types, "an interval") {
            return Type::Error;
        }
        let [lower, upper] = &types;
        if types.contains(&Type::Error) {
            return Type::Error;
        }
        if lower != upper || !lower.is_end() {
            let diagnostic = self.bad_ends(ends, &types, span);
            self.error(diagnostic);
            return Type::Error;
        }
        if let (Some(start), Some(end)) = (constants::constant(self.tree, lo), constants::constant(self.tree, hi))
            && reversed(&start, &end)
        {
            let (lower, upper) = (self.quote(lo), self.quote(hi));
            self.error(
                Diagnostic::new(Code::W0801, span, "this interval starts above its end")
                    .note("operations read it with its ends exchanged; `.start` and `.end` keep them as written")
                    .help(format!("write `[{upper} .. {lower}]`, component by component for vectors")),
            );
        }
        self.emit(Instruction::Interval(lower.clone()), span);
        lower.clone().interval()
    }

    /// E0411
    fn bad_ends(&self, [lo, hi]: [ExprId; 2], [lower, upper]: &[Type; 2], span: Span) -> Diagnostic {
        let message = if lower == upper {
            format!("an interval cannot have ends of type `{lower}`")
        } else {
            format!("the ends of this interval differ: `{lower}` and `{upper}`")
        };
        let mut diagnostic = Diagnostic::new(Code::E0411, span, message)
            .label(self.expr_span(lo), format!("this is `{lower}`"))
            .label(self.expr_span(hi), format!("this is `{upper}`"))
            .note("both ends are of one type: real, int, or a vector or matrix of reals");
        let help = if lower == upper {
            let real = match lower {
                Type::IntVector(n) => Type::Vector(*n),
                _ => Type::Real,
            };
            self.mend(lo, lower, &real).filter(|_| lower.is_int() || *lower == Type::Bool)
        } else {
            let widened = |have: &Type| matches!(have, Type::Int | Type::Bool | Type::Real);
            let upper_first = widened(upper) && *upper != Type::Real || !widened(lower);
            let (first, second) = ((hi, upper, lower), (lo, lower, upper));
            let order = if upper_first { [first, second] } else { [second, first] };
            order.into_iter().find_map(|(id, have, want)| self.mend(id, have, want))
        };
        if let Some(help) = help {
            diagnostic = diagnostic.help(help);
        }
        diagnostic
    }

    /// E0603 for the first csg value among operands that may not be csg.
    pub fn csg_in(&mut self, values: &[ExprId], types: &[Type], place: &str) -> bool {
        let Some(at) = types.iter().position(|t| *t == Type::Csg) else { return false };
        let Some(id) = values.get(at) else { return false };
        let help = match &tree::expr(self.tree, *id).kind {
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

/// The type of a list of so many elements of a type; [`Type::Error`] if there are no such lists.
fn listed(element: &Type, size: u8) -> Type {
    match element {
        Type::Real => Type::Vector(size),
        Type::Vector(rows) => Type::Matrix { columns: size, rows: *rows },
        Type::Interval(ends) if **ends == Type::Real => Type::Vector(size).interval(),
        _ => Type::Error,
    }
}

/// Whether some component of the start is above that of the end.
fn reversed(start: &Constant, end: &Constant) -> bool {
    match (start, end) {
        (Constant::Int(start), Constant::Int(end)) => start > end,
        (Constant::Reals(start), Constant::Reals(end)) => start.iter().zip(end).any(|(start, end)| start > end),
        _ => false,
    }
}
