//! The way through a graph at one point: branches, loops, tapes. What values are and what operations do is for a
//! [`Machine`] to say; the walk knows nothing of numbers.

use isograd_graph::{Graph, Node, NodeId, Op, Precision, Scalar, Value};

/// What computes.
pub trait Machine {
    type Value: Copy;

    /// An input or a constant.
    fn given(&mut self, value: Value) -> Self::Value;
    fn apply(&mut self, operation: &Operation<'_, Self::Value>) -> Result<Self::Value, Stop>;
    /// What decides a branch.
    fn truth(&mut self, value: Self::Value) -> Result<bool, Stop>;
    /// What bounds a loop, or is a place on a tape.
    fn int(&mut self, value: Self::Value) -> Result<i32, Stop>;
}

/// An operation that is to be applied.
pub struct Operation<'a, V> {
    /// How many nodes were visited before: names this application among all of a run.
    pub step: u64,
    pub node: NodeId,
    pub op: Op,
    pub args: &'a [NodeId],
    values: &'a [V],
}

impl<V: Copy> Operation<'_, V> {
    pub fn value(&self, id: NodeId) -> V {
        self.values[id.index()]
    }

    pub fn arg(&self, k: usize) -> V {
        self.value(self.args[k])
    }
}

/// Why a run has no outputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// What was computed in this step may be one of two things, and it matters which.
    Fork(u64),
    /// Nothing is promised about what follows.
    Special(&'static str),
}

/// The way, to be gone again and again.
pub struct Walk<'g, V> {
    graph: &'g Graph,
    values: Vec<V>,
    /// What is on a tape where nothing was written.
    missing: V,
    /// Of each theta, at its end: variables and what they become.
    finals: Vec<Vec<(NodeId, NodeId)>>,
    /// Of each theta, at its end: tapes, values on them, how far apart.
    tapes: Vec<Vec<(NodeId, NodeId, i64)>>,
    held: Vec<Vec<V>>,
}

/// More than any program of the tests takes.
const STEPS: u64 = 20_000_000;

impl<'g, V: Copy> Walk<'g, V> {
    pub fn new(graph: &'g Graph, missing: V) -> Self {
        let mut finals = vec![Vec::new(); graph.len()];
        let mut tapes = vec![Vec::new(); graph.len()];
        for (id, node) in graph.iter() {
            match node {
                Node::Final { end, carried, next } => finals[end.index()].push((carried, next)),
                Node::Tape { end, value, every } => tapes[end.index()].push((id, value, i64::from(every))),
                _ => {}
            }
        }
        let held = vec![Vec::new(); graph.len()];
        Self { graph, values: vec![missing; graph.len()], missing, finals, tapes, held }
    }

    /// What a node was in the last run.
    pub fn value(&self, id: NodeId) -> V {
        self.values[id.index()]
    }

    fn set(&mut self, id: NodeId, value: V) {
        self.values[id.index()] = value;
    }

    pub fn run(&mut self, machine: &mut impl Machine<Value = V>, inputs: &[Value]) -> Result<(), Stop> {
        self.values.fill(self.missing);
        // What an iteration gives a variable may be a constant that stands after the loop.
        for (id, node) in self.graph.iter() {
            let value = match node {
                Node::Real(bits) => Value::Real(Precision::F32.round(f64::from_bits(bits))),
                Node::Int(x) => Value::Int(x),
                Node::Bool(x) => Value::Bool(x),
                _ => continue,
            };
            self.values[id.index()] = machine.given(value);
        }
        let (mut at, mut step) = (NodeId(0), 0);
        while let Some(node) = self.graph.get(at) {
            if step == STEPS {
                return Err(Stop::Special("too many steps"));
            }
            at = self.step(machine, at, node, inputs, step)?;
            step += 1;
        }
        Ok(())
    }

