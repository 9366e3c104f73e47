//! Loops in the reverse sweep. One with a constant trip count is walked back by a loop that runs as often: each of its
//! iterations reads from tapes what an iteration started with, last iteration first, computes that once more and walks
//! it back. Any other is differentiated forward, by what its body reads from outside, and its Jacobian takes part.
//!
//! ```text
//! for i in lo..hi { x = body(x, r) }        tape of x at the start of each iteration
//!
//! for k from hi − lo − 1 down to 0 {        x̄: adjoints of the carried variables, r̄: of what is read from outside
//!     x = recall k;  … the body once more
//!     x̄ = x̄ · ∂body/∂x;  r̄ = r̄ + x̄ · ∂body/∂r
//! }
//! ```
//!
//! A long loop keeps only what each chunk of iterations starts with; a loop over the chunks, the last first, runs a
//! chunk once more with a tape and walks it back as above.

use std::collections::BTreeMap;

use isograd_graph::ops::{Derivative, Partial};
use isograd_graph::{Node, NodeId};
use rustc_hash::FxHashMap;

use super::trips::Trips;
use super::{Activity, Adjoint, Frame, Pending, Reverse};
use crate::differentiate::BATCH;
use crate::differentiate::activity::carried_finals;

/// A loop that is being walked back.
pub struct Turn {
    /// Its variables that have adjoints, each with the variable that carries the adjoint in the new loop.
    adjoints: Vec<Carry>,
    /// Of a loop in chunks, what carries the adjoints from chunk to chunk.
    chunks: Option<Vec<NodeId>>,
    /// Whether the body is walked in a branch, because the last chunk may have fewer iterations.
    guarded: bool,
}

/// The adjoint of a carried variable.
#[derive(Clone, Copy)]
struct Carry {
    /// The variable, in the old graph.
    of: NodeId,
    /// The variable for its adjoint, in the new graph.
    adjoint: NodeId,
    masked: bool,
}

/// What a loop's body needs to be computed once more.
struct Body {
    begin: NodeId,
    end: NodeId,
    /// Its live carried variables, each with what an iteration gives it.
    carried: Vec<(NodeId, NodeId)>,
    /// The nodes that are its counter.
    counters: Vec<NodeId>,
}

impl Reverse<'_, '_> {
    /// Begins to walk back the loop between two marks, whose `results` have adjoints; whether it has to be walked.
    pub(super) fn turn(&mut self, begin: NodeId, end: NodeId, results: &[Pending]) -> bool {
        match self.loops.get(begin) {
            None => {
                self.jacobian(begin, end, results);
                false
            }
            Some(Trips::Never) => {
                for Pending { result, adjoint } in results {
                    if let Some(Node::Final { carried, .. }) = self.graph.get(*result)
                        && let Some(Node::Carried { init, .. }) = self.graph.get(carried)
                    {
                        self.add(init, *adjoint);
                    }
                }
                false
            }
            Some(Trips::Kept { lo, count }) => {
                let body = self.body(begin, end);
                let tapes = self.tapes(&body, 1);
                let starts = self.starts(begin, end, results);
                let (number, adjoints) = self.backwards(count, starts);
                let counter = self.shifted(number, lo);
                self.enter_body(&body, &tapes, number, counter, Turn { adjoints, chunks: None, guarded: false });
                true
            }
            Some(Trips::Chunks { lo, count, chunk }) => {
                self.turn_chunks(begin, end, results, [lo, count, chunk]);
                true
            }
        }
    }

