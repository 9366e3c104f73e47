//! `eval`: the meaning of a csg tree under a concept at a value (LANGUAGE 12). Knows nothing of how trees are built.

use isograd_program::Type;
use isograd_program::typed::{ConceptId, Definition, DefinitionId, FunctionId, Impl, ImplId};
use isograd_syntax::{Code, Diagnostic, Span};

use crate::branches::Merge;
use crate::csg::{Csg, CsgId, CsgNode, LinkId};
use crate::machine::{Activity, Body, Flow, Machine};
use crate::value::{Scalars, Value};

/// How much of a tree is searched for a part that both sides of a choice share.
const SEARCHED: usize = 256;

/// What a result is the result of.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) enum Key {
    /// A tree under a concept at a value.
    Eval { tree: CsgId, concept: ConceptId, at: Scalars },
    /// A function, who calls it as LANGUAGE 12.5 counts, and its arguments.
    Call { function: FunctionId, link: Option<LinkId>, args: Vec<Value> },
}

/// A choice being evaluated.
pub(crate) struct ChoiceState {
    tree: CsgId,
    concept: ConceptId,
    at: Scalars,
    site: Span,
    phase: Phase,
}

enum Phase {
    /// Nothing was done yet, or what both sides share was evaluated.
    Start,
    /// A part of the other side was evaluated for both; its value is on the stack.
    Shared,
    /// The side for true was evaluated.
    Then,
    /// The other side was too.
    Otherwise(Scalars),
}

impl Machine<'_, '_> {
    /// Keeps a result for the scope it was made in and those inside.
    pub(crate) fn remember(&mut self, key: Key, value: &Value) {
        let scope = self.nodes.builder.scopes().next().unwrap_or(0);
        self.memory.insert((scope, key), value.clone());
    }

    /// Evaluating the same tree under the same concept at the same value again gives what is known already: made
    /// here or in a region around (LANGUAGE 12.2).
    fn recall(&self, key: &Key) -> Option<Value> {
        let mut place = (0, key.clone());
        self.nodes.builder.scopes().find_map(|scope| {
            place.0 = scope;
            self.memory.get(&place).cloned()
        })
    }

    /// `eval v.C(x)`
    pub(crate) fn eval(&mut self, id: ConceptId, live: bool) -> Flow {
        let program = self.program;
        let Some(concept) = program.concepts.get(id.0 as usize) else { return Err(self.bug("no such concept")) };
        let at = if concept.source == Type::Tuple(Vec::new()) { Scalars::from_iter([]) } else { self.pop_scalars()? };
        let Value::Csg(tree) = self.pop()? else { return Err(self.bug("eval of a value that is no csg")) };
        if live { self.specialise(tree, id, at) } else { self.push_zeros(id) }
    }

    fn push_zeros(&mut self, id: ConceptId) -> Flow {
        let program = self.program;
        let Some(concept) = program.concepts.get(id.0 as usize) else { return Err(self.bug("no such concept")) };
        let zeros = self.nodes.zeros(&concept.target);
        self.push_scalars(zeros);
        Ok(())
    }

    /// Begins to evaluate a tree; its value will be on the stack when what was begun is done.
    fn specialise(&mut self, mut tree: CsgId, concept: ConceptId, mut at: Scalars) -> Flow {
        let program = self.program;
        let mut passed = Vec::new();
        loop {
            let key = Key::Eval { tree, concept, at };
            if let Some(value) = self.recall(&key) {
                self.push(value);
                return Ok(());
            }
            let node = match self.forest.get(tree) {
                Some(Csg::Node(node)) => node,
                Some(Csg::Choice { .. }) => return self.begin_choice(key),
                None => return Err(self.bug("no such tree")),
            };
            let id = node.definition;
            let Some(definition) = program.definitions.get(id.0 as usize) else {
                return Err(self.bug("no such entity or operation"));
            };
            if self.forest.chain(node.built_by).any(|link| link == (id, concept)) {
                let node = node.clone();
                self.report_cycle(&node, concept)?;
                return self.push_zeros(concept);
            }
            if let Some(found) = program.impl_of.get(&(id, concept)) {
                let Some(implementation) = program.impls.get(found.0 as usize) else {
                    return Err(self.bug("no such impl"));
                };
                if implementation.operands as usize != node.subs.len() {
                    let node = node.clone();
                    self.report_operands(&node, definition, implementation)?;
                    return self.push_zeros(concept);
                }
                return self.begin_impl(*found, implementation, tree, key);
            }
            match *node.subs {
                [sub] if definition.operation && !definition.no_identity => {
                    passed.push(id);
                    let Key::Eval { at: same, .. } = key else { return Err(self.bug("no eval")) };
                    (tree, at) = (sub, same);
                }
                _ => {
                    let node = node.clone();
                    self.report_missing(&node, definition, concept, &passed)?;
                    return self.push_zeros(concept);
                }
            }
        }
    }

