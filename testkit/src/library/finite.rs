//! The law of numbers: value, gradient and Hessian are free of NaN wherever a point is at most 10⁹ in size (LANGUAGE
//! A.4), in f64 and in f32. Knows nothing of what the numbers should be.

use super::space::{Sampler, norm, scaled};
use super::{Claim, Count, Failure, Field, Measured, Order, Point};

const LAW: &str = "finite";

/// Faces, edges, corners, axes and diagonals of shapes with short decimals as sizes; what underflows when squared in
/// f32 or in f64; and the largest points.
const LIKELY: [f64; 12] = [0.0, 1e-30, -1e-20, 0.25, 0.5, -0.5, 1.0, -1.0, 1.5, 2.0, 1e9, -1e9];

pub fn finite(field: &Field<'_>, claim: &Claim) -> Result<Measured, Failure> {
    let points = places(field, claim);
    let mut count = Count::default();
    for (precision, evaluate) in [("f64", field.double), ("f32", field.single)] {
        let jets = field.asked(evaluate, &points, Order::Hessian)?;
        for (point, jet) in points.iter().zip(&jets) {
            let wrong = if jet.value.is_nan() {
                "value"
            } else if jet.gradient.iter().any(|x| x.is_nan()) {
                "gradient"
            } else if jet.hessian.iter().flatten().any(|x| x.is_nan()) {
                "Hessian"
            } else {
                count.judged += 1;
                continue;
            };
            if precision == "f32" && wrong == "Hessian" && overflows(field, *point)? {
                count.unjudged += 1;
                continue;
            }
            let what = format!("in {precision} the {wrong} at {point:?} has a NaN: {jet:?}");
            return Err(field.failure(LAW, what));
        }
    }
    Ok(Measured { count: count.at_least(95, LAW, field.name)?, ..Measured::default() })
}

/// Whether second or third derivatives are beyond the range of f32, as close to a tip. Definitions that use the gradient
/// of an operand need one order more than is asked for, and ∞ − ∞ is NaN.
fn overflows(field: &Field<'_>, point: Point) -> Result<bool, Failure> {
    const STEP: f64 = 1.0 / 1024.0;
    let jets = field.jets(&[point, scaled(point, 1.0 + STEP)], Order::Hessian)?;
    let [here, there] = [&jets[0], &jets[1]].map(|jet| jet.hessian.iter().flatten().copied().collect::<Vec<f64>>());
    let step = STEP * norm(point);
    let largest = here.iter().zip(&there).map(|(a, b)| a.abs().max((a - b).abs() / step)).fold(0.0, f64::max);
    Ok(step > 0.0 && largest > f64::from(f32::MAX))
}

fn places(field: &Field<'_>, claim: &Claim) -> Vec<Point> {
    const SOME: usize = 500;
    let mut sampler = Sampler::new(field.name, field.dimension);
    let mut points = claim.critical.clone();
    let third = if field.dimension == 3 { &LIKELY[..] } else { &[0.0] };
    for x in LIKELY {
        for y in LIKELY {
            points.extend(third.iter().map(|z| [x, y, *z]));
        }
    }
    points.extend((0..SOME).map(|_| sampler.within(claim.within)));
    points.extend((0..SOME).map(|_| {
        let direction = sampler.direction();
        scaled(direction, 1e9 * sampler.scale(100))
    }));
    points
}
