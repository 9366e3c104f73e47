//! The report of kinks: beside the results, how far the nearest place is where their derivatives do not exist or follow
//! a convention (LANGUAGE 13.6), on the path that the evaluation took. Knows kinks from the op table only, and nothing
//! of source text.
//!
//! Each value that a kink can reach carries a *shadow*, as a tangent goes beside a value: the discriminant nearest to 0
//! on the way to it, and which kink that is. An operation passes on the nearest of its operands' shadows and of its own;
//! where one operand is chosen, or one side of a branch, its shadow is. Two kinds are carried apart. *Creases* matter
//! along the paths that derivatives take. *Jumps*, which comparisons are too, matter through conditions and piecewise
//! constant operations as well: what depends on a jump jumps. A kink counts where some operand moves with what is
//! differentiated by: `length(max(q, 0))` has none where both constants were chosen.

use isograd_graph::ops::{Derivative, Discriminant, Kink, Partial};
use isograd_graph::{Builder, Exhausted, Graph, Mode, Node, NodeId, Op, Origin, Scalar, Watch};

use crate::differentiate::{Activity, Diff, carried_finals};
use crate::live::live;
use crate::raw::RawCopy;

/// What a report of kinks is about.
#[derive(Debug, Clone, PartialEq)]
pub struct KinkReport {
    /// Names of its outputs. A bool, whether the distance is at most `tolerance`. A real, the distance: the size of the
    /// nearest discriminant, +∞ without any. An int, the number of that kink, −1 without any. An int, the sign of the
    /// discriminant, 1 without any.
    pub names: [String; 4],
    /// Indices of the inputs that derivatives are by.
    pub by: Vec<usize>,
    /// How near is near.
    pub tolerance: f64,
    /// Whether the graph has been made smooth: the corners and comparisons in it are parts of smooth formulas.
    pub smooth: bool,
}

/// A place of a graph that has a kink.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KinkPlace {
    /// The operation.
    pub op: Op,
    /// Where it comes from.
    pub origin: Origin,
}

/// Adds the outputs of a report on the first `results` outputs of a raw graph whose live `diff`s and `bound`s are
/// expanded. Also returns the places that its numbers mean. A discriminant that is NaN or infinite is far.
///
/// # Errors
/// If the budget is spent.
pub fn kinks(
    graph: &Graph,
    results: usize,
    report: &KinkReport,
    max_nodes: usize,
    watch: &dyn Watch,
) -> Result<(Graph, Vec<KinkPlace>), Exhausted> {
    let is_real = |id: NodeId| graph.scalar(id) == Scalar::Real;
    let inputs = graph.iter().filter(|(_, node)| matches!(node, Node::Input(_))).enumerate();
    let seeds: Vec<NodeId> =
        inputs.filter(|(i, (id, _))| report.by.contains(i) && is_real(*id)).map(|(_, (id, _))| id).collect();
    let results: Vec<NodeId> = graph.outputs.iter().take(results).map(|o| o.node).filter(|id| is_real(*id)).collect();
    let mut only = graph.clone();
    only.outputs.retain(|o| results.contains(&o.node));
    let activity = Activity::together(graph, &seeds);
    let asked = |wrt: NodeId| results.iter().map(move |value| Diff { node: NodeId::NONE, value: *value, wrt });
    let diffs: Vec<Diff> = seeds.first().into_iter().flat_map(|seed| asked(*seed)).collect();
    let mut sweep = Sweep {
        graph,
        live: live(&only),
        needed: activity.needed(&diffs),
        active: graph.iter().map(|(id, _)| activity.active(id) != 0).collect(),
        reached: vec![Chains::NONE; graph.len()],
        b: Builder::new(Mode::Raw, max_nodes, watch),
        copy: RawCopy::new(graph),
        shadows: vec![Shadows::default(); graph.len()],
        moves: vec![Moves::Never; graph.len()],
        far: None,
        places: Vec::new(),
        smooth: report.smooth,
    };
    sweep.reach();
    for (id, node) in graph.iter() {
        sweep.node(id, node);
        if let Some(why) = sweep.b.exhausted() {
            return Err(why);
        }
    }
    sweep.finish(&results, report)
}

