//! One instance of a module: a store, its memory, and its columns in place.

use std::time::Instant;

use isograd_compiler::{Manifest, Memory as Abi};
use wasmtime::{Memory, Module, Store, StoreLimits, StoreLimitsBuilder, Trap, TypedFunc};

use crate::engine::TICK;
use crate::kernel::EvalError;
use crate::upper_halves;

/// An instance of a module, for one thread at a time. Fill columns, [`run`](Self::run), read columns: nothing is
/// copied. Columns are those of the manifest, numbered over all ports in order.
pub struct Instance {
    store: Store<StoreLimits>,
    memory: Memory,
    eval: TypedFunc<i32, ()>,
    interruptible: bool,
    block: usize,
    pad: usize,
    /// Addresses and lengths in bytes.
    inputs: Vec<(usize, usize)>,
    outputs: Vec<(usize, usize)>,
}

impl Instance {
    pub(crate) fn new(module: &Module, manifest: &Manifest, abi: &Abi) -> Result<Self, EvalError> {
        let failed = |e: wasmtime::Error| EvalError::Instance(format!("{e:#}"));
        let limits = StoreLimitsBuilder::new().memory_size(abi.memory as usize).memories(1).instances(1).build();
        let mut store = Store::new(module.engine(), limits);
        store.limiter(|limits| limits);
        let interruptible = manifest.unbounded;
        if interruptible {
            store.set_epoch_deadline(u64::MAX / 2);
        }
        let instance = wasmtime::Instance::new(&mut store, module, &[]).map_err(failed)?;
        let eval = instance.get_typed_func(&mut store, "eval").map_err(failed)?;
        let memory = instance
            .get_memory(&mut store, "memory")
            .ok_or_else(|| EvalError::Instance("the module has no memory".to_owned()))?;
        if memory.data_size(&store) != abi.memory as usize {
            return Err(EvalError::Instance("the memory is not as large as the manifest says".to_owned()));
        }
        let block = abi.block as usize;
        let place = |ports: &[isograd_compiler::Port]| {
            let columns = ports.iter().flat_map(|port| port.columns.iter().map(move |column| (port, column)));
            columns
                .map(|(port, column)| {
                    let elements = if port.rate == isograd_compiler::Rate::Varying { block } else { 1 };
                    (column.offset as usize, elements * manifest.element(column.scalar))
                })
                .collect()
        };
        let (inputs, outputs) = (place(&manifest.inputs), place(&manifest.outputs));
        Ok(Self { store, memory, eval, interruptible, block, pad: abi.pad as usize, inputs, outputs })
    }

    /// Most points per run.
    #[must_use]
    pub const fn block(&self) -> usize {
        self.block
    }

    /// `count` rounded up to whole iterations: so many elements of a varying column must be filled, best with copies
    /// of the last point.
    #[must_use]
    pub const fn padded(&self, count: usize) -> usize {
        count.next_multiple_of(self.pad)
    }

    /// The bytes of an input column.
    pub fn input_bytes(&mut self, column: usize) -> &mut [u8] {
        let Some((at, length)) = self.inputs.get(column).copied() else { return &mut [] };
        self.memory.data_mut(&mut self.store).get_mut(at..at + length).unwrap_or(&mut [])
    }

    /// The bytes of an output column.
    #[must_use]
    pub fn output_bytes(&self, column: usize) -> &[u8] {
        let Some((at, length)) = self.outputs.get(column).copied() else { return &[] };
        self.memory.data(&self.store).get(at..at + length).unwrap_or(&[])
    }

    /// An input column of `f32`, `f64` or `i32`; empty if there is none.
    pub fn input<T: bytemuck::Pod>(&mut self, column: usize) -> &mut [T] {
        bytemuck::try_cast_slice_mut(self.input_bytes(column)).unwrap_or(&mut [])
    }

    /// An output column of `f32`, `f64` or `i32`; empty if there is none.
    #[must_use]
    pub fn output<T: bytemuck::Pod>(&self, column: usize) -> &[T] {
        bytemuck::try_cast_slice(self.output_bytes(column)).unwrap_or(&[])
    }

    /// Computes the first `count` points of the block.
    ///
    /// # Errors
    /// If `count` is 0 or more than the block, the deadline passes, or the module traps.
    pub fn run(&mut self, count: usize, deadline: Option<Instant>) -> Result<(), EvalError> {
        if count == 0 || count > self.block {
            return Err(EvalError::Count { count, block: self.block });
        }
        if self.interruptible {
            let ticks = deadline.map_or(u64::MAX / 2, |at| {
                let left = at.saturating_duration_since(Instant::now());
                u64::try_from(left.as_millis() / TICK.as_millis()).unwrap_or(u64::MAX / 4) + 1
            });
            self.store.set_epoch_deadline(ticks);
        }
        let count = i32::try_from(count).unwrap_or(i32::MAX);
        upper_halves::clear();
        self.eval.call(&mut self.store, count).map_err(|e| match e.downcast_ref::<Trap>() {
            Some(Trap::Interrupt) => EvalError::Deadline,
            _ => EvalError::Instance(format!("{e:#}")),
        })
    }
}
