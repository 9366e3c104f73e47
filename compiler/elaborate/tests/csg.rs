//! Csg trees: sharing, cut-off, identity, choices, unrolled loops, depth and the other limits (LANGUAGE 11, 12, 18).
//! Knows nothing of how a graph is made.

mod common;

use std::cell::Cell;
use std::time::Instant;

use common::{codes, count, elaborated, example, graph, run};
use isograd_graph::{Node, Op, Unwatched, Watch};
use isograd_syntax::{Code, Diagnostic, Limits};

const ONE: &str = "f(x: real) -> real";

fn failure(source: &str, limits: &Limits) -> Diagnostic {
    match elaborated(source, limits, &Unwatched) {
        Ok(_) => panic!("elaborated:\n{source}"),
        Err(mut diagnostics) => diagnostics.remove(0),
    }
}

#[test]
fn sixty_doubling_unions_are_linear() {
    let graph = graph(&example(ONE, "csg c = Plus(1.0); for i in 0..60 { c = Add(){ c }{ c }; } eval c.D(x)"));
    assert_eq!(run(&graph, &[0.0]), [2f64.powi(60)]);
    assert!(graph.len() < 200, "{} nodes", graph.len());
}

#[test]
fn sixty_doubling_functions_are_linear() {
    let mut items = "fn c0() -> csg { Line() }\nfn r0(x: real) -> real { x }\n".to_owned();
    for i in 1..=60 {
        let j = i - 1;
        items += &format!("fn c{i}() -> csg {{ Add(){{ c{j}() }}{{ c{j}() }} }}\n");
        items += &format!("fn r{i}(x: real) -> real {{ r{j}(x) + r{j}(x) }}\n");
    }
    let graph = graph(&format!("{items}{}", example(ONE, "csg c = c60(); eval c.D(x) + r60(x)")));
    assert_eq!(run(&graph, &[1.0]), [2f64.powi(61)]);
    assert!(graph.len() < 300, "{} nodes", graph.len());
}

#[test]
fn choices_around_a_tree_are_linear() {
    let body = "csg c = Line(); for i in 0..40 { if x > i::<real> { c = Inc(){ c }; } } eval c.D(x)";
    let graph = graph(&example(ONE, body));
    for (x, want) in [(-1.0, -1.0), (0.5, 1.5), (39.5, 79.5), (100.0, 140.0)] {
        assert_eq!(run(&graph, &[x]), [want]);
    }
    assert!(graph.len() < 1500, "{} nodes", graph.len());
}

#[test]
fn the_same_eval_is_made_once_in_a_region_and_the_regions_inside() {
    let body = "csg c = Square(); let y = eval c.D(x); if x > 0.0 { y = y + eval c.D(x); } y";
    let graph = graph(&example(ONE, body));
    assert_eq!(run(&graph, &[3.0]), [18.0]);
    assert_eq!(count(&graph, Op::Mul), 1);
}

#[test]
fn sides_of_a_branch_do_not_share() {
    let body = "csg c = Square(); if x > 0.0 { eval c.D(x) } else { 1.0 + eval c.D(x) }";
    let graph = graph(&example(ONE, body));
    assert_eq!((run(&graph, &[3.0]), run(&graph, &[-3.0])), (vec![9.0], vec![10.0]));
    assert_eq!(count(&graph, Op::Mul), 2);
}

/// 2,000 nodes, 900 deep, built by functions and loops.
#[test]
fn a_deep_tree() {
    let items =
        "fn stack(c: csg, n: real) -> csg { csg t = c; for i in 0..450 { t = Add(){ Inc(){ t } }{ Plus(n) }; } t }";
    let body = "csg c = Line(); c = stack(c, x); csg d = Line(); for i in 0..550 { d = Inc(){ d }; } eval c.D(x) + eval d.D(x)";
    let graph = graph(&format!("{items}{}", example(ONE, body)));
    assert_eq!(run(&graph, &[0.0]), [450.0 + 550.0]);
    let deeper = body.replace("c = stack(c, x);", "c = stack(stack(c, x), x);");
    let error = failure(&format!("{items}{}", example(ONE, &deeper)), &Limits::default());
    assert_eq!(error.code, Code::E1005);
    assert!(error.message.contains("1000"), "{error:?}");
    let path = "Add → Inc → Add → Inc → … 993 more … → Inc → Add → Inc → Line";
    assert!(error.notes.iter().any(|n| n.contains(path)), "{:?}", error.notes);
}