/// Which chains of shadows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Chains {
    creases: bool,
    jumps: bool,
}

impl Chains {
    const NONE: Self = Self { creases: false, jumps: false };
    const JUMPS: Self = Self { creases: false, jumps: true };
    const BOTH: Self = Self { creases: true, jumps: true };

    const fn and(self, other: Self) -> Self {
        Self { creases: self.creases & other.creases, jumps: self.jumps & other.jumps }
    }

    const fn or(self, other: Self) -> Self {
        Self { creases: self.creases | other.creases, jumps: self.jumps | other.jumps }
    }
}

/// When a value moves.
#[derive(Debug, Clone, Copy)]
enum Moves {
    Never,
    Always,
    /// If this truth value of the new graph holds.
    When(NodeId),
}

/// What goes beside a value on one chain.
#[derive(Debug, Clone, Copy)]
struct Shadow {
    /// The nearest discriminant, never NaN.
    off: NodeId,
    /// The number of its kink.
    kink: NodeId,
}

/// What goes beside a value.
#[derive(Debug, Clone, Copy, Default)]
struct Shadows {
    creases: Option<Shadow>,
    jumps: Option<Shadow>,
}

impl Shadows {
    const fn cut(self, to: Chains) -> Self {
        Self { creases: if to.creases { self.creases } else { None }, jumps: if to.jumps { self.jumps } else { None } }
    }

    const fn chains(self) -> Chains {
        Chains { creases: self.creases.is_some(), jumps: self.jumps.is_some() }
    }
}

/// An operand whose shadow an operation passes on.
#[derive(Debug, Clone, Copy)]
struct Flow {
    from: NodeId,
    chains: Chains,
}

/// How shadows go through an operation.
struct Passage {
    /// Operands that count whatever happens.
    always: Vec<Flow>,
    /// Two operands of which one is chosen, if the condition holds the first.
    either: Option<(Discriminant, Flow, Flow)>,
}

impl Passage {
    fn of(op: Op, args: &[NodeId]) -> Self {
        let (cond, then, otherwise): (Discriminant, _, _) = match (&op.def().derivative, op) {
            (Derivative::Choice { cond, then, otherwise }, _) => (*cond, *then, *otherwise),
            (_, Op::SelectInt | Op::SelectBool) => (|_, args| args.first().copied().unwrap_or(NodeId::NONE), 1, 2),
            (derivative, _) => {
                let chains = |k: usize| match derivative {
                    Derivative::Partials(partials) if !matches!(partials.get(k), None | Some(Partial::Zero)) => {
                        Chains::BOTH
                    }
                    _ => Chains::JUMPS,
                };
                let always = args.iter().enumerate().map(|(k, x)| Flow { from: *x, chains: chains(k) }).collect();
                return Self { always, either: None };
            }
        };
        let side = |k: usize| args.get(k).map(|x| Flow { from: *x, chains: Chains::BOTH });
        let beside = args.iter().enumerate().filter(|(k, _)| *k != then && *k != otherwise);
        Self {
            always: beside.map(|(_, x)| Flow { from: *x, chains: Chains::JUMPS }).collect(),
            either: side(then).zip(side(otherwise)).map(|(then, otherwise)| (cond, then, otherwise)),
        }
    }

    fn flows(&self) -> impl Iterator<Item = Flow> + '_ {
        let either = self.either.iter().flat_map(|(_, then, otherwise)| [*then, *otherwise]);
        self.always.iter().copied().chain(either)
    }
}

