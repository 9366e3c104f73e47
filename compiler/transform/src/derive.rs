//! Host queries become `diff` and `bound` nodes at the end of the graph, so that they mean exactly what those would
//! give inside the program (LANGUAGE 9.5). Knows scalars of the interface; knows neither types nor how queries are
//! written.

use isograd_graph::{
    Builder, Enclosure, Exhausted, Facts, Graph, Mode, Node, NodeId, Op, Part, Range, Scalar, Value, Watch,
};

use crate::continuity::jumps;
use crate::differentiate::Activity;
use crate::raw::RawCopy;

/// One wanted scalar: an output of the graph, differentiated by inputs, the first of `by` first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wanted {
    /// The name of the new output, unique.
    pub name: String,
    /// The output's index.
    pub output: usize,
    /// Indices of inputs.
    pub by: Vec<usize>,
}

/// What an input of the new graph is to an input of the old one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Source {
    /// The same.
    Point(usize),
    /// The lower end of its range, if the host gives the ends in order.
    Start(usize),
    /// The other end.
    End(usize),
    /// How fast it changes along a direction.
    Direction(usize),
}

/// Outputs wanted of the new graph: an output of the old one, differentiated by inputs, then asked for in some form.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Asked {
    /// The names of the new outputs, unique; [`Form`] says how many there are.
    pub names: Vec<String>,
    /// The output's index.
    pub output: usize,
    /// Indices of inputs, the first differentiated by first.
    pub by: Vec<usize>,
    /// What is wanted of that.
    pub form: Form,
}

/// What is wanted of a value. Indices are of inputs of the old graph.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Form {
    /// The value. One output.
    Itself,
    /// Σ ∂f/∂xᵢ · dᵢ over these inputs x, whose directions d are inputs. One output; 0 where f does not depend on any.
    Directional(Vec<usize>),
    /// The enclosure where these inputs range over boxes. Three outputs: start, end, may be NaN.
    Enclosed(Vec<usize>),
    /// The same cut to the mean-value form (Moore, Kearfott & Cloud, Introduction to Interval Analysis, 2009, ch. 6).
    MeanValue(Vec<usize>),
    /// The upper end of ‖∇f‖ by these inputs, which range over boxes. Two outputs: that, and whether it may be NaN.
    Lipschitz(Vec<usize>),
}

/// A graph with the queries as outputs.
#[derive(Debug, Clone)]
pub struct Answering {
    /// The graph.
    pub graph: Graph,
    /// Per [`Asked`], for [`Form::MeanValue`] and [`Form::Lipschitz`]: whether the value is not known to be continuous
    /// in the inputs that range over boxes. The mean-value form then is the natural one.
    pub jumps: Vec<bool>,
}

/// Replaces the outputs of a raw graph by the wanted ones.
///
/// # Errors
/// If the budget is spent.
pub fn derive(graph: &Graph, wanted: &[Wanted], max_nodes: usize, watch: &dyn Watch) -> Result<Graph, Exhausted> {
    let inputs: Vec<(String, Source)> =
        graph.inputs.iter().enumerate().map(|(i, input)| (input.name.clone(), Source::Point(i))).collect();
    let asked: Vec<Asked> = wanted
        .iter()
        .map(|w| Asked { names: vec![w.name.clone()], output: w.output, by: w.by.clone(), form: Form::Itself })
        .collect();
    Ok(answer(graph, &inputs, &asked, max_nodes, watch)?.graph)
}

/// Replaces the inputs and outputs of a raw graph. An old input needs a [`Source::Point`] among the new ones unless
/// every form lets it range over a box; it must have all sources that forms name it with.
///
/// # Errors
/// If the budget is spent.
pub fn answer(
    graph: &Graph,
    inputs: &[(String, Source)],
    asked: &[Asked],
    max_nodes: usize,
    watch: &dyn Watch,
) -> Result<Answering, Exhausted> {
    let mut deriver = Deriver::new(graph, inputs, max_nodes, watch);
    deriver.copy_nodes();
    let depending = deriver.depending(asked);
    // A sum that looks like a value of the program is none.
    deriver.b.set_apart(true);
    let mut found = Vec::with_capacity(asked.len());
    for (asked, on) in asked.iter().zip(&depending) {
        let jumps = matches!(asked.form, Form::MeanValue(_) | Form::Lipschitz(_)) && deriver.jumps(asked);
        found.push(jumps);
        deriver.ask(asked, on, jumps);
        if let Some(why) = deriver.b.exhausted() {
            return Err(why);
        }
    }
    Ok(Answering { graph: deriver.b.finish()?, jumps: found })
}

