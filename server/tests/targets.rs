//! Modules of every target and their manifests over HTTP.

mod common;

use common::{Client, TempDir};
use isograd_compiler::{Form, Manifest, Target};
use serde_json::Value;

const BALL: &str = "export fn ball(at: vec3, radius: real = 1.0) -> real { length(at) - radius }";

/// What a module of a target is sent as, and what is in it.
fn looks(target: Target) -> (&'static str, &'static str) {
    match target {
        Target::Wasm => ("application/wasm", "\0asm"),
        Target::Spirv => ("application/octet-stream", "\u{3}\u{2}#\u{7}"),
        Target::Wgsl => ("text/wgsl; charset=utf-8", "@compute"),
        Target::Glsl => ("text/plain; charset=utf-8", "#version 450"),
        Target::Hlsl => ("text/plain; charset=utf-8", "numthreads"),
        Target::Msl => ("text/plain; charset=utf-8", "metal_stdlib"),
    }
}

#[tokio::test]
async fn every_target_has_its_module() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = client.id(BALL).await;
    let mut tags = Vec::new();
    for target in Target::ALL {
        let extension = target.extension();
        let answer = client.get(&format!("/v1/programs/{id}/module.{extension}?query=value&query=gradient(at)")).await;
        assert_eq!(answer.status, 200, "{extension}: {}", String::from_utf8_lossy(&answer.body));
        let (media, found) = looks(target);
        assert_eq!(answer.headers["content-type"], media);
        assert_eq!(answer.headers["content-disposition"], format!("attachment; filename=\"ball.{extension}\""));
        assert!(answer.body.windows(found.len()).any(|w| w == found.as_bytes()), "{extension}");
        assert!(target.is_binary() || std::str::from_utf8(&answer.body).is_ok(), "{extension}");
        tags.push(answer.headers["etag"].clone());
    }
    assert_eq!(tags.iter().collect::<std::collections::HashSet<_>>().len(), tags.len(), "{tags:?}");
    let again = client.get(&format!("/v1/programs/{id}/module.wasm?query=value&query=gradient(at)")).await;
    assert_eq!((again.body.starts_with(b"\0asm"), &again.headers["etag"]), (true, &tags[0]), "none replaced another");
    let evaluated = client.evaluate(&id, serde_json::json!({ "inputs": { "at": [0, 3, 4] } })).await;
    assert_eq!(evaluated.json()["outputs"][0]["rows"], serde_json::json!([[4.0]]));
}

#[tokio::test]
async fn a_form_is_a_field() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = client.id(BALL).await;
    let text = async |query: &str| {
        let answer = client.get(&format!("/v1/programs/{id}/module.wgsl?{query}")).await;
        assert_eq!(answer.status, 200, "{}", String::from_utf8_lossy(&answer.body));
        (String::from_utf8(answer.body.to_vec()).unwrap(), answer.headers["etag"].clone())
    };
    let (plain, kernel) = (text("").await, text("form=kernel").await);
    assert_eq!(plain, kernel, "kernel is the default");
    let (library, tag) = text("form=library").await;
    assert!(library.contains("fn ball(") && !library.contains("@compute"), "{library}");
    assert!(kernel.0.contains("@compute") && tag != kernel.1);
    let unknown = client.get(&format!("/v1/programs/{id}/module.wgsl?form=whole")).await;
    let detail = unknown.problem(422, "invalid-request")["detail"].as_str().unwrap().to_owned();
    assert!(detail.contains("form `whole`") && detail.contains("kernel, library"), "{detail}");
}

