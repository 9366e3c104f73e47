//! Items: signatures first, then bodies (LANGUAGE 8, 9, 10.5, 11.1, 11.2). Knows nothing of what stands in a body.

use isograd_syntax::{
    Code, Diagnostic, Span,
    tree::{self as syntax, Attribute, BlockId, ExprKind, Ident, Item, ItemKind, Tree, TypeId},
};
use rustc_hash::FxHashMap;

use super::{
    Report, World,
    body::{Body, Uses},
    messages::counted,
    metadata,
    statements::Want,
    tree, types,
};
use crate::{
    Type,
    load::Module,
    names::{self, Callee, Lookup, Other, Place, Repeated},
    typed::{self, Concept, ConceptId, Definition, DefinitionId, Function, FunctionId, Impl, ImplId, Param},
};

/// What the bodies use, by id.
#[derive(Debug, Default)]
pub(super) struct AllUses {
    pub functions: Vec<Uses>,
    pub impls: Vec<Uses>,
}

/// Fills in concepts, definitions and the heads of functions.
pub(super) fn signatures(world: &mut World, report: &mut Report) {
    for place in world.names.concepts.clone() {
        if let Some((tree, item)) = at(world.modules, place) {
            let before = report.trouble();
            let mut concept = concept(tree, item, report);
            let id = ConceptId(count(&world.program.concepts));
            if world.names.doubtful_concepts.contains(&id) {
                (concept.source, concept.target) = (Type::Error, Type::Error);
            }
            if report.trouble() != before || concept.target == Type::Error {
                world.program.unsound.concepts.insert(id);
            }
            world.program.concepts.push(concept);
        }
        attributes(world.modules, place, report);
    }
    unify(world, report);
    for place in world.names.definitions.clone() {
        if let Some((tree, item)) = at(world.modules, place) {
            let before = report.trouble();
            let definition = definition(tree, item, report);
            let id = DefinitionId(count(&world.program.definitions));
            if item.faults.head {
                world.names.doubtful_definitions.insert(id);
            }
            if report.trouble() != before || world.names.doubtful_definitions.contains(&id) {
                world.program.unsound.definitions.insert(id);
            }
            world.program.definitions.push(definition);
        }
        attributes(world.modules, place, report);
    }
    for (index, place) in world.names.functions.clone().into_iter().enumerate() {
        if let Some((tree, item)) = at(world.modules, place) {
            let library = world.modules.get(place.module).is_some_and(|m| m.library.is_some());
            let before = report.trouble();
            let id = FunctionId(u32::try_from(index).unwrap_or(u32::MAX));
            let function = function(world, tree, item, library, report);
            if item.faults.head {
                world.names.doubtful_functions.insert(id);
            }
            if report.trouble() != before || world.names.doubtful_functions.contains(&id) {
                world.program.unsound.functions.insert(id);
            }
            world.program.functions.push(function);
            if !library && matches!(item.kind, ItemKind::Function { export: true, .. }) {
                world.program.exports.push(id);
            }
        }
        attributes(world.modules, place, report);
    }
    for place in world.names.impls.clone() {
        attributes(world.modules, place, report);
    }
}

fn at(modules: &[Module], place: Place) -> Option<(&Tree, &Item)> {
    let module = modules.get(place.module)?;
    Some((&module.tree, module.tree.items.get(place.item)?))
}

fn concept(tree: &Tree, item: &Item, report: &mut Report) -> Concept {
    let ItemKind::Concept { name, source, target } = &item.kind else {
        return Concept { name: String::new(), source: Type::Error, target: Type::Error, span: item.span };
    };
    let source = source.map_or(Type::Tuple(Vec::new()), |s| no_csg(tree, s, "the source of a concept", report));
    let target = no_csg(tree, *target, "the target of a concept", report);
    // Of a type that could not be read to its end only the beginning is known.
    let (source, target) = if item.faults.any { (Type::Error, Type::Error) } else { (source, target) };
    Concept { name: name.text.clone(), source, target, span: item.span }
}

