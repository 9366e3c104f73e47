//! A module that is ready for a device, with all that its results are judged by: points, what WebAssembly computes at
//! them, and what the reference met. Made without a device.

use std::sync::LazyLock;

use isograd_compiler::{
    Abi, Bindings, Buffers, Checked, Code, Column, Derivatives, Differentiability, Form, Manifest, Options, Port, Rate,
    Request, Role, Target, compile, print_step,
};
use isograd_graph::ops::Family;
use isograd_graph::{Graph, Precision, Scalar, Unwatched, Value, Verified, parse, verify};
use isograd_runtime::{EvalOptions, Runtime, Settings, Values};
use isograd_spirv::{EmitError, Layout, Plan, Slot};
use isograd_vulkan::Device;
use isograd_wasm::Split;

use super::columns::{Held, column_type, held, rows};
use super::importer::importer;
use super::locate;
use super::points::points;
use super::rules::{Difference, HeldTo, Judged, Reference, Verdict, compare};
use super::tools::{assemble, link, validate};
use crate::gpu::bounds::{self, Judge, Model};
use crate::laws::{Failure, finished};
use crate::wasm::{Broken, Machine};

const LAW: &str = "wasm_equals_spirv";

/// What a module is made of, for messages.
#[derive(Debug, Clone)]
pub struct Subject {
    /// Short: the case's name.
    pub name: String,
    /// Long: the program or graph.
    pub text: String,
}

/// A module and what is wanted of it.
#[derive(Clone)]
pub struct Prepared {
    /// What it is made of.
    pub subject: Subject,
    /// How to call it.
    pub manifest: Manifest,
    /// The module.
    pub module: Vec<u8>,
    /// How many modules were validated for it.
    pub validated: usize,
    /// Points, each with the values of all inputs.
    pub points: Vec<Vec<Value>>,
    /// What WebAssembly computes.
    pub wasm: Vec<Vec<Value>>,
    /// The shader's own graph.
    pub graph: Verified,
    /// What the reference computes of it.
    pub reference: Reference,
    /// Whether it stores canonical NaNs; a function that is called leaves that to its caller.
    canonical: bool,
}

/// What became of a case.
pub enum Made {
    /// It can be executed.
    Ready(Box<Prepared>),
    /// The target lacks something, said by a diagnostic.
    Refused(String),
    /// It is valid, but has more than [`MOST_OPERATIONS`]: a software driver compiles it for minutes.
    TooLarge {
        /// How many modules were validated.
        validated: usize,
    },
}

/// The most operations of a kernel that is executed.
pub const MOST_OPERATIONS: usize = 10_000;

/// The runtime for all cases of a process: each is evaluated once, so it keeps little.
#[must_use]
pub fn runtime() -> &'static Runtime {
    static RUNTIME: LazyLock<Runtime> = LazyLock::new(|| Runtime::new(Settings::default()));
    &RUNTIME
}

impl Prepared {
    /// The bits of the shader's own graph, by the reference, against those of WebAssembly: nothing is excused.
    #[must_use]
    pub fn by_reference(&self) -> Verdict {
        compare(&self.wasm, &self.reference.rows, Judged::Reference)
    }

    /// What the device computes.
    ///
    /// # Errors
    /// If it does not take the module or stores what is no value.
    pub fn executed(&self, device: &Device) -> Result<Vec<Vec<Value>>, Failure> {
        let failed = |what: String| self.failure(what);
        let shader = device.load_bytes(&self.module, &self.manifest).map_err(|e| failed(e.to_string()))?;
        let inputs = held(&self.manifest, &self.points);
        let inputs: Vec<Values<'_>> = inputs.iter().map(Held::values).collect();
        let columns = shader.evaluate(&inputs, self.points.len()).map_err(|e| failed(e.to_string()))?;
        rows(&self.manifest, &columns, self.points.len(), self.canonical).map_err(failed)
    }

    /// Where a difference at a point begins, if that can be seen.
    #[must_use]
    pub fn origin(&self, point: usize, device: &Device) -> Option<String> {
        locate::first(&self.graph, &self.manifest, self.points.get(point)?, device)
    }

