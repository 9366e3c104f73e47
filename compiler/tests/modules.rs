//! Modules and libraries (LANGUAGE 10) through the whole compiler, with files in memory: what a program of several
//! files means, and what is said of one that has no meaning. Knows nothing of how names are found.

use std::collections::BTreeMap;

use isograd_compiler::{
    Checked, Loader, MemoryLoader, ModulePath, Options, Query, Request, Unwatched, check, compile, inspect,
};

/// A program in a directory beside libraries, each `name/path`.
struct Host {
    program: MemoryLoader,
    libraries: BTreeMap<String, String>,
}

impl Host {
    fn new(base: &str, files: &[(&str, &str)], libraries: &[(&str, &str)]) -> Self {
        let files = files.iter().map(|(path, text)| ((*path).to_owned(), text.as_bytes().to_vec())).collect();
        let libraries = libraries.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())).collect();
        Self { program: MemoryLoader { files, base: base.to_owned() }, libraries }
    }
}

impl Loader for Host {
    fn libraries(&self) -> Vec<String> {
        let mut names: Vec<String> =
            self.libraries.keys().filter_map(|p| Some(p.split_once('/')?.0.to_owned())).collect();
        names.dedup();
        names
    }

    fn resolve(&self, at: ModulePath) -> ModulePath {
        self.program.resolve(at)
    }

    fn allows(&self, at: &ModulePath) -> bool {
        at.library.is_some() || self.program.allows(at)
    }

    fn read(&self, at: &ModulePath) -> Result<Vec<u8>, String> {
        let Some(library) = &at.library else { return self.program.read(at) };
        let path = format!("{library}/{}", at.path.join("/"));
        self.libraries.get(&path).map(|t| t.clone().into_bytes()).ok_or_else(|| format!("no `{path}`"))
    }
}

fn checked(name: &str, entry: &str, host: &Host) -> Checked {
    check(name, entry.as_bytes().to_vec(), host, &Options::default(), &Unwatched)
}

/// The codes of everything that is said of the program, in order; those that compile are compiled.
fn codes(name: &str, entry: &str, host: &Host) -> String {
    let checked = checked(name, entry, host);
    let found = inspect(&checked, &Options::default(), || Unwatched);
    if !found.iter().any(isograd_compiler::Diagnostic::is_error) {
        for export in checked.exports() {
            let request = Request { export: export.name, queries: vec![Query::Value], ..Request::default() };
            compile(&checked, &request, &Options::default(), &Unwatched).unwrap_or_else(|e| panic!("{e:?}"));
        }
    }
    found.iter().map(|d| d.code.name()).collect::<Vec<_>>().join(" ")
}

const F: &str = "export fn f(x: real) -> real { g(x) }";
const G: &str = "fn g(x: real) -> real { x }";

#[test]
fn a_file_reached_by_two_routes_is_loaded_once() {
    let a = "module self::super::d::main; module self::super::d::b; fn g(x: real) -> real { h(x) }";
    let b = "module self::super::e::a; module self::super::d::main; fn h(x: real) -> real { x }";
    let host = Host::new("d", &[("e/a.vola", a), ("d/b.vola", b), ("d/main.vola", "unused")], &[]);
    assert_eq!(codes("d/main.vola", &format!("module self::super::e::a; module self::b; {F}"), &host), "");
    let host = Host::new("p/d", &[("p/d/a.vola", G)], &[]);
    let entry = format!("module a; module self::a; module self::super::d::a; module super::super::p::d::a; {F}");
    assert_eq!(codes("p/d/main.vola", &entry, &host), "");
}

#[test]
fn importing_oneself_or_a_file_twice_changes_nothing() {
    let host = Host::new("", &[("a.vola", "module self::main; module self::a; fn g(x: real) -> real { x }")], &[]);
    assert_eq!(codes("main.vola", &format!("module self::main; module self::a; {F} module a;"), &host), "");
}

#[test]
fn nothing_outside_of_the_program_is_read() {
    for path in ["self::super::a", "super::a", "self::super::super::a", "self::super::d::super::a"] {
        let host = Host::new("", &[("a.vola", G)], &[]);
        assert_eq!(codes("main.vola", &format!("module {path}; {F}"), &host), "E0308", "{path}");
    }
    let host = Host::new("d", &[("a.vola", G)], &[]);
    assert_eq!(codes("d/main.vola", &format!("module self::super::a; {F}"), &host), "");
    assert_eq!(codes("d/main.vola", &format!("module self::super::super::a; {F}"), &host), "E0308");
    assert_eq!(codes("d/main.vola", &format!("module self::super::super::d::a; {F}"), &host), "E0308");
}

