//! The typed program as text, for `--emit check`: signatures, and stack code indented by structure. Knows nothing of
//! what instructions do.

use std::fmt::Write as _;

use crate::{
    Program, Type,
    typed::{Code, Concept, Function, FunctionId, Impl, Instruction, Slot},
};

/// The listing of a program: concepts, definitions, functions, impls, in the order of their ids. Slots are shown with
/// their names, `Load at#0`.
#[must_use]
pub fn print(program: &Program) -> String {
    let mut out = String::new();
    for concept in &program.concepts {
        let _ = writeln!(out, "concept {}: {}", concept.name, arrow(concept));
    }
    for definition in &program.definitions {
        let word = if definition.operation { "operation" } else { "entity" };
        let params: Vec<String> = definition.params.iter().map(|p| format!("{}: {}", p.name, p.ty)).collect();
        let identity = if definition.no_identity { " no_identity" } else { "" };
        let _ = writeln!(out, "{word} {}({}){identity}", definition.name, params.join(", "));
    }
    for (index, function) in program.functions.iter().enumerate() {
        let export = program.exports.contains(&FunctionId(u32::try_from(index).unwrap_or(u32::MAX)));
        self::function(&mut out, program, function, export);
    }
    for implementation in &program.impls {
        self::implementation(&mut out, program, implementation);
    }
    out
}

fn arrow(concept: &Concept) -> String {
    match &concept.source {
        Type::Tuple(elements) if elements.is_empty() => format!("-> {}", concept.target),
        source => format!("{source} -> {}", concept.target),
    }
}

fn function(out: &mut String, program: &Program, function: &Function, export: bool) {
    let export = if export { "export " } else { "" };
    let params: Vec<String> = function.params.iter().map(|p| format!("{}: {}", p.name, p.ty)).collect();
    let _ = writeln!(out, "\n{export}fn {}({}) -> {}", function.name, params.join(", "), function.result);
    for param in &function.params {
        let default = param.default.iter().map(|c| ("default", c));
        let range = param.range.iter().flat_map(|(lo, hi)| [("from", lo), ("to", hi)]);
        for (what, constant) in default.chain(range) {
            let steps = constant.code.instructions.iter().map(|(i, _)| line(program, &constant.code, i));
            let _ = writeln!(out, "  {} {what}: {}", param.name, steps.collect::<Vec<_>>().join(", "));
        }
    }
    code(out, program, &function.code);
}

fn implementation(out: &mut String, program: &Program, implementation: &Impl) {
    let definition = program.definitions.get(implementation.definition.0 as usize);
    let concept = program.concepts.get(implementation.concept.0 as usize);
    let names = |from: usize, n: usize| {
        let slots = implementation.code.slots.iter().skip(from).take(n);
        slots.map(|s| s.name.as_str()).collect::<Vec<_>>().join(", ")
    };
    let sources = implementation.sources as usize;
    let params = definition.map_or(0, |d| d.params.len());
    let operands = match implementation.operands as usize {
        0 => String::new(),
        n => format!("<{}>", names(sources + params, n)),
    };
    let _ = writeln!(
        out,
        "\nimpl {}{operands} for {}({}): {}",
        definition.map_or("?", |d| &d.name),
        concept.map_or("?", |c| &c.name),
        names(0, sources),
        concept.map_or_else(|| "?".to_owned(), arrow),
    );
    code(out, program, &implementation.code);
}

fn code(out: &mut String, program: &Program, code: &Code) {
    let mut depth = 1_usize;
    for (instruction, _) in &code.instructions {
        if matches!(instruction, Instruction::Else | Instruction::EndIf | Instruction::EndFor | Instruction::EndBlock) {
            depth = depth.saturating_sub(1);
        }
        // A chain of `else if` nests deeply; its listing need not.
        let _ = writeln!(out, "{}{}", "  ".repeat(depth.min(40)), line(program, code, instruction));
        if matches!(
            instruction,
            Instruction::If(_) | Instruction::Else | Instruction::For(_) | Instruction::Block { .. }
        ) {
            depth += 1;
        }
    }
}

fn line(program: &Program, code: &Code, instruction: &Instruction) -> String {
    let slot = |slot: &Slot| {
        let local = code.slots.get(slot.0 as usize);
        format!("{}#{}", local.map_or("?", |l| &l.name), slot.0)
    };
    let slots = |what: &str, list: &[Slot]| match list {
        [] => String::new(),
        list => format!(" {what} {}", list.iter().map(slot).collect::<Vec<_>>().join(" ")),
    };
    match instruction {
        Instruction::Int(value) => format!("Int {value}"),
        Instruction::Real(value) => format!("Real {value:?}"),
        Instruction::Bool(value) => format!("Bool {value}"),
        Instruction::Load(s) => format!("Load {}", slot(s)),
        Instruction::Store(s) => {
            let ty = code.slots.get(s.0 as usize).map_or(Type::Error, |l| l.ty.clone());
            format!("Store {}: {ty}", slot(s))
        }
        Instruction::Drop => "Drop".to_owned(),
        Instruction::Pack(n) => format!("Pack {n}"),
        Instruction::Splat(n) => format!("Splat {n}"),
        Instruction::Pick { offset, length } => format!("Pick {offset}..{}", offset + length),
        Instruction::Cast { from, to } => format!("Cast {from} -> {to}"),
        Instruction::Neg(ty) => format!("Neg {ty}"),
        Instruction::Not => "Not".to_owned(),
        Instruction::Binary { op, left, right } => format!("{left} {} {right}", op.text()),
        Instruction::Builtin { builtin, args } => {
            let args: Vec<String> = args.iter().map(ToString::to_string).collect();
            format!("Builtin {}({})", builtin.name(), args.join(", "))
        }
        Instruction::Diff => "Diff".to_owned(),
        Instruction::Bound { value, by } => format!("Bound {value} by {by}"),
        Instruction::Interval(ty) => format!("Interval {ty}"),
        Instruction::PackIntervals(n) => format!("PackIntervals {n}"),
        Instruction::SplatInterval(n) => format!("SplatInterval {n}"),
        Instruction::End { ty, upper } => format!("{} {ty}", if *upper { "End" } else { "Start" }),
        Instruction::PickInterval { ends, offset, length } => {
            format!("PickInterval {offset}..{} of {ends}", offset + length)
        }
        Instruction::MayBeNan => "MayBeNan".to_owned(),
        Instruction::Call(id) => {
            format!("Call {}", program.functions.get(id.0 as usize).map_or("?", |f| &f.name))
        }
        Instruction::Node { definition, subtrees } => {
            let name = program.definitions.get(definition.0 as usize).map_or("?", |d| &d.name);
            format!("Node {name} subtrees {subtrees}")
        }
        Instruction::Eval { concept, live } => {
            let name = program.concepts.get(concept.0 as usize).map_or("?", |c| &c.name);
            format!("Eval {name}{}", if *live { "" } else { " dead" })
        }
        Instruction::If(branch) => {
            let value = branch.value.as_ref().map_or(String::new(), |t| format!(" value {t}"));
            format!("If{value}{}{}", slots("writes", &branch.writes), slots("restores", &branch.restores))
        }
        Instruction::Else => "Else".to_owned(),
        Instruction::EndIf => "EndIf".to_owned(),
        Instruction::For(facts) => format!("For {}{}", slot(&facts.counter), slots("writes", &facts.writes)),
        Instruction::EndFor => "EndFor".to_owned(),
        Instruction::Block { restores } => format!("Block{}", slots("restores", restores)),
        Instruction::EndBlock => "EndBlock".to_owned(),
    }
}
