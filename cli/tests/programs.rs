//! `isograd check` and `isograd compile`: bad programs, exit codes, modules, steps, libraries.

mod common;

use common::Dir;

const BALL: &str = "export fn ball(at: vec3, radius: real) -> real { length(at) - radius }\n";

#[test]
fn a_sound_program_passes_without_a_word() {
    assert_eq!(Dir::with(BALL).run(&["check", "main.vola"]).ok(), "");
    assert_eq!(Dir::with(BALL).run(&["check", "main.vola", "--format", "json"]).ok(), "[]\n");
}

#[test]
fn bad_programs_are_coded_diagnostics_with_a_place() {
    let items = "concept D: real -> real; entity Line(); operation P(); operation Q();\n";
    let cycle =
        "impl P<s> for D(x) { csg t = Q(){ s }; eval t.D(x) } impl Q<s> for D(x) { csg t = P(){ s }; eval t.D(x) }\n";
    let deep = format!("export fn f(x: real) -> real {{ {}x{} }}", "(".repeat(100_000), ")".repeat(100_000));
    let long = format!("{BALL}// {}", "x".repeat(10_000_000));
    let cases = [
        ("export fn f(x: real -> real { x }", "E02"),
        ("export fn f(x: real) -> real { y }", "E0301"),
        ("export fn f(x: real) -> real { x + 1 }", "E0401"),
        ("fn a(x: real) -> real { b(x) } fn b(x: real) -> real { a(x) } export fn f(x: real) -> real { x }", "E0506"),
        ("module self::missing;\nexport fn f(x: real) -> real { x }", "E0307"),
        (&format!("{items}export fn f(x: real) -> real {{ csg e = Line(); eval e.D(x) }}"), "E0605"),
        (&format!("{items}{cycle}export fn f(x: real) -> real {{ csg e = P(){{ Line() }}; eval e.D(x) }}"), "E0607"),
        (&deep, "E1004"),
        (&long, "E1001"),
    ];
    for (text, code) in cases {
        let dir = Dir::with(text);
        let began = std::time::Instant::now();
        dir.run(&["check", "main.vola"]).fails_with(1, &[&format!("error[{code}"), "main.vola"]);
        let json = dir.run(&["check", "main.vola", "--format", "json"]);
        assert_eq!((json.code, json.err.as_str()), (Some(1), ""), "{json:?}");
        let found: serde_json::Value = serde_json::from_str(&json.out).unwrap();
        assert!(found[0]["code"].as_str().unwrap().starts_with(code), "{found}");
        dir.run(&["compile", "main.vola"]).fails_with(1, &[&format!("error[{code}")]);
        dir.run(&["eval", "main.vola", "--args", "1"]).fails_with(1, &[&format!("error[{code}")]);
        assert!(began.elapsed().as_secs() < 20, "{code}: {:?}", began.elapsed());
    }
}

#[test]
fn what_is_no_text_and_what_is_no_file() {
    let dir = Dir::new();
    std::fs::write(dir.0.join("main.vola"), b"export fn f\xFF").unwrap();
    dir.run(&["check", "main.vola"]).fails_with(1, &["E0101"]);
    dir.run(&["check", "other.vola"]).fails_with(1, &["cannot read `other.vola`"]);
    dir.run(&["check", "."]).fails_with(1, &["cannot read `.`"]);
}

/// Two warnings and no error.
const WARNED: &str = "\
module self::part;
export fn f(x: real) -> real { x; part(x) }
";

/// One warning, in a file that both programs import.
const PART: &str = "fn part(x: real) -> real { x::<real> }\n";

#[test]
fn several_programs_are_checked_in_one_run() {
    let dir = Dir::with(WARNED);
    dir.write("part.vola", PART);
    dir.write("other.vola", &WARNED.replace("x; part(x)", "part(y)"));
    let json = |args: &[&str]| {
        let ran = dir.run(&[&["check", "--format", "json"], args].concat());
        let found: serde_json::Value = serde_json::from_str(&ran.out).unwrap();
        let shown = |d: &serde_json::Value| format!("{} {}", d["code"], d["labels"][0]["file"]).replace('"', "");
        (ran.code, found.as_array().unwrap().iter().map(shown).collect::<Vec<_>>())
    };
    let (code, both) = json(&["main.vola", "other.vola"]);
    assert_eq!((code, both.len()), (Some(1), 3), "{both:?}");
    for one in ["W0501 main.vola", "W0401 ./part.vola", "E0301 other.vola"] {
        assert!(both.iter().any(|d| d.replace("./", "") == one.replace("./", "")), "{one} is missing in {both:?}");
    }
    let (code, again) = json(&["main.vola", "main.vola"]);
    assert_eq!((code, again.len()), (Some(0), 2), "what two programs share is said once: {again:?}");
    let unreadable = dir.run(&["check", "none.vola", "other.vola"]);
    unreadable.fails_with(1, &["cannot read `none.vola`", "error[E0301]"]);
}

