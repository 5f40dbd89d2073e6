//! Depth maps of photos by splatting.

use super::depth_bounds::DepthBounds;
use super::frustum::Cone;
use super::photo_frame::{CHUNK, PhotoFrame, Shown, chunk_of};
use super::surface_cells::{SurfaceCells, SurfaceGroup, limit_spacings};
use super::{TransferError, TransferParams};
use crate::cloud::{Cloud, TileSource};
use crate::geometry::{View, floor};
use crate::progress::Progress;
use crate::raster::DepthMap;
use rayon::prelude::*;
use std::array::from_fn;

/// Splats are never wider than this many map pixels to each side: keeps a lone near point from covering a
/// photo.
const MAX_SPLAT_PX: i64 = 24;
/// Splats are drawn in this many interleaved rounds: a splat that overlaps the previous one has to wait until
/// the processor has stored it.
const LEAP: usize = 16;
/// Pixels of a row that are covered at once. Those beyond the splat get infinity, which changes nothing.
const LANES: usize = 8;

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
        for x in (x0..=x1).step_by(LANES) {
            let lanes: [f32; LANES] = from_fn(|i| if x + i as i64 <= x1 { depth } else { f32::INFINITY });
            for y in y0..=y1 {
                let pixels = &mut self.map.data_mut()[(y * width + x) as usize..];
                // A constant number of pixels compiles to code without a loop.
                match pixels.first_chunk_mut::<LANES>() {
                    Some(pixels) => cover(pixels, &lanes),
                    None => cover(pixels, &lanes),
                }
            }
        }
    }

    /// Bounds of the depths around each pixel, as far as [`Self::around`] reads with this radius.
    pub(super) fn bounds(&self, radius_px: f64) -> DepthBounds {
        DepthBounds::new(&self.map, self.radius(radius_px).ceil() as usize)
    }

    /// The bounds around a pixel of the photo.
    #[inline]
    pub(super) fn bounds_at(&self, bounds: &DepthBounds, pixel: [f64; 2]) -> Option<[f32; 2]> {
        bounds.at(pixel.map(|p| p * self.scale))
    }

    /// Map pixels of a radius around a pixel of the photo: one at least.
    fn radius(&self, radius_px: f64) -> f64 {
        (radius_px * self.scale).max(1.0)
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
        let radius = self.radius(radius_px);
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

/// Keeps the nearer depth of each pixel and lane.
#[inline]
fn cover(pixels: &mut [f32], lanes: &[f32; LANES]) {
    for (pixel, &depth) in pixels.iter_mut().zip(lanes) {
        *pixel = if depth < *pixel { depth } else { *pixel };
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
    let load = |tile| tiles.load(tile).map_err(|e| TransferError::tile(tile, e));

    let all = 0..tiles.tile_count();
    progress.each_prepared("surface", all.clone(), load, |_, cloud| {
        surfaces.push(SurfaceCells::new(&cloud, params.cell_m));
        Ok(())
    })?;

    limit_spacings(&mut surfaces);
    progress.each_prepared("depth maps", all, load, |tile, cloud| {
        let bounds = tiles.bounds(tile);
        let groups = surfaces[tile].groups(&cloud);
        maps.par_iter_mut()
            .zip(views.par_iter().zip(&cones))
            .filter(|(_, (_, cone))| cone.touches(&bounds))
            .for_each(|(map, (view, cone))| {
                let groups = groups.iter().filter(|g| cone.touches(&g.bounds));
                splat_tile(map, view, &cloud, groups, params);
            });
        Ok(())
    })?;

    Ok((maps, surfaces))
}

fn splat_tile<'a>(
    map: &mut SplatDepth,
    view: &View,
    cloud: &Cloud,
    groups: impl Iterator<Item = &'a SurfaceGroup>,
    params: &TransferParams,
) {
    let frame = PhotoFrame::of(view);
    let mut shown = Shown::none();
    let mut order: Vec<u32> = Vec::new();
    for group in groups {
        let width = params.splat_spacings * f64::from(group.surface.spacing_m) * frame.focal_px;
        order.clear();
        order.extend((0..LEAP).flat_map(|first| group.points.iter().skip(first).step_by(LEAP)));
        for points in order.chunks(CHUNK) {
            frame.show(&chunk_of(cloud, points.iter().copied()), &mut shown);
            for k in 0..points.len() {
                if let Some(pixel) = shown.pixel(k) {
                    let depth = shown.points[2][k];
                    map.splat(pixel, depth, width / depth);
                }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Camera, Rigid3};
    use crate::id::ImageId;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn each_pixel_holds_the_least_depth_of_the_squares_that_cover_it() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let view = View {
            image: ImageId(0),
            name: String::new(),
            camera: Camera::pinhole(61, 37, 50.0),
            cam_from_world: Rigid3::identity(),
        };
        for scale in [1.0, 0.6] {
            let mut map = SplatDepth::new(&view, scale);
            let splats: Vec<([f64; 2], f64, f64)> = (0..40)
                .map(|i| {
                    // One in eight is wide; some lie over the borders.
                    let radius = if i % 8 == 0 { 40.0 } else { 4.0 };
                    let mut draw = |low: f64, high: f64| rng.random_range(low..high);
                    (
                        [draw(-3.0, 64.0), draw(-3.0, 40.0)],
                        draw(2.0, 9.0),
                        draw(0.0, radius),
                    )
                })
                .collect();
            for &(pixel, depth_m, radius_px) in &splats {
                map.splat(pixel, depth_m, radius_px);
            }
            for (x, y) in (0..map.map.width()).flat_map(|x| (0..map.map.height()).map(move |y| (x, y))) {
                let covers = |([px, py], _, radius): &([f64; 2], f64, f64)| {
                    let radius = (radius * scale).min(24.0);
                    let holds = |centre: f64, at: u32| {
                        let at = f64::from(at);
                        (centre - radius).floor() <= at && at <= (centre + radius).floor()
                    };
                    holds(px * scale, x) && holds(py * scale, y)
                };
                let depths = splats.iter().filter(|s| covers(s)).map(|s| s.1 as f32);
                let expected = depths.fold(f32::INFINITY, f32::min);
                assert_eq!(map.map.get(x, y), Some(&expected), "{scale}: {x} {y}");
            }
        }
    }
}
