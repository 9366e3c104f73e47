//! Global names: which item a name means in a file of the program or of a library (LANGUAGE 6.1, 6.3, 10.5).
//! Knows nothing of local variables and of types.

use std::collections::{BTreeMap, BTreeSet};

use isograd_syntax::{
    Code, Diagnostic, Files, Span,
    tree::{Ident, Item, ItemKind},
};

use crate::{
    Builtin, Group,
    load::Module,
    report::Report,
    typed::{ConceptId, DefinitionId, FunctionId},
};

/// Where an item stands: module and item by index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Place {
    pub module: usize,
    pub item: usize,
}

/// A name space: the program or one library.
#[derive(Debug, Default)]
struct Space<'a> {
    library: Option<&'a str>,
    /// Other name spaces whose declarations can be reached, in order of import.
    imports: Vec<usize>,
    concepts: BTreeMap<&'a str, ConceptId>,
    definitions: BTreeMap<&'a str, DefinitionId>,
    functions: BTreeMap<&'a str, FunctionId>,
    /// The first declaration of each name, by kind.
    declared: BTreeMap<(&'a str, Kind), Span>,
    /// A file that this name space imports could not be loaded: any name may be declared there.
    incomplete: bool,
    /// Names in text between items that could not be read: they may be declared there.
    lost: BTreeSet<&'a str>,
}

/// What is looked for under a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    Concept,
    Definition,
    Function,
}

/// All global declarations. Ids count items of a kind in the order of modules and of items in them.
#[derive(Debug)]
pub(crate) struct Names<'a> {
    spaces: Vec<Space<'a>>,
    space_of: Vec<usize>,
    pub concepts: Vec<Place>,
    pub definitions: Vec<Place>,
    pub functions: Vec<Place>,
    pub impls: Vec<Place>,
    /// Declared twice, or with parameters that could not be read: what a use must look like is unknown.
    pub doubtful_concepts: BTreeSet<ConceptId>,
    pub doubtful_definitions: BTreeSet<DefinitionId>,
    pub doubtful_functions: BTreeSet<FunctionId>,
}

/// What a name was found to mean.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Lookup<T> {
    Found(T),
    /// Several libraries declare it.
    Ambiguous(Vec<Rival>),
    Missing,
}

/// One of several libraries that declare a name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Rival {
    pub library: String,
    /// Where.
    pub declared: Option<Span>,
}

/// A concept of the program, with those of the same name in libraries.
pub(crate) struct Repeated<'a> {
    pub name: &'a str,
    pub own: ConceptId,
    pub others: Vec<Other>,
}

/// A concept of a library.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Other {
    pub space: usize,
    pub id: ConceptId,
    /// Whether the program imports the library, not only another library.
    pub in_reach: bool,
}

/// What a call calls (LANGUAGE 6.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Callee {
    Definition(DefinitionId),
    Function(FunctionId),
    Builtin(Builtin),
    /// `diff`, whose value is an instruction of its own.
    Diff,
    /// `bound`, likewise.
    Bound,
}

impl<'a> Names<'a> {
    /// Collects the declarations of all modules and reports E0302, W0301 (all but concepts) and W0302.
    pub fn collect(modules: &'a [Module], report: &mut Report) -> Self {
        let mut names = Self {
            spaces: vec![Space::default()],
            space_of: Vec::new(),
            concepts: Vec::new(),
            definitions: Vec::new(),
            functions: Vec::new(),
            impls: Vec::new(),
            doubtful_concepts: BTreeSet::new(),
            doubtful_definitions: BTreeSet::new(),
            doubtful_functions: BTreeSet::new(),
        };
        for module in modules {
            let library = module.library.as_deref();
            let space = names.spaces.iter().position(|s| s.library == library).unwrap_or_else(|| {
                names.spaces.push(Space { library, ..Space::default() });
                names.spaces.len() - 1
            });
            names.space_of.push(space);
        }
        for (index, module) in modules.iter().enumerate() {
            let own = names.space(index);
            if let Some(space) = names.spaces.get_mut(own) {
                space.incomplete |= module.incomplete || module.tree.incomplete;
                space.lost.extend(module.tree.lost.iter().map(|n| n.text.as_str()));
            }
            for import in &module.imports {
                let target = names.space(*import);
                if let Some(space) = names.spaces.get_mut(own)
                    && target != own
                    && !space.imports.contains(&target)
                {
                    space.imports.push(target);
                }
            }
            for (item, it) in module.tree.items.iter().enumerate() {
                names.declare(Place { module: index, item }, it, report);
            }
        }
        names.hidden(report);
        names
    }

