//! Where the columns of a module lie in its memory. Knows sizes and offsets; knows nothing of instructions.
//!
//! The contract of a module: it imports nothing and exports
//!
//! * `memory`, of fixed size [`Layout::memory`];
//! * `eval(count: i32)`, which computes the outputs of the points `0..count`, `1 ≤ count ≤ block`, and does nothing
//!   for any other count. It works on whole groups of [`Layout::pad`] points, so it reads the inputs and overwrites
//!   the outputs up to the next multiple of `pad`: the caller fills those inputs, best with copies of the last point;
//! * `point()`, which is `eval(1)`.
//!
//! A varying input and every output is a column of `block` elements; a uniform input is one element in a slot of 16
//! bytes. Reals are binary32 or binary64 by the precision; ints and bools are 32-bit ints in both, bools 0 or 1 (read:
//! any other number is true). All is little-endian. Every NaN is stored with all bits set.
//! What lies behind the columns is the module's own: there it keeps values during a call, of several functions for each
//! other and of the iterations of loops.

use isograd_graph::{Graph, Precision, Scalar};

use crate::EmitError;

/// Points per block at most.
const MOST: u32 = 4096;
/// Points per block at least.
const LEAST: u32 = 64;
/// Bytes of all columns together, if the limits on points allow.
const COLUMNS: u64 = 128 << 10;
/// Bytes of all columns that functions keep for each other, if they keep more than a vector: the second cache has room.
const SCRATCH: u64 = 512 << 10;
/// Columns start one cache line apart from a multiple of their length: with lengths of powers of two, all columns
/// would otherwise compete for the same lines of the cache.
const LINE: u64 = 64;
/// Bytes of a page of WebAssembly memory.
const PAGE: u64 = 64 << 10;
/// Bytes of memory at most.
const LIMIT: u64 = 1 << 30;

/// Where the columns of a module lie. See the module's documentation for the contract.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Layout {
    /// What reals are.
    pub precision: Precision,
    /// Points per column, a multiple of `pad`.
    pub block: u32,
    /// Points that the module computes together.
    pub pad: u32,
    /// One per input of the graph.
    pub inputs: Vec<Slot>,
    /// One per output of the graph; all varying.
    pub outputs: Vec<Slot>,
    /// Bytes of memory, whole pages.
    pub memory: u32,
    /// Bytes of it behind the columns, where the module keeps values during a call.
    pub scratch: u32,
}

/// The memory behind the columns where the functions of a module keep values for each other (see `segments`) and loops
/// keep tapes (see `tapes`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Scratch {
    /// Where it begins: the slots, of a vector each, then the columns.
    offset: u32,
    slots: u32,
    /// Points of a column, all of which one part computes before the next part begins.
    pub points: u32,
    /// Bytes of a column.
    column: u32,
}

impl Scratch {
    /// The address of a slot.
    pub const fn slot(&self, slot: u32) -> u32 {
        self.offset + slot * 16
    }

    /// Bytes from a column to the next.
    pub const fn stride(&self) -> u32 {
        self.column
    }

    /// The address of a column.
    pub const fn column(&self, column: u32) -> u32 {
        self.slot(self.slots) + column * self.column
    }
}

/// The place of one scalar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Slot {
    /// Its address, a multiple of 16.
    pub offset: u32,
    /// The kind of its elements.
    pub scalar: Scalar,
    /// Whether it is a column of `block` elements, or one element.
    pub varying: bool,
}

impl Slot {
    /// Bytes of an element.
    #[must_use]
    pub const fn element(&self, precision: Precision) -> u32 {
        element(self.scalar, precision)
    }
}

/// Bytes of an element of a column.
const fn element(scalar: Scalar, precision: Precision) -> u32 {
    match scalar {
        Scalar::Real => precision.bytes(),
        Scalar::Int | Scalar::Bool => 4,
    }
}

/// Slots and columns that parts and tapes need, and the points of a chunk.
#[derive(Debug, Clone, Copy)]
pub struct Kept {
    /// Vectors.
    pub slots: u32,
    /// Columns.
    pub columns: u32,
    /// Points of a column.
    pub points: u32,
}

/// Places the columns of a graph, and what its functions keep for each other.
pub fn place(
    graph: &Graph,
    varying: &[bool],
    precision: Precision,
    pad: u32,
    kept: Option<Kept>,
) -> Result<(Layout, Option<Scratch>), EmitError> {
    let inputs = || graph.inputs.iter().map(|input| input.scalar).zip(varying.iter().copied());
    let outputs = || graph.outputs.iter().map(|output| (graph.scalar(output.node), true));
    let size = |scalar| u64::from(element(scalar, precision));
    let per_point: u64 = inputs().chain(outputs()).filter(|(_, varying)| *varying).map(|(s, _)| size(s)).sum();
    let mut block = MOST;
    while block > LEAST && u64::from(block) * per_point > COLUMNS {
        block /= 2;
    }

    let mut end = 0_u64;
    let slots = |kinds: &mut dyn Iterator<Item = (Scalar, bool)>, end: &mut u64, columns: bool| -> Vec<(usize, Slot)> {
        let mut slots = Vec::new();
        for (index, (scalar, varying)) in kinds.enumerate().filter(|(_, (_, varying))| *varying == columns) {
            let length = if varying { (u64::from(block) * size(scalar)).next_multiple_of(LINE) + LINE } else { 16 };
            slots.push((index, Slot { offset: u32::try_from(*end).unwrap_or(u32::MAX), scalar, varying }));
            *end += length;
        }
        slots
    };
    let mut places = slots(&mut inputs(), &mut end, false);
    end = end.next_multiple_of(LINE);
    places.extend(slots(&mut inputs(), &mut end, true));
    places.sort_unstable_by_key(|(index, _)| *index);
    let results = slots(&mut outputs(), &mut end, true);
    let scratch = kept.map(|kept| {
        let Kept { slots, columns, points } = kept;
        let mut points = if columns == 0 { block } else { points.min(block) };
        while points > pad && u64::from(points * precision.bytes()) * u64::from(columns) > SCRATCH {
            points /= 2;
        }
        let points = points.max(pad);
        let column = points * precision.bytes();
        let offset = u32::try_from(end.next_multiple_of(LINE)).unwrap_or(u32::MAX);
        end = u64::from(offset) + u64::from(slots) * 16 + u64::from(columns) * u64::from(column);
        Scratch { offset, slots, points, column }
    });
    let kept = scratch.map_or(0, |scratch| end - u64::from(scratch.offset));
    let memory = end.next_multiple_of(PAGE).max(PAGE);
    if memory > LIMIT {
        return Err(EmitError::Memory { bytes: memory });
    }
    let only_slots = |places: Vec<(usize, Slot)>| places.into_iter().map(|(_, slot)| slot).collect();
    let layout = Layout {
        precision,
        block,
        pad,
        inputs: only_slots(places),
        outputs: only_slots(results),
        memory: u32::try_from(memory).unwrap_or(u32::MAX),
        scratch: u32::try_from(kept).unwrap_or(u32::MAX),
    };
    Ok((layout, scratch))
}
