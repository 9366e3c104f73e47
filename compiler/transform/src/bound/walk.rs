//! The walk that encloses: from left to right over what a plan names, it makes beside each value the nodes of its
//! enclosure. Knows no operation; the rules stand in the op table.

use isograd_graph::{Builder, Enclosure, Graph, Node, NodeId, Range, Scalar, Value};
use rustc_hash::FxHashMap;

use super::depends::Depends;
use super::facts::facts;
use super::plan::Plan;
use crate::differentiate::carried_finals;
use crate::raw::RawCopy;

/// Encloses values at the end of a graph that is being copied.
pub struct Walk<'a, 'g, 'w> {
    pub graph: &'g Graph,
    pub depends: &'a Depends<'g>,
    pub b: &'a mut Builder<'w>,
    pub copy: &'a mut RawCopy<'g>,
    /// The new counters of the loops that are open.
    pub counters: &'a FxHashMap<NodeId, NodeId>,
    /// What the values that the box replaces become.
    pub sources: FxHashMap<NodeId, Enclosure>,
    enclosures: FxHashMap<NodeId, Enclosure>,
    /// Of a branch: what its results are on the side that was walked first, as joined if both may run.
    sides: FxHashMap<NodeId, Enclosure>,
    /// What stood for nodes before they were copied once more.
    saved: Vec<(NodeId, NodeId)>,
}

impl<'a, 'g, 'w> Walk<'a, 'g, 'w> {
    pub fn new(
        graph: &'g Graph,
        depends: &'a Depends<'g>,
        b: &'a mut Builder<'w>,
        copy: &'a mut RawCopy<'g>,
        counters: &'a FxHashMap<NodeId, NodeId>,
    ) -> Self {
        let (sources, enclosures, sides) = Default::default();
        Self { graph, depends, b, copy, counters, sources, enclosures, sides, saved: Vec::new() }
    }

    /// Makes the enclosures of a plan.
    pub fn run(&mut self, plan: &Plan) {
        let (mut at, stop) = plan.range;
        while at < stop && self.b.exhausted().is_none() {
            let Some(node) = self.graph.get(at) else { break };
            at = self.node(plan, stop, at, node);
        }
    }

    /// Lets go of the nodes that were copied once more; what stood for them before does so again.
    pub fn restore(&mut self) {
        self.forget(0);
    }

    fn forget(&mut self, keep: usize) {
        for (id, to) in self.saved.drain(keep.min(self.saved.len())..).rev() {
            self.copy.set(id, to);
        }
    }

    /// The enclosure of a value, as every operation reads it; of a constant that of its rounded value.
    pub fn enclosure(&mut self, of: NodeId) -> Enclosure {
        if let Some(found) = self.enclosures.get(&of) {
            return *found;
        }
        let value = self.value(of);
        self.point(value)
    }

    fn tidied(&mut self, of: NodeId) -> Enclosure {
        self.enclosure(of).tidied(self.b)
    }

    fn point(&mut self, value: NodeId) -> Enclosure {
        match self.b.value(value) {
            // Rounding keeps the order of ends.
            Some(Value::Real(x)) if !x.is_nan() => {
                let rounded = self.b.rounded_to_real(value);
                Enclosure::Real(Range::of(self.b, rounded, rounded))
            }
            _ => Enclosure::point(self.b, value),
        }
    }

    /// The value in the run. Constants are made anew: theirs may stand in a region that is closed, or further on.
    fn value(&mut self, of: NodeId) -> NodeId {
        match self.graph.get(of) {
            Some(Node::Real(bits)) => self.b.real(f64::from_bits(bits)),
            Some(Node::Int(x)) => self.b.int(x),
            Some(Node::Bool(x)) => self.b.bool(x),
            _ => self.copy.to(of),
        }
    }

    fn set_copy(&mut self, of: NodeId, to: NodeId) {
        self.saved.push((of, self.copy.to(of)));
        self.copy.set(of, to);
    }

    fn active(&self, plan: &Plan, id: NodeId) -> bool {
        self.depends.active(plan.level, id)
    }

