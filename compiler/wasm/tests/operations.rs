//! Every operation with lanes, on its domain and on special values, in both precisions.

#![allow(clippy::pedantic, reason = "tests")]

mod support;

use isograd_graph::ops::Lowering;
use isograd_graph::{NodeId, Op, Scalar, Value};
use support::{PRECISIONS, Random, compare, graph};

fn points(op: Op, random: &mut Random) -> Vec<Vec<Value>> {
    let def = op.def();
    (0..400)
        .map(|i| {
            let pairs = def.operands.iter().zip(def.domain);
            pairs
                .map(|(scalar, (lo, hi))| {
                    let x = lo + (hi - lo) * random.unit();
                    match scalar {
                        _ if i % 2 == 1 => random.value(*scalar),
                        Scalar::Real => Value::Real(x),
                        Scalar::Int => Value::Int(x.round() as i32),
                        Scalar::Bool => Value::Bool(random.below(2) == 0),
                    }
                })
                .collect()
        })
        .collect()
}

#[test]
fn every_operation_agrees_with_the_reference() {
    let mut random = Random(1);
    let mut tested = 0;
    for precision in PRECISIONS {
        for op in Op::ALL.iter().filter(|op| matches!(op.def().lowering, Lowering::Instructions { .. })) {
            let def = op.def();
            let verified = graph(precision, |b| {
                let args: Vec<NodeId> =
                    def.operands.iter().enumerate().map(|(k, s)| b.input(format!("x{k}"), *s)).collect();
                let result = b.op(*op, &args);
                b.output("y", result);
            });
            let mut points = points(*op, &mut random);
            if op.is_partial() {
                for point in &mut points {
                    if let Value::Real(x) = point[0] {
                        point[0] = Value::Real(if x.is_finite() { x.abs().clamp(1e-30, 1e30) } else { 1.5 });
                    }
                }
            }
            compare(&verified, &vec![true; def.operands.len()], &points);
            // One operand uniform, the others varying; and all uniform.
            let mut varying = vec![true; def.operands.len()];
            varying[0] = false;
            compare(&verified, &varying, &points[..60]);
            compare(&verified, &vec![false; def.operands.len()], &points[..5]);
            tested += 1;
        }
    }
    assert!(tested > 60, "{tested}");
}

/// Special operands against each other, which random choice might miss.
#[test]
fn divisions_and_casts_at_the_edges() {
    let ints = [0, 1, -1, 2, -7, i32::MIN, i32::MAX, i32::MIN + 1];
    let reals = [0.4, -0.6, 2147483647.0, 2147483648.0, -2147483648.0, -2147483904.0, 1e300, f64::NAN, f64::INFINITY];
    for precision in PRECISIONS {
        let verified = graph(precision, |b| {
            let (x, y, r) = (b.input("x", Scalar::Int), b.input("y", Scalar::Int), b.input("r", Scalar::Real));
            let quotient = b.idiv(x, y);
            let cast = b.real_to_int(r);
            let scaled = b.scale(r, x);
            let exponent = b.exponent(r);
            for (name, node) in [("q", quotient), ("c", cast), ("s", scaled), ("e", exponent)] {
                b.output(name, node);
            }
        });
        let mut points = Vec::new();
        for x in ints {
            for (k, y) in ints.iter().enumerate() {
                points.push(vec![Value::Int(x), Value::Int(*y), Value::Real(reals[k % reals.len()])]);
            }
        }
        points.extend(reals.iter().map(|r| vec![Value::Int(1), Value::Int(3), Value::Real(*r)]));
        compare(&verified, &[true; 3], &points);
    }
}
