//! Runs emitted modules in wasmtime and compares them bit for bit with the reference evaluator.

#![allow(dead_code, clippy::pedantic, reason = "shared by several test programs, of which each uses a part")]

#[path = "../../../graph/tests/garden/mod.rs"]
mod garden;

use std::sync::OnceLock;

use isograd_graph::{Evaluator, NodeId, Precision, Scalar, Value, Verified};
use isograd_wasm::{Layout, Module, Options, Slot, Split, Vectors, emit};
use wasmtime::{Config, Engine, Instance, Memory, OptLevel, Store, TypedFunc};

#[allow(unused_imports, reason = "each test program uses a part")]
pub use garden::{KINDS, PRECISIONS, Random, Soil, graph, random};

pub const VECTORS: [Option<Vectors>; 4] = [None, Some(Vectors::One), Some(Vectors::Two), Some(Vectors::Four)];

/// Computes so many values and then reads each once more, so that all of them are alive at a time.
pub fn wide(precision: Precision, values: u32) -> Verified {
    graph(precision, |b| {
        let x = b.input("x", Scalar::Real);
        let terms: Vec<NodeId> = (0..values)
            .map(|k| {
                let c = b.real(f64::from(k) + 0.5);
                b.div(x, c)
            })
            .collect();
        let sum = terms.into_iter().fold(x, |sum, term| b.sub(sum, term));
        b.output("y", sum);
    })
}

fn engine(level: OptLevel) -> &'static Engine {
    static NONE: OnceLock<Engine> = OnceLock::new();
    static SPEED: OnceLock<Engine> = OnceLock::new();
    let place = if matches!(level, OptLevel::None) { &NONE } else { &SPEED };
    place.get_or_init(|| Engine::new(Config::new().cranelift_opt_level(level)).expect("an engine"))
}

/// A module that runs.
pub struct Running {
    pub layout: Layout,
    store: Store<()>,
    memory: Memory,
    eval: TypedFunc<i32, ()>,
}

impl Running {
    pub fn new(module: &Module, level: OptLevel) -> Self {
        let engine = engine(level);
        let compiled = wasmtime::Module::new(engine, &module.bytes).expect("compiles");
        assert_eq!(compiled.imports().count(), 0);
        let mut store = Store::new(engine, ());
        let instance = Instance::new(&mut store, &compiled, &[]).expect("an instance");
        let memory = instance.get_memory(&mut store, "memory").expect("memory");
        let eval = instance.get_typed_func(&mut store, "eval").expect("eval");
        instance.get_typed_func::<(), ()>(&mut store, "point").expect("point");
        assert_eq!(memory.data_size(&store), module.layout.memory as usize);
        Self { layout: module.layout.clone(), store, memory, eval }
    }

    pub fn write(&mut self, slot: Slot, index: usize, value: Value) {
        let size = slot.element(self.layout.precision) as usize;
        let at = slot.offset as usize + if slot.varying { index * size } else { 0 };
        let place = &mut self.memory.data_mut(&mut self.store)[at..at + size];
        match value {
            Value::Real(x) if size == 4 => place.copy_from_slice(&(x as f32).to_le_bytes()),
            Value::Real(x) => place.copy_from_slice(&x.to_le_bytes()),
            Value::Int(x) => place.copy_from_slice(&x.to_le_bytes()),
            Value::Bool(x) => place.copy_from_slice(&i32::from(x).to_le_bytes()),
        }
    }

    pub fn read(&self, slot: Slot, index: usize) -> Value {
        let size = slot.element(self.layout.precision) as usize;
        let at = slot.offset as usize + index * size;
        let bytes = &self.memory.data(&self.store)[at..at + size];
        match (slot.scalar, size) {
            (Scalar::Real, 4) => {
                let x = f32::from_le_bytes(bytes.try_into().unwrap());
                assert!(!x.is_nan() || x.to_bits() == u32::MAX, "a NaN that is not canonical");
                Value::Real(f64::from(x))
            }
            (Scalar::Real, _) => {
                let x = f64::from_le_bytes(bytes.try_into().unwrap());
                assert!(!x.is_nan() || x.to_bits() == u64::MAX, "a NaN that is not canonical");
                Value::Real(x)
            }
            (Scalar::Int, _) => Value::Int(i32::from_le_bytes(bytes.try_into().unwrap())),
            (Scalar::Bool, _) => match i32::from_le_bytes(bytes.try_into().unwrap()) {
                0 => Value::Bool(false),
                1 => Value::Bool(true),
                other => panic!("a bool stored as {other}"),
            },
        }
    }

    /// Runs points (each the values of all inputs) and gives their outputs. Pads with the last.
    pub fn run(&mut self, points: &[Vec<Value>]) -> Vec<Vec<Value>> {
        let (block, pad) = (self.layout.block as usize, self.layout.pad as usize);
        assert!(points.len() <= block);
        for (k, slot) in self.layout.inputs.clone().into_iter().enumerate() {
            for i in 0..points.len().next_multiple_of(pad) {
                self.write(slot, i, points[i.min(points.len() - 1)][k]);
            }
        }
        self.eval.call(&mut self.store, points.len() as i32).expect("no trap");
        let outputs = self.layout.outputs.clone();
        (0..points.len()).map(|i| outputs.iter().map(|slot| self.read(*slot, i)).collect()).collect()
    }
}

/// Cuts everything into functions of a few operations, and calls into chunks of 16 points.
pub const TINY: Split = Split { above: 0, most: 4, points: 16 };

/// Compares module and evaluator on the points, with these inputs varying, for every number of vectors, in one function
/// and cut.
pub fn compare(graph: &Verified, varying: &[bool], points: &[Vec<Value>]) {
    let precision = graph.precision.expect("a precision");
    for vectors in VECTORS {
        for split in [Split::NEVER, TINY, Split { most: 12, ..TINY }] {
            let options = Options { precision, varying, vectors, split };
            let module = emit(graph, &options, b"{}").expect("emits");
            if let Err(error) = wasmparser::validate(&module.bytes) {
                panic!("{error} with {vectors:?}, {split:?}, varying {varying:?}\n{}", isograd_graph::print(graph));
            }
            let levels: &[OptLevel] =
                if split == Split::NEVER { &[OptLevel::None, OptLevel::Speed] } else { &[OptLevel::None] };
            for level in levels {
                compare_module(graph, &module, *level, points);
            }
        }
    }
}

fn compare_module(graph: &Verified, module: &Module, level: OptLevel, points: &[Vec<Value>]) {
    let mut running = Running::new(module, level);
    let mut evaluator = Evaluator::new(graph, module.layout.precision);
    // Uniform inputs keep the value of the first point of a call.
    for chunk in points.chunks(running.layout.block.min(37) as usize) {
        let chunk: Vec<Vec<Value>> = chunk
            .iter()
            .map(|point| {
                let slots = running.layout.inputs.iter().enumerate();
                slots.map(|(k, slot)| if slot.varying { point[k] } else { chunk[0][k] }).collect()
            })
            .collect();
        let got = running.run(&chunk);
        for (point, got) in chunk.iter().zip(got) {
            let want = evaluator.run(point).expect("ends");
            let same = want.iter().zip(&got).all(|(a, b)| a.same_bits(*b));
            assert!(
                same,
                "{level:?} {:?} at {point:?}: {want:?}, but the module computes {got:?}\n{}",
                module.layout.pad,
                isograd_graph::print(graph)
            );
        }
    }
}
