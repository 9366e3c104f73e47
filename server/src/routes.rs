//! The routes: what comes in by HTTP, what goes out. Thin: each reads its request, calls a function on a worker and
//! answers with what it gives.

use std::any::Any;
use std::collections::BTreeMap;
use std::error::Error as _;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::extract::{FromRequestParts, Path, RawQuery, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderValue, Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use isograd_compiler::{Code, Files, Target, UnknownCode, explain};
use serde::{Deserialize, de::DeserializeOwned};
use serde_json::json;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::trace::{DefaultMakeSpan, DefaultOnResponse, TraceLayer};
use tracing::{Level, error};

use crate::choice::Choice;
use crate::config::server_options;
use crate::evaluate::{self, EvaluateError};
use crate::json_values::Named;
use crate::limits::{self, LimitValue};
use crate::pool::Held;
use crate::problem::{Kind, Problem};
use crate::program::Source;
use crate::select::{self, UnknownName};
use crate::state::Service;
use crate::values::{Inputs, Interface, Misfit};
use crate::{describe, pages};

type Shared = State<Arc<Service>>;

/// All routes over a service.
pub fn router(service: Arc<Service>) -> Router {
    Router::new()
        .route("/v1/programs", post(post_program))
        .route("/v1/programs/{id}", get(get_program))
        .route("/v1/programs/{id}/evaluate", post(evaluate))
        .route("/v1/programs/{id}/manifest", get(manifest))
        // A segment that is only in part a parameter is not to be had: the handler reads `module.EXTENSION`.
        .route("/v1/programs/{id}/{module}", get(module))
        .route("/v1/format", post(format))
        .route("/v1/limits", get(limits))
        .route(pages::ADDRESS, get(diagnostics))
        .route(&format!("{}/{{code}}", pages::ADDRESS), get(diagnostic))
        .route("/health/live", get(live))
        .route("/health/ready", get(ready))
        .fallback(nothing_here)
        .method_not_allowed_fallback(wrong_method)
        .layer(CatchPanicLayer::custom(panicked))
        .layer(
            TraceLayer::new_for_http()
                .make_span_with(DefaultMakeSpan::new().level(Level::INFO))
                .on_response(DefaultOnResponse::new().level(Level::INFO)),
        )
        .with_state(service)
}

/// What stands in the path: a program's id, a diagnostic's code. Any text may stand there; the handler knows which it
/// takes.
struct At<T>(T);

impl<T: DeserializeOwned + Send, S: Send + Sync> FromRequestParts<S> for At<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let path = Path::<T>::from_request_parts(parts, state).await;
        path.map(|Path(parts)| Self(parts)).map_err(|error| Problem::new(Kind::InvalidRequest, error.body_text()))
    }
}

/// The body of `POST /v1/programs`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Posted {
    files: BTreeMap<String, String>,
    entry: Option<String>,
}

async fn post_program(State(service): Shared, request: Request) -> Result<Response, Problem> {
    let body = read_body(&service, request, service.limits.program_bytes()).await?;
    let shared = Arc::clone(&service);
    service.pool.run(move || keep(&shared, &body)).await
}

fn keep(service: &Service, body: &Held) -> Result<Response, Problem> {
    let posted: Posted = read_json(&body.bytes)?;
    let limits = &service.options.limits;
    let source = source(service, posted.files, posted.entry.as_deref())?;
    let program = service.check(source);
    if program.has_errors() {
        return Err(Problem::diagnostics(&program.diagnostics, &program.checked.files, limits));
    }
    let known = service.store.load(&program.id).is_ok();
    if !known {
        service.store.save(&program.source).map_err(|error| {
            error!("cannot keep program {}: {error}", program.id);
            Problem::new(Kind::Unavailable, format!("the store cannot be written: {error}"))
        })?;
    }
    let status = if known { StatusCode::OK } else { StatusCode::CREATED };
    let mut response = (status, axum::Json(program.json())).into_response();
    if let Ok(location) = HeaderValue::from_str(&format!("/v1/programs/{}", program.id)) {
        response.headers_mut().insert(header::LOCATION, location);
    }
    Ok(response)
}

