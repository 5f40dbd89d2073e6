//! The door: connections, each with a thread of its own.

use super::connections::Connections;
use super::request::{Head, NoRequest, Reader, Request};
use super::response::Response;
use std::io::{self, Read};
use std::net::{Ipv4Addr, Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

/// Time for a piece of an answer to be taken.
const TAKEN: Duration = Duration::from_secs(20);
/// Stack of a connection's thread, bytes.
const STACK: usize = 1024 * 1024;
/// How long, and how many bytes, what a refused connection still sends is read, so that it can read why.
const LINGER: (Duration, usize) = (Duration::from_millis(500), 4 << 20);

/// What answers requests.
pub trait Site: Send + Sync {
    /// Looks at a head before its body is read.
    ///
    /// # Errors
    /// The refusal of a request that is not served.
    fn admit(&self, head: &Head) -> Result<(), Response>;

    /// Answers a request that was admitted.
    fn answer(&self, request: &Request) -> Response;
}

/// A listener on the loopback address.
pub struct Listener {
    socket: TcpListener,
    port: u16,
}

impl Listener {
    /// Listens on 127.0.0.1. `port`: 0 for any that is free.
    ///
    /// # Errors
    /// The port is taken.
    pub fn bind(port: u16) -> io::Result<Self> {
        let socket = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        let port = socket.local_addr()?.port();
        Ok(Self { socket, port })
    }

    /// The port.
    pub fn port(&self) -> u16 {
        self.port
    }

    /// Answers from now on, on threads of its own, until the process ends.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn serve(self, site: Arc<dyn Site>) -> io::Result<()> {
        thread::Builder::new()
            .name("listener".to_owned())
            .spawn(move || self.accept(&site))?;
        Ok(())
    }

    fn accept(&self, site: &Arc<dyn Site>) {
        let connections = Arc::new(Connections::default());
        for stream in self.socket.incoming() {
            let Ok(stream) = stream else {
                // No file handle is left: connections end meanwhile.
                thread::sleep(Duration::from_millis(50));
                continue;
            };
            let Some(number) = connections.admit(&stream) else {
                continue;
            };
            let (site, all) = (Arc::clone(site), Arc::clone(&connections));
            let work = move || {
                // What goes wrong with one connection concerns no other.
                let _ = converse(&stream, site.as_ref(), &all, number);
                let _ = stream.shutdown(Shutdown::Both);
                all.remove(number);
            };
            if thread::Builder::new().stack_size(STACK).spawn(work).is_err() {
                connections.remove(number);
            }
        }
    }
}

/// Answers the requests of one connection until it ends.
fn converse(mut stream: &TcpStream, site: &dyn Site, all: &Connections, number: u64) -> io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(TAKEN))?;
    let mut reader = Reader::new(stream);
    loop {
        all.set_at_work(number, false);
        let asked = reader.head().and_then(|head| {
            site.admit(&head).map_err(NoRequest::Refused)?;
            let body = reader.body(&head)?;
            Ok(Request { head, body })
        });
        let request = match asked {
            Ok(request) => request,
            Err(NoRequest::Gone) => return Ok(()),
            Err(NoRequest::Refused(response)) => {
                response.write(&mut stream, false)?;
                return linger(stream);
            }
        };
        all.set_at_work(number, true);
        let response = site.answer(&request);
        if !response.write(&mut stream, request.head.keeps_alive())? {
            return Ok(());
        }
    }
}

/// Reads what is still sent: the system throws an answer away that lies behind unread bytes.
fn linger(mut stream: &TcpStream) -> io::Result<()> {
    stream.shutdown(Shutdown::Write)?;
    stream.set_read_timeout(Some(LINGER.0))?;
    let (until, mut left) = (Instant::now() + LINGER.0, LINGER.1);
    let mut chunk = [0; 8192];
    while left > 0 && Instant::now() < until {
        match stream.read(&mut chunk)? {
            0 => break,
            n => left = left.saturating_sub(n),
        }
    }
    Ok(())
}
