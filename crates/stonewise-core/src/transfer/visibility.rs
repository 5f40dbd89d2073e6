//! What each photo says about a point that it can see.

use super::TransferError;
use super::TransferParams;
use super::depth::{SplatDepth, splat_all};
use super::depth_bounds::DepthBounds;
use super::frustum::Cone;
use super::photo_frame::{CHUNK, Chunk, PhotoFrame, Shown, chunk_of};
use super::run_labels::RunLabels;
use super::surface_cells::{LocalSurface, SurfaceCells, SurfaceGroup};
use crate::cloud::{Cloud, TileSource};
use crate::geometry::{Bounds, View};
use crate::progress::Progress;
use crate::statistics::upper_median;
use nalgebra::{Point3, Vector3};
use pulp::{Arch, Simd, WithSimd};
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
    frames: Vec<PhotoFrame<'a>>,
    labels: Vec<RunLabels>,
    depths: Vec<SplatDepth>,
    bounds: Vec<DepthBounds>,
    /// Of each tile.
    surfaces: Vec<SurfaceCells>,
    params: &'a TransferParams,
    /// Cosine of the steepest incidence at which a photo votes.
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
        Ok(Self {
            centres: views.iter().map(|v| v.centre()).collect(),
            cones: views.iter().map(|v| Cone::of(v)).collect(),
            frames: views.iter().map(|v| PhotoFrame::of(v)).collect(),
            bounds: depths
                .par_iter()
                .map(|depth| depth.bounds(params.silhouette_px))
                .collect(),
            views,
            labels,
            depths,
            surfaces,
            params,
            least_cosine: params.max_incidence_rad.cos(),
        })
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
        let all = self.surfaces.iter().flat_map(SurfaceCells::spacings);
        upper_median(&mut all.map(f64::from).collect::<Vec<_>>()).unwrap_or(0.0)
    }

    /// For each cell of a tile's surface, what `note` makes of the sightings of its chosen points by the
    /// candidate photos. `note` is given the place of a point in `chosen` and its sightings.
    ///
    /// The surface of a cell is looked up once, photos that cannot vote in it are left out, and the others
    /// show its points side by side.
    pub(super) fn sight_cells<R: Default + Send>(
        &self,
        tile: usize,
        cloud: &Cloud,
        chosen: &[u32],
        candidates: &[u32],
        note: impl Fn(&mut R, u32, &[Sighting]) + Sync,
    ) -> Vec<R> {
        let groups = self.surfaces[tile].groups_of(cloud, chosen);
        let of_group = |(seen, found): &mut (Vec<Seen>, Vec<Sighting>), group: &SurfaceGroup| {
            let may_vote = |p: &u32| self.may_vote(*p as usize, group);
            let candidates = candidates.iter().copied().filter(may_vote);
            let looks: Vec<Look> = candidates.map(|photo| self.look(photo, &group.surface)).collect();
            seen.resize_with(seen.len().max(looks.len()), Seen::none);
            let mut noted = R::default();
            for places in group.points.chunks(CHUNK) {
                let points = places.iter().map(|&place| chosen[place as usize]);
                let chunk = chunk_of(cloud, points);
                for (look, seen) in looks.iter().zip(&mut *seen) {
                    self.see(look, &chunk, seen);
                }
                for (k, &place) in places.iter().enumerate() {
                    found.clear();
                    found.extend(
                        looks
                            .iter()
                            .zip(&*seen)
                            .filter_map(|(look, seen)| self.sight(look, seen, k)),
                    );
                    note(&mut noted, place, &found[..]);
                }
            }
            noted
        };
        groups.par_iter().map_init(Default::default, of_group).collect()
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

    fn look<'s>(&self, photo: u32, surface: &'s LocalSurface) -> Look<'s> {
        let normal = surface.normal.cast::<f64>();
        Look {
            photo,
            surface,
            normal: (surface.normal != Vector3::zeros())
                .then(|| self.frames[photo as usize].direction(&normal)),
            least_tolerance_m: surface.tolerance_m(1.0, self.params),
        }
    }

    /// Projects points into a photo, computes distances and incidences, and drops the points that are seen too
    /// obliquely.
    fn see(&self, look: &Look, world: &Chunk, seen: &mut Seen) {
        self.frames[look.photo as usize].show(world, &mut seen.shown);
        Arch::new().dispatch(Incidence {
            seen,
            normal: look.normal,
            least_cosine: self.least_cosine,
        });
    }

    /// The sighting of a point of a chunk; `None` where the photo does not show it.
    #[inline]
    fn sight(&self, look: &Look, seen: &Seen, k: usize) -> Option<Sighting> {
        let p = look.photo as usize;
        let pixel = seen.shown.pixel(k)?;
        let (depth, distance, across) = (seen.shown.points[2][k], seen.distance[k], seen.across[k]);
        // Most points lie on an even surface that fills their block of the depth map.
        let even = self.depths[p]
            .bounds_at(&self.bounds[p], pixel)
            .is_some_and(|[least, greatest]| {
                depth <= f64::from(least) + look.least_tolerance_m
                    && f64::from(greatest) <= depth + self.params.silhouette_step_m + look.least_tolerance_m
            });
        let at_a_silhouette = !even && self.is_at_a_silhouette(look, pixel, depth, across / distance)?;
        let instance = self.labels[p].at(pixel)?;
        // Precision of a border on the face: finer and less oblique photos place it more precisely. The
        // root keeps one close photo from outvoting the majority.
        let precision = (across * self.frames[p].focal_px / (distance * depth)).sqrt();
        let weight = if at_a_silhouette {
            precision * self.params.silhouette_weight
        } else {
            precision
        } as f32;
        Some(Sighting {
            photo: look.photo,
            instance,
            weight,
        })
    }

    /// Whether a point lies beside an occluder or on an edge; `None` where it is hidden.
    fn is_at_a_silhouette(&self, look: &Look, pixel: [f64; 2], depth: f64, cosine: f64) -> Option<bool> {
        let map = &self.depths[look.photo as usize];
        let tolerance = look.surface.tolerance_m(cosine, self.params);
        let here = map.at(pixel)?;
        if depth > f64::from(here) + tolerance {
            return None;
        }
        let [least, greatest] = map.around(pixel, here, self.params.silhouette_px);
        let step = self.params.silhouette_step_m + tolerance;
        Some(depth > f64::from(least) + step || f64::from(greatest) > depth + step)
    }
}

