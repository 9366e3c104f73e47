//! Every rewrite of the table, one by one: both sides have the same bits for all operands of a small number format, and
//! in both precisions for special and random ones; and each is what a folding builder applies. Knows no rewrite by name.
//!
//! The small formats follow IEEE 754: a sign, E exponent and M significand bits, with subnormals, infinities and NaN. An
//! operation is computed in f64 and rounded once more. That is the small format's own result for + − × ÷ √ because 53 is
//! at least 2(M + 1) + 2: S. A. Figueroa, "When is double rounding innocuous?", SIGNUM Newsletter 30 (3), 1995.

#![allow(clippy::pedantic, reason = "tests")]

use isograd_graph::ops::{self, Accuracy, Fit, LETTERS, Lowering, REWRITES, Rewrite, Term};
use isograd_graph::{Builder, Graph, Mode, Node, NodeId, Op, Precision, Scalar, Unwatched, Value, evaluate};

const PRECISIONS: [Precision; 2] = [Precision::F32, Precision::F64];

/// What the letters of a rewrite stand for.
type Row = [Value; LETTERS.len()];

const BLANK: Row = [Value::Bool(false); LETTERS.len()];

/// The letters of a term with the kind of each and the constants it may be.
fn letters(term: &Term, scalar: Scalar, all: &mut Vec<(usize, Scalar, Option<Fit>)>) {
    match term {
        Term::Any(letter) | Term::Known(letter, _) if all.iter().any(|l| l.0 == *letter) => {
            assert!(all.iter().any(|l| (l.0, l.1) == (*letter, scalar)), "a letter of one kind");
        }
        Term::Any(letter) => all.push((*letter, scalar, None)),
        Term::Known(letter, fit) => all.push((*letter, scalar, Some(*fit))),
        Term::Constant(value) => assert_eq!(value.scalar(), scalar),
        Term::Apply(op, terms) => {
            assert_eq!((op.def().result, op.def().operands.len()), (scalar, terms.len()), "{op}");
            terms.iter().zip(op.def().operands).for_each(|(t, s)| letters(t, *s, all));
        }
    }
}

fn result(rule: &Rewrite) -> Scalar {
    let Term::Apply(op, _) = &rule.left else { panic!("{rule}: no operation") };
    op.def().result
}

/// The letters of the left side.
fn unknowns(rule: &Rewrite) -> Vec<(usize, Scalar, Option<Fit>)> {
    let (mut left, mut both) = (Vec::new(), Vec::new());
    letters(&rule.left, result(rule), &mut left);
    letters(&rule.left, result(rule), &mut both);
    letters(&rule.right, result(rule), &mut both);
    assert_eq!(left.len(), both.len(), "{rule}: a letter on the right that is not on the left");
    left
}

/// A number format of `1 + E + M` bits, and ints of few bits.
#[derive(Clone, Copy)]
struct Small {
    exponent: i32,
    significand: i32,
    int: u32,
}

impl Small {
    /// The format in which all operands can be tried.
    fn for_letters(n: usize) -> Self {
        let (exponent, significand, int) = [(4, 3, 8), (4, 3, 8), (4, 3, 8), (3, 2, 4), (2, 1, 4)][n];
        Self { exponent, significand, int }
    }

    fn bias(self) -> i32 {
        (1 << (self.exponent - 1)) - 1
    }

    /// The largest finite number.
    fn largest(self) -> f64 {
        (2.0 - 2f64.powi(-self.significand)) * 2f64.powi(self.bias())
    }

    /// The nearest number of the format; of two the even one.
    fn round(self, x: f64) -> f64 {
        if x == 0.0 || !x.is_finite() {
            return x;
        }
        let exponent = ((x.to_bits() >> 52 & 0x7ff) as i32 - 1023).max(1 - self.bias());
        let unit = 2f64.powi(exponent - self.significand);
        let rounded = (x / unit).round_ties_even() * unit;
        if rounded.abs() > self.largest() { f64::INFINITY.copysign(x) } else { rounded }
    }

