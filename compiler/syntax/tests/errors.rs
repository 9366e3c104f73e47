//! Every code of the front end with its place, recovery without follow-up errors, and the renderers.

use isograd_syntax::{Code, Diagnostic, Diagnostics, FileId, Files, Limits, Span, parse, render};

/// The codes reported for `text`, with the text of the primary place.
fn errors(text: &str) -> Vec<(Code, &str)> {
    let parsed = parse(FileId(0), text, &Limits::default());
    let place = |d: &Diagnostic| &text[d.labels[0].span.start as usize..d.labels[0].span.end as usize];
    parsed.diagnostics.iter().map(|d| (d.code, place(d))).collect()
}

#[track_caller]
fn body(body: &str, expected: &[(Code, &str)]) {
    assert_eq!(errors(&format!("fn f(x: real) -> real {{ {body} }}")), expected, "{body}");
}

#[test]
fn tokens() {
    body("x @# y", &[(Code::E0102, "@")]);
    body("let a = \"no strings; here\"; a", &[(Code::E0102, "\"no strings; here\"")]);
    body("x & y", &[(Code::E0102, "&")]);
    body("1. + .5 + 3x + 1e", &[(Code::E0103, "1."), (Code::E0103, ".5"), (Code::E0103, "3x"), (Code::E0103, "1e")]);
    body("x::<int>=3", &[(Code::E0201, "=")]);
    body("2147483648", &[(Code::E0104, "2147483648")]);
    body("[x; 2147483648]", &[(Code::E0104, "2147483648")]);
}

#[test]
fn unexpected_tokens() {
    body("let a = ; a", &[(Code::E0201, ";")]);
    body("a + * b", &[(Code::E0201, "*")]);
    body("if c { a } else { b } + 1", &[(Code::E0201, "+")]);
    body("let a: real = 1.0; a", &[(Code::E0201, ":")]);
    body("a += 1.0; a", &[(Code::E0201, "=")]);
    body("return x;", &[(Code::E0201, "x")]);
    body("f(a b, c)", &[(Code::E0201, "b")]);
    body("for i of 0..3 { let = 2; } x", &[(Code::E0201, "of"), (Code::E0201, "=")]);
    body("if a = b { c + } else { d }", &[(Code::E0201, "="), (Code::E0201, "}")]);
    body("{ let a = 1.0; { } } x", &[(Code::E0201, "{")]);
    body("x; else { y }", &[(Code::E0201, "else")]);
    assert_eq!(errors("fn f(x: real) { x }"), [(Code::E0201, "{")]);
    assert_eq!(errors("fn f(x, y: real) -> real { x + }"), [(Code::E0201, ","), (Code::E0201, "}")]);
    assert_eq!(errors("concept C vec3 -> real; entity E()"), [(Code::E0201, "vec3"), (Code::E0201, "")]);
    assert_eq!(errors("let x = 1; y z } fn f() -> real { 1. }"), [(Code::E0201, "let"), (Code::E0103, "1.")]);
    assert_eq!(errors("#[a(1)]"), [(Code::E0201, "")]);
    assert_eq!(errors("fn f() -> real { 1.0 } }"), [(Code::E0201, "}")]);
    assert_eq!(errors("export 3(a: real) { a }"), [(Code::E0201, "3")]);
}

#[test]
fn unclosed_brackets_show_where_they_opened() {
    for (text, found, opened) in [
        ("fn f() -> real { x", "", "{"),
        ("fn f() -> real { (x", "", "("),
        ("fn f() -> real { (x; }", ";", "("),
        ("fn f() -> real { let a = [x, y; let b = a; }", ";", "["),
        ("fn f() -> real { g(x] + 1 }", "]", "("),
        ("fn f() -> real { [g(x] }", "]", "("),
        ("fn f() -> real { if g(x { y } z }", "{", "("),
        ("fn f() -> real { let a = 1.0; \n fn g() -> real { 1.0 }", "fn", "{"),
        ("entity A(a: real; entity B();", ";", "("),
    ] {
        let parsed = parse(FileId(0), text, &Limits::default());
        let [d] = parsed.diagnostics.as_slice() else { panic!("{text}: {:?}", parsed.diagnostics) };
        let at = |k: usize| &text[d.labels[k].span.start as usize..d.labels[k].span.end as usize];
        assert_eq!((d.code, at(0), at(1)), (Code::E0202, found, opened), "{text}");
    }
}

