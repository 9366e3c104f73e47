//! The graph's data: nodes, inputs, outputs. How graphs are made is in `builder`, what makes one well formed in
//! `verify`.

use std::ops::Index;

use crate::{Op, Precision, Scalar};

/// A node of a [`Graph`], by its position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(pub u32);

impl NodeId {
    /// No node: fills unused operand places.
    pub const NONE: Self = Self(u32::MAX);

    /// The position.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// Where a node comes from: an opaque number that the producer of the graph can turn into a source span.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Origin(pub u32);

/// Operands of an operation, at most four; unused places hold [`NodeId::NONE`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Args([NodeId; 4]);

impl Args {
    /// The operands, as many as there are.
    #[must_use]
    pub fn new(args: &[NodeId]) -> Self {
        let mut all = [NodeId::NONE; 4];
        for (place, arg) in all.iter_mut().zip(args) {
            *place = *arg;
        }
        Self(all)
    }

    /// What stands for the operands elsewhere, in another graph for example.
    #[must_use]
    pub fn map(self, mut to: impl FnMut(NodeId) -> NodeId) -> Self {
        Self(self.0.map(|x| if x == NodeId::NONE { x } else { to(x) }))
    }

    /// The operands as a slice.
    #[must_use]
    pub fn as_slice(&self) -> &[NodeId] {
        let n = self.0.iter().position(|a| *a == NodeId::NONE).unwrap_or(self.0.len());
        self.0.get(..n).unwrap_or(&[])
    }
}

/// A part of an enclosure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Part {
    /// The lower end, a real.
    Lower,
    /// The upper end, a real.
    Upper,
    /// Whether the value may be NaN, a bool.
    MayBeNan,
}

impl Part {
    /// All parts.
    pub const ALL: [Self; 3] = [Self::Lower, Self::Upper, Self::MayBeNan];

    /// Its name in the text form.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lower => "lower",
            Self::Upper => "upper",
            Self::MayBeNan => "maybenan",
        }
    }

    /// The kind of its value.
    #[must_use]
    pub const fn scalar(self) -> Scalar {
        match self {
            Self::Lower | Self::Upper => Scalar::Real,
            Self::MayBeNan => Scalar::Bool,
        }
    }
}

/// One node. The meaning of the structured ones is in the crate's documentation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Node {
    /// The flattened parameter with this index.
    Input(u32),
    /// A real constant, by its bits.
    Real(u64),
    /// An int constant.
    Int(i32),
    /// A truth constant.
    Bool(bool),
    /// An operation of the table.
    Apply(Op, Args),
    /// The same number as its operand, but a value of its own for `diff` (LANGUAGE 13.3). Gone after `fold`.
    Fresh(NodeId),
    /// The derivative of one scalar by another (LANGUAGE 13). Gone after `differentiate`.
    Diff {
        /// What is differentiated.
        value: NodeId,
        /// By what.
        wrt: NodeId,
    },
    /// One component of the box of a [`Node::Bound`]: there `wrt` may be any number from `lo` to `hi` (LANGUAGE 15.3).
    /// Gone after `differentiate`.
    Within {
        /// The value that becomes an interval.
        wrt: NodeId,
        /// One end; the ends are in no order.
        lo: NodeId,
        /// The other end.
        hi: NodeId,
        /// Whether the interval may be NaN.
        nan: NodeId,
        /// The `Within` of the next component; `NONE` for the last.
        next: NodeId,
    },
    /// A part of the enclosure of a real over a box (LANGUAGE 15). Gone after `differentiate`.
    Bound {
        /// What is enclosed.
        value: NodeId,
        /// The first component of the box.
        within: NodeId,
        /// Which part.
        part: Part,
    },
    /// Begins a branch: the nodes up to `otherwise` are the side for true, those up to `end` the other.
    Gamma {
        /// The condition.
        cond: NodeId,
        /// Its `Else`.
        otherwise: NodeId,
        /// Its `End`.
        end: NodeId,
    },
    /// Between the sides of a gamma.
    Else {
        /// The gamma.
        gamma: NodeId,
    },
    /// Begins a loop.
    Theta {
        /// The first counter value.
        lo: NodeId,
        /// One past the last.
        hi: NodeId,
        /// Its `End`.
        end: NodeId,
    },
    /// The counter of a loop, inside of it.
    Counter {
        /// The loop.
        theta: NodeId,
    },
    /// A carried variable at the start of an iteration, inside of the loop. Exactly one `Final` names it.
    Carried {
        /// The loop.
        theta: NodeId,
        /// Its content before the first iteration.
        init: NodeId,
    },
    /// Ends a gamma or theta.
    End {
        /// The gamma or theta.
        begin: NodeId,
    },
    /// A result of a gamma, after its end.
    Join {
        /// The gamma's end.
        end: NodeId,
        /// Its value on the side for true.
        then: NodeId,
        /// Its value on the other.
        otherwise: NodeId,
    },
    /// A carried variable after the last iteration, after the theta's end.
    Final {
        /// The theta's end.
        end: NodeId,
        /// The variable.
        carried: NodeId,
        /// What an iteration gives it.
        next: NodeId,
    },
    /// What a value was in the iterations of a loop whose bounds are constant, after the loop's end. No scalar: only a
    /// [`Node::Recall`] may name it.
    Tape {
        /// The theta's end.
        end: NodeId,
        /// The value, of the loop's region.
        value: NodeId,
        /// Of the first iteration and every so many from there on it holds the value; at least 1.
        every: u32,
    },
    /// What a tape has of an iteration.
    Recall {
        /// The tape.
        tape: NodeId,
        /// Which of the iterations that it holds, an int, from 0 for the first. What is not on the tape has no defined
        /// content.
        at: NodeId,
    },
}

