//! The law of derivatives: away from kinks the gradient is what differences of the value give, and the Hessian what
//! differences of the gradient give. Knows nothing of classes.

use super::space::Sampler;
use super::{Claim, Count, Failure, Field, Jet, Measured, Order, Point};
use crate::differences::{Slopes, slopes, stencil};

const LAW: &str = "differences";
const POINTS: usize = 300;
/// Where one step cannot judge, the next is tried: a longer one drowns rounding, a shorter one avoids kinks.
const STEPS: [f64; 3] = [1.0 / 1024.0, 1.0 / 32.0, 1.0 / 16384.0];
/// Differences less sure than this, relative to the derivative or to 1, judge nothing.
const SURE: f64 = 1e-6;

pub fn differences(field: &Field<'_>, claim: &Claim) -> Result<Measured, Failure> {
    let mut sampler = Sampler::new(field.name, field.dimension);
    let points: Vec<Point> = (0..POINTS).map(|_| sampler.within(claim.within)).collect();
    let jets = field.jets(&points, Order::Hessian)?;
    let mut all: Vec<(Point, Jet, Judged)> =
        points.into_iter().zip(jets).map(|(point, jet)| (point, jet, Judged::default())).collect();
    for step in STEPS {
        let pending = all.iter_mut().filter(|(_, _, judged)| !judged.hessian);
        judge(field, pending.collect(), step)?;
    }
    let count = |is: &dyn Fn(&Judged) -> bool| {
        let judged = all.iter().filter(|(_, _, judged)| is(judged)).count();
        Count { judged, unjudged: POINTS - judged }
    };
    let (first, second) = (count(&|judged| judged.gradient.is_some()), count(&|judged| judged.hessian));
    let worst = all.iter().filter_map(|(_, _, judged)| judged.gradient).fold(0.0, f64::max);
    let mut count = first.at_least(80, LAW, field.name)?;
    count += second.at_least(80, LAW, field.name)?;
    Ok(Measured { slope: Some(worst), count, ..Measured::default() })
}

/// What is known of a point.
#[derive(Default)]
struct Judged {
    /// How far the gradient is from differences.
    gradient: Option<f64>,
    hessian: bool,
}

fn judge(field: &Field<'_>, pending: Vec<&mut (Point, Jet, Judged)>, step: f64) -> Result<(), Failure> {
    let mut places = Vec::new();
    for (point, ..) in &pending {
        for axis in 0..field.dimension {
            places.extend(stencil(point[axis], step).into_iter().map(|x| {
                let mut moved = *point;
                moved[axis] = x;
                moved
            }));
        }
    }
    let size = stencil(0.0, step).len();
    let around = field.jets(&places, Order::Gradient)?;
    let blocks = places.chunks(size * field.dimension).zip(around.chunks(size * field.dimension));
    for ((point, jet, judged), (places, around)) in pending.into_iter().zip(blocks) {
        let slope = |axis: usize, of: &dyn Fn(&Jet) -> f64| -> Slopes {
            let block = axis * size..(axis + 1) * size;
            let at: Vec<f64> = places[block.clone()].iter().map(|p| p[axis]).collect();
            let values: Vec<f64> = around[block].iter().map(of).collect();
            slopes(&at, &values)
        };
        let compare = |is: f64, slopes: Slopes, what: &str| {
            let Some(should) = slopes.agreed(SURE) else { return Ok(None) };
            let off = (is - should.value).abs();
            if off <= 8.0 * should.error + SURE * (1.0 + should.value.abs()) {
                return Ok(Some(off));
            }
            let what = format!("at {point:?} {what} is {is}, but differences give {should:?}");
            Err(field.failure(LAW, what))
        };
        let mut gradient = Some(0.0_f64);
        for axis in 0..field.dimension {
            let what = format!("the derivative by coordinate {axis}");
            let off = compare(jet.gradient[axis], slope(axis, &|jet| jet.value), &what)?;
            gradient = gradient.zip(off).map(|(a, b)| a.max(b));
        }
        judged.gradient = judged.gradient.or(gradient);
        if gradient.is_none() {
            continue;
        }
        let mut hessian = true;
        for i in 0..field.dimension {
            for j in 0..field.dimension {
                let what = format!("the second derivative by coordinates {i} and {j}");
                hessian &= compare(jet.hessian[i][j], slope(j, &|jet| jet.gradient[i]), &what)?.is_some();
            }
        }
        judged.hessian = hessian;
    }
    Ok(())
}
