//! Which evals can influence a body's value (LANGUAGE 12.4), and which writes end with a value block unread (6.5).
//! Looks at the flow of data through finished code, a branch counting as read with its condition; knows no types.

use isograd_syntax::{Code as Error, Diagnostic, Span};

use super::Report;
use crate::{
    Program, Type,
    typed::{Branch, Code, FunctionId, ImplId, Instruction, Loop, Slot},
};

/// A value of the flow: what it is made from is in [`Flow::sources`].
type Value = usize;

/// Per function: which of its parameters can influence its value; none is known of a function with errors.
type Influences = Vec<Vec<bool>>;

/// Marks the evals that cannot influence the value of their body as not live; reports W0601 and W0502. `order` are
/// the functions, callees first: a call passes on what its callee uses. Bodies with errors are left alone.
pub(super) fn mark(program: &mut Program, order: &[usize], report: &mut Report) {
    let mut influences = vec![Vec::new(); program.functions.len()];
    for index in order {
        let id = FunctionId(u32::try_from(*index).unwrap_or(u32::MAX));
        let Some(function) = program.functions.get_mut(*index).filter(|_| !program.unsound.functions.contains(&id))
        else {
            continue;
        };
        let params = function.params.len();
        let mut code = std::mem::take(&mut function.code);
        let used = mark_body(&mut code, program, &influences, params, report);
        if let (Some(function), Some(place)) = (program.functions.get_mut(*index), influences.get_mut(*index)) {
            function.code = code;
            *place = used;
        }
    }
    for index in 0..program.impls.len() {
        let id = ImplId(u32::try_from(index).unwrap_or(u32::MAX));
        let Some(found) = program.impls.get_mut(index).filter(|_| !program.unsound.impls.contains(&id)) else {
            continue;
        };
        let mut code = std::mem::take(&mut found.code);
        mark_body(&mut code, program, &influences, 0, report);
        if let Some(found) = program.impls.get_mut(index) {
            found.code = code;
        }
    }
}

/// One body; the answer is which of its first `params` slots' values, as they are at the start, can influence its own.
fn mark_body(
    code: &mut Code,
    program: &Program,
    influences: &Influences,
    params: usize,
    report: &mut Report,
) -> Vec<bool> {
    let mut flow = Flow::new(code, program, influences);
    let arguments: Vec<Value> = (0..params).map(|_| flow.value(Vec::new(), false)).collect();
    for (slot, value) in flow.slots.iter_mut().zip(&arguments) {
        *slot = *value;
    }
    for (index, (instruction, span)) in code.instructions.iter().enumerate() {
        flow.step(index, instruction, *span);
    }
    let live = flow.reach(&flow.stack, false);
    let read = flow.reach(&flow.loads, true);
    for (value, index) in &flow.evals {
        if live.get(*value) == Some(&true) {
            continue;
        }
        if let Some((Instruction::Eval { live, .. }, span)) = code.instructions.get_mut(*index) {
            *live = false;
            report.push(
                Diagnostic::new(Error::W0601, *span, "the value of this `eval` is not used")
                    .note("it is left out of the compiled program, so impls that only it needs may be missing")
                    .help("use the value, or remove the `eval`"),
            );
        }
    }
    for (value, slot, span) in &flow.lost {
        if read.get(*value) == Some(&false) {
            let name = code.slots.get(slot.0 as usize).map_or("", |s| s.name.as_str());
            report.push(
                Diagnostic::new(Error::W0502, *span, format!("this write to `{name}` is lost"))
                    .note("a block that is used as a value writes to copies, which end with it")
                    .help("use the `if` as a statement to keep the write, or bind a new name with `let`"),
            );
        }
    }
    arguments.iter().map(|a| live.get(*a) == Some(&true)).collect()
}

/// An open construct.
enum Open {
    If {
        condition: Value,
        /// Slots written, with their content before and, once known, at the end of the first side.
        slots: Vec<(Slot, Value, Value)>,
        /// Whether the slots get their old content back.
        restores: bool,
        /// The first side's value.
        value: Option<Value>,
    },
    For {
        carried: Vec<(Slot, Value)>,
    },
    Block {
        before: Vec<(Slot, Value)>,
    },
}

