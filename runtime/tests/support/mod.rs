//! Artefacts of hand-built graphs, without the language.

#![allow(dead_code, clippy::pedantic, reason = "shared by programs of which each uses a part")]

use isograd_compiler::{
    Abi, Artefact, Column, ColumnType, DerivativeMode, Derivatives, Differentiability, Form, Manifest, Memory, Port,
    Rate, Role, Target,
};
use isograd_graph::{Builder, Mode, NodeId, Precision, Scalar, Unwatched, verify};
use isograd_wasm::{Options, Plan, Slot, Split, Vectors};

/// The artefact of a graph with these inputs varying. Each scalar is a port of its own.
pub fn artefact(
    precision: Precision,
    varying: &[bool],
    vectors: Option<Vectors>,
    build: impl FnOnce(&mut Builder<'_>),
) -> Artefact {
    let mut builder = Builder::new(Mode::Real(precision), 1_000_000, &Unwatched);
    build(&mut builder);
    let graph = verify(builder.finish().expect("within budget")).expect("well formed");
    let plan = Plan::new(&graph, &Options { precision, varying, vectors, split: Split::default() }).expect("plans");
    let (layout, work) = (plan.layout().clone(), plan.work());
    let module = plan.emit(b"").expect("emits");
    let port = |name: &str, slot: &Slot| {
        let scalar = match slot.scalar {
            Scalar::Real => ColumnType::Real,
            Scalar::Int => ColumnType::Int,
            Scalar::Bool => ColumnType::Bool,
        };
        Port {
            name: name.to_owned(),
            ty: slot.scalar.to_string(),
            rate: if slot.varying { Rate::Varying } else { Rate::Uniform },
            role: Role::Point,
            jumps: Vec::new(),
            kinks: Vec::new(),
            columns: vec![Column {
                name: name.to_owned(),
                scalar,
                offset: slot.offset,
                default: None,
                within: None,
                range: None,
                zero: false,
            }],
        }
    };
    // An id of its own for every module: the runtime's cache goes by it.
    let id =
        module.bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3));
    let manifest = Manifest {
        compiler: "test".to_owned(),
        id: format!("{id:016x}"),
        export: "f".to_owned(),
        precision: precision.name().to_owned(),
        inputs: graph.inputs.iter().zip(&layout.inputs).map(|(input, slot)| port(&input.name, slot)).collect(),
        outputs: graph.outputs.iter().zip(&layout.outputs).map(|(output, slot)| port(&output.name, slot)).collect(),
        target: Target::Wasm,
        form: Form::Kernel,
        abi: Abi::Memory(Memory {
            block: layout.block,
            pad: layout.pad,
            memory: layout.memory,
            scratch: layout.scratch,
        }),
        operations: work.operations as u32,
        unbounded: work.long_loop,
        derivatives: Derivatives { mode: DerivativeMode::Forward, forward: None, reverse: None },
        differentiability: Differentiability::Exact,
        sensitivity: None,
        specialised: None,
    };
    Artefact { bytes: module.bytes, manifest, warnings: Vec::new() }
}

/// √(x² + y² + z²) − r, and its partial derivatives by x, y and z if wanted.
pub fn sphere(b: &mut Builder<'_>, gradient: bool) {
    let at: Vec<NodeId> = ["x", "y", "z"].iter().map(|name| b.input(*name, Scalar::Real)).collect();
    let r = b.input("r", Scalar::Real);
    let squares: Vec<NodeId> = at.iter().map(|x| b.mul(*x, *x)).collect();
    let sum = b.add(squares[0], squares[1]);
    let sum = b.add(sum, squares[2]);
    let length = b.sqrt(sum);
    let value = b.sub(length, r);
    b.output("value", value);
    if gradient {
        let zero = b.real(0.0);
        let none = b.eq(length, zero);
        for (name, x) in ["dx", "dy", "dz"].into_iter().zip(at) {
            let quotient = b.div(x, length);
            let unit = b.select(none, zero, quotient);
            b.output(name, unit);
        }
    }
}