#[test]
fn impls_inside_each_other_are_limited() {
    let items = "operation Wrap(); impl Wrap<s> for D(x) { if x > 0.0 { eval s.D(x) } else { 0.0 } }";
    let body = |n| format!("csg c = Line(); for i in 0..{n} {{ c = Wrap(){{ c }}; }} eval c.D(x)");
    let fits = graph(&format!("{items}{}", example(ONE, &body(490))));
    assert_eq!(run(&fits, &[2.0]), [2.0]);
    let error = failure(&format!("{items}{}", example(ONE, &body(510))), &Limits::default());
    assert_eq!(error.code, Code::E1005);
    let what = "inside each other are 500 impls, 501 branches and loops; 500 of them are the impl of `Wrap` for `D`";
    assert!(error.notes.iter().any(|n| n == what), "{:?}", error.notes);
}

#[test]
fn else_if_chains_do_not_recurse() {
    let chain: String = (0..900).map(|i| format!("if x < {i}.0 {{ {i}.0 }} else ")).collect();
    let graph = graph(&example(ONE, &format!("{chain}{{ -1.0 }}")));
    assert_eq!((run(&graph, &[417.5]), run(&graph, &[1e9])), (vec![418.0], vec![-1.0]));
}

#[test]
fn identity_and_cut_off() {
    let items = "operation Cut(); operation Own(); operation Pick2();
        impl Cut<s> for Tone(x) { x * 2.0 }
        impl Pick2<a, b> for Tone(x) { eval b.Tone(x) }";
    let ok = "csg c = Pick2(){ Line() }{ Inc(){ Own(){ Cut(){ Line() } } } }; eval c.Tone(x)";
    let graph = graph(&format!("{items}{}", example(ONE, ok)));
    assert_eq!(run(&graph, &[2.0]), [4.0]);

    let error = failure(
        &format!("{items}{}", example(ONE, "csg c = Own(){ Inc(){ Line() } }; eval c.Tone(x)")),
        &Limits::default(),
    );
    assert_eq!(error.code, Code::E0605);
    assert!(error.message.contains("`Line`") && error.message.contains("`Tone`"), "{error:?}");
    assert!(error.notes.iter().any(|n| n.contains("Own → Inc → Line")), "{error:?}");

    let items = "#[define(no_identity)] operation Strict();";
    let error =
        failure(&format!("{items}{}", example(ONE, "csg c = Strict(){ Line() }; eval c.D(x)")), &Limits::default());
    assert_eq!(error.code, Code::E0605);
    assert!(error.notes.iter().any(|n| n.contains("no_identity")), "{error:?}");
}

#[test]
fn dead_evals_need_no_impl() {
    let graph = graph(&example(ONE, "csg c = Line(); let y = eval c.Tone(x); x"));
    assert_eq!(run(&graph, &[2.0]), [2.0]);
}

#[test]
fn only_the_picked_side_is_specialised() {
    let graph = graph(&example(ONE, "csg c = Line(); if 1 > 2 { eval c.Tone(x) } else { x }"));
    assert_eq!(run(&graph, &[2.0]), [2.0]);
}

#[test]
fn independent_errors_are_reported_together() {
    let body = "csg c = Line(); csg d = Add(){ c }; eval c.Tone(x) + eval d.D(x) + eval c.Tone(x + 1.0)";
    assert_eq!(codes(&example(ONE, body)), [Code::E0605, Code::E0606]);
}

#[test]
fn cycles_show_their_chain() {
    let items = "operation P(); operation Q();
        fn again(s: csg) -> csg { P(){ s } }
        impl P<s> for D(x) { csg t = Q(){ s }; eval t.D(x) }
        impl Q<s> for D(x) { csg t = again(s); eval t.D(x) }";
    let error = failure(&format!("{items}{}", example(ONE, "csg e = P(){ Line() }; eval e.D(x)")), &Limits::default());
    assert_eq!(error.code, Code::E0607);
    assert!(error.notes.iter().any(|n| n.contains("`P` for `D` → `Q` for `D` → `P` for `D`")), "{error:?}");
    // Nesting an operation in its own use is none.
    let graph = graph(&example(ONE, "csg e = Inc(){ Inc(){ Inc(){ Line() } } }; eval e.D(x)"));
    assert_eq!(run(&graph, &[0.0]), [3.0]);
}

