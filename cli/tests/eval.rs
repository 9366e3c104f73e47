//! `isograd eval`: where inputs come from, how results are written, and what bad input is answered.

mod common;

use common::Dir;

const BALL: &str = "\
/// The distance to a ball.
export fn ball(at: vec3, radius: real) -> real { length(at) - radius }
";

#[test]
fn args_give_one_point_each() {
    let dir = Dir::with(BALL);
    let queries = ["--query", "value", "--query", "gradient(at)", "--format", "csv"];
    let one = dir.run(&[&["eval", "main.vola", "--args", "3,4,0,0.5"], &queries[..]].concat());
    let expected = "value,gradient(at).at.x,gradient(at).at.y,gradient(at).at.z\n4.5,0.6,0.8,0.0\n";
    assert_eq!(one.ok(), expected);
    let two = dir.run(&[&["eval", "main.vola", "--args", "3,4,0,0.5", "--args", "-3,0,0,1"], &queries[..]].concat());
    assert_eq!(two.ok(), format!("{expected}2.0,-1.0,0.0,0.0\n"));
}

#[test]
fn points_come_from_a_file_or_the_standard_input() {
    let dir = Dir::with(BALL);
    let points = "\u{feff}radius, at.x,at.y,at.z\r\n1,3,4,0\r\n2,0,0,1e1\r\n";
    dir.write("points.csv", points);
    let command = ["eval", "main.vola", "--format", "csv", "--points"];
    assert_eq!(dir.run(&[&command[..], &["points.csv"]].concat()).ok(), "value\n4.0\n8.0\n");
    assert_eq!(dir.run_with(&[&command[..], &["-"]].concat(), points).ok(), "value\n4.0\n8.0\n");
    let without = "at.x,at.y,at.z\n3,4,0\n0,0,10\n";
    let set = dir.run_with(&[&command[..], &["-", "--set", "radius=1.5"]].concat(), without);
    assert_eq!(set.ok(), "value\n3.5\n8.5\n");
    let none = dir.run_with(&[&command[..], &["-", "--set", "radius=1.5"]].concat(), "at.x,at.y,at.z\n");
    assert_eq!(none.ok(), "value\n");
    assert_eq!(
        dir.run(&["eval", "main.vola", "--set", "at=3,4,0", "--set", "radius=5", "--format", "csv"]).ok(),
        "value\n0.0\n"
    );
}

#[test]
fn json_has_the_shape_of_the_http_api() {
    let dir = Dir::with(BALL);
    let ran = dir.run(&[
        "eval",
        "main.vola",
        "--args",
        "3,4,0,nan",
        "--query",
        "gradient(at)",
        "--query",
        "value",
        "--format",
        "json",
    ]);
    let expected = r#"{"export":"ball","outputs":[{"name":"gradient(at)","type":"vec3","columns":["at.x","at.y","at.z"],"rows":[[0.6,0.8,0.0]]},{"name":"value","type":"real","columns":["value"],"rows":[["nan"]]}]}"#;
    assert_eq!(ran.ok(), format!("{expected}\n"));
}