fn definition(tree: &Tree, item: &Item, report: &mut Report) -> Definition {
    let ItemKind::Definition { operation, name, params } = &item.kind else {
        let (name, params) = (String::new(), Vec::new());
        return Definition { name, operation: false, params, no_identity: false, span: item.span };
    };
    let place = "an argument of an entity or operation";
    let types = params.iter().map(|p| (p, no_csg(tree, p.ty, place, report))).collect::<Vec<_>>();
    distinct(params.iter().map(|p| &p.name), report);
    let kind = if *operation { "operation" } else { "entity" };
    no_metadata(tree, params, &format!("the {kind} `{}`", name.text), report);
    Definition {
        name: name.text.clone(),
        operation: *operation,
        params: types.into_iter().map(|(p, ty)| Param::new(p.name.text.clone(), ty)).collect(),
        no_identity: item.attributes.iter().any(|a| is_no_identity(tree, a)),
        span: item.span,
    }
}

fn function(world: &World, tree: &Tree, item: &Item, library: bool, report: &mut Report) -> Function {
    let ItemKind::Function { export, name, params, result, define, body } = &item.kind else {
        return Function {
            name: String::new(),
            params: Vec::new(),
            result: Type::Error,
            doc: None,
            code: typed::Code::default(),
            span: item.span,
        };
    };
    let written_export = *export;
    let export = written_export && !library;
    let mut kept = Vec::new();
    for param in params {
        let ty = types::resolve(tree, param.ty, report);
        if export && ty == Type::Csg {
            let message = format!("the parameter `{}` of the export `{}` is csg", param.name.text, name.text);
            report.push(csg_in_export(tree::type_expr(tree, param.ty).span, message));
        }
        kept.push(Param::new(param.name.text.clone(), ty));
    }
    if !written_export {
        no_metadata(tree, params, &format!("the function `{}`", name.text), report);
    }
    let result_type = match result {
        Some(result) => types::resolve(tree, *result, report),
        None if *define => Type::Csg,
        // Found out from the body.
        None => Type::Error,
    };
    if export && result_type == Type::Csg {
        let span = result.map_or(name.span, |r| tree::type_expr(tree, r).span);
        report.push(csg_in_export(span, format!("the result of the export `{}` is csg", name.text)));
    }
    Function {
        name: name.text.clone(),
        params: kept,
        result: result_type,
        doc: item.doc.clone(),
        code: typed::Code::default(),
        span: names::head(world.files, item, tree::block(tree, *body).span),
    }
}

fn csg_in_export(span: Span, message: String) -> Diagnostic {
    Diagnostic::new(Code::E0901, span, message)
        .note("csg exists at compile time only, a host has no values of that type")
        .help("remove `export`, or interpret the csg value with `eval` and return the result")
}

/// A type that may not be csg.
fn no_csg(tree: &Tree, id: TypeId, place: &str, report: &mut Report) -> Type {
    let ty = types::resolve(tree, id, report);
    if ty != Type::Csg {
        return ty;
    }
    report.push(
        Diagnostic::new(Code::E0603, tree::type_expr(tree, id).span, format!("{place} may not be csg"))
            .help("subtrees are given in blocks: `Operation(…){ subtree }`"),
    );
    Type::Error
}

/// E0904: defaults and ranges belong to parameters of exports.
fn no_metadata(tree: &Tree, params: &[syntax::Param], of: &str, report: &mut Report) {
    for param in params {
        let default = param.default.map(|d| tree::expr(tree, d).span);
        let range = param.range.map(|(lo, hi)| tree::expr(tree, lo).span.to(tree::expr(tree, hi).span));
        let (span, what) = match (default, range) {
            (Some(default), _) => (default, "a default"),
            (None, Some(range)) => (range, "a range"),
            (None, None) => continue,
        };
        let message = format!("`{}`, a parameter of {of}, cannot have {what}", param.name.text);
        report.push(
            Diagnostic::new(Code::E0904, span, message)
                .note("defaults and ranges tell a host about its arguments: they belong to parameters of exports")
                .help("remove it, or give it to the parameter of the export that passes the value on"),
        );
    }
}