struct Sweep<'g, 'w> {
    graph: &'g Graph,
    /// Whether a result needs the value at all.
    live: Vec<bool>,
    /// Not 0 where a derivative of a result goes through the value.
    needed: Vec<u64>,
    /// Whether the value has a derivative.
    active: Vec<bool>,
    /// The chains on which some kink reaches the value.
    reached: Vec<Chains>,
    b: Builder<'w>,
    copy: RawCopy<'g>,
    shadows: Vec<Shadows>,
    /// Whether a real moves, on the path taken, with what is differentiated by.
    moves: Vec<Moves>,
    /// No kink, a constant of the outermost region; made after the inputs.
    far: Option<Shadow>,
    places: Vec<KinkPlace>,
    smooth: bool,
}

impl Sweep<'_, '_> {
    /// The chains that serve some result at a node.
    fn serving(&self, id: NodeId) -> Chains {
        let live = self.live(id);
        Chains { creases: live && self.needed.get(id.index()).is_some_and(|bits| *bits != 0), jumps: live }
    }

    fn reached(&self, id: NodeId) -> Chains {
        self.reached.get(id.index()).copied().unwrap_or(Chains::NONE)
    }

    /// The chain on which an operation has a kink of its own, if an operand that it depends on moves.
    fn own(&self, op: Op, args: &[NodeId]) -> Chains {
        let moves = args.iter().any(|x| self.is_active(*x));
        let smoothed = matches!(op, Op::Min | Op::Max | Op::Abs | Op::Sign | Op::Lt | Op::Le);
        match op.def().kink {
            _ if self.smooth && smoothed => Chains::NONE,
            Kink::Where { jumps, .. } if moves => Chains { creases: !jumps, jumps },
            _ => Chains::NONE,
        }
    }

    /// The gamma or theta of an end.
    fn begin(&self, end: NodeId) -> NodeId {
        match self.graph.get(end) {
            Some(Node::End { begin }) => begin,
            _ => NodeId::NONE,
        }
    }

    fn condition(&self, end: NodeId) -> NodeId {
        match self.graph.get(self.begin(end)) {
            Some(Node::Gamma { cond, .. }) => cond,
            _ => NodeId::NONE,
        }
    }

    /// The ends of a loop's counter: how often the loop runs jumps with them.
    fn counts(&self, theta: NodeId) -> [NodeId; 2] {
        match self.graph.get(theta) {
            Some(Node::Theta { lo, hi, .. }) => [lo, hi],
            _ => [NodeId::NONE; 2],
        }
    }

    /// Finds the chains that reach each value. A loop is swept until its end tells its variables no more.
    fn reach(&mut self) {
        let mut at = NodeId(0);
        while let Some(node) = self.graph.get(at) {
            let again = match node {
                Node::End { begin } => self.close(at).then_some(begin),
                _ => {
                    let chains = self.reaching(node).and(self.serving(at)).or(self.reached(at));
                    if let Some(place) = self.reached.get_mut(at.index()) {
                        *place = chains;
                    }
                    None
                }
            };
            at = NodeId(again.unwrap_or(at).0 + 1);
        }
    }

    fn reaching(&self, node: Node) -> Chains {
        let jumps = |x: NodeId| self.reached(x).and(Chains::JUMPS);
        match node {
            Node::Apply(op, args) => {
                let args = args.as_slice();
                let flows = Passage::of(op, args);
                flows.flows().fold(self.own(op, args), |sum, x| sum.or(self.reached(x.from).and(x.chains)))
            }
            Node::Fresh(x) => self.reached(x),
            Node::Counter { theta } => self.counts(theta).into_iter().fold(Chains::NONE, |sum, x| sum.or(jumps(x))),
            Node::Carried { theta, init } => {
                self.counts(theta).into_iter().fold(self.reached(init), |sum, x| sum.or(jumps(x)))
            }
            Node::Join { end, then, otherwise } => {
                self.reached(then).or(self.reached(otherwise)).or(jumps(self.condition(end)))
            }
            Node::Final { carried, .. } => self.reached(carried),
            _ => Chains::NONE,
        }
    }

