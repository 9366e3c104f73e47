//! Defaults and ranges of parameters, from source to API description and manifest (LANGUAGE 9.3).

use isograd_compiler::{Checked, Manifest, MemoryLoader, Number, Options, Request, Unwatched, check, compile};

const PART: &str = "
export fn part(p: vec3 in [-2.0 .. 2.0],
               radius: real = 1.0 in [0.1 .. INF],
               count: vec2<int> in [1 .. 16],
               hollow: bool = true) -> real {
    (length(p) - radius) * hollow::<real> + (count.x * count.y)::<real>
}";

fn checked(source: &str) -> Checked {
    check("main.vola", source.into(), &MemoryLoader::default(), &Options::default(), &Unwatched)
}

fn compiled(source: &str) -> (Manifest, Vec<u8>) {
    let request = Request { export: "part".into(), queries: vec!["value".parse().unwrap()], ..Request::default() };
    let artefact = compile(&checked(source), &request, &Options::default(), &Unwatched).unwrap();
    (artefact.manifest, artefact.bytes)
}

#[test]
fn exports_show_the_metadata_of_their_parameters() {
    let program = checked(PART);
    assert!(program.is_ok(), "{:?}", program.diagnostics);
    let parameters = &program.exports()[0].parameters;
    let all: Vec<_> = parameters.iter().map(|p| (p.default.clone(), p.range.clone())).collect();
    assert_eq!(
        all,
        [
            (None, Some((vec![-2.0; 3], vec![2.0; 3]))),
            (Some(vec![1.0]), Some((vec![0.1], vec![f64::INFINITY]))),
            (None, Some((vec![1.0; 2], vec![16.0; 2]))),
            (Some(vec![1.0]), None),
        ]
    );
}

#[test]
fn the_manifest_has_it_column_by_column() {
    let (manifest, _) = compiled(PART);
    let columns: Vec<_> = manifest.inputs.iter().flat_map(|i| &i.columns).collect();
    let shown: Vec<_> = columns.iter().map(|c| (c.name.as_str(), c.default, c.range)).collect();
    let (n, box_) = (Number, Some([Number(-2.0), Number(2.0)]));
    assert_eq!(
        shown,
        [
            ("p.x", None, box_),
            ("p.y", None, box_),
            ("p.z", None, box_),
            ("radius", Some(n(1.0)), Some([n(0.1), n(f64::INFINITY)])),
            ("count.x", None, Some([n(1.0), n(16.0)])),
            ("count.y", None, Some([n(1.0), n(16.0)])),
            ("hollow", Some(n(1.0)), None),
        ]
    );
    let text = serde_json::to_string(&manifest).unwrap();
    assert!(text.contains("\"range\":[0.1,\"inf\"]"), "{text}");
    assert_eq!(serde_json::from_str::<Manifest>(&text).unwrap(), manifest, "infinities survive JSON");
    assert!(manifest.outputs.iter().flat_map(|o| &o.columns).all(|c| c.default.is_none() && c.range.is_none()));
}

/// Metadata changes the program's id and the manifest, and no value.
#[test]
fn the_code_does_not_depend_on_it() {
    let plain = PART.replace(" in [-2.0 .. 2.0]", "").replace(" = 1.0 in [0.1 .. INF]", "");
    let (with, without) = (compiled(PART), compiled(&plain));
    assert_ne!(with.0.id, without.0.id);
    assert_ne!(with.1, without.1);
    let code = |bytes: &[u8]| {
        let text = wasmprinter::print_bytes(bytes).unwrap();
        text.lines().filter(|l| !l.contains("@custom")).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(code(&with.1), code(&without.1));
}

#[test]
fn what_does_not_fit_is_found_by_check() {
    let program = checked("export fn f(r: real = 5.0 in [0.5 .. 3.0], n: int in [3 .. 1]) -> real { r }");
    assert!(!program.is_ok());
    let codes: Vec<_> = program.diagnostics.iter().map(|d| d.code.name()).collect();
    assert_eq!(codes, ["E0903", "E0903"]);
}
