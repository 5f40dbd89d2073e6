//! The studio as a whole: from its start to its end.

use crate::api::{Api, Served};
use crate::guard::Guard;
use crate::http::Listener;
use crate::place::Place;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

/// How long after the last page was closed the studio ends. A page that is loaded anew is closed for a moment.
const LEFT: Duration = Duration::from_secs(60);
/// Time between two looks whether it should end.
const LOOK: Duration = Duration::from_millis(100);

/// A server on the loopback address, at work until the process ends.
pub struct Studio {
    api: Arc<Api>,
}

impl Studio {
    /// Opens a folder of surveys, a project file or a folder of results. `port`: 0 for any that is free; `is_view`:
    /// nothing can be changed.
    ///
    /// # Errors
    /// Nothing is there; the port is taken.
    pub fn open(path: &Path, port: u16, is_view: bool) -> io::Result<Self> {
        let place = Place::of(path)?;
        let listener = Listener::bind(port)?;
        let api = Api::new(
            Guard::new(listener.port(), is_view, place.is_project_outside),
            place,
        );
        listener.serve(Arc::new(Served(Arc::clone(&api))))?;
        Ok(Self { api })
    }

    /// The address that a person is told, with its secret.
    pub fn address(&self) -> String {
        self.api.guard().address()
    }

    /// The address to start the browser with, which opens one session.
    pub fn address_for_browser(&self) -> Option<String> {
        self.api.guard().address_for_browser()
    }

    /// Waits until `is_stopped` says so, or the last page has been closed for a while and no run is at work; a run is
    /// then stopped where nothing is lost.
    pub fn wait(&self, is_stopped: impl Fn() -> bool) {
        let run = self.api.run();
        while !is_stopped() && (run.phase().is_at_work() || !self.api.is_left(LEFT)) {
            thread::sleep(LOOK);
        }
        run.stop();
        while run.phase().is_at_work() {
            thread::sleep(LOOK);
        }
    }
}
