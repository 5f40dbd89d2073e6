//! What strangers try: pages in the next tab, other programs of this machine, hostile results.

use crate::support::{Tested, answer, survey};
use serde_json::json;
use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

#[test]
fn only_the_person_who_was_told_the_address_may_ask() {
    let studio = Tested::new();
    let host = studio.host();
    for (request, expected) in [
        (format!("GET /api/v1/state HTTP/1.1\r\n{host}\r\n"), 401),
        (format!("GET / HTTP/1.1\r\n{host}\r\n"), 401),
        (format!("GET /studio.js HTTP/1.1\r\n{host}\r\n"), 401),
        (format!("GET /?token= HTTP/1.1\r\n{host}\r\n"), 401),
        (
            format!("GET /?token={} HTTP/1.1\r\n{host}\r\n", "0".repeat(64)),
            401,
        ),
        (
            format!("GET /?token={}0 HTTP/1.1\r\n{host}\r\n", studio.token),
            401,
        ),
        (
            format!("GET /api/v1/state?token={} HTTP/1.1\r\n{host}\r\n", studio.token),
            401,
        ),
        (
            format!(
                "POST /?token={} HTTP/1.1\r\n{host}Content-Length: 0\r\n\r\n",
                studio.token
            ),
            401,
        ),
        (
            format!(
                "GET /api/v1/state HTTP/1.1\r\n{host}Cookie: stonewise-{}={}\r\n\r\n",
                studio.port, studio.token
            ),
            401,
        ),
    ] {
        assert_eq!(studio.raw(&request).status, expected, "{request}");
    }
    assert_eq!(studio.get("/api/v1/state").status, 200);
    assert_eq!(studio.get("/").status, 200);
}

#[test]
fn the_browsers_address_opens_one_session() {
    let studio = Tested::new();
    let address = studio.studio.address_for_browser().unwrap();
    let path = address.split_once(&studio.port.to_string()).unwrap().1;
    let request = format!("GET {path} HTTP/1.1\r\n{}\r\n", studio.host());
    assert_eq!(studio.raw(&request).status, 200);
    assert_eq!(studio.raw(&request).status, 401);
}

#[test]
fn the_cookie_is_for_this_page_alone() {
    let studio = Tested::new();
    let welcome = studio.raw(&format!(
        "GET /?token={} HTTP/1.1\r\n{}\r\n",
        studio.token,
        studio.host()
    ));
    let cookie = welcome.header("Set-Cookie").unwrap();
    assert!(
        cookie.contains("; HttpOnly") && cookie.contains("; SameSite=Strict"),
        "{cookie}"
    );
    assert!(!cookie.contains(&studio.token));
}

#[test]
fn a_name_that_was_rebound_to_this_machine_reaches_nothing() {
    let studio = Tested::new();
    let (port, cookie) = (studio.port, &studio.cookie);
    for host in [
        "evil.example".to_owned(),
        format!("evil.example:{port}"),
        "127.0.0.1".to_owned(),
        format!("127.0.0.1:{}", port ^ 1),
        format!("127.0.0.1.evil.example:{port}"),
        format!("[::1]:{port}"),
        String::new(),
    ] {
        let request = format!("GET /api/v1/state HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\n\r\n");
        assert_eq!(studio.raw(&request).status, 421, "{host}");
        let first = format!("GET /?token={} HTTP/1.1\r\nHost: {host}\r\n\r\n", studio.token);
        assert_eq!(studio.raw(&first).status, 421, "{host}");
    }
    let none = format!("GET /api/v1/state HTTP/1.1\r\nCookie: {cookie}\r\n\r\n");
    assert_eq!(studio.raw(&none).status, 421);
    let two = format!(
        "GET /api/v1/state HTTP/1.1\r\n{}Host: evil.example\r\nCookie: {cookie}\r\n\r\n",
        studio.host()
    );
    assert_eq!(studio.raw(&two).status, 421);
}

