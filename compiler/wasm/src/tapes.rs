//! Tapes: what loops leave of each iteration in memory, and how it is read back. Knows where they lie behind the columns
//! of the module; knows nothing of derivatives, which they are for.
//!
//! A tape is an array of vectors, one for each iteration that it holds and for each vector of points: in a module of one
//! function of the points of an iteration, in one of several of the points of a chunk, because the loop that reads it may
//! stand in a later function. One that is the same at every point has one vector for each iteration. The loop that writes
//! it and the one that reads it count alike in all lanes, so one address serves all; what lanes write that are off there
//! is never read, as the reader stands under the same mask.

use isograd_graph::{Graph, Node, NodeId};
use rustc_hash::FxHashMap;

use crate::EmitError;
use crate::code::at;
use crate::emit::{Emitter, VECTOR};
use crate::rates::Rates;
use crate::segments::Place;

/// Where the tapes of a graph lie: the first slot or column of each, after those that functions keep for each other.
#[derive(Debug, Clone, Default)]
pub struct Tapes {
    places: FxHashMap<NodeId, Place>,
    /// How many slots there are.
    pub slots: u32,
    /// How many columns there are.
    pub columns: u32,
}

impl Tapes {
    /// Gives each tape that is needed its place.
    pub fn new(graph: &Graph, rates: &Rates) -> Result<Self, EmitError> {
        let mut this = Self::default();
        for (id, node) in graph.iter().filter(|(id, _)| rates.needed[*id]) {
            match node {
                Node::Tape { end, every, .. } => {
                    let length = graph.tape_length(end, every).ok_or(EmitError::Tape(id))?;
                    let next = if rates.uniform[id] { &mut this.slots } else { &mut this.columns };
                    let first = *next;
                    *next = first.checked_add(length).ok_or(EmitError::Tape(id))?;
                    let place = if rates.uniform[id] { Place::Slot(first) } else { Place::Column(first) };
                    this.places.insert(id, place);
                }
                Node::Recall { at, .. } if !rates.uniform[at] => return Err(EmitError::Tape(id)),
                _ => {}
            }
        }
        Ok(this)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }
}

impl Emitter<'_> {
    /// Where a tape begins.
    fn origin(&self, tape: NodeId) -> u32 {
        let (Some(scratch), Some(place)) = (self.memory, self.tapes.places.get(&tape)) else { return 0 };
        let (slots, columns) = self.kept.map_or((0, 0), |segments| (segments.slots, segments.columns));
        match place {
            Place::Slot(slot) => scratch.slot(slots + slot),
            Place::Column(column) => scratch.column(columns + column),
        }
    }

    /// Pops the number of an entry into a local, as how far it is from the beginning of its tape, at the points of this
    /// iteration.
    fn set_distance(&mut self, tape: NodeId, address: u32) {
        let uniform = self.rates.uniform[tape];
        let size = if uniform { VECTOR } else { self.memory.map_or(0, |scratch| scratch.stride()) };
        self.code.sink().i32_const(size.cast_signed()).i32_mul();
        if self.kept.is_some() && !uniform {
            self.code.get(self.scratch);
            self.code.sink().i32_add();
        }
        self.code.set(address);
    }

    /// At the end of an iteration, writes the tapes of a loop that counts in a local. One that holds every n-th iteration
    /// is written in each: entry ⌈k/n⌉ in iteration k, so that iteration j·n is the last to write entry j.
    pub fn record(&mut self, theta: NodeId, lo: NodeId, counter: u32) {
        let rates = self.rates;
        let address = self.locals.take_scalar();
        // What the address is good for.
        let mut holds = None;
        for tape in rates.tapes.get(&theta).into_iter().flatten() {
            let Node::Tape { value, every, .. } = self.graph[*tape] else { continue };
            let kind = (every, rates.uniform[*tape]);
            if holds.replace(kind) != Some(kind) {
                self.code.get(counter);
                if let Node::Int(lo) = self.graph[lo]
                    && lo != 0
                {
                    self.code.sink().i32_const(lo).i32_sub();
                }
                if every > 1 {
                    let every = every.cast_signed();
                    self.code.sink().i32_const(every - 1).i32_add().i32_const(every).i32_div_u();
                }
                self.set_distance(*tape, address);
            }
            let origin = self.origin(*tape);
            for vector in 0..self.width(*tape) {
                self.code.get(address);
                self.push(value, vector);
                self.code.sink().v128_store(at(origin + vector * VECTOR, 4));
            }
        }
        self.locals.give_scalar(address);
    }

    /// Reads an entry of a tape.
    pub fn recall(&mut self, position: usize, id: NodeId, tape: NodeId, number: NodeId) {
        let address = self.locals.take_scalar();
        self.push_scalar(number);
        self.set_distance(tape, address);
        let origin = self.origin(tape);
        self.free(position);
        let local = self.allot(id);
        for vector in 0..self.width(id) {
            self.code.get(address);
            self.code.sink().v128_load(at(origin + vector * VECTOR, 4));
            self.code.set(local + vector);
        }
        self.locals.give_scalar(address);
    }
}