    /// What a device computed, by the rules and, if it is held to them only, by bounds.
    #[must_use]
    pub fn judged(&self, found: &[Vec<Value>], held_to: HeldTo) -> Verdict {
        if held_to == HeldTo::Bits || self.manifest.precision() != Some(Precision::F32) {
            return compare(&self.wasm, found, Judged::Device(&self.reference.met));
        }
        let mut judge = Judge::new(&self.graph, Model::vulkan_to_nearest());
        let mut all = Verdict::default();
        for (point, (inputs, wasm)) in self.points.iter().zip(&self.wasm).enumerate() {
            let found = found.get(point).map_or(&[][..], std::slice::from_ref);
            let met = self.reference.met.get(point).map_or(&[][..], std::slice::from_ref);
            let mut one = compare(std::slice::from_ref(wasm), found, Judged::Device(met));
            if let [found] = found
                && one.tally.different > 0
                && found.len() == wasm.len()
            {
                let place = match judge.judge(inputs, found) {
                    bounds::Verdict::Within { .. } => Some(&mut one.tally.within),
                    bounds::Verdict::Ambiguous | bounds::Verdict::Special(_) => Some(&mut one.tally.unjudged),
                    bounds::Verdict::Outside { .. } => None,
                };
                if let Some(place) = place {
                    *place = std::mem::take(&mut one.tally.different);
                    one.first = None;
                }
            }
            all.tally += one.tally;
            all.excused.extend(one.excused);
            all.first = all.first.or(one.first.map(|d| Difference { point, ..d }));
        }
        all
    }

    /// A failure about this module.
    #[must_use]
    pub fn failure(&self, what: String) -> Failure {
        Failure { law: LAW, subject: self.subject.name.clone(), what }
    }
}

/// The points of a case.
#[derive(Debug, Clone, Copy)]
pub enum At<'a> {
    /// These.
    Given(&'a [Vec<Value>]),
    /// So many, seeded, as the manifest asks for.
    Seeded(usize, u64),
}

/// Compiles a request to WebAssembly and to a SPIR-V kernel, has it validated if the tools are there, and evaluates
/// it on the CPU. The request's target is ignored.
///
/// # Errors
/// If something fails that should not; what SPIR-V cannot do is no failure.
pub fn of_request(checked: &Checked, request: &Request, name: &str, at: At<'_>, tools: bool) -> Result<Made, Failure> {
    of_form(checked, request, Form::Kernel, name, at, tools)
}

/// The same with a SPIR-V library, linked with a kernel that imports its function. The tools must be there.
///
/// # Errors
/// If something fails that should not; what SPIR-V cannot do is no failure.
pub fn of_library(checked: &Checked, request: &Request, name: &str, at: At<'_>) -> Result<Made, Failure> {
    of_form(checked, request, Form::Library, name, at, true)
}

fn of_form(
    checked: &Checked,
    request: &Request,
    form: Form,
    name: &str,
    at: At<'_>,
    tools: bool,
) -> Result<Made, Failure> {
    let text = checked.files.iter().next().map(|(_, file)| file.text.clone()).unwrap_or_default();
    let subject = Subject { name: name.to_owned(), text };
    let failed = |what: String| Failure { law: LAW, subject: name.to_owned(), what };
    let options = Options { verify: true, ..Options::default() };
    let diagnosed = |target: &str, all: &[isograd_compiler::Diagnostic]| {
        let all: Vec<String> = all.iter().map(|d| format!("{}: {}", d.code.name(), d.message)).collect();
        failed(format!("compiled to {target}: {}", all.join("; ")))
    };
    let wasm = Request { target: Target::Wasm, form: Form::Kernel, ..request.clone() };
    let wasm = compile(checked, &wasm, &options, &Unwatched).map_err(|e| diagnosed("wasm", &e))?;
    let request = Request { target: Target::Spirv, form, ..request.clone() };
    let artefact = match compile(checked, &request, &options, &Unwatched) {
        Ok(artefact) => artefact,
        Err(all) if all.iter().all(|d| d.code == Code::E1101) => {
            return Ok(Made::Refused(all.iter().map(|d| d.message.clone()).collect()));
        }
        Err(all) => return Err(diagnosed("spirv", &all)),
    };

    let scheduled = print_step(checked, &request, "schedule", &options, &Unwatched);
    let scheduled = scheduled.map_err(|e| diagnosed("spirv", &e))?;
    let graph = parse(&scheduled).map_err(|e| failed(e.to_string()))?;
    let graph = verify(graph).map_err(|e| failed(e.to_string()))?;

    let mut module = artefact.bytes;
    let mut manifest = artefact.manifest;
    let mut validated = 0;
    let mut valid = |module: &[u8], library: bool| {
        validated += usize::from(tools);
        if tools { validate(module, library).map_err(failed) } else { Ok(()) }
    };
    valid(&module, form == Form::Library)?;
    if form == Form::Library {
        manifest.inputs.iter_mut().for_each(|port| port.rate = Rate::Varying);
        let text = importer(&manifest, &request.export);
        let importing = assemble(&text).map_err(|e| failed(format!("the importing kernel: {e}\n{text}")))?;
        module = link(&[&importing, &module]).map_err(|e| failed(format!("{e}\n{text}")))?;
        valid(&module, false)?;
        manifest.form = Form::Kernel;
        manifest.abi = Abi::Buffers(buffers(manifest.precision().unwrap_or_default(), &manifest.inputs, 0));
    }

    if graph.operations() > MOST_OPERATIONS {
        return Ok(Made::TooLarge { validated });
    }
    let mut points = match at {
        At::Given(points) => points.to_vec(),
        At::Seeded(n, seed) => points(&manifest, n, seed),
    };
    let reference = Reference::of(&graph, manifest.precision().unwrap_or_default(), &mut points);
    let kernel = runtime().load(&wasm).map_err(|e| failed(e.to_string()))?;
    let inputs = held(&wasm.manifest, &points);
    let inputs: Vec<Values<'_>> = inputs.iter().map(Held::values).collect();
    let columns = kernel.evaluate(&inputs, points.len(), &EvalOptions::default()).map_err(|e| failed(e.to_string()))?;
    let wasm = rows(&wasm.manifest, &columns, points.len(), true).map_err(failed)?;
    let canonical = form == Form::Kernel;
    Ok(Made::Ready(Box::new(Prepared {
        subject,
        manifest,
        module,
        validated,
        points,
        wasm,
        graph,
        reference,
        canonical,
    })))
}