#[test]
fn missing_files_and_libraries_say_where_was_looked() {
    let host = Host::new("", &[], &[("lib/a", G)]);
    let said = |entry: &str| {
        let found = checked("main.vola", entry, &host).diagnostics;
        assert_eq!(found.len(), 1, "{found:?}");
        format!("{} {} {:?} {:?}", found[0].code.name(), found[0].message, found[0].notes, found[0].help)
    };
    for (entry, phrases) in [
        ("module self::x::y;", &["E0307", "`x/y.vola`", "lib", "std"][..]),
        ("module lib::b;", &["E0307", "`lib/b.vola`", "lib", "std"]),
        ("module other::b;", &["E0306", "`other`", "`other/b.vola`", "lib", "std"]),
        ("module lib;", &["E0307", "`lib.vola`"]),
        ("module lib::super::a;", &["E0308", "`super`"]),
    ] {
        let text = said(entry);
        assert!(phrases.iter().all(|p| text.contains(p)), "{entry}: {text}");
    }
}

#[test]
fn only_a_library_with_a_path_is_one() {
    let host = Host::new("", &[("lib.vola", G)], &[("lib/g", "fn g(x: real) -> real { missing(x) }")]);
    assert_eq!(codes("main.vola", &format!("module lib; {F}"), &host), "");
    // `self` in front leaves the library out.
    let host = Host::new("", &[("lib/g.vola", G)], &[("lib/g", "fn g(x: real) -> real { missing(x) }")]);
    assert_eq!(codes("main.vola", &format!("module self::lib::g; {F}"), &host), "");
}

#[test]
fn files_of_a_library_find_each_other_and_other_libraries() {
    let libraries = [
        ("one/sub/a", "module self::super::b; module self::c; fn g(x: real) -> real { b(x) + c(x) }"),
        ("one/b", "module two::t; fn b(x: real) -> real { t(x) }"),
        ("one/sub/c", "module b; fn c(x: real) -> real { b(x) }"),
        ("one/sub/b", ""),
        ("two/t", "fn t(x: real) -> real { x }"),
    ];
    let host = Host::new("", &[], &libraries);
    assert_eq!(codes("main.vola", &format!("module one::sub::a; {F}"), &host), "");
    // What a library imports is not in the reach of the program.
    assert_eq!(codes("main.vola", "module one::sub::a; export fn f(x: real) -> real { t(x) }", &host), "E0301");
    assert_eq!(
        codes("main.vola", "module one::sub::a; module two::t; export fn f(x: real) -> real { t(x) }", &host),
        ""
    );
}

#[test]
fn a_library_never_sees_the_program() {
    let host = Host::new(
        "",
        &[],
        &[(
            "lib/a",
            "fn g(x: real) -> real { csg e = E(); eval e.C(x) + h(x) } entity E(); concept C: real -> real; impl E for C(x) { h(x) } fn h(x: real) -> real { sign(x) }",
        )],
    );
    // The program's `sign` and `h` are its own; the library's calls are not theirs.
    let entry =
        format!("module lib::a; fn sign(x: real) -> real {{ missing }} fn h(x: real) -> real {{ x }} entity E(); {F}");
    assert_eq!(codes("main.vola", &entry, &host), "E0301 W0301 W0301");
}

#[test]
fn names_of_two_libraries_are_ambiguous_only_where_they_are_used() {
    let libraries = [
        ("one/a", "entity E(); fn g(x: real) -> real { x } concept C: real -> real; impl E for C(x) { x }"),
        ("two/a", "operation E(k: real); fn g(x: int) -> real { 1.0 } concept C: real -> real;"),
    ];
    let host = Host::new("", &[("b.vola", "module two::a;")], &libraries);
    let imports = "module one::a; module self::b;";
    assert_eq!(codes("main.vola", &format!("{imports} export fn f(x: real) -> real {{ x }}"), &host), "");
    for (body, expected) in [("g(x)", "E0304"), ("csg e = E(); x", "E0304"), ("csg e = F(); eval e.C(x)", "E0304")] {
        let entry = format!("{imports} entity F(); export fn f(x: real) -> real {{ {body} }}");
        assert_eq!(codes("main.vola", &entry, &host), expected, "{body}");
    }
    let entry = format!("{imports} impl E for C(x) {{ x }} export fn f(x: real) -> real {{ x }}");
    assert_eq!(codes("main.vola", &entry, &host), "E0304 E0304");
    // A declaration of the program's own settles it.
    assert_eq!(codes("main.vola", &format!("{imports} fn g(x: real) -> real {{ x }} {F}"), &host), "W0301 W0301");
}

const SHAPES: &str = "concept C: real -> real; entity Leaf(); impl Leaf for C(x) { x } operation Up();";

