//! Loading and the name spaces of program and libraries (LANGUAGE 10), with files in memory.

mod common;

use common::{Memory, check_files, check_text, codes, said};
use isograd_program::{check, load};
use isograd_syntax::Limits;

const MAIN: &str = "export fn f(x: real) -> real { g(x) }";

fn run(entry: &str, files: &[(&str, &str)], libraries: &[&str]) -> (String, String) {
    let (loaded, checked) = check_files(entry, &Memory::new(files, libraries));
    let all: Vec<String> = loaded.diagnostics.iter().chain(&checked.diagnostics).map(said).collect();
    (codes(&loaded, &checked), all.join("\n"))
}

#[test]
fn self_super_and_plain_paths_are_relative_to_the_importing_file() {
    let g = "fn g(x: real) -> real { x }";
    for (path, file) in [
        ("self::a", "a"),
        ("self::a::b", "a/b"),
        ("a", "a"),
        ("a::b", "a/b"),
        ("std", "std"),
        ("self::super::a", "../a"),
        ("self::super::super::a::b", "../../a/b"),
        ("super::a", "../a"),
        ("self::std::a", "std/a"),
        ("std::a::b", "std/a/b"),
    ] {
        let (found, all) = run(&format!("module {path};{MAIN}"), &[(file, g)], &["std"]);
        assert_eq!(found, "", "{path}: {all}");
    }
}

#[test]
fn files_in_directories_import_their_neighbours() {
    let files = [
        ("shapes/all", "module self::ball; module self::deep::ring; module self::super::tools;"),
        ("shapes/ball", "fn ball(x: real) -> real { tool(x) }"),
        ("shapes/deep/ring", "module self::super::ball; fn g(x: real) -> real { ball(x) }"),
        ("tools", "fn tool(x: real) -> real { x }"),
    ];
    let (loaded, checked) = check_files(&format!("module self::shapes::all;{MAIN}"), &Memory::new(&files, &[]));
    assert_eq!(codes(&loaded, &checked), "");
    let names: Vec<&str> = loaded.files.iter().map(|(_, f)| f.name.as_str()).collect();
    assert_eq!(names, ["main.vola", "shapes/all.vola", "shapes/ball.vola", "shapes/deep/ring.vola", "tools.vola"]);
}

#[test]
fn file_names_are_shown_as_seen_from_the_host() {
    let loader = Memory::new(&[("../a", ""), ("../../b", ""), ("c", ""), ("std/d", "")], &["std"]);
    let entry = "module self::super::a; module self::super::super::b; module self::c; module std::d;";
    let loaded = load("dir/main.vola", entry.as_bytes().to_vec(), &loader, &Limits::default());
    let names: Vec<&str> = loaded.files.iter().map(|(_, f)| f.name.as_str()).collect();
    assert_eq!(names, ["dir/main.vola", "a.vola", "../b.vola", "dir/c.vola", "std/d.vola"]);
}

#[test]
fn cycles_load_each_file_once() {
    let files = [
        ("a", "module self::main; module self::b; fn g(x: real) -> real { h(x) }"),
        ("b", "module self::a; fn h(x: real) -> real { x }"),
    ];
    let (loaded, checked) =
        check_files(&format!("module self::a; module self::main;{MAIN}"), &Memory::new(&files, &[]));
    assert_eq!(codes(&loaded, &checked), "");
    assert_eq!(loaded.modules.len(), 3);
    assert_eq!(loaded.modules[0].imports, [1, 0]);
}

#[test]
fn std_and_stdlib_are_one_library() {
    let files = [("std/a", "module self::c; fn g(x: real) -> real { x }"), ("std/c", "module stdlib::a;")];
    let (loaded, checked) =
        check_files(&format!("module std::a; module stdlib::a; {MAIN}"), &Memory::new(&files, &["std", "stdlib"]));
    assert_eq!(codes(&loaded, &checked), "");
    assert_eq!(loaded.modules.len(), 3);
}