    fn turn_chunks(&mut self, begin: NodeId, end: NodeId, results: &[Pending], [lo, count, chunk]: [i32; 3]) {
        let body = self.body(begin, end);
        let tapes = self.tapes(&body, chunk.unsigned_abs());
        let starts = self.starts(begin, end, results);
        let (number, outer) = self.backwards(count / chunk + i32::from(count % chunk != 0), starts);
        let size = self.b.int(chunk);
        let first = self.b.imul(number, size);
        let first = self.shifted(first, lo);

        let inits: Vec<NodeId> = tapes.iter().map(|tape| self.b.recall(*tape, number)).collect();
        let (from, to) = (self.b.int(0), self.b.int(chunk));
        self.b.theta(from, to);
        let number = self.b.counter();
        let counter = self.b.iadd(first, number);
        let carried: Vec<NodeId> = inits.iter().map(|init| self.b.carried(*init)).collect();
        let saved = self.again_with(&body, &carried, counter);
        let nexts: Vec<NodeId> = body.carried.iter().map(|(_, next)| self.copy.to(*next)).collect();
        self.restore(saved);
        let again = self.b.end();
        for (carried, next) in carried.iter().zip(nexts) {
            self.b.carry_out(again, *carried, next);
        }
        let tapes: Vec<NodeId> = carried.iter().map(|carried| self.b.tape(again, *carried, 1)).collect();

        let starts = outer.iter().map(|c| Carry { adjoint: c.adjoint, ..*c }).collect();
        let (number, adjoints) = self.backwards(chunk, starts);
        let counter = self.b.iadd(first, number);
        let guarded = count % chunk != 0;
        if guarded {
            let hi = self.b.int(lo.wrapping_add(count));
            let exists = self.b.ilt(counter, hi);
            self.b.gamma(exists);
        }
        let chunks = Some(outer.iter().map(|c| c.adjoint).collect());
        self.enter_body(&body, &tapes, number, counter, Turn { adjoints, chunks, guarded });
    }

    /// What the body of the loop between two marks consists of.
    fn body(&self, begin: NodeId, end: NodeId) -> Body {
        let finals = carried_finals(self.graph, end).filter(|(_, carried, _)| self.is_live(*carried));
        let carried = finals.map(|(_, carried, next)| (carried, next)).collect();
        let inside = (begin.0 + 1..end.0).map(NodeId).filter(|id| self.is_live(*id));
        let counters = inside.filter(|id| self.graph.get(*id) == Some(Node::Counter { theta: begin })).collect();
        Body { begin, end, carried, counters }
    }

    /// Tapes of a loop's carried variables.
    fn tapes(&mut self, body: &Body, every: u32) -> Vec<NodeId> {
        let end = self.copy.to(body.end);
        body.carried.iter().map(|(carried, _)| self.b.tape(end, self.copy.to(*carried), every)).collect()
    }

    /// `x` + a constant.
    fn shifted(&mut self, x: NodeId, by: i32) -> NodeId {
        if by == 0 {
            return x;
        }
        let by = self.b.int(by);
        self.b.iadd(x, by)
    }

    /// Begins a loop that counts from `count` − 1 down to 0 and carries adjoints. Returns that number, and the adjoints
    /// inside.
    fn backwards(&mut self, count: i32, starts: Vec<Carry>) -> (NodeId, Vec<Carry>) {
        let (from, to) = (self.b.int(0), self.b.int(count));
        let last = self.b.int(count.saturating_sub(1));
        self.b.theta(from, to);
        let counter = self.b.counter();
        let number = self.b.isub(last, counter);
        let carries = starts.into_iter().map(|c| Carry { adjoint: self.b.carried(c.adjoint), ..c }).collect();
        (number, carries)
    }

    /// Computes a body once more in the loop just begun, and begins to walk it.
    fn enter_body(&mut self, body: &Body, tapes: &[NodeId], number: NodeId, counter: NodeId, turn: Turn) {
        let carried: Vec<NodeId> = tapes.iter().map(|tape| self.b.recall(*tape, number)).collect();
        let saved = self.again_with(body, &carried, counter);
        let starts: Vec<Carry> = turn.adjoints.clone();
        self.frames.push(Frame { begin: Some(body.begin), saved, turn: Some(turn), ..Frame::default() });
        let nexts: FxHashMap<NodeId, NodeId> = body.carried.iter().copied().collect();
        for Carry { of, adjoint, masked } in starts {
            if let Some(next) = nexts.get(&of) {
                self.add(*next, Adjoint { node: adjoint, masked });
            }
        }
    }

    /// Computes a body once more, with these values for its carried variables; returns what stood for its nodes.
    fn again_with(&mut self, body: &Body, carried: &[NodeId], counter: NodeId) -> Vec<(NodeId, NodeId)> {
        let own = body.carried.iter().map(|(of, _)| *of).zip(carried.iter().copied());
        let own: Vec<(NodeId, NodeId)> = own.chain(body.counters.iter().map(|id| (*id, counter))).collect();
        let mut saved = Vec::with_capacity(own.len());
        for (id, to) in own {
            saved.push((id, self.copy.to(id)));
            self.copy.set(id, to);
        }
        saved.extend(self.again(NodeId(body.begin.0 + 1), body.end));
        saved
    }

