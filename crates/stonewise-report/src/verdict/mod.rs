//! The verdict on a run: the state of the wall, its zones and its stones, and one sentence that says it
//! everywhere.
//!
//! `assess` is a pure function of what was measured, of how sound the run is and of the thresholds;
//! `evidence` takes what it needs from result files.

mod area;
mod assess;
mod case;
mod evidence;
mod interval;
mod judged;
mod limits;
mod lost;
mod sentence;
mod series;
#[cfg(test)]
mod set_thresholds;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;
mod time;

pub(crate) use evidence::verdict_in;
pub use evidence::{Pair, verdict_on};
pub(crate) use sentence::zone_in_words;
#[cfg(test)]
pub(crate) use series::answers;
pub(crate) use series::name as term_name;
pub use series::{inseparable_in_words, series_verdict};
pub use time::Course;

use stonewise_base::warnings::Warning;

/// Whether there is a doubt about a later epoch or about the run as a whole; `later`: names of all later
/// epochs.
pub fn is_doubted<'a>(
    warnings: &[Warning],
    epoch: &str,
    later: impl Iterator<Item = &'a str> + Clone,
) -> bool {
    let about_another = |subject: &str| subject != epoch && later.clone().any(|name| name == subject);
    warnings.iter().any(|w| w.doubt && !about_another(&w.subject))
}
