//! Defaults and ranges of parameters as numbers (LANGUAGE 9.3), and what is reported about them.

mod common;

use common::program;
use isograd_elaborate::{Metadata, metadata};
use isograd_graph::Unwatched;
use isograd_syntax::{Diagnostic, Limits};

fn of(params: &str) -> (Vec<Metadata>, Vec<Diagnostic>) {
    let program = program(&format!("export fn f({params}) -> real {{ 1.0 }}"));
    metadata(&program, program.exports[0], &Limits::default(), &Unwatched)
}

type Default = Option<Vec<f64>>;
type Range = Option<(Vec<f64>, Vec<f64>)>;

/// The default and the range of the only parameter.
fn only(param: &str) -> (Default, Range) {
    let (all, wrong) = of(param);
    assert!(wrong.is_empty(), "{param}: {wrong:#?}");
    let [one] = all.as_slice() else { panic!("{param}: {all:?}") };
    (one.default.clone(), one.range.clone())
}

#[test]
fn numbers() {
    assert_eq!(only("x: real"), (None, None));
    assert_eq!(only("x: real = 1.0 in [0.1 .. 3.0]"), (Some(vec![1.0]), Some((vec![0.1], vec![3.0]))));
    let range = Some((vec![-2.0; 3], vec![2.0; 3]));
    assert_eq!(only("x: vec3 in [-2.0 .. 2.0]"), (None, range));
    let range = Some((vec![0.1; 2], vec![5.0, 6.0]));
    assert_eq!(only("x: vec2 = [1.0; 2] in [[0.1; 2] .. [5.0, 6.0]]"), (Some(vec![1.0; 2]), range));
    let range = Some((vec![0.0; 4], vec![f64::INFINITY; 4]));
    assert_eq!(
        only("x: mat2 = transpose([[1.0, 2.0], [3.0, 4.0]]) in [[[0.0; 2]; 2] .. INF]"),
        (Some(vec![1.0, 3.0, 2.0, 4.0]), range)
    );
    assert_eq!(only("x: int = 2 * 8 / 3 in [-1 .. 16]"), (Some(vec![5.0]), Some((vec![-1.0], vec![16.0]))));
    assert_eq!(only("x: vec2<int> in [0 .. 9]"), (None, Some((vec![0.0; 2], vec![9.0; 2]))));
    assert_eq!(only("x: bool = !(1 < 2)"), (Some(vec![0.0]), None));
    assert_eq!(only("x: quat = quat(0.0, 0.0, 0.0, 1.0)"), (Some(vec![0.0, 0.0, 0.0, 1.0]), None));
    assert_eq!(only("x: (int, bool) = (3, true)"), (Some(vec![3.0, 1.0]), None));
    // Constants are computed in f64 and not rounded.
    assert_eq!(only("x: real = 0.1 + 0.2"), (Some(vec![0.1 + 0.2]), None));
    let (default, _) = only("x: real = 2.0 * PI * max(cos(0.0), 0.5)");
    assert_eq!(default, Some(vec![std::f64::consts::TAU]));
    assert_eq!(only("x: interval<real> = [0.1 .. 1.0]"), (Some(vec![0.1, 1.0]), None));
    assert_eq!(only("x: (bool, interval<int>) = (true, [2 .. -1])"), (Some(vec![1.0, 2.0, -1.0]), None));
}

#[test]
fn what_does_not_fit_is_reported_with_its_numbers() {
    for (params, phrases) in [
        ("r: real in [3.0 .. 0.5]", ["`r`", "reversed: 3.0 .. 0.5"]),
        ("r: int in [3 .. -2]", ["`r`", "3 .. -2"]),
        ("r: vec3 in [0.0 .. [1.0, -1.0, 2.0]]", ["`r.y`", "0.0 .. -1.0"]),
        ("r: real in [0.0 .. 0.0 / 0.0]", ["`r`", "no number"]),
        ("r: real = 5.0 in [0.5 .. 3.0]", ["`r` is 5.0", "range 0.5 .. 3.0"]),
        ("r: vec2 = [1.0, 4.0] in [0.5 .. 3.0]", ["`r.y` is 4.0", "range 0.5 .. 3.0"]),
        ("r: int = 0 in [1 .. 16]", ["`r` is 0", "range 1 .. 16"]),
        ("r: real = INF - INF", ["`r`", "no number"]),
        ("r: real = sqrt(-1.0) in [0.0 .. 1.0]", ["`r` is NaN", "0.0 .. 1.0"]),
    ] {
        let (_, wrong) = of(params);
        let [one] = wrong.as_slice() else { panic!("{params}: {wrong:#?}") };
        assert_eq!(one.code.name(), "E0903", "{params}");
        for phrase in phrases {
            assert!(one.message.contains(phrase), "{params}: {} lacks {phrase}", one.message);
        }
    }
    let (_, wrong) = of("a: real = 2.0 in [0.0 .. 1.0], b: real, c: int in [1 .. 0]");
    assert_eq!(wrong.len(), 2, "each parameter is reported: {wrong:#?}");
}
