//! The verifier: what makes a graph well formed. Emitters take a [`Verified`] graph only, so that an unverified one
//! cannot reach a target.

use std::fmt;
use std::ops::Deref;

use crate::{Graph, Node, NodeId, Scalar};

/// A graph that has passed [`verify`].
#[derive(Debug, Clone, PartialEq)]
pub struct Verified(Graph);

impl Deref for Verified {
    type Target = Graph;

    fn deref(&self) -> &Graph {
        &self.0
    }
}

impl Verified {
    /// Gives the graph back, to be transformed.
    #[must_use]
    pub fn into_inner(self) -> Graph {
        self.0
    }
}

/// What is wrong with a graph: a bug of the compiler, never of a user's program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VerifyError {
    /// The node.
    pub node: NodeId,
    /// What is wrong with it.
    pub what: String,
}

impl fmt::Display for VerifyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "node %{}: {}", self.node.0, self.what)
    }
}

impl std::error::Error for VerifyError {}

/// An open region while walking: its owner, and its position, which is after the owner's last mark.
struct Open {
    owner: NodeId,
    start: NodeId,
}

/// Checks that
/// * operands precede their users and lie in open regions, except that `join`, `final` and `tape` look into the regions
///   that their `end` closed;
/// * kinds fit: conditions are bools, bounds ints, operands as the op table says;
/// * marks are nested and linked to each other, and `counter`, `carried`, `join`, `final` name the right ones;
/// * each `carried` has exactly one `final`, and the finals of a loop follow its end, with nothing but constants between;
/// * a `tape` is named by `recall`s alone, and the bounds of its loop are constants (once those are rounded: before, they
///   are what folds to constants), at least one iteration apart;
/// * inputs come first, and outputs lie in the outermost region.
///
/// # Errors
/// The first violation.
pub fn verify(graph: Graph) -> Result<Verified, VerifyError> {
    Checker { graph: &graph, region: vec![NodeId::NONE; graph.len()], open: Vec::new(), carried: vec![0; graph.len()] }
        .run()?;
    Ok(Verified(graph))
}

struct Checker<'g> {
    graph: &'g Graph,
    /// The mark that opened the region each node lies in; `NONE` in the outermost.
    region: Vec<NodeId>,
    open: Vec<Open>,
    /// How many finals name each carried.
    carried: Vec<u32>,
}

