//! Branches, loops and value blocks: what becomes a gamma or theta, what is decided here, and what is unrolled
//! (LANGUAGE 6.5, 7, 11.6, 11.7). Knows nothing of single operations.

use isograd_graph::{NodeId, Op, Scalar, Value as Constant};
use isograd_program::Type;
use isograd_program::typed::{Branch, Loop, Slot};
use isograd_syntax::{Code, Diagnostic, Span};

use crate::machine::{Flow, Machine};
use crate::operators::Operators as _;
use crate::value::{Scalars, Value};

/// More iterations of a csg loop than this are worth a warning.
const MANY_ITERATIONS: u64 = 64;

/// A bracket that is open.
pub(crate) enum Control<'p> {
    Branch(BranchState<'p>),
    Loop(LoopState<'p>),
    Block(Saved),
}

/// Slots and what was in them.
type Saved = Vec<(Slot, Value)>;

pub(crate) struct BranchState<'p> {
    kind: BranchKind,
    branch: &'p Branch,
    /// The written slots whose new content stays.
    writes: Saved,
    /// The written slots whose old content comes back.
    restores: Saved,
    /// What the side for true left.
    then: Option<Side>,
}

#[derive(Clone, Copy)]
enum BranchKind {
    /// The condition is constant: one side only.
    Picked,
    /// A gamma.
    Gamma,
    /// Both sides run in place and the results are selected, because csg values cannot leave a gamma.
    Both(NodeId),
}

/// What a side of a branch leaves.
struct Side {
    value: Option<Value>,
    writes: Vec<Value>,
}

pub(crate) struct LoopState<'p> {
    kind: LoopKind,
    facts: &'p Loop,
}

enum LoopKind {
    /// A theta and its carried variables.
    Theta(Vec<(Slot, Scalars)>),
    /// Iteration by iteration: the one that runs, and the end.
    Unrolled(i32, i32),
}

