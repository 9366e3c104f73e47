//! Names in bodies: what they mean, and the report if they mean nothing (LANGUAGE 6.4, 10.5). Knows no types but that
//! of a variable.

use isograd_syntax::{
    Code, Diagnostic, Span,
    tree::{ExprId, Ident, ItemKind},
};

use super::{Report, World, body::Body, messages::alternatives, tree};
use crate::{
    Type,
    names::{Callee, Kind, Lookup, Rival, builtin_names, item},
    suggest::similar,
    typed::{ConceptId, DefinitionId},
};

impl<'a> World<'a> {
    /// The concept that a name means, or a report.
    pub(super) fn concept(&self, space: usize, name: &'a Ident, report: &mut Report) -> Option<ConceptId> {
        let found = self.names.concept(space, &name.text);
        self.found(found, space, name, Kind::Concept, report)
    }

    /// The entity or operation that a name means, or a report.
    pub(super) fn definition(&self, space: usize, name: &'a Ident, report: &mut Report) -> Option<DefinitionId> {
        let found = self.names.definition(space, &name.text);
        self.found(found, space, name, Kind::Definition, report)
    }

    fn found<T>(&self, found: Lookup<T>, space: usize, name: &'a Ident, kind: Kind, report: &mut Report) -> Option<T> {
        match found {
            Lookup::Found(id) => Some(id),
            Lookup::Ambiguous(libraries) => {
                report.push_unknown((space, kind, &name.text), name.span, |_| ambiguous(name, &libraries));
                None
            }
            Lookup::Missing if self.names.may_exist(space, &name.text) => {
                report.mute();
                None
            }
            Lookup::Missing => {
                report.push_unknown((space, kind, &name.text), name.span, |suggest| {
                    self.missing(space, name, kind, suggest)
                });
                None
            }
        }
    }

    /// E0301 for a global name.
    pub(super) fn missing(&self, space: usize, name: &Ident, kind: Kind, suggest: bool) -> Diagnostic {
        let what = match kind {
            Kind::Concept => "concept",
            Kind::Definition => "entity or operation",
            Kind::Function => "function, entity or operation",
        };
        let text = &name.text;
        let mut diagnostic = Diagnostic::new(Code::E0301, name.span, format!("there is no {what} `{text}`"))
            .here("neither declared nor imported");
        if let Some(other) = self.other_kind(space, text, kind) {
            diagnostic = diagnostic.note(format!("`{text}` is {other}"));
        }
        if !suggest {
            return diagnostic;
        }
        let mut candidates = self.names.candidates(space, kind);
        if kind == Kind::Function {
            candidates.extend(self.names.candidates(space, Kind::Definition));
            candidates.extend(builtin_names());
        }
        match similar(text, candidates).as_slice() {
            [] => match self.names.elsewhere(space, text, kind) {
                Some(library) => {
                    diagnostic.help(format!("the library `{library}` has one; import it with `module {library}::…;`"))
                }
                None => diagnostic,
            },
            near => diagnostic.help(format!("did you mean {}?", alternatives(near))),
        }
    }

    /// What else a name is, as a noun phrase.
    pub(super) fn other_kind(&self, space: usize, name: &str, kind: Kind) -> Option<String> {
        let concept = || matches!(self.names.concept(space, name), Lookup::Found(_)).then(|| "a concept".to_owned());
        let callee = || match self.names.callee(space, name) {
            Lookup::Found(callee) => Some(self.describe(callee).to_owned()),
            _ => None,
        };
        match kind {
            Kind::Concept => callee(),
            Kind::Definition => callee().or_else(concept),
            Kind::Function => concept(),
        }
    }

    /// What a callee is.
    pub(super) fn describe(&self, callee: Callee) -> &'static str {
        match callee {
            Callee::Definition(id) => match self.program.definitions.get(id.0 as usize) {
                Some(d) if d.operation => "an operation",
                _ => "an entity",
            },
            Callee::Function(_) => "a function",
            Callee::Builtin(_) | Callee::Diff | Callee::Bound => "a built-in function",
        }
    }
}

impl<'a> Body<'a> {
    /// A name used as a value.
    pub fn name(&mut self, id: ExprId, name: &'a str) -> Type {
        let span = tree::expr(self.tree, id).span;
        if let Some((_, variable)) = self.variable(name) {
            return self.load(variable.slot, span);
        }
        self.unknown_variable(name, span, "");
        Type::Error
    }

    /// E0301 or E0303 for a name that is no variable, once in a body.
    pub fn unknown_variable(&mut self, name: &'a str, span: Span, purpose: &str) {
        if self.may_be_variable(name) || !self.unknown.insert(name) {
            self.report.mute();
            return;
        }
        let world = self.world;
        let callee = match world.names.callee(self.space, name) {
            Lookup::Found(callee) => Some((world.describe(callee), matches!(callee, Callee::Definition(_)))),
            _ => None,
        };
        let concept = || matches!(world.names.concept(self.space, name), Lookup::Found(_));
        let mut near = Vec::new();
        if self.report.is_worth_it() {
            near = similar(name, self.variables());
        }
        if let Some((what, definition)) = callee
            && near.is_empty()
        {
            let help = if definition { "build a node with" } else { "call it:" };
            let mut diagnostic = Diagnostic::new(Code::E0303, span, format!("`{name}` is {what}, not a variable"));
            if let Some((declared, _)) = self.function_named(name) {
                diagnostic = diagnostic.label(declared, "declared here");
            }
            self.error(diagnostic.help(format!("{help} `{name}(…)`")));
            return;
        }
        let purpose = if purpose.is_empty() { String::new() } else { format!(" {purpose}") };
        let mut diagnostic = Diagnostic::new(Code::E0301, span, format!("there is no variable `{name}`{purpose}"))
            .here("no variable of this name is in scope");
        if concept() {
            diagnostic = diagnostic.note(format!("`{name}` is a concept"));
        }
        if !near.is_empty() {
            diagnostic = diagnostic.help(format!("did you mean {}?", alternatives(&near)));
        }
        self.error(diagnostic);
    }

    /// What a call calls, or a report.
    pub fn callee(&mut self, name: &'a Ident) -> Option<Callee> {
        let found = self.world.names.callee(self.space, &name.text);
        self.world.found(found, self.space, name, Kind::Function, self.report)
    }

    /// The concept of an `eval`, or a report.
    pub fn concept(&mut self, name: &'a Ident) -> Option<ConceptId> {
        self.world.concept(self.space, name, self.report)
    }

    /// Where a function of this name declares its result, and the result's type.
    pub fn function_named(&self, name: &str) -> Option<(Span, Type)> {
        let Lookup::Found(Callee::Function(id)) = self.world.names.callee(self.space, name) else { return None };
        let function = self.world.program.functions.get(id.0 as usize)?;
        let place = *self.world.names.functions.get(id.0 as usize)?;
        let ItemKind::Function { name, .. } = &item(self.world.modules, place)?.kind else { return None };
        Some((name.span, function.result.clone()))
    }
}

fn ambiguous(name: &Ident, rivals: &[Rival]) -> Diagnostic {
    let libraries: Vec<&str> = rivals.iter().map(|r| r.library.as_str()).collect();
    let message = format!("`{}` is declared by several libraries: {}", name.text, libraries.join(", "));
    let mut diagnostic = Diagnostic::new(Code::E0304, name.span, message).here("means which of them?");
    for Rival { library, declared } in rivals {
        if let Some(declared) = declared {
            diagnostic = diagnostic.label(*declared, format!("declared by `{library}`"));
        }
    }
    diagnostic.help("import only one of them, or declare the name in the program itself")
}
