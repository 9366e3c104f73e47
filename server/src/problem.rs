//! What a client is told when something is wrong: `application/problem+json` (RFC 9457), from one list of kinds.
//! Knows nothing of routes; every answer that is no success is made here.

use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use isograd_compiler::{Code, Diagnostic, Files, Limits};
use serde_json::{Value, json};

use crate::limits::LimitValue;
use crate::pages;

macro_rules! kinds {
    ($( $(#[doc = $doc:literal])+ $kind:ident = $status:literal, $name:literal, $title:literal; )+) => {
        /// The kinds of problems. A kind's `type` is `urn:isograd:problem:NAME`.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum Kind { $( $(#[doc = $doc])+ $kind, )+ }

        impl Kind {
            /// All kinds.
            pub const ALL: &'static [Self] = &[$( Self::$kind, )+];

            /// The last part of the `type`.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $( Self::$kind => $name, )+ }
            }

            /// The same for every problem of this kind.
            #[must_use]
            pub const fn title(self) -> &'static str {
                match self { $( Self::$kind => $title, )+ }
            }

            /// The HTTP status.
            #[must_use]
            pub const fn status(self) -> u16 {
                match self { $( Self::$kind => $status, )+ }
            }
        }
    };
}

kinds! {
    /// The body is no JSON, or ended too early.
    InvalidJson = 400, "invalid-json", "The body is not valid JSON";
    /// JSON or query string of the wrong form: a field is missing, unknown or of the wrong type.
    InvalidRequest = 422, "invalid-request", "The request has not the expected form";
    /// No such route.
    NotFound = 404, "not-found", "There is nothing at this address";
    /// The route exists with another method.
    MethodNotAllowed = 405, "method-not-allowed", "This address does not take this method";
    /// No program of this id.
    UnknownProgram = 404, "unknown-program", "There is no program with this id";
    /// The program has errors; `diagnostics` lists them.
    DoesNotCompile = 422, "does-not-compile", "The program does not compile";
    /// An export, parameter or query that the program does not have.
    UnknownName = 422, "unknown-name", "The program has nothing of this name";
    /// Values that do not fit the parameters.
    InvalidInput = 422, "invalid-input", "The inputs do not fit the parameters";
    /// The body is over its limit.
    BodyTooLarge = 413, "body-too-large", "The body is too large";
    /// The body did not arrive in time.
    BodyTimeout = 408, "body-timeout", "The body did not arrive in time";
    /// Another limit is exceeded; `limit` names it.
    LimitExceeded = 422, "limit-exceeded", "A limit is exceeded";
    /// The evaluation did not end in time.
    DeadlineExceeded = 422, "deadline-exceeded", "The evaluation took too long";
    /// All workers are busy and the queue is full, or the server holds all the bodies it may.
    Busy = 503, "busy", "The server is busy";
    /// The server is told to stop, or its store cannot be used.
    Unavailable = 503, "unavailable", "The server cannot answer now";
    /// A stored program is not what was stored.
    DamagedProgram = 500, "damaged-program", "The stored program is damaged";
    /// A mistake of ours.
    Internal = 500, "internal", "The server made a mistake";
}

/// A problem.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// Its kind.
    pub kind: Kind,
    /// What is wrong here and what to do.
    pub detail: String,
    /// The limit that is exceeded.
    pub limit: Option<LimitValue>,
    /// Diagnostics of the compiler, as JSON, each with the address of its page.
    pub diagnostics: Option<Value>,
}

impl Problem {
    /// A problem.
    #[must_use]
    pub fn new(kind: Kind, detail: impl Into<String>) -> Self {
        Self { kind, detail: detail.into(), limit: None, diagnostics: None }
    }

    /// The problem, naming a limit.
    #[must_use]
    pub const fn limit(mut self, limit: LimitValue) -> Self {
        self.limit = Some(limit);
        self
    }

    /// More of something than a limit allows.
    #[must_use]
    pub fn over(limit: LimitValue, what: &str, found: u64) -> Self {
        let detail = format!("the request has {found} {what}, the limit `{}` is {}", limit.name, limit.value);
        Self::new(Kind::LimitExceeded, detail).limit(limit)
    }

    /// What the compiler says. If it is about one limit of the language, the problem names it.
    #[must_use]
    pub fn diagnostics(diagnostics: &[Diagnostic], files: &Files, limits: &Limits) -> Self {
        let errors = diagnostics.iter().filter(|d| d.is_error());
        let first = errors.clone().next();
        let limit = first.and_then(|d| exceeded(d.code, limits));
        let count = errors.count();
        let message = first.map_or("", |d| d.message.as_str());
        let detail = match count {
            0 | 1 => format!("{message}; see `diagnostics`"),
            _ => format!("{message}, and {} more errors; see `diagnostics`", count - 1),
        };
        let kind = match first.map(|d| d.code) {
            _ if limit.is_some() => Kind::LimitExceeded,
            Some(Code::E1102) => Kind::InvalidRequest,
            Some(Code::E1103) => Kind::Internal,
            _ => Kind::DoesNotCompile,
        };
        Self { kind, detail, limit, diagnostics: Some(pages::json(diagnostics, files)) }
    }

    /// The body of the answer.
    #[must_use]
    pub fn json(&self) -> Value {
        let mut body = json!({
            "type": format!("urn:isograd:problem:{}", self.kind.name()),
            "title": self.kind.title(),
            "status": self.kind.status(),
            "detail": self.detail,
        });
        if let Some(object) = body.as_object_mut() {
            if let Some(limit) = self.limit {
                object.insert("limit".to_owned(), json!({ "name": limit.name, "value": limit.value }));
            }
            if let Some(diagnostics) = &self.diagnostics {
                object.insert("diagnostics".to_owned(), diagnostics.clone());
            }
        }
        body
    }
}

/// The limit of the language that a diagnostic is about.
fn exceeded(code: Code, limits: &Limits) -> Option<LimitValue> {
    let limit = Limits::ALL.iter().find(|l| l.code == code)?;
    Some(LimitValue { name: limit.name, value: (limit.get)(limits) })
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.kind.status()).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let mut response = (status, self.json().to_string()).into_response();
        let headers = response.headers_mut();
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("application/problem+json"));
        if status == StatusCode::SERVICE_UNAVAILABLE {
            headers.insert(header::RETRY_AFTER, HeaderValue::from_static("1"));
        }
        response
    }
}
