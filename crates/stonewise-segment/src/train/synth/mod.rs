//! Rendered photos of masonry whose stones are known: what the built-in weights learn from.
//!
//! A photo is a wall seen by a camera: a bond laid out in wall coordinates ([`Bond`]), stones that depart
//! from its cells ([`StoneShape`]), their substance and the mortar ([`Material`], [`Mortar`]), a viewpoint
//! ([`Viewpoint`]), light ([`Light`]) and the camera's own marks ([`Camera`]). Nothing is taken from any
//! photo. The stone behind every sample of the canvas is looked up, so the cost goes with the pixels and not
//! with the size of the wall.
//!
//! `stonewise-simulate` draws masonry, too, and the two stay apart. There, one wall of solid stones in metres must meet
//! scanners, cameras and shadows of all epochs at the same surface. Here, hundreds of thousands of photos need bonds,
//! arches, ruins and clutter that no survey needs, and the built-in weights belong to their bytes. As the two share no
//! stone, texture or light, simulated surveys test the detector on walls that it did not learn from.
//!
//! Lengths are pixels of the photo unless a field says otherwise; pixel (0, 0) covers `[0, 1) x [0, 1)`.

mod backdrop;
mod brush;
mod building;
mod camera;
mod canvas;
mod cell;
mod dirt;
mod draw;
mod dry;
mod labels;
mod layout;
mod light;
mod masonry;
mod material;
mod noise;
mod object;
mod rubble;
mod scene;
mod stone;
mod style;
mod survey;
mod view;
mod wall;

pub use backdrop::{Backdrop, BackdropKind};
pub use camera::Camera;
pub use dirt::Dirt;
pub use layout::{Bond, BrickPattern, Courses};
pub use light::{CastShadow, Light};
pub use masonry::{Masonry, Ring};
pub use material::{FaceRelief, Material, Mortar};
pub use object::{Object, ObjectKind};
pub use scene::{Content, Layer, Region};
pub use stone::StoneShape;
pub use style::MasonryStyle;
pub use survey::{Survey, SurveyKind};
pub use view::Viewpoint;
pub use wall::Wall;

use crate::Sample;
use canvas::Canvas;
use draw::Rng;
use rand::SeedableRng;

/// Samples per pixel along an axis.
const CANVAS_SCALE: f32 = 1.5;
/// A photo of masonry drawn from a seed, `width` x `height` pixels (at least 1), with the visible face of
/// every stone.
///
/// Equal seeds and sizes give equal bytes. Cost: 0.3 to 0.5 microseconds a pixel on one core.
pub fn masonry_photo(seed: u64, width: u32, height: u32) -> Sample {
    surveyed_photo_by(None, seed, width, height)
}

/// The photo of [`masonry_photo`] with the relief that a survey gives it.
pub fn surveyed_photo_by(survey: Option<&Survey>, seed: u64, width: u32, height: u32) -> Sample {
    masonry_photo_of(
        &MasonryStyle::random(seed, width, height),
        survey,
        seed,
        width,
        height,
    )
}

/// A photo of masonry of a given style, with the relief that a survey gives it; the seed draws the single
/// stones and the noise.
pub fn masonry_photo_of(
    style: &MasonryStyle,
    survey: Option<&Survey>,
    seed: u64,
    width: u32,
    height: u32,
) -> Sample {
    let mut rng = Rng::seed_from_u64(seed);
    let mut canvas = Canvas::new(width, height, CANVAS_SCALE);
    for layer in &style.layers {
        canvas.current += 1;
        layer.paint(&mut canvas, width, height, &mut rng);
    }
    style.dirt.paint(&mut canvas, &mut rng);
    for object in &style.objects {
        canvas.current += 1;
        object.paint(&mut canvas, &mut rng);
    }
    let relief = survey.map(|survey| survey.relief(&canvas, style, seed, [width, height]));
    let radiance = style.light.shade(&canvas, &mut rng);
    let samples = [canvas.width, canvas.height];
    let pixels = style
        .camera
        .develop(radiance, samples, canvas.scale, [width, height], &mut rng);
    let (labels, ignore) = labels::finish(&canvas, style.camera.blur_px, width, height);
    Sample::from_pixels(width, height, |i| (pixels[i], labels.data()[i], ignore.data()[i]))
        .with_relief(relief)
}
