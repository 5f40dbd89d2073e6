//! Work that Python waits for: it can be followed and stopped.

use crate::error::error;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;
use stonewise_core::progress::Progress;

/// How often Python looks at the work: often enough for a bar that moves and for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);
/// Size of the stack of a working thread, as much as the main thread of a program has, bytes.
pub const STACK_BYTES: usize = 8 << 20;

/// Python functions that are called while the work goes on.
pub struct Listeners {
    /// Called with the name of a piece of work, the units that are done, and all of them.
    pub progress: Option<Py<PyAny>>,
    /// Called with a line that a person should read.
    pub note: Option<Py<PyAny>>,
}

impl Listeners {
    /// A function for progress alone.
    pub fn progress(progress: Option<Py<PyAny>>) -> Self {
        Self { progress, note: None }
    }
}

/// Does the work on a thread of its own, with the interpreter's lock released.
///
/// The calling thread tells the listeners, and stops the work on Ctrl-C or when a listener fails; that
/// exception is raised once the work has come to its end.
pub fn attended<T: Send>(
    py: Python<'_>,
    listeners: &Listeners,
    work: impl FnOnce(&dyn Progress) -> T + Send,
) -> PyResult<T> {
    let messenger = Messenger::default();
    thread::scope(|scope| {
        let worker = thread::Builder::new()
            .name("stonewise".to_owned())
            .stack_size(STACK_BYTES)
            .spawn_scoped(scope, || {
                let result = work(&messenger);
                messenger.finish();
                result
            })?;
        let mut told = Told::default();
        let mut failure = None;
        loop {
            py.detach(|| messenger.wait());
            let is_finished = messenger.is_finished() || worker.is_finished();
            if failure.is_none() {
                failure = messenger.tell(py, listeners, &mut told).err();
            }
            // Also after a failure: an interruption that nobody takes would come back later.
            if let Err(interrupt) = py.check_signals() {
                failure.get_or_insert(interrupt);
            }
            if failure.is_some() {
                messenger.cancelled.store(true, Ordering::Relaxed);
            }
            if is_finished {
                break;
            }
        }
        let result = py.detach(|| worker.join());
        match (failure, result) {
            (Some(failure), _) => Err(failure),
            (None, Ok(result)) => Ok(result),
            (None, Err(_)) => Err(error(
                "an error in the program itself; please report it with the lines above",
            )),
        }
    })
}

/// Takes what the work says to the thread that may call Python.
#[derive(Default)]
struct Messenger {
    events: Mutex<Vec<Event>>,
    done: AtomicU64,
    steps: Mutex<Steps>,
    cancelled: AtomicBool,
    finished: Mutex<bool>,
    ended: Condvar,
}

/// The steps that the work announced, and the one at work.
#[derive(Default)]
struct Steps {
    names: Vec<String>,
    present: Option<usize>,
}

enum Event {
    /// A piece of work begins, after `before` units of the one before it.
    Begin {
        what: String,
        total: u64,
        before: u64,
    },
    Note(String),
}

/// What the listeners were told last.
#[derive(Default)]
struct Told {
    what: Option<(String, u64)>,
    done: u64,
}

impl Progress for Messenger {
    fn begin(&self, what: &str, total: u64) {
        let what = self.steps().with_step(what);
        let mut events = self.events();
        let before = self.done.swap(0, Ordering::Relaxed);
        events.push(Event::Begin { what, total, before });
    }

    fn advance(&self, units: u64) {
        self.done.fetch_add(units, Ordering::Relaxed);
    }

    fn agenda(&self, steps: &[String]) {
        *self.steps() = Steps {
            names: steps.to_vec(),
            present: None,
        };
    }

    fn enter(&self, step: usize) {
        self.steps().present = Some(step);
    }

    fn note(&self, line: &str) {
        self.events().push(Event::Note(line.to_owned()));
    }

    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

impl Messenger {
    fn events(&self) -> MutexGuard<'_, Vec<Event>> {
        self.events.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn steps(&self) -> MutexGuard<'_, Steps> {
        self.steps.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn finish(&self) {
        *self.finished.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.ended.notify_all();
    }

    fn is_finished(&self) -> bool {
        *self.finished.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Until the work has ended or it is time to look.
    fn wait(&self) {
        let finished = self.finished.lock().unwrap_or_else(PoisonError::into_inner);
        if !*finished {
            drop(self.ended.wait_timeout(finished, LOOK));
        }
    }

    fn tell(&self, py: Python<'_>, listeners: &Listeners, told: &mut Told) -> PyResult<()> {
        let (events, done) = {
            let mut events = self.events();
            (std::mem::take(&mut *events), self.done.load(Ordering::Relaxed))
        };
        for event in events {
            match event {
                Event::Note(line) => {
                    if let Some(note) = &listeners.note {
                        note.call1(py, (line,))?;
                    }
                }
                Event::Begin { what, total, before } => {
                    told.advance(py, listeners, before)?;
                    *told = Told {
                        what: Some((what, total)),
                        done: 0,
                    };
                    told.say(py, listeners)?;
                }
            }
        }
        told.advance(py, listeners, done)
    }
}

impl Steps {
    /// A task under the name of its step, such as "4/6 measure the motions, iteration 3".
    fn with_step(&self, what: &str) -> String {
        let step = self.present.and_then(|at| Some((at + 1, self.names.get(at)?)));
        step.map_or_else(
            || what.to_owned(),
            |(number, name)| format!("{number}/{} {name}, {what}", self.names.len()),
        )
    }
}

impl Told {
    fn advance(&mut self, py: Python<'_>, listeners: &Listeners, done: u64) -> PyResult<()> {
        let total = self.what.as_ref().map_or(0, |(_, total)| *total);
        let done = done.min(total);
        if done == self.done {
            return Ok(());
        }
        self.done = done;
        self.say(py, listeners)
    }

    fn say(&self, py: Python<'_>, listeners: &Listeners) -> PyResult<()> {
        if let (Some(progress), Some((what, total))) = (&listeners.progress, &self.what) {
            progress.call1(py, (what, self.done, total))?;
        }
        Ok(())
    }
}
