//! How many vectors of points an iteration should compute. Knows the measurements of
//! `NOTES-speed`; knows nothing of how code is written.

use isograd_graph::{Graph, Node, NodeId, Precision, Unready};
use rustc_hash::FxHashMap;

use crate::lives::{Item, Lives, Order};
use crate::rates::Rates;
use crate::{EmitError, Vectors, lanes};

/// Bytes of machine code that the loop over the points may have if it computes several vectors.
const CODE: u64 = 80 << 10;
/// Bytes of machine code of an instruction, about.
const BYTES: u64 = 7;
/// Values alive of which four vectors fit the registers.
const FEW: usize = 16;
/// Values alive of which two vectors fit the registers, spilling some.
const SOME: usize = 30;
/// Instructions of a body that the processor does not overlap with the next iteration's.
const LONG_BODY: u64 = 200;
/// A processor works on about so many instructions at once: if a chain has more than this share of them, it waits.
const WAITING: u64 = 4;

/// How many vectors an iteration should compute. Several hide latencies, as long as their values fit the registers
/// and their code the cache. A short body needs fewer, because the processor overlaps its iterations by itself; each
/// vector more costs time to compile. The numbers are those of `cargo run -p isograd-benches` on the thesis's scenes:
/// the values of 68 blended spheres (1,072 operations, 15 alive) take 212, 117, 71 ns with 1, 2, 4 vectors, their
/// gradients (4,697 operations, 36 alive) 297, 405, 587 ns; small shapes take the same with 2 as with 4.
///
/// A part of a large graph computes one vector, unless most of its operations wait for each other: the values of 8,000
/// operations in parts take 273, 289, 409 ns with 1, 2, 4 vectors, and 16, 61, 109 ms to compile.
pub fn vectors(
    graph: &Graph,
    rates: &Rates,
    order: &Order,
    lives: &Lives,
    precision: Precision,
    is_part: bool,
) -> Result<Vectors, EmitError> {
    let mut instructions = 0_u64;
    // The instructions of the longest chain of which each waits for the one before, by the value at its end.
    let mut chains: FxHashMap<NodeId, u64> = FxHashMap::default();
    let mut longest = 0;
    for item in order.items.get(order.start..).unwrap_or(&[]) {
        if let Item::Node(id) = item
            && let Node::Apply(op, args) = graph[*id]
            && !rates.uniform[*id]
        {
            let program = lanes::program(op, precision).ok_or(EmitError::from(Unready::NoInstructions(op)))?;
            let own = u64::from(program.instructions);
            instructions += own;
            if is_part {
                let before = args.as_slice().iter().filter_map(|x| chains.get(x)).max().copied().unwrap_or(0);
                chains.insert(*id, before + own);
                longest = longest.max(before + own);
            }
        }
    }
    let fits = |n: u64| instructions * n * BYTES <= CODE;
    let waits = longest * WAITING > instructions;
    Ok(match lives.pressure(rates) {
        0..=FEW if instructions > LONG_BODY && fits(4) && (!is_part || waits) => Vectors::Four,
        0..=SOME if fits(2) && !is_part => Vectors::Two,
        _ => Vectors::One,
    })
}
