//! Trees of correct programs: precedence, heads, both dialects, documentation, spans, depth.

use isograd_syntax::{Code, FileId, Files, Limits, Span, parse, print, tree::ItemKind};

fn items(text: &str) -> String {
    let parsed = parse(FileId(0), text, &Limits::default());
    assert_eq!(parsed.diagnostics, [], "{text}");
    print(&parsed.tree)
}

/// The printed value of a function with this body.
fn value(body: &str) -> String {
    let printed = items(&format!("fn f() -> real {{ {body} }}"));
    let start = printed.find("(value ").expect("a value") + "(value ".len();
    let end = printed.trim_end().len() - ")))".len();
    printed[start..end].to_owned()
}

#[track_caller]
fn same(left: &str, right: &str) {
    assert_eq!(value(left), value(right), "{left} is not {right}");
}

#[test]
fn precedence() {
    same("a + b * c", "a + (b * c)");
    same("a - b - c", "(a - b) - c");
    same("a / b * c % d", "((a / b) * c) % d");
    same("a + b < c - d", "(a + b) < (c - d)");
    same("a < b < c", "(a < b) < c");
    same("a || b && c == d || e", "(a || (b && (c == d))) || e");
    same("1.0 + x*3.0 == 7.0 && x > 1.0 || x < -5.0", "(((1.0 + (x*3.0)) == 7.0) && (x > 1.0)) || (x < (-5.0))");
    same("-x::<int>", "(-x)::<int>");
    same("!a && b", "(!a) && b");
    same("-x.y", "-(x.y)");
    same("a * -b::<int> + c", "(a * ((-b)::<int>)) + c");
    same("x::<vec2<int>>.y", "(x::<vec2<int>>).y");
    same("x::<int>::<real>", "(x::<int>)::<real>");
    same("a--b", "a - (-b)");
    same("a * - b", "a * (-b)");
    same("x::<int>==y", "(x::<int>) == y");
    same("x::<interval<int>>==y", "(x::<interval<int>>) == y");
    assert_eq!(value("a + b * -c"), "(+ a (* b (- c)))");
    assert_eq!(value("- - !x"), "(- (- (! x)))");
}

#[test]
fn expressions() {
    assert_eq!(value("t.0.1.x"), "(. (. (. t 0) 1) x)");
    assert_eq!(value("(a, (b, c),)"), "(tuple a (tuple b c))");
    assert_eq!(value("[[1.0, 2], [x; 3],]"), "(list (list 1.0 2) (splat x 3))");
    assert_eq!(value("[-1.0..2.0]"), "(interval (- 1.0) 2.0)");
    assert_eq!(
        value("[INF .. f(PI, EULER, true)]"),
        "(interval inf (call f 3.141592653589793 2.718281828459045 true))"
    );
    assert_eq!(value("eval t.C(x) + eval u.D()"), "(+ (eval t C x) (eval u D))");
    assert_eq!(value("t.C(x) + v()"), "(+ (eval24 t C x) (call v))");
    assert_eq!(value("f(a).x"), "(. (call f a) x)");
    assert_eq!(value("1e3 + 1_0.5"), "(+ 1000.0 10.5)");
}

#[test]
fn statements_and_blocks() {
    let printed = items(
        "fn f(x: real) -> real {
            let a = x; csg c = Join(){ k = k + 1.0; Plus(k) }{ Line() };
            for i in 0..n { a = a + i::<real>; }
            if a > 1.0 { a = 2.0; } else if b { f(a); } else { }
            ;
            if a { b } else { c }
        }",
    );
    assert_eq!(
        printed,
        "(fn f (x real) -> real
  (block
    (let a x)
    (csg c (call Join
      (block
        (set k (+ k 1.0))
        (value (call Plus k)))
      (block
        (value (call Line)))))
    (for i 0 .. n
      (block
        (set a (+ a (cast i real)))))
    (if (> a 1.0)
      (block
        (set a 2.0))
    elif b
      (block
        (drop (call f a)))
    else
      (block))
    (empty)
    (if a
      (block
        (value b))
    else
      (block
        (value c)))))
"
    );
}

#[test]
fn a_call_in_a_head_takes_no_block() {
    let head = items("fn f() -> real { if g(x) { y } for i in lo(1)..hi(2) { z; } if (g(x){ a }) == b { c } }");
    assert_eq!(
        head,
        "(fn f -> real
  (block
    (if (call g x)
      (block
        (value y)))
    (for i (call lo 1) .. (call hi 2)
      (block
        (drop z)))
    (if (== (call g x
      (block
        (value a))) b)
      (block
        (value c)))))
"
    );
    // The blocks of a head's own blocks are free again, and heads nest.
    items("fn f() -> real { if if a { N(){ x } } else { b } { N(){ x } } }");
    items("fn f() -> csg { if c { A(){ B() } } else { A(){ B() } } }");
}