/// The program that files and the name of the entry stand for.
fn source(service: &Service, files: BTreeMap<String, String>, entry: Option<&str>) -> Result<Source, Problem> {
    let limit = service.limits.program_files();
    if files.len() as u64 > limit.value {
        return Err(Problem::over(limit, "files", files.len() as u64));
    }
    Source::new(files, entry).map_err(|d| Problem::diagnostics(&d, &Files::default(), &service.options.limits))
}

/// The body of `POST /v1/format`: a program, whose entry file is formatted. The other files are needed to migrate.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Format {
    files: BTreeMap<String, String>,
    entry: Option<String>,
    #[serde(default)]
    migrate: bool,
}

async fn format(State(service): Shared, request: Request) -> Result<Response, Problem> {
    let body = read_body(&service, request, service.limits.program_bytes()).await?;
    let shared = Arc::clone(&service);
    service.pool.run(move || formatted(&shared, &body)).await
}

fn formatted(service: &Service, body: &Held) -> Result<Response, Problem> {
    let asked: Format = read_json(&body.bytes)?;
    let source = source(service, asked.files, asked.entry.as_deref())?;
    let options = &service.options;
    let text = source
        .rewritten(asked.migrate, &service.libraries, options)
        .map_err(|m| Problem::diagnostics(&m.diagnostics, &m.files, &options.limits))?;
    let changed = text != source.text();
    Ok(axum::Json(json!({ "text": text, "changed": changed })).into_response())
}

async fn get_program(State(service): Shared, At(id): At<String>) -> Result<Response, Problem> {
    let shared = Arc::clone(&service);
    service.pool.run(move || Ok(axum::Json(shared.program(&id)?.json()).into_response())).await
}

/// The body of `POST /v1/programs/{id}/evaluate`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Evaluate {
    export: Option<String>,
    query: Option<Vec<String>>,
    #[serde(default)]
    inputs: Named,
    precision: Option<String>,
    mode: Option<String>,
    differentiability: Option<String>,
    sensitivity: Option<f64>,
    #[serde(default)]
    within: Vec<String>,
}

async fn evaluate(State(service): Shared, At(id): At<String>, request: Request) -> Result<Response, Problem> {
    let body = read_body(&service, request, service.limits.evaluate_bytes()).await?;
    let shared = Arc::clone(&service);
    service.pool.run(move || answer(&shared, &id, body)).await
}

fn answer(service: &Service, id: &str, body: Held) -> Result<Response, Problem> {
    let program = service.program(id)?;
    let asked: Evaluate = read_json(&body.bytes)?;
    let choice = Choice {
        export: asked.export,
        queries: asked.query,
        precision: asked.precision,
        mode: asked.mode,
        differentiability: asked.differentiability,
        sensitivity: asked.sensitivity.map(|s| s.to_string()),
        within: asked.within,
        ..Choice::default()
    };
    let mut wanted = choice.request(service, &program)?;
    let exports = program.checked.exports();
    let export = select::export(&exports, Some(&wanted.export))?;

    let interface = Interface::of(export, &wanted.queries);
    let mut named = Vec::with_capacity(asked.inputs.0.len());
    for (name, shaped) in asked.inputs.0 {
        let values = shaped.values(interface.argument(&name).map_err(UnknownName)?)?;
        named.push((name, values));
    }
    let inputs = Inputs::of(&interface, named)?;
    drop(body);

    let points = service.limits.points();
    if inputs.points as u64 > points.value {
        return Err(Problem::over(points, "points", inputs.points as u64));
    }
    evaluate::set_rates(&mut wanted, &interface, &inputs);
    let artefact = service.compiled(&program, &wanted)?;
    let columns: usize = artefact.manifest.outputs.iter().map(|o| o.columns.len()).sum();
    let scalars = (inputs.points as u64).saturating_mul(columns as u64);
    let output_scalars = service.limits.output_scalars();
    if scalars > output_scalars.value {
        return Err(Problem::over(output_scalars, "numbers of results", scalars));
    }
    let limit = service.limits.evaluation_ms();
    let outputs = service
        .kernel(&artefact)
        .and_then(|kernel| evaluate::run(&kernel, &inputs, Some(Duration::from_millis(limit.value))))
        .map_err(|error| failed(&error, limit))?;
    let mut text = Vec::new();
    outputs.write_json(&mut text).map_err(|error| Problem::new(Kind::Internal, error.to_string()))?;
    Ok(([(header::CONTENT_TYPE, "application/json")], text).into_response())
}