    /// At the end of a loop, what reaches the next content of a variable reaches the variable. Whether that was news.
    fn close(&mut self, end: NodeId) -> bool {
        let mut news = false;
        for (_, carried, next) in carried_finals(self.graph, end) {
            let before = self.reached(carried);
            let after = before.or(self.reached(next).and(self.serving(carried)));
            if let Some(place) = self.reached.get_mut(carried.index()) {
                *place = after;
            }
            news |= before != after;
        }
        news
    }

    /// Copies a node and makes what goes beside it.
    fn node(&mut self, id: NodeId, node: Node) {
        if !matches!(node, Node::Input(_)) {
            self.far();
        }
        if let Node::Theta { end, .. } = node {
            self.enter(id, end);
        }
        self.copy.node(&mut self.b, id, node);
        self.b.set_apart(true);
        if self.live(id) && self.is_active(id) {
            let moves = self.moving(node);
            if let Some(place) = self.moves.get_mut(id.index()) {
                *place = moves;
            }
        }
        self.shade(id, node);
        self.b.set_apart(false);
    }

    /// Makes the shadows of a node.
    fn shade(&mut self, id: NodeId, node: Node) {
        let chains = self.reached(id);
        if chains == Chains::NONE {
            return;
        }
        let shadows = match node {
            Node::Apply(op, args) => {
                let at = KinkPlace { op, origin: self.graph.origin(id) };
                self.apply(at, args.as_slice(), chains)
            }
            Node::Fresh(x) => self.shadows(x),
            Node::Counter { theta } => self.counted(theta),
            // Made before the loop; only the constants for the first iteration become variables.
            Node::Carried { .. } => {
                let init = self.shadows(id);
                self.each(chains, |this, chain| {
                    let init = chain(init).unwrap_or_else(|| this.far());
                    Some(Shadow { off: this.b.carried(init.off), kink: this.b.carried(init.kink) })
                })
            }
            Node::Final { end, carried, next } => {
                let (carried, next, end) = (self.shadows(carried), self.shadows(next), self.copy.to(end));
                self.each(chains, |this, chain| {
                    let (carried, next) = (chain(carried)?, chain(next).unwrap_or_else(|| this.far()));
                    let off = this.b.carry_out(end, carried.off, next.off);
                    Some(Shadow { off, kink: this.b.carry_out(end, carried.kink, next.kink) })
                })
            }
            Node::Join { end, then, otherwise } => {
                let (then, otherwise, to) = (self.shadows(then), self.shadows(otherwise), self.copy.to(end));
                let cond = self.shadows(self.condition(end)).cut(Chains::JUMPS);
                let taken = self.each(chains, |this, chain| {
                    let sides = (chain(then), chain(otherwise));
                    if let (None, None) = sides {
                        return None;
                    }
                    let (then, otherwise) =
                        (sides.0.unwrap_or_else(|| this.far()), sides.1.unwrap_or_else(|| this.far()));
                    let off = this.b.join(to, then.off, otherwise.off);
                    Some(Shadow { off, kink: this.b.join(to, then.kink, otherwise.kink) })
                });
                self.nearest(cond, taken)
            }
            _ => Shadows::default(),
        };
        self.set(id, shadows.cut(chains));
    }

    /// When an active value moves.
    fn moving(&mut self, node: Node) -> Moves {
        match node {
            Node::Apply(op, args) => {
                let args = args.as_slice();
                let Some((cond, then, otherwise)) = Passage::of(op, args).either else { return self.any(args) };
                let (then, otherwise) = (self.moves(then.from), self.moves(otherwise.from));
                if let (Moves::Always, Moves::Always) = (then, otherwise) {
                    return Moves::Always;
                }
                let operands: Vec<NodeId> = args.iter().map(|x| self.copy.to(*x)).collect();
                let cond = cond(&mut self.b, &operands);
                let (then, otherwise) = (self.truth(then), self.truth(otherwise));
                Moves::When(self.b.select_bool(cond, then, otherwise))
            }
            Node::Fresh(x) => self.moves(x),
            Node::Carried { init, .. } => {
                let init = self.moves(init);
                let init = self.truth(init);
                Moves::When(self.b.carried(init))
            }
            Node::Final { end, carried, next } => {
                let (carried, next) = (self.moves(carried), self.moves(next));
                let (carried, next) = (self.truth(carried), self.truth(next));
                Moves::When(self.b.carry_out(self.copy.to(end), carried, next))
            }
            Node::Join { end, then, otherwise } => match (self.moves(then), self.moves(otherwise)) {
                (Moves::Always, Moves::Always) => Moves::Always,
                (then, otherwise) => {
                    let (then, otherwise) = (self.truth(then), self.truth(otherwise));
                    Moves::When(self.b.join(self.copy.to(end), then, otherwise))
                }
            },
            // What is differentiated by, and derivatives in dead code.
            _ => Moves::Always,
        }
    }