/// Takes a raw graph without `diff` through the end of the pipeline for both targets, has the kernel validated if the
/// tools are there, and evaluates it on the CPU at points. Each second input is uniform if asked for.
///
/// # Errors
/// If something fails that should not; what SPIR-V cannot do is no failure.
pub fn of_graph(
    graph: &Graph,
    precision: Precision,
    optimised: bool,
    uniforms: bool,
    name: &str,
    mut points: Vec<Vec<Value>>,
    tools: bool,
) -> Result<Made, Failure> {
    let text = isograd_graph::print(graph);
    let failed = |what: String| Failure { law: LAW, subject: format!("{name}\n{text}"), what };
    let lanes = finished(graph, precision, Family::Lanes, optimised)?;
    let shader = finished(graph, precision, Family::Shader, optimised)?;
    let varying: Vec<bool> = (0..shader.inputs.len()).map(|k| !uniforms || k % 2 == 0).collect();
    let plan = Plan::new(&shader, isograd_spirv::Form::Kernel { varying: &varying });
    let made = plan.and_then(|plan| Ok((plan.spirv()?, plan.layout().clone())));
    let (module, layout) = match made {
        Ok(made) => made,
        Err(EmitError::Unsupported { lack, .. }) => return Ok(Made::Refused(lack.to_string())),
        Err(e) => return Err(failed(e.to_string())),
    };
    if tools {
        validate(&module, false).map_err(&failed)?;
    }
    if shader.operations() > MOST_OPERATIONS {
        return Ok(Made::TooLarge { validated: usize::from(tools) });
    }
    if let Some(first) = points.first().cloned() {
        for row in &mut points {
            for ((value, first), varying) in row.iter_mut().zip(&first).zip(&varying) {
                *value = if *varying { *value } else { *first };
            }
        }
    }
    let reference = Reference::of(&shader, precision, &mut points);
    let mut machine = Machine::new(&lanes, &varying, None, Split::default()).map_err(|Broken(e)| failed(e))?;
    let mut wasm = Vec::new();
    for chunk in points.chunks(machine.block()) {
        wasm.extend(machine.run(chunk).map_err(|Broken(e)| failed(e))?);
    }
    let manifest = manifest_of(&shader, &layout);
    let subject = Subject { name: name.to_owned(), text: text.clone() };
    let validated = usize::from(tools);
    let (graph, canonical) = (shader, true);
    Ok(Made::Ready(Box::new(Prepared {
        subject,
        manifest,
        module,
        validated,
        points,
        wasm,
        graph,
        reference,
        canonical,
    })))
}