#[test]
fn mistakes_of_all_phases_are_told_in_one_run() {
    let dir = Dir::with(
        "concept D: real -> real; entity Line();
        fn a(x: real) -> real { x + }
        fn b(x: real) -> real { x + 1 }
        export fn c(x: real) -> real { csg line = Line(); eval line.D(x) }\n",
    );
    let all = ["error[E0201]", "error[E0401]", "error[E0605]"];
    for command in [&["check", "main.vola"][..], &["compile", "main.vola"], &["eval", "main.vola", "--args", "1"]] {
        dir.run(command).fails_with(1, &all);
    }
}

#[test]
fn diagnostics_are_written_for_other_tools() {
    let dir = Dir::with("export fn größe(x: real) -> real { y + 1.0 }\n");
    let github = dir.run(&["check", "main.vola", "--format", "github"]);
    assert_eq!((github.code, github.err.as_str()), (Some(1), ""));
    let place = "file=main.vola,line=1,col=36,endLine=1,endColumn=37,title=E0301 name not found";
    assert!(github.out.starts_with(&format!("::error {place}::")) && github.out.ends_with('\n'), "{}", github.out);
    let sarif = dir.run(&["check", "main.vola", "--format", "sarif"]);
    assert_eq!((sarif.code, sarif.err.as_str()), (Some(1), ""));
    let log: serde_json::Value = serde_json::from_str(&sarif.out).unwrap();
    let run = &log["runs"][0];
    assert_eq!((&log["version"], &run["tool"]["driver"]["rules"][0]["id"]), (&"2.1.0".into(), &"E0301".into()));
    assert_eq!(run["results"][0]["locations"][0]["physicalLocation"]["region"]["startColumn"], 36);
    let sound = Dir::with(BALL);
    assert_eq!(sound.run(&["check", "main.vola", "--format", "github"]).ok(), "");
    let none: serde_json::Value =
        serde_json::from_str(sound.run(&["check", "main.vola", "--format", "sarif"]).ok()).unwrap();
    assert_eq!(none["runs"][0]["results"], serde_json::json!([]));
    sound.run(&["check", "main.vola", "--format", "xml"]).fails_with(2, &["terminal, json, sarif, github"]);
}

#[test]
fn denied_warnings_fail_every_command() {
    let dir = Dir::with(WARNED);
    dir.write("part.vola", PART);
    let args = ["--args", "1", "--format", "csv"];
    let denied = ["2 warnings", "--deny-warnings", "warning[W0501]", "warning[W0401]"];
    for command in [
        &["check", "main.vola"][..],
        &["compile", "main.vola", "-o", "f.wasm"],
        &[&["eval", "main.vola"], &args[..]].concat(),
    ] {
        assert_eq!(dir.run(command).code, Some(0));
        let _ = std::fs::remove_file(dir.0.join("f.wasm"));
        dir.run(&[command, &["--deny-warnings"]].concat()).fails_with(1, &denied);
        assert!(!dir.0.join("f.wasm").exists());
    }
    let json = dir.run(&["check", "main.vola", "--format", "json", "--deny-warnings"]);
    assert_eq!((json.code, json.err.contains("2 warnings")), (Some(1), true));
    assert_eq!(Dir::with(BALL).run(&["check", "main.vola", "--deny-warnings"]).ok(), "");
    // What only specialisation finds counts as well.
    let late = Dir::with(
        "module std::sphere;\nmodule std::union;\nmodule std::trans3d;\nexport fn f(x: real) -> real {
            csg row = Sphere(0.3);
            for i in 1..70 { row = Union(){ row }{ Trans3d([i::<real>, 0.0, 0.0]){ Sphere(0.3) } }; }
            eval row.Sdf3d([x, 0.0, 0.0])
        }\n",
    );
    let found = ["W0602", "1 warning,"];
    late.run(&["check", "main.vola", "--deny-warnings"]).fails_with(1, &found);
    late.run(&["eval", "main.vola", "--args", "1", "--deny-warnings"]).fails_with(1, &found);
    late.run(&["compile", "main.vola", "-o", "f.wasm", "--deny-warnings"]).fails_with(1, &found);
    assert!(!late.0.join("f.wasm").exists());
}

