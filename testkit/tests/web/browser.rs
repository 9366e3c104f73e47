//! Headless Chromium on pages of a folder, served by a small HTTP server of its own. Knows nothing of what the pages do.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, Condvar, Mutex};
use std::thread;
use std::time::{Duration, Instant};

/// How long a page may take: most of it is Chromium's start.
const TIMEOUT: Duration = Duration::from_secs(60);

const NAMES: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

const FLAGS: [&str; 11] = [
    "--headless",
    // Without it Chromium refuses to run as root.
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--virtual-time-budget=10000",
    "--window-size=900,1200",
    "--dump-dom",
];

/// Put behind a page. Chromium's virtual time stands still while something is fetched, but not while WebAssembly is
/// compiled on another thread: without this request, which the server answers when the page says that it is no longer
/// loading, a busy machine prints the page too early.
const HOLD: &str = r#"<script>
    fetch("held");
    const status = document.getElementById("status");
    new MutationObserver(() => fetch("release")).observe(status, { childList: true });
</script>"#;

/// A Chromium.
#[derive(Debug, Clone)]
pub struct Browser {
    program: String,
}

impl Browser {
    /// The one that `CHROMIUM` names, or the first on the path that answers; Ubuntu's package is a script that does not
    /// without the snap.
    pub fn find() -> Result<Self, String> {
        let answers = |program: &str| Command::new(program).arg("--version").output().is_ok_and(|o| o.status.success());
        if let Ok(program) = std::env::var("CHROMIUM") {
            let found = answers(&program);
            return found.then_some(Self { program }).ok_or("what the variable CHROMIUM names does not run".into());
        }
        match NAMES.into_iter().find(|program| answers(program)) {
            Some(program) => Ok(Self { program: program.into() }),
            None => Err(format!("there is no Chromium: none of {} is on PATH and runs", NAMES.join(", "))),
        }
    }

    /// The document that a page of the folder has become when it has nothing left to do.
    pub fn document(&self, folder: &Path, address: &str) -> Result<String, String> {
        self.run(folder, address, &[])
    }

    /// A picture of a page, as PNG.
    pub fn screenshot(&self, folder: &Path, address: &str, to: &Path) -> Result<(), String> {
        self.run(folder, address, &[format!("--screenshot={}", to.display())]).map(drop)
    }

    fn run(&self, folder: &Path, address: &str, flags: &[String]) -> Result<String, String> {
        let port = serve(folder.to_owned()).map_err(|e| format!("no server: {e}"))?;
        // Chromium writes into files, so that nobody need read while it runs.
        let own = tempfile::tempdir().map_err(|e| e.to_string())?;
        let create = |name: &str| fs::File::create(own.path().join(name)).map_err(|e| format!("{name}: {e}"));
        let read = |name: &str| fs::read(own.path().join(name)).map(|b| String::from_utf8_lossy(&b).into_owned());
        let mut child = Command::new(&self.program)
            .args(FLAGS)
            .args(flags)
            .arg(format!("--user-data-dir={}", own.path().join("profile").display()))
            .arg(format!("http://127.0.0.1:{port}/{address}"))
            .stdin(Stdio::null())
            .stdout(create("stdout")?)
            .stderr(create("stderr")?)
            .process_group(0)
            .spawn()
            .map_err(|e| format!("{}: {e}", self.program))?;
        let started = Instant::now();
        let status = loop {
            match child.try_wait() {
                Ok(Some(status)) => break Some(status),
                Ok(None) if started.elapsed() < TIMEOUT => thread::sleep(Duration::from_millis(20)),
                _ => break None,
            }
        };
        // Its helpers go with it: the group has the child's number.
        let group = format!("kill -9 -{}", child.id());
        let _ = Command::new("sh").args(["-c", &group]).stderr(Stdio::null()).status();
        let _ = child.wait();
        let errors = read("stderr").unwrap_or_default();
        let tail = errors.get(errors.floor_char_boundary(errors.len().saturating_sub(2000))..).unwrap_or_default();
        match status {
            Some(status) if status.success() => read("stdout").map_err(|e| e.to_string()),
            Some(status) => Err(format!("{} ended with {status} at {address:.200}:\n{tail}", self.program)),
            None => Err(format!("{} took more than {TIMEOUT:?} at {address:.200}:\n{tail}", self.program)),
        }
    }
}

/// Serves the files of a folder on a port of 127.0.0.1 for as long as the tests run.
fn serve(folder: PathBuf) -> std::io::Result<u16> {
    let listener = TcpListener::bind("127.0.0.1:0")?;
    let port = listener.local_addr()?.port();
    let released = Arc::new((Mutex::new(false), Condvar::new()));
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            // Browsers open connections ahead of need: one that says nothing must not hold up the others.
            let (folder, released) = (folder.clone(), released.clone());
            thread::spawn(move || answer(&stream, &folder, &released));
        }
    });
    Ok(port)
}

fn answer(mut stream: &TcpStream, folder: &Path, (released, change): &(Mutex<bool>, Condvar)) -> std::io::Result<()> {
    let mut request = String::new();
    let mut lines = BufReader::new(stream);
    lines.read_line(&mut request)?;
    let mut header = String::new();
    while lines.read_line(&mut header)? > 2 {
        header.clear();
    }
    let path = request.split(' ').nth(1).unwrap_or_default();
    let name = path.split('?').next().unwrap_or_default().trim_start_matches('/');
    let mut file = Some(name).filter(|name| !name.contains('/')).and_then(|name| fs::read(folder.join(name)).ok());
    match name {
        "held" => {
            let waiting = released.lock().expect("no panic holds it");
            drop(change.wait_timeout_while(waiting, TIMEOUT, |released| !*released));
            file = Some(Vec::new());
        }
        "release" => {
            *released.lock().expect("no panic holds it") = true;
            change.notify_all();
            file = Some(Vec::new());
        }
        "index.html" => file.iter_mut().for_each(|page| page.extend_from_slice(HOLD.as_bytes())),
        _ => {}
    }
    let (status, body) = file.map_or(("404 Not Found", Vec::new()), |body| ("200 OK", body));
    let kind = match name.rsplit('.').next() {
        Some("html") => "text/html",
        Some("js") => "text/javascript",
        Some("wasm") => "application/wasm",
        Some("csv") => "text/csv",
        _ => "application/octet-stream",
    };
    let length = body.len();
    write!(
        stream,
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n"
    )?;
    stream.write_all(&body)
}
