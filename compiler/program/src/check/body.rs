//! The state while one body is checked: slots, scopes and the constructs around (LANGUAGE 6.4, 6.5), and the code
//! written so far. Knows which variables a construct writes; knows nothing of types' rules.

use std::collections::BTreeSet;

use isograd_syntax::{
    Code as Error, Diagnostic, Span,
    tree::{BlockId, ExprId, Faults, Ident, Item, Tree},
};
use rustc_hash::FxHashMap;

use super::{Report, World, tree};
use crate::{
    Type,
    typed::{Code, DefinitionId, FunctionId, Instruction, Local, Slot},
};

/// A local variable while its scope is open.
#[derive(Debug, Clone, Copy)]
pub(super) struct Variable {
    pub slot: Slot,
    /// Where it was defined.
    pub span: Span,
    /// What it was bound to.
    pub value: Option<ExprId>,
    /// An assignment in a value block gave it another type; the name was defined further out.
    pub copied: bool,
}

/// What a construct does with writes to outer variables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FrameKind {
    /// Branches of an `if` in statement position, or a loop body: writes reach the outer variable.
    Through,
    /// Branches of an `if` used as a value: writes end with it.
    Value,
    /// A block of a scoped call: writes end with it.
    Block,
    /// The body of a \[24\] loop expression: only this slot may be written.
    Only(Slot),
}

/// A construct that is open.
#[derive(Debug)]
pub(super) struct Frame {
    kind: FrameKind,
    /// Slots from this one on were made inside.
    start: u32,
    /// Scopes from this one on are inside.
    scope: usize,
    writes: BTreeSet<Slot>,
}

/// What a body uses, for the searches for cycles.
#[derive(Debug, Default)]
pub(super) struct Uses {
    /// Functions called.
    pub calls: Vec<(FunctionId, Span)>,
    /// Nodes built.
    pub built: Vec<(DefinitionId, Span)>,
}

/// A body being checked.
pub(super) struct Body<'a> {
    pub world: &'a World<'a>,
    pub tree: &'a Tree,
    /// The name space it is in.
    pub space: usize,
    pub report: &'a mut Report,
    pub code: Code,
    pub uses: Uses,
    /// Unknown variables are not reported, because a definition that may declare them is unknown itself.
    pub lenient: bool,
    /// What of it could not be read.
    faults: Faults,
    /// Names in the text that could not be read.
    skipped: BTreeSet<&'a str>,
    /// Variables already reported as unknown.
    pub unknown: BTreeSet<&'a str>,
    scopes: Vec<FxHashMap<&'a str, Variable>>,
    frames: Vec<Frame>,
    /// Scalars of all types kept in the code, against types that double with each line.
    scalars: u64,
}

impl<'a> Body<'a> {
    /// A body with one scope open, which holds nothing yet.
    pub fn new(world: &'a World<'a>, tree: &'a Tree, space: usize, report: &'a mut Report) -> Self {
        Self {
            world,
            tree,
            space,
            report,
            code: Code::default(),
            uses: Uses::default(),
            lenient: false,
            faults: Faults::default(),
            skipped: BTreeSet::new(),
            unknown: BTreeSet::new(),
            scopes: vec![FxHashMap::default()],
            frames: Vec::new(),
            scalars: 0,
        }
    }

    /// Takes into account that not all of the item could be read.
    pub fn of_item(mut self, item: &Item) -> Self {
        self.faults = item.faults;
        if item.faults.any {
            let inside = |n: &&Ident| item.span.start <= n.span.start && n.span.end <= item.span.end;
            let first = self.tree.skipped.partition_point(|n| n.span.start < item.span.start);
            let skipped = self.tree.skipped.get(first..).unwrap_or(&[]);
            self.skipped = skipped.iter().take_while(inside).map(|n| n.text.as_str()).collect();
            self.report.mute();
        }
        self
    }

    /// Whether a name that is not in reach may have been defined in what could not be read.
    pub fn may_be_variable(&self, name: &str) -> bool {
        self.lenient || self.faults.nesting || self.skipped.contains(name)
    }

    /// Ends the body.
    pub fn finish(self) -> (Code, Uses) {
        (self.code, self.uses)
    }

    /// Whether a mistake may only seem one, because a part of the body could not be read: a missing value, a missing
    /// scope, a use of what is there. If the brackets do not match, hardly anything is certain.
    fn may_be_follow_up(&self, diagnostic: &Diagnostic) -> bool {
        let code = diagnostic.code;
        let needs_all = matches!(code, Error::E0302 | Error::E0409 | Error::E0503 | Error::E0505 | Error::E0507);
        let name = matches!(code, Error::E0301 | Error::E0303 | Error::E0304);
        self.faults.any && (needs_all || !diagnostic.is_error()) || self.faults.nesting && !name
    }

    pub fn emit(&mut self, instruction: Instruction, span: Span) {
        self.code.instructions.push((instruction, span));
    }

    /// Reports an error or a warning.
    pub fn error(&mut self, diagnostic: Diagnostic) {
        if self.may_be_follow_up(&diagnostic) {
            self.report.mute();
        } else {
            self.report.push(diagnostic);
        }
    }

    /// Counts a type that the code keeps.
    pub fn keep(&mut self, ty: &Type, span: Span) {
        let limit = self.world.limits.graph_nodes;
        let before = self.scalars;
        self.scalars = self.scalars.saturating_add(u64::from(ty.len()));
        if before <= limit && self.scalars > limit {
            self.error(
                Diagnostic::new(
                    Error::E1007,
                    span,
                    format!("the variables of this body hold more than {limit} scalars"),
                )
                .note(format!("the limit `graph_nodes` is {limit}"))
                .help("split the body, or raise the limit `graph_nodes`"),
            );
        }
    }

