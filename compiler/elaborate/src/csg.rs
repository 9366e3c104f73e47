//! The csg trees of one export: an arena of nodes, choices between trees, and who built what (LANGUAGE 11, 12).
//! Knows nothing of the impls that give trees a meaning.

use isograd_graph::NodeId;
use isograd_program::typed::{ConceptId, DefinitionId};
use isograd_syntax::Span;

use crate::value::Scalars;

/// A tree of a [`Forest`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct CsgId(u32);

/// A step of the chain "was built by the impl of … for …" (LANGUAGE 12.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct LinkId(u32);

/// A csg value.
#[derive(Debug, Clone)]
pub(crate) enum Csg {
    /// An entity or operation with its arguments and subtrees.
    Node(CsgNode),
    /// One of two trees, decided at run time.
    Choice {
        /// The condition, as it was where the choice was made.
        cond: NodeId,
        /// The tree if it holds.
        then: CsgId,
        /// The tree otherwise.
        otherwise: CsgId,
    },
}

/// A node of a csg tree.
#[derive(Debug, Clone)]
pub(crate) struct CsgNode {
    /// Which entity or operation.
    pub(crate) definition: DefinitionId,
    /// Its arguments, each already a value of its own where it has to be.
    pub(crate) args: Vec<Scalars>,
    /// Its subtrees.
    pub(crate) subs: Vec<CsgId>,
    /// The impl that built it, if one did.
    pub(crate) built_by: Option<LinkId>,
    /// Where it was built.
    pub(crate) span: Span,
}

#[derive(Debug, Clone, Copy)]
struct Link {
    definition: DefinitionId,
    concept: ConceptId,
    parent: Option<LinkId>,
}

/// All trees of one export. They share; subtrees precede their users.
#[derive(Debug, Default)]
pub(crate) struct Forest {
    trees: Vec<(Csg, u64)>,
    links: Vec<Link>,
}

fn id(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}

impl Forest {
    /// The number of nodes and choices.
    pub(crate) fn len(&self) -> u64 {
        self.trees.len() as u64
    }

    /// The tree with this id.
    pub(crate) fn get(&self, tree: CsgId) -> Option<&Csg> {
        self.trees.get(tree.0 as usize).map(|(csg, _)| csg)
    }

    /// Nodes on the longest path of a tree.
    fn depth(&self, tree: CsgId) -> u64 {
        self.trees.get(tree.0 as usize).map_or(0, |(_, depth)| *depth)
    }

    /// The nodes of a tree's longest path, from its root.
    pub(crate) fn deepest_path(&self, tree: CsgId) -> impl Iterator<Item = DefinitionId> + '_ {
        let below = |at: &CsgId| match self.get(*at)? {
            Csg::Node(node) => node.subs.iter().copied().max_by_key(|s| self.depth(*s)),
            Csg::Choice { then, otherwise, .. } => [*then, *otherwise].into_iter().max_by_key(|s| self.depth(*s)),
        };
        std::iter::successors(Some(tree), below).filter_map(|at| match self.get(at)? {
            Csg::Node(node) => Some(node.definition),
            Csg::Choice { .. } => None,
        })
    }

    /// Adds a node; also says how many nodes are on its longest path.
    pub(crate) fn node(&mut self, node: CsgNode) -> (CsgId, u64) {
        let depth = 1 + node.subs.iter().map(|s| self.depth(*s)).max().unwrap_or(0);
        let new = CsgId(id(self.trees.len()));
        self.trees.push((Csg::Node(node), depth));
        (new, depth)
    }

    /// The tree `then` where `cond` holds, else `otherwise`.
    pub(crate) fn choice(&mut self, cond: NodeId, then: CsgId, otherwise: CsgId) -> CsgId {
        if then == otherwise {
            return then;
        }
        let depth = self.depth(then).max(self.depth(otherwise));
        let new = CsgId(id(self.trees.len()));
        self.trees.push((Csg::Choice { cond, then, otherwise }, depth));
        new
    }

    /// The chain of what the impl of `definition` for `concept` builds when it runs for a node built by `parent`.
    pub(crate) fn link(&mut self, definition: DefinitionId, concept: ConceptId, parent: Option<LinkId>) -> LinkId {
        self.links.push(Link { definition, concept, parent });
        LinkId(id(self.links.len() - 1))
    }

    /// The impls of a chain, the nearest first.
    pub(crate) fn chain(&self, from: Option<LinkId>) -> impl Iterator<Item = (DefinitionId, ConceptId)> + '_ {
        let get = |l: LinkId| self.links.get(l.0 as usize).copied();
        std::iter::successors(from.and_then(get), move |l| l.parent.and_then(get)).map(|l| (l.definition, l.concept))
    }

    /// Whether `inner` is a proper part of `outer`, as far as looking at `budget` nodes can tell.
    pub(crate) fn contains(&self, outer: CsgId, inner: CsgId, budget: usize) -> bool {
        let mut open = vec![outer];
        for _ in 0..budget {
            let Some(tree) = open.pop() else { return false };
            let before = open.len();
            match self.get(tree) {
                Some(Csg::Node(node)) => open.extend(&node.subs),
                Some(Csg::Choice { then, otherwise, .. }) => open.extend([*then, *otherwise]),
                None => {}
            }
            if open.iter().skip(before).any(|t| *t == inner) {
                return true;
            }
        }
        false
    }
}
