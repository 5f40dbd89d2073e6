//! The template of a stone: the mean of the first epoch's photos, brought onto each other.

use super::matching::{FaceCells, LEAST_SHARE, Match, Template, Warp};
use super::params::PhotoParams;
use super::patch::Patch;
use super::search::Search;
use super::surface::Surface;
use nalgebra::Vector2;

/// Rounds in which the template follows the photos.
const ROUNDS: usize = 3;
/// Distance within which photos of one epoch are searched for on each other, in standard deviations of the
/// difference that errors of two poses cause.
const POSE_SDS: f64 = 4.0;
/// Distance in which a least-squares match may end from its start, cells: within the grain that smoothing
/// leaves.
const PULL_IN: f64 = 4.0;

/// The face on which photos are matched.
pub(super) struct Face {
    pub surface: Surface,
    pub cells: FaceCells,
    /// Correlation below which a photo is left out.
    min_correlation: f64,
    /// Distance within which photos of one epoch are searched for on each other, cells.
    pose_reach: isize,
    /// Distance within which the other epoch is searched for, cells.
    pub reach: isize,
}

/// The mean of one epoch's photos, and how each lies on it.
pub(super) struct Mean {
    pub template: Template,
    pub matches: Vec<Option<Match>>,
}

impl Face {
    /// `pixel_m`: size of a pixel on the face, metres; `search_m`: distance within which the other epoch is
    /// searched for, metres.
    pub fn new(surface: Surface, pixel_m: f64, search_m: f64, params: &PhotoParams) -> Self {
        // Two photos, each shifted by errors of position and of attitude: the root of four variances.
        let apart_px = 2.0 * params.pose_error_px;
        Self {
            cells: FaceCells::new(&surface),
            pose_reach: (POSE_SDS * apart_px * pixel_m / surface.cell_m).ceil() as isize,
            min_correlation: params.min_correlation,
            reach: (search_m / surface.cell_m).ceil() as isize,
            surface,
        }
    }

    /// The mean of photos of one epoch aligned with each other, refined in rounds; `None` if none matches.
    pub fn template(&self, patches: &[Patch]) -> Option<Mean> {
        let mut mean = self.first_mean(patches)?;
        for round in 1..ROUNDS {
            mean.matches = self.matches(&mean.template, patches, &mean.matches);
            if round + 1 < ROUNDS {
                mean.template = self.mean(patches, &mean.matches)?;
            }
        }
        Some(mean)
    }

    /// The mean of photos of one epoch aligned with one of them: accurate enough for a search.
    pub fn first_mean(&self, patches: &[Patch]) -> Option<Mean> {
        let matches = self.first_matches(patches)?;
        let template = self.mean(patches, &matches)?;
        Some(Mean { template, matches })
    }

