use super::{Accuracy, Derivative, Kink, Lowering, Op, constant, discriminant};
use crate::{Builder, Evaluator, Mode, NodeId, Precision, Scalar, Unwatched, Value};

const SPECIAL: [f64; 14] =
    [0.0, -0.0, 1.0, -1.0, 0.5, 2.5, -2.5, 3.0, 1e-40, -1e-30, 1e30, f64::INFINITY, f64::NEG_INFINITY, f64::NAN];
const INTS: [i32; 9] = [0, 1, -1, 2, 7, -7, i32::MAX, i32::MIN, i32::MIN + 1];

fn values(scalar: Scalar, precision: Precision) -> Vec<Value> {
    match scalar {
        Scalar::Real => SPECIAL.iter().map(|x| Value::Real(precision.round(*x))).collect(),
        Scalar::Int => INTS.iter().map(|x| Value::Int(*x)).collect(),
        Scalar::Bool => vec![Value::Bool(false), Value::Bool(true)],
    }
}

/// All combinations of special operands.
fn grid(operands: &[Scalar], precision: Precision) -> Vec<Vec<Value>> {
    let mut all = vec![Vec::new()];
    for scalar in operands {
        let mut longer = Vec::new();
        for head in &all {
            for value in values(*scalar, precision) {
                let mut row: Vec<Value> = head.clone();
                row.push(value);
                longer.push(row);
            }
        }
        all = longer;
    }
    all
}

#[test]
fn declarations_fit_together() {
    let mut names: Vec<_> = Op::ALL.iter().map(|op| op.def().name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), Op::ALL.len(), "names are unique");
    for op in Op::ALL {
        let def = op.def();
        assert_eq!(def.domain.len(), def.operands.len(), "{op}");
        assert!(def.domain.iter().all(|(lo, hi)| lo <= hi), "{op}");
        assert!((def.cost > 0 || *op == Op::Rounded) && !def.formula.is_empty(), "{op}");
        match &def.derivative {
            Derivative::Zero => {}
            Derivative::Partials(partials) => assert_eq!(partials.len(), def.operands.len(), "{op}"),
            Derivative::Choice { then, otherwise, .. } => {
                assert!(*then < def.operands.len() && *otherwise < def.operands.len(), "{op}");
            }
        }
        if !matches!(def.derivative, Derivative::Zero) {
            assert_eq!(def.result, Scalar::Real, "{op}");
        }
        if let Kink::Where { set, measure, slopes, .. } = def.kink {
            assert!(def.operands.iter().all(|s| *s == Scalar::Real), "{op}: discriminants are of reals");
            assert!(discriminant(*op, &vec![0.5; def.operands.len()]).is_finite(), "{op}");
            assert!([set, measure, slopes[0], slopes[1], slopes[2]].iter().all(|words| !words.is_empty()), "{op}");
        }
    }
}

#[test]
fn commuting_operations_commute() {
    for op in Op::ALL.iter().filter(|op| op.def().commutes) {
        for precision in [Precision::F32, Precision::F64] {
            for mut row in grid(&op.def().operands[..2], precision) {
                row.extend(op.def().operands[2..].iter().map(|s| Value::zero(*s)));
                let before = (op.def().eval.at(precision))(&row);
                row.swap(0, 1);
                assert!(before.same_bits((op.def().eval.at(precision))(&row)), "{op} {row:?}");
            }
        }
    }
}

#[test]
fn exact_fragments_are_their_formulas() {
    for op in Op::ALL {
        let (Lowering::Fragment(_), Accuracy::Exact) = (&op.def().lowering, op.def().accuracy) else { continue };
        for precision in [Precision::F32, Precision::F64] {
            for row in grid(op.def().operands, precision) {
                let formula = (op.def().eval.at(precision))(&row);
                let fragment = constant(*op, &row, precision).unwrap();
                assert!(formula.same_bits(fragment), "{op} {row:?}: formula {formula:?}, fragment {fragment:?}");
            }
        }
    }
}

/// An operand of a rewrite: what can stand there that some rewrite looks at.
#[derive(Clone, Copy, Debug)]
enum Shape {
    Input(u32),
    Negated(u32),
    Absolute(u32),
    Root(u32),
    Constant(f64),
}

