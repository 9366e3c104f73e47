//! Laws of equal bits between WebAssembly and shaders: by the reference for the shader's graph, by a device for its
//! words. What may differ is said by the rules of [`crate::gpu::bits`].

use isograd_vulkan::Device;

use super::{Failure, show};
use crate::gpu::bits::{Difference, Prepared, Tally, Verdict, held_to};

/// WebAssembly ≡ the shader's own graph, run by the reference: nothing is excused. The counts have what strayed.
#[must_use]
pub fn wasm_equals_shader_graph(prepared: &Prepared) -> (Tally, Option<Failure>) {
    let Verdict { tally, first, .. } = prepared.by_reference();
    let what = "the reference of the shader's graph";
    let failure = first.map(|d| differs(prepared, &d, what, "before a device is asked"));
    (Tally { strayed: tally.different, ..Tally::default() }, failure)
}

/// WebAssembly ≡ SPIR-V on a device, but for what a rule excuses; a real GPU is held to bounds.
#[must_use]
pub fn wasm_equals_spirv(prepared: &Prepared, device: &Device) -> (Tally, Option<Failure>) {
    match prepared.executed(device) {
        Err(failure) => (Tally::default(), Some(failure)),
        Ok(rows) => {
            let Verdict { tally, first, .. } = prepared.judged(&rows, held_to(device));
            let failure = first.map(|d| {
                let begins = prepared.origin(d.point, device).unwrap_or("where it begins cannot be seen".to_owned());
                differs(prepared, &d, "SPIR-V", &begins)
            });
            (Tally { kernels: 1, ..tally }, failure)
        }
    }
}

fn differs(prepared: &Prepared, difference: &Difference, who: &str, place: &str) -> Failure {
    let Difference { point, output, wanted, found } = difference;
    let names: Vec<&str> =
        prepared.manifest.outputs.iter().flat_map(|p| p.columns.iter().map(|c| c.name.as_str())).collect();
    let name = names.get(*output).copied().unwrap_or_default();
    let at = prepared.points.get(*point).map_or(&[][..], Vec::as_slice);
    let bits = |value: isograd_graph::Value| match value {
        isograd_graph::Value::Real(x) if prepared.manifest.precision == "f64" => {
            format!("{x:?} ({:#018x})", x.to_bits())
        }
        #[expect(clippy::cast_possible_truncation, reason = "an f32 held in an f64")]
        isograd_graph::Value::Real(x) => format!("{x:?} ({:#010x})", (x as f32).to_bits()),
        other => show(&[other]),
    };
    let what = format!(
        "point {point}, output {output} `{name}`, at {}: WebAssembly {}, {who} {} ({place})",
        show(at),
        bits(*wanted),
        bits(*found),
    );
    prepared.failure(what)
}
