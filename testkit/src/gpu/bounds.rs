//! What a conforming GPU may answer. Judges the results of a shader by intervals that are propagated through its graph
//! with the minimum precision of Vulkan or WGSL; knows nothing of devices, and of targets only what they may round.
//!
//! The bound of a value is the interval of everything that it can be on a conforming device: the image of the operands'
//! intervals, to first order Σ|∂f/∂xᵢ|·eᵢ, widened by the operation's own error. Where an interval straddles a decision
//! (comparison, floor, sign) the point is *ambiguous*: each choice is a run of its own, and the answer must lie within
//! the bounds of one of them. What a device need not compute at all (NaN, infinity, overflow, division by almost 0) is
//! not judged, and counted by its rule.

mod interval;
mod machine;
mod simulate;
mod tally;
mod walk;

use std::collections::BTreeMap;

use isograd_graph::{Graph, Value};

pub use simulate::{Device, Mistake, Style};
pub use tally::Tally;

use machine::{Bounds, Known};
use walk::{Stop, Walk};

/// How many combinations of choices are tried at an ambiguous point.
const CHOICES: usize = 64;

/// What a device promises.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Model {
    /// Whether `+ − ×` and conversions of ints round to nearest; else to either neighbour. What is representable is exact.
    pub nearest: bool,
    /// The error of a quotient, in units in the last place; 0 for rounding to nearest.
    pub quotient: f64,
    /// Whether √x is 1 / inversesqrt(x), the latter within 2 units in the last place; else rounded to nearest.
    pub root_by_inverse: bool,
    /// Whether subnormal numbers may be taken for 0.
    pub flushes: bool,
    /// Whether the sign of a 0 means nothing.
    pub unsigned_zeros: bool,
    /// Whether operations may be contracted and reordered.
    ///
    /// Little depends on it, where the direction of rounding is free. An interval has an end rounded down and one rounded
    /// up, so with two numbers it contains all between: for a·b the unrounded product, so that fma(a, b, c), which rounds a·b + c once, lies in the interval of
    /// the sum, rounding being monotone. Likewise it contains what exact arithmetic gives; a reordering that is "at least
    /// as accurate" (WGSL 15.7.5) lies between that and the ends. Only what relies on two uses of a value being the same
    /// number, as x − x = 0, fails if one of them is not rounded.
    pub contracts: bool,
}

impl Model {
    /// SPIR-V with `NoContraction`, as Vulkan's "Precision of Individual Operations" promises it without float controls.
    #[must_use]
    pub const fn vulkan() -> Self {
        Self {
            nearest: false,
            quotient: 2.5,
            root_by_inverse: true,
            flushes: true,
            unsigned_zeros: true,
            contracts: false,
        }
    }

    /// The same of a device that rounds to nearest and keeps the signs of zeros, as those do that say so
    /// (`shaderRoundingModeRTEFloat32`, `shaderSignedZeroInfNanPreserveFloat32`) and all others that are known. The
    /// kernels count on both: their splits of numbers and their roundings to integers stay what they are meant to be.
    #[must_use]
    pub const fn vulkan_to_nearest() -> Self {
        Self { nearest: true, unsigned_zeros: false, ..Self::vulkan() }
    }

    /// WGSL (15.7), which promises the same of each operation, and lets them be contracted.
    #[must_use]
    pub const fn webgpu() -> Self {
        Self { contracts: true, ..Self::vulkan() }
    }

    /// IEEE 754 with rounding to nearest: nothing but the bits of the reference is right.
    #[must_use]
    pub const fn exact() -> Self {
        Self {
            nearest: true,
            quotient: 0.0,
            root_by_inverse: false,
            flushes: false,
            unsigned_zeros: false,
            contracts: false,
        }
    }
}

/// What is to be said of the answer at a point.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// A conforming device may give it.
    Within {
        /// The largest distance of an output from the middle of its interval, the ends being at 1; 0 where the interval
        /// is a point.
        ratio: f64,
        /// The widest interval, half of it in units in the last place of its middle.
        ulps: f64,
        /// Whether the point is ambiguous: then another choice might have been accepted as well.
        ambiguous: bool,
    },
    /// No conforming device gives it.
    Outside {
        /// Which output.
        output: usize,
        /// The answer.
        got: Value,
        /// The middle of the interval, of the choices that come nearest.
        want: Value,
        /// Half the width of the interval.
        bound: f64,
    },
    /// There are more choices than were tried, and none of these fits: not judged.
    Ambiguous,
    /// The point meets what devices promise nothing about: not judged.
    Special(&'static str),
}

