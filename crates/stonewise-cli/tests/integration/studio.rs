//! A studio that is killed while a person corrects stones: nothing that it answered is lost, nothing is there twice.
//!
//! `STONEWISE_KILLS=200 cargo test -p stonewise-cli --test integration studio` kills more often; `STONEWISE_SEED` gives other
//! moments.

use crate::support::{Dice, program};
use serde_json::{Value, json};
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// Kills where the environment does not say how many.
const KILLS: u64 = 8;

const PROJECT: &str = "[project]\nname = \"dam\"\n[[epochs]]\nname = \"a\"\nclouds = [\"a.xyz\"]\n\
                       [[epochs]]\nname = \"b\"\nclouds = [\"a.xyz\"]\n";

fn number(key: &str, or: u64) -> u64 {
    std::env::var(key).ok().and_then(|n| n.parse().ok()).unwrap_or(or)
}

fn survey() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("a.xyz"), "0 0 0\n1 0 0\n1 0 1\n0 0 1\n").unwrap();
    fs::write(dir.path().join("stonewise.toml"), PROJECT).unwrap();
    // An unrolled wall, so that no results are needed.
    let wall = json!({
        "origin": [0.0, 0.0, 0.0], "out": [0.0, -1.0, 0.0], "up_per_height": 1.0, "start": [0.0, 0.0],
        "stretches": [[0.0, 0.0, 0.0]]
    });
    let edits = json!({ "format": 1, "facade": wall, "edits": [] });
    fs::write(dir.path().join("edits.json"), edits.to_string()).unwrap();
    dir
}

/// A studio, with the cookie that it accepts.
struct Studio {
    child: Child,
    host: String,
    cookie: String,
}

impl Studio {
    fn start(folder: &Path) -> Self {
        let mut child = Command::new(program())
            .args(["studio", "--no-browser", "--quiet"])
            .arg(folder)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut address = String::new();
        BufReader::new(child.stdout.as_mut().unwrap())
            .read_line(&mut address)
            .unwrap();
        let rest = address.trim().strip_prefix("http://").unwrap();
        let (host, path) = rest.split_once('/').unwrap();
        let mut studio = Self {
            child,
            host: host.to_owned(),
            cookie: String::new(),
        };
        let welcome = studio.ask("GET", &format!("/{path}"), "").unwrap();
        let cookie = welcome.split_once("Set-Cookie: ").unwrap().1;
        studio.cookie = cookie.split_once(';').unwrap().0.to_owned();
        studio
    }

    /// The answer, where one comes.
    fn ask(&self, method: &str, path: &str, body: &str) -> Option<String> {
        let mut stream = TcpStream::connect(&self.host).ok()?;
        let (host, cookie, length) = (&self.host, &self.cookie, body.len());
        let request = format!(
            "{method} {path} HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\nConnection: close\r\n\
             Content-Type: application/json\r\nContent-Length: {length}\r\n\r\n{body}"
        );
        stream.write_all(request.as_bytes()).ok()?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer).ok()?;
        answer.starts_with("HTTP/1.1 200").then_some(answer)
    }

    /// Adds an edit of this number; whether that was answered.
    fn add(&self, n: u64) -> bool {
        let edit = json!({ "do": "delete", "at": [[n, 1.0]], "who": "A. Keller", "when": "", "why": "door" });
        let body = json!({ "id": format!("edit-{n}"), "edits": [edit] });
        self.ask("POST", "/api/v1/edits", &body.to_string()).is_some()
    }
}

impl Drop for Studio {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The numbers of the edits in a JSON document.
fn numbers(text: &str) -> Vec<u64> {
    let value: Value = serde_json::from_str(text).unwrap();
    let edits = value["edits"].as_array().unwrap().clone();
    edits
        .iter()
        .map(|e| e["at"][0][0].as_f64().unwrap() as u64)
        .collect()
}

#[test]
fn a_killed_studio_loses_no_correction_and_doubles_none() {
    let folder = survey();
    let mut dice = Dice(number("STONEWISE_SEED", 1));
    let mut next = 0;
    for kill in 0..number("STONEWISE_KILLS", KILLS) {
        let mut studio = Studio::start(folder.path());
        // The one whose answer was lost is sent again; it may have been taken before.
        let wait = Duration::from_micros(dice.below(40_000) as u64);
        let id = studio.child.id().to_string();
        let killer = std::thread::spawn(move || {
            std::thread::sleep(wait);
            Command::new("kill").args(["-9", &id]).status().unwrap();
        });
        while studio.add(next) {
            next += 1;
        }
        killer.join().unwrap();
        studio.child.wait().unwrap();
        let again = Studio::start(folder.path());
        let answer = again.ask("GET", "/api/v1/edits", "").unwrap();
        let found = numbers(answer.split_once("\r\n\r\n").unwrap().1);
        let answered: Vec<u64> = (0..next).collect();
        let in_flight: Vec<u64> = (0..=next).collect();
        assert!(
            found == answered || found == in_flight,
            "kill {kill}: {next} answered, found {found:?}"
        );
        // Opening the edits has brought the file that runs read up to date.
        let file = fs::read_to_string(folder.path().join("edits.json")).unwrap();
        assert_eq!(numbers(&file), found, "kill {kill}");
    }
    let last = Studio::start(folder.path());
    assert!(last.add(next));
    let file = fs::read_to_string(folder.path().join("edits.json")).unwrap();
    assert_eq!(numbers(&file), (0..=next).collect::<Vec<_>>());
    println!("{} corrections", next + 1);
}
