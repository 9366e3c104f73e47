//! The code that bodies become, as listings: slots, scopes, what constructs write and restore.

mod common;

use common::{PRELUDE, check_text, codes};
use isograd_program::print;

/// The listing of the function `f` with this head and body, which may cause warnings only.
fn listing(signature: &str, body: &str) -> String {
    let (loaded, checked) = check_text(&format!("{PRELUDE}\nexport fn {signature} {{ {body} }}"));
    assert!(!codes(&loaded, &checked).contains('E'), "{}", codes(&loaded, &checked));
    let text = print(&checked.program);
    let start = text.find("export fn f(").unwrap();
    let end = text[start..].find("\n\n").map_or(text.len(), |e| start + e);
    text[start..end].lines().skip(1).map(|l| format!("{}\n", l.strip_prefix("  ").unwrap())).collect()
}

fn lists(signature: &str, body: &str, expected: &str) {
    let expected: String =
        expected.lines().skip(1).map(|l| format!("{}\n", l.strip_prefix("        ").unwrap_or(""))).collect();
    let found = listing(signature, body);
    assert_eq!(found.trim_end(), expected.trim_end(), "{body}\n{found}");
}

#[test]
fn loops_write_outer_slots() {
    lists(
        "f(a: real) -> real",
        "let s = a; for i in 1..4 { s = s + i::<real>; } s",
        "
        Load a#0
        Store s#1: real
        Int 1
        Int 4
        For i#2 writes s#1
          Load s#1
          Load i#2
          Cast int -> real
          real + real
          Store s#1: real
        EndFor
        Load s#1",
    );
}

#[test]
fn inner_definitions_shadow() {
    lists(
        "f(a: real) -> real",
        "let r = a; if a > 0.0 { let r = 5.0; r = 6.0; } r",
        "
        Load a#0
        Store r#1: real
        Load a#0
        Real 0.0
        real > real
        If
          Real 5.0
          Store r#2: real
          Real 6.0
          Store r#2: real
        Else
        EndIf
        Load r#1",
    );
}

#[test]
fn statement_branches_write_through_all_levels() {
    lists(
        "f(x: real) -> real",
        "let r = 0.0; if x > 0.0 { if x > 1.0 { r = 2.0; } else { r = 1.0; } } r",
        "
        Real 0.0
        Store r#1: real
        Load x#0
        Real 0.0
        real > real
        If writes r#1
          Load x#0
          Real 1.0
          real > real
          If writes r#1
            Real 2.0
            Store r#1: real
          Else
            Real 1.0
            Store r#1: real
          EndIf
        Else
        EndIf
        Load r#1",
    );
}

#[test]
fn value_branches_restore() {
    lists(
        "f(x: real) -> real",
        "let r = 1.0; let y = if x > 0.0 { r = 2.0; r } else { r }; r + y",
        "
        Real 1.0
        Store r#1: real
        Load x#0
        Real 0.0
        real > real
        If value real restores r#1
          Real 2.0
          Store r#1: real
          Load r#1
        Else
          Load r#1
        EndIf
        Store y#2: real
        Load r#1
        Load y#2
        real + real",
    );
}

#[test]
fn writes_restored_inside_do_not_count_outside() {
    lists(
        "f(x: real) -> real",
        "let r = x; for i in 0..3 { let y = if x > 0.0 { r = x; r } else { x }; } r",
        "
        Load x#0
        Store r#1: real
        Int 0
        Int 3
        For i#2
          Load x#0
          Real 0.0
          real > real
          If value real restores r#1
            Load x#0
            Store r#1: real
            Load r#1
          Else
            Load x#0
          EndIf
          Store y#3: real
        EndFor
        Load r#1",
    );
}

#[test]
fn else_if_nests() {
    lists(
        "f(x: real) -> real",
        "if x < 0.0 {0.0} else if x < 1.0 {1.0} else {2.0}",
        "
        Load x#0
        Real 0.0
        real < real
        If value real
          Real 0.0
        Else
          Load x#0
          Real 1.0
          real < real
          If value real
            Real 1.0
          Else
            Real 2.0
          EndIf
        EndIf",
    );
}

#[test]
fn definition_arguments_are_captured_by_value() {
    lists(
        "f(x: real) -> real",
        "let k = 1.0; csg e = Shift(k); k = 100.0; eval e.D(x)",
        "
        Real 1.0
        Store k#1: real
        Load k#1
        Node Shift subtrees 0
        Store e#2: csg
        Real 100.0
        Store k#1: real
        Load e#2
        Load x#0
        Eval D",
    );
}

#[test]
fn scoped_call_blocks_write_to_copies() {
    lists(
        "f(x: real) -> real",
        "let k = 1.0; csg e = Add(){ k = k + 1.0; Plus(k) }{ Plus(k) }; eval e.D(x)",
        "
        Real 1.0
        Store k#1: real
        Block restores k#1
          Load k#1
          Real 1.0
          real + real
          Store k#1: real
          Load k#1
          Node Plus subtrees 0
        EndBlock
        Block
          Load k#1
          Node Plus subtrees 0
        EndBlock
        Node Add subtrees 2
        Store e#2: csg
        Load e#2
        Load x#0
        Eval D",
    );
}

#[test]
fn user_functions_win_over_extension_built_ins() {
    lists(
        "f(x: real) -> real",
        "sign(x) + abs(x)",
        "
        Load x#0
        Call sign
        Load x#0
        Builtin abs(real)
        real + real",
    );
}