    /// Walks one node and says which comes next.
    fn node(&mut self, plan: &Plan, stop: NodeId, at: NodeId, node: Node) -> NodeId {
        let next = NodeId(at.0 + 1);
        match node {
            Node::Gamma { cond, end, .. } if end < stop => {
                if !plan.enters(at) {
                    return NodeId(end.0 + 1);
                }
                self.begin_branch(plan, at, cond);
            }
            Node::Theta { lo, hi, end } if end < stop => {
                if !plan.enters(at) {
                    return NodeId(end.0 + 1);
                }
                let (lo, hi) = (self.value(lo), self.value(hi));
                self.begin_loop(plan, at, end, lo, hi);
            }
            Node::Theta { lo, end, .. } => {
                if let Some(earlier) = plan.replay(at) {
                    self.replay(earlier, at, lo, end);
                }
            }
            Node::Else { gamma } if plan.enters(gamma) => self.switch(plan, gamma),
            Node::End { begin } if plan.enters(begin) => match self.graph.get(begin) {
                Some(Node::Theta { .. }) => self.end_loop(plan, at),
                _ => self.end_branch(plan, at, begin),
            },
            Node::Gamma { .. } | Node::Else { .. } | Node::End { .. } => {}
            _ => self.plain(plan, at, node),
        }
        next
    }

    fn plain(&mut self, plan: &Plan, at: NodeId, node: Node) {
        // Variables and results of loops stand where their loop begins and ends.
        if plan.again(at) && !matches!(node, Node::Carried { .. } | Node::Final { .. }) {
            self.saved.push((at, self.copy.to(at)));
            self.copy.node(self.b, at, node);
        }
        if !plan.encloses(at) || self.enclosures.contains_key(&at) {
            return;
        }
        self.b.set_origin(self.graph.origin(at));
        let enclosure = if !self.active(plan, at) {
            let value = self.value(at);
            self.point(value)
        } else if self.depends.is_source(plan.level, at) {
            match self.sources.get(&at) {
                Some(given) => *given,
                None => return,
            }
        } else {
            match node {
                Node::Apply(op, args) => {
                    let mut operands = [Enclosure::Int { lo: NodeId::NONE, hi: NodeId::NONE }; 4];
                    for (place, x) in operands.iter_mut().zip(args.as_slice()) {
                        *place = self.enclosure(*x);
                    }
                    let args = args.as_slice();
                    let facts = facts(self.graph, args, |x| self.depends.is_source(plan.level, x));
                    self.b.enclose(op, operands.get(..args.len()).unwrap_or(&[]), facts)
                }
                Node::Fresh(x) => self.enclosure(x),
                Node::Tape { end, value, every } => {
                    let (end, content) = (self.copy.to(end), self.enclosure(value));
                    self.each(content, |b, x| b.tape(end, x, every))
                }
                Node::Recall { tape, at } => {
                    let (tapes, at) = (self.enclosure(tape), self.value(at));
                    self.each(tapes, |b, x| b.recall(x, at))
                }
                _ => return,
            }
        };
        self.enclosures.insert(at, enclosure);
    }

    /// A branch on a value of the run stays one; of one on an enclosed condition, each side runs if it may.
    fn begin_branch(&mut self, plan: &Plan, at: NodeId, cond: NodeId) {
        self.b.set_origin(self.graph.origin(at));
        let taken = match (self.active(plan, cond), self.tidied_truth(plan, cond)) {
            (true, Some((yes, _))) => yes,
            _ => self.value(cond),
        };
        self.b.gamma(taken);
    }

    fn tidied_truth(&mut self, plan: &Plan, cond: NodeId) -> Option<(NodeId, NodeId)> {
        if !self.active(plan, cond) {
            return None;
        }
        match self.enclosure(cond) {
            Enclosure::Bool { yes, no } => Some((yes, no)),
            _ => None,
        }
    }

    fn switch(&mut self, plan: &Plan, gamma: NodeId) {
        let Some(Node::Gamma { cond, end, .. }) = self.graph.get(gamma) else { return };
        let results: Vec<_> = plan.results(end).iter().filter_map(|j| Some((*j, self.sides_of(*j)?.0))).collect();
        let results: Vec<_> = results.into_iter().map(|(join, then)| (join, self.tidied(then))).collect();
        let Some((_, no)) = self.tidied_truth(plan, cond) else {
            self.sides.extend(results);
            self.b.otherwise();
            return;
        };
        self.results_if_run(results);
        self.b.gamma(no);
    }