#[test]
fn pages_of_other_sites_and_ports_reach_nothing_even_with_the_cookie() {
    let studio = Tested::new();
    let own = format!(
        "Origin: http://127.0.0.1:{}\r\nSec-Fetch-Site: same-origin\r\n",
        studio.port
    );
    assert_eq!(studio.ask_with("GET", "/api/v1/state", &own, "").status, 200);
    for header in [
        "Origin: http://evil.example\r\n".to_owned(),
        "Origin: null\r\n".to_owned(),
        format!("Origin: https://127.0.0.1:{}\r\n", studio.port),
        format!("Origin: http://localhost:{}\r\n", studio.port),
        format!("Origin: http://127.0.0.1:{}\r\n", studio.port ^ 1),
        "Sec-Fetch-Site: cross-site\r\n".to_owned(),
        "Sec-Fetch-Site: same-site\r\n".to_owned(),
    ] {
        for (method, path) in [
            ("GET", "/api/v1/state"),
            ("POST", "/api/v1/run"),
            ("GET", "/report/report.html"),
        ] {
            let status = studio.ask_with(method, path, &header, "{}").status;
            assert_eq!(status, 403, "{method} {header}");
        }
    }
    // What forms can send is no body of the API.
    let form = format!(
        "POST /api/v1/run HTTP/1.1\r\n{}Cookie: {}\r\nContent-Type: text/plain\r\nContent-Length: 2\r\n\r\n{{}}",
        studio.host(),
        studio.cookie
    );
    assert_eq!(studio.raw(&form).status, 415);
    // No answer lets another site read it.
    let answer = studio.get("/api/v1/state");
    assert!(answer.header("Access-Control-Allow-Origin").is_none());
    let policy = answer.header("Content-Security-Policy").unwrap();
    assert!(
        policy.contains("default-src 'none'") && policy.contains("script-src 'self'"),
        "{policy}"
    );
    assert!(!policy.contains("unsafe-inline"), "{policy}");
}

#[test]
fn nothing_outside_the_folders_is_served() {
    let studio = Tested::new();
    let results = studio.path("results");
    fs::create_dir_all(results.join("data")).unwrap();
    fs::write(results.join("report.html"), "<p>report</p>").unwrap();
    fs::write(results.join("notes.html"), "notes").unwrap();
    fs::write(studio.path("secret.html"), "secret").unwrap();
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(studio.path("secret.html"), results.join("yearly.html")).unwrap();
        std::os::unix::fs::symlink("/etc", results.join("data/report_2.html")).unwrap();
    }
    let served = studio.get("/report/report.html");
    assert_eq!((served.status, served.body.as_str()), (200, "<p>report</p>"));
    // Its scripts are those of whoever made the results: it gets an origin of its own.
    assert!(
        served
            .header("Content-Security-Policy")
            .unwrap()
            .starts_with("sandbox allow-scripts allow-downloads")
    );
    for path in [
        "/report/../../secret.html",
        "/report/..%2f..%2fsecret.html",
        "/report/%2e%2e/%2e%2e/secret.html",
        "/report/..\\..\\secret.html",
        "/report//etc/hosts.html",
        "/report/yearly.html",
        "/report/data/report_2.html",
        "/report/notes.html",
        "/report/",
        "/report/report.html/",
        "/../stonewise.toml",
        "/stonewise.toml",
        "//etc/passwd",
        "/api/v1/epochs/../picture",
        "/api/v1/epochs/7/picture",
        "/api/v1/epochs/0/stones/1",
        "/api/v1/epochs/0/stones/../../../secret.html",
        "/api/v1/epochs/0/stones/1/0",
        "/api/v1/../../secret.html",
    ] {
        let answer = studio.get(path);
        assert_eq!(answer.status, 404, "{path}: {}", answer.body);
        assert!(!answer.body.contains("secret"), "{path}");
    }
}

#[test]
fn a_project_file_gets_no_new_path_outside_its_folder() {
    let studio = Tested::new();
    let before = fs::read_to_string(studio.path("stonewise.toml")).unwrap();
    let outside = survey();
    let cloud = outside.path().join("a.xyz");
    #[cfg(unix)]
    std::os::unix::fs::symlink(&cloud, studio.path("link.xyz")).unwrap();
    for path in [cloud.to_str().unwrap(), "link.xyz", "/etc/hosts"] {
        let change = json!({ "changes": [{ "way": ["epochs", 0, "clouds"], "value": [path] }] });
        let answer = studio.send("PATCH", "/api/v1/project", &change);
        assert_eq!(answer.status, 403, "{path}: {}", answer.body);
    }
    assert_eq!(fs::read_to_string(studio.path("stonewise.toml")).unwrap(), before);
}

#[cfg(unix)]
#[test]
fn a_detector_is_taught_in_the_folder_of_the_survey_alone() {
    let studio = Tested::new();
    let teach = |minutes: f64| studio.send("POST", "/api/v1/teaching", &json!({ "minutes": minutes }));
    for minutes in [0.0, -1.0, 1e9] {
        let refused = teach(minutes);
        assert!(
            refused.status == 422 && refused.body.contains("minutes"),
            "{}",
            refused.body
        );
    }
    // There are no results yet on which corrections could have been made.
    assert_eq!(teach(1.0).status, 422);
    let elsewhere = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink(elsewhere.path(), studio.path("detector")).unwrap();
    let offer = json!({ "training": "0123abcd" }).to_string();
    fs::write(elsewhere.path().join("offer.json"), offer).unwrap();
    for (method, path) in [
        ("POST", "/api/v1/teaching"),
        ("GET", "/api/v1/teaching"),
        ("POST", "/api/v1/teaching/accept"),
        ("DELETE", "/api/v1/teaching"),
    ] {
        let answer = studio.ask_with(method, path, "", &json!({ "minutes": 1 }).to_string());
        assert_eq!(answer.status, 403, "{method} {path}: {}", answer.body);
    }
    assert_eq!(fs::read_dir(elsewhere.path()).unwrap().count(), 1);
}

