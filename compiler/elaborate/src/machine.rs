//! The machine that runs a program's stack code with graph nodes for numbers. Bodies, branches, loops and evals lie
//! on a stack of their own, never on the host's. What a construct means is in the files beside this one.

use isograd_graph::{Exhausted, NodeId, Op, Precision, Scalar, Watch};
use isograd_program::typed::{Code, Constant, FunctionId, ImplId, Instruction, Slot};
use isograd_program::{Program, ScalarKind};
use isograd_syntax::{Code as DiagnosticCode, Diagnostic, Limits, Span};
use rustc_hash::FxHashMap;

use crate::Elaborated;
use crate::branches::Control;
use crate::builtins::Builtins as _;
use crate::code::{Jumps, jumps};
use crate::csg::{CsgNode, Forest, LinkId};
use crate::eval::{ChoiceState, Key};
use crate::intervals::{is_enclosed, with_flags, without_flags};
use crate::messages::too_large;
use crate::nodes::Nodes;
use crate::operators::Operators as _;
use crate::value::{Scalars, Value};

/// Elaboration stops; why is in the machine's diagnostics.
#[derive(Debug)]
pub(crate) struct Stop;

pub(crate) type Flow<T = ()> = Result<T, Stop>;

/// A body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Body {
    Function(FunctionId),
    Impl(ImplId),
}

/// A body being run.
pub(crate) struct Frame<'p> {
    pub(crate) body: Body,
    code: &'p Code,
    jumps: Jumps,
    pc: usize,
    /// Height of the value stack below this body's values.
    base: usize,
    pub(crate) slots: Vec<Value>,
    /// Branches, loops and blocks that are open.
    pub(crate) controls: Vec<Control<'p>>,
    /// Where it was called or evaluated.
    pub(crate) site: Span,
    /// What built the nodes that this body builds.
    pub(crate) link: Option<LinkId>,
    /// Under what to remember the result, and the number of novelties when the body began.
    remember: Option<(Key, u64)>,
}

/// Something being run.
pub(crate) enum Activity<'p> {
    Frame(Frame<'p>),
    Choice(ChoiceState),
}

pub(crate) struct Machine<'p, 'w> {
    pub(crate) program: &'p Program,
    pub(crate) limits: &'p Limits,
    watch: &'w dyn Watch,
    pub(crate) nodes: Nodes<'w>,
    pub(crate) forest: Forest,
    stack: Vec<Value>,
    pub(crate) activities: Vec<Activity<'p>>,
    /// Results by the scope they were made in.
    pub(crate) memory: FxHashMap<(u32, Key), Value>,
    jumps: FxHashMap<Body, Jumps>,
    /// Names of the graph's loop variables, for messages.
    pub(crate) loop_names: FxHashMap<NodeId, &'p str>,
    /// Calls, impls, branches and loops that are open.
    pub(crate) nesting: u64,
    pub(crate) unrolled: u64,
    steps: u64,
    pub(crate) diagnostics: Vec<Diagnostic>,
    pub(crate) warnings: Vec<Diagnostic>,
    /// Every `diff` so far, with its results.
    diffs: Vec<(Span, Vec<NodeId>)>,
}

/// Runs an export.
pub(crate) fn run(
    program: &Program,
    export: FunctionId,
    limits: &Limits,
    watch: &dyn Watch,
) -> Result<Elaborated, Vec<Diagnostic>> {
    let Some(function) = program.functions.get(export.0 as usize) else {
        return Err(vec![Diagnostic::global(DiagnosticCode::E1102, "there is no such export")]);
    };
    let mut machine = Machine::new(program, limits, watch, function.span);
    if machine.export(export).is_err() || !machine.diagnostics.is_empty() {
        return Err(machine.diagnostics);
    }
    let Machine { nodes, warnings, diffs, .. } = machine;
    match nodes.finish() {
        Ok((graph, origins, carried)) => Ok(Elaborated { graph, origins, carried, warnings, diffs }),
        Err(why) => Err(vec![too_large(why, function.span, limits)]),
    }
}

