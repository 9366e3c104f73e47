//! Fields whose claims are wrong, each of which a law must reject, and what they were before they were spoilt, which
//! must pass: a law that accepts everything proves nothing.

use libtest_mimic::Trial;

use isograd_testkit::library::{Field, Jet, Order, Point, judge};

use crate::kernels::Kernels;
use crate::specimens::{self, parse};

const HELPERS: &str = "\
fn corner(q: vec3) -> real { length(max(q, [0.0; 3])) + min(max(q.x, max(q.y, q.z)), 0.0) }
fn cube(p: vec3, e: vec3) -> real { corner(abs(p) - e) }
";

/// Name, directives, the body of `f(p: vec3)`.
const RIGHT: &[(&str, &[&str], &str)] = &[
    ("ball", &["class E"], "length(p) - 1.0"),
    ("box", &["class E"], "cube(p, [1.0, 0.5, 1.5])"),
    ("flat box", &["class E", "outside"], "cube(p, [1.0, 0.0, 1.0])"),
    ("octahedron", &["class U"], "(abs(p.x) + abs(p.y) + abs(p.z) - 1.0) / sqrt(3.0)"),
    ("boxes joined", &["class U"], "min(cube(p, [1.0, 0.5, 0.5]), cube(p, [0.5, 1.0, 0.5]))"),
    ("boxes joined, outside", &["class E", "outside"], "min(cube(p, [1.0, 0.5, 0.5]), cube(p, [0.5, 1.0, 0.5]))"),
    ("boxes cut, inside", &["class E", "inside"], "max(cube(p, [1.0, 0.5, 0.5]), cube(p, [0.5, 1.0, 0.5]))"),
    ("short", &["class L"], "0.7 * (length(p) - 1.0)"),
    ("steep", &["class N", "lipschitz 1.5"], "1.5 * (length(p) - 1.0)"),
];

/// The same, and the law that must reject it.
const WRONG: &[(&str, &[&str], &str, &str)] = &[
    ("1.01 of a ball", &["class E"], "1.01 * (length(p) - 1.0)", "unit gradient"),
    ("a ball that is longer inside", &["class E"], "max(length(p) - 1.0, 1.01 * (length(p) - 1.0))", "unit gradient"),
    (
        "a box without an `abs`",
        &["class E"],
        "length(max(p - [1.0, 0.5, 1.5], [0.0; 3])) + min(max(abs(p.x) - 1.0, max(abs(p.y) - 0.5, abs(p.z) - 1.5)), 0.0)",
        "unit gradient",
    ),
    (
        "a box that is wrong beyond its edges",
        &["class E"],
        "max(abs(p.x) - 1.0, max(abs(p.y) - 0.5, abs(p.z) - 1.5))",
        "foot point",
    ),
    ("an octahedron as a distance", &["class E"], "(abs(p.x) + abs(p.y) + abs(p.z) - 1.0) / sqrt(3.0)", "foot point"),
    (
        "boxes joined, wrong inside only",
        &["class E"],
        "min(cube(p, [1.0, 0.5, 0.5]), cube(p, [0.5, 1.0, 0.5]))",
        "foot point",
    ),
    ("planes cut, wrong outside only", &["class E", "outside"], "max(p.x, 0.8 * p.y - 0.6 * p.x)", "foot point"),
    ("a nearer zero that is ignored", &["class E"], "if p.x > 0.9 { p.x - 1.0 } else { p.x + 1.0 }", "continuous"),
    ("a jump", &["class U"], "length(p) - 1.0 + if p.x > 0.25 { 0.00001 } else { 0.0 }", "continuous"),
    ("a short one as unit", &["class U"], "0.999 * (length(p) - 1.0)", "unit gradient"),
    ("1.1 of a ball as a lower bound", &["class L"], "1.1 * (length(p) - 1.0)", "Lipschitz"),
    ("slope 1.5 as a lower bound", &["class L"], "1.5 * p.x + 0.1 * sin(p.y)", "Lipschitz"),
    ("slope 1.5 as 1.45", &["class N", "lipschitz 1.45"], "1.5 * (length(p) - 1.0)", "Lipschitz"),
    ("0/0 at the centre", &["class E"], "dot(p, p) / length(p) - 1.0", "finite"),
    (
        "an overflow in f32",
        &["class N"],
        "p.x * (dot(p, p) * dot(p, p) * dot(p, p)) / (1.0 + dot(p, p) * dot(p, p) * dot(p, p))",
        "finite",
    ),
    ("a NaN in the gradient", &["class N"], "p.y + sqrt(p.x * p.x) * p.x / abs(p.x)", "finite"),
    ("nothing but kinks", &["class L"], "abs(mod(1048576.0 * p.x, 2.0) - 1.0) / 2097152.0", "differences"),
    ("no zero", &["class E"], "length(p) + 0.5", "foot point"),
];

/// A trial for each.
pub fn trials() -> Vec<Trial> {
    let program = |claims: &[&str], body: &str| {
        let said: String = claims.iter().map(|claim| format!("//# {claim}\n")).collect();
        format!("{HELPERS}{said}export fn f(p: vec3) -> real {{ {body} }}\n")
    };
    let right = RIGHT.iter().map(move |(name, claims, body)| {
        let source = program(claims, body);
        Trial::test(format!("control: {name}"), move || Ok(judge_all(&source)?))
    });
    let wrong = WRONG.iter().map(move |(name, claims, body, law)| {
        let source = program(claims, body);
        Trial::test(format!("control: {name} is rejected"), move || Ok(rejected(judge_all(&source), law)?))
    });
    let spoilt = [("gradient", 1), ("Hessian", 2)].map(|(what, order)| {
        Trial::test(format!("control: a wrong {what} is rejected"), move || Ok(rejected(spoilt(order), "differences")?))
    });
    right.chain(wrong).chain(spoilt).collect()
}

fn judge_all(source: &str) -> Result<(), String> {
    for specimen in parse("control", source) {
        specimens::judge(&specimen)?;
    }
    Ok(())
}

fn rejected(answer: Result<(), String>, law: &str) -> Result<(), String> {
    match answer {
        Err(e) if e.contains(&format!("the law `{law}`")) => Ok(()),
        Err(e) => Err(format!("it must be the law `{law}` that rejects it: {e}")),
        Ok(()) => Err("it was accepted".to_owned()),
    }
}

/// A box whose derivatives of one order lack a sign, as by a rule that forgets it.
fn spoilt(order: usize) -> Result<(), String> {
    let source = format!("{HELPERS}//# class N\nexport fn f(p: vec3) -> real {{ length(p) + 0.5 * sin(p.x * p.y) }}\n");
    let kernels = Kernels::compile(&source, "f", 3)?;
    let spoil = |mut jet: Jet| {
        match order {
            1 => jet.gradient[1] = -jet.gradient[1],
            _ => jet.hessian[0][1] = -jet.hessian[0][1],
        }
        jet
    };
    let double = |points: &[Point], order: Order| {
        Ok(kernels.double(points, order, 0)?.into_iter().map(spoil).collect::<Vec<_>>())
    };
    let single = |points: &[Point], _: Order| kernels.single(points, 0);
    let field = Field { name: "spoilt", dimension: 3, double: &double, single: &single };
    let claim = parse("control", &source).remove(0).claim;
    judge(&field, &claim).map(|_| ()).map_err(|e| e.to_string())
}
