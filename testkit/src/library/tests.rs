//! The laws judge closed formulas: right ones pass, wrong ones do not.

use super::*;
use crate::library::space::{along, direction_of, norm};

const CLAIM: Claim = Claim { class: None, side: None, lipschitz: None, within: (-2.0, 2.0), critical: Vec::new() };

/// A ball of radius 1, its numbers altered.
fn ball(alter: impl Fn(Point, Jet) -> Jet) -> impl Fn(&[Point], Order) -> Result<Vec<Jet>, String> {
    move |points, _| {
        let jet = |p: &Point| {
            let n = direction_of(*p).unwrap_or_default();
            let r = norm(*p);
            let hessian = [0, 1, 2].map(|i| {
                let e = [0, 1, 2].map(|j| f64::from(u8::from(i == j)));
                if r > 0.0 { along(e, -n[i], n).map(|x| x / r) } else { [0.0; 3] }
            });
            alter(*p, Jet { value: r - 1.0, gradient: n, hessian })
        };
        Ok(points.iter().map(jet).collect())
    }
}

fn judged(class: Class, alter: impl Fn(Point, Jet) -> Jet) -> Result<Measured, String> {
    let evaluate = ball(alter);
    let field = Field { name: "ball", dimension: 3, double: &evaluate, single: &evaluate };
    judge(&field, &Claim { class: Some(class), ..CLAIM }).map_err(|failure| failure.law.to_owned())
}

#[test]
fn a_ball_is_exact() {
    let measured = judged(Class::Exact, |_, jet| jet).expect("the distance of a ball");
    assert!(measured.distance.is_some_and(|off| off < 1e-6), "{measured:?}");
    assert!(measured.unit.is_some_and(|off| off < 1e-12), "{measured:?}");
    assert!(measured.lipschitz.is_some_and(|quotient| quotient < 1.0 + 1e-9), "{measured:?}");
    assert!(measured.count.judged > 5000, "{measured:?}");
}

#[test]
fn wrong_numbers_are_found() {
    let law = |alter: fn(Point, Jet) -> Jet| judged(Class::Exact, alter).expect_err("a wrong number");
    assert_eq!(law(|p, jet| Jet { value: if p[0] > 1e8 { f64::NAN } else { jet.value }, ..jet }), "finite");
    assert_eq!(law(|_, jet| Jet { gradient: jet.gradient.map(|x| x * 1.001), ..jet }), "differences");
    assert_eq!(law(|_, jet| Jet { hessian: [[0.0; 3]; 3], ..jet }), "differences");
    let longer = |_: Point, jet: Jet| Jet {
        value: jet.value * 1.01,
        gradient: jet.gradient.map(|x| x * 1.01),
        hessian: jet.hessian.map(|row| row.map(|x| x * 1.01)),
    };
    assert_eq!(law(longer), "unit gradient");
    assert_eq!(judged(Class::Lower, longer).expect_err("longer than the distance"), "Lipschitz");
    assert!(judged(Class::Neither, longer).is_ok());
    // The slope is right everywhere but at one jump, inside.
    let jump = |p: Point, jet: Jet| Jet { value: jet.value - if norm(p) < 0.5 { 1e-4 } else { 0.0 }, ..jet };
    assert_eq!(judged(Class::Unit, jump).expect_err("a jump"), "continuous");
}

type Value = fn(Point) -> f64;

/// The largest of what a point is beyond the faces of a box.
fn faces(p: Point) -> f64 {
    (p[0].abs() - 1.0).max(p[1].abs() - 0.5).max(p[2].abs() - 1.5)
}

/// The distance outside of that box.
fn beyond(p: Point) -> f64 {
    norm([p[0].abs() - 1.0, p[1].abs() - 0.5, p[2].abs() - 1.5].map(|x| x.max(0.0)))
}

/// A field in f64 alone, judged by the law of distance alone.
fn searched(class: Class, side: Option<Side>, value: Value) -> Result<f64, String> {
    let slope = |p: Point, axis: usize| {
        let moved = |h: f64| {
            let mut p = p;
            p[axis] += h;
            value(p)
        };
        (moved(1e-6) - moved(-1e-6)) / 2e-6
    };
    let jet = |p: &Point| Jet { value: value(*p), gradient: [0, 1, 2].map(|i| slope(*p, i)), ..Jet::default() };
    let evaluate = |points: &[Point], _: Order| Ok(points.iter().map(jet).collect());
    let field = Field { name: "searched", dimension: 3, double: &evaluate, single: &evaluate };
    let claim = Claim { class: Some(class), side, ..CLAIM };
    let measured = distance::distance(&field, &claim, class).map_err(|failure| failure.what)?;
    Ok(measured.distance.unwrap_or(0.0))
}

#[test]
fn distances_are_found_by_search_alone() {
    let cases: [(&str, Option<Side>, Value); 4] = [
        ("ball", None, |p| norm(p) - 1.0),
        ("box", None, |p| beyond(p) + faces(p).min(0.0)),
        ("inside of a cut", Some(Side::Inside), |p| p[0].max(p[1]) - 0.5),
        ("plate", None, |p| norm([(p[0].abs() - 1.0).max(0.0), p[1], (p[2].abs() - 1.0).max(0.0)])),
    ];
    for (name, side, value) in cases {
        let worst = searched(Class::Exact, side, value).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(worst < 1e-5, "{name}: {worst}");
    }
    let refuted: [(&str, Option<Side>, Value, &str); 6] = [
        ("too long", None, |p| 1.001 * (norm(p) - 1.0), "nearer"),
        ("too short", None, |p| 0.999 * (norm(p) - 1.0), "farther"),
        ("too short inside", None, |p| (norm(p) - 1.0).max(0.999 * (norm(p) - 1.0)), "farther"),
        ("no corners", None, faces, "farther"),
        ("outside of a cut", Some(Side::Outside), |p| p[0].max(p[1]) - 0.5, "farther"),
        ("nowhere", None, |p| norm(p) + 0.5, "no zero"),
    ];
    for (name, side, value, how) in refuted {
        let message = searched(Class::Exact, side, value).expect_err(name);
        assert!(message.contains(how), "{name}: {message}");
    }
    let message = searched(Class::Lower, None, |p| 1.001 * (norm(p) - 1.0)).expect_err("no lower bound");
    assert!(message.contains("nearer"), "{message}");
    assert!(searched(Class::Lower, None, |p| 0.999 * (norm(p) - 1.0)).is_ok());
}
