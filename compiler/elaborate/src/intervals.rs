//! Intervals on the machine: the lower ends, the upper ends, and for each end whether the value may be NaN (LANGUAGE
//! 15.6). Knows nothing of how an operation is enclosed, which is in the op table, nor of how `bound` is expanded.

use isograd_graph::{Builder, Enclosure, Facts, Node, NodeId, Op, Part, Precision, Range, Scalar, Value};
use isograd_program::Type;
use isograd_program::typed::Instruction;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::builtins::Builtins as _;
use crate::machine::{Flow, Machine};
use crate::nodes::Nodes;
use crate::operators::Operators as _;
use crate::value::Scalars;

/// A component of an interval. Two intervals with the same ends are two values, so their product is no square (LANGUAGE
/// 15.4): `identity` tells them apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Component {
    enclosure: Enclosure,
    /// The flag of an interval, which is a node of its own; of a plain value the value.
    identity: NodeId,
}

/// What is known of intervals.
#[derive(Debug, Default)]
pub(crate) struct Known {
    /// Lower ends, upper ends and flags of intervals whose ends are in order and numbers of `real`.
    tidy: FxHashSet<[NodeId; 3]>,
    /// Results of operations by scope and operands.
    results: FxHashMap<(u32, Op, [Option<Component>; 4]), Component>,
    /// The precision that ends are computed in, where it is known already.
    precision: Option<Precision>,
}

impl Known {
    /// Ends are computed in this precision.
    pub(crate) const fn compute_in(&mut self, precision: Precision) {
        self.precision = Some(precision);
    }
}

/// The domain of enclosures.
pub(crate) struct Enclosures<'n, 'w>(&'n mut Nodes<'w>);

impl Enclosures<'_, '_> {
    /// What encloses an operation. In one scope the same operation on the same operands is the same value (LANGUAGE
    /// 13.3.5), and otherwise it is not, nor are its ends anything else that the program wrote.
    pub(crate) fn op(&mut self, op: Op, args: &[Component]) -> Component {
        let mut operands = [None; 4];
        for (place, arg) in operands.iter_mut().zip(args) {
            *place = Some(*arg);
        }
        let nodes = &mut *self.0;
        let key = (nodes.builder.scopes().next().unwrap_or(0), op, operands);
        if let Some(known) = nodes.intervals.results.get(&key) {
            return *known;
        }
        let same = matches!(args, [a, b] if a == b);
        // No formula divides a component by anything but the length of its vector.
        let facts = Facts { same, part: op == Op::Unit };
        let enclosures: Vec<Enclosure> = args.iter().map(|a| a.enclosure).collect();
        let component = nodes.aside(|b| match b.enclose(op, &enclosures, facts) {
            Enclosure::Real(Range { lo, hi, nan, tidy }) => {
                let (lo, hi, nan) = (b.fresh(lo), b.fresh(hi), b.fresh(nan));
                Component { enclosure: Enclosure::Real(Range { lo, hi, nan, tidy }), identity: nan }
            }
            Enclosure::Int { lo, hi } => {
                let no = b.bool(false);
                Component { enclosure: Enclosure::Int { lo, hi }, identity: b.fresh(no) }
            }
            truth @ Enclosure::Bool { yes, .. } => Component { enclosure: truth, identity: yes },
        });
        if let Enclosure::Real(Range { lo, hi, tidy: true, .. }) | Enclosure::Int { lo, hi } = component.enclosure {
            nodes.intervals.tidy.insert([lo, hi, component.identity]);
        }
        nodes.intervals.results.insert(key, component);
        component
    }

    pub(crate) fn real(&mut self, x: f64) -> Component {
        let x = self.0.real(x);
        self.0.aside(|b| Component { enclosure: Enclosure::Real(Range::of(b, x, x)), identity: x })
    }

    /// The components of a value; a plain one is read as an interval of one point (LANGUAGE 4.2).
    fn components(&mut self, ty: &Type, scalars: &[NodeId]) -> Vec<Component> {
        if !matches!(ty, Type::Interval(_)) {
            let point = |x: &NodeId| self.0.aside(|b| Component { enclosure: Enclosure::point(b, *x), identity: *x });
            return scalars.iter().map(point).collect();
        }
        components(scalars).map(|[lo, hi, flag]| self.component(lo, hi, flag)).collect()
    }

