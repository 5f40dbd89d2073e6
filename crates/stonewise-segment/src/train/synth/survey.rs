//! The cloud of a rendered photo: what a scanner, a drone or stereo photos would show of its surface.

use super::backdrop::{Backdrop, BackdropKind};
use super::canvas::Canvas;
use super::draw::{Rng, between, chance, log_between, normal, sometimes, stream};
use super::noise::{Field, Grain};
use super::object::{Object, ObjectKind};
use super::scene::{Content, Layer};
use super::style::MasonryStyle;
use super::view::{View, Viewpoint};
use nalgebra::Vector3;
use stonewise_core::geometry::Camera;
use stonewise_core::raster::{RangeImage, ReliefMap};

/// Size of a wall's median stone, metres: bricks to large ashlars.
const STONE_M: [f32; 2] = [0.12, 1.2];
/// Size of a pixel on the wall, metres: close-ups to photos of a whole dam.
const PIXEL_M: [f32; 2] = [0.0008, 0.03];
/// Most points for a pixel of the photo: more change nothing.
const MOST_POINTS: f32 = 1.0;
/// Steps towards the scanner at which its line of sight may be cut, pixels.
const SIGHT_STEPS_PX: [f32; 5] = [1.0, 2.0, 4.0, 8.0, 16.0];

/// Where a cloud comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurveyKind {
    /// A scanner on the ground: dense, exact, blind behind edges.
    Terrestrial,
    /// A scanner in the air: sparse, noisy.
    Drone,
    /// Overlapping photos: dense, smoothed, with holes and waves.
    Stereo,
}

/// A survey of a rendered wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Survey {
    /// Where the cloud comes from.
    pub kind: SurveyKind,
    /// Size of the wall's median stone, metres, 0.12 to 1.2.
    pub stone_m: f32,
    /// Distance between points, metres: 3 to 10 mm from the ground, 15 to 40 mm from the air; of stereo
    /// photos 1 to 3 pixels.
    pub spacing_m: f32,
    /// Standard deviation along the line of sight, metres: 1 to 6 mm from the ground, 5 to 20 mm from the
    /// air; of stereo photos 0.3 to 1.5 pixels, most of it waves.
    pub noise_m: f32,
    /// Shift of the cloud in the photo, pixels, within 1.5 along both axes: the errors of poses and
    /// registration.
    pub shift_px: [f32; 2],
    /// Direction in the photo towards the scanner, radians, and its height over the wall, 0.4 to 1.3 radians.
    pub scanner: [f32; 2],
    /// Share of the wall without points, 0 to 0.5, in half of the surveys none.
    pub gaps: f32,
}

impl Survey {
    /// A survey of this kind, drawn at random.
    pub fn random(kind: SurveyKind, seed: u64) -> Self {
        Self::drawn(kind, &mut stream(seed, 2))
    }

    /// A survey of a kind drawn at random: in two of five cases none, in a quarter a terrestrial scan, in a
    /// fifth one from a drone, in the others a cloud from stereo photos.
    pub fn sometimes(seed: u64) -> Option<Self> {
        let mut rng = stream(seed, 2);
        let kind = match between(&mut rng, 0.0, 1.0) {
            p if p < 0.40 => return None,
            p if p < 0.65 => SurveyKind::Terrestrial,
            p if p < 0.85 => SurveyKind::Drone,
            _ => SurveyKind::Stereo,
        };
        Some(Self::drawn(kind, &mut rng))
    }

    fn drawn(kind: SurveyKind, rng: &mut Rng) -> Self {
        let mut range = |low, high| log_between(rng, low, high);
        let stone_m = range(STONE_M[0], STONE_M[1]);
        // Of stereo photos in pixels, which `relief` takes to metres.
        let (spacing_m, noise_m) = match kind {
            SurveyKind::Terrestrial => (range(0.003, 0.01), range(0.001, 0.006)),
            SurveyKind::Drone => (range(0.015, 0.04), range(0.005, 0.02)),
            SurveyKind::Stereo => (range(1.0, 3.0), range(0.3, 1.5)),
        };
        Self {
            kind,
            stone_m,
            spacing_m,
            noise_m,
            shift_px: [(); 2].map(|()| between(rng, -1.5, 1.5) * between(rng, 0.0, 1.0)),
            scanner: [between(rng, 0.0, std::f32::consts::TAU), between(rng, 0.4, 1.3)],
            gaps: sometimes(rng, 0.5, 0.05, 0.5),
        }
    }

