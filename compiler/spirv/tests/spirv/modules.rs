//! Every operation and random control flow, in kernels and libraries.

use isograd_graph::Verified;
use isograd_graph::ops::Family;
use isograd_spirv::{Form, Plan};

use crate::garden::{PRECISIONS, Random, Soil, graph, random, single};
use crate::tools::{assert_valid, have};

pub fn kernel(graph: &Verified, varying: &[bool]) -> Vec<u8> {
    let plan = Plan::new(graph, Form::Kernel { varying }).expect("a plan");
    plan.spirv().unwrap_or_else(|error| panic!("{error}\n{}", isograd_graph::print(graph)))
}

#[test]
fn every_operation_makes_a_valid_kernel() {
    let check = have("spirv-val");
    let mut modules = 0;
    for precision in PRECISIONS {
        for op in Soil::of(Family::Shader).operations {
            let graph = single(op, precision);
            let varying: Vec<bool> = (0..graph.inputs.len()).map(|i| i % 2 == 0).collect();
            let module = kernel(&graph, &varying);
            if check {
                assert_valid(&module, &format!("{op} in {}", precision.name()));
            }
            modules += 1;
        }
    }
    assert!(modules >= 80, "{modules}");
}

#[test]
fn random_control_flow_makes_valid_kernels() {
    let check = have("spirv-val");
    let (mut phis, mut selects, mut tapes) = (0, 0, 0);
    for precision in PRECISIONS {
        for seed in 0..150 {
            let graph = random(seed, precision, &Soil::of(Family::Shader), 14);
            let mut rates = Random(seed);
            let varying: Vec<bool> = graph.inputs.iter().map(|_| rates.below(2) == 0).collect();
            let module = kernel(&graph, &varying);
            let text = isograd_spirv::disassemble(&module).unwrap();
            phis += text.matches("OpPhi").count();
            selects += text.matches("OpSelectionMerge").count();
            tapes += text.matches("\"tape\"").count();
            if check {
                assert_valid(&module, &format!("seed {seed}\n{}", isograd_graph::print(&graph)));
            }
        }
    }
    // The garden grows what it should.
    assert!(phis > 2000 && selects > 500 && tapes > 50, "{phis} phis, {selects} selections, {tapes} tapes");
}

#[test]
fn kernels_without_inputs_or_outputs_are_valid() {
    let check = have("spirv-val");
    for precision in PRECISIONS {
        let constant = graph(precision, |b| {
            for (name, x) in [("zero", 0.0), ("minus", -0.0), ("inf", f64::INFINITY), ("nan", f64::NAN)] {
                let x = b.real(x);
                b.output(name, x);
            }
        });
        let module = kernel(&constant, &[]);
        let text = isograd_spirv::disassemble(&module).unwrap();
        assert!(!text.contains("\"inputs\"") && !text.contains("\"uniforms\""), "{text}");
        let empty = kernel(&graph(precision, |_| {}), &[]);
        assert!(!isograd_spirv::disassemble(&empty).unwrap().contains("\"outputs\""));
        if check {
            assert_valid(&module, "constants");
            assert_valid(&empty, "nothing");
        }
    }
}