    /// A component as operations read it (LANGUAGE 15.2).
    fn component(&mut self, lo: NodeId, hi: NodeId, flag: NodeId) -> Component {
        let tidy = self.0.intervals.tidy.contains(&[lo, hi, flag]);
        let enclosure = match self.0.builder.graph().scalar(lo) {
            Scalar::Real => Enclosure::Real(Range { lo, hi, nan: flag, tidy }),
            _ if tidy => Enclosure::Int { lo, hi },
            _ => self.0.aside(|b| Enclosure::Int { lo: b.op(Op::IntMin, &[lo, hi]), hi: b.op(Op::IntMax, &[lo, hi]) }),
        };
        Component { enclosure, identity: flag }
    }

    /// The interval with these components; `None` if one is no number.
    fn interval(components: &[Component]) -> Option<Scalars> {
        let ends = |c: &Component| match c.enclosure {
            Enclosure::Real(Range { lo, hi, .. }) | Enclosure::Int { lo, hi } => Some([lo, hi, c.identity]),
            Enclosure::Bool { .. } => None,
        };
        components.iter().map(ends).collect::<Option<Vec<_>>>().map(|all| from_components(&all))
    }
}

impl Nodes<'_> {
    /// Makes nodes that are no part of the program as written: none of them is a value that the program knows.
    fn aside<T>(&mut self, make: impl FnOnce(&mut Builder<'_>) -> T) -> T {
        let before = self.builder.graph().len();
        self.builder.set_apart(true);
        let made = make(&mut self.builder);
        self.builder.set_apart(false);
        self.note_from(before, self.intervals.precision);
        made
    }

    /// The flag of an interval that the program writes: a value of its own, because the interval is one.
    fn new_flag(&mut self) -> NodeId {
        let no = self.bool(false);
        self.novelty();
        let before = self.builder.graph().len();
        let flag = self.builder.fresh(no);
        self.note_from(before, None);
        flag
    }

    /// A flag without what tells its interval from others.
    fn plain_flag(&self, flag: NodeId) -> NodeId {
        match self.builder.graph().get(flag) {
            Some(Node::Fresh(inner)) if matches!(self.value(inner), Some(Value::Bool(_))) => inner,
            _ => flag,
        }
    }
}

/// The lower end, upper end and flag of each component.
fn components(interval: &[NodeId]) -> impl Iterator<Item = [NodeId; 3]> + '_ {
    let n = interval.len() / 3;
    let (lows, rest) = interval.split_at(n);
    let (highs, flags) = rest.split_at(n);
    lows.iter().zip(highs).zip(flags).map(|((lo, hi), flag)| [*lo, *hi, *flag])
}

/// The interval with these components.
fn from_components(all: &[[NodeId; 3]]) -> Scalars {
    (0..3).flat_map(|part| all.iter().filter_map(move |c| c.get(part).copied())).collect()
}

/// The scalars of a value of this type as its host sees them: without flags (LANGUAGE 9.2).
pub(crate) fn without_flags(ty: &Type, scalars: &[NodeId]) -> Vec<NodeId> {
    let mut seen = Vec::with_capacity(scalars.len());
    let mut rest = scalars.iter().copied();
    ty.each_part(&mut |part| {
        seen.extend(rest.by_ref().take(part.len() as usize));
        rest.by_ref().take((part.width() - part.len()) as usize).for_each(drop);
    });
    seen
}

/// The value of this type that its host gives with these scalars: nothing may be NaN.
pub(crate) fn with_flags(ty: &Type, scalars: &[NodeId], no: NodeId) -> Scalars {
    let mut value = Vec::with_capacity(scalars.len());
    let mut rest = scalars.iter().copied();
    ty.each_part(&mut |part| {
        value.extend(rest.by_ref().take(part.len() as usize));
        value.extend((part.len()..part.width()).map(|_| no));
    });
    value.into_iter().collect()
}

/// Whether an operator or built-in is one of intervals.
pub(crate) fn is_enclosed(instruction: &Instruction) -> bool {
    let interval = |ty: &Type| matches!(ty, Type::Interval(_));
    match instruction {
        Instruction::Neg(ty) => interval(ty),
        Instruction::Binary { left, right, .. } => interval(left) || interval(right),
        Instruction::Builtin { args, .. } => args.iter().any(interval),
        _ => false,
    }
}

