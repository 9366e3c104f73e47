//! Runs emitted modules directly in wasmtime, a block of points at a time, so that the laws may choose batch sizes,
//! positions and vectors per iteration. Knows a module's layout and nothing of how the runtime spreads points.

use std::sync::OnceLock;

use isograd_graph::{Scalar, Value, Verified};
use isograd_wasm::{Layout, Options, Slot, Split, Vectors, emit};
use wasmtime::{Config, Engine, Instance, Memory, Module, OptLevel, Store, TypedFunc};

/// Cuts everything into functions of a few operations, which a call runs over chunks of 16 points.
pub const TINY: Split = Split { above: 0, most: 8, points: 16 };

/// A module that runs.
pub struct Machine {
    layout: Layout,
    store: Store<()>,
    memory: Memory,
    eval: TypedFunc<i32, ()>,
}

/// Why a module does not run: each a mistake of the compiler.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Broken(pub String);

impl Machine {
    /// Emits, compiles and instantiates a graph.
    ///
    /// # Errors
    /// If one of these fails, or the module imports something.
    pub fn new(graph: &Verified, varying: &[bool], vectors: Option<Vectors>, split: Split) -> Result<Self, Broken> {
        let precision = graph.precision.ok_or_else(|| Broken("the graph has no precision".into()))?;
        let broken = |e: &dyn std::fmt::Display| Broken(e.to_string());
        let module = emit(graph, &Options { precision, varying, vectors, split }, b"").map_err(|e| broken(&e))?;
        let compiled = Module::new(engine(), &module.bytes).map_err(|e| broken(&format!("{e:#}")))?;
        if compiled.imports().count() > 0 {
            return Err(Broken("the module imports something".into()));
        }
        let mut store = Store::new(engine(), ());
        let instance = Instance::new(&mut store, &compiled, &[]).map_err(|e| broken(&e))?;
        let memory = instance.get_memory(&mut store, "memory").ok_or_else(|| Broken("no memory".into()))?;
        let eval = instance.get_typed_func(&mut store, "eval").map_err(|e| broken(&e))?;
        Ok(Self { layout: module.layout, store, memory, eval })
    }

    /// The most points of one call.
    #[must_use]
    pub const fn block(&self) -> usize {
        self.layout.block as usize
    }

    /// The outputs at up to a block of points, each the values of all inputs; uniform inputs are those of the first.
    ///
    /// # Errors
    /// If the module traps or stores what is no value.
    pub fn run(&mut self, points: &[Vec<Value>]) -> Result<Vec<Vec<Value>>, Broken> {
        let Some(last) = points.last() else { return Ok(Vec::new()) };
        let padded = points.len().next_multiple_of(self.layout.pad as usize);
        let size = |slot: &Slot| slot.element(self.layout.precision) as usize;
        let memory = self.memory.data_mut(&mut self.store);
        for (k, slot) in self.layout.inputs.iter().enumerate() {
            for i in 0..if slot.varying { padded } else { 1 } {
                let at = slot.offset as usize + i * size(slot);
                write(&mut memory[at..at + size(slot)], points.get(i).unwrap_or(last)[k]);
            }
        }
        let count = i32::try_from(points.len()).map_err(|e| Broken(e.to_string()))?;
        self.eval.call(&mut self.store, count).map_err(|e| Broken(format!("{e:#}")))?;
        let memory = self.memory.data(&self.store);
        let row = |i: usize| {
            self.layout.outputs.iter().map(move |slot| {
                let at = slot.offset as usize + i * size(slot);
                read(slot.scalar, &memory[at..at + size(slot)])
            })
        };
        (0..points.len()).map(|i| row(i).collect()).collect()
    }
}

fn engine() -> &'static Engine {
    static ENGINE: OnceLock<Engine> = OnceLock::new();
    ENGINE.get_or_init(|| Engine::new(Config::new().cranelift_opt_level(OptLevel::None)).expect("an engine"))
}

fn write(place: &mut [u8], value: Value) {
    match value {
        #[expect(clippy::cast_possible_truncation, reason = "f32 values are held in f64")]
        Value::Real(x) if place.len() == 4 => place.copy_from_slice(&(x as f32).to_le_bytes()),
        Value::Real(x) => place.copy_from_slice(&x.to_le_bytes()),
        Value::Int(x) => place.copy_from_slice(&x.to_le_bytes()),
        Value::Bool(x) => place.copy_from_slice(&i32::from(x).to_le_bytes()),
    }
}

fn read(scalar: Scalar, bytes: &[u8]) -> Result<Value, Broken> {
    let canonical = bytes.iter().all(|b| *b == 0xff);
    let real = |x: f64| match (x.is_nan(), canonical) {
        (true, false) => Err(Broken("a NaN is stored that is not the canonical one".into())),
        _ => Ok(Value::Real(x)),
    };
    let int = |b: [u8; 4]| i32::from_le_bytes(b);
    match (scalar, bytes) {
        (Scalar::Real, &[a, b, c, d]) => real(f64::from(f32::from_le_bytes([a, b, c, d]))),
        (Scalar::Real, &[a, b, c, d, e, f, g, h]) => real(f64::from_le_bytes([a, b, c, d, e, f, g, h])),
        (Scalar::Int, &[a, b, c, d]) => Ok(Value::Int(int([a, b, c, d]))),
        (Scalar::Bool, &[a, b, c, d]) => match int([a, b, c, d]) {
            0 => Ok(Value::Bool(false)),
            1 => Ok(Value::Bool(true)),
            other => Err(Broken(format!("a bool is stored as {other}"))),
        },
        _ => Err(Broken("an element of an unexpected size".into())),
    }
}
