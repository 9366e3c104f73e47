//! The syntax tree (LANGUAGE 2), one per file. Nodes live in arenas in the order the parser finished them, so
//! children precede parents, nothing is dropped recursively, and long operator chains are flat data.
//! The tree knows shapes only: no name is resolved, no type is checked.

use crate::Span;

macro_rules! id {
    ($(#[doc = $doc:literal] $name:ident;)+) => { $(
        #[doc = $doc]
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub struct $name(pub u32);
    )+ };
}

id! {
    /// An expression of a [`Tree`].
    ExprId;
    /// A block of a [`Tree`].
    BlockId;
    /// A type of a [`Tree`].
    TypeId;
}

/// A name as written.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Ident {
    /// The characters.
    pub text: String,
    /// Where.
    pub span: Span,
}

/// One parsed file. Parsing never fails: what could not be read is [`ExprKind::Error`] or left out, and a
/// diagnostic says so.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tree {
    /// Items in source order.
    pub items: Vec<Item>,
    /// Expressions.
    pub exprs: Vec<Expr>,
    /// Blocks.
    pub blocks: Vec<Block>,
    /// Types.
    pub types: Vec<TypeExpr>,
    /// Names in text that was skipped inside of items, in source order: they may have been defined there.
    pub skipped: Vec<Ident>,
    /// Names in text that was skipped between items, likewise: they may have been declared there.
    pub lost: Vec<Ident>,
    /// Whether text was skipped that may be an import or declares something whose name could not be read: then any
    /// name may be declared there.
    pub incomplete: bool,
}

/// `#[name(args)]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Attribute {
    /// The name.
    pub name: Ident,
    /// The arguments.
    pub args: Vec<ExprId>,
    /// All of it.
    pub span: Span,
}

/// An item with what stands before it.
#[derive(Debug, Clone, PartialEq)]
pub struct Item {
    /// Doc comment, lines joined (LANGUAGE 1.3).
    pub doc: Option<String>,
    /// Attributes.
    pub attributes: Vec<Attribute>,
    /// What it is.
    pub kind: ItemKind,
    /// All of it, without doc comment and attributes.
    pub span: Span,
    /// What of it could not be read.
    pub faults: Faults,
}

/// Where an item has syntax errors, which decides what can still be said about it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Faults {
    /// In its parameters, operands or result: they may be incomplete.
    pub head: bool,
    /// Somewhere: values and statements may be missing.
    pub any: bool,
    /// In its brackets or blocks: what belongs into which scope is a guess.
    pub nesting: bool,
}

/// What an item is.
#[derive(Debug, Clone, PartialEq)]
pub enum ItemKind {
    /// `module a::b;`
    Module {
        /// The path's elements, at least one.
        path: Vec<Ident>,
    },
    /// `entity N(params);` or `operation N(params);`
    Definition {
        /// Whether it is an operation.
        operation: bool,
        /// Its name.
        name: Ident,
        /// Its arguments.
        params: Vec<Param>,
    },
    /// `concept C: S -> T;`
    Concept {
        /// Its name.
        name: Ident,
        /// The source; absent in the \[24\] form.
        source: Option<TypeId>,
        /// The target.
        target: TypeId,
    },
    /// `impl N<a, b> for C(p) { … }`
    Impl {
        /// The entity or operation.
        node: Ident,
        /// Operands.
        operands: Vec<Ident>,
        /// The concept.
        concept: Ident,
        /// The concept's arguments: one; several or none in \[24\] forms.
        args: Vec<Ident>,
        /// The body.
        body: BlockId,
    },
    /// `[export] fn name(params) -> R { … }`
    Function {
        /// Whether it is exported.
        export: bool,
        /// Its name.
        name: Ident,
        /// Parameters.
        params: Vec<Param>,
        /// The result's type; `None` in the \[24\] forms `export f(…) {…}` and `define f(…) {…}`.
        result: Option<TypeId>,
        /// Whether it is a \[24\] `define`.
        define: bool,
        /// The body.
        body: BlockId,
    },
}

/// `name: T = default in [lo .. hi]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Param {
    /// The name.
    pub name: Ident,
    /// The type.
    pub ty: TypeId,
    /// The default.
    pub default: Option<ExprId>,
    /// The range's ends.
    pub range: Option<(ExprId, ExprId)>,
}

/// A type as written.
#[derive(Debug, Clone, PartialEq)]
pub struct TypeExpr {
    /// What it is.
    pub kind: TypeKind,
    /// Where.
    pub span: Span,
}

/// What a type as written is.
#[derive(Debug, Clone, PartialEq)]
pub enum TypeKind {
    /// A word, with an element type if one was written: `real`, `vec3`, `vec2<int>`, `mat2x3`, `csg`. The parser
    /// accepts any word here; the checker knows which exist.
    Word {
        /// The word.
        name: String,
        /// The element type.
        element: Option<TypeId>,
    },
    /// `tensor<2, 3, …><real>`.
    Tensor,
    /// `interval<T>`.
    Interval(TypeId),
    /// `(T, U, …)`, at least two.
    Tuple(Vec<TypeId>),
    /// Could not be read; reported.
    Error,
}

