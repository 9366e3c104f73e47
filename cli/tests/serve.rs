//! `isograd serve` as a process: requests over a socket, SIGKILL, SIGTERM.

mod common;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use common::Dir;

const DOUBLE: &str = r#"{"files":{"main.vola":"export fn double(x: real) -> real { x * 2.0 }"}}"#;

struct Serving {
    child: Child,
    address: String,
}

impl Serving {
    fn start(dir: &Dir) -> Self {
        Self::with(dir, &["--listen", "127.0.0.1:0", "--store", "kept"])
    }

    fn with(dir: &Dir, args: &[&str]) -> Self {
        let mut command = dir.command(&[&["serve"], args].concat());
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("listening on http://").unwrap().to_owned();
        Self { child, address }
    }

    fn request(&self, head: &str, body: &str) -> String {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        let length = body.len();
        write!(stream, "{head} HTTP/1.1\r\nhost: x\r\nconnection: close\r\ncontent-length: {length}\r\n\r\n{body}")
            .unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }

    /// Sends a signal by name.
    fn signal(&self, name: &str) {
        let status = Command::new("kill").args(["-s", name, &self.child.id().to_string()]).status().unwrap();
        assert!(status.success());
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn id(answer: &str) -> String {
    let start = answer.find("\"id\":\"").unwrap() + 6;
    answer[start..start + 64].to_owned()
}

#[test]
fn a_program_survives_sigkill() {
    let dir = Dir::new();
    let mut first = Serving::start(&dir);
    let created = first.request("POST /v1/programs", DOUBLE);
    assert!(created.starts_with("HTTP/1.1 201"), "{created}");
    let id = id(&created);
    first.signal("KILL");
    first.child.wait().unwrap();
    let second = Serving::start(&dir);
    let answer = second.request(&format!("POST /v1/programs/{id}/evaluate"), r#"{"inputs":{"x":[21,0.25]}}"#);
    assert!(answer.starts_with("HTTP/1.1 200") && answer.ends_with(r#""rows":[[42.0],[0.5]]}]}"#), "{answer}");
}

#[test]
fn sigterm_ends_the_server_with_success() {
    let dir = Dir::new();
    let mut serving = Serving::start(&dir);
    assert!(serving.request("GET /health/ready", "").starts_with("HTTP/1.1 200"));
    let began = Instant::now();
    serving.signal("TERM");
    let status = serving.child.wait().unwrap();
    assert_eq!(status.code(), Some(0));
    assert!(began.elapsed() < Duration::from_secs(10));
}

#[test]
fn a_truncated_request_is_answered() {
    let dir = Dir::new();
    let serving = Serving::start(&dir);
    let mut stream = TcpStream::connect(&serving.address).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    write!(stream, "POST /v1/programs HTTP/1.1\r\nhost: x\r\ncontent-length: 1000\r\n\r\n{{\"files\":").unwrap();
    stream.shutdown(std::net::Shutdown::Write).unwrap();
    let mut answer = String::new();
    let _ = stream.read_to_string(&mut answer);
    assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 400"), "{answer}");
    assert!(serving.request("GET /health/live", "").starts_with("HTTP/1.1 200"), "the server goes on");
}

#[test]
fn a_configuration_file_is_read_and_flags_win_over_it() {
    let dir = Dir::new();
    dir.write("lib/twice.vola", "fn twice(x: real) -> real { x * 2.0 }\n");
    let text = "\
listen = \"127.0.0.1:1\"
store = \"kept\"

[libraries]
ext = \"lib\"

[limits]
points = 2
diff_order = 3
";
    dir.write("isograd.toml", text);
    let args = ["--config", "isograd.toml", "--listen", "127.0.0.1:0", "--limit", "diff_order=1", "--limit", "queue=9"];
    let serving = Serving::with(&dir, &args);
    let limits = serving.request("GET /v1/limits", "");
    let limit = |name: &str, value: u64| limits.contains(&format!("\"name\":\"{name}\",\"value\":{value}}}"));
    assert!(
        limit("points", 2) && limit("diff_order", 1) && limit("queue", 9) && limit("derived_nodes", 200_000),
        "{limits}"
    );
    let program = r#"{"files":{"main.vola":"module ext::twice; export fn f(x: real) -> real { twice(x) }"}}"#;
    let created = serving.request("POST /v1/programs", program);
    assert!(created.starts_with("HTTP/1.1 201") && dir.0.join("kept").is_dir(), "{created}");
    let id = id(&created);
    let answer = serving.request(&format!("POST /v1/programs/{id}/evaluate"), r#"{"inputs":{"x":[1,2,3]}}"#);
    assert!(answer.starts_with("HTTP/1.1 422") && answer.contains("limit-exceeded"), "{answer}");
}

#[test]
fn a_bad_configuration_keeps_the_server_from_starting() {
    let dir = Dir::new();
    let run = |text: &str| {
        dir.write("isograd.toml", text);
        dir.run(&["serve", "--config", "isograd.toml", "--listen", "127.0.0.1:0"])
    };
    run("[limits]\npoint = 2\n")
        .fails_with(1, &["isograd.toml: [limits]: there is no limit `point`", "points", "nesting"]);
    run("port = 2\n").fails_with(1, &["isograd.toml: TOML parse error at line 1", "`port`", "`listen`"]);
    run("listen = 2\n").fails_with(1, &["isograd.toml", "line 1"]);
    run("[libraries]\next = \"none\"\n").fails_with(1, &["isograd.toml: [libraries]: there is no directory `none`"]);
    run("[libraries]\n\"a b\" = \".\"\n").fails_with(1, &["`a b` cannot stand in"]);
    dir.run(&["serve", "--config", "none.toml"]).fails_with(1, &["cannot read `none.toml`"]);
    dir.run(&["serve", "--limit", "point=2"]).fails_with(2, &["no limit `point`", "points"]);
}

#[test]
fn what_cannot_be_served_is_told() {
    let dir = Dir::new();
    dir.write("file", "");
    dir.run(&["serve", "--listen", "127.0.0.1:0", "--store", "file"]).fails_with(1, &["`file`", "store"]);
    let serving = Serving::start(&dir);
    dir.run(&["serve", "--listen", &serving.address]).fails_with(1, &["cannot listen on", &serving.address]);
    dir.run(&["serve", "--listen", "nowhere"]).fails(2);
}