impl Node {
    /// A real constant.
    #[must_use]
    pub fn real(x: f64) -> Self {
        Self::Real(x.to_bits())
    }

    /// Calls `f` with each value operand (not with the structural links between the marks of one structure).
    pub fn each_operand(&self, mut f: impl FnMut(NodeId)) {
        match self {
            Self::Input(_) | Self::Real(_) | Self::Int(_) | Self::Bool(_) => {}
            Self::Else { .. } | Self::End { .. } | Self::Counter { .. } => {}
            Self::Apply(_, args) => args.as_slice().iter().copied().for_each(f),
            Self::Fresh(x) => f(*x),
            Self::Diff { value, wrt } => {
                f(*value);
                f(*wrt);
            }
            Self::Within { wrt, lo, hi, nan, next } => {
                for x in [wrt, lo, hi, nan] {
                    f(*x);
                }
                if *next != NodeId::NONE {
                    f(*next);
                }
            }
            Self::Bound { value, within, .. } => {
                f(*value);
                f(*within);
            }
            Self::Gamma { cond, .. } => f(*cond),
            Self::Theta { lo, hi, .. } => {
                f(*lo);
                f(*hi);
            }
            Self::Carried { init, .. } => f(*init),
            Self::Join { then, otherwise, .. } => {
                f(*then);
                f(*otherwise);
            }
            Self::Final { carried, next, .. } => {
                f(*carried);
                f(*next);
            }
            Self::Tape { value, .. } => f(*value),
            Self::Recall { tape, at } => {
                f(*tape);
                f(*at);
            }
        }
    }
}

/// A parameter scalar of a graph.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Input {
    /// Its flattened name, `at.x`.
    pub name: String,
    /// Its kind.
    pub scalar: Scalar,
}

/// A result scalar of a graph.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Output {
    /// Its name, unique in the graph.
    pub name: String,
    /// The node, in the outermost region.
    pub node: NodeId,
}

/// A graph: see the crate's documentation.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Graph {
    pub(crate) nodes: Vec<Node>,
    pub(crate) scalars: Vec<Scalar>,
    pub(crate) origins: Vec<Origin>,
    /// The parameters, flattened.
    pub inputs: Vec<Input>,
    /// The results, flattened.
    pub outputs: Vec<Output>,
    /// The precision its real constants are rounded to; `None` before `fold`, while they are unrounded f64.
    pub precision: Option<Precision>,
}

impl Graph {
    /// The number of nodes, marks included.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether there are no nodes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// The nodes in order with their ids.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = (NodeId, Node)> + '_ {
        self.nodes.iter().enumerate().map(|(i, n)| (NodeId(u32::try_from(i).unwrap_or(u32::MAX)), *n))
    }

    /// The node with this id, if there is one.
    #[must_use]
    pub fn get(&self, id: NodeId) -> Option<Node> {
        self.nodes.get(id.index()).copied()
    }

    /// The kind of a node's value; `Bool` for marks, which have none.
    #[must_use]
    pub fn scalar(&self, id: NodeId) -> Scalar {
        self.scalars.get(id.index()).copied().unwrap_or(Scalar::Bool)
    }

    /// Where a node comes from.
    #[must_use]
    pub fn origin(&self, id: NodeId) -> Origin {
        self.origins.get(id.index()).copied().unwrap_or_default()
    }

    /// Operations of the table, the number that budgets and reports count.
    #[must_use]
    pub fn operations(&self) -> usize {
        self.nodes.iter().filter(|n| matches!(n, Node::Apply(..))).count()
    }
}

impl Index<NodeId> for Graph {
    type Output = Node;

    #[expect(clippy::indexing_slicing, reason = "ids come from this graph")]
    fn index(&self, id: NodeId) -> &Node {
        &self.nodes[id.index()]
    }
}
