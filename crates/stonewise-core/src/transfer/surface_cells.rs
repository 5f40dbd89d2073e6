//! Local spacing, noise and orientation of a tile's surface.

use super::TransferParams;
use super::neighbourhood::{Members, Neighbourhood};
use crate::cloud::Cloud;
use crate::geometry::{Bounds, CellMap, cell_of, floor};
use crate::statistics::upper_median;
use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

/// What the surface is like around a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct LocalSurface {
    /// Unit normal of the face, sign arbitrary.
    pub normal: Vector3<f32>,
    /// Distance between points of an even surface sampling of the same density, metres.
    pub spacing_m: f32,
    /// Standard deviation of points about a small plane, metres.
    pub noise_m: f32,
    /// Points of the cell.
    points: u32,
}

impl LocalSurface {
    /// Cosine of the angle between a line of sight (unit vector) and the face's normal. A cell without a
    /// normal (one or two points) says nothing about incidence: 0.5.
    #[inline]
    pub(super) fn cosine(&self, line: &Vector3<f64>) -> f64 {
        if self.normal == Vector3::zeros() {
            0.5
        } else {
            line.dot(&self.normal.cast()).abs()
        }
    }

    /// How far behind the nearest depth of its pixel a point of this surface still counts as visible, metres.
    #[inline]
    pub(super) fn tolerance_m(&self, cosine: f64, params: &TransferParams) -> f64 {
        let tangent = (1.0 - cosine * cosine).max(0.0).sqrt() / cosine;
        params.tolerance_spacings * f64::from(self.spacing_m) * (1.0 + tangent)
            + params.tolerance_noises * f64::from(self.noise_m)
    }
}

/// Local surface in cubic cells of a tile.
pub(super) struct SurfaceCells {
    /// Origin of the tile, world frame.
    origin: Point3<f64>,
    cell_m: f64,
    /// Ascending.
    keys: Vec<[i32; 3]>,
    /// Surface of each key's cell.
    surfaces: Vec<LocalSurface>,
}

/// Points of a tile that lie in one cell.
pub(super) struct SurfaceGroup {
    /// What the surface is like there.
    pub surface: LocalSurface,
    /// Around its points, world.
    pub bounds: Bounds,
    /// Ascending indices into the tile.
    pub points: Vec<u32>,
}

/// Points around a sample of which spacing and noise are measured.
const NEIGHBOURS: usize = 12;
/// Samples per cell at most; the median of them is kept.
const SAMPLES: usize = 5;
/// A cell's spacing is at most this many times that around the usual point of its block.
const MAX_SPACINGS: f32 = 2.0;
/// Edge of the blocks of the world in which the usual spacing is sought, metres: not the tiles, whose size
/// must not matter.
const BLOCK_M: f64 = 4.0;
/// Neighbours farther away than this say nothing about a surface, metres.
const MAX_NEIGHBOUR_M: f64 = 0.5;

impl SurfaceCells {
    /// Measures the surface of a tile; [`limit_spacings`] comes next. Cost: a few searches per cell, each
    /// through its points.
    pub(super) fn new(cloud: &Cloud, cell_m: f64) -> Self {
        let points: Vec<Point3<f64>> = (0..cloud.len()).map(|i| cloud.local(i)).collect();
        let members = members(&points, cell_m);
        let neighbourhood = Neighbourhood {
            points: &points,
            members: &members,
            cell_m,
        };
        let measured: Vec<LocalSurface> = members
            .par_iter()
            .map(|cell| measure(&neighbourhood, cell))
            .collect();
        Self {
            origin: cloud.origin(),
            cell_m,
            keys: members.iter().map(|m| m.0).collect(),
            surfaces: measured,
        }
    }

    /// The points of the tile, cell by cell. Neighbours then come one after the other, whose pixels lie in
    /// the processor's cache.
    pub(super) fn groups(&self, cloud: &Cloud) -> Vec<SurfaceGroup> {
        self.groups_of(cloud, &(0..cloud.len() as u32).collect::<Vec<u32>>())
    }

    /// Some of the points of the tile, cell by cell; places in `chosen` stand for points. Those without a
    /// cell are in no group.
    pub(super) fn groups_of(&self, cloud: &Cloud, chosen: &[u32]) -> Vec<SurfaceGroup> {
        let points: Vec<Point3<f64>> = chosen.iter().map(|&i| cloud.local(i as usize)).collect();
        let group = |(key, points): Members| {
            let at = self.keys.binary_search(&key).ok()?;
            let bounds = Bounds::of(points.iter().map(|&k| cloud.world(chosen[k as usize] as usize)))?;
            Some(SurfaceGroup {
                surface: self.surfaces[at],
                bounds,
                points,
            })
        };
        members(&points, self.cell_m)
            .into_iter()
            .filter_map(group)
            .collect()
    }

