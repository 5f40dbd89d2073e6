//! A studio on a made-up survey, and raw requests to it.

use serde_json::Value;
use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::time::Duration;
use stonewise_studio::Studio;
use tempfile::TempDir;

pub const PROJECT: &str = "\
# Written by hand.
[project]
name = \"Lower dam\" # the old one
[[epochs]]
name = \"2024\"
clouds = [\"a.xyz\"]
[[epochs]]
name = \"2025\"
clouds = [\"b.xyz\"]
";

/// An answer.
#[derive(Debug)]
pub struct Answer {
    pub status: u16,
    pub head: String,
    pub body: String,
}

impl Answer {
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.body).unwrap()
    }

    pub fn header(&self, name: &str) -> Option<&str> {
        let lines = self.head.lines().filter_map(|l| l.split_once(": "));
        lines
            .into_iter()
            .find(|(n, _)| n.eq_ignore_ascii_case(name))
            .map(|(_, v)| v)
    }
}

/// A studio, its folder, and the cookie that it accepts.
pub struct Tested {
    pub dir: TempDir,
    pub studio: Studio,
    pub port: u16,
    pub token: String,
    pub cookie: String,
}

/// A survey of two small clouds.
pub fn survey() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    for (name, z) in [("a.xyz", 0.0), ("b.xyz", 0.01)] {
        let points: Vec<String> = (0..400)
            .map(|i| format!("{} 0 {}", f64::from(i % 20) * 0.05, z + f64::from(i / 20) * 0.05))
            .collect();
        fs::write(dir.path().join(name), points.join("\n")).unwrap();
    }
    fs::write(dir.path().join("stonewise.toml"), PROJECT).unwrap();
    dir
}

impl Tested {
    pub fn new() -> Self {
        Self::of(survey(), false)
    }

    pub fn of(dir: TempDir, is_view: bool) -> Self {
        Self::at(dir, "", is_view)
    }

    /// A studio that opens a folder in this one.
    pub fn at(dir: TempDir, folder: &str, is_view: bool) -> Self {
        let studio = Studio::open(&dir.path().join(folder), 0, is_view).unwrap();
        let address = studio.address();
        let rest = address.strip_prefix("http://127.0.0.1:").unwrap();
        let (port, token) = rest.split_once("/?token=").unwrap();
        let (port, token) = (port.parse().unwrap(), token.to_owned());
        let mut tested = Self {
            dir,
            studio,
            port,
            token,
            cookie: String::new(),
        };
        let welcome = tested.raw(&format!(
            "GET /?token={} HTTP/1.1\r\n{}\r\n",
            tested.token,
            tested.host()
        ));
        assert_eq!(welcome.status, 200);
        let cookie = welcome.header("Set-Cookie").unwrap();
        tested.cookie = cookie.split(';').next().unwrap().to_owned();
        tested
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    pub fn host(&self) -> String {
        format!("Host: 127.0.0.1:{}\r\n", self.port)
    }

    pub fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream
    }

    /// Sends these bytes on a connection of their own.
    pub fn raw(&self, request: &str) -> Answer {
        let mut stream = self.connect();
        let request = request.replacen("\r\n", "\r\nConnection: close\r\n", 1);
        stream.write_all(request.as_bytes()).unwrap();
        answer(&mut stream)
    }

    /// A request as the page sends it, with more headers.
    pub fn ask_with(&self, method: &str, path: &str, headers: &str, body: &str) -> Answer {
        let length = match method {
            "GET" => String::new(),
            _ => format!(
                "Content-Type: application/json\r\nContent-Length: {}\r\n",
                body.len()
            ),
        };
        let (host, cookie) = (self.host(), &self.cookie);
        self.raw(&format!(
            "{method} {path} HTTP/1.1\r\n{host}Cookie: {cookie}\r\n{length}{headers}\r\n{body}"
        ))
    }

    pub fn get(&self, path: &str) -> Answer {
        self.ask_with("GET", path, "", "")
    }

    pub fn send(&self, method: &str, path: &str, body: &Value) -> Answer {
        self.ask_with(method, path, "", &body.to_string())
    }
}

/// Reads an answer to the end of its connection.
pub fn answer(stream: &mut TcpStream) -> Answer {
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let (head, body) = text.split_once("\r\n\r\n").unwrap_or((&text, ""));
    let status = head.split(' ').nth(1).and_then(|s| s.parse().ok()).unwrap_or(0);
    Answer {
        status,
        head: head.to_owned(),
        body: body.to_owned(),
    }
}