    /// All its numbers, one NaN among them.
    fn reals(self) -> Vec<f64> {
        let mut all = Vec::new();
        for exponent in 0..(1 << self.exponent) - 1 {
            for digits in 0..1 << self.significand {
                let lead = if exponent == 0 { 0 } else { 1 << self.significand };
                let x = f64::from(lead + digits) * 2f64.powi(exponent.max(1) - self.bias() - self.significand);
                all.extend([x, -x]);
            }
        }
        all.extend([f64::INFINITY, f64::NEG_INFINITY, f64::NAN]);
        all
    }

    fn values(self, scalar: Scalar, fit: Option<Fit>) -> Vec<Value> {
        let normal = |x: f64| x.abs() <= self.largest() && x.abs() >= 2f64.powi(1 - self.bias());
        let all: Vec<Value> = match scalar {
            Scalar::Real => self.reals().into_iter().map(Value::Real).collect(),
            Scalar::Int => (-(1 << (self.int - 1))..1 << (self.int - 1)).map(Value::Int).collect(),
            Scalar::Bool => vec![Value::Bool(false), Value::Bool(true)],
        };
        let fits = |value: &Value| match (fit, *value) {
            // What the words of `Fit::PowerOfTwo` say, of this format.
            (Some(Fit::PowerOfTwo), Value::Real(x)) => x.to_bits() << 12 == 0 && normal(x) && normal(1.0 / x),
            _ => true,
        };
        all.into_iter().filter(fits).collect()
    }

    /// A value of the format: reals rounded, ints modulo 2ⁿ, which + − · allow.
    fn narrow(self, value: Value) -> Value {
        match value {
            Value::Real(x) => Value::Real(self.round(x)),
            Value::Int(x) => Value::Int(x << (32 - self.int) >> (32 - self.int)),
            Value::Bool(x) => Value::Bool(x),
        }
    }

    fn apply(self, op: Op, args: &[Value]) -> Value {
        assert_eq!(op.def().accuracy, Accuracy::Exact, "{op} has no meaning in a small format");
        match op.def().lowering {
            Lowering::Instructions { .. } => self.narrow((op.def().eval.f64)(args)),
            Lowering::Fragment(fragment) => {
                let mut b = Builder::new(Mode::Raw, 1000, &Unwatched);
                let inputs: Vec<NodeId> = op.def().operands.iter().map(|s| b.input("x", *s)).collect();
                let result = fragment(&mut b, &inputs, Precision::F64);
                let mut values: Vec<Value> = Vec::new();
                for (_, node) in b.graph().iter() {
                    let value = match node {
                        Node::Input(i) => args[i as usize],
                        Node::Apply(op, of) => {
                            let of: Vec<Value> = of.as_slice().iter().map(|x| values[x.index()]).collect();
                            self.apply(op, &of)
                        }
                        _ => self.narrow(b.value(NodeId(values.len() as u32)).unwrap()),
                    };
                    values.push(value);
                }
                values[result.index()]
            }
        }
    }

    fn evaluate(self, term: &Term, row: &Row) -> Value {
        match term {
            Term::Any(letter) | Term::Known(letter, _) => row[*letter],
            Term::Constant(value) => {
                assert!(self.narrow(*value).same_bits(*value), "the format has the constant");
                *value
            }
            Term::Apply(op, terms) => {
                let mut args = [Value::Bool(false); 4];
                args.iter_mut().zip(*terms).for_each(|(place, t)| *place = self.evaluate(t, row));
                self.apply(*op, &args[..terms.len()])
            }
        }
    }
}

/// All rows of operands.
fn rows(
    unknowns: &[(usize, Scalar, Option<Fit>)],
    mut values: impl FnMut(Scalar, Option<Fit>) -> Vec<Value>,
) -> Vec<Row> {
    let mut all = vec![BLANK];
    for (letter, scalar, fit) in unknowns {
        let values = values(*scalar, *fit);
        assert!(!values.is_empty());
        let with = |row: Row, value: Value| {
            let mut row = row;
            row[*letter] = value;
            row
        };
        all = all.into_iter().flat_map(|row| values.iter().map(move |v| with(row, *v))).collect();
    }
    all
}