fn distinct<'a>(names: impl Iterator<Item = &'a Ident>, report: &mut Report) {
    let mut seen: FxHashMap<&str, Span> = FxHashMap::default();
    for name in names {
        if let Some(before) = seen.insert(&name.text, name.span) {
            report.push(
                Diagnostic::new(Code::E0302, name.span, format!("`{}` is defined twice in this scope", name.text))
                    .label(before, "first defined here")
                    .help("choose another name"),
            );
        }
    }
}

fn is_no_identity(tree: &Tree, attribute: &Attribute) -> bool {
    let named = |a: &syntax::ExprId| matches!(&tree::expr(tree, *a).kind, ExprKind::Name(n) if n == "no_identity");
    attribute.name.text == "define" && attribute.args.len() == 1 && attribute.args.iter().all(named)
}

/// W0901 for attributes that mean nothing where they stand (LANGUAGE 8.3).
fn attributes(modules: &[Module], place: Place, report: &mut Report) {
    let Some((tree, item)) = at(modules, place) else { return };
    for attribute in &item.attributes {
        let known = match &item.kind {
            ItemKind::Function { .. } | ItemKind::Impl { .. } => attribute.name.text == "no_inline",
            ItemKind::Definition { operation: true, .. } => is_no_identity(tree, attribute),
            _ => false,
        };
        if !known {
            let message = format!("the attribute `{}` means nothing here and is ignored", attribute.name.text);
            report.push(
                Diagnostic::new(Code::W0901, attribute.span, message)
                    .help("there are `#[no_inline()]` for functions and `#[define(no_identity)]` for operations"),
            );
        }
    }
}

/// A concept of the program with the name and types of a library's is that concept (LANGUAGE 10.5).
fn unify(world: &mut World, report: &mut Report) {
    for Repeated { name, own, others } in world.names.repeated_concepts() {
        let mut chosen: Option<ConceptId> = None;
        for Other { space, id: other, in_reach } in others {
            let get = |id: ConceptId| world.program.concepts.get(id.0 as usize);
            let (Some(ours), Some(theirs)) = (get(own), get(other)) else { continue };
            let library = world.names.library(space).unwrap_or("");
            let shown = |c: &Concept| format!("{} -> {}", c.source, c.target);
            let types = [&ours.source, &ours.target, &theirs.source, &theirs.target];
            if types.contains(&&Type::Error) {
                continue;
            }
            if ours.source != theirs.source || ours.target != theirs.target {
                if !in_reach {
                    continue;
                }
                let message = format!("the concept `{name}` differs from the one of the library `{library}`");
                report.push(
                    Diagnostic::new(Code::E0305, ours.span, message)
                        .here(format!("here it is `{}`", shown(ours)))
                        .label(theirs.span, format!("there it is `{}`", shown(theirs)))
                        .help("use the same types, or another name"),
                );
                // Which of them a use means is unknown.
                world.program.unsound.concepts.insert(own);
                if let Some(concept) = world.program.concepts.get_mut(own.0 as usize) {
                    (concept.source, concept.target) = (Type::Error, Type::Error);
                }
                continue;
            }
            report.push(
                Diagnostic::new(
                    Code::W0301,
                    ours.span,
                    format!("the concept `{name}` repeats the one of the library `{library}`; they are one concept"),
                )
                .label(theirs.span, "the library's declaration")
                .help("remove this declaration"),
            );
            let id = *chosen.get_or_insert(other);
            world.names.unify_concept(space, name, id);
            world.names.unify_concept(0, name, id);
        }
    }
}

