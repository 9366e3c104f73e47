//! Graphs to WebAssembly: one module with a loop over points in lanes (DESIGN 7). Takes a graph after `kernels`, as it
//! stands: it reorders nothing and knows nothing of source text, differentiation and hosts.
//!
//! `lanes` holds the instruction texts of the op table as bytes; `rates` says what is computed once and what in every
//! lane; `lives`, in which order and for how long; `segments`, where a large graph is cut into functions; `pressure`,
//! how many vectors at a time; `layout`, where columns lie; `emit`, `regions` and `tapes` write the code. No relaxed SIMD, no
//! fused operations, constants at each use.

#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing, clippy::panic, clippy::print_stdout)
)]

mod code;
mod emit;
mod lanes;
mod layout;
mod lives;
mod pressure;
mod rates;
mod regions;
mod segments;
mod tapes;

use std::borrow::Cow;

use isograd_graph::{NodeId, Precision, Unready, Verified, Work};
use wasm_encoder::{
    CodeSection, CustomSection, ExportKind, ExportSection, FunctionSection, MemorySection, MemoryType, TypeSection,
    ValType,
};

pub use layout::{Layout, Slot};
pub use segments::Split;

/// The custom section that holds the manifest.
pub const MANIFEST: &str = "isograd.manifest";

/// WebAssembly implementations refuse functions of more bytes.
const FUNCTION_BYTES: usize = 7_654_321;

/// Vectors of points that an iteration computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Vectors {
    /// One: four points, in f64 two.
    One = 1,
    /// Two.
    Two = 2,
    /// Four.
    Four = 4,
}

/// How to emit.
#[derive(Debug, Clone, Copy)]
pub struct Options<'a> {
    /// What reals are; that of the graph.
    pub precision: Precision,
    /// For each input of the graph whether it has a value for each point.
    pub varying: &'a [bool],
    /// Vectors per iteration; `None` chooses by the number of values that live at once.
    pub vectors: Option<Vectors>,
    /// When and how to cut a large graph into several functions.
    pub split: Split,
}

/// An emitted module.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Module {
    /// The WebAssembly.
    pub bytes: Vec<u8>,
    /// Where its columns lie.
    pub layout: Layout,
    /// What its compilation and its calls may take.
    pub work: Work,
}

/// Why a graph was not emitted. All but the limits are mistakes of the compiler, not of its user.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EmitError {
    /// The graph is not ready for emission.
    #[error(transparent)]
    Unready(#[from] Unready),
    /// A tape of a loop whose trip count is not constant, or one that is read at another iteration in each lane.
    #[error("node %{} is a tape that has no fixed place, or reads one that is not the same for all lanes", .0.0)]
    Tape(NodeId),
    /// The options do not fit the graph.
    #[error("{what}")]
    Options {
        /// In what way.
        what: &'static str,
    },
    /// The columns take too much memory.
    #[error("the columns of a block take {bytes} bytes of memory; at most 1 GiB is possible")]
    Memory {
        /// What they take.
        bytes: u64,
    },
    /// More locals than WebAssembly allows.
    #[error("{count} values live at once; WebAssembly allows 50,000")]
    Locals {
        /// How many.
        count: u32,
    },
    /// More code than WebAssembly allows.
    #[error("the function has {bytes} bytes; WebAssembly allows 7,654,321")]
    Code {
        /// How many.
        bytes: usize,
    },
}

/// All decisions about a module, before its code is written: the layout is known here, so that a manifest can
/// describe it.
pub struct Plan<'g> {
    graph: &'g Verified,
    rates: rates::Rates,
    /// The functions: one, or the parts.
    functions: Vec<Planned>,
    segments: Option<segments::Segments>,
    tapes: tapes::Tapes,
    scratch: Option<layout::Scratch>,
    layout: Layout,
    work: Work,
}

/// All decisions about a function.
struct Planned {
    order: lives::Order,
    lives: lives::Lives,
    vectors: Vectors,
}

impl<'g> Plan<'g> {
    /// Plans a module.
    ///
    /// # Errors
    /// If the graph is not ready for emission, the options do not fit it, or it needs too much memory.
    pub fn new(graph: &'g Verified, options: &Options<'_>) -> Result<Self, EmitError> {
        if options.varying.len() != graph.inputs.len() {
            return Err(EmitError::Options { what: "a rate must be given for each input of the graph" });
        }
        if graph.precision != Some(options.precision) {
            return Err(EmitError::Options { what: "the graph has another precision" });
        }
        let rates = rates::Rates::new(graph, options.varying)?;
        let order = lives::order(graph, &rates);
        let work = rates.work;
        let (segments, orders) = match segments::cut(graph, &rates, &order, &options.split) {
            Some((segments, orders)) => (Some(segments), orders),
            None => (None, vec![order]),
        };
        let mut tables = lives::Tables::new(graph);
        let mut functions = Vec::with_capacity(orders.len());
        for order in orders {
            let lives = lives::Lives::new(graph, &rates, &order, &mut tables);
            let vectors = match options.vectors {
                Some(vectors) => vectors,
                None => pressure::vectors(graph, &rates, &order, &lives, options.precision, segments.is_some())?,
            };
            functions.push(Planned { order, lives, vectors });
        }
        let vectors = functions.iter().map(|function| function.vectors as u32).max().unwrap_or(1);
        let pad = vectors * 16 / options.precision.bytes();
        let tapes = tapes::Tapes::new(graph, &rates)?;
        // In a module of one function a column is for the points of an iteration.
        let alone = layout::Kept { slots: 0, columns: 0, points: pad };
        let kept = segments.as_ref().map(|segments| segments.kept(&options.split));
        let kept = kept.or_else(|| (!tapes.is_empty()).then_some(alone)).map(|kept| layout::Kept {
            slots: kept.slots.saturating_add(tapes.slots),
            columns: kept.columns.saturating_add(tapes.columns),
            ..kept
        });
        let (layout, scratch) = layout::place(graph, options.varying, options.precision, pad, kept)?;
        Ok(Self { graph, rates, functions, segments, tapes, scratch, layout, work })
    }

