//! Which figures of the second of two folders are better or worse: paired by survey.

use super::figures::{Better, Figures, columns};
use super::lines;
use crate::Outcome;
use crate::table::Table;
use crate::words::Words;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_core::statistics::discoveries;

/// Changes below this share of a figure make no difference.
const MARGIN: f64 = 0.03;
/// Share of false discoveries among the figures that are called better or worse.
const FALSE_DISCOVERIES: f64 = 0.05;
/// Times that the surveys are drawn anew.
const DRAWS: usize = 4000;

pub fn run(words: &Words) -> Outcome {
    let [_, first, second, ..] = words.as_slice() else {
        return Err("name two folders: lab yardstick compare FOLDER FOLDER".into());
    };
    let filter = words.option("--filter").unwrap_or_default();
    let [first, second] = [lines(Path::new(first))?, lines(Path::new(second))?];
    let columns = columns();
    let changes: Vec<Option<Change>> = columns
        .iter()
        .map(|(name, better)| Change::of(&pairs(&first, &second, name, filter), *better))
        .collect();
    let p: Vec<Option<f64>> = changes.iter().map(|c| c.as_ref().map(|c| c.p)).collect();
    let shown = discoveries(&p, FALSE_DISCOVERIES);
    let table = Table::begin([
        "figure",
        "surveys",
        "first",
        "second",
        "worse by",
        "95 % from",
        "to",
        "",
    ]);
    for (k, ((name, _), change)) in columns.iter().zip(&changes).enumerate() {
        let Some(c) = change else { continue };
        let number = |v: f64| format!("{v:.3}");
        let loss = |v: f64| format!("{v:+.3}");
        table.row([
            name.clone(),
            c.surveys.to_string(),
            number(c.means[0]),
            number(c.means[1]),
            loss(c.loss),
            loss(c.interval[0]),
            loss(c.interval[1]),
            c.verdict(shown.contains(&k)).to_owned(),
        ]);
    }
    Ok(())
}

/// A figure of the surveys that both have.
fn pairs(
    first: &BTreeMap<String, Figures>,
    second: &BTreeMap<String, Figures>,
    name: &str,
    filter: &str,
) -> Vec<[f64; 2]> {
    let both = |(survey, one): (&String, &Figures)| Some([*one.get(name)?, *second.get(survey)?.get(name)?]);
    first
        .iter()
        .filter(|(survey, _)| survey.contains(filter))
        .filter_map(both)
        .collect()
}

/// How a figure changed.
struct Change {
    surveys: usize,
    means: [f64; 2],
    /// By how much it is worse, mean of the surveys; negative: better.
    loss: f64,
    interval: [f64; 2],
    /// Probability of so large a change by the choice of surveys alone, two sided.
    p: f64,
    /// Changes below this make no difference.
    margin: f64,
}

impl Change {
    /// `None` without surveys. Percentile bootstrap over surveys (Efron 1979); the seed is fixed.
    fn of(pairs: &[[f64; 2]], better: Better) -> Option<Self> {
        let n = pairs.len();
        if n == 0 {
            return None;
        }
        let bad = |v: f64| match better {
            Better::Less => v,
            Better::More => -v,
            Better::Near(right) => (v - right).abs(),
        };
        let losses: Vec<f64> = pairs.iter().map(|[a, b]| bad(*b) - bad(*a)).collect();
        let mean = |of: &dyn Fn(usize) -> f64| (0..n).map(of).sum::<f64>() / n as f64;
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut drawn: Vec<f64> = (0..DRAWS)
            .map(|_| (0..n).map(|_| losses[rng.random_range(0..n)]).sum::<f64>() / n as f64)
            .collect();
        drawn.sort_by(f64::total_cmp);
        let beyond = |side: f64| drawn.iter().filter(|d| side * **d <= 0.0).count();
        let tail = beyond(1.0).min(beyond(-1.0)) as f64;
        Some(Self {
            surveys: n,
            means: [0, 1].map(|k| mean(&|i| pairs[i][k])),
            loss: mean(&|i| losses[i]),
            interval: [drawn[DRAWS / 40], drawn[DRAWS - 1 - DRAWS / 40]],
            p: (2.0 * (tail + 1.0) / (DRAWS as f64 + 1.0)).min(1.0),
            margin: MARGIN * mean(&|i| pairs[i][0].abs()),
        })
    }

    fn verdict(&self, is_shown: bool) -> &'static str {
        match is_shown && self.loss.abs() > self.margin {
            true if self.loss > 0.0 => "worse",
            true => "better",
            false => "no difference",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_simulate::normal;

    /// Pairs of which the second is `factor` times the first, less some scatter.
    fn pairs_of(factor: f64, scatter: f64, seed: u64) -> Vec<[f64; 2]> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..60)
            .map(|k| {
                let first = 1.0 + 0.05 * f64::from(k);
                [first, factor * first + scatter * normal(&mut rng)]
            })
            .collect()
    }

    fn verdict(pairs: &[[f64; 2]], better: Better) -> &'static str {
        let change = Change::of(pairs, better).unwrap();
        change.verdict(change.p < 0.05)
    }

    #[test]
    fn says_what_is_better() {
        for (better, less) in [(Better::Less, "better"), (Better::More, "worse")] {
            assert_eq!(verdict(&pairs_of(0.8, 0.2, 1), better), less);
            assert_eq!(verdict(&pairs_of(0.98, 0.0, 1), better), "no difference");
            assert_eq!(verdict(&pairs_of(1.0, 0.0, 1), better), "no difference");
        }
        // From 0.85 to 0.93: nearer to 0.95, although larger.
        assert_eq!(verdict(&[[0.85, 0.93]; 20], Better::Near(0.95)), "better");
        assert!(Change::of(&[], Better::Less).is_none());
    }

    /// The interval is that of a mean: 1.96 standard errors to either side. Of pairs without a difference, one in
    /// twenty has p below 0.05.
    #[test]
    fn interval_is_that_of_a_mean() {
        let change = Change::of(&pairs_of(1.0, 0.3, 2), Better::Less).unwrap();
        let width = change.interval[1] - change.interval[0];
        let expected = 2.0 * 1.96 * 0.3 / 60f64.sqrt();
        assert!((width / expected - 1.0).abs() < 0.25, "{width} {expected}");
        let false_alarms =
            (0..200).filter(|s| Change::of(&pairs_of(1.0, 0.3, 100 + s), Better::Less).unwrap().p < 0.05);
        assert!((2..=22).contains(&false_alarms.count()));
    }
}
