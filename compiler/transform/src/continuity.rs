//! How a value depends on inputs that range over boxes: without kinks, with kinks, or with jumps. Decided from the
//! operations alone; knows nothing of the boxes.

use isograd_graph::{Graph, Node, NodeId, Op};

use crate::differentiate::carried_finals;

/// How a value depends on the inputs; each level includes those before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    /// Not at all.
    Constant,
    /// Wherever its derivatives of all orders are finite, they are continuous.
    Smooth,
    /// It is continuous, and between the kinks smooth.
    Continuous,
    /// It may jump, or nothing is known.
    Jumps,
}

/// Whether a value, differentiated so many times, may jump while the inputs range over boxes and it is bounded, has
/// bounded derivatives and is never NaN.
pub fn jumps(graph: &Graph, value: NodeId, order: usize, inputs: &[NodeId]) -> bool {
    let mut levels = Levels { graph, levels: vec![Level::Constant; graph.len()] };
    for input in inputs {
        levels.raise(*input, Level::Smooth);
    }
    let mut at = NodeId(0);
    while let Some(node) = graph.get(at) {
        at = levels.node(at, node).unwrap_or(NodeId(at.0 + 1));
    }
    let level = levels.of(value);
    level == Level::Jumps || order > 0 && level == Level::Continuous
}

struct Levels<'g> {
    graph: &'g Graph,
    levels: Vec<Level>,
}

impl Levels<'_> {
    fn of(&self, id: NodeId) -> Level {
        self.levels.get(id.index()).copied().unwrap_or(Level::Constant)
    }

    fn raise(&mut self, id: NodeId, level: Level) -> bool {
        let Some(place) = self.levels.get_mut(id.index()) else { return false };
        let raised = level > *place;
        *place = level.max(*place);
        raised
    }

    /// Finds the level of one node. Where a loop's end changes what its carried variables hold, returns the node to go
    /// back to.
    fn node(&mut self, at: NodeId, node: Node) -> Option<NodeId> {
        let level = match node {
            Node::Apply(op, args) => self.applied(op, args.as_slice()),
            Node::Fresh(x) => self.of(x),
            Node::Diff { value, .. } => match self.of(value) {
                Level::Continuous => Level::Jumps,
                level => level,
            },
            Node::Join { end, then, otherwise } => {
                let chosen = match self.begin(end) {
                    Some(Node::Gamma { cond, .. }) => self.of(cond),
                    _ => Level::Constant,
                };
                self.decided(chosen, self.of(then).max(self.of(otherwise)))
            }
            Node::Counter { theta } => match self.graph.get(theta) {
                Some(Node::Theta { lo, hi, .. }) => self.decided(self.of(lo).max(self.of(hi)), Level::Constant),
                _ => Level::Jumps,
            },
            Node::Carried { init, .. } => self.of(init),
            Node::Final { end, carried, .. } => {
                let times = match self.begin(end) {
                    Some(Node::Theta { lo, hi, .. }) => self.of(lo).max(self.of(hi)),
                    _ => Level::Jumps,
                };
                self.decided(times, self.of(carried))
            }
            Node::End { begin } => return self.close(at, begin),
            Node::Input(_) | Node::Real(_) | Node::Int(_) | Node::Bool(_) => return None,
            Node::Gamma { .. } | Node::Else { .. } | Node::Theta { .. } => return None,
            // What the program encloses it may join where a branch is undecided.
            _ => {
                let mut level = Level::Constant;
                node.each_operand(|x| level = level.max(self.of(x)));
                self.decided(level, level)
            }
        };
        self.raise(at, level);
        None
    }

    /// The level of what a condition chooses from.
    fn decided(&self, condition: Level, chosen: Level) -> Level {
        if condition == Level::Constant { chosen } else { Level::Jumps }
    }

    fn applied(&self, op: Op, args: &[NodeId]) -> Level {
        let level = args.iter().fold(Level::Constant, |level, x| level.max(self.of(*x)));
        if level == Level::Constant {
            return level;
        }
        match op {
            Op::Select | Op::SelectInt | Op::SelectBool => {
                args.first().map_or(Level::Jumps, |cond| self.decided(self.of(*cond), level))
            }
            // 0^b jumps where b leaves 0.
            Op::Pow if args.get(1).is_some_and(|b| self.of(*b) > Level::Constant) => Level::Jumps,
            _ => level.max(of_operation(op)),
        }
    }

    fn begin(&self, end: NodeId) -> Option<Node> {
        match self.graph.get(end) {
            Some(Node::End { begin }) => self.graph.get(begin),
            _ => None,
        }
    }

    /// At the end of a loop, what an iteration gives its variables reaches the next one.
    fn close(&mut self, end: NodeId, begin: NodeId) -> Option<NodeId> {
        if !matches!(self.graph.get(begin), Some(Node::Theta { .. })) {
            return None;
        }
        let mut changed = false;
        for (_, carried, next) in carried_finals(self.graph, end) {
            changed |= self.raise(carried, self.of(next));
        }
        changed.then_some(NodeId(begin.0 + 1))
    }
}

/// The level of an operation in operands that are no constants. Where an operation has an infinite slope or a pole
/// (`sqrt` and `log` at 0, `/` by 0, `tan`), the enclosure of its derivative is unbounded, which is for the caller.
const fn of_operation(op: Op) -> Level {
    match op {
        Op::Add | Op::Sub | Op::Mul | Op::Div | Op::Neg | Op::Sqrt | Op::InverseSqrt => Level::Smooth,
        Op::Exp | Op::Exp2 | Op::Log | Op::Log2 | Op::Pow | Op::Rounded => Level::Smooth,
        Op::Sin | Op::Cos | Op::Tan | Op::Asin | Op::Acos | Op::Atan => Level::Smooth,
        Op::Sinh | Op::Cosh | Op::Tanh | Op::Asinh | Op::Acosh | Op::Atanh => Level::Smooth,
        Op::Abs | Op::Min | Op::Max | Op::Length2 | Op::Length3 | Op::Length4 => Level::Continuous,
        _ => Level::Jumps,
    }
}
