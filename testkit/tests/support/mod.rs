//! What the tests of the language and of the standard library share: a program is taken through the pipeline and
//! evaluated in three independent ways. Knows nothing of files and of what is expected.

#![allow(dead_code, unused_imports, reason = "each test binary uses a part")]

pub mod gpu;
mod wasm;

use std::fmt::Write as _;

use isograd_compiler::{
    Checked, DerivativeMode, Diagnostic, MemoryLoader, Options, Precision, Query, Sensitivity, Wrt,
};
use isograd_elaborate::elaborate;
use isograd_graph::ops::Family;
use isograd_graph::{Evaluator, Graph, Unwatched, Value};
use isograd_program::typed::Function;
use isograd_program::{ScalarKind, Type};
use isograd_testkit::differences::{Estimate, Side, central, one_sided};
pub use isograd_transform::Sweep;
use isograd_transform::{Wanted, Width, derive, differentiate, fold, kernels, optimise, schedule};

pub use wasm::{Varying, evaluated, request, smooth, wasm};

/// Options under which every transform's result is verified.
pub fn options() -> Options {
    Options { verify: true, ..Options::default() }
}

/// Checks a program of one file.
pub fn check(source: &str) -> Checked {
    isograd_compiler::check("main.vola", source.as_bytes().to_vec(), &MemoryLoader::default(), &options(), &Unwatched)
}

/// Checks a program that must be free of errors.
pub fn check_ok(source: &str) -> Checked {
    let checked = check(source);
    assert!(checked.is_ok(), "{}", listed(&checked.diagnostics));
    checked
}

/// Diagnostics for a failing test's message.
pub fn listed(diagnostics: &[Diagnostic]) -> String {
    diagnostics.iter().fold(String::new(), |mut text, d| {
        let _ = writeln!(text, "{}: {}", d.code.name(), d.message);
        text
    })
}

/// An export of a checked program.
pub fn export<'c>(checked: &'c Checked, name: &str) -> &'c Function {
    let program = checked.program.as_ref().expect("a program without errors");
    let mut all = program.exports.iter().map(|id| &program.functions[id.0 as usize]);
    all.find(|f| f.name == name).unwrap_or_else(|| panic!("no export `{name}`"))
}

/// The scalars of all parameters of an export.
pub fn inputs(function: &Function) -> Vec<ScalarKind> {
    function.params.iter().flat_map(|p| p.ty.scalars()).collect()
}

/// A number as a scalar of a kind; a truth value is 0 or 1.
pub fn value(kind: ScalarKind, x: f64, precision: Precision) -> Value {
    match kind {
        ScalarKind::Real => Value::Real(precision.round(x)),
        ScalarKind::Int => Value::Int(x as i32),
        ScalarKind::Bool => Value::Bool(x != 0.0),
    }
}

/// A scalar as a number.
pub fn number(value: Value) -> f64 {
    match value {
        Value::Real(x) => x,
        Value::Int(x) => f64::from(x),
        Value::Bool(x) => f64::from(u8::from(x)),
    }
}

/// The graphs of some queries that are evaluated by the reference.
pub struct Graphs {
    /// After constants are folded, transcendental functions still whole: an oracle.
    pub folded: Graph,
    /// What is emitted: WebAssembly must agree with it bit for bit.
    pub scheduled: Graph,
    precision: Precision,
}

impl Graphs {
    /// Takes an export through the pipeline by hand, its derivatives with that sweep.
    pub fn of(
        checked: &Checked,
        name: &str,
        queries: &[Query],
        precision: Precision,
        sweep: Sweep,
    ) -> Result<Self, Vec<Diagnostic>> {
        Self::in_mode(checked, name, queries, precision, sweep, None)
    }

    /// The same, in the mode `smooth` if there is a sensitivity.
    pub fn in_mode(
        checked: &Checked,
        name: &str,
        queries: &[Query],
        precision: Precision,
        sweep: Sweep,
        sensitivity: Option<Sensitivity>,
    ) -> Result<Self, Vec<Diagnostic>> {
        const NODES: usize = 4_000_000;
        let program = checked.program.as_ref().expect("a program without errors");
        let id = *program.exports.iter().find(|id| program.functions[id.0 as usize].name == name).expect("the export");
        let raw = elaborate(program, id, &options().limits, &Unwatched)?.graph;
        let raw = match sensitivity.map(|s| Width::of(s.get(), precision).expect("a width")) {
            Some(width) => isograd_transform::smooth(&raw, width, NODES, &Unwatched).expect("within the budget").graph,
            None => raw,
        };
        let wanted = wanted(&program.functions[id.0 as usize], queries);
        let derived = derive(&raw, &wanted, NODES, &Unwatched).expect("within the budget");
        let plain = differentiate(derived, sweep, isograd_graph::Precision::F32, 6, NODES, &Unwatched)
            .map_err(|e| vec![Diagnostic::global(isograd_compiler::Code::E0705, format!("{e:?}"))])?;
        let folded = fold(&plain, precision, NODES, &Unwatched).expect("within the budget");
        let expanded = kernels(&folded, precision, Family::Lanes, NODES, &Unwatched).expect("within the budget");
        let optimised = optimise(&expanded, precision, NODES, &Unwatched).expect("within the budget");
        let scheduled = schedule(&optimised, precision, NODES, &Unwatched).expect("within the budget");
        Ok(Self { folded, scheduled, precision })
    }