    /// Ends the walk of the loop whose begin was reached.
    pub(super) fn leave_loop(&mut self) {
        let side = self.leave();
        let Some(Turn { adjoints, chunks, guarded }) = side.turn else { return };
        let zero = Adjoint { node: self.zero, masked: true };
        let mut nexts: Vec<Adjoint> = adjoints.iter().map(|c| side.own.get(&c.of).copied().unwrap_or(zero)).collect();
        let mut terms: Vec<(NodeId, Adjoint)> = side.outer.into_iter().collect();
        if guarded {
            self.b.otherwise();
            let end = self.b.end();
            for (next, carry) in nexts.iter_mut().zip(&adjoints) {
                next.node = self.b.join(end, next.node, carry.adjoint);
            }
            for (_, term) in &mut terms {
                term.node = self.b.join(end, term.node, self.zero);
            }
        }
        self.close(adjoints.iter().map(|c| c.adjoint).collect(), &mut nexts, &mut terms);
        if let Some(chunks) = chunks {
            self.close(chunks, &mut nexts, &mut terms);
        }
        for (carry, adjoint) in adjoints.iter().zip(nexts) {
            if let Some(Node::Carried { init, .. }) = self.graph.get(carry.of) {
                self.add(init, adjoint);
            }
        }
        for (of, sum) in terms {
            self.add(of, sum);
        }
    }

    /// Ends a loop: what an iteration gives the adjoints that it carries becomes their last content, and the terms of
    /// each iteration their sums.
    fn close(&mut self, adjoints: Vec<NodeId>, nexts: &mut [Adjoint], terms: &mut [(NodeId, Adjoint)]) {
        let mut sums = Vec::with_capacity(terms.len());
        for (_, term) in &*terms {
            let sum = self.b.carried(self.zero);
            sums.push((sum, self.b.add(sum, term.node)));
        }
        let end = self.b.end();
        for (adjoint, next) in adjoints.into_iter().zip(nexts) {
            next.node = self.b.carry_out(end, adjoint, next.node);
        }
        for ((_, term), (sum, next)) in terms.iter_mut().zip(sums) {
            term.node = self.b.carry_out(end, sum, next);
        }
    }

    /// The carried variables of a loop that an adjoint reaches, from these results: where each adjoint starts, and
    /// whether it is masked in any iteration.
    fn starts(&self, begin: NodeId, end: NodeId, results: &[Pending]) -> Vec<Carry> {
        let finals: Vec<(NodeId, NodeId, NodeId)> = carried_finals(self.graph, end).collect();
        let mut starts: BTreeMap<NodeId, Carry> = BTreeMap::new();
        for (result, carried, _) in &finals {
            if let Some(pending) = results.iter().find(|p| p.result == *result) {
                let Adjoint { node, masked } = pending.adjoint;
                starts.insert(*carried, Carry { of: *carried, adjoint: node, masked });
            }
        }
        loop {
            let mut reach = Reach { sweep: self, masked: FxHashMap::default() };
            for (_, carried, next) in &finals {
                if let Some(start) = starts.get(carried) {
                    reach.put(*next, start.masked);
                }
            }
            reach.body(begin, end);
            let mut news = false;
            for (_, carried, _) in &finals {
                let found = reach.masked.get(carried).copied();
                match (starts.get_mut(carried), found) {
                    (Some(start), found) => {
                        news |= !start.masked && found != Some(false);
                        start.masked |= found != Some(false);
                    }
                    (None, Some(_)) => {
                        // It starts with nothing, as if a branch had not been taken.
                        starts.insert(*carried, Carry { of: *carried, adjoint: self.zero, masked: true });
                        news = true;
                    }
                    (None, None) => {}
                }
            }
            if !news {
                return starts.into_values().collect();
            }
        }
    }

