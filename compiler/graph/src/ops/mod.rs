//! The table of operations (DESIGN 4): everything that is known of an operation, in one struct literal. Printing,
//! laws, evaluation, differentiation and the emitters derive from it; adding an operation is one literal in a file
//! beside this one and one line in the list below.

mod bits;
mod directed;
mod enclose;
mod enclose_functions;
mod int;
mod kink;
mod real;
mod rewrite;
mod smooth;
mod transcendental;
mod truth;

use std::fmt;

use crate::{Builder, Enclosure, Facts, Mode, NodeId, Precision, Scalar, Unwatched, Value};

pub use kink::{Discriminant, Kink, discriminant};
pub use rewrite::{Fit, LETTERS, Letter, REWRITES, Rewrite, Term, applicable, rewrite};

macro_rules! table {
    ($( $op:ident => $def:path; )+) => {
        /// An operation of the table.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Op { $( #[doc = concat!("See `", stringify!($def), "`.")] $op, )+ }

        impl Op {
            /// Every operation.
            pub const ALL: &'static [Self] = &[ $( Self::$op, )+ ];

            /// What is known of it.
            #[must_use]
            pub const fn def(self) -> &'static OpDef { match self { $( Self::$op => &$def, )+ } }
        }
    };
}

table! {
    Add => real::ADD;
    Sub => real::SUB;
    Mul => real::MUL;
    Div => real::DIV;
    Neg => real::NEG;
    Sqrt => real::SQRT;
    InverseSqrt => real::INVERSE_SQRT;
    Abs => real::ABS;
    Min => real::MIN;
    Max => real::MAX;
    Fract => real::FRACT;
    Mod => real::MOD;
    Floor => real::FLOOR;
    Ceil => real::CEIL;
    Trunc => real::TRUNC;
    Round => real::ROUND;
    Sign => real::SIGN;
    Length2 => real::LENGTH2;
    Length3 => real::LENGTH3;
    Length4 => real::LENGTH4;
    Unit => real::UNIT;
    Exp => transcendental::EXP;
    Exp2 => transcendental::EXP2;
    Log => transcendental::LOG;
    Log2 => transcendental::LOG2;
    Pow => transcendental::POW;
    Sin => transcendental::SIN;
    Cos => transcendental::COS;
    Tan => transcendental::TAN;
    Asin => transcendental::ASIN;
    Acos => transcendental::ACOS;
    Atan => transcendental::ATAN;
    Atan2 => transcendental::ATAN2;
    Sinh => transcendental::SINH;
    Cosh => transcendental::COSH;
    Tanh => transcendental::TANH;
    Asinh => transcendental::ASINH;
    Acosh => transcendental::ACOSH;
    Atanh => transcendental::ATANH;
    Softplus => smooth::SOFTPLUS;
    Sigmoid => smooth::SIGMOID;
    Rounded => directed::ROUNDED;
    NextDown => directed::NEXT_DOWN;
    NextUp => directed::NEXT_UP;
    AddDown => directed::ADD_DOWN;
    AddUp => directed::ADD_UP;
    MulDown => directed::MUL_DOWN;
    MulUp => directed::MUL_UP;
    DivDown => directed::DIV_DOWN;
    DivUp => directed::DIV_UP;
    SqrtDown => directed::SQRT_DOWN;
    SqrtUp => directed::SQRT_UP;
    Above => directed::ABOVE;
    Below => directed::BELOW;
    Raised => directed::RAISED;
    Lowered => directed::LOWERED;
    ProductBelow => directed::PRODUCT_BELOW;
    WideProductBelow => directed::WIDE_PRODUCT_BELOW;
    WideProductAbove => directed::WIDE_PRODUCT_ABOVE;
    Copysign => bits::COPYSIGN;
    Exponent => bits::EXPONENT;
    Scale => bits::SCALE;
    Lt => truth::LT;
    Le => truth::LE;
    Eq => truth::EQ;
    Ne => truth::NE;
    And => truth::AND;
    Or => truth::OR;
    Not => truth::NOT;
    Select => truth::SELECT;
    SelectInt => truth::SELECT_INT;
    SelectBool => truth::SELECT_BOOL;
    IntAdd => int::ADD;
    IntSub => int::SUB;
    IntMul => int::MUL;
    IntDiv => int::DIV;
    IntRem => int::REM;
    IntNeg => int::NEG;
    IntAbs => int::ABS;
    IntMin => int::MIN;
    IntMax => int::MAX;
    IntSign => int::SIGN;
    IntEq => int::EQ;
    IntLt => int::LT;
    IntLe => int::LE;
    IntToReal => int::TO_REAL;
    RealToInt => int::FROM_REAL;
}

impl Op {
    /// Whether it means nothing for some operands. Only the fragments of directed rounding take such steps, and never
    /// give them those.
    #[must_use]
    pub const fn is_partial(self) -> bool {
        matches!(self, Self::Above | Self::Below | Self::Raised | Self::Lowered)
    }
}

impl fmt::Display for Op {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.def().name)
    }
}

