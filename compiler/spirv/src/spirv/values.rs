//! The nodes of a graph as instructions, one after the other. Knows what a node is in SPIR-V; where inputs come from and
//! where outputs go it does not know.

use isograd_graph::{Args, Node, NodeId, Op, PerNode, Scalar};
use rspirv::spirv::{self, Decoration, Word};

use super::module::Writer;
use super::regions::Frame;
use crate::program::{Gives, Instruction, Kind, Spirv, Step, program};
use crate::{EmitError, Plan};

/// Writes the nodes of a graph.
pub struct Body<'p, 'g> {
    pub plan: &'p Plan<'g>,
    pub out: &'p mut Writer,
    /// What each node is; 0 for what is not written yet.
    pub values: PerNode<Word>,
    /// The variable of each tape that is needed.
    pub tapes: PerNode<Word>,
    /// The open branches and loops.
    pub frames: Vec<Frame>,
    /// What the instructions of an operation have computed.
    stack: Vec<(Word, Kind)>,
}

impl<'p, 'g> Body<'p, 'g> {
    /// Writes all nodes that outputs depend on. The inputs are given: unneeded ones are 0.
    pub fn write(plan: &'p Plan<'g>, out: &'p mut Writer, inputs: &[Word]) -> Result<Self, EmitError> {
        let mut this = Self {
            plan,
            out,
            values: PerNode::new(plan.graph, 0),
            tapes: PerNode::new(plan.graph, 0),
            frames: Vec::new(),
            stack: Vec::new(),
        };
        this.declare_tapes();
        for (id, node) in plan.graph.iter().filter(|(id, _)| plan.structure.needed[*id]) {
            this.node(id, node, inputs)?;
        }
        Ok(this)
    }

    fn node(&mut self, id: NodeId, node: Node, inputs: &[Word]) -> Result<(), EmitError> {
        match node {
            Node::Input(index) => self.values[id] = inputs.get(index as usize).copied().unwrap_or_default(),
            Node::Apply(op, args) => self.values[id] = self.apply(op, args)?,
            Node::Gamma { cond, .. } => self.gamma(cond),
            Node::Else { .. } => self.otherwise(),
            Node::Theta { lo, hi, .. } => self.theta(id, lo, hi),
            Node::End { begin } => match self.plan.graph[begin] {
                Node::Theta { lo, .. } => self.end_theta(begin, lo),
                _ => self.end_gamma(begin, id),
            },
            // The phi of a counter is what its loop is.
            Node::Counter { theta } => self.values[id] = self.values[theta],
            Node::Join { end, then, otherwise } => self.late_join(id, end, then, otherwise),
            Node::Final { carried, .. } => self.values[id] = self.values[carried],
            Node::Recall { tape, at } => self.recall(id, tape, at),
            // Constants are written where they are used, carried variables where their loop begins, tapes where the
            // iterations of their loops end; the rest never reaches an emitter.
            _ => {}
        }
        Ok(())
    }

    /// The value of a node that has been written, or of a constant.
    pub fn value(&mut self, id: NodeId) -> Word {
        if self.values[id] == 0 {
            self.values[id] = match self.plan.graph[id] {
                Node::Real(bits) => self.out.real(f64::from_bits(bits)),
                Node::Int(x) => self.out.int(x),
                Node::Bool(x) => self.out.truth(x),
                _ => 0,
            };
        }
        self.values[id]
    }

    /// The kind of a node.
    pub fn kind(&self, id: NodeId) -> Kind {
        self.plan.graph.scalar(id).into()
    }

    /// A value of a kind that does not matter.
    pub fn any(&mut self, scalar: Scalar) -> Word {
        match scalar {
            Scalar::Real => self.out.real(0.0),
            Scalar::Int => self.out.int(0),
            Scalar::Bool => self.out.truth(false),
        }
    }

    fn apply(&mut self, op: Op, args: Args) -> Result<Word, EmitError> {
        let malformed = EmitError::Program(op);
        let Some(steps) = program(op, self.out.precision) else { return Err(malformed) };
        self.stack.clear();
        for step in steps {
            let pushed = match step {
                Step::Operand(index) => {
                    let Some(operand) = args.as_slice().get(*index) else { return Err(malformed) };
                    (self.value(*operand), self.kind(*operand))
                }
                Step::Int(x) => (self.out.int(*x), Kind::Int),
                Step::Wide(x) => (self.out.wide(*x), Kind::Wide),
                Step::Real(x) => (self.out.real(*x), Kind::Real),
                Step::Do(instruction) => match self.instruction(instruction) {
                    Some(result) => result,
                    None => return Err(malformed),
                },
            };
            self.stack.push(pushed);
        }
        match self.stack.as_slice() {
            [(result, _)] => Ok(*result),
            _ => Err(malformed),
        }
    }

    /// Takes the operands of an instruction from the stack and writes it; `None` if they are not there.
    fn instruction(&mut self, instruction: &Instruction) -> Option<(Word, Kind)> {
        let from = self.stack.len().checked_sub(instruction.operands)?;
        let taken = self.stack.get(from..)?;
        let kind = match instruction.result {
            Gives::Is(kind) => kind,
            Gives::First => taken.first()?.1,
            Gives::Last => taken.last()?.1,
        };
        let mut operands = [0; 4];
        for (place, (operand, _)) in operands.iter_mut().zip(taken) {
            *place = *operand;
        }
        let operands = operands.get(..instruction.operands)?;
        self.stack.truncate(from);
        let result = match instruction.spirv {
            Spirv::Op(code) => self.out.compute(code, kind, operands),
            Spirv::Ext(code) => {
                let kind = self.out.kind(kind);
                self.out.extended(code, kind, operands)
            }
            Spirv::Resize(code) if self.out.is_wide() => self.out.compute(code, kind, operands),
            Spirv::Resize(_) => *operands.first()?,
        };
        if instruction.exact {
            self.out.decorate(result, Decoration::NoContraction, vec![]);
        }
        Some((result, kind))
    }

    /// `chosen` if the condition holds, else `other`.
    pub fn select(&mut self, kind: Kind, cond: Word, chosen: Word, other: Word) -> Word {
        self.out.compute(spirv::Op::Select, kind, &[cond, chosen, other])
    }
}
