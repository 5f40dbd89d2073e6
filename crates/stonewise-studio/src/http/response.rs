//! Responses, written to a connection.

use serde::Serialize;
use std::borrow::Cow;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Write};

/// What scripts, styles, pictures and frames of the page may be: its own, and nothing inline.
const OWN_ONLY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; \
                        frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// A page that brings its own scripts, such as the report. It has an origin of its own, which reaches nothing here.
const SEALED: &str = "sandbox allow-scripts allow-downloads allow-popups; default-src 'none'; script-src 'unsafe-inline'; \
                      style-src 'unsafe-inline'; img-src data: blob:; font-src data:; base-uri 'none'; form-action 'none'; \
                      frame-ancestors 'self'";

/// Writes a body piece by piece, until it fails.
type Stream = Box<dyn FnOnce(&mut dyn Write) -> io::Result<()> + Send>;

/// What follows the head.
pub enum Body {
    /// These bytes.
    Bytes(Cow<'static, [u8]>),
    /// A file as it is, of this length.
    File(File, u64),
    /// Whatever is written, until it fails; the connection then ends.
    Stream(Stream),
}

/// An answer.
pub struct Response {
    status: u16,
    kind: &'static str,
    policy: &'static str,
    cookie: Option<String>,
    body: Body,
}

impl std::fmt::Debug for Response {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.status, self.kind)
    }
}

/// An error in the body of an answer.
#[derive(Serialize)]
struct Message<'a> {
    message: &'a str,
}

impl Response {
    /// An answer of this media type.
    pub fn new(status: u16, kind: &'static str, body: Body) -> Self {
        Self {
            status,
            kind,
            policy: OWN_ONLY,
            cookie: None,
            body,
        }
    }

    /// JSON.
    pub fn json(status: u16, value: &impl Serialize) -> Self {
        match serde_json::to_vec(value) {
            Ok(bytes) => Self::new(status, "application/json", Body::Bytes(bytes.into())),
            Err(error) => Self::error(500, &error.to_string()),
        }
    }

    /// An error in words.
    pub fn error(status: u16, message: &str) -> Self {
        let body = serde_json::to_vec(&Message { message }).unwrap_or_default();
        Self::new(status, "application/json", Body::Bytes(body.into()))
    }

    /// Gives the page an origin of its own, for pages that hold scripts themselves.
    #[must_use]
    pub fn sealed(self) -> Self {
        Self {
            policy: SEALED,
            ..self
        }
    }

    /// Adds a cookie to the response.
    #[must_use]
    pub fn with_cookie(self, cookie: String) -> Self {
        Self {
            cookie: Some(cookie),
            ..self
        }
    }

    /// The status.
    #[cfg(test)]
    pub fn status(&self) -> u16 {
        self.status
    }

    /// Writes the answer; whether the connection can be used again.
    pub(super) fn write(self, out: &mut dyn Write, keep: bool) -> io::Result<bool> {
        let keep = keep && !matches!(self.body, Body::Stream(_));
        let mut head = format!("HTTP/1.1 {} {}\r\n", self.status, reason(self.status));
        let mut line = |name: &str, value: &str| {
            let _ = write!(head, "{name}: {value}\r\n");
        };
        line("Content-Type", self.kind);
        line("Content-Security-Policy", self.policy);
        line("X-Content-Type-Options", "nosniff");
        line("Referrer-Policy", "no-referrer");
        line("Cross-Origin-Resource-Policy", "same-origin");
        line("Cross-Origin-Opener-Policy", "same-origin");
        line("Cache-Control", "no-store");
        if let Some(cookie) = &self.cookie {
            line("Set-Cookie", cookie);
        }
        match &self.body {
            Body::Bytes(bytes) => line("Content-Length", &bytes.len().to_string()),
            Body::File(_, length) => line("Content-Length", &length.to_string()),
            Body::Stream(_) => {}
        }
        line("Connection", if keep { "keep-alive" } else { "close" });
        head += "\r\n";
        match self.body {
            Body::Bytes(bytes) => {
                // One packet where it is short.
                let mut all = head.into_bytes();
                all.extend_from_slice(&bytes);
                out.write_all(&all)?;
            }
            Body::File(file, length) => {
                out.write_all(head.as_bytes())?;
                let written = io::copy(&mut io::Read::take(file, length), out)?;
                if written < length {
                    return Ok(false);
                }
            }
            Body::Stream(stream) => {
                out.write_all(head.as_bytes())?;
                stream(out)?;
            }
        }
        Ok(keep)
    }
}

fn reason(status: u16) -> &'static str {
    match status {
        200 => "OK",
        400 => "Bad Request",
        401 => "Unauthorized",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        409 => "Conflict",
        411 => "Length Required",
        413 => "Content Too Large",
        415 => "Unsupported Media Type",
        421 => "Misdirected Request",
        422 => "Unprocessable Content",
        431 => "Request Header Fields Too Large",
        _ => "Internal Server Error",
    }
}
