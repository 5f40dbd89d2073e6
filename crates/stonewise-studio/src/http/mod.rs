//! HTTP/1.1 on the loopback address, with limits on everything that a stranger could send.
//!
//! It is served by threads of the standard library: each limit takes a few lines here. tiny_http has none of them, and
//! axum brings tokio and hyper.
//!
//! Heads are parsed by `httparse`. Bodies have a length that is said beforehand; what is longer than allowed is
//! refused before it is read. A connection that has sent no whole request can be closed for a newer one, so that
//! idle ones never keep a person out.

mod connections;
mod listener;
mod request;
mod response;

pub use listener::{Listener, Site};
pub use request::{Head, Method, Request};
pub use response::{Body, Response};
