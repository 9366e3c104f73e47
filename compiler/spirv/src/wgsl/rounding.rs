//! Which results of a graph are rounded at a barrier. Knows what compilers do to arithmetic that they may reorder; knows
//! nothing of text.
//!
//! WGSL lets an implementation reorder arithmetic, and those there are do it in three places. Constants are merged:
//! (x + C) − D becomes x + (C − D), and (x·C)/D becomes x·(C/D). What is added and taken away again vanishes. A common
//! factor is taken out: x·a + y·a becomes (x + y)·a. Kernels count on the roundings that this takes away: the integer
//! nearest to x is (x + 1.5·2²³) − 1.5·2²³, and (a − (a − b)) − b the error of a − b.
//!
//! So the inner result of such a chain gets the barrier, and of two products one. So does a product that is added and
//! taken away: fused into one of the two sums only, it would not be the same number in both.

use isograd_graph::{Graph, Node, NodeId, Op, PerNode, Structure};

use Chain::{Products, Sums};

/// What constants are merged in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Chain {
    Sums,
    Products,
}

/// Per node whether its result is rounded at a barrier.
pub fn barriers(graph: &Graph, structure: &Structure) -> PerNode<bool> {
    let mut guarded = PerNode::new(graph, false);
    for chain in [Sums, Products] {
        // What meets a constant: the operands of the outer operations of the chain.
        let mut open = Vec::new();
        for (_, node) in graph.iter().filter(|(id, _)| structure.needed[*id]) {
            open.extend(beside_constant(graph, node, chain));
        }
        let mut seen = PerNode::new(graph, false);
        while let Some(id) = open.pop() {
            if std::mem::replace(&mut seen[id], true) {
                continue;
            }
            let node = graph[id];
            if beside_constant(graph, node, chain).is_some() {
                guarded[id] = true;
            } else {
                passed_on(structure, id, node, &mut open);
            }
        }
    }
    for (_, node) in graph.iter().filter(|(id, _)| structure.needed[*id]) {
        let Some([a, b]) = operands(graph, node, Sums) else { continue };
        for (sum, other) in [(a, b), (b, a)] {
            if operands(graph, graph[sum], Sums).is_some_and(|terms| terms.contains(&other)) {
                guarded[sum] = true;
                if operands(graph, graph[other], Products).is_some() {
                    guarded[other] = true;
                }
            }
        }
    }
    for (_, node) in graph.iter().filter(|(id, _)| structure.needed[*id]) {
        let Some([a, b]) = operands(graph, node, Sums) else { continue };
        if !guarded[a] && !guarded[b] && have_common_factor(graph, a, b) {
            guarded[a] = true;
        }
    }
    guarded
}

fn have_common_factor(graph: &Graph, a: NodeId, b: NodeId) -> bool {
    let same = |x: NodeId, y: NodeId| x == y || graph[x].is_constant() && graph[x] == graph[y];
    let (Node::Apply(op, _), Node::Apply(other, _)) = (graph[a], graph[b]) else { return false };
    let (Some(left), Some(right)) = (operands(graph, graph[a], Products), operands(graph, graph[b], Products)) else {
        return false;
    };
    match (op, other, left, right) {
        (Op::Mul, Op::Mul, left, right) => left.iter().any(|x| right.iter().any(|y| same(*x, *y))),
        (Op::Div, Op::Div, [_, x], [_, y]) => same(x, y),
        _ => false,
    }
}

/// The operands of an operation of the chain, without their signs.
fn operands(graph: &Graph, node: Node, chain: Chain) -> Option<[NodeId; 2]> {
    let Node::Apply(op, args) = node else { return None };
    let belongs = match op {
        Op::Add | Op::Sub => chain == Sums,
        Op::Mul | Op::Div | Op::Scale => chain == Products,
        _ => false,
    };
    match args.as_slice() {
        [a, b] if belongs => Some([unsigned(graph, *a), unsigned(graph, *b)]),
        _ => None,
    }
}

/// The operand that an operation of the chain has besides a constant. A scale by a constant is a product with one.
fn beside_constant(graph: &Graph, node: Node, chain: Chain) -> Option<NodeId> {
    let [a, b] = operands(graph, node, chain)?;
    match (graph[a].is_constant(), graph[b].is_constant()) {
        (false, true) => Some(a),
        (true, false) => Some(b),
        _ => None,
    }
}

fn unsigned(graph: &Graph, mut id: NodeId) -> NodeId {
    while let Node::Apply(Op::Neg, args) = graph[id]
        && let [a] = args.as_slice()
    {
        id = *a;
    }
    id
}

/// The values that one may be, as it is or with the other sign: an unrolled loop and a side of a branch make chains too.
fn passed_on(structure: &Structure, id: NodeId, node: Node, values: &mut Vec<NodeId>) {
    match node {
        Node::Apply(Op::Neg | Op::Select, _) => {}
        Node::Apply(..) => return,
        Node::Carried { .. } => values.push(structure.next[id]),
        _ => {}
    }
    node.each_operand(|x| values.push(x));
}

#[cfg(test)]
mod tests {
    use isograd_graph::ops::Family;
    use isograd_graph::{Builder, Mode, Precision, Scalar, Unwatched, verify};

    use super::*;