    /// Begins the body of an impl for a node.
    fn begin_impl(&mut self, id: ImplId, found: &Impl, tree: CsgId, key: Key) -> Flow {
        let program = self.program;
        let (Some(Csg::Node(node)), Key::Eval { at, concept, .. }) = (self.forest.get(tree), &key) else {
            return Err(self.bug("impl of no node"));
        };
        let source = program.concepts.get(concept.0 as usize).map(|c| &c.source);
        let mut args = Vec::with_capacity(found.code.slots.len());
        match (found.sources, source) {
            (1, _) => args.push(Value::Scalars(at.clone())),
            (n, Some(Type::Tuple(elements))) if n as usize == elements.len() => {
                let mut rest = &**at;
                for element in elements {
                    let (head, tail) = rest.split_at_checked(element.width() as usize).unwrap_or((rest, &[]));
                    args.push(Value::Scalars(head.iter().copied().collect()));
                    rest = tail;
                }
            }
            (0, _) => {}
            _ => return Err(self.bug("impl whose arguments do not fit the concept")),
        }
        args.extend(node.args.iter().cloned().map(Value::Scalars));
        args.extend(node.subs.iter().copied().map(Value::Csg));
        let (definition, built_by) = (node.definition, node.built_by);
        let link = self.forest.link(definition, *concept, built_by);
        self.deeper()?;
        let Some(found) = program.impls.get(id.0 as usize) else { return Err(self.bug("no such impl")) };
        self.enter(Body::Impl(id), &found.code, args, Some(link), Some(key))
    }

    fn begin_choice(&mut self, key: Key) -> Flow {
        let Key::Eval { tree, concept, at } = key else { return Err(self.bug("no eval")) };
        self.deeper()?;
        let site = self.nodes.here();
        self.activities.push(Activity::Choice(ChoiceState { tree, concept, at, site, phase: Phase::Start }));
        Ok(())
    }

    /// `if cond { spec(then) } else { spec(otherwise) }`, one step at a time. If one tree is part of the other it is
    /// evaluated before, so that a chain of choices between `c` and something around `c` takes linear time.
    pub(crate) fn resume_choice(&mut self) -> Flow {
        let Some(Activity::Choice(ChoiceState { tree, concept, at, site, phase })) = self.activities.pop() else {
            return Err(self.bug("no choice is running"));
        };
        let Some(Csg::Choice { cond, then, otherwise }) = self.forest.get(tree).cloned() else {
            return Err(self.bug("no such choice"));
        };
        self.nodes.stand(site);
        let again = |at: Scalars, phase| Activity::Choice(ChoiceState { tree, concept, at, site, phase });
        match phase {
            Phase::Start => {
                let shared = if self.forest.contains(then, otherwise, SEARCHED) {
                    Some(otherwise)
                } else if self.forest.contains(otherwise, then, SEARCHED) {
                    Some(then)
                } else {
                    None
                };
                if let Some(shared) = shared {
                    self.activities.push(again(at.clone(), Phase::Shared));
                    return self.specialise(shared, concept, at);
                }
                self.open_choice(cond);
                self.activities.push(again(at.clone(), Phase::Then));
                self.specialise(then, concept, at)
            }
            Phase::Shared => {
                self.pop()?;
                self.open_choice(cond);
                self.activities.push(again(at.clone(), Phase::Then));
                self.specialise(then, concept, at)
            }
            Phase::Then => {
                let value = self.pop_scalars()?;
                self.nodes.builder.otherwise();
                self.activities.push(again(at.clone(), Phase::Otherwise(value)));
                self.specialise(otherwise, concept, at)
            }
            Phase::Otherwise(value) => {
                let other = self.pop_scalars()?;
                let end = self.nodes.builder.end();
                let result = Value::Scalars(self.merge_scalars(Merge::Join(end), &value, &other)?);
                self.shallower();
                self.remember(Key::Eval { tree, concept, at }, &result);
                self.push(result);
                Ok(())
            }
        }
    }