    /// When any of these moves.
    fn any(&mut self, of: &[NodeId]) -> Moves {
        let mut any = Moves::Never;
        for x in of {
            any = match (any, self.moves(*x)) {
                (Moves::Always, _) | (_, Moves::Always) => return Moves::Always,
                (Moves::When(a), Moves::When(b)) => Moves::When(self.b.or(a, b)),
                (Moves::Never, other) | (other, Moves::Never) => other,
            };
        }
        any
    }

    fn moves(&self, id: NodeId) -> Moves {
        self.moves.get(id.index()).copied().unwrap_or(Moves::Never)
    }

    fn truth(&mut self, moves: Moves) -> NodeId {
        match moves {
            Moves::Never => self.b.bool(false),
            Moves::Always => self.b.bool(true),
            Moves::When(truth) => truth,
        }
    }

    fn live(&self, id: NodeId) -> bool {
        self.live.get(id.index()).copied().unwrap_or(false)
    }

    fn is_active(&self, id: NodeId) -> bool {
        self.active.get(id.index()).copied().unwrap_or(false)
    }

    /// Before a loop: what its variables' shadows are at first. The loop's region must not contain it.
    fn enter(&mut self, theta: NodeId, end: NodeId) {
        let variables = (theta.0 + 1..end.0).map(NodeId).filter_map(|id| match self.graph.get(id) {
            Some(Node::Carried { theta: of, init }) if of == theta => Some((id, init)),
            _ => None,
        });
        let variables: Vec<_> = variables.filter(|(id, _)| self.reached(*id) != Chains::NONE).collect();
        self.b.set_apart(true);
        for (id, init) in variables {
            let (counted, init) = (self.counted(theta), self.shadows(init));
            let first = self.nearest(counted, init);
            self.set(id, first);
        }
        self.b.set_apart(false);
    }

    /// The jumps of how often a loop runs.
    fn counted(&mut self, theta: NodeId) -> Shadows {
        let [lo, hi] = self.counts(theta).map(|x| self.shadows(x).cut(Chains::JUMPS));
        self.nearest(lo, hi)
    }

    fn apply(&mut self, at: KinkPlace, args: &[NodeId], chains: Chains) -> Shadows {
        let operands: Vec<NodeId> = args.iter().map(|x| self.copy.to(*x)).collect();
        let passage = Passage::of(at.op, args);
        let mut sum = Shadows::default();
        for flow in &passage.always {
            let shadows = self.shadows(flow.from).cut(flow.chains);
            sum = self.nearest(sum, shadows);
        }
        if let Some((cond, then, otherwise)) = passage.either {
            let (then, otherwise) = (self.shadows(then.from), self.shadows(otherwise.from));
            if then.chains().or(otherwise.chains()) != Chains::NONE {
                let cond = cond(&mut self.b, &operands);
                let chosen = self.each(chains, |this, chain| {
                    let sides = (chain(then), chain(otherwise));
                    if let (None, None) = sides {
                        return None;
                    }
                    let (then, otherwise) =
                        (sides.0.unwrap_or_else(|| this.far()), sides.1.unwrap_or_else(|| this.far()));
                    let off = this.b.select(cond, then.off, otherwise.off);
                    Some(Shadow { off, kink: this.b.select_int(cond, then.kink, otherwise.kink) })
                });
                sum = self.nearest(sum, chosen);
            }
        }
        let own = self.own(at.op, args).and(chains);
        if own == Chains::NONE {
            return sum;
        }
        let Kink::Where { discriminant, .. } = at.op.def().kink else { return sum };
        let mut off = discriminant(&mut self.b, &operands);
        if let Moves::When(moves) = self.any(args) {
            let far = self.far();
            off = self.b.select(moves, off, far.off);
        }
        let kink = self.b.int(i32::try_from(self.places.len()).unwrap_or(i32::MAX));
        self.places.push(at);
        let own = self.each(own, |this, chain| {
            // The discriminant may be NaN, which is nearer than nothing.
            let before = chain(sum).unwrap_or_else(|| this.far());
            Some(this.nearer(before, Shadow { off, kink }))
        });
        Shadows { creases: own.creases.or(sum.creases), jumps: own.jumps.or(sum.jumps) }
    }

