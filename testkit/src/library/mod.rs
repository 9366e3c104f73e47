//! The laws of fields: what LANGUAGE A.3 and A.4 demand of a function of points in space, judged by its numbers. Knows
//! neither the language nor who computes the numbers: a field is a closure from points to values and derivatives.
//!
//! Each law answers with the worst deviation it met, or with the first point where the claim does not hold. Nothing is
//! believed because the field says so twice: distances are measured by search in the values, slopes by differences.

mod differences;
mod distance;
mod finite;
mod slopes;
mod space;
mod zero_set;

use crate::laws::{Count, Failure};
pub use space::Point;

/// The classes of LANGUAGE A.3; each implies those before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    /// N: right zero set and sign only.
    Neither,
    /// L: Lipschitz constant 1, so never more than the distance.
    Lower,
    /// U: a gradient of length 1 wherever there is one.
    Unit,
    /// E: the distance.
    Exact,
}

/// Where a claim of class E or U holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Where the value is above 0.
    Outside,
    /// Where it is below 0.
    Inside,
}

/// What is claimed of a field.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    /// Its class; `None` for a component of a map, which is no field.
    pub class: Option<Class>,
    /// Where a class E or U holds; `None`: everywhere.
    pub side: Option<Side>,
    /// A Lipschitz constant for class N.
    pub lipschitz: Option<f64>,
    /// Each component of the points that are sampled.
    pub within: (f64, f64),
    /// Points where something may divide by zero.
    pub critical: Vec<Point>,
}

/// How much of a [`Jet`] is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Order {
    /// The value.
    Value,
    /// Value and gradient.
    Gradient,
    /// Value, gradient and Hessian.
    Hessian,
}

/// Value and derivatives at a point; what was not asked for is 0, and so is the third axis of a field in the plane.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Jet {
    /// The value.
    pub value: f64,
    /// By each coordinate.
    pub gradient: Point,
    /// By each pair of coordinates.
    pub hessian: [Point; 3],
}

/// Computes a field at points; an error ends the judgement.
pub type Evaluate<'a> = dyn Fn(&[Point], Order) -> Result<Vec<Jet>, String> + 'a;

/// A field that can be asked for numbers.
pub struct Field<'a> {
    /// For messages, and the seed of its points.
    pub name: &'a str,
    /// 2 or 3.
    pub dimension: usize,
    /// In f64.
    pub double: &'a Evaluate<'a>,
    /// In f32.
    pub single: &'a Evaluate<'a>,
}

/// The worst of what the laws met; `None` where the claim gives nothing to measure.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Measured {
    /// Largest | ‖∇F‖ − 1 |.
    pub unit: Option<f64>,
    /// Largest | abs(F) − distance to the zero set |.
    pub distance: Option<f64>,
    /// Largest abs(F) at `p − F∇F`.
    pub foot: Option<f64>,
    /// Largest abs(F(p) − F(q)) / ‖p − q‖.
    pub lipschitz: Option<f64>,
    /// Largest deviation of a first derivative from differences.
    pub slope: Option<f64>,
    /// Points of all laws.
    pub count: Count,
}

impl Measured {
    /// The worse of both in everything.
    pub fn join(&mut self, other: &Self) {
        let worse = |a: &mut Option<f64>, b: Option<f64>| *a = a.map_or(b, |a| Some(b.map_or(a, |b| a.max(b))));
        worse(&mut self.unit, other.unit);
        worse(&mut self.distance, other.distance);
        worse(&mut self.foot, other.foot);
        worse(&mut self.lipschitz, other.lipschitz);
        worse(&mut self.slope, other.slope);
        self.count += other.count;
    }
}

/// Judges a field by all laws of its claim.
///
/// # Errors
/// At the first point where a law does not hold, or if a law could judge less than 80 % of its points.
pub fn judge(field: &Field<'_>, claim: &Claim) -> Result<Measured, Failure> {
    let mut measured = finite::finite(field, claim)?;
    measured.join(&differences::differences(field, claim)?);
    let Some(class) = claim.class else { return Ok(measured) };
    if class >= Class::Unit {
        measured.join(&slopes::unit(field, claim)?);
    }
    let constant = if class >= Class::Lower { Some(1.0) } else { claim.lipschitz };
    if let Some(constant) = constant {
        measured.join(&slopes::continuous(field, claim, constant)?);
        measured.join(&slopes::lipschitz(field, claim, constant)?);
    }
    if class == Class::Exact {
        measured.join(&distance::foot(field, claim)?);
    }
    if class == Class::Exact || class == Class::Lower {
        measured.join(&distance::distance(field, claim, class)?);
    }
    Ok(measured)
}

impl Field<'_> {
    fn failure(&self, law: &'static str, what: String) -> Failure {
        Failure { law, subject: self.name.to_owned(), what }
    }

    /// The field in f64.
    fn jets(&self, points: &[Point], order: Order) -> Result<Vec<Jet>, Failure> {
        self.asked(self.double, points, order)
    }

    fn asked(&self, evaluate: &Evaluate<'_>, points: &[Point], order: Order) -> Result<Vec<Jet>, Failure> {
        // Batches that stay in cache.
        let mut all = Vec::with_capacity(points.len());
        for some in points.chunks(4096) {
            let jets = evaluate(some, order).map_err(|e| self.failure("evaluate", e))?;
            if jets.len() != some.len() {
                return Err(self.failure("evaluate", format!("{} results for {} points", jets.len(), some.len())));
            }
            all.extend(jets);
        }
        Ok(all)
    }

    fn values(&self, points: &[Point]) -> Result<Vec<f64>, Failure> {
        Ok(self.jets(points, Order::Value)?.into_iter().map(|jet| jet.value).collect())
    }

    /// About this many points of the sampled cube of which the claim speaks: of all that are tried `many` at most. A
    /// claim for one side may speak of a small part of the cube.
    fn covered(
        &self,
        claim: &Claim,
        law: &'static str,
        many: usize,
        mut sample: impl FnMut() -> Point,
    ) -> Result<Vec<Point>, Failure> {
        if claim.side.is_none() {
            return Ok((0..many).map(|_| sample()).collect());
        }
        let tried: Vec<Point> = (0..16 * many).map(|_| sample()).collect();
        let values = self.values(&tried)?;
        let covered = tried.into_iter().zip(values).filter(|(_, value)| claim.covers(*value)).take(many);
        let covered: Vec<Point> = covered.map(|(point, _)| point).collect();
        if covered.len() * 10 >= many {
            return Ok(covered);
        }
        let what = format!("only {} of {} points are where the claim holds", covered.len(), 16 * many);
        Err(self.failure(law, what))
    }

    /// Whether the gradient jumps within this distance of a point along an axis: then the point is too near a kink.
    fn kink_near(&self, point: Point, within: f64) -> Result<bool, Failure> {
        const JUMP: f64 = 1e-2;
        let mut around = vec![point];
        for axis in 0..self.dimension {
            for h in [-within, within] {
                let mut moved = point;
                moved[axis] += h;
                around.push(moved);
            }
        }
        let jets = self.jets(&around, Order::Gradient)?;
        Ok(jets.iter().any(|jet| space::exceeds(space::distance(jet.gradient, jets[0].gradient), JUMP)))
    }
}

impl Claim {
    /// Whether the claim speaks of a point with this value.
    fn covers(&self, value: f64) -> bool {
        match self.side {
            None => true,
            Some(Side::Outside) => value > 0.0,
            Some(Side::Inside) => value < 0.0,
        }
    }
}

#[cfg(test)]
mod tests;
