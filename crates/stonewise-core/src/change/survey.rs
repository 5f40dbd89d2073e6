//! Comparing whole surveys, one tile of the first (or compared) cloud at a time.

use super::error::CompareError;
use crate::change::{
    ChangeField, CorePoint, M3c2Params, MeshIndex, OutwardReference, c2c, c2m, m3c2, thin_to_voxels,
};
use crate::cloud::{GridIndex, TileSource};
use crate::geometry::Bounds;
use crate::params::Params;
use crate::progress::Progress;
use nalgebra::Point3;

/// M3C2 of two surveys at core points thinned from the first one, in the order of its tiles.
///
/// Normals are fitted to the first survey. A core point belongs to the tile that holds it, and every tile is
/// read with as much surroundings as normals and cylinders need, so results do not depend on the tiles.
/// Memory: one tile of either survey with its surroundings, and the results. Core points without a normal are
/// left out.
///
/// # Errors
/// A tile cannot be read, the parameters are not usable, or the caller stopped the work.
pub fn m3c2_survey<A: TileSource, B: TileSource>(
    first: &A,
    second: &B,
    outward: &OutwardReference<'_>,
    params: &M3c2Params,
    progress: &dyn Progress,
) -> Result<ChangeField, CompareError> {
    params.check()?;
    let cylinder_reach = params.cylinder_radius_m.hypot(params.max_depth_m);
    // The far corner of a voxel that straddles the border is at most its diagonal away.
    let halo = params
        .normal_radius_m
        .max(cylinder_reach)
        .max(params.core_spacing_m * 3f64.sqrt());
    let mut field = ChangeField::default();
    progress.each(
        "M3C2",
        0..first.tile_count(),
        |tile| -> Result<(), CompareError> {
            let mut points = tile_points(first, tile)?;
            let own = points.len();
            points.extend(points_around(first, &first.bounds(tile).grown(halo), Some(tile))?);
            let positions: Vec<Point3<f64>> = thin_to_voxels(&points, params.core_spacing_m)
                .into_iter()
                .filter(|&i| i < own)
                .map(|i| points[i])
                .collect();
            let first_index = GridIndex::new(&points, params.cylinder_radius_m);
            drop(points);
            let mut core = CorePoint::fitted(&first_index, &positions, params.normal_radius_m, outward);
            core.retain(|point| point.normal.is_some());
            if let Some(bounds) = Bounds::of(core.iter().map(|point| point.position)) {
                let near = points_around(second, &bounds.grown(cylinder_reach), None)?;
                let second_index = GridIndex::new(&near, params.cylinder_radius_m);
                field
                    .points
                    .extend(m3c2(&first_index, &second_index, &core, params).points);
            }
            Ok(())
        },
    )?;

    Ok(field)
}

/// Points of a survey, tile by tile, with their distances from something.
#[derive(Clone, Debug, Default)]
pub struct PointDistances {
    /// World frame, metres.
    pub points: Vec<Point3<f64>>,
    /// Distance of each point, metres; `None`: farther than was looked for.
    pub distances_m: Vec<Option<f64>>,
}

/// Cloud to cloud distances of every point of `compared` to `reference`.
///
/// Memory: one tile of `compared`, of `reference` what lies within `max_m` of it, and the results.
///
/// # Errors
/// A tile cannot be read, or the caller stopped the work.
pub fn c2c_survey<A: TileSource, B: TileSource>(
    reference: &A,
    compared: &B,
    max_m: f64,
    progress: &dyn Progress,
) -> Result<PointDistances, CompareError> {
    distances("C2C", compared, progress, |points, bounds| {
        let near = points_around(reference, &bounds.grown(max_m), None)?;
        Ok(c2c(&GridIndex::for_nearest(&near), points, max_m))
    })
}

/// Signed distances of every point of `compared` to a mesh.
///
/// # Errors
/// As [`c2c_survey`].
pub fn c2m_survey<B: TileSource>(
    mesh: &MeshIndex,
    compared: &B,
    max_m: f64,
    progress: &dyn Progress,
) -> Result<PointDistances, CompareError> {
    distances("C2M", compared, progress, |points, _| {
        Ok(c2m(mesh, points, max_m))
    })
}

fn distances<S: TileSource>(
    what: &str,
    compared: &S,
    progress: &dyn Progress,
    measure: impl Fn(&[Point3<f64>], &Bounds) -> Result<Vec<Option<f64>>, CompareError>,
) -> Result<PointDistances, CompareError> {
    let mut found = PointDistances::default();
    progress.each(
        what,
        0..compared.tile_count(),
        |tile| -> Result<(), CompareError> {
            let points = tile_points(compared, tile)?;
            found
                .distances_m
                .extend(measure(&points, &compared.bounds(tile))?);
            found.points.extend(points);
            Ok(())
        },
    )?;
    Ok(found)
}