/// The value of a constant: its scalars in order (LANGUAGE 9.3, 17.3). `owner` is the export whose metadata it is.
pub(crate) fn constant(
    program: &Program,
    owner: FunctionId,
    constant: &Constant,
    limits: &Limits,
    watch: &dyn Watch,
) -> Result<Vec<isograd_graph::Value>, Vec<Diagnostic>> {
    let site = program.functions.get(owner.0 as usize).map_or(constant.span, |f| f.span);
    let mut machine = Machine::new(program, limits, watch, site);
    let values = machine.constant(owner, constant);
    match values {
        Ok(values) if machine.diagnostics.is_empty() => Ok(values),
        _ => Err(machine.diagnostics),
    }
}

impl<'p, 'w> Machine<'p, 'w> {
    /// A machine that has run nothing; what it makes first comes from `span`.
    fn new(program: &'p Program, limits: &'p Limits, watch: &'w dyn Watch, span: Span) -> Self {
        Self {
            program,
            limits,
            watch,
            nodes: Nodes::new(limits.graph_nodes, watch, span),
            forest: Forest::default(),
            stack: Vec::new(),
            activities: Vec::new(),
            memory: FxHashMap::default(),
            jumps: FxHashMap::default(),
            loop_names: FxHashMap::default(),
            nesting: 0,
            unrolled: 0,
            steps: 0,
            diagnostics: Vec::new(),
            warnings: Vec::new(),
            diffs: Vec::new(),
        }
    }

    /// Runs code without parameters, whose value is constant.
    fn constant(&mut self, owner: FunctionId, constant: &'p Constant) -> Flow<Vec<isograd_graph::Value>> {
        // Constants are computed in f64 (LANGUAGE 17.3), the ends of intervals too.
        self.nodes.intervals.compute_in(Precision::F64);
        self.enter(Body::Function(owner), &constant.code, Vec::new(), None, None)?;
        self.run()?;
        let result = without_flags(&constant.ty, &self.pop_scalars()?);
        let values: Option<Vec<_>> = result.iter().map(|x| self.nodes.value(*x)).collect();
        values.ok_or(()).map_err(|()| self.bug("constant without a value"))
    }

    /// Goes on until the body entered first is left.
    fn run(&mut self) -> Flow {
        while let Some(activity) = self.activities.last() {
            let in_frame = matches!(activity, Activity::Frame(_));
            self.poll()?;
            if in_frame { self.step()? } else { self.resume_choice()? }
        }
        Ok(())
    }

    /// Inputs, body, outputs.
    fn export(&mut self, id: FunctionId) -> Flow {
        let program = self.program;
        let Some(function) = program.functions.get(id.0 as usize) else { return Err(self.bug("no such function")) };
        let counts = [
            ("parameters", function.params.iter().map(|p| u64::from(p.ty.len())).sum::<u64>()),
            ("results", u64::from(function.result.len())),
        ];
        for (what, count) in counts {
            if count > self.limits.export_scalars {
                let name = &function.name;
                let limit = self.limits.export_scalars;
                let message = format!("`{name}` has {count} scalar {what}, more than the {limit} allowed");
                self.diagnostics.push(
                    Diagnostic::new(DiagnosticCode::E1010, function.span, message)
                        .help("split the export, or raise the limit `export_scalars`"),
                );
                return Err(Stop);
            }
        }
        let mut inputs = Vec::new();
        for param in &function.params {
            let columns = param.ty.columns(&param.name);
            let input = |(name, kind): (String, ScalarKind)| {
                let scalar = match kind {
                    ScalarKind::Real => Scalar::Real,
                    ScalarKind::Int => Scalar::Int,
                    ScalarKind::Bool => Scalar::Bool,
                };
                self.nodes.builder.input(name, scalar)
            };
            inputs.push(columns.into_iter().zip(param.ty.scalars()).map(input).collect::<Scalars>());
        }
        let no = self.nodes.bool(false);
        let args = function.params.iter().zip(&inputs);
        let args = args.map(|(param, input)| Value::Scalars(with_flags(&param.ty, input, no))).collect();
        self.enter(Body::Function(id), &function.code, args, None, None)?;
        self.run()?;
        let result = without_flags(&function.result, &self.pop_scalars()?);
        let columns = function.result.columns("value");
        if columns.len() != result.len() {
            return Err(self.bug("result of another shape than declared"));
        }
        for (name, node) in columns.into_iter().zip(result.iter()) {
            self.nodes.builder.output(name, *node);
        }
        self.poll()
    }