fn shaped(b: &mut Builder<'_>, inputs: &[NodeId], shape: Shape) -> NodeId {
    match shape {
        Shape::Input(i) => inputs[i as usize],
        Shape::Negated(i) => b.neg(inputs[i as usize]),
        Shape::Absolute(i) => b.abs(inputs[i as usize]),
        Shape::Root(i) => b.sqrt(inputs[i as usize]),
        Shape::Constant(x) => b.real(x),
    }
}

#[test]
fn rewrites_preserve_bits() {
    let mut shapes = vec![Shape::Input(0), Shape::Input(1), Shape::Negated(0), Shape::Negated(1)];
    shapes.extend([Shape::Absolute(0), Shape::Root(0)]);
    shapes.extend([0.0, -0.0, 1.0, -1.0, 2.0, 0.25, -4.0, 3.0, f64::INFINITY].map(Shape::Constant));
    let ops = [Op::Add, Op::Sub, Op::Mul, Op::Div, Op::Min, Op::Max, Op::Neg, Op::Abs];
    for precision in [Precision::F32, Precision::F64] {
        for op in ops {
            for x in &shapes {
                for y in &shapes {
                    let graph = |mode| {
                        let mut b = Builder::new(mode, 1000, &Unwatched);
                        let inputs = [b.input("x", Scalar::Real), b.input("y", Scalar::Real)];
                        let operands = [shaped(&mut b, &inputs, *x), shaped(&mut b, &inputs, *y)];
                        let result = b.op(op, &operands[..op.def().operands.len()]);
                        b.output("r", result);
                        b.finish().unwrap()
                    };
                    let (plain, rewritten) = (graph(Mode::Raw), graph(Mode::Real(precision)));
                    let (mut plain, mut rewritten) =
                        (Evaluator::new(&plain, precision), Evaluator::new(&rewritten, precision));
                    for row in grid(&[Scalar::Real; 2], precision) {
                        let (a, b) = (plain.run(&row).unwrap()[0], rewritten.run(&row).unwrap()[0]);
                        assert!(a.same_bits(b), "{op} {x:?} {y:?} at {row:?}: {a:?} rewritten {b:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn selections_and_truth_rewrite_to_the_same() {
    for code in 0..27 {
        let graph = |mode| {
            let mut b = Builder::new(mode, 1000, &Unwatched);
            let inputs = [b.input("p", Scalar::Bool), b.input("q", Scalar::Bool)];
            let pick = |b: &mut Builder<'_>, k: i32| match k {
                0 => inputs[0],
                1 => b.not(inputs[1]),
                _ => b.bool(true),
            };
            let (c, x, y) = (pick(&mut b, code / 9), pick(&mut b, code / 3 % 3), pick(&mut b, code % 3));
            let c = b.not(c);
            let chosen = b.select_bool(c, x, y);
            let (and, or) = (b.and(x, y), b.or(chosen, c));
            for (i, node) in [chosen, and, or].into_iter().enumerate() {
                b.output(format!("r{i}"), node);
            }
            b.finish().unwrap()
        };
        let (plain, rewritten) = (graph(Mode::Raw), graph(Mode::Real(Precision::F32)));
        for row in grid(&[Scalar::Bool; 2], Precision::F32) {
            let run = |g| crate::evaluate(g, Precision::F32, &row).unwrap();
            assert_eq!(run(&plain), run(&rewritten), "{code} at {row:?}");
        }
    }
}

#[test]
fn constants_are_exact_until_they_meet_a_variable() {
    // 0.1 · 0.1 in f64, rounded once, is another f32 than the product of the rounded factors.
    let mut b = Builder::new(Mode::Exact(Precision::F32), 100, &Unwatched);
    let x = b.input("x", Scalar::Real);
    let tenth = b.real(0.1);
    let product = b.mul(tenth, tenth);
    let sum = b.add(product, x);
    b.output("s", sum);
    let graph = b.finish().unwrap();
    let got = crate::evaluate(&graph, Precision::F32, &[Value::Real(0.0)]).unwrap();
    #[expect(clippy::cast_possible_truncation, reason = "rounding is what is tested")]
    let once = f64::from((0.1_f64 * 0.1) as f32);
    assert_eq!(got, [Value::Real(once)]);
    assert_ne!(once, f64::from(0.1_f32 * 0.1_f32));
}
