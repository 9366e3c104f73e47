//! Diagnostics as data: code, severity, message, labelled spans, notes and help. Renderers are elsewhere.

use std::fmt;
use std::str::FromStr;

use crate::Span;

macro_rules! codes {
    ($dollar:tt $( $code:ident $title:literal; )+) => {
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

        /// Calls the macro `with` on the names of all codes, so that another crate can hold something for each of
        /// them and does not compile while one is missing.
        #[macro_export]
        macro_rules! for_each_code {
            ($dollar with:ident) => { $dollar with! { $( $code )+ } };
        }
    };
}

codes! {
    $
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
    E0703 "operation with a kink on the way of a derivative, in the mode strict";
    E0704 "branch on the way of a derivative, in the mode strict";
    E0705 "diff in a loop whose order would grow";
    E0801 "bound of something that has no enclosure";
    E0802 "variable and interval of bound do not fit";
    E0803 "third argument of bound is no interval";
    E0804 "operation that intervals do not have";
    E0805 "loop bound depends on what bound replaces";
    E0901 "csg in the signature of an export";
    E0902 "default or range that is not constant";
    E0903 "range reversed or default outside it";
    E0904 "default or range where none is allowed";
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
    E1101 "target that cannot do this";
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
    W0702 "jump that the mode smooth keeps";
    W0801 "constant interval with start > end";
    W0901 "unknown attribute";
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A text that is no code.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownCode {
    /// The text.
    pub text: String,
    /// The codes whose numbers are nearest to its number, the nearest first; none if it has no number.
    pub near: Vec<Code>,
}

impl fmt::Display for UnknownCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "there is no diagnostic `{}`", self.text)?;
        let near: Vec<&str> = self.near.iter().map(|c| c.name()).collect();
        match near.as_slice() {
            [] => f.write_str(": a code is E or W and four digits, `E0401`"),
            [one] => write!(f, ": near it is {one}"),
            [first @ .., last] => write!(f, ": near it are {} and {last}", first.join(", ")),
        }
    }
}

impl std::error::Error for UnknownCode {}

/// How many codes [`UnknownCode`] proposes, and how far their numbers may be away.
const NEAR: (usize, u32) = (3, 100);

impl FromStr for Code {
    type Err = UnknownCode;

    /// Upper and lower case are the same.
    fn from_str(text: &str) -> Result<Self, UnknownCode> {
        let text = text.trim();
        if let Some(code) = Self::ALL.iter().find(|c| c.name().eq_ignore_ascii_case(text)) {
            return Ok(*code);
        }
        let digits = text.trim_start_matches(|c: char| c.is_ascii_alphabetic());
        let wanted = Some(digits).filter(|d| text.len() - d.len() <= 1).and_then(|d| d.parse::<u32>().ok());
        let letter = text.chars().next().map(|c| c.to_ascii_uppercase());
        let mut near: Vec<_> = Self::ALL
            .iter()
            .filter_map(|&code| {
                let number = code.name().get(1..)?.parse::<u32>().ok()?;
                let away = number.abs_diff(wanted?);
                (away <= NEAR.1).then_some((away, code.name().chars().next() != letter, code))
            })
            .collect();
        near.sort_unstable();
        let near = near.into_iter().take(NEAR.0).map(|(_, _, code)| code).collect();
        Err(UnknownCode { text: text.to_owned(), near })
    }
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

#[cfg(test)]
mod tests {
    use super::Code;

    #[test]
    fn codes_are_read_in_any_case() {
        for code in Code::ALL {
            assert_eq!(code.name().parse(), Ok(*code));
            assert_eq!(format!(" {} ", code.name().to_lowercase()).parse(), Ok(*code));
        }
    }

    #[test]
    fn an_unknown_code_names_near_ones() {
        let near = |text: &str| text.parse::<Code>().unwrap_err().to_string();
        assert_eq!(near("e0400"), "there is no diagnostic `e0400`: near it are E0401, W0401 and E0402");
        assert_eq!(near("W0413"), "there is no diagnostic `W0413`: near it are E0412, E0411 and E0410");
        assert_eq!(near("401"), "there is no diagnostic `401`: near it are E0401, W0401 and E0402");
        assert_eq!(near("E9999"), "there is no diagnostic `E9999`: a code is E or W and four digits, `E0401`");
        assert_eq!(near("type"), "there is no diagnostic `type`: a code is E or W and four digits, `E0401`");
        assert_eq!(near("É0401"), "there is no diagnostic `É0401`: a code is E or W and four digits, `E0401`");
    }
}