/// Checks all bodies; functions whose result is inferred come first, in the order of their calls.
pub(super) fn bodies(world: &mut World, report: &mut Report) -> AllUses {
    let mut uses = AllUses::default();
    uses.functions.resize_with(world.program.functions.len(), Uses::default);
    let inferred = inferred(world);
    let declared = (0..world.program.functions.len()).filter(|i| !inferred.contains(i));
    let order: Vec<usize> = inferred.iter().copied().chain(declared).collect();
    for index in order {
        let before = report.trouble();
        let (code, result, used) = function_body(world, index, report);
        if report.trouble() != before {
            world.program.unsound.functions.insert(FunctionId(u32::try_from(index).unwrap_or(u32::MAX)));
        }
        if let (Some(function), Some(slot)) = (world.program.functions.get_mut(index), uses.functions.get_mut(index)) {
            function.code = code;
            function.result = result;
            *slot = used;
        }
    }
    metadata::exports(world, report);
    for place in world.names.impls.clone() {
        let before = report.trouble();
        let (implementation, used) = match impl_body(world, place, report) {
            Ok(checked) => checked,
            Err(known) => {
                world.program.unsound.lost_impls.push(known);
                continue;
            }
        };
        let key = (implementation.definition, implementation.concept);
        let id = ImplId(count(&world.program.impls));
        if report.trouble() != before {
            world.program.unsound.impls.insert(id);
        }
        let first = world.program.impl_of.get(&key).copied();
        match first.and_then(|i| Some((i, world.program.impls.get(i.0 as usize)?.span))) {
            Some((first, span)) => {
                report.push(second_impl(world, &implementation, span));
                world.program.unsound.impls.insert(first);
            }
            None => {
                world.program.impl_of.insert(key, id);
            }
        }
        world.program.impls.push(implementation);
        uses.impls.push(used);
    }
    if world.names.may_lack_impls() {
        world.program.unsound.lost_impls.push((None, None));
    }
    uses
}

fn count<T>(list: &[T]) -> u32 {
    u32::try_from(list.len()).unwrap_or(u32::MAX)
}

fn second_impl(world: &World, second: &Impl, first: Span) -> Diagnostic {
    let definition = world.program.definitions.get(second.definition.0 as usize).map_or("", |d| d.name.as_str());
    let concept = world.program.concepts.get(second.concept.0 as usize).map_or("", |c| c.name.as_str());
    let message = format!("`{definition}` has two impls for `{concept}`");
    Diagnostic::new(Code::E0610, second.span, message)
        .here("second impl")
        .label(first, "first impl")
        .help("remove one of them")
}

fn function_body(world: &World, index: usize, report: &mut Report) -> (typed::Code, Type, Uses) {
    let nothing = || (typed::Code::default(), Type::Error, Uses::default());
    let (Some(place), Some(function)) = (world.names.functions.get(index), world.program.functions.get(index)) else {
        return nothing();
    };
    let Some((tree, item)) = at(world.modules, *place) else { return nothing() };
    let ItemKind::Function { export, name, params, result, define, body: block } = &item.kind else {
        return nothing();
    };
    let mut body = Body::new(world, tree, world.names.space(place.module), report).of_item(item);
    for (written, param) in params.iter().zip(&function.params) {
        body.parameter(&written.name.text, written.name.span, param.ty.clone());
    }
    let whom = format!("the function `{}`", name.text);
    let declared = result.map(|r| tree::type_expr(tree, r).span);
    let expected = (result.is_some() || *define).then(|| function.result.clone());
    let ty = body_value(&mut body, *block, expected.as_ref(), declared, &whom);
    if expected.is_none() && *export && ty == Type::Csg {
        let message = format!("the result of the export `{}` is csg", name.text);
        body.error(csg_in_export(name.span, message).here("the value of its body is csg"));
    }
    let (code, uses) = body.finish();
    (code, expected.unwrap_or(ty), uses)
}

