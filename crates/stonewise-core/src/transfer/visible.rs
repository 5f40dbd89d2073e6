//! The points of a cloud that one photo sees.

use super::depth::splat_all;
use super::frustum::Cone;
use super::{TransferError, TransferParams};
use crate::cloud::{Cloud, TileSource};
use crate::geometry::{Bounds, View};
use crate::params::Params;
use crate::progress::{Progress, Silent};

/// A point that a photo sees.
#[derive(Clone, Copy, Debug)]
pub(super) struct VisiblePoint {
    /// Its place in its tile.
    pub point: u32,
    /// Where the photo shows it.
    pub pixel: [f64; 2],
    /// Its depth along the view axis, metres.
    pub depth_m: f64,
}

/// Calls `visit` with each tile that a photo may show and the points of it that it sees, tile by tile.
///
/// Points behind the nearest surface are left out, with the depth map and the tolerance that
/// [`super::transfer_labels`] uses. Cost: three passes over these tiles; memory holds one of them a thread
/// and the depth map.
///
/// # Errors
/// A tile cannot be read, a parameter cannot have its value, the caller stopped it, or `visit` failed.
pub(super) fn each_visible<T: TileSource>(
    tiles: &T,
    view: &View,
    params: &TransferParams,
    progress: &dyn Progress,
    mut visit: impl FnMut(usize, &[VisiblePoint]) -> Result<(), TransferError>,
) -> Result<(), TransferError> {
    params.check()?;
    let cone = Cone::of(view);
    let shown = (0..tiles.tile_count()).filter(|&tile| cone.touches(&tiles.bounds(tile)));
    let shown = Shown {
        tiles,
        which: shown.collect(),
    };
    progress.check()?;
    let (maps, surfaces) = splat_all(&shown, &[view], params, &Silent)?;
    let centre = view.centre();
    let mut visible = Vec::new();

    for (tile, surface) in surfaces.iter().enumerate() {
        progress.check()?;
        let cloud = shown.load(tile).map_err(|e| TransferError::tile(tile, e))?;
        visible.clear();
        for group in surface.groups(&cloud) {
            for &i in &group.points {
                let world = cloud.world(i as usize);
                let Some(seen) = view.project(&world).filter(|seen| view.is_inside(seen.pixel)) else {
                    continue;
                };
                let cosine = group.surface.cosine(&(world - centre).normalize());
                let tolerance = group.surface.tolerance_m(cosine, params);
                let nearest = maps.first().and_then(|map| map.at(seen.pixel));
                if nearest.is_some_and(|nearest| seen.depth_m <= f64::from(nearest) + tolerance) {
                    visible.push(VisiblePoint {
                        point: i,
                        pixel: seen.pixel,
                        depth_m: seen.depth_m,
                    });
                }
            }
        }
        visit(shown.which[tile], &visible)?;
    }

    Ok(())
}

/// The tiles that a photo may show.
struct Shown<'a, T> {
    tiles: &'a T,
    which: Vec<usize>,
}

impl<T: TileSource> TileSource for Shown<'_, T> {
    type Error = T::Error;

    fn tile_count(&self) -> usize {
        self.which.len()
    }

    fn bounds(&self, tile: usize) -> Bounds {
        self.tiles.bounds(self.which[tile])
    }

    fn load(&self, tile: usize) -> Result<Cloud, Self::Error> {
        self.tiles.load(self.which[tile])
    }
}
