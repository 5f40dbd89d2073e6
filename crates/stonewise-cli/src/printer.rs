//! The log and the progress: all of it on stderr.

use crate::note::note;
use crate::screen::Screen;
use crate::steps::{Ended, Steps, cut, wrapped};
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, Once, PoisonError};
use std::time::Instant;
use stonewise_core::progress::Progress;

/// Seconds until the next line about the same work in a log that is not a terminal; doubled each time, so that a step
/// of a second and one of a day both leave a few lines.
const FIRST_WAIT_S: f64 = 5.0;
/// The longest such wait: within it a reader of the log sees that the run is alive.
const LONGEST_WAIT_S: f64 = 600.0;

/// Shows progress as a list of steps with a bar on a terminal, as lines elsewhere; Ctrl-C stops the work.
pub struct Printer {
    shown: Mutex<Shown>,
    quiet: bool,
    cancelled: Arc<AtomicBool>,
    listening: Once,
    started: Instant,
}

/// What has been shown so far.
struct Shown {
    steps: Steps,
    part: Part,
    /// Where stderr is a terminal.
    screen: Option<Screen>,
    /// The last line of progress where it is not: work that begins anew many times is one line.
    last: String,
    /// Earliest time of the next line about the same work, seconds.
    next: f64,
    wait: f64,
}

/// The part of a step at work.
#[derive(Default)]
struct Part {
    what: String,
    detail: String,
    done: u64,
    total: u64,
}

impl Printer {
    /// A printer for this command.
    pub fn new(quiet: bool) -> Self {
        let screen = std::io::stderr().is_terminal().then(Screen::new);
        Self {
            shown: Mutex::new(Shown {
                steps: Steps::default(),
                part: Part::default(),
                screen,
                last: String::new(),
                next: 0.0,
                wait: FIRST_WAIT_S,
            }),
            quiet,
            cancelled: Arc::new(AtomicBool::new(false)),
            listening: Once::new(),
            started: Instant::now(),
        }
    }

    /// Listens for Ctrl-C and for the system's request to end from now on; a second one ends at once.
    ///
    /// Before work begins that looks whether it should stop, either ends the program as always.
    pub fn listen(&self) {
        self.listening.call_once(|| {
            let flag = Arc::clone(&self.cancelled);
            let handler = move || {
                if flag.swap(true, Ordering::SeqCst) {
                    std::process::exit(130);
                }
                // On a thread of its own: a reader of stderr that is stuck must not hold up the second
                // signal.
                std::thread::spawn(|| note("stopping; what is finished is kept (once more to stop at once)"));
            };
            if ctrlc::set_handler(handler).is_err() {
                note("Ctrl-C cannot be caught here; it will stop at once");
            }
        });
    }

    /// One line of the log.
    pub fn log(&self, line: &str) {
        if !self.quiet {
            self.always(line);
        }
    }

    /// One line of the log, also with `--quiet`.
    pub fn always(&self, line: &str) {
        match &self.shown().screen {
            Some(screen) => screen.above(|| {
                let lines = wrapped(line, screen.width(), 2);
                lines.iter().for_each(|line| note(line));
            }),
            None => note(line),
        }
    }

    /// A remark, which takes one line of a terminal: as much as fits beside its code.
    pub fn remark(&self, word: &str, text: &str, code: Option<&str>) {
        let code = code.map_or(String::new(), |code| format!(" [{code}]"));
        let text = format!("{word}: {text}");
        let width = self.shown().screen.as_ref().map_or(usize::MAX, Screen::width);
        let text = cut(&text, width.saturating_sub(code.chars().count()));
        self.log(&format!("{text}{code}"));
    }

    /// The list of steps is at its end.
    pub fn finish(&self) {
        let now = self.now();
        let mut shown = self.shown();
        if let Some(ended) = shown.steps.end(now).filter(|_| !self.quiet) {
            shown.ended(&ended, now);
        }
        if let Some(screen) = &shown.screen {
            screen.clear();
        }
    }

    /// Takes the bar away; a step that did not come to its end is marked so.
    pub fn abandon(&self) {
        let shown = self.shown();
        if let Some(screen) = &shown.screen {
            screen.clear();
            if let Some(step) = shown.steps.present().filter(|_| !self.quiet) {
                screen.failed(&step);
            }
        }
    }

    fn shown(&self) -> MutexGuard<'_, Shown> {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }
}

