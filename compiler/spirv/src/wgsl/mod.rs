//! WGSL of a plan, straight from the graph. Knows the module around a function: bindings, structs, entry point; knows
//! nothing of SPIR-V.
//!
//! All that a module has of its own is named apart from what the source names: in a kernel by the choice of names, in a
//! library by two underscores, so that several libraries can be put into one module.
//!
//! Implementations merge sums with sums and products with products, which would take the roundings away that kernels count
//! on. There, and only there, the inner result goes through the bits of a number, which nothing is merged across.

mod body;
mod names;
mod rounding;
mod text;

use std::fmt::Write;

use isograd_graph::{Precision, Scalar};

pub use names::identifier;

use crate::plan::{Shape, Slot};
use crate::{CALL, ENTRY, EmitError, Form, INPUTS, Lack, Language, OUTPUTS, Plan, SET, Signature, UNIFORMS, WORKGROUP};
use body::Body;
use names::Names;
use text::type_name;

/// How deep WGSL lets braces nest in those of a function.
const NESTING: u32 = 126;
/// Members of a struct, parameters of a function, elements of a new array: as many as every implementation allows.
const MEMBERS: usize = 1023;
const PARAMETERS: usize = 255;
const ELEMENTS: usize = 2047;

/// What text can promise.
const ROUNDING: &str = "\
// Each operation is meant to be rounded on its own. WGSL cannot demand that: an implementation may fuse a * b + c into
// one rounding, divide and take roots a little wrong, flush subnormal numbers to 0 and ignore infinities and NaN. So
// results may differ in their last digits from those of WebAssembly and SPIR-V.
";

