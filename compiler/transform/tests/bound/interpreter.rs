//! The interpreter that encloses all values of a graph at once, against expanded graphs and by hand. Knows no source text.

use super::*;

#[test]
fn the_interpreter_gives_the_ends_that_the_expanded_graph_gives() {
    let (mut same, mut bounded) = (0, 0);
    for seed in 0..300 {
        let mut random = random::Random(seed ^ 0x7e57);
        let [[a, b], [c, d]] = ends(&mut random);
        let z = random.real();
        // Without loops both see the same: a loop's nodes are joined over its iterations.
        let depth = usize::from(seed % 2 == 0);
        let mut no_loops = None;
        let plain = build(&["x", "y", "z"], |b, i| random::plain(seed, depth, b, i));
        if plain.iter().any(|(_, n)| matches!(n, isograd_graph::Node::Theta { .. })) {
            no_loops = Some(());
        }
        let bounds = build(&["x", "y", "z"], |builder, i| {
            let values = random::plain(seed, depth, builder, i);
            let [a, b, c, d, z] = [a, b, c, d, z].map(|x| builder.real(x));
            let over = [(i[0], a, b), (i[1], c, d), (i[2], z, z)];
            values.into_iter().flat_map(|v| parts(builder, v, &over)).collect()
        });
        let folded = fold(&plain, P, MANY, &Unwatched).unwrap();
        let real = |lo, hi| Hull::Real { lo, hi, nan: false };
        let boxes = [real(a, b), real(c, d), real(z, z)];
        let loops = Loops::Run { max_steps: 1_000_000 };
        let found = enclosures(&folded, &boxes, P, loops, &Unwatched).unwrap();
        let loose = enclosures(&folded, &boxes, P, Loops::Unbounded, &Unwatched).unwrap();
        let raw = enclosures(&plain, &boxes, P, loops, &Unwatched).unwrap();
        let out = run(&finished(&expanded(&bounds, Sweep::Forward)), &[0.0, 0.0, z]);
        for (k, part) in out.chunks(3).enumerate() {
            let [hull, loose, raw] = [(&found, &folded), (&loose, &folded), (&raw, &plain)]
                .map(|(found, graph)| found[graph.outputs[k].node.index()]);
            let Hull::Real { lo, hi, nan } = hull else { panic!("{hull:?}") };
            assert_eq!(format!("{hull:?}"), format!("{raw:?}"), "seed {seed}: raw and folded differ");
            if no_loops.is_none() {
                let bits = [part[0], part[1]].map(|x| (x + 0.0).to_bits());
                assert_eq!(bits, [lo, hi].map(|x| (x + 0.0).to_bits()), "seed {seed}: {part:?}\n{}", print(&folded));
                assert_eq!(part[2] == 1.0, nan, "seed {seed}: {part:?}\n{}", print(&folded));
                same += 1;
                bounded += usize::from(lo.is_finite());
            }
            for wide in [hull, loose] {
                let Hull::Real { lo: l, hi: h, .. } = wide else { panic!("{wide:?}") };
                // NaN where a loop's end is known may be a number where it is not; then it reads as anything.
                let anything = part[0].is_nan() || part[1] - part[0] == f64::INFINITY && part[2] == 1.0 && nan;
                assert!(anything || l <= part[0] && part[1] <= h, "seed {seed}: {part:?} not in {wide:?}");
            }
        }
    }
    assert!(same > 200 && bounded > 100, "{same} {bounded}");
}

#[test]
fn the_interpreter_leaves_out_what_is_never_reached() {
    let text = "
        %0 = input x: real
        %1 = real 0
        %2 = lt %0 %1
        %3 = gamma %2
          %4 = neg %0
        %5 = else
          %6 = add %0 %0
        %7 = end
        %8 = join %7 %4 %6
        output y %8";
    let graph = verify(parse(text).unwrap()).unwrap().into_inner();
    let at = |lo, hi| {
        let found = enclosures(&graph, &[Hull::Real { lo, hi, nan: false }], P, Loops::Unbounded, &Unwatched).unwrap();
        (found[4], found[6], found[8])
    };
    let real = |lo, hi| Hull::Real { lo, hi, nan: false };
    assert_eq!(at(1.0, 2.0), (Hull::Never, real(2.0, 4.0), real(2.0, 4.0)));
    assert_eq!(at(-3.0, -2.0), (real(2.0, 3.0), Hull::Never, real(2.0, 3.0)));
    assert_eq!(at(-3.0, 2.0), (real(-2.0, 3.0), real(-6.0, 4.0), real(-6.0, 4.0)));
}

#[test]
fn the_interpreter_runs_loops_up_to_its_budget() {
    // y doubles from 1, ten times; z keeps its content; the body's counter.
    let graph = build(&["x"], |b, i| {
        let (lo, hi, one) = (b.int(0), b.int(10), b.real(1.0));
        b.theta(lo, hi);
        let y = b.carried(one);
        let z = b.carried(i[0]);
        let counter = b.counter();
        let count = b.int_to_real(counter);
        let double = b.add(y, y);
        let held = b.min(double, count);
        let end = b.end();
        let y = b.carry_out(end, y, double);
        let z = b.carry_out(end, z, z);
        let seven = b.real(7.0);
        let _ = held;
        vec![y, z, b.min(y, seven)]
    });
    let input = [Hull::Real { lo: 3.0, hi: 4.0, nan: false }];
    let outputs = |loops| {
        let found = enclosures(&graph, &input, P, loops, &Unwatched).unwrap();
        (graph.outputs.iter().map(|o| found[o.node.index()]).collect::<Vec<_>>(), found)
    };
    let real = |lo, hi| Hull::Real { lo, hi, nan: false };
    let (run, all) = outputs(Loops::Run { max_steps: 1000 });
    assert_eq!(run, [real(1024.0, 1024.0), real(3.0, 4.0), real(7.0, 7.0)]);
    let counter = graph.iter().find(|(_, n)| matches!(n, isograd_graph::Node::Counter { .. })).unwrap().0;
    assert_eq!(all[counter.index()], Hull::Int { lo: 0, hi: 9 });
    for loops in [Loops::Unbounded, Loops::Run { max_steps: 40 }] {
        let (run, all) = outputs(loops);
        assert_eq!(run[0], Hull::anything(Scalar::Real));
        assert_eq!(run[1], real(3.0, 4.0));
        assert_eq!(all[counter.index()], Hull::Int { lo: 0, hi: 9 });
    }
}