impl Shown {
    fn ended(&mut self, ended: &Ended, now: f64) {
        match (&self.screen, ended.seconds) {
            (Some(screen), _) => screen.ended(ended),
            (None, None) => note(&format!("[{now:.1} s] {}, done earlier", ended.step.trim_start())),
            (None, Some(_)) => {}
        }
    }

    /// A step begins.
    fn entered(&mut self, now: f64) {
        self.part = Part::default();
        let Some(step) = self.steps.present() else { return };
        match &self.screen {
            Some(screen) => screen.begin(&step, self.steps.to_come()),
            None => {
                note(&format!("[{now:.1} s] {}", step.trim_start()));
                (self.wait, self.next) = (FIRST_WAIT_S, now + FIRST_WAIT_S);
            }
        }
    }

    /// A part of a step begins, or goes on.
    fn show(&mut self, now: f64) {
        let place = self.steps.present();
        match (&self.screen, place) {
            (Some(screen), place) => {
                let words = joined(None, &[self.part.what.as_str(), self.part.detail.as_str()]);
                match place {
                    Some(place) => screen.part(&place, &words, self.part.total),
                    None => screen.part(&words, "", self.part.total),
                }
            }
            (None, Some(place)) => self.print_where(Some(place.trim_start()), now),
            // A small part of a step whose files were there.
            (None, None) if self.steps.is_within() => {}
            (None, None) if self.part.detail.is_empty() => {
                if self.print_line(&self.part.what.clone(), now) {
                    (self.wait, self.next) = (FIRST_WAIT_S, now + FIRST_WAIT_S);
                }
            }
            (None, None) => self.print_where(None, now),
        }
    }

    /// A line with the count and the detail of the work, once the wait is over.
    fn print_where(&mut self, step: Option<&str>, now: f64) {
        if now < self.next {
            return;
        }
        self.wait = (2.0 * self.wait).min(LONGEST_WAIT_S);
        self.next = now + self.wait;
        let count = match self.part.total {
            0 => self.part.what.clone(),
            total => format!("{}: {} of {total}", self.part.what, self.part.done),
        };
        let words = [count.as_str(), self.part.detail.as_str()];
        self.print_line(&joined(step, &words), now);
    }

    /// A line of progress, unless it is the same as the last. Returns whether it differs.
    fn print_line(&mut self, line: &str, now: f64) -> bool {
        let differs = std::mem::replace(&mut self.last, line.to_owned()) != line;
        if differs {
            note(&format!("[{now:.1} s] {line}"));
        }
        differs
    }
}

/// The place of a step, and what it is at.
fn joined(place: Option<&str>, words: &[&str]) -> String {
    let words = words.iter().copied().filter(|w| !w.is_empty());
    place.into_iter().chain(words).collect::<Vec<_>>().join(", ")
}

impl Progress for Printer {
    fn begin(&self, what: &str, total: u64) {
        self.listen();
        if self.quiet {
            return;
        }
        let mut shown = self.shown();
        shown.part = Part {
            what: what.to_owned(),
            total,
            ..Part::default()
        };
        if let Some(screen) = &shown.screen {
            screen.restart();
        }
        shown.show(self.now());
    }

    fn advance(&self, units: u64) {
        if self.quiet {
            return;
        }
        let mut shown = self.shown();
        shown.part.done += units;
        match &shown.screen {
            Some(screen) => screen.advance(units),
            None if shown.steps.present().is_some() => shown.show(self.now()),
            None => {}
        }
    }

    fn agenda(&self, steps: &[String]) {
        self.finish();
        self.shown().steps.list(steps);
    }

    fn enter(&self, step: usize) {
        self.listen();
        let now = self.now();
        let mut shown = self.shown();
        let before = shown.steps.present();
        let ended = shown.steps.enter(step, now);
        if self.quiet || shown.steps.present() == before {
            return;
        }
        if let Some(ended) = ended {
            shown.ended(&ended, now);
        }
        shown.entered(now);
    }

    fn take_over(&self, step: usize) {
        let now = self.now();
        let mut shown = self.shown();
        if let Some(ended) = shown.steps.take_over(step, now).filter(|_| !self.quiet) {
            shown.ended(&ended, now);
        }
    }

    fn detail(&self, unit: &str) {
        if self.quiet {
            return;
        }
        let mut shown = self.shown();
        unit.clone_into(&mut shown.part.detail);
        shown.show(self.now());
    }

    fn note(&self, line: &str) {
        self.log(line);
    }

    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}
