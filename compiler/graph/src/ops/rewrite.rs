//! The rewrites of a folding builder: one table, one line per rewrite, both sides as terms. Each side has the bits of the
//! other for every operand (NaNs are one value, LANGUAGE 17.1), which the tests show rule by rule; knows nothing of uses.

use std::fmt;

use crate::{Builder, Node, NodeId, Op, Value};

/// One rewrite: what looks like `left` becomes `right`.
#[derive(Debug)]
pub struct Rewrite {
    /// The operation that is rewritten, with its operands. Operands of operations that commute stand in either order.
    pub left: Term,
    /// What takes its place.
    pub right: Term,
}

/// A side of a [`Rewrite`], or a part of one.
#[derive(Debug)]
pub enum Term {
    /// Any value; the same one wherever the letter stands.
    Any(Letter),
    /// On the left any constant that fits, on the right the same.
    Known(Letter, Fit),
    /// This very constant.
    Constant(Value),
    /// An operation; on the right, one of constants is a constant.
    Apply(Op, &'static [Term]),
}

/// A variable of a rule, by its place among [`LETTERS`].
pub type Letter = usize;

/// What the variables of rules are called.
pub const LETTERS: [&str; 6] = ["x", "y", "z", "w", "k", "l"];

/// Which constants a [`Term::Known`] stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fit {
    /// All.
    Constant,
    /// 2ⁿ and −2ⁿ, |n| ≤ 122: these and their inverses are normal numbers in either precision.
    PowerOfTwo,
}

impl Fit {
    /// Whether it stands for this one.
    #[must_use]
    pub fn admits(self, value: Value) -> bool {
        match (self, value) {
            (Self::Constant, _) => true,
            (Self::PowerOfTwo, Value::Real(x)) => x.to_bits() << 12 == 0 && (1e-37..1e37).contains(&x.abs()),
            (Self::PowerOfTwo, _) => false,
        }
    }
}

macro_rules! term {
    (x) => { Term::Any(0) };
    (y) => { Term::Any(1) };
    (z) => { Term::Any(2) };
    (w) => { Term::Any(3) };
    (k) => { Term::Known(4, Fit::Constant) };
    (l) => { Term::Known(5, Fit::Constant) };
    ([k: $fit:ident]) => { Term::Known(4, Fit::$fit) };
    ([$value:expr]) => { Term::Constant(Value::Real($value)) };
    ([int $value:expr]) => { Term::Constant(Value::Int($value)) };
    ([bool $value:expr]) => { Term::Constant(Value::Bool($value)) };
    (($op:ident $($arg:tt)+)) => { Term::Apply(Op::$op, &[$(term!($arg)),+]) };
}

macro_rules! rules {
    ($( $left:tt => $right:tt; )+) => { &[$( Rewrite { left: term!($left), right: term!($right) } ),+] };
}

/// Every rewrite, by the operation on its left side; of those that apply the first is taken. None makes more
/// operations than it takes away even if the operands that it looks into have other users, so that graphs only shrink
/// and rewriting ends.
#[rustfmt::skip]
pub static REWRITES: &[Rewrite] = rules! {
    (Add x [-0.0]) => x;
    (Add x (Neg y)) => (Sub x y);

    (Sub x [0.0]) => x;
    (Sub [-0.0] x) => (Neg x);
    (Sub x (Neg y)) => (Add x y);

    (Mul x [1.0]) => x;
    (Mul x [-1.0]) => (Neg x);
    (Mul x [2.0]) => (Add x x);
    (Mul (Neg x) k) => (Mul x (Neg k));
    (Mul (Neg x) (Neg y)) => (Mul x y);
    (Mul (Abs x) (Abs x)) => (Mul x x);

    (Div x [1.0]) => x;
    (Div x [-1.0]) => (Neg x);
    (Div x [k: PowerOfTwo]) => (Mul x (Div [1.0] k));
    (Div (Neg x) k) => (Div x (Neg k));
    (Div k (Neg x)) => (Div (Neg k) x);
    (Div (Neg x) (Neg y)) => (Div x y);

    (Neg (Neg x)) => x;

    (Abs (Neg x)) => (Abs x);
    (Abs (Abs x)) => (Abs x);
    (Abs (Length2 x y)) => (Length2 x y);
    (Abs (Length3 x y z)) => (Length3 x y z);
    (Abs (Length4 x y z w)) => (Length4 x y z w);

    (Min x x) => x;
    (Max x x) => x;

    (Not (Not x)) => x;

    (And x x) => x;
    (And x [bool true]) => x;
    (And x [bool false]) => [bool false];

    (Or x x) => x;
    (Or x [bool false]) => x;
    (Or x [bool true]) => [bool true];

    (Select [bool true] x y) => x;
    (Select [bool false] x y) => y;
    (Select x y y) => y;
    (Select (Not x) y z) => (Select x z y);
    (Select x (Select x y z) w) => (Select x y w);
    (Select x y (Select x z w)) => (Select x y w);

    (SelectInt [bool true] x y) => x;
    (SelectInt [bool false] x y) => y;
    (SelectInt x y y) => y;
    (SelectInt (Not x) y z) => (SelectInt x z y);
    (SelectInt x (SelectInt x y z) w) => (SelectInt x y w);
    (SelectInt x y (SelectInt x z w)) => (SelectInt x y w);

    (SelectBool [bool true] x y) => x;
    (SelectBool [bool false] x y) => y;
    (SelectBool x y y) => y;
    (SelectBool (Not x) y z) => (SelectBool x z y);
    (SelectBool x (SelectBool x y z) w) => (SelectBool x y w);
    (SelectBool x y (SelectBool x z w)) => (SelectBool x y w);
    (SelectBool x [bool true] y) => (Or x y);
    (SelectBool x y [bool false]) => (And x y);

    (IntAdd x [int 0]) => x;
    (IntSub x [int 0]) => x;
    (IntMul x [int 1]) => x;
    (IntMin x x) => x;
    (IntMax x x) => x;
};