/// The module of a target, which the extension of its name says.
async fn module(
    State(service): Shared,
    At((id, name)): At<(String, String)>,
    RawQuery(query): RawQuery,
    uri: Uri,
) -> Result<Response, Problem> {
    let Some(extension) = name.strip_prefix("module.") else { return Err(nothing_here(uri).await) };
    let target = Target::ALL.into_iter().find(|target| target.extension() == extension).ok_or_else(|| {
        let shown: String = name.chars().take(50).collect();
        let modules = Target::ALL.map(|target| format!("`module.{}` ({})", target.extension(), target.name()));
        Problem::new(Kind::NotFound, format!("there is no `{shown}`; a program has {}", modules.join(", ")))
    })?;
    let shared = Arc::clone(&service);
    service.pool.run(move || module_bytes(&shared, &id, target, query.as_deref().unwrap_or(""))).await
}

fn module_bytes(service: &Service, id: &str, target: Target, query: &str) -> Result<Response, Problem> {
    let choice = Choice::of_module(query, target)?;
    let program = service.program(id)?;
    let artefact = service.compiled(&program, &choice.request(service, &program)?)?;
    let manifest = &artefact.manifest;
    let headers = [
        (header::CONTENT_TYPE, media_type(target).to_owned()),
        (header::ETAG, format!("\"{}\"", manifest.id)),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{}.{}\"", manifest.export, target.extension())),
    ];
    Ok((headers, artefact.bytes.clone()).into_response())
}

/// What a module is to whoever gets it. Only two of these types have a registration: SPIR-V is bytes to everyone else,
/// the other languages are text.
const fn media_type(target: Target) -> &'static str {
    match target {
        Target::Wasm => "application/wasm",
        Target::Spirv => "application/octet-stream",
        Target::Wgsl => "text/wgsl; charset=utf-8",
        Target::Glsl | Target::Hlsl | Target::Msl => "text/plain; charset=utf-8",
    }
}

async fn manifest(State(service): Shared, At(id): At<String>, RawQuery(query): RawQuery) -> Result<Response, Problem> {
    let shared = Arc::clone(&service);
    service.pool.run(move || manifest_json(&shared, &id, query.as_deref().unwrap_or(""))).await
}

fn manifest_json(service: &Service, id: &str, query: &str) -> Result<Response, Problem> {
    let choice = Choice::of_manifest(query)?;
    let program = service.program(id)?;
    let artefact = service.compiled(&program, &choice.request(service, &program)?)?;
    let headers = [
        (header::CONTENT_TYPE, "application/json".to_owned()),
        (header::ETAG, format!("\"{}\"", artefact.manifest.id)),
    ];
    Ok((headers, describe::manifest(&artefact.manifest)).into_response())
}

async fn limits(State(service): Shared) -> Response {
    let language = limits::language_json(&service.options.limits, &server_options().limits);
    axum::Json(json!({ "language": language, "service": limits::service_json(&service.limits) })).into_response()
}

async fn diagnostics() -> Response {
    axum::Json(json!({ "diagnostics": pages::list() })).into_response()
}

async fn diagnostic(At(code): At<String>) -> Result<Response, Problem> {
    let code: Code = code.parse().map_err(|error: UnknownCode| {
        let shown: String = error.text.chars().take(50).collect();
        let error = UnknownCode { text: shown, ..error };
        Problem::new(Kind::NotFound, format!("{error}; all are at {}", pages::ADDRESS))
    })?;
    Ok(([(header::CONTENT_TYPE, "text/markdown; charset=utf-8")], explain(code)).into_response())
}

async fn live() -> Response {
    axum::Json(json!({ "status": "live" })).into_response()
}

