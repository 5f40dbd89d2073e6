//! The list of steps on a terminal: finished ones ticked and timed, the one at work with its count.

use crate::note::note;
use crate::steps::{Ended, cut, span, time_to_go};
use console::Term;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::fmt::Write;
use std::sync::Mutex;
use std::time::Duration;

/// Redraws in a second.
const REDRAWS: u8 = 8;
/// Time between two pictures of the sign that work goes on.
const TICK: Duration = Duration::from_millis(250);
/// Names of steps are no wider than this, so that the eye finds the time that belongs to them.
const NAMES: usize = 60;
/// From this count on a percentage says more than the count.
const MOST_COUNTED: u64 = 100_000;

/// A terminal.
pub struct Screen {
    term: Term,
    bar: ProgressBar,
    /// The line of steps to come.
    then: Mutex<String>,
    colours: bool,
}

impl Screen {
    /// stderr as a terminal.
    pub fn new() -> Self {
        let target = ProgressDrawTarget::stderr_with_hz(REDRAWS);
        let term = Term::stderr();
        Self {
            // The style of a bar without a count; the first part sets its own.
            bar: ProgressBar::with_draw_target(None, target).with_style(ProgressStyle::default_spinner()),
            then: Mutex::default(),
            colours: term.features().colors_supported() && std::env::var_os("NO_COLOR").is_none(),
            term,
        }
    }

    /// Characters in a line; as many as any text needs where the terminal does not say.
    pub fn width(&self) -> usize {
        self.term
            .size_checked()
            .map_or(usize::MAX, |(_, columns)| usize::from(columns))
    }

    /// Does what writes lines above the bar.
    pub fn above(&self, write: impl FnOnce()) {
        self.bar.suspend(write);
    }

    /// A step begins; others follow.
    pub fn begin(&self, step: &str, to_come: &[String]) {
        let then = match to_come {
            [] => String::new(),
            names => cut(
                &format!("    then {}", names.join(", ")),
                self.width().saturating_sub(1),
            ),
        };
        if let Ok(mut shown) = self.then.lock() {
            *shown = then;
        }
        self.restart();
        self.part(step, "", 0);
    }

    /// The time to go is that of the work that begins now.
    pub fn restart(&self) {
        self.bar.reset();
    }

    /// A part of the work, named on a line of its own, of `total` units; 0 where their number is unknown.
    pub fn part(&self, step: &str, words: &str, total: u64) {
        match total {
            0 => self.bar.unset_length(),
            total => self.bar.set_length(total),
        }
        self.bar.set_style(self.style(words, total > 0));
        self.bar.set_message(step.to_owned());
        self.bar.enable_steady_tick(TICK);
    }

    /// More units are done.
    pub fn advance(&self, units: u64) {
        self.bar.inc(units);
    }

    /// A finished step.
    pub fn ended(&self, ended: &Ended) {
        let time = ended.seconds.map_or_else(|| "done earlier".to_owned(), span);
        self.line(("\u{2713}", "32"), &ended.step, &time);
    }

    /// A step that did not come to its end.
    pub fn failed(&self, step: &str) {
        self.line(("\u{2717}", "31"), step, "not finished");
    }

    /// Takes the bar away.
    pub fn clear(&self) {
        self.bar.disable_steady_tick();
        self.bar.finish_and_clear();
    }

    fn line(&self, (mark, colour): (&str, &str), step: &str, time: &str) {
        let mark = match self.colours {
            true => format!("\u{1b}[{colour}m{mark}\u{1b}[0m"),
            false => mark.to_owned(),
        };
        // Before the name are the mark and a space, behind it a space and at most thirteen characters of
        // time.
        let width = NAMES.min(self.width().saturating_sub(2 + 1 + 13 + 1));
        let step = cut(step, width);
        self.bar
            .suspend(|| note(&format!("{mark} {step:<width$} {time:>13}")));
    }

    fn style(&self, words: &str, is_counted: bool) -> ProgressStyle {
        let then = self.then.lock().map_or(String::new(), |then| then.clone());
        let words = match words {
            "" => String::new(),
            words => cut(&format!("    {words}"), self.width().saturating_sub(1)),
        };
        let below: Vec<String> = [words, then].into_iter().filter(|l| !l.is_empty()).collect();
        let below = below.join("\n");
        let bar = if self.width() < 120 { 14 } else { 30 };
        // Beside the name and the bar: sign, count, time to go, four spaces, and one column that stays free.
        let name = NAMES.min(self.width().saturating_sub(bar + 1 + 8 + 14 + 4 + 1));
        let counted = format!("{{spinner}} {{msg:{name}!}} {{bar:{bar}}} {{count:>8}} {{to_go:14}}");
        let first = if is_counted {
            &counted
        } else {
            "{spinner} {wide_msg}"
        };
        let template = match below.as_str() {
            "" => first.to_owned(),
            _ => format!("{first}\n{{below}}"),
        };
        ProgressStyle::with_template(&template)
            .unwrap_or_else(|_| ProgressStyle::default_bar())
            .tick_chars("|/-\\ ")
            .progress_chars("#>-")
            .with_key("count", |state: &ProgressState, out: &mut dyn Write| {
                // Each change draws; what begins without a count is drawn once in the style of what had one.
                if let Some(total) = state.len() {
                    let _ = write!(out, "{}", count(state.pos(), total));
                }
            })
            .with_key("to_go", |state: &ProgressState, out: &mut dyn Write| {
                let seconds = [state.elapsed(), state.eta()].map(|t| t.as_secs_f64());
                let total = state.len().unwrap_or(0);
                let _ = write!(out, "{}", time_to_go(seconds[0], seconds[1], state.pos(), total));
            })
            .with_key("below", move |_: &ProgressState, out: &mut dyn Write| {
                let _ = write!(out, "{below}");
            })
    }
}

/// How far the work is.
fn count(done: u64, total: u64) -> String {
    match total {
        total if total >= MOST_COUNTED => format!("{} %", done.min(total) * 100 / total),
        total => format!("{done}/{total}"),
    }
}
