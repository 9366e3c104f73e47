//! All decisions about a shader before its text is written: what a host binds or passes, and whether the target can do
//! it. Knows limits and places; knows nothing of instructions.

use isograd_graph::ops::Family;
use isograd_graph::{Node, NodeId, PerNode, Precision, Scalar, Structure, Verified, Work};

use crate::{EmitError, Form, Lack, Language, TAPE_BYTES};

/// A function as its callers see it. Each group of scalars is one value, whose shape is that of [`Shape::of`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Signature {
    /// Its name.
    pub name: String,
    /// The parameters: groups of the inputs of the graph, in order.
    pub parameters: Vec<Group>,
    /// The results: groups of the outputs of the graph, in order. One is returned as it is, several as the members of a
    /// struct.
    pub results: Vec<Group>,
}

/// Neighbouring inputs or outputs that are one value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// Its name.
    pub name: String,
    /// How many scalars it has, at least one.
    pub scalars: usize,
}

/// The shape of a value of a function.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Shape {
    /// One scalar.
    Scalar(Scalar),
    /// Two to four scalars of one kind.
    Vector(Scalar, u32),
    /// More scalars of one kind.
    Array(Scalar, u32),
    /// Scalars of several kinds.
    Struct(Vec<Scalar>),
}

impl Shape {
    /// The shape of a value with these scalars.
    #[must_use]
    pub fn of(scalars: &[Scalar]) -> Self {
        let count = u32::try_from(scalars.len()).unwrap_or(u32::MAX);
        match scalars {
            [one] => Self::Scalar(*one),
            [first, rest @ ..] if rest.iter().all(|s| s == first) => match count {
                2..=4 => Self::Vector(*first, count),
                _ => Self::Array(*first, count),
            },
            _ => Self::Struct(scalars.to_vec()),
        }
    }
}

/// Where a host finds the columns of a kernel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// What reals are.
    pub precision: Precision,
    /// One per input of the graph.
    pub inputs: Vec<Slot>,
    /// One per output of the graph; all varying.
    pub outputs: Vec<Slot>,
    /// Bytes of tapes per invocation.
    pub tapes: u32,
}

/// A column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slot {
    /// What it holds.
    pub scalar: Scalar,
    /// Whether there is an element for each point: then it is among the varying inputs or the outputs.
    pub varying: bool,
    /// Its number among those of its binding.
    pub column: u32,
}

/// The decisions.
pub struct Plan<'g> {
    pub(crate) graph: &'g Verified,
    pub(crate) form: Form<'g>,
    pub(crate) structure: Structure,
    /// How many entries each needed tape has.
    pub(crate) tapes: PerNode<u32>,
    layout: Layout,
    /// The deepest nest of branches and loops, and a node in it.
    depth: (u32, NodeId),
}

impl<'g> Plan<'g> {
    /// Plans a shader.
    ///
    /// # Errors
    /// If the graph is not ready for emission, the form does not fit it, or no target could keep its tapes.
    pub fn new(graph: &'g Verified, form: Form<'g>) -> Result<Self, EmitError> {
        let precision = graph.precision.ok_or(EmitError::Options { what: "the graph has no precision" })?;
        fits(graph, &form)?;
        let structure = Structure::new(graph, Family::Shader)?;
        let mut tapes = PerNode::new(graph, 0);
        let mut bytes = 0_u64;
        let mut largest = (0, None);
        for (id, node) in graph.iter().filter(|(id, _)| structure.needed[*id]) {
            let Node::Tape { end, every, .. } = node else { continue };
            let length = graph.tape_length(end, every).ok_or(EmitError::Tape(id))?;
            tapes[id] = length;
            let size = u64::from(length) * u64::from(element(graph.scalar(id), precision));
            bytes += size;
            if size >= largest.0 {
                largest = (size, Some(id));
            }
        }
        let tape_bytes = u32::try_from(bytes).ok().filter(|bytes| *bytes <= TAPE_BYTES);
        let Some(tape_bytes) = tape_bytes else {
            return Err(EmitError::Unsupported {
                target: Language::Spirv,
                lack: Lack::Tapes { bytes },
                node: largest.1,
            });
        };
        let layout = layout(graph, &form, precision, tape_bytes);
        let depth = depth(graph, &structure);
        Ok(Self { graph, form, structure, tapes, layout, depth })
    }