async fn ready(State(service): Shared) -> Result<Response, Problem> {
    if service.stopping.load(Ordering::Relaxed) {
        return Err(Problem::new(Kind::Unavailable, "the server is stopping"));
    }
    let shared = Arc::clone(&service);
    let probed = tokio::task::spawn_blocking(move || shared.store.probe()).await;
    let unwritable = match probed {
        Ok(Ok(())) => return Ok(axum::Json(json!({ "status": "ready" })).into_response()),
        Ok(Err(error)) => error.to_string(),
        Err(error) => error.to_string(),
    };
    Err(Problem::new(Kind::Unavailable, format!("the store cannot be written: {unwritable}")))
}

async fn nothing_here(uri: Uri) -> Problem {
    let path: String = uri.path().chars().take(200).collect();
    Problem::new(Kind::NotFound, format!("there is nothing at `{path}`; programs are at /v1/programs"))
}

async fn wrong_method(method: Method, uri: Uri) -> Problem {
    let path: String = uri.path().chars().take(200).collect();
    Problem::new(Kind::MethodNotAllowed, format!("`{path}` does not take {method}; see the header `allow`"))
}

fn panicked(cause: Box<dyn Any + Send + 'static>) -> Response {
    let what = cause.downcast_ref::<String>().map(String::as_str).or_else(|| cause.downcast_ref::<&str>().copied());
    error!("a request panicked: {}", what.unwrap_or("without a message"));
    Problem::new(Kind::Internal, "the request could not be answered; this is a mistake of the server").into_response()
}

/// Reads a body, within a limit of bytes, of time, and of what all bodies may take together.
async fn read_body(service: &Service, request: Request, limit: LimitValue) -> Result<Held, Problem> {
    let too_large = || {
        let detail = format!("the limit `{}` is {} bytes", limit.name, limit.value);
        Problem::new(Kind::BodyTooLarge, detail).limit(limit)
    };
    let announced = request.headers().get(header::CONTENT_LENGTH);
    let announced = announced.and_then(|v| v.to_str().ok()).and_then(|v| v.parse::<u64>().ok());
    if announced.is_some_and(|n| n > limit.value) {
        return Err(too_large());
    }
    let memory = service.pool.memory(announced.unwrap_or(limit.value))?;
    let time = service.limits.body_ms();
    let most = usize::try_from(limit.value).unwrap_or(usize::MAX);
    let reading = axum::body::to_bytes(Body::new(request.into_body()), most);
    match tokio::time::timeout(Duration::from_millis(time.value), reading).await {
        Ok(Ok(bytes)) => Ok(memory.hold(bytes)),
        Ok(Err(error)) if error.source().is_some_and(|e| e.is::<http_body_util::LengthLimitError>()) => {
            Err(too_large())
        }
        Ok(Err(error)) => {
            Err(Problem::new(Kind::InvalidJson, format!("the body ended before it was complete: {error}")))
        }
        Err(_) => {
            let detail = format!("the body did not arrive within {} ms", time.value);
            Err(Problem::new(Kind::BodyTimeout, detail).limit(time))
        }
    }
}

fn read_json<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Problem> {
    serde_json::from_slice(bytes).map_err(|error| {
        let kind = if error.is_data() { Kind::InvalidRequest } else { Kind::InvalidJson };
        Problem::new(kind, error.to_string())
    })
}

fn failed(error: &EvaluateError, limit: LimitValue) -> Problem {
    match error {
        EvaluateError::Deadline => {
            let detail = format!(
                "the evaluation took longer than {} ms (`{}`); ask for fewer points, or shorten the program's loops",
                limit.value, limit.name
            );
            Problem::new(Kind::DeadlineExceeded, detail).limit(limit)
        }
        EvaluateError::Refused { message, limit } => {
            let problem = Problem::new(Kind::LimitExceeded, message.clone());
            Problem { limit: *limit, ..problem }
        }
        EvaluateError::Internal(why) => {
            error!("an evaluation failed: {why}");
            Problem::new(Kind::Internal, format!("the evaluation failed: {why}"))
        }
    }
}

impl From<UnknownName> for Problem {
    fn from(error: UnknownName) -> Self {
        Self::new(Kind::UnknownName, error.0)
    }
}

impl From<Misfit> for Problem {
    fn from(error: Misfit) -> Self {
        Self::new(Kind::InvalidInput, error.0)
    }
}
