//! Mistakes in interval rules, one at a time. Some are made in what goes into a rule and comes out of it, others in the
//! text of the graph that the rule builds. Knows no rule.

use std::cell::Cell;

use isograd_graph::ops::{Accuracy, EnclosureRule};
use isograd_graph::{
    Builder, Enclosure, Facts, Mode, NodeId, Op, OpDef, Precision, Range, Scalar, Unwatched, Value, print,
};
use isograd_testkit::laws::enclosure::{Form, Rule, altered_enclosure, altered_tightness};
use isograd_testkit::points::Random;
use isograd_testkit::soundness::boxes::Side;

use crate::{OPERANDS, Planted};

/// What is wrong with a rule.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mistake {
    /// The ends are exchanged, or what may be true with what may be false.
    Swapped,
    /// The lower end lies further up than errors reach, or nothing may be true.
    LowerRaised,
    /// The upper end lies further down, or nothing may be false.
    UpperLowered,
    /// The lower end of an operand (or that it may be true) is not seen: the other stands for it.
    LowerForgotten(usize),
    /// The upper end of an operand (or that it may be false) is not seen.
    UpperForgotten(usize),
    /// That an operand may be NaN is not seen.
    FlagForgotten(usize),
    /// The result is never flagged.
    Unflagged,
    /// Both ends of the operand as it is, whether or not it lies in the domain.
    DomainForgotten,
    /// Directed operations round to nearest.
    Nearest,
    /// Kernels are not widened by their error.
    Unwidened,
    /// One of the smallest and largest of several numbers is one of them: a corner is left out.
    CornerDropped(usize, bool),
    /// The lower end is further out than it may be.
    LowerLoose,
    /// The upper end is further out than it may be.
    UpperLoose,
    /// The result is always flagged.
    Flagged,
}

impl Mistake {
    fn name(self) -> String {
        match self {
            Self::LowerForgotten(k) => format!("LowerForgotten({})", OPERANDS[k]),
            Self::UpperForgotten(k) => format!("UpperForgotten({})", OPERANDS[k]),
            Self::FlagForgotten(k) => format!("FlagForgotten({})", OPERANDS[k]),
            Self::CornerDropped(k, second) => format!("CornerDropped({}{})", k + 1, if second { "b" } else { "a" }),
            other => format!("{other:?}"),
        }
    }

    fn in_text(self) -> bool {
        matches!(self, Self::Nearest | Self::Unwidened | Self::CornerDropped(..))
    }
}

thread_local! {
    /// The operation and the mistake of `altered`: rules are function pointers and carry nothing with them.
    static PLANTED: Cell<Option<(Op, Mistake)>> = const { Cell::new(None) };
}

fn altered(b: &mut Builder<'_>, operands: &[Enclosure], facts: Facts) -> Enclosure {
    let (op, mistake) = PLANTED.get().expect("set before use");
    let mut operands = operands.to_vec();
    let fine = op.def().accuracy == Accuracy::Exact;
    match mistake {
        Mistake::LowerForgotten(k) => operands[k] = forgotten(operands[k], false),
        Mistake::UpperForgotten(k) => operands[k] = forgotten(operands[k], true),
        Mistake::FlagForgotten(k) => {
            if let Enclosure::Real(x) = operands[k] {
                operands[k] = Enclosure::Real(Range { nan: b.bool(false), ..x });
            }
        }
        Mistake::DomainForgotten => {
            if let Enclosure::Real(x) = operands[0] {
                let (lo, hi) = (b.op(op, &[x.lo]), b.op(op, &[x.hi]));
                let (lo, hi) = if matches!(op, Op::Acos | Op::InverseSqrt) { (hi, lo) } else { (lo, hi) };
                return Enclosure::Real(Range { lo: moved(b, lo, false, 8), hi: moved(b, hi, true, 8), ..x });
            }
        }
        _ => {}
    }
    let rule: EnclosureRule = op.def().enclosure;
    let result = rule(b, &operands, facts);
    let (few, many) = (if fine { 1 } else { 10 }, 24);
    match (result, mistake) {
        (Enclosure::Real(x), _) => Enclosure::Real(match mistake {
            Mistake::Swapped => Range { lo: x.hi, hi: x.lo, ..x },
            Mistake::LowerRaised => Range { lo: moved(b, x.lo, true, few), ..x },
            Mistake::UpperLowered => Range { hi: moved(b, x.hi, false, few), ..x },
            Mistake::LowerLoose => Range { lo: moved(b, x.lo, false, many), ..x },
            Mistake::UpperLoose => Range { hi: moved(b, x.hi, true, many), ..x },
            Mistake::Unflagged => Range { nan: b.bool(false), ..x },
            Mistake::Flagged => Range { nan: b.bool(true), ..x },
            _ => x,
        }),
        (Enclosure::Int { lo, hi }, _) => {
            let one = b.int(1);
            match mistake {
                Mistake::Swapped => Enclosure::Int { lo: hi, hi: lo },
                Mistake::LowerRaised => Enclosure::Int { lo: b.iadd(lo, one), hi },
                Mistake::UpperLowered => Enclosure::Int { lo, hi: b.isub(hi, one) },
                Mistake::LowerLoose => Enclosure::Int { lo: b.isub(lo, one), hi },
                Mistake::UpperLoose => Enclosure::Int { lo, hi: b.iadd(hi, one) },
                _ => result,
            }
        }
        (Enclosure::Bool { yes, no }, _) => match mistake {
            Mistake::Swapped => Enclosure::Bool { yes: no, no: yes },
            Mistake::LowerRaised => Enclosure::Bool { yes: b.bool(false), no },
            Mistake::UpperLowered => Enclosure::Bool { yes, no: b.bool(false) },
            Mistake::LowerLoose => Enclosure::Bool { yes: b.bool(true), no },
            Mistake::UpperLoose => Enclosure::Bool { yes, no: b.bool(true) },
            _ => result,
        },
    }
}

