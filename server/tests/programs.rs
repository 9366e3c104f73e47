//! The HTTP API in process: programs, evaluation, modules, and what bad requests are answered.

mod common;

use axum::body::{Body, Bytes};
use axum::http::Request;
use common::{Client, TempDir};
use isograd_compiler::Limits;
use isograd_server::{ServerLimits, server_options};
use serde_json::{Value, json};

const BALL: &str = "\
/// The distance to a ball.
export fn ball(at: vec3, radius: real) -> real { length(at) - radius }
";

/// About as slow as programs get: the trip count comes from outside.
const SLOW: &str = "\
export fn slow(x: real, n: int) -> real { let y = x; for i in 0..n { y = sin(y) + x; } y }
";

fn rows(outputs: &Value, index: usize) -> Vec<Vec<f64>> {
    let rows = outputs["outputs"][index]["rows"].as_array().unwrap();
    rows.iter().map(|r| r.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()).collect()
}

#[tokio::test]
async fn a_program_is_posted_described_and_evaluated() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let answer = client.program(BALL).await;
    assert_eq!(answer.status, 201);
    let created = answer.json();
    let id = created["id"].as_str().unwrap();
    assert_eq!(answer.headers["location"], format!("/v1/programs/{id}"));
    assert_eq!(
        created["exports"],
        json!([{
            "name": "ball",
            "parameters": [
                { "name": "at", "type": "vec3", "columns": ["at.x", "at.y", "at.z"], "default": null, "range": null },
                { "name": "radius", "type": "real", "columns": ["radius"], "default": null, "range": null },
            ],
            "result": { "name": "value", "type": "real", "columns": ["value"] },
            "doc": "The distance to a ball.",
        }])
    );
    assert_eq!(created["diagnostics"], json!([]));
    assert_eq!(client.program(BALL).await.status, 200);
    let described = client.get(&format!("/v1/programs/{id}")).await;
    assert_eq!((described.status, described.json()), (200, created.clone()));

    let answer = client
        .evaluate(
            id,
            json!({
                "export": "ball",
                "query": ["value", "gradient(at)"],
                "inputs": { "at": [[3.0, 4.0, 0.0], [0.0, 0.0, -2.0]], "radius": 0.5 },
            }),
        )
        .await;
    assert_eq!(answer.status, 200, "{}", answer.json());
    assert_eq!(answer.headers["content-type"], "application/json");
    let outputs = answer.json();
    assert_eq!(outputs["export"], "ball");
    assert_eq!(outputs["outputs"][0]["name"], "value");
    assert_eq!(outputs["outputs"][1]["name"], "gradient(at)");
    assert_eq!(outputs["outputs"][1]["type"], "vec3");
    assert_eq!(outputs["outputs"][1]["columns"], json!(["at.x", "at.y", "at.z"]));
    assert_eq!(rows(&outputs, 0), [[4.5], [1.5]]);
    let gradients = rows(&outputs, 1);
    for (found, expected) in gradients.iter().zip([[0.6, 0.8, 0.0], [0.0, 0.0, -1.0]]) {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{gradients:?}");
    }
}

#[tokio::test]
async fn the_shape_of_an_input_decides_its_rate() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = client.id(BALL).await;
    let values = async |inputs: Value| {
        let answer = client.evaluate(&id, json!({ "inputs": inputs })).await;
        assert_eq!(answer.status, 200, "{}", answer.json());
        rows(&answer.json(), 0)
    };
    assert_eq!(values(json!({ "at": [3, 4, 0], "radius": 1 })).await, [[4.0]]);
    assert_eq!(values(json!({ "at": [3, 4, 0], "radius": [1, 2] })).await, [[4.0], [3.0]]);
    assert_eq!(values(json!({ "at": [[3, 4, 0], [0, 0, 1]], "radius": [1, 2] })).await, [[4.0], [-1.0]]);
    assert_eq!(values(json!({ "at": [], "radius": 1 })).await, Vec::<Vec<f64>>::new());
}

#[tokio::test]
async fn numbers_that_are_not_finite_are_strings_both_ways() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = client.id("export fn f(x: real) -> real { x * 2.0 }").await;
    let answer = client.evaluate(&id, json!({ "inputs": { "x": ["nan", "inf", "-inf", 1.5] } })).await;
    assert_eq!(answer.json()["outputs"][0]["rows"], json!([["nan"], ["inf"], ["-inf"], [3.0]]));
}