    /// The relief of a painted photo of `size` pixels.
    pub(super) fn relief(
        &self,
        canvas: &Canvas,
        style: &MasonryStyle,
        seed: u64,
        size: [u32; 2],
    ) -> ReliefMap {
        let mut rng = stream(seed, 3);
        let smallest = style
            .layers
            .iter()
            .map(Layer::stone_px)
            .fold(f32::INFINITY, f32::min);
        let stone_px = if smallest.is_finite() { smallest } else { 60.0 };
        let pixel_m = (self.stone_m / stone_px).clamp(PIXEL_M[0], PIXEL_M[1]);
        let scene = Scene::new(style, pixel_m, size, &mut rng);
        let unit = if self.kind == SurveyKind::Stereo {
            pixel_m
        } else {
            1.0
        };

        let (spacing, noise) = (self.spacing_m * unit, self.noise_m * unit);
        let holes = Field::isotropic(&mut rng, Grain::Fractal, 0.4 * size[0].max(size[1]) as f32);
        let waves = Field::isotropic(&mut rng, Grain::Fractal, 40.0);
        // The fractal field has a standard deviation of 1: about this share lies below.
        let threshold = 3.0 * self.gaps - 1.8;
        let per_pixel = (pixel_m / spacing).powi(2).min(MOST_POINTS);
        let [width, height] = size.map(|side| side as f32);
        let count = (per_pixel * width * height) as usize;
        let mut range = RangeImage::new(&scene.camera);

        for _ in 0..count {
            let place = [between(&mut rng, 0.0, width), between(&mut rng, 0.0, height)];
            if self.gaps > 0.0 && holes.at(place[0], place[1]) < threshold {
                continue;
            }
            let error = match self.kind {
                SurveyKind::Stereo => noise * (0.3 * normal(&mut rng) + 0.9 * waves.at(place[0], place[1])),
                _ => noise * normal(&mut rng),
            };
            let Some((_, piece)) = scene.sample(canvas, place) else {
                continue;
            };
            let Some(height_m) = self.seen(&scene, canvas, place, &mut rng) else {
                continue;
            };
            let depth = scene.depth(piece, place, height_m + piece.rough_m * normal(&mut rng)) + error;
            let shown = [0, 1].map(|axis| f64::from(place[axis] + self.shift_px[axis]));
            range.add(shown, f64::from(depth));
        }

        range.relief()
    }

    /// Height over its own wall that the survey gives a place, metres; `None` where it sees nothing.
    fn seen(&self, scene: &Scene, canvas: &Canvas, [x, y]: [f32; 2], rng: &mut Rng) -> Option<f32> {
        let here = scene.height(canvas, [x, y])?;
        match self.kind {
            // Matching compares patches: heights are means over some pixels.
            SurveyKind::Stereo => {
                let mut sum = here;
                for _ in 0..3 {
                    let near = [x + 2.0 * normal(rng), y + 2.0 * normal(rng)];
                    sum += scene.height(canvas, near).unwrap_or(here);
                }
                Some(0.25 * sum)
            }
            SurveyKind::Drone => Some(here),
            SurveyKind::Terrestrial => {
                let [towards, elevation] = self.scanner;
                let (sin, cos) = towards.sin_cos();
                let rise = elevation.tan() * scene.pixel_m;
                let is_cut = |step: &f32| {
                    let other = scene.height(canvas, [x + cos * step, y + sin * step]);
                    other.is_some_and(|other| other > here + rise * step + 0.002)
                };
                (!SIGHT_STEPS_PX.iter().any(is_cut)).then_some(here)
            }
        }
    }
}

/// The painted photo in metres.
struct Scene {
    camera: Camera,
    pixel_m: f32,
    size: [f32; 2],
    pieces: Vec<Piece>,
}

/// Where a layer or an object stands.
#[derive(Clone, Copy)]
struct Piece {
    /// Normal over distance of its plane, 1/m.
    plane: Vector3<f32>,
    /// Before its plane, metres.
    off_m: f32,
    /// Depth of leaves and branches, metres.
    rough_m: f32,
    /// Nothing comes back from the sky and from some openings.
    is_empty: bool,
}

