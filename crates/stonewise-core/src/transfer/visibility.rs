//! What each photo says about a point that it can see.

use super::TransferError;
use super::TransferParams;
use super::depth::{SplatDepth, splat_all};
use super::frustum::Cone;
use super::run_labels::RunLabels;
use super::surface_cells::{LocalSurface, SurfaceCells, SurfaceGroup};
use crate::cloud::{Cloud, TileSource};
use crate::geometry::{Bounds, View};
use crate::progress::Progress;
use nalgebra::Point3;
use rayon::prelude::*;

/// One photo's word on one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sighting {
    /// Position of the photo among those with a mask.
    pub photo: u32,
    /// Instance of that photo's mask, 0 for background.
    pub instance: u32,
    /// How much the word counts; only ratios matter.
    pub weight: f32,
}

/// Radians by which a whole cell must be too oblique before its points are not looked at: rounding must not
/// decide.
const ANGLE_MARGIN: f64 = 1e-6;

/// Everything needed to look up any point in all photos.
pub(super) struct Observer<'a> {
    views: Vec<&'a View>,
    centres: Vec<Point3<f64>>,
    cones: Vec<Cone>,
    labels: Vec<RunLabels>,
    depths: Vec<SplatDepth>,
    /// Of the tiles from `first_tile` on.
    surfaces: Vec<SurfaceCells>,
    first_tile: usize,
    params: &'a TransferParams,
    /// Of the steepest incidence at which a photo votes.
    least_cosine: f64,
}