#[tokio::test]
async fn ints_and_bools_keep_their_kind_and_f64_its_digits() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = client.id("export fn f(n: int, x: real, up: bool) -> (int, bool, real) { (n / 2, up, x / 3.0) }").await;
    let body = json!({ "precision": "f64", "inputs": { "n": [7, -7], "x": 1, "up": true } });
    let answer = client.evaluate(&id, body).await;
    let third = 1.0 / 3.0;
    assert_eq!(answer.json()["outputs"][0]["rows"], json!([[3, true, third], [-3, true, third]]));
}

#[tokio::test]
async fn many_points_keep_their_order() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = client.id("export fn f(x: real) -> real { x + 1.0 }").await;
    let points: Vec<u32> = (0..100_000).collect();
    let answer = client.evaluate(&id, json!({ "inputs": { "x": points } })).await;
    let found = rows(&answer.json(), 0);
    assert_eq!(found.len(), 100_000);
    assert!(found.iter().enumerate().all(|(i, row)| row[0] == i as f64 + 1.0));
}

#[tokio::test]
async fn a_module_is_webassembly_with_an_id() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = client.id(BALL).await;
    let path = format!("/v1/programs/{id}/module.wasm?export=ball&query=value&query=gradient(at)&precision=f32");
    let answer = client.get(&path).await;
    assert_eq!(answer.status, 200);
    assert_eq!(answer.headers["content-type"], "application/wasm");
    assert!(answer.body.starts_with(b"\0asm"));
    let escaped = client.get(&path.replace("gradient(at)", "gradient%28at%29")).await;
    assert_eq!(answer.headers["etag"], escaped.headers["etag"]);
    let value = client.get(&format!("/v1/programs/{id}/module.wasm")).await;
    assert_ne!(answer.headers["etag"], value.headers["etag"]);
    client.get(&format!("{path}&mode=x")).await.problem(422, "invalid-request");
    client.get(&format!("/v1/programs/{id}/module.wasm?query=slope")).await.problem(422, "invalid-request");
    client.get(&format!("/v1/programs/{id}/module.wasm?export=cube")).await.problem(422, "unknown-name");
    client.get(&format!("/v1/programs/{id}/module.wasm?precision=f16")).await.problem(422, "invalid-request");
}

#[tokio::test]
async fn programs_of_several_files_are_confined_to_them() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let main = "module self::lib::ball;\nexport fn f(x: real) -> real { twice(x) }";
    let files = json!({ "app/main.vola": main, "app/lib/ball.vola": "fn twice(x: real) -> real { x * 2.0 }" });
    let answer = client.post("/v1/programs", json!({ "files": files, "entry": "app/main.vola" }).to_string()).await;
    assert_eq!(answer.status, 201, "{}", answer.json());
    client.post("/v1/programs", json!({ "files": files }).to_string()).await.problem(422, "does-not-compile");

    for path in ["../etc/passwd.vola", "/etc/passwd.vola", "a/../../b.vola", "main.txt"] {
        let problem = client.post("/v1/programs", json!({ "files": { path: BALL } }).to_string()).await;
        let problem = problem.problem(422, "does-not-compile");
        assert_eq!(problem["diagnostics"][0]["code"], "E0308", "{problem}");
    }
    std::fs::write(directory.0.join("secret.vola"), "fn secret() -> real { 1.0 }").unwrap();
    let outside = "module self::super::secret;\nexport fn f(x: real) -> real { x }";
    let problem = client.program(outside).await.problem(422, "does-not-compile");
    let code = problem["diagnostics"][0]["code"].as_str().unwrap();
    assert!(matches!(code, "E0307" | "E0308"), "{problem}");
}

