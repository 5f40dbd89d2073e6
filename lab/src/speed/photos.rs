//! Photos of the wall with a mask for each stone of a regular bond.

use super::survey::Survey;
use nalgebra::{Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::convert::Infallible;
use stonewise_core::cloud::{Cloud, MemoryTiles};
use stonewise_core::geometry::{Camera, Rigid3, View, cell_of};
use stonewise_core::id::ImageId;
use stonewise_core::progress::Silent;
use stonewise_core::raster::LabelImage;
use stonewise_core::transfer::{MemoryLabels, TransferParams, transfer_labels};

/// Pixels of a photo of 12 MP, and its focal length in pixels.
const PHOTO_PX: [u32; 2] = [4000, 3000];
const FOCAL_PX: f64 = 3000.0;
/// From the photos to the wall, metres: each shows 9.3 x 7 m.
const DISTANCE_M: f64 = 7.0;
/// Photos along and up the wall.
const PHOTOS: [u32; 2] = [4, 2];
/// Width and height of a stone with its joint, and width of the joint, metres.
const STONE_M: [f64; 2] = [0.4, 0.25];
const JOINT_M: f64 = 0.02;
/// Edge of the tiles, metres: that of the project file's default.
const TILE_M: f64 = 8.0;

/// Everything that the transfer of labels needs.
pub struct Photos {
    tiles: MemoryTiles,
    points: usize,
    views: Vec<View>,
    masks: Vec<LabelImage>,
}

impl Photos {
    pub fn new(survey: &Survey) -> Self {
        let cloud = &survey.clouds[0];
        let mut tiles: BTreeMap<[i64; 3], Vec<Point3<f64>>> = BTreeMap::new();
        for p in cloud {
            tiles.entry(cell_of(p, TILE_M)).or_default().push(*p);
        }
        let tiles = MemoryTiles::new(tiles.into_iter().map(|(key, points)| {
            Cloud::from_world(Point3::from(key.map(|k| (k as f64 + 0.5) * TILE_M)), points)
        }));
        let high = cloud
            .iter()
            .fold(Vector3::zeros(), |high: Vector3<f64>, p| high.sup(&p.coords));
        let views: Vec<View> = (0..PHOTOS[0] * PHOTOS[1])
            .map(|i| {
                let share = [i % PHOTOS[0], i / PHOTOS[0]];
                let at = |a: usize, extent: f64| extent * (f64::from(share[a]) + 0.5) / f64::from(PHOTOS[a]);
                view(i, Point3::new(at(0, high.x), -DISTANCE_M, at(1, high.z)))
            })
            .collect();
        let masks = views.iter().map(mask).collect();
        Self {
            tiles,
            points: cloud.len(),
            views,
            masks,
        }
    }

    /// Labels of all points; units are pairs of a point and a photo.
    pub fn label(self) -> (usize, Vec<f64>) {
        let mut store = MemoryLabels::default();
        let mut masks = self.masks.into_iter();
        let mask = |_| Ok::<_, Infallible>(masks.next());
        let params = TransferParams::default();
        transfer_labels(&self.tiles, &self.views, mask, &mut store, &params, &Silent).unwrap();
        let values = store
            .tiles
            .iter()
            .flat_map(|t| t.stone.iter().zip(&t.confidence))
            .flat_map(|(&stone, &confidence)| [f64::from(stone), f64::from(confidence)]);
        (self.points * self.views.len(), values.collect())
    }
}

/// A photo that looks along y, upright.
fn view(number: u32, centre: Point3<f64>) -> View {
    let axes = Rotation3::from_basis_unchecked(&[
        Vector3::new(1.0, 0.0, 0.0),
        Vector3::new(0.0, 0.0, 1.0),
        Vector3::new(0.0, -1.0, 0.0),
    ]);
    let turn = UnitQuaternion::from_rotation_matrix(&axes);
    View {
        image: ImageId(number),
        name: format!("{number}.jpg"),
        camera: Camera::pinhole(PHOTO_PX[0], PHOTO_PX[1], FOCAL_PX),
        cam_from_world: Rigid3::from_parts(Translation3::from(-(turn * centre.coords)), turn),
    }
}

/// The stone of each pixel's place on the wall, 0 in the joints; numbers are the photo's own.
fn mask(view: &View) -> LabelImage {
    let centre = view.centre();
    let [width, height] = PHOTO_PX;
    let labels = (0..height).flat_map(|y| {
        (0..width).map(move |x| {
            let at = |pixel: u32, side: u32| (f64::from(pixel) + 0.5 - f64::from(side) / 2.0) / FOCAL_PX;
            let place = [
                centre.x + DISTANCE_M * at(x, width),
                centre.z - DISTANCE_M * at(y, height),
            ];
            stone(place)
        })
    });
    LabelImage::from_vec(width, height, labels.collect()).unwrap()
}

/// Every other course is shifted by half a stone.
fn stone([along, up]: [f64; 2]) -> u32 {
    let course = (up / STONE_M[1]).floor();
    let shifted = along
        + if course.rem_euclid(2.0) == 0.0 {
            0.0
        } else {
            STONE_M[0] / 2.0
        };
    let row = (shifted / STONE_M[0]).floor();
    let joint = |value: f64, side: f64| value.rem_euclid(side) < JOINT_M;
    if joint(shifted, STONE_M[0]) || joint(up, STONE_M[1]) {
        return 0;
    }
    (1000.0 * (course + 20.0) + row + 20.0) as u32
}
