//! What a match must pass: more correlation than chance gives, the way back, and another normalisation of
//! contrast.
//!
//! Photos of one epoch resemble each other, so a wrong match, on a shadow's edge or on a neighbour's, can be
//! the same in all of them and correlate well. It is rarely the same from the second epoch to the first, or
//! in another window.

use super::matching::{Match, Template};
use super::patch::Patch;
use super::template::{Face, Mean, median_shift};
use nalgebra::Vector2;
use statrs::distribution::{ContinuousCDF, Normal};
use std::f64::consts::PI;

/// Probability that the best of all places sought correlates as well by chance.
const CHANCE: f64 = 0.05;
/// Correlation that still counts as grain: below, sums over longer distances would only add noise.
const LEAST_GRAIN: f64 = 0.05;
/// Reach over which grain is summed, cells: beyond, contrast normalisation leaves none.
const LONGEST_GRAIN: usize = 12;

/// Cells by which the way back and the other normalisation may lead elsewhere. Half a pixel: of 1,457 tracked
/// stones on ten simulated walls that leaves out 12 of 19 that were wrong by more than 4 mm, and 3 of 1,347
/// that were right to 1.5 mm.
const MOST_APART: f64 = 0.5;

/// The photos of both epochs and how they lie on the template.
pub(super) struct Verification<'a> {
    pub face: &'a Face,
    pub patches: [&'a [Patch]; 2],
    /// The first epoch's photos on their template.
    pub first: &'a Mean,
    /// The second epoch's photos on that template.
    pub second: &'a [Option<Match>],
}

impl Verification<'_> {
    /// Change of the match under the other normalisation (patches `others`), cells; `None` where the match fails
    /// because the way back or the other normalisation gives a different shift or none.
    pub fn verified(&self, others: [&[Patch]; 2]) -> Option<Vector2<f64>> {
        let way_back = self.way_back()?;
        let other = self.under(others)?;
        (way_back.norm() <= MOST_APART && other.norm() <= MOST_APART).then_some(other)
    }

    /// How far the first epoch's photos are shifted from their matches when they are matched with the mean of
    /// the second epoch's photos, cells.
    fn way_back(&self) -> Option<Vector2<f64>> {
        let [first, second] = self.patches;
        let template = self.face.mean(second, self.second)?;
        let back = self.face.matches_across(&template, first, self.first)?;
        apart(&back, &self.first.matches)
    }

    /// The second epoch's shift against the first's in photos of another normalisation, less that in these.
    fn under(&self, others: [&[Patch]; 2]) -> Option<Vector2<f64>> {
        let matches = [&self.first.matches, self.second];
        let template = self.face.mean(others[0], matches[0])?;
        let [first, second] = [0, 1].map(|epoch| {
            let again: Vec<Option<Match>> = others[epoch]
                .iter()
                .zip(matches[epoch])
                .map(|(patch, found)| self.face.matched(&template, patch, found.as_ref()?.warp))
                .collect();
            apart(&again, matches[epoch])
        });
        Some(second? - first?)
    }
}

/// How far matches' correlation with a template lies above none, in standard deviations; `None` where the best
/// place of a search as far as the face is searched for correlates as well by chance.
///
/// A face of n independent grains has Fisher's z with a standard deviation of 1 / sqrt(n) (Fisher 1921); the
/// search tries as many independent places as grains fit into its circle.
pub(super) fn beyond_chance(face: &Face, template: &Template, matches: &[Option<Match>]) -> Option<f64> {
    let correlations: Vec<f64> = matches.iter().flatten().map(|m| m.correlation).collect();
    let mean = correlations.iter().sum::<f64>() / correlations.len() as f64;
    let grain_area = grain_cells(face, &template.patch).powi(2);
    let grains = face.cells.count() as f64 / grain_area;
    let places = (PI * (face.reach * face.reach) as f64 / grain_area).max(1.0);
    let z = mean.clamp(-MOST_CORRELATION, MOST_CORRELATION).atanh() * grains.sqrt();
    (z > Normal::standard().inverse_cdf(1.0 - CHANCE / places)).then_some(z)
}

/// Keeps Fisher's z finite.
const MOST_CORRELATION: f64 = 0.999;

