//! Targets and forms: what a manifest says of each, what becomes of an id, and that what a target cannot do is said at the
//! construct that needs it. What modules compute is tested where they run.

use std::collections::BTreeSet;

use isograd_compiler::{
    Abi, Artefact, Checked, Code, DerivativeMode, Diagnostic, Form, Manifest, MemoryLoader, Options, Precision,
    Request, Target, Unwatched, check, compile,
};

const BALL: &str = "export fn ball(at: vec3, radius: real = 1.0) -> real { length(at) - radius }";
/// 2,000 iterations keep 8,000 bytes in f32 for the walk back.
const LOOP: &str = "export fn ball(at: vec3, k: real) -> real {
    let x = at.x;
    for i in 0..2000 { x = sin(x * k) + at.y; }
    x
}";

fn checked(source: &str) -> Checked {
    let checked = check("main.vola", source.into(), &MemoryLoader::default(), &Options::default(), &Unwatched);
    assert!(checked.is_ok(), "{:?}", checked.diagnostics);
    checked
}

fn request(target: Target, form: Form) -> Request {
    let queries = ["value", "gradient(*)"].map(|q| q.parse().expect("a query")).to_vec();
    Request { export: "ball".into(), queries, target, form, ..Request::default() }
}

fn compiled(source: &str, request: &Request) -> Result<Artefact, Vec<Diagnostic>> {
    compile(&checked(source), request, &Options { verify: true, ..Options::default() }, &Unwatched)
}

fn refused(source: &str, request: &Request) -> Diagnostic {
    let [diagnostic] = compiled(source, request).expect_err("refused").try_into().expect("one diagnostic");
    diagnostic
}

#[test]
fn each_target_and_form_has_its_own_id_and_the_abi_that_fits() {
    let mut ids = BTreeSet::new();
    for target in Target::ALL {
        for form in Form::ALL {
            if (target, form) == (Target::Wasm, Form::Library) {
                assert_eq!(refused(BALL, &request(target, form)).code, Code::E1102);
                continue;
            }
            let Artefact { manifest, bytes, .. } = compiled(BALL, &request(target, form)).expect("compiles");
            assert!(ids.insert(manifest.id.clone()), "{} {}", target.name(), form.name());
            assert_eq!((manifest.target, manifest.form), (target, form));
            assert_eq!(std::str::from_utf8(&bytes).is_ok(), !target.is_binary(), "{}", target.name());
            match (&manifest.abi, target, form) {
                (Abi::Memory(_), Target::Wasm, _) => {}
                (Abi::Buffers(buffers), _, Form::Kernel) => {
                    assert_eq!((buffers.element, buffers.workgroup, buffers.entry.as_str()), (4, 64, "main"));
                    assert_eq!((buffers.bindings.inputs, buffers.bindings.uniforms), (Some(0), Some(3)));
                    // Columns count within their binding: radius is the first uniform one.
                    let offsets: Vec<u32> =
                        manifest.inputs.iter().flat_map(|p| p.columns.iter().map(|c| c.offset)).collect();
                    assert_eq!(offsets, [0, 1, 2, 0]);
                }
                (Abi::Function(function), _, Form::Library) => assert_eq!(function.function, "ball"),
                (abi, ..) => panic!("{} {}: {abi:?}", target.name(), form.name()),
            }
            let json = serde_json::to_string(&manifest).expect("JSON");
            assert_eq!(serde_json::from_str::<Manifest>(&json).expect("reads back"), manifest, "{json}");
        }
    }
}

#[test]
fn bindings_without_content_are_absent() {
    let manifest = compiled("export fn ball(at: vec3) -> real { at.x }", &request(Target::Spirv, Form::Kernel))
        .expect("compiles")
        .manifest;
    let bindings = manifest.buffers().expect("buffers").bindings;
    assert_eq!((bindings.inputs, bindings.uniforms), (Some(0), None));
}

#[test]
fn a_tape_over_the_limit_is_refused_at_its_loop() {
    for target in [Target::Spirv, Target::Wgsl] {
        let wanted = Request { mode: DerivativeMode::Reverse, ..request(target, Form::Kernel) };
        let diagnostic = refused(LOOP, &wanted);
        assert_eq!(diagnostic.code, Code::E1101);
        let text = &diagnostic.message;
        assert!(text.contains(target.name()) && text.contains("4096") && text.contains("8000"), "{text}");
        let span = diagnostic.labels.first().expect("a place").span;
        assert!(LOOP[span.start as usize..].starts_with("for i in 0..2000"), "{:?}", diagnostic.labels);
        compiled(LOOP, &Request { mode: DerivativeMode::Forward, ..wanted }).expect("nothing is kept");
    }
    let wasm = Request { mode: DerivativeMode::Reverse, ..request(Target::Wasm, Form::Kernel) };
    compiled(LOOP, &wasm).expect("fits into memory");
}

#[test]
fn doubles_are_of_wasm_and_spirv_only() {
    for target in Target::ALL {
        let wanted = Request { precision: Precision::F64, ..request(target, Form::Kernel) };
        match target {
            Target::Wasm | Target::Spirv => _ = compiled(BALL, &wanted).expect("compiles"),
            _ => {
                let diagnostic = refused(BALL, &wanted);
                assert_eq!(diagnostic.code, Code::E1101);
                assert!(diagnostic.message.contains(target.name()), "{}", diagnostic.message);
            }
        }
    }
}

#[test]
fn a_function_takes_255_parameters() {
    let source = |count: usize| {
        let parameters: Vec<String> = (0..count).map(|i| format!("p{i}: real")).collect();
        format!("export fn ball({}) -> real {{ p0 + p{} }}", parameters.join(", "), count - 1)
    };
    for target in [Target::Spirv, Target::Wgsl] {
        let wanted = |form| Request { queries: vec!["value".parse().expect("a query")], ..request(target, form) };
        compiled(&source(255), &wanted(Form::Library)).expect("255 are allowed");
        let diagnostic = refused(&source(256), &wanted(Form::Library));
        assert_eq!(diagnostic.code, Code::E1101);
        assert!(diagnostic.message.contains("256"), "{}", diagnostic.message);
        compiled(&source(256), &wanted(Form::Kernel)).expect("a kernel has buffers");
    }
}