impl Plan<'_> {
    /// The text of a kernel, or of a function for other modules.
    ///
    /// # Errors
    /// If WGSL cannot do what the graph asks for.
    pub fn wgsl(&self) -> Result<String, EmitError> {
        if self.layout().precision == Precision::F64 {
            return Err(unsupported(Lack::Doubles));
        }
        self.nests_within(Language::Wgsl, NESTING)?;
        match &self.form {
            Form::Kernel { .. } => self.kernel(),
            Form::Library(signature) => self.library(signature),
        }
    }

    fn kernel(&self) -> Result<String, EmitError> {
        let mut names = Names::default();
        for name in ["inputs", "outputs", "uniforms", "call", "Call", ENTRY, "invocation", "point", "bits_of"] {
            names.claim(name.to_owned());
        }
        let outputs = self.graph.outputs.iter().map(|output| output.name.clone());
        let mut body = Body::new(self, names, String::new(), outputs);
        let layout = self.layout();
        let has = |varying| layout.inputs.iter().any(|slot| slot.varying == varying);
        let needed = self.needed_inputs();
        let read = |varying| layout.inputs.iter().zip(&needed).any(|(slot, needed)| slot.varying == varying && *needed);
        body.line(format_args!("if invocation.x >= call.count - min(call.base, call.count) {{"));
        body.line(format_args!("    return;"));
        body.line(format_args!("}}"));
        body.line(format_args!("let point = call.base + invocation.x;"));
        // A binding that nothing reads would vanish from the layouts that implementations deduce.
        for (varying, buffer) in [(true, "inputs"), (false, "uniforms")] {
            if has(varying) && !read(varying) {
                body.line(format_args!("_ = {buffer}[0];"));
            }
        }
        body.nodes(false, |body, index| {
            let (Some(slot), Some(input)) = (layout.inputs.get(index), self.graph.inputs.get(index)) else {
                return String::new();
            };
            let element = if slot.varying {
                format!("inputs[{}]", place("input", slot.column))
            } else {
                format!("uniforms[{}]", slot.column)
            };
            let name = body.names.take(&input.name);
            match slot.scalar {
                Scalar::Real => body.line(format_args!("let {name} = bitcast<f32>({element});")),
                Scalar::Int => body.line(format_args!("let {name} = bitcast<i32>({element});")),
                Scalar::Bool => body.line(format_args!("let {name} = {element} != 0u;")),
            }
            name
        })?;
        let mut stores_reals = false;
        for (slot, output) in layout.outputs.iter().zip(&self.graph.outputs) {
            let place = place("output", slot.column);
            let text = body.text(output.node).to_owned();
            match (body.constant_bits(output.node), slot.scalar) {
                (Some(bits), _) => body.line(format_args!("outputs[{place}] = {bits:#x}u;")),
                (None, Scalar::Real) => {
                    stores_reals = true;
                    body.line(format_args!("outputs[{place}] = bits_of({text});"));
                }
                (None, Scalar::Int) => body.line(format_args!("outputs[{place}] = bitcast<u32>({text});")),
                (None, Scalar::Bool) => body.line(format_args!("outputs[{place}] = u32({text});")),
            }
        }

        let mut out = self.kernel_header();
        out.push_str(
            "struct Call {\n    count: u32,\n    input_stride: u32,\n    output_stride: u32,\n    base: u32,\n}\n\n",
        );
        let mut bind = |number, access, name, ty| {
            // Writing to a string cannot fail.
            let _ = writeln!(out, "@group({SET}) @binding({number}) var<{access}> {name}: {ty};");
        };
        if has(true) {
            bind(INPUTS, "storage, read", "inputs", "array<u32>");
        }
        if !layout.outputs.is_empty() {
            bind(OUTPUTS, "storage, read_write", "outputs", "array<u32>");
        }
        bind(CALL, "uniform", "call", "Call");
        if has(false) {
            bind(UNIFORMS, "storage, read", "uniforms", "array<u32>");
        }
        out.push('\n');
        if stores_reals {
            out.push_str(
                "// The bits of a number; of NaN all are set.\nfn bits_of(x: f32) -> u32 {\n    let bits = \
                 bitcast<u32>(x);\n    return select(bits, 0xffffffffu, (bits & 0x7fffffffu) > 0x7f800000u);\n}\n\n",
            );
        }
        for function in &body.functions {
            out.push_str(function);
            out.push('\n');
        }
        let _ = write!(
            out,
            "@compute @workgroup_size({WORKGROUP})\nfn {ENTRY}(@builtin(global_invocation_id) invocation: vec3<u32>) \
             {{\n{}}}\n",
            body.out
        );
        Ok(out)
    }

    /// Per input of the graph whether an output depends on it.
    fn needed_inputs(&self) -> Vec<bool> {
        let mut needed = vec![false; self.graph.inputs.len()];
        for (id, node) in self.graph.iter() {
            if let isograd_graph::Node::Input(index) = node
                && let Some(place) = needed.get_mut(index as usize)
            {
                *place = self.structure.needed[id];
            }
        }
        needed
    }

    fn kernel_header(&self) -> String {
        let mut out = String::from(
            "// A kernel made by Isograd: invocation x computes point base + x if that is less than count.\n//\n",
        );
        let layout = self.layout();
        let mut columns = |buffer: &str, rule: &str, all: Vec<(&Slot, &str)>| {
            if all.is_empty() {
                return;
            }
            let _ = writeln!(out, "// {buffer}: {rule}");
            for (slot, name) in all {
                let _ = writeln!(out, "//     {} {}: {}", slot.column, comment(name), type_name(slot.scalar));
            }
        };
        let inputs = |varying| {
            let all = layout.inputs.iter().zip(&self.graph.inputs);
            all.filter(|(slot, _)| slot.varying == varying).map(|(slot, input)| (slot, input.name.as_str())).collect()
        };
        columns("inputs", "number k of point i is element k * input_stride + i", inputs(true));
        columns("uniforms", "number k is element k", inputs(false));
        let outputs = layout.outputs.iter().zip(&self.graph.outputs).map(|(slot, o)| (slot, o.name.as_str())).collect();
        columns("outputs", "number k of point i is element k * output_stride + i", outputs);
        let _ = write!(
            out,
            "// An element is the bits of its number; a bool is 0 or 1. All bits are set in NaN.\n//\n{ROUNDING}\n"
        );
        out
    }

    fn library(&self, signature: &Signature) -> Result<String, EmitError> {
        if signature.parameters.len() > PARAMETERS {
            return Err(unsupported(Lack::Parameters { count: signature.parameters.len() }));
        }
        let (parameters, results) = self.shapes(signature);
        let mut names = Names::default();
        let function = names.take(&signature.name);
        let mut structs = String::new();

        // The parameters, and what their scalars are called.
        let mut list = Vec::new();
        let mut inputs = Vec::new();
        let mut columns = self.graph.inputs.iter().map(|input| input.name.as_str());
        for (group, shape) in signature.parameters.iter().zip(&parameters) {
            let name = names.take(&group.name);
            let own: Vec<&str> = columns.by_ref().take(group.scalars).collect();
            let ty = ty(&mut names, &mut structs, &function, &group.name, shape, &own)?;
            list.push(format!("{name}: {}", ty.name));
            inputs.extend(ty.selectors.iter().map(|selector| format!("{name}{selector}")));
        }

        // The types of the results.
        let mut types = Vec::new();
        let mut columns = self.graph.outputs.iter().map(|output| output.name.as_str());
        for (group, shape) in signature.results.iter().zip(&results) {
            let own: Vec<&str> = columns.by_ref().take(group.scalars).collect();
            types.push(ty(&mut names, &mut structs, &function, &group.name, shape, &own)?);
        }
        let returned = match types.as_slice() {
            [] => None,
            [one] => Some(one.name.clone()),
            several => {
                at_most(MEMBERS, several.len())?;
                let name = names.claim(format!("{function}__result"));
                let members = signature.results.iter().zip(several).map(|(g, ty)| (g.name.as_str(), ty.name.as_str()));
                let _ = member_names(&mut structs, &name, members);
                Some(name)
            }
        };

        let outputs = signature.results.iter().zip(&types);
        let outputs = outputs.flat_map(|(group, ty)| ty.selectors.iter().map(|s| format!("{}{s}", group.name)));
        let mut body = Body::new(self, names, format!("{function}__"), outputs);
        body.nodes(true, |_, index| inputs.get(index).cloned().unwrap_or_default())?;
        let mut outputs = self.graph.outputs.iter();
        let values: Vec<String> = types
            .iter()
            .map(|ty| {
                let own: Vec<&str> = outputs.by_ref().take(ty.scalars).map(|output| body.text(output.node)).collect();
                ty.made_of(&own)
            })
            .collect();
        let arrow = match (&returned, values.as_slice()) {
            (Some(name), [value]) => {
                body.line(format_args!("return {value};"));
                format!(" -> {name}")
            }
            (Some(name), several) => {
                body.line(format_args!("return {name}("));
                several.iter().for_each(|value| body.line(format_args!("    {value},")));
                body.line(format_args!(");"));
                format!(" -> {name}")
            }
            (None, _) => String::new(),
        };

        let mut out = format!(
            "// {}: a function made by Isograd, for other modules to contain. Names of its own have two underscores.\n\
             //\n{ROUNDING}\n{structs}",
            comment(&signature.name)
        );
        for helper in &body.functions {
            out.push_str(helper);
            out.push('\n');
        }
        let _ = write!(out, "fn {function}({}){arrow} {{\n{}}}\n", list.join(", "), body.out);
        Ok(out)
    }
}