    /// Where the columns will lie.
    #[must_use]
    pub const fn layout(&self) -> &Layout {
        &self.layout
    }

    /// What compilation and calls may take.
    #[must_use]
    pub const fn work(&self) -> Work {
        self.work
    }

    /// Vectors per iteration; of several functions the most.
    #[must_use]
    pub fn vectors(&self) -> Vectors {
        let all = self.functions.iter().map(|function| function.vectors);
        all.max_by_key(|vectors| *vectors as u32).unwrap_or(Vectors::One)
    }

    /// Writes the code.
    ///
    /// # Errors
    /// If the code exceeds a limit of WebAssembly.
    pub fn write(self) -> Result<Written, EmitError> {
        let Self { graph, rates, tapes, layout, scratch, .. } = &self;
        let common = emit::Common { graph, rates, tapes, layout, scratch: *scratch };
        let (eval, parts) = match (self.segments.as_ref().zip(self.scratch), self.functions.as_slice()) {
            (Some((segments, scratch)), functions) => emit::split(&common, segments, scratch, functions)?,
            (None, [function]) => (emit::whole(&common, function)?, Vec::new()),
            (None, _) => (Vec::new(), Vec::new()),
        };
        if let Some(bytes) = parts.iter().chain([&eval]).map(Vec::len).find(|bytes| *bytes > FUNCTION_BYTES) {
            return Err(EmitError::Code { bytes });
        }
        let once = self.segments.as_ref().map_or(0, |segments| segments.once);
        Ok(Written { eval, parts, once, layout: self.layout, work: self.work })
    }

    /// Writes the code and the module around it.
    ///
    /// # Errors
    /// As [`Plan::write`].
    pub fn emit(self, manifest: &[u8]) -> Result<Module, EmitError> {
        Ok(self.write()?.seal(manifest))
    }
}

/// The code of a module that lacks its manifest.
#[derive(Debug, Clone)]
pub struct Written {
    eval: Vec<u8>,
    parts: Vec<Vec<u8>>,
    /// How many of the parts, the first ones, run once.
    once: usize,
    /// Where the columns lie.
    pub layout: Layout,
    /// What compilation and calls may take.
    pub work: Work,
}

impl Written {
    /// The module. The manifest goes into the custom section [`MANIFEST`]; an empty one is left out.
    #[must_use]
    pub fn seal(self, manifest: &[u8]) -> Module {
        let bytes = self.assemble(manifest);
        Module { bytes, layout: self.layout, work: self.work }
    }

    fn assemble(&self, manifest: &[u8]) -> Vec<u8> {
        let mut types = TypeSection::new();
        types.ty().function([ValType::I32], []);
        types.ty().function([], []);
        let mut functions = FunctionSection::new();
        functions.function(0).function(1);
        if !self.parts.is_empty() {
            types.ty().function([ValType::I32, ValType::I32], []);
            (0..self.parts.len()).for_each(|k| _ = functions.function(if k < self.once { 1 } else { 2 }));
        }
        let pages = u64::from(self.layout.memory >> 16);
        let mut memories = MemorySection::new();
        memories.memory(MemoryType {
            minimum: pages,
            maximum: Some(pages),
            memory64: false,
            shared: false,
            page_size_log2: None,
        });
        let mut exports = ExportSection::new();
        exports.export("memory", ExportKind::Memory, 0);
        exports.export("eval", ExportKind::Func, 0);
        exports.export("point", ExportKind::Func, 1);
        let mut point = wasm_encoder::Function::new([]);
        point.instructions().i32_const(1).call(0).end();
        let mut code = CodeSection::new();
        code.raw(&self.eval).function(&point);
        self.parts.iter().for_each(|part| _ = code.raw(part));

        let mut module = wasm_encoder::Module::new();
        module.section(&types).section(&functions).section(&memories).section(&exports).section(&code);
        if !manifest.is_empty() {
            module.section(&CustomSection { name: Cow::Borrowed(MANIFEST), data: Cow::Borrowed(manifest) });
        }
        module.finish()
    }
}

/// Plans and writes a module at once.
///
/// # Errors
/// As [`Plan::new`] and [`Plan::emit`].
pub fn emit(graph: &Verified, options: &Options<'_>, manifest: &[u8]) -> Result<Module, EmitError> {
    Plan::new(graph, options)?.emit(manifest)
}
