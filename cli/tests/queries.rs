//! `isograd eval` with directions and boxes: what they give, against formulas worked out by hand, and how they are given.

mod common;

use common::{Dir, Ran};

const SHAPES: &str = "
module std::sphere;
module std::box;
module std::gyroid;
export fn ball(at: vec3) -> real { csg s = Sphere(1.0); eval s.Sdf3d(at) }
export fn cube(at: vec3) -> real { csg s = Box([1.0, 1.0, 1.0]); eval s.Sdf3d(at) }
export fn waves(at: vec3) -> real { csg s = Gyroid(1.0); eval s.Sdf3d(at) }
export fn disc(at: vec2, r: real = 1.0 in [0.5 .. 2.0]) -> real { length(at) - r }
export fn curve(x: real, y: real) -> real { x*x - x*y + y }
export fn steps(x: real) -> (real, real) { (floor(x) + x*x - x, x*x - x) }
export fn pair(x: real, n: int) -> (vec2, int) { ([x * x, x * n::<real>], n) }
";

/// The numbers of the only row; `true` is 1.
fn row(ran: &Ran) -> Vec<f64> {
    let lines: Vec<&str> = ran.ok().lines().collect();
    assert_eq!(lines.len(), 2, "{}", ran.out);
    lines[1].split(',').map(|cell| cell.parse().unwrap_or(f64::from(u8::from(cell == "true")))).collect()
}

fn eval(dir: &Dir, export: &str, queries: &[&str], rest: &[&str]) -> Ran {
    let mut args = vec!["eval", "main.vola", "--export", export, "--format", "csv", "--precision", "f64"];
    queries.iter().for_each(|q| args.extend(["--query", q]));
    args.extend(rest);
    dir.run(&args)
}

/// Each number is what is expected, or outside of it by a few units in the last place, as enclosures are.
fn enclosed(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for range in found.chunks(3).zip(expected.chunks(3)) {
        let ([lo, hi, nan], [least, most, expected_nan]) = range else { panic!("{found:?}") };
        let slack = 16.0 * f64::EPSILON * (1.0 + least.abs().max(most.abs()));
        assert!(lo <= least && *lo >= least - slack, "{found:?} for {expected:?}");
        assert!(hi >= most && *hi <= most + slack, "{found:?} for {expected:?}");
        assert_eq!(nan, expected_nan, "{found:?} for {expected:?}");
    }
}

#[test]
fn enclosures_of_shapes_are_those_worked_out_by_hand() {
    let dir = Dir::with(SHAPES);
    let bound = |export: &str, ends: &str| row(&eval(&dir, export, &["bound(at)"], &["--set", &format!("at={ends}")]));
    // From the middle, 0 away, to the corner (−2, 3).
    enclosed(&bound("disc", "-2,1,0,3"), &[-1.0, 13_f64.sqrt() - 1.0, 0.0]);
    // From (2, 0, 0) to (3, ±1, 0.5).
    enclosed(&bound("ball", "2,3,-1,1,0,0.5"), &[1.0, 10.25_f64.sqrt() - 1.0, 0.0]);
    // The face x = 1 from both sides; x = 2 .. 3 beside the face, x = 3 one beyond in y as well.
    enclosed(&bound("cube", "0.5,1.5,0,0,0,0"), &[-0.5, 0.5, 0.0]);
    enclosed(&bound("cube", "2,3,0,2,0,0"), &[1.0, 5_f64.sqrt(), 0.0]);
    // sin wx cos wy alone matters at z = 0.25, x = 0, where sin wz = 1 and cos wx = 1: sin wy·0 + 1·1 + 0·cos wy.
    let amplitude = 1.0 / (2.0 * std::f64::consts::PI * 3_f64.sqrt());
    let waves = bound("waves", "0,0,-0.1,0.1,0.25,0.25");
    enclosed(&waves, &[amplitude, amplitude, 0.0]);
    // Reversed ends are exchanged, a NaN end is nothing known.
    assert_eq!(bound("ball", "3,2,1,-1,0.5,0"), bound("ball", "2,3,-1,1,0,0.5"));
    assert_eq!(bound("ball", "nan,1,0,0,0,0"), [-1.0, f64::INFINITY, 1.0]);
    // A number alone is both ends.
    enclosed(&bound("ball", "3,4,0"), &[4.0, 4.0, 0.0]);
}