/// With one end in the place of the other; a truth value that may be one thing only, may be the other instead.
fn forgotten(x: Enclosure, upper: bool) -> Enclosure {
    match (x, upper) {
        (Enclosure::Real(x), false) => Enclosure::Real(Range { lo: x.hi, ..x }),
        (Enclosure::Real(x), true) => Enclosure::Real(Range { hi: x.lo, ..x }),
        (Enclosure::Int { hi, .. }, false) => Enclosure::Int { lo: hi, hi },
        (Enclosure::Int { lo, .. }, true) => Enclosure::Int { lo, hi: lo },
        (Enclosure::Bool { no, .. }, false) => Enclosure::Bool { yes: no, no },
        (Enclosure::Bool { yes, .. }, true) => Enclosure::Bool { yes, no: yes },
    }
}

fn moved(b: &mut Builder<'_>, x: NodeId, up: bool, steps: u32) -> NodeId {
    (0..steps).fold(x, |x, _| if up { b.next_up(x) } else { b.next_down(x) })
}

/// The text of a rule's graph with the mistake.
fn text(before: &str, mistake: Mistake) -> String {
    let mut corners = 0;
    let line = |line: &str| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let &[id, equals, name, ref args @ ..] = &words[..] else { return line.to_owned() };
        match mistake {
            Mistake::Nearest => {
                let directed = ["add", "mul", "div", "sqrt"]
                    .iter()
                    .find(|plain| name.strip_prefix(**plain).is_some_and(|way| way == "_down" || way == "_up"));
                directed.map_or(line.to_owned(), |plain| format!("{id} {equals} {plain} {}", args.join(" ")))
            }
            Mistake::Unwidened if name == "next_down" || name == "next_up" => {
                format!("{id} {equals} rounded {}", args.join(" "))
            }
            Mistake::CornerDropped(k, second) if ["min", "max", "imin", "imax"].contains(&name) => {
                corners += 1;
                let kept = args[usize::from(second)];
                if corners == k + 1 { format!("{id} {equals} {name} {kept} {kept}") } else { line.to_owned() }
            }
            _ => line.to_owned(),
        }
    };
    before.lines().map(line).collect::<Vec<_>>().join("\n")
}

/// The text of a rule's graph over boxes.
fn graph_of(op: Op) -> String {
    let mut b = Builder::new(Mode::Raw, 100_000, &Unwatched);
    let operands: Vec<Enclosure> = op
        .def()
        .operands
        .iter()
        .map(|kind| match kind {
            Scalar::Real => {
                let (lo, hi, nan) = (b.input("lo", *kind), b.input("hi", *kind), b.input("nan", Scalar::Bool));
                Enclosure::Real(Range { lo, hi, nan, tidy: true })
            }
            Scalar::Int => Enclosure::Int { lo: b.input("lo", *kind), hi: b.input("hi", *kind) },
            Scalar::Bool => Enclosure::Bool { yes: b.input("yes", *kind), no: b.input("no", *kind) },
        })
        .collect();
    (op.def().enclosure)(&mut b, &operands, Facts::default());
    print(&b.finish().expect("small"))
}

fn count(text: &str, names: &[&str]) -> usize {
    text.lines().filter(|line| line.split_whitespace().nth(2).is_some_and(|word| names.contains(&word))).count()
}