#[test]
fn items_of_both_dialects() {
    let printed = items(
        "module self::super::a; module std;
        entity N(); operation O(a: s, b: vec3,);
        concept C: vec3 -> real; concept T: -> (real, vec2<int>);
        impl N for C(p) { p } impl O<a, b,> for T { a } impl O<a> for C(x, y) { a }
        export fn e(p: vec3 in [-2.0 .. 2.0], i: interval<real>=[0.0..1.0], n: int = 4 in [1 .. 16]) -> (real) { n }
        export old(at: CSG){ at } define d(){ N() }
        #[define(no_identity)] #[no_inline()] fn define(x: tensor<2, 3,4><real>, m: mat2x3) -> interval<vec3<real>> { x }",
    );
    assert_eq!(
        printed,
        "(module self super a)
(module std)
(entity N)
(operation O (a s) (b vec3))
(concept C vec3 -> real)
(concept T -> (real, vec2<int>))
(impl N (operands) for C (args p)
  (block
    (value p)))
(impl O (operands a b) for T (args)
  (block
    (value a)))
(impl O (operands a) for C (args x y)
  (block
    (value a)))
(export fn e (p vec3 in (- 2.0) .. 2.0) (i interval<real> = (interval 0.0 1.0)) (n int = 4 in 1 .. 16) -> real
  (block
    (value n)))
(export fn old (at CSG)
  (block
    (value at)))
(define d
  (block
    (value (call N))))
#[define no_identity]
#[no_inline]
(fn define (x tensor) (m mat2x3) -> interval<vec3<real>>
  (block
    (value x)))
"
    );
}

#[test]
fn loops_as_values() {
    assert_eq!(value("let p = for p = a in 0..4 { p = p * 2.0; }; p"), "p");
    let printed = items("fn f() -> real { for x = a in 0..4 { x = x; } }");
    assert!(printed.contains("(value (loop x a in 0 .. 4\n"), "{printed}");
}

#[test]
fn words_that_are_special_elsewhere_are_names() {
    items(
        "fn s(real: real, define: s, x: i) -> real { let s = 1.0; let bound = s; let start = bound; define = s; self + super }",
    );
}

#[test]
fn documentation() {
    let text = "\u{feff}/// One.\r\n///  Two.\r\nentity A(); /// no doc\n//// no\nentity B();\n/// a\n\n  /// b\n#[x()] // c\n/// d\nentity C();";
    let parsed = parse(FileId(0), text, &Limits::default());
    assert_eq!(parsed.diagnostics, []);
    let docs: Vec<_> = parsed.tree.items.iter().map(|i| i.doc.as_deref()).collect();
    assert_eq!(docs, [Some("One.\n Two."), None, Some("a\n\nb\nd")]);
    let inside = parse(FileId(0), "fn f() -> real { /// no\n x }\n/// end of file", &Limits::default());
    assert_eq!((inside.diagnostics, inside.tree.items[0].doc.as_deref()), (vec![], None));
}

#[test]
fn line_ends_mean_nothing() {
    let text = "fn f() -> real {\n let a = 1.0; // c\n a\n}\n/// d\nentity A();";
    assert_eq!(items(text), items(&text.replace('\n', "\r\n")));
}

#[test]
fn spans() {
    let text = "/// d\n#[a()] fn größe(x: real) -> real { (x + 1.0) * x::<int>.y }";
    let mut files = Files::default();
    let id = files.add("a.vola", text);
    let parsed = parse(id, text, &Limits::default());
    let item = &parsed.tree.items[0];
    assert_eq!(files.text(item.span), &text[text.find("fn").unwrap()..]);
    assert_eq!(files.text(item.attributes[0].span), "#[a()]");
    let ItemKind::Function { name, .. } = &item.kind else { panic!() };
    assert_eq!(files.text(name.span), "größe");
    let spans: Vec<_> = parsed.tree.exprs.iter().map(|e| files.text(e.span)).collect();
    assert_eq!(spans, ["x", "1.0", "(x + 1.0)", "x", "x::<int>", "x::<int>.y", "(x + 1.0) * x::<int>.y"]);
}

/// Runs on the stack that a thread has by default.
fn on_a_thread(test: impl FnOnce() + Send + 'static) {
    std::thread::Builder::new().stack_size(2 << 20).spawn(test).unwrap().join().unwrap();
}

