//! The open connections, limited in number.

use std::collections::BTreeMap;
use std::net::{Shutdown, TcpStream};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Most connections at a time. A browser opens six; each of them has a thread.
const MOST: usize = 64;

/// An open connection.
struct Open {
    stream: TcpStream,
    /// Whether a whole, admitted request has arrived and is being answered.
    is_at_work: bool,
}

/// All open connections, by the number in which they came.
#[derive(Default)]
pub(super) struct Connections {
    open: Mutex<(u64, BTreeMap<u64, Open>)>,
}

impl Connections {
    /// Takes up a connection. Where there are too many, the oldest one that waits for a request is closed; where
    /// none waits, this one is.
    pub fn admit(&self, stream: &TcpStream) -> Option<u64> {
        let stream = stream.try_clone().ok()?;
        let mut open = self.open();
        let (count, all) = &mut *open;
        if all.len() >= MOST {
            let idle = all
                .iter()
                .find(|(_, o)| !o.is_at_work)
                .map(|(number, _)| *number)?;
            if let Some(gone) = all.remove(&idle) {
                let _ = gone.stream.shutdown(Shutdown::Both);
            }
        }
        *count += 1;
        all.insert(
            *count,
            Open {
                stream,
                is_at_work: false,
            },
        );
        Some(*count)
    }

    /// Says whether a request of this connection is being answered.
    pub fn set_at_work(&self, number: u64, is_at_work: bool) {
        if let Some(open) = self.open().1.get_mut(&number) {
            open.is_at_work = is_at_work;
        }
    }

    /// The connection has ended.
    pub fn remove(&self, number: u64) {
        self.open().1.remove(&number);
    }

    fn open(&self) -> MutexGuard<'_, (u64, BTreeMap<u64, Open>)> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