    /// Evaluates the folded graph.
    pub fn oracle(&self, points: &[Vec<Value>]) -> Vec<Vec<Value>> {
        evaluate(&self.folded, self.precision, points)
    }

    /// Evaluates what is emitted.
    pub fn emitted(&self, points: &[Vec<Value>]) -> Vec<Vec<Value>> {
        evaluate(&self.scheduled, self.precision, points)
    }
}

fn evaluate(graph: &Graph, precision: Precision, points: &[Vec<Value>]) -> Vec<Vec<Value>> {
    let mut evaluator = Evaluator::new(graph, precision);
    points.iter().map(|point| evaluator.run(point).expect("enough steps")).collect()
}

/// The scalars that queries want of an export, in the order of LANGUAGE 13.1.
fn wanted(function: &Function, queries: &[Query]) -> Vec<Wanted> {
    let reals = |ty: &Type| -> Vec<usize> {
        (0..).zip(ty.scalars()).filter(|(_, s)| *s == ScalarKind::Real).map(|(i, _)| i).collect()
    };
    let inputs = |wrt: &Wrt| -> Vec<usize> {
        let mut before = 0;
        let mut all = Vec::new();
        for param in &function.params {
            if *wrt == Wrt::All || *wrt == Wrt::Parameter(param.name.clone()) {
                all.extend(reals(&param.ty).into_iter().map(|i| i + before));
            }
            before += param.ty.len() as usize;
        }
        all
    };
    let outputs = reals(&function.result);
    let mut all: Vec<(usize, Vec<usize>)> = Vec::new();
    for query in queries {
        match query {
            Query::Value => all.extend((0..function.result.len() as usize).map(|output| (output, Vec::new()))),
            Query::Gradient(p) | Query::Jacobian(p) => {
                all.extend(inputs(p).iter().flat_map(|j| outputs.iter().map(|i| (*i, vec![*j]))));
            }
            Query::Hessian(p, q) => {
                for k in inputs(q) {
                    all.extend(
                        inputs(p).iter().flat_map(|j| outputs.iter().map(move |i| (*i, vec![*j.min(&k), k.max(*j)]))),
                    );
                }
            }
            other => panic!("{other}: no list of derivatives"),
        }
    }
    let name = |i: usize| format!("out{i}");
    all.into_iter().enumerate().map(|(i, (output, by))| Wanted { name: name(i), output, by }).collect()
}

/// Compiles the value of an export in both precisions: its warnings, or its errors.
pub fn compile(checked: &Checked, name: &str) -> Result<Vec<Diagnostic>, Vec<Diagnostic>> {
    let function = export(checked, name);
    let mut warnings = Vec::new();
    for precision in [Precision::F32, Precision::F64] {
        let request = wasm::request(function, &[Query::Value], precision, DerivativeMode::Auto, Varying::All);
        warnings = isograd_compiler::compile(checked, &request, &options(), &Unwatched)?.warnings;
    }
    Ok(warnings)
}

/// A smooth function's derivative by each coordinate of a point, from values alone; `None` where differences cannot
/// judge: near a kink the one-sided ones do not agree.
pub fn slope(f: impl Fn(&[f64]) -> f64, point: &[f64], axis: usize) -> Option<f64> {
    const STEP: f64 = 1.0 / 1024.0;
    const JUDGED: f64 = 1e-6;
    let along = |x: f64| {
        let mut moved = point.to_vec();
        moved[axis] = x;
        f(&moved)
    };
    let both = central(along, point[axis], STEP);
    let sides = [Side::Above, Side::Below].map(|side| one_sided(along, point[axis], STEP, side));
    let agree = |e: &Estimate| e.error < JUDGED && (e.value - both.value).abs() < JUDGED * (1.0 + both.value.abs());
    (agree(&both) && sides.iter().all(agree)).then_some(both.value)
}
