//! Comparing whole surveys, one tile of the first (or compared) cloud at a time.

use crate::change::{
    ChangeField, M3c2Params, MeshIndex, OutwardReference, c2c, c2m, estimate_normals, m3c2, thin_to_voxels,
};
use crate::cloud::{GridIndex, TileSource};
use crate::geometry::Bounds;
use crate::params::{ParamError, Params};
use crate::progress::{Interrupted, Progress};
use nalgebra::{Point3, Vector3};
use std::ops::Range;

/// What the receiver of results may fail with.
pub type SinkError = Box<dyn std::error::Error + Send + Sync>;

/// Why a survey could not be compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SurveyError {
    /// A tile could not be read.
    #[error("a tile of the cloud could not be read")]
    Read(#[source] SinkError),
    /// The receiver of the results failed.
    #[error("results could not be kept")]
    Sink(#[source] SinkError),
    /// Stopped by the caller.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
    /// Parameters that cannot work.
    #[error(transparent)]
    Params(#[from] ParamError),
}

/// M3C2 of two surveys at core points thinned from the first one; hands each tile's results to `sink`, in
/// order.
///
/// Normals are fitted to the first survey. A core point belongs to the tile that holds it, and every tile is
/// read with as much surroundings as normals and cylinders need, so results do not depend on the tiles.
/// Memory: one tile of either survey with its surroundings. Core points without a normal are left out.
///
/// # Errors
/// A tile cannot be read, the parameters are not usable, `sink` fails, or the caller stopped the work.
pub fn m3c2_survey<A: TileSource, B: TileSource>(
    first: &A,
    second: &B,
    outward: &OutwardReference<'_>,
    params: &M3c2Params,
    progress: &dyn Progress,
    sink: impl FnMut(usize, ChangeField) -> Result<(), SinkError>,
) -> Result<(), SurveyError>
where
    A::Error: Sync,
    B::Error: Sync,
{
    m3c2_tiles(
        first,
        second,
        outward,
        params,
        0..first.tile_count(),
        progress,
        sink,
    )
}

/// The same at the core points of some tiles of the first survey.
///
/// # Errors
/// As [`m3c2_survey`].
pub fn m3c2_tiles<A: TileSource, B: TileSource>(
    first: &A,
    second: &B,
    outward: &OutwardReference<'_>,
    params: &M3c2Params,
    tiles: Range<usize>,
    progress: &dyn Progress,
    mut sink: impl FnMut(usize, ChangeField) -> Result<(), SinkError>,
) -> Result<(), SurveyError>
where
    A::Error: Sync,
    B::Error: Sync,
{
    params.check()?;
    let cylinder_reach = params.cylinder_radius_m.hypot(params.max_depth_m);
    progress.begin("M3C2", tiles.len() as u64);
    for tile in tiles {
        progress.check()?;
        // The far corner of a voxel that straddles the border is at most its diagonal away.
        let halo = params
            .normal_radius_m
            .max(cylinder_reach)
            .max(params.core_spacing_m * 3f64.sqrt());
        let mut points = tile_points(first, tile)?;
        let own = points.len();
        points.extend(points_around(first, &first.bounds(tile).grown(halo), Some(tile))?);
        let core: Vec<Point3<f64>> = thin_to_voxels(&points, params.core_spacing_m)
            .into_iter()
            .filter(|&i| i < own)
            .map(|i| points[i])
            .collect();
        let first_index = GridIndex::new(&points, params.cylinder_radius_m);
        drop(points);
        let normals = estimate_normals(&first_index, &core, params.normal_radius_m, outward);
        let (core, normals): (Vec<Point3<f64>>, Vec<Vector3<f64>>) = core
            .into_iter()
            .zip(normals)
            .filter_map(|(p, n)| Some((p, n?)))
            .unzip();
        let field = match Bounds::of(core.iter().copied()) {
            None => ChangeField::default(),
            Some(bounds) => {
                let near = points_around(second, &bounds.grown(cylinder_reach), None)?;
                let second_index = GridIndex::new(&near, params.cylinder_radius_m);
                m3c2(&first_index, &second_index, &core, &normals, params)
            }
        };
        sink(tile, field).map_err(SurveyError::Sink)?;
        progress.advance(1);
    }
    Ok(())
}

/// Cloud to cloud distances of every point of `compared` to `reference`; `sink(tile, points, distances)` gets
/// them in the order of the tile's points.
///
/// Memory: one tile of `compared`, and of `reference` what lies within `max_m` of it.
///
/// # Errors
/// A tile cannot be read, `sink` fails, or the caller stopped the work.
pub fn c2c_survey<A: TileSource, B: TileSource>(
    reference: &A,
    compared: &B,
    max_m: f64,
    progress: &dyn Progress,
    mut sink: impl FnMut(usize, &[Point3<f64>], Vec<Option<f64>>) -> Result<(), SinkError>,
) -> Result<(), SurveyError>
where
    A::Error: Sync,
    B::Error: Sync,
{
    each_tile("C2C", compared, progress, |tile, points, bounds| {
        let near = points_around(reference, &bounds.grown(max_m), None)?;
        let index = GridIndex::for_nearest(&near);
        sink(tile, points, c2c(&index, points, max_m)).map_err(SurveyError::Sink)
    })
}

/// Signed distances of every point of `compared` to a mesh; `sink(tile, points, distances)` gets them in the
/// order of the tile's points.
///
/// # Errors
/// As [`c2c_survey`].
pub fn c2m_survey<B: TileSource>(
    mesh: &MeshIndex,
    compared: &B,
    max_m: f64,
    progress: &dyn Progress,
    mut sink: impl FnMut(usize, &[Point3<f64>], Vec<Option<f64>>) -> Result<(), SinkError>,
) -> Result<(), SurveyError>
where
    B::Error: Sync,
{
    each_tile("C2M", compared, progress, |tile, points, _| {
        sink(tile, points, c2m(mesh, points, max_m)).map_err(SurveyError::Sink)
    })
}

fn each_tile<S: TileSource>(
    what: &str,
    source: &S,
    progress: &dyn Progress,
    mut work: impl FnMut(usize, &[Point3<f64>], Bounds) -> Result<(), SurveyError>,
) -> Result<(), SurveyError>
where
    S::Error: Sync,
{
    progress.begin(what, source.tile_count() as u64);
    for tile in 0..source.tile_count() {
        progress.check()?;
        work(tile, &tile_points(source, tile)?, source.bounds(tile))?;
        progress.advance(1);
    }
    Ok(())
}

fn tile_points<S: TileSource>(source: &S, tile: usize) -> Result<Vec<Point3<f64>>, SurveyError>
where
    S::Error: Sync,
{
    let cloud = source.load(tile).map_err(|e| SurveyError::Read(Box::new(e)))?;
    Ok((0..cloud.len()).map(|i| cloud.world(i)).collect())
}

/// All points inside the region but those of the tile `except`; positions are the tiles' own, not rounded
/// again.
fn points_around<S: TileSource>(
    source: &S,
    region: &Bounds,
    except: Option<usize>,
) -> Result<Vec<Point3<f64>>, SurveyError>
where
    S::Error: Sync,
{
    let mut found = Vec::new();
    for tile in (0..source.tile_count()).filter(|&t| Some(t) != except && source.bounds(t).intersects(region))
    {
        found.extend(
            tile_points(source, tile)?
                .into_iter()
                .filter(|p| region.contains(p)),
        );
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
        let mut all = Vec::new();
        let outward = OutwardReference::Towards(&[Point3::new(8.0, 1.0, 1.0)]);
        m3c2_survey(first, second, &outward, &params, &Silent, |_, field| {
            all.extend(field.points);
            Ok(())
        })
        .unwrap();
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
        let mut seen = 0;
        c2c_survey(&first, &second, 0.1, &Silent, |tile, points, distances| {
            let cloud = second.load(tile).unwrap();
            assert_eq!((points.len(), distances.len()), (cloud.len(), cloud.len()));
            assert_eq!(points[0], cloud.world(0));
            assert!(
                distances
                    .iter()
                    .all(|d| d.is_some_and(|d| d > 0.015 && d < 0.0301))
            );
            seen += points.len();
            Ok(())
        })
        .unwrap();
        assert_eq!(seen, 10_000);
    }
}
