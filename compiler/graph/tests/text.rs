//! The text form reads back, and says which line is wrong.

use isograd_graph::{Precision, Value, evaluate, parse, print, verify};

const LOOP: &str = "\
precision f64
%0 = input x: real
%1 = input n: int
%2 = int 0
%3 = real 1.0
%4 = theta %2 %1
  %5 = carried %4 %3
  %6 = counter %4
  %7 = int_to_real %6
  %8 = lt %7 %0
  %9 = gamma %8
    %10 = mul %5 %0
  %11 = else
    %12 = real -inf
    %13 = max %5 %12
  %14 = end
  %15 = join %14 %10 %13
%16 = end
%17 = final %4 %5 %15
output value.x/a b %17
";

#[test]
fn a_graph_reads_back() {
    let text = LOOP.replace("final %4", "final %16");
    let graph = parse(&text).unwrap();
    assert_eq!(print(&graph), text);
    let graph = verify(graph).unwrap();
    let run = |n| evaluate(&graph, Precision::F64, &[Value::Real(2.0), Value::Int(n)]).unwrap();
    assert_eq!(run(0), [Value::Real(1.0)]);
    assert_eq!(run(5), [Value::Real(4.0)]);
}

#[test]
fn a_malformed_graph_is_read_and_refused_by_the_verifier() {
    assert!(verify(parse(LOOP).unwrap()).is_err());
    assert!(verify(parse("%0 = input x: real\n%1 = theta %0 %0\n").unwrap()).is_err());
    assert!(verify(parse("%0 = input x: int\n%1 = sqrt %0\n").unwrap()).is_err());
}

#[test]
fn a_line_that_is_no_node_is_named() {
    let cases = [
        ("%0 = real", 1, "``"),
        ("%0 = real one", 1, "`one`"),
        ("%0 = int 2147483648", 1, "`2147483648`"),
        ("%0 = real 1.0\n%2 = neg %0", 2, "%1"),
        ("%0 = real 1.0\n%1 = neg %0 %0", 2, "other operands"),
        ("%0 = real 1.0\n\n%1 = negate %0", 3, "`negate`"),
        ("%0 = else", 1, "no branch"),
        ("%0 = end", 1, "nothing to end"),
        ("%0 = input x: vec3", 1, "`vec3`"),
        ("precision f16", 1, "`f16`"),
        ("output x", 1, "an output"),
        ("nonsense", 1, "a word"),
        ("%0 real 1.0", 1, "`=`"),
    ];
    for (text, line, what) in cases {
        let error = parse(text).unwrap_err();
        assert!(error.line == line && error.what.contains(what), "{text}: {error}");
    }
}