impl Checker<'_> {
    fn run(&mut self) -> Result<(), VerifyError> {
        for (id, node) in self.graph.iter() {
            self.node(id, node).map_err(|what| VerifyError { node: id, what })?;
        }
        if let Some(open) = self.open.last() {
            return Err(VerifyError { node: open.owner, what: "region is not closed".into() });
        }
        for (id, node) in self.graph.iter() {
            let named = self.carried.get(id.index()).copied().unwrap_or(0);
            if matches!(node, Node::Carried { .. }) && named != 1 {
                return Err(VerifyError { node: id, what: format!("carried variable with {named} finals") });
            }
        }
        for output in &self.graph.outputs {
            let inside = self.region.get(output.node.index()) != Some(&NodeId::NONE);
            if inside || self.is_no_value(output.node) {
                return Err(VerifyError { node: output.node, what: format!("cannot be the output {}", output.name) });
            }
        }
        Ok(())
    }

    fn is_no_value(&self, id: NodeId) -> bool {
        matches!(
            self.graph.get(id),
            None | Some(
                Node::Gamma { .. } | Node::Else { .. } | Node::Theta { .. } | Node::End { .. } | Node::Tape { .. }
            )
        )
    }

    /// A value that is visible here.
    fn operand(&self, at: NodeId, x: NodeId, want: Scalar) -> Result<(), String> {
        self.value(at, x, want)?;
        self.visible(x)
    }

    fn visible(&self, x: NodeId) -> Result<(), String> {
        let region = self.region.get(x.index()).copied().unwrap_or(NodeId::NONE);
        if region != NodeId::NONE && !self.open.iter().rev().any(|o| o.start == region) {
            return Err(format!("operand %{} lies in a region that is not open here", x.0));
        }
        Ok(())
    }

    /// An earlier value of this kind, wherever it lies.
    fn value(&self, at: NodeId, x: NodeId, want: Scalar) -> Result<(), String> {
        if x >= at || self.is_no_value(x) {
            return Err(format!("operand %{} is no earlier value", x.0));
        }
        let got = self.graph.scalar(x);
        if got == want { Ok(()) } else { Err(format!("operand %{} is {got}, must be {want}", x.0)) }
    }

    /// A component of a box that is visible here.
    fn within(&self, at: NodeId, x: NodeId) -> Result<(), String> {
        self.operand(at, x, Scalar::Bool)?;
        match self.graph.get(x) {
            Some(Node::Within { .. }) => Ok(()),
            _ => Err(format!("operand %{} is no component of a box", x.0)),
        }
    }

    fn inside(&self, owner: NodeId) -> bool {
        self.open.last().is_some_and(|o| o.owner == owner)
    }

    fn node(&mut self, id: NodeId, node: Node) -> Result<(), String> {
        let kind = self.graph.scalar(id);
        let here = self.open.last().map_or(NodeId::NONE, |o| o.start);
        if let Some(place) = self.region.get_mut(id.index()) {
            *place = here;
        }
        match node {
            Node::Input(i) => {
                let declared = self.graph.inputs.get(i as usize).map(|input| input.scalar);
                if id.0 != i || declared != Some(kind) {
                    return Err("input out of place or of another kind than declared".into());
                }
                Ok(())
            }
            Node::Real(_) | Node::Int(_) | Node::Bool(_) => Ok(()),
            Node::Apply(op, args) => {
                let def = op.def();
                if args.as_slice().len() != def.operands.len() || kind != def.result {
                    return Err(format!("{op} with {} operands giving {kind}", args.as_slice().len()));
                }
                args.as_slice().iter().zip(def.operands).try_for_each(|(x, want)| self.operand(id, *x, *want))
            }
            Node::Fresh(x) => self.operand(id, x, kind),
            Node::Diff { value, wrt } => {
                self.operand(id, value, Scalar::Real)?;
                self.operand(id, wrt, Scalar::Real)
            }
            Node::Within { wrt, lo, hi, nan, next } => {
                [wrt, lo, hi].into_iter().try_for_each(|x| self.operand(id, x, Scalar::Real))?;
                self.operand(id, nan, Scalar::Bool)?;
                if next == NodeId::NONE { Ok(()) } else { self.within(id, next) }
            }
            Node::Bound { value, within, .. } => {
                self.operand(id, value, Scalar::Real)?;
                self.within(id, within)
            }
            Node::Gamma { cond, otherwise, end } => {
                self.operand(id, cond, Scalar::Bool)?;
                self.linked(otherwise, Node::Else { gamma: id })?;
                self.linked(end, Node::End { begin: id })?;
                self.open.push(Open { owner: id, start: id });
                Ok(())
            }
            Node::Else { gamma } => {
                let Some(Node::Gamma { otherwise, .. }) = self.graph.get(gamma) else {
                    return Err("of no gamma".into());
                };
                if otherwise != id || !self.inside(gamma) {
                    return Err("not linked to the gamma around it".into());
                }
                self.open.pop();
                self.open.push(Open { owner: gamma, start: id });
                Ok(())
            }
            Node::Theta { lo, hi, end } => {
                self.operand(id, lo, Scalar::Int)?;
                self.operand(id, hi, Scalar::Int)?;
                self.linked(end, Node::End { begin: id })?;
                self.open.push(Open { owner: id, start: id });
                Ok(())
            }
            Node::End { begin } => {
                let linked = match self.graph.get(begin) {
                    Some(Node::Gamma { end, otherwise, .. }) => {
                        end == id && self.open.last().is_some_and(|o| o.start == otherwise)
                    }
                    Some(Node::Theta { end, .. }) => end == id,
                    _ => false,
                };
                if !linked || !self.inside(begin) {
                    return Err("not linked to the region around it".into());
                }
                self.open.pop();
                let outside = self.open.last().map_or(NodeId::NONE, |o| o.start);
                if let Some(place) = self.region.get_mut(id.index()) {
                    *place = outside;
                }
                Ok(())
            }
            Node::Counter { theta } => {
                if kind == Scalar::Int && self.inside(theta) {
                    Ok(())
                } else {
                    Err("not of the loop around it".into())
                }
            }
            Node::Carried { theta, init } => {
                if !self.inside(theta) {
                    return Err("not of the loop around it".into());
                }
                self.operand(id, init, kind)?;
                if self.region.get(init.index()) == Some(&theta) {
                    return Err("initial content computed inside the loop".into());
                }
                Ok(())
            }
            Node::Join { end, then, otherwise } => {
                let Some(Node::End { begin }) = self.graph.get(end) else { return Err("of no end".into()) };
                let Some(Node::Gamma { otherwise: mark, .. }) = self.graph.get(begin) else {
                    return Err("of no gamma".into());
                };
                self.closed_here(id, end)?;
                self.result(id, then, kind, begin)?;
                self.result(id, otherwise, kind, mark)
            }
            Node::Final { end, carried, next } => {
                let Some(Node::End { begin }) = self.graph.get(end) else { return Err("of no end".into()) };
                match self.graph.get(carried) {
                    Some(Node::Carried { theta, .. }) if theta == begin => {}
                    _ => return Err("of no carried variable of its loop".into()),
                }
                if let Some(n) = self.carried.get_mut(carried.index()) {
                    *n += 1;
                }
                self.closed_here(id, end)?;
                for between in end.0 + 1..id.0 {
                    match self.graph.get(NodeId(between)) {
                        Some(Node::Real(_) | Node::Int(_) | Node::Bool(_)) => {}
                        Some(Node::Final { end: of, .. }) if of == end => {}
                        _ => return Err("something else stands between the end of its loop and it".into()),
                    }
                }
                if self.graph.scalar(carried) != kind {
                    return Err("of another kind than its variable".into());
                }
                let constant = matches!(self.graph.get(next), Some(Node::Real(_) | Node::Int(_) | Node::Bool(_)));
                if next > end && !constant {
                    return Err("an iteration cannot give it what is computed after the loop".into());
                }
                self.result(id, next, kind, begin)
            }
            Node::Tape { end, value, every } => {
                let Some(Node::End { begin }) = self.graph.get(end) else { return Err("of no end".into()) };
                let Some(Node::Theta { lo, hi, .. }) = self.graph.get(begin) else { return Err("of no loop".into()) };
                self.closed_here(id, end)?;
                self.result(id, value, kind, begin)?;
                if every == 0 {
                    return Err("of no iteration".into());
                }
                match (self.graph.get(lo), self.graph.get(hi)) {
                    (Some(Node::Int(lo)), Some(Node::Int(hi))) if lo < hi => Ok(()),
                    (Some(Node::Int(_)), Some(Node::Int(_))) => Err("of a loop without an iteration".into()),
                    _ if self.graph.precision.is_some() => Err("of a loop whose bounds are not constant".into()),
                    _ => Ok(()),
                }
            }
            Node::Recall { tape, at } => {
                self.operand(id, at, Scalar::Int)?;
                if tape >= id || !matches!(self.graph.get(tape), Some(Node::Tape { .. })) {
                    return Err("of no tape".into());
                }
                if self.graph.scalar(tape) != kind {
                    return Err("of another kind than its tape".into());
                }
                self.visible(tape)
            }
        }
    }

    /// An operand of a `join` or `final`: in the region that `mark` opened, or visible here.
    fn result(&self, at: NodeId, x: NodeId, want: Scalar, mark: NodeId) -> Result<(), String> {
        if self.region.get(x.index()) == Some(&mark) { self.value(at, x, want) } else { self.operand(at, x, want) }
    }

    /// `join` and `final` stand in the region that contains their end.
    fn closed_here(&self, at: NodeId, end: NodeId) -> Result<(), String> {
        let here = self.open.last().map_or(NodeId::NONE, |o| o.start);
        if end < at && self.region.get(end.index()) == Some(&here) {
            Ok(())
        } else {
            Err("not in the region of its end".into())
        }
    }

    fn linked(&self, at: NodeId, want: Node) -> Result<(), String> {
        if self.graph.get(at) == Some(want) { Ok(()) } else { Err(format!("mark %{} does not belong to it", at.0)) }
    }
}