impl<'p> Machine<'p, '_> {
    fn open_scope(&mut self) {
        self.nodes.novelty();
        self.nodes.builder.open_scope();
    }

    fn save(&mut self, slots: &[Slot]) -> Flow<Saved> {
        slots.iter().map(|slot| Ok((*slot, self.slot(*slot)?))).collect()
    }

    fn restore(&mut self, saved: &Saved) -> Flow {
        saved.iter().try_for_each(|(slot, value)| self.set_slot(*slot, value.clone()))
    }

    /// Makes the content of slots values of their own.
    fn renew(&mut self, slots: &[Slot]) -> Flow {
        for slot in slots {
            if let Value::Scalars(scalars) = self.slot(*slot)? {
                let fresh = self.nodes.renewed(&scalars);
                self.set_slot(*slot, Value::Scalars(fresh))?;
            }
        }
        Ok(())
    }

    /// `If`
    pub(crate) fn begin_branch(&mut self, branch: &'p Branch) -> Flow {
        let cond = self.pop_kind(Scalar::Bool)?;
        self.deeper()?;
        let (writes, restores) = (self.save(&branch.writes)?, self.save(&branch.restores)?);
        let picked = match self.nodes.value(cond) {
            Some(Constant::Bool(cond)) => Some(cond),
            _ => None,
        };
        let csg = branch.value == Some(Type::Csg) || writes.iter().any(|(_, v)| matches!(v, Value::Csg(_)));
        let kind = if let Some(cond) = picked {
            self.open_scope();
            if !cond {
                let place = self.place()?;
                let otherwise = self.target(place)?;
                self.jump(otherwise + 1)?;
            }
            BranchKind::Picked
        } else if csg {
            self.open_scope();
            BranchKind::Both(cond)
        } else {
            self.nodes.novelty();
            self.nodes.builder.gamma(cond);
            BranchKind::Gamma
        };
        self.frame()?.controls.push(Control::Branch(BranchState { kind, branch, writes, restores, then: None }));
        Ok(())
    }

    fn pop_branch(&mut self) -> Flow<BranchState<'p>> {
        match self.frame()?.controls.pop() {
            Some(Control::Branch(state)) => Ok(state),
            _ => Err(self.bug("no branch is open")),
        }
    }

    /// What the side that ends here leaves; the slots get back what they held before.
    fn end_side(&mut self, state: &BranchState<'p>) -> Flow<Side> {
        let value = if state.branch.value.is_some() { Some(self.pop()?) } else { None };
        let writes = state.writes.iter().map(|(slot, _)| self.slot(*slot)).collect::<Flow<_>>()?;
        self.restore(&state.writes)?;
        self.restore(&state.restores)?;
        Ok(Side { value, writes })
    }

    /// `Else`
    pub(crate) fn switch_branch(&mut self) -> Flow {
        let mut state = self.pop_branch()?;
        match state.kind {
            BranchKind::Picked => {
                let place = self.place()?;
                let end = self.target(place)?;
                self.jump(end)?;
            }
            BranchKind::Gamma => {
                state.then = Some(self.end_side(&state)?);
                self.nodes.builder.otherwise();
            }
            BranchKind::Both(_) => {
                state.then = Some(self.end_side(&state)?);
                self.nodes.builder.close_scope();
                self.open_scope();
            }
        }
        self.frame()?.controls.push(Control::Branch(state));
        Ok(())
    }

    /// `EndIf`: the value and the written variables are new values (LANGUAGE 13.3.3).
    pub(crate) fn end_branch(&mut self) -> Flow {
        let mut state = self.pop_branch()?;
        self.shallower();
        if matches!(state.kind, BranchKind::Picked) {
            return self.end_picked(&state);
        }
        let otherwise = self.end_side(&state)?;
        let Some(then) = state.then.take() else { return Err(self.bug("branch without its first side")) };
        let merge = match state.kind {
            BranchKind::Both(cond) => {
                self.nodes.builder.close_scope();
                Merge::Select(cond)
            }
            BranchKind::Gamma | BranchKind::Picked => Merge::Join(self.nodes.builder.end()),
        };
        match (then.value, otherwise.value) {
            (Some(a), Some(b)) => {
                let value = self.merge(merge, &a, &b)?;
                self.push(value);
            }
            (None, None) => {}
            _ => return Err(self.bug("branch with one value")),
        }
        for (((slot, before), a), b) in state.writes.iter().zip(&then.writes).zip(&otherwise.writes) {
            if a != before || b != before {
                let value = self.merge(merge, a, b)?;
                self.set_slot(*slot, value)?;
            }
        }
        Ok(())
    }

    fn end_picked(&mut self, state: &BranchState<'p>) -> Flow {
        let value = if state.branch.value.is_some() { Some(self.pop()?) } else { None };
        self.nodes.builder.close_scope();
        match value {
            Some(Value::Scalars(scalars)) => {
                let fresh = self.nodes.renewed(&scalars);
                self.push_scalars(fresh);
            }
            Some(other) => self.push(other),
            None => {}
        }
        self.renew(&state.branch.writes)?;
        self.restore(&state.restores)
    }

    /// The value after a branch whose sides left `a` and `b`.
    fn merge(&mut self, merge: Merge, a: &Value, b: &Value) -> Flow<Value> {
        match (merge, a, b) {
            (_, Value::Scalars(a), Value::Scalars(b)) => self.merge_scalars(merge, a, b).map(Value::Scalars),
            (Merge::Select(cond), Value::Csg(a), Value::Csg(b)) => Ok(Value::Csg(self.forest.choice(cond, *a, *b))),
            _ => Err(self.bug("sides of a branch that leave different things")),
        }
    }

    /// The scalars after a branch whose sides left `a` and `b`.
    pub(crate) fn merge_scalars(&mut self, merge: Merge, a: &Scalars, b: &Scalars) -> Flow<Scalars> {
        let nodes = &mut self.nodes;
        let merged = nodes.pairs(a, b, |nodes, a, b| match merge {
            Merge::Join(end) => nodes.builder.join(end, a, b),
            Merge::Select(cond) => {
                let op = match nodes.builder.graph().scalar(a) {
                    Scalar::Real => Op::Select,
                    Scalar::Int => Op::SelectInt,
                    Scalar::Bool => Op::SelectBool,
                };
                let selected = nodes.op(op, &[cond, a, b]);
                nodes.fresh(selected)
            }
        });
        merged.ok_or(()).map_err(|()| self.bug("sides of a branch that leave different shapes"))
    }

    /// `For`
    pub(crate) fn begin_loop(&mut self, facts: &'p Loop, span: Span) -> Flow {
        let (hi, lo) = (self.pop_kind(Scalar::Int)?, self.pop_kind(Scalar::Int)?);
        let mut csg = false;
        for slot in &facts.writes {
            csg |= self.is_csg_slot(*slot)?;
        }
        let bounds = match (self.nodes.value(lo), self.nodes.value(hi)) {
            (Some(Constant::Int(lo)), Some(Constant::Int(hi))) => Some((lo, hi)),
            _ => None,
        };
        match bounds {
            Some((lo, hi)) if lo >= hi => self.skip_loop(facts),
            Some((lo, hi)) if csg => {
                self.count_iterations(i64::from(hi) - i64::from(lo), span)?;
                self.deeper()?;
                let state = LoopState { kind: LoopKind::Unrolled(lo, hi), facts };
                self.frame()?.controls.push(Control::Loop(state));
                self.begin_iteration(facts, lo)
            }
            None if csg => {
                self.report_bounds(lo, hi, span)?;
                self.skip_loop(facts)
            }
            _ => self.begin_theta(facts, lo, hi),
        }
    }

    /// A loop that certainly has no iteration.
    fn skip_loop(&mut self, facts: &'p Loop) -> Flow {
        self.renew(&facts.writes)?;
        let place = self.place()?;
        let end = self.target(place)?;
        self.jump(end + 1)
    }

    fn begin_theta(&mut self, facts: &'p Loop, lo: NodeId, hi: NodeId) -> Flow {
        self.deeper()?;
        let inits = self.save(&facts.writes)?;
        self.nodes.novelty();
        self.nodes.builder.theta(lo, hi);
        let counter = self.nodes.builder.counter();
        let name = self.slot_name(facts.counter)?;
        self.loop_names.insert(counter, name);
        self.set_slot(facts.counter, Value::Scalars(Scalars::one(counter)))?;
        let mut carried = Vec::with_capacity(inits.len());
        for (slot, init) in inits {
            let Value::Scalars(init) = init else { return Err(self.bug("csg carried by a loop")) };
            let name = self.slot_name(slot)?;
            let nodes = self.nodes.carried(&init, name);
            self.loop_names.extend(nodes.iter().map(|x| (*x, name)));
            self.set_slot(slot, Value::Scalars(nodes.clone()))?;
            carried.push((slot, nodes));
        }
        self.frame()?.controls.push(Control::Loop(LoopState { kind: LoopKind::Theta(carried), facts }));
        Ok(())
    }

    /// Counts the iterations of a csg loop before the first is made (LANGUAGE 18).
    fn count_iterations(&mut self, count: i64, span: Span) -> Flow {
        let count = u64::try_from(count).unwrap_or(0);
        let limit = self.limits.unrolled_iterations;
        self.unrolled = self.unrolled.saturating_add(count);
        if self.unrolled > limit {
            let all = if self.unrolled == count {
                format!("this csg loop has {count} iterations")
            } else {
                format!("with the {count} of this one, the csg loops have {} iterations", self.unrolled)
            };
            return Err(self.fail(
                Diagnostic::new(Code::E1006, span, format!("{all}, more than the {limit} that may be unrolled"))
                    .note("a loop that assigns a csg variable is unrolled")
                    .help("use fewer iterations, or raise the limit `unrolled_iterations`"),
            ));
        }
        if count > MANY_ITERATIONS {
            let message = format!("csg loop is unrolled {count} times");
            self.warn(
                Diagnostic::new(Code::W0602, span, message)
                    .note("each iteration makes the compiled program larger and slower")
                    .help("if the copies are regular, move the point into the cell of the nearest one instead"),
            );
        }
        Ok(())
    }

    fn begin_iteration(&mut self, facts: &Loop, counter: i32) -> Flow {
        self.open_scope();
        self.renew(&facts.writes)?;
        let counter = self.nodes.int(counter);
        self.set_slot(facts.counter, Value::Scalars(Scalars::one(counter)))
    }

    /// `EndFor`
    pub(crate) fn end_iteration(&mut self) -> Flow {
        let Some(Control::Loop(LoopState { kind, facts })) = self.frame()?.controls.pop() else {
            return Err(self.bug("no loop is open"));
        };
        match kind {
            LoopKind::Unrolled(at, hi) => {
                self.nodes.builder.close_scope();
                let next = at.saturating_add(1);
                if next >= hi {
                    self.shallower();
                    return self.renew(&facts.writes);
                }
                let place = self.place()?;
                let start = self.target(place)?;
                self.jump(start + 1)?;
                let state = LoopState { kind: LoopKind::Unrolled(next, hi), facts };
                self.frame()?.controls.push(Control::Loop(state));
                self.begin_iteration(facts, next)
            }
            LoopKind::Theta(carried) => {
                self.shallower();
                let end = self.nodes.builder.end();
                for (slot, nodes) in carried {
                    let Value::Scalars(next) = self.slot(slot)? else { return Err(self.bug("csg carried by a loop")) };
                    let finals =
                        self.nodes.pairs(&nodes, &next, |n, carried, next| n.builder.carry_out(end, carried, next));
                    let Some(finals) = finals else { return Err(self.bug("loop variable that changes its shape")) };
                    self.set_slot(slot, Value::Scalars(finals))?;
                }
                Ok(())
            }
        }
    }

    /// E0608: says what the bounds of a csg loop depend on.
    fn report_bounds(&mut self, lo: NodeId, hi: NodeId, span: Span) -> Flow {
        let mut sources = self.nodes.sources(lo);
        sources.extend(self.nodes.sources(hi));
        sources.sort_unstable();
        sources.dedup();
        let graph = self.nodes.builder.graph();
        let names: Vec<String> = sources
            .iter()
            .filter_map(|source| match graph.get(*source)? {
                isograd_graph::Node::Input(i) => {
                    let input = graph.inputs.get(i as usize)?;
                    Some(format!("the parameter `{}`", input.name))
                }
                _ => Some(format!("`{}` of an ordinary loop", self.loop_names.get(source)?)),
            })
            .collect();
        let which = match (self.nodes.value(lo), self.nodes.value(hi)) {
            (None, Some(_)) => "lower bound",
            (Some(_), None) => "upper bound",
            _ => "bounds",
        };
        let depend = if which == "bounds" { "depend" } else { "depends" };
        let on = if names.is_empty() {
            "a value known at run time only".to_owned()
        } else {
            names.iter().take(4).map(String::as_str).collect::<Vec<_>>().join(", ")
        };
        self.report(
            Diagnostic::new(Code::E0608, span, format!("the {which} of this csg loop {depend} on {on}"))
                .note("a loop that assigns a csg variable is unrolled, so its bounds must be constant ints")
                .help("use a constant bound and decide inside the loop with `if` whether to add to the tree"),
        )
    }

    /// `Block`
    pub(crate) fn begin_block(&mut self, restores: &[Slot]) -> Flow {
        let saved = self.save(restores)?;
        self.frame()?.controls.push(Control::Block(saved));
        Ok(())
    }

    /// `EndBlock`
    pub(crate) fn end_block(&mut self) -> Flow {
        let Some(Control::Block(saved)) = self.frame()?.controls.pop() else {
            return Err(self.bug("no block is open"));
        };
        self.restore(&saved)
    }
}

/// How the results of two sides become one.
#[derive(Clone, Copy)]
pub(crate) enum Merge {
    /// By joins of the gamma with this end.
    Join(NodeId),
    /// By selects on this condition.
    Select(NodeId),
}