    /// A loop: its Jacobian by what it reads from outside is left to the forward sweep, as `diff` nodes of a copy that
    /// reads each of these values under a name of its own.
    fn jacobian(&mut self, begin: NodeId, end: NodeId, results: &[Pending]) {
        let finals: Vec<NodeId> = carried_finals(self.graph, end).map(|(id, _, _)| id).collect();
        let last = finals.last().copied().unwrap_or(end);
        let mut reads = Vec::new();
        let mut at = begin;
        while at <= last {
            if let Some(node) = self.graph.get(at).filter(|_| self.is_live(at)) {
                let read = |x: NodeId| x < begin && self.activity.active(x) != 0;
                node.each_operand(|x| reads.extend(Some(x).filter(|x| read(*x))));
            }
            at = NodeId(at.0 + 1);
        }
        reads.sort_unstable();
        reads.dedup();
        let mut saved: Vec<(NodeId, NodeId)> = reads.iter().map(|x| (*x, self.copy.to(*x))).collect();
        for x in &reads {
            let fresh = self.b.fresh(self.copy.to(*x));
            self.copy.set(*x, fresh);
        }
        saved.extend(self.again(begin, NodeId(last.0 + 1)));
        let names: Vec<NodeId> = reads.iter().map(|x| self.copy.to(*x)).collect();
        let mut sums: BTreeMap<NodeId, Adjoint> = BTreeMap::new();
        for batch in names.chunks(BATCH).zip(reads.chunks(BATCH)) {
            let depends = Activity::of(self.b.graph(), batch.0);
            let reached: Vec<u64> = results.iter().map(|r| depends.active(self.copy.to(r.result))).collect();
            let bits: Vec<u64> = batch.0.iter().map(|name| depends.seed(*name).unwrap_or(0)).collect();
            for ((name, read), bit) in batch.0.iter().zip(batch.1).zip(bits) {
                for (result, _) in results.iter().zip(&reached).filter(|(_, active)| **active & bit != 0) {
                    let slope = self.b.diff(self.copy.to(result.result), *name);
                    // A loop that does not run, or a branch inside, may leave out what it reads.
                    let term = Adjoint { masked: true, ..self.product(slope, result.adjoint) };
                    let sum = match sums.get(read) {
                        Some(sum) => self.sum(*sum, term),
                        None => term,
                    };
                    sums.insert(*read, sum);
                }
            }
        }
        self.restore(saved);
        for (read, sum) in sums {
            self.add(read, sum);
        }
    }
}

/// Which values of a body an adjoint reaches, and whether it is masked there: what the walk will find, on the safe side.
struct Reach<'a, 'g, 'w> {
    sweep: &'a Reverse<'g, 'w>,
    masked: FxHashMap<NodeId, bool>,
}

impl Reach<'_, '_, '_> {
    /// A term of the adjoint of a value.
    fn put(&mut self, of: NodeId, masked: bool) {
        // A loop inside names variables that nothing needs: they were not copied.
        if self.sweep.is_active(of) && self.sweep.is_live(of) {
            self.masked.entry(of).and_modify(|all| *all &= masked).or_insert(masked);
        }
    }

    /// Goes through a body from its end.
    fn body(&mut self, begin: NodeId, end: NodeId) {
        let graph = self.sweep.graph;
        for id in (begin.0 + 1..end.0).rev().map(NodeId) {
            let Some(node) = graph.get(id) else { continue };
            if let Node::End { .. } = node {
                // Of a loop inside, any iteration may reach all variables.
                if carried_finals(graph, id).any(|(result, ..)| self.masked.contains_key(&result)) {
                    for (_, carried, next) in carried_finals(graph, id) {
                        self.put(carried, true);
                        self.put(next, true);
                    }
                }
                continue;
            }
            let Some(masked) = self.masked.get(&id).copied() else { continue };
            match node {
                Node::Apply(op, args) => self.operation(&op.def().derivative, args.as_slice(), masked),
                Node::Fresh(x) => self.put(x, masked),
                Node::Join { then, otherwise, .. } => {
                    self.put(then, true);
                    self.put(otherwise, true);
                }
                Node::Carried { theta, init } if theta != begin => self.put(init, true),
                _ => {}
            }
        }
    }

    fn operation(&mut self, derivative: &Derivative, args: &[NodeId], masked: bool) {
        match derivative {
            Derivative::Zero => {}
            Derivative::Choice { then, otherwise, .. } => {
                if let (Some(then), Some(otherwise)) = (args.get(*then), args.get(*otherwise)) {
                    self.put(*then, masked || then != otherwise);
                    self.put(*otherwise, masked || then != otherwise);
                }
            }
            Derivative::Partials(partials) => {
                for (arg, partial) in args.iter().zip(partials.iter()) {
                    if !matches!(partial, Partial::Zero) {
                        self.put(*arg, masked);
                    }
                }
            }
        }
    }
}