impl Machine<'_, '_> {
    /// Runs an instruction that makes intervals, takes them apart or computes with them.
    pub(crate) fn interval(&mut self, instruction: &Instruction) -> Flow {
        let value = match instruction {
            Instruction::Interval(_) => {
                let (hi, lo) = (self.pop_scalars()?, self.pop_scalars()?);
                let flags: Vec<NodeId> = lo.iter().map(|_| self.nodes.new_flag()).collect();
                (lo.len() == hi.len()).then(|| lo.iter().chain(hi.iter()).copied().chain(flags).collect())
            }
            Instruction::PackIntervals(n) => {
                let parts = self.pop_many_scalars(*n as usize)?;
                Some(from_components(&parts.iter().flat_map(|p| components(p)).collect::<Vec<_>>()))
            }
            Instruction::SplatInterval(n) => {
                let part = self.pop_scalars()?;
                Some(from_components(&(0..*n).flat_map(|_| components(&part)).collect::<Vec<_>>()))
            }
            Instruction::End { ty, upper } => {
                let (interval, n) = (self.pop_scalars()?, ty.len() as usize);
                let start = if *upper { n } else { 0 };
                interval.get(start..start.saturating_add(n)).map(|end| end.iter().copied().collect())
            }
            Instruction::PickInterval { offset, length, .. } => {
                let interval = self.pop_scalars()?;
                let all: Vec<_> = components(&interval).collect();
                let start = *offset as usize;
                all.get(start..start.saturating_add(*length as usize)).map(from_components)
            }
            Instruction::MayBeNan => {
                let interval = self.pop_scalars()?;
                let flags = components(&interval).map(|[_, _, flag]| flag);
                flags.reduce(|a, b| self.nodes.op(Op::Or, &[a, b])).map(Scalars::one)
            }
            Instruction::Bound { .. } => self.bound()?,
            Instruction::Neg(ty) => self.enclosed(std::slice::from_ref(ty), |domain, types, operands| {
                let ([ty], [a]) = (types, operands) else { return None };
                Some(domain.negative(ty, a))
            })?,
            Instruction::Binary { op, left, right } => {
                self.enclosed(&[left.clone(), right.clone()], |domain, types, operands| {
                    let ([left, right], [a, b]) = (types, operands) else { return None };
                    domain.binary(*op, (left, a), (right, b))
                })?
            }
            Instruction::Builtin { builtin, args } => {
                self.enclosed(args, |domain, types, operands| domain.builtin(*builtin, types, operands))?
            }
            _ => None,
        };
        self.push_checked(value)
    }

    /// Pops operands of these types and applies a formula, which gets the types of their ends, to what encloses them.
    fn enclosed(
        &mut self,
        types: &[Type],
        formula: impl FnOnce(&mut Enclosures<'_, '_>, &[Type], &[Vec<Component>]) -> Option<Vec<Component>>,
    ) -> Flow<Option<Scalars>> {
        let values = self.pop_many_scalars(types.len())?;
        let mut domain = Enclosures(&mut self.nodes);
        let operands: Vec<_> = types.iter().zip(&values).map(|(ty, value)| domain.components(ty, value)).collect();
        let ends: Vec<Type> = types.iter().map(|ty| ty.ends().clone()).collect();
        Ok(formula(&mut domain, &ends, &operands).and_then(|result| Enclosures::interval(&result)))
    }

    /// What encloses each scalar of e in one box (LANGUAGE 15.3). Nothing depends on a component of dyn that is an
    /// unnamed constant (LANGUAGE 13.3.2).
    fn bound(&mut self) -> Flow<Option<Scalars>> {
        let (iv, wrt, e) = (self.pop_scalars()?, self.pop_scalars()?, self.pop_scalars()?);
        let nodes = &mut self.nodes;
        let varied = wrt.iter().zip(components(&iv)).filter(|(wrt, _)| !nodes.is_unnamed_constant(**wrt));
        let varied: Vec<_> = varied.map(|(wrt, [lo, hi, flag])| (*wrt, lo, hi, nodes.plain_flag(flag))).collect();
        if varied.is_empty() {
            let points = Enclosures(nodes).components(&Type::Real, &e);
            return Ok(Enclosures::interval(&points));
        }
        let within = nodes.builder.within(&varied);
        let parts = Part::ALL.iter().flat_map(|part| e.iter().map(|value| (*value, *part)));
        Ok(Some(parts.map(|(value, part)| nodes.builder.bound(value, within, part)).collect()))
    }
}