#[test]
fn a_concept_of_the_program_is_the_librarys() {
    let host = Host::new("", &[], &[("lib/a", SHAPES)]);
    let entry = "module lib::a; concept C: real -> real; impl Up<a> for C(x) { 1.0 + eval a.C(x) }
        export fn f(x: real) -> real { csg l = Up(){ Leaf() }; eval l.C(x) }";
    assert_eq!(codes("main.vola", entry, &host), "W0301");
    let entry = "module lib::a; concept C: real -> real; impl Leaf for C(x) { 2.0 }";
    assert_eq!(codes("main.vola", entry, &host), "W0301 E0610");
}

#[test]
fn a_concept_of_the_program_is_that_of_a_library_which_only_a_library_imports() {
    let libraries =
        [("lib/a", "module base::c; entity Leaf(); impl Leaf for C(x) { x }"), ("base/c", "concept C: real -> real;")];
    let host = Host::new("", &[], &libraries);
    let entry = "module lib::a; concept C: real -> real; export fn f(x: real) -> real { csg l = Leaf(); eval l.C(x) }";
    assert_eq!(codes("main.vola", entry, &host), "W0301");
    // It is not in the program's reach, so another concept of that name is the program's alone.
    let entry = "module lib::a; concept C: real -> int; export fn f(x: real) -> real { x }";
    assert_eq!(codes("main.vola", entry, &host), "");
}

#[test]
fn one_concept_of_the_program_joins_those_of_two_libraries() {
    let libraries = [
        ("one/a", "concept C: real -> real; entity Leaf(); impl Leaf for C(x) { x }"),
        ("two/a", "concept C: real -> real; operation Up(); impl Up<a> for C(x) { 1.0 + eval a.C(x) }"),
    ];
    let host = Host::new("", &[], &libraries);
    let entry = "module one::a; module two::a; concept C: real -> real;
        export fn f(x: real) -> real { csg l = Up(){ Leaf() }; eval l.C(x) }";
    assert_eq!(codes("main.vola", entry, &host), "W0301 W0301");
}

#[test]
fn nothing_follows_from_a_concept_that_differs_from_the_librarys() {
    let library = format!("{SHAPES} fn g(x: real) -> real {{ csg l = Leaf(); eval l.C(x) }}");
    let host = Host::new("", &[], &[("lib/a", &library)]);
    let entry = "module lib::a;
        concept C: vec2 -> real;
        entity Mine();
        impl Mine for C(p) { p.x }
        impl Up<a> for C(p) { eval a.C(p) }
        export fn own(p: vec2) -> real { csg m = Up(){ Mine() }; eval m.C(p) }
        export fn theirs(x: real) -> real { csg l = Leaf(); eval l.C(x) }
        export fn through(x: real) -> real { g(x) }
        export fn wrong(x: real) -> real { x + 1 }";
    assert_eq!(codes("main.vola", entry, &host), "E0305 E0401");
    let said = &checked("main.vola", entry, &host).diagnostics[0];
    let labels: Vec<&str> = said.labels.iter().map(|l| l.text.as_str()).collect();
    assert_eq!(labels, ["here it is `vec2 -> real`", "there it is `real -> real`"]);
}

#[test]
fn exports_of_a_library_are_ordinary_functions() {
    let host = Host::new("", &[], &[("lib/a", "export fn g(x: real) -> real { x } export old(x: s) { g(x) }")]);
    let entry = "module lib::a; export fn f(x: real) -> real { g(x) + old(x) }";
    assert_eq!(codes("main.vola", entry, &host), "");
    let names: Vec<String> = checked("main.vola", entry, &host).exports().into_iter().map(|e| e.name).collect();
    assert_eq!(names, ["f"]);
    // Those of other files of the program are the program's.
    let host = Host::new("", &[("a.vola", "export fn g(x: real) -> real { x }")], &[]);
    let names: Vec<String> =
        checked("main.vola", &format!("module a; {F}"), &host).exports().into_iter().map(|e| e.name).collect();
    assert_eq!(names, ["f", "g"]);
}

#[test]
fn a_host_may_replace_the_standard_library_under_both_its_names() {
    let host = Host::new("", &[], &[("std/sphere", G)]);
    assert_eq!(codes("main.vola", &format!("module std::sphere; {F}"), &host), "");
    assert_eq!(codes("main.vola", &format!("module stdlib::sphere; {F}"), &host), "");
}

#[test]
fn errors_in_imported_files_are_found_together() {
    let files =
        [("a.vola", "fn a(x: real) -> real { x + 1 }"), ("b.vola", "fn b(x: real) -> real { y }"), ("c.vola", "fn c(")];
    let host = Host::new("", &files, &[]);
    let entry = "module a; module b; module c; module d; export fn f(x: real) -> real { z(x) }";
    // `z` may be declared in the files that could not be read; `y` is a variable.
    assert_eq!(codes("main.vola", entry, &host), "E0307 E0401 E0301 E0202");
    let entry = "module a; module b; export fn f(x: real) -> real { z(x) }";
    assert_eq!(codes("main.vola", entry, &host), "E0301 E0401 E0301");
}
