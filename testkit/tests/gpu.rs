//! WebAssembly ≡ SPIR-V, bit for bit, on a Vulkan device: every example, every specimen of the standard library, every
//! operation of the table, graphs and programs grown from seeds, and functions that another kernel links. The rules by
//! which a difference is excused are those of `isograd_testkit::gpu::bits`. Prints a table at its end, passed or not.
//!
//! ```sh
//! cargo test --release --test gpu                      # the short form
//! ISOGRAD_LONG=1 cargo test --release --test gpu       # more points, more graphs
//! cargo test --release --test gpu -- 'graphs: seed 7'  # cases whose name contains this; with --exact: that one
//! ```
//!
//! A real GPU is held to bounds where it has other bits, a software device to the bits; `ISOGRAD_GPU_BOUNDS` chooses.
//! Without a Vulkan device the shaders' graphs are still compared by the reference, and what is missing is printed;
//! `ISOGRAD_REQUIRE_VULKAN=1` makes it a failure, as `ISOGRAD_REQUIRE_SPIRV_TOOLS=1` does without SPIRV-Tools.

use std::collections::{BTreeMap, BTreeSet};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::thread;
use std::time::{Duration, Instant};

use isograd_graph::{Precision, Value};
use isograd_testkit::gpu::bits::corpora::{Case, Corpus, all, extent};
use isograd_testkit::gpu::bits::planted::{self, Mistake};
use isograd_testkit::gpu::bits::{self, HeldTo, MOST_EXCUSED, MOST_OPERATIONS, Made, Missing, Prepared, Rule, Tally};
use isograd_testkit::laws::{self, Failure};
use isograd_vulkan::Device;
use libtest_mimic::Arguments;

/// Failures that are printed in full.
const SHOWN: usize = 12;

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let start = Instant::now();
    let tools = bits::tools();
    let device = bits::device();
    let cases = chosen(all(&extent(), tools.is_ok()), &arguments);
    if arguments.list {
        cases.iter().for_each(|case| println!("{}: test", case.name));
        return ExitCode::SUCCESS;
    }
    let mut report = Report::default();
    run(&cases, device.is_ok(), tools.is_ok(), &mut report);
    if let Ok(device) = &device {
        report.failures.extend(controls(device, tools.is_ok()));
    }
    let missing: Vec<&Missing> = tools.as_ref().err().into_iter().chain(device.as_ref().err()).collect();
    report.print(device.as_ref().ok(), &missing, start.elapsed());
    let whole = arguments.filter.is_none() && arguments.skip.is_empty();
    let complaints = report.complaints(device.as_ref().ok(), &missing, whole);
    complaints.iter().for_each(|complaint| println!("FAILED: {complaint}"));
    if complaints.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn chosen(mut cases: Vec<Case>, arguments: &Arguments) -> Vec<Case> {
    let meant = |name: &str, part: &String| if arguments.exact { name == part } else { name.contains(part.as_str()) };
    cases.retain(|case| arguments.filter.as_ref().is_none_or(|part| meant(&case.name, part)));
    cases.retain(|case| !arguments.skip.iter().any(|part| meant(&case.name, part)));
    cases
}

/// Each mistake that is planted in a module is seen.
fn controls(device: &Device, tools: bool) -> Vec<Failure> {
    let failed = |what: String| Failure { law: "planted_mistakes_are_seen", subject: "controls".to_owned(), what };
    let points = isograd_testkit::points::in_box(&[(0.5, 1.0), (1.25, 2.0)], 64, 1);
    let points = points.iter().map(|p| p.iter().map(|x| Value::Real(Precision::F32.round(*x))).collect()).collect();
    let right = match bits::of_graph(&planted::graph(), Precision::F32, false, false, "controls", points, tools) {
        Ok(Made::Ready(right)) => right,
        Ok(_) => return vec![failed("the graph of the controls is refused".to_owned())],
        Err(failure) => return vec![failure],
    };
    // Buffers are used again: what lies in them must not be what is expected.
    let mut other = (*right).clone();
    other.points.reverse();
    let mut failures: Vec<Failure> = laws::wasm_equals_spirv(&right, device).1.into_iter().collect();
    for mistake in Mistake::ALL {
        let Some(wrong) = mistake.plant(&right) else {
            failures.push(failed(format!("there is no place for the mistake {mistake:?}")));
            continue;
        };
        if tools && let Err(e) = bits::validate(&wrong.module) {
            failures.push(failed(format!("{mistake:?} makes the module invalid: {e}")));
        }
        failures.extend(other.executed(device).err());
        let tally = laws::wasm_equals_spirv(&wrong, device).0;
        if tally.different + tally.within + tally.unjudged == 0 {
            failures.push(failed(format!("nobody sees the mistake {mistake:?}")));
        }
    }
    println!("{} mistakes planted, {} not seen", Mistake::ALL.len(), failures.len());
    failures
}