    /// Asks whether to go on. Nodes are counted by the builder, but a program can also waste time without making any.
    fn poll(&mut self) -> Flow {
        self.steps += 1;
        let expired = self.steps.is_multiple_of(4096) && self.watch.expired();
        match self.nodes.builder.exhausted() {
            Some(why) => Err(self.fail(too_large(why, self.nodes.here(), self.limits))),
            None if expired => Err(self.fail(too_large(Exhausted::Time, self.nodes.here(), self.limits))),
            None => Ok(()),
        }
    }

    /// Counts a call, impl, branch or loop that opens.
    pub(crate) fn deeper(&mut self) -> Flow {
        self.nesting += 1;
        let limit = self.limits.csg_depth;
        if self.nesting <= limit {
            return Ok(());
        }
        let message = format!("more than {limit} impls, calls, branches and loops inside each other");
        Err(self.fail(
            Diagnostic::new(DiagnosticCode::E1005, self.nodes.here(), message)
                .note(self.inside_each_other())
                .help("make the csg tree less deep, or raise the limit `csg_depth`"),
        ))
    }

    /// Counts one that closes.
    pub(crate) const fn shallower(&mut self) {
        self.nesting = self.nesting.saturating_sub(1);
    }

    /// Begins a body; its arguments become names (LANGUAGE 13.3.4).
    pub(crate) fn enter(
        &mut self,
        body: Body,
        code: &'p Code,
        args: Vec<Value>,
        link: Option<LinkId>,
        key: Option<Key>,
    ) -> Flow {
        let jumps = match self.jumps.get(&body) {
            Some(jumps) => jumps.clone(),
            None => {
                let Some(jumps) = jumps(code) else { return Err(self.bug("brackets that do not fit")) };
                self.jumps.insert(body, jumps.clone());
                jumps
            }
        };
        let remember = key.map(|key| (key, self.nodes.novelties()));
        let mut slots = Vec::with_capacity(code.slots.len());
        for arg in args {
            slots.push(match arg {
                Value::Scalars(scalars) => Value::Scalars(self.nodes.named(&scalars)),
                other => other,
            });
        }
        if slots.len() > code.slots.len() {
            return Err(self.bug("more arguments than slots"));
        }
        slots.resize(code.slots.len(), Value::Unset);
        let (site, base) = (self.nodes.here(), self.stack.len());
        let frame = Frame { body, code, jumps, pc: 0, base, slots, controls: Vec::new(), site, link, remember };
        self.activities.push(Activity::Frame(frame));
        Ok(())
    }

