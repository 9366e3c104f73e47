//! Devices that compute as badly as they may, and devices with a mistake: what the bounds must accept, and what they
//! must not. Knows nothing of intervals.

use isograd_graph::{Graph, Node, NodeId, Op, Value};

use super::Model;
use super::interval::{down, nearest, two_sum, ulp, up};
use super::walk::{Machine, Operation, Stop, Walk};
use crate::points::Random;

/// How a device uses the freedom that its model leaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// Each operation errs by any amount.
    Any,
    /// Each errs as much as it may, to either side.
    Extreme,
}

/// What is wrong with the operation of a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mistake {
    /// Its result is this much too large, relatively.
    Relative(f64),
    /// The second term of a sum is missing, or the second factor of a product.
    Missing,
    /// It is another operation on the same kinds.
    Other(Op),
}

/// A simulated device.
pub struct Device<'g> {
    graph: &'g Graph,
    walk: Option<Walk<'g, Value>>,
    computing: Computing<'g>,
}

struct Computing<'g> {
    graph: &'g Graph,
    model: Model,
    style: Style,
    random: Random,
    mistake: Option<(NodeId, Mistake)>,
}

impl<'g> Device<'g> {
    /// A device that runs a graph.
    #[must_use]
    pub fn new(graph: &'g Graph, model: Model, style: Style, seed: u64) -> Self {
        let computing = Computing { graph, model, style, random: Random::new(seed), mistake: None };
        Self { graph, walk: Some(Walk::new(graph, Value::Int(0))), computing }
    }

    /// The same device with a mistake.
    #[must_use]
    pub const fn with(mut self, node: NodeId, mistake: Mistake) -> Self {
        self.computing.mistake = Some((node, mistake));
        self
    }

    /// Its answer at a point; `None` if the graph takes too many steps.
    pub fn run(&mut self, inputs: &[Value]) -> Option<Vec<Value>> {
        let walk = self.walk.as_mut()?;
        walk.run(&mut self.computing, inputs).ok()?;
        Some(self.graph.outputs.iter().map(|output| walk.value(output.node)).collect())
    }
}

impl Machine for Computing<'_> {
    type Value = Value;

    fn given(&mut self, value: Value) -> Value {
        match value {
            Value::Real(x) => Value::Real(self.flushed(nearest(x))),
            other => other,
        }
    }

    fn apply(&mut self, o: &Operation<'_, Value>) -> Result<Value, Stop> {
        let mistake = self.mistake.and_then(|(node, mistake)| (node == o.node).then_some(mistake));
        let args: Vec<Value> = o.args.iter().map(|id| o.value(*id)).collect();
        Ok(match mistake {
            Some(Mistake::Missing) => args[0],
            Some(Mistake::Other(op)) => (op.def().eval.f32)(&args),
            Some(Mistake::Relative(by)) => match self.right(o, &args) {
                Value::Real(x) => Value::Real(nearest(x * (1.0 + by))),
                other => other,
            },
            None => self.right(o, &args),
        })
    }

    fn truth(&mut self, value: Value) -> Result<bool, Stop> {
        Ok(value == Value::Bool(true))
    }

    fn int(&mut self, value: Value) -> Result<i32, Stop> {
        if let Value::Int(x) = value { Ok(x) } else { Err(Stop::Special("not an int")) }
    }
}

impl Computing<'_> {
    /// The result as a device of this model may compute it.
    fn right(&mut self, o: &Operation<'_, Value>, args: &[Value]) -> Value {
        let usual = (o.op.def().eval.f32)(args);
        let Value::Real(result) = usual else { return usual };
        if !result.is_finite() {
            return usual;
        }
        let free = !self.model.nearest;
        let result = match (o.op, args) {
            (Op::Add, [Value::Real(a), Value::Real(b)]) if free => {
                let (s, e) = self.fused(o, 1.0).unwrap_or_else(|| two_sum(*a, *b));
                self.rounded(s, e)
            }
            (Op::Sub, [Value::Real(a), Value::Real(b)]) if free => {
                let (s, e) = self.fused(o, -1.0).unwrap_or_else(|| two_sum(*a, -*b));
                self.rounded(s, e)
            }
            (Op::Mul, [Value::Real(a), Value::Real(b)]) if free => self.rounded(a * b, 0.0),
            (Op::IntToReal, [Value::Int(n)]) if free => self.rounded(f64::from(*n), 0.0),
            (Op::Div, [Value::Real(a), Value::Real(b)]) if self.model.quotient > 0.0 && *a != 0.0 => {
                self.near(a / b, self.model.quotient)
            }
            (Op::Sqrt, [Value::Real(a)]) if self.model.root_by_inverse && *a > 0.0 => {
                let inverse = self.near(1.0 / a.sqrt(), 2.0);
                self.near(1.0 / inverse, self.model.quotient)
            }
            _ => result,
        };
        Value::Real(self.flushed(result))
    }

    /// x·y ± z without rounding the product, where an operand is one and chance wants it.
    fn fused(&mut self, o: &Operation<'_, Value>, sign: f64) -> Option<(f64, f64)> {
        if !self.model.contracts || self.random.chance(30) {
            return None;
        }
        let product = |id: NodeId| match self.graph.get(id) {
            Some(Node::Apply(Op::Mul, args)) => match args.as_slice() {
                [x, y] => match (o.value(*x), o.value(*y)) {
                    (Value::Real(x), Value::Real(y)) => Some(x * y),
                    _ => None,
                },
                _ => None,
            },
            _ => None,
        };
        let real = |k: usize| if let Value::Real(x) = o.arg(k) { x } else { f64::NAN };
        let (a, b) = (product(o.args[0]), product(o.args[1]));
        let sum = match (a, b) {
            (Some(a), _) if self.random.chance(50) || b.is_none() => two_sum(a, sign * real(1)),
            (_, Some(b)) => two_sum(real(0), sign * b),
            _ => return None,
        };
        sum.0.is_finite().then_some(sum)
    }

    /// x + e rounded to either neighbour.
    fn rounded(&mut self, x: f64, e: f64) -> f64 {
        let rounded = if self.random.chance(50) { down(x, e) } else { up(x, e) };
        if rounded.is_finite() { rounded } else { nearest(x) }
    }

    /// An f32 number at most so many units in the last place from x.
    fn near(&mut self, x: f64, ulps: f64) -> f64 {
        let far = ulps * ulp(x);
        let by = match self.style {
            Style::Any => self.random.within((-far, far)),
            Style::Extreme if self.random.chance(50) => far,
            Style::Extreme => -far,
        };
        // Rounded back towards x, so as not to be farther than allowed.
        let there = x + by;
        let there = if by > 0.0 { down(there, 0.0) } else { up(there, 0.0) };
        if there.is_finite() { there } else { nearest(x) }
    }

    fn flushed(&mut self, x: f64) -> f64 {
        let subnormal = x != 0.0 && x.abs() < f64::from(f32::MIN_POSITIVE);
        if self.model.flushes && subnormal && self.random.chance(50) { 0.0 } else { x }
    }
}
