//! Shapes as a reader of LANGUAGE A.5 and A.6 would write them in Rust: value, gradient and Hessian by hand, in f64 with
//! glam. Knows no graph, no program and no derivative rule.

use glam::{DMat3, DVec3};

/// A field at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Field {
    /// Its value.
    pub value: f64,
    /// ∇.
    pub gradient: DVec3,
    /// ∇∇ᵀ, symmetric.
    pub hessian: DMat3,
    /// How far the point is from where the formulas change: tolerances make no sense nearer than rounding.
    pub clearance: f64,
}

/// u·vᵀ.
fn outer(u: DVec3, v: DVec3) -> DMat3 {
    DMat3::from_cols(u * v.x, u * v.y, u * v.z)
}

/// ‖p‖ − r: the normal n = p/‖p‖, and (I − n·nᵀ)/‖p‖. At the centre all derivatives are 0 (LANGUAGE 13.6).
#[must_use]
pub fn sphere(p: DVec3, radius: f64) -> Field {
    let length = p.length();
    if length == 0.0 {
        return Field { value: -radius, gradient: DVec3::ZERO, hessian: DMat3::ZERO, clearance: 0.0 };
    }
    let normal = p / length;
    Field {
        value: length - radius,
        gradient: normal,
        hessian: (DMat3::IDENTITY - outer(normal, normal)) * length.recip(),
        clearance: length,
    }
}

/// The exact distance to a box of half extents e. With q = |p| − e: outside, the distance to the nearest point of the
/// box, whose gradient points away from it and which curves only around edges and corners; inside, minus the distance
/// to the nearest face, flat.
#[must_use]
pub fn cuboid(p: DVec3, extent: DVec3) -> Field {
    let q = p.abs() - extent;
    let side = DVec3::new(p.x.signum(), p.y.signum(), p.z.signum());
    if q.max_element() > 0.0 {
        let beyond = q.max(DVec3::ZERO);
        let distance = beyond.length();
        let normal = side * (beyond / distance);
        // The directions in which the nearest point of the box does not follow p.
        let stuck = DVec3::from_array(q.to_array().map(|x| if x > 0.0 { 1.0 } else { 0.0 }));
        let curved = (DMat3::from_diagonal(stuck) - outer(normal, normal)) * distance.recip();
        let edges = q.abs().min_element();
        let folds = p.abs() + (DVec3::ONE - stuck) * f64::MAX;
        return Field { value: distance, gradient: normal, hessian: curved, clearance: edges.min(folds.min_element()) };
    }
    let mut order = [0, 1, 2];
    order.sort_by(|i, j| q[*j].total_cmp(&q[*i]));
    let [nearest, second, _] = order;
    let mut gradient = DVec3::ZERO;
    gradient[nearest] = side[nearest];
    Field {
        value: q[nearest],
        gradient,
        hessian: DMat3::ZERO,
        clearance: (q[nearest] - q[second]).min(-q[nearest]).min(p[nearest].abs()),
    }
}

/// p moved by −offset.
#[must_use]
pub fn translated(p: DVec3, offset: DVec3, field: impl Fn(DVec3) -> Field) -> Field {
    field(p - offset)
}

/// min(A, B) − h²k/4 with h = max(k − |A − B|, 0)/k. In the seam, with the weight w = h/2 of the farther operand F and
/// 1 − w of the nearer one N: ∇ = (1 − w)∇N + w∇F, and the Hessian (1 − w)H_N + w·H_F − (∇A − ∇B)(∇A − ∇B)ᵀ/2k.
#[must_use]
pub fn smooth_union(a: Field, b: Field, k: f64) -> Field {
    let (near, far) = if b.value < a.value { (b, a) } else { (a, b) };
    let gap = far.value - near.value;
    let clearance = a.clearance.min(b.clearance).min((k - gap).abs());
    if gap >= k {
        return Field { clearance, ..near };
    }
    let h = (k - gap) / k;
    let w = h / 2.0;
    let across = a.gradient - b.gradient;
    Field {
        value: near.value - h * h * k / 4.0,
        gradient: near.gradient * (1.0 - w) + far.gradient * w,
        hessian: near.hessian * (1.0 - w) + far.hessian * w - outer(across, across) * (0.5 / k),
        clearance,
    }
}

/// min(A, B), the left on ties.
#[must_use]
pub fn union(a: Field, b: Field) -> Field {
    let clearance = a.clearance.min(b.clearance).min((a.value - b.value).abs());
    Field { clearance, ..if b.value < a.value { b } else { a } }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::differences::central;
    use crate::points::in_box;

    /// The hand-derived gradients and Hessians are those of the values: the models are tested by differences, before
    /// they test anything.
    #[test]
    fn models_agree_with_differences() {
        type Model = fn(DVec3) -> Field;
        let models: [Model; 3] = [
            |p| sphere(p, 1.5),
            |p| cuboid(p, DVec3::new(1.0, 0.7, 1.2)),
            |p| smooth_union(sphere(p, 1.0), translated(p, DVec3::X, |p| cuboid(p, DVec3::ONE)), 0.5),
        ];
        for model in models {
            let mut judged = 0;
            for point in in_box(&[(-2.0, 2.0); 3], 500, 9) {
                let p = DVec3::from_slice(&point);
                let field = model(p);
                if field.clearance < 1e-2 {
                    continue;
                }
                judged += 1;
                for i in 0..3 {
                    let moved = |x: f64| {
                        let mut p = p;
                        p[i] = x;
                        model(p)
                    };
                    let slope = central(|x| moved(x).value, p[i], field.clearance / 4.0);
                    let error = 1e-9 + 4.0 * slope.error;
                    assert!((slope.value - field.gradient[i]).abs() < error, "{p} {field:?} {slope:?}");
                    for j in 0..3 {
                        let slope = central(|x| moved(x).gradient[j], p[i], field.clearance / 4.0);
                        let error = 1e-8 + 4.0 * slope.error;
                        assert!((slope.value - field.hessian.col(i)[j]).abs() < error, "{p} {field:?} {slope:?}");
                    }
                }
            }
            assert!(judged > 400, "{judged}");
        }
    }
}
