//! Every operation and random control flow, in kernels and libraries.

use isograd_graph::ops::Family;
use isograd_graph::{Builder, Mode, NodeId, Precision, Scalar, Unwatched, Value, verify};
use isograd_spirv::{Form, Plan};
use naga::{Expression, Literal};

use crate::garden::{Random, Soil, graph, random, single};
use crate::{checked, kernel, library, scalars, scenes, signature};

#[test]
fn every_operation_makes_a_valid_module() {
    let mut modules = 0;
    for op in Soil::of(Family::Shader).operations {
        let graph = single(op, Precision::F32);
        checked(&kernel(&graph).unwrap());
        checked(&library(&graph, &scalars(&graph)).unwrap());
        modules += 1;
    }
    assert!(modules >= 45, "{modules}");
}

/// WGSL computes what is constant when it reads a module, and refuses infinities, NaN and overflow in it.
#[test]
fn operations_on_constants_are_left_to_run_time() {
    let (reals, ints) = ([0.0, -1.5, 3e38, f64::NAN, f64::INFINITY], [0, -1, i32::MIN, i32::MAX, 40]);
    for op in Soil::of(Family::Shader).operations {
        for k in 0..5 {
            let mut b = Builder::new(Mode::Raw, 1000, &Unwatched);
            let operands: Vec<NodeId> = op
                .def()
                .operands
                .iter()
                .map(|scalar| {
                    b.constant(match scalar {
                        Scalar::Real => Value::Real(reals[k]),
                        Scalar::Int => Value::Int(ints[k]),
                        Scalar::Bool => Value::Bool(k % 2 == 0),
                    })
                })
                .collect();
            let result = b.op(op, &operands);
            b.output("y", result);
            let mut graph = b.finish().unwrap();
            graph.precision = Some(Precision::F32);
            let graph = verify(graph).unwrap();
            assert_eq!(graph.operations(), 1, "{op} is not folded");
            checked(&kernel(&graph).unwrap());
            checked(&library(&graph, &scalars(&graph)).unwrap());
        }
    }
}

#[test]
fn random_control_flow_makes_valid_modules() {
    let (mut branches, mut loops, mut tapes) = (0, 0, 0);
    for seed in 0..300 {
        let graph = random(seed, Precision::F32, &Soil::of(Family::Shader), 14);
        let mut rates = Random(seed);
        let varying: Vec<bool> = graph.inputs.iter().map(|_| rates.below(2) == 0).collect();
        let text = Plan::new(&graph, Form::Kernel { varying: &varying }).unwrap().wgsl().unwrap();
        checked(&text);
        assert_eq!(text, Plan::new(&graph, Form::Kernel { varying: &varying }).unwrap().wgsl().unwrap());
        branches += text.matches(" else {").count();
        loops += text.matches("for (").count();
        tapes += text.matches(": array<").count();
        let text = library(&graph, &scalars(&graph)).unwrap();
        checked(&text);
        checked(&library(&graph, &signature("g", &[("in", 6)], &[("out", 6)])).unwrap());
    }
    // The garden grows what it should.
    assert!(branches > 300 && loops > 300 && tapes > 100, "{branches} branches, {loops} loops, {tapes} tapes");
}

/// Two libraries of the same helpers, in one module with an entry point that calls both.
#[test]
fn libraries_stand_side_by_side() {
    let graph = graph(Precision::F32, |b| {
        let (x, n) = (b.input("x", Scalar::Real), b.input("n", Scalar::Int));
        let y = b.scale(x, n);
        let y = b.copysign(y, x);
        let m = b.exponent(y);
        let (magic, half) = (b.real(12_582_912.0), b.real(0.5));
        let y = b.add(y, magic);
        let y = b.sub(y, magic);
        let y = b.add(y, half);
        b.output("y", y);
        b.output("m", m);
    });
    let [first, second] = ["f", "f_result"]
        .map(|name| library(&graph, &signature(name, &[("x", 1), ("n", 1)], &[("y", 1), ("m", 1)])).unwrap());
    let caller = "@compute @workgroup_size(1) fn main() { let a = f(1.0, 2); let b = f_result(a.y, a.m); }";
    checked(&format!("{first}{second}{caller}"));
    // The barrier of chains of constants: declared once, used by both inner ones.
    assert_eq!(first.matches("fn f__rounded(x: f32) -> f32 {").count(), 1, "{first}");
    assert!(
        first.contains("= f__rounded(v1 + 12582912.0);") && first.contains("= f__rounded(v2 - 12582912.0);"),
        "{first}"
    );
}

/// The numbers of the text are those of the graph, bit for bit, as naga reads them.
#[test]
fn constants_keep_their_bits() {
    let values = [1.5, 0.1, 1e-40, -1e-45, -0.0, 3.4028234663852886e38, -1e-30, 16777216.0, 1e20];
    for x in values {
        let x = Precision::F32.round(x);
        let graph = graph(Precision::F32, |b| {
            let (y, t) = (b.input("y", Scalar::Real), b.input("t", Scalar::Bool));
            let x = b.real(x);
            let z = b.select(t, x, y);
            b.output("z", z);
        });
        let module = checked(&library(&graph, &scalars(&graph)).unwrap());
        let (_, function) = module.functions.iter().next().unwrap();
        let literals: Vec<u32> = function
            .expressions
            .iter()
            .filter_map(|(_, e)| match e {
                Expression::Literal(Literal::F32(x)) => Some(x.to_bits()),
                _ => None,
            })
            .collect();
        assert!(literals.contains(&(x as f32).to_bits()), "{x}: {literals:x?}");
    }
}

#[test]
fn kernels_without_inputs_or_outputs_have_no_such_binding() {
    let constant = graph(Precision::F32, |b| {
        let x = b.real(1.0);
        b.output("one", x);
    });
    let text = kernel(&constant).unwrap();
    assert_eq!(checked(&text).global_variables.len(), 2, "{text}");
    let text = kernel(&graph(Precision::F32, |_| {})).unwrap();
    assert_eq!(checked(&text).global_variables.len(), 1, "{text}");
    // What is bound is read, though no output depends on it.
    let idle = graph(Precision::F32, |b| {
        b.input("x", Scalar::Real);
        b.input("y", Scalar::Real);
    });
    let text = Plan::new(&idle, Form::Kernel { varying: &[true, false] }).unwrap().wgsl().unwrap();
    checked(&text);
    assert!(text.contains("_ = inputs[0];") && text.contains("_ = uniforms[0];"), "{text}");
    let nothing = graph(Precision::F32, |_| {});
    assert!(checked(&library(&nothing, &scalars(&nothing)).unwrap()).functions.len() == 1);
}

#[test]
fn the_text_grows_linearly() {
    let size = |operations| kernel(&scenes::straight(operations)).unwrap().len();
    let (small, large) = (size(1000), size(100_000));
    assert!(large < small * 130, "{small} and {large}");
    let graph = scenes::straight(8000);
    let start = std::time::Instant::now();
    let text = kernel(&graph).unwrap();
    eprintln!("8,000 operations: {:?}, {} bytes", start.elapsed(), text.len());
}
