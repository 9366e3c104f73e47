//! Chosen graphs, as the compiler would make them.

use isograd_graph::{Builder, NodeId, Precision, Scalar, Verified};

use crate::garden::graph;

fn point(b: &mut Builder<'_>) -> [NodeId; 3] {
    ["at.x", "at.y", "at.z"].map(|name| b.input(name, Scalar::Real))
}

fn length(b: &mut Builder<'_>, v: [NodeId; 3]) -> NodeId {
    let [x, y, z] = v.map(|x| b.mul(x, x));
    let sum = b.add(x, y);
    let sum = b.add(sum, z);
    b.sqrt(sum)
}

/// The distance to a sphere and its gradient.
pub fn sphere() -> Verified {
    graph(Precision::F32, |b| {
        let at = point(b);
        let radius = b.input("radius", Scalar::Real);
        let away = length(b, at);
        let value = b.sub(away, radius);
        b.output("value", value);
        for (name, x) in ["x", "y", "z"].iter().zip(at) {
            let slope = b.div(x, away);
            b.output(format!("value/at.{name}"), slope);
        }
    })
}

/// Two spheres side by side, joined smoothly, with the gradient.
pub fn smooth_union() -> Verified {
    graph(Precision::F32, |b| {
        let at = point(b);
        let (radius, k) = (b.input("radius", Scalar::Real), b.input("k", Scalar::Real));
        let one = b.real(1.0);
        let (zero, half) = (b.real(0.0), b.real(0.5));
        let [x, y, z] = at;
        let (left, right) = (b.add(x, one), b.sub(x, one));
        let spheres = [left, right].map(|x| {
            let away = length(b, [x, y, z]);
            let gradient = [x, y, z].map(|x| b.div(x, away));
            (b.sub(away, radius), gradient)
        });
        let [(a, da), (c, dc)] = spheres;
        // h = clamp(½ + ½(c − a)/k), value = c + (a − c)h − k·h(1 − h)
        let apart = b.sub(c, a);
        let apart = b.mul(half, apart);
        let apart = b.div(apart, k);
        let h = b.add(half, apart);
        let h = b.max(h, zero);
        let h = b.min(h, one);
        let back = b.sub(one, h);
        let (wa, wc) = (b.mul(a, h), b.mul(c, back));
        let mixed = b.add(wa, wc);
        let bump = b.mul(h, back);
        let bump = b.mul(k, bump);
        let value = b.sub(mixed, bump);
        b.output("value", value);
        for (axis, (da, dc)) in ["x", "y", "z"].iter().zip(da.into_iter().zip(dc)) {
            let (da, dc) = (b.mul(da, h), b.mul(dc, back));
            let slope = b.add(da, dc);
            b.output(format!("value/at.{axis}"), slope);
        }
    })
}

/// A branch with a branch in it, joins of values that come later, and a side without statements.
pub fn branch() -> Verified {
    graph(Precision::F32, |b| {
        let (x, n) = (b.input("x", Scalar::Real), b.input("n", Scalar::Int));
        let (zero, four) = (b.real(0.0), b.int(4));
        let below = b.lt(x, zero);
        b.gamma(below);
        let few = b.ilt(n, four);
        b.gamma(few);
        b.otherwise();
        let root = b.neg(x);
        let root = b.sqrt(root);
        let end = b.end();
        let inner = b.join(end, zero, root);
        b.otherwise();
        let cube = b.mul(x, x);
        let cube = b.mul(cube, x);
        let end = b.end();
        let late = b.floor(x);
        let first = b.join(end, inner, cube);
        let second = b.join(end, late, cube);
        b.output("first", first);
        b.output("second", second);
    })
}

/// Fibonacci numbers, and variables that change places.
pub fn cycle() -> Verified {
    graph(Precision::F32, |b| {
        let (from, to) = (b.input("from", Scalar::Int), b.input("to", Scalar::Int));
        let (zero, one) = (b.int(0), b.int(1));
        b.theta(from, to);
        let i = b.counter();
        let (x, y) = (b.carried(zero), b.carried(one));
        let (p, q) = (b.carried(from), b.carried(to));
        let sum = b.iadd(x, y);
        let sum = b.iadd(sum, i);
        let end = b.end();
        for (name, (variable, next)) in [("x", (x, y)), ("y", (y, sum)), ("p", (p, q)), ("q", (q, p))] {
            let last = b.carry_out(end, variable, next);
            b.output(name, last);
        }
    })
}

/// The slope of x ↦ sqrt(x + k) iterated, in reverse.
pub fn tape() -> Verified {
    graph(Precision::F32, |b| {
        let x = b.input("x", Scalar::Real);
        let (first, last, none, count) = (b.int(-3), b.int(7), b.int(0), b.int(10));
        let (one, half) = (b.real(1.0), b.real(0.5));
        b.theta(first, last);
        let k = b.counter();
        let y = b.carried(x);
        let k = b.int_to_real(k);
        let sum = b.add(y, k);
        let root = b.sqrt(sum);
        let end = b.end();
        let value = b.carry_out(end, y, root);
        let all = b.tape(end, root, 1);
        let some = b.tape(end, y, 4);
        b.theta(none, count);
        let i = b.counter();
        let slope = b.carried(one);
        let nine = b.int(9);
        let back = b.isub(nine, i);
        let root = b.recall(all, back);
        let third = b.int(2);
        let y = b.recall(some, third);
        let unit = b.div(half, root);
        let unit = b.mul(unit, y);
        let next = b.mul(slope, unit);
        let end = b.end();
        let slope = b.carry_out(end, slope, next);
        b.output("value", value);
        b.output("value/x", slope);
    })
}

/// A chain of so many additions and products.
pub fn straight(operations: usize) -> Verified {
    graph(Precision::F32, |b| {
        let x = b.input("x", Scalar::Real);
        let mut y = x;
        for k in 0..operations / 2 {
            let c = b.real(k as f64 + 0.1);
            y = b.add(y, c);
            y = b.mul(y, x);
        }
        b.output("y", y);
    })
}

/// Branches inside each other.
pub fn nested(depth: usize) -> Verified {
    graph(Precision::F32, |b| {
        let x = b.input("x", Scalar::Real);
        let conds: Vec<NodeId> = (0..depth)
            .map(|k| {
                let c = b.real(k as f64);
                b.lt(x, c)
            })
            .collect();
        conds.iter().for_each(|cond| _ = b.gamma(*cond));
        let mut y = b.sqrt(x);
        for _ in &conds {
            b.otherwise();
            let end = b.end();
            y = b.join(end, y, x);
        }
        b.output("y", y);
    })
}
