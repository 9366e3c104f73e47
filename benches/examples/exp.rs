#![allow(missing_docs, unsafe_code, dead_code)]
#[path = "../src/measure.rs"]
mod measure;
#[path = "../src/models.rs"]
mod models;
#[path = "../src/peers.rs"]
mod peers;
use isograd_compiler::*;
use measure::*;
use std::time::{Duration, Instant};

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let filter = args.get(1).cloned().unwrap_or_default();
    let opts: Vec<&str> = args.get(2).map(|s| s.split(',').collect()).unwrap_or(vec!["none", "speed"]);
    let effort = Effort { rounds: 41, turn: Duration::from_millis(2) };
    for m in models::all() {
        if !filter.is_empty() && !m.name.starts_with(&filter) { continue; }
        println!("== {} steps ops {}", m.name, m.steps.operations());
        let loader = MemoryLoader::default();
        let o = Options::default();
        for grad in [false, true] {
            let w = Stopwatch::default();
            let t0 = Instant::now();
            let checked = check("m.vola", m.vola.clone().into_bytes(), &loader, &o, &w);
            if !checked.is_ok() { println!("{:?}", checked.diagnostics); continue; }
            let queries = if grad { vec![Query::Value, Query::Gradient("at".into())] } else { vec![Query::Value] };
            let req = Request { export: "field".into(), queries, ..Default::default() };
            let art = match compile(&checked, &req, &o, &w) { Ok(a) => a, Err(e) => { println!("{e:?}"); continue; } };
            let total = t0.elapsed();
            if let Ok(p) = std::env::var("DUMP") { std::fs::write(format!("{p}/{}-{}.wasm", m.name.replace(' ', "_"), grad), &art.bytes).unwrap(); }
            let mf = &art.manifest;
            println!(" grad={grad} ops {} bytes {} block {} pad {} compile {:.2} ms: {}", mf.operations, art.bytes.len(), mf.block, mf.pad, total.as_secs_f64()*1e3,
                w.finish().iter().map(|(n,t)| format!("{n} {:.0}", t*1e6)).collect::<Vec<_>>().join(" "));
            let block = mf.block as usize;
            let pts = models::points(block, 7);
            for opt in &opts {
                let mut cfg = wasmtime::Config::new();
                cfg.cranelift_opt_level(match *opt { "none" => wasmtime::OptLevel::None, _ => wasmtime::OptLevel::Speed });
                cfg.signals_based_traps(true);
                let eng = wasmtime::Engine::new(&cfg).unwrap();
                let t0 = Instant::now();
                let module = wasmtime::Module::new(&eng, &art.bytes).unwrap();
                let ct = t0.elapsed();
                let mut store = wasmtime::Store::new(&eng, ());
                let inst = wasmtime::Instance::new(&mut store, &module, &[]).unwrap();
                let mem = inst.get_memory(&mut store, "memory").unwrap();
                let f = inst.get_typed_func::<i32, ()>(&mut store, "eval").unwrap();
                for (c, col) in mf.inputs[0].columns.iter().zip(&pts) {
                    let bytes: Vec<u8> = col.iter().flat_map(|x| x.to_le_bytes()).collect();
                    mem.write(&mut store, c.offset as usize, &bytes).unwrap();
                }
                let mut peer = peers::Fidget::new(&m.steps, &pts, block).unwrap();
                let r = race(effort, || {
                    unsafe { std::arch::x86_64::_mm256_zeroupper() };
                    f.call(&mut store, block as i32).unwrap();
                }, || if grad { peer.run_gradients() } else { peer.run_values() });
                let read = |store: &wasmtime::Store<()>, off: u32| -> Vec<f32> {
                    let d = &mem.data(store)[off as usize..off as usize + 4 * block];
                    d.chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
                };
                let mut worst = 0f32;
                let v = read(&store, mf.outputs[0].columns[0].offset);
                for (a, b) in v.iter().zip(peer.values()) { worst = worst.max((a - b).abs()); }
                if grad {
                    let g = peer.gradients();
                    let mut big = 0;
                    for k in 0..3 {
                        let d = read(&store, mf.outputs[1].columns[k].offset);
                        for (a, b) in d.iter().zip(&g) { let e = (a - b.d(k)).abs(); if e > 1e-3 { big += 1; } else { worst = worst.max(e); } }
                    }
                    if big > 0 { println!("   {big} of {} partials differ by > 1e-3", 3 * block); }
                }
                println!("   {opt:6} ours {:8.3} ns  fidget {:8.3} ns  ratio {:.3}  diff {worst:.1e} cranelift {:.2} ms ({:.2} us/op)",
                    r.ours / block as f64 * 1e9, r.theirs / block as f64 * 1e9, r.ratio, ct.as_secs_f64() * 1e3, ct.as_secs_f64() * 1e6 / f64::from(mf.operations));
            }
        }
    }
}
