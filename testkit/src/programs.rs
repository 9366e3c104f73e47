//! Structured programs: well-typed Vola text grown from a sequence of choices, so that a fuzzer's bytes, or a seed, reach
//! every construct behind the parser. Knows the typing rules of the language; knows nothing of what programs compute.

use std::fmt::Write as _;

use isograd_compiler::Type;

use crate::points::Random;

/// Where choices come from.
#[derive(Debug, Clone)]
pub enum Choices<'a> {
    /// Pseudo-random.
    Seeded(Random),
    /// A fuzzer's bytes, one per choice; when they run out, the first alternative.
    Bytes(&'a [u8]),
}

impl Choices<'_> {
    /// A number from 0 to `n` − 1.
    fn below(&mut self, n: usize) -> usize {
        match self {
            Self::Seeded(random) => random.below(n.max(1)),
            Self::Bytes(bytes) => match bytes.split_first() {
                Some((first, rest)) => {
                    *bytes = rest;
                    usize::from(*first) % n.max(1)
                }
                None => 0,
            },
        }
    }

    fn chance(&mut self, percent: usize) -> bool {
        self.below(100) < percent
    }
}

/// A program without errors, except that it may exceed a limit or nest derivatives in a loop (E0705). It has concepts,
/// entities, operations, impls, functions and two exports, `f` and `g`.
#[must_use]
pub fn program(choices: Choices<'_>) -> String {
    let mut gardener = Gardener {
        choices,
        text: String::new(),
        scopes: Vec::new(),
        functions: Vec::new(),
        concepts: Vec::new(),
        definitions: Vec::new(),
        operators: true,
        budget: 0,
        derivatives: 0,
        names: 0,
    };
    gardener.items();
    gardener.text
}

/// A variable in reach.
#[derive(Debug, Clone)]
struct Variable {
    name: String,
    ty: Type,
    /// Loop counters are not assigned, so that loops stay as long as they look.
    fixed: bool,
}

struct Gardener<'a> {
    choices: Choices<'a>,
    text: String,
    /// Innermost last.
    scopes: Vec<Vec<Variable>>,
    /// Name, parameters, result of the functions so far.
    functions: Vec<(String, Vec<Type>, Type)>,
    /// Name, source, target.
    concepts: Vec<(String, Type, Type)>,
    /// Name, parameters, number of operands.
    definitions: Vec<(String, Vec<Type>, usize)>,
    /// Whether csg nodes may be built: not in impls, which could build themselves.
    operators: bool,
    /// Expressions that may still be grown in this body.
    budget: usize,
    /// How many `diff` are open.
    derivatives: usize,
    names: usize,
}

const UNARY: &[&str] = &[
    "sqrt",
    "exp",
    "fract",
    "abs",
    "floor",
    "ceil",
    "round",
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "sinh",
    "cosh",
    "tanh",
    "asinh",
    "acosh",
    "atanh",
    "sign",
    "saturate",
    "trunc",
    "log",
    "log2",
    "exp2",
    "inversesqrt",
];
const BINARY: &[&str] = &["pow", "min", "max", "mod", "step"];
const TERNARY: &[&str] = &["clamp", "mix", "smoothstep", "lerp"];
const REALS: &[&str] = &["0.0", "1.0", "2.5", "0.1", "1e-3", "PI", "EULER", "INF", "1e30"];
const INTS: &[&str] = &["0", "1", "2", "3", "7", "2147483647"];

