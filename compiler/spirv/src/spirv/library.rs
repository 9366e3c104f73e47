//! The door of a library: a function that takes and gives values, exported under its name. Knows the shapes of values;
//! knows nothing of what is computed.

use isograd_graph::{NodeId, Scalar};
use rspirv::dr::{self, Operand};
use rspirv::spirv::{Capability, Decoration, LinkageType, Op, Word};

use super::module::{Writer, ids};
use super::values::Body;
use crate::{EmitError, Group, Lack, Language, Plan, Shape, Signature};

/// The most parameters of a function (SPIR-V 2.17).
const PARAMETERS: usize = 255;
/// The most members of a struct (SPIR-V 2.17). Arrays may have more, but no instruction that makes one.
const MEMBERS: usize = 16_383;

/// Writes a library.
pub fn library(plan: &Plan<'_>, signature: &Signature) -> Result<dr::Module, EmitError> {
    let mut out = Writer::new(plan.layout().precision);
    let types = Types::declare(&mut out, plan, signature)?;
    let parameters = types.begin(&mut out, signature);
    let first = out.id();
    out.begin_block(first);
    let mut inputs = Vec::with_capacity(plan.graph.inputs.len());
    for (value, parameter) in parameters.into_iter().zip(&types.parameters) {
        for index in 0..parameter.scalars.len() {
            let input = inputs.len();
            let needed = u32::try_from(input).is_ok_and(|input| plan.structure.needed[NodeId(input)]);
            inputs.push(if needed { parameter.take(&mut out, value, index) } else { 0 });
        }
    }
    let mut body = Body::write(plan, &mut out, &inputs)?;
    let outputs: Vec<Word> = plan.graph.outputs.iter().map(|output| body.value(output.node)).collect();
    types.give(&mut out, &outputs);
    out.end_function();
    out.finish()
}

/// The types of a function.
struct Types {
    /// Of each parameter.
    parameters: Vec<Passed>,
    /// Of each result.
    results: Vec<Passed>,
    /// What the function returns: nothing, its only result or a struct of all.
    returned: Word,
}

/// The type of a parameter or result.
struct Passed {
    id: Word,
    /// The kinds of its scalars.
    scalars: Vec<Scalar>,
}

impl Types {
    /// Declares them, if SPIR-V can pass as much.
    fn declare(out: &mut Writer, plan: &Plan<'_>, signature: &Signature) -> Result<Self, EmitError> {
        let count = signature.parameters.len();
        if count > PARAMETERS {
            let lack = Lack::Parameters { count };
            return Err(EmitError::Unsupported { target: Language::Spirv, lack, node: None });
        }
        let groups = signature.parameters.iter().chain(&signature.results);
        let count = groups.map(|group| group.scalars).max().unwrap_or(0).max(signature.results.len());
        if count > MEMBERS {
            let lack = Lack::Members { count, most: MEMBERS };
            return Err(EmitError::Unsupported { target: Language::Spirv, lack, node: None });
        }
        let graph = plan.graph;
        let inputs: Vec<&str> = graph.inputs.iter().map(|input| input.name.as_str()).collect();
        let outputs: Vec<&str> = graph.outputs.iter().map(|output| output.name.as_str()).collect();
        let (parameters, results) = plan.shapes(signature);
        let parameters = passed(out, parameters, &signature.parameters, &inputs);
        let results = passed(out, results, &signature.results, &outputs);
        let returned = match results.as_slice() {
            [] => out.shared(Op::TypeVoid, None, vec![]),
            [one] => one.id,
            all => {
                let members: Vec<Word> = all.iter().map(|result| result.id).collect();
                let all = out.global(Op::TypeStruct, None, ids(&members));
                for (member, group) in (0..).zip(&signature.results) {
                    out.name_member(all, member, &group.name);
                }
                all
            }
        };
        Ok(Self { parameters, results, returned })
    }