    /// Whether a name that was not found may be declared in text that could not be read.
    pub fn may_exist(&self, space: usize, name: &str) -> bool {
        self.in_reach(space).any(|s| s.incomplete || s.lost.contains(name))
    }

    /// Whether a use of what was found may mean another declaration, or one whose parameters could not be read.
    pub fn is_doubtful(&self, callee: Callee) -> bool {
        match callee {
            Callee::Definition(id) => self.doubtful_definitions.contains(&id),
            Callee::Function(id) => self.doubtful_functions.contains(&id),
            _ => false,
        }
    }

    /// Whether impls may stand in text that could not be read.
    pub fn may_lack_impls(&self) -> bool {
        self.spaces.iter().any(|s| s.incomplete || !s.lost.is_empty())
    }

    /// The name space itself and those it imports.
    fn in_reach(&self, space: usize) -> impl Iterator<Item = &Space<'a>> {
        let own = self.spaces.get(space);
        let imports = own.map_or(&[][..], |s| s.imports.as_slice());
        own.into_iter().chain(imports.iter().filter_map(|i| self.spaces.get(*i)))
    }

    /// The name space of a module.
    pub fn space(&self, module: usize) -> usize {
        self.space_of.get(module).copied().unwrap_or(0)
    }

    fn declare(&mut self, place: Place, item: &'a Item, report: &mut Report) {
        let own = self.space(place.module);
        let (kind, name) = match &item.kind {
            ItemKind::Module { .. } => return,
            ItemKind::Impl { .. } => {
                self.impls.push(place);
                return;
            }
            ItemKind::Concept { name, .. } => (Kind::Concept, name),
            ItemKind::Definition { name, .. } => (Kind::Definition, name),
            ItemKind::Function { name, .. } => (Kind::Function, name),
        };
        let Some(space) = self.spaces.get_mut(own) else { return };
        let first = space.first(kind, name, report);
        let text = name.text.as_str();
        if !first {
            self.doubtful_concepts.extend(space.concepts.get(text));
            self.doubtful_definitions.extend(space.definitions.get(text));
            self.doubtful_functions.extend(space.functions.get(text));
        }
        match kind {
            Kind::Concept => {
                if first {
                    space.concepts.insert(text, ConceptId(count(&self.concepts)));
                }
                self.concepts.push(place);
            }
            Kind::Definition => {
                if first {
                    space.definitions.insert(text, DefinitionId(count(&self.definitions)));
                }
                self.definitions.push(place);
            }
            Kind::Function => {
                if first {
                    space.functions.insert(text, FunctionId(count(&self.functions)));
                    if core(text).is_some() {
                        report.push(
                            Diagnostic::new(
                                Code::W0302,
                                name.span,
                                format!("the function `{text}` is never called: `{text}` is a built-in function"),
                            )
                            .help("give it another name"),
                        );
                    }
                }
                self.functions.push(place);
            }
        }
    }

    /// W0301: declarations of the program that hide one of a library.
    fn hidden(&self, report: &mut Report) {
        let Some(program) = self.spaces.first() else { return };
        for ((name, kind), span) in &program.declared {
            if *kind == Kind::Concept {
                continue;
            }
            for library in program.imports.iter().filter_map(|i| self.spaces.get(*i)) {
                let kinds = [Kind::Definition, Kind::Function];
                if let Some(other) = kinds.iter().find_map(|k| library.declared.get(&(*name, *k))) {
                    let from = library.library.unwrap_or("");
                    report.push(
                        Diagnostic::new(Code::W0301, *span, format!("`{name}` hides the one of the library `{from}`"))
                            .label(*other, "the library's declaration")
                            .help("give it another name if you want to use both"),
                    );
                }
            }
        }
    }

    /// The own declaration, else those of imported libraries, each with its library. `kinds` is what `get` looks
    /// for, in its order.
    fn reach<T: Copy + PartialEq>(
        &self,
        space: usize,
        name: &str,
        kinds: &[Kind],
        get: impl Fn(&Space<'a>) -> Option<T>,
    ) -> (Option<T>, Vec<(T, Rival)>) {
        let Some(own) = self.spaces.get(space) else { return (None, Vec::new()) };
        let mut others: Vec<(T, Rival)> = Vec::new();
        for s in own.imports.iter().filter_map(|i| self.spaces.get(*i)) {
            if let Some(id) = get(s)
                && !others.iter().any(|(o, _)| *o == id)
            {
                let library = s.library.unwrap_or("the program").to_owned();
                let declared = kinds.iter().find_map(|kind| s.declared.get(&(name, *kind)).copied());
                others.push((id, Rival { library, declared }));
            }
        }
        (get(own), others)
    }

    fn lookup<T: Copy + PartialEq>(
        &self,
        space: usize,
        name: &str,
        kind: Kind,
        get: impl Fn(&Space<'a>) -> Option<T>,
    ) -> Lookup<T> {
        let (own, others) = self.reach(space, name, &[kind], get);
        match (own, others.as_slice()) {
            (Some(id), _) => Lookup::Found(id),
            (None, []) => Lookup::Missing,
            (None, [(id, _)]) => Lookup::Found(*id),
            (None, _) => Lookup::Ambiguous(others.into_iter().map(|(_, rival)| rival).collect()),
        }
    }

    /// The concept that a name means.
    pub fn concept(&self, space: usize, name: &str) -> Lookup<ConceptId> {
        self.lookup(space, name, Kind::Concept, |s| s.concepts.get(name).copied())
    }

    /// The entity or operation that a name means.
    pub fn definition(&self, space: usize, name: &str) -> Lookup<DefinitionId> {
        self.lookup(space, name, Kind::Definition, |s| s.definitions.get(name).copied())
    }

    /// What a call of this name calls: an entity or operation, else a core built-in, else a function, else a built-in
    /// of the extension (LANGUAGE 6.3). A declaration of one's own hides those of libraries (10.5).
    pub fn callee(&self, space: usize, name: &str) -> Lookup<Callee> {
        let get = |s: &Space<'a>| {
            let definition = s.definitions.get(name).map(|d| Callee::Definition(*d));
            definition.or_else(|| s.functions.get(name).map(|f| Callee::Function(*f)))
        };
        let (own, others) = self.reach(space, name, &[Kind::Definition, Kind::Function], get);
        let is_definition = |c: &Callee| matches!(c, Callee::Definition(_));
        let definition = match own {
            Some(own) => is_definition(&own),
            None => others.iter().any(|(c, _)| is_definition(c)),
        };
        if !definition && let Some(builtin) = core(name) {
            return Lookup::Found(builtin);
        }
        match (own, others.as_slice()) {
            (Some(callee), _) => Lookup::Found(callee),
            (None, [(callee, _)]) => Lookup::Found(*callee),
            (None, []) => match builtin(name, Group::Extension) {
                Some(builtin) => Lookup::Found(builtin),
                None => Lookup::Missing,
            },
            (None, _) => Lookup::Ambiguous(others.into_iter().map(|(_, rival)| rival).collect()),
        }
    }

    /// All names of a kind that can be reached, for suggestions.
    pub fn candidates(&self, space: usize, kind: Kind) -> Vec<&'a str> {
        self.in_reach(space).flat_map(|s| s.declared.keys().filter(|(_, k)| *k == kind).map(|(n, _)| *n)).collect()
    }

    /// The concepts of the program together with those of the same name in all libraries.
    pub fn repeated_concepts(&self) -> Vec<Repeated<'a>> {
        let Some(program) = self.spaces.first() else { return Vec::new() };
        let others = |name: &str| {
            let found = self.spaces.iter().enumerate().skip(1).filter_map(|(space, s)| {
                let id = *s.concepts.get(name)?;
                Some(Other { space, id, in_reach: program.imports.contains(&space) })
            });
            found.collect::<Vec<_>>()
        };
        let all = program.concepts.iter().map(|(name, id)| Repeated { name, own: *id, others: others(name) });
        all.filter(|r| !r.others.is_empty()).collect()
    }

    /// Makes a name of a name space mean another concept.
    pub fn unify_concept(&mut self, space: usize, name: &'a str, id: ConceptId) {
        if let Some(space) = self.spaces.get_mut(space) {
            space.concepts.insert(name, id);
        }
    }

    /// A library outside of a name space's reach that declares the name.
    pub fn elsewhere(&self, space: usize, name: &str, kind: Kind) -> Option<&'a str> {
        let imports = self.spaces.get(space).map_or(&[][..], |s| s.imports.as_slice());
        let others = self.spaces.iter().enumerate().filter(|(i, _)| *i != space && !imports.contains(i));
        let mut found = others.filter(|(_, s)| s.declared.contains_key(&(name, kind)));
        found.find_map(|(_, s)| s.library)
    }

    /// The library of a name space.
    pub fn library(&self, space: usize) -> Option<&'a str> {
        self.spaces.get(space).and_then(|s| s.library)
    }
}

