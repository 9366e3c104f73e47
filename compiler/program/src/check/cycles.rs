//! Cycles that are errors whether or not they are reached: recursive functions (LANGUAGE 8.2) and impls that build the
//! node they interpret (12.5, direct). Knows only who calls and builds what.

use std::collections::VecDeque;

use isograd_syntax::{Code, Diagnostic, Span};

use super::{Report, World, items::AllUses};

/// E0506 for every function that can reach itself, with the shortest cycle through it.
pub(super) fn recursion(world: &World, uses: &AllUses, report: &mut Report) {
    let calls = |f: usize| {
        let list = uses.functions.get(f).map_or(&[][..], |u| u.calls.as_slice());
        list.iter().map(|(g, span)| (g.0 as usize, *span))
    };
    for member in on_cycles(uses.functions.len(), &|f| calls(f).map(|(g, _)| g).collect()) {
        if !report.is_worth_it() {
            report.push(Diagnostic::global(Code::E0506, "a function calls itself"));
            continue;
        }
        let Some(path) = shortest(member, member, uses.functions.len(), &calls) else { continue };
        let Some(function) = world.program.functions.get(member) else { continue };
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
}

/// E0607 for every impl that builds its own node, itself or through functions.
pub(super) fn self_building(world: &World, uses: &AllUses, report: &mut Report) {
    let built = |u: &super::body::Uses, wanted| u.built.iter().find(|(d, _)| *d == wanted).map(|(_, span)| *span);
    let name = |f: usize| world.program.functions.get(f).map_or("", |f| f.name.as_str());
    for (implementation, used) in world.program.impls.iter().zip(&uses.impls) {
        let wanted = implementation.definition;
        let mut seen = vec![false; uses.functions.len()];
        let mut queue: VecDeque<(usize, usize)> = VecDeque::new();
        // Each function with the call that led to it: (function, index of the caller in `trail`, place).
        let mut trail: Vec<(usize, Option<usize>, Span)> = Vec::new();
        let mut found = built(used, wanted).map(|span| (None, span));
        let mut visit = |calls: &[(crate::typed::FunctionId, Span)],
                         from: Option<usize>,
                         trail: &mut Vec<(usize, Option<usize>, Span)>,
                         queue: &mut VecDeque<(usize, usize)>| {
            for (callee, span) in calls {
                let callee = callee.0 as usize;
                if let Some(seen) = seen.get_mut(callee).filter(|s| !**s) {
                    *seen = true;
                    trail.push((callee, from, *span));
                    queue.push_back((callee, trail.len() - 1));
                }
            }
        };
        visit(&used.calls, None, &mut trail, &mut queue);
        while let (None, Some((function, at))) = (found, queue.pop_front()) {
            let Some(used) = uses.functions.get(function) else { continue };
            found = built(used, wanted).map(|span| (Some(at), span));
            visit(&used.calls, Some(at), &mut trail, &mut queue);
        }
        let Some((mut at, span)) = found else { continue };
        let definition = world.program.definitions.get(wanted.0 as usize).map_or("", |d| d.name.as_str());
        let concept = world.program.concepts.get(implementation.concept.0 as usize).map_or("", |c| c.name.as_str());
        let mut chain = vec![format!("builds `{definition}`")];
        let mut labels = vec![(span, format!("builds `{definition}`"))];
        while let Some((function, from, place)) = at.and_then(|at| trail.get(at)).copied() {
            chain.push(format!("calls `{}`", name(function)));
            labels.push((place, format!("calls `{}`", name(function))));
            at = from;
        }
        chain.push(format!("the impl of `{definition}` for `{concept}`"));
        chain.reverse();
        labels.reverse();
        let message = format!("the impl of `{definition}` for `{concept}` builds a node `{definition}` itself");
        let mut diagnostic = Diagnostic::new(Code::E0607, implementation.span, message)
            .note(chain.join(" → "))
            .help("evaluate an operand, or build other nodes; a tree that contains itself has no end");
        for (span, text) in labels.into_iter().take(8) {
            diagnostic = diagnostic.label(span, text);
        }
        report.push(diagnostic);
    }
}

/// The nodes of a graph that can reach themselves: members of strongly connected components with an edge inside
/// (Tarjan 1972, with an explicit stack).
fn on_cycles(count: usize, edges: &dyn Fn(usize) -> Vec<usize>) -> Vec<usize> {
    const NEW: usize = usize::MAX;
    let mut index = vec![NEW; count];
    let mut low = vec![0; count];
    let mut open = vec![false; count];
    let mut component = Vec::new();
    let mut found = Vec::new();
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
    found
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
