//! Which requests are served: those of the page that this program opened, by its address and cookie.
//!
//! A page of another site can make the browser send requests here, also under a name of its own (DNS rebinding:
//! Jackson et al. 2007). So each request must name this address (Host), come from this page (Origin,
//! Sec-Fetch-Site) and bring a cookie that only the secret of the first address gives.

use crate::http::{Body, Head, Method, Response};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// Digits of a secret: 256 bits.
const DIGITS: usize = 64;

/// The media type of all bodies; forms of other sites cannot send it.
const JSON: &str = "application/json";

/// What the page calls to change a project outside the folder that was opened.
pub const ALLOW: &str = "/api/v1/allow";

/// What stands in front of every answer.
pub struct Guard {
    port: u16,
    /// In the address that a person is told.
    told: Secret,
    /// In the address that the browser is started with, which other users may see in the list of processes: it opens
    /// one session.
    once: Mutex<Option<Secret>>,
    session: Secret,
    is_view: bool,
    /// Nothing can be changed until a person allows it in the page.
    is_read_only: AtomicBool,
}

/// A random text that is compared in constant time.
#[derive(Clone)]
struct Secret(String);

impl Secret {
    fn new() -> Self {
        let bytes: [u8; DIGITS / 2] = rand::random();
        Self(bytes.iter().map(|b| format!("{b:02x}")).collect())
    }

    /// Digests of blake3 are compared in constant time.
    fn is(&self, text: &str) -> bool {
        text.len() == DIGITS && blake3::hash(self.0.as_bytes()) == blake3::hash(text.as_bytes())
    }
}

impl Guard {
    /// For a server on this port; `is_view`: nothing can be changed; `is_read_only`: not until [`Guard::allow`].
    pub fn new(port: u16, is_view: bool, is_read_only: bool) -> Self {
        Self {
            port,
            told: Secret::new(),
            once: Mutex::new(Some(Secret::new())),
            session: Secret::new(),
            is_view,
            is_read_only: AtomicBool::new(is_read_only),
        }
    }

    /// The address that a person is told.
    pub fn address(&self) -> String {
        self.address_with(&self.told.0)
    }

    /// The address that the browser is started with: it opens one session; `None` once it has.
    pub fn address_for_browser(&self) -> Option<String> {
        let once = self.once.lock().unwrap_or_else(PoisonError::into_inner);
        once.as_ref().map(|secret| self.address_with(&secret.0))
    }

    /// Whether nothing can be changed.
    pub fn is_view(&self) -> bool {
        self.is_view
    }

    /// Whether nothing can be changed before [`Guard::allow`].
    pub fn is_read_only(&self) -> bool {
        self.is_read_only.load(Ordering::SeqCst)
    }

    /// Lets the page change the project, although that lies outside the folder that was opened.
    pub fn allow(&self) {
        self.is_read_only.store(false, Ordering::SeqCst);
    }

    fn address_with(&self, secret: &str) -> String {
        format!("http://127.0.0.1:{}/?token={secret}", self.port)
    }

    /// Looks at a request before it is answered.
    ///
    /// # Errors
    /// The refusal of a request that is not served; for the first address, the cookie.
    pub fn admit(&self, head: &Head) -> Result<(), Response> {
        self.check_host(head)?;
        if head.path == "/"
            && head.method == Method::Get
            && let Some(token) = head.query("token")
        {
            return Err(self.welcome(token));
        }
        self.check_origin(head)?;
        if !self.has_cookie(head) {
            return Err(Response::error(
                401,
                "open the address that stonewise studio printed, with its token",
            ));
        }
        if head.method == Method::Get {
            return Ok(());
        }
        if self.is_view {
            return Err(Response::error(403, "this page is only for looking (--view)"));
        }
        if self.is_read_only() && head.path != ALLOW {
            return Err(Response::error(
                403,
                "the project lies outside the folder that was opened: allow changes on the page first",
            ));
        }
        let kind = head.header("content-type").unwrap_or("");
        if kind != JSON && !kind.starts_with("application/json;") {
            return Err(Response::error(415, "bodies are application/json"));
        }
        Ok(())
    }

    /// The name under which the server was asked must be its own.
    fn check_host(&self, head: &Head) -> Result<(), Response> {
        let host = head.header("host").unwrap_or("");
        match self.hosts().iter().any(|own| own == host) {
            true => Ok(()),
            false => Err(Response::error(421, "this server has another address")),
        }
    }

    fn hosts(&self) -> [String; 2] {
        ["127.0.0.1", "localhost"].map(|name| format!("{name}:{}", self.port))
    }

    /// Requests of pages of other sites, or of another port of this machine, are refused.
    fn check_origin(&self, head: &Head) -> Result<(), Response> {
        let host = head.header("host").unwrap_or("");
        let is_own = |origin: &str| origin.strip_prefix("http://") == Some(host);
        let is_foreign = head.headers("origin").any(|origin| !is_own(origin));
        let from_elsewhere = head
            .headers("sec-fetch-site")
            .any(|from| from != "same-origin" && from != "none");
        match is_foreign || from_elsewhere {
            true => Err(Response::error(403, "asked by a page of another site")),
            false => Ok(()),
        }
    }

    fn cookie_name(&self) -> String {
        // Cookies are shared by all ports of a host, so that each studio needs a name of its own.
        format!("stonewise-{}", self.port)
    }

    fn has_cookie(&self, head: &Head) -> bool {
        let name = self.cookie_name();
        let pairs = head.headers("cookie").flat_map(|c| c.split(';'));
        pairs
            .filter_map(|pair| pair.trim().split_once('='))
            .any(|(key, value)| key == name && self.session.is(value))
    }

    /// Gives the cookie for the secret of the first address.
    fn welcome(&self, token: &str) -> Response {
        let mut once = self.once.lock().unwrap_or_else(PoisonError::into_inner);
        let is_once = once.as_ref().is_some_and(|secret| secret.is(token));
        if !is_once && !self.told.is(token) {
            return Response::error(
                401,
                "a wrong token; open the address that stonewise studio printed",
            );
        }
        if is_once {
            *once = None;
        }
        // A strict cookie is not sent along a redirection that began on another site, but from a page of this one.
        let page = "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>stonewise</title>\
                    <link rel=\"icon\" href=\"data:,\">\
                    <meta http-equiv=\"refresh\" content=\"0;url=/\"><a href=\"/\">stonewise studio</a></html>";
        let cookie = format!(
            "{}={}; HttpOnly; SameSite=Strict; Path=/",
            self.cookie_name(),
            self.session.0
        );
        Response::new(
            200,
            "text/html; charset=utf-8",
            Body::Bytes(page.as_bytes().into()),
        )
        .with_cookie(cookie)
    }
}
