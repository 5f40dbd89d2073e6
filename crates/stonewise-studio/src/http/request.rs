//! Requests, read from a connection.

use super::response::Response;
use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Longest head, bytes.
const MAX_HEAD: usize = 16 * 1024;
/// Most headers.
const MAX_HEADERS: usize = 64;
/// Longest body, bytes. An edit of the longest outline takes some ten kilobytes.
const MAX_BODY: usize = 1024 * 1024;
/// Time for the next request of a connection to begin.
const IDLE: Duration = Duration::from_secs(60);
/// Time for a head to arrive once it has begun, and for a body.
const ARRIVAL: Duration = Duration::from_secs(10);

/// A method that the server supports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Reads.
    Get,
    /// Adds or starts.
    Post,
    /// Changes.
    Patch,
    /// Ends or takes away.
    Delete,
}

/// What comes before the body.
#[derive(Debug)]
pub struct Head {
    /// The method.
    pub method: Method,
    /// The path as sent, without the query; it is never decoded.
    pub path: String,
    /// What stands behind the question mark, as sent.
    pub query: String,
    headers: Vec<(String, String)>,
    /// Whether the connection stays open.
    keep: bool,
}

impl Head {
    /// The value of a header that was sent once; `name` in small letters.
    pub fn header(&self, name: &str) -> Option<&str> {
        let mut all = self.headers.iter().filter(|(n, _)| n == name);
        let (_, first) = all.next()?;
        all.next().is_none().then_some(first.as_str())
    }

    /// All values of a header; `name` in small letters.
    pub fn headers<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a str> {
        let named = self.headers.iter().filter(move |(n, _)| n == name);
        named.map(|(_, value)| value.as_str())
    }

    /// The value of a key in the query, as sent.
    pub fn query(&self, key: &str) -> Option<&str> {
        let pairs = self.query.split('&').filter_map(|pair| pair.split_once('='));
        pairs.into_iter().find(|(k, _)| *k == key).map(|(_, value)| value)
    }

    pub(super) fn keeps_alive(&self) -> bool {
        self.keep
    }
}

/// A request that has arrived as a whole.
#[derive(Debug)]
pub struct Request {
    /// What comes before the body.
    pub head: Head,
    /// The body.
    pub body: Vec<u8>,
}

/// Why there is no request.
#[derive(Debug)]
pub(super) enum NoRequest {
    /// The other side has gone, or was too slow.
    Gone,
    /// The request is answered with this, and the connection ends.
    Refused(Response),
}

impl From<io::Error> for NoRequest {
    fn from(_: io::Error) -> Self {
        Self::Gone
    }
}

fn refused(status: u16, message: &str) -> NoRequest {
    NoRequest::Refused(Response::error(status, message))
}

/// Reads requests from one connection.
pub(super) struct Reader<'a> {
    stream: &'a TcpStream,
    /// What has arrived and belongs to no request yet.
    arrived: Vec<u8>,
}

impl<'a> Reader<'a> {
    pub fn new(stream: &'a TcpStream) -> Self {
        Self {
            stream,
            arrived: Vec::new(),
        }
    }

    /// The head of the next request.
    pub fn head(&mut self) -> Result<Head, NoRequest> {
        let mut deadline = Instant::now() + IDLE;
        if self.arrived.is_empty() {
            self.more(deadline)?;
        }
        deadline = Instant::now() + ARRIVAL;
        loop {
            if let Some((head, length)) = parse(&self.arrived)? {
                self.arrived.drain(..length);
                return Ok(head);
            }
            if self.arrived.len() >= MAX_HEAD {
                return Err(refused(431, "the head of the request is too long"));
            }
            self.more(deadline)?;
        }
    }

    /// The body that belongs to a head.
    pub fn body(&mut self, head: &Head) -> Result<Vec<u8>, NoRequest> {
        let length = body_length(head)?;
        if length == 0 {
            return Ok(Vec::new());
        }
        if head.header("expect").is_some() && self.arrived.is_empty() {
            self.stream.write_all(b"HTTP/1.1 100 Continue\r\n\r\n")?;
        }
        let deadline = Instant::now() + ARRIVAL;
        while self.arrived.len() < length {
            self.more(deadline)?;
        }
        Ok(self.arrived.drain(..length).collect())
    }

    fn more(&mut self, deadline: Instant) -> Result<(), NoRequest> {
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(NoRequest::Gone);
        }
        self.stream.set_read_timeout(Some(left))?;
        let mut chunk = [0; 8192];
        match self.stream.read(&mut chunk) {
            Ok(0) => Err(NoRequest::Gone),
            Ok(n) => {
                self.arrived.extend_from_slice(chunk.get(..n).unwrap_or_default());
                Ok(())
            }
            Err(e) if e.kind() == ErrorKind::Interrupted => Ok(()),
            Err(_) => Err(NoRequest::Gone),
        }
    }
}