    fn sides_of(&self, join: NodeId) -> Option<(NodeId, NodeId)> {
        match self.graph.get(join) {
            Some(Node::Join { then, otherwise, .. }) => Some((then, otherwise)),
            _ => None,
        }
    }

    fn end_branch(&mut self, plan: &Plan, at: NodeId, gamma: NodeId) {
        let Some(Node::Gamma { cond, .. }) = self.graph.get(gamma) else { return };
        let results: Vec<_> = plan.results(at).iter().filter_map(|j| Some((*j, self.sides_of(*j)?.1))).collect();
        let results: Vec<_> = results.into_iter().map(|(join, other)| (join, self.tidied(other))).collect();
        if self.active(plan, cond) {
            let first: Vec<_> = results.iter().map(|(join, _)| self.sides.get(join).copied()).collect();
            let joins: Vec<NodeId> = results.iter().map(|(join, _)| *join).collect();
            self.results_if_run(results);
            for (join, first) in joins.into_iter().zip(first) {
                if let (Some(first), Some(second)) = (first, self.sides.get(&join).copied()) {
                    let hull = first.hull(second, self.b);
                    self.enclosures.insert(join, hull);
                }
            }
            return;
        }
        let end = self.b.end();
        self.set_copy(at, end);
        for (join, other) in results {
            if let Some(then) = self.sides.get(&join).copied() {
                let joined = self.joined(end, then, other);
                self.enclosures.insert(join, joined);
            }
        }
    }

    /// Closes a branch that has one side; where it does not run, its results are what adds nothing to a hull.
    fn results_if_run(&mut self, results: Vec<(NodeId, Enclosure)>) {
        self.b.otherwise();
        let nothing: Vec<_> = results.iter().map(|(_, e)| self.nothing(*e)).collect();
        let end = self.b.end();
        for ((join, enclosure), nothing) in results.into_iter().zip(nothing) {
            let joined = self.joined(end, enclosure, nothing);
            self.sides.insert(join, joined);
        }
    }

    /// The neutral element of the hull.
    fn nothing(&mut self, like: Enclosure) -> Enclosure {
        match like {
            Enclosure::Real(_) => {
                let (lo, hi) = (self.b.real(f64::INFINITY), self.b.real(f64::NEG_INFINITY));
                Enclosure::Real(Range::of(self.b, lo, hi))
            }
            Enclosure::Int { .. } => Enclosure::Int { lo: self.b.int(i32::MAX), hi: self.b.int(i32::MIN) },
            Enclosure::Bool { .. } => Enclosure::Bool { yes: self.b.bool(false), no: self.b.bool(false) },
        }
    }

    fn joined(&mut self, end: NodeId, then: Enclosure, otherwise: Enclosure) -> Enclosure {
        match (then, otherwise) {
            (Enclosure::Real(x), Enclosure::Real(y)) => {
                let (lo, hi) = (self.b.join(end, x.lo, y.lo), self.b.join(end, x.hi, y.hi));
                Enclosure::Real(Range { lo, hi, nan: self.b.join(end, x.nan, y.nan), tidy: true })
            }
            (Enclosure::Int { lo, hi }, Enclosure::Int { lo: lo2, hi: hi2 }) => {
                Enclosure::Int { lo: self.b.join(end, lo, lo2), hi: self.b.join(end, hi, hi2) }
            }
            (Enclosure::Bool { yes, no }, Enclosure::Bool { yes: yes2, no: no2 }) => {
                Enclosure::Bool { yes: self.b.join(end, yes, yes2), no: self.b.join(end, no, no2) }
            }
            _ => then,
        }
    }

    /// A loop runs as often as in the run; beside the enclosures of its variables it carries what they need of the run.
    fn begin_loop(&mut self, plan: &Plan, at: NodeId, end: NodeId, lo: NodeId, hi: NodeId) {
        self.b.set_origin(self.graph.origin(at));
        let variables: Vec<NodeId> = carried_finals(self.graph, end).map(|(_, carried, _)| carried).collect();
        let mut enclosed = Vec::new();
        let mut again = Vec::new();
        for carried in variables {
            let Some(Node::Carried { init, .. }) = self.graph.get(carried) else { continue };
            if plan.encloses(carried) && self.active(plan, carried) {
                enclosed.push((carried, self.tidied(init)));
            }
            if plan.again(carried) {
                again.push((carried, self.value(init)));
            }
        }
        let theta = self.b.theta(lo, hi);
        self.set_copy(at, theta);
        for (carried, init) in enclosed {
            let variable = self.each(init, |b, x| b.carried(x));
            self.enclosures.insert(carried, variable);
        }
        for (carried, init) in again {
            let variable = self.b.carried(init);
            self.set_copy(carried, variable);
        }
    }

