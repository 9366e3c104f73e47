//! Mistakes planted in copies of the op table: the laws must catch each of them. Were one to pass, the law would be worth
//! nothing for that rule. What was planted and which law caught it stands in `docs/mutations.md`, which
//! `ISOGRAD_BLESS=1 cargo test --release --test planted` writes.

#![allow(clippy::pedantic, reason = "tests")]

#[path = "planted/enclosures.rs"]
mod enclosures;
#[path = "planted/page.rs"]
mod page;

use std::cell::Cell;

use isograd_graph::ops::{Derivative, Discriminant, Kink, Partial, Rule};
use isograd_graph::{Builder, NodeId, Op, OpDef, Scalar};
use isograd_testkit::laws;

/// What is wrong with a rule.
#[derive(Clone, Copy, Debug)]
enum Mistake {
    /// −f′
    Negated,
    /// f′·(1 + 10⁻⁹)
    Scaled,
    /// f′ + 10⁻⁹
    Shifted,
    /// 0
    Dropped,
    /// 1
    One,
    /// The rule of the next operand.
    Exchanged,
    /// f′², as if the rule had been applied twice.
    Squared,
}

const OPERANDS: [&str; 4] = ["a", "b", "c", "d"];

const MISTAKES: [Mistake; 7] = [
    Mistake::Negated,
    Mistake::Scaled,
    Mistake::Shifted,
    Mistake::Dropped,
    Mistake::One,
    Mistake::Exchanged,
    Mistake::Squared,
];

thread_local! {
    /// The rule that `altered` alters: rules are function pointers and carry nothing with them.
    static RULE: Cell<Option<(Rule, Mistake)>> = const { Cell::new(None) };
}

fn altered(b: &mut Builder<'_>, args: &[NodeId], result: NodeId) -> NodeId {
    let (rule, mistake) = RULE.get().expect("set before use");
    let slope = rule(b, args, result);
    match mistake {
        Mistake::Negated => b.neg(slope),
        Mistake::Scaled => {
            let factor = b.real(1.0 + 1e-9);
            b.mul(slope, factor)
        }
        Mistake::Shifted => {
            let shift = b.real(1e-9);
            b.add(slope, shift)
        }
        Mistake::Squared => b.mul(slope, slope),
        Mistake::Dropped | Mistake::One | Mistake::Exchanged => slope,
    }
}

fn one(b: &mut Builder<'_>, _: &[NodeId], _: NodeId) -> NodeId {
    b.real(1.0)
}

fn minus_one(b: &mut Builder<'_>, _: &[NodeId], _: NodeId) -> NodeId {
    b.real(-1.0)
}

fn zero(b: &mut Builder<'_>, _: &[NodeId], _: NodeId) -> NodeId {
    b.real(0.0)
}

/// The partial with a mistake; `None` if that is no mistake.
fn with_mistake(partials: &[Partial], k: usize, mistake: Mistake) -> Option<Partial> {
    let next = &partials[(k + 1) % partials.len()];
    match (&partials[k], mistake) {
        (Partial::Zero, Mistake::Dropped | Mistake::Negated | Mistake::Scaled | Mistake::Squared) => None,
        (Partial::One, Mistake::One | Mistake::Squared) => None,
        (_, Mistake::Dropped) => Some(Partial::Zero),
        (_, Mistake::One) => Some(Partial::One),
        (partial, Mistake::Exchanged) if same(partial, next) => None,
        (_, Mistake::Exchanged) => Some(next.clone()),
        (partial, _) => {
            let rule = match partial {
                Partial::Zero => zero,
                Partial::One => one,
                Partial::MinusOne => minus_one,
                Partial::Of(rule) => *rule,
            };
            RULE.set(Some((rule, mistake)));
            Some(Partial::Of(altered))
        }
    }
}

fn same(a: &Partial, b: &Partial) -> bool {
    match (a, b) {
        (Partial::Of(a), Partial::Of(b)) => std::ptr::fn_addr_eq(*a, *b),
        (a, b) => std::mem::discriminant(a) == std::mem::discriminant(b),
    }
}

fn is_caught(op: Op, derivative: Derivative) -> bool {
    let def = OpDef { derivative, ..op.def().clone() };
    laws::derivative(op, &def, 40, 7).is_err()
}

/// A mistake in the rules of an operation, and the law that caught it.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Planted {
    op: Op,
    mistake: String,
    /// The law that caught it, or why nothing could.
    law: Result<&'static str, &'static str>,
}