#[test]
fn nesting_has_a_limit() {
    let codes = |body: &str, limit: u64| {
        let text = format!("fn f() -> real {{ {body} }}");
        let limits = Limits { nesting: limit, ..Limits::default() };
        parse(FileId(0), &text, &limits).diagnostics.iter().map(|d| d.code).collect::<Vec<_>>()
    };
    // The function's own block is the first.
    let parens = |n: usize| format!("{}x{}", "(".repeat(n), ")".repeat(n));
    assert_eq!(codes(&parens(255), 256), []);
    assert_eq!(codes(&parens(256), 256), [Code::E1004]);
    assert_eq!(codes(&format!("{}x", "-".repeat(255)), 256), []);
    assert_eq!(codes(&format!("{}x", "!".repeat(256)), 256), [Code::E1004]);
    assert_eq!(codes(&"if x {".repeat(9).replace('x', &parens(1)), 10), [Code::E0202]);
    assert_eq!(codes("x::<interval<interval<vec2<real>>>>", 5), []);
    assert_eq!(codes("x::<interval<interval<vec2<real>>>> ; [1.0; y]", 4), [Code::E1004, Code::E0203]);
    // What comes after is read as usual.
    assert_eq!(codes("((((x)))) + 1; [1.0; y]", 3), [Code::E1004, Code::E0203]);
}

#[test]
fn enormous_nesting_is_rejected_quickly() {
    on_a_thread(|| {
        let n = 100_000;
        let open = [
            "(",
            "-",
            "-(",
            "[",
            "{",
            "if x {",
            "if ",
            "for x = ",
            "f(g(){",
            "x::<interval<",
            "eval ",
            "f(a){[(1, if f(){",
        ];
        for open in open {
            for limits in [Limits::default(), Limits { nesting: u64::MAX, ..Limits::default() }] {
                let text = format!("fn f() -> real {{ {} }}", open.repeat(n));
                let parsed = parse(FileId(0), &text, &limits);
                let deep = parsed.diagnostics.iter().filter(|d| d.code == Code::E1004).count();
                assert_eq!(deep, usize::from(!matches!(open, "eval " | "x::<interval<")), "{open}");
                assert!(!print(&parsed.tree).is_empty() || parsed.tree.items.is_empty());
            }
        }
        for (open, close) in [("(", ")"), ("[", "]"), ("if x {", "}"), ("-(", ")")] {
            let text = format!("fn f() -> real {{ {}1{} }} fn g() -> real {{ ; }}", open.repeat(n), close.repeat(n));
            let parsed = parse(FileId(0), &text, &Limits::default());
            assert_eq!(parsed.diagnostics.iter().map(|d| d.code).collect::<Vec<_>>(), [Code::E1004]);
            assert_eq!(parsed.tree.items.len(), 2);
        }
    });
}

#[test]
fn long_chains_are_no_nesting() {
    on_a_thread(|| {
        let n = 100_000;
        let chains = [
            "1 + ".repeat(n) + "1",
            "1 < 2 * 3 + ".repeat(n) + "1",
            "x".to_owned() + &"::<int>".repeat(n),
            "x".to_owned() + &".y".repeat(n),
            "if x { 1 } else ".repeat(n) + "{ 2 }",
            "N()".to_owned() + &"{ x }".repeat(n),
        ];
        for chain in chains {
            let text = format!("fn f() -> real {{ {chain} }}");
            let parsed = parse(FileId(0), &text, &Limits::default());
            assert_eq!(parsed.diagnostics, []);
            assert!(print(&parsed.tree).len() > n);
        }
    });
}

#[test]
fn ten_megabytes_are_read_in_linear_time() {
    let line = "let x = foo(a.x, [1.0; 3]) * 2.0 + -b; // c\n";
    for (unit, around) in
        [(line, "fn f() -> real { "), ("@ ", ""), ("f(,)", ""), ("fn f(", ""), ("'", ""), ("x y ", "")]
    {
        let text = around.to_owned() + &unit.repeat(10_000_000 / unit.len());
        let parsed = parse(FileId(0), &text, &Limits::default());
        assert!(parsed.diagnostics.len() <= 100);
        assert_eq!(parsed.omitted > 0, matches!(unit, "@ " | "fn f("), "{unit}");
    }
}

#[test]
fn children_precede_parents() {
    let parsed = parse(FileId(0), "fn f() -> real { a + b * (c - [d; 2].x) }", &Limits::default());
    assert_eq!(parsed.tree.exprs.last().unwrap().span, Span::new(FileId(0), 17, 39));
}