/// The head at the start of some bytes and its length; `None` where it has not arrived as a whole.
fn parse(bytes: &[u8]) -> Result<Option<(Head, usize)>, NoRequest> {
    let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
    let mut parsed = httparse::Request::new(&mut headers);
    let length = match parsed.parse(bytes) {
        Ok(httparse::Status::Complete(length)) => length,
        Ok(httparse::Status::Partial) => return Ok(None),
        Err(httparse::Error::TooManyHeaders) => return Err(refused(431, "too many headers")),
        Err(_) => return Err(refused(400, "no HTTP request")),
    };
    if length > MAX_HEAD {
        return Err(refused(431, "the head of the request is too long"));
    }
    let method = match parsed.method {
        Some("GET") => Method::Get,
        Some("POST") => Method::Post,
        Some("PATCH") => Method::Patch,
        Some("DELETE") => Method::Delete,
        _ => return Err(refused(405, "no such method here")),
    };

    let (path, query) = parsed
        .path
        .unwrap_or("")
        .split_once('?')
        .unwrap_or((parsed.path.unwrap_or(""), ""));
    let text = |h: &httparse::Header| {
        let value = std::str::from_utf8(h.value).map_err(|_| refused(400, "a header that is no text"))?;
        Ok((h.name.to_ascii_lowercase(), value.trim().to_owned()))
    };
    let headers = parsed
        .headers
        .iter()
        .map(text)
        .collect::<Result<Vec<_>, NoRequest>>()?;

    let closes = headers
        .iter()
        .any(|(n, v)| n == "connection" && v.eq_ignore_ascii_case("close"));
    let head = Head {
        method,
        path: path.to_owned(),
        query: query.to_owned(),
        headers,
        keep: parsed.version == Some(1) && !closes,
    };
    Ok(Some((head, length)))
}

/// The length that a head says its body has.
fn body_length(head: &Head) -> Result<usize, NoRequest> {
    if head.headers("transfer-encoding").next().is_some() {
        return Err(refused(411, "say the length of the body (Content-Length)"));
    }
    if head.headers("content-length").next().is_none() {
        return Ok(0);
    }
    let digits = head
        .header("content-length")
        .filter(|t| t.bytes().all(|b| b.is_ascii_digit()));
    let length = digits.and_then(|t| t.parse::<u64>().ok());
    match length.map(usize::try_from) {
        Some(Ok(length)) if length <= MAX_BODY => Ok(length),
        Some(_) => Err(refused(413, "the body is too long")),
        None => Err(refused(400, "no length of the body")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(bytes: &[u8]) -> u16 {
        match parse(bytes) {
            Err(NoRequest::Refused(response)) => response.status(),
            Ok(Some((head, _))) => match body_length(&head) {
                Err(NoRequest::Refused(response)) => response.status(),
                _ => 200,
            },
            _ => 0,
        }
    }

    #[test]
    fn requests_that_two_servers_could_read_differently_are_refused() {
        // RFC 9112, 6.3: a body has one length.
        assert_eq!(status(b"POST / HTTP/1.1\r\nContent-Length: 3\r\n\r\n"), 200);
        for (bytes, expected) in [
            (
                &b"POST / HTTP/1.1\r\nContent-Length: 3\r\nContent-Length: 4\r\n\r\n"[..],
                400,
            ),
            (
                b"POST / HTTP/1.1\r\nContent-Length: 3\r\nTransfer-Encoding: chunked\r\n\r\n",
                411,
            ),
            (b"POST / HTTP/1.1\r\nContent-Length: +3\r\n\r\n", 400),
            (b"POST / HTTP/1.1\r\nContent-Length: 1073741824\r\n\r\n", 413),
            (
                b"POST / HTTP/1.1\r\nContent-Length: 99999999999999999999999\r\n\r\n",
                400,
            ),
            (b"TRACE / HTTP/1.1\r\n\r\n", 405),
            (b"GET / HTTP/1.1\r\nA b: c\r\n\r\n", 400),
            (b"GET / HTTP/1.1\r\nHost: a", 0),
        ] {
            assert_eq!(status(bytes), expected, "{}", String::from_utf8_lossy(bytes));
        }
    }

    #[test]
    fn keys_of_a_query_are_found_whole() {
        let (head, _) = parse(b"GET /a?xtoken=1&token=2 HTTP/1.1\r\n\r\n")
            .unwrap()
            .unwrap();
        assert_eq!(
            (head.path.as_str(), head.query("token"), head.query("a")),
            ("/a", Some("2"), None)
        );
    }
}
