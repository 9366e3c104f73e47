//! The types of the built-in functions (LANGUAGE 5, 16): for which arguments they are defined and what they yield.
//! Knows nothing of what they compute.

use isograd_syntax::{
    Code, Diagnostic, Span,
    tree::{BinaryOp, ExprId, Ident},
};

use super::{body::Body, messages::counted};
use crate::{Builtin, Type, typed::Instruction};

/// Which arguments a built-in takes.
enum Rule {
    /// So many of one type, of the kinds allowed; yields the same type.
    Same(usize, Kinds),
    /// So many of one type, of the kinds allowed; yields a real.
    ToReal(usize, Kinds),
    /// Exactly one of these lists.
    Fixed(&'static [(&'static [Type], Type)]),
    /// One matrix (or quaternion), which decides the result's type.
    Shape(fn(&Type) -> Option<Type>),
}

/// Kinds of types beside vectors.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kinds {
    /// R, V
    Real,
    /// R, V, I
    Number,
    /// R, V, I, matrices
    Matrix,
    /// V
    Vector,
    /// V, quat
    VectorOrQuat,
}

impl Kinds {
    fn allow(self, ty: &Type) -> bool {
        match ty {
            Type::Vector(_) => true,
            Type::Real => matches!(self, Self::Real | Self::Number | Self::Matrix),
            Type::Int | Type::IntVector(_) => matches!(self, Self::Number | Self::Matrix),
            Type::Matrix { .. } => self == Self::Matrix,
            Type::Quat => self == Self::VectorOrQuat,
            _ => false,
        }
    }
}

/// The letters of signatures.
const LETTERS: &str = "R is a real, V a vector of reals, I an int or a vector of ints; or intervals with such ends";

const V3: Type = Type::Vector(3);

fn rule(builtin: Builtin) -> Rule {
    use Builtin as B;
    match builtin {
        B::Dot => Rule::ToReal(2, Kinds::VectorOrQuat),
        B::Length => Rule::ToReal(1, Kinds::VectorOrQuat),
        B::Distance => Rule::ToReal(2, Kinds::Vector),
        B::Normalize => Rule::Same(1, Kinds::VectorOrQuat),
        B::Reflect => Rule::Same(2, Kinds::Vector),
        B::Cross => Rule::Fixed(&[(&[V3, V3], V3)]),
        B::Sqrt
        | B::Exp
        | B::Fract
        | B::Floor
        | B::Ceil
        | B::Round
        | B::Sin
        | B::Cos
        | B::Tan
        | B::Asin
        | B::Acos
        | B::Atan
        | B::Saturate
        | B::Trunc
        | B::Log
        | B::Log2
        | B::Exp2
        | B::Sinh
        | B::Cosh
        | B::Tanh
        | B::Asinh
        | B::Acosh
        | B::Atanh
        | B::InverseSqrt => Rule::Same(1, Kinds::Real),
        B::Pow | B::Step => Rule::Same(2, Kinds::Real),
        B::Mix | B::Lerp | B::Smoothstep => Rule::Same(3, Kinds::Real),
        B::Abs | B::Sign => Rule::Same(1, Kinds::Number),
        B::Min | B::Max => Rule::Same(2, Kinds::Number),
        B::Clamp => Rule::Same(3, Kinds::Number),
        B::Mod => Rule::Same(2, Kinds::Matrix),
        B::Inverse | B::Invert => Rule::Shape(|ty| match ty {
            Type::Quat => Some(Type::Quat),
            Type::Matrix { columns, rows } => (columns == rows).then(|| ty.clone()),
            _ => None,
        }),
        B::Determinant => Rule::Shape(|ty| match ty {
            Type::Matrix { columns, rows } => (columns == rows).then_some(Type::Real),
            _ => None,
        }),
        B::Transpose => Rule::Shape(|ty| match *ty {
            Type::Matrix { columns, rows } => Some(Type::Matrix { columns: rows, rows: columns }),
            _ => None,
        }),
        B::Atan2 => Rule::Fixed(&[(&[Type::Real, Type::Real], Type::Real)]),
        B::Quat => Rule::Fixed(&[
            (&[Type::Real, Type::Real, Type::Real, Type::Real], Type::Quat),
            (&[V3, Type::Real], Type::Quat),
        ]),
        B::Conjugate => Rule::Fixed(&[(&[Type::Quat], Type::Quat)]),
        B::Rotate => Rule::Fixed(&[(&[Type::Quat, V3], V3)]),
        B::ToMat3 => Rule::Fixed(&[(&[Type::Quat], Type::Matrix { columns: 3, rows: 3 })]),
    }
}