/// A type of a parameter or result.
struct Type {
    name: String,
    scalars: usize,
    /// What selects each scalar of a value.
    selectors: Vec<String>,
}

impl Type {
    fn made_of(&self, scalars: &[&str]) -> String {
        match scalars {
            [one] => (*one).to_owned(),
            several => format!("{}({})", self.name, several.join(", ")),
        }
    }
}

/// The type of a shape, whose struct is declared if it is one.
fn ty(
    names: &mut Names,
    structs: &mut String,
    function: &str,
    group: &str,
    shape: &Shape,
    columns: &[&str],
) -> Result<Type, EmitError> {
    let (name, selectors) = match shape {
        Shape::Scalar(scalar) => (type_name(*scalar).to_owned(), vec![String::new()]),
        Shape::Vector(scalar, count) => {
            let selectors = [".x", ".y", ".z", ".w"].iter().take(*count as usize).map(|s| (*s).to_owned()).collect();
            (format!("vec{count}<{}>", type_name(*scalar)), selectors)
        }
        Shape::Array(scalar, count) => {
            at_most(ELEMENTS, *count as usize)?;
            (format!("array<{}, {count}>", type_name(*scalar)), (0..*count).map(|k| format!("[{k}]")).collect())
        }
        Shape::Struct(scalars) => {
            at_most(MEMBERS, scalars.len())?;
            let name = names.claim(format!("{function}__{}", identifier(group)));
            let short = |column: &'_ str| column.strip_prefix(group).unwrap_or(column).to_owned();
            let columns: Vec<String> = columns.iter().map(|column| short(column)).collect();
            let members = columns.iter().zip(scalars).map(|(column, s)| (column.as_str(), type_name(*s)));
            let members = member_names(structs, &name, members);
            (name, members.into_iter().map(|member| format!(".{member}")).collect())
        }
    };
    Ok(Type { name, scalars: columns.len(), selectors })
}

/// Declares a struct and gives the names of its members.
fn member_names<'a>(
    structs: &mut String,
    name: &str,
    members: impl Iterator<Item = (&'a str, &'a str)>,
) -> Vec<String> {
    let mut names = Names::default();
    let mut all = Vec::new();
    let _ = writeln!(structs, "struct {name} {{");
    for (wish, ty) in members {
        let member = names.take(wish);
        if member != wish && wish.contains(['(', '/']) {
            let _ = writeln!(structs, "    // {}", comment(wish));
        }
        let _ = writeln!(structs, "    {member}: {ty},");
        all.push(member);
    }
    structs.push_str("}\n\n");
    all
}

/// Where a number of the point is in its buffer.
fn place(buffer: &str, column: u32) -> String {
    match column {
        0 => "point".to_owned(),
        1 => format!("call.{buffer}_stride + point"),
        _ => format!("{column}u * call.{buffer}_stride + point"),
    }
}

/// A name within a line of comment.
fn comment(name: &str) -> String {
    name.chars().map(|c| if c.is_control() || matches!(c, '\u{2028}' | '\u{2029}') { ' ' } else { c }).collect()
}

fn at_most(most: usize, count: usize) -> Result<(), EmitError> {
    if count <= most { Ok(()) } else { Err(unsupported(Lack::Members { count, most })) }
}

const fn unsupported(lack: Lack) -> EmitError {
    EmitError::Unsupported { target: Language::Wgsl, lack, node: None }
}