    /// A new slot; no name means it yet.
    pub fn slot(&mut self, name: &str, ty: Type, span: Span) -> Slot {
        self.keep(&ty, span);
        let slot = Slot(u32::try_from(self.code.slots.len()).unwrap_or(u32::MAX));
        // Once the limit is passed the program is refused; its types need not be kept any more.
        let ty = if self.scalars > self.world.limits.graph_nodes { Type::Error } else { ty };
        self.code.slots.push(Local { name: name.to_owned(), ty });
        slot
    }

    /// The type of a slot.
    pub fn slot_type(&self, slot: Slot) -> Type {
        self.code.slots.get(slot.0 as usize).map_or(Type::Error, |s| s.ty.clone())
    }

    /// Forgets the type of a slot after a report, so that its uses cause no others.
    pub fn poison(&mut self, slot: Slot) {
        if let Some(local) = self.code.slots.get_mut(slot.0 as usize) {
            local.ty = Type::Error;
        }
    }

    /// Makes a name mean a slot in the current scope; E0302 if the scope has the name already.
    pub fn define(&mut self, name: &'a str, span: Span, slot: Slot, value: Option<ExprId>) {
        let variable = Variable { slot, span, value, copied: false };
        let Some(scope) = self.scopes.last_mut() else { return };
        let before = scope.get(name).copied();
        scope.insert(name, variable);
        if let Some(before) = before
            && !before.copied
        {
            self.error(
                Diagnostic::new(Error::E0302, span, format!("`{name}` is defined twice in this scope"))
                    .here("defined again here")
                    .label(before.span, "first defined here")
                    .help(format!("assign with `{name} = …;`, or choose another name")),
            );
            // Which of the two a use means is not known.
            self.poison(slot);
        }
    }

    /// A parameter: a slot with a name.
    pub fn parameter(&mut self, name: &'a str, span: Span, ty: Type) {
        let slot = self.slot(name, ty, span);
        self.define(name, span, slot, None);
    }

    /// The variable that a name means, with the index of its scope.
    pub fn variable(&self, name: &str) -> Option<(usize, Variable)> {
        self.scopes.iter().enumerate().rev().find_map(|(i, s)| s.get(name).map(|v| (i, *v)))
    }

    /// All variables in reach, for suggestions.
    pub fn variables(&self) -> Vec<&'a str> {
        let mut names: Vec<&str> = self.scopes.iter().flat_map(|s| s.keys().copied()).collect();
        names.sort_unstable();
        names
    }

    pub fn open_scope(&mut self) {
        self.scopes.push(FxHashMap::default());
    }

    pub fn close_scope(&mut self) {
        self.scopes.pop();
    }

    pub fn open_frame(&mut self, kind: FrameKind) {
        let start = u32::try_from(self.code.slots.len()).unwrap_or(u32::MAX);
        self.frames.push(Frame { kind, start, scope: self.scopes.len(), writes: BTreeSet::new() });
    }

    /// Ends a construct: the outer slots written in it. Unless its writes end with it, they count for the construct
    /// around it as well.
    pub fn close_frame(&mut self) -> Vec<Slot> {
        let Some(frame) = self.frames.pop() else { return Vec::new() };
        if matches!(frame.kind, FrameKind::Through | FrameKind::Only(_))
            && let Some(outer) = self.frames.last_mut()
        {
            let start = outer.start;
            outer.writes.extend(frame.writes.iter().filter(|s| s.0 < start));
        }
        frame.writes.into_iter().collect()
    }

    /// Notes that a slot is written here.
    pub fn written(&mut self, slot: Slot) {
        if let Some(frame) = self.frames.last_mut()
            && slot.0 < frame.start
        {
            frame.writes.insert(slot);
        }
    }

    /// Whether a branch or loop stands between the scope and here, so that a variable of that scope must keep its
    /// type.
    pub fn is_conditional(&self, scope: usize) -> bool {
        self.frames.iter().any(|f| f.kind != FrameKind::Block && f.scope > scope)
    }

    /// The variable of the innermost \[24\] loop expression, if one stands between the scope and here.
    pub fn only(&self, scope: usize) -> Option<Slot> {
        self.frames.iter().rev().find_map(|f| match f.kind {
            FrameKind::Only(slot) if f.scope > scope => Some(slot),
            _ => None,
        })
    }

    /// Makes a name mean a new slot from here on: in its scope, or, in a value block, until that block ends.
    pub fn rebind(&mut self, name: &'a str, scope: usize, variable: Variable) {
        let inside = self.frames.last().filter(|f| f.kind == FrameKind::Block && f.scope > scope).map(|f| f.scope);
        let variable = Variable { copied: variable.copied || inside.is_some(), ..variable };
        if let Some(scope) = self.scopes.get_mut(inside.unwrap_or(scope)) {
            scope.insert(name, variable);
        }
    }

    pub fn text(&self, span: Span) -> &'a str {
        self.world.files.text(span)
    }

    pub fn expr_span(&self, id: ExprId) -> Span {
        tree::expr(self.tree, id).span
    }

    pub fn block_span(&self, id: BlockId) -> Span {
        tree::block(self.tree, id).span
    }
}