/// A reason why a built-in is not defined for its arguments: which one, and the type that would do.
struct Misfit {
    argument: usize,
    wanted: Option<Type>,
    /// It is defined for the ends of these intervals, but has no enclosure.
    no_enclosure: bool,
}

/// The result's type. Intervals are taken where their ends are, all arguments being intervals then (LANGUAGE 5, 15.8).
fn result(rule: &Rule, types: &[Type]) -> Result<Type, Misfit> {
    let is_interval = |t: &Type| matches!(t, Type::Interval(_));
    let Some(interval) = types.iter().position(is_interval) else { return apply(rule, types) };
    let ends: Vec<Type> = types.iter().map(|t| t.ends().clone()).collect();
    let wanted = |argument: usize, ty: Type| match types.get(argument).is_some_and(is_interval) {
        true if ty.is_end() => ty.interval(),
        _ => ty,
    };
    match apply(rule, &ends) {
        Err(misfit) => Err(Misfit { wanted: misfit.wanted.map(|ty| wanted(misfit.argument, ty)), ..misfit }),
        Ok(ty) if !ty.is_end() || ends.iter().any(|t| !t.is_end()) => {
            Err(Misfit { argument: interval, wanted: None, no_enclosure: true })
        }
        Ok(ty) => match types.iter().position(|t| !is_interval(t)) {
            Some(argument) => {
                let wanted = ends.get(argument).map(|t| t.clone().interval());
                Err(Misfit { argument, wanted, no_enclosure: false })
            }
            None => Ok(ty.interval()),
        },
    }
}

fn apply(rule: &Rule, types: &[Type]) -> Result<Type, Misfit> {
    match rule {
        Rule::Same(_, kinds) | Rule::ToReal(_, kinds) => {
            if let Some(argument) = types.iter().position(|t| !kinds.allow(t)) {
                let like = types.iter().find(|t| kinds.allow(t)).cloned();
                let real = match types.get(argument) {
                    Some(Type::IntVector(n)) => Type::Vector(*n),
                    _ => Type::Real,
                };
                let wanted = like.or_else(|| kinds.allow(&real).then_some(real));
                return Err(Misfit { argument, wanted, no_enclosure: false });
            }
            let first = types.first().cloned().unwrap_or(Type::Error);
            if let Some(argument) = types.iter().position(|t| *t != first) {
                return Err(differing(types, argument, first));
            }
            Ok(if matches!(rule, Rule::ToReal(..)) { Type::Real } else { first })
        }
        Rule::Fixed(forms) => {
            if let Some((_, result)) = forms.iter().find(|(parameters, _)| *parameters == types) {
                return Ok(result.clone());
            }
            let form = forms.iter().find(|(parameters, _)| parameters.len() == types.len());
            let parameters = form.map_or(&[][..], |(p, _)| *p);
            let argument = parameters.iter().zip(types).position(|(p, t)| p != t).unwrap_or(0);
            Err(Misfit { argument, wanted: parameters.get(argument).cloned(), no_enclosure: false })
        }
        Rule::Shape(shape) => {
            types.first().and_then(shape).ok_or(Misfit { argument: 0, wanted: None, no_enclosure: false })
        }
    }
}