    fn block(&self, key: &[i32; 3]) -> [i64; 3] {
        block_of(&self.origin, self.cell_m, key)
    }

    /// Spacings of all cells, in no particular order.
    pub(super) fn spacings(&self) -> impl Iterator<Item = f32> {
        self.surfaces.iter().map(|c| c.spacing_m)
    }
}

/// Takes lone points (leaves, birds, mixed returns) for what they are: points without a surface around them,
/// not the corners of a large one, which would hide what lies behind.
///
/// A cell's spacing is limited by what is usual in its block of the world, whatever tiles that falls into.
pub(super) fn limit_spacings(tiles: &mut [SurfaceCells]) {
    let mut blocks: CellMap<[i64; 3], Vec<(f32, u32)>> = CellMap::default();
    for tile in tiles.iter() {
        for (key, surface) in tile.keys.iter().zip(&tile.surfaces) {
            let spacings = blocks.entry(tile.block(key)).or_default();
            spacings.push((surface.spacing_m, surface.points));
        }
    }
    let limits: CellMap<[i64; 3], f32> = blocks
        .into_iter()
        .map(|(block, spacings)| (block, MAX_SPACINGS * usual(spacings)))
        .collect();
    for tile in tiles {
        let (origin, cell_m) = (tile.origin, tile.cell_m);
        for (key, surface) in tile.keys.iter().zip(&mut tile.surfaces) {
            let limit = limits.get(&block_of(&origin, cell_m, key)).copied();
            surface.spacing_m = surface.spacing_m.min(limit.unwrap_or(f32::INFINITY));
        }
    }
}

/// The spacing around the middle one of all points, of cells with their spacings and numbers of points.
fn usual(mut spacings: Vec<(f32, u32)>) -> f32 {
    spacings.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = spacings.iter().map(|c| u64::from(c.1)).sum::<u64>() / 2;
    let mut passed = 0;
    let middle = spacings.iter().find(|c| {
        passed += u64::from(c.1);
        passed > half
    });
    middle.map_or(f32::INFINITY, |c| c.0)
}

/// The block of the world in which the middle of a tile's cell lies.
fn block_of(origin: &Point3<f64>, cell_m: f64, key: &[i32; 3]) -> [i64; 3] {
    let middle = [0, 1, 2].map(|a| origin[a] + (f64::from(key[a]) + 0.5) * cell_m);
    cell_of(&Point3::from(middle), BLOCK_M)
}

fn key(p: &Point3<f64>, cell_m: f64) -> [i32; 3] {
    [0, 1, 2].map(|a| floor(p[a] / cell_m) as i32)
}

/// Indices of the points of each cell; cells and indices ascend.
fn members(points: &[Point3<f64>], cell_m: f64) -> Vec<Members> {
    let mut numbers: CellMap<[i32; 3], usize> = CellMap::default();
    let mut members: Vec<Members> = Vec::new();
    let mut last: Option<([i32; 3], usize)> = None;
    for (i, p) in points.iter().enumerate() {
        let key = key(p, cell_m);
        // Points mostly follow one in the same cell.
        let number = match last {
            Some((previous, number)) if previous == key => number,
            _ => *numbers.entry(key).or_insert_with(|| {
                members.push((key, Vec::new()));
                members.len() - 1
            }),
        };
        last = Some((key, number));
        members[number].1.push(i as u32);
    }
    members.sort_unstable_by_key(|(key, _)| *key);
    members
}

fn measure(around: &Neighbourhood, (cell, ids): &Members) -> LocalSurface {
    let points = around.points;
    let step = ids.len().div_ceil(SAMPLES).max(1);
    let mut spacings = Vec::new();
    let mut noises = Vec::new();

    for &i in ids.iter().skip(step / 2).step_by(step) {
        let found = around.nearest_k(cell, &points[i as usize], NEIGHBOURS + 1, MAX_NEIGHBOUR_M);
        let near: Vec<Point3<f64>> = found.iter().map(|f| points[f.0]).collect();
        let reach2 = found.last().map_or(0.0, |f| f.1);
        spacings.push(if found.len() > 1 {
            (std::f64::consts::PI * reach2 / (found.len() - 1) as f64).sqrt()
        } else {
            MAX_NEIGHBOUR_M
        });
        // Three parameters of the plane are free: the residuals of k points hold k - 3 degrees of freedom.
        if near.len() > 4 {
            let (_, spread) = principal(&near);
            noises.push(spread * (near.len() as f64 / (near.len() - 3) as f64).sqrt());
        }
    }

    let spacing = upper_median(&mut spacings).unwrap_or(0.0);
    let thinned: Vec<Point3<f64>> = thinned(points, ids);
    let normal = if thinned.len() >= 3 {
        principal(&thinned).0
    } else {
        Vector3::zeros()
    };

    LocalSurface {
        normal: normal.cast(),
        spacing_m: spacing.min(around.cell_m) as f32,
        noise_m: upper_median(&mut noises).unwrap_or(0.0) as f32,
        points: ids.len() as u32,
    }
}