/// Everything that is known of an operation. No field is optional. Cloned only to alter a rule and see that the laws
/// notice.
#[derive(Debug, Clone)]
pub struct OpDef {
    /// Its name in the text form.
    pub name: &'static str,
    /// Kinds of its operands, at most four.
    pub operands: &'static [Scalar],
    /// Kind of its result.
    pub result: Scalar,
    /// Its meaning in operands a, b, c, d.
    pub formula: &'static str,
    /// Whether exchanging a and b preserves the bits of the result.
    pub commutes: bool,
    /// Reference evaluation. Transcendental functions use the host's mathematical library here, so this serves
    /// oracles; constants are computed by [`constant`].
    pub eval: Eval,
    /// How the result changes with the operands.
    pub derivative: Derivative,
    /// Where it is not differentiable.
    pub kink: Kink,
    /// Operands worth testing: a closed range each (ints and bools too: rounded, `≥ 1` is true).
    pub domain: &'static [(f64, f64)],
    /// The error promised.
    pub accuracy: Accuracy,
    /// What encloses the result.
    pub enclosure: EnclosureRule,
    /// Time in units of an addition.
    pub cost: u32,
    /// How a target computes it.
    pub lowering: Lowering,
}

/// Reference evaluation in both precisions. Operands of other kinds than declared give NaN, 0 or false.
#[derive(Debug, Clone)]
pub struct Eval {
    /// In f64.
    pub f64: fn(&[Value]) -> Value,
    /// In f32: operands and result are f32 numbers held in f64.
    pub f32: fn(&[Value]) -> Value,
}

impl Eval {
    /// In the given precision.
    #[must_use]
    pub fn at(&self, precision: Precision) -> fn(&[Value]) -> Value {
        match precision {
            Precision::F32 => self.f32,
            Precision::F64 => self.f64,
        }
    }
}

