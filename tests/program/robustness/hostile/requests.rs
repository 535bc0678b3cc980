//! Requests to `serve`, as raw bytes.

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use crate::robustness::hostile::process::Running;

/// How long a server may take to be ready.
const PATIENCE: Duration = Duration::from_secs(10);

/// How long an answer is waited for.
const WAIT: Duration = Duration::from_millis(800);

/// Sends the request in the folder `request` to a server once it listens; the answer, empty if there is none. A body
/// alone is sent with a sound head.
pub(crate) fn send(server: &Running<'_>, folder: &Path) -> Vec<u8> {
    let Some(address) = address(server) else {
        return Vec::new();
    };
    let port = address.rsplit(':').next().unwrap_or_default();
    let read = |name: &str| fs::read(folder.join("request").join(name));
    let bytes = match read("body.json") {
        Ok(body) => {
            let head = format!(
                "POST /v1/chat/completions HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Type: application/json\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
                body.len()
            );
            [head.as_bytes(), &body].concat()
        }
        Err(_) => with_port(&read("whole.http").unwrap_or_default(), port),
    };
    answer(&address, &bytes).unwrap_or_default()
}

fn answer(address: &str, bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut stream = TcpStream::connect(address)?;
    stream.set_read_timeout(Some(WAIT))?;
    stream.set_write_timeout(Some(WAIT))?;
    stream.write_all(bytes)?;
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    Ok(answer)
}

/// The bytes with the port in the place of its name.
pub(crate) fn with_port(bytes: &[u8], port: &str) -> Vec<u8> {
    let Some(place) = bytes.windows(5).position(|part| part == b"PORTS") else {
        return bytes.to_vec();
    };
    let rest = with_port(&bytes[place + 5..], port);
    [&bytes[..place], port.as_bytes(), &rest].concat()
}

/// The address at which a server listens; `None` if it ends before.
fn address(server: &Running<'_>) -> Option<String> {
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        let said = server.stdout();
        if let Some(line) = said.lines().find(|_| said.contains('\n')) {
            let address = line.trim().strip_prefix("http://")?;
            return Some(address.strip_suffix("/v1")?.to_owned());
        }
        if server.has_complained() {
            return None;
        }
        thread::sleep(Duration::from_millis(2));
    }
    None
}