fn thinned(points: &[Point3<f64>], ids: &[u32]) -> Vec<Point3<f64>> {
    let step = ids.len().div_ceil(400).max(1);
    ids.iter().step_by(step).map(|&i| points[i as usize]).collect()
}

/// Normal of the least-squares plane and the standard deviation along it.
fn principal(points: &[Point3<f64>]) -> (Vector3<f64>, f64) {
    let n = points.len() as f64;
    let mean = points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / n;
    let covariance: Matrix3<f64> = points
        .iter()
        .map(|p| (p.coords - mean) * (p.coords - mean).transpose() / n)
        .sum();
    let eigen = covariance.symmetric_eigen();
    let smallest = eigen.eigenvalues.imin();
    let value = eigen.eigenvalues[smallest].max(0.0).sqrt();
    (eigen.eigenvectors.column(smallest).into_owned(), value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use std::collections::BTreeMap;

    #[test]
    fn finds_spacing_noise_and_normal_of_a_noisy_plane() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let normal = Vector3::new(0.8, 0.0, 0.6);
        let (u, v) = (Vector3::new(-0.6, 0.0, 0.8), Vector3::y());
        let mut gauss = || (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>();
        let points: Vec<Point3<f64>> = (0..100 * 100)
            .map(|i| {
                let (a, b) = (f64::from(i % 100), f64::from(i / 100));
                Point3::origin() + u * (0.01 * a) + v * (0.01 * b) + normal * (0.001 * gauss())
            })
            .collect();
        let cloud = Cloud::from_world(Point3::origin(), points);
        let cells = SurfaceCells::new(&cloud, 0.25);
        let groups = cells.groups(&cloud);
        assert_eq!(groups.iter().map(|g| g.points.len()).sum::<usize>(), cloud.len());
        let group = groups.iter().find(|g| g.points.contains(&5050)).unwrap();
        let surface = &group.surface;
        assert!(
            (f64::from(surface.spacing_m) - 0.01).abs() < 0.0025,
            "{surface:?}"
        );
        assert!((f64::from(surface.noise_m) - 0.001).abs() < 0.0005, "{surface:?}");
        assert!(surface.normal.cast::<f64>().cross(&normal).norm() < 0.05);
    }

    /// Spacings of the cells of one dense and one sparse patch, by their place, when the cloud is cut into
    /// tiles of this size.
    fn limited(tile_m: f64) -> Vec<([i64; 3], f32)> {
        let grid = |step: f64, x0: f64, n: u32| {
            (0..n * n).map(move |i| Point3::new(x0 + step * f64::from(i % n), step * f64::from(i / n), 0.1))
        };
        let points: Vec<_> = grid(0.01, 0.003, 100).chain(grid(0.15, 2.203, 6)).collect();
        let mut tiles: BTreeMap<[i64; 3], Vec<Point3<f64>>> = BTreeMap::new();
        for p in points {
            tiles.entry(cell_of(&p, tile_m)).or_default().push(p);
        }
        let cut = tiles.into_iter().map(|(key, points)| {
            let origin = Point3::from(key.map(|k| (k as f64 + 0.5) * tile_m));
            SurfaceCells::new(&Cloud::from_world(origin, points), 0.25)
        });
        let mut cut: Vec<SurfaceCells> = cut.collect();
        limit_spacings(&mut cut);
        let place = |tile: &SurfaceCells, key: &[i32; 3]| {
            cell_of(
                &Point3::from([0, 1, 2].map(|a| tile.origin[a] + (f64::from(key[a]) + 0.5) * 0.25)),
                0.25,
            )
        };
        let mut all: Vec<_> = cut
            .iter()
            .flat_map(|tile| {
                tile.keys
                    .iter()
                    .zip(&tile.surfaces)
                    .map(|(key, c)| (place(tile, key), c.spacing_m))
            })
            .collect();
        all.sort_by_key(|c| c.0);
        all
    }

    #[test]
    fn what_spacing_is_usual_does_not_depend_on_the_size_of_tiles() {
        let whole = limited(4.0);
        // The sparse patch is a hundred times as sparse: it is limited by the dense one, in a tile of its own
        // too.
        assert!(whole.iter().all(|c| c.1 < 0.025), "{whole:?}");
        for size in [2.0, 8.0] {
            let cut = limited(size);
            assert_eq!(cut.len(), whole.len());
            for (a, b) in cut.iter().zip(&whole) {
                assert!(a.0 == b.0 && (a.1 - b.1).abs() < 1e-5, "{size}: {a:?} {b:?}");
            }
        }
    }
}