#[test]
fn limits_are_set_by_flag() {
    let dir = Dir::with("export fn f(x: real) -> real { ((((x)))) }\n");
    let limit = ["--limit", "nesting=3"];
    for command in
        [&["check", "main.vola"][..], &["compile", "main.vola", "-o", "f.wasm"], &["eval", "main.vola", "--args", "1"]]
    {
        assert_eq!(dir.run(command).code, Some(0));
        dir.run(&[command, &limit[..]].concat()).fails_with(1, &["error[E1004]"]);
        dir.run(&[command, &["--limit", "depth=3"]].concat())
            .fails_with(2, &["`--limit depth=3`", "no limit `depth`", "nesting", "compile_time_ms"]);
    }
    assert_eq!(dir.run(&["check", "main.vola", "--limit", "source_bytes=1_000", "--limit", "nesting=9"]).ok(), "");
    dir.run(&["check", "main.vola", "--limit", "points=3"]).fails_with(2, &["no limit `points`"]);
    for bad in ["nesting", "nesting=", "nesting=-1", "nesting=1.5", "=3"] {
        dir.run(&["check", "main.vola", "--limit", bad]).fails(2);
    }
}

#[test]
fn a_missing_module_shows_what_was_tried() {
    let dir = Dir::with("module self::shapes::ball;\nexport fn f(x: real) -> real { x }\n");
    dir.run(&["check", "main.vola"]).fails_with(1, &["E0307", "tried `./shapes/ball.vola`"]);
}

#[test]
fn modules_are_found_beside_above_and_in_libraries() {
    let dir = Dir::new();
    dir.write("app/main.vola", "module self::part;\nmodule self::super::common;\nmodule self::super::app::part;\nmodule ext::deep::ball;\nexport fn f(x: real) -> real { part(x) + common(x) + ball(x) }\n");
    dir.write("app/part.vola", "fn part(x: real) -> real { x }\n");
    dir.write("common.vola", "fn common(x: real) -> real { 10.0 * x }\n");
    dir.write("lib/deep/ball.vola", "fn ball(x: real) -> real { 100.0 * x }\n");
    let ran = dir.run(&["eval", "app/main.vola", "--library", "ext=lib", "--args", "1", "--format", "csv"]);
    assert_eq!(ran.ok(), "value\n111.0\n");
    dir.run(&["check", "app/main.vola"]).fails_with(1, &["E0306", "ext"]);
    dir.run(&["check", "app/main.vola", "--library", "ext=lib", "--library", "ext=lib"]).fails(2);
}

/// A file that is reached by two paths is one file (LANGUAGE 10.3).
#[cfg(unix)]
#[test]
fn a_linked_module_is_loaded_once() {
    let dir = Dir::with("module self::shapes::ball;\nmodule self::link;\nexport fn f(x: real) -> real { ball(x) }\n");
    dir.write("shapes/ball.vola", "fn ball(x: real) -> real { x - 1.0 }\n");
    std::os::unix::fs::symlink("shapes/ball.vola", dir.0.join("link.vola")).unwrap();
    dir.run(&["check", "main.vola"]).ok();
}

#[test]
fn compile_writes_a_module_for_every_export() {
    let dir = Dir::with(&format!("{BALL}export fn twice(x: real) -> real {{ x * 2.0 }}\n"));
    let ran = dir.run(&["compile", "main.vola", "--out-dir", "out"]);
    assert_eq!((ran.code, ran.out.as_str()), (Some(0), ""), "{ran:?}");
    assert!(ran.err.contains("out/ball.wasm") && ran.err.contains("operations"), "{ran:?}");
    for name in ["ball", "twice"] {
        assert!(std::fs::read(dir.0.join(format!("out/{name}.wasm"))).unwrap().starts_with(b"\0asm"));
    }
    let one = dir.run(&["compile", "main.vola", "--export", "ball", "--query", "gradient(at)", "-o", "g.wasm"]);
    assert_eq!(one.code, Some(0), "{one:?}");
    assert!(std::fs::read(dir.0.join("g.wasm")).unwrap().starts_with(b"\0asm"));
    dir.run(&["compile", "main.vola", "-o", "x.wasm"]).fails_with(2, &["`ball`, `twice`", "--out-dir"]);
    dir.run(&["compile", "main.vola", "--export", "cube"]).fails_with(1, &["`cube`", "`ball`, `twice`"]);
    dir.run(&["compile", "main.vola", "--query", "gradient(at)"]).fails_with(1, &["`at`", "`twice`"]);
    dir.run(&["compile", "main.vola", "-o", "x", "--out-dir", "y"]).fails(2);
    dir.run(&["compile", "main.vola", "--export", "ball", "-o", "no/such/x.wasm"]).fails_with(1, &["no/such/x.wasm"]);
}

