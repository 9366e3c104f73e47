//! A compiled artefact: evaluates columns in blocks over threads.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use isograd_compiler::{Column as Declared, ColumnType, Differentiability, Manifest, Memory, Precision, Rate};
use rayon::prelude::*;
use wasmtime::Module;

use crate::columns::{Piece, put};
use crate::{Column, Instance, LoadError, Values};

/// How to evaluate.
#[derive(Debug, Clone, Copy, Default)]
pub struct EvalOptions {
    /// When to give up.
    pub deadline: Option<Instant>,
    /// Threads to use: `None` for all cores, 1 for the calling thread alone.
    pub threads: Option<usize>,
}

/// Why an evaluation failed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EvalError {
    /// Not one column per input scalar.
    #[error("{given} input columns were given; the module has {wanted}")]
    Columns {
        /// How many were given.
        given: usize,
        /// How many there must be.
        wanted: usize,
    },
    /// A column of the wrong length.
    #[error("the input `{column}` has {given} numbers; it must have {wanted}")]
    Length {
        /// The column.
        column: String,
        /// How many were given.
        given: usize,
        /// How many there must be: one, or one per point.
        wanted: String,
    },
    /// Reals for ints or the other way round.
    #[error("the input `{column}` is given in the wrong kind of numbers: it holds {holds}")]
    Kind {
        /// The column.
        column: String,
        /// What it holds.
        holds: &'static str,
    },
    /// A number outside of what the module was compiled for.
    #[error("the input `{column}` is {value} at point {point}; this module is {why} between {lo} and {hi}")]
    Outside {
        /// The column.
        column: String,
        /// The first point with such a number, from 0.
        point: usize,
        /// The number.
        value: f64,
        /// The least it may be.
        lo: f64,
        /// The most.
        hi: f64,
        /// Whether the module is specialised to a box, or proved over a range.
        why: &'static str,
    },
    /// More points than a block holds, or none.
    #[error("{count} points do not fit a block of 1 to {block}")]
    Count {
        /// How many.
        count: usize,
        /// Most.
        block: usize,
    },
    /// The deadline passed.
    #[error("the evaluation took longer than its deadline")]
    Deadline,
    /// The results do not fit into memory.
    #[error("{points} points have results of {bytes} bytes, more than fit into memory")]
    Memory {
        /// How many points.
        points: usize,
        /// Bytes of the results.
        bytes: u128,
    },
    /// The module could not be run.
    #[error("the module failed: {0}")]
    Instance(String),
}

/// Bytes of results of one evaluation, at most.
const MAX_RESULTS: u128 = 8 << 30;

/// A compiled artefact.
pub struct Kernel {
    module: Module,
    manifest: Manifest,
    abi: Memory,
    precision: Precision,
    weight: u64,
    /// Instances that no thread uses now.
    idle: Mutex<Vec<Instance>>,
    /// Keeps the clock of deadlines running.
    _alive: Arc<()>,
}

impl Kernel {
    pub(crate) fn new(module: Module, manifest: Manifest, weight: u64, alive: Arc<()>) -> Result<Self, LoadError> {
        let Some(precision) = manifest.precision() else {
            return Err(LoadError::Module(format!("unknown precision `{}`", manifest.precision)));
        };
        let abi = *memory(&manifest)?;
        if abi.block == 0 || abi.pad == 0 || !abi.block.is_multiple_of(abi.pad) {
            return Err(LoadError::Module("the manifest's block is no multiple of its pad".to_owned()));
        }
        // Columns outside of the memory would be read as nothing, and written to no effect.
        for port in manifest.inputs.iter().chain(&manifest.outputs) {
            let elements = if port.rate == Rate::Varying { u64::from(abi.block) } else { 1 };
            for column in &port.columns {
                let end = u64::from(column.offset) + elements * manifest.element(column.scalar) as u64;
                if !column.offset.is_multiple_of(16) || end > u64::from(abi.memory) {
                    return Err(LoadError::Module(format!("the column `{}` does not lie in the memory", column.name)));
                }
            }
        }
        Ok(Self { module, manifest, abi, precision, weight, idle: Mutex::new(Vec::new()), _alive: alive })
    }

    /// How to call it.
    #[must_use]
    pub const fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Bytes it takes in the cache, about.
    pub(crate) const fn weight(&self) -> u64 {
        self.weight
    }

    /// A new instance, to be used without copies.
    ///
    /// # Errors
    /// If wasmtime cannot make one.
    pub fn instance(&self) -> Result<Instance, EvalError> {
        Instance::new(&self.module, &self.manifest, &self.abi)
    }