#[test]
fn the_table_shows_inputs_beside_results() {
    let dir = Dir::with(BALL);
    let ran = dir.run(&[
        "eval",
        "main.vola",
        "--args",
        "3,4,0,0.5",
        "--args",
        "0,0,10,0.5",
        "--query",
        "value",
        "--query",
        "gradient(at)",
    ]);
    let expected = "\
              at  │  value  │   gradient(at)
at.x  at.y  at.z  │         │  at.x  at.y  at.z
──────────────────┼─────────┼──────────────────
 3.0   4.0   0.0  │    4.5  │   0.6   0.8   0.0
 0.0   0.0  10.0  │    9.5  │   0.0   0.0   1.0
";
    let found: Vec<String> = ran.ok().lines().map(|l| l.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
    let expected: Vec<String> = expected.lines().map(|l| l.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
    assert_eq!(found, expected);
    let widths: Vec<usize> = ran.ok().lines().skip(2).map(|l| l.chars().count()).collect();
    assert!(widths.iter().all(|w| *w == widths[0]), "{}", ran.out);
}

#[test]
fn ints_bools_and_double_precision() {
    let dir = Dir::with("export fn f(n: int, up: bool, x: real) -> (int, bool, real) { (n / 2, up, x / 3.0) }");
    let ran = dir.run(&[
        "eval",
        "main.vola",
        "--args",
        "-7,true,1",
        "--args",
        "7,0,1",
        "--precision",
        "f64",
        "--format",
        "csv",
    ]);
    assert_eq!(ran.ok(), "value.0,value.1,value.2\n-3,true,0.3333333333333333\n3,false,0.3333333333333333\n");
}

#[test]
fn a_hessian_and_an_export_by_name() {
    let dir = Dir::with("export fn f(p: vec2) -> real { p.x * p.x * p.y }\nexport fn g(p: vec2) -> real { p.x }\n");
    let ran =
        dir.run(&["eval", "main.vola", "--export", "f", "--args", "2,3", "--query", "hessian(p)", "--format", "csv"]);
    let rows: Vec<&str> = ran.ok().lines().collect();
    assert_eq!(rows[1], "6.0,4.0,4.0,0.0");
}

#[test]
fn a_million_points_are_no_trouble() {
    let dir = Dir::with("export fn f(x: real) -> real { x * 2.0 }");
    let mut points = String::from("x\n");
    for i in 0..1_000_000 {
        points.push_str(&format!("{i}\n"));
    }
    let began = std::time::Instant::now();
    let ran = dir.run_with(&["eval", "main.vola", "--points", "-", "--format", "csv"], &points);
    assert!(ran.ok().ends_with("1999998.0\n"));
    assert_eq!(ran.out.lines().count(), 1_000_001);
    assert!(began.elapsed().as_secs() < 20, "{:?}", began.elapsed());
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    use std::io::Read;
    use std::process::Stdio;
    let dir = Dir::with("export fn f(x: real) -> real { x }");
    let mut points = String::from("x\n");
    points.push_str(&"1.5\n".repeat(200_000));
    dir.write("points.csv", &points);
    let mut command = dir.command(&["eval", "main.vola", "--points", "points.csv", "--format", "csv"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut some = [0; 10];
    child.stdout.take().unwrap().read_exact(&mut some).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned()), (Some(0), String::new()));
}

#[test]
fn bad_csv_is_told_by_line_and_column() {
    let dir = Dir::with(BALL);
    let run = |points: &str| dir.run_with(&["eval", "main.vola", "--points", "-", "--set", "radius=1"], points);
    run("at.x,at.y,at.z\n1,2,3\n1,2\n").fails_with(1, &["standard input:3", "2 values", "expected 3: at.x,at.y,at.z"]);
    run("at.x,at.y,at.z\n1,2,3,4\n").fails_with(1, &["standard input:2", "4 values", "expected 3"]);
    run("at.x,at.y,at.z\n1,2,3\n\n1,far,3\n")
        .fails_with(1, &["standard input:4", "column 2 (`at.y`)", "`far`", "expected a number"]);
    run("at.x,at.y,at.z\r\n\r\n1,2,3\r\n1,far,3").fails_with(1, &["standard input:4", "column 2"]);
    run("at.x,at.y,at.z\n1,,3\n").fails_with(1, &["standard input:2", "column 2 (`at.y`) is ``"]);
    run("at.x,at.y\n1,2\n").fails_with(1, &["the column at.z of `at: vec3` (at.x, at.y, at.z) is missing"]);
    run("at.x,at.y,at.z,at.w\n").fails_with(1, &["column 4 is named `at.w`", "at.x,at.y,at.z,radius"]);
    run("at.x,at.y,at.x\n").fails_with(1, &["column 3", "`at.x`", "once"]);
    run("at.x,at.y,at.z,radius\n1,2,3,4\n").fails_with(1, &["`radius`", "--set"]);
    run("").fails_with(1, &["empty", "at.x,at.y,at.z"]);
    run("at.x,at.y,at.z\n1,2,\"3\n4,5,6\n").fails_with(1, &["standard input:2", "column 3"]);
    dir.run(&["eval", "main.vola", "--points", "none.csv"]).fails_with(1, &["none.csv"]);
}

#[test]
fn inputs_that_do_not_fit_are_told_by_name() {
    let dir = Dir::with(BALL);
    let run = |args: &[&str]| dir.run(&[&["eval", "main.vola"], args].concat());
    run(&["--args", "1,2,3"])
        .fails_with(1, &["has 3 values", "takes 4", "`at: vec3` (at.x, at.y, at.z), `radius: real`"]);
    run(&["--args", "1,2,3,4,5"]).fails_with(1, &["has 5 values", "takes 4"]);
    run(&["--args", "1,2,x,4"]).fails_with(1, &["`at.z` is `x`", "a number"]);
    run(&[]).fails_with(1, &["`at: vec3` (at.x, at.y, at.z), `radius: real`", "--args"]);
    run(&["--set", "at=1,2,3"]).fails_with(1, &["no value for the parameter `radius: real`"]);
    run(&["--set", "at=1,2", "--set", "radius=1"])
        .fails_with(1, &["has 2 values", "`at: vec3` (at.x, at.y, at.z) has 3"]);
    run(&["--set", "at=1,2,3", "--set", "size=1"]).fails_with(1, &["no parameter `size`", "`radius: real`"]);
    run(&["--set", "radius=1", "--set", "radius=2", "--set", "at=1,2,3"]).fails_with(1, &["`radius`", "twice"]);
    run(&["--export", "cube", "--args", "1"]).fails_with(1, &["no export `cube`", "`ball`"]);
    run(&["--args", "1,2,3,4", "--query", "gradient(to)"]).fails_with(1, &["no parameter `to`", "`at`, `radius`"]);
    let ints = Dir::with("export fn f(n: int, b: bool) -> int { n }");
    ints.run(&["eval", "main.vola", "--args", "1.5,0"]).fails_with(1, &["`n` is `1.5`", "an int"]);
    ints.run(&["eval", "main.vola", "--args", "1,yes"]).fails_with(1, &["`b` is `yes`", "true, false, 0 or 1"]);
    let two = Dir::with("export fn f(x: real) -> real { x }\nexport fn g(x: real) -> real { x }\n");
    two.run(&["eval", "main.vola", "--args", "1"]).fails_with(1, &["`f`, `g`"]);
    let none = Dir::with("fn f(x: real) -> real { x }");
    none.run(&["eval", "main.vola", "--args", "1"]).fails_with(1, &["export fn"]);
}

#[test]
fn parameters_with_defaults_may_be_left_out() {
    let dir = Dir::with(
        "export fn f(x: vec2, a: real = 10.0 in [0.0 .. 100.0], b: vec2 = [100.0, 1000.0], up: bool = true) -> real \
         { x.x + x.y + a + b.x + b.y + up::<real> }",
    );
    let run =
        |args: &[&str], points: &str| dir.run_with(&[&["eval", "main.vola", "--format", "csv"], args].concat(), points);
    assert_eq!(run(&["--args", "1,2"], "").ok(), "value\n1114.0\n");
    assert_eq!(
        run(&["--args", "1,2", "--args", "1,2,20", "--args", "1,2,20,0,0,0"], "").ok(),
        "value\n1114.0\n1124.0\n23.0\n"
    );
    assert_eq!(run(&["--set", "x=1,2", "--set", "b=0,0"], "").ok(), "value\n14.0\n");
    assert_eq!(run(&["--points", "-"], "x.x,x.y\n1,2\n3,4\n").ok(), "value\n1114.0\n1118.0\n");
    assert_eq!(run(&["--points", "-", "--set", "up=0"], "x.x,x.y,a\n1,2,0\n").ok(), "value\n1103.0\n");
    assert_eq!(run(&["--args", "1,2,1000"], "").ok(), "value\n2104.0\n", "a range changes no value");
    run(&["--args", "1,2,20,0"], "")
        .fails_with(1, &["has 4 values", "takes 6, or fewer from 2 on", "`a: real` with default 10.0"]);
    run(&["--args", "1"], "").fails_with(1, &["has 1 value,"]);
    run(&["--args", "1,2,3,4,5,1,7"], "").fails_with(1, &["has 7 values"]);
    run(&["--set", "a=1"], "").fails_with(1, &["no value for the parameter `x: vec2` (x.x, x.y)"]);
    run(&[], "").fails_with(1, &["no values for the parameters", "--args"]);
    run(&["--points", "-"], "x.x,x.y,b.x\n").fails_with(1, &["the column b.y of `b: vec2`"]);
    let all = Dir::with("export fn f(x: real = 2.0) -> real { x * x }");
    assert_eq!(
        all.run(&["eval", "main.vola", "--format", "csv", "--query", "gradient(x)"]).ok(),
        "gradient(x).x\n4.0\n"
    );
}

#[test]
fn wrong_usage_is_exit_code_2() {
    let dir = Dir::with(BALL);
    for args in [
        &["eval"][..],
        &["eval", "main.vola", "--query", "slope(at)"],
        &["eval", "main.vola", "--args", "1", "--points", "x.csv"],
        &["eval", "main.vola", "--set", "radius"],
        &["eval", "main.vola", "--format", "xml"],
        &["eval", "main.vola", "--precision", "f16"],
        &["eval", "main.vola", "--library", "none=missing"],
        &["evaluate", "main.vola"],
        &[],
    ] {
        dir.run(args).fails(2);
    }
}

#[test]
fn an_endless_evaluation_is_ended() {
    let dir = Dir::with("export fn f(x: real, n: int) -> real { let y = x; for i in 0..n { y = sin(y) + x; } y }");
    let began = std::time::Instant::now();
    let ran = dir.run(&["eval", "main.vola", "--args", "0.5,2000000000", "--deadline", "1"]);
    ran.fails_with(1, &["longer than 1 s", "--deadline"]);
    assert!(began.elapsed().as_secs() < 10, "{:?}", began.elapsed());
}

#[test]
fn smooth_has_a_sensitivity_and_a_manifest_that_says_so() {
    let dir = Dir::with("export fn f(x: real) -> real { abs(x) }\n");
    let base = ["eval", "main.vola", "--args", "0", "--query", "value", "--query", "hessian(x)", "--format", "csv"];
    let row = |more: &[&str]| dir.run(&[&base[..], more].concat()).ok().lines().nth(1).unwrap().to_owned();
    assert_eq!(row(&["--differentiability", "exact"]), row(&[]));
    assert_eq!(row(&[]), "0.0,0.0");
    let numbers = |row: String| row.split(',').map(|x| x.parse().unwrap()).collect::<Vec<f64>>();
    let near = |found: Vec<f64>, want: [f64; 2]| found.iter().zip(want).all(|(x, y)| (x - y).abs() <= 1e-5 * y);
    let smooth = ["--differentiability", "smooth"];
    assert!(near(numbers(row(&smooth)), [0.000_693_147_2, 1000.0]));
    assert!(near(numbers(row(&[&smooth[..], &["--sensitivity", "1000"]].concat())), [std::f64::consts::LN_2, 1.0]));
    dir.run(&[&base[..], &["--sensitivity", "2"]].concat()).fails_with(1, &["E1102", "`exact`", "`smooth`"]);
    for wrong in ["0", "-1", "inf", "soft"] {
        let wrong = format!("--sensitivity={wrong}");
        dir.run(&[&base[..], &smooth[..], &[wrong.as_str()]].concat()).fails_with(2, &["finite number above 0"]);
    }
    dir.run(&[&base[..], &["--differentiability", "rough"]].concat()).fails_with(2, &["exact, strict, smooth"]);
    dir.run(&["compile", "main.vola", "--differentiability", "smooth", "--sensitivity", "0.5", "-o", "f.wasm"]);
    let bytes = std::fs::read(dir.0.join("f.wasm")).unwrap();
    let said = br#""differentiability":"smooth","sensitivity":0.5"#;
    assert!(bytes.windows(said.len()).any(|w| w == said), "the manifest is in the module");
}

#[test]
fn both_ways_of_derivatives_agree() {
    let dir = Dir::with("export fn f(a: vec4, b: vec4) -> real { sqrt(dot(a, b) * dot(a, a) + exp(b.x * a.y)) }\n");
    let gradient = |mode: &str| {
        let args = ["--args", "1,2,3,4,0.5,0.25,2,1", "--format", "csv", "--mode", mode];
        let ran =
            dir.run(&[&["eval", "main.vola", "--query", "gradient(a)", "--query", "gradient(b)"], &args[..]].concat());
        let rows = ran.ok().lines().nth(1).unwrap().split(',');
        rows.map(|x| x.parse().unwrap()).collect::<Vec<f64>>()
    };
    let (forward, reverse) = (gradient("forward"), gradient("reverse"));
    assert_eq!(forward.len(), 8);
    assert!(
        forward.iter().zip(&reverse).all(|(x, y)| (x - y).abs() <= 1e-5 * x.abs().max(1.0)),
        "{forward:?} {reverse:?}"
    );
    assert!([forward, reverse].contains(&gradient("auto")));
    let bad = ["eval", "main.vola", "--args", "1,2,3,4,5,6,7,8", "--mode", "backward"];
    dir.run(&bad).fails_with(2, &["backward", "auto, forward, reverse"]);
}
