//! Branches, loops and tapes of the graph as blocks. Knows nothing of operations.
//!
//! A branch is a selection, its joins are phis of its merge block. A loop is
//!
//! ```text
//! header:    phis of the counter and the carried variables; to the body while counter < end, else to the merge block
//! body:      an iteration, then its stores to tapes
//! continue:  counter + 1; to the header
//! merge:     what follows: the finals are the phis of the header
//! ```

use isograd_graph::{Node, NodeId, Scalar};
use rspirv::dr::Operand;
use rspirv::spirv::{GlslStd450Op, LoopControl, Op, SelectionControl, StorageClass, Word};

use super::module::ids;
use super::values::Body;
use crate::program::Kind;

/// An open branch or loop.
pub enum Frame {
    /// A branch.
    Branch {
        /// The label of the side for false.
        otherwise: Word,
        /// The label of what follows.
        merge: Word,
        /// The block that the side for true ended in, once it has.
        exit: Word,
    },
    /// A loop.
    Loop {
        /// The number of the block that is its header, and its label.
        header: (usize, Word),
        /// The label of the block that counts.
        next: Word,
        /// The label of what follows.
        merge: Word,
    },
}

impl Body<'_, '_> {
    fn branch(&mut self, to: Word) {
        self.out.terminate(Op::Branch, ids(&[to]));
    }

    /// Opens a branch and its side for true.
    pub fn gamma(&mut self, cond: NodeId) {
        let cond = self.value(cond);
        let [then, otherwise, merge] = [(); 3].map(|()| self.out.id());
        self.out.effect(Op::SelectionMerge, vec![Operand::IdRef(merge), SelectionControl::NONE.into()]);
        self.out.terminate(Op::BranchConditional, ids(&[cond, then, otherwise]));
        self.out.begin_block(then);
        self.frames.push(Frame::Branch { otherwise, merge, exit: 0 });
    }

    /// Ends the side for true and opens the other.
    pub fn otherwise(&mut self) {
        let here = self.out.label();
        let Some(Frame::Branch { otherwise, merge, exit }) = self.frames.last_mut() else { return };
        *exit = here;
        let (otherwise, merge) = (*otherwise, *merge);
        self.branch(merge);
        self.out.begin_block(otherwise);
    }

    /// Ends a branch, with phis of its joins. What is computed only after it cannot be in a phi: the other side's value
    /// is kept, if the branch computes it.
    pub fn end_gamma(&mut self, gamma: NodeId, end: NodeId) {
        let Some(Frame::Branch { merge, exit, .. }) = self.frames.pop() else { return };
        let here = self.out.label();
        self.branch(merge);
        self.out.begin_block(merge);
        let plan = self.plan;
        for join in plan.structure.joins.get(&end).into_iter().flatten().copied() {
            let Node::Join { then, otherwise, .. } = plan.graph[join] else { continue };
            let late = [then, otherwise].map(|x| plan.graph.is_late(end, x));
            let sides = match late {
                [false, false] => [then, otherwise].map(|x| self.value(x)),
                [true, false] if otherwise > gamma => [self.any(plan.graph.scalar(join)), self.value(otherwise)],
                [false, true] if then > gamma => [self.value(then), self.any(plan.graph.scalar(join))],
                _ => continue,
            };
            let [then, otherwise] = sides;
            let kind = self.kind(join);
            self.values[join] = self.out.compute(Op::Phi, kind, &[then, exit, otherwise, here]);
        }
    }

    /// A join with operands that were computed after the branch: selects where it stands.
    pub fn late_join(&mut self, id: NodeId, end: NodeId, then: NodeId, otherwise: NodeId) {
        let graph = self.plan.graph;
        let late = [then, otherwise].map(|x| graph.is_late(end, x));
        let gamma = graph.owner(end);
        let Node::Gamma { cond, .. } = graph[gamma] else { return };
        if late == [false, false] {
            return;
        }
        let kept = self.values[id];
        let [then, otherwise] =
            [then, otherwise].map(|x| if x > gamma && !graph.is_late(end, x) { kept } else { self.value(x) });
        let (cond, kind) = (self.value(cond), self.kind(id));
        self.values[id] = self.select(kind, cond, then, otherwise);
    }

    /// Opens a loop.
    pub fn theta(&mut self, theta: NodeId, lo: NodeId, hi: NodeId) {
        let (lo, hi) = (self.value(lo), self.value(hi));
        let before = self.out.label();
        let [header, body, next, merge] = [(); 4].map(|()| self.out.id());
        self.branch(header);
        let block = self.out.blocks();
        self.out.begin_block(header);
        let counter = self.out.compute(Op::Phi, Kind::Int, &[lo, before]);
        self.values[theta] = counter;
        let plan = self.plan;
        for variable in plan.structure.carried.get(&theta).into_iter().flatten().copied() {
            let Node::Carried { init, .. } = plan.graph[variable] else { continue };
            let (init, kind) = (self.value(init), self.kind(variable));
            self.values[variable] = self.out.compute(Op::Phi, kind, &[init, before]);
        }
        let goes_on = self.out.compute(Op::SLessThan, Kind::Bool, &[counter, hi]);
        let mut operands = ids(&[merge, next]);
        operands.push(LoopControl::NONE.into());
        self.out.effect(Op::LoopMerge, operands);
        self.out.terminate(Op::BranchConditional, ids(&[goes_on, body, merge]));
        self.out.begin_block(body);
        self.frames.push(Frame::Loop { header: (block, header), next, merge });
    }

