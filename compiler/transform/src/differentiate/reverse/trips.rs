//! Which loops of a raw graph have a constant trip count, and what may be recorded of them. Knows sizes; knows nothing of
//! adjoints.

use isograd_graph::{Graph, Node, NodeId, Precision, Scalar, Value, ops};
use rustc_hash::FxHashMap;

/// Bytes that the tapes of a graph may have for a point.
const LIMIT: u64 = 64 << 10;

/// How large the tapes of single loops may be. What is too large altogether is tried again with less.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Allowance {
    scalars: u64,
}

impl Allowance {
    /// Nothing.
    pub const NONE: Self = Self { scalars: 0 };

    /// What to try in turn: the limit for each; a sixteenth of that, so that more loops keep only some iterations and
    /// recompute the others; nothing.
    pub const fn of(precision: Precision) -> [Self; 3] {
        let scalars = LIMIT / precision.bytes() as u64;
        [Self { scalars }, Self { scalars: scalars / 16 }, Self::NONE]
    }
}

/// How the iterations of a loop are had again, the last one first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trips {
    /// There are none.
    Never,
    /// What each iteration starts with is kept.
    Kept {
        /// The first counter value.
        lo: i32,
        /// How many iterations.
        count: i32,
    },
    /// What every so many iterations start with is kept; from there they are run once more and kept for the time being
    /// (Griewank and Walther, *Evaluating Derivatives*, 2008, chapter 12, with two levels).
    Chunks {
        /// The first counter value.
        lo: i32,
        /// How many iterations.
        count: i32,
        /// Iterations of a chunk; the last one may have fewer.
        chunk: i32,
    },
}

/// The loops of a graph that can be walked back.
pub struct Loops<'l> {
    /// Which nodes of the graph are live.
    pub live: &'l [bool],
    /// By their begins.
    trips: FxHashMap<NodeId, Trips>,
}

impl<'l> Loops<'l> {
    /// Finds them. Carried variables count if they are live.
    pub fn of(graph: &Graph, live: &'l [bool], allowance: Allowance) -> Self {
        let mut loops = FxHashMap::default();
        if allowance == Allowance::NONE {
            return Self { live, trips: loops };
        }
        let constants = Constants::of(graph);
        let mut carried: FxHashMap<NodeId, u64> = FxHashMap::default();
        for (id, node) in graph.iter() {
            match node {
                Node::Carried { theta, .. } if live.get(id.index()) == Some(&true) => {
                    *carried.entry(theta).or_default() += 1;
                }
                Node::End { begin } => {
                    let Some(Node::Theta { lo, hi, .. }) = graph.get(begin) else { continue };
                    let variables = carried.remove(&begin).unwrap_or(0);
                    if let Some((lo, hi)) = constants.int(lo).zip(constants.int(hi))
                        && let Some(trips) = trips(lo, hi, variables, allowance.scalars)
                    {
                        loops.insert(begin, trips);
                    }
                }
                _ => {}
            }
        }
        Self { live, trips: loops }
    }

    /// How to walk back a loop; `None` if that is not possible.
    pub fn get(&self, theta: NodeId) -> Option<Trips> {
        self.trips.get(&theta).copied()
    }

    /// Whether a value is the result of a loop that cannot be walked back.
    pub fn stuck_at(&self, graph: &Graph, value: NodeId) -> bool {
        match graph.get(value) {
            Some(Node::Final { end, .. }) => match graph.get(end) {
                Some(Node::End { begin }) => self.get(begin).is_none(),
                _ => true,
            },
            _ => false,
        }
    }
}

fn trips(lo: i32, hi: i32, variables: u64, room: u64) -> Option<Trips> {
    if lo >= hi {
        return Some(Trips::Never);
    }
    let count = hi.checked_sub(lo)?;
    let fits = |scalars: u64| scalars.saturating_mul(variables) <= room;
    let n = u64::from(count.unsigned_abs());
    if fits(n) {
        return Some(Trips::Kept { lo, count });
    }
    // Of the sizes that need about the least room, one that divides the count needs no test.
    let root = n.isqrt();
    let divisor = (root..=root.saturating_mul(2)).find(|chunk| n.is_multiple_of(*chunk));
    let chunk = divisor.unwrap_or(root + 1);
    let chunk_count = n.div_ceil(chunk);
    if !fits(chunk + chunk_count) {
        return None;
    }
    Some(Trips::Chunks { lo, count, chunk: i32::try_from(chunk).ok()? })
}

/// Whether the tapes of a graph fit the limit together.
pub fn tapes_fit(graph: &Graph, live: &[bool], precision: Precision) -> bool {
    let is_live = |id: NodeId| live.get(id.index()) == Some(&true);
    let mut tapes = graph.iter().filter(|(id, node)| matches!(node, Node::Tape { .. }) && is_live(*id)).peekable();
    if tapes.peek().is_none() {
        return true;
    }
    let constants = Constants::of(graph);
    let scalars: u64 = tapes.map(|(_, node)| constants.held(graph, node)).fold(0, u64::saturating_add);
    scalars.saturating_mul(precision.bytes().into()) <= LIMIT
}

/// The ints and truths of a raw graph that are constant: `fold` finds the same.
struct Constants(Vec<Option<Value>>);

impl Constants {
    fn of(graph: &Graph) -> Self {
        let mut this = Self(Vec::with_capacity(graph.len()));
        for (id, node) in graph.iter() {
            let value = match node {
                _ if graph.scalar(id) == Scalar::Real => None,
                Node::Int(x) => Some(Value::Int(x)),
                Node::Bool(x) => Some(Value::Bool(x)),
                Node::Fresh(x) => this.get(x),
                Node::Apply(op, args) => {
                    let mut values = [Value::Int(0); 4];
                    let args = args.as_slice();
                    let known = args
                        .iter()
                        .zip(&mut values)
                        .all(|(arg, place)| this.get(*arg).map(|value| *place = value).is_some());
                    // No real is constant here, so that the precision does not matter.
                    known.then(|| ops::constant(op, values.get(..args.len()).unwrap_or(&[]), Precision::F64)).flatten()
                }
                _ => None,
            };
            this.0.push(value);
        }
        this
    }

    fn get(&self, id: NodeId) -> Option<Value> {
        self.0.get(id.index()).copied().flatten()
    }

    fn int(&self, id: NodeId) -> Option<i32> {
        match self.get(id)? {
            Value::Int(x) => Some(x),
            _ => None,
        }
    }

    /// How many scalars a tape holds.
    fn held(&self, graph: &Graph, tape: Node) -> u64 {
        let Node::Tape { end, every, .. } = tape else { return 0 };
        let Some(Node::End { begin }) = graph.get(end) else { return 0 };
        let Some(Node::Theta { lo, hi, .. }) = graph.get(begin) else { return 0 };
        match self.int(lo).zip(self.int(hi)) {
            Some((lo, hi)) => {
                let count = u64::try_from(i64::from(hi) - i64::from(lo)).unwrap_or(0);
                count.div_ceil(u64::from(every.max(1)))
            }
            None => u64::MAX,
        }
    }
}
