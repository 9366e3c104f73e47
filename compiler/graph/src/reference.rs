//! The reference evaluator: runs a graph at one point with the table's evaluation functions. It is slow, simple and
//! independent of every target. Before `kernels` it is an oracle; after `kernels` it must agree bit for bit with
//! WebAssembly.

use crate::{Graph, Node, NodeId, Part, Precision, Value};

/// Evaluates a graph again and again without allocating.
#[derive(Debug)]
pub struct Evaluator<'g> {
    graph: &'g Graph,
    precision: Precision,
    values: Vec<Value>,
    /// Per theta, at its `end`: the finals that follow it.
    finals: Vec<Vec<(NodeId, NodeId)>>,
    /// Per theta, at its `end`: its tapes, each with the value that it is of and how far apart its iterations are.
    tapes: Vec<Vec<(NodeId, NodeId, i64)>>,
    /// Per tape: what it holds.
    held: Vec<Vec<Value>>,
    steps_left: u64,
}

/// The outputs of a graph at one point. `None` if it took more than a thousand million steps.
#[must_use]
pub fn evaluate(graph: &Graph, precision: Precision, inputs: &[Value]) -> Option<Vec<Value>> {
    Evaluator::new(graph, precision).run(inputs)
}

impl<'g> Evaluator<'g> {
    /// Prepares a graph.
    #[must_use]
    pub fn new(graph: &'g Graph, precision: Precision) -> Self {
        // Constants have their values from the beginning: what an iteration gives a variable may be one that stands
        // after the loop's end.
        let value = |(id, node)| match node {
            Node::Real(bits) => Value::Real(precision.round(f64::from_bits(bits))),
            Node::Int(x) => Value::Int(x),
            Node::Bool(x) => Value::Bool(x),
            _ => Value::zero(graph.scalar(id)),
        };
        let values = graph.iter().map(value).collect();
        let mut finals = vec![Vec::new(); graph.len()];
        for (_, node) in graph.iter() {
            if let Node::Final { end, carried, next } = node
                && let Some(list) = finals.get_mut(end.index())
            {
                list.push((carried, next));
            }
        }
        let mut tapes = vec![Vec::new(); graph.len()];
        for (id, node) in graph.iter() {
            if let Node::Tape { end, value, every } = node
                && let Some(list) = tapes.get_mut(end.index())
            {
                list.push((id, value, i64::from(every)));
            }
        }
        let held = vec![Vec::new(); if tapes.iter().all(Vec::is_empty) { 0 } else { graph.len() }];
        Self { graph, precision, values, finals, tapes, held, steps_left: 0 }
    }

    fn value(&self, id: NodeId) -> Value {
        self.values.get(id.index()).copied().unwrap_or(Value::Bool(false))
    }

    fn set(&mut self, id: NodeId, value: Value) {
        if let Some(place) = self.values.get_mut(id.index()) {
            *place = value;
        }
    }

    fn int(&self, id: NodeId) -> i32 {
        match self.value(id) {
            Value::Int(x) => x,
            _ => 0,
        }
    }

    fn truth(&self, id: NodeId) -> bool {
        self.value(id) == Value::Bool(true)
    }

    /// The value a node had in the last run.
    #[must_use]
    pub fn last(&self, id: NodeId) -> Value {
        self.value(id)
    }

    /// The outputs at one point. `None` if it took more than a thousand million steps.
    pub fn run(&mut self, inputs: &[Value]) -> Option<Vec<Value>> {
        self.run_watched(inputs, |_, _| {})
    }

    /// As [`Evaluator::run`]; `seen` is shown each value that a node gets, in every iteration of the loops around it.
    /// What a carried variable gets is shown at the nodes that give it.
    pub fn run_watched(&mut self, inputs: &[Value], mut seen: impl FnMut(NodeId, Value)) -> Option<Vec<Value>> {
        self.steps_left = 1_000_000_000;
        let mut at = NodeId(0);
        while let Some(node) = self.graph.get(at) {
            self.steps_left = self.steps_left.checked_sub(1)?;
            let next = self.step(at, node, inputs);
            seen(at, self.value(at));
            at = next;
        }
        Some(self.graph.outputs.iter().map(|o| self.round(self.value(o.node))).collect())
    }

    fn round(&self, value: Value) -> Value {
        match value {
            Value::Real(x) => Value::Real(self.precision.round(x)),
            other => other,
        }
    }

