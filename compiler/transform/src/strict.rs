//! Strict differentiability (LANGUAGE 14.2): the operations and branches on the paths of derivatives that are not proved
//! to be differentiable while the inputs keep their ranges. Knows kinks from the op table; knows nothing of source text.
//!
//! For each value that some live `diff` differentiates by, a mark goes from left to right to all that depends on it, and
//! another from what is differentiated from right to left along the operands that derivatives pass through. An operation
//! with a kink, or a condition, that meets both needs a proof: that the enclosures of its operands miss the kink.

use isograd_graph::ops::{Derivative, Kink};
use isograd_graph::{Builder, Graph, Mode, Node, NodeId, Op, Origin, Precision, Scalar, Unwatched, Watch};

use crate::bound::{Hull, Loops, enclosures};
use crate::differentiate::carried_finals;
use crate::live::live;

/// Values that are followed at once: bits of a word.
const BATCH: usize = 64;

/// Something on the path of a derivative that may not be differentiable.
#[derive(Debug, Clone, PartialEq)]
pub struct Suspect {
    /// Where it comes from.
    pub origin: Origin,
    /// The operation; none is a branch.
    pub op: Option<Op>,
    /// What encloses its operands over the ranges; of a branch, nothing.
    pub operands: Vec<Hull>,
    /// Indices of the inputs that its operands depend on.
    pub inputs: Vec<u32>,
}

/// What in a raw graph, whose `diff`s are not expanded, is not proved to be differentiable while each input lies in its
/// range. Loops run for at most `max_steps` nodes in all; beyond that nothing is known of what they carry. `None` if
/// time is up.
#[must_use]
pub fn suspects(
    graph: &Graph,
    ranges: &[Hull],
    precision: Precision,
    max_steps: u64,
    watch: &dyn Watch,
) -> Option<Vec<Suspect>> {
    let live = live(graph);
    let is_live = |id: NodeId| live.get(id.index()).copied().unwrap_or(false);
    let diffs: Vec<(NodeId, NodeId)> = graph
        .iter()
        .filter_map(|(id, node)| match node {
            Node::Diff { value, wrt } if is_live(id) => Some((value, wrt)),
            _ => None,
        })
        .collect();
    let mut seeds: Vec<NodeId> = diffs.iter().map(|d| d.1).collect();
    seeds.sort_unstable();
    seeds.dedup();
    let mut candidates = vec![false; graph.len()];
    for batch in seeds.chunks(BATCH) {
        if watch.expired() {
            return None;
        }
        let paths = Paths::of(graph, &diffs, batch);
        for (id, node) in graph.iter() {
            if let Some(place) = candidates.get_mut(id.index()) {
                *place |= is_live(id) && paths.meets(id, node);
            }
        }
    }
    if !candidates.contains(&true) {
        return Some(Vec::new());
    }
    let hulls = enclosures(graph, ranges, precision, Loops::Run { max_steps }, watch)?;
    let hull = |id: NodeId| hulls.get(id.index()).copied().unwrap_or(Hull::Never);
    let mut found = Vec::new();
    for (id, node) in graph.iter().filter(|(id, _)| candidates.get(id.index()).copied().unwrap_or(false)) {
        let (op, operands, depends) = match node {
            Node::Apply(Op::Select | Op::SelectInt | Op::SelectBool, args) => {
                let Some(cond) = args.as_slice().first().copied() else { continue };
                if hull(id) == Hull::Never || hull(cond).decided().is_some() {
                    continue;
                }
                (None, Vec::new(), vec![cond])
            }
            Node::Apply(op, args) => {
                let operands: Vec<Hull> = args.as_slice().iter().map(|x| hull(*x)).collect();
                if hull(id) == Hull::Never || misses(op, &operands, hull(id), precision) {
                    continue;
                }
                (Some(op), operands, args.as_slice().to_vec())
            }
            Node::Gamma { cond, .. } => {
                if matches!(hull(cond), Hull::Never) || hull(cond).decided().is_some() {
                    continue;
                }
                (None, Vec::new(), vec![cond])
            }
            _ => continue,
        };
        found.push(Suspect { origin: graph.origin(id), op, operands, inputs: inputs_of(graph, &depends) });
    }
    Some(found)
}

