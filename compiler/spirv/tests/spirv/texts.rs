//! What modules look like.

use isograd_graph::{Precision, Scalar, Verified};
use isograd_spirv::{Form, Group, Plan, Signature, disassemble};

use crate::garden::graph;
use crate::modules::kernel;

fn text(graph: &Verified, varying: &[bool]) -> String {
    disassemble(&kernel(graph, varying)).expect("disassembles")
}

/// √(x² + y² + z²) − r and its gradient by the point.
pub fn sphere(precision: Precision) -> Verified {
    graph(precision, |b| {
        let at = ["at.x", "at.y", "at.z"].map(|name| b.input(name, Scalar::Real));
        let radius = b.input("radius", Scalar::Real);
        let [x, y, z] = at.map(|x| b.mul(x, x));
        let sum = b.add(x, y);
        let sum = b.add(sum, z);
        let length = b.sqrt(sum);
        let value = b.sub(length, radius);
        b.output("value", value);
        for (name, x) in ["gradient.x", "gradient.y", "gradient.z"].into_iter().zip(at) {
            let slope = b.div(x, length);
            b.output(name, slope);
        }
    })
}

#[test]
fn sphere_with_gradient() {
    insta::assert_snapshot!(text(&sphere(Precision::F32), &[true, true, true, false]));
}

#[test]
fn branch() {
    let graph = graph(Precision::F32, |b| {
        let (x, y) = (b.input("x", Scalar::Real), b.input("y", Scalar::Real));
        let less = b.lt(x, y);
        b.gamma(less);
        let product = b.mul(x, y);
        b.otherwise();
        let quotient = b.div(x, y);
        let end = b.end();
        let late = b.neg(y);
        let (first, second) = (b.join(end, product, quotient), b.join(end, late, quotient));
        b.output("first", first);
        b.output("second", second);
    });
    insta::assert_snapshot!(text(&graph, &[true, true]));
}

#[test]
fn loop_with_ints_and_bools() {
    let graph = graph(Precision::F64, |b| {
        let (x, n, flip) = (b.input("x", Scalar::Real), b.input("n", Scalar::Int), b.input("flip", Scalar::Bool));
        let zero = b.int(0);
        b.theta(zero, n);
        let counter = b.counter();
        let (power, flag) = (b.carried(x), b.carried(flip));
        let number = b.int_to_real(counter);
        let next = b.mul(power, number);
        let not = b.not(flag);
        let end = b.end();
        let (power, flag) = (b.carry_out(end, power, next), b.carry_out(end, flag, not));
        b.output("power", power);
        b.output("flag", flag);
        b.output("same", n);
    });
    insta::assert_snapshot!(text(&graph, &[true, true, false]));
}

#[test]
fn tape() {
    let graph = graph(Precision::F32, |b| {
        let x = b.input("x", Scalar::Real);
        let (none, ten, five) = (b.int(0), b.int(10), b.int(5));
        b.theta(none, ten);
        let power = b.carried(x);
        let square = b.mul(power, power);
        let end = b.end();
        let last = b.carry_out(end, power, square);
        let tape = b.tape(end, power, 2);
        b.theta(none, five);
        let at = b.counter();
        let sum = b.carried(last);
        let recalled = b.recall(tape, at);
        let next = b.add(sum, recalled);
        let end = b.end();
        let sum = b.carry_out(end, sum, next);
        b.output("sum", sum);
    });
    insta::assert_snapshot!(text(&graph, &[true]));
}

#[test]
fn library_function() {
    let group = |name: &str, scalars| Group { name: name.to_owned(), scalars };
    let signature = Signature {
        name: "sphere".to_owned(),
        parameters: vec![group("at", 3), group("radius", 1)],
        results: vec![group("value", 1), group("gradient(sphere, at)", 3)],
    };
    let graph = sphere(Precision::F32);
    let plan = Plan::new(&graph, Form::Library(&signature)).expect("a plan");
    insta::assert_snapshot!(disassemble(&plan.spirv().expect("emits")).expect("disassembles"));
}

#[test]
fn what_is_no_module_is_refused() {
    for bytes in [&b""[..], b"\0asm\x01\0\0\0", &[3, 2, 0x23, 7]] {
        assert!(disassemble(bytes).is_err(), "{bytes:?}");
    }
    let module = kernel(&sphere(Precision::F32), &[true; 4]);
    assert!(disassemble(&module[..module.len() - 4]).is_err());
}
