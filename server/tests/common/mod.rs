//! A router over a fresh directory, and requests to it without a network.

#![allow(dead_code, reason = "every test binary uses its own part")]

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use axum::Router;
use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, Request};
use isograd_compiler::Options;
use isograd_server::{Libraries, ServerLimits, Service, Store, router, server_options};
use serde_json::{Value, json};
use tower::ServiceExt;

/// A directory that is empty now and gone when the test is over.
pub struct TempDir(pub PathBuf);

impl TempDir {
    pub fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let name = format!("server-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }
}

impl Drop for TempDir {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// An answer.
pub struct Answer {
    pub status: u16,
    pub headers: HeaderMap,
    pub body: Bytes,
}

impl Answer {
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&self.body)))
    }

    /// The body, which must be a problem of this status and kind.
    #[track_caller]
    pub fn problem(&self, status: u16, kind: &str) -> Value {
        let body = String::from_utf8_lossy(&self.body).into_owned();
        assert_eq!(self.status, status, "{body}");
        assert_eq!(self.headers["content-type"], "application/problem+json", "{body}");
        let json = self.json();
        assert_eq!(json["type"], format!("urn:isograd:problem:{kind}"), "{body}");
        assert_eq!(json["status"], status, "{body}");
        assert!(json["title"].is_string() && json["detail"].as_str().is_some_and(|d| d.len() > 10), "{body}");
        json
    }
}

/// A server without a network.
pub struct Client(pub Router);

impl Client {
    pub fn over(directory: &Path) -> Self {
        Self::with(directory, ServerLimits::default(), server_options())
    }

    pub fn with(directory: &Path, limits: ServerLimits, options: Options) -> Self {
        let store = Store::open(directory).unwrap();
        Self(router(Arc::new(Service::new(store, Libraries::default(), limits, options))))
    }

    pub async fn send(&self, request: Request<Body>) -> Answer {
        let response = self.0.clone().oneshot(request).await.unwrap();
        let (parts, body) = response.into_parts();
        let body = axum::body::to_bytes(body, usize::MAX).await.unwrap();
        Answer { status: parts.status.as_u16(), headers: parts.headers, body }
    }

    pub async fn get(&self, path: &str) -> Answer {
        self.send(Request::get(path).body(Body::empty()).unwrap()).await
    }

    pub async fn post(&self, path: &str, body: impl Into<Body>) -> Answer {
        self.send(Request::post(path).body(body.into()).unwrap()).await
    }

    /// Posts a program of one file.
    pub async fn program(&self, text: &str) -> Answer {
        self.post("/v1/programs", json!({ "files": { "main.vola": text } }).to_string()).await
    }

    /// Posts a program of one file, which must compile; its id.
    pub async fn id(&self, text: &str) -> String {
        let answer = self.program(text).await;
        let body = String::from_utf8_lossy(&answer.body);
        assert!(matches!(answer.status, 200 | 201), "{body}");
        answer.json()["id"].as_str().unwrap().to_owned()
    }

    pub async fn evaluate(&self, id: &str, body: Value) -> Answer {
        self.post(&format!("/v1/programs/{id}/evaluate"), body.to_string()).await
    }
}
