//! Specialisation: the graph that is left when its inputs stay in a box. Decides by enclosures alone, so what it leaves
//! computes the same bits inside of the box; knows nothing of where boxes come from.

use isograd_graph::{Builder, Exhausted, Graph, Mode, NodeId, Op, Precision, Watch};

use crate::bound::{Hull, Loops, enclosures};
use crate::copy::copy_each;

/// Drops the sides of branches, the operands of `min` and `max`, and the comparisons that are decided while each input
/// lies in its box. The graph is folded. It computes the same bits for every input of the box, and anything outside.
///
/// # Errors
/// If the budget is spent.
pub fn specialise(
    graph: &Graph,
    boxes: &[Hull],
    precision: Precision,
    max_nodes: usize,
    watch: &dyn Watch,
) -> Result<Graph, Exhausted> {
    // A decision inside of a loop must hold in every iteration, so nothing is assumed of what it carries.
    let Some(hulls) = enclosures(graph, boxes, precision, Loops::Unbounded, watch) else {
        return Err(Exhausted::Time);
    };
    let hull = |id: NodeId| hulls.get(id.index()).copied().unwrap_or(Hull::Never);
    let apply = |b: &mut Builder<'_>, id: NodeId, op: Op, operands: &[NodeId]| {
        if let Some(truth) = hull(id).decided() {
            return b.bool(truth);
        }
        let old = |k: usize| match graph.get(id) {
            Some(isograd_graph::Node::Apply(_, args)) => args.as_slice().get(k).map_or(Hull::Never, |x| hull(*x)),
            _ => Hull::Never,
        };
        match (chosen(op, old(0), old(1)), operands) {
            (Some(Chosen::First), [x, ..]) => *x,
            (Some(Chosen::Second), [_, y, ..]) => *y,
            (Some(Chosen::Negative), [x, ..]) => b.neg(*x),
            (Some(Chosen::Quotient), [x, y]) => b.div(*x, *y),
            _ => b.op(op, operands),
        }
    };
    copy_each(graph, Mode::Real(precision), max_nodes, watch, apply)
}

enum Chosen {
    First,
    Second,
    Negative,
    /// The first by the second.
    Quotient,
}

/// What an operation with these operands always gives, bit for bit.
fn chosen(op: Op, a: Hull, b: Hull) -> Option<Chosen> {
    // It is 0 only where the length is.
    if op == Op::Unit {
        return matches!(b, Hull::Real { lo, hi, .. } if 0.0 < lo || hi < 0.0).then_some(Chosen::Quotient);
    }
    let Hull::Real { lo: a_lo, hi: a_hi, nan: false } = a else { return None };
    if op == Op::Abs {
        // |−0| is +0.
        return match () {
            () if a_lo > 0.0 => Some(Chosen::First),
            () if a_hi < 0.0 => Some(Chosen::Negative),
            () => None,
        };
    }
    let Hull::Real { lo: b_lo, hi: b_hi, nan: false } = b else { return None };
    match op {
        Op::Min if a_hi <= b_lo => Some(Chosen::First),
        Op::Min if b_hi < a_lo => Some(Chosen::Second),
        Op::Max if b_hi <= a_lo => Some(Chosen::First),
        Op::Max if a_hi < b_lo => Some(Chosen::Second),
        _ => None,
    }
}
