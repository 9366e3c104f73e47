//! The column of the GPU: a request compiled to SPIR-V and executed on a Vulkan device, judged by the rules of
//! `isograd_testkit::gpu::bits`. Counts what it compared and what the rules excused.

use std::sync::{LazyLock, Mutex};

use isograd_compiler::{Checked, Request};
use isograd_graph::Value;
use isograd_testkit::gpu::bits::{self, At, Made, Missing, Rule, Tally};
use isograd_testkit::laws;
use isograd_vulkan::Device;

/// The device, or what is missing.
static DEVICE: LazyLock<Result<Device, Missing>> = LazyLock::new(bits::device);
static TOOLS: LazyLock<Result<(), Missing>> = LazyLock::new(bits::tools);
static TALLY: Mutex<Option<Tally>> = Mutex::new(None);

/// Whether there is a device that computes with f64.
pub fn doubles() -> bool {
    DEVICE.as_ref().is_ok_and(|device| device.info().doubles)
}

/// The results on the device at points are those of WebAssembly, by the rules. Nothing is asked where there is no
/// device.
pub fn judge(checked: &Checked, request: &Request, points: &[Vec<Value>]) -> Result<(), String> {
    let Ok(device) = &*DEVICE else { return Ok(()) };
    let made = bits::of_request(checked, request, &request.export, At::Given(points), TOOLS.is_ok());
    let prepared = match made.map_err(|e| e.what)? {
        Made::Ready(prepared) => prepared,
        Made::Refused(_) => {
            count(Tally { refused: 1, ..Tally::default() });
            return Ok(());
        }
        Made::TooLarge { validated } => {
            count(Tally { validated, large: 1, ..Tally::default() });
            return Ok(());
        }
    };
    if prepared.points.len() < points.len() {
        return Err("the reference takes too many steps".to_owned());
    }
    let (strayed, graph) = laws::wasm_equals_shader_graph(&prepared);
    let (executed, different) = laws::wasm_equals_spirv(&prepared, device);
    count(Tally { validated: prepared.validated, ..strayed });
    count(executed);
    graph.or(different).map_or(Ok(()), |failure| Err(failure.what))
}

fn count(tally: Tally) {
    *TALLY.lock().expect("no test panicked while counting").get_or_insert_default() += tally;
}

/// What was compared, and what is missing; whether something is that is demanded.
pub fn report() -> (String, bool) {
    let missing: Vec<&Missing> = TOOLS.as_ref().err().into_iter().chain(DEVICE.as_ref().err()).collect();
    let mut lines: Vec<String> = missing.iter().map(ToString::to_string).collect();
    if let Ok(device) = &*DEVICE {
        let tally = TALLY.lock().expect("no test panicked while counting").unwrap_or_default();
        let Tally { validated, kernels, values, different, excused, refused, large, .. } = tally;
        let rules: Vec<String> = Rule::ALL.iter().zip(excused).map(|(r, n)| format!("{n} {}", r.name())).collect();
        lines.push(format!(
            "SPIR-V on {}: {validated} modules validated, {kernels} kernels executed, {values} values compared, \
             {different} different, excused: {}; {refused} refused, {large} too large; {}",
            device.info().name,
            rules.join(", "),
            bits::validation(device.messages().len()),
        ));
    }
    let messages = DEVICE.as_ref().map(Device::messages).unwrap_or_default();
    lines.extend(messages.iter().take(5).cloned());
    (lines.join("\n"), missing.iter().any(|m| m.demanded) || !messages.is_empty())
}