fn tile_points<S: TileSource>(source: &S, tile: usize) -> Result<Vec<Point3<f64>>, CompareError> {
    let cloud = source.load(tile).map_err(|e| CompareError::Read(Box::new(e)))?;
    Ok((0..cloud.len()).map(|i| cloud.world(i)).collect())
}

/// All points inside the region but those of the tile `except`; positions are the tiles' own, not rounded
/// again.
fn points_around<S: TileSource>(
    source: &S,
    region: &Bounds,
    except: Option<usize>,
) -> Result<Vec<Point3<f64>>, CompareError> {
    let mut found = Vec::new();
    for tile in (0..source.tile_count()).filter(|&t| Some(t) != except && source.bounds(t).intersects(region))
    {
        let points = tile_points(source, tile)?.into_iter();
        found.extend(points.filter(|p| region.contains(p)));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::change::ChangePoint;
    use crate::cloud::{Cloud, MemoryTiles};
    use crate::progress::Silent;

    /// A wavy wall that looks along x, 2 x 2 m, one point every 2 cm, moved out by `shift_m`.
    fn wall(shift_m: f64) -> Vec<Point3<f64>> {
        (0..10_000)
            .map(|i| (0.02 * f64::from(i % 100), 0.02 * f64::from(i / 100)))
            .map(|(y, z)| Point3::new(0.02 * (4.0 * y).sin() * (3.0 * z).cos() - 0.2 * z + shift_m, y, z))
            .collect()
    }

    fn tiled(points: &[Point3<f64>], size_m: f64) -> MemoryTiles {
        let mut tiles = std::collections::BTreeMap::<_, Vec<_>>::new();
        for p in points {
            let key = [p.x, p.y, p.z].map(|c| (c / size_m).floor() as i64);
            tiles.entry(key).or_default().push(*p);
        }
        MemoryTiles::new(
            tiles
                .into_values()
                .map(|t| Cloud::from_world(Point3::origin(), t)),
        )
    }

    fn run(first: &MemoryTiles, second: &MemoryTiles) -> Vec<ChangePoint> {
        let params = M3c2Params {
            core_spacing_m: 0.11,
            normal_radius_m: 0.1,
            ..M3c2Params::default()
        };
        let outward = OutwardReference::Towards(&[Point3::new(8.0, 1.0, 1.0)]);
        let field = m3c2_survey(first, second, &outward, &params, &Silent).unwrap();
        let mut all = field.points;
        all.sort_by(|a, b| {
            let key = |c: &ChangePoint| [c.position.z, c.position.y, c.position.x];
            key(a).partial_cmp(&key(b)).unwrap()
        });
        all
    }

    #[test]
    fn results_do_not_depend_on_the_tiles() {
        let (first, second) = (wall(0.0), wall(0.01));
        let whole = run(&tiled(&first, 100.0), &tiled(&second, 100.0));
        let parts = run(&tiled(&first, 0.37), &tiled(&second, 0.53));
        assert!(whole.len() > 300);
        assert_eq!(whole.len(), parts.len());
        for (a, b) in whole.iter().zip(&parts) {
            assert_eq!((a.position, a.counts), (b.position, b.counts));
            assert!((a.distance_m.unwrap() - b.distance_m.unwrap()).abs() < 1e-9);
            assert!(a.normal.x > 0.8);
            // Moved along x: the wall's normal sees its share of it.
            assert!((a.distance_m.unwrap() - 0.01 * a.normal.x).abs() < 1e-3);
        }
    }

    #[test]
    fn cloud_to_cloud_goes_tile_by_tile_in_point_order() {
        let (first, second) = (tiled(&wall(0.0), 0.7), tiled(&wall(0.03), 0.5));
        let found = c2c_survey(&first, &second, 0.1, &Silent).unwrap();
        let clouds = (0..second.tile_count()).map(|tile| second.load(tile).unwrap());
        let points: Vec<Point3<f64>> = clouds
            .flat_map(|cloud| (0..cloud.len()).map(|i| cloud.world(i)).collect::<Vec<_>>())
            .collect();
        assert_eq!((points.len(), &points), (10_000, &found.points));
        assert_eq!(found.distances_m.len(), points.len());
        let is_near = |d: &Option<f64>| d.is_some_and(|d| d > 0.015 && d < 0.0301);
        assert!(found.distances_m.iter().all(is_near));
    }
}