/// The operands in a small format for which the sides differ.
fn differences(left: &Term, right: &Term, unknowns: &[(usize, Scalar, Option<Fit>)]) -> Vec<Row> {
    let small = Small::for_letters(unknowns.len());
    let differ = |row: &Row| !small.evaluate(left, row).same_bits(small.evaluate(right, row));
    rows(unknowns, |scalar, fit| small.values(scalar, fit)).into_iter().filter(differ).collect()
}

#[test]
fn both_sides_are_the_same_for_all_small_numbers() {
    for rule in REWRITES {
        let found = differences(&rule.left, &rule.right, &unknowns(rule));
        assert!(found.is_empty(), "{rule} is wrong {} times, at {:?}", found.len(), found[0]);
    }
}

#[test]
fn what_is_nearly_a_rewrite_is_told_apart() {
    const X: Term = Term::Any(0);
    const Y: Term = Term::Any(1);
    const ZERO: Term = Term::Constant(Value::Real(0.0));
    const NEGATED: Term = Term::Apply(Op::Neg, &[X]);
    const MIRRORED: Term = Term::Apply(Op::Neg, &[Y]);
    const SUM: Term = Term::Apply(Op::Add, &[X, Y]);
    const DIFFERENCE: Term = Term::Apply(Op::Sub, &[X, Y]);
    const ROOT: Term = Term::Apply(Op::Sqrt, &[X]);
    const INVERSE: Term = Term::Apply(Op::Div, &[Term::Constant(Value::Real(1.0)), Y]);
    let wrong = [
        (Term::Apply(Op::Add, &[X, ZERO]), X),                                      // at −0
        (Term::Apply(Op::Sub, &[X, X]), ZERO),                                      // at ∞ and NaN
        (Term::Apply(Op::Mul, &[X, ZERO]), ZERO),                                   // at −1, ∞ and NaN
        (Term::Apply(Op::Neg, &[DIFFERENCE]), Term::Apply(Op::Sub, &[Y, X])),       // where x = y
        (Term::Apply(Op::Add, &[NEGATED, MIRRORED]), Term::Apply(Op::Neg, &[SUM])), // where x = −y
        (Term::Apply(Op::Abs, &[ROOT]), ROOT),                                      // at −0
        (Term::Apply(Op::Div, &[X, Y]), Term::Apply(Op::Mul, &[X, INVERSE])),       // rounded twice
        (Term::Apply(Op::Sub, &[SUM, Y]), X),                                       // rounded
    ];
    for (left, right) in &wrong {
        let unknowns = [(0, Scalar::Real, None), (1, Scalar::Real, None)];
        assert!(!differences(left, right, &unknowns).is_empty(), "{left} = {right}");
    }
}

/// `SplitMix64`: seeded operands.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn value(&mut self, scalar: Scalar, precision: Precision, fit: Option<Fit>) -> Value {
        let bits = self.bits();
        match (scalar, precision) {
            (Scalar::Real, _) if fit == Some(Fit::PowerOfTwo) => {
                Value::Real(f64::from_bits(bits & 1 << 63 | (1023 - 122 + bits % 245) << 52))
            }
            (Scalar::Real, Precision::F32) => Value::Real(f64::from(f32::from_bits(bits as u32))),
            (Scalar::Real, Precision::F64) => Value::Real(f64::from_bits(bits)),
            (Scalar::Int, _) => Value::Int(bits as i32 >> (bits >> 32 & 31)),
            (Scalar::Bool, _) => Value::Bool(bits & 1 == 1),
        }
    }
}

