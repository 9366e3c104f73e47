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

/// √(u² + v²) of two fields, with l the root and n = (u, v)/l: ∇l = (u∇u + v∇v)/l, and
/// H = (u·H_u + v·H_v + ∇u∇uᵀ + ∇v∇vᵀ − ∇l∇lᵀ)/l.
fn hypotenuse(u: Field, v: Field) -> Field {
    let value = u.value.hypot(v.value);
    let gradient = (u.gradient * u.value + v.gradient * v.value) / value;
    let own = outer(u.gradient, u.gradient) + outer(v.gradient, v.gradient) - outer(gradient, gradient);
    let hessian = (u.hessian * u.value + v.hessian * v.value + own) * value.recip();
    Field { value, gradient, hessian, clearance: u.clearance.min(v.clearance).min(value) }
}

/// ⟨p, n⟩ − offset: flat, with the gradient n.
fn linear(p: DVec3, normal: DVec3, offset: f64) -> Field {
    Field { value: p.dot(normal) - offset, gradient: normal, hessian: DMat3::ZERO, clearance: f64::INFINITY }
}

/// ρ = ‖(x, y)‖: the normal n = (x, y, 0)/ρ, and t·tᵀ/ρ with the tangent t = (−y, x, 0)/ρ.
fn axial(p: DVec3) -> Field {
    let rho = p.x.hypot(p.y);
    let tangent = DVec3::new(-p.y, p.x, 0.0) / rho;
    Field {
        value: rho,
        gradient: DVec3::new(p.x, p.y, 0.0) / rho,
        hessian: outer(tangent, tangent) * rho.recip(),
        clearance: rho,
    }
}

/// A field less a number.
fn less(u: Field, by: f64) -> Field {
    Field { value: u.value - by, ..u }
}

/// ⟨p, n⟩ − offset with n = normal/‖normal‖.
#[must_use]
pub fn plane(p: DVec3, normal: DVec3, offset: f64) -> Field {
    linear(p, normal / normal.length(), offset)
}

/// ‖(ρ − major, z)‖ − minor.
#[must_use]
pub fn torus(p: DVec3, major: f64, minor: f64) -> Field {
    less(hypotenuse(less(axial(p), major), linear(p, DVec3::Z, 0.0)), minor)
}

/// The distance to the segment from a to b less the radius: a sphere's beyond the ends, a cylinder's between them,
/// where the direction from the axis is n and the only curvature is that around the axis d, (I − d·dᵀ − n·nᵀ)/r.
#[must_use]
pub fn capsule(p: DVec3, a: DVec3, b: DVec3, radius: f64) -> Field {
    let axis = b - a;
    let along = (p - a).dot(axis) / axis.length();
    let past = (along - axis.length()).abs().min(along.abs());
    let end = |centre| translated(p, centre, |p| sphere(p, radius));
    if along <= 0.0 || along >= axis.length() {
        let field = end(if along <= 0.0 { a } else { b });
        return Field { clearance: field.clearance.min(past), ..field };
    }
    let d = axis.normalize();
    let arm = p - a - d * along;
    let r = arm.length();
    let n = arm / r;
    Field {
        value: r - radius,
        gradient: n,
        hessian: (DMat3::IDENTITY - outer(d, d) - outer(n, n)) * r.recip(),
        clearance: r.min(past),
    }
}

/// The corner u ≤ 0, v ≤ 0 of two fields whose gradients are perpendicular: √(u² + v²) where both are above 0, else
/// the larger.
fn corner(u: Field, v: Field) -> Field {
    let near = u.value.abs().min(v.value.abs());
    let clearance = u.clearance.min(v.clearance);
    if u.value > 0.0 && v.value > 0.0 {
        let field = hypotenuse(u, v);
        return Field { clearance: clearance.min(near), ..field };
    }
    let (more, fewer) = if u.value < v.value { (v, u) } else { (u, v) };
    // Outside, the smaller changes nothing until it is above 0; inside, until it is the larger.
    let next = if more.value > 0.0 { -fewer.value } else { (more.value - fewer.value).min(-more.value) };
    Field { clearance: clearance.min(next).min(more.value.abs()), ..more }
}

