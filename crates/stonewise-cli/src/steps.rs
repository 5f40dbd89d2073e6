//! Where a run stands in its list of steps.

use std::collections::BTreeSet;

/// A list of steps, and the one at work.
#[derive(Debug, Default)]
pub struct Steps {
    names: Vec<String>,
    at: At,
    /// Places of the steps that have ended.
    ended: BTreeSet<usize>,
}

#[derive(Debug, Default)]
enum At {
    #[default]
    Nothing,
    /// Work on this step began at this time, seconds.
    Work(usize, f64),
    /// All that is known of this step so far was done earlier.
    TakenOver(usize),
}

/// A step that has ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Ended {
    /// Its place in the list and its name, such as "4/6 measure the motions".
    pub step: String,
    /// How long it took, seconds; `None` where it was done earlier.
    pub seconds: Option<f64>,
}

impl Steps {
    /// Another list.
    pub fn list(&mut self, names: &[String]) {
        *self = Self {
            names: names.to_vec(),
            ..Self::default()
        };
    }

    /// Work on a step begins or goes on; the step that this ends.
    pub fn enter(&mut self, step: usize, now: f64) -> Option<Ended> {
        match self.at {
            At::Work(at, _) if at == step => None,
            At::TakenOver(at) if at == step => {
                self.at = At::Work(step, now);
                None
            }
            _ => {
                let ended = self.end(now);
                self.at = At::Work(step, now);
                ended
            }
        }
    }

    /// A step, or a part of it, was done earlier; the step that this ends. A step that has ended already is
    /// only read again.
    pub fn take_over(&mut self, step: usize, now: f64) -> Option<Ended> {
        match self.at {
            At::Work(at, _) | At::TakenOver(at) if at == step => None,
            _ if self.ended.contains(&step) => None,
            _ => {
                let ended = self.end(now);
                self.at = At::TakenOver(step);
                ended
            }
        }
    }

    /// The last step has ended, too.
    pub fn end(&mut self, now: f64) -> Option<Ended> {
        let (step, seconds) = match std::mem::take(&mut self.at) {
            At::Nothing => return None,
            At::Work(step, since) => (step, Some(now - since)),
            At::TakenOver(step) => (step, None),
        };
        self.ended.insert(step);
        let step = self.named(step)?;
        Some(Ended { step, seconds })
    }

    /// The step at work.
    pub fn present(&self) -> Option<String> {
        match self.at {
            At::Work(step, _) => self.named(step),
            At::Nothing | At::TakenOver(_) => None,
        }
    }

    /// Whether a step of the list has begun, or was done earlier: what begins now is a part of it.
    pub fn is_within(&self) -> bool {
        !matches!(self.at, At::Nothing)
    }

    /// The steps after the one at work.
    pub fn to_come(&self) -> &[String] {
        let (At::Work(step, _) | At::TakenOver(step)) = self.at else {
            return &[];
        };
        self.names.get(step + 1..).unwrap_or_default()
    }

    fn named(&self, step: usize) -> Option<String> {
        let name = self.names.get(step)?;
        // All numbers have the width of the last, so that the names of a list stand below each other.
        let width = self.names.len().to_string().len();
        Some(format!("{:>width$}/{} {name}", step + 1, self.names.len()))
    }
}

/// A span of time in words, such as "2 min 5 s".
pub fn span(seconds: f64) -> String {
    match seconds {
        s if s < 9.95 => format!("{s:.1} s"),
        s if s < 59.5 => format!("{s:.0} s"),
        s if s < 3599.5 => {
            let s = s.round() as u64;
            format!("{} min {:02} s", s / 60, s % 60)
        }
        s => {
            let minutes = (s / 60.0).round() as u64;
            format!("{} h {:02} min", minutes / 60, minutes % 60)
        }
    }
}

/// Time to go in words, no finer than it can be known; empty where it is not known yet.
///
/// `elapsed` and `to_go`: seconds. Less than three seconds of work, or less than a fiftieth of it, say
/// nothing about the rest.
pub fn time_to_go(elapsed: f64, to_go: f64, done: u64, total: u64) -> String {
    let is_known = elapsed >= 3.0 && done > 0 && done.saturating_mul(50) >= total && to_go.is_finite();
    match to_go {
        _ if !is_known || done >= total => String::new(),
        s if s < 10.0 => "< 10 s to go".to_owned(),
        s if s < 90.0 => format!("~{:.0} s to go", (s / 10.0).ceil() * 10.0),
        s if s < 5400.0 => format!("~{:.0} min to go", s / 60.0),
        s => format!("~{:.1} h to go", s / 3600.0),
    }
}

/// A line in lines of at most `width` characters, broken between words; those after the first are indented.
pub fn wrapped(line: &str, width: usize, indent: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in line.split(' ') {
        let is_first = lines.len() == 1;
        let Some(last) = lines.last_mut() else { continue };
        let is_fresh = last.is_empty() || (!is_first && last.trim().is_empty());
        if !is_fresh && last.chars().count() + 1 + word.chars().count() > width {
            lines.push(format!("{:indent$}{word}", ""));
        } else {
            if !is_fresh {
                last.push(' ');
            }
            last.push_str(word);
        }
    }
    lines
}

