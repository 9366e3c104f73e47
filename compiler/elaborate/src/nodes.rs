//! The raw graph under construction, and which of its nodes are constants (LANGUAGE 17.3). Knows nothing of the
//! program that the nodes come from, except their places.

use std::collections::BTreeMap;

use isograd_graph::ops::{self, Accuracy};
use isograd_graph::{Builder, Exhausted, Graph, Mode, Node, NodeId, Op, Origin, Precision, Scalar, Value, Watch};
use isograd_program::{ScalarKind, Type};
use isograd_syntax::Span;
use rustc_hash::FxHashMap;

use crate::intervals::{Known, with_flags};
use crate::value::Scalars;

/// A builder in raw mode that also knows the values of constants.
pub(crate) struct Nodes<'w> {
    pub(crate) builder: Builder<'w>,
    /// Values of constants, unrounded; shorter than the graph while the rest is not constant.
    constants: Vec<Option<Value>>,
    spans: Vec<Span>,
    origins: FxHashMap<Span, Origin>,
    /// Names of variables that loops carry, by the origins of their nodes.
    carried: BTreeMap<Origin, String>,
    here: Span,
    /// How often something was made that equals nothing else: see [`Nodes::novelties`].
    novelties: u64,
    pub(crate) intervals: Known,
}

/// A graph, the span of each origin, and the names of carried variables by theirs.
pub(crate) type Finished = (Graph, Vec<Span>, BTreeMap<Origin, String>);

impl<'w> Nodes<'w> {
    /// No nodes yet; what comes first comes from `span`.
    pub(crate) fn new(max_nodes: u64, watch: &'w dyn Watch, span: Span) -> Self {
        let max_nodes = usize::try_from(max_nodes.min(u64::from(u32::MAX - 1))).unwrap_or(usize::MAX);
        Self {
            builder: Builder::new(Mode::Raw, max_nodes, watch),
            constants: Vec::new(),
            spans: vec![span],
            origins: FxHashMap::from_iter([(span, Origin(0))]),
            carried: BTreeMap::new(),
            here: span,
            novelties: 0,
            intervals: Known::default(),
        }
    }

    /// What is made from now on comes from `span`.
    pub(crate) fn stand(&mut self, span: Span) {
        if span == self.here {
            return;
        }
        self.here = span;
        let spans = &mut self.spans;
        let origin = *self.origins.entry(span).or_insert_with(|| {
            spans.push(span);
            Origin(u32::try_from(spans.len() - 1).unwrap_or(0))
        });
        self.builder.set_origin(origin);
    }

    /// Where what is made now comes from.
    pub(crate) const fn here(&self) -> Span {
        self.here
    }

    /// A variable that the loop being begun carries: an origin of its own tells it from others.
    pub(crate) fn carried(&mut self, init: &Scalars, name: &str) -> Scalars {
        let own = Origin(u32::try_from(self.spans.len()).unwrap_or(0));
        self.spans.push(self.here);
        self.carried.insert(own, name.to_owned());
        self.builder.set_origin(own);
        let nodes = init.iter().map(|x| self.builder.carried(*x)).collect();
        self.builder.set_origin(self.origins.get(&self.here).copied().unwrap_or_default());
        nodes
    }

    /// The finished graph.
    pub(crate) fn finish(self) -> Result<Finished, Exhausted> {
        let (spans, carried) = (self.spans, self.carried);
        self.builder.finish().map(|graph| (graph, spans, carried))
    }

    /// Counts fresh values, regions and scopes. If a computation makes none, then repeating it in the same scope
    /// gives the same nodes.
    pub(crate) const fn novelties(&self) -> u64 {
        self.novelties
    }

    /// Counts one more.
    pub(crate) const fn novelty(&mut self) {
        self.novelties += 1;
    }

    /// The value of a constant.
    pub(crate) fn value(&self, id: NodeId) -> Option<Value> {
        self.constants.get(id.index()).copied().flatten()
    }

    fn note(&mut self, id: NodeId, value: Option<Value>) {
        if value.is_none() || self.builder.exhausted().is_some() {
            return;
        }
        if id.index() >= self.constants.len() {
            self.constants.resize(id.index() + 1, None);
        }
        if let Some(place) = self.constants.get_mut(id.index()) {
            *place = value;
        }
    }

    /// A real constant.
    pub(crate) fn real(&mut self, x: f64) -> NodeId {
        let id = self.builder.real(x);
        self.note(id, Some(Value::Real(x)));
        id
    }

    /// An int constant.
    pub(crate) fn int(&mut self, x: i32) -> NodeId {
        let id = self.builder.int(x);
        self.note(id, Some(Value::Int(x)));
        id
    }

    /// A truth constant.
    pub(crate) fn bool(&mut self, x: bool) -> NodeId {
        let id = self.builder.bool(x);
        self.note(id, Some(Value::Bool(x)));
        id
    }