#[test]
fn a_bound_without_parameter_is_over_all() {
    let dir = Dir::with(SHAPES);
    let all = eval(&dir, "disc", &["bound"], &["--set", "at=3,3,4,4", "--set", "r=1,2"]);
    assert!(all.ok().starts_with("bound(*).start,bound(*).end,bound(*).may_be_nan\n"), "{}", all.out);
    enclosed(&row(&all), &[3.0, 4.0, 0.0]);
    // Without a box, the default is one.
    enclosed(&row(&eval(&dir, "disc", &["bound"], &["--set", "at=3,4"])), &[4.0, 4.0, 0.0]);
    enclosed(&row(&eval(&dir, "disc", &["bound"], &["--args", "3,3,4,4,1,2"])), &[3.0, 4.0, 0.0]);
}

#[test]
fn the_mean_value_form_is_tighter_where_values_recur() {
    let dir = Dir::with(SHAPES);
    let ends = ["--set", "x=0.9,1", "--set", "y=0,0.1"];
    let found = row(&eval(&dir, "curve", &["bound", "bound(*, mean)"], &ends));
    // x² ≥ 0.81, xy ≤ 0.1; and 0.905 at the centre, slopes up to 2 and 0.1 over 0.05.
    enclosed(&found, &[0.71, 1.1, 0.0, 0.905 - 0.105, 0.905 + 0.105, 0.0]);
    // f(0.5) = −0.25 with slope −1 .. 1 over ±0.5; where floor jumps, the natural enclosure.
    let steps = row(&eval(&dir, "steps", &["bound(x)", "bound(x, mean)"], &["--set", "x=0,1"]));
    enclosed(&steps[..6], &[-1.0, 2.0, 0.0, -1.0, 1.0, 0.0]);
    enclosed(&steps[6..], &[-1.0, 2.0, 0.0, -0.75, 0.25, 0.0]);
    // Nothing is lost where the form is of no use: no middle, no slope.
    let unbounded = row(&eval(&dir, "steps", &["bound(x)", "bound(x, mean)"], &["--set", "x=0,inf"]));
    assert_eq!(unbounded[3..6], unbounded[9..]);
}

#[test]
fn the_norm_of_the_gradient_is_bounded() {
    let dir = Dir::with(SHAPES);
    let norm = |export: &str, ends: &str| {
        let found = row(&eval(&dir, export, &["lipschitz(at)"], &["--set", &format!("at={ends}")]));
        assert_eq!(found[1], 0.0);
        found[0]
    };
    for (export, ends) in [("ball", "2,3,0,0,0,0"), ("ball", "1,2,3"), ("cube", "2,3,-1,1,0,0.5"), ("waves", "0,0,0")] {
        let norm = norm(export, ends);
        assert!((1.0..=1.0 + 16.0 * f64::EPSILON).contains(&norm), "{export} on {ends}: {norm}");
    }
    // Around the centre each component of the unit vector may be anything.
    let around = norm("ball", "-1,1,-1,1,-1,1");
    assert!((3_f64.sqrt()..=3_f64.sqrt() * (1.0 + 8.0 * f64::EPSILON)).contains(&around), "{around}");
    let several = row(&eval(&dir, "pair", &["lipschitz(x)"], &["--set", "x=-3,1", "--set", "n=4"]));
    assert_eq!(several, [6.0, 0.0, 4.0, 0.0]);
}