#[test]
fn special_syntax_errors() {
    body("[3.0 + 4.0; 10.0].x", &[(Code::E0203, "10.0")]);
    body("[x; n + 1, 2] + [x; -1]", &[(Code::E0203, "n + 1, 2"), (Code::E0203, "-1")]);
    body("let in = x; in = 2.0; x.for", &[(Code::E0204, "in"), (Code::E0204, "in"), (Code::E0204, "for")]);
    body("for if in 0..3 { x; } x", &[(Code::E0204, "if")]);
    assert_eq!(errors("fn fn(let: real) -> real { 1.0 }"), [(Code::E0204, "fn"), (Code::E0204, "let")]);
    assert_eq!(errors("entity impl(); operation O();"), [(Code::E0204, "impl")]);
    body("[] + () + (x,)", &[(Code::E0205, "[]"), (Code::E0205, "()"), (Code::E0205, "(x,)")]);
    assert_eq!(errors("fn f(x: ()) -> (real) { x }"), [(Code::E0205, "()")]);
    body("eval f(x).C(x) + eval (t).C(x)", &[(Code::E0206, "f(x)"), (Code::E0206, "(t)")]);
    body("eval a.b.C(x); f(x).C(x)", &[(Code::E0206, "a.b"), (Code::E0206, "f(x)")]);
    body("eval t", &[(Code::E0201, "}")]);
    body("p.x = 1.0; p.0.y = x + ; p", &[(Code::E0207, "p.x"), (Code::E0207, "p.0.y"), (Code::E0201, ";")]);
}