/// With `max(v, 0.0)` it is the real that must become a vector, with `max(1, x)` the int that must become a real.
fn differing(types: &[Type], argument: usize, first: Type) -> Misfit {
    let other = types.get(argument).cloned().unwrap_or(Type::Error);
    let rank = |t: &Type| match t {
        Type::Int => 0,
        Type::IntVector(_) => 1,
        Type::Real => 2,
        _ => 3,
    };
    let (argument, wanted) = if rank(&first) < rank(&other) { (0, other) } else { (argument, first) };
    Misfit { argument, wanted: Some(wanted), no_enclosure: false }
}

impl Body<'_> {
    /// A built-in, its arguments being on the stack.
    pub fn builtin(&mut self, builtin: Builtin, callee: &Ident, args: &[ExprId], types: Vec<Type>, span: Span) -> Type {
        if self.csg_in(args, &types, "an argument of a built-in function") {
            return Type::Error;
        }
        let rule = rule(builtin);
        let signature = format!("the signature is `{}`", builtin.signature());
        let mut counts: Vec<usize> = match &rule {
            Rule::Same(n, _) | Rule::ToReal(n, _) => vec![*n],
            Rule::Fixed(forms) => forms.iter().map(|(p, _)| p.len()).collect(),
            Rule::Shape(_) => vec![1],
        };
        if !counts.contains(&args.len()) {
            if self.unread(args) {
                return Type::Error;
            }
            counts.sort_unstable();
            counts.dedup();
            let most = counts.pop().unwrap_or(0);
            let fewer: String = counts.iter().map(|n| format!("{n} or ")).collect();
            self.error(
                Diagnostic::new(
                    Code::E0402,
                    callee.span,
                    format!("`{}` takes {fewer}{}, not {}", callee.text, counted(most, "argument"), args.len()),
                )
                .note(signature)
                .note(LETTERS),
            );
            return Type::Error;
        }
        if types.contains(&Type::Error) {
            return Type::Error;
        }
        let ty = match result(&rule, &types) {
            Ok(ty) => ty,
            Err(misfit) => {
                self.misfit(&misfit, callee, args, &types, signature);
                return Type::Error;
            }
        };
        // `mod` of matrices is the operator `%`; that is where the product of types is known.
        let instruction = match (builtin, types.as_slice()) {
            (Builtin::Mod, [left, right]) if matches!(left.ends(), Type::Matrix { .. }) => {
                Instruction::Binary { op: BinaryOp::Rem, left: left.clone(), right: right.clone() }
            }
            _ => Instruction::Builtin { builtin, args: types },
        };
        self.emit(instruction, span);
        ty
    }

    fn misfit(&mut self, misfit: &Misfit, callee: &Ident, args: &[ExprId], types: &[Type], signature: String) {
        let (Some(id), Some(ty)) = (args.get(misfit.argument), types.get(misfit.argument)) else { return };
        let number = misfit.argument + 1;
        let span = self.expr_span(*id);
        if misfit.no_enclosure {
            let (text, name) = (self.operand_text(*id), &callee.text);
            self.error(
                Diagnostic::new(Code::E0804, span, format!("`{name}` has no enclosure: it does not take `{ty}`"))
                    .here(format!("this is `{ty}`"))
                    .note(signature)
                    .help(format!(
                        "use an end, `{text}.start` or `{text}.end`, or `bound(e, dyn, {text})` around it all"
                    )),
            );
            return;
        }
        let message = match &misfit.wanted {
            Some(wanted) => format!("argument {number} of `{}` is `{ty}`, but `{wanted}` is needed here", callee.text),
            None => format!("argument {number} of `{}` is `{ty}`, for which it is not defined", callee.text),
        };
        let mut diagnostic = Diagnostic::new(Code::E0403, span, message).here(format!("this is `{ty}`"));
        for (i, (other, ty)) in args.iter().zip(types).enumerate() {
            if i != misfit.argument {
                diagnostic = diagnostic.label(self.expr_span(*other), format!("this is `{ty}`"));
            }
        }
        diagnostic = diagnostic.note(signature).note(LETTERS);
        let mend = misfit.wanted.as_ref().and_then(|wanted| self.mend(*id, ty, wanted));
        if let Some(mend) = mend {
            diagnostic = diagnostic.help(mend);
        }
        self.error(diagnostic);
    }
}
