//! The template of a stone: the mean of the first epoch's photos, brought onto each other.

use super::matching::{FaceCells, Match, Template, Warp};
use super::patch::Patch;
use super::search::Search;
use super::surface::Surface;
use nalgebra::Vector2;

/// Rounds in which the template follows the photos.
const ROUNDS: usize = 3;
/// Error of a pose for which photos of one epoch are searched, cells of a pixel: several times what bundle
/// adjustments leave.
const POSE_REACH: isize = 4;
/// Distance in which a least-squares match may end from its start, cells: within the grain that smoothing
/// leaves.
pub(super) const PULL_IN: f64 = 4.0;

/// The face on which photos are matched.
pub(super) struct Face {
    pub surface: Surface,
    pub cells: FaceCells,
    /// Correlation below which a photo is left out.
    pub min_correlation: f64,
}

impl Face {
    pub fn new(surface: Surface, min_correlation: f64) -> Self {
        Self {
            cells: FaceCells::new(&surface),
            surface,
            min_correlation,
        }
    }

    /// The mean of photos brought onto each other, and how each lies on it; `None` where none matches.
    pub fn template(&self, patches: &[Patch]) -> Option<(Template, Vec<Option<Match>>)> {
        let mut matches = self.first_matches(patches)?;
        let mut template = self.mean(patches, &matches)?;
        for round in 1..ROUNDS {
            matches = self.matches(&template, patches, &matches);
            if round + 1 < ROUNDS {
                template = self.mean(patches, &matches)?;
            }
        }
        Some((template, matches))
    }

    /// The photos matched with the one of them that most others agree with; among equals that which shows
    /// most of the face.
    fn first_matches(&self, patches: &[Patch]) -> Option<Vec<Option<Match>>> {
        let inside = &self.surface.inside;
        let shown = |i: usize| -> usize {
            let valid = &patches[i].valid;
            (0..valid.len()).filter(|&k| inside[k] && valid[k]).count()
        };
        let mut references: Vec<usize> = (0..patches.len()).collect();
        references.sort_by_key(|&i| (std::cmp::Reverse(shown(i)), i));
        let count = |m: &[Option<Match>]| m.iter().flatten().count();
        let mut best: Option<Vec<Option<Match>>> = None;
        for reference in references {
            let still = Warp::shift(Vector2::zeros());
            let warped = self.cells.warped(&patches[reference], &self.surface, &still);
            let template = Template::new(warped, &self.surface);
            let found = self.matches(&template, patches, &[]);
            if best.as_ref().is_none_or(|b| count(&found) > count(b)) {
                best = Some(found);
            }
            if best.as_ref().is_some_and(|b| count(b) == patches.len()) {
                break;
            }
        }
        best
    }

    /// Photos matched with a template one by one, each from where it lay on it before, or from where it is
    /// found.
    fn matches(
        &self,
        template: &Template,
        patches: &[Patch],
        before: &[Option<Match>],
    ) -> Vec<Option<Match>> {
        let one = |(i, patch): (usize, &Patch)| {
            let start = match before.get(i).copied().flatten() {
                Some(found) => found.warp,
                None => self.sought(template, &[patch], POSE_REACH)?,
            };
            self.matched(template, patch, start)
        };
        patches.iter().enumerate().map(one).collect()
    }

    /// Photos that share a motion matched with a template, from where they agree best with it within `reach`
    /// cells.
    pub fn matches_together(
        &self,
        template: &Template,
        patches: &[Patch],
        reach: isize,
    ) -> Option<Vec<Option<Match>>> {
        let views: Vec<&Patch> = patches.iter().collect();
        let start = self.sought(template, &views, reach)?;
        let one = |patch| self.matched(template, patch, start);
        Some(patches.iter().map(one).collect())
    }

    /// Where photos that share a motion agree best with a template, within `reach` cells.
    pub fn sought(&self, template: &Template, patches: &[&Patch], reach: isize) -> Option<Warp> {
        let (shift, _) = Search::new(template, &self.surface).best_shift(patches, reach)?;
        Some(Warp::shift(shift))
    }

    /// A photo's match with a template near a start; `None` where it does not settle or correlates too
    /// little.
    pub fn matched(&self, template: &Template, patch: &Patch, start: Warp) -> Option<Match> {
        let found = self
            .cells
            .matched(template, patch, &self.surface, start, PULL_IN)?;
        (found.correlation >= self.min_correlation).then_some(found)
    }

    /// Mean of the warped photos, cell by cell; `None` without a match.
    pub fn mean(&self, patches: &[Patch], matches: &[Option<Match>]) -> Option<Template> {
        let warped: Vec<Patch> = patches
            .iter()
            .zip(matches)
            .filter_map(|(patch, found)| {
                let warp = found.as_ref()?.warp;
                Some(self.cells.warped(patch, &self.surface, &warp))
            })
            .collect();
        if warped.is_empty() {
            return None;
        }
        let of_cell = |k: usize| -> (f32, u16) {
            warped
                .iter()
                .filter(|w| w.valid[k])
                .fold((0.0, 0), |(s, n), w| (s + w.values[k], n + 1))
        };
        let cells: Vec<(f32, u16)> = (0..self.surface.heights.len()).map(of_cell).collect();
        let patch = Patch {
            values: cells
                .iter()
                .map(|(s, n)| if *n > 0 { s / f32::from(*n) } else { 0.0 })
                .collect(),
            valid: cells.iter().map(|(_, n)| *n > 0).collect(),
        };
        Some(Template::new(patch, &self.surface))
    }
}

/// Median of shifts, each coordinate by itself; `None` without any.
pub(super) fn median_shift(shifts: impl Iterator<Item = Vector2<f64>>) -> Option<Vector2<f64>> {
    let shifts: Vec<Vector2<f64>> = shifts.collect();
    let median = |axis: usize| {
        let mut values: Vec<f64> = shifts.iter().map(|s| s[axis]).collect();
        crate::statistics::median(&mut values)
    };
    Some(Vector2::new(median(0)?, median(1)?))
}
