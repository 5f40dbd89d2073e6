//! Rendered photos of masonry whose stones are known: what the built-in weights learn from.
//!
//! A photo is a wall seen by a camera: a bond laid out in wall coordinates ([`Bond`]), stones that depart from its cells
//! ([`StoneShape`]), their substance and the mortar ([`Material`], [`Mortar`]), a viewpoint ([`Viewpoint`]), light
//! ([`Light`]) and the camera's own marks ([`Camera`]). Nothing is taken from any photo. Every pixel of the canvas asks for
//! the stone behind it, so the cost goes with the pixels and not with the size of the wall.
//!
//! Lengths are pixels of the photo unless a field says otherwise; pixel (0, 0) covers `[0, 1) x [0, 1)`.

mod camera;
mod canvas;
mod draw;
mod labels;
mod layout;
mod light;
mod material;
mod noise;
mod stone;
mod view;
mod wall;

pub use camera::Camera;
pub use layout::{Bond, BrickPattern, Courses};
pub use light::{CastShadow, Light};
pub use material::{FaceRelief, Material, Mortar};
pub use stone::StoneShape;
pub use view::Viewpoint;
pub use wall::Wall;

use crate::Sample;
use canvas::Canvas;
use draw::Rng;
use rand::SeedableRng;
use view::View;

/// Samples per pixel along an axis.
const CANVAS_SCALE: f32 = 1.5;
/// Smallest and largest median size of a photo's stones, pixels; single stones are smaller and larger.
const STONE_PX: [f32; 2] = [13.0, 220.0];

/// Everything that is drawn for a photo, but for the single stones.
#[derive(Clone, Debug, PartialEq)]
pub struct MasonryStyle {
    /// Where the camera stands.
    pub viewpoint: Viewpoint,
    /// The wall.
    pub wall: Wall,
    /// The light on it.
    pub light: Light,
    /// What camera and file format do.
    pub camera: Camera,
}

impl MasonryStyle {
    /// A style for a photo of `width` x `height` pixels, in which the largest stones are no larger than the photo.
    pub fn random(seed: u64, width: u32, height: u32) -> Self {
        // A stream apart from that of the single stones.
        let mut rng = Rng::seed_from_u64(seed);
        rng.set_stream(1);
        let largest = STONE_PX[1].min(0.6 * width.min(height) as f32).max(STONE_PX[0]);
        Self {
            viewpoint: Viewpoint::random(&mut rng),
            wall: Wall::random(&mut rng, STONE_PX[0], largest),
            light: Light::random(&mut rng),
            camera: Camera::random(&mut rng),
        }
    }
}

/// A photo of masonry drawn from a seed, `width` x `height` pixels (at least 1), with the visible face of every stone.
///
/// The same seed and size give the same bytes. Cost: about 0.4 microseconds a pixel on one core.
pub fn masonry_photo(seed: u64, width: u32, height: u32) -> Sample {
    masonry_photo_of(&MasonryStyle::random(seed, width, height), seed, width, height)
}

/// A photo of masonry of a given style; the seed draws the single stones and the noise.
pub fn masonry_photo_of(style: &MasonryStyle, seed: u64, width: u32, height: u32) -> Sample {
    let mut rng = Rng::seed_from_u64(seed);
    let mut canvas = Canvas::new(width, height, CANVAS_SCALE);
    let view = View::new(&style.viewpoint, width, height);
    let region = vec![true; canvas.label.len()];
    style.wall.paint(&mut canvas, &view, &region, &mut rng);
    let radiance = style.light.shade(&mut canvas, &mut rng);
    let samples = [canvas.width, canvas.height];
    let pixels = style
        .camera
        .develop(radiance, samples, canvas.scale, [width, height], &mut rng);
    let (labels, ignore) = labels::finish(&canvas, width, height);
    Sample::from_pixels(width, height, |i| (pixels[i], labels.data()[i], ignore.data()[i]))
}