#[test]
fn independent_errors_are_all_reported_and_only_these() {
    let text = "entity Ball(radius real);
        impl Ball for Sdf(p) { length(p) -  }
        fn f(x: real) -> real {
            let a = (x + ;
            let b = g(x, 3x, y);
            let c = a * b
            c = [a, b;
            for i in 0.. { c = c + 1.0; }
            c d
        }
        fn g() -> real { 1.0 }
        bogus words here
        fn h() -> real { eval f().C(1) }";
    assert_eq!(
        errors(text),
        [
            (Code::E0201, "real"),
            (Code::E0201, "}"),
            (Code::E0201, ";"),
            (Code::E0103, "3x"),
            (Code::E0201, ""),
            (Code::E0202, ";"),
            (Code::E0201, "{"),
            (Code::E0201, "d"),
            (Code::E0201, "bogus"),
            (Code::E0206, "f()"),
        ]
    );
}

#[test]
fn errors_beyond_the_limit_are_counted() {
    let limits = Limits { diagnostics: 3, ..Limits::default() };
    let parsed = parse(FileId(0), &"fn f() -> real { + }\n".repeat(10), &limits);
    assert_eq!((parsed.diagnostics.len(), parsed.omitted), (3, 7));
}

#[test]
fn the_sink_sorts_and_prefers_errors() {
    let at = |code, file, start| Diagnostic::new(code, Span::new(FileId(file), start, start + 1), "m");
    let mut sink = Diagnostics::default();
    assert!(sink.is_empty());
    sink.push(at(Code::W0501, 0, 1));
    assert!(!sink.has_errors());
    sink.push(Diagnostic::global(Code::E1011, "late"));
    sink.extend([at(Code::E0301, 1, 0), at(Code::E0301, 0, 9), at(Code::E0301, 0, 9), at(Code::W0501, 0, 2)]);
    sink.omit_errors(2);
    assert!(sink.has_errors());
    let all = sink.clone().finish(&Limits::default());
    let order: Vec<_> =
        all.diagnostics.iter().map(|d| d.labels.first().map(|l| (l.span.file.0, l.span.start))).collect();
    assert_eq!(order, [Some((0, 1)), Some((0, 2)), Some((0, 9)), Some((1, 0)), None]);
    let few = sink.clone().finish(&Limits { diagnostics: 4, ..Limits::default() });
    assert_eq!(few.diagnostics.iter().map(|d| d.code.name()).collect::<Vec<_>>(), ["W0501", "E0301", "E0301", "E1011"]);
    assert_eq!((few.omitted_errors, few.omitted_warnings), (2, 1));
    let two = sink.finish(&Limits { diagnostics: 2, ..Limits::default() });
    assert_eq!((two.diagnostics.len(), two.omitted_errors, two.omitted_warnings), (2, 3, 2));
}

fn two_files() -> (Files, Diagnostic) {
    let mut files = Files::default();
    let a = files.add("a.vola", "entity Ball();\r\nfn größe() -> real { Ball(1.0) }\r\n");
    let b = files.add("std/b.vola", "// b\nentity Ball(radius: real);\n");
    let diagnostic = Diagnostic::new(Code::E0302, Span::new(b, 12, 16), "`Ball` is defined twice")
        .here("second definition")
        .label(Span::new(a, 7, 11), "first definition")
        .label(Span::new(a, 39, 43), "used here")
        .note("entities share a name space")
        .help("rename one");
    (files, diagnostic)
}

#[test]
fn terminal_text() {
    let (files, diagnostic) = two_files();
    let expected = "error[E0302]: `Ball` is defined twice
 --> std/b.vola:2:8
  |
2 | entity Ball(radius: real);
  |        ^^^^ second definition
  |
 ::: a.vola:1:8
  |
1 | entity Ball();
  |        ---- first definition
2 | fn größe() -> real { Ball(1.0) }
  |                      ---- used here
  |
  = note: entities share a name space
  = help: rename one

";
    assert_eq!(render::terminal(std::slice::from_ref(&diagnostic), &files, false), expected);
    assert!(render::terminal(&[diagnostic], &files, true).contains("\u{1b}["));
    let global = Diagnostic::global(Code::W0901, "unknown\u{1b}[31m").help("x\u{1b}[31m");
    let text = render::terminal(&[global], &files, false);
    assert!(text.starts_with("warning[W0901]: unknown") && !text.contains('\u{1b}'), "{text}");
}

#[test]
fn json_values() {
    let (files, diagnostic) = two_files();
    let value = render::json(&[diagnostic], &files);
    let expected = serde_json::json!([{
        "code": "E0302",
        "severity": "error",
        "message": "`Ball` is defined twice",
        "labels": [
            {"file": "std/b.vola", "start": {"line": 2, "column": 8, "byte": 12}, "end": {"line": 2, "column": 12, "byte": 16}, "text": "second definition"},
            {"file": "a.vola", "start": {"line": 1, "column": 8, "byte": 7}, "end": {"line": 1, "column": 12, "byte": 11}, "text": "first definition"},
            {"file": "a.vola", "start": {"line": 2, "column": 22, "byte": 39}, "end": {"line": 2, "column": 26, "byte": 43}, "text": "used here"},
        ],
        "notes": ["entities share a name space"],
        "help": "rename one",
    }]);
    assert_eq!(value, expected);
}

#[test]
fn sarif_log() {
    let (files, diagnostic) = two_files();
    let global = Diagnostic::global(Code::E1011, "late");
    let warning = Diagnostic::new(Code::W0501, Span::new(FileId(0), 14, 41), "value dropped");
    let mut odd = Files::default();
    odd.add("/models/größe 100%.vola", "x");
    let diagnostics = [diagnostic, warning, global];
    let other = [Diagnostic::new(Code::E0302, Span::new(FileId(0), 0, 1), "m")];
    let found = render::sarif(&[(&diagnostics, &files), (&other, &odd)]);
    let rule = |id: &str, title: &str, level: &str| {
        serde_json::json!({
            "id": id,
            "shortDescription": { "text": title },
            "help": { "text": format!("`isograd explain {id}` shows an example and how to mend it.") },
            "defaultConfiguration": { "level": level },
        })
    };
    let physical = |uri: &str, lines: [u32; 2], columns: [u32; 2]| {
        serde_json::json!({
            "artifactLocation": { "uri": uri },
            "region": {
                "startLine": lines[0], "startColumn": columns[0], "endLine": lines[1], "endColumn": columns[1],
            },
        })
    };
    let expected = serde_json::json!({
        "$schema": "https://json.schemastore.org/sarif-2.1.0.json",
        "version": "2.1.0",
        "runs": [{
            "tool": { "driver": {
                "name": "isograd",
                "semanticVersion": env!("CARGO_PKG_VERSION"),
                "rules": [
                    rule("E0302", Code::E0302.title(), "error"),
                    rule("E1011", Code::E1011.title(), "error"),
                    rule("W0501", Code::W0501.title(), "warning"),
                ],
            } },
            "columnKind": "unicodeCodePoints",
            "results": [
                {
                    "ruleId": "E0302",
                    "ruleIndex": 0,
                    "level": "error",
                    "message": {
                        "text": "`Ball` is defined twice\nnote: entities share a name space\nhelp: rename one"
                    },
                    "locations": [{
                        "physicalLocation": physical("std/b.vola", [2, 2], [8, 12]),
                        "message": { "text": "second definition" },
                    }],
                    "relatedLocations": [
                        {
                            "physicalLocation": physical("a.vola", [1, 1], [8, 12]),
                            "message": { "text": "first definition" },
                        },
                        {
                            "physicalLocation": physical("a.vola", [2, 2], [22, 26]),
                            "message": { "text": "used here" },
                        },
                    ],
                },
                {
                    "ruleId": "W0501",
                    "ruleIndex": 2,
                    "level": "warning",
                    "message": { "text": "value dropped" },
                    "locations": [{ "physicalLocation": physical("a.vola", [1, 2], [15, 24]) }],
                },
                { "ruleId": "E1011", "ruleIndex": 1, "level": "error", "message": { "text": "late" } },
                {
                    "ruleId": "E0302",
                    "ruleIndex": 0,
                    "level": "error",
                    "message": { "text": "m" },
                    "locations": [
                        { "physicalLocation": physical("file:///models/gr%C3%B6%C3%9Fe%20100%25.vola", [1, 1], [1, 2]) },
                    ],
                },
            ],
        }],
    });
    assert_eq!(found, expected);
    assert_eq!(render::sarif(&[])["runs"][0]["results"], serde_json::json!([]), "nothing found is a run as well");
}

#[test]
fn github_annotations() {
    let (files, diagnostic) = two_files();
    let wide = Diagnostic::new(Code::W0501, Span::new(FileId(0), 14, 41), "100% of\r\nit: a, b").help("50%");
    let expected = "\
::error file=std/b.vola,line=2,col=8,endLine=2,endColumn=12,title=E0302 defined twice::`Ball` is defined twice%0A\
second definition%0Aa.vola:1:8: first definition%0Aa.vola:2:22: used here%0Anote: entities share a name space%0A\
help: rename one
::warning file=a.vola,line=1,endLine=2,title=W0501 value dropped::100%25 of%0D%0Ait: a, b%0Ahelp: 50%25
::error title=E1011 compilation took too long::late
";
    let global = Diagnostic::global(Code::E1011, "late");
    assert_eq!(render::github(&[diagnostic, wide, global], &files), expected);
    let mut odd = Files::default();
    odd.add("a:b,c%.vola", "x");
    let odd = render::github(&[Diagnostic::new(Code::E0301, Span::new(FileId(0), 0, 1), "m")], &odd);
    assert_eq!(
        odd,
        "::error file=a%3Ab%2Cc%25.vola,line=1,col=1,endLine=1,endColumn=2,title=E0301 name not found::m\n"
    );
}

#[test]
fn any_span_can_be_shown() {
    let texts = ["", "\n", "é", "a\r\nb\r\n", "\t\u{1b}x\u{0}\n\n\n", "日本語 𝕏 a\u{301}"];
    for text in texts {
        let mut files = Files::default();
        files.add("x.vola", text);
        for file in [0, 1] {
            for start in (0..=12).chain([u32::MAX]) {
                for end in (0..=12).chain([u32::MAX]) {
                    let span = Span::new(FileId(file), start, end);
                    let d =
                        Diagnostic::new(Code::E0201, span, "m").here("h").label(Span::new(FileId(0), end, start), "");
                    assert!(render::terminal(std::slice::from_ref(&d), &files, false).contains("E0201"));
                    let shown = std::slice::from_ref(&d);
                    assert_eq!(render::json(shown, &files)[0]["code"], "E0201");
                    assert_eq!(render::github(shown, &files).lines().count(), 1);
                    assert_eq!(render::sarif(&[(shown, &files)])["runs"][0]["results"][0]["ruleId"], "E0201");
                }
            }
        }
    }
}

#[test]
fn enormous_lines_and_places_are_cut() {
    let text = format!("fn f() -> real {{ {} @ {} }}\n", "ä + ".repeat(1_000_000), "1.0 + ".repeat(1_000_000))
        + &"// line\n".repeat(10_000);
    let mut files = Files::default();
    let id = files.add("x.vola", &*text);
    let at = u32::try_from(text.find('@').unwrap()).unwrap();
    let diagnostic = Diagnostic::new(Code::E0102, Span::new(id, at, at + 1), "m")
        .here("here")
        .label(Span::new(id, 0, 2), "start")
        .label(Span::new(id, 3, u32::MAX), "all")
        .label(Span::new(id, text.len() as u32, text.len() as u32), "end");
    let shown = render::terminal(&[diagnostic], &files, false);
    assert!(shown.len() < 4_000, "{}", shown.len());
    assert!(shown.contains("x.vola:1:4000019"), "{shown}");
    for word in ["here", "start", "all", "end"] {
        assert!(shown.contains(word), "{shown}");
    }
}

#[test]
fn a_semicolon_forgotten_at_the_end_of_a_line_is_missed_there() {
    for (text, wanted) in [
        ("fn f() -> real {\n    let a = 1.0\n    a\n}", "let a = 1.0"),
        ("fn f() -> real {\n    let a = g(1.0 // one\n      2.0);\n    a\n}", "let a = g(1.0"),
    ] {
        let parsed = parse(FileId(0), text, &Limits::default());
        let [d] = parsed.diagnostics.as_slice() else { panic!("{text}: {:?}", parsed.diagnostics) };
        let [missing, found] = d.labels.as_slice() else { panic!("{:?}", d.labels) };
        let end = text.find(wanted).unwrap() + wanted.len();
        assert_eq!((missing.span.start as usize, missing.span.end as usize), (end, end), "{text}");
        assert!(found.span.start as usize > end && found.text.starts_with("found "), "{found:?}");
    }
    // On one line, what was found is the better place.
    let parsed = parse(FileId(0), "fn f() -> real { let a = 1.0 a }", &Limits::default());
    assert_eq!(parsed.diagnostics[0].labels.len(), 1);
}

#[test]
fn a_missing_name_is_one_error() {
    body("let ; = 1.0; x", &[(Code::E0201, ";")]);
    body("csg 3 = x; x", &[(Code::E0201, "3")]);
    body("let = 1.0; x", &[(Code::E0201, "=")]);
    body("let ; = g(x, 3x); x", &[(Code::E0201, ";"), (Code::E0103, "3x")]);
}
