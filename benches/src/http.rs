//! Requests through the server's own router, within the process: how much of their time is evaluation. Knows the API
//! and nothing of the server's inside.

use std::sync::Arc;

use axum::body::{Body, to_bytes};
use axum::http::{Method, Request, StatusCode};
use isograd_server::{Libraries, ServerLimits, Service, Store, router, server_options};
use serde_json::{Value, json};
use tokio::runtime::Runtime;
use tower::ServiceExt;

use crate::ours::Failure;

/// A server without a socket, with one program.
pub struct Server {
    runtime: Runtime,
    router: axum::Router,
    program: String,
    // Removed with the server.
    _store: tempfile::TempDir,
}

impl Server {
    /// Starts a server and posts the program.
    pub fn new(vola: &str) -> Result<Self, Failure> {
        let store = tempfile::tempdir()?;
        let service =
            Service::new(Store::open(store.path())?, Libraries::default(), ServerLimits::default(), server_options());
        let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
        let mut this = Self { runtime, router: router(Arc::new(service)), program: String::new(), _store: store };
        let (status, body) = this.post("/v1/programs", json!({ "files": { "main.vola": vola } }).to_string())?;
        let answer: Value = serde_json::from_slice(&body)?;
        let id = answer["id"].as_str().ok_or_else(|| format!("posting the program gave {status}: {answer}"))?;
        this.program = id.to_owned();
        Ok(this)
    }

    /// The body that asks for value and gradient at these points, in as few digits as say each number.
    pub fn question([x, y, z]: &[Vec<f32>; 3]) -> String {
        let rows: Vec<_> = x.iter().zip(y).zip(z).map(|((x, y), z)| format!("[{x},{y},{z}]")).collect();
        let rows = rows.join(",");
        format!(r#"{{"export":"field","query":["value","gradient(at)"],"inputs":{{"at":[{rows}]}}}}"#)
    }

    /// Asks. Gives the bytes of the answer.
    pub fn evaluate(&self, question: &str) -> Result<usize, Failure> {
        let (status, body) = self.post(&format!("/v1/programs/{}/evaluate", self.program), question.to_owned())?;
        if status != StatusCode::OK {
            return Err(format!("the server answered {status}: {}", String::from_utf8_lossy(&body)).into());
        }
        Ok(body.len())
    }

    fn post(&self, path: &str, body: String) -> Result<(StatusCode, Vec<u8>), Failure> {
        let request = Request::builder()
            .method(Method::POST)
            .uri(path)
            .header("content-type", "application/json")
            .body(Body::from(body))?;
        self.runtime.block_on(async {
            let answer = self.router.clone().oneshot(request).await?;
            let status = answer.status();
            Ok((status, to_bytes(answer.into_body(), usize::MAX).await?.to_vec()))
        })
    }
}