/// What was found.
#[derive(Default)]
struct Report {
    rows: BTreeMap<(Corpus, &'static str), (Tally, Duration)>,
    failures: Vec<Failure>,
    refusals: BTreeMap<String, usize>,
    texts: BTreeMap<String, String>,
    /// What the validation layer said.
    messages: Vec<String>,
}

/// What became of a case.
struct Outcome {
    tally: Tally,
    failures: Vec<Failure>,
    /// The program or graph, if something failed.
    text: Option<String>,
    /// Why the target refused it.
    refusal: Option<String>,
    /// How long the device had work.
    executing: Duration,
}

/// All cores take cases, each with a device of its own: a software driver compiles on one core.
fn run(cases: &[Case], device: bool, tools: bool, report: &mut Report) {
    let next = AtomicUsize::new(0);
    let workers = thread::available_parallelism().map_or(2, usize::from);
    let (sender, receiver) = channel();
    let messages = Mutex::new(Vec::new());
    thread::scope(|scope| {
        for _ in 0..workers {
            let (sender, next, messages) = (sender.clone(), &next, &messages);
            scope.spawn(move || {
                let open = || if device { bits::device().ok() } else { None };
                let close = |device: Option<Device>| {
                    let said = device.map(|device| device.messages()).unwrap_or_default();
                    messages.lock().expect("no worker panicked").extend(said);
                };
                let mut device = open();
                while let Some(case) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let (outcome, usable) = outcome(case, device.as_ref(), tools);
                    if !usable {
                        // It may be at work for ever.
                        close(std::mem::replace(&mut device, open()));
                    }
                    if sender.send((case, outcome)).is_err() {
                        break;
                    }
                }
                close(device);
            });
        }
        drop(sender);
        receiver.into_iter().for_each(|(case, outcome)| report.add(case, outcome));
    });
    report.messages = messages.into_inner().expect("no worker panicked");
}

/// Makes a case and judges it; also whether the device can still be used.
fn outcome(case: &Case, device: Option<&Device>, tools: bool) -> (Outcome, bool) {
    let mut outcome =
        Outcome { tally: Tally::default(), failures: Vec::new(), text: None, refusal: None, executing: Duration::ZERO };
    let mut usable = true;
    match case.make(tools) {
        Ok(Some(Made::Ready(prepared))) => usable = judge(&prepared, device, &mut outcome),
        Ok(Some(Made::Refused(why))) => (outcome.tally.refused, outcome.refusal) = (1, Some(why)),
        Ok(Some(Made::TooLarge { validated })) => (outcome.tally.validated, outcome.tally.large) = (validated, 1),
        Ok(None) => {}
        Err(failure) => outcome.failures.push(failure),
    }
    (outcome, usable)
}

fn judge(prepared: &Prepared, device: Option<&Device>, outcome: &mut Outcome) -> bool {
    let (tally, strayed) = laws::wasm_equals_shader_graph(prepared);
    outcome.tally = Tally { validated: prepared.validated, ..tally };
    outcome.failures.extend(strayed);
    let mut usable = true;
    if let Some(device) = device {
        let start = Instant::now();
        let (executed, different) = laws::wasm_equals_spirv(prepared, device);
        outcome.executing = start.elapsed();
        usable = executed.kernels > 0;
        outcome.tally += executed;
        outcome.failures.extend(different);
    }
    if !outcome.failures.is_empty() {
        outcome.text = Some(prepared.subject.text.clone());
    }
    usable
}

impl Report {
    fn add(&mut self, case: &Case, outcome: Outcome) {
        let Outcome { tally, failures, text, refusal, executing } = outcome;
        if let Some(why) = refusal {
            *self.refusals.entry(why).or_default() += 1;
        }
        self.failures.extend(failures);
        self.texts.extend(text.map(|text| (case.name.clone(), text)));
        let (sum, time) = self.rows.entry((case.corpus, case.precision.name())).or_default();
        *sum += tally;
        *time += executing;
    }