    /// Makes a shadow for each of the chains; the function is given what takes that chain's shadow from others.
    fn each(
        &mut self,
        chains: Chains,
        mut make: impl FnMut(&mut Self, fn(Shadows) -> Option<Shadow>) -> Option<Shadow>,
    ) -> Shadows {
        Shadows {
            creases: if chains.creases { make(self, |s| s.creases) } else { None },
            jumps: if chains.jumps { make(self, |s| s.jumps) } else { None },
        }
    }

    fn nearest(&mut self, a: Shadows, b: Shadows) -> Shadows {
        let chains = a.chains().or(b.chains());
        self.each(chains, |this, chain| match (chain(a), chain(b)) {
            (Some(a), Some(b)) => Some(this.nearer(a, b)),
            (a, b) => a.or(b),
        })
    }

    /// `b` where it is nearer to 0, else `a`.
    fn nearer(&mut self, a: Shadow, b: Shadow) -> Shadow {
        let (from_a, from_b) = (self.b.abs(a.off), self.b.abs(b.off));
        let nearer = self.b.lt(from_b, from_a);
        Shadow { off: self.b.select(nearer, b.off, a.off), kink: self.b.select_int(nearer, b.kink, a.kink) }
    }

    fn far(&mut self) -> Shadow {
        match self.far {
            Some(far) => far,
            None => {
                let far = Shadow { off: self.b.real(f64::INFINITY), kink: self.b.int(-1) };
                // What variables of loops hold at first: constants are found again wherever they are visible.
                let _ = [true, false].map(|x| self.b.bool(x));
                *self.far.insert(far)
            }
        }
    }

    fn shadows(&self, id: NodeId) -> Shadows {
        self.shadows.get(id.index()).copied().unwrap_or_default()
    }

    fn set(&mut self, id: NodeId, shadows: Shadows) {
        if let Some(place) = self.shadows.get_mut(id.index()) {
            *place = shadows;
        }
    }

    /// The report's outputs, after those that there were.
    fn finish(mut self, results: &[NodeId], report: &KinkReport) -> Result<(Graph, Vec<KinkPlace>), Exhausted> {
        for output in &self.graph.outputs {
            self.b.output(output.name.clone(), self.copy.to(output.node));
        }
        self.b.set_apart(true);
        let mut all = self.far();
        for result in results {
            let Shadows { creases, jumps } = self.shadows(*result);
            for shadow in [creases, jumps].into_iter().flatten() {
                all = self.nearer(all, shadow);
            }
        }
        let tolerance = self.b.real(report.tolerance);
        let distance = self.b.abs(all.off);
        let near = self.b.le(distance, tolerance);
        let sign = self.b.sign(all.off);
        let side = self.b.real_to_int(sign);
        for (name, node) in report.names.iter().zip([near, distance, all.kink, side]) {
            self.b.output(name.as_str(), node);
        }
        Ok((self.b.finish()?, self.places))
    }
}
