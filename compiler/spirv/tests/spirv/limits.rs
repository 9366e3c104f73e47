//! What SPIR-V cannot do is said, and what it just can is done.

use isograd_graph::{Builder, NodeId, Precision, Scalar, Verified};
use isograd_spirv::{EmitError, Form, Group, Lack, Language, Plan, Signature};

use crate::garden::graph;
use crate::tools::{assert_valid, have, validate};

fn lack(result: Result<Vec<u8>, EmitError>) -> Option<Lack> {
    match result {
        Err(EmitError::Unsupported { target: Language::Spirv, lack, .. }) => Some(lack),
        _ => None,
    }
}

/// Branches in the sides of branches, or loops in loops, so deep.
fn nested(depth: u32, looping: bool) -> Verified {
    graph(Precision::F32, |b: &mut Builder<'_>| {
        let (x, n) = (b.input("x", Scalar::Real), b.input("n", Scalar::Int));
        let zero = b.int(0);
        let mut conds = Vec::new();
        let mut inner = x;
        for i in 0..depth {
            if looping {
                b.theta(zero, n);
                inner = b.carried(inner);
                conds.push(inner);
            } else {
                let limit = b.real(f64::from(i));
                let cond = b.lt(inner, limit);
                b.gamma(cond);
                inner = b.add(inner, x);
            }
        }
        let mut result: NodeId = b.mul(inner, x);
        for _ in 0..depth {
            if looping {
                let end = b.end();
                let carried = conds.pop().unwrap();
                result = b.carry_out(end, carried, result);
            } else {
                b.otherwise();
                let end = b.end();
                result = b.join(end, result, x);
            }
        }
        b.output("y", result);
    })
}

/// `spirv-val` takes time by the cube of the depth, so it looks at a shallower nest.
#[test]
fn constructs_nest_as_deep_as_the_standard_allows() {
    let signature = signature(2);
    for looping in [false, true] {
        let [kernel, library] = [Form::Kernel { varying: &[true, true] }, Form::Library(&signature)];
        // A function has no question for the point around it.
        for (form, most, environment) in [(kernel, 1022, "vulkan1.1"), (library, 1023, "spv1.3")] {
            let emit = |depth| Plan::new(&nested(depth, looping), form.clone()).expect("a plan").spirv();
            assert!(emit(most).is_ok(), "{most} deep, looping: {looping}");
            assert_eq!(lack(emit(most + 1)), Some(Lack::Nesting { depth: most + 1, most }));
            if have("spirv-val") {
                assert_eq!(validate(&emit(60).unwrap(), environment), Ok(()), "looping: {looping}");
            }
        }
    }
}

fn signature(parameters: usize) -> Signature {
    let parameters = (0..parameters).map(|i| Group { name: format!("p{i}"), scalars: 1 }).collect();
    let results = vec![Group { name: "y".to_owned(), scalars: 1 }];
    Signature { name: "f".to_owned(), parameters, results }
}

#[test]
fn functions_take_255_parameters() {
    let with = |count: usize| {
        graph(Precision::F32, |b| {
            let inputs: Vec<NodeId> = (0..count).map(|i| b.input(format!("p{i}"), Scalar::Real)).collect();
            let sum = inputs.into_iter().reduce(|x, y| b.add(x, y)).unwrap();
            b.output("y", sum);
        })
    };
    let (most, more) = (with(255), with(256));
    let signatures = [signature(255), signature(256)];
    let module = Plan::new(&most, Form::Library(&signatures[0])).unwrap().spirv().expect("emits");
    if have("spirv-val") {
        validate(&module, "spv1.3").unwrap();
    }
    let plan = Plan::new(&more, Form::Library(&signatures[1])).unwrap();
    assert_eq!(lack(plan.spirv()), Some(Lack::Parameters { count: 256 }));
    // A kernel has no parameters.
    let module = Plan::new(&more, Form::Kernel { varying: &[true; 256] }).unwrap().spirv().expect("emits");
    if have("spirv-val") {
        assert_valid(&module, "256 inputs");
    }
}

#[test]
fn values_have_16383_members() {
    let with = |count: usize| {
        graph(Precision::F32, |b| {
            let x = b.input("x", Scalar::Real);
            (0..count).for_each(|i| b.output(format!("y{i}"), x));
        })
    };
    let group = |scalars| Group { name: "g".to_owned(), scalars };
    let mut function = signature(1);
    let mut emit = |count: usize, results: Vec<Group>| {
        function.results = results;
        Plan::new(&with(count), Form::Library(&function)).unwrap().spirv()
    };
    for results in [vec![group(16_383)], vec![group(1); 16_383]] {
        let module = emit(16_383, results).expect("emits");
        if have("spirv-val") {
            validate(&module, "spv1.3").unwrap();
        }
    }
    for results in [vec![group(16_384)], vec![group(1); 16_384]] {
        assert_eq!(lack(emit(16_384, results)), Some(Lack::Members { count: 16_384, most: 16_383 }));
    }
}
