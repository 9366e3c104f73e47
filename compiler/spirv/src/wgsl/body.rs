//! The statements of a function: one `let` for each value, `if` for branches, `for` for loops. Knows the nodes of a graph;
//! knows nothing of where inputs come from and where outputs go.
//!
//! Values stand in statements of their own because some compilers fuse what stands in one expression only, and because
//! naga and others call themselves for each operand of an operand.
//!
//! Everything that is a constant expression in WGSL is computed by its compilers, which refuse infinities, NaN and
//! overflow in it. So those numbers are made of the bits of a variable, and of an operation on constants alone the first
//! operand is given a name, which makes it a value of run time.

use std::fmt::{Arguments, Write};

use isograd_graph::{Args, Node, NodeId, Op, PerNode};

use rustc_hash::{FxHashMap, FxHashSet};

use super::names::Names;
use super::rounding::barriers;
use super::text::{barrier, expression, function, is_long, real, type_name};
use crate::{EmitError, Lack, Language, Plan};

/// Bytes of variables that every implementation of WGSL lets a function have.
const VARIABLE_BYTES: u32 = 8192;

/// Reals that are no constants of WGSL: what they are called, and the bits of each.
const SPECIAL: [(&str, u32); 3] =
    [("infinity", 0x7f80_0000), ("minus_infinity", 0xff80_0000), ("not_a_number", 0x7fc0_0000)];

/// Which of [`SPECIAL`] a real is.
fn special(x: f64) -> Option<usize> {
    if x.is_nan() {
        Some(2)
    } else if x.is_infinite() {
        Some(usize::from(x < 0.0))
    } else {
        None
    }
}

/// A side of a branch that is being written.
struct Side {
    /// Where its first mark begins.
    start: usize,
    /// Where its statements begin.
    inside: usize,
    /// Whether nothing of the branch stands before it.
    whole: bool,
    cond: String,
}

/// A function that is being written.
pub struct Body<'p, 'g> {
    plan: &'p Plan<'g>,
    /// The names that are taken here and in the module.
    pub names: Names,
    /// What functions of operations begin with.
    prefix: String,
    /// What each value is called; for a loop its counter.
    texts: PerNode<String>,
    /// The outputs that have no name here yet.
    outputs: FxHashMap<NodeId, String>,
    /// The names of [`SPECIAL`].
    specials: [String; 3],
    /// Which results are rounded at a barrier.
    barriers: PerNode<bool>,
    /// The name of the function that is the barrier, if one is called.
    barrier: Option<String>,
    /// Functions of operations that are called: their names.
    called: Vec<Option<String>>,
    /// The texts of all of these.
    pub functions: Vec<String>,
    /// The statements.
    pub out: String,
    depth: usize,
    sides: Vec<Side>,
    /// Bytes of variables so far.
    bytes: u32,
}

impl<'p, 'g> Body<'p, 'g> {
    /// An empty one, with a wish for the name of each output. Functions of operations get the prefix.
    pub fn new(plan: &'p Plan<'g>, names: Names, prefix: String, outputs: impl IntoIterator<Item = String>) -> Self {
        let mut wishes = FxHashMap::default();
        for (output, wish) in plan.graph.outputs.iter().zip(outputs) {
            wishes.entry(output.node).or_insert(wish);
        }
        Self {
            plan,
            names,
            prefix,
            texts: PerNode::new(plan.graph, String::new()),
            outputs: wishes,
            specials: Default::default(),
            barriers: barriers(plan.graph, &plan.structure),
            barrier: None,
            called: vec![None; Op::ALL.len()],
            functions: Vec::new(),
            out: String::with_capacity(plan.graph.len() * 40),
            depth: 1,
            sides: Vec::new(),
            bytes: 0,
        }
    }

    /// What a value is called.
    pub fn text(&self, id: NodeId) -> &str {
        &self.texts[id]
    }

    /// Writes a line.
    pub fn line(&mut self, line: Arguments<'_>) {
        for _ in 0..self.depth {
            self.out.push_str("    ");
        }
        // Writing to a string cannot fail.
        let _ = self.out.write_fmt(line);
        self.out.push('\n');
    }

