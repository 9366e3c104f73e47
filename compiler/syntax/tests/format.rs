//! The formatter on small examples, and what holds for every correct file: the same tree, and nothing left to do.

use isograd_syntax::{FileId, Limits, format, parse, print};
use proptest::prelude::*;

fn formatted(text: &str) -> String {
    let parsed = parse(FileId(0), text, &Limits::default());
    assert_eq!(parsed.diagnostics, [], "{text}");
    let once = format(text, &parsed.tree);
    let again = parse(FileId(0), &once, &Limits::default());
    assert_eq!(again.diagnostics, [], "{once}");
    assert_eq!(print(&again.tree), print(&parsed.tree), "{once}");
    assert_eq!(format(&once, &again.tree), once, "not at rest");
    once
}

#[test]
fn spaces() {
    let cases = [
        ("fn f(a:real,b :real)->real{a+b}", "fn f(a: real, b: real) -> real { a + b }\n"),
        ("fn f(a:real)->real{- a*-a--a}", "fn f(a: real) -> real { -a * -a - -a }\n"),
        ("fn f(b:bool)->bool{! b&&!b||b}", "fn f(b: bool) -> bool { !b && !b || b }\n"),
        ("fn f(a:vec2< int >)->int{a . x+a.1}", "fn f(a: vec2<int>) -> int { a.x + a.1 }\n"),
        ("fn f(a:real)->bool{a :: <int>>=3}", "fn f(a: real) -> bool { a::<int> >= 3 }\n"),
        ("fn f(a:real)->bool{a::<int>==3}", "fn f(a: real) -> bool { a::<int> == 3 }\n"),
        ("fn f(t:((int,int),int))->int{t.0.1}", "fn f(t: ((int, int), int)) -> int { t.0.1 }\n"),
        (
            "export fn f(i:interval<real>=[0.0..1.0],k:real=1.0 in[0.0..2.0])->real{i.start}",
            "export fn f(i: interval<real> = [0.0 .. 1.0], k: real = 1.0 in [0.0 .. 2.0]) -> real { i.start }\n",
        ),
        ("impl Add< a ,b >for D( p ){eval a . D(p)}", "impl Add<a, b> for D(p) { eval a.D(p) }\n"),
        ("define t(){Add ( ) { A() } { B() }}", "define t() { Add(){ A() }{ B() } }\n"),
        (
            "fn f(n:int)->int{let s=0;for i in 0 .. n{s=s+i;}s}",
            "fn f(n: int) -> int { let s = 0; for i in 0..n { s = s + i; } s }\n",
        ),
        (
            "fn f(x:real)->real{if(x<1.0){-x}else if x>2.0{x}else{[x;2].x}}",
            "fn f(x: real) -> real { if (x < 1.0) { -x } else if x > 2.0 { x } else { [x; 2].x } }\n",
        ),
        ("# [ no_inline ( ) ] fn f()->real{(1.0)}", "#[no_inline()] fn f() -> real { (1.0) }\n"),
        ("module a :: b;module c;", "module a::b;\nmodule c;\n"),
        ("\u{feff}module a;\r\n\r\n\r\n\r\nmodule b;", "module a;\n\nmodule b;\n"),
        ("", ""),
        ("// only this  \n", "// only this\n"),
    ];
    for (text, expected) in cases {
        assert_eq!(formatted(text), expected);
    }
}

#[test]
fn lines_and_comments() {
    let text = "\
/// Doc.
#[define(no_identity)]
operation Op(); // at the end
  // alone
fn f(
x: real,
y: real // last
) -> real
{

    // first
    let a = x +
    y
    * 2.0;


    csg t = Op(){
    A() // leaf
    }{ B()
    };
    if a > 0.0 {
    -a
    } else {
    a
    }
    // end

}
";
    let expected = "\
/// Doc.
#[define(no_identity)]
operation Op(); // at the end
// alone
fn f(
    x: real,
    y: real // last
) -> real {
    // first
    let a = x +
        y
        * 2.0;

    csg t = Op(){
        A() // leaf
    }{ B()
    };
    if a > 0.0 {
        -a
    } else {
        a
    }
    // end
}
";
    assert_eq!(formatted(text), expected);
}

#[test]
fn parameters_stand_below_the_first() {
    let text = "\
entity Größe(a: real,
b: real);
export fn f(x: real,
  // Said of y.
      y: vec2 = [
0.0, 1.0
] in [[0.0; 2]
.. [1.0; 2]]
) -> real {
g(x,
y)
}
fn g( // not beside
x: real) -> real { x }
";
    let expected = "\
entity Größe(a: real,
             b: real);
export fn f(x: real,
            // Said of y.
            y: vec2 = [
                0.0, 1.0
            ] in [[0.0; 2]
                .. [1.0; 2]]
) -> real {
    g(x,
        y)
}
fn g( // not beside
    x: real) -> real { x }
";
    assert_eq!(formatted(text), expected);
}

const WHOLE: &str = include_str!("whole.vola");

/// A correct file with other white space and comments between its tokens.
fn shaken(gaps: &[u8]) -> String {
    let mut gaps = gaps.iter().cycle();
    let mut out = String::new();
    for line in WHOLE.lines() {
        if line.starts_with("///") {
            out += &format!("\n{line}\n");
            continue;
        }
        for word in line.split(' ') {
            out += word;
            out += match gaps.next() {
                Some(0) => "\n",
                Some(1) => "\t \r\n\n\n ",
                Some(2) => " // why - not\n",
                Some(3) => "\n  // alone {\n\n",
                _ => " ",
            };
        }
    }
    out
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn nothing_but_white_space_changes(gaps in prop::collection::vec(0_u8..9, 1..200)) {
        formatted(&shaken(&gaps));
    }
}