/// The body's block: it needs a value, of the declared type if there is one (E0505, E0409).
fn body_value(body: &mut Body, block: BlockId, expected: Option<&Type>, declared: Option<Span>, whom: &str) -> Type {
    let span = body.block_span(block);
    let Some(ty) = body.value_block(block, Want::Any) else {
        let what = expected.filter(|t| **t != Type::Error).map_or(String::new(), |t| format!(" of type `{t}`"));
        body.error(
            Diagnostic::new(Code::E0505, span, format!("{whom} needs a value{what}, but its block has none"))
                .help("end the block with an expression without `;`"),
        );
        return Type::Error;
    };
    let Some(expected) = expected else { return ty };
    if ty == *expected || ty == Type::Error || *expected == Type::Error {
        return expected.clone();
    }
    let value = super::statements::tail(tree::block(body.tree, block));
    let at = value.map_or(span, |v| body.expr_span(v));
    let mut diagnostic =
        Diagnostic::new(Code::E0409, at, format!("{whom} must yield `{expected}`, but this is `{ty}`"))
            .here(format!("this is `{ty}`"));
    if let Some(declared) = declared {
        diagnostic = diagnostic.label(declared, format!("`{expected}` is declared here"));
    }
    if let Some(mend) = value.and_then(|v| body.mend(v, &ty, expected)) {
        diagnostic = diagnostic.help(mend);
    }
    body.error(diagnostic);
    expected.clone()
}

/// Checks an impl. If its node or concept is unknown, it answers what is known.
fn impl_body(
    world: &World,
    place: Place,
    report: &mut Report,
) -> Result<(Impl, Uses), (Option<DefinitionId>, Option<ConceptId>)> {
    let (tree, item) = at(world.modules, place).ok_or((None, None))?;
    let ItemKind::Impl { node, operands, concept, args, body: block } = &item.kind else { return Err((None, None)) };
    let space = world.names.space(place.module);
    let definition = world.definition(space, node, report);
    let concept_id = world.concept(space, concept, report);
    let get_definition = |id: DefinitionId| world.program.definitions.get(id.0 as usize);
    let get_concept = |id: ConceptId| world.program.concepts.get(id.0 as usize);
    let (definition_of, concept_of) = (definition.and_then(get_definition), concept_id.and_then(get_concept));
    let doubtful = definition.is_some_and(|d| world.names.doubtful_definitions.contains(&d));
    if let Some(first) = operands.first().filter(|_| !doubtful && definition_of.is_some_and(|d| !d.operation)) {
        report.push(
            Diagnostic::new(Code::E0611, first.span, format!("`{}` is an entity and has no operands", node.text))
                .help("remove the operands, or declare it as an `operation`"),
        );
    }
    let sources = concept_of
        .filter(|_| !item.faults.head)
        .map_or_else(|| vec![Type::Error; args.len()], |c| sources(c, concept, args, report));
    let mut body = Body::new(world, tree, space, report).of_item(item);
    body.lenient =
        definition.is_none() || doubtful || item.faults.head || concept_of.is_some_and(|_| sources.len() != args.len());
    for (name, ty) in args.iter().zip(&sources) {
        body.parameter(&name.text, name.span, ty.clone());
    }
    let written = definition.and_then(|d| world.names.definitions.get(d.0 as usize));
    let written = written.and_then(|p| at(world.modules, *p)).map(|(_, item)| &item.kind);
    if let (Some(ItemKind::Definition { params, .. }), Some(definition)) = (written, definition_of) {
        for (written, param) in params.iter().zip(&definition.params) {
            body.parameter(&written.name.text, written.name.span, param.ty.clone());
        }
    }
    for operand in operands {
        body.parameter(&operand.text, operand.span, Type::Csg);
    }
    let whom = format!("this impl for `{}`", concept.text);
    let target = concept_of.map_or(Type::Error, |c| c.target.clone());
    body_value(&mut body, *block, Some(&target), concept_of.map(|c| c.span), &whom);
    let (code, uses) = body.finish();
    let head = names::head(world.files, item, tree::block(tree, *block).span);
    let (Some(definition), Some(concept)) = (definition, concept_id) else { return Err((definition, concept_id)) };
    let implementation = Impl {
        definition,
        concept,
        sources: u32::try_from(args.len()).unwrap_or(u32::MAX),
        operands: u32::try_from(operands.len()).unwrap_or(u32::MAX),
        code,
        span: head,
    };
    Ok((implementation, uses))
}