#[test]
fn a_page_for_looking_changes_nothing() {
    let studio = Tested::of(survey(), true);
    let before = fs::read_to_string(studio.path("stonewise.toml")).unwrap();
    for (method, path) in [
        ("POST", "/api/v1/run"),
        ("DELETE", "/api/v1/run"),
        ("POST", "/api/v1/project"),
        ("PATCH", "/api/v1/project"),
        ("POST", "/api/v1/edits"),
        ("POST", "/api/v1/edits/undo"),
        ("POST", "/api/v1/edits/redo"),
        ("POST", "/api/v1/stable"),
        ("POST", "/api/v1/teaching"),
        ("POST", "/api/v1/teaching/accept"),
        ("DELETE", "/api/v1/teaching"),
        ("POST", "/api/v1/remarks"),
        ("DELETE", "/api/v1/remarks"),
        ("POST", "/api/v1/signature"),
        ("DELETE", "/api/v1/signature"),
        ("POST", "/api/v1/pdf"),
    ] {
        assert_eq!(
            studio.send(method, path, &json!({})).status,
            403,
            "{method} {path}"
        );
    }
    assert_eq!(studio.get("/api/v1/edits").status, 200);
    assert_eq!(fs::read_to_string(studio.path("stonewise.toml")).unwrap(), before);
    let names: Vec<_> = fs::read_dir(studio.dir.path())
        .unwrap()
        .flatten()
        .map(|e| e.file_name())
        .collect();
    assert_eq!(names.len(), 3, "{names:?}");
}

#[test]
fn a_gigabyte_is_refused_before_it_is_read() {
    let studio = Tested::new();
    let mut stream = studio.connect();
    let (host, cookie) = (studio.host(), &studio.cookie);
    let head = format!(
        "POST /api/v1/edits HTTP/1.1\r\n{host}Cookie: {cookie}\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n",
        1_u64 << 30
    );
    stream.write_all(head.as_bytes()).unwrap();
    let chunk = vec![b' '; 1 << 16];
    let mut sent = 0_u64;
    while sent < 1 << 30 && stream.write_all(&chunk).is_ok() {
        sent += chunk.len() as u64;
    }
    assert!(sent < 64 << 20, "the server took {sent} bytes");
    let mut small = studio.connect();
    small.write_all(head.as_bytes()).unwrap();
    assert_eq!(answer(&mut small).status, 413);
    // A head without an end is cut off, too.
    let mut long = studio.connect();
    long.write_all(format!("GET / HTTP/1.1\r\n{host}X: ").as_bytes())
        .unwrap();
    long.write_all(&vec![b'a'; 20_000]).unwrap();
    assert_eq!(answer(&mut long).status, 431);
}

#[test]
fn ten_thousand_idle_connections_keep_nobody_out() {
    let studio = Tested::new();
    // A page that is told of changes.
    let mut events = studio.connect();
    let (host, cookie) = (studio.host(), &studio.cookie);
    write!(
        events,
        "GET /api/v1/events HTTP/1.1\r\n{host}Cookie: {cookie}\r\n\r\n"
    )
    .unwrap();
    let mut first = [0; 16];
    events.read_exact(&mut first).unwrap();
    let mut idle: Vec<TcpStream> = Vec::new();
    for n in 0..10_000 {
        let mut stream = studio.connect();
        if n % 2 == 0 {
            // Half of a request, and never more.
            let _ = stream.write_all(b"GET / HTTP/1.1\r\nHost: ");
        }
        idle.push(stream);
        // Our own handles are limited, too.
        if idle.len() > 200 {
            idle.remove(0);
        }
    }
    let began = Instant::now();
    for _ in 0..20 {
        assert_eq!(studio.get("/api/v1/state").status, 200);
    }
    assert!(began.elapsed() < Duration::from_secs(5), "{:?}", began.elapsed());
    // The page is still told: each event is a whole state.
    let mut more = [0; 64];
    events.read_exact(&mut more).unwrap();
    assert_eq!(&first[..8], b"HTTP/1.1");
}