struct Flow<'a> {
    program: &'a Program,
    influences: &'a Influences,
    /// What each value is made from.
    sources: Vec<Vec<Value>>,
    /// Whether a value only passes on one of its sources.
    passes: Vec<bool>,
    stack: Vec<Value>,
    slots: Vec<Value>,
    open: Vec<Open>,
    evals: Vec<(Value, usize)>,
    loads: Vec<Value>,
    /// Writes to slots that get their old content back.
    lost: Vec<(Value, Slot, Span)>,
    /// For each slot how many open constructs give it its old content back.
    restored: Vec<u32>,
}

impl<'a> Flow<'a> {
    fn new(code: &Code, program: &'a Program, influences: &'a Influences) -> Self {
        let mut flow = Self {
            program,
            influences,
            sources: Vec::new(),
            passes: Vec::new(),
            stack: Vec::new(),
            slots: Vec::new(),
            open: Vec::new(),
            evals: Vec::new(),
            loads: Vec::new(),
            lost: Vec::new(),
            restored: vec![0; code.slots.len()],
        };
        let unset = flow.value(Vec::new(), false);
        flow.slots = vec![unset; code.slots.len()];
        flow
    }

    fn value(&mut self, sources: Vec<Value>, passes: bool) -> Value {
        self.sources.push(sources);
        self.passes.push(passes);
        self.sources.len() - 1
    }

    fn pop(&mut self) -> Value {
        self.stack.pop().unwrap_or(0)
    }

    fn get(&self, slot: Slot) -> Value {
        self.slots.get(slot.0 as usize).copied().unwrap_or(0)
    }

    fn set(&mut self, slot: Slot, value: Value) {
        if let Some(place) = self.slots.get_mut(slot.0 as usize) {
            *place = value;
        }
    }

    /// An operation that pops `n` values and pushes one.
    fn operation(&mut self, n: usize) -> Value {
        let from = self.stack.len().saturating_sub(n);
        let sources = self.stack.split_off(from);
        let value = self.value(sources, false);
        self.stack.push(value);
        value
    }

    fn step(&mut self, index: usize, instruction: &Instruction, span: Span) {
        match instruction {
            Instruction::Int(_) | Instruction::Real(_) | Instruction::Bool(_) => {
                self.operation(0);
            }
            Instruction::Load(slot) => {
                let value = self.get(*slot);
                self.loads.push(value);
                self.stack.push(value);
            }
            Instruction::Store(slot) => {
                let source = self.pop();
                let value = self.value(vec![source], false);
                self.set(*slot, value);
                if self.restored.get(slot.0 as usize).is_some_and(|n| *n > 0) {
                    self.lost.push((value, *slot, span));
                }
            }
            Instruction::Drop => {
                self.pop();
            }
            Instruction::Pack(n) | Instruction::PackIntervals(n) => {
                self.operation(*n as usize);
            }
            Instruction::Splat(_)
            | Instruction::Pick { .. }
            | Instruction::SplatInterval(_)
            | Instruction::End { .. }
            | Instruction::PickInterval { .. }
            | Instruction::MayBeNan
            | Instruction::Cast { .. }
            | Instruction::Neg(_)
            | Instruction::Not => {
                self.operation(1);
            }
            Instruction::Binary { .. } | Instruction::Diff | Instruction::Interval(_) => {
                self.operation(2);
            }
            Instruction::Bound { .. } => {
                self.operation(3);
            }
            Instruction::Builtin { args, .. } => {
                self.operation(args.len());
            }
            Instruction::Call(id) => {
                let function = self.program.functions.get(id.0 as usize);
                let value = self.operation(function.map_or(0, |f| f.params.len()));
                if let (Some(used), Some(sources)) =
                    (self.influences.get(id.0 as usize).filter(|u| !u.is_empty()), self.sources.get_mut(value))
                {
                    let mut used = used.iter().copied();
                    sources.retain(|_| used.next().unwrap_or(true));
                }
            }
            Instruction::Node { definition, subtrees } => {
                let definition = self.program.definitions.get(definition.0 as usize);
                self.operation(definition.map_or(0, |d| d.params.len()) + *subtrees as usize);
            }
            Instruction::Eval { concept, .. } => {
                let concept = self.program.concepts.get(concept.0 as usize);
                let without_source = concept.is_some_and(|c| c.source == Type::Tuple(Vec::new()));
                let value = self.operation(if without_source { 1 } else { 2 });
                self.evals.push((value, index));
            }
            Instruction::If(branch) => self.open_if(branch),
            Instruction::Else => self.other_side(),
            Instruction::For(facts) => self.open_for(facts),
            Instruction::Block { restores } => {
                let before = restores.iter().map(|s| (*s, self.get(*s))).collect();
                self.restore(restores.iter().copied(), true);
                self.open.push(Open::Block { before });
            }
            Instruction::EndIf | Instruction::EndFor | Instruction::EndBlock => self.close(),
        }
    }