    /// Where a host finds the columns of a kernel. In a library the columns are numbered through.
    #[must_use]
    pub const fn layout(&self) -> &Layout {
        &self.layout
    }

    /// What the work of a point is.
    #[must_use]
    pub const fn work(&self) -> Work {
        self.structure.work
    }

    /// Refuses what nests deeper than a target allows.
    pub(crate) const fn nests_within(&self, target: Language, most: u32) -> Result<(), EmitError> {
        let (depth, node) = self.depth;
        if depth <= most {
            return Ok(());
        }
        Err(EmitError::Unsupported { target, lack: Lack::Nesting { depth, most }, node: Some(node) })
    }

    /// The scalars of the groups of inputs and of outputs of a library.
    pub(crate) fn shapes(&self, signature: &Signature) -> (Vec<Shape>, Vec<Shape>) {
        let inputs: Vec<Scalar> = self.graph.inputs.iter().map(|i| i.scalar).collect();
        let outputs: Vec<Scalar> = self.graph.outputs.iter().map(|o| self.graph.scalar(o.node)).collect();
        (shapes(&inputs, &signature.parameters), shapes(&outputs, &signature.results))
    }
}

fn shapes(mut scalars: &[Scalar], groups: &[Group]) -> Vec<Shape> {
    let mut shapes = Vec::with_capacity(groups.len());
    for group in groups {
        let (own, rest) = scalars.split_at_checked(group.scalars).unwrap_or((scalars, &[]));
        shapes.push(Shape::of(own));
        scalars = rest;
    }
    shapes
}

/// Bytes of an element of a tape; truth values are kept as ints.
const fn element(scalar: Scalar, precision: Precision) -> u32 {
    match scalar {
        Scalar::Real => precision.bytes(),
        Scalar::Int | Scalar::Bool => 4,
    }
}

fn fits(graph: &Verified, form: &Form<'_>) -> Result<(), EmitError> {
    match form {
        Form::Kernel { varying } if varying.len() != graph.inputs.len() => {
            Err(EmitError::Options { what: "a rate must be given for each input of the graph" })
        }
        Form::Library(signature) => {
            let sum = |groups: &[Group]| groups.iter().map(|g| g.scalars).sum::<usize>();
            let empty = signature.parameters.iter().chain(&signature.results).any(|g| g.scalars == 0);
            if empty
                || sum(&signature.parameters) != graph.inputs.len()
                || sum(&signature.results) != graph.outputs.len()
            {
                return Err(EmitError::Options { what: "the signature does not have the scalars of the graph" });
            }
            Ok(())
        }
        Form::Kernel { .. } => Ok(()),
    }
}

fn layout(graph: &Verified, form: &Form<'_>, precision: Precision, tapes: u32) -> Layout {
    let all;
    let varying = match form {
        Form::Kernel { varying } => *varying,
        Form::Library(_) => {
            all = vec![true; graph.inputs.len()];
            &all
        }
    };
    let mut next = [0_u32; 2];
    let mut input = |(input, varying): (&isograd_graph::Input, &bool)| {
        let [once, each] = &mut next;
        let next = if *varying { each } else { once };
        let column = *next;
        *next += 1;
        Slot { scalar: input.scalar, varying: *varying, column }
    };
    let inputs = graph.inputs.iter().zip(varying).map(&mut input).collect();
    let output = |(column, output): (u32, &isograd_graph::Output)| Slot {
        scalar: graph.scalar(output.node),
        varying: true,
        column,
    };
    let outputs = (0..).zip(&graph.outputs).map(output).collect();
    Layout { precision, inputs, outputs, tapes }
}

fn depth(graph: &Verified, structure: &Structure) -> (u32, NodeId) {
    let mut depth = 0_u32;
    let mut deepest = (0, NodeId::NONE);
    for (id, node) in graph.iter().filter(|(id, _)| structure.needed[*id]) {
        match node {
            Node::Gamma { .. } | Node::Theta { .. } => {
                depth += 1;
                if depth > deepest.0 {
                    deepest = (depth, id);
                }
            }
            Node::End { .. } => depth = depth.saturating_sub(1),
            _ => {}
        }
    }
    deepest
}
