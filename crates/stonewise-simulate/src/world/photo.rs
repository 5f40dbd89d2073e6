//! Photos of a scene, with the exact label of every pixel.

use crate::world::day::{Day, LaterDays};
use crate::world::face::FacePoint;
use crate::world::lens::{SensorParams, develop};
use crate::world::light::{Light, LightMap};
use crate::world::material::{Painter, on_side};
use crate::world::noise::{Noise, normal};
use crate::world::props::Material;
use crate::world::scene::{Hit, Scene, Target};
use crate::world::tls::about;
use crate::world::wall::Wall;
use nalgebra::{Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use stonewise_core::geometry::{Camera, Distortion, Rigid3, View};
use stonewise_core::id::ImageId;
use stonewise_core::raster::{LabelImage, Raster};

/// Camera and flight of the photos of an epoch.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PhotoParams {
    /// Photos along the wall.
    pub columns: u32,
    /// Photos above each other.
    pub rows: u32,
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Focal length, pixels.
    pub focal_px: f64,
    /// Principal point off the image centre, pixels.
    pub center_offset_px: [f64; 2],
    /// Radial distortion k1, k2, k3 (Brown).
    pub radial: [f64; 3],
    /// Tangential distortion p1, p2, in OpenCV's order.
    pub tangential: [f64; 2],
    /// Distance from the face, metres.
    pub distance_m: f64,
    /// How far the drone strays from its planned place, metres.
    pub placement_m: f64,
    /// Error of the delivered orientation, seen in the image, pixels: half as turn, half as shift.
    pub pose_noise_px: f64,
    /// Whether the last photo of an epoch has no orientation, as happens.
    pub last_unaligned: bool,
    /// Whether photos are rendered; if not they are plain grey, which is quicker and enough where masks are
    /// given.
    pub rendered: bool,
    /// How light, moss and moisture of the later epochs differ from those of the first.
    pub later: LaterDays,
    /// Lens and sensor.
    pub sensor: SensorParams,
}

impl Default for PhotoParams {
    fn default() -> Self {
        Self {
            columns: 3,
            rows: 2,
            width: 1632,
            height: 1224,
            // 24 mm equivalent on four to three would be 1130 px; drones' longer lenses are about twice that.
            focal_px: 2400.0,
            center_offset_px: [-5.0, 14.0],
            radial: [0.02, 0.01, 0.0],
            tangential: [-1.5e-4, 4e-4],
            distance_m: 8.0,
            placement_m: 0.3,
            pose_noise_px: 0.4,
            last_unaligned: false,
            rendered: true,
            later: LaterDays::default(),
            sensor: SensorParams::default(),
        }
    }
}

/// A simulated photo.
#[derive(Clone, Debug)]
pub struct Photo {
    /// The picture, sRGB.
    pub image: Raster<[u8; 3]>,
    /// True stone under each pixel's centre, 0 elsewhere.
    pub labels: LabelImage,
}

/// Places that the drone took photos from, exactly. `names`: `IMG_e001` for the first of epoch e.
pub fn plan_views(wall: &Wall, params: &PhotoParams, epoch: usize, seed: u64) -> Vec<View> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let w = wall.extent();
    let face = &wall.face;
    let (wide, high, foot) = (w[1] - w[0], w[3] - w[2].max(0.0), w[2].max(0.0));

    // Half of the width of the wall that a photo shows.
    let seen = 0.5 * params.distance_m * f64::from(params.width) / params.focal_px;
    let aspect = f64::from(params.height) / f64::from(params.width);
    let mut views = Vec::new();

    for row in 0..params.rows {
        for column in 0..params.columns {
            let mut stray = || params.placement_m * rng.random_range(-1.0..=1.0);
            let share = |k: u32, n: u32| (f64::from(k) + 0.5) / f64::from(n);
            // Photos reach beyond the ends, so that every stone is seen from several sides.
            let a = w[0] - 0.3 * wide.min(6.0) + (wide + 0.6 * wide.min(6.0)) * share(column, params.columns);
            let u = foot + high * (0.25 + 1.0 * share(row, params.rows));
            let from = face.world_of(&FacePoint {
                a: a + stray(),
                u: u + stray(),
                n: params.distance_m + stray(),
            });
            // The picture stays on the section; a section smaller than the picture stays in its middle.
            let aim_a = within(a, [w[0], w[1]], 0.75 * seen);
            let aim_u = within(
                foot + high * share(row, params.rows),
                [foot, w[3]],
                0.75 * seen * aspect,
            );
            let at = face.world_of(&FacePoint {
                a: aim_a + 0.15 * stray(),
                u: aim_u + 0.15 * stray(),
                n: 0.0,
            });
            let roll = 0.01 * normal(&mut rng);
            let number = views.len() as u32;
            views.push(View {
                image: ImageId(number),
                name: format!("IMG_{}{:03}", epoch + 1, number + 1),
                camera: camera(params),
                cam_from_world: look_at(&from, &at, roll),
            });
        }
    }

    views
}

