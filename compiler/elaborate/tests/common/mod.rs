//! What the tests share: source text to raw graph, and evaluation of the raw graph. Knows no derivative rules but the
//! few that tell which values LANGUAGE 13.3 takes for the same.

#![allow(dead_code, reason = "each test file uses its own part")]

use isograd_elaborate::{Elaborated, elaborate};
use isograd_graph::{Graph, Node, NodeId, Op, Precision, Unwatched, Value, Watch, evaluate, verify};
use isograd_program::{Loader, ModulePath, Program, check, load};
use isograd_syntax::{Code, Diagnostic, Limits};

/// The items that the acceptance examples of LANGUAGE 21 share.
pub const ITEMS: &str = "
concept D: real -> real;
concept V: real -> vec2;
concept Tone: real -> real;
entity Line();
entity Square();
entity Five();
entity Shift(k: real);
entity Plus(k: real);
operation Add();
operation Inc();
operation Tag(t: real);
operation Along(pos: real, time: real);
impl Line for D(x) { x }
impl Square for D(x) { x * x }
impl Five for D(x) { 5.0 }
impl Shift for D(x) { x - k }
impl Plus for D(x) { x + k }
impl Add<a, b> for D(x) { eval a.D(x) + eval b.D(x) }
impl Inc<sub> for D(x) { 1.0 + eval sub.D(x) }
impl Tag<sub> for Tone(x) { t }
impl Along<sub> for V(x) {
    let v = diff(pos, time);
    let a = diff(v, time);
    [v - 4.0, a]
}
fn sq(a: real) -> real { a * a }
fn sign(x: real) -> real { 7.0 }
fn dprod(a: real, b: real) -> real { diff(a * b, a) }
fn twice(c: csg) -> csg { Add(){ c }{ c } }
";

struct NoFiles;

impl Loader for NoFiles {
    fn libraries(&self) -> Vec<String> {
        Vec::new()
    }

    fn read(&self, _: &ModulePath) -> Result<Vec<u8>, String> {
        Err("there are no files".into())
    }
}

/// A program that has no errors.
pub fn program(source: &str) -> Program {
    let limits = Limits::default();
    let loaded = load("test.vola", source.as_bytes().to_vec(), &NoFiles, &limits);
    assert!(loaded.diagnostics.iter().all(|d| !d.is_error()), "{source}\n{:#?}", loaded.diagnostics);
    let checked = check(&loaded, &limits);
    assert!(checked.diagnostics.iter().all(|d| !d.is_error()), "{source}\n{:#?}", checked.diagnostics);
    checked.program
}

/// Elaborates the only export.
pub fn elaborated(source: &str, limits: &Limits, watch: &dyn Watch) -> Result<Elaborated, Vec<Diagnostic>> {
    let program = program(source);
    let export = *program.exports.first().expect("an export");
    elaborate(&program, export, limits, watch)
}

/// The raw graph of the only export, verified.
pub fn graph(source: &str) -> Graph {
    let done = elaborated(source, &Limits::default(), &Unwatched).unwrap_or_else(|d| panic!("{source}\n{d:#?}"));
    for (id, _) in done.graph.iter() {
        assert!((done.graph.origin(id).0 as usize) < done.origins.len());
    }
    verify(done.graph).unwrap_or_else(|e| panic!("{source}\n{e}")).into_inner()
}

/// `export fn f` with this signature and body below the shared items.
pub fn example(signature: &str, body: &str) -> String {
    format!("{ITEMS}\nexport fn {signature} {{ {body} }}")
}

/// The inputs of a graph from numbers.
pub fn inputs(graph: &Graph, numbers: &[f64]) -> Vec<Value> {
    assert_eq!(graph.inputs.len(), numbers.len());
    let value = |(input, x): (&isograd_graph::Input, &f64)| match input.scalar {
        isograd_graph::Scalar::Real => Value::Real(*x),
        isograd_graph::Scalar::Int => Value::Int(*x as i32),
        isograd_graph::Scalar::Bool => Value::Bool(*x != 0.0),
    };
    graph.inputs.iter().zip(numbers).map(value).collect()
}

/// A value as a number.
pub fn number(value: Value) -> f64 {
    match value {
        Value::Real(x) => x,
        Value::Int(x) => f64::from(x),
        Value::Bool(x) => f64::from(u8::from(x)),
    }
}

