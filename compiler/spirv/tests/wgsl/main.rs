//! WGSL and its translations: what they look like, that naga's reader and validator accept them, that limits are noticed.
//! What they compute is run elsewhere, where there is a device.

#![allow(clippy::pedantic, reason = "tests")]

#[path = "../../../graph/tests/garden/mod.rs"]
mod garden;
mod limits;
mod modules;
mod scenes;
mod texts;
mod translations;

use isograd_graph::Verified;
use isograd_spirv::{EmitError, Form, Group, Plan, Signature};

/// The kernel of a graph, all of whose inputs vary.
fn kernel(graph: &Verified) -> Result<String, EmitError> {
    Plan::new(graph, Form::Kernel { varying: &vec![true; graph.inputs.len()] })?.wgsl()
}

/// The function of a graph.
fn library(graph: &Verified, signature: &Signature) -> Result<String, EmitError> {
    Plan::new(graph, Form::Library(signature))?.wgsl()
}

/// A signature by groups of names and sizes.
fn signature(name: &str, parameters: &[(&str, usize)], results: &[(&str, usize)]) -> Signature {
    let groups = |groups: &[(&str, usize)]| {
        groups.iter().map(|(name, scalars)| Group { name: (*name).to_owned(), scalars: *scalars }).collect()
    };
    Signature { name: name.to_owned(), parameters: groups(parameters), results: groups(results) }
}

/// Every scalar for itself.
fn scalars(graph: &Verified) -> Signature {
    let inputs: Vec<(&str, usize)> = graph.inputs.iter().map(|i| (i.name.as_str(), 1)).collect();
    let outputs: Vec<(&str, usize)> = graph.outputs.iter().map(|o| (o.name.as_str(), 1)).collect();
    signature("f", &inputs, &outputs)
}

/// Reads and validates a module.
fn checked(text: &str) -> naga::Module {
    let module =
        naga::front::wgsl::parse_str(text).unwrap_or_else(|error| panic!("{}\n{text}", error.emit_to_string(text)));
    let mut validator =
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::empty());
    validator.validate(&module).unwrap_or_else(|error| panic!("{}\n{text}", error.emit_to_string(text)));
    module
}