impl<'a> Observer<'a> {
    /// Makes the depth maps of the photos that have masks.
    pub(super) fn new<T: TileSource>(
        tiles: &T,
        masked: Vec<(&'a View, RunLabels)>,
        params: &'a TransferParams,
        progress: &dyn Progress,
    ) -> Result<Self, TransferError> {
        let (views, labels): (Vec<&View>, Vec<RunLabels>) = masked.into_iter().unzip();
        let (depths, surfaces) = splat_all(tiles, &views, params, progress)?;
        Ok(Self::of(views, labels, depths, (surfaces, 0), params))
    }

    /// The same from depth maps and surfaces that were made before; `surfaces`: those of consecutive tiles,
    /// and the number of the first. What no tile of these needs may be empty.
    pub(super) fn of(
        views: Vec<&'a View>,
        labels: Vec<RunLabels>,
        depths: Vec<SplatDepth>,
        (surfaces, first_tile): (Vec<SurfaceCells>, usize),
        params: &'a TransferParams,
    ) -> Self {
        Self {
            centres: views.iter().map(|v| v.centre()).collect(),
            cones: views.iter().map(|v| Cone::of(v)).collect(),
            views,
            labels,
            depths,
            surfaces,
            first_tile,
            params,
            least_cosine: params.max_incidence_rad.cos(),
        }
    }

    /// The depth map of a photo.
    pub(super) fn depth(&self, photo: usize) -> Option<&SplatDepth> {
        self.depths.get(photo)
    }

    /// The local surface of a tile.
    pub(super) fn surface(&self, tile: usize) -> Option<&SurfaceCells> {
        self.surfaces.get(tile.checked_sub(self.first_tile)?)
    }

    /// The photos that have masks.
    pub(super) fn views(&self) -> &[&'a View] {
        &self.views
    }

    /// Photos that may show a part of the box.
    pub(super) fn candidates(&self, bounds: &Bounds) -> Vec<u32> {
        (0..self.views.len() as u32)
            .filter(|&p| self.cones[p as usize].touches(bounds))
            .collect()
    }

    /// Median point spacing over the cells of the whole cloud, metres.
    pub(super) fn spacing_m(&self) -> f64 {
        let mut all: Vec<f32> = self.surfaces.iter().flat_map(SurfaceCells::spacings).collect();
        all.sort_by(f32::total_cmp);
        all.get(all.len() / 2).copied().map_or(0.0, f64::from)
    }

    /// What `judge` makes of the sightings of each chosen point of a tile by the candidate photos, in the
    /// order of `chosen`.
    ///
    /// Points come cell by cell: their surface is looked up once, photos that cannot vote in the cell are
    /// left out, and the others show its points side by side.
    pub(super) fn sight_all<R: Clone + Default + Send>(
        &self,
        tile: usize,
        cloud: &Cloud,
        chosen: &[u32],
        candidates: &[u32],
        judge: impl Fn(&[Sighting]) -> R + Sync,
    ) -> Vec<R> {
        let groups = self.surfaces[tile - self.first_tile].groups_of(cloud, chosen);
        let judged: Vec<Vec<R>> = groups
            .par_iter()
            .map_init(Vec::new, |found, group| {
                let may_vote = |p: &u32| self.may_vote(*p as usize, group);
                let candidates: Vec<u32> = candidates.iter().copied().filter(may_vote).collect();
                let of_point = |&k: &u32| {
                    let world = cloud.world(chosen[k as usize] as usize);
                    found.clear();
                    let sightings = candidates
                        .iter()
                        .map(|&photo| self.sight_in(photo, &group.surface, &world));
                    found.extend(sightings.flatten());
                    judge(&found[..])
                };
                group.points.iter().map(of_point).collect()
            })
            .collect();
        let mut results = vec![R::default(); chosen.len()];
        for (group, judged) in groups.iter().zip(judged) {
            for (&k, result) in group.points.iter().zip(judged) {
                results[k as usize] = result;
            }
        }
        results
    }

    /// False only where the photo shows no point of a cell, or all of them at too steep an incidence to vote.
    fn may_vote(&self, photo: usize, group: &SurfaceGroup) -> bool {
        if !self.cones[photo].touches(&group.bounds) {
            return false;
        }
        let to_centre = group.bounds.centre() - self.centres[photo];
        let radius = (group.bounds.max - group.bounds.min).norm() / 2.0;
        let distance = to_centre.norm();
        if distance <= radius {
            return true;
        }
        let incidence = group.surface.cosine(&(to_centre / distance)).min(1.0).acos();
        incidence - (radius / distance).asin() <= self.params.max_incidence_rad + ANGLE_MARGIN
    }

    /// What a photo says about a point; what costs least and rules out most comes first.
    fn sight_in(&self, photo: u32, surface: &LocalSurface, world: &Point3<f64>) -> Option<Sighting> {
        let p = photo as usize;
        let view = self.views[p];
        let seen = view.project(world)?;
        if !view.is_inside(seen.pixel) {
            return None;
        }
        let line = (world - self.centres[p]).normalize();
        let cosine = surface.cosine(&line);
        if cosine < self.least_cosine {
            return None;
        }
        let tolerance = surface.tolerance_m(cosine, self.params);
        let (depth, here) = (seen.depth_m, self.depths[p].at(seen.pixel)?);
        if depth > f64::from(here) + tolerance {
            return None;
        }
        let instance = self.labels[p].at(seen.pixel)?;
        let [least, greatest] = self.depths[p].around(seen.pixel, here, self.params.silhouette_px);
        let step = self.params.silhouette_step_m + tolerance;
        let beside_an_occluder = depth > f64::from(least) + step;
        let on_an_edge = f64::from(greatest) > depth + step;
        // Precision of a border on the face: finer and less oblique photos place it more precisely. The
        // root keeps one close photo from outvoting the majority.
        let precision = (cosine / view.gsd_m(depth)).sqrt();
        let weight = if beside_an_occluder || on_an_edge {
            precision * self.params.silhouette_weight
        } else {
            precision
        } as f32;
        Some(Sighting {
            photo,
            instance,
            weight,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Camera, Rigid3};
    use crate::id::ImageId;
    use crate::raster::LabelImage;
    use nalgebra::{Translation3, UnitQuaternion, Vector3};
    use rand::{RngExt, SeedableRng};

    /// Cells of a rough wall and photos that look anywhere: photos left out for a cell say nothing about any
    /// of its points, and enough are left out.
    #[test]
    fn photos_left_out_for_a_cell_see_none_of_its_points() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let points = (0..4000).map(|_| {
            let (x, z): (f64, f64) = (rng.random_range(0.0..4.0), rng.random_range(0.0..2.0));
            Point3::new(x, 0.3 * (3.0 * x).sin(), z)
        });
        let cloud = Cloud::from_world(Point3::new(2.0, 0.0, 1.0), points.collect::<Vec<_>>());
        let views: Vec<View> = (0..40)
            .map(|i| {
                let mut draw = |reach: f64| Vector3::from_fn(|_, _| rng.random_range(-reach..reach));
                let centre = Vector3::new(2.0, -3.0, 1.0) + draw(2.5);
                let turn =
                    UnitQuaternion::face_towards(&(draw(1.0) + Vector3::y()), &-Vector3::z()).inverse();
                View {
                    image: ImageId(i),
                    name: String::new(),
                    camera: Camera::pinhole(40, 30, 35.0),
                    cam_from_world: Rigid3::from_parts(Translation3::from(-(turn * centre)), turn),
                }
            })
            .collect();
        let labels = || RunLabels::new(&LabelImage::filled(40, 30, 1));
        let params = TransferParams::default();
        let surfaces = vec![SurfaceCells::new(&cloud, params.cell_m)];
        let groups = surfaces[0].groups(&cloud);
        let observer = Observer::of(
            views.iter().collect(),
            views.iter().map(|_| labels()).collect(),
            views.iter().map(|v| SplatDepth::new(v, 1.0)).collect(),
            (surfaces, 0),
            &params,
        );
        let (mut left_out, mut seen) = (0, 0);
        for group in &groups {
            for photo in 0..views.len() {
                let sees = |&i: &u32| {
                    let world = cloud.world(i as usize);
                    observer.sight_in(photo as u32, &group.surface, &world).is_some()
                };
                let some = group.points.iter().any(sees);
                seen += usize::from(some);
                if !observer.may_vote(photo, group) {
                    left_out += 1;
                    assert!(!some, "photo {photo} sees a cell that it was left out for");
                }
            }
        }
        let all = groups.len() * views.len();
        assert!(
            seen > all / 20 && left_out > all / 2,
            "{seen} seen, {left_out} left out of {all}"
        );
    }
}
