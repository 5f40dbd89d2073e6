//! The learning rate over a training.

use serde::{Deserialize, Serialize};
use stonewise_core::params::{Params, Range, Ranged};

/// How long a whole training lasts, over however many runs of the program.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Total {
    /// Steps of the optimiser.
    Steps(u64),
    /// Minutes spent in training.
    Minutes(f64),
}

/// How far a training has come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Elapsed {
    /// Steps of the optimiser done.
    pub steps: u64,
    /// Seconds spent in training, without the pauses between runs.
    pub seconds: f64,
}

impl Total {
    /// Share of the training that is done, 0 to 1.
    pub fn share_done(&self, elapsed: &Elapsed) -> f64 {
        let share = match *self {
            Self::Steps(steps) => elapsed.steps as f64 / steps as f64,
            Self::Minutes(minutes) => elapsed.seconds / (60.0 * minutes),
        };
        // A total of zero is over before it starts.
        if share.is_nan() { 1.0 } else { share.min(1.0) }
    }
}

/// A trapezoid: linear warm-up, a plateau, linear decay to zero.
///
/// The plateau does not depend on the total, so a training that is continued under a larger total goes on as
/// if the total had been known from the start. Source: Hägele et al. 2024, who find it as good as a cosine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Schedule {
    /// Rate of the plateau.
    pub learning_rate: f64,
    /// Steps of warm-up: at the start the moments of the optimiser are guesses from few gradients.
    pub warmup_steps: u64,
    /// Share of the total that decays.
    pub decay_share: f64,
}

impl Default for Schedule {
    fn default() -> Self {
        Self {
            learning_rate: 8e-4,
            warmup_steps: 200,
            decay_share: 0.4,
        }
    }
}

impl Params for Schedule {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::POSITIVE.holds("learning_rate", self.learning_rate),
            Range::SHARE.holds("decay_share", self.decay_share),
        ]
    }
}

impl Schedule {
    /// The rate of the next step.
    pub fn rate(&self, total: &Total, elapsed: &Elapsed) -> f64 {
        let rise = (elapsed.steps + 1) as f64 / self.warmup_steps.max(1) as f64;
        let fall = (1.0 - total.share_done(elapsed)) / self.decay_share.max(f64::EPSILON);
        self.learning_rate * rise.min(fall).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(steps: u64, seconds: f64) -> Elapsed {
        Elapsed { steps, seconds }
    }

    #[test]
    fn the_rate_rises_stays_and_falls_to_nothing() {
        let schedule = Schedule {
            learning_rate: 0.1,
            warmup_steps: 10,
            decay_share: 0.25,
        };
        let total = Total::Steps(400);
        let rate = |steps| schedule.rate(&total, &at(steps, 1e9));
        assert!((rate(0) - 0.01).abs() < 1e-12);
        assert!((rate(9) - 0.1).abs() < 1e-12 && (rate(300) - 0.1).abs() < 1e-12);
        assert!((rate(350) - 0.05).abs() < 1e-12);
        assert_eq!([rate(400), rate(500)], [0.0, 0.0]);
    }

    #[test]
    fn minutes_count_time_and_not_steps() {
        let total = Total::Minutes(2.0);
        assert_eq!(total.share_done(&at(1_000_000, 30.0)), 0.25);
        assert_eq!(total.share_done(&at(0, 600.0)), 1.0);
        assert_eq!(Total::Minutes(0.0).share_done(&at(0, 0.0)), 1.0);
    }
}
