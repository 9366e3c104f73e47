//! The typed program: what elaboration reads. Names are resolved to ids and slots, types are known, and each body
//! is linear stack code, so that nothing downstream recurses over a program. Knows nothing of graphs.

use std::collections::BTreeSet;

use isograd_syntax::Span;
use rustc_hash::FxHashMap;

use crate::{Builtin, Type};

macro_rules! id {
    ($(#[doc = $doc:literal] $name:ident;)+) => { $(
        #[doc = $doc]
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u32);
    )+ };
}

id! {
    /// A concept of a [`Program`].
    ConceptId;
    /// An entity or operation of a [`Program`].
    DefinitionId;
    /// An impl of a [`Program`].
    ImplId;
    /// A function of a [`Program`].
    FunctionId;
    /// A local variable of a [`Code`].
    Slot;
}

/// A checked program with its libraries. Everything in it is well typed; what remains to be found out per export
/// (missing impls, csg cycles, csg loop bounds, derivative order, limits) needs specialisation.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Program {
    /// Concepts.
    pub concepts: Vec<Concept>,
    /// Entities and operations.
    pub definitions: Vec<Definition>,
    /// Impls.
    pub impls: Vec<Impl>,
    /// The impl of a definition for a concept.
    pub impl_of: FxHashMap<(DefinitionId, ConceptId), ImplId>,
    /// Functions.
    pub functions: Vec<Function>,
    /// The exported functions of the program, in source order.
    pub exports: Vec<FunctionId>,
    /// What has errors, if there are any.
    pub unsound: Unsound,
}

/// What has errors and must not be elaborated. Empty in a program without errors.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Unsound {
    /// Functions with an error in their head or body.
    pub functions: BTreeSet<FunctionId>,
    /// Definitions whose declaration has an error.
    pub definitions: BTreeSet<DefinitionId>,
    /// Concepts whose declaration has an error.
    pub concepts: BTreeSet<ConceptId>,
    /// Impls with an error in their head or body.
    pub impls: BTreeSet<ImplId>,
    /// Impls that exist in the source but not here, as far as node and concept are known.
    pub lost_impls: Vec<(Option<DefinitionId>, Option<ConceptId>)>,
}

/// `concept C: S -> T;`
#[derive(Debug, Clone, PartialEq)]
pub struct Concept {
    /// Its name.
    pub name: String,
    /// S; the empty tuple if the concept has no source.
    pub source: Type,
    /// T.
    pub target: Type,
    /// Its declaration.
    pub span: Span,
}

/// `entity N(args);` or `operation N(args);`
#[derive(Debug, Clone, PartialEq)]
pub struct Definition {
    /// Its name.
    pub name: String,
    /// Whether it is an operation.
    pub operation: bool,
    /// Names and types of its arguments.
    pub params: Vec<Param>,
    /// `#[define(no_identity)]` (LANGUAGE 12.3).
    pub no_identity: bool,
    /// Its declaration.
    pub span: Span,
}

/// A parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Param {
    /// Its name.
    pub name: String,
    /// Its type.
    pub ty: Type,
    /// Its default (LANGUAGE 9.3); parameters of exports only, like the range.
    pub default: Option<Constant>,
    /// The ends of its range.
    pub range: Option<(Constant, Constant)>,
}

impl Param {
    /// A parameter without default and range.
    #[must_use]
    pub const fn new(name: String, ty: Type) -> Self {
        Self { name, ty, default: None, range: None }
    }
}

/// A constant expression: its code has no slots, brackets, calls and nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Constant {
    /// Leaves its value.
    pub code: Code,
    /// Its type.
    pub ty: Type,
    /// Where it is written.
    pub span: Span,
}

/// `impl N<operands> for C(p) { … }`. The first slots of its code hold, in this order, the concept's argument(s)
/// (one slot; in the \[24\] form with several names one per tuple element), the definition's arguments, the operands.
#[derive(Debug, Clone, PartialEq)]
pub struct Impl {
    /// The node.
    pub definition: DefinitionId,
    /// The concept.
    pub concept: ConceptId,
    /// Number of slots that share the concept's source: 1, or one per tuple element.
    pub sources: u32,
    /// Number of operands.
    pub operands: u32,
    /// The body; leaves one value of the concept's target type.
    pub code: Code,
    /// The head, for diagnostics.
    pub span: Span,
}

/// `fn name(params) -> R { … }`. The first slots of its code hold the parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Function {
    /// Its name.
    pub name: String,
    /// Parameters.
    pub params: Vec<Param>,
    /// The result's type.
    pub result: Type,
    /// Documentation.
    pub doc: Option<String>,
    /// The body; leaves one value of the result's type.
    pub code: Code,
    /// The head, for diagnostics.
    pub span: Span,
}

/// A body: linear code for a machine with a stack of values and numbered slots. A value is a list of scalars
/// (flattened as in LANGUAGE 9.2, with the flags of intervals: [`Type::width`]) or one csg tree. Every instruction has the span it was written at.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Code {
    /// Every local variable, parameters first.
    pub slots: Vec<Local>,
    /// The instructions with their places.
    pub instructions: Vec<(Instruction, Span)>,
}

/// A local variable. One slot has one type; an assignment that changes the type gets a slot of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Local {
    /// Its name as written.
    pub name: String,
    /// Its type.
    pub ty: Type,
}

