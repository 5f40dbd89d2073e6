//! Shaded relief: a surface of one grey under light from above and from one side.

use crate::geometry::Camera;
use crate::raster::{DepthMap, RgbImage, SumTable};

/// The side from which light comes. A joint that runs towards the light shows little.
#[derive(Clone, Copy)]
pub(super) enum Side {
    Left,
    Right,
}

/// Grey picture of the surface that a depth map holds; black where it is empty.
///
/// `half_window`: half the side of the window of a slope, pixels, which smooths the noise of single points.
///
/// Lambert's law for a distant light from the upper left, or from the upper right. Darker joints, as under the light of
/// the sky, let the detector find fewer stones.
pub(super) fn relief_shade(depth: &DepthMap, camera: &Camera, side: Side, half_window: usize) -> RgbImage {
    let (width, height) = (depth.width() as usize, depth.height() as usize);
    let mean = mean_depth(depth);
    let table = SumTable::new([width, height], |x, y| {
        let d = f64::from(depth.data()[y * width + x]);
        let q = d - mean;
        let (x, y) = (x as f64 - 0.5 * width as f64, y as f64 - 0.5 * height as f64);
        d.is_finite()
            .then_some([1.0, q, x, y, x * x, x * y, y * y, x * q, y * q])
    });
    let across = match side {
        Side::Left => -0.5,
        Side::Right => 0.5,
    };
    let light = nalgebra::Vector3::new(across, -0.6, -0.62).normalize();

    let mut image = RgbImage::filled(depth.width(), depth.height(), [0; 3]);
    for (at, pixel) in image.data_mut().iter_mut().enumerate() {
        let place = [at % width, at / width];
        let [n, q, x, y, xx, xy, yy, xq, yq] = table.window(place, half_window);
        if n < 6.0 {
            continue;
        }
        let (mx, my, mq) = (x / n, y / n, q / n);
        let (cxx, cxy, cyy) = (xx / n - mx * mx, xy / n - mx * my, yy / n - my * my);
        let (cxq, cyq) = (xq / n - mx * mq, yq / n - my * mq);
        let determinant = cxx * cyy - cxy * cxy;
        if determinant < 0.1 {
            continue;
        }
        let gsd_m = (mean + mq) / camera.focal_px[0];
        let slope_x = (cxq * cyy - cyq * cxy) / determinant / gsd_m;
        let slope_y = (cyq * cxx - cxq * cxy) / determinant / gsd_m;
        let normal = nalgebra::Vector3::new(slope_x, slope_y, -1.0).normalize();
        let light = normal.dot(&light).max(0.0);
        let grey = 255.0 * (0.25 + 0.75 * light);
        *pixel = [grey.clamp(1.0, 255.0) as u8; 3];
    }

    image
}

fn mean_depth(depth: &DepthMap) -> f64 {
    let known = depth.data().iter().filter(|d| d.is_finite());
    let (count, sum) = known.fold((0.0, 0.0), |(n, sum), d| (n + 1.0, sum + f64::from(*d)));
    if count > 0.0 { sum / count } else { 0.0 }
}