/// The new inputs of one old input.
#[derive(Debug, Clone, Copy)]
struct Places {
    point: NodeId,
    start: NodeId,
    end: NodeId,
    direction: NodeId,
}

struct Deriver<'g, 'w> {
    graph: &'g Graph,
    copy: RawCopy<'g>,
    /// The inputs of the old graph.
    inputs: Vec<NodeId>,
    places: Vec<Places>,
    b: Builder<'w>,
}

impl<'g, 'w> Deriver<'g, 'w> {
    /// With all new inputs, which stand before everything else.
    fn new(graph: &'g Graph, inputs: &[(String, Source)], max_nodes: usize, watch: &'w dyn Watch) -> Self {
        let mut b = Builder::new(Mode::Raw, max_nodes, watch);
        let none = Places { point: NodeId::NONE, start: NodeId::NONE, end: NodeId::NONE, direction: NodeId::NONE };
        let mut places = vec![none; graph.inputs.len()];
        for (name, source) in inputs {
            let (Source::Point(i) | Source::Start(i) | Source::End(i) | Source::Direction(i)) = *source;
            let scalar = graph.inputs.get(i).map_or(Scalar::Real, |input| input.scalar);
            let node = b.input(name.as_str(), scalar);
            let Some(places) = places.get_mut(i) else { continue };
            match source {
                Source::Point(_) => places.point = node,
                Source::Start(_) => places.start = node,
                Source::End(_) => places.end = node,
                Source::Direction(_) => places.direction = node,
            }
        }
        for (places, input) in places.iter_mut().zip(&graph.inputs) {
            if places.point == NodeId::NONE {
                // The value of what ranges over a box does not matter (LANGUAGE 15.3), but it is a value of its own.
                let any =
                    if places.start == NodeId::NONE { b.constant(Value::zero(input.scalar)) } else { places.start };
                places.point = b.fresh(any);
            }
        }
        let of = |i: usize| graph.iter().find(|(_, n)| *n == Node::Input(u32::try_from(i).unwrap_or(u32::MAX)));
        let inputs = (0..graph.inputs.len()).map(|i| of(i).map_or(NodeId::NONE, |(id, _)| id)).collect();
        Self { graph, copy: RawCopy::new(graph), inputs, places, b }
    }

    fn copy_nodes(&mut self) {
        for (id, node) in self.graph.iter() {
            match node {
                Node::Input(i) => self.copy.set(id, self.places.get(i as usize).map_or(NodeId::NONE, |p| p.point)),
                _ => {
                    self.copy.node(&mut self.b, id, node);
                }
            }
        }
    }

    /// Per query: those of its form's inputs that its output depends on. A product with a derivative that is
    /// structurally 0 must not be formed (LANGUAGE 13.7).
    fn depending(&self, asked: &[Asked]) -> Vec<Vec<usize>> {
        let mut depending = vec![Vec::new(); asked.len()];
        let mut seeds: Vec<(NodeId, usize)> = Vec::new();
        for (asked, _) in asked.iter().zip(&depending) {
            seeds.extend(asked.form.over().iter().filter_map(|i| Some((*self.inputs.get(*i)?, *i))));
        }
        seeds.sort_unstable();
        seeds.dedup();
        for batch in seeds.chunks(64) {
            let nodes: Vec<NodeId> = batch.iter().map(|(node, _)| *node).collect();
            let activity = Activity::of(self.graph, &nodes);
            for (asked, on) in asked.iter().zip(&mut depending) {
                let Some(output) = self.graph.outputs.get(asked.output) else { continue };
                let active = activity.active(output.node);
                let of_form = batch.iter().enumerate().filter(|(_, (_, i))| asked.form.over().contains(i));
                on.extend(of_form.filter(|(bit, _)| active & (1 << bit) != 0).map(|(_, (_, i))| *i));
            }
        }
        depending
    }