/// Views as a bundle adjustment would deliver them: each a little off.
pub fn disturb_views(views: &[View], params: &PhotoParams, seed: u64) -> Vec<View> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let half = params.pose_noise_px * 0.5f64.sqrt();
    views
        .iter()
        .map(|view| {
            let turn = Vector3::from_fn(|_, _| half / params.focal_px * normal(&mut rng));
            let shift =
                Vector3::from_fn(|_, _| half / params.focal_px * params.distance_m * normal(&mut rng));
            View {
                cam_from_world: view.cam_from_world * about(&view.centre(), turn, shift),
                ..view.clone()
            }
        })
        .collect()
}

/// The part of the section that a photo shows, and a margin around it: smallest a, largest a, smallest u,
/// largest u, metres; `None` where it shows nothing of the section.
pub fn shown_part(wall: &Wall, view: &View) -> Option<[f64; 4]> {
    const STEPS: u32 = 12;
    const MARGIN_M: f64 = 1.5;
    let extent = wall.extent();
    let mut part = [f64::MAX, f64::MIN, f64::MAX, f64::MIN];
    for j in 0..=STEPS {
        for i in 0..=STEPS {
            let share = |k: u32, size: u32| f64::from(size) * f64::from(k) / f64::from(STEPS);
            let pixel = [share(i, view.camera.width), share(j, view.camera.height)];
            let met = view
                .ray(pixel)
                .and_then(|(from, along)| wall.face.meet(&from, &along, 300.0));
            if let Some(f) = met {
                part = [
                    part[0].min(f.a),
                    part[1].max(f.a),
                    part[2].min(f.u),
                    part[3].max(f.u),
                ];
            }
        }
    }
    let inside = [
        (part[0] - MARGIN_M).max(extent[0]),
        (part[1] + MARGIN_M).min(extent[1]),
        (part[2] - MARGIN_M).max(extent[2]),
        (part[3] + MARGIN_M).min(extent[3]),
    ];
    (inside[0] < inside[1] && inside[2] < inside[3]).then_some(inside)
}

/// The true stone under each pixel's centre, 0 elsewhere, without taking the photo: a third of its cost.
pub fn true_labels(scene: &Scene, view: &View) -> LabelImage {
    let (width, height) = (view.camera.width, view.camera.height);
    let mut labels = LabelImage::filled(width, height, 0);
    let stone = |x: usize, y: usize| {
        let (from, along) = view.ray([x as f64 + 0.5, y as f64 + 0.5])?;
        scene.target_of(&from, &along)?.stone()
    };
    labels
        .data_mut()
        .par_chunks_mut(width as usize)
        .enumerate()
        .for_each(|(y, row)| {
            for (x, label) in row.iter_mut().enumerate() {
                *label = stone(x, y).map_or(0, |s| s.0);
            }
        });
    labels
}

/// The light and the look of one epoch; photos of the epoch share it.
pub struct Studio<'a> {
    scene: &'a Scene<'a>,
    light: Light,
    map: LightMap,
    painter: Painter,
    bump: Noise,
    seed: u64,
}