/// One instruction. "Pops a, b" means that b is on top.
#[derive(Debug, Clone, PartialEq)]
pub enum Instruction {
    /// Pushes an int literal.
    Int(i32),
    /// Pushes a real literal.
    Real(f64),
    /// Pushes a truth literal.
    Bool(bool),
    /// Pushes the value of a slot.
    Load(Slot),
    /// Pops a value and binds it to a slot (`let`, `csg`, assignment): an unnamed constant becomes a value of its
    /// own here (LANGUAGE 13.3.4).
    Store(Slot),
    /// Pops a value that nobody uses.
    Drop,
    /// Pops n values of scalars, pushes one with all their scalars in order (tuple, list).
    Pack(u32),
    /// Pops a value, pushes it repeated n times (`[e; n]`).
    Splat(u32),
    /// Pops a value, pushes `length` of its scalars from `offset` on (component access).
    Pick {
        /// First scalar.
        offset: u32,
        /// How many.
        length: u32,
    },
    /// Pops a value of type `from`, pushes it as `to`, which differs (LANGUAGE 3.4).
    Cast {
        /// From.
        from: Type,
        /// To.
        to: Type,
    },
    /// Pops a, pushes `-a` (a of type `ty`).
    Neg(Type),
    /// Pops a bool, pushes its negation.
    Not,
    /// Pops a, b, pushes `a op b` (LANGUAGE 4.1), both sides' types given.
    Binary {
        /// The operator.
        op: isograd_syntax::tree::BinaryOp,
        /// The type of a. If only one side is an interval, the other one is read as an interval of one point
        /// (LANGUAGE 4.2).
        left: Type,
        /// The type of b.
        right: Type,
    },
    /// Pops lo, hi, both of this type, pushes the interval (LANGUAGE 3.5).
    Interval(Type),
    /// Pops n intervals of reals, pushes the interval of the vectors of their ends (a list).
    PackIntervals(u32),
    /// Pops an interval of reals, pushes the interval of the vectors of n times its ends (`[i; n]`).
    SplatInterval(u32),
    /// Pops an interval, pushes its lower or upper end.
    End {
        /// The type of the end.
        ty: Type,
        /// Whether it is the upper one.
        upper: bool,
    },
    /// Pops an interval, pushes the interval of `length` scalars of each end from `offset` on (component access).
    PickInterval {
        /// Scalars of one end.
        ends: u32,
        /// First scalar of an end.
        offset: u32,
        /// How many.
        length: u32,
    },
    /// Pops an interval, pushes whether it may be NaN (LANGUAGE 15.6).
    MayBeNan,
    /// Pops the arguments, pushes the built-in's value (LANGUAGE 5). `diff` and `bound` are instructions of their
    /// own. If one argument is an interval, all are.
    Builtin {
        /// Which.
        builtin: Builtin,
        /// The arguments' types.
        args: Vec<Type>,
    },
    /// Pops e, wrt, pushes the derivative with one scalar per pair: for each scalar of wrt, for each of e
    /// (LANGUAGE 13.1).
    Diff,
    /// Pops e, dyn, iv, pushes the enclosure of e with iv in the place of dyn (LANGUAGE 15.3).
    Bound {
        /// The type of e.
        value: Type,
        /// The type of dyn and of the ends of iv.
        by: Type,
    },
    /// Pops the arguments, calls, pushes the result. Passing binds as `Store` does.
    Call(FunctionId),
    /// Pops the definition's arguments, then `subtrees` csg values, pushes a csg node.
    Node {
        /// The entity or operation.
        definition: DefinitionId,
        /// How many subtrees.
        subtrees: u32,
    },
    /// Pops a csg value and one value of the concept's source type (nothing for a concept without source), pushes
    /// the target's value.
    Eval {
        /// The concept.
        concept: ConceptId,
        /// False if the value cannot influence a result: it is not specialised, and a value of zeros is pushed
        /// (LANGUAGE 12.4).
        live: bool,
    },
    /// Pops a bool. What follows up to the matching `Else` runs if it is true, then up to `EndIf` otherwise.
    If(Branch),
    /// Between the sides of an `If`; every `If` has one.
    Else,
    /// Ends an `If`: each side has left one value if `value`.
    EndIf,
    /// Pops lo, hi; runs up to the matching `EndFor` with the counter from lo to hi − 1.
    For(Loop),
    /// Ends a `For`.
    EndFor,
    /// Starts a value block of a scoped call: writes to these outer slots end with it (LANGUAGE 6.5).
    Block {
        /// Outer slots written inside.
        restores: Vec<Slot>,
    },
    /// Ends a `Block`; its value is on the stack.
    EndBlock,
}

/// The facts of an `if`.
#[derive(Debug, Clone, PartialEq)]
pub struct Branch {
    /// Whether each side leaves a value, and its type.
    pub value: Option<Type>,
    /// Outer slots written on some side whose new content is seen afterwards (statement form).
    pub writes: Vec<Slot>,
    /// Outer slots written on some side whose old content comes back afterwards (value form).
    pub restores: Vec<Slot>,
}

/// The facts of a `for`.
#[derive(Debug, Clone, PartialEq)]
pub struct Loop {
    /// The counter.
    pub counter: Slot,
    /// Outer slots written in the body. If one is csg, the loop is a csg loop and is unrolled (LANGUAGE 11.7).
    pub writes: Vec<Slot>,
}
