//! Branches and loops of the graph in lanes (DESIGN 7). What all lanes decide alike is a real branch or counted loop;
//! else a side runs if any lane takes it and a loop until no lane goes on, under masks. Knows nothing of operations.
//!
//! No value crosses the end of a side in a local that only one side sets: code generators would keep the stale one
//! alive. So a side that does not run sets the results to 0.

use isograd_graph::{Node, NodeId, Precision};
use wasm_encoder::BlockType;

use crate::emit::Emitter;

/// An open branch or loop.
pub enum Frame {
    /// A branch on a uniform condition.
    Branch,
    /// A branch that lanes take one by one.
    LaneBranch {
        /// The mask around it.
        outer: Option<u32>,
        /// The group of the mask of the open side, to be taken back; `None` if it is the condition itself.
        own: Option<u32>,
        /// Whether the open side has code, and so an `if` around it.
        guarded: bool,
    },
    /// A loop with uniform bounds.
    Loop {
        /// The local of the counter.
        counter: u32,
        /// The end.
        hi: Bound,
        /// Whether an `if` around it asks if it runs at all.
        guarded: bool,
    },
    /// A loop that lanes leave one by one.
    LaneLoop {
        /// The mask around it.
        outer: Option<u32>,
        /// The group of the lanes that go on.
        running: u32,
        /// The counter.
        counter: LaneCounter,
    },
}

/// The end of a loop with uniform bounds.
#[derive(Clone, Copy)]
pub enum Bound {
    /// A constant.
    Constant(i32),
    /// A local.
    Local(u32),
}

/// The counter of a loop that lanes leave one by one.
#[derive(Clone, Copy)]
pub enum LaneCounter {
    /// All lanes began at the same number: an i32 local.
    Scalar(u32),
    /// A group.
    Lanes(u32),
}