    /// Writes the statements of all nodes. `input` gives an input of the graph a text, and may write lines for it;
    /// `named_outputs` says whether outputs that are infinite or NaN are asked for by [`Self::text`].
    pub fn nodes(
        &mut self,
        named_outputs: bool,
        mut input: impl FnMut(&mut Self, usize) -> String,
    ) -> Result<(), EmitError> {
        self.specials(named_outputs)?;
        self.tapes()?;
        self.constants();
        let plan = self.plan;
        for (id, node) in plan.graph.iter().filter(|(id, _)| plan.structure.needed[*id]) {
            let text = match node {
                Node::Input(index) => input(self, index as usize),
                Node::Apply(op, args) => self.apply(id, op, args)?,
                Node::Gamma { cond, end, .. } => {
                    self.gamma(cond, end)?;
                    continue;
                }
                Node::Else { gamma } => {
                    self.otherwise(gamma);
                    continue;
                }
                Node::Theta { lo, hi, .. } => self.theta(id, lo, hi)?,
                Node::Counter { theta } => self.texts[theta].clone(),
                Node::End { begin } => {
                    self.end(id, begin);
                    continue;
                }
                Node::Join { end, then, otherwise } => self.join(id, end, then, otherwise),
                Node::Final { carried, .. } => self.texts[carried].clone(),
                Node::Recall { tape, at } => self.recall(id, tape, at),
                // Loops name their carried variables, tapes and constants have their texts, and a plan has none of the rest.
                Node::Carried { .. } | Node::Tape { .. } => continue,
                Node::Real(_) | Node::Int(_) | Node::Bool(_) => continue,
                Node::Fresh(_) | Node::Diff { .. } | Node::Within { .. } | Node::Bound { .. } => continue,
            };
            self.texts[id] = text;
        }
        Ok(())
    }

    /// Counts a variable.
    fn variable(&mut self, elements: u32, node: NodeId) -> Result<(), EmitError> {
        self.bytes = self.bytes.saturating_add(elements.saturating_mul(4));
        if self.bytes <= VARIABLE_BYTES {
            return Ok(());
        }
        let lack = Lack::Variables { most: VARIABLE_BYTES };
        Err(EmitError::Unsupported { target: Language::Wgsl, lack, node: Some(node) })
    }

    /// Declares the infinities and NaN if they are operands.
    fn specials(&mut self, named_outputs: bool) -> Result<(), EmitError> {
        let graph = self.plan.graph;
        let mut used = [NodeId::NONE; 3];
        let mut use_of = |id: NodeId| {
            if let Some(Node::Real(bits)) = graph.get(id)
                && let Some(used) = special(f64::from_bits(bits)).and_then(|k| used.get_mut(k))
            {
                *used = id;
            }
        };
        for (_, node) in graph.iter().filter(|(id, _)| self.plan.structure.needed[*id]) {
            node.each_operand(&mut use_of);
        }
        if named_outputs {
            graph.outputs.iter().for_each(|output| use_of(output.node));
        }
        for (k, ((wish, bits), node)) in SPECIAL.iter().zip(used).enumerate() {
            if node == NodeId::NONE {
                continue;
            }
            self.variable(1, node)?;
            let name = self.names.take(wish);
            let variable = self.names.claim(format!("{name}_bits"));
            self.line(format_args!("var {variable} = {bits:#x}u;"));
            self.line(format_args!("let {name} = bitcast<f32>({variable});"));
            if let Some(place) = self.specials.get_mut(k) {
                *place = name;
            }
        }
        Ok(())
    }

    /// Declares the tapes: at the beginning, as a variable is set to 0 each time that its declaration is reached.
    fn tapes(&mut self) -> Result<(), EmitError> {
        let plan = self.plan;
        for (id, node) in plan.graph.iter().filter(|(id, _)| plan.structure.needed[*id]) {
            if let Node::Tape { value, .. } = node {
                self.variable(plan.tapes[id], id)?;
                let name = self.names.take("tape");
                let element = type_name(plan.graph.scalar(value));
                self.line(format_args!("var {name}: array<{element}, {}>;", plan.tapes[id]));
                self.texts[id] = name;
            }
        }
        Ok(())
    }

    /// Writes the constants. A join may be named one that comes after its branch.
    fn constants(&mut self) {
        let plan = self.plan;
        for (id, node) in plan.graph.iter().filter(|(id, _)| plan.structure.needed[*id]) {
            self.texts[id] = match node {
                Node::Real(bits) => {
                    let x = f64::from_bits(bits);
                    special(x).and_then(|k| self.specials.get(k).cloned()).unwrap_or_else(|| real(x))
                }
                Node::Int(n) => n.to_string(),
                Node::Bool(b) => b.to_string(),
                _ => continue,
            };
        }
    }

    /// A name for a value: that of the output that it is.
    fn name(&mut self, id: NodeId) -> String {
        match self.outputs.remove(&id) {
            Some(name) => self.names.take(&name),
            None => self.names.local(),
        }
    }

    /// Names a value.
    fn value(&mut self, id: NodeId, value: Arguments<'_>) -> String {
        let name = self.name(id);
        self.line(format_args!("let {name} = {value};"));
        name
    }

