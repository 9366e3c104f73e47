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
        let mut command = dir.command(&["serve", "--listen", "127.0.0.1:0", "--store", "kept"]);
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
fn what_cannot_be_served_is_told() {
    let dir = Dir::new();
    dir.write("file", "");
    dir.run(&["serve", "--listen", "127.0.0.1:0", "--store", "file"]).fails_with(1, &["`file`", "store"]);
    let serving = Serving::start(&dir);
    dir.run(&["serve", "--listen", &serving.address]).fails_with(1, &["cannot listen on", &serving.address]);
    dir.run(&["serve", "--listen", "nowhere"]).fails(2);
}