impl<'a> Space<'a> {
    /// Records a declaration; reports E0302 and answers false if the name is taken. A function may not have the name
    /// of anything else (LANGUAGE 6.1).
    fn first(&mut self, kind: Kind, name: &'a Ident, report: &mut Report) -> bool {
        let text = name.text.as_str();
        let rivals: &[Kind] = match kind {
            Kind::Concept => &[Kind::Concept, Kind::Function],
            Kind::Definition => &[Kind::Definition, Kind::Function],
            Kind::Function => &[Kind::Function, Kind::Definition, Kind::Concept],
        };
        let taken = rivals.iter().find_map(|k| self.declared.get(&(text, *k)));
        if let Some(before) = taken {
            report.push(
                Diagnostic::new(Code::E0302, name.span, format!("`{text}` is declared twice"))
                    .here("declared again here")
                    .label(*before, "first declared here")
                    .help("remove one of them, or give it another name"),
            );
            return false;
        }
        self.declared.insert((text, kind), name.span);
        true
    }
}

/// The built-in of the core with this name.
fn core(name: &str) -> Option<Callee> {
    match name {
        "diff" => Some(Callee::Diff),
        "bound" => Some(Callee::Bound),
        _ => builtin(name, Group::Core),
    }
}

fn builtin(name: &str, group: Group) -> Option<Callee> {
    Builtin::ALL.iter().find(|b| b.group() == group && b.name() == name).map(|b| Callee::Builtin(*b))
}

/// The names of all built-in functions.
pub(crate) fn builtin_names<'a>() -> impl Iterator<Item = &'a str> {
    Builtin::ALL.iter().map(|b| b.name()).chain(["diff", "bound"])
}

fn count(list: &[Place]) -> u32 {
    u32::try_from(list.len()).unwrap_or(u32::MAX)
}

/// The item at a place.
pub(crate) fn item(modules: &[Module], place: Place) -> Option<&Item> {
    modules.get(place.module).and_then(|m| m.tree.items.get(place.item))
}

/// The part of an item before its block: `fn f(x: real) -> real`.
pub(crate) fn head(files: &Files, item: &Item, body: Span) -> Span {
    let head = Span::new(item.span.file, item.span.start, body.start.max(item.span.start));
    let length = files.text(head).trim_end().len();
    Span { end: head.start.saturating_add(u32::try_from(length).unwrap_or(0)), ..head }
}