    /// Executes one node and says which comes next.
    fn step(&mut self, at: NodeId, node: Node, inputs: &[Value]) -> NodeId {
        let next = NodeId(at.0 + 1);
        match node {
            Node::Input(i) => {
                let value = inputs.get(i as usize).copied().unwrap_or(Value::zero(self.graph.scalar(at)));
                self.set(at, self.round(value));
            }
            Node::Real(bits) => self.set(at, self.round(Value::Real(f64::from_bits(bits)))),
            Node::Int(x) => self.set(at, Value::Int(x)),
            Node::Bool(x) => self.set(at, Value::Bool(x)),
            Node::Fresh(x) => self.set(at, self.value(x)),
            // Derivatives and enclosures are no operations: a graph that still contains one has no value there.
            Node::Within { .. } => {}
            Node::Bound { part: Part::MayBeNan, .. } => self.set(at, Value::Bool(true)),
            Node::Diff { .. } | Node::Bound { .. } => self.set(at, Value::Real(f64::NAN)),
            Node::Apply(op, args) => {
                let mut operands = [Value::Int(0); 4];
                for (place, arg) in operands.iter_mut().zip(args.as_slice()) {
                    *place = self.value(*arg);
                }
                let value = (op.def().eval.at(self.precision))(operands.get(..args.as_slice().len()).unwrap_or(&[]));
                self.set(at, value);
            }
            Node::Gamma { cond, otherwise, .. } => {
                let cond = self.value(cond);
                self.set(at, cond);
                if cond != Value::Bool(true) {
                    return NodeId(otherwise.0 + 1);
                }
            }
            Node::Else { gamma } => {
                if let Some(Node::Gamma { end, .. }) = self.graph.get(gamma) {
                    return end;
                }
            }
            Node::Join { end, then, otherwise } => {
                let Some(Node::End { begin }) = self.graph.get(end) else { return next };
                self.set(at, self.value(if self.truth(begin) { then } else { otherwise }));
            }
            Node::Theta { lo, hi, end } => {
                self.set(at, self.value(lo));
                let enter = self.int(lo) < self.int(hi);
                self.begin_loop(end);
                if !enter {
                    return NodeId(end.0 + 1);
                }
            }
            Node::Counter { theta } => self.set(at, self.value(theta)),
            // Set when the loop begins and after each iteration.
            Node::Carried { .. } => {}
            Node::End { begin } => {
                if let Some(Node::Theta { lo, hi, .. }) = self.graph.get(begin) {
                    let counter = self.int(begin).wrapping_add(1);
                    self.record(at, Some(i64::from(counter) - 1 - i64::from(self.int(lo))));
                    self.set(begin, Value::Int(counter));
                    self.advance(at);
                    if counter < self.int(hi) {
                        return NodeId(begin.0 + 1);
                    }
                }
            }
            Node::Final { carried, .. } => self.set(at, self.value(carried)),
            Node::Tape { .. } => {}
            Node::Recall { tape, at: number } => {
                let held = self.held.get(tape.index()).map_or(&[][..], Vec::as_slice);
                let value = usize::try_from(self.int(number)).ok().and_then(|i| held.get(i)).copied();
                self.set(at, value.unwrap_or(Value::zero(self.graph.scalar(at))));
            }
        }
        next
    }

    /// Empties the tapes of a loop that begins, or adds what their values are at the end of an iteration, counted from 0.
    fn record(&mut self, end: NodeId, iteration: Option<i64>) {
        let tapes = self.tapes.get(end.index()).map_or(&[][..], Vec::as_slice);
        for (tape, value, every) in tapes {
            let value = self.values.get(value.index()).copied();
            let Some(held) = self.held.get_mut(tape.index()) else { continue };
            match iteration {
                None => held.clear(),
                Some(i) if i.checked_rem(*every) == Some(0) => held.extend(value),
                Some(_) => {}
            }
        }
    }

    /// Gives the carried variables of a loop their first content.
    fn begin_loop(&mut self, end: NodeId) {
        self.record(end, None);
        let pairs = self.finals.get_mut(end.index()).map(std::mem::take).unwrap_or_default();
        let inits: Vec<_> = pairs
            .iter()
            .filter_map(|(carried, _)| match self.graph.get(*carried) {
                Some(Node::Carried { init, .. }) => Some((*carried, self.value(init))),
                _ => None,
            })
            .collect();
        for (carried, value) in inits {
            self.set(carried, value);
        }
        if let Some(place) = self.finals.get_mut(end.index()) {
            *place = pairs;
        }
    }

    /// Gives the carried variables of a loop what the iteration computed, all at once.
    fn advance(&mut self, end: NodeId) {
        let pairs = self.finals.get_mut(end.index()).map(std::mem::take).unwrap_or_default();
        let values: Vec<_> = pairs.iter().map(|(_, next)| self.value(*next)).collect();
        for ((carried, _), value) in pairs.iter().zip(values) {
            self.set(*carried, value);
        }
        if let Some(place) = self.finals.get_mut(end.index()) {
            *place = pairs;
        }
    }
}