#[test]
fn every_step_can_be_shown() {
    let dir = Dir::with(BALL);
    for step in isograd_compiler::STEPS.iter().chain(&["parse", "tree", "program", "graph", "wat"]) {
        let ran = dir.run(&["compile", "main.vola", "--query", "gradient(at)", "--emit", step]);
        assert!(ran.ok().ends_with('\n') && ran.out.len() > 20, "{step}: {ran:?}");
    }
    dir.run(&["compile", "main.vola", "--emit", "soup"]).fails_with(2, &["soup", "optimise", "graph"]);
    let graph = dir.run(&["compile", "main.vola", "--emit", "graph", "-o", "graph.txt"]);
    assert_eq!(graph.ok(), "");
    assert_eq!(
        std::fs::read_to_string(dir.0.join("graph.txt")).unwrap(),
        dir.run(&["compile", "main.vola", "--emit", "graph"]).out
    );
}

#[test]
fn timings_list_the_steps_in_order() {
    let dir = Dir::with(BALL);
    let ran = dir.run(&["compile", "main.vola", "--timings", "-o", "x.wasm"]);
    assert_eq!(ran.code, Some(0));
    let mut places = isograd_compiler::STEPS.iter().map(|s| ran.err.find(&format!("\n{s} ")));
    let mut last = None;
    assert!(places.all(|p| p.is_some() && std::mem::replace(&mut last, p) < p), "{}", ran.err);
    assert!(ran.err.contains("\ntotal") && ran.err.contains('%'), "{}", ran.err);
    // Nothing was timed.
    let unread = dir.run(&["compile", "nowhere.vola", "--timings"]);
    assert!(!unread.fails(1).contains("total"), "{unread:?}");
}

#[test]
fn timings_say_which_way_derivatives_are_computed() {
    let wide = "export fn f(a: vec4, b: vec4) -> real {
        let s = sqrt(dot(a, b) * dot(a, a) + exp(b.x * a.y));
        let t = sqrt(s * s + sin(s) * exp(s));
        t * t + cos(t) * s
    }\n";
    let dir = Dir::with(&format!("{wide}export fn g(a: real, b: real) -> real {{ a * a * b }}\n"));
    let queries = ["--query", "gradient(a)", "--query", "gradient(b)", "--timings"];
    let way = |args: &[&str]| {
        let ran = dir.run(&[&["compile", "main.vola"], &queries[..], args].concat());
        assert_eq!(ran.code, Some(0), "{ran:?}");
        ran.err.lines().filter(|l| l.starts_with("derivatives")).map(str::to_owned).collect::<Vec<_>>()
    };
    let f = ["--export", "f", "-o", "auto.wasm"];
    let auto = way(&f);
    assert!(auto.len() == 1 && auto[0].starts_with("derivatives: reverse (cost "), "{auto:?}");
    assert!(auto[0].contains("; forward "), "{auto:?}");
    for mode in ["forward", "reverse"] {
        let file = format!("{mode}.wasm");
        let asked = way(&["--export", "f", "-o", &file, "--mode", mode]);
        assert_eq!(asked, [format!("derivatives: {mode} (asked for)")]);
    }
    let bytes = |name: &str| std::fs::read(dir.0.join(name)).unwrap();
    assert!(bytes("forward.wasm") != bytes("reverse.wasm") && bytes("auto.wasm") != bytes("reverse.wasm"));
    let both = way(&["--out-dir", "out"]);
    assert!(
        both.len() == 2 && both[0].starts_with("derivatives of `f`: reverse") && both[1].contains("`g`"),
        "{both:?}"
    );
    let none = dir.run(&["compile", "main.vola", "--export", "g", "-o", "g.wasm", "--timings"]);
    assert!(
        none.err.contains("derivatives: forward (too few values to differentiate by for a reverse sweep to pay)\n"),
        "{none:?}"
    );
    dir.run(&["compile", "main.vola", "--mode", "mixed"]).fails_with(2, &["mixed", "auto, forward, reverse"]);
}