/// Integral of a patch's autocorrelation along a line, cells: the side of what counts as one independent
/// value.
fn grain_cells(face: &Face, patch: &Patch) -> f64 {
    let (inside, columns) = (&face.surface.inside, face.surface.columns);
    let shows = |k: usize| inside.get(k) == Some(&true) && patch.valid[k];
    let correlation = |distance: usize| {
        let (mut product, mut square) = (0.0, 0.0);
        for k in (0..patch.values.len()).filter(|&k| shows(k)) {
            for to in [k + distance, k + distance * columns] {
                if shows(to) {
                    product += f64::from(patch.values[k] * patch.values[to]);
                    square += f64::from(patch.values[k] * patch.values[k]);
                }
            }
        }
        if square > 0.0 { product / square } else { 0.0 }
    };
    let beside: f64 = (1..LONGEST_GRAIN)
        .map(correlation)
        .take_while(|c| *c > LEAST_GRAIN)
        .sum();
    1.0 + 2.0 * beside
}

/// Median difference of the shifts of photos that both lists match, cells, each coordinate by itself.
fn apart(matches: &[Option<Match>], from: &[Option<Match>]) -> Option<Vector2<f64>> {
    let both = matches.iter().zip(from);
    median_shift(both.filter_map(|(a, b)| Some(a.as_ref()?.warp.shift - b.as_ref()?.warp.shift)))
}

#[cfg(test)]
mod tests {
    use super::super::matching::Warp;
    use super::super::search::Search;
    use super::super::testing::{face, grained};
    use super::*;
    use nalgebra::Matrix2;

    fn matched(correlation: f64) -> Option<Match> {
        Some(Match {
            is_affine: true,
            warp: Warp::shift(Vector2::zeros()),
            covariance: Matrix2::identity(),
            correlation,
        })
    }

    #[test]
    fn the_best_of_chance_passes_as_rarely_as_stated() {
        let face = face(0.5);
        let mut passed = 0;
        for seed in 0..120 {
            let template = Template::new(grained(2 * seed, 3.0, [0.0; 2]), &face.surface);
            let other = grained(2 * seed + 1, 3.0, [0.0; 2]);
            let search = Search::new(&template, &face.surface, &face.cells);
            let (_, best) = search.best_shift(&other, face.reach).unwrap();
            passed += usize::from(beyond_chance(&face, &template, &[matched(best)]).is_some());
        }
        // 5 % of 120 are 6, standard deviation 2.4.
        assert!(passed <= 14, "{passed}");
        let template = Template::new(grained(1, 3.0, [0.0; 2]), &face.surface);
        assert!(beyond_chance(&face, &template, &[matched(0.8)]).is_some());
    }

    #[test]
    fn a_coarse_picture_needs_more_correlation_than_a_fine_one() {
        let face = face(0.5);
        let [fine, coarse] =
            [2.0, 9.0].map(|grain| Template::new(grained(3, grain, [0.0; 2]), &face.surface));
        let found = [matched(0.5)];
        assert!(beyond_chance(&face, &fine, &found).is_some());
        assert!(beyond_chance(&face, &coarse, &found).is_none());
    }

    #[test]
    fn a_match_that_leads_elsewhere_on_the_way_back_is_refused() {
        let face = face(0.5);
        let [first, second] = [0.0, 3.0].map(|shift| vec![grained(5, 3.0, [shift, 0.0])]);
        let mean = face.template(&first).unwrap();
        let at = |shift: f64| {
            let warp = Warp::shift(Vector2::new(shift, 0.0));
            let twos = [matched(0.9).map(|m| Match { warp, ..m })];
            let verification = Verification {
                face: &face,
                patches: [&first, &second],
                first: &mean,
                second: &twos,
            };
            let apart = verification.way_back().map(|w| w.norm());
            (apart, verification.verified([&first, &second]).is_some())
        };
        let (apart, is_verified) = at(3.0);
        assert!(apart.is_some_and(|a| a < 0.05) && is_verified, "{apart:?}");
        // The photo moved by 3 cells and was matched at -2: the way back is 5 cells off.
        let (apart, is_verified) = at(-2.0);
        assert!(
            apart.is_some_and(|a| (a - 5.0).abs() < 0.1) && !is_verified,
            "{apart:?}"
        );
    }
}