/// The mistakes that can be made in the rule of an operation.
fn of(op: Op) -> Vec<Mistake> {
    let def = op.def();
    let mut all =
        vec![Mistake::Swapped, Mistake::LowerRaised, Mistake::UpperLowered, Mistake::LowerLoose, Mistake::UpperLoose];
    // What directed operations give for a NaN is not specified.
    let flags = def.accuracy != Accuracy::Directed;
    for (k, kind) in def.operands.iter().enumerate() {
        all.extend([Mistake::LowerForgotten(k), Mistake::UpperForgotten(k)]);
        if *kind == Scalar::Real && flags {
            all.push(Mistake::FlagForgotten(k));
        }
    }
    if def.result == Scalar::Real && def.operands.contains(&Scalar::Real) && flags {
        all.push(Mistake::Unflagged);
    }
    if def.result == Scalar::Real {
        all.push(Mistake::Flagged);
    }
    if matches!(op, Op::Sqrt | Op::InverseSqrt | Op::Log | Op::Log2 | Op::Asin | Op::Acos | Op::Acosh | Op::Atanh) {
        all.push(Mistake::DomainForgotten);
    }
    let text = graph_of(op);
    let directed = ["add_down", "add_up", "mul_down", "mul_up", "div_down", "div_up", "sqrt_down", "sqrt_up"];
    if count(&text, &directed) > 0 {
        all.push(Mistake::Nearest);
    }
    if count(&text, &["next_down", "next_up"]) > 0 && matches!(def.accuracy, Accuracy::Ulp { .. }) {
        all.push(Mistake::Unwidened);
    }
    for k in 0..count(&text, &["min", "max", "imin", "imax"]) {
        all.extend([Mistake::CornerDropped(k, false), Mistake::CornerDropped(k, true)]);
    }
    all
}

/// Every mistake in every rule, and what catches it.
pub fn mistakes() -> Vec<Planted> {
    let mut all = Vec::new();
    for op in Op::ALL {
        for mistake in of(*op) {
            all.push(Planted { op: *op, mistake: mistake.name(), law: judged(*op, mistake) });
        }
    }
    all
}

/// Boxes of each precision over which survivors are compared with what is right.
pub const BOXES: usize = 3000;

fn with(op: Op, mistake: Mistake) -> OpDef {
    PLANTED.set(Some((op, mistake)));
    let enclosure: EnclosureRule = if mistake.in_text() { op.def().enclosure } else { altered };
    OpDef { enclosure, ..op.def().clone() }
}

fn judged(op: Op, mistake: Mistake) -> Result<&'static str, &'static str> {
    let def = with(op, mistake);
    let alter = |before: &str| text(before, mistake);
    for (boxes, seed) in [(40, 1), (300, 2)] {
        if altered_enclosure(op, &def, boxes, seed, alter).is_err() {
            return Ok("enclosure");
        }
        if altered_tightness(op, &def, boxes, seed, alter).is_err() {
            return Ok("tightness");
        }
    }
    match compared(op, &def, mistake, true) {
        Err("missed") if altered_enclosure(op, &def, 6000, 3, alter).is_err() => Ok("enclosure"),
        Err("missed") => compared(op, &def, mistake, false),
        survives => survives,
    }
}

/// What became of an enclosure that no law objects to: it is the same, or only wider within what is allowed. An operand
/// that is infinite and nothing else is no number; it is left out unless `infinite`.
fn compared(op: Op, def: &OpDef, mistake: Mistake, infinite: bool) -> Result<&'static str, &'static str> {
    let mut wider = false;
    for precision in [Precision::F32, Precision::F64] {
        let right = Rule::new(op, op.def(), precision, Form::Boxes).expect("the rule");
        let wrong = Rule::altered(op, def, precision, Form::Boxes, |before| text(before, mistake)).expect("the rule");
        let (mut judge_right, mut judge_wrong) = (right.judge(), wrong.judge());
        let mut random = Random::new(3);
        for _ in 0..BOXES {
            let sides = right.random_box(&mut random);
            if !infinite
                && sides.iter().any(|side| matches!(side, Side::Real { lo, hi, .. } if lo == hi && lo.is_infinite()))
            {
                continue;
            }
            let ends = [judge_right.enclosure(&sides), judge_wrong.enclosure(&sides)].map(|x| x.expect("few steps"));
            let [right, wrong] = &ends;
            let holds = match (&right[..], &wrong[..]) {
                (
                    [Value::Real(a), Value::Real(b), Value::Bool(p)],
                    [Value::Real(c), Value::Real(d), Value::Bool(q)],
                ) => (c <= a || a.is_nan()) && (b <= d || b.is_nan()) && (*q || !p),
                ([Value::Int(a), Value::Int(b)], [Value::Int(c), Value::Int(d)]) => c <= a && b <= d,
                ([Value::Bool(a), Value::Bool(b)], [Value::Bool(c), Value::Bool(d)]) => a <= c && b <= d,
                _ => false,
            };
            if !holds {
                return Err("missed");
            }
            wider |= !right.iter().zip(wrong).all(|(x, y)| x == y || x.same_bits(*y));
        }
    }
    Err(if wider { "only wider" } else { "no difference" })
}

/// The rule as it is passes both laws, and so does its text unaltered.
pub fn passes(op: Op) {
    for judgement in [
        altered_enclosure(op, op.def(), 1000, 2, str::to_owned),
        altered_tightness(op, op.def(), 1000, 2, str::to_owned),
    ] {
        judgement.unwrap_or_else(|failure| panic!("{failure}"));
    }
}
