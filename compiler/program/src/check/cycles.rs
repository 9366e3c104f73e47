//! Cycles that are errors whether or not they are reached: recursive functions (LANGUAGE 8.2) and impls that build the
//! node they interpret (12.5, direct). Knows only who calls and builds what.

use std::collections::VecDeque;

use isograd_syntax::{Code, Diagnostic, Span};

use super::{Report, World, body::Uses, items::AllUses};
use crate::typed::DefinitionId;

/// E0506 for every function that can reach itself, with the shortest cycle through it. The answer is these functions,
/// and all functions, callees first.
pub(super) fn recursion(world: &World, uses: &AllUses, report: &mut Report) -> (Vec<usize>, Vec<usize>) {
    let calls = |f: usize| {
        let list = uses.functions.get(f).map_or(&[][..], |u| u.calls.as_slice());
        list.iter().map(|(g, span)| (g.0 as usize, *span))
    };
    let (members, order) = on_cycles(uses.functions.len(), &|f| calls(f).map(|(g, _)| g).collect());
    for member in members.iter().copied() {
        let Some(function) = world.program.functions.get(member) else { continue };
        if !report.is_worth_it() {
            report.push(Diagnostic::new(Code::E0506, function.span, "this function calls itself"));
            continue;
        }
        let Some(path) = shortest(member, member, uses.functions.len(), &calls) else { continue };
        let name = |f: usize| world.program.functions.get(f).map_or("", |f| f.name.as_str());
        let names: Vec<String> =
            std::iter::once(member).chain(path.iter().map(|(g, _)| *g)).map(|f| format!("`{}`", name(f))).collect();
        let mut diagnostic =
            Diagnostic::new(Code::E0506, function.span, format!("the function `{}` calls itself", function.name))
                .note(format!("the cycle is {}", names.join(" → ")))
                .help("functions cannot be recursive: use a loop, or write out the levels");
        for (callee, span) in path.iter().take(8) {
            diagnostic = diagnostic.label(*span, format!("calls `{}`", name(*callee)));
        }
        report.push(diagnostic);
    }
    (members, order)
}

/// E0607 for every impl that builds its own node, itself or through functions; the answer is these impls.
pub(super) fn self_building(world: &World, uses: &AllUses, report: &mut Report) -> Vec<usize> {
    let suspects = suspects(world, uses);
    for index in suspects.iter().copied() {
        let (Some(implementation), Some(used)) = (world.program.impls.get(index), uses.impls.get(index)) else {
            continue;
        };
        let definition = world.program.definitions.get(implementation.definition.0 as usize);
        let concept = world.program.concepts.get(implementation.concept.0 as usize);
        let definition = definition.map_or("", |d| d.name.as_str());
        let concept = concept.map_or("", |c| c.name.as_str());
        let message = format!("the impl of `{definition}` for `{concept}` builds a node `{definition}` itself");
        let mut diagnostic = Diagnostic::new(Code::E0607, implementation.span, message)
            .help("evaluate an operand, or build other nodes; a tree that contains itself has no end");
        if report.is_worth_it() {
            let (calls, span) = way_to_node(used, implementation.definition, uses);
            let mut chain = vec![format!("the impl of `{definition}` for `{concept}`")];
            for (function, place) in calls {
                let name = world.program.functions.get(function).map_or("", |f| f.name.as_str());
                let step = format!("calls `{name}`");
                diagnostic = diagnostic.label(place, step.clone());
                chain.push(step);
            }
            let step = format!("builds `{definition}`");
            if let Some(span) = span {
                diagnostic = diagnostic.label(span, step.clone());
            }
            chain.push(step);
            diagnostic = diagnostic.note(chain.join(" → "));
        }
        report.push(diagnostic);
    }
    suspects
}

/// The impls from which a node of their own definition can be built. Definitions are followed through the functions
/// in sets of 64, so that many of them cost little.
fn suspects(world: &World, uses: &AllUses) -> Vec<usize> {
    let callees = |f: usize| uses.functions.get(f).map_or(&[][..], |u| u.calls.as_slice());
    let (_, order) = on_cycles(uses.functions.len(), &|f| callees(f).iter().map(|(g, _)| g.0 as usize).collect());
    let mut by_definition: Vec<(u32, usize)> =
        world.program.impls.iter().enumerate().map(|(i, imp)| (imp.definition.0, i)).collect();
    by_definition.sort_unstable();
    let mut found = Vec::new();
    let mut rest = by_definition.as_slice();
    while let Some((first, _)) = rest.first() {
        let end = first.saturating_add(64);
        let (group, after) = rest.split_at(rest.partition_point(|(d, _)| *d < end));
        rest = after;
        let bit = |d: DefinitionId| if (*first..end).contains(&d.0) { 1_u64 << (d.0 - first) } else { 0 };
        let own = |u: &Uses| u.built.iter().fold(0, |set, (d, _)| set | bit(*d));
        let mut sets: Vec<u64> = uses.functions.iter().map(own).collect();
        // One pass suffices without recursion, which is reported elsewhere.
        let mut changed = sets.iter().any(|s| *s != 0);
        while changed {
            changed = false;
            for function in &order {
                let below = callees(*function).iter().fold(0, |set, (g, _)| set | get(&sets, g.0 as usize, 0));
                let before = get(&sets, *function, 0);
                changed |= before | below != before;
                set(&mut sets, *function, before | below);
            }
        }
        for (definition, index) in group {
            let Some(used) = uses.impls.get(*index) else { continue };
            let below = used.calls.iter().fold(own(used), |set, (g, _)| set | get(&sets, g.0 as usize, 0));
            if below & bit(DefinitionId(*definition)) != 0 {
                found.push(*index);
            }
        }
    }
    found.sort_unstable();
    found
}