/// `{ stmts value }`.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Statements.
    pub stmts: Vec<Stmt>,
    /// The final expression. A final `if` is parsed as a statement; who needs a value takes it (LANGUAGE 2.4).
    pub value: Option<ExprId>,
    /// With braces.
    pub span: Span,
}

/// A statement.
#[derive(Debug, Clone, PartialEq)]
pub struct Stmt {
    /// What it is.
    pub kind: StmtKind,
    /// All of it.
    pub span: Span,
}

/// What a statement is.
#[derive(Debug, Clone, PartialEq)]
pub enum StmtKind {
    /// `let x = e;` or `csg x = e;`
    Bind {
        /// Whether the word was `csg`.
        csg: bool,
        /// The name.
        name: Ident,
        /// The value.
        value: ExprId,
    },
    /// `x = e;`
    Assign {
        /// The name.
        name: Ident,
        /// The value.
        value: ExprId,
    },
    /// `for i in lo..hi { … }`
    For {
        /// The counter.
        counter: Ident,
        /// The first value.
        lo: ExprId,
        /// One past the last.
        hi: ExprId,
        /// The body.
        body: BlockId,
    },
    /// `if … {…} else …`: an expression of kind [`ExprKind::If`].
    If(ExprId),
    /// `e;`
    Expr(ExprId),
    /// `;`
    Empty,
}

/// An expression.
#[derive(Debug, Clone, PartialEq)]
pub struct Expr {
    /// What it is.
    pub kind: ExprKind,
    /// All of it, with parentheses if there are any.
    pub span: Span,
}

/// What an expression is.
#[derive(Debug, Clone, PartialEq)]
pub enum ExprKind {
    /// `12`
    Int(i32),
    /// `1.5`, also `INF`, `PI`, `EULER`
    Real(f64),
    /// `true`
    Bool(bool),
    /// `x`
    Name(String),
    /// `-e`, `!e`
    Unary {
        /// The operator.
        op: UnaryOp,
        /// The operand.
        operand: ExprId,
    },
    /// `a + b`
    Binary {
        /// The operator.
        op: BinaryOp,
        /// Where the operator stands.
        op_span: Span,
        /// The left operand.
        left: ExprId,
        /// The right operand.
        right: ExprId,
    },
    /// `e::<T>`
    Cast {
        /// The value.
        value: ExprId,
        /// The type.
        ty: TypeId,
    },
    /// `e.x`, `e.0`
    Access {
        /// The value.
        base: ExprId,
        /// The field or index as written.
        field: Ident,
    },
    /// `f(args)`, with blocks a scoped call.
    Call {
        /// What is called.
        callee: Ident,
        /// Arguments.
        args: Vec<ExprId>,
        /// Blocks.
        blocks: Vec<BlockId>,
    },
    /// `eval v.C(args)`
    Eval {
        /// The csg variable.
        tree: Ident,
        /// The concept.
        concept: Ident,
        /// Arguments.
        args: Vec<ExprId>,
        /// False in the \[24\] form without the word.
        word: bool,
    },
    /// `(a, b)`, at least two
    Tuple(Vec<ExprId>),
    /// `[a, b]`
    List(Vec<ExprId>),
    /// `[e; N]`
    Splat {
        /// The element.
        element: ExprId,
        /// How often.
        count: u32,
    },
    /// `[lo .. hi]`
    Interval {
        /// The lower end.
        lo: ExprId,
        /// The upper end.
        hi: ExprId,
    },
    /// `if c {…} else if d {…} else {…}`
    If {
        /// Conditions with their blocks, at least one.
        arms: Vec<(ExprId, BlockId)>,
        /// The last block.
        otherwise: Option<BlockId>,
    },
    /// `for v = init in lo..hi {…}` \[24\]
    Loop {
        /// The carried name.
        name: Ident,
        /// Its first value.
        init: ExprId,
        /// The first counter value.
        lo: ExprId,
        /// One past the last.
        hi: ExprId,
        /// The body.
        body: BlockId,
    },
    /// The beginning of something that could not be read to its end; reported. What it would have been is unknown.
    Partial(ExprId),
    /// Could not be read; reported.
    Error,
}

/// A prefix operator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum UnaryOp {
    /// `-`
    Neg,
    /// `!`
    Not,
}

/// A binary operator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BinaryOp {
    /// `+`
    Add,
    /// `-`
    Sub,
    /// `*`
    Mul,
    /// `/`
    Div,
    /// `%`
    Rem,
    /// `<`
    Lt,
    /// `>`
    Gt,
    /// `<=`
    Le,
    /// `>=`
    Ge,
    /// `==`
    Eq,
    /// `!=`
    Ne,
    /// `&&`
    And,
    /// `||`
    Or,
}

impl BinaryOp {
    /// As written.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Add => "+",
            Self::Sub => "-",
            Self::Mul => "*",
            Self::Div => "/",
            Self::Rem => "%",
            Self::Lt => "<",
            Self::Gt => ">",
            Self::Le => "<=",
            Self::Ge => ">=",
            Self::Eq => "==",
            Self::Ne => "!=",
            Self::And => "&&",
            Self::Or => "||",
        }
    }
}

impl UnaryOp {
    /// As written.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::Neg => "-",
            Self::Not => "!",
        }
    }
}
