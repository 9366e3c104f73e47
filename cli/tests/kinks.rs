//! `isograd eval --query kinks`: the report on the command line.

mod common;

use common::Dir;

const SLAB: &str = "export fn slab(x: real) -> real { max(x - 1.0, -1.0 - x) }\n";

#[test]
fn a_report_as_csv_json_and_table() {
    let dir = Dir::with(SLAB);
    let eval = |format: &str, query: &str| {
        let points = ["--args", "0", "--args", "0.25", "--args", "-3"];
        let rest = ["--query", query, "--query", "gradient(x)", "--format", format];
        dir.run(&[&["eval", "main.vola"], &points[..], &rest[..]].concat()).ok().to_owned()
    };
    let csv = "kinks(x).near,kinks(x).distance,kinks(x).kink,kinks(x).side,gradient(x).x\n\
               true,0.0,0,0,1.0\nfalse,0.5,0,1,1.0\nfalse,6.0,0,-1,-1.0\n";
    assert_eq!(eval("csv", "kinks(x)"), csv);
    let rows: Vec<String> =
        eval("csv", "kinks(x, 0.5)").lines().map(|l| l.split(',').next().unwrap().to_owned()).collect();
    assert_eq!(rows[1..], ["true", "true", "false"]);
    let json = eval("json", "kinks(x)");
    let expected = r#""rows":[[true,0.0,0,0],[false,0.5,0,1],[false,6.0,0,-1]],"kinks":[{"kink":0,"operation":"max","formula":"b if a < b, else a","place":"main.vola:1:35","set":"a = b","discriminant":"a − b","derivatives":["b′","a′","a′"]}]"#;
    assert!(json.contains(expected), "{json}");
    let table = eval("table", "kinks(x)");
    let legend = "kinks(x): kink 0 is `max` at main.vola:1:35, where a = b\n  side -1: b′; side 0: a′; side 1: a′; by the sign of a − b\n";
    assert!(table.ends_with(legend), "{table}");
}

#[test]
fn without_a_kink_nothing_is_near() {
    let dir = Dir::with("export fn f(x: real) -> real { x * x }\n");
    let ran = dir.run(&["eval", "main.vola", "--args", "0", "--query", "kinks", "--format", "json"]);
    assert!(ran.ok().contains(r#""rows":[[false,"inf",-1,1]]}"#), "{}", ran.out);
    let wrong = dir.run(&["eval", "main.vola", "--args", "0", "--query", "kinks(x, -1)"]);
    assert!(wrong.err.contains("kinks(PARAMETER, TOLERANCE)"), "{}", wrong.err);
}