    fn end_loop(&mut self, plan: &Plan, at: NodeId) {
        let mut enclosed = Vec::new();
        let mut again = Vec::new();
        for (result, carried, next) in carried_finals(self.graph, at).collect::<Vec<_>>() {
            if plan.encloses(carried) && self.active(plan, carried) {
                enclosed.push((result, self.enclosure(carried), self.tidied(next)));
            }
            if plan.again(carried) {
                again.push((result, self.copy.to(carried), self.value(next)));
            }
        }
        for tape in plan.results(at) {
            if let Some(Node::Tape { value, .. }) = self.graph.get(*tape) {
                let content = self.tidied(value);
                self.enclosures.insert(value, content);
            }
        }
        let end = self.b.end();
        self.set_copy(at, end);
        for (result, variable, next) in enclosed {
            let carried_out = match (variable, next) {
                (Enclosure::Real(x), Enclosure::Real(y)) => {
                    let (lo, hi) = (self.b.carry_out(end, x.lo, y.lo), self.b.carry_out(end, x.hi, y.hi));
                    Enclosure::Real(Range { lo, hi, nan: self.b.carry_out(end, x.nan, y.nan), tidy: true })
                }
                (Enclosure::Int { lo, hi }, Enclosure::Int { lo: lo2, hi: hi2 }) => {
                    Enclosure::Int { lo: self.b.carry_out(end, lo, lo2), hi: self.b.carry_out(end, hi, hi2) }
                }
                (Enclosure::Bool { yes, no }, Enclosure::Bool { yes: yes2, no: no2 }) => {
                    Enclosure::Bool { yes: self.b.carry_out(end, yes, yes2), no: self.b.carry_out(end, no, no2) }
                }
                _ => variable,
            };
            self.enclosures.insert(result, carried_out);
        }
        for (result, variable, next) in again {
            let carried_out = self.b.carry_out(end, variable, next);
            self.set_copy(result, carried_out);
        }
    }

    /// The earlier iterations of a loop that is open, in a loop up to its counter: they give what its variables
    /// hold now.
    fn replay(&mut self, plan: &Plan, theta: NodeId, lo: NodeId, end: NodeId) {
        let Some(counter) = self.counters.get(&theta).copied() else { return };
        let keep = self.saved.len();
        let lo = self.value(lo);
        self.begin_loop(plan, theta, end, lo, counter);
        self.run(plan);
        self.end_loop(plan, end);
        self.forget(keep);
        let finals: Vec<_> = carried_finals(self.graph, end).collect();
        let now: Vec<_> =
            finals.iter().filter_map(|(result, carried, _)| Some((*carried, *self.enclosures.get(result)?))).collect();
        // All else in the body belongs to earlier iterations.
        self.enclosures.retain(|id, _| *id < theta);
        self.enclosures.extend(now);
    }

    fn each(&mut self, e: Enclosure, mut f: impl FnMut(&mut Builder<'w>, NodeId) -> NodeId) -> Enclosure {
        match e {
            Enclosure::Real(Range { lo, hi, nan, .. }) => {
                Enclosure::Real(Range { lo: f(self.b, lo), hi: f(self.b, hi), nan: f(self.b, nan), tidy: true })
            }
            Enclosure::Int { lo, hi } => Enclosure::Int { lo: f(self.b, lo), hi: f(self.b, hi) },
            Enclosure::Bool { yes, no } => Enclosure::Bool { yes: f(self.b, yes), no: f(self.b, no) },
        }
    }

    /// What kind of enclosure a value has does not matter to a caller that wants the ends of a real.
    pub fn range(&mut self, of: NodeId) -> Option<Range> {
        match self.enclosure(of) {
            Enclosure::Real(range) if self.graph.scalar(of) == Scalar::Real => Some(range),
            _ => None,
        }
    }
}
