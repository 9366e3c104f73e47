//! `POST /v1/format`: the entry file in the form of the house and, if that is asked for, in the current dialect.

mod common;

use common::{Client, TempDir};
use isograd_server::{ServerLimits, server_options};
use serde_json::{Value, json};

const OLD: &str = "module part;\nexport f(x: s) { part(x) }\n";
const NEW: &str = "module self::part;\nexport fn f(x: real) -> real { part(x) }\n";
const PART: &str = "fn part(x: real) -> real { x }";

async fn format(client: &Client, body: Value) -> common::Answer {
    client.post("/v1/format", body.to_string()).await
}

#[tokio::test]
async fn the_entry_file_is_formatted() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let answer = format(&client, json!({ "files": { "a.vola": "fn f( x:real )->real{x*x}" } })).await;
    let expected = "fn f(x: real) -> real { x * x }\n";
    assert_eq!((answer.status, answer.json()), (200, json!({ "text": expected, "changed": true })));
    let again = format(&client, json!({ "files": { "a.vola": expected }, "migrate": false })).await;
    assert_eq!(again.json(), json!({ "text": expected, "changed": false }));
    let empty = format(&client, json!({ "files": { "a.vola": "" } })).await;
    assert_eq!(empty.json(), json!({ "text": "", "changed": false }));
    // What it imports does not matter for that.
    let old = format(&client, json!({ "files": { "a.vola": OLD } })).await;
    assert_eq!(old.json(), json!({ "text": OLD, "changed": false }));
}

#[tokio::test]
async fn it_is_migrated_with_what_it_imports() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let files = json!({ "d/main.vola": OLD, "d/part.vola": PART });
    let answer = format(&client, json!({ "files": files, "entry": "d/main.vola", "migrate": true })).await;
    assert_eq!((answer.status, answer.json()), (200, json!({ "text": NEW, "changed": true })));
    let alone = format(&client, json!({ "files": { "main.vola": OLD }, "migrate": true })).await;
    let problem = alone.problem(422, "does-not-compile");
    assert_eq!(problem["diagnostics"][0]["code"], "E0307");
}

#[tokio::test]
async fn what_cannot_be_formatted_is_a_problem() {
    let directory = TempDir::new();
    let client =
        Client::with(&directory.0, ServerLimits { program_files: 2, ..ServerLimits::default() }, server_options());
    let wrong = format(&client, json!({ "files": { "a.vola": "fn f(x: real) -> real { x + }" } })).await;
    let problem = wrong.problem(422, "does-not-compile");
    assert_eq!(problem["diagnostics"][0]["labels"][0]["file"], "a.vola");
    let deep = format!("fn f(x: real) -> real {{ {}x{} }}", "(".repeat(10_000), ")".repeat(10_000));
    let deep = format(&client, json!({ "files": { "a.vola": deep } })).await;
    assert_eq!(deep.problem(422, "limit-exceeded")["limit"]["name"], "nesting");
    let many = json!({ "files": { "a.vola": "", "b.vola": "", "c.vola": "" }, "entry": "a.vola" });
    format(&client, many).await.problem(422, "limit-exceeded");
    format(&client, json!({ "files": { "a.vola": "", "b.vola": "" } })).await.problem(422, "does-not-compile");
    format(&client, json!({ "text": "" })).await.problem(422, "invalid-request");
    format(&client, json!({ "files": { "a.vola": "" }, "migrate": 1 })).await.problem(422, "invalid-request");
    assert_eq!(client.get("/v1/format").await.headers["allow"], "POST");
}