#[test]
fn missing_files_and_libraries_say_what_was_tried() {
    let cases: &[(&str, &str, &[&str])] = &[
        ("module self::nothing;", "E0307", &["`nothing.vola` not found", "tried nothing", "registered libraries: std"]),
        ("module std::nothing;", "E0307", &["`std/nothing.vola`"]),
        ("module std;", "E0307", &["`module std::prelude;`"]),
        ("module stdd::sphere;", "E0306", &["no library `stdd`", "`stdd/sphere.vola`", "registered libraries: std"]),
        ("module self;", "E0308", &["a directory, not a file"]),
        ("module self::super;", "E0308", &[]),
        ("module self::a::super::b;", "E0308", &["at the start"]),
        ("module self::a::self::b;", "E0308", &[]),
        ("module std::super::a;", "E0308", &["may not follow a library"]),
    ];
    for (source, expected, phrases) in cases {
        let (found, all) = run(source, &[], &["std"]);
        assert_eq!(found, *expected, "{source}: {all}");
        for phrase in *phrases {
            assert!(all.contains(phrase), "{source}: `{phrase}` not in {all}");
        }
    }
}

#[test]
fn leaving_a_library_or_the_allowed_directory_is_an_error() {
    let (found, all) = run("module std::a;", &[("std/a", "module self::super::b;")], &["std"]);
    assert_eq!(found, "E0308", "{all}");
    let mut loader = Memory::new(&[("../a", "")], &[]);
    loader.confined = true;
    let (loaded, checked) = check_files("module self::super::a;", &loader);
    assert_eq!(codes(&loaded, &checked), "E0308");
}

#[test]
fn bytes_that_are_no_text_are_located() {
    let mut loader = Memory::default();
    loader.files.insert("a".to_owned(), b"\xEF\xBB\xBFfn g\n\xFFx".to_vec());
    loader.files.insert("b".to_owned(), b"\xEF\xBB\xBFfn g(x: real) -> real { x }".to_vec());
    let (loaded, _) = check_files("module self::a;", &loader);
    let diagnostic = &loaded.diagnostics[0];
    assert!(said(diagnostic).contains("byte 8"), "{}", said(diagnostic));
    let span = diagnostic.labels[0].span;
    assert_eq!(loaded.files.position(span.file, span.start), (2, 1));
    let (loaded, checked) = check_files(&format!("module self::b;{MAIN}"), &loader);
    assert_eq!(codes(&loaded, &checked), "");
}

#[test]
fn limits_on_sources_are_errors() {
    let big = format!("// {}\n", "x".repeat(100));
    let loader = Memory::new(&[("a", &big), ("b", &big), ("c", "")], &[]);
    let entry = "module self::a; module self::b; module self::c;";
    let with = |limits: Limits| {
        let loaded = load("main.vola", entry.as_bytes().to_vec(), &loader, &limits);
        loaded.diagnostics.iter().map(|d| d.code.name()).collect::<Vec<_>>().join(" ")
    };
    assert_eq!(with(Limits::default()), "");
    assert_eq!(with(Limits { source_bytes: 80, ..Limits::default() }), "E1001 E1001");
    assert_eq!(with(Limits { total_source_bytes: 200, ..Limits::default() }), "E1002");
    assert_eq!(with(Limits { modules: 3, ..Limits::default() }), "E1003");
    assert_eq!(with(Limits { modules: 4, ..Limits::default() }), "");
    assert_eq!(with(Limits { source_bytes: 10, ..Limits::default() }), "E1001", "the entry file itself");
}

#[test]
fn programs_see_their_libraries_and_libraries_never_the_program() {
    let library = [("lib/a", "fn g(x: real) -> real { own(x) }")];
    let entry = format!("module lib::a; fn own(x: real) -> real {{ x }} {MAIN}");
    let (found, all) = run(&entry, &library, &["lib"]);
    assert_eq!(found, "E0301", "{all}");
    let library =
        [("lib/a", "module self::b; fn g(x: real) -> real { own(x) }"), ("lib/b", "fn own(x: real) -> real { x }")];
    assert_eq!(run(&format!("module lib::a; {MAIN}"), &library, &["lib"]).0, "");
}