    /// The body being run.
    pub(crate) fn frame(&mut self) -> Flow<&mut Frame<'p>> {
        if !matches!(self.activities.last(), Some(Activity::Frame(_))) {
            return Err(self.bug("no body is running"));
        }
        match self.activities.last_mut() {
            Some(Activity::Frame(frame)) => Ok(frame),
            _ => Err(Stop),
        }
    }

    /// The content of a slot of the body being run.
    pub(crate) fn slot(&mut self, slot: Slot) -> Flow<Value> {
        match self.frame()?.slots.get(slot.0 as usize) {
            Some(Value::Unset) => Err(self.bug("slot read before it was written")),
            Some(value) => Ok(value.clone()),
            None => Err(self.bug("no such slot")),
        }
    }

    /// Changes the content of a slot of the body being run.
    pub(crate) fn set_slot(&mut self, slot: Slot, value: Value) -> Flow {
        match self.frame()?.slots.get_mut(slot.0 as usize) {
            Some(place) => {
                *place = value;
                Ok(())
            }
            None => Err(self.bug("no such slot")),
        }
    }

    /// The name of a slot of the body being run.
    pub(crate) fn slot_name(&mut self, slot: Slot) -> Flow<&'p str> {
        let code = self.frame()?.code;
        Ok(code.slots.get(slot.0 as usize).map_or("", |local| local.name.as_str()))
    }

    /// Whether a slot of the body being run holds csg.
    pub(crate) fn is_csg_slot(&mut self, slot: Slot) -> Flow<bool> {
        let code = self.frame()?.code;
        Ok(code.slots.get(slot.0 as usize).is_some_and(|local| local.ty == isograd_program::Type::Csg))
    }

    /// Where the bracket at this place or the one just run leads.
    pub(crate) fn target(&mut self, at: usize) -> Flow<usize> {
        match self.frame()?.jumps.get(at).copied().flatten() {
            Some(target) => Ok(target),
            None => Err(self.bug("bracket that leads nowhere")),
        }
    }

    /// The place of the instruction being run.
    pub(crate) fn place(&mut self) -> Flow<usize> {
        Ok(self.frame()?.pc.saturating_sub(1))
    }

    /// Goes on with the instruction at `pc`.
    pub(crate) fn jump(&mut self, pc: usize) -> Flow {
        self.frame()?.pc = pc;
        Ok(())
    }

    pub(crate) fn push(&mut self, value: Value) {
        self.stack.push(value);
    }

    pub(crate) fn push_scalars(&mut self, scalars: Scalars) {
        self.stack.push(Value::Scalars(scalars));
    }

    pub(crate) fn push_checked(&mut self, scalars: Option<Scalars>) -> Flow {
        match scalars {
            Some(scalars) => {
                self.push_scalars(scalars);
                Ok(())
            }
            None => Err(self.bug("operation with operands it is not defined for")),
        }
    }

    /// The value on top; never one of a body further out.
    pub(crate) fn pop(&mut self) -> Flow<Value> {
        let base = match self.activities.last() {
            Some(Activity::Frame(frame)) => frame.base,
            Some(Activity::Choice(_)) | None => 0,
        };
        if self.stack.len() > base
            && let Some(value) = self.stack.pop()
        {
            return Ok(value);
        }
        Err(self.bug("value missing on the stack"))
    }

    pub(crate) fn pop_scalars(&mut self) -> Flow<Scalars> {
        match self.pop()? {
            Value::Scalars(scalars) => Ok(scalars),
            Value::Csg(_) | Value::Unset => Err(self.bug("csg where a number is needed")),
        }
    }

    /// One scalar of this kind.
    pub(crate) fn pop_kind(&mut self, kind: Scalar) -> Flow<NodeId> {
        match *self.pop_scalars()? {
            [node] if self.nodes.builder.graph().scalar(node) == kind => Ok(node),
            _ => Err(self.bug("value of another kind than is needed")),
        }
    }

    /// The `n` values on top, the lowest first.
    fn pop_many(&mut self, n: usize) -> Flow<Vec<Value>> {
        let mut values = Vec::with_capacity(n.min(64));
        for _ in 0..n {
            values.push(self.pop()?);
        }
        values.reverse();
        Ok(values)
    }

    pub(crate) fn pop_many_scalars(&mut self, n: usize) -> Flow<Vec<Scalars>> {
        let mut values = Vec::with_capacity(n.min(64));
        for _ in 0..n {
            values.push(self.pop_scalars()?);
        }
        values.reverse();
        Ok(values)
    }

    /// Runs one instruction of the innermost body, or leaves it at its end.
    fn step(&mut self) -> Flow {
        let frame = self.frame()?;
        let Some((instruction, span)) = frame.code.instructions.get(frame.pc) else { return self.leave() };
        frame.pc += 1;
        self.nodes.stand(*span);
        match instruction {
            _ if is_enclosed(instruction) => self.interval(instruction)?,
            Instruction::Int(x) => {
                let node = self.nodes.int(*x);
                self.push_scalars(Scalars::one(node));
            }
            Instruction::Real(x) => {
                let node = self.nodes.real(*x);
                self.push_scalars(Scalars::one(node));
            }
            Instruction::Bool(x) => {
                let node = self.nodes.bool(*x);
                self.push_scalars(Scalars::one(node));
            }
            Instruction::Load(slot) => {
                let value = self.slot(*slot)?;
                self.push(value);
            }
            Instruction::Store(slot) => {
                let value = match self.pop()? {
                    Value::Scalars(scalars) => Value::Scalars(self.nodes.named(&scalars)),
                    other => other,
                };
                self.set_slot(*slot, value)?;
            }
            Instruction::Drop => {
                self.pop()?;
            }
            Instruction::Pack(n) => {
                let parts = self.pop_many_scalars(*n as usize)?;
                let size: usize = parts.iter().map(|p| p.len()).sum();
                // Tuples of tuples double their size with every line of source, without making a node.
                if size as u64 > self.limits.graph_nodes {
                    let limit = usize::try_from(self.limits.graph_nodes).unwrap_or(usize::MAX);
                    return Err(self.fail(too_large(Exhausted::Nodes(limit), *span, self.limits)));
                }
                self.push_scalars(parts.iter().flat_map(|p| p.iter().copied()).collect());
            }
            Instruction::Splat(n) => {
                let part = self.pop_scalars()?;
                self.push_scalars((0..*n).flat_map(|_| part.iter().copied()).collect());
            }
            Instruction::Pick { offset, length } => {
                let whole = self.pop_scalars()?;
                let (offset, length) = (*offset as usize, *length as usize);
                let part = whole.get(offset..offset.saturating_add(length)).map(|p| p.iter().copied().collect());
                self.push_checked(part)?;
            }
            Instruction::Cast { from, to } => {
                let value = self.pop_scalars()?;
                let value = self.nodes.cast(from, to, &value);
                self.push_checked(value)?;
            }
            Instruction::Neg(ty) => {
                let value = self.pop_scalars()?;
                let value = self.nodes.negative(ty, &value);
                self.push_scalars(value);
            }
            Instruction::Not => {
                let value = self.pop_kind(Scalar::Bool)?;
                let value = self.nodes.op(Op::Not, &[value]);
                self.push_scalars(Scalars::one(value));
            }
            Instruction::Binary { op, left, right } => {
                let (b, a) = (self.pop_scalars()?, self.pop_scalars()?);
                let value = self.nodes.binary(*op, (left, &a), (right, &b));
                self.push_checked(value)?;
            }
            Instruction::Builtin { builtin, args } => {
                let values = self.pop_many_scalars(args.len())?;
                let value = self.nodes.builtin(*builtin, args, &values);
                self.push_checked(value)?;
            }
            Instruction::Interval(_)
            | Instruction::PackIntervals(_)
            | Instruction::SplatInterval(_)
            | Instruction::End { .. }
            | Instruction::PickInterval { .. }
            | Instruction::MayBeNan
            | Instruction::Bound { .. } => self.interval(instruction)?,
            Instruction::Diff => self.diff()?,
            Instruction::Call(function) => self.call(*function)?,
            Instruction::Node { definition, subtrees } => self.build(*definition, *subtrees as usize, *span)?,
            Instruction::Eval { concept, live } => self.eval(*concept, *live)?,
            Instruction::If(branch) => self.begin_branch(branch)?,
            Instruction::Else => self.switch_branch()?,
            Instruction::EndIf => self.end_branch()?,
            Instruction::For(facts) => self.begin_loop(facts, *span)?,
            Instruction::EndFor => self.end_iteration()?,
            Instruction::Block { restores } => self.begin_block(restores)?,
            Instruction::EndBlock => self.end_block()?,
        }
        Ok(())
    }

    /// Leaves the innermost body, whose result is on the stack.
    fn leave(&mut self) -> Flow {
        let result = self.pop()?;
        let frame = self.frame()?;
        let (base, open) = (frame.base, frame.controls.len());
        let remember = frame.remember.take();
        if self.stack.len() != base || open > 0 {
            return Err(self.bug("body that leaves something behind"));
        }
        self.activities.pop();
        if !self.activities.is_empty() {
            self.shallower();
        }
        if let Some((key, novelties)) = remember
            && (matches!(key, Key::Eval { .. }) || novelties == self.nodes.novelties())
        {
            self.remember(key, &result);
        }
        self.push(result);
        Ok(())
    }

    /// The derivative, one scalar per pair: for each of `wrt`, for each of `e` (LANGUAGE 13.1).
    fn diff(&mut self) -> Flow {
        let (wrt, e) = (self.pop_scalars()?, self.pop_scalars()?);
        if !wrt.is_empty() && wrt.iter().all(|w| self.nodes.is_unnamed_constant(*w)) {
            self.warn(
                Diagnostic::new(
                    DiagnosticCode::W0701,
                    self.nodes.here(),
                    "derivative by an unnamed constant is always 0",
                )
                .help("bind the constant with `let` and differentiate by that name"),
            );
        }
        let mut result = Vec::with_capacity(wrt.len() * e.len());
        for w in wrt.iter() {
            for e in e.iter() {
                result.push(self.nodes.diff(*e, *w));
            }
        }
        self.diffs.push((self.nodes.here(), result.clone()));
        self.push_scalars(result.into_iter().collect());
        Ok(())
    }

    /// Calls a function: its body runs in place. The same call again in the same scope gives the same nodes, unless
    /// it made values of its own.
    fn call(&mut self, id: FunctionId) -> Flow {
        let program = self.program;
        let Some(function) = program.functions.get(id.0 as usize) else { return Err(self.bug("no such function")) };
        let args = self.pop_many(function.params.len())?;
        let link = self.frame()?.link;
        let key = Key::Call { function: id, link, args: args.clone() };
        let scope = self.nodes.builder.scopes().next().unwrap_or(0);
        if let Some(result) = self.memory.get(&(scope, key.clone())) {
            let result = result.clone();
            self.push(result);
            return Ok(());
        }
        self.deeper()?;
        self.enter(Body::Function(id), &function.code, args, link, Some(key))
    }

    /// Builds a csg node (LANGUAGE 11.3).
    fn build(&mut self, id: isograd_program::typed::DefinitionId, subtrees: usize, span: Span) -> Flow {
        let program = self.program;
        let Some(definition) = program.definitions.get(id.0 as usize) else { return Err(self.bug("no such node")) };
        let mut subs = Vec::with_capacity(subtrees.min(64));
        for sub in self.pop_many(subtrees)? {
            match sub {
                Value::Csg(tree) => subs.push(tree),
                Value::Scalars(_) | Value::Unset => return Err(self.bug("number where csg is needed")),
            }
        }
        let args = self.pop_many_scalars(definition.params.len())?;
        let args: Vec<Scalars> = args.iter().map(|a| self.nodes.named(a)).collect();
        let built_by = self.frame()?.link;
        let (tree, depth) = self.forest.node(CsgNode { definition: id, args, subs, built_by, span });
        let limit = self.limits.csg_depth;
        if depth > limit {
            let message = format!("csg tree with more than {limit} nodes on a path");
            return Err(self.fail(
                Diagnostic::new(DiagnosticCode::E1005, span, message)
                    .note(self.deepest_path(tree))
                    .help("build the tree less deep, or raise the limit `csg_depth`"),
            ));
        }
        if self.forest.len() > self.limits.graph_nodes {
            let limit = usize::try_from(self.limits.graph_nodes).unwrap_or(usize::MAX);
            return Err(self.fail(too_large(Exhausted::Nodes(limit), span, self.limits)));
        }
        self.push(Value::Csg(tree));
        Ok(())
    }
}