    /// The photos matched with the one of them that most others agree with; among equals that which shows
    /// most of the face.
    fn first_matches(&self, patches: &[Patch]) -> Option<Vec<Option<Match>>> {
        let inside = &self.surface.inside;
        let shown = |i: usize| -> usize {
            let valid = &patches[i].valid;
            (0..valid.len()).filter(|&k| inside[k] && valid[k]).count()
        };
        // A photo that shows less than this of the face matches none.
        let least = LEAST_SHARE * self.cells.count() as f64;
        let mut references: Vec<usize> = (0..patches.len()).filter(|&i| shown(i) as f64 >= least).collect();
        references.sort_by_key(|&i| (std::cmp::Reverse(shown(i)), i));
        let most = references.len();
        let count = |m: &[Option<Match>]| m.iter().flatten().count();
        let mut best: Option<Vec<Option<Match>>> = None;
        for reference in references {
            let still = Warp::shift(Vector2::zeros());
            let warped = self.warped(&patches[reference], &still);
            let template = Template::new(warped, &self.surface);
            let found = self.matches(&template, patches, &[]);
            if best.as_ref().is_none_or(|b| count(&found) > count(b)) {
                best = Some(found);
            }
            if best.as_ref().is_some_and(|b| count(b) == most) {
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
        let search = Search::new(template, &self.surface, &self.cells);
        let one = |(i, patch): (usize, &Patch)| {
            let start = match before.get(i).copied().flatten() {
                Some(found) => found.warp,
                None => Warp::shift(search.best_shift(patch, self.pose_reach)?.0),
            };
            self.matched(template, patch, start)
        };
        patches.iter().enumerate().map(one).collect()
    }

    /// Photos of an epoch matched with the template of the other epoch.
    ///
    /// The mean of their own epoch is searched for as far as `reach`, so that errors of single poses do
    /// not blur the search. Each photo starts from its own shift on that mean.
    pub fn matches_across(
        &self,
        template: &Template,
        patches: &[Patch],
        own: &Mean,
    ) -> Option<Vec<Option<Match>>> {
        let (shift, _) =
            Search::new(template, &self.surface, &self.cells).best_shift(&own.template.patch, self.reach)?;
        let between = Warp::shift(shift);
        let start = |found: &Option<Match>| found.map_or(between, |m| m.warp.after(&between));
        let starts: Vec<Warp> = own.matches.iter().map(start).collect();
        Some(self.matches_from(template, patches, &starts))
    }

    /// Photos matched with a template, each from its start.
    pub fn matches_from(
        &self,
        template: &Template,
        patches: &[Patch],
        starts: &[Warp],
    ) -> Vec<Option<Match>> {
        let photos = patches.iter().zip(starts);
        photos
            .map(|(p, start)| self.matched(template, p, *start))
            .collect()
    }

    /// A photo's match with a template near a start; `None` where it does not settle or correlates too
    /// little.
    pub fn matched(&self, template: &Template, patch: &Patch, start: Warp) -> Option<Match> {
        let found = self
            .cells
            .matched(template, patch, &self.surface, start, PULL_IN)?;
        (found.correlation >= self.min_correlation).then_some(found)
    }

    /// A warped photo on the face and around it, as far as it is searched for.
    fn warped(&self, patch: &Patch, warp: &Warp) -> Patch {
        let margin = self.reach.unsigned_abs();
        self.cells.warped(patch, &self.surface, warp, margin)
    }

    /// Mean of the warped photos, cell by cell; `None` without a match.
    pub fn mean(&self, patches: &[Patch], matches: &[Option<Match>]) -> Option<Template> {
        let warped: Vec<Patch> = patches
            .iter()
            .zip(matches)
            .filter_map(|(patch, found)| {
                let warp = found.as_ref()?.warp;
                Some(self.warped(patch, &warp))
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
        let mean = |(sum, n): &(f32, u16)| if *n > 0 { sum / f32::from(*n) } else { 0.0 };
        let values = cells.iter().map(mean).collect();
        let valid = cells.iter().map(|(_, n)| *n > 0).collect();
        let patch = Patch::new(values, valid, self.surface.columns);
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

#[cfg(test)]
mod tests {
    use super::super::testing::{face, grained};
    use super::*;

    const GRAIN: f64 = 3.0;
    /// Cells by which poses shift the photos of an epoch.
    const POSES: [[f64; 2]; 5] = [[0.0, 0.0], [2.5, -1.5], [-3.0, 2.0], [1.0, 3.5], [-1.5, -3.0]];

    fn photos(moved: [f64; 2]) -> Vec<Patch> {
        let photo = |[x, y]: &[f64; 2]| grained(7, GRAIN, [x + moved[0], y + moved[1]]);
        POSES.iter().map(photo).collect()
    }

    /// The largest distance of matches from the shifts that the photos' poses and `moved` cause, cells, after
    /// the shift that all have in common is removed.
    fn largest_error(matches: &[Option<Match>], moved: [f64; 2]) -> Option<f64> {
        let errors: Option<Vec<Vector2<f64>>> = matches
            .iter()
            .zip(POSES)
            .map(|(found, [x, y])| {
                Some(found.as_ref()?.warp.shift - Vector2::new(x + moved[0], y + moved[1]))
            })
            .collect();
        let errors = errors?;
        let mean = errors.iter().sum::<Vector2<f64>>() / errors.len() as f64;
        errors.iter().map(|e| (e - mean).norm()).reduce(f64::max)
    }

    #[test]
    fn photos_with_wrong_poses_are_found_across_epochs() {
        let face = face(1.0);
        let moved = [6.0, -4.0];
        let second = photos(moved);
        let mean = face.template(&photos([0.0; 2])).unwrap();
        let own = face.first_mean(&second).unwrap();
        let found = face.matches_across(&mean.template, &second, &own).unwrap();
        let error = largest_error(&found, moved);
        assert!(error.is_some_and(|e| e < 0.1), "{error:?}");
        let shift = |matches: &[Option<Match>]| median_shift(matches.iter().flatten().map(|m| m.warp.shift));
        let between = shift(&found).unwrap() - shift(&mean.matches).unwrap();
        assert!((between - Vector2::from(moved)).norm() < 0.1, "{between}");
    }

    #[test]
    fn photos_are_brought_together_as_far_as_their_poses_are_stated_to_err() {
        let far = [grained(7, GRAIN, [0.0; 2]), grained(7, GRAIN, [9.0, 0.0])];
        let difference = |pose_error_px: f64| {
            let mean = face(pose_error_px).template(&far).unwrap();
            let [first, second] = [0, 1].map(|i| mean.matches[i].map(|m| m.warp.shift.x));
            Some(second? - first?)
        };
        assert!(difference(1.5).is_some_and(|d| (d - 9.0).abs() < 0.1));
        assert!(difference(0.5).is_none_or(|d| d < 8.0));
    }
}