/// Judges answers of one graph, of precision f32 and after `kernels` for shaders.
pub struct Judge<'g> {
    graph: &'g Graph,
    walk: Walk<'g, Known>,
    model: Model,
}

/// The verdict on the outputs of a graph at one point.
#[must_use]
pub fn judge(graph: &Graph, model: Model, inputs: &[Value], got: &[Value]) -> Verdict {
    Judge::new(graph, model).judge(inputs, got)
}

impl<'g> Judge<'g> {
    /// Prepares a graph.
    #[must_use]
    pub fn new(graph: &'g Graph, model: Model) -> Self {
        Self { graph, walk: Walk::new(graph, Known::Lost("an unwritten value")), model }
    }

    /// The verdict on the outputs at one point.
    ///
    /// # Panics
    /// If there are not as many answers as outputs.
    pub fn judge(&mut self, inputs: &[Value], got: &[Value]) -> Verdict {
        assert_eq!(got.len(), self.graph.outputs.len(), "an answer for each output");
        let mut open = vec![BTreeMap::new()];
        let mut runs = 0;
        let (mut nearest, mut special, mut forked) = (None, None, false);
        while let Some(choices) = open.pop() {
            runs += 1;
            if runs > 2 * CHOICES {
                return Verdict::Ambiguous;
            }
            let mut machine = Bounds { model: self.model, graph: self.graph, choices };
            match self.walk.run(&mut machine, inputs) {
                Ok(()) => {}
                Err(Stop::Fork(step)) => {
                    forked = true;
                    for choice in [true, false] {
                        let mut choices = machine.choices.clone();
                        choices.insert(step, choice);
                        open.push(choices);
                    }
                    continue;
                }
                Err(Stop::Special(rule)) => {
                    special = Some(rule);
                    continue;
                }
            }
            match self.outputs(got) {
                Verdict::Within { ratio, ulps, ambiguous } => {
                    return Verdict::Within { ratio, ulps, ambiguous: ambiguous || forked };
                }
                Verdict::Special(rule) => special = Some(rule),
                outside => nearest = Some(nearer(nearest, outside)),
            }
        }
        match (special, nearest) {
            (Some(rule), _) => Verdict::Special(rule),
            (None, Some(outside)) => outside,
            (None, None) => Verdict::Ambiguous,
        }
    }

    /// The verdict on the answers of one combination of choices.
    fn outputs(&self, got: &[Value]) -> Verdict {
        let (mut ratio, mut ulps, mut ambiguous) = (0_f64, 0_f64, false);
        for (output, (declared, got)) in self.graph.outputs.iter().zip(got).enumerate() {
            let known = self.walk.value(declared.node);
            let outside = |want, bound| Verdict::Outside { output, got: *got, want, bound };
            match (known, *got) {
                (Known::Lost(rule), _) => return Verdict::Special(rule),
                (Known::Real(i), _) if i.is_infinite() => return Verdict::Special("infinity"),
                (Known::Real(i), Value::Real(x)) => {
                    // A NaN is no number of the interval.
                    if !i.contains(x) {
                        return outside(Value::Real(i.middle()), i.radius());
                    }
                    ratio = ratio.max(i.ratio(x));
                    ulps = ulps.max(i.ulps());
                }
                (Known::Maybe(_), Value::Bool(_)) => ambiguous = true,
                (Known::Int(want), _) if Value::Int(want) != *got => return outside(Value::Int(want), 0.0),
                (Known::Bool(want), _) if Value::Bool(want) != *got => return outside(Value::Bool(want), 0.0),
                (Known::Real(i), _) => return outside(Value::Real(i.middle()), i.radius()),
                (Known::Maybe(_), _) => return outside(Value::Bool(true), 0.0),
                (Known::Int(_) | Known::Bool(_), _) => {}
            }
        }
        Verdict::Within { ratio, ulps, ambiguous }
    }
}

/// Of two misses the one by fewer bounds.
fn nearer(best: Option<Verdict>, new: Verdict) -> Verdict {
    let miss = |verdict: &Verdict| match verdict {
        Verdict::Outside { got: Value::Real(got), want: Value::Real(want), bound, .. } => (got - want).abs() / bound,
        _ => f64::INFINITY,
    };
    match best {
        Some(best) if miss(&best) <= miss(&new) => best,
        _ => new,
    }
}