impl<'a> Studio<'a> {
    /// Sets up the light of a day. Cost: about a microsecond for every 25 mm^2 of wall.
    pub fn new(scene: &'a Scene<'a>, day: &Day) -> Self {
        let wall_seed = scene.wall().params().seed;
        Self {
            map: LightMap::new(scene, &day.light),
            light: day.light.clone(),
            scene,
            painter: Painter::new(wall_seed, day),
            bump: Noise::new(wall_seed, 300),
            seed: day.seed,
        }
    }

    /// Takes a photo. The same bytes for any number of threads. Cost: about a microsecond and a half a pixel.
    pub fn photograph(&self, view: &View, sensor: &SensorParams) -> Photo {
        let (width, height) = (view.camera.width, view.camera.height);
        let rows: Vec<Vec<(Sample, u32)>> = (0..height)
            .into_par_iter()
            .map(|y| {
                (0..width)
                    .map(|x| self.sample(view, [f64::from(x) + 0.5, f64::from(y) + 0.5]))
                    .collect()
            })
            .collect();
        let mut labels = LabelImage::filled(width, height, 0);
        for (label, (_, stone)) in labels.data_mut().iter_mut().zip(rows.iter().flatten()) {
            *label = *stone;
        }
        let mut light = Raster::filled(width, height, [0.0f32; 3]);
        light
            .data_mut()
            .par_chunks_mut(width as usize)
            .enumerate()
            .for_each(|(y, out)| self.smooth_row(view, &rows, y, out));
        let meter = meter(&rows, &light);
        let seed = Noise::new(self.seed, 70)
            .uniform(u64::from(view.image.0))
            .to_bits();
        Photo {
            image: develop(&light, meter, sensor, seed),
            labels,
        }
    }

    /// A row of light, with four samples where neighbours differ in kind.
    fn smooth_row(&self, view: &View, rows: &[Vec<(Sample, u32)>], y: usize, out: &mut [[f32; 3]]) {
        let kind = |x: usize, y: usize| rows[y][x].0.kind;
        let (width, height) = (out.len(), rows.len());
        for (x, light) in out.iter_mut().enumerate() {
            *light = rows[y][x].0.light;
            let here = kind(x, y);
            let differs = (x + 1 < width && kind(x + 1, y) != here)
                || (y + 1 < height && kind(x, y + 1) != here)
                || (x > 0 && kind(x - 1, y) != here)
                || (y > 0 && kind(x, y - 1) != here);
            if !differs {
                continue;
            }
            for (dx, dy) in [(0.2, 0.3), (0.8, 0.2), (0.3, 0.8), (0.7, 0.7)] {
                let more = self.sample(view, [x as f64 + dx, y as f64 + dy]).0.light;
                for (sum, v) in light.iter_mut().zip(more) {
                    *sum += v;
                }
            }
            *light = light.map(|v| v / 5.0);
        }
    }

    fn sample(&self, view: &View, pixel: [f64; 2]) -> (Sample, u32) {
        let Some((from, along)) = view.ray(pixel) else {
            return (
                Sample {
                    light: [0.0; 3],
                    kind: 0,
                },
                0,
            );
        };
        let Some(hit) = self.scene.trace(&from, &along) else {
            return (self.sky(&along), 0);
        };
        let stone = hit.target.stone().map_or(0, |s| s.0);
        let (lit, open) = self.reach(&hit);
        let normal = self.bumped(&hit);
        let colour = self.painter.colour(self.scene.wall(), &hit);
        let incoming = self.light.on(&normal, lit, open);
        let light = std::array::from_fn(|c| (colour[c] * incoming[c]) as f32);
        let kind = match hit.target {
            Target::Stone(i, _) => 100 + i as u32,
            Target::Other(material, _) => 1 + material as u32,
        };
        (Sample { light, kind }, stone)
    }

    fn sky(&self, along: &Vector3<f64>) -> Sample {
        let up = along.z.clamp(0.0, 1.0).sqrt();
        let low = [0.58, 0.66, 0.74];
        let high = [0.20, 0.33, 0.58];
        let cloud =
            (0.5 + 1.2 * self.bump.octaves(3.0 * along.y + 3.0, 9.0 * along.z, 5, 0.55)).clamp(0.0, 1.0);
        let light = std::array::from_fn(|c| {
            let clear = low[c] + (high[c] - low[c]) * up;
            (clear + (0.72 - clear) * 0.7 * cloud) as f32
        });
        Sample { light, kind: 0 }
    }

