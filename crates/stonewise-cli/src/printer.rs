//! The log and the progress bar: all of it on stderr.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, Once, PoisonError};
use std::time::Instant;
use stonewise_core::progress::Progress;

/// Shows progress as a bar on a terminal, as lines elsewhere; Ctrl-C asks the work to stop.
pub struct Printer {
    bar: Mutex<ProgressBar>,
    quiet: bool,
    terminal: bool,
    cancelled: Arc<AtomicBool>,
    listening: Once,
    started: Instant,
    /// The last line of progress where there is no terminal: work that begins anew many times is one line.
    last: Mutex<String>,
}

impl Printer {
    /// A printer for this command.
    pub fn new(quiet: bool) -> Self {
        let terminal = std::io::stderr().is_terminal();
        Self {
            bar: Mutex::new(ProgressBar::hidden()),
            quiet,
            terminal,
            cancelled: Arc::new(AtomicBool::new(false)),
            listening: Once::new(),
            started: Instant::now(),
            last: Mutex::default(),
        }
    }

    /// Listens for Ctrl-C and for the system's request to end from now on; a second one ends at once.
    ///
    /// Before work begins that looks whether it should stop, either ends the program as always.
    fn listen(&self) {
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
            self.bar().suspend(|| note(line));
        }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar().finish_and_clear();
    }

    fn bar(&self) -> std::sync::MutexGuard<'_, ProgressBar> {
        self.bar.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for Printer {
    fn begin(&self, what: &str, total: u64) {
        self.listen();
        if self.quiet {
            return;
        }
        let mut bar = self.bar();
        bar.finish_and_clear();
        if !self.terminal {
            let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
            if std::mem::replace(&mut *last, what.to_owned()) == what {
                return;
            }
            note(&format!(
                "[{:7.1} s] {what}",
                self.started.elapsed().as_secs_f64()
            ));
            return;
        }
        let style = ProgressStyle::with_template("{msg:28} {bar:30} {percent:>3} % {eta:>5}")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        *bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr_with_hz(8))
            .with_style(style);
        bar.set_message(what.to_owned());
    }

    fn advance(&self, units: u64) {
        if self.terminal && !self.quiet {
            self.bar().inc(units);
        }
    }

    fn note(&self, line: &str) {
        self.log(line);
    }

    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

/// Writes one line to stderr; a closed stderr is no reason to fail.
pub fn note(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}