#[tokio::test]
async fn a_bad_program_is_answered_with_its_diagnostics() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let items = "concept D: real -> real; entity Line(); operation P(); operation Q();\n";
    let cycle =
        "impl P<s> for D(x) { csg t = Q(){ s }; eval t.D(x) } impl Q<s> for D(x) { csg t = P(){ s }; eval t.D(x) }\n";
    let cases = [
        ("export fn f(x: real -> real { x }", "E0"),
        ("export fn f(x: real) -> real { y }", "E0301"),
        ("export fn f(x: real) -> real { x + 1 }", "E0401"),
        ("fn a(x: real) -> real { b(x) } fn b(x: real) -> real { a(x) } export fn f(x: real) -> real { x }", "E0506"),
        ("module self::missing;\nexport fn f(x: real) -> real { x }", "E0307"),
        (&format!("{items}export fn f(x: real) -> real {{ csg e = Line(); eval e.D(x) }}"), "E0605"),
        (&format!("{items}{cycle}export fn f(x: real) -> real {{ csg e = P(){{ Line() }}; eval e.D(x) }}"), "E0607"),
    ];
    for (text, code) in cases {
        let problem = client.program(text).await.problem(422, "does-not-compile");
        let first = &problem["diagnostics"][0];
        assert!(first["code"].as_str().unwrap().starts_with(code), "{text}: {problem}");
        assert_eq!(first["labels"][0]["file"], "main.vola", "{problem}");
        assert!(first["labels"][0]["start"]["line"].is_u64(), "{problem}");
    }
}

#[tokio::test]
async fn limits_of_the_language_are_named() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let deep = format!("export fn f(x: real) -> real {{ {}x{} }}", "(".repeat(100_000), ")".repeat(100_000));
    let problem = client.program(&deep).await.problem(422, "limit-exceeded");
    assert_eq!((problem["limit"]["name"].as_str(), problem["limit"]["value"].as_u64()), (Some("nesting"), Some(256)));
    assert_eq!(problem["diagnostics"][0]["code"], "E1004");

    let long = format!("{BALL}// {}", "x".repeat(10_000_000));
    let problem = client.program(&long).await.problem(422, "limit-exceeded");
    assert_eq!(problem["limit"]["name"], "source_bytes");
    assert_eq!(problem["diagnostics"][0]["code"], "E1001");
}

#[tokio::test]
async fn limits_of_the_service_are_named() {
    let directory = TempDir::new();
    let limits = ServerLimits {
        program_bytes: 2000,
        evaluate_bytes: 1000,
        points: 10,
        output_scalars: 12,
        queries: 4,
        ..ServerLimits::default()
    };
    let client = Client::with(&directory.0, limits, server_options());
    let id = client.id(BALL).await;
    let limit = |problem: Value| {
        (problem["limit"]["name"].as_str().unwrap().to_owned(), problem["limit"]["value"].as_u64().unwrap())
    };

    let large = client.program(&format!("// {}", "x".repeat(3000))).await.problem(413, "body-too-large");
    assert_eq!(limit(large), ("program_bytes".to_owned(), 2000));
    let announced = Request::post("/v1/programs").header("content-length", "999999999").body(Body::empty()).unwrap();
    assert_eq!(limit(client.send(announced).await.problem(413, "body-too-large")).1, 2000);
    let chunked = Body::from_stream(Chunks(100));
    let endless = client.send(Request::post(format!("/v1/programs/{id}/evaluate")).body(chunked).unwrap()).await;
    assert_eq!(limit(endless.problem(413, "body-too-large")), ("evaluate_bytes".to_owned(), 1000));

    let points: Vec<[u32; 3]> = vec![[1, 2, 3]; 11];
    let many = client.evaluate(&id, json!({ "inputs": { "at": points, "radius": 1 } })).await;
    assert_eq!(limit(many.problem(422, "limit-exceeded")), ("points".to_owned(), 10));
    let wide = json!({ "query": ["gradient(at)"], "inputs": { "at": &points[..5], "radius": 1 } });
    assert_eq!(
        limit(client.evaluate(&id, wide).await.problem(422, "limit-exceeded")),
        ("output_scalars".to_owned(), 12)
    );
    let queries = json!({ "query": ["value", "value", "value", "value", "value"], "inputs": {} });
    assert_eq!(limit(client.evaluate(&id, queries).await.problem(422, "limit-exceeded")), ("queries".to_owned(), 4));
}

/// A body of so many pieces without announced length.
struct Chunks(u32);