#[test]
fn csg_loops_write_csg_slots() {
    lists(
        "f(x: real) -> real",
        "csg c = Line(); for i in 0..7 { c = Inc(){ c }; } eval c.D(x)",
        "
        Node Line subtrees 0
        Store c#1: csg
        Int 0
        Int 7
        For i#2 writes c#1
          Block
            Load c#1
          EndBlock
          Node Inc subtrees 1
          Store c#1: csg
        EndFor
        Load c#1
        Load x#0
        Eval D",
    );
}

#[test]
fn loop_expressions_have_a_variable_of_their_own() {
    lists(
        "f(x: real) -> real",
        "let x2 = for x = x in 0..4 { x = x * 2.0; }; x2 + x",
        "
        Load x#0
        Store x#1: real
        Int 0
        Int 4
        For #2 writes x#1
          Load x#1
          Real 2.0
          real * real
          Store x#1: real
        EndFor
        Load x#1
        Store x2#3: real
        Load x2#3
        Load x#0
        real + real",
    );
}

#[test]
fn an_assignment_of_another_type_gets_a_slot_of_its_own() {
    lists(
        "f(x: real) -> real",
        "let a = 1; csg e = Inc(){ a = x; Shift(a) }; a = a + 1; eval e.D(a::<real>)",
        "
        Int 1
        Store a#1: int
        Block
          Load x#0
          Store a#2: real
          Load a#2
          Node Shift subtrees 0
        EndBlock
        Node Inc subtrees 1
        Store e#3: csg
        Load a#1
        Int 1
        int + int
        Store a#1: int
        Load e#3
        Load a#1
        Cast int -> real
        Eval D",
    );
}

#[test]
fn components_are_ranges_of_scalars() {
    lists(
        "f(m: mat2x3) -> real",
        "let t = (1, m, [m.x.y; 2]); t.1.y.z + t.2.y + diff(m.x, t.2.x).x",
        "
        Int 1
        Load m#0
        Load m#0
        Pick 0..3
        Pick 1..2
        Splat 2
        Pack 3
        Store t#1: (int, mat2x3, vec2)
        Load t#1
        Pick 1..7
        Pick 3..6
        Pick 2..3
        Load t#1
        Pick 7..9
        Pick 1..2
        real + real
        Load m#0
        Pick 0..3
        Load t#1
        Pick 7..9
        Pick 0..1
        Diff
        Pick 0..1
        real + real",
    );
}

#[test]
fn dead_evals_are_marked() {
    lists(
        "f(x: real) -> real",
        "csg e = Line(); let y = eval e.D(x); eval e.D(x); eval e.D(x)",
        "
        Node Line subtrees 0
        Store e#1: csg
        Load e#1
        Load x#0
        Eval D dead
        Store y#2: real
        Load e#1
        Load x#0
        Eval D dead
        Drop
        Load e#1
        Load x#0
        Eval D",
    );
}

#[test]
fn tuple_sources_are_packed_and_impls_split_them() {
    let (loaded, checked) = check_text(
        "concept P: (real, vec2) -> real;
         concept N: -> real;
         operation Op(k: real);
         impl Op<a> for P(u, v) { eval a.P((u, v)) + k }
         impl Op<a> for N { eval a.N() }
         export fn f(c: real) -> real { csg o = Op(c){ Op(c) }; eval o.P(c, [c; 2]) }",
    );
    assert_eq!(codes(&loaded, &checked), "");
    assert_eq!(
        print(&checked.program),
        "concept P: (real, vec2) -> real
concept N: -> real
operation Op(k: real)

export fn f(c: real) -> real
  Load c#0
  Block
    Load c#0
    Node Op subtrees 0
  EndBlock
  Node Op subtrees 1
  Store o#1: csg
  Load o#1
  Load c#0
  Load c#0
  Splat 2
  Pack 2
  Eval P

impl Op<a> for P(u, v): (real, vec2) -> real
  Load a#3
  Load u#0
  Load v#1
  Pack 2
  Eval P
  Load k#2
  real + real

impl Op<a> for N(): -> real
  Load a#1
  Eval N
"
    );
}

#[test]
fn functions_keep_their_documentation_and_head() {
    let (loaded, checked) = check_text("/// A ball.\n/// Round.\nexport fn ball(p: vec3) -> real { length(p) - 1.0 }");
    let f = &checked.program.functions[0];
    assert_eq!(f.doc.as_deref(), Some("A ball.\nRound."));
    assert_eq!(loaded.files.text(f.span), "export fn ball(p: vec3) -> real");
}

#[test]
fn intervals_and_metadata_have_instructions_of_their_own() {
    lists(
        "f(a: real = 1.0 in [-2.0 .. PI], i: interval<vec2> = [[0.0; 2] .. [1.0; 2]]) -> (real, bool)",
        "let j = bound([a, a], a, [a .. 1.0]) - i; let k = [j.y; 3]; ([k.x, j.x].1.x + j.end.y, k.may_be_nan)",
        "
        a default: Real 1.0
        a from: Real 2.0, Neg real
        a to: Real 3.141592653589793
        i default: Real 0.0, Splat 2, Real 1.0, Splat 2, Interval vec2
        Load a#0
        Load a#0
        Pack 2
        Load a#0
        Load a#0
        Real 1.0
        Interval real
        Bound vec2 by real
        Load i#1
        interval<vec2> - interval<vec2>
        Store j#2: interval<vec2>
        Load j#2
        PickInterval 1..2 of 2
        SplatInterval 3
        Store k#3: interval<vec3>
        Load k#3
        PickInterval 0..1 of 3
        Load j#2
        PickInterval 0..1 of 2
        PackIntervals 2
        End vec2
        Pick 0..1
        Load j#2
        End vec2
        Pick 1..2
        real + real
        Load k#3
        MayBeNan
        Pack 2",
    );
}