    fn restore(&mut self, slots: impl Iterator<Item = Slot>, enter: bool) {
        for slot in slots {
            if let Some(n) = self.restored.get_mut(slot.0 as usize) {
                *n = if enter { *n + 1 } else { n.saturating_sub(1) };
            }
        }
    }

    fn open_if(&mut self, branch: &Branch) {
        let condition = self.pop();
        let restores = branch.value.is_some();
        let slots = if restores { &branch.restores } else { &branch.writes };
        if restores {
            self.restore(slots.iter().copied(), true);
        }
        let slots = slots.iter().map(|s| (*s, self.get(*s), 0)).collect();
        self.open.push(Open::If { condition, slots, restores, value: None });
    }

    fn other_side(&mut self) {
        let Some(Open::If { condition, mut slots, restores, .. }) = self.open.pop() else { return };
        for (slot, before, end) in &mut slots {
            *end = self.get(*slot);
            self.set(*slot, *before);
        }
        let value = restores.then(|| self.pop());
        self.open.push(Open::If { condition, slots, restores, value });
    }

    fn open_for(&mut self, facts: &Loop) {
        let (hi, lo) = (self.pop(), self.pop());
        let carried: Vec<(Slot, Value)> = facts
            .writes
            .iter()
            .map(|slot| {
                let head = self.value(vec![self.get(*slot), lo, hi], true);
                self.set(*slot, head);
                (*slot, head)
            })
            .collect();
        let counter = self.value(vec![lo, hi], false);
        self.set(facts.counter, counter);
        self.open.push(Open::For { carried });
    }

    fn close(&mut self) {
        match self.open.pop() {
            Some(Open::If { condition, slots, restores, value }) => {
                self.restore(slots.iter().map(|(s, _, _)| *s).filter(|_| restores), false);
                for (slot, before, first) in slots {
                    let joined = match restores {
                        true => before,
                        false => self.value(vec![first, self.get(slot), condition], true),
                    };
                    self.set(slot, joined);
                }
                if let Some(first) = value {
                    let second = self.pop();
                    let joined = self.value(vec![first, second, condition], true);
                    self.stack.push(joined);
                }
            }
            Some(Open::For { carried }) => {
                for (slot, head) in carried {
                    let end = self.get(slot);
                    if let Some(sources) = self.sources.get_mut(head) {
                        sources.push(end);
                    }
                    self.set(slot, head);
                }
            }
            Some(Open::Block { before }) => {
                self.restore(before.iter().map(|(s, _)| *s), false);
                for (slot, value) in before {
                    self.set(slot, value);
                }
            }
            None => {}
        }
    }

    /// Which values reach one of the roots, going from each value to what it is made from; with `passing` only
    /// through values that pass something on.
    fn reach(&self, roots: &[Value], passing: bool) -> Vec<bool> {
        let mut reached = vec![false; self.sources.len()];
        let mut work = roots.to_vec();
        while let Some(value) = work.pop() {
            let Some(mark) = reached.get_mut(value).filter(|m| !**m) else { continue };
            *mark = true;
            if !passing || self.passes.get(value) == Some(&true) {
                work.extend(self.sources.get(value).into_iter().flatten());
            }
        }
        reached
    }
}