#[test]
fn csg_through_branches() {
    let body = "csg c = Line(); let k = 1.0; let n = 0; let b = false;
        if x > 0.0 { c = Plus(k); k = 2.0; n = 1; b = true; } else { if x < -1.0 { c = Inc(){ c }; k = 3.0; n = 2; } }
        csg d = if b { Add(){ c }{ Plus(k) } } else { c };
        eval d.D(x) + n::<real> * 100.0";
    let graph = graph(&example(ONE, body));
    for (x, want) in [(1.0, 2.0 + 3.0 + 100.0), (-0.5, -0.5), (-2.0, -1.0 + 200.0)] {
        assert_eq!(run(&graph, &[x]), [want], "at {x}");
    }
}

#[test]
fn a_choice_is_a_branch_of_the_graph() {
    let graph =
        graph(&example("f(x: real, b: bool) -> real", "csg c = if b { Square() } else { Five() }; eval c.D(x)"));
    assert_eq!((run(&graph, &[3.0, 1.0]), run(&graph, &[3.0, 0.0])), (vec![9.0], vec![5.0]));
    assert_eq!(graph.iter().filter(|(_, n)| matches!(n, Node::Gamma { .. })).count(), 1);
}

#[test]
fn evals_in_loops_and_branches() {
    let body = "csg c = Shift(y); let s = 0.0;
        for i in 0..n { if i % 2 == 0 { s = s + eval c.D(i::<real>); } else { csg e = Add(){ c }{ c }; s = s - eval e.D(x); } } s";
    let graph = graph(&example("f(x: real, y: real, n: int) -> real", body));
    let want = |x: f64, y: f64, n: i32| {
        (0..n).map(|i| if i % 2 == 0 { f64::from(i) - y } else { -2.0 * (x - y) }).sum::<f64>()
    };
    for n in [0, 1, 5] {
        assert_eq!(run(&graph, &[3.0, 0.5, f64::from(n)]), [want(3.0, 0.5, n)]);
    }
}

#[test]
fn unrolled_loops() {
    let body = "csg c = Line(); let k = 0.5; for i in 0..3 { for j in i..3 { k = k + 1.0; c = Add(){ c }{ Shift(k) }; } } eval c.D(x) + k";
    let graph = graph(&example(ONE, body));
    // k runs through 1.5 … 6.5; seven leaves.
    assert_eq!(run(&graph, &[10.0]), [70.0 - (1.5 + 2.5 + 3.5 + 4.5 + 5.5 + 6.5) + 6.5]);
    let items = "fn ring(n: int) -> csg { csg c = Line(); for i in 0..n * 2 { c = Inc(){ c }; } c }";
    let graph = common::graph(&format!("{items}{}", example(ONE, "csg c = ring(2.5::<int>); eval c.D(x)")));
    assert_eq!(run(&graph, &[0.0]), [4.0]);
}

#[test]
fn unrolling_is_counted_before_it_begins() {
    let start = Instant::now();
    let body = |n: u64| format!("csg c = Line(); for i in 0..{n} {{ c = Line(); }} eval c.D(x)");
    let error = failure(&example(ONE, &body(1_000_000_000)), &Limits::default());
    assert_eq!(error.code, Code::E1006);
    assert!(error.message.contains("1000000000") && error.message.contains("65536"), "{error:?}");
    assert!(start.elapsed().as_secs() < 30);
    let warned = |n| elaborated(&example(ONE, &body(n)), &Limits::default(), &Unwatched).unwrap().warnings;
    assert_eq!(warned(64), []);
    assert_eq!(warned(65).iter().map(|w| w.code).collect::<Vec<_>>(), [Code::W0602]);
    let twice = "csg c = Line(); for i in 0..40000 { c = Line(); } for i in 0..40000 { c = Line(); } eval c.D(x)";
    assert_eq!(codes(&example(ONE, twice)), [Code::E1006]);
}

#[test]
fn an_ordinary_loop_is_not_unrolled() {
    let size = |n: &str| graph(&example(ONE, &format!("let s = x; for i in 0..{n} {{ s = s * 0.5 + 1.0; }} s"))).len();
    assert_eq!(size("10"), size("1000000000"));
}