    fn print(&self, device: Option<&Device>, missing: &[&Missing], took: Duration) {
        for failure in self.failures.iter().take(SHOWN) {
            let Failure { law, subject, what } = failure;
            println!("\nthe law `{law}` does not hold: {what}\n  {subject}");
            println!("  replay: cargo test --release --test gpu -- --exact '{}'", first_line(subject));
            // Programs of files are named; what was grown is shown.
            if let Some(text) = self.texts.get(subject).filter(|text| text.len() < 4_000 && !subject.contains(".vola"))
            {
                println!("{text}");
            }
        }
        if self.failures.len() > SHOWN {
            println!("\n{} more failures are not shown", self.failures.len() - SHOWN);
        }
        println!();
        let rules = Rule::ALL.map(Rule::name);
        println!(
            "{:27}{:>10}{:>9}{:>8}{:>7}{:>9}{:>9}{:>10}{:>10}{:>10}   excused: {:>7}{:>10}{:>11}{:>6}{:>8}{:>8}",
            "WebAssembly ≡ SPIR-V",
            "validated",
            "executed",
            "refused",
            "large",
            "points",
            "normal",
            "values",
            "different",
            "reference",
            rules[0],
            rules[1],
            rules[2],
            rules[3],
            rules[4],
            "seconds",
        );
        let mut sum = (Tally::default(), Duration::ZERO);
        for ((corpus, precision), (tally, time)) in &self.rows {
            sum.0 += *tally;
            sum.1 += *time;
            line(&format!("{} {precision}", corpus.name()), tally, *time);
        }
        let (sum, executing) = sum;
        line("all", &sum, executing);
        println!(
            "validated: modules that spirv-val and our lints accept; executed: kernels; refused: beyond a limit of the \
             target, with a diagnostic;\nlarge: more than {MOST_OPERATIONS} operations, not executed; normal: points at which the reference meets neither NaN nor infinity, nor \
             subnormals nor long loops (of the others {} have equal bits all the same);\ndifferent: values with other bits on the \
             device, not excused; reference: values of the shader's graph with other bits, by the reference;\nseconds: on the device",
            sum.equal_all_the_same,
        );
        for (why, count) in &self.refusals {
            println!("refused {count}×: {why}");
        }
        if let Some(device) = device {
            let info = device.info();
            println!("device: {} ({:?}), driver {}, Vulkan {}", info.name, info.kind, info.driver, info.api);
            println!("{}", bits::validation(self.messages.len()));
            match bits::held_to(device) {
                HeldTo::Bits => println!("held to the bits of WebAssembly"),
                HeldTo::Bounds => println!(
                    "held in f32 to bounds: of the values with other bits {} lie within them, of {} they say nothing",
                    sum.within, sum.unjudged
                ),
            }
        }
        missing.iter().for_each(|missing| println!("{missing}"));
        println!("{:.0} s", took.as_secs_f64());
    }

    /// Why the suite fails.
    fn complaints(&self, device: Option<&Device>, missing: &[&Missing], whole: bool) -> Vec<String> {
        let mut all: Vec<String> = missing.iter().filter(|m| m.demanded).map(|m| m.to_string()).collect();
        if !self.failures.is_empty() {
            all.push(format!("{} failures", self.failures.len()));
        }
        for ((corpus, precision), (tally, _)) in &self.rows {
            let name = format!("{} in {precision}", corpus.name());
            if tally.different + tally.strayed > 0 {
                all.push(format!("{name}: {} values differ, {} of the reference", tally.different, tally.strayed));
            }
            if tally.hides() {
                all.push(format!("{name}: more than {MOST_EXCUSED} % of the values had to be excused"));
            }
            if whole && device.is_some() && tally.kernels == 0 {
                all.push(format!("{name}: nothing was executed"));
            }
        }
        let seen: BTreeSet<Corpus> = self.rows.keys().map(|(corpus, _)| *corpus).collect();
        let expected = if missing.is_empty() { Corpus::ALL.len() } else { 0 };
        if whole && seen.len() < expected {
            all.push(format!("only {} of {expected} corpora have cases", seen.len()));
        }
        all.extend(self.messages.iter().take(5).map(|message| format!("the validation layer says: {message}")));
        all
    }
}

fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}

fn line(name: &str, tally: &Tally, time: Duration) {
    let Tally { validated, kernels, refused, large, points, normal, values, different, strayed, excused, .. } = tally;
    println!(
        "{name:27}{validated:>10}{kernels:>9}{refused:>8}{large:>7}{points:>9}{normal:>9}{values:>10}{different:>10}{strayed:>10}            {:>7}{:>10}{:>11}{:>6}{:>8}{:>8.1}",
        excused[0],
        excused[1],
        excused[2],
        excused[3],
        excused[4],
        time.as_secs_f64(),
    );
}