/// What a host must know of a graph's kernel.
pub fn manifest_of(graph: &Verified, layout: &Layout) -> Manifest {
    let port = |name: &str, kind: Scalar, slot: &Slot| Port {
        name: name.to_owned(),
        ty: kind.to_string(),
        rate: if slot.varying { Rate::Varying } else { Rate::Uniform },
        role: Role::Point,
        jumps: Vec::new(),
        kinks: Vec::new(),
        columns: vec![Column {
            name: name.to_owned(),
            scalar: column_type(kind),
            offset: slot.column,
            default: None,
            within: None,
            range: None,
            zero: false,
        }],
    };
    let inputs: Vec<Port> =
        graph.inputs.iter().zip(&layout.inputs).map(|(input, slot)| port(&input.name, input.scalar, slot)).collect();
    let outputs = graph.outputs.iter().zip(&layout.outputs);
    let outputs = outputs.map(|(output, slot)| port(&output.name, graph.scalar(output.node), slot)).collect();
    Manifest {
        compiler: String::new(),
        id: String::new(),
        export: "graph".to_owned(),
        precision: layout.precision.name().to_owned(),
        target: Target::Spirv,
        form: Form::Kernel,
        abi: Abi::Buffers(buffers(layout.precision, &inputs, layout.tapes)),
        inputs,
        outputs,
        operations: u32::try_from(graph.operations()).unwrap_or(u32::MAX),
        unbounded: false,
        derivatives: Derivatives { mode: isograd_compiler::DerivativeMode::Forward, forward: None, reverse: None },
        specialised: None,
        differentiability: Differentiability::default(),
        sensitivity: None,
    }
}

fn buffers(precision: Precision, inputs: &[Port], tapes: u32) -> Buffers {
    let any = |rate: Rate| inputs.iter().any(|port| port.rate == rate && !port.columns.is_empty());
    Buffers {
        entry: isograd_spirv::ENTRY.to_owned(),
        workgroup: isograd_spirv::WORKGROUP,
        element: precision.bytes(),
        bindings: Bindings {
            set: isograd_spirv::SET,
            inputs: any(Rate::Varying).then_some(isograd_spirv::INPUTS),
            outputs: isograd_spirv::OUTPUTS,
            call: isograd_spirv::CALL,
            uniforms: any(Rate::Uniform).then_some(isograd_spirv::UNIFORMS),
        },
        tapes,
    }
}

#[cfg(test)]
mod tests {
    use isograd_graph::{Builder, Mode};

    use super::*;
    use crate::gpu::bounds::{Device, Style};

    /// Devices that round as badly as Vulkan lets them are accepted by bounds and not by bits; larger errors by neither.
    #[test]
    fn bounds_accept_what_vulkan_allows_and_nothing_else() {
        let points: Vec<Vec<Value>> = crate::points::in_box(&[(0.5, 1.0), (1.25, 2.0)], 64, 1)
            .iter()
            .map(|p| p.iter().map(|x| Value::Real(Precision::F32.round(*x))).collect())
            .collect();
        let mut b = Builder::new(Mode::Raw, 100, &Unwatched);
        let (x, y) = (b.input("x", Scalar::Real), b.input("y", Scalar::Real));
        let (quotient, root) = (b.div(x, y), b.sqrt(y));
        b.output("quotient", quotient);
        b.output("root", root);
        let graph = b.finish().expect("no budget");
        let made = of_graph(&graph, Precision::F32, false, false, "bounds", points, false);
        let Ok(Made::Ready(prepared)) = made else { panic!("the graph is small and right") };
        let mut device = Device::new(&prepared.graph, Model::vulkan_to_nearest(), Style::Extreme, 7);
        let rough: Vec<Vec<Value>> =
            prepared.points.iter().map(|point| device.run(point).expect("nothing special")).collect();
        let by_bits = prepared.judged(&rough, HeldTo::Bits).tally;
        let by_bounds = prepared.judged(&rough, HeldTo::Bounds);
        assert!(by_bits.different > 0, "{by_bits:?}");
        assert_eq!(by_bounds.first, None);
        assert_eq!(by_bounds.tally.different, 0);
        assert_eq!(by_bounds.tally.within + by_bounds.tally.unjudged, by_bits.different);
        assert!(by_bounds.tally.within > by_bits.different / 2, "{:?}", by_bounds.tally);

        let wrong = |value: &Value| match value {
            Value::Real(x) => Value::Real(Precision::F32.round(x * 1.001)),
            other => *other,
        };
        let wrong: Vec<Vec<Value>> = rough.iter().map(|row| row.iter().map(wrong).collect()).collect();
        let verdict = prepared.judged(&wrong, HeldTo::Bounds);
        assert!(verdict.tally.different > verdict.tally.values / 2 && verdict.first.is_some(), "{:?}", verdict.tally);
    }
}
