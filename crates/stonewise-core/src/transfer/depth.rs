//! Depth maps of photos by splatting.

use super::bytes::{Reader, Writer};
use super::frustum::Cone;
use super::surface_cells::{SurfaceCells, SurfaceGroup, limit_spacings};
use super::{TransferError, TransferParams};
use crate::cloud::{Cloud, TileSource};
use crate::geometry::{View, floor};
use crate::progress::Progress;
use crate::raster::DepthMap;
use rayon::prelude::*;

/// Splats are never wider than this many map pixels to each side: keeps a lone near point from covering a
/// photo.
const MAX_SPLAT_PX: i64 = 24;

/// The nearest surface of each pixel of a photo, possibly at reduced resolution.
pub(super) struct SplatDepth {
    map: DepthMap,
    /// Map pixels per photo pixel, at most 1.
    scale: f64,
}

impl SplatDepth {
    pub(super) fn new(view: &View, scale: f64) -> Self {
        let side = |pixels: u32| (f64::from(pixels) * scale).ceil() as u32;
        Self {
            map: DepthMap::filled(side(view.camera.width), side(view.camera.height), f32::INFINITY),
            scale,
        }
    }

    /// A map that nobody looks at.
    pub(super) fn none() -> Self {
        Self {
            map: DepthMap::filled(0, 0, f32::INFINITY),
            scale: 1.0,
        }
    }

    /// As bytes, for [`Self::decode`].
    pub(super) fn encode(&self) -> Vec<u8> {
        let mut out = Writer::default();
        out.f64(self.scale);
        out.u32(self.map.width());
        out.u32(self.map.height());
        self.map.data().iter().for_each(|&depth| out.f32(depth));
        out.0
    }

    pub(super) fn decode(bytes: &[u8]) -> Result<Self, TransferError> {
        let mut bytes = Reader(bytes);
        let scale = bytes.f64()?;
        let (width, height) = (bytes.u32()?, bytes.u32()?);
        let depths = bytes.0.chunks_exact(4);
        let depths = depths.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        let map = DepthMap::from_vec(width, height, depths.collect());
        Ok(Self {
            map: map.ok_or(TransferError::Damaged)?,
            scale,
        })
    }

    /// Lets a point cover the square of half width `radius_px` (photo pixels) around its pixel.
    pub(super) fn splat(&mut self, pixel: [f64; 2], depth_m: f64, radius_px: f64) {
        let radius = (radius_px * self.scale).min(MAX_SPLAT_PX as f64);
        let depth = depth_m as f32;
        let width = i64::from(self.map.width());
        let height = i64::from(self.map.height());
        let range = |centre: f64, size: i64| {
            let low = floor(centre - radius).max(0);
            let high = floor(centre + radius).min(size - 1);
            (low, high)
        };
        let (x0, x1) = range(pixel[0] * self.scale, width);
        let (y0, y1) = range(pixel[1] * self.scale, height);
        if x0 > x1 {
            return;
        }
        for y in y0..=y1 {
            let row = (y * width) as usize;
            for value in &mut self.map.data_mut()[row + x0 as usize..=row + x1 as usize] {
                *value = value.min(depth);
            }
        }
    }

    /// Depth of the nearest surface at a pixel.
    #[inline]
    pub(super) fn at(&self, pixel: [f64; 2]) -> Option<f32> {
        self.map.at(pixel.map(|p| p * self.scale)).copied()
    }

    /// The least and greatest depth at a pixel and within `radius_px` (photo pixels); `here`: that at the
    /// pixel.
    #[inline]
    pub(super) fn around(&self, pixel: [f64; 2], here: f32, radius_px: f64) -> [f32; 2] {
        let radius = (radius_px * self.scale).max(1.0);
        let around = |pixel: f64, side: u32| {
            let centre = pixel * self.scale;
            [-radius, 0.0, radius].map(|d| {
                let place = centre + d;
                (place >= 0.0 && (place as u32) < side).then_some(place as usize)
            })
        };
        let columns = around(pixel[0], self.map.width());
        let rows = around(pixel[1], self.map.height());
        let (mut least, mut greatest) = (here, if here.is_finite() { here } else { 0.0 });
        for row in rows.into_iter().flatten() {
            let row = &self.map.data()[row * self.map.width() as usize..];
            for column in columns.into_iter().flatten() {
                let depth = row[column];
                if depth.is_finite() {
                    least = least.min(depth);
                    greatest = greatest.max(depth);
                }
            }
        }
        [least, greatest]
    }
}

/// Depth maps of the photos and the local surface of all tiles, from two passes over the cloud: what spacing
/// is usual is known after the first.
///
/// Cost: one projection a point and photo whose cone touches the surface cell, and one write a pixel of each
/// splat.
pub(super) fn splat_all<T: TileSource>(
    tiles: &T,
    views: &[&View],
    params: &TransferParams,
    progress: &dyn Progress,
) -> Result<(Vec<SplatDepth>, Vec<SurfaceCells>), TransferError> {
    let scale = map_scale(views, params.depth_memory_mib);
    let mut maps: Vec<SplatDepth> = views.iter().map(|v| SplatDepth::new(v, scale)).collect();
    let cones: Vec<Cone> = views.iter().map(|v| Cone::of(v)).collect();
    let mut surfaces = Vec::with_capacity(tiles.tile_count());
    progress.begin("depth maps", 2 * tiles.tile_count() as u64);
    for tile in 0..tiles.tile_count() {
        progress.check()?;
        let cloud = tiles.load(tile).map_err(|e| TransferError::tile(tile, e))?;
        surfaces.push(SurfaceCells::new(&cloud, params.cell_m));
        progress.advance(1);
    }
    limit_spacings(&mut surfaces);
    for (tile, surface) in surfaces.iter().enumerate() {
        progress.check()?;
        let cloud = tiles.load(tile).map_err(|e| TransferError::tile(tile, e))?;
        let bounds = tiles.bounds(tile);
        let groups = surface.groups(&cloud);
        maps.par_iter_mut()
            .zip(views.par_iter().zip(&cones))
            .filter(|(_, (_, cone))| cone.touches(&bounds))
            .for_each(|(map, (view, cone))| {
                let groups = groups.iter().filter(|g| cone.touches(&g.bounds));
                splat_tile(map, view, &cloud, groups, params);
            });
        progress.advance(1);
    }
    Ok((maps, surfaces))
}

fn splat_tile<'a>(
    map: &mut SplatDepth,
    view: &View,
    cloud: &Cloud,
    groups: impl Iterator<Item = &'a SurfaceGroup>,
    params: &TransferParams,
) {
    for group in groups {
        let spacing = f64::from(group.surface.spacing_m);
        for &i in &group.points {
            let Some(seen) = view.project(&cloud.world(i as usize)) else {
                continue;
            };
            if view.is_inside(seen.pixel) {
                let radius = params.splat_spacings * spacing / view.gsd_m(seen.depth_m);
                map.splat(seen.pixel, seen.depth_m, radius);
            }
        }
    }
}

/// The resolution at which the maps of all photos fit in the memory allowed to them.
fn map_scale(views: &[&View], memory_mib: u32) -> f64 {
    let pixels: f64 = views
        .iter()
        .map(|v| f64::from(v.camera.width) * f64::from(v.camera.height))
        .sum();
    let allowed = f64::from(memory_mib.max(1)) * 1024.0 * 1024.0 / 4.0;
    (allowed / pixels.max(1.0)).sqrt().min(1.0)
}
