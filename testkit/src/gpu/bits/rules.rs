//! What may differ and what not: the rules, and the counts of a comparison. Knows values; knows no device.

use std::ops::AddAssign;

use isograd_graph::ops::Family;
use isograd_graph::{Evaluator, Node, PerNode, Precision, Structure, Value, Verified};

/// The most percent of the numbers of a corpus that may be excused.
pub const MOST_EXCUSED: usize = 30;

/// The most iterations of loops at a point that a device is held to: lavapipe leaves all loops after as many.
pub const MOST_ITERATIONS: u32 = 65_535;

/// Why a difference is excused: by what the reference met at that point, or else by what differs. In the order in which
/// they are asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rule {
    /// A real on the way is NaN.
    Nan,
    /// One is infinite.
    Infinity,
    /// One is subnormal.
    Subnormal,
    /// None of this, but loops run for more than [`MOST_ITERATIONS`].
    Long,
    /// None of this, but the two numbers are zeros of different sign.
    Zero,
}

impl Rule {
    /// All rules in their order.
    pub const ALL: [Self; 5] = [Self::Nan, Self::Infinity, Self::Subnormal, Self::Long, Self::Zero];

    /// Its name in reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nan => "nan",
            Self::Infinity => "infinity",
            Self::Subnormal => "subnormal",
            Self::Long => "long",
            Self::Zero => "zero",
        }
    }

    /// The rule that a number calls for.
    fn of(x: f64, precision: Precision) -> Option<Self> {
        let least = match precision {
            Precision::F32 => f64::from(f32::MIN_POSITIVE),
            Precision::F64 => f64::MIN_POSITIVE,
        };
        match x {
            _ if x.is_nan() => Some(Self::Nan),
            _ if x.is_infinite() => Some(Self::Infinity),
            _ if x != 0.0 && x.abs() < least => Some(Self::Subnormal),
            _ => None,
        }
    }
}

/// What the reference evaluator computed of a shader's own graph, and met on the way.
#[derive(Debug, Clone)]
pub struct Reference {
    /// The outputs at each point.
    pub rows: Vec<Vec<Value>>,
    /// The first rule that a number on the way to them called for.
    pub met: Vec<Option<Rule>>,
}

impl Reference {
    /// Runs a graph at points; a point that takes too many steps is left out of them.
    #[must_use]
    pub fn of(graph: &Verified, precision: Precision, points: &mut Vec<Vec<Value>>) -> Self {
        let needed = Structure::new(graph, Family::Shader).ok().map(|structure| structure.needed);
        let mut loops = PerNode::new(graph, false);
        for (id, node) in graph.iter() {
            loops[id] = matches!(node, Node::End { begin } if matches!(graph.get(begin), Some(Node::Theta { .. })));
        }
        let mut evaluator = Evaluator::new(graph, precision);
        let mut reference = Self { rows: Vec::new(), met: Vec::new() };
        points.retain(|point| {
            let mut met: Option<Rule> = None;
            let mut iterations = 0_u32;
            let row = evaluator.run_watched(point, |id, value| {
                if let Value::Real(x) = value
                    && let Some(rule) = Rule::of(x, precision)
                    && needed.as_ref().is_none_or(|needed| needed[id])
                {
                    met = Some(met.map_or(rule, |met| met.min(rule)));
                }
                iterations = iterations.saturating_add(u32::from(loops[id]));
            });
            let Some(row) = row else { return false };
            reference.rows.push(row);
            reference.met.push(met.or((iterations > MOST_ITERATIONS).then_some(Rule::Long)));
            true
        });
        reference
    }
}

/// Counts of a comparison.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    /// Modules that `spirv-val` accepted.
    pub validated: usize,
    /// Kernels that were executed.
    pub kernels: usize,
    /// What a target cannot do, each said by a diagnostic.
    pub refused: usize,
    /// Modules too large to be executed.
    pub large: usize,
    /// Points of all kernels.
    pub points: usize,
    /// Of them, those at which the reference met normal numbers and zeros only.
    pub normal: usize,
    /// Of the others, those with equal bits all the same.
    pub equal_all_the_same: usize,
    /// Numbers compared with WebAssembly.
    pub values: usize,
    /// Of them, those that differ and are not excused.
    pub different: usize,
    /// Those that differ and are excused, by [`Rule`].
    pub excused: [usize; 5],
    /// Those that differ, but are within the bounds that a device is held to.
    pub within: usize,
    /// Those that differ where bounds say nothing: too many choices, or overflow on the way.
    pub unjudged: usize,
    /// Numbers of the reference that have not the bits of WebAssembly.
    pub strayed: usize,
}

impl Tally {
    /// All that are excused or not judged.
    #[must_use]
    pub fn all_excused(&self) -> usize {
        self.excused.iter().sum::<usize>() + self.unjudged
    }

    /// Whether more was excused than may be.
    #[must_use]
    pub fn hides(&self) -> bool {
        self.all_excused() * 100 > self.values * MOST_EXCUSED
    }
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.validated += other.validated;
        self.kernels += other.kernels;
        self.refused += other.refused;
        self.large += other.large;
        self.points += other.points;
        self.normal += other.normal;
        self.equal_all_the_same += other.equal_all_the_same;
        self.values += other.values;
        self.different += other.different;
        self.strayed += other.strayed;
        self.within += other.within;
        self.unjudged += other.unjudged;
        for (sum, more) in self.excused.iter_mut().zip(other.excused) {
            *sum += more;
        }
    }
}