impl futures_core::Stream for Chunks {
    type Item = Result<Bytes, std::io::Error>;

    fn poll_next(
        mut self: std::pin::Pin<&mut Self>,
        _: &mut std::task::Context<'_>,
    ) -> std::task::Poll<Option<Self::Item>> {
        self.0 = self.0.saturating_sub(1);
        std::task::Poll::Ready((self.0 > 0).then(|| Ok(Bytes::from_static(&[b' '; 100]))))
    }
}

#[tokio::test]
async fn an_evaluation_over_the_deadline_ends() {
    let directory = TempDir::new();
    let limits = ServerLimits { evaluation_ms: 200, ..ServerLimits::default() };
    let client = Client::with(&directory.0, limits, server_options());
    let id = client.id(SLOW).await;
    let began = std::time::Instant::now();
    let answer = client.evaluate(&id, json!({ "inputs": { "x": 0.5, "n": 2_000_000_000 } })).await;
    let problem = answer.problem(422, "deadline-exceeded");
    assert_eq!(problem["limit"], json!({ "name": "evaluation_ms", "value": 200 }));
    assert!(began.elapsed().as_secs() < 5, "{:?}", began.elapsed());
    let answer = client.evaluate(&id, json!({ "inputs": { "x": 0.5, "n": 3 } })).await;
    assert_eq!(answer.status, 200, "the next evaluation is not affected");
}

#[tokio::test]
async fn a_compilation_over_its_deadline_is_a_limit() {
    let directory = TempDir::new();
    let text = format!("export fn f(x: real) -> real {{ let y = x; {} y }}", "y = sin(y) + x; ".repeat(500));
    let id = Client::over(&directory.0).id(&text).await;
    let limits = Limits { compile_time_ms: 0, ..Limits::default() };
    let options = isograd_compiler::Options { limits, verify: false };
    let client = Client::with(&directory.0, ServerLimits::default(), options);
    let answer = client.evaluate(&id, json!({ "inputs": { "x": 1 } })).await;
    let problem = answer.problem(422, "limit-exceeded");
    assert_eq!(problem["limit"], json!({ "name": "compile_time_ms", "value": 0 }));
}

#[tokio::test]
async fn bad_json_and_bad_fields_are_told_apart() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = client.id(BALL).await;
    let whole = json!({ "files": { "main.vola": BALL } }).to_string();
    for body in ["", "{", &whole[..whole.len() / 2], "\u{1}", "[1e999]", "{\"files\": {\"a.vola\": \"\\ud800\"}}"] {
        let problem = client.post("/v1/programs", body.to_owned()).await.problem(400, "invalid-json");
        assert!(problem["detail"].as_str().unwrap().contains("line"), "{problem}");
    }
    client.post("/v1/programs", Body::from(vec![b'{', b'"', 0xFF, b'"'])).await.problem(400, "invalid-json");
    let deep = format!("{{\"inputs\": {{\"at\": {}", "[".repeat(100_000));
    client.post(&format!("/v1/programs/{id}/evaluate"), deep).await.problem(400, "invalid-json");
    for body in ["{}", "[]", "{\"files\": 1}", "{\"files\": {\"a.vola\": 1}}", "{\"files\": {}, \"entrance\": 1}"] {
        client.post("/v1/programs", body).await.problem(422, "invalid-request");
    }
    client.post("/v1/programs", "{\"files\": {}}").await.problem(422, "does-not-compile");
}

