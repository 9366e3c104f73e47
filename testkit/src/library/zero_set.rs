//! The zero set of a field as a cloud of points, and the one of all its points that is nearest to another, by search.
//! Knows no claims, and never uses the field's gradient at the point whose distance is sought.

use super::space::{Sampler, along, direction_of, distance, dot, minus, norm, scaled};
use super::{Claim, Failure, Field, Order, Point};

/// Points where the field is 0, in a cube somewhat larger than the one that is judged.
pub struct ZeroSet {
    pub points: Vec<Point>,
    sides: (f64, f64),
}

/// What a search found: there is a zero at this distance, and hardly one that is nearer than by the slack.
#[derive(Debug, Clone, Copy)]
pub struct Closest {
    pub distance: f64,
    pub slack: f64,
    pub zero: Point,
}

/// A point with the nearest zero found so far.
struct Search {
    of: usize,
    point: Point,
    value: f64,
    zero: Point,
    radius: f64,
    /// How far from the zero to look, relative to the radius: what succeeds grows, what does not shrinks.
    reach: f64,
}

impl Search {
    /// Takes a zero if it is nearer; answers whether it is so by as much as counts for the reach.
    fn offer(&mut self, zero: Point) -> bool {
        let (radius, before) = (distance(zero, self.point), self.radius);
        if radius < before {
            (self.zero, self.radius) = (zero, radius);
        }
        radius < before * (1.0 - 0.01 * self.reach * self.reach)
    }

    /// How far to look this time: about as far as was good before, or any way.
    fn look(&self, sampler: &mut Sampler) -> f64 {
        if sampler.random.chance(75) { self.reach * 2.0 * sampler.scale(3) } else { sampler.scale(SCALES) }
    }
}

const SAMPLES: usize = 4096;
/// Sectors of space around a point, each of which gives a start: signs of the coordinates and which is the largest.
const SECTORS: usize = 24;
/// Rounds in which all starts are followed, then those for which only the best are.
const FIRST: usize = 4;
const ROUNDS: usize = 30;
const BEST: usize = 3;
const RAYS: usize = 16;
const WALKS: usize = 8;
/// How often a scale is halved at most: the square root of what f64 resolves.
const SCALES: usize = 26;

impl ZeroSet {
    /// Samples the zero set in two ways that find different parts of it: by bisection between points of different
    /// sign, and by Newton steps, which also find where the field touches 0 without changing its sign.
    pub fn sample(field: &Field<'_>, claim: &Claim, sampler: &mut Sampler) -> Result<Self, Failure> {
        let (lo, hi) = claim.within;
        let margin = (hi - lo) * 0.375;
        let sides = (lo - margin, hi + margin);
        let all: Vec<Point> =
            (0..2 * SAMPLES).map(|k| sampler.within(if k % 2 == 0 { sides } else { claim.within })).collect();
        let values = field.values(&all)?;
        let part = |inside: bool| -> Vec<Point> {
            all.iter().zip(&values).filter(|(_, v)| (**v < 0.0) == inside).map(|(p, _)| *p).collect()
        };
        let (negative, positive) = (part(true), part(false));
        let mut points = Vec::new();
        if !negative.is_empty() && !positive.is_empty() {
            let random = &mut sampler.random;
            let mut pick = |from: &[Point]| from[random.below(from.len())];
            let pairs: Vec<(Point, Point)> = (0..SAMPLES).map(|_| (pick(&positive), pick(&negative))).collect();
            points = bisect(field, pairs)?;
        }
        points.extend(newton(field, all[..SAMPLES].to_vec(), 16)?.into_iter().flatten());
        points.retain(|p| p.iter().take(field.dimension).all(|x| (sides.0..=sides.1).contains(x)));
        Ok(Self { points, sides })
    }

    /// Whether a ball lies where the zero set was sampled.
    pub fn saw(&self, center: Point, radius: f64, dimension: usize) -> bool {
        let (lo, hi) = self.sides;
        center.iter().take(dimension).all(|x| x - radius >= lo && x + radius <= hi)
    }

    /// The distances of points, given with their values and zeros already found for them, to the zero set.
    ///
    /// The search starts from the nearest samples in all directions, moves them along the zero set, and looks for nearer
    /// zeros in random directions around the best, at all scales: on the way to a point of the other sign there is a
    /// zero, which is nearer if that point is.
    pub fn closest(
        &self,
        field: &Field<'_>,
        of: &[(Point, f64, Option<Point>)],
        sampler: &mut Sampler,
    ) -> Result<Vec<Closest>, Failure> {
        let mut all: Vec<Search> = Vec::new();
        for (index, (point, value, found)) in of.iter().enumerate() {
            for zero in self.starts(*point).into_iter().chain(*found) {
                let radius = distance(*point, zero);
                all.push(Search { of: index, point: *point, value: *value, zero, radius, reach: 0.5 });
            }
        }
        let best = |all: &[Search]| {
            let mut best = vec![Closest { distance: f64::INFINITY, slack: 0.0, zero: [0.0; 3] }; of.len()];
            for Search { of, zero, radius, reach, .. } in all {
                if *radius < best[*of].distance {
                    // What an offset of the zero along a smooth set changes.
                    best[*of] = Closest { distance: *radius, slack: 4.0 * radius * reach * reach, zero: *zero };
                }
            }
            best
        };
        for _ in 0..FIRST {
            walk(field, &mut all, sampler)?;
        }
        all.sort_by(|a, b| a.of.cmp(&b.of).then(a.radius.total_cmp(&b.radius)));
        let mut place = (usize::MAX, 0);
        all.retain(|search| {
            place = if place.0 == search.of { (search.of, place.1 + 1) } else { (search.of, 0) };
            place.1 < BEST
        });
        let mut before = Vec::new();
        for round in 0..ROUNDS {
            if round == ROUNDS - ROUNDS / 3 {
                before = best(&all);
            }
            walk(field, &mut all, sampler)?;
            cast(field, &mut all, sampler)?;
        }
        let slack = |before: &Closest, now: &Closest| {
            1e-7 * (1.0 + now.distance) + 4.0 * (before.distance - now.distance) + now.slack
        };
        Ok(before.iter().zip(best(&all)).map(|(before, now)| Closest { slack: slack(before, &now), ..now }).collect())
    }