    /// Whether a value may jump while inputs range over boxes.
    fn jumps(&self, asked: &Asked) -> bool {
        let over: Vec<NodeId> = asked.form.over().iter().filter_map(|i| self.inputs.get(*i).copied()).collect();
        let Some(output) = self.graph.outputs.get(asked.output) else { return true };
        jumps(self.graph, output.node, asked.by.len(), &over)
    }

    fn places(&self, input: usize) -> Option<Places> {
        self.places.get(input).copied()
    }

    fn places_of(&self, inputs: &[usize]) -> Vec<Places> {
        inputs.iter().filter_map(|i| self.places(*i)).collect()
    }

    /// Makes the outputs of one query; `on` are the inputs of its form that matter.
    fn ask(&mut self, asked: &Asked, on: &[usize], jumps: bool) {
        let Some(output) = self.graph.outputs.get(asked.output) else { return };
        let mut value = self.copy.to(output.node);
        for by in &asked.by {
            let Some(places) = self.places(*by) else { continue };
            value = self.diff(value, places.point);
        }
        let made = match &asked.form {
            Form::Itself => vec![value],
            Form::Directional(_) => vec![self.directional(value, on)],
            Form::Enclosed(over) => {
                let range = self.enclosed(value, over);
                vec![range.lo, range.hi, range.nan]
            }
            Form::MeanValue(over) => {
                let mut range = self.enclosed(value, over);
                if !jumps {
                    range = self.mean_value(value, range, over, on);
                }
                vec![range.lo, range.hi, range.nan]
            }
            Form::Lipschitz(over) => {
                let range = self.gradient_norm(value, over, on);
                vec![range.hi, range.nan]
            }
        };
        for (name, node) in asked.names.iter().zip(made) {
            self.b.output(name.as_str(), node);
        }
    }

    /// Only reals vary continuously (LANGUAGE 9.5).
    fn diff(&mut self, value: NodeId, wrt: NodeId) -> NodeId {
        let (of, by) = (self.b.graph().scalar(value), self.b.graph().scalar(wrt));
        if of == Scalar::Real && by == Scalar::Real { self.b.diff(value, wrt) } else { value }
    }

    /// Σ ∂f/∂xᵢ · dᵢ. Not the tangent of t ↦ f(x + t·d), which at a kink follows other conventions.
    fn directional(&mut self, value: NodeId, on: &[usize]) -> NodeId {
        let mut sum = None;
        for places in self.places_of(on) {
            let partial = self.b.diff(value, places.point);
            let term = self.b.mul(partial, places.direction);
            sum = Some(match sum {
                Some(sum) => self.b.add(sum, term),
                None => term,
            });
        }
        sum.unwrap_or_else(|| self.b.real(0.0))
    }

    /// The box of these inputs.
    fn box_of(&mut self, over: &[usize]) -> NodeId {
        let no = self.b.bool(false);
        let components: Vec<_> = self.places_of(over).into_iter().map(|p| (p.point, p.start, p.end, no)).collect();
        self.b.within(&components)
    }

    /// What encloses a value over boxes, as `bound` gives it.
    fn enclosed(&mut self, value: NodeId, over: &[usize]) -> Range {
        let within = self.box_of(over);
        self.bound(value, within)
    }

    fn bound(&mut self, value: NodeId, within: NodeId) -> Range {
        if within == NodeId::NONE {
            let nan = self.b.ne(value, value);
            return Range { lo: value, hi: value, nan, tidy: false };
        }
        let [lo, hi, nan] = Part::ALL.map(|part| self.b.bound(value, within, part));
        Range { lo, hi, nan, tidy: false }
    }

