//! What WGSL cannot do is said.

use isograd_graph::{Precision, Scalar, Verified};
use isograd_spirv::{Dialect, EmitError, Form, Lack, Plan};

use crate::garden::graph;
use crate::{checked, kernel, library, scenes, signature};

#[track_caller]
fn lack(result: Result<String, EmitError>) -> Lack {
    match result {
        Err(EmitError::Unsupported { lack, .. }) => lack,
        other => panic!("{other:?}"),
    }
}

fn many(inputs: usize, outputs: usize) -> Verified {
    graph(Precision::F32, |b| {
        let first = b.input("x0", Scalar::Real);
        (1..inputs).for_each(|k| _ = b.input(format!("x{k}"), Scalar::Real));
        (0..outputs).for_each(|k| b.output(format!("y{k}"), first));
    })
}

#[test]
fn doubles() {
    let graph = graph(Precision::F64, |b| {
        let x = b.input("x", Scalar::Real);
        b.output("x", x);
    });
    assert_eq!(lack(kernel(&graph)), Lack::Doubles);
}

#[test]
fn nests() {
    checked(&kernel(&scenes::nested(126)).unwrap());
    assert_eq!(lack(kernel(&scenes::nested(127))), Lack::Nesting { depth: 127, most: 126 });
}

#[test]
fn parameters_and_results() {
    let of = |inputs: usize, outputs: usize| {
        let graph = many(inputs, outputs);
        let names = |prefix, count| (0..count).map(|k| format!("{prefix}{k}")).collect::<Vec<String>>();
        let (inputs, outputs) = (names('x', inputs), names('y', outputs));
        let pairs = |names: &'_ [String]| -> Vec<(String, usize)> { names.iter().map(|n| (n.clone(), 1)).collect() };
        let (inputs, outputs) = (pairs(&inputs), pairs(&outputs));
        let by = |pairs: &'_ [(String, usize)]| -> Vec<(&'static str, usize)> {
            pairs.iter().map(|(n, c)| (&*n.clone().leak(), *c)).collect()
        };
        library(&graph, &signature("f", &by(&inputs), &by(&outputs)))
    };
    checked(&of(255, 1023).unwrap());
    assert_eq!(lack(of(256, 1)), Lack::Parameters { count: 256 });
    assert_eq!(lack(of(1, 1024)), Lack::Members { count: 1024, most: 1023 });
    let wide = |count| library(&many(1, count), &signature("f", &[("x", 1)], &[("hessian", count)]));
    checked(&wide(2047).unwrap());
    assert_eq!(lack(wide(2048)), Lack::Members { count: 2048, most: 2047 });
}

#[test]
fn variables() {
    let branches = |count: usize| {
        graph(Precision::F32, |b| {
            let mut x = b.input("x", Scalar::Real);
            for k in 0..count {
                let c = b.real(k as f64);
                let cond = b.lt(x, c);
                b.gamma(cond);
                let then = b.sqrt(x);
                b.otherwise();
                let end = b.end();
                x = b.join(end, then, x);
            }
            b.output("y", x);
        })
    };
    checked(&kernel(&branches(2048)).unwrap());
    assert_eq!(lack(kernel(&branches(2049))), Lack::Variables { most: 8192 });
}

#[test]
fn translations() {
    let graph = scenes::straight(16_386);
    let plan = Plan::new(&graph, Form::Kernel { varying: &[true] }).unwrap();
    assert_eq!(lack(plan.translated(Dialect::Msl)), Lack::Translated { count: 16_386, most: 16_384 });
    checked(&plan.wgsl().unwrap());
}
