//! `docs/targets.md` says what is so: its blocks that name a file are parts of that file, or what the compiler makes. Knows
//! the names behind the language of a block; knows nothing of the text around them.

#![allow(clippy::pedantic, reason = "tests")]

use std::fs;
use std::path::Path;

use isograd_compiler::{Artefact, Form, MemoryLoader, Options, Query, Request, Target, Unwatched, check, compile};
use serde_json::Value;

/// A block with a name: ```` ```rust vulkan/examples/host.rs ````.
struct Block {
    name: String,
    text: String,
}

fn read(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn blocks(document: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut lines = document.lines();
    while let Some(line) = lines.next() {
        let Some(info) = line.strip_prefix("```") else { continue };
        let text: Vec<&str> = lines.by_ref().take_while(|line| *line != "```").collect();
        if let Some((_, name)) = info.split_once(' ') {
            blocks.push(Block { name: name.to_owned(), text: text.join("\n") });
        }
    }
    blocks
}

fn compiled(source: &str, target: Target, form: Form) -> Artefact {
    let options = Options { verify: true, ..Options::default() };
    let checked = check("ball.vola", source.into(), &MemoryLoader::default(), &options, &Unwatched);
    let queries = vec![Query::Value, Query::Gradient("at".into())];
    let request = Request { export: "ball".into(), queries, target, form, ..Request::default() };
    compile(&checked, &request, &options, &Unwatched).unwrap_or_else(|e| panic!("{e:?}"))
}

/// Panics unless each part of a block, between lines `// …`, is so many neighbouring lines of the file, all indented alike.
fn assert_part(block: &str, name: &str, file: &str) {
    let file: Vec<&str> = file.lines().collect();
    let mut from = 0;
    for part in block.split("// …\n") {
        let part: Vec<&str> = part.lines().collect();
        let begins = |at: &usize| {
            let indent = file[*at].len() - file[*at].trim_start().len();
            let same = |(line, of_file): (&&str, &&str)| {
                line.is_empty() && of_file.is_empty() || of_file.get(indent..) == Some(*line)
            };
            file.len() - at >= part.len() && part.iter().zip(&file[*at..]).all(same)
        };
        let found = (from..file.len()).find(begins);
        let found = found.unwrap_or_else(|| panic!("docs/targets.md: this is not in {name}:\n{}", part.join("\n")));
        from = found + part.len();
    }
}

#[test]
fn the_blocks_of_the_chapter_on_targets_are_true() {
    let blocks = blocks(&read("docs/targets.md"));
    let ball = &blocks.iter().find(|block| block.name == "ball.vola").expect("the program").text;
    for Block { name, text } in &blocks {
        match name.as_str() {
            "ball.vola" => {}
            "ball.spv.json" => {
                let mut shown: Value = serde_json::from_str(text).expect("JSON");
                let artefact = compiled(ball, Target::Spirv, Form::Kernel);
                let mut made = serde_json::to_value(&artefact.manifest).expect("JSON");
                // A hash of the compiler's version among others.
                shown["id"] = Value::Null;
                made["id"] = Value::Null;
                assert_eq!(shown, made, "{made:#}");
            }
            "ball.wgsl" => {
                let artefact = compiled(ball, Target::Wgsl, Form::Library);
                assert_part(text, name, &String::from_utf8(artefact.bytes).expect("UTF-8"));
            }
            path => assert_part(text, path, &read(path)),
        }
    }
    let mut names: Vec<&str> = blocks.iter().map(|block| block.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names, ["ball.spv.json", "ball.vola", "ball.wgsl", "vulkan/examples/host.rs"]);
}

#[test]
fn links_of_the_chapter_lead_somewhere() {
    let text = read("docs/targets.md");
    let links: Vec<&str> =
        text.split("](").skip(1).filter_map(|rest| rest.split_once(')').map(|(link, _)| link)).collect();
    for link in links.iter().filter(|link| !link.starts_with('#')) {
        read(&format!("docs/{link}"));
    }
    for link in links.iter().filter_map(|link| link.strip_prefix('#')) {
        let heading = |line: &str| {
            line.starts_with('#') && line.trim_start_matches(['#', ' ']).to_lowercase().replace(' ', "-") == link
        };
        assert!(text.lines().any(heading), "there is no heading {link}");
    }
}