fn special(scalar: Scalar, precision: Precision, fit: Option<Fit>) -> Vec<Value> {
    let (tiny, normal, large) = match precision {
        Precision::F32 => (f64::from(f32::from_bits(1)), f64::from(f32::MIN_POSITIVE), f64::from(f32::MAX)),
        Precision::F64 => (f64::from_bits(1), f64::MIN_POSITIVE, f64::MAX),
    };
    let eps = if precision == Precision::F32 { f64::from(f32::EPSILON) } else { f64::EPSILON };
    let next = normal + tiny; // the smallest normal number but one
    let reals =
        [0.0, 1.0, 0.5, 2.0, 3.0, 0.1, 1.0 + eps, tiny, 3.0 * tiny, normal - tiny, normal, next, large, f64::INFINITY];
    let ends = [1.0, 2.0, 0.5, 4.0, 2f64.powi(122), 2f64.powi(-122)];
    let signed = |all: &[f64]| all.iter().flat_map(|x| [*x, -*x]).map(|x| Value::Real(precision.round(x))).collect();
    match scalar {
        Scalar::Real if fit == Some(Fit::PowerOfTwo) => signed(&ends),
        Scalar::Real => [signed(&reals), vec![Value::Real(f64::NAN)]].concat(),
        Scalar::Int => [0, 1, -1, 2, 7, i32::MAX, i32::MIN, i32::MIN + 1].map(Value::Int).to_vec(),
        Scalar::Bool => vec![Value::Bool(false), Value::Bool(true)],
    }
}

/// The graph of a term: a plain one, or what rewriting makes of it.
struct Made {
    graph: Graph,
    /// What rewrote the operation at the top.
    applied: Option<&'static Rewrite>,
}

/// Builds a term with constants for known letters; `exchanged` has the inputs in the opposite order and turns the operands
/// of operations that commute.
fn make(term: &Term, unknowns: &[(usize, Scalar, Option<Fit>)], row: &Row, mode: Mode, exchanged: bool) -> Made {
    let mut b = Builder::new(mode, 1000, &Unwatched);
    let mut nodes = [NodeId::NONE; LETTERS.len()];
    let mut unknowns = unknowns.to_vec();
    if exchanged {
        unknowns.reverse();
    }
    for (letter, scalar, fit) in
        unknowns.iter().filter(|u| u.2.is_none()).chain(unknowns.iter().filter(|u| u.2.is_some()))
    {
        nodes[*letter] = if fit.is_none() { b.input(LETTERS[*letter], *scalar) } else { b.constant(row[*letter]) };
    }
    let (result, applied) = build(&mut b, term, &nodes, exchanged);
    b.output("result", result);
    Made { graph: b.finish().unwrap(), applied }
}

fn build(b: &mut Builder<'_>, term: &Term, letters: &[NodeId], exchanged: bool) -> (NodeId, Option<&'static Rewrite>) {
    match term {
        Term::Any(letter) | Term::Known(letter, _) => (letters[*letter], None),
        Term::Constant(value) => (b.constant(*value), None),
        Term::Apply(op, terms) => {
            let mut args: Vec<NodeId> = terms.iter().map(|t| build(b, t, letters, exchanged).0).collect();
            if exchanged && op.def().commutes {
                args.swap(0, 1);
            }
            (b.op(*op, &args), ops::applicable(b, *op, &args))
        }
    }
}

fn inputs(unknowns: &[(usize, Scalar, Option<Fit>)], row: &Row, exchanged: bool) -> Vec<Value> {
    let mut letters: Vec<usize> = unknowns.iter().filter(|u| u.2.is_none()).map(|u| u.0).collect();
    if exchanged {
        letters.reverse();
    }
    letters.into_iter().map(|letter| row[letter]).collect()
}