    /// A value of zeros; its intervals are points.
    pub(crate) fn zeros(&mut self, ty: &Type) -> Scalars {
        let zero = |kind: &ScalarKind| match kind {
            ScalarKind::Real => self.real(0.0),
            ScalarKind::Int => self.int(0),
            ScalarKind::Bool => self.bool(false),
        };
        let zeros: Scalars = ty.scalars().iter().map(zero).collect();
        let no = self.bool(false);
        with_flags(ty, &zeros, no)
    }

    /// Applies an operation of the table.
    pub(crate) fn op(&mut self, op: Op, args: &[NodeId]) -> NodeId {
        let before = self.builder.graph().len();
        let id = self.builder.op(op, args);
        if id.index() >= before {
            let value = self.applied(op, args, Precision::F64);
            self.note(id, value);
        }
        id
    }

    /// The value of an operation on constants.
    fn applied(&self, op: Op, args: &[NodeId], precision: Precision) -> Option<Value> {
        let mut values = [Value::Int(0); 4];
        for (arg, place) in args.iter().zip(&mut values) {
            *place = self.value(*arg)?;
        }
        ops::constant(op, values.get(..args.len()).unwrap_or(&[]), precision)
    }

    /// Notes the constants among the nodes from `start` on, which were not made one by one. An operation that rounds to
    /// `real` has a value if it is known which numbers those are.
    pub(crate) fn note_from(&mut self, start: usize, precision: Option<Precision>) {
        for at in start..self.builder.graph().len() {
            let id = NodeId(u32::try_from(at).unwrap_or(u32::MAX));
            let value = match self.builder.graph().get(id) {
                Some(Node::Fresh(inner)) => self.value(inner),
                Some(Node::Apply(op, args)) if op.def().accuracy == Accuracy::Directed => {
                    precision.and_then(|p| self.applied(op, args.as_slice(), p))
                }
                Some(Node::Apply(op, args)) => self.applied(op, args.as_slice(), Precision::F64),
                Some(_) => self.builder.value(id),
                None => None,
            };
            self.note(id, value);
        }
    }

    /// A value of its own if `id` is real; ints and bools need none, nothing differentiates by them.
    pub(crate) fn fresh(&mut self, id: NodeId) -> NodeId {
        if self.builder.graph().scalar(id) != Scalar::Real {
            return id;
        }
        self.novelties += 1;
        let fresh = self.builder.fresh(id);
        self.note(fresh, self.value(id));
        fresh
    }

    /// Each real scalar as a value of its own (LANGUAGE 13.3.3).
    pub(crate) fn renewed(&mut self, value: &Scalars) -> Scalars {
        value.iter().map(|x| self.fresh(*x)).collect()
    }

    /// The value as a name denotes it: unnamed constants become values of their own (LANGUAGE 13.3.4).
    pub(crate) fn named(&mut self, value: &Scalars) -> Scalars {
        value.iter().map(|x| if self.is_unnamed_constant(*x) { self.fresh(*x) } else { *x }).collect()
    }

    /// A real constant that no name denotes and that no `diff` made.
    pub(crate) fn is_unnamed_constant(&self, id: NodeId) -> bool {
        matches!(self.value(id), Some(Value::Real(_)))
            && !matches!(self.builder.graph().get(id), Some(Node::Fresh(_) | Node::Diff { .. }))
    }

    /// The derivative of one scalar by another (LANGUAGE 13.1). A value that is constant cannot depend on one that
    /// is not; what else a derivative is, is found out later.
    pub(crate) fn diff(&mut self, value: NodeId, wrt: NodeId) -> NodeId {
        if self.is_unnamed_constant(wrt) {
            return self.real(0.0);
        }
        let id = self.builder.diff(value, wrt);
        if self.value(value).is_some() && self.value(wrt).is_none() {
            self.note(id, Some(Value::Real(0.0)));
        }
        id
    }

    /// What a value depends on: inputs, counters and carried variables, in the order of the graph.
    pub(crate) fn sources(&self, id: NodeId) -> Vec<NodeId> {
        let graph = self.builder.graph();
        let mut seen = rustc_hash::FxHashSet::default();
        let (mut open, mut found) = (vec![id], Vec::new());
        while let Some(at) = open.pop() {
            if !seen.insert(at) || self.value(at).is_some() {
                continue;
            }
            match graph.get(at) {
                Some(Node::Input(_) | Node::Counter { .. } | Node::Carried { .. }) => found.push(at),
                Some(Node::Join { end, then, otherwise }) => {
                    open.extend([then, otherwise]);
                    if let Some(Node::End { begin }) = graph.get(end)
                        && let Some(Node::Gamma { cond, .. }) = graph.get(begin)
                    {
                        open.push(cond);
                    }
                }
                Some(node) => node.each_operand(|x| open.push(x)),
                None => {}
            }
        }
        found.sort_unstable();
        found
    }
}