impl Scene {
    fn new(style: &MasonryStyle, pixel_m: f32, size: [u32; 2], rng: &mut Rng) -> Self {
        let main = style
            .layers
            .iter()
            .find_map(viewpoint)
            .unwrap_or(Viewpoint::FRONTAL);
        let focal_px = main.focal * size[0].max(size[1]) as f32;

        let plane = |viewpoint: &Viewpoint| {
            let turned = Viewpoint {
                focal: main.focal,
                distortion: 0.0,
                ..*viewpoint
            };
            View::new(&turned, size[0], size[1]).plane(focal_px) / pixel_m
        };

        let on_the_wall = Piece {
            plane: plane(&main),
            off_m: 0.0,
            rough_m: 0.0,
            is_empty: false,
        };
        let mut pieces = vec![on_the_wall];

        for (i, layer) in style.layers.iter().enumerate() {
            let own = viewpoint(layer).map_or(on_the_wall.plane, |v| plane(&v));
            let off_m = if i == 0 {
                0.0
            } else {
                sometimes(rng, 0.5, -1.0, 0.5)
            };
            let piece = Piece {
                plane: own,
                off_m,
                ..on_the_wall
            };
            pieces.push(match &layer.content {
                Content::Masonry(_) => piece,
                Content::Backdrop(backdrop) => piece.backdrop(backdrop, rng),
            });
        }

        pieces.extend(style.objects.iter().map(|object| on_the_wall.object(object, rng)));
        Self {
            camera: Camera::pinhole(size[0], size[1], f64::from(focal_px)),
            pixel_m,
            size: size.map(|side| side as f32),
            pieces,
        }
    }

    /// The canvas's sample at a place of the photo, and the piece it shows.
    fn sample(&self, canvas: &Canvas, place: [f32; 2]) -> Option<(usize, &Piece)> {
        let inside = (0..2).all(|axis| place[axis] >= 0.0 && place[axis] < self.size[axis]);
        let [x, y] = place.map(|p| (p.max(0.0) * canvas.scale) as usize);
        let i = y.min(canvas.height - 1) * canvas.width + x.min(canvas.width - 1);
        let piece = self.pieces.get(usize::from(canvas.piece[i]))?;
        (inside && !piece.is_empty).then_some((i, piece))
    }

    /// Height over the plane of its own wall, metres.
    fn height(&self, canvas: &Canvas, place: [f32; 2]) -> Option<f32> {
        let (i, piece) = self.sample(canvas, place)?;
        Some(canvas.relief[i] * self.pixel_m + piece.off_m)
    }

    /// Depth of a place of a piece at a height over its plane, metres.
    fn depth(&self, piece: &Piece, place: [f32; 2], height_m: f32) -> f32 {
        let focal = self.camera.focal_px[0] as f32;
        let [x, y] = [0, 1].map(|axis| (place[axis] - 0.5 * self.size[axis]) / focal);
        let inverse = piece.plane.dot(&Vector3::new(x, y, 1.0));
        // Along the ray, a point before the plane by h has 1 - h / distance of its depth.
        (1.0 - height_m * piece.plane.norm()) / inverse
    }
}

impl Piece {
    fn backdrop(self, backdrop: &Backdrop, rng: &mut Rng) -> Self {
        let (off_m, rough_m) = match backdrop.kind {
            BackdropKind::Foliage => (-log_between(rng, 0.1, 5.0), log_between(rng, 0.03, 0.4)),
            BackdropKind::Ground => (-log_between(rng, 0.1, 3.0), log_between(rng, 0.003, 0.05)),
            BackdropKind::Void => (-log_between(rng, 0.1, 2.0), 0.0),
            BackdropKind::Plaster | BackdropKind::Planks => (between(rng, -0.3, 0.3), 0.0),
            BackdropKind::Sky => (0.0, 0.0),
        };
        let is_dark = backdrop.kind == BackdropKind::Void && chance(rng, 0.5);
        Self {
            off_m,
            rough_m,
            is_empty: is_dark || backdrop.kind == BackdropKind::Sky,
            ..self
        }
    }

    fn object(self, object: &Object, rng: &mut Rng) -> Self {
        let (off_m, rough_m) = match object.kind {
            ObjectKind::Railing | ObjectKind::Person | ObjectKind::Building => {
                (log_between(rng, 0.1, 3.0), 0.0)
            }
            ObjectKind::Plant => (log_between(rng, 0.03, 1.0), log_between(rng, 0.01, 0.15)),
            ObjectKind::Pipe => (log_between(rng, 0.01, 0.3), 0.0),
            ObjectKind::Window => (-log_between(rng, 0.02, 0.4), 0.0),
            _ => (0.0, 0.0),
        };
        Self {
            off_m,
            rough_m,
            ..self
        }
    }
}

fn viewpoint(layer: &Layer) -> Option<Viewpoint> {
    match &layer.content {
        Content::Masonry(masonry) => Some(masonry.viewpoint),
        Content::Backdrop(_) => None,
    }
}