    /// Share of the sun and of the sky that reach a place.
    fn reach(&self, hit: &Hit) -> (f64, f64) {
        match hit.target {
            Target::Stone(..) | Target::Other(Material::Mortar, _) => {
                let [lit, open] = self.map.at(&self.scene.wall().face.face_of(&hit.point));
                (lit, open)
            }
            Target::Other(material, _) => {
                let start = hit.point + hit.normal * 0.004;
                let lit = !self.scene.blocked(&start, &self.light.sun, 20.0);
                let open = match material {
                    Material::Leaf => 0.75,
                    // Under the wall's foot the ground sees half the sky.
                    Material::Ground => (0.55 + 0.3 * hit.point.x).clamp(0.5, 1.0),
                    _ => 0.9,
                };
                (f64::from(u8::from(lit)), open)
            }
        }
    }

    /// The normal with the roughness that is too fine for the geometry.
    fn bumped(&self, hit: &Hit) -> Vector3<f64> {
        let (x, y, size, strength) = match hit.target {
            Target::Stone(i, [x, y]) => (x + i as f64 * 3.1, y, 0.016, 0.55),
            Target::Other(Material::Mortar, [a, u]) => (a, u, 0.011, 0.55),
            Target::Other(Material::Ground, _) => (hit.point.x, hit.point.y, 0.04, 0.9),
            Target::Other(Material::Bank, _) => {
                let [s, t] = on_side(hit);
                (s, t, 0.09, 2.4)
            }
            Target::Other(..) => return hit.normal,
        };
        let turn = |k: f64| strength * self.bump.octaves(x / size + k, y / size - k, 3, 0.8);
        (hit.normal + Vector3::new(0.5 * turn(90.0), turn(0.0), turn(37.0))).normalize()
    }
}

/// Light that comes along a ray, and what kind of thing sent it.
#[derive(Clone, Copy)]
struct Sample {
    light: [f32; 3],
    kind: u32,
}

/// Mean light of everything but the sky.
fn meter(rows: &[Vec<(Sample, u32)>], light: &Raster<[f32; 3]>) -> f64 {
    let (sum, count) = rows
        .iter()
        .flatten()
        .zip(light.data())
        .filter(|((sample, _), _)| sample.kind != 0)
        .fold((0.0, 0usize), |(s, n), (_, l)| (s + f64::from(l[1]), n + 1));
    if count == 0 { 1.0 } else { sum / count as f64 }
}

fn camera(params: &PhotoParams) -> Camera {
    let [k1, k2, k3] = params.radial;
    let centre = |size: u32, offset: f64| f64::from(size) / 2.0 + offset;
    Camera {
        width: params.width,
        height: params.height,
        focal_px: [params.focal_px; 2],
        center_px: [
            centre(params.width, params.center_offset_px[0]),
            centre(params.height, params.center_offset_px[1]),
        ],
        skew_px: 0.0,
        distortion: Distortion::brown([k1, k2, k3, 0.0], [0.0; 3], params.tangential),
        near: None,
    }
}

/// The value, moved to at least `margin` from both ends, or to the middle where there is no such place.
fn within(value: f64, ends: [f64; 2], margin: f64) -> f64 {
    if ends[1] - ends[0] <= 2.0 * margin {
        0.5 * (ends[0] + ends[1])
    } else {
        value.clamp(ends[0] + margin, ends[1] - margin)
    }
}

/// Pose of a camera at `from` that looks at `at`, turned about its view by `roll`.
fn look_at(from: &Point3<f64>, at: &Point3<f64>, roll: f64) -> Rigid3 {
    let forward = (at - from).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let down = forward.cross(&right);
    let level = Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()]);
    let turned =
        Rotation3::from_axis_angle(&Vector3::z_axis(), roll) * Rotation3::from_matrix_unchecked(level);
    let rotation = UnitQuaternion::from_rotation_matrix(&turned);
    Rigid3::from_parts(Translation3::from(-(rotation * from.coords)), rotation)
}