    fn apply(&mut self, id: NodeId, op: Op, args: Args) -> Result<String, EmitError> {
        let args = args.as_slice();
        let all_constant = args.iter().all(|x| self.plan.graph[*x].is_constant());
        let first = match args {
            [first, ..] if all_constant => {
                let text = self.texts[*first].clone();
                Some(self.value(NodeId::NONE, format_args!("{text}")))
            }
            _ => None,
        };
        let mut operands: Vec<&str> = args.iter().map(|x| self.texts[*x].as_str()).collect();
        if let (Some(name), Some(place)) = (&first, operands.first_mut()) {
            *place = name;
        }
        let text = if is_long(op)? {
            let operands = operands.join(", ");
            let name = self.function(op)?;
            format!("{name}({operands})")
        } else {
            expression(op, &operands)?
        };
        if self.barriers[id] {
            let barrier = self.barrier();
            return Ok(self.value(id, format_args!("{barrier}({text})")));
        }
        Ok(self.value(id, format_args!("{text}")))
    }

    /// The name of a function of the module.
    fn helper(&mut self, wish: &str) -> String {
        if self.prefix.is_empty() { self.names.take(wish) } else { self.names.claim(format!("{}{wish}", self.prefix)) }
    }

    /// The barrier.
    fn barrier(&mut self) -> String {
        if let Some(name) = &self.barrier {
            return name.clone();
        }
        let name = self.helper("rounded");
        self.functions.push(barrier(&name));
        self.barrier = Some(name.clone());
        name
    }

    /// The function of an operation.
    fn function(&mut self, op: Op) -> Result<String, EmitError> {
        if let Some(Some(name)) = self.called.get(op as usize) {
            return Ok(name.clone());
        }
        let name = self.helper(op.def().name);
        self.functions.push(function(op, &name)?);
        let Some(place) = self.called.get_mut(op as usize) else { return Err(EmitError::Program(op)) };
        *place = Some(name.clone());
        Ok(name)
    }

    fn joins(&self, end: NodeId) -> impl Iterator<Item = (NodeId, NodeId, NodeId)> + use<'p, 'g> {
        let plan = self.plan;
        plan.structure.joins.get(&end).into_iter().flatten().filter_map(|join| match plan.graph[*join] {
            Node::Join { then, otherwise, .. } => Some((*join, then, otherwise)),
            _ => None,
        })
    }

    /// Opens a branch. A join is a variable that its sides set; one that a side does not set, because what it would be is
    /// computed only later, is selected then.
    fn gamma(&mut self, cond: NodeId, end: NodeId) -> Result<(), EmitError> {
        let graph = self.plan.graph;
        for (join, then, otherwise) in self.joins(end) {
            if !(graph.is_late(end, then) && graph.is_late(end, otherwise)) {
                self.variable(1, join)?;
                let late = graph.is_late(end, then) || graph.is_late(end, otherwise);
                let name = self.name(if late { NodeId::NONE } else { join });
                self.line(format_args!("var {name}: {};", type_name(graph.scalar(join))));
                self.texts[join] = name;
            }
        }
        let start = self.out.len();
        let cond = self.texts[cond].clone();
        self.line(format_args!("if {cond} {{"));
        self.sides.push(Side { start, inside: self.out.len(), whole: true, cond });
        self.depth += 1;
        Ok(())
    }

    fn set(&mut self, join: NodeId, end: NodeId, value: NodeId) {
        if !self.plan.graph.is_late(end, value) {
            let (name, value) = (self.texts[join].clone(), self.texts[value].clone());
            self.line(format_args!("{name} = {value};"));
        }
    }

    fn otherwise(&mut self, gamma: NodeId) {
        let Node::Gamma { end, .. } = self.plan.graph[gamma] else { return };
        for (join, then, _) in self.joins(end) {
            self.set(join, end, then);
        }
        self.depth = self.depth.saturating_sub(1);
        let Some(Side { start, inside, cond, .. }) = self.sides.pop() else { return };
        let whole = self.out.len() == inside;
        if whole {
            self.out.truncate(start);
        }
        let start = self.out.len();
        if whole {
            self.line(format_args!("if !{cond} {{"));
        } else {
            self.line(format_args!("}} else {{"));
        }
        self.sides.push(Side { start, inside: self.out.len(), whole, cond });
        self.depth += 1;
    }

    fn end(&mut self, end: NodeId, begin: NodeId) {
        match self.plan.graph[begin] {
            Node::Theta { lo, .. } => self.iteration(begin, lo),
            _ => {
                for (join, _, otherwise) in self.joins(end) {
                    self.set(join, end, otherwise);
                }
                if let Some(side) = self.sides.pop()
                    && side.inside == self.out.len()
                {
                    self.out.truncate(side.start);
                    if side.whole {
                        self.depth = self.depth.saturating_sub(1);
                        return;
                    }
                }
            }
        }
        self.depth = self.depth.saturating_sub(1);
        self.line(format_args!("}}"));
    }

