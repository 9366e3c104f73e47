//! Directions and boxes over HTTP: how JSON gives them, what the answers hold, and what bad ones are answered.

mod common;

use common::{Client, TempDir};
use serde_json::{Value, json};

const DISC: &str = "export fn disc(at: vec2, radius: real = 1.0) -> real { length(at) - radius }";

async fn posted(client: &Client) -> String {
    client.program(DISC).await.json()["id"].as_str().unwrap().to_owned()
}

#[tokio::test]
async fn a_box_is_two_ends_for_each_number() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = posted(&client).await;
    let evaluate = async |query: Value, inputs: Value| {
        let answer = client.evaluate(&id, json!({ "query": query, "inputs": inputs, "precision": "f64" })).await;
        assert_eq!(answer.status, 200, "{}", answer.json());
        answer.json()["outputs"].clone()
    };
    let one = evaluate(json!(["bound(at)"]), json!({ "at": [[3, 0], 4] })).await;
    assert_eq!(one[0]["columns"], json!(["start", "end", "may_be_nan"]));
    assert_eq!(one[0]["rows"], json!([[3.0, 4.0, false]]));

    let inputs = json!({ "at": [[[0, 3], [4, 4]], [6, 8]], "radius": [[1, 2], [3, "nan"]] });
    let many = evaluate(json!(["bound", "bound(gradient(radius), *)"]), inputs).await;
    assert_eq!(many[0]["rows"], json!([[2.0, 4.0, false], ["-inf", "inf", true]]));
    assert_eq!(many[1]["rows"], json!([[-1.0, -1.0, false], [-1.0, -1.0, false]]));

    let both = evaluate(json!(["value", "bound(at)"]), json!({ "at": [3, 4], "at.box": [[0, 3], 4] })).await;
    assert_eq!(both[0]["rows"], json!([[4.0]]));
    assert_eq!(both[1]["rows"], json!([[3.0, 4.0, false]]));

    let inputs = json!({ "at": [[3, 4], [0, -2]], "at.direction": [5, 10] });
    let along = evaluate(json!(["directional(at)"]), inputs).await;
    assert_eq!(along[0]["columns"], json!(["value"]));
    assert_eq!(along[0]["rows"], json!([[11.0], [-10.0]]));
}

#[tokio::test]
async fn what_is_given_wrongly_is_a_problem() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = posted(&client).await;
    let problem = async |query: &str, inputs: Value| {
        let answer = client.evaluate(&id, json!({ "query": [query], "inputs": inputs })).await;
        assert_eq!(answer.status, 422, "{}", answer.json());
        let body = answer.json();
        let kind = body["type"].as_str().unwrap().rsplit(':').next().unwrap().to_owned();
        (kind, body["detail"].as_str().unwrap().to_owned())
    };
    let (kind, detail) = problem("value", json!({ "at": [[0, 1], 2] })).await;
    assert!(kind == "invalid-input" && detail.contains("boxes are for the parameters that `bound`"), "{detail}");
    let (kind, detail) = problem("value", json!({ "at": [0, 1], "at.box": [0, 1] })).await;
    assert!(kind == "unknown-name" && detail.contains("no query ranges over a box of `at`"), "{detail}");
    let (kind, detail) = problem("bound(at)", json!({ "at": [0, 1], "radius": [0, 1, 2], "to": 1 })).await;
    assert!(kind == "unknown-name" && detail.contains("no parameter `to`; it takes the box `at: vec2`"), "{detail}");
    let (kind, detail) = problem("directional(at)", json!({ "at": [0, 1] })).await;
    assert!(kind == "invalid-input" && detail.contains("no value for the direction `at.direction: vec2`"), "{detail}");
    let (kind, detail) = problem("bound(at)", json!({ "at": [[0, 1, 2], 3] })).await;
    assert!(kind == "invalid-input" && detail.contains("such as [[0.0, 1.0], [0.0, 1.0]]"), "{detail}");
    let (kind, detail) = problem("bound(to)", json!({ "at": [0, 1] })).await;
    assert!(kind == "unknown-name" && detail.contains("there is no parameter `to`"), "{detail}");
    let (kind, detail) = problem("bounds(at)", json!({ "at": [0, 1] })).await;
    assert!(kind == "invalid-request" && detail.contains("`lipschitz(PARAMETER)`"), "{detail}");
}

#[tokio::test]
async fn a_program_says_what_can_be_asked() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let queries = client.program(DISC).await.json()["queries"].clone();
    let forms: Vec<&str> = queries.as_array().unwrap().iter().map(|q| q["query"].as_str().unwrap()).collect();
    let all: Vec<&str> = isograd_compiler::FORMS.iter().map(|f| f.form).collect();
    assert_eq!(forms, all);
}

#[tokio::test]
async fn a_box_specialises_and_strict_keeps_ranges() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let text = "export fn f(x: real in [1.0 .. 2.0]) -> real { max(abs(x), 0.5) }";
    let id = client.program(text).await.json()["id"].as_str().unwrap().to_owned();
    let ask = async |more: Value, x: f64| {
        let mut body = json!({ "query": ["gradient(x)"], "inputs": { "x": x } });
        body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        client.evaluate(&id, body).await
    };
    for more in [json!({ "within": ["x=0.75:1.5"] }), json!({ "differentiability": "strict" })] {
        let inside = ask(more.clone(), 1.25).await;
        assert_eq!((inside.status, &inside.json()["outputs"][0]["rows"]), (200, &json!([[1.0]])));
        let outside = ask(more, 3.0).await;
        assert_eq!(outside.status, 422);
        assert!(outside.json()["detail"].as_str().unwrap().contains("`x` is 3 at point 0"), "{}", outside.json());
    }
    for within in [json!(["x=1"]), json!(["y=0:1"]), json!(["x=0:1", "x=0:2"]), json!("x=0:1")] {
        let answer = ask(json!({ "within": within }), 1.25).await;
        assert!((400..500).contains(&answer.status), "{}", answer.json());
    }
}