#[tokio::test]
async fn what_a_request_names_must_exist() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = client.id(BALL).await;
    let detail = async |status, kind: &str, body: Value| {
        let problem = client.evaluate(&id, body).await.problem(status, kind);
        problem["detail"].as_str().unwrap().to_owned()
    };
    let inputs = json!({ "at": [1, 2, 3], "radius": 1 });
    let export = detail(422, "unknown-name", json!({ "export": "cube", "inputs": inputs })).await;
    assert!(export.contains("`cube`") && export.contains("`ball`"), "{export}");
    let query = detail(422, "unknown-name", json!({ "query": ["gradient(to)"], "inputs": inputs })).await;
    assert!(query.contains("`to`") && query.contains("`at`, `radius`"), "{query}");
    let form = detail(422, "invalid-request", json!({ "query": ["slope(at)"], "inputs": inputs })).await;
    assert!(form.contains("slope(at)") && form.contains("gradient(PARAMETER)"), "{form}");
    detail(422, "invalid-request", json!({ "query": [], "inputs": inputs })).await;
    detail(422, "invalid-request", json!({ "query": ["value", "value"], "inputs": inputs })).await;
    detail(422, "invalid-request", json!({ "precision": "f16", "inputs": inputs })).await;
    let extra = detail(422, "unknown-name", json!({ "inputs": { "at": [1, 2, 3], "radius": 1, "n": 1 } })).await;
    assert!(extra.contains("`n`") && extra.contains("`radius: real`"), "{extra}");
    let missing = detail(422, "invalid-input", json!({ "inputs": { "at": [1, 2, 3] } })).await;
    assert!(missing.contains("`radius: real`"), "{missing}");
    let short = detail(422, "invalid-input", json!({ "inputs": { "at": [[1, 2, 3], [1, 2]], "radius": 1 } })).await;
    assert!(short.contains("value 1 of `at: vec3`") && short.contains("[0.0, 0.0, 0.0]"), "{short}");
    let uneven = json!({ "inputs": { "at": [[1, 2, 3], [1, 2, 3]], "radius": [1, 2, 3] } });
    let uneven = detail(422, "invalid-input", uneven).await;
    assert!(uneven.contains("2 values") && uneven.contains("has 3"), "{uneven}");
    detail(422, "invalid-request", json!({ "inputs": { "at": "far", "radius": 1 } })).await;
}

#[tokio::test]
async fn unknown_addresses_and_methods_are_problems() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let absent = "0".repeat(64);
    for id in [absent.as_str(), "x", "..%2f..%2fetc%2fpasswd", &"A".repeat(64), &"f".repeat(5000)] {
        client.get(&format!("/v1/programs/{id}")).await.problem(404, "unknown-program");
        client.get(&format!("/v1/programs/{id}/module.wasm")).await.problem(404, "unknown-program");
        client.evaluate(id, json!({ "inputs": {} })).await.problem(404, "unknown-program");
    }
    client.get("/").await.problem(404, "not-found");
    client.get("/v2/programs").await.problem(404, "not-found");
    let wrong = client.get("/v1/programs").await;
    wrong.problem(405, "method-not-allowed");
    assert_eq!(wrong.headers["allow"], "POST");
    client.get(&format!("/v1/programs/{absent}/evaluate")).await.problem(405, "method-not-allowed");
    client.get("/v1/programs/%FF").await.problem(422, "invalid-request");
}

#[tokio::test]
async fn health_says_live_and_ready_until_the_store_is_gone() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    assert_eq!(client.get("/health/live").await.json(), json!({ "status": "live" }));
    assert_eq!(client.get("/health/ready").await.json(), json!({ "status": "ready" }));
    std::fs::remove_dir_all(&directory.0).unwrap();
    let answer = client.get("/health/ready").await;
    answer.problem(503, "unavailable");
    assert_eq!(answer.headers["retry-after"], "1");
    assert_eq!(client.get("/health/live").await.status, 200);
}