    /// The operations of the outputs that are rounded at barriers, as `op constant`.
    fn guarded(build: impl FnOnce(&mut Builder<'_>, NodeId, NodeId) -> NodeId) -> Vec<String> {
        let mut b = Builder::new(Mode::Real(Precision::F32), 1000, &Unwatched);
        let (x, y) = (b.input("x", Scalar::Real), b.input("y", Scalar::Real));
        let result = build(&mut b, x, y);
        b.output("z", result);
        let graph = verify(b.finish().unwrap()).unwrap();
        let structure = Structure::new(&graph, Family::Shader).unwrap();
        let barriers = barriers(&graph, &structure);
        graph
            .iter()
            .filter(|(id, _)| barriers[*id])
            .map(|(_, node)| {
                let Node::Apply(op, args) = node else { panic!("{node:?}") };
                let constant = args.as_slice().iter().find_map(|x| match graph[*x] {
                    Node::Real(bits) => Some(f64::from_bits(bits).to_string()),
                    Node::Int(n) => Some(n.to_string()),
                    _ => None,
                });
                format!("{op} {}", constant.unwrap_or_default()).trim().to_owned()
            })
            .collect()
    }

    fn real(b: &mut Builder<'_>, op: Op, x: NodeId, constant: f64) -> NodeId {
        let constant = b.real(constant);
        b.op(op, &[x, constant])
    }

    #[test]
    fn constants_of_sums_and_of_products() {
        let chain = |inner, outer| {
            guarded(|b, x, _| {
                let x = real(b, inner, x, 3.0);
                real(b, outer, x, 5.0)
            })
        };
        for (inner, outer) in
            [(Op::Add, Op::Sub), (Op::Sub, Op::Add), (Op::Mul, Op::Mul), (Op::Mul, Op::Div), (Op::Div, Op::Div)]
        {
            assert_eq!(chain(inner, outer), [format!("{inner} 3")]);
        }
        for (inner, outer) in [(Op::Add, Op::Mul), (Op::Mul, Op::Sub), (Op::Div, Op::Add)] {
            assert!(chain(inner, outer).is_empty(), "{inner} and {outer}");
        }
        let scaled = guarded(|b, x, _| {
            let two = b.int(2);
            let x = b.scale(x, two);
            real(b, Op::Mul, x, 3.0)
        });
        assert_eq!(scaled, ["scale 2"]);
    }

    /// The constant in front, signs between, three in a row, and no barrier for what no output needs.
    #[test]
    fn every_inner_one_of_a_chain_and_no_other() {
        let found = guarded(|b, x, y| {
            let (one, nine) = (b.real(1.0), b.real(9.0));
            let x = b.sub(one, x);
            let x = b.neg(x);
            let x = real(b, Op::Add, x, 7.0);
            let x = b.sub(nine, x);
            let apart = b.mul(x, y);
            let unneeded = real(b, Op::Add, apart, 2.0);
            real(b, Op::Add, unneeded, 2.0);
            real(b, Op::Add, apart, 3.0)
        });
        assert_eq!(found, ["sub 1", "sub 7"]);
    }

    #[test]
    fn what_is_added_and_taken_away() {
        let error = guarded(|b, x, y| {
            let difference = b.sub(x, y);
            let back = b.sub(x, difference);
            b.sub(back, y)
        });
        assert_eq!(error, ["sub"]);
        // Veltkamp's split: its product must be one number.
        let split = guarded(|b, x, _| {
            let product = real(b, Op::Mul, x, 4097.0);
            let rest = b.sub(product, x);
            b.sub(product, rest)
        });
        assert_eq!(split, ["mul 4097", "sub"]);
    }

    #[test]
    fn common_factors() {
        let found = guarded(|b, x, y| {
            let (xx, xy) = (b.mul(x, x), b.mul(x, y));
            let yy = b.mul(y, y);
            let sum = b.add(xx, yy);
            let other = b.neg(xy);
            let other = b.add(other, xx);
            b.max(sum, other)
        });
        assert_eq!(found, ["mul"]);
        let quotients = guarded(|b, x, y| {
            let (left, right) = (real(b, Op::Div, x, 3.0), real(b, Op::Div, y, 3.0));
            let (over, under) = (b.div(left, x), b.div(right, x));
            let (first, second) = (b.sub(left, right), b.add(over, under));
            let (three, four) = (b.div(x, y), b.div(x, left));
            let third = b.add(three, four);
            let all = b.max(first, second);
            b.max(all, third)
        });
        assert_eq!(quotients, ["div 3", "div"]);
        // One barrier of two products is enough.
        let once = guarded(|b, x, y| {
            let (left, right) = (real(b, Op::Mul, x, 3.0), real(b, Op::Mul, y, 3.0));
            let outer = real(b, Op::Mul, right, 5.0);
            let sum = b.add(left, right);
            b.max(sum, outer)
        });
        assert_eq!(once, ["mul 3"]);
    }

    #[test]
    fn branches_selections_and_loops_make_chains() {
        let found = guarded(|b, x, y| {
            let cond = b.lt(x, y);
            b.gamma(cond);
            let then = real(b, Op::Add, x, 1.0);
            b.otherwise();
            let otherwise = real(b, Op::Add, y, 2.0);
            let end = b.end();
            let joined = b.join(end, then, otherwise);
            let least = b.lt(joined, y);
            let other = real(b, Op::Sub, y, 3.0);
            let chosen = b.select(least, joined, other);
            real(b, Op::Sub, chosen, 4.0)
        });
        assert_eq!(found, ["add 1", "add 2", "sub 3"]);
        let steps = guarded(|b, x, _| {
            let (zero, ten) = (b.int(0), b.int(10));
            let start = real(b, Op::Mul, x, 3.0);
            b.theta(zero, ten);
            let carried = b.carried(start);
            let next = real(b, Op::Mul, carried, 0.5);
            let end = b.end();
            b.carry_out(end, carried, next)
        });
        assert_eq!(steps, ["mul 3", "mul 0.5"]);
    }
}
