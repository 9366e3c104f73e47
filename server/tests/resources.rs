//! What the HTTP API says about itself and about programs: limits, diagnostics and their pages, defaults and ranges.

mod common;

use common::{Client, TempDir};
use isograd_compiler::{Code, Limits};
use isograd_server::{ServerLimits, server_options};
use serde_json::{Value, json};

fn find<'a>(list: &'a Value, key: &str, name: &str) -> &'a Value {
    list.as_array().unwrap().iter().find(|entry| entry[key] == name).unwrap_or_else(|| panic!("no {name} in {list}"))
}

#[tokio::test]
async fn limits_are_listed_with_what_they_are_set_to() {
    let directory = TempDir::new();
    let mut options = server_options();
    options.limits.diff_order = 2;
    let limits = ServerLimits { points: 10, ..ServerLimits::default() };
    let answer = Client::with(&directory.0, limits, options).get("/v1/limits").await;
    assert_eq!(answer.status, 200);
    let listed = answer.json();
    let about = "`diff` inside `diff`, including the host's query.";
    assert_eq!(
        *find(&listed["language"], "name", "diff_order"),
        json!({ "name": "diff_order", "value": 2, "default": 6, "code": "E1009", "about": about })
    );
    assert_eq!(find(&listed["language"], "name", "derived_nodes")["default"], 200_000);
    assert_eq!(
        *find(&listed["service"], "name", "points"),
        json!({ "name": "points", "value": 10, "default": 1_000_000, "about": "Points of one evaluation." })
    );
    assert_eq!(listed["language"].as_array().unwrap().len(), Limits::ALL.len());
    assert_eq!(listed["service"].as_array().unwrap().len(), ServerLimits::ALL.len());
}

#[tokio::test]
async fn every_diagnostic_has_a_page() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let listed = client.get("/v1/diagnostics").await.json();
    let listed = listed["diagnostics"].as_array().unwrap();
    assert_eq!(listed.len(), Code::ALL.len());
    for (entry, code) in listed.iter().zip(Code::ALL) {
        assert_eq!((entry["code"].as_str(), entry["title"].as_str()), (Some(code.name()), Some(code.title())));
        let page = client.get(entry["page"].as_str().unwrap()).await;
        assert_eq!(
            (page.status, &page.headers["content-type"]),
            (200, &"text/markdown; charset=utf-8".parse().unwrap())
        );
        assert_eq!(page.body, isograd_compiler::explain(*code));
    }
    let error = json!({
        "code": "E0401", "severity": "error", "title": Code::E0401.title(), "page": "/v1/diagnostics/E0401",
    });
    assert_eq!(listed.iter().find(|e| e["code"] == "E0401"), Some(&error));
    assert!(listed.iter().any(|e| e["severity"] == "warning"));
    let unknown = client.get("/v1/diagnostics/E0400").await.problem(404, "not-found");
    assert!(unknown["detail"].as_str().unwrap().contains("E0401"), "{unknown}");
    client.get("/v1/diagnostics/..%2fE0401").await.problem(404, "not-found");
    client.get(&format!("/v1/diagnostics/{}", "E".repeat(5000))).await.problem(404, "not-found");
    client.post("/v1/diagnostics", "").await.problem(405, "method-not-allowed");
}

#[tokio::test]
async fn what_the_compiler_says_leads_to_its_pages() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let problem = client.program("export fn f(x: real) -> real { y + 1 }").await.problem(422, "does-not-compile");
    let said = problem["diagnostics"][0].clone();
    assert_eq!((&said["code"], &said["page"]), (&json!("E0301"), &json!("/v1/diagnostics/E0301")));
    let warned = client.program("export fn f(x: real) -> real { x::<real> }").await.json();
    let said = &warned["diagnostics"][0];
    assert_eq!((&said["code"], &said["page"]), (&json!("W0401"), &json!("/v1/diagnostics/W0401")));
}

/// Parameters with and without defaults, of every kind of type that may have one (LANGUAGE 9.3).
const PART: &str = "\
/// A part.
export fn part(p: vec2 in [-2.0 .. 2.0], r: real = 1.5 in [0.5 .. 3.0], n: int = 4 in [1 .. 16], up: bool = true,
               size: vec2 = [1.0, 2.0]) -> real {
    p.x + p.y + r + n::<real> + up::<real> + size.x * size.y
}
";

#[tokio::test]
async fn defaults_and_ranges_are_described_and_used() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let described = client.program(PART).await.json();
    let part = &described["exports"][0];
    assert_eq!(part["doc"], "A part.");
    let of = |name: &str| {
        let parameter = find(&part["parameters"], "name", name);
        (parameter["default"].clone(), parameter["range"].clone())
    };
    assert_eq!(of("p"), (Value::Null, json!({ "lower": [-2.0, -2.0], "upper": [2.0, 2.0] })));
    assert_eq!(of("r"), (json!(1.5), json!({ "lower": 0.5, "upper": 3.0 })));
    assert_eq!(of("n"), (json!(4), json!({ "lower": 1, "upper": 16 })));
    assert_eq!(of("up"), (json!(true), Value::Null));
    assert_eq!(of("size"), (json!([1.0, 2.0]), Value::Null));

    let id = described["id"].as_str().unwrap();
    let rows = async |inputs: Value| {
        let answer = client.evaluate(id, json!({ "inputs": inputs })).await;
        assert_eq!(answer.status, 200, "{}", answer.json());
        answer.json()["outputs"][0]["rows"].clone()
    };
    assert_eq!(rows(json!({ "p": [[0, 0], [1, 2]] })).await, json!([[8.5], [11.5]]));
    assert_eq!(rows(json!({ "p": [0, 0], "r": [10, 20], "up": false })).await, json!([[16.0], [26.0]]));
    // The description can be sent back as it is.
    assert_eq!(rows(json!({ "p": [0, 0], "size": of("size").0, "n": of("n").0 })).await, json!([[8.5]]));
    let missing = client.evaluate(id, json!({ "inputs": { "r": 1 } })).await.problem(422, "invalid-input");
    assert!(missing["detail"].as_str().unwrap().contains("`p: vec2`"), "{missing}");
}