/// A cylinder around the z axis: the corner of ρ − radius and |z| − half_height.
#[must_use]
pub fn cylinder(p: DVec3, radius: f64, half_height: f64) -> Field {
    let side = linear(p, DVec3::Z * p.z.signum(), half_height);
    corner(less(axial(p), radius), Field { clearance: p.z.abs(), ..side })
}

/// A box whose corners are rounded by the radius: the exact box of what is left inside the rounding, less the radius.
#[must_use]
pub fn round_box(p: DVec3, extent: DVec3, radius: f64) -> Field {
    less(cuboid(p, extent - DVec3::splat(radius)), radius)
}

/// max(A, B), the left on ties.
#[must_use]
pub fn intersection(a: Field, b: Field) -> Field {
    let clearance = a.clearance.min(b.clearance).min((a.value - b.value).abs());
    Field { clearance, ..if a.value < b.value { b } else { a } }
}

/// (sin X cos Y + sin Y cos Z + sin Z cos X)/(w√3) at (X, Y, Z) = w·p, w = 2π/cell. With S, C the sines and cosines:
/// ∂/∂X = C_X C_Y − S_Z S_X, ∂²/∂X² = −S_X C_Y − S_Z C_X, ∂²/∂X∂Y = −C_X S_Y, and so on around.
#[must_use]
pub fn gyroid(p: DVec3, cell: f64) -> Field {
    let w = std::f64::consts::TAU / cell;
    let (s, c) = ((p * w).map(f64::sin), (p * w).map(f64::cos));
    let scale = (w * 3.0_f64.sqrt()).recip();
    // X Y Z, Y Z X and Z X Y of the formulas.
    let around = [[0, 1, 2], [1, 2, 0], [2, 0, 1]];
    let value: f64 = around.iter().map(|[x, y, _]| s[*x] * c[*y]).sum();
    let gradient = around.map(|[x, y, z]| c[x] * c[y] - s[z] * s[x]);
    let mut hessian = DMat3::ZERO;
    for [x, y, z] in around {
        hessian.col_mut(x)[x] = -s[x] * c[y] - s[z] * c[x];
        hessian.col_mut(x)[y] = -c[x] * s[y];
        hessian.col_mut(y)[x] = -c[x] * s[y];
    }
    Field {
        value: value * scale,
        gradient: DVec3::from_array(gradient) * (scale * w),
        hessian: hessian * (scale * w * w),
        clearance: f64::INFINITY,
    }
}

/// ‖M·p‖·least − least with M = diag(1/radii): with q = M·p and l = ‖q‖, ∇ = M·q/l and H = (M² − ∇∇ᵀ)/l, each times
/// the least radius.
#[must_use]
pub fn ellipsoid(p: DVec3, radii: DVec3) -> Field {
    let least = radii.min_element();
    let m = radii.recip();
    let length = (m * p).length();
    let gradient = m * m * p / length;
    Field {
        value: (length - 1.0) * least,
        gradient: gradient * least,
        hessian: (DMat3::from_diagonal(m * m) - outer(gradient, gradient)) * (least / length),
        clearance: length * least,
    }
}

/// F at p − cell·round(p/cell): the field of the nearest copy.
#[must_use]
pub fn repeated(p: DVec3, cell: DVec3, field: impl Fn(DVec3) -> Field) -> Field {
    let ratio = p / cell;
    let moved = field(p - cell * ratio.map(f64::round));
    let wall = (ratio.map(|x| (x - x.floor() - 0.5).abs()) * cell).min_element();
    Field { clearance: moved.clearance.min(wall), ..moved }
}