/// The shortest chain of calls, with their places, from a body to one that builds the node, and where it does.
fn way_to_node(used: &Uses, wanted: DefinitionId, uses: &AllUses) -> (Vec<(usize, Span)>, Option<Span>) {
    let built = |u: &Uses| u.built.iter().find(|(d, _)| *d == wanted).map(|(_, span)| *span);
    if let Some(span) = built(used) {
        return (Vec::new(), Some(span));
    }
    let mut seen = vec![false; uses.functions.len()];
    // Each function with the step before it and the place of the call.
    let mut steps: Vec<(usize, Option<usize>, Span)> = Vec::new();
    let mut at = None;
    let mut next = 0;
    let mut calls = used.calls.as_slice();
    loop {
        for (callee, span) in calls {
            let callee = callee.0 as usize;
            if !get(&seen, callee, true) {
                set(&mut seen, callee, true);
                steps.push((callee, at, *span));
            }
        }
        let Some((function, _, _)) = steps.get(next) else { return (Vec::new(), None) };
        let Some(body) = uses.functions.get(*function) else { return (Vec::new(), None) };
        at = Some(next);
        if let Some(span) = built(body) {
            let mut way = Vec::new();
            while let Some((function, before, place)) = at.and_then(|at| steps.get(at)).copied() {
                way.push((function, place));
                at = before;
            }
            way.reverse();
            return (way, Some(span));
        }
        calls = body.calls.as_slice();
        next += 1;
    }
}

/// The nodes of a graph that can reach themselves: members of strongly connected components with an edge inside
/// (Tarjan 1972, with an explicit stack). Second, all nodes, targets before sources except in cycles.
fn on_cycles(count: usize, edges: &dyn Fn(usize) -> Vec<usize>) -> (Vec<usize>, Vec<usize>) {
    const NEW: usize = usize::MAX;
    let mut index = vec![NEW; count];
    let mut low = vec![0; count];
    let mut open = vec![false; count];
    let mut component = Vec::new();
    let mut found = Vec::new();
    let mut order = Vec::new();
    let mut next = 0;
    for root in 0..count {
        let mut work: Vec<(usize, Vec<usize>)> = Vec::new();
        let mut enter = Some(root).filter(|r| index.get(*r) == Some(&NEW));
        loop {
            if let Some(node) = enter.take() {
                set(&mut index, node, next);
                set(&mut low, node, next);
                set(&mut open, node, true);
                next += 1;
                component.push(node);
                work.push((node, edges(node)));
            }
            let Some((node, rest)) = work.last_mut() else { break };
            let node = *node;
            if let Some(target) = rest.pop() {
                if target == node {
                    found.push(node);
                }
                if get(&index, target, 0) == NEW {
                    enter = Some(target);
                } else if get(&open, target, false) {
                    let least = get(&low, node, 0).min(get(&index, target, 0));
                    set(&mut low, node, least);
                }
                continue;
            }
            work.pop();
            order.push(node);
            if let Some((parent, _)) = work.last() {
                let least = get(&low, *parent, 0).min(get(&low, node, 0));
                set(&mut low, *parent, least);
            }
            if get(&low, node, 0) == get(&index, node, 0) {
                let start = component.iter().rposition(|n| *n == node).unwrap_or(0);
                let members = component.split_off(start);
                for member in &members {
                    set(&mut open, *member, false);
                }
                if members.len() > 1 {
                    found.extend(members);
                }
            }
        }
    }
    found.sort_unstable();
    found.dedup();
    (found, order)
}

fn get<T: Copy>(list: &[T], at: usize, otherwise: T) -> T {
    list.get(at).copied().unwrap_or(otherwise)
}

fn set<T>(list: &mut [T], at: usize, value: T) {
    if let Some(place) = list.get_mut(at) {
        *place = value;
    }
}

/// The shortest way with at least one step, as the nodes after the first with the places of the steps.
fn shortest<I: Iterator<Item = (usize, Span)>>(
    from: usize,
    to: usize,
    count: usize,
    edges: &dyn Fn(usize) -> I,
) -> Option<Vec<(usize, Span)>> {
    let mut before: Vec<Option<(usize, Span)>> = vec![None; count];
    let mut queue = VecDeque::from([from]);
    while let Some(node) = queue.pop_front() {
        for (target, span) in edges(node) {
            let Some(place) = before.get_mut(target).filter(|p| p.is_none()) else { continue };
            *place = Some((node, span));
            if target != to {
                queue.push_back(target);
                continue;
            }
            let mut path = Vec::new();
            let mut at = to;
            while let Some((previous, span)) = before.get(at).copied().flatten() {
                path.push((at, span));
                at = previous;
                if at == from {
                    break;
                }
            }
            path.reverse();
            return Some(path);
        }
    }
    None
}
