//! The laws of steepness: ‖∇F‖ = 1 for class U, and a Lipschitz constant for the others (LANGUAGE A.3). Knows nothing
//! of zero sets.

use super::space::{Sampler, along, distance, dot, exceeds, minus, norm, scaled};
use super::{Claim, Count, Failure, Field, Jet, Measured, Order, Point};

/// ‖∇F‖ = 1 wherever a gradient exists, that is away from kinks.
pub fn unit(field: &Field<'_>, claim: &Claim) -> Result<Measured, Failure> {
    const LAW: &str = "unit gradient";
    const POINTS: usize = 2000;
    const TOLERANCE: f64 = 1e-9;
    let mut sampler = Sampler::new(field.name, field.dimension);
    let points = field.covered(claim, LAW, POINTS, || sampler.within(claim.within))?;
    let (mut count, mut worst) = (Count::default(), 0.0_f64);
    for (point, jet) in points.iter().zip(field.jets(&points, Order::Gradient)?) {
        let off = (norm(jet.gradient) - 1.0).abs();
        if off <= TOLERANCE {
            count.judged += 1;
            worst = worst.max(off);
        } else if field.kink_near(*point, 1e-7)? {
            count.unjudged += 1;
        } else {
            let what = format!("at {point:?} the gradient {:?} is {} long", jet.gradient, norm(jet.gradient));
            return Err(field.failure(LAW, what));
        }
    }
    Ok(Measured { unit: Some(worst), count: count.at_least(80, LAW, field.name)?, ..Measured::default() })
}

/// No jumps: pieces of lines are halved towards where the value goes on least like its tangent. What is left there is a
/// jump, if the value still goes farther than the constant allows.
pub fn continuous(field: &Field<'_>, claim: &Claim, constant: f64) -> Result<Measured, Failure> {
    const LAW: &str = "continuous";
    const LINES: usize = 64;
    const PIECES: usize = 64;
    const HALVINGS: usize = 30;
    let mut sampler = Sampler::new(field.name, field.dimension);
    let (mut lower, mut upper) = (Vec::new(), Vec::new());
    for _ in 0..LINES {
        let (from, to) = (sampler.within(claim.within), sampler.within(claim.within));
        let step = scaled(minus(to, from), 1.0 / PIECES as f64);
        let place = |k: usize| along(from, k as f64, step);
        lower.extend((0..PIECES).map(place));
        upper.extend((1..=PIECES).map(place));
    }
    let jets = |points: &[Point]| field.jets(points, Order::Gradient);
    let pairs = |points: Vec<Point>, jets: Vec<Jet>| points.into_iter().zip(jets).collect::<Vec<_>>();
    let mut lower = {
        let at = jets(&lower)?;
        pairs(lower, at)
    };
    let mut upper = {
        let at = jets(&upper)?;
        pairs(upper, at)
    };
    for _ in 0..HALVINGS {
        let middle: Vec<Point> = lower.iter().zip(&upper).map(|(a, b)| scaled(along(a.0, 1.0, b.0), 0.5)).collect();
        let at = jets(&middle)?;
        let off =
            |a: &(Point, Jet), b: &(Point, Jet)| (b.1.value - a.1.value - dot(a.1.gradient, minus(b.0, a.0))).abs();
        for ((a, b), m) in lower.iter_mut().zip(&mut upper).zip(pairs(middle, at)) {
            *(if off(a, &m) > off(&m, b) { b } else { a }) = m;
        }
    }
    let mut judged = 0;
    for ((p, a), (q, b)) in lower.iter().zip(&upper) {
        if !claim.covers(a.value) || !claim.covers(b.value) {
            continue;
        }
        judged += 1;
        let rounding = 64.0 * f64::EPSILON * (norm(*p) + a.value.abs());
        if exceeds((b.value - a.value).abs(), 2.0 * constant * distance(*p, *q) + rounding) {
            let what = format!("between {p:?} and {q:?} the value jumps from {} to {}", a.value, b.value);
            return Err(field.failure(LAW, what));
        }
    }
    Ok(Measured { count: Count { judged, unjudged: 0 }, ..Measured::default() })
}

/// abs(F(p) − F(q)) ≤ K·‖p − q‖ for near and far pairs, which also finds jumps; and ‖∇F‖ ≤ K.
///
/// A claim for one side is judged by near pairs of that side: the way between far ones may leave it.
pub fn lipschitz(field: &Field<'_>, claim: &Claim, constant: f64) -> Result<Measured, Failure> {
    const LAW: &str = "Lipschitz";
    const PAIRS: usize = 4000;
    let mut sampler = Sampler::new(field.name, field.dimension);
    let side = claim.within.1 - claim.within.0;
    let from = field.covered(claim, LAW, PAIRS, || sampler.within(claim.within))?;
    let mut to = Vec::new();
    for (k, point) in from.iter().enumerate() {
        let point = *point;
        to.push(if k % 4 == 0 && claim.side.is_none() {
            sampler.within(claim.within)
        } else {
            let direction = sampler.direction();
            along(point, side * sampler.scale(24), direction)
        });
    }
    let (starts, ends) = (field.jets(&from, Order::Gradient)?, field.values(&to)?);
    let (mut judged, mut worst) = (0, 0.0_f64);
    for ((p, jet), (q, there)) in from.iter().zip(&starts).zip(to.iter().zip(&ends)) {
        if !claim.covers(jet.value) || !claim.covers(*there) {
            continue;
        }
        let apart = distance(*p, *q);
        // What rounding alone may add: the values are sums of terms as large as they and the points are.
        let size = norm(*p) + norm(*q) + jet.value.abs() + there.abs();
        let rounding = 64.0 * f64::EPSILON * size / apart;
        let near = apart < side / 64.0;
        if claim.side.is_some() && !near {
            continue;
        }
        judged += 1;
        let quotient = (there - jet.value).abs() / apart;
        let allowed = constant * (1.0 + 1e-9) + rounding;
        if exceeds(quotient, allowed) {
            let what = format!("from {p:?} to {q:?} the value goes from {} to {there}: slope {quotient}", jet.value);
            return Err(field.failure(LAW, what));
        }
        let slope = norm(jet.gradient);
        if exceeds(slope, constant * (1.0 + 1e-9)) {
            let what = format!("at {p:?} the gradient {:?} is {slope} long", jet.gradient);
            return Err(field.failure(LAW, what));
        }
        worst = worst.max(slope).max(if rounding < 1e-9 { quotient } else { 0.0 });
    }
    let count = Count { judged, unjudged: 0 };
    Ok(Measured { lipschitz: Some(worst), count, ..Measured::default() })
}