/// What the rules of one operation look at.
#[derive(Clone, Copy)]
struct Group {
    /// Its rules, by place in [`REWRITES`].
    begin: usize,
    end: usize,
    /// The operations that an operand is on some left side, a bit for each.
    heads: u128,
    /// Whether some left side has a constant operand.
    constants: bool,
    /// Whether some left side has the same operand twice.
    twice: bool,
}

const NONE: Group = Group { begin: 0, end: 0, heads: 0, constants: false, twice: false };

/// By operation. Of most operations in a graph it says at once that nothing applies.
static GROUPS: [Group; Op::ALL.len()] = groups();

#[expect(clippy::indexing_slicing, clippy::panic, reason = "at compile time")]
const fn groups() -> [Group; Op::ALL.len()] {
    const { assert!(Op::ALL.len() <= 128, "`heads` has a bit for each operation") };
    let mut groups = [NONE; Op::ALL.len()];
    let mut at = 0;
    while at < REWRITES.len() {
        let Term::Apply(op, operands) = &REWRITES[at].left else { panic!("a left side is an operation") };
        let group = &mut groups[*op as usize];
        if group.end == 0 {
            group.begin = at;
        } else {
            assert!(group.end == at, "the rules of an operation stand together");
        }
        group.end = at + 1;
        let mut letters = 0_u32;
        let mut i = 0;
        while i < operands.len() {
            match &operands[i] {
                Term::Any(letter) => {
                    group.twice |= letters & 1 << *letter != 0;
                    letters |= 1 << *letter;
                }
                Term::Known(..) | Term::Constant(_) => group.constants = true,
                Term::Apply(op, _) => group.heads |= 1 << *op as u32,
            }
            i += 1;
        }
        at += 1;
    }
    groups
}

impl Group {
    /// Whether an operand is such that a rule may apply.
    fn may_apply(&self, b: &Builder<'_>, args: &[NodeId]) -> bool {
        if self.end == 0 {
            return false;
        }
        let looked_at = |x: &NodeId| match b.graph().get(*x) {
            Some(Node::Apply(op, _)) => self.heads & 1 << op as u32 != 0,
            Some(Node::Real(_) | Node::Int(_) | Node::Bool(_)) => self.constants,
            _ => false,
        };
        args.iter().any(looked_at) || (self.twice && args.iter().zip(args.iter().skip(1)).any(|(x, y)| x == y))
    }
}

/// What the letters of a rule stand for.
type Bindings = [NodeId; LETTERS.len()];

/// The rewrite that applies to an operation, and what its letters stand for.
fn find(b: &Builder<'_>, op: Op, args: &[NodeId]) -> Option<(&'static Rewrite, Bindings)> {
    let group = GROUPS.get(op as usize)?;
    if !group.may_apply(b, args) {
        return None;
    }
    let rules = REWRITES.get(group.begin..group.end)?;
    rules.iter().find_map(|rule| Some((rule, rule.matches(b, args)?)))
}