/// A rule in graph operations: the builder, the operands, the result.
pub type Rule = fn(&mut Builder<'_>, &[NodeId], NodeId) -> NodeId;

/// What encloses the result, in graph operations: the builder, what encloses the operands (tidy), and what else is
/// known of them (LANGUAGE 15.4 to 15.6).
pub type EnclosureRule = fn(&mut Builder<'_>, &[Enclosure], Facts) -> Enclosure;

/// How the result changes with the operands. One rule serves forward and reverse mode and, being written in the
/// same operations, every higher order.
#[derive(Debug, Clone)]
pub enum Derivative {
    /// It does not: the result is an int or bool, or piecewise constant.
    Zero,
    /// The partial derivative by each operand; `Partial::Zero` for ints and bools.
    Partials(&'static [Partial]),
    /// The result is one of two operands, and so is the derivative; the other contributes nothing, not even a
    /// product with 0 (LANGUAGE 13.7).
    Choice {
        /// Builds the condition.
        cond: fn(&mut Builder<'_>, &[NodeId]) -> NodeId,
        /// Index of the operand chosen if it holds.
        then: usize,
        /// Index of the operand chosen otherwise.
        otherwise: usize,
    },
}

/// One partial derivative.
#[derive(Debug, Clone)]
pub enum Partial {
    /// 0, structurally.
    Zero,
    /// 1.
    One,
    /// −1.
    MinusOne,
    /// By a rule.
    Of(Rule),
}

/// The error promised on the domain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accuracy {
    /// The result of the formula with each operation rounded on its own, bit for bit (LANGUAGE 17.2).
    Exact,
    /// The number of `real` next to the exact result on one side. Constants too are computed in `real`: an end that is
    /// rounded twice may lie inside of what it encloses.
    Directed,
    /// At most so many units in the last place from the exact result (LANGUAGE 17.4).
    Ulp {
        /// In f32.
        f32: u32,
        /// In f64.
        f64: u32,
    },
}

/// How a target computes an operation.
#[derive(Debug, Clone)]
pub enum Lowering {
    /// By instructions, as stack programs: `a b c d` push operands. For WebAssembly `i32:N` and `i64:N` push a constant in
    /// every lane, `low32` packs the low halves of 64-bit lanes into the low two 32-bit lanes, `NAME:N` is an instruction
    /// with an immediate, all else is an instruction. Reals are f32x4 or f64x2, ints i32x4 (in f64 modules the low two
    /// lanes), bools masks as wide as reals.
    Instructions {
        /// In WebAssembly of f32.
        f32x4: &'static str,
        /// In WebAssembly of f64.
        f64x2: &'static str,
        /// In shaders.
        shader: Shader,
    },
    /// By other operations on every target.
    Fragment(Fragment),
}

/// How shaders compute an operation that has instructions in WebAssembly.
#[derive(Debug, Clone)]
pub enum Shader {
    /// By instructions on scalars, as stack programs: `a b c d` push operands, `i:N` an int, `r:X` a real, `w:N` an int as
    /// wide as a real, `bits` makes that of a real and `real` a real of it, all else is an instruction that the shader
    /// emitters declare.
    Scalar {
        /// In f32 modules.
        f32: &'static str,
        /// In f64 modules.
        f64: &'static str,
    },
    /// By other operations: they have no f64 beside f32.
    Fragment(Fragment),
}

/// A graph that computes an operation, which the `kernels` step puts in its place. Fragments may contain operations that
/// have fragments themselves.
pub type Fragment = fn(&mut Builder<'_>, &[NodeId], Precision) -> NodeId;

/// Targets that have the same instructions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// WebAssembly with lanes.
    Lanes,
    /// SPIR-V and WGSL.
    Shader,
}

impl Family {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Lanes, Self::Shader];
}

impl OpDef {
    /// What computes it on a family of targets that has no instructions for it.
    #[must_use]
    pub const fn fragment(&self, family: Family) -> Option<Fragment> {
        match (&self.lowering, family) {
            (Lowering::Fragment(fragment), _)
            | (Lowering::Instructions { shader: Shader::Fragment(fragment), .. }, Family::Shader) => Some(*fragment),
            (Lowering::Instructions { .. }, _) => None,
        }
    }
}

/// One program for both precisions.
const fn scalar(text: &'static str) -> Shader {
    Shader::Scalar { f32: text, f64: text }
}

/// The value of an operation on constants, as every target computes it: by its fragment if it has one.
/// `None` if the operands do not fit.
#[must_use]
pub fn constant(op: Op, args: &[Value], precision: Precision) -> Option<Value> {
    let def = op.def();
    if args.len() != def.operands.len() || args.iter().zip(def.operands).any(|(a, s)| a.scalar() != *s) {
        return None;
    }
    match def.lowering {
        Lowering::Instructions { .. } => Some((def.eval.at(precision))(args)),
        Lowering::Fragment(fragment) => {
            let mut builder = Builder::new(Mode::Real(precision), 100_000, &Unwatched);
            let nodes: Vec<NodeId> = args.iter().map(|v| builder.constant(*v)).collect();
            let result = fragment(&mut builder, &nodes, precision);
            builder.value(result)
        }
    }
}

const R: Scalar = Scalar::Real;
const I: Scalar = Scalar::Int;
const B: Scalar = Scalar::Bool;

/// `eval!(|x: Real, n: Int| -> Real { … })`: one formula, evaluated in f64 and in f32.
macro_rules! eval {
    (|$($x:ident : $k:ident),+| -> $r:ident $body:block) => {
        $crate::ops::Eval {
            f64: |v| {
                #[allow(dead_code, reason = "some formulas name the type")]
                type F = f64;
                match v {
                    [$($crate::Value::$k($x)),+] => { $(let $x = eval!(@in64 $k $x);)+ eval!(@out64 $r $body) }
                    _ => eval!(@bad $r),
                }
            },
            f32: |v| {
                #[allow(dead_code, reason = "some formulas name the type")]
                type F = f32;
                match v {
                    [$($crate::Value::$k($x)),+] => { $(let $x = eval!(@in32 $k $x);)+ eval!(@out32 $r $body) }
                    _ => eval!(@bad $r),
                }
            },
        }
    };
    (@in64 $k:ident $x:ident) => { *$x };
    (@in32 Real $x:ident) => { *$x as f32 };
    (@in32 $k:ident $x:ident) => { *$x };
    (@out64 $r:ident $body:block) => { $crate::Value::$r($body) };
    (@out32 Real $body:block) => { $crate::Value::Real(f64::from($body)) };
    (@out32 $r:ident $body:block) => { $crate::Value::$r($body) };
    (@bad Real) => { $crate::Value::Real(f64::NAN) };
    (@bad Int) => { $crate::Value::Int(0) };
    (@bad Bool) => { $crate::Value::Bool(false) };
}

/// `rule!(|b, [x, y], r| …)`: a [`Rule`]; operands that do not fit give the result itself.
macro_rules! rule {
    (|$b:ident, [$($x:ident),+]| $body:expr) => { $crate::ops::rule!(|$b, [$($x),+], r| { let _ = r; $body }) };
    (|$b:ident, [$($x:ident),+], $r:ident| $body:expr) => {
        $crate::ops::Partial::Of(|$b, args, $r| match *args { [$($x),+] => $body, _ => $r })
    };
}

/// `fragment!(|b, [x], p| …)`: a lowering by a fragment.
macro_rules! fragment {
    (|$b:ident, [$($x:ident),+], $p:ident| $body:expr) => {
        $crate::ops::Lowering::Fragment(|$b, args, $p| match *args { [$($x),+] => $body, _ => $crate::NodeId::NONE })
    };
}

/// `shader!(|b, [x], p| …)`: a lowering by a fragment in shaders alone.
macro_rules! shader {
    (|$b:ident, [$($x:ident),+], $p:ident| $body:expr) => {
        $crate::ops::Shader::Fragment(|$b, args, $p| match *args { [$($x),+] => $body, _ => $crate::NodeId::NONE })
    };
}

pub(crate) use {eval, fragment, rule, shader};

#[cfg(test)]
mod tests;