    /// Executes one node and says which comes next.
    fn step(
        &mut self,
        machine: &mut impl Machine<Value = V>,
        at: NodeId,
        node: Node,
        inputs: &[Value],
        step: u64,
    ) -> Result<NodeId, Stop> {
        let next = NodeId(at.0 + 1);
        match node {
            Node::Real(_) | Node::Int(_) | Node::Bool(_) => {}
            Node::Input(i) => {
                let value = machine.given(inputs.get(i as usize).copied().unwrap_or(Value::zero(Scalar::Real)));
                self.set(at, value);
            }
            Node::Fresh(x) => self.set(at, self.value(x)),
            Node::Apply(op, args) => {
                let operation = Operation { step, node: at, op, args: args.as_slice(), values: &self.values };
                let value = machine.apply(&operation)?;
                self.set(at, value);
            }
            Node::Gamma { cond, otherwise, .. } => {
                let cond = self.value(cond);
                let cond = machine.truth(cond)?;
                let decided = machine.given(Value::Bool(cond));
                self.set(at, decided);
                if !cond {
                    return Ok(NodeId(otherwise.0 + 1));
                }
            }
            Node::Else { gamma } => {
                if let Some(Node::Gamma { end, .. }) = self.graph.get(gamma) {
                    return Ok(end);
                }
            }
            Node::Join { end, then, otherwise } => {
                let decided = self.value(self.graph.owner(end));
                let from = if machine.truth(decided)? { then } else { otherwise };
                self.set(at, self.value(from));
            }
            Node::Theta { lo, hi, end } => {
                let (lo, hi) = (machine.int(self.value(lo))?, machine.int(self.value(hi))?);
                let first = machine.given(Value::Int(lo));
                self.set(at, first);
                self.begin(end);
                if lo >= hi {
                    return Ok(NodeId(end.0 + 1));
                }
            }
            Node::Counter { theta } => self.set(at, self.value(theta)),
            Node::Carried { .. } => {}
            Node::End { begin } => {
                if let Some(Node::Theta { lo, hi, .. }) = self.graph.get(begin) {
                    let [now, lo, hi] = [begin, lo, hi].map(|id| self.value(id));
                    let (now, lo, hi) = (machine.int(now)?, machine.int(lo)?, machine.int(hi)?);
                    self.record(at, i64::from(now) - i64::from(lo));
                    let counter = now.wrapping_add(1);
                    let value = machine.given(Value::Int(counter));
                    self.set(begin, value);
                    self.advance(at);
                    if counter < hi {
                        return Ok(NodeId(begin.0 + 1));
                    }
                }
            }
            Node::Final { carried, .. } => self.set(at, self.value(carried)),
            Node::Tape { .. } => {}
            Node::Recall { tape, at: place } => {
                let place = machine.int(self.value(place))?;
                let held = usize::try_from(place).ok().and_then(|i| self.held[tape.index()].get(i));
                let value = held.copied().unwrap_or(self.missing);
                self.set(at, value);
            }
            Node::Diff { .. } | Node::Within { .. } | Node::Bound { .. } => {
                return Err(Stop::Special("the graph is not ready"));
            }
        }
        Ok(next)
    }

    /// Empties the tapes of a loop and gives its variables their first content.
    fn begin(&mut self, end: NodeId) {
        for (tape, ..) in &self.tapes[end.index()] {
            self.held[tape.index()].clear();
        }
        let init = |(carried, _): &(NodeId, NodeId)| match self.graph.get(*carried) {
            Some(Node::Carried { init, .. }) => Some((*carried, self.value(init))),
            _ => None,
        };
        let inits: Vec<_> = self.finals[end.index()].iter().filter_map(init).collect();
        for (carried, value) in inits {
            self.set(carried, value);
        }
    }

    fn record(&mut self, end: NodeId, iteration: i64) {
        for (tape, value, every) in &self.tapes[end.index()] {
            if iteration.checked_rem(*every) == Some(0) {
                self.held[tape.index()].push(self.values[value.index()]);
            }
        }
    }

    /// Gives the variables what the iteration computed, all at once.
    fn advance(&mut self, end: NodeId) {
        let next: Vec<_> =
            self.finals[end.index()].iter().map(|(carried, next)| (*carried, self.value(*next))).collect();
        for (carried, value) in next {
            self.set(carried, value);
        }
    }
}