/// The types of the names that an impl gives the concept's argument (LANGUAGE 11.2); E0611 if they do not fit.
fn sources(concept: &Concept, name: &Ident, args: &[Ident], report: &mut Report) -> Vec<Type> {
    let expected = match &concept.source {
        Type::Tuple(elements) if elements.is_empty() => {
            if args.is_empty() {
                return Vec::new();
            }
            "no argument, because it has no source".to_owned()
        }
        Type::Tuple(elements) if elements.len() == args.len() => return elements.clone(),
        source if args.len() == 1 => return vec![source.clone()],
        Type::Error => return vec![Type::Error; args.len()],
        Type::Tuple(elements) => format!("1 argument, or {}, one per element", counted(elements.len(), "argument")),
        source => format!("1 argument of type `{source}`"),
    };
    let message = format!("an impl for `{}` names {expected}; this one names {}", concept.name, args.len());
    let place = args.first().zip(args.last()).map_or(name.span, |(first, last)| first.span.to(last.span));
    report.push(Diagnostic::new(Code::E0611, place, message).label(concept.span, "the concept").help(format!(
        "write `impl … for {}{}`",
        concept.name,
        match &concept.source {
            Type::Tuple(elements) if elements.is_empty() => "",
            _ => "(p)",
        }
    )));
    vec![Type::Error; args.len()]
}

/// The \[24\] exports without a written result, callees before callers.
fn inferred(world: &World) -> Vec<usize> {
    let without = |place: &Place| {
        let item = at(world.modules, *place).map(|(_, item)| &item.kind);
        matches!(item, Some(ItemKind::Function { result: None, define: false, .. }))
    };
    let places = &world.names.functions;
    let members: Vec<usize> = places.iter().enumerate().filter(|(_, p)| without(p)).map(|(i, _)| i).collect();
    if members.is_empty() {
        return members;
    }
    let mut callees: FxHashMap<usize, Vec<usize>> = FxHashMap::default();
    for (index, module) in world.modules.iter().enumerate() {
        let inside = members.iter().filter_map(|m| Some((*m, places.get(*m).filter(|p| p.module == index)?)));
        // Items stand in source order, so their places are sorted.
        let spans: Vec<(usize, Span)> =
            inside.filter_map(|(m, p)| Some((m, module.tree.items.get(p.item)?.span))).collect();
        let space = world.names.space(index);
        for expr in module.tree.exprs.iter().filter(|_| !spans.is_empty()) {
            let ExprKind::Call { callee, .. } = &expr.kind else { continue };
            let after = spans.partition_point(|(_, span)| span.start <= expr.span.start);
            let caller = after.checked_sub(1).and_then(|at| spans.get(at)).filter(|(_, s)| expr.span.end <= s.end);
            if let Some((caller, _)) = caller
                && let Lookup::Found(Callee::Function(id)) = world.names.callee(space, &callee.text)
                && members.binary_search(&(id.0 as usize)).is_ok()
            {
                callees.entry(*caller).or_default().push(id.0 as usize);
            }
        }
    }
    after_callees(&members, &callees)
}

/// Depth-first order with an explicit stack; in cycles, which are errors, any order.
fn after_callees(members: &[usize], callees: &FxHashMap<usize, Vec<usize>>) -> Vec<usize> {
    let mut order = Vec::new();
    let mut state: FxHashMap<usize, usize> = FxHashMap::default();
    for member in members {
        let mut stack = vec![*member];
        while let Some(top) = stack.last().copied() {
            let targets = callees.get(&top).map_or(&[][..], Vec::as_slice);
            let next = state.entry(top).or_insert(0);
            match targets.get(*next) {
                Some(target) => {
                    *next += 1;
                    if !state.contains_key(target) {
                        stack.push(*target);
                    }
                }
                None => {
                    stack.pop();
                    if *next != usize::MAX {
                        *next = usize::MAX;
                        order.push(top);
                    }
                }
            }
        }
    }
    order
}