/// The outputs at a point.
pub fn run(graph: &Graph, numbers: &[f64]) -> Vec<f64> {
    let values = evaluate(graph, Precision::F64, &inputs(graph, numbers)).expect("not too many steps");
    values.into_iter().map(number).collect()
}

/// Whether the numbers agree as LANGUAGE 21 wants it.
pub fn agree(got: &[f64], want: &[f64]) -> bool {
    let close = |(a, b): (&f64, &f64)| a == b || (a - b).abs() <= 1e-5 * b.abs().max(1.0);
    got.len() == want.len() && got.iter().zip(want).all(close)
}

/// The codes of the errors.
pub fn codes(source: &str) -> Vec<Code> {
    match elaborated(source, &Limits::default(), &Unwatched) {
        Ok(_) => Vec::new(),
        Err(diagnostics) => diagnostics.iter().map(|d| d.code).collect(),
    }
}

/// How often an operation occurs.
pub fn count(graph: &Graph, op: Op) -> usize {
    graph.iter().filter(|(_, n)| matches!(n, Node::Apply(o, _) if *o == op)).count()
}

/// The outputs at a point where some are first derivatives of values made without loops, computed by dual numbers:
/// a derivative is what a change of the node `wrt` alone does.
pub fn derivatives(graph: &Graph, numbers: &[f64]) -> Vec<f64> {
    let inputs = inputs(graph, numbers);
    let values = duals(graph, &inputs, NodeId::NONE);
    let output = |id: NodeId| match graph.get(id) {
        Some(Node::Diff { value, wrt }) => duals(graph, &inputs, wrt)[value.index()].1,
        _ => values[id.index()].0,
    };
    graph.outputs.iter().map(|o| output(o.node)).collect()
}

fn duals(graph: &Graph, inputs: &[Value], seed: NodeId) -> Vec<(f64, f64)> {
    let mut duals: Vec<(f64, f64)> = Vec::new();
    for (id, node) in graph.iter() {
        let at = |x: NodeId| duals[x.index()];
        let (value, tangent) = match node {
            Node::Input(i) => (number(inputs[i as usize]), 0.0),
            Node::Real(bits) => (f64::from_bits(bits), 0.0),
            Node::Int(x) => (f64::from(x), 0.0),
            Node::Bool(x) => (f64::from(u8::from(x)), 0.0),
            Node::Fresh(x) => at(x),
            Node::Diff { value, wrt } if seed == NodeId::NONE => (duals_of(graph, inputs, value, wrt), 0.0),
            Node::Diff { .. } | Node::Within { .. } | Node::Bound { .. } => (f64::NAN, 0.0),
            Node::Gamma { cond, .. } => at(cond),
            Node::Else { .. } => (0.0, 0.0),
            Node::End { begin } => at(begin),
            Node::Join { end, then, otherwise } => at(if at(end).0 == 1.0 { then } else { otherwise }),
            Node::Theta { .. }
            | Node::Counter { .. }
            | Node::Carried { .. }
            | Node::Final { .. }
            | Node::Tape { .. }
            | Node::Recall { .. } => panic!("a loop"),
            Node::Apply(op, args) => {
                let args: Vec<(f64, f64)> = args.as_slice().iter().map(|a| at(*a)).collect();
                match (op, &args[..]) {
                    (Op::Add, [a, b]) => (a.0 + b.0, a.1 + b.1),
                    (Op::Sub, [a, b]) => (a.0 - b.0, a.1 - b.1),
                    (Op::Mul, [a, b]) => (a.0 * b.0, a.1 * b.0 + a.0 * b.1),
                    (Op::Sin, [a]) => (a.0.sin(), a.0.cos() * a.1),
                    (Op::Lt, [a, b]) => (f64::from(u8::from(a.0 < b.0)), 0.0),
                    (Op::IntLt, [a, b]) => (f64::from(u8::from(a.0 < b.0)), 0.0),
                    (Op::IntEq, [a, b]) => (f64::from(u8::from(a.0 == b.0)), 0.0),
                    (Op::Not, [a]) => (1.0 - a.0, 0.0),
                    (Op::Select, [c, a, b]) => *(if c.0 == 1.0 { a } else { b }),
                    _ => panic!("{op} has no rule here"),
                }
            }
        };
        duals.push((value, if id == seed { 1.0 } else { tangent }));
    }
    duals
}

fn duals_of(graph: &Graph, inputs: &[Value], value: NodeId, wrt: NodeId) -> f64 {
    duals(graph, inputs, wrt)[value.index()].1
}