/// Mistakes in partial derivatives, one at a time.
fn partials() -> Vec<Planted> {
    let mut all = Vec::new();
    for op in Op::ALL {
        let Derivative::Partials(partials) = op.def().derivative else { continue };
        for k in 0..partials.len() {
            for mistake in MISTAKES {
                let Some(wrong) = with_mistake(partials, k, mistake) else { continue };
                let mut altered = partials.to_vec();
                altered[k] = wrong;
                let caught = is_caught(*op, Derivative::Partials(altered.leak()));
                let law = if caught { Ok("derivative") } else { Err("missed") };
                all.push(Planted { op: *op, mistake: format!("{mistake:?}({})", OPERANDS[k]), law });
            }
        }
    }
    all
}

/// Mistakes in the choices of `min`, `max` and the selections.
fn choices() -> Vec<Planted> {
    let mut all = Vec::new();
    for op in Op::ALL {
        let Derivative::Choice { cond, then, otherwise } = op.def().derivative else { continue };
        let wrong = [
            ("Exchanged", Derivative::Choice { cond, then: otherwise, otherwise: then }),
            ("Always", Derivative::Choice { cond, then, otherwise: then }),
            ("Never", Derivative::Choice { cond, then: otherwise, otherwise }),
            ("Inverted", Derivative::Choice { cond: inverted(*op), then, otherwise }),
            ("Dropped", Derivative::Zero),
        ];
        for (mistake, derivative) in wrong {
            let law = if is_caught(*op, derivative) { Ok("derivative") } else { Err("missed") };
            all.push(Planted { op: *op, mistake: mistake.to_owned(), law });
        }
    }
    all
}