    /// f(c) + Σ ∂f/∂xᵢ(X)·(Xᵢ − cᵢ) with c the middle of the box X, cut to the natural enclosure; that alone where the
    /// box or a partial derivative is unbounded or anything may be NaN. By the mean value theorem, which also holds of
    /// the generalised derivatives that enclose kinks, every exact value lies inside.
    fn mean_value(&mut self, value: NodeId, natural: Range, over: &[usize], on: &[usize]) -> Range {
        let within = self.box_of(over);
        let no = self.b.bool(false);
        let mut usable = self.b.not(natural.nan);
        let mut centre = Vec::new();
        let mut terms = Vec::new();
        for places in self.places_of(on) {
            let x = Range { lo: places.start, hi: places.end, nan: no, tidy: false }.tidied(&mut self.b);
            let c = self.middle(x);
            let partial = self.b.diff(value, places.point);
            let partial = self.bound(partial, within);
            for bounded in [c, partial.lo, partial.hi] {
                let bounded = self.finite(bounded);
                usable = self.b.and(usable, bounded);
            }
            usable = self.and_not(usable, partial.nan);
            centre.push((places.point, c, c, no));
            let c = Enclosure::Real(Range { lo: c, hi: c, nan: no, tidy: true });
            let off = self.b.enclose(Op::Sub, &[Enclosure::Real(x), c], Facts::default());
            terms.push(self.b.enclose(Op::Mul, &[Enclosure::Real(partial), off], Facts::default()));
        }
        if terms.is_empty() {
            return natural;
        }
        let at_centre = self.b.within(&centre);
        let mut sum = Enclosure::Real(self.bound(value, at_centre));
        for term in terms {
            sum = self.b.enclose(Op::Add, &[sum, term], Facts::default());
        }
        let Enclosure::Real(mean) = sum.tidied(&mut self.b) else { return natural };
        usable = self.and_not(usable, mean.nan);
        let (lo, hi) = (self.b.max(natural.lo, mean.lo), self.b.min(natural.hi, mean.hi));
        let (lo, hi) = (self.b.select(usable, lo, natural.lo), self.b.select(usable, hi, natural.hi));
        Range { lo, hi, ..natural }
    }

    /// A number of a tidy range: the middle if that is one.
    fn middle(&mut self, x: Range) -> NodeId {
        let half = self.b.real(0.5);
        let (lo, hi) = (self.b.mul(half, x.lo), self.b.mul(half, x.hi));
        let middle = self.b.add(lo, hi);
        let (above, below) = (self.b.le(x.lo, middle), self.b.le(middle, x.hi));
        let inside = self.b.and(above, below);
        self.b.select(inside, middle, x.lo)
    }

    fn finite(&mut self, x: NodeId) -> NodeId {
        let infinity = self.b.real(f64::INFINITY);
        let magnitude = self.b.abs(x);
        self.b.lt(magnitude, infinity)
    }

    fn and_not(&mut self, a: NodeId, b: NodeId) -> NodeId {
        let not = self.b.not(b);
        self.b.and(a, not)
    }

    /// √Σ (∂f/∂xᵢ)² over boxes (LANGUAGE 15.7).
    fn gradient_norm(&mut self, value: NodeId, over: &[usize], on: &[usize]) -> Range {
        let within = self.box_of(over);
        let mut partials = Vec::new();
        for places in self.places_of(on) {
            let partial = self.b.diff(value, places.point);
            partials.push(Enclosure::Real(self.bound(partial, within)));
        }
        let same = Facts { same: true, ..Facts::default() };
        let norm = match partials.as_slice() {
            [] => {
                let zero = self.b.real(0.0);
                Enclosure::point(&mut self.b, zero)
            }
            [only] => self.b.enclose(Op::Abs, &[*only], Facts::default()),
            [first, rest @ ..] => {
                let mut sum = self.b.enclose(Op::Mul, &[*first, *first], same);
                for partial in rest {
                    let square = self.b.enclose(Op::Mul, &[*partial, *partial], same);
                    sum = self.b.enclose(Op::Add, &[sum, square], Facts::default());
                }
                self.b.enclose(Op::Sqrt, &[sum], Facts::default())
            }
        };
        match norm.tidied(&mut self.b) {
            Enclosure::Real(range) => range,
            Enclosure::Int { .. } | Enclosure::Bool { .. } => Range::of(&mut self.b, value, value),
        }
    }
}

impl Form {
    /// The inputs that the form is about, ascending or not.
    fn over(&self) -> &[usize] {
        match self {
            Self::Itself => &[],
            Self::Directional(over) | Self::Enclosed(over) | Self::MeanValue(over) | Self::Lipschitz(over) => over,
        }
    }
}
