//! The laws of distance: a field of class E is the distance to its zero set, one of class L never more than it
//! (LANGUAGE A.3). Knows the zero set only as what searches find.

use super::space::{Sampler, along, norm};
use super::zero_set::ZeroSet;
use super::{Claim, Class, Count, Failure, Field, Measured, Order, Point};

/// p − F∇F lies on the zero set, wherever there is a gradient.
pub fn foot(field: &Field<'_>, claim: &Claim) -> Result<Measured, Failure> {
    const LAW: &str = "foot point";
    const POINTS: usize = 1000;
    let mut sampler = Sampler::new(field.name, field.dimension);
    let points = field.covered(claim, LAW, POINTS, || sampler.within(claim.within))?;
    let jets = field.jets(&points, Order::Gradient)?;
    let feet: Vec<Point> = points.iter().zip(&jets).map(|(p, jet)| along(*p, -jet.value, jet.gradient)).collect();
    let left = field.values(&feet)?;
    let (mut count, mut worst) = (Count::default(), 0.0_f64);
    for ((point, jet), (foot, left)) in points.iter().zip(&jets).zip(feet.iter().zip(left)) {
        if left.abs() <= 1e-9 * (1.0 + norm(*point) + jet.value.abs()) {
            count.judged += 1;
            worst = worst.max(left.abs());
        } else if field.kink_near(*point, 1e-7)? {
            count.unjudged += 1;
        } else {
            let what = format!("from {point:?}, where the value is {}, the way home {foot:?} has {left}", jet.value);
            return Err(field.failure(LAW, what));
        }
    }
    Ok(Measured { foot: Some(worst), count: count.at_least(80, LAW, field.name)?, ..Measured::default() })
}

/// abs(F) is the distance to the zero set for class E, at most that for class L.
///
/// Both ends come from searches: a zero that is nearer than abs(F) refutes both, and if the search, which has a slack
/// of its own, finds none at abs(F), that refutes E.
pub fn distance(field: &Field<'_>, claim: &Claim, class: Class) -> Result<Measured, Failure> {
    const LAW: &str = "distance";
    const POINTS: usize = 240;
    const ROUNDING: f64 = 1e-8;
    const VACUOUS: f64 = 1e-3;
    const RETRIES: usize = 4;
    let mut sampler = Sampler::new(field.name, field.dimension);
    let zeros = ZeroSet::sample(field, claim, &mut sampler)?;
    if zeros.points.is_empty() {
        // What is nowhere may be a lower bound of the distance to nothing.
        if class < Class::Exact {
            return Ok(Measured::default());
        }
        return Err(field.failure(LAW, "no zero was found, so there is nothing to be distant from".to_owned()));
    }
    let side = claim.within.1 - claim.within.0;
    let mut turn = 0;
    let places = field.covered(claim, LAW, POINTS, || {
        turn += 1;
        if turn % 2 == 0 {
            return sampler.within(claim.within);
        }
        let zero = zeros.points[sampler.random.below(zeros.points.len())];
        let direction = sampler.direction();
        along(zero, side * sampler.scale(10), direction)
    })?;
    let values = field.values(&places)?;
    let mut of: Vec<(Point, f64, Option<Point>)> = places.into_iter().zip(values).map(|(p, v)| (p, v, None)).collect();
    let mut found = zeros.closest(field, &of, &mut sampler)?;
    // A search that seems to have ended early goes on.
    for _ in 0..RETRIES {
        let farther = |k: &usize| class == Class::Exact && of[*k].1.abs() < found[*k].distance - found[*k].slack;
        let again: Vec<usize> = (0..of.len()).filter(farther).collect();
        for k in &again {
            of[*k].2 = Some(found[*k].zero);
        }
        let some: Vec<_> = again.iter().map(|k| of[*k]).collect();
        for (k, closest) in again.into_iter().zip(zeros.closest(field, &some, &mut sampler)?) {
            found[k] = closest;
        }
    }
    let (mut count, mut worst) = (Count::default(), 0.0_f64);
    for ((point, value, _), closest) in of.iter().zip(found) {
        let far = value.abs();
        let failed = |how: &str| {
            let what = format!("at {point:?} the value is {value}, but the zero set is {how}: {closest:?}");
            Err(field.failure(LAW, what))
        };
        if far > closest.distance + ROUNDING * (1.0 + far) {
            return failed("nearer");
        }
        if class < Class::Exact {
            count.judged += 1;
            continue;
        }
        if closest.slack > VACUOUS || !zeros.saw(*point, far + closest.slack, field.dimension) {
            count.unjudged += 1;
            continue;
        }
        if far < closest.distance - closest.slack {
            return failed("farther");
        }
        count.judged += 1;
        worst = worst.max((far - closest.distance).abs());
    }
    // Points whose ball leaves the sampled cube cannot be judged; half of those near the surface must be.
    let count = count.at_least(50, LAW, field.name)?;
    let distance = (class == Class::Exact).then_some(worst);
    Ok(Measured { distance, count, ..Measured::default() })
}