#[test]
fn bounds_say_what_they_depend_on() {
    let text = |signature: &str, body: &str| {
        let error = failure(&example(signature, body), &Limits::default());
        assert_eq!(error.code, Code::E0608);
        error.message
    };
    let loops = "csg c = Line(); for i in 0..n * m { c = Inc(){ c }; } eval c.D(x)";
    let message = text("f(x: real, n: int, m: int) -> real", loops);
    assert!(message.contains("upper bound") && message.contains("`n`") && message.contains("`m`"), "{message}");
    let nested =
        "let s = x; for k in 0..9 { csg c = Line(); for i in k..9 { c = Inc(){ c }; } s = s + eval c.D(x); } s";
    let message = text(ONE, nested);
    assert!(message.contains("lower bound") && message.contains("`k`"), "{message}");
}

#[test]
fn other_limits() {
    let few = Limits { graph_nodes: 100, ..Limits::default() };
    let body: String = (0..200).map(|i| format!("x = x * {i}.5;")).collect();
    assert_eq!(failure(&example(ONE, &format!("{body} x")), &few).code, Code::E1007);
    let trees: String = (0..60).map(|_| "c = Add(){ c }{ Line() };").collect();
    assert_eq!(failure(&example(ONE, &format!("csg c = Line(); {trees} eval c.D(x)")), &few).code, Code::E1007);
    let few = Limits { export_scalars: 4, ..Limits::default() };
    assert_eq!(failure("export fn f(m: mat2, x: real) -> real { x }", &few).code, Code::E1010);
    assert_eq!(failure("export fn f(x: real) -> (mat2, real) { ([[x; 2]; 2], x) }", &few).code, Code::E1010);
}

/// Exponentially many calls that make no nodes still end.
#[test]
fn time_is_limited() {
    struct After(Cell<u32>);
    impl Watch for After {
        fn expired(&self) -> bool {
            self.0.set(self.0.get() + 1);
            self.0.get() > 20
        }
    }
    let mut items = "fn r0(x: real) -> real { let c = 1.0; x }\n".to_owned();
    for i in 1..=60 {
        let j = i - 1;
        items += &format!("fn r{i}(x: real) -> real {{ r{j}(x) + r{j}(x) }}\n");
    }
    let source = format!("{items}{}", example(ONE, "r60(x)"));
    let errors = elaborated(&source, &Limits::default(), &After(Cell::new(0))).unwrap_err();
    assert_eq!(errors.iter().map(|d| d.code).collect::<Vec<_>>(), [Code::E1011]);
    let errors = elaborated(&source, &Limits::default(), &Unwatched).unwrap_err();
    assert_eq!(errors.iter().map(|d| d.code).collect::<Vec<_>>(), [Code::E1007]);
}

#[test]
fn errors_show_the_way() {
    let items = "fn inner(c: csg, x: real) -> real { eval c.Tone(x) }\nfn outer(x: real) -> real { csg c = Line(); inner(c, x) }";
    let error = failure(&format!("{items}{}", example(ONE, "outer(x)")), &Limits::default());
    let labels: Vec<&str> = error.labels.iter().map(|l| l.text.as_str()).collect();
    assert!(labels.contains(&"in `inner`, called here") && labels.contains(&"in `outer`, called here"), "{labels:?}");
}

/// A csg value whose argument comes from a region, and evals under choices inside regions.
#[test]
fn trees_made_inside_regions() {
    let body = "let s = 0.0;
        for i in 0..4 {
            csg c = Shift(s + 1.0);
            if x > 0.0 { csg d = Add(){ c }{ Line() }; c = d; } else { c = Inc(){ c }; }
            s = s + eval c.D(x);
        } s";
    let graph = graph(&example(ONE, body));
    let want = |x: f64| (0..4).fold(0.0, |s, _| s + if x > 0.0 { (x - (s + 1.0)) + x } else { 1.0 + (x - (s + 1.0)) });
    for x in [2.0, -2.0] {
        assert_eq!(run(&graph, &[x]), [want(x)]);
    }
}

#[test]
fn large_tuples_are_limited() {
    let few = Limits { graph_nodes: 100, ..Limits::default() };
    let body = "let a = (x, x); let b = (a, a); let c = (b, b); let d = (c, c); let e = (d, d); let g = (e, e); let h = (g, g); x";
    assert_eq!(failure(&example(ONE, body), &few).code, Code::E1007);
}
