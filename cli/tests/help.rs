//! What the command knows without evaluating anything: `isograd explain`, `limits` and `describe`.

mod common;

use common::Dir;
use isograd_compiler::{Code, Limits};
use serde_json::{Value, json};

#[test]
fn a_code_is_explained_by_its_page() {
    let dir = Dir::new();
    let page = |name: &str| {
        let path = format!("{}/../docs/diagnostics/{name}.md", env!("CARGO_MANIFEST_DIR"));
        format!("{}\n", std::fs::read_to_string(path).unwrap().trim_end())
    };
    let shown = dir.run(&["explain", "E0401"]);
    assert_eq!(shown.ok(), page("E0401"));
    assert!(shown.out.contains("operator") && shown.out.contains("```vola\n"), "{}", shown.out);
    assert_eq!(dir.run(&["explain", "e0401", "W0501"]).ok(), format!("{}\n{}", page("E0401"), page("W0501")));
    dir.run(&["explain", "E0400"]).fails_with(2, &["no diagnostic `E0400`", "E0401", "lists all"]);
    dir.run(&["explain", "E0401", "types"]).fails_with(2, &["no diagnostic `types`"]);
}

#[test]
fn without_a_code_all_are_listed() {
    let all: String = Code::ALL.iter().map(|c| format!("{}  {}\n", c.name(), c.title())).collect();
    assert_eq!(Dir::new().run(&["explain"]).ok(), all);
}

/// `isograd limits > cli/tests/limits.txt` renews it.
#[test]
fn limits_are_listed() {
    let dir = Dir::new();
    assert_eq!(dir.run(&["limits"]).ok(), include_str!("limits.txt"));
    let listed: Value = serde_json::from_str(dir.run(&["limits", "--json"]).ok()).unwrap();
    let names = |list: &Value| -> Vec<String> {
        list.as_array().unwrap().iter().map(|l| l["name"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(names(&listed["language"]), Limits::ALL.iter().map(|l| l.name).collect::<Vec<_>>());
    assert!(names(&listed["service"]).contains(&"points".to_owned()));
    let nesting = listed["language"].as_array().unwrap().iter().find(|l| l["name"] == "nesting").unwrap();
    let about = "Brackets, blocks and prefix operators inside each other; at most 512.";
    let expected = json!({ "name": "nesting", "value": 256, "default": 256, "code": "E1004", "about": about });
    assert_eq!(*nesting, expected);
}

/// The example of LANGUAGE 9.3.
const PART: &str = "\
/// A ball with a hole.
///
/// Along all axes.
export fn part(p: vec3 in [-2.0 .. 2.0],
               radius: real = 1.0 in [0.1 .. 3.0],
               size: vec3 = [1.0; 3] in [[0.1; 3] .. [5.0; 3]],
               count: int = 4 in [1 .. 16],
               hollow: bool = false) -> real {
    let hole = radius * 0.5 * hollow::<real>;
    max(length(p / size) - radius, hole - length(p)) / count::<real>
}

export fn id(x: real) -> real { x }
";

#[test]
fn exports_are_described() {
    let dir = Dir::with(PART);
    let expected = "\
part -> real
  A ball with a hole.

  Along all axes.
    p       vec3                     in [[-2.0, -2.0, -2.0] .. [2.0, 2.0, 2.0]]
    radius  real  = 1.0              in [0.1 .. 3.0]
    size    vec3  = [1.0, 1.0, 1.0]  in [[0.1, 0.1, 0.1] .. [5.0, 5.0, 5.0]]
    count   int   = 4                in [1 .. 16]
    hollow  bool  = false

id -> real
    x  real
";
    let ran = dir.run(&["describe", "main.vola"]);
    let (exports, queries) = ran.ok().split_once("\nqueries, ").unwrap();
    assert_eq!(exports, expected);
    assert_eq!(queries.lines().skip(1).count(), isograd_compiler::FORMS.len(), "{queries}");
    let described: Value = serde_json::from_str(dir.run(&["describe", "main.vola", "--json"]).ok()).unwrap();
    let part = &described["exports"][0];
    assert_eq!((&part["name"], &part["result"]["type"]), (&json!("part"), &json!("real")));
    assert_eq!(
        part["parameters"][1],
        json!({
            "name": "radius", "type": "real", "columns": ["radius"],
            "default": 1.0, "range": { "lower": 0.1, "upper": 3.0 },
        })
    );
    assert_eq!(described["exports"][1]["parameters"][0]["default"], Value::Null);
    assert_eq!(Dir::with("fn f(x: real) -> real { x }").run(&["describe", "main.vola"]).ok(), "");
    Dir::with("export fn f(x: real) -> real { y }").run(&["describe", "main.vola"]).fails_with(1, &["E0301"]);
}