/// Whether operands that lie in these hulls miss the kink of an operation, whose result lies in `result`.
fn misses(op: Op, operands: &[Hull], result: Hull, precision: Precision) -> bool {
    let Kink::Where { discriminant, .. } = op.def().kink else { return true };
    // Between two jumps a sawtooth has no zero, and a step is constant.
    match (op, operands) {
        (Op::Fract | Op::Mod, _) => return without_zero(result),
        // A box that meets a = 0 and b ≤ 0 meets both at once.
        (Op::Atan2, &[y, x]) => return without_zero(y) || matches!(x, Hull::Real { lo, .. } if 0.0 < lo),
        (_, &[Hull::Real { lo, hi, .. }]) if matches!(op.def().derivative, Derivative::Zero) => {
            let constant = match result {
                Hull::Real { lo, hi, nan } => lo == hi && !nan,
                Hull::Int { lo, hi } => lo == hi,
                Hull::Bool { .. } | Hull::Never => false,
            };
            let off = |x| isograd_graph::ops::discriminant(op, &[x]) != 0.0;
            return constant && off(lo) && off(hi);
        }
        _ => {}
    }
    let mut b = Builder::new(Mode::Raw, 1_000, &Unwatched);
    let args: Vec<NodeId> = op.def().operands.iter().map(|kind| b.input("", *kind)).collect();
    let off = discriminant(&mut b, &args);
    let Ok(graph) = b.finish() else { return false };
    let hulls = enclosures(&graph, operands, precision, Loops::Unbounded, &Unwatched);
    hulls.and_then(|h| h.get(off.index()).copied()).is_some_and(without_zero)
}

/// Poles and places outside of the domain are no kinks, so it may be NaN.
fn without_zero(hull: Hull) -> bool {
    matches!(hull, Hull::Real { lo, hi, .. } if 0.0 < lo || hi < 0.0)
}

/// Marks of up to 64 values that are differentiated by.
struct Paths<'g> {
    graph: &'g Graph,
    /// By node: the values it depends on, in any way.
    depends: Vec<u64>,
    /// By node: the values by which something is differentiated that it passes a derivative to.
    needed: Vec<u64>,
}

impl<'g> Paths<'g> {
    fn of(graph: &'g Graph, diffs: &[(NodeId, NodeId)], seeds: &[NodeId]) -> Self {
        let mut this = Self { graph, depends: vec![0; graph.len()], needed: vec![0; graph.len()] };
        let bit = |wrt: NodeId| seeds.iter().position(|s| *s == wrt).map_or(0, |i| 1_u64 << i);
        for seed in seeds {
            add(&mut this.depends, *seed, bit(*seed));
        }
        // Loops carry marks back to their beginning; marks are only ever added.
        let mut changed = true;
        while changed {
            changed = false;
            for (id, node) in graph.iter() {
                changed |= this.forward(id, node);
            }
        }
        for (value, wrt) in diffs {
            add(&mut this.needed, *value, bit(*wrt));
        }
        changed = true;
        while changed {
            changed = false;
            for (id, node) in graph.iter().rev() {
                changed |= this.backward(id, node);
            }
        }
        this
    }

    fn depends(&self, id: NodeId) -> u64 {
        self.depends.get(id.index()).copied().unwrap_or(0)
    }

    fn needed(&self, id: NodeId) -> u64 {
        self.needed.get(id.index()).copied().unwrap_or(0)
    }

    fn cond_of(&self, end: NodeId) -> Option<NodeId> {
        match self.graph.get(end) {
            Some(Node::End { begin }) => match self.graph.get(begin) {
                Some(Node::Gamma { cond, .. }) => Some(cond),
                _ => None,
            },
            _ => None,
        }
    }

    fn forward(&mut self, id: NodeId, node: Node) -> bool {
        let mut bits = 0;
        node.each_operand(|x| bits |= self.depends(x));
        match node {
            Node::Join { end, .. } => bits |= self.cond_of(end).map_or(0, |cond| self.depends(cond)),
            Node::Counter { theta } => bits |= self.depends(theta),
            Node::Final { carried, .. } => {
                return add(&mut self.depends, carried, bits) | add(&mut self.depends, id, bits);
            }
            _ => {}
        }
        add(&mut self.depends, id, bits)
    }