/// A text cut to `width` characters, with an ellipsis where something is left out.
pub fn cut(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return text.to_owned();
    }
    let kept: String = text.chars().take(width.saturating_sub(1)).collect();
    format!("{}\u{2026}", kept.trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn steps(names: &[&str]) -> Steps {
        let mut steps = Steps::default();
        steps.list(&names.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>());
        steps
    }

    #[test]
    fn each_step_ends_once_with_its_time() {
        let mut steps = steps(&["check", "clouds of 2025-04", "report"]);
        assert_eq!(steps.enter(0, 0.0), None);
        assert_eq!(steps.present().unwrap(), "1/3 check");
        assert_eq!(steps.enter(0, 1.0), None);
        let ended = steps.enter(1, 1.5).unwrap();
        assert_eq!((ended.step.as_str(), ended.seconds), ("1/3 check", Some(1.5)));
        assert_eq!(steps.to_come(), ["report"]);
        assert_eq!(
            steps.enter(2, 4.0).unwrap(),
            Ended {
                step: "2/3 clouds of 2025-04".to_owned(),
                seconds: Some(2.5)
            }
        );
        assert_eq!(steps.end(4.5).unwrap().seconds, Some(0.5));
        assert_eq!(steps.end(5.0), None);
    }

    #[test]
    fn a_step_is_taken_over_only_if_all_of_it_was_done() {
        let mut steps = steps(&["check", "labels", "report"]);
        steps.enter(0, 0.0);
        // Labels have two parts: both done earlier.
        assert_eq!(steps.take_over(1, 1.0).unwrap().step, "1/3 check");
        assert_eq!(steps.take_over(1, 1.0), None);
        assert_eq!(steps.enter(2, 1.5).unwrap().seconds, None);
        // The first alone was done earlier.
        let mut steps = super::tests::steps(&["check", "labels", "report"]);
        steps.take_over(1, 1.0);
        assert_eq!(steps.enter(1, 1.0), None);
        assert_eq!(steps.enter(2, 3.0).unwrap().seconds, Some(2.0));
        // What was done in this run is not taken over, even if a later part was there.
        assert_eq!(steps.take_over(2, 4.0), None);
        assert_eq!(steps.end(4.0).unwrap().seconds, Some(1.0));
    }

    #[test]
    fn a_step_that_is_read_again_by_a_later_one_does_not_end_twice() {
        let mut steps = steps(&["clouds", "photos", "labels"]);
        steps.enter(0, 0.0);
        assert_eq!(steps.enter(1, 2.0).unwrap().seconds, Some(2.0));
        assert_eq!(steps.take_over(0, 3.0), None);
        assert_eq!(steps.present().unwrap(), "2/3 photos");
        assert_eq!(steps.enter(2, 5.0).unwrap().seconds, Some(3.0));
        // Another list begins anew.
        steps.list(&["clouds".to_owned(), "photos".to_owned()]);
        steps.enter(1, 6.0);
        assert_eq!(steps.take_over(0, 7.0).unwrap().step, "2/2 photos");
    }

    #[test]
    fn a_time_to_go_is_said_only_where_it_is_known() {
        for (elapsed, to_go, done, total, words) in [
            (2.0, 100.0, 10, 100, ""),
            (10.0, 600.0, 1, 100, ""),
            (10.0, 95.0, 10, 100, "~2 min to go"),
            (10.0, 41.0, 10, 100, "~50 s to go"),
            (60.0, 4.0, 90, 100, "< 10 s to go"),
            (60.0, 0.0, 100, 100, ""),
            (900.0, 9000.0, 10, 100, "~2.5 h to go"),
        ] {
            assert_eq!(time_to_go(elapsed, to_go, done, total), words);
        }
    }

    #[test]
    fn spans_are_said_in_the_unit_that_fits() {
        for (seconds, words) in [
            (0.04, "0.0 s"),
            (9.94, "9.9 s"),
            (9.96, "10 s"),
            (59.6, "1 min 00 s"),
            (125.2, "2 min 05 s"),
            (3599.9, "1 h 00 min"),
            (7380.0, "2 h 03 min"),
        ] {
            assert_eq!(span(seconds), words);
        }
    }

    #[test]
    fn lines_break_between_words_and_lose_none() {
        let line =
            "note: epoch 2: areas off the wall are seen in both epochs and could show their registration";
        for width in [20, 33, 80, 200] {
            let lines = wrapped(line, width, 2);
            assert!(lines.iter().all(|l| l.chars().count() <= width), "{lines:?}");
            let joined: Vec<&str> = lines.iter().map(|l| l.trim()).collect();
            assert_eq!(joined.join(" "), line);
        }
        assert_eq!(wrapped("averyverylongword", 5, 2), ["averyverylongword"]);
        let table = wrapped("all   masks  two words", 17, 13);
        assert_eq!(table, ["all   masks  two", "             words"]);
        assert_eq!(cut("adjustment of 2026-04", 12), "adjustment\u{2026}");
    }
}