impl Emitter<'_> {
    /// Whether any lane of any vector is on.
    fn any(&mut self, mask: u32) {
        for vector in 0..self.vectors {
            self.code.get(mask + vector);
            if vector > 0 {
                self.code.sink().v128_or();
            }
        }
        self.code.sink().v128_any_true();
    }

    fn joins(&self, end: NodeId) -> Vec<NodeId> {
        self.rates.joins.get(&end).cloned().unwrap_or_default()
    }

    fn carried(&self, theta: NodeId) -> Vec<NodeId> {
        self.rates.carried.get(&theta).cloned().unwrap_or_default()
    }

    /// Opens a branch and its side for true.
    pub fn gamma(&mut self, cond: NodeId, empty: bool) {
        if self.rates.uniform[cond] {
            self.push_scalar(cond);
            self.code.sink().if_(BlockType::Empty);
            self.frames.push(Frame::Branch);
            return;
        }
        let outer = self.mask;
        let own = outer.map(|outer| {
            let mask = self.locals.take(true);
            for vector in 0..self.vectors {
                self.push(cond, vector);
                self.code.get(outer + vector);
                self.code.sink().v128_and();
                self.code.set(mask + vector);
            }
            mask
        });
        let mask = own.unwrap_or_else(|| self.local(cond, 0));
        self.mask = Some(mask);
        if !empty {
            self.any(mask);
            self.code.sink().if_(BlockType::Empty);
        }
        self.frames.push(Frame::LaneBranch { outer, own, guarded: !empty });
    }

    /// Ends the side for true and opens the other.
    pub fn otherwise(&mut self, position: usize, cond: NodeId, end: NodeId, empty: bool) {
        let joins = self.joins(end);
        let mut results = Vec::new();
        for join in &joins {
            if let Node::Join { then, .. } = self.graph[*join]
                && !self.graph.is_late(end, then)
            {
                (0..self.width(*join)).for_each(|vector| self.push(then, vector));
                results.push(*join);
            }
        }
        self.free(position);
        for join in &joins {
            self.allot(*join);
        }
        for join in results.iter().rev() {
            self.set(*join);
        }
        match self.frames.pop() {
            Some(Frame::LaneBranch { outer, own, guarded }) => {
                if guarded {
                    self.code.sink().else_();
                    for join in &results {
                        (0..self.vectors).for_each(|_| _ = self.code.sink().v128_const(0));
                        self.set(*join);
                    }
                    self.code.sink().end();
                }
                let mask = own.unwrap_or_else(|| self.locals.take(true));
                if !empty {
                    for vector in 0..self.vectors {
                        if let Some(outer) = outer {
                            self.code.get(outer + vector);
                            self.push(cond, vector);
                            self.code.sink().v128_andnot();
                        } else {
                            self.push(cond, vector);
                            self.code.sink().v128_not();
                        }
                        self.code.set(mask + vector);
                    }
                    self.any(mask);
                    self.code.sink().if_(BlockType::Empty);
                }
                self.mask = Some(mask);
                self.frames.push(Frame::LaneBranch { outer, own: Some(mask), guarded: !empty });
            }
            _ => {
                self.code.sink().else_();
                self.frames.push(Frame::Branch);
            }
        }
    }

    /// Pops the vectors of a value into its locals.
    fn set(&mut self, id: NodeId) {
        for vector in (0..self.width(id)).rev() {
            let local = self.local(id, vector);
            self.code.set(local);
        }
    }

    /// Ends a branch.
    pub fn end_gamma(&mut self, end: NodeId, cond: NodeId) {
        let frame = self.frames.pop();
        let in_lanes = matches!(frame, Some(Frame::LaneBranch { .. }));
        for join in self.joins(end) {
            let Node::Join { then, otherwise, .. } = self.graph[join] else { continue };
            if self.graph.is_late(end, otherwise) {
                continue;
            }
            for vector in 0..self.width(join) {
                let local = self.local(join, vector);
                if in_lanes && !self.graph.is_late(end, then) {
                    self.code.get(local);
                    self.push(otherwise, vector);
                    self.push(cond, vector);
                    self.narrow(self.graph.scalar(join));
                    self.code.sink().v128_bitselect();
                } else {
                    self.push(otherwise, vector);
                }
                self.code.set(local);
            }
        }
        match frame {
            Some(Frame::LaneBranch { outer, own, guarded }) => {
                if guarded {
                    self.code.sink().end();
                }
                if let Some(mask) = own {
                    self.locals.give(mask, true);
                }
                self.mask = outer;
            }
            _ => _ = self.code.sink().end(),
        }
    }

    /// Opens a loop.
    pub fn theta(&mut self, position: usize, theta: NodeId, lo: NodeId, hi: NodeId) {
        let frame = if self.rates.uniform[lo] && self.rates.uniform[hi] {
            self.scalar_loop(lo, hi)
        } else {
            self.lane_loop(lo, hi)
        };
        let carried = self.carried(theta);
        for variable in &carried {
            if let Node::Carried { init, .. } = self.graph[*variable] {
                (0..self.width(*variable)).for_each(|vector| self.push(init, vector));
            }
        }
        self.free(position);
        for variable in &carried {
            self.allot(*variable);
        }
        for variable in carried.iter().rev() {
            self.set(*variable);
        }
        match frame {
            Frame::Loop { counter, hi, guarded } => {
                if guarded {
                    self.below(counter, hi);
                    self.code.sink().if_(BlockType::Empty);
                }
            }
            Frame::LaneLoop { running, .. } => {
                self.any(running);
                self.code.sink().if_(BlockType::Empty);
                self.mask = Some(running);
            }
            Frame::Branch | Frame::LaneBranch { .. } => {}
        }
        self.code.sink().loop_(BlockType::Empty);
        self.frames.push(frame);
    }

    fn scalar_loop(&mut self, lo: NodeId, hi: NodeId) -> Frame {
        let counter = self.locals.take_scalar();
        self.push_scalar(lo);
        self.code.set(counter);
        let bound = if let Node::Int(x) = self.graph[hi] {
            Bound::Constant(x)
        } else {
            let local = self.locals.take_scalar();
            self.push_scalar(hi);
            self.code.set(local);
            Bound::Local(local)
        };
        let runs = matches!((self.graph[lo], self.graph[hi]), (Node::Int(lo), Node::Int(hi)) if lo < hi);
        Frame::Loop { counter, hi: bound, guarded: !runs }
    }

    fn lane_loop(&mut self, lo: NodeId, hi: NodeId) -> Frame {
        let running = self.locals.take(true);
        for vector in 0..self.vectors {
            self.push(lo, vector);
            self.push(hi, vector);
            self.lanes_below();
            if let Some(outer) = self.mask {
                self.code.get(outer + vector);
                self.code.sink().v128_and();
            }
            self.code.set(running + vector);
        }
        let counter = if self.rates.uniform[lo] {
            let local = self.locals.take_scalar();
            self.push_scalar(lo);
            self.code.set(local);
            LaneCounter::Scalar(local)
        } else {
            let group = self.locals.take(true);
            for vector in 0..self.vectors {
                self.push(lo, vector);
                self.code.set(group + vector);
            }
            LaneCounter::Lanes(group)
        };
        Frame::LaneLoop { outer: self.mask, running, counter }
    }

    fn below(&mut self, counter: u32, hi: Bound) {
        self.code.get(counter);
        match hi {
            Bound::Constant(x) => _ = self.code.sink().i32_const(x),
            Bound::Local(local) => self.code.get(local),
        }
        self.code.sink().i32_lt_s();
    }

    /// Compares the two ints on the stack into a mask.
    fn lanes_below(&mut self) {
        self.code.sink().i32x4_lt_s();
        if self.layout.precision == Precision::F64 {
            self.code.sink().i64x2_extend_low_i32x4_s();
        }
    }

    /// The counter of the innermost open loop, as a value.
    pub fn counter(&mut self, id: NodeId) {
        let counter = self.frames.iter().rev().find_map(|frame| match frame {
            Frame::Loop { counter, .. } => Some(LaneCounter::Scalar(*counter)),
            Frame::LaneLoop { counter, .. } => Some(*counter),
            Frame::Branch | Frame::LaneBranch { .. } => None,
        });
        let local = self.allot(id);
        match counter {
            Some(LaneCounter::Scalar(counter)) => {
                self.code.get(counter);
                self.code.sink().i32x4_splat();
                self.code.set(local);
            }
            Some(LaneCounter::Lanes(group)) => {
                for vector in 0..self.width(id) {
                    self.code.get(group + vector);
                    self.code.set(local + vector);
                }
            }
            None => {}
        }
    }

    /// Ends an iteration: gives the carried variables what it computed, all at once, and goes on if it must.
    pub fn end_theta(&mut self, theta: NodeId, hi: NodeId) {
        let Some(frame) = self.frames.pop() else { return };
        let mut carried = self.carried(theta);
        if let (Frame::Loop { counter, .. }, Node::Theta { lo, .. }) = (&frame, self.graph[theta]) {
            self.record(theta, lo, *counter);
        }
        carried.retain(|variable| self.rates.next[*variable] != *variable);
        for variable in &carried {
            let next = self.rates.next[*variable];
            for vector in 0..self.width(*variable) {
                self.push(next, vector);
                if let Frame::LaneLoop { running, .. } = frame {
                    self.push(*variable, vector);
                    self.code.get(running + vector);
                    self.narrow(self.graph.scalar(*variable));
                    self.code.sink().v128_bitselect();
                }
            }
        }
        for variable in carried.iter().rev() {
            self.set(*variable);
        }
        match frame {
            Frame::Loop { counter, hi, guarded } => {
                self.code.sink().local_get(counter).i32_const(1).i32_add();
                self.code.set(counter);
                self.below(counter, hi);
                self.code.sink().br_if(0).end();
                if guarded {
                    self.code.sink().end();
                }
                if let Bound::Local(local) = hi {
                    self.locals.give_scalar(local);
                }
                self.locals.give_scalar(counter);
            }
            Frame::LaneLoop { outer, running, counter } => {
                self.advance_lanes(running, counter, hi);
                self.any(running);
                self.code.sink().br_if(0).end().end();
                self.locals.give(running, true);
                match counter {
                    LaneCounter::Scalar(local) => self.locals.give_scalar(local),
                    LaneCounter::Lanes(group) => self.locals.give(group, true),
                }
                self.mask = outer;
            }
            Frame::Branch | Frame::LaneBranch { .. } => {}
        }
    }

    /// Counts, and turns off the lanes that are done. A lane that is off stays off, wherever its counter gets to.
    fn advance_lanes(&mut self, running: u32, counter: LaneCounter, hi: NodeId) {
        if let LaneCounter::Scalar(local) = counter {
            self.code.sink().local_get(local).i32_const(1).i32_add();
            self.code.set(local);
        }
        for vector in 0..self.vectors {
            match counter {
                LaneCounter::Scalar(local) => {
                    self.code.get(local);
                    self.code.sink().i32x4_splat();
                }
                LaneCounter::Lanes(group) => {
                    self.code.get(group + vector);
                    self.push_one();
                    self.code.sink().i32x4_add();
                    self.code.set(group + vector);
                    self.code.get(group + vector);
                }
            }
            self.push(hi, vector);
            self.lanes_below();
            self.code.get(running + vector);
            self.code.sink().v128_and();
            self.code.set(running + vector);
        }
    }

    fn push_one(&mut self) {
        self.code.write(|bytes| crate::lanes::splat32(1, bytes));
    }
}