#[test]
fn derivatives_are_enclosed() {
    let dir = Dir::with(SHAPES);
    let found = row(&eval(&dir, "disc", &["bound(gradient(at), at)"], &["--set", "at=-2,1,0,3"]));
    enclosed(&found, &[-1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    let found = row(&eval(&dir, "curve", &["bound(hessian(x, y), x)"], &["--set", "x=0,1", "--set", "y=0"]));
    assert_eq!(found, [-1.0, -1.0, 0.0]);
}

#[test]
fn a_directional_derivative_is_gradient_times_direction() {
    let dir = Dir::with(SHAPES);
    let queries = ["gradient(*)", "directional(*)", "directional(at)"];
    let points = "at.x,at.y,r,at.x.direction,at.y.direction,r.direction\n3,4,1,2,-1,5\n0,0,1,1,1,1\n-1,0.5,2,0,1,0\n";
    dir.write("points.csv", points);
    let ran = eval(&dir, "disc", &queries, &["--points", "points.csv"]);
    let header = "gradient(*).at.x,gradient(*).at.y,gradient(*).r,directional(*).value,directional(at).value";
    assert_eq!(ran.ok().lines().next(), Some(header));
    for (line, given) in ran.ok().lines().skip(1).zip(points.lines().skip(1)) {
        let numbers = |line: &str| line.split(',').map(|x| x.parse::<f64>().unwrap()).collect::<Vec<_>>();
        let (found, given) = (numbers(line), numbers(given));
        let product = |n: usize| found.iter().zip(&given[3..]).take(n).map(|(g, d)| g * d).sum::<f64>();
        assert_eq!((found[3], found[4]), (product(3), product(2)), "{line}");
    }
    // A direction counts only for what the result depends on.
    let none = eval(&dir, "steps", &["directional(x)"], &["--set", "x=1", "--set", "x.direction=inf"]);
    assert_eq!(none.ok(), "directional(x).value.0,directional(x).value.1\ninf,inf\n");
    let constant = Dir::with("export fn f(x: real, y: real) -> real { floor(x) + y }");
    let given = ["--set", "x=1", "--set", "y=2", "--set", "x.direction=inf", "--set", "y.direction=3"];
    assert_eq!(row(&eval(&constant, "f", &["directional(*)"], &given)), [3.0]);
}

#[test]
fn boxes_come_from_csv() {
    let dir = Dir::with(SHAPES);
    dir.write("boxes.csv", "at.x.start,at.x.end,at.y\n3,5,4\n0,0,12\n");
    let ran = eval(&dir, "disc", &["bound(at)"], &["--points", "boxes.csv"]);
    let rows: Vec<Vec<&str>> = ran.ok().lines().skip(1).map(|l| l.split(',').collect()).collect();
    assert_eq!((rows[0][0], rows[1][..].to_vec()), ("4.0", vec!["11.0", "11.0", "false"]));
    // Where another query needs the point, both are given, each by its own name.
    let both = "at.x,at.x.start,at.x.end,at.y,at.y.start,at.y.end\n3,0,3,4,4,4\n";
    dir.write("both.csv", both);
    let ran = eval(&dir, "disc", &["value", "bound(at)"], &["--points", "both.csv"]);
    enclosed(&row(&ran)[1..], &[3.0, 4.0, 0.0]);
    assert_eq!(row(&ran)[0], 4.0);
}

#[test]
fn what_is_given_wrongly_is_answered_with_how_to_give_it() {
    let dir = Dir::with(SHAPES);
    let said = |queries: &[&str], given: &[&str], csv: &str| {
        dir.write("points.csv", csv);
        let ran = eval(&dir, "disc", queries, given);
        ran.fails(1).to_owned()
    };
    let points = ["--points", "points.csv"];
    let unknown = said(&["value"], &points, "at.x.start,at.x.end,at.y\n1,2,3\n");
    assert!(unknown.contains("no query ranges over a box of `at`"), "{unknown}");
    let unknown = said(&["value"], &["--set", "at=1,2", "--set", "at.direction=1,0"], "");
    assert!(unknown.contains("as `directional(at)` does"), "{unknown}");
    let own_name = said(&["bound(at)"], &["--set", "at.box=1,2,1,2"], "");
    assert!(own_name.contains("give its box as `at`"), "{own_name}");
    let missing = said(&["value", "bound(at)"], &["--set", "at=1,2"], "");
    assert!(missing.contains("no value for the box `at.box: vec2` (at.x.start, at.x.end, at.y.start"), "{missing}");
    let half = said(&["bound(at)"], &points, "at.x.start,at.y.start,at.y.end\n1,2,3\n");
    assert!(half.contains("the column at.x.end of the box `at: vec2`"), "{half}");
    let twice = said(&["bound(at)"], &points, "at.x,at.x.start,at.x.end,at.y\n1,2,3,4\n");
    assert!(twice.contains("the column `at.x` gives both ends, and `at.x.start` one of them"), "{twice}");
    let count = said(&["bound(at)"], &["--set", "at=1,2,3"], "");
    assert!(count.contains("has 3 values") && count.contains("has 4, or 2 for a single point"), "{count}");
    let other = said(&["bound(to)"], &["--set", "at=1,2"], "");
    assert!(other.contains("`bound(to)`: there is no parameter `to`"), "{other}");
    let again = said(&["bound(at)"], &[&points[..], &["--set", "at=1,2"]].concat(), "at.x,at.y\n1,2\n");
    assert!(again.contains("the column `at.x` gives `at`, and so does `--set`"), "{again}");
}

#[test]
fn compile_and_describe_say_what_is_known_before() {
    let dir = Dir::with(SHAPES);
    let compiled = dir.run(&["compile", "main.vola", "--export", "curve", "--query", "hessian(*)", "-o", "a.wasm"]);
    assert_eq!(compiled.code, Some(0), "{}", compiled.err);
    assert!(compiled.err.contains("  hessian(*): 1 of 4 are always 0: y/y\n"), "{}", compiled.err);
    let compiled = dir.run(&["compile", "main.vola", "--export", "steps", "--query", "bound(x, mean)", "-o", "a.wasm"]);
    assert!(compiled.err.contains("bound(x, mean): may jump, the natural enclosure: value.0\n"), "{}", compiled.err);
    let described = dir.run(&["describe", "main.vola"]);
    for form in ["bound(PARAMETER, mean)  ", "lipschitz(PARAMETER)  ", "directional(PARAMETER)  "] {
        assert!(described.ok().contains(form), "{}", described.out);
    }
    let json: serde_json::Value = serde_json::from_str(dir.run(&["describe", "main.vola", "--json"]).ok()).unwrap();
    assert_eq!(json["queries"][0]["query"], "value");
}

#[test]
fn a_box_specialises_and_is_kept() {
    let dir = Dir::with(SHAPES);
    let within = ["--within", "at=[0.5, -0.25]:[1, 0.25]"];
    let inside = row(&eval(&dir, "disc", &["value", "gradient(at)"], &["--set", "at=1,0", within[0], within[1]]));
    assert_eq!(inside, row(&eval(&dir, "disc", &["value", "gradient(at)"], &["--set", "at=1,0"])));
    for (arguments, part) in [
        (&["--set", "at=1,0.5", within[0], within[1]][..], "`at.y` is 0.5 at point 0"),
        (&["--set", "at=1,0", "--within", "at=0:1"], "has 2 scalars, not 1"),
        (&["--set", "at=1,0", "--within", "at=[0,0]"], "is no box"),
        (&["--set", "at=1,0", within[0], within[1], within[0], within[1]], "names `at` twice"),
    ] {
        let ran = eval(&dir, "disc", &["value"], arguments);
        assert!(ran.code != Some(0) && ran.err.contains(part), "{part}: {}", ran.err);
    }
    let written = dir.run(&["compile", "main.vola", "--export", "cube", "--within", "at=[1.5,0,0]:[2,0.5,0.5]"]);
    assert!(written.code == Some(0) && written.err.contains("specialised: "), "{}", written.err);
}

#[test]
fn strict_refuses_numbers_outside_of_the_ranges_it_proves() {
    let dir = Dir::with("export fn f(x: real in [1.0 .. 2.0]) -> real { abs(x) }");
    let strict = |x: &str| {
        let at = format!("x={x}");
        eval(&dir, "f", &["gradient(x)"], &["--differentiability", "strict", "--set", &at])
    };
    assert_eq!(row(&strict("1.5")), [1.0]);
    let outside = strict("0.5");
    assert!(outside.code != Some(0) && outside.err.contains("between 1 and 2"), "{}", outside.err);
    assert_eq!(row(&eval(&dir, "f", &["gradient(x)"], &["--set", "x=0.5"])), [1.0]);
}