#[test]
fn declarations_of_the_program_hide_those_of_libraries() {
    let library = [("lib/a", "entity E(a: real); fn g(x: real) -> real { x } fn k(x: real) -> real { g(x) }")];
    let entry = "module lib::a; entity E(); fn g(x: int) -> real { 1.0 }
        export fn f(x: real) -> real { csg e = E(); k(x) + g(1) }";
    let (found, all) = run(entry, &library, &["lib"]);
    assert_eq!(found, "W0301 W0301", "{all}");
    assert!(all.contains("library `lib`"));
}

#[test]
fn names_of_two_libraries_are_an_error_where_used() {
    let files = [("one/a", "fn g(x: real) -> real { x }"), ("two/a", "fn g(x: real) -> real { x }")];
    let imports = "module one::a; module two::a;";
    assert_eq!(run(&format!("{imports} fn f(x: real) -> real {{ x }}"), &files, &["one", "two"]).0, "");
    let (found, all) = run(&format!("{imports} {MAIN}"), &files, &["one", "two"]);
    assert_eq!(found, "E0304");
    assert!(all.contains("one, two"), "{all}");
    for declared in ["declared by `one`", "declared by `two`"] {
        assert!(all.contains(declared), "{declared}: {all}");
    }
}

#[test]
fn concepts_of_the_program_are_those_of_the_library() {
    let library = [("lib/a", "concept C: real -> real; operation Id(); entity Leaf(); impl Leaf for C(x) { x }")];
    let same = "module lib::a; concept C: real -> real;
        export fn f(x: real) -> real { csg l = Leaf(); eval l.C(x) }
        impl Id<s> for C(x) { eval s.C(x) }";
    let (loaded, checked) = check_files(same, &Memory::new(&library, &["lib"]));
    assert_eq!(codes(&loaded, &checked), "W0301");
    let concepts: Vec<u32> = checked.program.impls.iter().map(|i| i.concept.0).collect();
    assert_eq!(concepts[0], concepts[1]);
    let (found, all) = run("module lib::a; concept C: real -> vec2;", &library, &["lib"]);
    assert_eq!(found, "E0305");
    assert!(all.contains("real -> vec2") && all.contains("real -> real"), "{all}");
}

#[test]
fn exports_of_libraries_are_functions() {
    let library = [("lib/a", "export fn g(x: real) -> real { x } export fn make() -> csg { Leaf() } entity Leaf();")];
    let (loaded, checked) = check_files(&format!("module lib::a; {MAIN}"), &Memory::new(&library, &["lib"]));
    assert_eq!(codes(&loaded, &checked), "");
    let names: Vec<&str> =
        checked.program.exports.iter().map(|f| checked.program.functions[f.0 as usize].name.as_str()).collect();
    assert_eq!(names, ["f"]);
}

#[test]
fn second_declarations_in_other_files_show_both_places() {
    let (loaded, checked) = check_files(
        &format!("module self::a; {MAIN} fn g(x: real) -> real {{ x }}"),
        &Memory::new(&[("a", "fn g(x: real) -> real { x }")], &[]),
    );
    assert_eq!(codes(&loaded, &checked), "E0302");
    let files: Vec<u32> = checked.diagnostics[0].labels.iter().map(|l| l.span.file.0).collect();
    assert_eq!(files, [1, 0]);
}

#[test]
fn an_empty_program_is_fine() {
    let (loaded, checked) = check_text("");
    assert_eq!(codes(&loaded, &checked), "");
    assert!(checked.program.exports.is_empty());
    assert_eq!(check(&loaded, &Limits::default()), checked);
}