    /// Ends an iteration and its loop.
    pub fn end_theta(&mut self, theta: NodeId, lo: NodeId) {
        let Some(Frame::Loop { header: (block, header), next, merge }) = self.frames.pop() else { return };
        self.record(theta, lo);
        self.branch(next);
        self.out.begin_block(next);
        let one = self.out.int(1);
        let counter = self.values[theta];
        let counted = self.out.compute(Op::IAdd, Kind::Int, &[counter, one]);
        self.out.extend_phi(block, 0, counted, next);
        let plan = self.plan;
        for (place, variable) in (1..).zip(plan.structure.carried.get(&theta).into_iter().flatten()) {
            let given = self.value(plan.structure.next[*variable]);
            self.out.extend_phi(block, place, given, next);
        }
        self.branch(header);
        self.out.begin_block(merge);
    }

    /// What an entry of a tape is in memory: truth values have no form there.
    const fn stored(scalar: Scalar) -> Kind {
        match scalar {
            Scalar::Real => Kind::Real,
            Scalar::Int | Scalar::Bool => Kind::Int,
        }
    }

    /// Declares the variable of each tape that is needed.
    pub fn declare_tapes(&mut self) {
        let plan = self.plan;
        for (id, node) in plan.graph.iter().filter(|(id, _)| plan.structure.needed[*id]) {
            if matches!(node, Node::Tape { .. }) {
                let kind = self.out.kind(Self::stored(plan.graph.scalar(id)));
                let length = self.out.uint(plan.tapes[id]);
                let array = self.out.shared(Op::TypeArray, None, ids(&[kind, length]));
                self.tapes[id] = self.out.variable(array);
                self.out.name(self.tapes[id], "tape");
            }
        }
    }

    /// Where an entry of a tape is.
    fn entry(&mut self, tape: NodeId, index: Word) -> Word {
        let kind = self.out.kind(Self::stored(self.plan.graph.scalar(tape)));
        let pointer = self.out.pointer(StorageClass::Function, kind);
        self.out.push(Op::AccessChain, pointer, ids(&[self.tapes[tape], index]))
    }

    /// At the end of an iteration, writes the tapes of a loop. One that holds every n-th iteration is written in each:
    /// entry ⌈k/n⌉ in iteration k, so that iteration j·n is the last to write entry j.
    fn record(&mut self, theta: NodeId, lo: NodeId) {
        let plan = self.plan;
        let mut latest = None;
        for tape in plan.structure.tapes.get(&theta).into_iter().flatten().copied() {
            let Node::Tape { value, every, .. } = plan.graph[tape] else { continue };
            let index = match latest {
                Some((of, index)) if of == every => index,
                _ => self.entry_number(theta, lo, every),
            };
            latest = Some((every, index));
            let mut value = self.value(value);
            if plan.graph.scalar(tape) == Scalar::Bool {
                let (one, zero) = (self.out.int(1), self.out.int(0));
                value = self.select(Kind::Int, value, one, zero);
            }
            let pointer = self.entry(tape, index);
            self.out.effect(Op::Store, ids(&[pointer, value]));
        }
    }

    /// ⌈(counter − lo) / every⌉, without a sign: the difference need not fit an int.
    fn entry_number(&mut self, theta: NodeId, lo: NodeId, every: u32) -> Word {
        let unsigned = self.out.unsigned(32);
        let (counter, lo) = (self.values[theta], self.value(lo));
        let distance = self.out.push(Op::ISub, unsigned, ids(&[counter, lo]));
        if every <= 1 {
            return distance;
        }
        let (up, every) = (self.out.uint(every - 1), self.out.uint(every));
        let sum = self.out.push(Op::IAdd, unsigned, ids(&[distance, up]));
        self.out.push(Op::UDiv, unsigned, ids(&[sum, every]))
    }

    /// Reads an entry of a tape. What is not on the tape has no defined content, but a place there: devices may do
    /// anything on reading outside an array.
    pub fn recall(&mut self, id: NodeId, tape: NodeId, at: NodeId) {
        let unsigned = self.out.unsigned(32);
        let at = self.value(at);
        let number = self.out.push(Op::Bitcast, unsigned, ids(&[at]));
        let last = self.out.uint(self.plan.tapes[tape].saturating_sub(1));
        let index = self.out.extended(GlslStd450Op::UMin, unsigned, &[number, last]);
        let pointer = self.entry(tape, index);
        let scalar = self.plan.graph.scalar(id);
        let mut value = self.out.compute(Op::Load, Self::stored(scalar), &[pointer]);
        if scalar == Scalar::Bool {
            let zero = self.out.int(0);
            value = self.out.compute(Op::INotEqual, Kind::Bool, &[value, zero]);
        }
        self.values[id] = value;
    }
}