    /// Derivatives pass through everything but conditions, and not through what is piecewise constant in reals.
    fn backward(&mut self, id: NodeId, node: Node) -> bool {
        let bits = self.needed(id);
        if bits == 0 || matches!(node, Node::Apply(op, _) if stops(op)) {
            return false;
        }
        let graph = self.graph;
        let mut changed = false;
        let needed = &mut self.needed;
        if let Node::Carried { .. } = node {
            // What an iteration gives it is found through its final.
            changed |= carried_next(graph, id).is_some_and(|next| add(needed, next, bits));
        }
        node.each_operand(|x| {
            if graph.scalar(x) != Scalar::Bool {
                changed |= add(needed, x, bits);
            }
        });
        changed
    }

    /// Whether a node with a kink, or a branch, is on a path.
    fn meets(&self, id: NodeId, node: Node) -> bool {
        match node {
            Node::Apply(Op::Select | Op::SelectInt | Op::SelectBool, args) => {
                args.as_slice().first().is_some_and(|cond| self.depends(*cond) & self.needed(id) != 0)
            }
            Node::Apply(op, args) if matches!(op.def().kink, Kink::Where { .. }) => {
                let bits = args.as_slice().iter().fold(0, |bits, x| bits | self.depends(*x));
                bits & self.needed(id) != 0
            }
            Node::Gamma { cond, end, .. } => {
                let joins = self.graph.iter().skip(end.index() + 1).map_while(|(id, node)| match node {
                    Node::Join { end: of, .. } if of == end => Some(Some(id)),
                    Node::Real(_) | Node::Int(_) | Node::Bool(_) | Node::Join { .. } => Some(None),
                    _ => None,
                });
                let needed = joins.flatten().fold(0, |bits, join| bits | self.needed(join));
                self.depends(cond) & needed != 0
            }
            _ => false,
        }
    }
}

/// Whether nothing in front of an operation matters to derivatives. A jump of an int is one of the real made from it.
fn stops(op: Op) -> bool {
    matches!(op.def().derivative, Derivative::Zero) && op.def().result == Scalar::Real && op != Op::IntToReal
}

fn carried_next(graph: &Graph, carried: NodeId) -> Option<NodeId> {
    let Some(Node::Carried { theta, .. }) = graph.get(carried) else { return None };
    let Some(Node::Theta { end, .. }) = graph.get(theta) else { return None };
    carried_finals(graph, end).find(|(_, of, _)| *of == carried).map(|(_, _, next)| next)
}

/// Adds bits; whether that was news.
fn add(marks: &mut [u64], id: NodeId, bits: u64) -> bool {
    match marks.get_mut(id.index()) {
        Some(place) if bits & !*place != 0 => {
            *place |= bits;
            true
        }
        _ => false,
    }
}

/// Indices of the inputs that any of these nodes depends on.
fn inputs_of(graph: &Graph, nodes: &[NodeId]) -> Vec<u32> {
    let mut reached = vec![0; graph.len()];
    for node in nodes {
        add(&mut reached, *node, 1);
    }
    let mut changed = true;
    let mut inputs = Vec::new();
    while changed {
        changed = false;
        for (id, node) in graph.iter().rev() {
            if reached.get(id.index()).copied() != Some(1) {
                continue;
            }
            node.each_operand(|x| changed |= add(&mut reached, x, 1));
            match node {
                Node::Join { end, .. } | Node::Final { end, .. } => changed |= add(&mut reached, end, 1),
                Node::End { begin } => changed |= add(&mut reached, begin, 1),
                Node::Counter { theta } => changed |= add(&mut reached, theta, 1),
                Node::Carried { .. } => {
                    changed |= carried_next(graph, id).is_some_and(|next| add(&mut reached, next, 1));
                }
                _ => {}
            }
        }
    }
    for (id, node) in graph.iter() {
        if let Node::Input(index) = node
            && reached.get(id.index()).copied() == Some(1)
        {
            inputs.push(index);
        }
    }
    inputs
}