/// A photo and a cell of the surface, with all quantities that do not depend on the point.
struct Look<'a> {
    photo: u32,
    surface: &'a LocalSurface,
    /// Normal of the cell, in the frame of the camera; `None` where it has none.
    normal: Option<Vector3<f64>>,
    /// Depth tolerance of a point seen at a right angle, metres.
    least_tolerance_m: f64,
}

/// What a photo shows of the points of a chunk.
struct Seen {
    /// Without the points seen at too steep an incidence.
    shown: Shown,
    /// From the camera, metres.
    distance: [f64; CHUNK],
    /// Along the normal of the surface, metres. Divided by the distance, this is the cosine of the incidence.
    across: [f64; CHUNK],
}

impl Seen {
    fn none() -> Self {
        Self {
            shown: Shown::none(),
            distance: [f64::NAN; CHUNK],
            across: [f64::NAN; CHUNK],
        }
    }
}

/// Computes distances and incidences.
struct Incidence<'a> {
    seen: &'a mut Seen,
    normal: Option<Vector3<f64>>,
    least_cosine: f64,
}

impl WithSimd for Incidence<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Seen {
            shown,
            distance,
            across,
        } = self.seen;
        let normal = self.normal.unwrap_or_default();
        for k in 0..CHUNK {
            let [x, y, z] = [shown.points[0][k], shown.points[1][k], shown.points[2][k]];
            distance[k] = (x * x + y * y + z * z).sqrt();
            let along_normal = (normal.x * x + normal.y * y + normal.z * z).abs();
            across[k] = if self.normal.is_some() {
                along_normal
            } else {
                0.5 * distance[k]
            };
            let is_steep = across[k] < self.least_cosine * distance[k];
            shown.pixels[0][k] = if is_steep { f64::NAN } else { shown.pixels[0][k] };
        }
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

    /// What a photo says, from the depth map and the formulas for a single point alone.
    fn sight_alone(
        observer: &Observer,
        photo: usize,
        surface: &LocalSurface,
        world: &Point3<f64>,
    ) -> Option<Sighting> {
        let (view, params, map) = (observer.views[photo], observer.params, &observer.depths[photo]);
        let seen = view.project(world).filter(|seen| view.is_inside(seen.pixel))?;
        let cosine = surface.cosine(&(world - view.centre()).normalize());
        let (depth, here, tolerance) = (
            seen.depth_m,
            map.at(seen.pixel)?,
            surface.tolerance_m(cosine, params),
        );
        if cosine < params.max_incidence_rad.cos() || depth > f64::from(here) + tolerance {
            return None;
        }
        let [least, greatest] = map.around(seen.pixel, here, params.silhouette_px).map(f64::from);
        let step = params.silhouette_step_m + tolerance;
        let share = if depth > least + step || greatest > depth + step {
            params.silhouette_weight
        } else {
            1.0
        };
        Some(Sighting {
            photo: photo as u32,
            instance: observer.labels[photo].at(seen.pixel)?,
            weight: (share * (cosine / view.gsd_m(depth)).sqrt()) as f32,
        })
    }

    /// The sighting of a point that is alone in its chunk.
    fn sight(observer: &Observer, look: &Look, world: &Point3<f64>) -> Option<Sighting> {
        let mut seen = Seen::none();
        let cloud = Cloud::from_world(*world, [*world]);
        observer.see(look, &chunk_of(&cloud, 0..1), &mut seen);
        observer.sight(look, &seen, 0)
    }

    /// A wall with recesses, a rail and a board before it, all in the depth maps, which some photos look at
    /// slantwise; also where maps are smaller than their photos.
    #[test]
    fn points_whose_block_is_even_are_judged_as_all_others() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(9);
        let mut draw = |low: f64, high: f64| rng.random_range(low..high);
        let wall = (0..30_000).map(|_| {
            let (x, z) = (draw(0.0, 4.0), draw(0.0, 2.0));
            let recess = if x % 0.8 < 0.1 { 0.3 } else { 0.0 };
            Point3::new(x, recess + 0.02 * (9.0 * x).sin() * (7.0 * z).cos(), z)
        });
        let wall: Vec<Point3<f64>> = wall.collect();
        let rail = (0..3000).map(|_| Point3::new(draw(0.0, 4.0), -0.8, draw(0.5, 0.53)));
        let points: Vec<Point3<f64>> = wall.into_iter().chain(rail).collect();
        let board =
            (0..4000).map(|_| Point3::new(draw(2.0, 2.7), -0.4 + draw(-0.002, 0.002), draw(0.8, 1.6)));
        let board: Vec<Point3<f64>> = board.collect();
        let cloud = Cloud::from_world(Point3::new(2.0, 0.0, 1.0), points.into_iter().chain(board));
        let views: Vec<View> = (0..6)
            .map(|i| {
                let centre = Vector3::new(draw(-1.0, 5.0), draw(-5.0, -2.0), draw(0.0, 2.0));
                let to_middle = Vector3::new(2.0, 0.0, 1.0) - centre;
                let turn = UnitQuaternion::face_towards(&to_middle, &-Vector3::z()).inverse();
                View {
                    image: ImageId(i),
                    name: String::new(),
                    camera: Camera::pinhole(300, 200, 200.0),
                    cam_from_world: Rigid3::from_parts(Translation3::from(-(turn * centre)), turn),
                }
            })
            .collect();
        let masks = || {
            LabelImage::from_vec(
                300,
                200,
                (0..60_000u32).map(|i| i % 300 / 23 + i / 6000).collect(),
            )
        };
        let tiles = crate::cloud::MemoryTiles::new([cloud.clone()]);
        for depth_memory_mib in [1024, 1] {
            let params = TransferParams {
                depth_memory_mib,
                ..TransferParams::default()
            };
            let masked = views
                .iter()
                .map(|v| (v, RunLabels::new(&masks().unwrap())))
                .collect();
            let observer = Observer::new(&tiles, masked, &params, &crate::progress::Silent).unwrap();
            let (mut full, mut at_silhouettes, mut unseen) = (0, 0, 0);
            let mut seen = Seen::none();
            for group in observer.surfaces[0].groups(&cloud) {
                let chunks = || group.points.chunks(CHUNK);
                for (photo, points) in (0..views.len()).flat_map(|p| chunks().map(move |points| (p, points)))
                {
                    let look = observer.look(photo as u32, &group.surface);
                    observer.see(&look, &chunk_of(&cloud, points.iter().copied()), &mut seen);
                    for (k, &i) in points.iter().enumerate() {
                        let world = cloud.world(i as usize);
                        let expected = sight_alone(&observer, photo, &group.surface, &world);
                        let found = observer.sight(&look, &seen, k);
                        let bare = |s: &Sighting| (s.photo, s.instance);
                        assert_eq!(found.as_ref().map(bare), expected.as_ref().map(bare));
                        if let (Some(found), Some(expected)) = (&found, &expected) {
                            assert!((found.weight / expected.weight - 1.0).abs() < 1e-6);
                            full += usize::from(found.weight > 1.0);
                            at_silhouettes += usize::from(found.weight <= 1.0);
                        }
                        unseen += usize::from(found.is_none());
                    }
                }
            }
            let counts = [full, at_silhouettes, unseen];
            let all: usize = counts.iter().sum();
            assert!(counts.iter().all(|n| 20 * n > all), "{counts:?}");
        }
    }

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
        let masked = views.iter().map(|v| (v, labels())).collect();
        let tiles = crate::cloud::MemoryTiles::new([cloud.clone()]);
        let observer = Observer::new(&tiles, masked, &params, &crate::progress::Silent).unwrap();
        let groups = observer.surfaces[0].groups(&cloud);
        let (mut left_out, mut seen) = (0, 0);
        for group in &groups {
            for photo in 0..views.len() {
                let sees = |&i: &u32| {
                    let world = cloud.world(i as usize);
                    sight(&observer, &observer.look(photo as u32, &group.surface), &world).is_some()
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