#[test]
fn every_rewrite_is_applied_and_preserves_bits_in_both_precisions() {
    let mut random = Random(17);
    for rule in REWRITES {
        let mut seen = false;
        let unknowns = unknowns(rule);
        for precision in PRECISIONS {
            let most = [usize::MAX, usize::MAX, usize::MAX, 20, 12][unknowns.len()];
            let mut all = rows(&unknowns, |scalar, fit| {
                let mut values = special(scalar, precision, fit);
                values.truncate(most);
                values
            });
            let drawn = (0..2000).map(|_| {
                let mut row = BLANK;
                unknowns.iter().for_each(|(letter, scalar, fit)| row[*letter] = random.value(*scalar, precision, *fit));
                row
            });
            all.extend(drawn);
            let known = |row: &Row| -> Vec<u64> {
                let bits = |value: Value| match value {
                    Value::Real(x) => x.to_bits(),
                    Value::Int(x) => x as u64,
                    Value::Bool(x) => u64::from(x),
                };
                unknowns.iter().filter(|u| u.2.is_some()).map(|u| bits(row[u.0])).collect()
            };
            all.sort_by_key(known);
            for rows in all.chunk_by(|a, b| known(a) == known(b)) {
                let plain = make(&rule.left, &unknowns, &rows[0], Mode::Raw, false);
                let rewritten = [false, true].map(|e| make(&rule.left, &unknowns, &rows[0], Mode::Real(precision), e));
                for made in &rewritten {
                    // A rewrite of this very constant, such as that of x·1, comes before the one of all.
                    let itself = made.applied.is_some_and(|applied| std::ptr::eq(applied, rule));
                    let by_constant = unknowns.iter().any(|u| u.2.is_some()) && made.applied.is_some();
                    seen |= itself;
                    let applied = made.applied.map(ToString::to_string);
                    assert!(itself || by_constant, "{rule} at {:?}: {applied:?} applies", rows[0]);
                }
                for row in rows {
                    let want = evaluate(&plain.graph, precision, &inputs(&unknowns, row, false)).unwrap()[0];
                    for (made, exchanged) in rewritten.iter().zip([false, true]) {
                        let got = evaluate(&made.graph, precision, &inputs(&unknowns, row, exchanged)).unwrap()[0];
                        assert!(want.same_bits(got), "{rule} at {row:?}: {want:?}, rewritten {got:?}");
                    }
                }
            }
        }
        assert!(seen, "{rule} is never applied");
    }
}

#[test]
fn a_rewrite_makes_at_most_one_operation_for_the_one_it_takes_away() {
    fn operations(term: &Term) -> usize {
        match term {
            Term::Apply(_, terms) => {
                let constant = terms.iter().all(|t| matches!(t, Term::Known(..) | Term::Constant(_)));
                usize::from(!constant) + terms.iter().map(operations).sum::<usize>()
            }
            _ => 0,
        }
    }
    for rule in REWRITES {
        assert!(operations(&rule.right) <= 1, "{rule}: what the left side looks into may have other users");
    }
}

#[test]
fn powers_of_two_end_where_their_inverses_do() {
    let all = (-1074..1024).flat_map(|n| [2f64.powi(n), -2f64.powi(n)].map(|x| (n, x)));
    for (n, x) in all {
        assert_eq!(Fit::PowerOfTwo.admits(Value::Real(x)), (-122..=122).contains(&n), "2^{n}");
        if (-122..=122).contains(&n) {
            let inverse = (1.0 / x) as f32;
            assert!(inverse.is_normal() && (x as f32).is_normal() && f64::from(inverse) * x == 1.0, "2^{n}");
        }
    }
    for x in [0.0, 3.0, 1.5, f64::INFINITY, f64::NAN, 1.0 + f64::EPSILON] {
        assert!(!Fit::PowerOfTwo.admits(Value::Real(x)), "{x}");
    }
}

#[test]
fn small_formats_round_to_the_nearest_and_of_two_to_the_even() {
    for n in 1..5 {
        let small = Small::for_letters(n);
        let mut finite: Vec<f64> = small.reals().into_iter().filter(|x| x.is_finite() && *x >= 0.0).collect();
        finite.retain(|x| x.to_bits() != (-0.0_f64).to_bits());
        finite.sort_by(f64::total_cmp);
        for (i, pair) in finite.windows(2).enumerate() {
            let middle = (pair[0] + pair[1]) / 2.0;
            assert_eq!(small.round(pair[0]), pair[0]);
            assert_eq!(small.round(middle), pair[i % 2], "{middle}: the number of even place is the even one");
            assert_eq!(small.round(middle.next_down()), pair[0]);
            assert_eq!(small.round(-middle.next_up()), -pair[1]);
        }
        let largest = small.largest();
        assert_eq!(finite.last(), Some(&largest));
        let half = (largest - finite[finite.len() - 2]) / 2.0;
        assert_eq!(small.round(largest + half), f64::INFINITY);
        assert_eq!(small.round((largest + half).next_down()), largest);
    }
}
