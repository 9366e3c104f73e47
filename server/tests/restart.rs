//! Programs over restarts of the service, and files that are not what was written.

mod common;

use std::fs;
use std::path::PathBuf;

use common::{Client, TempDir};
use serde_json::json;

const DOUBLE: &str = "export fn double(x: real) -> real { x * 2.0 }";

fn stored(directory: &TempDir) -> Vec<PathBuf> {
    let entries = fs::read_dir(directory.0.join("programs")).unwrap();
    let mut files: Vec<PathBuf> = entries.map(|e| e.unwrap().path()).collect();
    files.sort();
    files
}

#[tokio::test]
async fn a_program_survives_a_restart() {
    let directory = TempDir::new();
    let id = Client::over(&directory.0).id(DOUBLE).await;
    let files = stored(&directory);
    assert_eq!(files.len(), 1, "one whole file and no temporary one: {files:?}");

    let client = Client::over(&directory.0);
    assert_eq!(client.get(&format!("/v1/programs/{id}")).await.json()["exports"][0]["name"], "double");
    let answer = client.evaluate(&id, json!({ "inputs": { "x": 21 } })).await;
    assert_eq!(answer.json()["outputs"][0]["rows"], json!([[42.0]]));
    assert_eq!(client.program(DOUBLE).await.status, 200);
}

#[tokio::test]
async fn a_program_that_does_not_compile_is_not_kept() {
    let directory = TempDir::new();
    Client::over(&directory.0).program("export fn f(x: real) -> real { y }").await.problem(422, "does-not-compile");
    assert_eq!(stored(&directory), Vec::<PathBuf>::new());
}

#[tokio::test]
async fn a_damaged_file_is_told_and_repaired_by_posting_again() {
    let directory = TempDir::new();
    let id = Client::over(&directory.0).id(DOUBLE).await;
    let path = stored(&directory).remove(0);
    let whole = fs::read(&path).unwrap();
    let other = String::from_utf8(whole.clone()).unwrap().replace("2.0", "3.0").into_bytes();
    for damaged in [&whole[..whole.len() / 2], b"", b"\xFF\xFE", b"{}", other.as_slice()] {
        fs::write(&path, damaged).unwrap();
        let client = Client::over(&directory.0);
        let problem = client.get(&format!("/v1/programs/{id}")).await.problem(500, "damaged-program");
        assert!(problem["detail"].as_str().unwrap().contains(&id), "{problem}");
        client.evaluate(&id, json!({ "inputs": { "x": 1 } })).await.problem(500, "damaged-program");
        assert_eq!(client.program(DOUBLE).await.status, 201);
        assert_eq!(fs::read(&path).unwrap(), whole);
        assert_eq!(client.get(&format!("/v1/programs/{id}")).await.status, 200);
    }
}

#[tokio::test]
async fn what_a_dead_process_left_behind_does_not_disturb() {
    let directory = TempDir::new();
    let id = Client::over(&directory.0).id(DOUBLE).await;
    let programs = directory.0.join("programs");
    let young = programs.join(".new-1-0");
    let old = programs.join(".new-1-1");
    fs::write(&young, "half").unwrap();
    fs::write(&old, "half").unwrap();
    let hours_ago = std::time::SystemTime::now() - std::time::Duration::from_secs(7200);
    fs::File::options().write(true).open(&old).unwrap().set_modified(hours_ago).unwrap();
    let client = Client::over(&directory.0);
    assert_eq!(client.get(&format!("/v1/programs/{id}")).await.status, 200);
    assert!(young.exists(), "another process may be writing it");
    assert!(!old.exists());
}

#[tokio::test]
async fn a_store_that_cannot_be_written_is_told() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    fs::remove_dir_all(&directory.0).unwrap();
    let problem = client.program(DOUBLE).await.problem(503, "unavailable");
    assert!(problem["detail"].as_str().unwrap().contains("store"), "{problem}");
}