    fn join(&mut self, join: NodeId, end: NodeId, then: NodeId, otherwise: NodeId) -> String {
        let graph = self.plan.graph;
        let (late, late_otherwise) = (graph.is_late(end, then), graph.is_late(end, otherwise));
        if !(late || late_otherwise) {
            return self.texts[join].clone();
        }
        let Node::Gamma { cond, .. } = graph[graph.owner(end)] else { return String::new() };
        let text = |late, value| self.texts[if late { value } else { join }].as_str();
        let (otherwise, then) = (text(late_otherwise, otherwise).to_owned(), text(late, then).to_owned());
        let cond = self.texts[cond].clone();
        self.value(join, format_args!("select({otherwise}, {then}, {cond})"))
    }

    /// Opens a loop; its text is its counter.
    fn theta(&mut self, theta: NodeId, lo: NodeId, hi: NodeId) -> Result<String, EmitError> {
        let plan = self.plan;
        for variable in plan.structure.carried.get(&theta).into_iter().flatten() {
            let Node::Carried { init, .. } = plan.graph[*variable] else { continue };
            let changes = plan.structure.next[*variable] != *variable;
            let kind = if changes { "var" } else { "let" };
            if changes {
                self.variable(1, *variable)?;
            }
            let name = self.names.local();
            let (ty, init) = (type_name(plan.graph.scalar(*variable)), self.texts[init].clone());
            self.line(format_args!("{kind} {name}: {ty} = {init};"));
            self.texts[*variable] = name;
        }
        self.variable(1, theta)?;
        let counter = self.names.take("i");
        let (lo, hi) = (self.texts[lo].clone(), self.texts[hi].clone());
        self.line(format_args!("for (var {counter}: i32 = {lo}; {counter} < {hi}; {counter}++) {{"));
        self.depth += 1;
        Ok(counter)
    }

    /// Ends an iteration: writes the tapes, and gives the carried variables what it computed, all at once.
    fn iteration(&mut self, theta: NodeId, lo: NodeId) {
        let plan = self.plan;
        for tape in plan.structure.tapes.get(&theta).into_iter().flatten() {
            let Node::Tape { value, every, .. } = plan.graph[*tape] else { continue };
            let counter = &self.texts[theta];
            let number = match plan.graph[lo] {
                Node::Int(0) => counter.clone(),
                Node::Int(lo) if lo < 0 && lo != i32::MIN => format!("{counter} + {}", -lo),
                Node::Int(lo) => format!("{counter} - {lo}"),
                _ => continue,
            };
            // Entry ⌈k/n⌉ is written in iteration k, a number that may not fit an i32.
            let entry = match every {
                0 | 1 => number,
                _ => format!("(u32({number}) + {}u) / {every}u", every - 1),
            };
            let (name, value) = (self.texts[*tape].clone(), self.texts[value].clone());
            self.line(format_args!("{name}[{entry}] = {value};"));
        }
        let mut pairs = Vec::new();
        let mut set = FxHashSet::default();
        for variable in plan.structure.carried.get(&theta).into_iter().flatten() {
            let next = plan.structure.next[*variable];
            if next == *variable {
                continue;
            }
            let mut value = self.texts[next].clone();
            // By then the other variable would have changed.
            if set.contains(&next) {
                value = self.value(NodeId::NONE, format_args!("{value}"));
            }
            set.insert(*variable);
            pairs.push((self.texts[*variable].clone(), value));
        }
        for (name, value) in pairs {
            self.line(format_args!("{name} = {value};"));
        }
    }

    fn recall(&mut self, id: NodeId, tape: NodeId, at: NodeId) -> String {
        let entry = match self.plan.graph[at] {
            // A constant that is not on the tape would be refused.
            Node::Int(n) if u32::try_from(n).map_or(true, |n| n >= self.plan.tapes[tape]) => "0".to_owned(),
            _ => self.texts[at].clone(),
        };
        let name = self.texts[tape].clone();
        self.value(id, format_args!("{name}[{entry}]"))
    }

    /// The bits that an output has in a buffer, for a constant.
    pub fn constant_bits(&self, id: NodeId) -> Option<u32> {
        match self.plan.graph[id] {
            #[expect(clippy::cast_possible_truncation, reason = "graphs of f32 hold f32")]
            Node::Real(bits) => {
                let x = f64::from_bits(bits) as f32;
                Some(if x.is_nan() { u32::MAX } else { x.to_bits() })
            }
            Node::Int(n) => Some(n.cast_unsigned()),
            Node::Bool(b) => Some(u32::from(b)),
            _ => None,
        }
    }
}