    /// Begins the function: the numbers of its parameters.
    fn begin(&self, out: &mut Writer, signature: &Signature) -> Vec<Word> {
        out.capability(Capability::Linkage);
        let types: Vec<Word> = self.parameters.iter().map(|parameter| parameter.id).collect();
        let (function, parameters) = out.begin_function(self.returned, &types);
        out.name(function, &signature.name);
        let name = signature.name.as_str().into();
        out.decorate(function, Decoration::LinkageAttributes, vec![name, LinkageType::Export.into()]);
        for (parameter, group) in parameters.iter().zip(&signature.parameters) {
            out.name(*parameter, &group.name);
        }
        parameters
    }

    /// Returns these scalars.
    fn give(&self, out: &mut Writer, mut scalars: &[Word]) {
        let mut values = Vec::with_capacity(self.results.len());
        for result in &self.results {
            let (own, rest) = scalars.split_at_checked(result.scalars.len()).unwrap_or((scalars, &[]));
            values.push(result.make(out, own));
            scalars = rest;
        }
        match values.as_slice() {
            [] => out.terminate(Op::Return, vec![]),
            [one] => out.terminate(Op::ReturnValue, ids(&[*one])),
            all => {
                let value = out.push(Op::CompositeConstruct, self.returned, ids(all));
                out.terminate(Op::ReturnValue, ids(&[value]));
            }
        }
    }
}

impl Passed {
    /// A scalar of a value.
    fn take(&self, out: &mut Writer, value: Word, index: usize) -> Word {
        let (Some(scalar), Ok(place)) = (self.scalars.get(index), u32::try_from(index)) else { return value };
        if self.scalars.len() == 1 {
            return value;
        }
        let kind = out.kind((*scalar).into());
        out.push(Op::CompositeExtract, kind, vec![Operand::IdRef(value), Operand::LiteralBit32(place)])
    }

    /// A value of these scalars.
    fn make(&self, out: &mut Writer, scalars: &[Word]) -> Word {
        match scalars {
            [one] => *one,
            all => out.push(Op::CompositeConstruct, self.id, ids(all)),
        }
    }
}

fn passed(out: &mut Writer, shapes: Vec<Shape>, groups: &[Group], mut names: &[&str]) -> Vec<Passed> {
    let mut all = Vec::with_capacity(shapes.len());
    for (shape, group) in shapes.into_iter().zip(groups) {
        let (own, rest) = names.split_at_checked(group.scalars).unwrap_or((names, &[]));
        all.push(one(out, shape, &group.name, own));
        names = rest;
    }
    all
}

fn one(out: &mut Writer, shape: Shape, group: &str, names: &[&str]) -> Passed {
    match shape {
        Shape::Scalar(scalar) => Passed { id: out.kind(scalar.into()), scalars: vec![scalar] },
        Shape::Vector(scalar, count) => {
            let kind = out.kind(scalar.into());
            let id = out.shared(Op::TypeVector, None, vec![Operand::IdRef(kind), Operand::LiteralBit32(count)]);
            Passed { id, scalars: names.iter().map(|_| scalar).collect() }
        }
        Shape::Array(scalar, count) => {
            let (kind, count) = (out.kind(scalar.into()), out.uint(count));
            let id = out.shared(Op::TypeArray, None, ids(&[kind, count]));
            Passed { id, scalars: names.iter().map(|_| scalar).collect() }
        }
        Shape::Struct(scalars) => {
            let members: Vec<Word> = scalars.iter().map(|scalar| out.kind((*scalar).into())).collect();
            let id = out.global(Op::TypeStruct, None, ids(&members));
            for (member, name) in (0..).zip(names) {
                // `at.x` is the `x` of `at`.
                let own = name.strip_prefix(group).and_then(|rest| rest.strip_prefix('.')).unwrap_or(name);
                out.name_member(id, member, own);
            }
            Passed { id, scalars }
        }
    }
}