    /// The nearest sample in each sector of space around a point.
    fn starts(&self, point: Point) -> Vec<Point> {
        let mut nearest = [(f64::INFINITY, point); SECTORS];
        for zero in &self.points {
            let v = minus(*zero, point);
            let signs = v.iter().fold(0, |signs, x| 2 * signs + usize::from(*x < 0.0));
            let [x, y, z] = v.map(f64::abs);
            let largest = if x >= y && x >= z { 0 } else { 1 + usize::from(z > y) };
            let (best, square) = (&mut nearest[3 * signs + largest], dot(v, v));
            if square < best.0 {
                *best = (square, *zero);
            }
        }
        nearest.into_iter().filter(|(square, _)| square.is_finite()).map(|(_, zero)| zero).collect()
    }
}

/// Moves zeros along the zero set: a Newton walk from places around them, and from where the tangent plane is nearest.
fn walk(field: &Field<'_>, all: &mut [Search], sampler: &mut Sampler) -> Result<(), Failure> {
    let zeros: Vec<Point> = all.iter().map(|s| s.zero).collect();
    let jets = field.jets(&zeros, Order::Gradient)?;
    let mut places = Vec::new();
    for (search, jet) in all.iter().zip(jets) {
        let apart = minus(search.point, search.zero);
        let normal = direction_of(jet.gradient).unwrap_or_default();
        places.push(along(search.zero, 1.0, along(apart, -dot(apart, normal), normal)));
        for _ in 1..WALKS {
            let direction = sampler.direction();
            places.push(along(search.zero, search.radius * search.look(sampler), direction));
        }
    }
    let found = newton(field, places, 3)?;
    for (search, zeros) in all.iter_mut().zip(found.chunks(WALKS)) {
        let mut success = false;
        for zero in zeros.iter().flatten() {
            success |= search.offer(*zero);
        }
        search.reach = if success { (search.reach * 1.5).min(0.5) } else { search.reach * 0.7 };
    }
    Ok(())
}

/// Looks from the points towards their zeros and somewhat beside, just as far.
fn cast(field: &Field<'_>, all: &mut [Search], sampler: &mut Sampler) -> Result<(), Failure> {
    let mut ends = Vec::new();
    for search in all.iter() {
        let towards = direction_of(minus(search.zero, search.point));
        for _ in 0..RAYS {
            let beside = sampler.direction();
            let scale = search.look(sampler);
            let ray = towards.and_then(|u| direction_of(along(u, scale, beside))).unwrap_or(beside);
            ends.push(along(search.point, search.radius * (1.0 - 1e-12), ray));
        }
    }
    let values = field.values(&ends)?;
    let (mut hit, mut pairs) = (Vec::new(), Vec::new());
    for (k, (search, (ends, values))) in all.iter().zip(ends.chunks(RAYS).zip(values.chunks(RAYS))).enumerate() {
        let other = |v: &f64| search.value != 0.0 && v.signum() * search.value < 0.0;
        if let Some(i) = values.iter().position(other) {
            hit.push(k);
            pairs.push((search.point, ends[i]));
        }
    }
    for (k, zero) in hit.into_iter().zip(bisect(field, pairs)?) {
        let search = &mut all[k];
        if search.offer(zero) {
            search.reach = (search.reach * 1.5).min(0.5);
        }
    }
    Ok(())
}

/// Between points of different signs, the place where the sign changes, on the side of the second.
fn bisect(field: &Field<'_>, mut pairs: Vec<(Point, Point)>) -> Result<Vec<Point>, Failure> {
    const HALVINGS: usize = 50;
    let starts: Vec<Point> = pairs.iter().map(|(a, _)| *a).collect();
    let negative: Vec<bool> = field.values(&starts)?.iter().map(|v| *v < 0.0).collect();
    for _ in 0..HALVINGS {
        let middles: Vec<Point> = pairs.iter().map(|(a, b)| scaled(along(*a, 1.0, *b), 0.5)).collect();
        for ((pair, middle), (value, negative)) in
            pairs.iter_mut().zip(&middles).zip(field.values(&middles)?.iter().zip(&negative))
        {
            if (*value < 0.0) == *negative {
                pair.0 = *middle;
            } else {
                pair.1 = *middle;
            }
        }
    }
    Ok(pairs.into_iter().map(|(_, b)| b).collect())
}

/// Walks to the zero set by p − F∇F/‖∇F‖²; nothing where the walk does not arrive.
fn newton(field: &Field<'_>, mut points: Vec<Point>, steps: usize) -> Result<Vec<Option<Point>>, Failure> {
    for _ in 0..steps {
        let jets = field.jets(&points, Order::Gradient)?;
        for (point, jet) in points.iter_mut().zip(jets) {
            let square = dot(jet.gradient, jet.gradient);
            if square > 0.0 {
                *point = along(*point, -jet.value / square, jet.gradient);
            }
        }
    }
    let values = field.values(&points)?;
    let arrived = |(p, v): (&Point, f64)| (v.abs() <= 1e-12 * (1.0 + norm(*p))).then_some(*p);
    Ok(points.iter().zip(values).map(arrived).collect())
}