#[tokio::test]
async fn a_mode_and_its_sensitivity_are_fields() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = client.id("export fn f(x: real) -> real { abs(x) }").await;
    let at_zero = |more: serde_json::Value| {
        let mut body = json!({ "query": ["value", "hessian(x)"], "inputs": { "x": 0 } });
        body.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        client.evaluate(&id, body)
    };
    for (more, value, slope) in [
        (json!({}), 0.0, 0.0),
        (json!({ "differentiability": "exact" }), 0.0, 0.0),
        (json!({ "differentiability": "smooth" }), 0.000_693_147_2, 1000.0),
        (json!({ "differentiability": "smooth", "sensitivity": 1000 }), std::f64::consts::LN_2, 1.0),
    ] {
        let answer = at_zero(more).await;
        assert_eq!(answer.status, 200, "{}", answer.json());
        let found = [rows(&answer.json(), 0).concat()[0], rows(&answer.json(), 1).concat()[0]];
        assert!((found[0] - value).abs() < 1e-5 * value.max(1e-9), "{found:?}");
        assert!((found[1] - slope).abs() < 1e-4 * slope.max(1e-9), "{found:?}");
    }
    for (more, said) in [
        (json!({ "differentiability": "rough" }), "exact, strict, smooth"),
        (json!({ "differentiability": "smooth", "sensitivity": 0 }), "above 0"),
    ] {
        let problem = at_zero(more).await.problem(422, "invalid-request");
        assert!(problem["detail"].as_str().unwrap().contains(said), "{problem}");
    }
    let module = |query: &str| format!("/v1/programs/{id}/module.wasm?{query}");
    let mut ids = Vec::new();
    for query in ["", "differentiability=smooth", "differentiability=smooth&sensitivity=2"] {
        let answer = client.get(&module(query)).await;
        assert_eq!(answer.status, 200);
        ids.push(answer.headers["etag"].clone());
    }
    assert!(ids[0] != ids[1] && ids[1] != ids[2] && ids[0] != ids[2], "{ids:?}");
    let spelled_out = client.get(&module("differentiability=smooth&sensitivity=1.0")).await;
    assert_eq!(spelled_out.headers["etag"], ids[1], "1 is the default");
    // A sensitivity that nothing would use is refused by the compiler.
    assert_eq!(at_zero(json!({ "sensitivity": 2 })).await.status, 422);
}

#[tokio::test]
async fn both_ways_of_derivatives_agree() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = client.id("export fn f(a: vec4) -> real { sqrt(dot(a, a) * a.x + exp(a.y * a.z)) }").await;
    let mut gradients = Vec::new();
    let mut ids = Vec::new();
    for mode in ["forward", "reverse", "auto"] {
        let body = json!({ "query": ["gradient(a)"], "mode": mode, "inputs": { "a": [1.5, 0.5, 2, 3] } });
        let answer = client.evaluate(&id, body).await;
        assert_eq!(answer.status, 200, "{}", answer.json());
        gradients.push(rows(&answer.json(), 0).concat());
        let module = client.get(&format!("/v1/programs/{id}/module.wasm?query=gradient(a)&mode={mode}")).await;
        assert_eq!(module.status, 200);
        ids.push(module.headers["etag"].clone());
    }
    let near = |x: &f64, y: &f64| (x - y).abs() <= 1e-5 * x.abs().max(1.0);
    assert!(gradients[0].iter().zip(&gradients[1]).all(|(x, y)| near(x, y)), "{gradients:?}");
    assert!(gradients[..2].contains(&gradients[2]), "{gradients:?}");
    assert!(ids[0] != ids[1] && ids[1] != ids[2] && ids[0] != ids[2], "{ids:?}");
    let plain = client.get(&format!("/v1/programs/{id}/module.wasm?query=gradient(a)")).await;
    assert_eq!(plain.headers["etag"], ids[2], "auto is the default");
    let body = json!({ "mode": "backward", "inputs": { "a": [1, 2, 3, 4] } });
    for answer in
        [client.evaluate(&id, body).await, client.get(&format!("/v1/programs/{id}/module.wasm?mode=backward")).await]
    {
        let problem = answer.problem(422, "invalid-request");
        let detail = problem["detail"].as_str().unwrap();
        assert!(detail.contains("mode `backward`") && detail.contains("auto, forward, reverse"), "{detail}");
    }
}

#[tokio::test]
async fn a_report_of_kinks_names_those_that_occur() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = client.id("export fn f(x: real) -> real { max(abs(x), 1.0) }").await;
    let body = json!({ "query": ["kinks(x, 0.5)"], "inputs": { "x": [0.25, -1.5] } });
    let answer = client.evaluate(&id, body).await;
    assert_eq!(answer.status, 200, "{}", answer.json());
    let output = &answer.json()["outputs"][0];
    assert_eq!(output["columns"], json!(["near", "distance", "kink", "side"]));
    // Where 1 is chosen, that |x| has a crease does not matter.
    assert_eq!(output["rows"], json!([[false, 0.75, 1, -1], [true, 0.5, 1, 1]]));
    assert_eq!(output["kinks"].as_array().unwrap().len(), 1);
    assert_eq!(output["kinks"][0]["kink"], 1);
    assert_eq!(output["kinks"][0]["operation"], "max");
}