    fn open_choice(&mut self, cond: isograd_graph::NodeId) {
        self.nodes.novelty();
        self.nodes.builder.gamma(cond);
    }

    /// The nodes whose impls are running, from the first eval on.
    fn running(&self) -> Vec<DefinitionId> {
        let running = |activity: &Activity<'_>| match activity {
            Activity::Frame(frame) => match frame.body {
                Body::Impl(id) => self.program.impls.get(id.0 as usize).map(|i| i.definition),
                Body::Function(_) => None,
            },
            Activity::Choice(_) => None,
        };
        self.activities.iter().filter_map(running).collect()
    }

    /// E0605
    fn report_missing(
        &mut self,
        node: &CsgNode,
        definition: &Definition,
        concept: ConceptId,
        passed: &[DefinitionId],
    ) -> Flow {
        let (name, wanted) = (&definition.name, self.concept(concept));
        let mut path = self.running();
        path.extend(passed);
        path.push(node.definition);
        let names: Vec<&str> = path.iter().map(|d| self.definition(*d)).collect();
        let operands = match node.subs.len() {
            0 => String::new(),
            n => {
                let names = ["a", "b", "c", "d", "e", "f", "g", "h"];
                let names: Vec<&str> = names.into_iter().cycle().take(n.min(8)).collect();
                format!("<{}>", names.join(", "))
            }
        };
        let mut diagnostic =
            Diagnostic::new(Code::E0605, node.span, format!("`{name}` has no impl for the concept `{wanted}`"))
                .here(format!("this `{name}` is evaluated under `{wanted}`"))
                .help(format!("write `impl {name}{operands} for {wanted}(p) {{ … }}`"));
        let here = self.nodes.here();
        if here != node.span {
            diagnostic = diagnostic.label(here, "by this eval");
        }
        if names.len() > 1 {
            diagnostic = diagnostic.note(format!("on the way {}", Self::path(&names)));
        }
        if definition.no_identity && node.subs.len() == 1 {
            diagnostic = diagnostic
                .note(format!("`{name}` is marked `#[define(no_identity)]`, so its operand does not stand in for it"));
        } else if definition.operation {
            diagnostic =
                diagnostic.note("only an operation with exactly one subtree is passed through without an impl");
        }
        self.report(diagnostic)
    }

    /// E0606
    fn report_operands(&mut self, node: &CsgNode, definition: &Definition, found: &Impl) -> Flow {
        let name = &definition.name;
        let count = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
        let has = count(node.subs.len(), "subtree");
        let wants = count(found.operands as usize, "operand");
        let concept = self.concept(found.concept);
        let message = format!("`{name}` is built with {has}, but its impl for `{concept}` has {wants}");
        self.report(
            Diagnostic::new(Code::E0606, node.span, message)
                .here(format!("{has} here"))
                .label(found.span, format!("{wants} here"))
                .help(format!("give `{name}` as many blocks as the impl has operands")),
        )
    }

    /// E0607
    fn report_cycle(&mut self, node: &CsgNode, concept: ConceptId) -> Flow {
        let step = (node.definition, concept);
        let mut chain = vec![step];
        for link in self.forest.chain(node.built_by) {
            chain.push(link);
            if link == step {
                break;
            }
        }
        chain.reverse();
        let names: Vec<String> =
            chain.iter().map(|(d, c)| format!("`{}` for `{}`", self.definition(*d), self.concept(*c))).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let (name, wanted) = (self.definition(node.definition), self.concept(concept));
        let diagnostic = Diagnostic::new(
            Code::E0607,
            node.span,
            format!("cycle of impls: to evaluate `{name}` under `{wanted}` it takes another `{name}` under `{wanted}`"),
        )
        .here("built by an impl that it leads to")
        .note(format!("the chain of impls is {}", Self::path(&names)))
        .help("an impl may use its operands, but not build what its own meaning needs");
        self.report(diagnostic)
    }
}
