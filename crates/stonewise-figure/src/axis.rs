//! One axis of a plot: its range, its ticks, and where a value lies.

use super::text::number;

/// An axis.
#[derive(Clone, Debug)]
pub struct Axis {
    /// What is written beside it.
    pub label: String,
    /// Values at its ends.
    pub range: [f64; 2],
    /// Whether equal steps are equal ratios.
    pub logarithmic: bool,
    /// What stands before the decimals of its numbers.
    pub decimal: &'static str,
}

impl Axis {
    /// An axis with equal steps; an empty range is widened, and one that is not finite is 0 to 1.
    pub fn linear(label: &str, range: [f64; 2]) -> Self {
        let [low, high] = range;
        let range = match (high - low).is_finite() {
            true if high > low => range,
            true => [low - 0.5, low + 0.5],
            false => [0.0, 1.0],
        };
        Self {
            label: label.to_owned(),
            range,
            logarithmic: false,
            decimal: ".",
        }
    }

    /// A linear axis around values, with a margin of 4 %; `with_zero` takes zero in.
    pub fn around(label: &str, values: impl IntoIterator<Item = f64>, with_zero: bool) -> Self {
        let start = if with_zero {
            [0.0, 0.0]
        } else {
            [f64::MAX, f64::MIN]
        };
        let [low, high] = values
            .into_iter()
            .filter(|v| v.is_finite())
            .fold(start, |[low, high], v| [low.min(v), high.max(v)]);
        if low > high {
            return Self::linear(label, [0.0, 1.0]);
        }
        let margin = 0.04 * (high - low);
        let below = if with_zero && low == 0.0 { 0.0 } else { margin };
        Self::linear(label, [low - below, high + margin])
    }

    /// A logarithmic axis around positive values; others are left out.
    pub fn decades(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let [low, high] = values
            .into_iter()
            .filter(|v| v.is_finite() && *v > 0.0)
            .fold([f64::MAX, f64::MIN], |[low, high], v| [low.min(v), high.max(v)]);
        let range = if low > high {
            [0.1, 10.0]
        } else {
            [low / 1.3, high * 1.3]
        };
        Self {
            label: label.to_owned(),
            range,
            logarithmic: true,
            decimal: ".",
        }
    }

    /// Where a value lies: 0 at the low end, 1 at the high end; NaN where a logarithm has none.
    pub fn share(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        if self.logarithmic {
            (value / low).ln() / (high / low).ln()
        } else {
            (value - low) / (high - low)
        }
    }

    /// Whether a value lies between the ends, or on one.
    pub fn holds(&self, value: f64) -> bool {
        self.range[0] <= value && value <= self.range[1]
    }

    /// Round values with their texts, about `wanted` of them.
    pub fn ticks(&self, wanted: usize) -> Vec<(f64, String)> {
        let ticks = if self.logarithmic {
            self.decade_ticks(wanted)
        } else {
            self.even_ticks(wanted)
        };
        let text = |(value, decimals)| (value, number(value, decimals).replace('.', self.decimal));
        ticks.into_iter().map(text).collect()
    }

    /// Values and how many decimals they need.
    fn even_ticks(&self, wanted: usize) -> Vec<(f64, usize)> {
        let [low, high] = self.range;
        let step = nice_above((high - low) / wanted.max(1) as f64);
        let (first, last) = (
            (low / step - 1e-9).ceil() as i64,
            (high / step + 1e-9).floor() as i64,
        );
        let decimals = decimals_of(step);
        (first..=last).map(|i| (i as f64 * step, decimals)).collect()
    }

    fn decade_ticks(&self, wanted: usize) -> Vec<(f64, usize)> {
        let [low, high] = self.range;
        let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
        let with = |factors: &[f64]| {
            let all = decades
                .clone()
                .flat_map(|d| factors.iter().map(move |f| f * 10f64.powi(d)));
            all.filter(|v| (low..=high).contains(v)).collect::<Vec<_>>()
        };
        let fine = with(&[1.0, 2.0, 5.0]);
        let chosen = if fine.len() <= wanted + 2 {
            fine
        } else {
            with(&[1.0])
        };
        chosen
            .into_iter()
            .map(|v| (v, (-v.log10() - 1e-9).ceil().max(0.0) as usize))
            .collect()
    }
}

/// The smallest of 1, 2, 2.5, 5 times a power of ten that is at least `value`; 1 for values that are not
/// positive.
pub fn nice_above(value: f64) -> f64 {
    if !value.is_finite() || value <= 0.0 {
        return 1.0;
    }
    let power = 10f64.powf(value.log10().floor());
    let steps = [1.0, 2.0, 2.5, 5.0, 10.0];
    steps
        .into_iter()
        .map(|s| s * power)
        .find(|s| *s >= value * (1.0 - 1e-9))
        .unwrap_or(10.0 * power)
}

/// Decimals that multiples of a step need, six at most.
fn decimals_of(step: f64) -> usize {
    let whole = |d: &i32| {
        let scaled = step * 10f64.powi(*d);
        (scaled - scaled.round()).abs() <= 1e-6
    };
    (0..6).find(whole).unwrap_or(6) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(axis: &Axis, wanted: usize) -> Vec<String> {
        axis.ticks(wanted).into_iter().map(|t| t.1).collect()
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(
            texts(&Axis::linear("", [0.0, 1.0]), 5),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        assert_eq!(texts(&Axis::linear("", [-3.0, 12.0]), 3), ["0", "5", "10"]);
        assert_eq!(texts(&Axis::linear("", [-1.0, 4.2]), 5), ["0", "2", "4"]);
        let mut fine = Axis::linear("", [0.0, 0.5]);
        assert_eq!(texts(&fine, 2), ["0.00", "0.25", "0.50"]);
        fine.decimal = ",";
        assert_eq!(texts(&fine, 2), ["0,00", "0,25", "0,50"]);
        assert_eq!(texts(&Axis::linear("", [f64::NAN, 1.0]), 1), ["0", "1"]);
        let decades = Axis::decades("", [0.05, 30.0]);
        assert_eq!(texts(&decades, 4), ["0.1", "1", "10"]);
        assert_eq!(texts(&Axis::decades("", [1.0, 8.0]), 5), ["1", "2", "5", "10"]);
    }

    #[test]
    fn shares_run_from_end_to_end() {
        let axis = Axis::linear("", [2.0, 4.0]);
        assert_eq!(
            (axis.share(2.0), axis.share(3.0), axis.share(4.0)),
            (0.0, 0.5, 1.0)
        );
        let mut axis = Axis::decades("", [1.0]);
        axis.range = [0.01, 100.0];
        assert!((axis.share(1.0) - 0.5).abs() < 1e-12 && axis.share(-1.0).is_nan());
        assert!(Axis::around("", [], true).range[1] > 0.0);
        assert!(Axis::linear("", [1.0, 1.0]).range[1] > 1.0);
    }

    #[test]
    fn nice_numbers_are_not_below() {
        for (value, nice) in [
            (0.7, 1.0),
            (1.0, 1.0),
            (1.1, 2.0),
            (21.0, 25.0),
            (260.0, 500.0),
            (0.0, 1.0),
        ] {
            assert_eq!(nice_above(value), nice);
        }
        assert_eq!(nice_above(f64::NAN), 1.0);
    }
}