type Condition = fn(&mut Builder<'_>, &[NodeId]) -> NodeId;

/// The condition the other way round.
fn inverted(op: Op) -> Condition {
    match op {
        Op::Min => |b, args| b.lt(args[0], args[1]),
        Op::Max => |b, args| b.lt(args[1], args[0]),
        _ => |b, args| b.not(args[0]),
    }
}

thread_local! {
    /// The discriminant that `shifted` shifts.
    static DISCRIMINANT: Cell<Option<Discriminant>> = const { Cell::new(None) };
}

fn shifted(b: &mut Builder<'_>, args: &[NodeId]) -> NodeId {
    let off = DISCRIMINANT.get().expect("set before use")(b, args);
    let shift = b.real(0.03);
    b.sub(off, shift)
}

/// Kinks nowhere, everywhere and beside where they are.
fn kinks() -> Vec<Planted> {
    let nowhere: Discriminant = |b, _| b.real(1.0);
    let everywhere: Discriminant = |b, _| b.real(0.0);
    let mut all = Vec::new();
    for op in Op::ALL {
        let Kink::Where { set, measure, slopes, jumps, discriminant } = op.def().kink else { continue };
        DISCRIMINANT.set(Some(discriminant));
        for (mistake, wrong) in [("Nowhere", nowhere), ("Everywhere", everywhere), ("Shifted", shifted)] {
            let kink = Kink::Where { set, measure, slopes, jumps, discriminant: wrong };
            let caught = laws::kink(*op, &OpDef { kink, ..op.def().clone() }, 40, 9).is_err();
            let law = if caught { Ok("kink") } else { Err("missed") };
            all.push(Planted { op: *op, mistake: mistake.to_owned(), law });
        }
    }
    all
}

/// Slopes on the wrong sides, and kinks that are not declared at all.
#[test]
fn kinks_of_the_wrong_kind_are_caught() {
    for op in Op::ALL {
        let Kink::Where { set, measure, slopes, jumps, discriminant } = op.def().kink else { continue };
        let exchanged = [slopes[2], slopes[1], slopes[0]];
        if matches!(op, Op::Abs | Op::Min | Op::Max) {
            let kink = Kink::Where { set, measure, slopes: exchanged, jumps, discriminant };
            assert!(laws::kink(*op, &OpDef { kink, ..op.def().clone() }, 40, 9).is_err(), "{op}: {exchanged:?}");
        }
    }
    // Vertical slopes at an end of the domain are not looked for along lines.
    for op in [Op::Abs, Op::Min, Op::Max, Op::Floor, Op::Fract, Op::Mod, Op::Sign, Op::Atan2, Op::Lt, Op::RealToInt] {
        assert!(laws::kink(op, &OpDef { kink: Kink::None, ..op.def().clone() }, 40, 9).is_err(), "{op}");
    }
}

/// Rules that are right everywhere but in the kink, where they break LANGUAGE 13.6.
#[test]
fn broken_conventions_are_caught() {
    let steep: Rule = |b, _, result| {
        let half = b.real(0.5);
        b.div(half, result)
    };
    let sided: Rule = |b, args, _| {
        let one = b.real(1.0);
        b.copysign(one, args[0])
    };
    let divided: Rule = |b, args, result| b.div(args[0], result);
    let chord: Rule = |b, args, _| {
        let one = b.real(1.0);
        let square = b.mul(args[0], args[0]);
        let rest = b.sub(one, square);
        let root = b.sqrt(rest);
        b.div(one, root)
    };
    let arcosine: Rule = |b, args, _| {
        let one = b.real(1.0);
        let square = b.mul(args[0], args[0]);
        let rest = b.sub(square, one);
        let root = b.sqrt(rest);
        b.div(one, root)
    };
    let power: Rule = |b, args, _| {
        let one = b.real(1.0);
        let less = b.sub(args[1], one);
        let power = b.pow(args[0], less);
        b.mul(args[1], power)
    };
    let logarithm: Rule = |b, args, result| {
        let log = b.log(args[0]);
        b.mul(result, log)
    };
    let angle: Rule = |b, args, _| {
        let (y, x) = (b.mul(args[0], args[0]), b.mul(args[1], args[1]));
        let square = b.add(y, x);
        b.div(args[1], square)
    };
    let whole: Rule = |b, args, _| {
        let one = b.real(1.0);
        b.div(one, args[1])
    };
    let cases = [
        (Op::Sqrt, 0, steep),
        (Op::Abs, 0, sided),
        (Op::Length2, 0, divided),
        (Op::Length3, 0, divided),
        (Op::Length4, 0, divided),
        (Op::Asin, 0, chord),
        (Op::Acosh, 0, arcosine),
        (Op::Pow, 0, power),
        (Op::Pow, 1, logarithm),
        (Op::Atan2, 0, angle),
        (Op::Unit, 0, whole),
    ];
    for (op, k, rule) in cases {
        let Derivative::Partials(partials) = op.def().derivative else { panic!("{op} has partials") };
        let mut altered = partials.to_vec();
        altered[k] = Partial::Of(rule);
        assert!(is_caught(op, Derivative::Partials(altered.leak())), "{op} by operand {k}");
    }
    // Ties: `≤` instead of `<` takes the other operand where both are equal.
    let ties: [(Op, Condition); 2] =
        [(Op::Min, |b, args| b.le(args[1], args[0])), (Op::Max, |b, args| b.le(args[0], args[1]))];
    for (op, cond) in ties {
        assert!(is_caught(op, Derivative::Choice { cond, then: 1, otherwise: 0 }), "{op}");
    }
}

/// Operations that change in steps have derivative 0; giving them any other is caught, and so is a derivative of
/// what is no real.
#[test]
fn derivatives_where_there_are_none_are_caught() {
    for op in Op::ALL.iter().filter(|op| matches!(op.def().derivative, Derivative::Zero)) {
        let operands = op.def().operands;
        if op.def().result == Scalar::Real {
            let partials = vec![Partial::One; operands.len()];
            assert!(is_caught(*op, Derivative::Partials(partials.leak())), "{op}");
        }
    }
    assert!(is_caught(Op::Scale, Derivative::Partials(vec![Partial::One, Partial::One].leak())));
}

#[test]
fn the_table_itself_passes() {
    for op in Op::ALL {
        laws::derivative(*op, op.def(), 40, 7).unwrap_or_else(|failure| panic!("{failure}"));
        enclosures::passes(*op);
    }
}

#[test]
fn every_mistake_is_caught() {
    let lists = [partials(), choices(), kinks(), enclosures::mistakes()];
    println!("{:?} mistakes in partials, choices, kinks, enclosures", lists.each_ref().map(Vec::len));
    assert!(lists.iter().zip([180, 15, 75, 800]).all(|(list, least)| list.len() >= least));
    let all = lists.concat();
    let missed: Vec<String> =
        all.iter().filter(|p| p.law == Err("missed")).map(|p| format!("{}: {}", p.op, p.mistake)).collect();
    println!("{missed:#?}");
    page::check(&page::written(&all)).unwrap_or_else(|why| panic!("{why}"));
    assert!(missed.is_empty(), "{} of {} are missed", missed.len(), all.len());
}