/// F at the point q(p) = (c·x + s·y, c·y − s·x, z) with c, s = cos, sin(rate·z). With the Jacobian
/// J = ∂q/∂p: ∇ = Jᵀ∇F, and H = Jᵀ·H_F·J + Σ ∂F/∂qₖ·∂²qₖ/∂p². As q_x′ = rate·q_y and q_y′ = −rate·q_x along z, the last
/// is by (x, z) rate·(∂F/∂q_y·(−c) − ∂F/∂q_x·s), by (y, z) rate·(∂F/∂q_x·c − ∂F/∂q_y·s), and by (z, z)
/// −rate²·(∂F/∂q_x·q_x + ∂F/∂q_y·q_y).
#[must_use]
pub fn twisted(p: DVec3, rate: f64, field: impl Fn(DVec3) -> Field) -> Field {
    let (s, c) = (rate * p.z).sin_cos();
    let q = DVec3::new(c * p.x + s * p.y, c * p.y - s * p.x, p.z);
    let f = field(q);
    let g = f.gradient;
    let jacobian =
        DMat3::from_cols(DVec3::new(c, -s, 0.0), DVec3::new(s, c, 0.0), DVec3::new(rate * q.y, -rate * q.x, 1.0));
    let by_xz = rate * (-g.y * c - g.x * s);
    let by_yz = rate * (g.x * c - g.y * s);
    let by_zz = -rate * rate * (g.x * q.x + g.y * q.y);
    let bent =
        DMat3::from_cols(DVec3::new(0.0, 0.0, by_xz), DVec3::new(0.0, 0.0, by_yz), DVec3::new(by_xz, by_yz, by_zz));
    Field { gradient: jacobian.transpose() * g, hessian: jacobian.transpose() * f.hessian * jacobian + bent, ..f }
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
        let models: [Model; 13] = [
            |p| sphere(p, 1.5),
            |p| cuboid(p, DVec3::new(1.0, 0.7, 1.2)),
            |p| smooth_union(sphere(p, 1.0), translated(p, DVec3::X, |p| cuboid(p, DVec3::ONE)), 0.5),
            |p| plane(p, DVec3::new(1.0, -2.0, 0.5), 0.25),
            |p| torus(p, 1.2, 0.4),
            |p| capsule(p, DVec3::new(-1.0, 0.5, 0.0), DVec3::new(1.0, -0.5, 0.75), 0.5),
            |p| cylinder(p, 0.9, 0.6),
            |p| round_box(p, DVec3::new(1.0, 0.7, 1.2), 0.3),
            |p| intersection(sphere(p, 1.5), translated(p, DVec3::X, |p| sphere(p, 1.0))),
            |p| gyroid(p, 2.5),
            |p| ellipsoid(p, DVec3::new(1.5, 0.8, 1.1)),
            |p| repeated(p, DVec3::new(1.5, 2.0, 1.0), |p| sphere(p, 0.4)),
            |p| twisted(p, 0.7, |p| translated(p, DVec3::X, |p| ellipsoid(p, DVec3::new(1.5, 0.8, 1.1)))),
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
                let step = field.clearance.min(1.0) / 4.0;
                for i in 0..3 {
                    let moved = |x: f64| {
                        let mut p = p;
                        p[i] = x;
                        model(p)
                    };
                    let slope = central(|x| moved(x).value, p[i], step);
                    let error = 1e-9 + 4.0 * slope.error;
                    assert!((slope.value - field.gradient[i]).abs() < error, "{p} {field:?} {slope:?}");
                    for j in 0..3 {
                        let slope = central(|x| moved(x).gradient[j], p[i], step);
                        let error = 1e-8 + 4.0 * slope.error;
                        assert!((slope.value - field.hessian.col(i)[j]).abs() < error, "{p} {field:?} {slope:?}");
                    }
                }
            }
            assert!(judged > 350, "{judged}");
        }
    }
}
