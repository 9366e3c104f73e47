//! The peer: Fidget's native compiler, fed the same expressions and the same points. Uses it as its documentation
//! shows, at the lowest level, where nothing stands between the caller's slices and the machine code.

use fidget::context::{BadNode, Context, Node};
use fidget::eval::{BulkEvaluator, Function, MathFunction, Tape};
use fidget::jit::{JitBulkFn, JitFloatSliceEval, JitFunction, JitGradSliceEval};
use fidget::types::Grad;
use fidget::var::Var;

use crate::models::{Step, Steps};

/// An expression compiled for values and for gradients, with the points of one block.
pub struct Fidget {
    values: JitBulkFn<f32>,
    gradients: JitBulkFn<Grad>,
    float: JitFloatSliceEval,
    grad: JitGradSliceEval,
    columns: Vec<Vec<f32>>,
    grads: Vec<Vec<Grad>>,
}

impl Fidget {
    /// Compiles for the first `block` of the points.
    pub fn new(steps: &Steps, points: &[Vec<f32>; 3], block: usize) -> Result<Self, BadNode> {
        let mut context = Context::new();
        let root = import(&mut context, steps)?;
        let function = JitFunction::new(&context, &[root])?;
        let values = function.float_slice_tape(Default::default());
        let gradients = function.grad_slice_tape(Default::default());
        let unit = |axis: usize, x: f32| Grad::new(x, f32::from(axis == 0), f32::from(axis == 1), f32::from(axis == 2));
        let mut columns = vec![Vec::new(); values.vars().len()];
        let mut grads = vec![Vec::new(); gradients.vars().len()];
        for (axis, (var, column)) in [Var::X, Var::Y, Var::Z].iter().zip(points).enumerate() {
            let column = &column[..block.min(column.len())];
            if let Some(place) = values.vars().get(var).and_then(|i| columns.get_mut(i)) {
                place.extend_from_slice(column);
            }
            if let Some(place) = gradients.vars().get(var).and_then(|i| grads.get_mut(i)) {
                place.extend(column.iter().map(|x| unit(axis, *x)));
            }
        }
        Ok(Self { values, gradients, float: JitFloatSliceEval::new(), grad: JitGradSliceEval::new(), columns, grads })
    }

    /// The values of the block.
    pub fn values(&mut self) -> Vec<f32> {
        self.float.eval(&self.values, &self.columns).map(|out| out[0].to_vec()).unwrap_or_default()
    }

    /// The values of the block, left in place.
    pub fn run_values(&mut self) {
        std::hint::black_box(self.float.eval(&self.values, &self.columns).is_ok());
    }

    /// Values and partial derivatives of the block.
    pub fn gradients(&mut self) -> Vec<Grad> {
        self.grad.eval(&self.gradients, &self.grads).map(|out| out[0].to_vec()).unwrap_or_default()
    }

    /// Values and partial derivatives of the block, left in place.
    pub fn run_gradients(&mut self) {
        std::hint::black_box(self.grad.eval(&self.gradients, &self.grads).is_ok());
    }
}

fn import(context: &mut Context, steps: &Steps) -> Result<Node, BadNode> {
    let mut nodes: Vec<Node> = Vec::with_capacity(steps.0.len());
    for step in &steps.0 {
        let node = match *step {
            Step::Axis(axis) => context.axes()[axis],
            Step::Constant(x) => context.constant(x),
            Step::Add(a, b) => context.add(nodes[a], nodes[b])?,
            Step::Sub(a, b) => context.sub(nodes[a], nodes[b])?,
            Step::Mul(a, b) if a == b => context.square(nodes[a])?,
            Step::Mul(a, b) => context.mul(nodes[a], nodes[b])?,
            Step::Div(a, b) => context.div(nodes[a], nodes[b])?,
            Step::Min(a, b) => context.min(nodes[a], nodes[b])?,
            Step::Max(a, b) => context.max(nodes[a], nodes[b])?,
            Step::Neg(a) => context.neg(nodes[a])?,
            Step::Abs(a) => context.abs(nodes[a])?,
            Step::Sqrt(a) => context.sqrt(nodes[a])?,
        };
        nodes.push(node);
    }
    Ok(nodes.last().copied().unwrap_or_else(|| context.constant(0.0)))
}