/// What a device is held to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeldTo {
    /// The bits of WebAssembly.
    Bits,
    /// In f32 the bounds that follow from Vulkan's precision, at points with other bits.
    Bounds,
}

/// A difference that nothing excuses.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// The number of the point.
    pub point: usize,
    /// The number of the output.
    pub output: usize,
    /// What WebAssembly computes.
    pub wanted: Value,
    /// What the other computes.
    pub found: Value,
}

/// What became of a comparison.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Verdict {
    /// The counts; `values` and what follows from them only.
    pub tally: Tally,
    /// The first difference that nothing excuses.
    pub first: Option<Difference>,
    /// For each point whether something was excused there.
    pub excused: Vec<bool>,
}

/// Who is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Judged<'a> {
    /// The reference: nothing is excused.
    Reference,
    /// A device, with what the reference met at each point.
    Device(&'a [Option<Rule>]),
}

/// Compares what was found at points with what is wanted, by the rules.
#[must_use]
pub fn compare(wanted: &[Vec<Value>], found: &[Vec<Value>], judged: Judged<'_>) -> Verdict {
    let mut verdict = Verdict::default();
    let tally = &mut verdict.tally;
    for (point, wanted) in wanted.iter().enumerate() {
        let (device, met) = match judged {
            Judged::Reference => (false, None),
            Judged::Device(met) => (true, met.get(point).copied().flatten()),
        };
        let found = found.get(point).map_or(&[][..], Vec::as_slice);
        let mut equal = true;
        let mut excused = false;
        for (output, wanted) in wanted.iter().enumerate() {
            tally.values += 1;
            let found = found.get(output).copied();
            if found.is_some_and(|found| found.same_bits(*wanted)) {
                continue;
            }
            equal = false;
            let zeros = |found| matches!((wanted, found), (Value::Real(a), Value::Real(b)) if *a == 0.0 && b == 0.0);
            match (met, found) {
                (Some(rule), Some(_)) => {
                    tally.excused[rule as usize] += 1;
                    excused = true;
                }
                (None, Some(found)) if device && zeros(found) => {
                    tally.excused[Rule::Zero as usize] += 1;
                    excused = true;
                }
                (_, found) => {
                    tally.different += 1;
                    let found = found.unwrap_or(Value::Real(f64::NAN));
                    verdict.first.get_or_insert(Difference { point, output, wanted: *wanted, found });
                }
            }
        }
        tally.points += 1;
        tally.normal += usize::from(met.is_none());
        tally.equal_all_the_same += usize::from(met.is_some() && equal);
        verdict.excused.push(excused);
    }
    verdict
}

#[cfg(test)]
mod tests {
    use isograd_graph::{parse, verify};

    use super::*;

    fn met(text: &str, precision: Precision, x: f64) -> Option<Rule> {
        let graph = verify(parse(text).expect("a graph")).expect("well formed");
        Reference::of(&graph, precision, &mut vec![vec![Value::Real(x)]]).met[0]
    }

    #[test]
    fn what_is_met_on_the_way_counts() {
        let mut b = isograd_graph::Builder::new(isograd_graph::Mode::Raw, 100, &isograd_graph::Unwatched);
        let x = b.input("x", isograd_graph::Scalar::Real);
        let (one, tiny) = (b.real(1.0), b.real(1e-30));
        let unused = b.div(one, x);
        let small = b.mul(x, tiny);
        let less = b.lt(small, one);
        let y = b.select(less, one, x);
        b.output("y", y);
        let _ = unused;
        let text = isograd_graph::print(&b.finish().expect("no budget"));
        for (x, f32, f64) in [
            (1.0, None, None),
            // The quotient is infinite, but no output needs it.
            (0.0, None, None),
            (1e-9, Some(Rule::Subnormal), None),
            (f64::INFINITY, Some(Rule::Infinity), Some(Rule::Infinity)),
            (f64::NAN, Some(Rule::Nan), Some(Rule::Nan)),
            (1e-310, None, Some(Rule::Subnormal)),
        ] {
            assert_eq!(met(&text, Precision::F32, x), f32, "{x}");
            assert_eq!(met(&text, Precision::F64, x), f64, "{x}");
        }
    }

    #[test]
    fn a_difference_is_excused_by_what_was_met_and_by_nothing_else() {
        let real = |x: f64| vec![Value::Real(x)];
        let wanted = [real(1.0), real(-0.0), real(3.0), real(f64::NAN), real(5.0), real(1.0)];
        let found = [real(1.0), real(0.0), real(4.0), real(-f64::NAN), real(5.0), real(1.0f64.next_up())];
        let met = [None, None, Some(Rule::Infinity), Some(Rule::Nan), Some(Rule::Subnormal), None];
        let Verdict { tally, first, excused } = compare(&wanted, &found, Judged::Device(&met));
        assert_eq!((tally.values, tally.different, tally.excused), (6, 1, [0, 1, 0, 0, 1]));
        assert_eq!((tally.normal, tally.equal_all_the_same), (3, 2));
        assert_eq!(first.map(|d| d.point), Some(5));
        assert_eq!(excused, [false, true, true, false, false, false]);
        // What is not there at all is not excused, and the reference in nothing.
        assert_eq!(compare(&wanted, &[], Judged::Device(&[Some(Rule::Nan); 6])).tally.different, 6);
        assert_eq!(compare(&wanted, &found, Judged::Reference).tally.different, 3);
    }
}