#[tokio::test]
async fn a_manifest_stands_alone() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = client.id(BALL).await;
    for target in Target::ALL {
        for form in Form::ALL {
            let (name, extension, form_name) = (target.name(), target.extension(), form.name());
            let module = client.get(&format!("/v1/programs/{id}/module.{extension}?form={form_name}")).await;
            let answer = client.get(&format!("/v1/programs/{id}/manifest?target={name}&form={form_name}")).await;
            assert_eq!(answer.status, module.status, "{name} {form_name}");
            if answer.status != 200 {
                assert_eq!(form, Form::Library, "{name}: {}", String::from_utf8_lossy(&answer.body));
                continue;
            }
            assert_eq!(answer.headers["content-type"], "application/json");
            assert_eq!(answer.headers["etag"], module.headers["etag"]);
            let manifest: Manifest = serde_json::from_slice(&answer.body).unwrap();
            assert_eq!((manifest.target, manifest.form), (target, form));
            assert_eq!(answer.headers["etag"], format!("\"{}\"", manifest.id));
            assert_eq!(manifest.memory().is_some(), target == Target::Wasm);
            assert_eq!(manifest.buffers().is_some(), target != Target::Wasm && form == Form::Kernel);
        }
    }
    let spirv = client.get(&format!("/v1/programs/{id}/manifest?target=spirv")).await;
    let body: Value = spirv.json();
    let bindings = serde_json::json!({ "set": 0, "inputs": 0, "outputs": 1, "call": 2, "uniforms": 3 });
    assert_eq!((&body["entry"], &body["bindings"]), (&Value::from("main"), &bindings));
    assert!(spirv.body.ends_with(b"}\n") && spirv.body.windows(4).any(|w| w == b"\n  \""), "it is for reading as well");
    let plain: Manifest =
        serde_json::from_slice(&client.get(&format!("/v1/programs/{id}/manifest")).await.body).unwrap();
    assert_eq!(plain.target, Target::Wasm);
}

#[tokio::test]
async fn what_a_target_cannot_do_is_a_problem_with_diagnostics() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = client.id(BALL).await;
    for path in ["module.wgsl?precision=f64", "manifest?target=wgsl&precision=f64"] {
        let problem = client.get(&format!("/v1/programs/{id}/{path}")).await.problem(422, "does-not-compile");
        assert_eq!(problem["diagnostics"][0]["code"], "E1101", "{problem}");
        assert!(problem["detail"].as_str().unwrap().contains("`wgsl`"), "{problem}");
    }
    let library = client.get(&format!("/v1/programs/{id}/module.wasm?form=library")).await;
    assert_eq!(library.problem(422, "invalid-request")["diagnostics"][0]["code"], "E1102");
}

#[tokio::test]
async fn unknown_modules_and_fields_are_answered_with_what_there_is() {
    let directory = TempDir::new();
    let client = Client::over(&directory.0);
    let id = client.id(BALL).await;
    let detail = async |path: &str, status, kind: &str| {
        let problem = client.get(&format!("/v1/programs/{id}/{path}")).await.problem(status, kind);
        problem["detail"].as_str().unwrap().to_owned()
    };
    for name in ["module.spirv", "module.", "module.wasm.json", "module.WASM"] {
        let said = detail(name, 404, "not-found").await;
        for target in Target::ALL {
            assert!(said.contains(&format!("`module.{}` ({})", target.extension(), target.name())), "{said}");
        }
    }
    for name in ["modules", "module", "programs", "manifest.json"] {
        assert!(detail(name, 404, "not-found").await.contains("nothing at"));
    }
    detail("module.%FF", 422, "invalid-request").await;
    let target = detail("module.spv?target=wasm", 422, "invalid-request").await;
    assert!(target.contains("unknown field `target`") && target.contains("`form`"), "{target}");
    let target = detail("manifest?target=spv", 422, "invalid-request").await;
    assert!(target.contains("target `spv`") && target.contains("wasm, spirv, wgsl, glsl, hlsl, msl"), "{target}");
    let field = detail("manifest?device=gpu", 422, "invalid-request").await;
    assert!(field.contains("unknown field `device`") && field.contains("`target`"), "{field}");
    for twice in ["manifest?form=kernel&form=library", "module.wgsl?form=kernel&form=library"] {
        assert!(detail(twice, 422, "invalid-request").await.contains("`form` is given twice"));
    }
    client.post(&format!("/v1/programs/{id}/module.spv"), "").await.problem(405, "method-not-allowed");
}