    /// Evaluates `points` points. `inputs` has one entry per input scalar of the manifest, all ports in order: one
    /// number per point if it varies, or a single one. Returns one column per output scalar, in order.
    ///
    /// # Errors
    /// If the inputs do not fit the manifest, the deadline passes, or the module fails.
    pub fn evaluate(
        &self,
        inputs: &[Values<'_>],
        points: usize,
        options: &EvalOptions,
    ) -> Result<Vec<Column>, EvalError> {
        fits(&self.manifest, inputs, points)?;
        let outputs = || self.manifest.outputs.iter().flat_map(|port| &port.columns);
        let bytes = outputs().map(|c| self.manifest.element(c.scalar) as u128).sum::<u128>() * points as u128;
        if bytes > MAX_RESULTS {
            return Err(EvalError::Memory { points, bytes });
        }
        let mut columns: Vec<Column> = outputs().map(|c| Column::zeros(c.scalar, self.precision, points)).collect();
        let block = self.abi.block as usize;
        let mut blocks: Vec<Vec<Piece<'_>>> = (0..points.div_ceil(block)).map(|_| Vec::new()).collect();
        for column in &mut columns {
            for (pieces, piece) in blocks.iter_mut().zip(column.pieces(block)) {
                pieces.push(piece);
            }
        }
        let work = |(index, mut pieces): (usize, Vec<Piece<'_>>)| {
            let from = index * block;
            self.block(inputs, from, block.min(points - from), &mut pieces, options)
        };
        let alone = options.threads == Some(1) || blocks.len() <= 1;
        if alone {
            blocks.into_iter().enumerate().try_for_each(work)?;
        } else if let Some(threads) = options.threads {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .map_err(|e| EvalError::Instance(e.to_string()))?;
            pool.install(|| blocks.into_par_iter().enumerate().try_for_each(work))?;
        } else {
            blocks.into_par_iter().enumerate().try_for_each(work)?;
        }
        Ok(columns)
    }

    /// Evaluates one block with an idle instance.
    fn block(
        &self,
        inputs: &[Values<'_>],
        from: usize,
        count: usize,
        pieces: &mut [Piece<'_>],
        options: &EvalOptions,
    ) -> Result<(), EvalError> {
        if options.deadline.is_some_and(|at| Instant::now() >= at) {
            return Err(EvalError::Deadline);
        }
        let idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut instance = match idle {
            Some(instance) => instance,
            None => self.instance()?,
        };
        let padded = instance.padded(count);
        let rates = self.manifest.inputs.iter().flat_map(|port| port.columns.iter().map(|_| port.rate));
        for (index, (values, rate)) in inputs.iter().zip(rates).enumerate() {
            let (count, padded) = if rate == Rate::Varying { (count, padded) } else { (1, 1) };
            put(*values, self.precision, from, count, padded, instance.input_bytes(index));
        }
        // An instance that trapped is not used again.
        instance.run(count, options.deadline)?;
        for (index, piece) in pieces.iter_mut().enumerate() {
            piece.take(instance.output_bytes(index));
        }
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(instance);
        Ok(())
    }
}

/// How to call a WebAssembly module.
pub(crate) fn memory(manifest: &Manifest) -> Result<&Memory, LoadError> {
    manifest.memory().ok_or_else(|| {
        LoadError::Module(format!("it is compiled to `{}`; the runtime takes `wasm`", manifest.target.name()))
    })
}

/// Whether inputs can be given to a module: so many columns, so long, of the right kinds, inside of what it is compiled for.
///
/// # Errors
/// In what way not.
pub fn fits(manifest: &Manifest, inputs: &[Values<'_>], points: usize) -> Result<(), EvalError> {
    let declared: Vec<(&Declared, Rate)> =
        manifest.inputs.iter().flat_map(|port| port.columns.iter().map(|c| (c, port.rate))).collect();
    if declared.len() != inputs.len() {
        return Err(EvalError::Columns { given: inputs.len(), wanted: declared.len() });
    }
    for ((column, rate), values) in declared.iter().zip(inputs) {
        let (name, given) = (column.name.clone(), values.len());
        let fits = given == 1 || (*rate == Rate::Varying && given == points);
        if !fits {
            let wanted = if *rate == Rate::Varying { format!("1 or {points}") } else { "1".to_owned() };
            return Err(EvalError::Length { column: name, given, wanted });
        }
        if !values.fits(column.scalar) {
            return Err(EvalError::Kind { column: name, holds: column.scalar.describe() });
        }
        inside(manifest, column, *values)?;
    }
    Ok(())
}

/// Refuses numbers for which the module gives no meaningful results: outside of the box it is specialised to, or, in
/// `strict`, outside of the ranges that its proofs assume (LANGUAGE 9.3).
fn inside(manifest: &Manifest, column: &Declared, values: Values<'_>) -> Result<(), EvalError> {
    let proved = column.range.filter(|_| manifest.differentiability == Differentiability::Strict);
    for (ends, why) in [(column.within, "specialised to numbers"), (proved, "proved for numbers")] {
        let Some([lo, hi]) = ends else { continue };
        // Numbers are compared as the module reads them.
        let precision = manifest.precision().filter(|_| column.scalar == ColumnType::Real);
        let read = |x: f64| precision.map_or(x, |p| p.round(x));
        if let Some((point, value)) = values.first_outside(read(lo.0), read(hi.0), read) {
            return Err(EvalError::Outside { column: column.name.clone(), point, value, lo: lo.0, hi: hi.0, why });
        }
    }
    Ok(())
}