impl Gardener<'_> {
    fn items(&mut self) {
        for k in 0..1 + self.choices.below(2) {
            let (source, target) = (self.ty(1), self.ty(1));
            let _ = writeln!(self.text, "concept C{k}: {source} -> {target};");
            self.concepts.push((format!("C{k}"), source, target));
        }
        for k in 0..2 + self.choices.below(3) {
            // The first is an entity, so that there is always a leaf.
            let operands = if k == 0 { 0 } else { self.choices.below(3) };
            let params: Vec<Type> = (0..self.choices.below(3)).map(|_| self.ty(1)).collect();
            let list = params.iter().enumerate().map(|(i, t)| format!("a{i}: {t}")).collect::<Vec<_>>().join(", ");
            let word = if operands == 0 { "entity" } else { "operation" };
            let _ = writeln!(self.text, "{word} N{k}({list});");
            self.definitions.push((format!("N{k}"), params, operands));
        }
        for _ in 0..self.choices.below(3) {
            self.function(false);
        }
        self.operators = false;
        for (node, params, operands) in self.definitions.clone() {
            for (concept, source, target) in self.concepts.clone() {
                let subs: Vec<String> = (0..operands).map(|i| format!("sub{i}")).collect();
                let list = if subs.is_empty() { String::new() } else { format!("<{}>", subs.join(", ")) };
                let _ = write!(self.text, "impl {node}{list} for {concept}(p) ");
                let mut scope = vec![variable("p", &source)];
                scope.extend(params.iter().enumerate().map(|(i, t)| variable(&format!("a{i}"), t)));
                scope.extend(subs.iter().map(|s| variable(s, &Type::Csg)));
                self.body(scope, &target);
            }
        }
        self.operators = true;
        for _ in 0..self.choices.below(3) {
            self.function(false);
        }
        self.function(true);
        self.function(true);
    }

    fn function(&mut self, export: bool) {
        let name = if export {
            let exported = self.functions.iter().any(|(name, ..)| name == "f");
            if exported { "g".to_owned() } else { "f".to_owned() }
        } else {
            format!("h{}", self.functions.len())
        };
        let params: Vec<Type> = (0..1 + self.choices.below(3))
            .map(|_| if !export && self.choices.chance(15) { Type::Csg } else { self.ty(2) })
            .collect();
        let result = if !export && self.choices.chance(20) { Type::Csg } else { self.ty(2) };
        let list = params.iter().enumerate().map(|(i, t)| format!("p{i}: {t}")).collect::<Vec<_>>().join(", ");
        let word = if export { "export fn" } else { "fn" };
        let _ = write!(self.text, "{word} {name}({list}) -> {result} ");
        let scope = params.iter().enumerate().map(|(i, t)| variable(&format!("p{i}"), t)).collect();
        self.body(scope, &result);
        self.functions.push((name, params, result));
    }

    /// A type of values, with tuples up to a depth.
    fn ty(&mut self, depth: usize) -> Type {
        let extent = |c: &mut Choices<'_>| 2 + u8::try_from(c.below(3)).unwrap_or(0);
        match self.choices.below(if depth == 0 { 8 } else { 9 }) {
            0..=2 => Type::Real,
            3 => Type::Int,
            4 => Type::Bool,
            5 => Type::Vector(extent(&mut self.choices)),
            6 => match self.choices.below(2) {
                0 => Type::IntVector(extent(&mut self.choices)),
                _ => Type::Quat,
            },
            7 => Type::Matrix { columns: extent(&mut self.choices), rows: extent(&mut self.choices) },
            _ => Type::Tuple((0..2 + self.choices.below(2)).map(|_| self.ty(depth - 1)).collect()),
        }
    }

    fn body(&mut self, scope: Vec<Variable>, result: &Type) {
        self.budget = 60;
        self.names = 0;
        self.scopes.push(scope);
        self.text.push_str("{\n");
        for _ in 0..self.choices.below(5) {
            self.statement(2);
        }
        let value = self.expression(result, 3);
        let _ = writeln!(self.text, "{value}\n}}");
        self.scopes.clear();
    }

    fn statement(&mut self, depth: usize) {
        match self.choices.below(if depth == 0 { 3 } else { 6 }) {
            0 => {
                let ty = self.ty(1);
                self.binding("let", &ty);
            }
            // An entity's impl has no csg value at hand, and must not build a node.
            1 if self.operators || self.with(|t| *t == Type::Csg).is_some() => self.binding("csg", &Type::Csg),
            1 => {}
            2 | 3 => {
                let all: Vec<Variable> = self.in_reach().into_iter().filter(|v| !v.fixed).collect();
                if all.is_empty() {
                    return;
                }
                let target = all[self.choices.below(all.len())].clone();
                let value = self.expression(&target.ty, 2);
                let _ = writeln!(self.text, "{} = {value};", target.name);
            }
            4 => {
                let condition = self.expression(&Type::Bool, 1);
                let _ = writeln!(self.text, "if {condition} {{");
                self.nested(depth - 1);
                if self.choices.chance(60) {
                    self.text.push_str("} else {\n");
                    self.nested(depth - 1);
                }
                self.text.push_str("}\n");
            }
            _ => {
                let counter = self.name();
                let _ = writeln!(self.text, "for {counter} in 0..{} {{", self.choices.below(4));
                self.scopes.push(vec![Variable { fixed: true, ..variable(&counter, &Type::Int) }]);
                self.nested(depth - 1);
                self.scopes.pop();
                self.text.push_str("}\n");
            }
        }
    }

    fn nested(&mut self, depth: usize) {
        self.scopes.push(Vec::new());
        for _ in 0..1 + self.choices.below(2) {
            self.statement(depth);
        }
        self.scopes.pop();
    }

    /// `let` or `csg`, sometimes with a name of an outer scope, which it hides.
    fn binding(&mut self, word: &str, ty: &Type) {
        let value = self.expression(ty, 3);
        let fresh = self.name();
        let current: Vec<String> =
            self.scopes.last().map_or(Vec::new(), |s| s.iter().map(|v| v.name.clone()).collect());
        let outer: Vec<Variable> =
            self.in_reach().into_iter().filter(|v| !v.fixed && !current.contains(&v.name)).collect();
        let name = if !outer.is_empty() && self.choices.chance(20) {
            outer[self.choices.below(outer.len())].name.clone()
        } else {
            fresh
        };
        let _ = writeln!(self.text, "{word} {name} = {value};");
        if let Some(scope) = self.scopes.last_mut() {
            scope.push(variable(&name, ty));
        }
    }

    fn name(&mut self) -> String {
        self.names += 1;
        format!("v{}", self.names)
    }

    /// The variables in reach, hidden ones left out.
    fn in_reach(&self) -> Vec<Variable> {
        let mut seen: Vec<Variable> = Vec::new();
        for variable in self.scopes.iter().rev().flatten() {
            if !seen.iter().any(|v| v.name == variable.name) {
                seen.push(variable.clone());
            }
        }
        seen
    }

    fn with(&mut self, wanted: impl Fn(&Type) -> bool) -> Option<Variable> {
        let all: Vec<Variable> = self.in_reach().into_iter().filter(|v| wanted(&v.ty)).collect();
        (!all.is_empty()).then(|| all[self.choices.below(all.len())].clone())
    }

    /// An expression of a type. Everything that is no atom stands in parentheses or is a call.
    fn expression(&mut self, ty: &Type, depth: usize) -> String {
        if depth == 0 || self.budget == 0 {
            return self.atom(ty);
        }
        self.budget -= 1;
        let d = depth - 1;
        match self.choices.below(8) {
            0 | 1 => self.atom(ty),
            2 => self.branch(ty, d),
            3 => self.call(ty, d).unwrap_or_else(|| self.atom(ty)),
            4 => self.evaluation(ty, d).unwrap_or_else(|| self.atom(ty)),
            5 => self.derivative(ty, d).unwrap_or_else(|| self.atom(ty)),
            _ => self.operation(ty, d),
        }
    }

    /// A literal or a variable.
    fn atom(&mut self, ty: &Type) -> String {
        if self.choices.chance(70)
            && let Some(found) = self.with(|t| t == ty)
        {
            return found.name;
        }
        let pick = |c: &mut Choices<'_>, from: &[&str]| from[c.below(from.len())].to_owned();
        match ty {
            Type::Real => match self.with(|t| matches!(t, Type::Vector(_))) {
                Some(vector) if self.choices.chance(50) => format!("{}.x", vector.name),
                _ => pick(&mut self.choices, REALS),
            },
            Type::Int => pick(&mut self.choices, INTS),
            Type::Bool => pick(&mut self.choices, &["true", "false"]),
            Type::Vector(n) => format!("[{}; {n}]", self.atom(&Type::Real)),
            Type::IntVector(n) => format!("[{}; {n}]::<vec{n}<int>>", self.atom(&Type::Real)),
            Type::Matrix { columns, rows } => format!("[{}; {columns}]", self.atom(&Type::Vector(*rows))),
            Type::Quat => {
                let parts: Vec<String> = (0..4).map(|_| self.atom(&Type::Real)).collect();
                format!("quat({})", parts.join(", "))
            }
            Type::Tuple(elements) => {
                let parts: Vec<String> = elements.iter().map(|t| self.atom(t)).collect();
                format!("({})", parts.join(", "))
            }
            Type::Csg => {
                let found = self.with(|t| *t == Type::Csg);
                match found {
                    Some(found) => found.name,
                    None => self.node(0),
                }
            }
            Type::Interval(_) | Type::Error => "0.0".to_owned(),
        }
    }

    /// A csg node.
    fn node(&mut self, depth: usize) -> String {
        let leaves = if depth == 0 { 1 } else { self.definitions.len() };
        let (name, params, operands) = self.definitions[self.choices.below(leaves)].clone();
        let args: Vec<String> = params.iter().map(|t| self.expression(t, depth.min(1))).collect();
        let mut text = format!("{name}({})", args.join(", "));
        if operands > 0 {
            text.push(' ');
        }
        for _ in 0..operands {
            let sub = self.expression(&Type::Csg, depth.saturating_sub(1));
            let _ = write!(text, "{{ {sub} }}");
        }
        text
    }

    fn branch(&mut self, ty: &Type, depth: usize) -> String {
        let condition = self.expression(&Type::Bool, depth.min(1));
        let (then, otherwise) = (self.expression(ty, depth), self.expression(ty, depth));
        format!("(if {condition} {{ {then} }} else {{ {otherwise} }})")
    }

    fn call(&mut self, ty: &Type, depth: usize) -> Option<String> {
        if !self.operators {
            return None;
        }
        let all: Vec<_> = self.functions.iter().filter(|(_, _, result)| result == ty).cloned().collect();
        if all.is_empty() {
            return None;
        }
        let (name, params, _) = all[self.choices.below(all.len())].clone();
        let args: Vec<String> = params.iter().map(|t| self.expression(t, depth)).collect();
        Some(format!("{name}({})", args.join(", ")))
    }

    fn evaluation(&mut self, ty: &Type, depth: usize) -> Option<String> {
        let tree = self.with(|t| *t == Type::Csg)?;
        let all: Vec<_> = self.concepts.iter().filter(|(_, _, target)| target == ty).cloned().collect();
        if all.is_empty() {
            return None;
        }
        let (concept, source, _) = all[self.choices.below(all.len())].clone();
        let at = self.expression(&source, depth);
        Some(format!("eval {}.{concept}({at})", tree.name))
    }

    /// `diff` of something of the fitting type by a variable.
    fn derivative(&mut self, ty: &Type, depth: usize) -> Option<String> {
        if self.derivatives > 1 {
            return None;
        }
        let (of, by) = match ty {
            Type::Real => (Type::Real, Type::Real),
            Type::Vector(n) if self.choices.chance(50) => (Type::Vector(*n), Type::Real),
            Type::Vector(n) => (Type::Real, Type::Vector(*n)),
            Type::Matrix { columns, rows } => (Type::Vector(*rows), Type::Vector(*columns)),
            _ => return None,
        };
        let by = self.with(|t| *t == by)?;
        self.derivatives += 1;
        let of = self.expression(&of, depth);
        self.derivatives -= 1;
        Some(format!("diff({of}, {})", by.name))
    }

    fn operation(&mut self, ty: &Type, d: usize) -> String {
        let of = |me: &mut Self, t: &Type| me.expression(t, d);
        match ty {
            Type::Real => match self.choices.below(7) {
                0 => format!("({}::<real>)", of(self, &Type::Int)),
                1 => format!("({}::<real>)", of(self, &Type::Bool)),
                2 => format!("dot({}, {})", of(self, &Type::Vector(3)), of(self, &Type::Vector(3))),
                3 => format!("length({})", of(self, &Type::Vector(2))),
                4 => {
                    let n = 2 + u8::try_from(self.choices.below(3)).unwrap_or(0);
                    format!("determinant({})", of(self, &Type::Matrix { columns: n, rows: n }))
                }
                5 => format!("atan2({}, {})", of(self, ty), of(self, ty)),
                _ => self.arithmetic(ty, d),
            },
            Type::Vector(n) => match self.choices.below(6) {
                0 => format!("normalize({})", of(self, ty)),
                1 => format!("({} * {})", of(self, ty), of(self, &Type::Real)),
                2 => format!("({}::<vec{n}>)", of(self, &Type::IntVector(*n))),
                3 => {
                    let parts: Vec<String> = (0..*n).map(|_| of(self, &Type::Real)).collect();
                    format!("[{}]", parts.join(", "))
                }
                4 => {
                    let matrix = Type::Matrix { columns: 2, rows: *n };
                    format!("({} * {})", of(self, &matrix), of(self, &Type::Vector(2)))
                }
                _ => self.arithmetic(ty, d),
            },
            Type::Int | Type::IntVector(_) => match self.choices.below(6) {
                0 => match ty {
                    Type::IntVector(n) => format!("({}::<vec{n}<int>>)", of(self, &Type::Vector(*n))),
                    _ => format!("({}::<int>)", of(self, &Type::Real)),
                },
                1 => format!("(-{})", of(self, ty)),
                2 => format!("abs({})", of(self, ty)),
                3 => format!("min({}, {})", of(self, ty), of(self, ty)),
                _ => {
                    let op = ["+", "-", "*", "/", "%"][self.choices.below(5)];
                    format!("({} {op} {})", of(self, ty), of(self, ty))
                }
            },
            Type::Bool => match self.choices.below(3) {
                0 => format!("(!{})", of(self, ty)),
                1 => {
                    let op = ["&&", "||"][self.choices.below(2)];
                    format!("({} {op} {})", of(self, ty), of(self, ty))
                }
                _ => {
                    let op = ["<", ">", "<=", ">=", "==", "!="][self.choices.below(6)];
                    let side = [Type::Real, Type::Int][self.choices.below(2)].clone();
                    format!("({} {op} {})", of(self, &side), of(self, &side))
                }
            },
            Type::Matrix { columns, rows } => match self.choices.below(5) {
                0 => format!("transpose({})", of(self, &Type::Matrix { columns: *rows, rows: *columns })),
                1 if columns == rows => format!("inverse({})", of(self, ty)),
                2 => format!(
                    "({} * {})",
                    of(self, &Type::Matrix { columns: 2, rows: *rows }),
                    of(self, &Type::Matrix { columns: *columns, rows: 2 })
                ),
                3 => format!("({} + {})", of(self, ty), of(self, ty)),
                _ => {
                    let parts: Vec<String> = (0..*columns).map(|_| of(self, &Type::Vector(*rows))).collect();
                    format!("[{}]", parts.join(", "))
                }
            },
            Type::Quat => match self.choices.below(3) {
                0 => format!("conjugate({})", of(self, ty)),
                1 => format!("({} * {})", of(self, ty), of(self, ty)),
                _ => format!("quat({}, {})", of(self, &Type::Vector(3)), of(self, &Type::Real)),
            },
            Type::Tuple(elements) => {
                let parts: Vec<String> = elements.iter().map(|t| of(self, t)).collect();
                format!("({})", parts.join(", "))
            }
            Type::Csg if self.operators => self.node(d),
            Type::Csg | Type::Interval(_) | Type::Error => self.atom(ty),
        }
    }

    /// What is defined for reals and, component by component, for vectors of reals.
    fn arithmetic(&mut self, ty: &Type, d: usize) -> String {
        match self.choices.below(4) {
            0 => format!("{}({})", UNARY[self.choices.below(UNARY.len())], self.expression(ty, d)),
            1 => {
                let name = BINARY[self.choices.below(BINARY.len())];
                format!("{name}({}, {})", self.expression(ty, d), self.expression(ty, d))
            }
            2 => {
                let name = TERNARY[self.choices.below(TERNARY.len())];
                let parts: Vec<String> = (0..3).map(|_| self.expression(ty, d)).collect();
                format!("{name}({})", parts.join(", "))
            }
            _ => {
                let op = ["+", "-", "*", "/", "%"][self.choices.below(5)];
                format!("({} {op} {})", self.expression(ty, d), self.expression(ty, d))
            }
        }
    }
}

fn variable(name: &str, ty: &Type) -> Variable {
    Variable { name: name.to_owned(), ty: ty.clone(), fixed: false }
}
