//! Relief of one photo from the cloud of its epoch.

use super::visible::each_visible;
use super::{TransferError, TransferParams};
use crate::cloud::TileSource;
use crate::geometry::View;
use crate::progress::Progress;
use crate::raster::{RangeImage, ReliefMap};

/// The relief of what a photo shows, see [`ReliefMap`].
///
/// Points behind the nearest surface are left out, with the depth map and the tolerance that
/// [`super::transfer_labels`] uses. Cost: three passes over the tiles that the photo may show; memory holds
/// one of them a thread and the depth map.
///
/// # Errors
/// A tile cannot be read, a parameter cannot have its value, or the caller stopped it.
pub fn photo_relief<T: TileSource>(
    tiles: &T,
    view: &View,
    params: &TransferParams,
    progress: &dyn Progress,
) -> Result<ReliefMap, TransferError> {
    let mut range = RangeImage::new(&view.camera);
    each_visible(tiles, view, params, progress, |_, visible| {
        visible
            .iter()
            .for_each(|seen| range.add(seen.pixel, seen.depth_m));
        Ok(())
    })?;
    Ok(range.relief())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::{Cloud, MemoryTiles};
    use crate::geometry::{Camera, Rigid3};
    use crate::id::ImageId;
    use crate::progress::Silent;
    use nalgebra::Point3;

    /// A wall at 10 m with a joint of 4 cm width and 3 cm depth every 40 cm, a second wall 5 m behind it, and
    /// a board 1 m before it.
    #[test]
    fn joints_of_a_wall_lie_low_and_what_is_hidden_is_left_out() {
        let mut points = Vec::new();
        for (i, j) in (0..300).flat_map(|j| (0..400).map(move |i| (i, j))) {
            // In the middle of the pixels.
            let (x, y) = (0.01 * f64::from(i) - 1.995, 0.01 * f64::from(j) - 1.495);
            let is_joint = i % 40 < 4;
            points.push(Point3::new(x, y, if is_joint { 10.03 } else { 10.0 }));
            points.push(Point3::new(1.5 * x, 1.5 * y, 15.0));
            if (0.8..1.2).contains(&x) && y.abs() < 0.2 {
                points.push(Point3::new(x, y, 9.0));
            }
        }
        let tiles = MemoryTiles::new([Cloud::from_world(Point3::origin(), points)]);
        let view = View {
            image: ImageId(0),
            name: "photo".to_owned(),
            camera: Camera::pinhole(400, 300, 1000.0),
            cam_from_world: Rigid3::identity(),
        };
        let relief = photo_relief(&tiles, &view, &TransferParams::default(), &Silent).unwrap();
        assert_eq!((relief.width(), relief.height()), (200, 150));
        let wide = |x: f64, y: f64| {
            let pixel = [x, y].map(|v| v * 50.0);
            relief
                .get((100.0 + pixel[0]) as u32, (75.0 + pixel[1]) as u32)
                .unwrap()[1]
        };
        let metres = |v: f32| 0.04 * f64::from(v) / (1.0 - f64::from(v.abs()));
        // The middle of a joint against that of the stone beside it.
        let depth = metres(wide(-0.38, -0.5)) - metres(wide(-0.58, -0.5));
        assert!((depth + 0.03).abs() < 0.004, "{depth}");
        // The middle of the board is as flat as the wall: nothing of the wall behind it is mixed in.
        assert!(wide(1.0, 0.0) > -0.1, "{}", wide(1.0, 0.0));
        assert!(
            wide(0.7, 0.0) < -0.5,
            "the wall beside the board: {}",
            wide(0.7, 0.0)
        );
    }
}
