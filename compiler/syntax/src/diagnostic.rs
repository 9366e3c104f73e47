//! Diagnostics as data: code, severity, message, labelled spans, notes and help. Renderers are elsewhere.

use crate::Span;

macro_rules! codes {
    ($( $code:ident $title:literal; )+) => {
        /// Every diagnostic of the language (LANGUAGE 19). Codes are stable.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Code { $( #[doc = $title] $code, )+ }

        impl Code {
            /// All codes, in order.
            pub const ALL: &'static [Self] = &[ $( Self::$code, )+ ];

            /// The code as written, `E0401`.
            #[must_use]
            pub const fn name(self) -> &'static str { match self { $( Self::$code => stringify!($code), )+ } }

            /// What it is about, in a few words.
            #[must_use]
            pub const fn title(self) -> &'static str { match self { $( Self::$code => $title, )+ } }
        }
    };
}

codes! {
    E0101 "not UTF-8";
    E0102 "character that starts no token";
    E0103 "malformed number";
    E0104 "int literal too large";
    E0201 "unexpected token";
    E0202 "bracket or block not closed";
    E0203 "splat count that is no integer literal";
    E0204 "keyword used as a name";
    E0205 "empty list or one-element tuple";
    E0206 "eval of something that is no name";
    E0207 "assignment to a component";
    E0301 "name not found";
    E0302 "defined twice";
    E0303 "call of something that is no function";
    E0304 "name declared by two libraries";
    E0305 "program concept differs from the library's";
    E0306 "unknown library";
    E0307 "module file not found";
    E0308 "malformed module path";
    E0401 "operator with these operands";
    E0402 "wrong number of arguments";
    E0403 "argument of the wrong type";
    E0404 "shapes of a matrix product do not fit";
    E0405 "element that cannot be in a list";
    E0406 "list of the wrong size";
    E0407 "unknown field or index out of range";
    E0408 "cast not defined";
    E0409 "value has not the declared type";
    E0410 "type not supported";
    E0411 "ends of an interval differ";
    E0412 "variable changes its type in a branch or loop";
    E0501 "condition that is no bool";
    E0502 "branches yield different types";
    E0503 "if used as a value without else";
    E0504 "loop bound that is no int";
    E0505 "block without the value it needs";
    E0506 "recursion";
    E0507 "loop expression assigns an outer variable";
    E0601 "csg binding of a value that is no csg";
    E0602 "let binding of a csg value";
    E0603 "csg where it may not stand";
    E0604 "blocks after a name that is no operation";
    E0605 "no impl for the concept";
    E0606 "number of subtrees differs from the operands";
    E0607 "cycle of impls";
    E0608 "csg loop with bounds that are not constant";
    E0609 "eval of a value that is no csg";
    E0610 "second impl for the same node and concept";
    E0611 "impl of the wrong form";
    E0701 "diff of something not differentiable";
    E0702 "diff with respect to something that is no variable";
    E0705 "diff in a loop whose order would grow";
    E0901 "csg in the signature of an export";
    E1001 "source file too large";
    E1002 "sources too large";
    E1003 "too many modules";
    E1004 "nested too deeply";
    E1005 "csg tree too deep";
    E1006 "too many unrolled iterations";
    E1007 "graph too large";
    E1008 "derivative too large";
    E1009 "derivative order too high";
    E1010 "too many parameters or results";
    E1011 "compilation took too long";
    E1012 "too many diagnostics";
    E1101 "not yet supported";
    E1102 "bad request";
    E1103 "error of the compiler";
    W0301 "declaration hides one of a library";
    W0302 "function has the name of a core built-in";
    W0401 "cast of a type to itself";
    W0402 "assignment changes the type of a variable";
    W0403 "int division by the constant 0";
    W0501 "value dropped";
    W0502 "write that is lost";
    W0601 "eval whose value is not used";
    W0602 "csg loop unrolled many times";
    W0603 "outdated form";
    W0701 "derivative is always 0";
    W0901 "unknown attribute";
}

/// How bad it is. An error stops the compilation at the end of the phase; a warning does not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// The program does not compile.
    Error,
    /// The program compiles; something in it is probably not meant.
    Warning,
}

impl Code {
    /// Errors start with E, warnings with W.
    #[must_use]
    pub fn severity(self) -> Severity {
        if self.name().starts_with('W') { Severity::Warning } else { Severity::Error }
    }
}

/// A place and what is to be said about it.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Label {
    /// The place.
    pub span: Span,
    /// What is there; may be empty.
    pub text: String,
}

/// One diagnostic. The first label is the primary place; a diagnostic about no place has none.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Diagnostic {
    /// What kind of mistake.
    pub code: Code,
    /// The mistake in the user's terms, one sentence without a final stop.
    pub message: String,
    /// Places, the primary one first.
    pub labels: Vec<Label>,
    /// Why, where that is not obvious; the chain of calls, evals or imports that led here.
    pub notes: Vec<String>,
    /// What to do about it.
    pub help: Option<String>,
}

impl Diagnostic {
    /// A diagnostic at `span`.
    pub fn new(code: Code, span: Span, message: impl Into<String>) -> Self {
        Self { labels: vec![Label { span, text: String::new() }], ..Self::global(code, message) }
    }

    /// A diagnostic about no particular place.
    pub fn global(code: Code, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), labels: Vec::new(), notes: Vec::new(), help: None }
    }

    /// Says what is at the primary place.
    #[must_use]
    pub fn here(mut self, text: impl Into<String>) -> Self {
        if let Some(label) = self.labels.first_mut() {
            label.text = text.into();
        }
        self
    }

    /// Adds a place.
    #[must_use]
    pub fn label(mut self, span: Span, text: impl Into<String>) -> Self {
        self.labels.push(Label { span, text: text.into() });
        self
    }

    /// Adds a note.
    #[must_use]
    pub fn note(mut self, text: impl Into<String>) -> Self {
        self.notes.push(text.into());
        self
    }

    /// Says what to do.
    #[must_use]
    pub fn help(mut self, text: impl Into<String>) -> Self {
        self.help = Some(text.into());
        self
    }

    /// Whether it stops the compilation.
    #[must_use]
    pub fn is_error(&self) -> bool {
        self.code.severity() == Severity::Error
    }
}