/// The rewrite that applies to an operation, if one does.
#[must_use]
pub fn applicable(b: &Builder<'_>, op: Op, args: &[NodeId]) -> Option<&'static Rewrite> {
    find(b, op, args).map(|(rule, _)| rule)
}

/// What the operation simplifies to, if a rewrite applies.
pub fn rewrite(b: &mut Builder<'_>, op: Op, args: &[NodeId]) -> Option<NodeId> {
    let (rule, letters) = find(b, op, args)?;
    Some(rule.right.build(b, &letters))
}

impl Rewrite {
    fn matches(&self, b: &Builder<'_>, args: &[NodeId]) -> Option<Bindings> {
        let Term::Apply(op, operands) = &self.left else { return None };
        let mut orders = Orders::default();
        loop {
            let mut letters = [NodeId::NONE; LETTERS.len()];
            if operands_match(b, *op, operands, args, &mut letters, &mut orders) {
                return Some(letters);
            }
            orders = orders.next()?;
        }
    }
}

/// One choice of the order of operands of each commuting operation of a left side.
#[derive(Default)]
struct Orders {
    /// A bit for each, set if its first two operands are exchanged.
    exchanged: u32,
    /// How many were met.
    met: u32,
}

impl Orders {
    fn take(&mut self) -> bool {
        self.met += 1;
        self.exchanged & 1 << (self.met - 1) != 0
    }

    fn next(self) -> Option<Self> {
        let exchanged = self.exchanged + 1;
        (exchanged < 1 << self.met).then_some(Self { exchanged, met: 0 })
    }
}

fn operands_match(
    b: &Builder<'_>,
    op: Op,
    terms: &[Term],
    args: &[NodeId],
    letters: &mut Bindings,
    orders: &mut Orders,
) -> bool {
    match (op.def().commutes, args) {
        (true, [x, y, rest @ ..]) if orders.take() => {
            let exchanged = [y, x].into_iter().chain(rest);
            terms.len() == args.len() && terms.iter().zip(exchanged).all(|(t, x)| t.matches(b, *x, letters, orders))
        }
        _ => terms.len() == args.len() && terms.iter().zip(args).all(|(t, x)| t.matches(b, *x, letters, orders)),
    }
}

impl Term {
    fn matches(&self, b: &Builder<'_>, x: NodeId, letters: &mut Bindings, orders: &mut Orders) -> bool {
        let mut bind = |letter: Letter| match letters.get_mut(letter) {
            Some(place) if *place == NodeId::NONE => {
                *place = x;
                true
            }
            Some(place) => *place == x,
            None => false,
        };
        match self {
            Self::Any(letter) => bind(*letter),
            Self::Known(letter, fit) => b.value(x).is_some_and(|value| fit.admits(value)) && bind(*letter),
            Self::Constant(constant) => b.value(x).is_some_and(|value| value.same_bits(*constant)),
            Self::Apply(op, terms) => match b.graph().get(x) {
                Some(Node::Apply(of, args)) if of == *op => {
                    operands_match(b, *op, terms, args.as_slice(), letters, orders)
                }
                _ => false,
            },
        }
    }

    fn build(&self, b: &mut Builder<'_>, letters: &Bindings) -> NodeId {
        match self {
            Self::Any(letter) | Self::Known(letter, _) => letters.get(*letter).copied().unwrap_or(NodeId::NONE),
            Self::Constant(value) => b.constant(*value),
            Self::Apply(op, terms) => {
                let mut args = [NodeId::NONE; 4];
                for (place, term) in args.iter_mut().zip(*terms) {
                    *place = term.build(b, letters);
                }
                b.op(*op, args.get(..terms.len()).unwrap_or(&[]))
            }
        }
    }
}

impl fmt::Display for Rewrite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}", self.left, self.right)
    }
}

impl fmt::Display for Term {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Any(letter) | Self::Known(letter, _) => f.write_str(LETTERS.get(*letter).unwrap_or(&"?")),
            Self::Constant(Value::Real(x)) => write!(f, "{x:?}"),
            Self::Constant(Value::Int(x)) => write!(f, "{x}"),
            Self::Constant(Value::Bool(x)) => write!(f, "{x}"),
            Self::Apply(op, terms) => {
                write!(f, "{op}(")?;
                for (i, term) in terms.iter().enumerate() {
                    write!(f, "{}{term}", if i == 0 { "" } else { ", " })?;
                }
                f.write_str(")")
            }
        }
    }
}
